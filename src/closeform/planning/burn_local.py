"""Burns of least delta-v within thrust limits that keep all pairs clear: in slots, cut where thrust begins.

As with impulses, but a craft's time is cut into slots, in each of which it may thrust within its limit,
constantly.  Where a slot is used in part it is cut there for the next round, where it is used it is cut
fine, so that thrust comes to be full or none, along the primer.                              # theory 6
"""

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from itertools import product
from math import ceil, inf, pi, sqrt
from typing import Any, Self

import numpy as np

from closeform.arrays import Floats
from closeform.fuel.pulses import extended
from closeform.fuel.thrusters import Thrusters
from closeform.motion.arc import END, START
from closeform.motion.impulse_arcs import flown_arcs
from closeform.motion.path import Path
from closeform.motion.reduced import LOWER
from closeform.motion.saturated import BOUND
from closeform.motion.within_limit import TooLittleThrust, limited
from closeform.planning.firing_times import Moments, pushes_table, sizes_of, some_of_each
from closeform.planning.impulse_alone import answers_alone
from closeform.planning.impulse_checks import Failures, Spent
from closeform.planning.impulse_descent import cleared
from closeform.planning.impulse_local import FEWER, FIRED, IDLE, LAST, WIDEST, ImpulseSolver
from closeform.planning.problem import Problem
from closeform.planning.scene import Contacts

SLOTS, A_TURN = 24, 60  # of a craft's time, and more of them for each orbit
FINE = 0.03  # rad of the orbit: slots in which thrust is to follow a primer that turns
FINEST = 1.0 / 64.0  # of a craft's time, of which they are no more
BRIEFEST = 1e-6  # of a craft's time: no slot is shorter
USED, FULL = 1e-6, 0.98  # of what a slot allows: more is thrust, or all of it
BESIDE = 0.1  # of a burn: the slots next to it
TOUCHING = 1e-9  # of a craft's time: burns no further apart are one
FURTHER = 1e-5  # of a zone: planes moved out, that fewer slots are clear of it
ALONE = 8  # rounds in which burns settle where nothing is in the way
ROOMY = 1.05  # times as long as at the limit are burns about impulses, that they have room to change
SHORT = 1e-4  # of a craft's time: burns no longer are as good as impulses
LEVELS, CLOSER = 14, 1.07  # limits that are tried on the way to a limit, and how close together at least


