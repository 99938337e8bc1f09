"""Close approaches of craft that lost their thrust between impulses or during one.

Between impulses a path is one natural motion, whenever thrust is lost there.  One plane is for a failure at
its start, after which nothing more is fired.  Another is for a failure at its end, before which all of it is
fired.  During an impulse the failures form a chord; the impulse is treated as a brief burn, so that each
failure has an instant of its own.                                                           # theory (74)
"""

from collections.abc import Callable, Iterator
from itertools import count
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.motion.arc import END, IMPULSE, MEAN_MOTION, PUSH, START, STATE, WIDTH
from closeform.motion.chief_orbit import ChiefOrbit
from closeform.motion.orbit import Orbit
from closeform.planning.delta_v.checks import Checked, drifting
from closeform.planning.delta_v.dual.fleet import BRIEF
from closeform.planning.delta_v.firing_times import Moments
from closeform.planning.energy.side_search import MARGINS
from closeform.planning.passive.certification import failures
from closeform.planning.passive.failure_minima import find_failures
from closeform.planning.problem.problem import Problem, Trajectories
from closeform.planning.problem.scene import Contacts
from closeform.zones.shapes import BALL
from closeform.zones.zone import scaled_norm

ROOM = 600  # capacity for minima, for each pair
TOUCHING = 1.02  # zones: a plane that is farther away is not a contact
REACH = 1.4  # zones, within which a minimum becomes a plane
AMID = (np.arange(32) + 0.5) / 32  # shares of an impulse after which thrust is lost
OPEN = 1e-3  # share of a chord near its ends that counts as the end
INSIDE = 1.0 - 1e-12  # largest norm that counts as inside
BESIDE = np.array([0.02, 0.05])  # of a craft's time: tolerances of instants and times for a replacement
CELLS = np.array([0.01, 0.02])  # cells of which only the nearest plane is kept


