"""Joint shaping: the least-energy paths of many craft around each other, by forces at contacts.

A round solves the quadratic program of the known contacts (the zones' supporting planes there),
deflects all paths by its forces, and lets every contact slide to where its two paths now come
closest.  A contact that slid far keeps its old time beside the new one, which damps the
rounds.  Once paths are nearly clear, Newton's method takes the contacts to the conditions of optimality;
where a path hugs a zone for a while it has no single contact to go to, and the planes are
raised by the little that is missing.  The cheapest clear draft is never lost.    # theory 4, "many craft"
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.motion.arc import END, MEAN_MOTION, START
from closeform.planning.joint import answers, compliances, seen
from closeform.planning.meetings import dips, sample, settle
from closeform.planning.newton import SMALL, TOUCHING, conditions
from closeform.planning.pressing import press
from closeform.planning.task import Contacts, Flown, Task

ROUNDS, HOPELESS = 60, 15  # rounds, and those without getting nearer to clear that are waited for
SAMPLES = 64  # of a craft's time, between which a dip may be missed until the march finds it
A_TURN = 16  # samples of each turn of the orbit, where that is more
SAME = 1e-3  # of the time in which a pair can give way: contacts that are closer are one
SOFT, FADE = 1e-2, 0.3  # how far contacts give way at first, and how fast that fades: normals turn meanwhile
CLOSE = 0.05  # how little normals and times change in a round before Newton's method is tried
NEARLY = 1e-2  # how deep inside the zone a draft may be to be raised out of it
ENOUGH, STEADY = 1e-6, 1e-6  # depth and relative change of energy at which rounds end
NEWTON = 12  # steps
RAISES = 4
GIVEN_UP = 1.5  # times the energy to beat
TOO_FAR = 1e5  # zones that a contact alone would push its craft
MEET = 1e-9  # norm below which two craft meet and no side of the zone is nearer
TINY = 1e-300
PINNED = 1e-9  # a contact this near to the aim after Newton's method is on it

Sides = Callable[["Planner", Contacts, Floats], Floats]  # normals of new contacts at their motions


@dataclass(frozen=True, eq=False)
class Draft:
    """Paths, the contacts that shape them, and the energy beyond the unconstrained optima.

    `clear`: no dip below the aim was seen.  `settled`: the conditions of optimality hold.
    """

    contacts: Contacts
    flown: Flown
    energy: float
    clear: bool
    settled: bool


class Planner:
    """Relaxes contacts for one task at one aim, `margin` zones; boxes are balls of a `power` norm."""

    def __init__(
        self, task: Task, margin: float, power: float, rounding: float = 1.0, which: Any = None
    ) -> None:
        """`which`: the pairs whose boxes are rounded, all unless given; a ball `rounding` times as large."""
        self.task = task
        rounded = (
            task.boxes.copy() if which is None else task.boxes & np.isin(np.arange(len(task.pairs)), which)
        )
        self.powers = np.where(rounded, power, np.where(task.boxes, np.inf, 2.0))
        self.aims = margin * np.where(rounded, rounding, 1.0)
        widths = np.array([np.linalg.norm(np.linalg.inv(zone.matrix), 2) for zone in task.zones])
        self.radii = widths[task.kinds] * np.where(task.boxes, np.sqrt(3.0), 1.0)
        self.times = samples(task)
        self.spans = task.windows[:, 1] - task.windows[:, 0]

    def relaxed(self, contacts: Contacts, sides: Sides, bar: float = np.inf) -> Draft:
        """The cheapest clear draft that contacts lead to, else the last draft.

        Given up where it costs well above `bar` when nearly clear.
        """
        best: Draft | None = None
        before, close = np.inf, CLOSE
        least, latest = np.inf, 0
        for turn in range(ROUNDS):
            harder, energy = self.pressed(contacts, 1.0, SOFT * FADE**turn)
            contacts = harder if energy < np.inf else self.pressed(contacts, 1.0, SOFT)[0]
            flown = self.task.flown(contacts)
            there = self.slid(flown, contacts)
            shift = np.abs(there.times - contacts.times) / self.spans[contacts.which]
            turned = np.abs(there.normals - contacts.normals).max(axis=1, initial=0.0)
            moved = max(shift.max(initial=0.0), turned.max(initial=0.0))
            found = self.dips(flown)
            fresh = self.fresh(flown, found, there, sides)
            short = self.shortfall(found)
            if short < max(least, NEARLY):
                least, latest = short, turn
            elif turn - latest > HOPELESS:
                break
            if short < NEARLY:
                if energy > GIVEN_UP * bar:
                    break
                if not len(fresh) and moved < close:
                    polished = self.polished(self.merged(there))
                    if polished is not None:
                        return polished if best is None else min(polished, best, key=lambda one: one.energy)
                    close = 0.5 * moved
                raised = self.raised(contacts, short)
                if raised is not None and (best is None or raised.energy < best.energy):
                    best = raised
                energy = raised.energy if raised is not None else np.inf
                if best is not None and short < ENOUGH and abs(energy - before) <= STEADY * energy:
                    return best
                before = energy
            old = contacts.some(shift > SAME)  # beside the new time
            old = replace(old, normals=self.normals(self.motions(flown, old), old.which))
            contacts = self.merged(there.joined(old)).joined(fresh)
        return best or self.draft(contacts, clear=False)

    def pressed(self, contacts: Contacts, lift: float, soft: float = 0.0) -> tuple[Contacts, float]:
        """Contacts with the forces that keep the paths `lift` times the aim away, and the energy of that.

        Idle ones go.  The energy is inf where contacts ask for what cannot be together: their forces
        grow beyond all bounds.
        """
        if not len(contacts):
            return contacts, 0.0
        reach = np.einsum("ki,ki->k", contacts.normals, self.motions(self.task.direct, contacts)[:, 0])
        gaps = self.aims[contacts.which] * lift - reach
        gram, force = self.gram(contacts), np.zeros(len(contacts))
        press(gram, gaps, contacts.force > 0.0, soft, force)
        possible = bool(np.isfinite(force).all() and (force * gram.diagonal() < TOO_FAR).all())
        energy = 0.5 * float(force @ gram @ force) if possible else np.inf
        pressing = Contacts(contacts.which, contacts.times, contacts.normals, force).some(force > 0.0)
        return pressing, energy if energy >= 0.0 else np.inf

    def slid(self, flown: Flown, contacts: Contacts) -> Contacts:
        """Contacts where their pairs come closest, downhill from where they are."""
        task, which, times = self.task, contacts.which, contacts.times.copy()
        settle(*flown, task.pairs[which], task.forms[which], self.powers[which], task.windows[which], times)
        there = replace(contacts, times=times)
        motions = self.motions(flown, there)
        apart = self.norms(motions[:, 0], which) > MEET
        turned = np.where(apart[:, None], self.normals(motions, which), contacts.normals)
        return replace(there, normals=np.ascontiguousarray(turned))

    def fresh(self, flown: Flown, found: Floats, contacts: Contacts, sides: Sides) -> Contacts:
        """New contacts, without force, at dips that no contact is near."""
        which = found[:, 0].astype(np.int64)
        new = Contacts.unpressed(which, np.clip(found[:, 1], *self.task.windows[which].T))
        near = np.abs(new.times[:, None] - contacts.times) < 2.0 * SAME * self.spans[contacts.which]
        new = new.some(~((which[:, None] == contacts.which) & near).any(axis=1))
        return replace(new, normals=sides(self, new, self.motions(flown, new))) if len(new) else new

    def nearest(self, flown: Flown, which: Any, times: Floats) -> Contacts:
        """Contacts of pairs at times, without force, on the sides on which paths pass."""
        new = Contacts.unpressed(which, np.clip(times, *self.task.windows[which].T))
        return replace(new, normals=self.normals(self.motions(flown, new), which))

    def merged(self, contacts: Contacts) -> Contacts:
        """One contact for those of a pair that have come together, at the time of the hardest pressed."""
        ordered = contacts.some(np.lexsort((contacts.times, contacts.which)))
        new = np.ones(len(ordered), dtype=bool)
        new[1:] = np.diff(ordered.which) > 0
        new[1:] |= np.diff(ordered.times) >= SAME * self.spans[ordered.which[1:]]
        if new.all():
            return contacts
        group = np.cumsum(new) - 1
        hardest = np.lexsort((ordered.force, group))
        last = np.flatnonzero(np.append(np.diff(group[hardest]) > 0, True))
        return replace(
            ordered.some(hardest[last]), force=np.asarray(np.bincount(group, ordered.force), dtype=float)
        )

    def raised(self, contacts: Contacts, short: float) -> Draft | None:
        """A clear draft with the contacts where they are, aimed a little higher; None where there is none."""
        lift = 1.0
        for _ in range(RAISES):
            lift += 1.5 * short + 1e-11
            higher, energy = self.pressed(contacts, lift)
            if energy == np.inf:
                return None
            flown = self.task.flown(higher)
            short = self.shortfall(self.dips(flown))
            if short == 0.0:
                return Draft(higher, flown, energy, clear=True, settled=False)
            if short > NEARLY:
                return None
        return None

    def polished(self, contacts: Contacts) -> Draft | None:
        """The draft that meets the conditions of optimality to rounding; None where Newton's method fails."""
        if not len(contacts):
            return self.draft(contacts, settled=True)
        task, which, count = self.task, contacts.which, len(contacts)
        forms, powers, aims = task.forms[which], self.powers[which], self.aims[which]
        early, late = task.windows[which].T
        pinned = (contacts.times <= early) | (contacts.times >= late)
        durations = np.where(pinned, 0.0, self.spans[which])
        points = self.motions(task.flown(contacts), contacts)[:, 0]
        points = points * (aims / self.norms(points, which))[:, None]
        jacobian, rhs = np.empty((5 * count, 5 * count)), np.empty(5 * count)
        for _ in range(NEWTON):
            flown = task.flown(contacts)
            motions = self.motions(flown, contacts)
            jacobian[:] = rhs[:] = 0.0
            scalars, vectors = (powers, aims, contacts.force), (contacts.normals, points)
            error = conditions(
                *self.answers(contacts), forms, scalars, vectors, motions, durations, jacobian, rhs
            )
            if 0.0 <= error < TOUCHING:
                deep = self.shortfall(self.dips(flown)) > PINNED
                return None if deep else self.draft(contacts, settled=True)
            if not 0.0 <= error < 10.0:
                return None
            step = (rhs if count <= SMALL else solved(jacobian, rhs)).reshape(count, 5)
            points = points + step[:, :3]
            force, times = contacts.force + step[:, 3], contacts.times + step[:, 4]
            if not ((force > 0.0) & (early <= times) & (times <= late)).all():
                return None
            normals = self.normals(points[:, None], which)
            contacts = replace(contacts, force=force, times=times, normals=normals)
        return None

    def draft(self, contacts: Contacts, clear: bool = True, settled: bool = False) -> Draft:
        """The paths under the contacts' forces."""
        energy = 0.5 * float(contacts.force @ self.gram(contacts) @ contacts.force)
        return Draft(contacts, self.task.flown(contacts), energy, clear, settled)

    def dips(self, flown: Flown) -> Floats:
        """Rows (pair, time, norm) of the dips below the aim that samples show."""
        task = self.task
        states = np.empty((len(flown[1]) - 1, len(self.times), 6))
        sample(*flown, self.times, states)
        found = np.empty((4 * len(task.pairs) + 64, 3))
        zones = task.forms, self.radii, self.powers, self.aims
        count = dips(*flown, self.times, states, task.pairs, *zones, found)
        return found[: min(count, len(found))]

    def shortfall(self, found: Floats) -> float:
        """By how much the deepest of the dips misses the aim, as a share of it."""
        return float((1.0 - found[:, 2] / self.aims[found[:, 0].astype(np.int64)]).max(initial=0.0))

    def gram(self, contacts: Contacts) -> Floats:
        """Compliance between the contacts along their normals (K, K)."""
        task, count = self.task, len(contacts)
        along = np.einsum("kji,kj->ki", task.forms[contacts.which], contacts.normals, order="C")
        gram = np.empty((count, count))
        compliances(task.base, task.inverses, task.pairs[contacts.which], contacts.times, along, gram)
        return gram

    def answers(self, contacts: Contacts) -> tuple[Any, Floats, Floats]:
        """Links (L, 2) of contacts that share craft, what a force at m does at k (L, 6, 3), and its rate."""
        task, pairs = self.task, self.task.pairs[contacts.which]
        movers = np.where(pairs < len(task.base), pairs, -1)
        shared = (movers[:, None, :, None] == movers[None, :, None, :]) & (movers >= 0)[:, None, :, None]
        links = np.ascontiguousarray(np.argwhere(shared.any(axis=(2, 3))))
        blocks, rates = np.empty((len(links), 6, 3)), np.empty((len(links), 6, 3))
        answers(task.base, task.inverses, pairs, contacts.times, links, blocks, rates)
        return links, blocks, rates

    def rounded(self, contacts: Contacts) -> bool:
        """Whether some contact is with a box."""
        return bool(self.task.boxes[contacts.which].any())

    def motions(self, flown: Flown, contacts: Contacts) -> Floats:
        """Relative position, velocity and acceleration (K, 3, 3) at the contacts, in zone coordinates."""
        out = np.zeros((len(contacts), 3, 3))
        which = contacts.which
        seen(*flown, self.task.pairs[which], contacts.times, self.task.forms[which], out)
        return out

    def norms(self, places: Floats, which: Any) -> Floats:
        """Norms (K,) of places in zone coordinates (K, 3)."""
        powers = self.powers[which]
        size = np.abs(places).max(axis=1, initial=TINY)
        shares = np.abs(places) / size[:, None]
        return np.asarray(size * (shares ** powers[:, None]).sum(axis=1) ** (1.0 / powers))

    def normals(self, motions: Floats, which: Any) -> Floats:
        """Gradients (K, 3) of the norms at motions (K, >= 1, 3)."""
        places = motions[:, 0]
        shares = np.abs(places) / np.maximum(self.norms(places, which), TINY)[:, None]
        return np.ascontiguousarray(np.sign(places) * shares ** (self.powers[which][:, None] - 1.0))


def solved(matrix: Floats, rhs: Floats) -> Floats:
    """Solution of many equations, each with few unknowns."""
    from scipy.sparse import csc_matrix
    from scipy.sparse.linalg import splu

    try:
        return np.asarray(splu(csc_matrix(matrix)).solve(rhs))
    except RuntimeError:  # singular
        return np.full(len(rhs), np.nan)


def samples(task: Task) -> Floats:
    """Times that cover every craft's own time, and every turn of the orbit."""
    spans = np.unique([*task.base[:, [START, END]], [task.first, task.last]], axis=0)
    turns = task.base[0, MEAN_MOTION] * np.ptp(spans, axis=1) / (2.0 * np.pi)
    each = np.maximum(SAMPLES / np.sqrt(len(spans)), A_TURN * turns).astype(int) + 1
    grids = [np.linspace(start, end, count) for (start, end), count in zip(spans, each, strict=True)]
    return np.unique(np.concatenate(grids))