class BurnSolver(ImpulseSolver):
    """Solves one problem from any contacts, by burns within limits (N,) [m/s^2], where inf by impulses."""

    def __init__(
        self,
        problem: Problem,
        limits: Floats,
        thrusters: Sequence[Thrusters | None],
        names: Sequence[str],
        failures: Failures | None = None,
    ) -> None:
        super().__init__(problem, thrusters, names, failures)
        self.limits = np.where(np.isfinite(limits), limits, 0.0)
        self.enough = inf  # times these limits, within which safe burns were found on the way to the limits
        spans = problem.base[:, [START, END]]
        self.times = np.ptp(spans, axis=1)
        turns = problem.orbit.mean_motion * self.times / (2.0 * pi)
        self.edges = [
            np.linspace(start, end, SLOTS + ceil(A_TURN * own) + 1)
            for (start, end), own in zip(spans, turns, strict=True)
        ]
        slots = map(Moments.slots, self.edges)
        self.grid = [
            own if limit else times for own, times, limit in zip(slots, self.grid, self.limits, strict=True)
        ]

    def unconstrained(self) -> Spent:
        """The least delta-v of each craft by itself within its limit, whatever is in the way.

        Raises TooLittleThrust for a craft whose limit is shown to be too low, and ValueError for one whose
        thrusters cannot make its transfer.
        """
        problem, paths, least = self.problem, [], 0.0
        for i, limit in enumerate(self.limits):
            task = problem.orbit.mean_motion, problem.base[i : i + 1], self.finals[i : i + 1]
            found = answers_alone(*task, self.thrusters[i : i + 1], self.names[i : i + 1])
            if limit:
                try:
                    arcs, _, _, facts = limited(*task, limit, sparing=True)
                except TooLittleThrust as weak:
                    weak.which = i
                    alone = None if weak.needed > 0.0 else self.alone()
                    if alone is None:
                        raise
                    return alone
                least += float(max(facts[0, BOUND], found[0, LOWER]))
            else:
                arcs, _ = flown_arcs(*task, found)
                least += float(found[0, LOWER])
            path = Path(problem.orbit, arcs, np.array([0, len(arcs)]), ())
            paths.append(extended(path, problem.first, problem.arrival))
        flown, spent = problem.with_path(*paths), float(sum(path.delta_v for path in paths))
        none = [Moments.slots(np.empty(1))] * problem.count
        impulses = np.empty((problem.count, 0, 3))
        checked = self.checked(flown, Contacts.none())
        return Spent(flown, spent, least, checked, Contacts.none(), 1.0, none, impulses, none)

    def alone(self) -> Spent | None:
        """The same by slots, with the bound of impulses, where the limit is not shown to be enough."""
        found = self.priced(self.grid, Contacts.none(), WIDEST, inf)
        for _ in range(ALONE):
            if found is None:
                return None
            found = self.priced(self.following(found), Contacts.none(), LAST, inf)
        return found and replace(found, least=super().unconstrained().least)

    def tightened(self, safe: Spent) -> Spent | None:
        """Clear burns within the limits near to safe paths by impulses, or by what burns the limits allow.

        Where those about impulses are not safe, and no step makes them so, limits come down to what they are
        from where they are, the way there being halved until it leads on.  `enough` tells how far they came.
        """
        sizes = [own[own > 0.0] for own in sizes_of(safe.impulses)]
        short = [own.max(initial=0.0) / (SHORT * time) for own, time in zip(sizes, self.times, strict=True)]
        limited = self.limits > 0.0
        reached = max(1.0, float((np.array(short)[limited] / self.limits[limited]).max()))
        tried = 1.0
        for _ in range(LEVELS):
            solver = self.within(tried)
            near = solver.about(safe)
            found = None if near is None else cleared(solver, near)
            if found is not None:
                if tried == 1.0:
                    return found
                self.enough = reached = tried
                safe, tried = found, 1.0
            elif reached < CLOSER * tried:
                break
            else:
                tried = sqrt(tried * reached)
        return None

    def within(self, factor: float) -> Self:
        """The same within so many times the limits."""
        other = copy(self)
        other.limits = factor * self.limits
        return other

    def about(self, paths: Spent) -> Spent | None:
        """Paths whose impulses or burns are burns a little below the limits about the same times.

        Burns in each other's way are moved apart by as little as it takes; None where time is too short.
        """
        moments, pushes = [], []
        for i, (own, given) in enumerate(zip(paths.fired(0.0), paths.impulses, strict=True)):
            sizes = np.linalg.norm(given, axis=1)
            given, sizes, limit = given[sizes > 0.0], sizes[sizes > 0.0], self.limits[i]
            if limit:
                lengths = np.maximum(ROOMY * sizes / limit, BRIEFEST * self.times[i])
                first, last = self.edges[i][[0, -1]]
                if lengths.sum() > last - first:
                    return None
                begins = apart(own.times + 0.5 * (own.widths - lengths), lengths, sizes, first, last)
                pieces = np.ceil(lengths / self.fine(i)).astype(int)
                widths, before = np.repeat(lengths / pieces, pieces), np.cumsum(pieces) - pieces
                within = np.arange(pieces.sum()) - np.repeat(before, pieces)
                starts = np.repeat(begins, pieces) + within * widths
                own = Moments(starts, np.zeros(len(starts), dtype=np.int64), widths)
                given = np.repeat(given / pieces[:, None], pieces, axis=0)
            moments.append(own)
            pushes.append(given)
        return self.fired_at(moments, pushes_table(pushes), paths)

    def fine(self, i: int) -> float:
        """How long slots of a craft are at most where it burns [s]."""
        n = self.problem.orbit.mean_motion
        return float(min(FINEST * self.times[i], FINE / n) if n > 0.0 else FINEST * self.times[i])

    def following(self, found: Spent) -> list[Moments]:
        """The slots of the next round, cut where thrust begins and ends."""
        sizes, following = sizes_of(found.impulses), super().following(found)
        for i, slots in enumerate(found.moments):
            if self.limits[i]:
                shares = sizes[i, : len(slots.times)] / (self.limits[i] * slots.widths)
                edges = self.cut(i, burn_times(slots, shares, found.peaks[i].times))
                following[i] = Moments.slots(edges)
        return following

    def cut(self, i: int, burns: Floats) -> Floats:
        """The edges (J + 1,) of a craft's slots, fine in and beside its `burns` (B, 2)."""
        whole, brief = self.times[i], BRIEFEST * self.times[i]
        first, last = self.edges[i][[0, -1]]
        fine = self.fine(i)
        edges, open_edges = [], self.edges[i]
        for start, end in without_gaps(burns, TOUCHING * whole):
            if end - start < brief:
                start, end = 0.5 * (start + end) + np.array([-0.5, 0.5]) * brief
            beside = min(max(BESIDE * (end - start), brief), fine)
            edges += [np.linspace(start, end, ceil((end - start) / fine) + 1), [start - beside, end + beside]]
            open_edges = open_edges[(open_edges < start - 1.5 * beside) | (open_edges > end + 1.5 * beside)]
        every = np.unique(np.clip(np.concatenate([[first, last], open_edges, *edges]), first, last))
        kept: Floats = every[np.diff(every, prepend=-inf) > 0.5 * brief]
        kept[-1] = last
        return kept

    def focused(self, best: Spent) -> Spent:
        """As it is: what rounds come to is full or none."""
        return best

    def fewest(self, best: Spent) -> Spent:
        """The same without burns hardly used, where that is clear; what these did the others do longer."""
        for share, further in product((FIRED, IDLE), (0.0, FURTHER)):
            used, start = self.with_neighbours(best, share), replace(best, margin=best.margin + further)

            def kept(_: Spent, used: list[Moments] = used) -> list[Moments]:
                return used

            found = next(self.refired(start, kept, 1.0 + FEWER, steady=True), None)
            if found is not None and found.delta_v <= (1.0 + FEWER) * best.delta_v:
                return found
        return best

    def with_neighbours(self, best: Spent, share: float) -> list[Moments]:
        """When each craft fires more than a share of all, with the slots next to those; they are one burn."""
        large = sizes_of(best.impulses) > share * best.delta_v
        near = large.copy()
        near[:, 1:] |= large[:, :-1]
        near[:, :-1] |= large[:, 1:]
        return some_of_each(best.moments, np.where(self.limits[:, None] > 0.0, near, large))

    def settled(self, best: Spent) -> Contacts:
        """The contacts with the multipliers of the last round, whose slots are fine where craft burn."""
        return best.contacts