class ImpulseFailures:
    """Loss of thrust in one problem; `holding` keeps active planes without a replacement."""

    holding = False

    def __init__(self, problem: Problem, safe_starts: Callable[[float], Iterator[Contacts]]) -> None:
        self.safe_starts = safe_starts
        self.known: dict[float, tuple[list[Contacts], Iterator[Contacts]]] = {}
        self.problem, self.scene = problem, problem.seen
        self.room = Contacts.none(ROOM * (1 + len(problem.pairs)))
        self.norms = np.empty(self.room.number)
        self.unshifted = np.zeros((len(self.scene.states), 6))
        self.lengths = problem.base[:, END] - problem.base[:, START]

    def checked(self, trajectories: Trajectories, known: Contacts) -> Checked:
        """Return conflicts of paths and close approaches of failed craft, also from `known` contacts.

        The absence of conflicts is certified.
        """
        problem, whole = self.problem, self.problem.whole(trajectories)
        missed = problem.conflicts(whole)
        lost, nearest = self.near(trajectories, known)
        if nearest >= 1.0 and not missed:
            certain = failures(problem, problem.path(trajectories), problem.bodies(whole))
            if certain.number:
                lost, nearest = self.near(trajectories, known.joined(certain))
                nearest = min(nearest, INSIDE)
        return Checked(missed, lost, nearest, [])

    def touching(self, trajectories: Trajectories, contacts: Contacts) -> tuple[Contacts, bool]:
        """Return the contacts that paths touch, moved onto the chords of impulses, and whether all touch."""
        wide = self.brief(trajectories)
        lasting = np.ptp(wide[0][self.rows_of(wide, contacts), START : END + 1], axis=1)
        amid = np.flatnonzero(drifting(contacts) & (lasting < 3.0 * BRIEF * self.lengths.max()))
        placed, _ = self.placed(wide, contacts.some(amid))
        contacts.drifts[amid], contacts.normals[amid] = placed.drifts, placed.normals
        places = self.problem.motions(wide, contacts)[:, 0]
        kinds = self.problem.kinds[contacts.which]
        sizes = [scaled_norm(self.problem.zones[kind], q) for kind, q in zip(kinds, places, strict=True)]
        along = (contacts.normals * places).sum(axis=1)
        touched = np.where(self.problem.with_errors(contacts), along, sizes) < TOUCHING
        return contacts.some(np.flatnonzero(touched)), bool(touched.all())

    def starts(self, margin: float = MARGINS[0]) -> Iterator[Contacts]:
        """Yield contacts of passively safe paths of minimum energy, for zones enlarged by a margin.

        Each path is sought once, whichever solver asks for it.
        """
        found, others = self.known.setdefault(margin, ([], self.safe_starts(margin)))
        for k in count():
            if k == len(found):
                another = next(others, None)
                if another is None:
                    return
                found.append(another)
            yield found[k]

    def brief(self, trajectories: Trajectories) -> Trajectories:
        """Return the paths with impulses as brief burns, amid which thrust may be lost."""
        arcs, offsets = trajectories
        own = [
            widened(self.problem.orbit, arcs[offsets[i] : offsets[i + 1]], BRIEF * self.lengths[i])
            for i in range(self.problem.count)
        ]
        starts = np.concatenate([[0], np.cumsum([len(rows) for rows in own])])
        return self.problem.with_obstacles(np.concatenate(own), starts)

    def near(self, trajectories: Trajectories, known: Contacts) -> tuple[Contacts, float]:
        """Return planes at close approaches of failed craft, and the smallest norm.

        With `holding`, `known` planes that no new one replaces are included.
        """
        wide = arcs, offsets = self.brief(trajectories)
        own = offsets[: self.problem.count + 1]
        craft, moments = self.failed(known), []
        for i in range(self.problem.count):
            rows = arcs[own[i] : own[i + 1]]
            burning = rows[:, PUSH : PUSH + 3].any(axis=1)
            coasts = rows[~burning, START : END + 1].mean(axis=1)
            amid = rows[burning, START, None] + AMID * np.ptp(rows[burning, START : END + 1], axis=1)[:, None]
            moments.append(np.concatenate([coasts, amid.ravel(), lost_at(known)[craft == i]]))
        most = max(map(len, moments))
        table = np.array([np.pad(row, (0, most - len(row)), mode="edge") for row in moments])
        self.problem.effort.used += most * len(self.scene.times) * len(self.scene.pairs)
        motion = self.problem._own_rows(wide)
        number = find_failures(self.scene, *motion, table, self.unshifted, REACH, self.room, self.norms)
        planes, nearest = self.planes(wide, self.room.first(number), self.norms[:number].copy())
        if self.holding:
            planes = planes.joined(known.some(self.unlike(known, planes)))
        return planes, nearest

    def planes(self, wide: Trajectories, found: Contacts, norms: Floats) -> tuple[Contacts, float]:
        """Return planes for the coasts and impulses of the failures found, and the smallest norm."""
        arcs, rows, side, lost = wide[0], self.rows_of(wide, found), side_of(found), lost_at(found)
        start, end, burning = arcs[rows, START], arcs[rows, END], arcs[rows, PUSH : PUSH + 3].any(axis=1)
        over = found.times > end  # contact after the arc in which thrust was lost
        later, amid = over & ~burning, over & burning
        middle = later & (np.abs(lost - 0.5 * (start + end)) < 1e-9 * (end - start))
        first, last, chords = found.some(middle), found.some(middle), found.some(amid)
        first.drifts[np.arange(first.number), side[middle]] = first.times - start[middle]
        last.drifts[np.arange(last.number), side[middle]] = last.times - end[middle]
        chords, sizes = self.placed(wide, chords)
        share = (lost_at(chords) - start[amid]) / (end - start)[amid]
        within = (share > OPEN) & (share < 1.0 - OPEN)
        groups = [found.some(later & ~middle), first, last, chords.some(within)]
        planes = groups[0].joined(first).joined(last).joined(groups[3])
        kinds = np.repeat(np.arange(4), [group.number for group in groups])
        each = norms[later & ~middle], norms[middle], norms[middle], sizes[within]
        order = np.argsort(np.concatenate(each), kind="stable")  # the nearest first
        cells = np.rint(self.instants(planes) / CELLS)
        key = np.column_stack([planes.which, side_of(planes), kinds, cells])[order]
        _, once = np.unique(key, axis=0, return_index=True)
        nearest = norms[over].min(initial=np.inf)
        return planes.some(order[once]), float(nearest)

    def unlike(self, known: Contacts, planes: Contacts) -> Any:
        """Return the mask (K,) of known contacts that no plane replaces."""
        same = (known.which[:, None] == planes.which) & (side_of(known)[:, None] == side_of(planes))
        apart = np.abs(self.instants(known)[:, None] - self.instants(planes))
        return ~(same & (apart < BESIDE).all(axis=2)).any(axis=1)

    def instants(self, contacts: Contacts) -> Floats:
        """Return the times (K, 2) of loss of thrust and contact, in units of the longest duration."""
        return np.column_stack([lost_at(contacts), contacts.times]) / float(self.lengths.max())

    def placed(self, wide: Trajectories, found: Contacts) -> tuple[Contacts, Floats]:
        """Return failures during burns, moved to the nearest points of their chords, and the norms there."""
        rows, side = self.rows_of(wide, found), side_of(found)
        start, end = wide[0][rows, START], wide[0][rows, END]
        ball = self.scene.shapes[self.problem.kinds[found.which]] == BALL
        lost = [np.where(found.drifts > 0.0, (found.times - at)[:, None], 0.0) for at in (start, end)]
        both = found.joined(found)._replace(drifts=np.concatenate(lost))
        ends = np.split(self.problem.motions(wide, both)[:, 0], 2)
        chord = ends[1] - ends[0]
        square = (chord * chord).sum(axis=1)
        nearest = -(ends[0] * chord).sum(axis=1) / np.where(square > 0.0, square, 1.0)
        share = np.where(ball, np.clip(nearest, 0.0, 1.0), (lost_at(found) - start) / (end - start))
        placed = found.drifts.copy()
        placed[np.arange(found.number), side] = found.times - start - share * (end - start)
        place = ends[0] + share[:, None] * chord
        size = np.linalg.norm(place, axis=1)[:, None]
        outward = place / np.where(size > 0.0, size, 1.0)
        turned = np.where(ball[:, None] & (size > 0.0), outward, found.normals)
        return found._replace(drifts=placed, normals=turned), (turned * place).sum(axis=1)

    def merged(
        self, contacts: Contacts, before: list[Moments], impulses: Floats, after: list[Moments]
    ) -> Contacts:
        """Return the contacts for fewer moments `after`, each of which replaces the nearest of `before`.

        A loss of thrust among the replaced moments becomes one during their replacement, after the same
        fraction.
        """
        craft, drifts = self.failed(contacts), contacts.drifts.copy()
        for k in np.flatnonzero(contacts.drifts.any(axis=1)):
            i, side = craft[k], int(np.argmax(contacts.drifts[k]))
            lost, brief = contacts.times[k] - contacts.drifts[k, side], BRIEF * self.lengths[i]
            whole = np.linalg.norm(impulses[i, : len(before[i].times)], axis=1)
            begun, ended = before[i].burns(brief).T
            begins, ends = after[i].burns(brief).T
            given = whole * np.clip((lost - begun) / (ended - begun), 0.0, 1.0)
            owner = np.abs((begun + ended)[:, None] - (begins + ends)).argmin(axis=1)
            total = np.bincount(owner, whole, len(begins))
            share = np.bincount(owner, given, len(begins)) / np.where(total > 0.0, total, 1.0)
            part = total * ((share > OPEN) & (share < 1.0 - OPEN))
            if part.any():
                m = part.argmax()
                lost = begins[m] + share[m] * (ends[m] - begins[m])
            else:
                low = np.max(ends[(total > 0.0) & (share >= 1.0 - OPEN)], initial=-np.inf)
                high = np.min(begins[(total > 0.0) & (share <= OPEN)], initial=np.inf)
                lost = min(max(lost, low), high)
            drifts[k, side] = max(contacts.times[k] - lost, 0.0)
        return contacts._replace(drifts=drifts)

    def failed(self, contacts: Contacts) -> Any:
        """Return the body (K,) that lost its thrust."""
        return self.problem.pairs[contacts.which, side_of(contacts)]

    def rows_of(self, wide: Trajectories, found: Contacts) -> Any:
        """Return the arc (K,) of the failed craft in which its thrust was lost."""
        arcs, offsets = wide
        craft, lost = self.failed(found), lost_at(found)
        rows = np.empty(found.number, dtype=np.int64)
        for i in np.unique(craft):
            starts, own = arcs[offsets[i] : offsets[i + 1], START], craft == i
            rows[own] = offsets[i] + np.maximum(np.searchsorted(starts, lost[own], "right") - 1, 0)
        return rows


def side_of(contacts: Contacts) -> Any:
    """Return which body (K,) of each pair failed."""
    return np.argmax(contacts.drifts, axis=1)


def lost_at(contacts: Contacts) -> Floats:
    """Return the times (K,) of loss of thrust."""
    lost: Floats = contacts.times - contacts.drifts.max(axis=1)
    return lost


def widened(orbit: Orbit | ChiefOrbit, rows: Floats, brief: float) -> Floats:
    """Return arcs of one craft with impulses as burns of duration 2 `brief` about their times.

    A burn is shorter where the motion of the chief is not known before its impulse, or after it.
    """
    found: list[Floats] = []
    fires: Any = rows[:, IMPULSE : IMPULSE + 3].any(axis=1)
    known = orbit.chief.span if isinstance(orbit, ChiefOrbit) else (-np.inf, np.inf)
    times = rows[fires, START, None]
    spans = np.clip(times + np.array([-brief, brief]), *known)
    burns = zip(spans, orbit.transition(spans - times, times), strict=True)
    for row, burning in zip(rows, fires, strict=True):
        coast = row.copy()
        if burning:
            push, state = row[IMPULSE : IMPULSE + 3], row[STATE : STATE + 6]
            (begin, end), (back, ahead) = next(burns)
            if found:
                found[-1][END] = begin
            burn = np.zeros(WIDTH)
            burn[[START, END, MEAN_MOTION]] = begin, end, row[MEAN_MOTION]
            burn[STATE : STATE + 6] = back @ (state - np.concatenate([np.zeros(3), push]))
            burn[PUSH : PUSH + 3] = push / (end - begin)
            coast[IMPULSE : IMPULSE + 3] = 0.0
            coast[START], coast[END] = end, max(row[END], end)
            coast[STATE : STATE + 6] = ahead @ state
            found.append(burn)
        found.append(coast)
    return np.array(found)