def burn_times(slots: Moments, shares: Floats, peaks: Floats) -> Floats:
    """Where a craft burns (B, 2): slots as far as they are used, on the side of their neighbour.

    Without one about the time, of `peaks`, when its primer is longest.
    """
    around = np.pad(shares, 1)
    found = []
    for j in np.flatnonzero(shares > USED):
        start, width = slots.times[j], slots.widths[j]
        length = width * (shares[j] if shares[j] < FULL else 1.0)
        before, after = around[j], around[j + 2]
        if after > max(before, USED):
            start += width - length
        elif before <= USED:
            inside = peaks[(peaks >= start) & (peaks <= start + width)]
            middle = inside[0] if len(inside) else start + 0.5 * width
            start = min(max(middle - 0.5 * length, start), start + width - length)
        found.append((start, start + length))
    return np.array(found).reshape(-1, 2)


def apart(begins: Floats, lengths: Floats, weights: Floats, first: float, last: float) -> Floats:
    """When burns (B,) of some lengths begin so that none is in the way of another, nor before the first time.

    Near to `begins`, in the mean square by weights; all of them fit.
    """
    from scipy.optimize import isotonic_regression  # half a second to import

    if not len(begins):
        return begins
    ahead = np.cumsum(lengths) - lengths
    found = isotonic_regression(begins - ahead, weights=weights).x
    moved: Floats = np.clip(found, first, last - lengths.sum()) + ahead
    return moved


def without_gaps(burns: Floats, apart: float) -> list[list[Any]]:
    """Burns (B, 2) in order, those no further apart as one."""
    found: list[list[Any]] = []
    for start, end in burns:
        if found and start - found[-1][1] <= apart:
            found[-1][1] = end
        else:
            found.append([start, end])
    return found
