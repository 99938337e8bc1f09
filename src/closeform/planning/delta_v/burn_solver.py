"""Burns of minimum delta-v within thrust limits that keep all pairs clear, on adaptive time slots.

As with impulses, but a craft's time is divided into slots with constant thrust within the limit.  A
slot that is used in part is cut for the next round, and used slots are refined, so that the thrust converges
to full or zero along the primer.                                                             # theory 6
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from itertools import product
from math import ceil, inf, pi
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from closeform.arrays import Floats
from closeform.fuel.pulses import extended
from closeform.fuel.thrusters import Thrusters
from closeform.motion.arc import END, START
from closeform.motion.minimum_delta_v.impulse_arcs import impulse_trajectories
from closeform.motion.minimum_delta_v.reduced import LOWER
from closeform.motion.minimum_delta_v.saturated import BOUND, NEEDED, UNDECIDED
from closeform.motion.minimum_delta_v.within_limit import TooLittleThrust, limited
from closeform.motion.path import Path
from closeform.planning.delta_v.checks import Spent
from closeform.planning.delta_v.dual.fleet import POINTS, WEIGHTS
from closeform.planning.delta_v.firing_times import Moments, pushes_table, sizes_of, some_of_each
from closeform.planning.delta_v.impulse_descent import cleared, tightened
from closeform.planning.delta_v.impulse_solver import (
    FEWER,
    FIRED,
    IDLE,
    SMALL,
    SMALL_SHARE,
    ImpulseSolver,
)
from closeform.planning.delta_v.unconstrained import answers_alone
from closeform.planning.problem.problem import Closest, Problem, Trajectories
from closeform.planning.problem.scene import Contacts

if TYPE_CHECKING:
    from closeform.planning.delta_v.thrust_loss import ImpulseFailures

SLOTS, A_TURN = 24, 60  # of a craft's time, and additional ones for each orbit
BRIEF_BURNS = 4.0  # times the peak of continuous thrust: above it burns are brief enough to replace impulses
PARTS = 1, 4  # of a slot, for continuous thrust: the second where the first leads too far into zones
FINE = 0.03  # rad of the orbit: maximum slot with thrust along a turning primer
FINEST = 1.0 / 64.0  # of a craft's time: upper limit of these slots
BRIEFEST = 1e-6  # of a craft's time: no slot is shorter
USED, FULL = 1e-6, 0.98  # of a slot's maximum: above these a slot is used, or full
THROTTLED = 0.1  # of a limit: a slot with less thrust is judged by itself, not as a part of its burn
BESIDE = 0.1  # of a burn: length of the slots next to it
TOUCHING = 1e-9  # of a craft's time: burns no further apart are merged
FURTHER = 1e-5  # of a zone: distance by which planes move out so that fewer slots stay clear
ROOMY = 1.05  # duration of burns relative to full thrust, which leaves a reserve
SHORT = 1e-4  # of a craft's time: shorter burns are as good as impulses


class BurnSolver(ImpulseSolver):
    """Solver of one problem by burns within limits (N,) [m/s^2], with impulses where a limit is inf."""

    def __init__(
        self,
        problem: Problem,
        limits: Floats,
        thrusters: Sequence[Thrusters | None],
        names: Sequence[str],
        failures: ImpulseFailures | None = None,
    ) -> None:
        super().__init__(problem, thrusters, names, failures)
        self.limits = np.where(np.isfinite(limits), limits, 0.0)
        self.enough = inf  # smallest factor of the limits with which safe burns were found
        spans = problem.base[:, [START, END]]
        self.times = np.ptp(spans, axis=1)
        turns = problem.orbit._rate * self.times / (2.0 * pi)
        self.edges = [
            self.requirements.with_edges(i, problem.orbit._spaced(start, end, SLOTS + ceil(A_TURN * own) + 1))
            for i, ((start, end), own) in enumerate(zip(spans, turns, strict=True))
        ]
        slots = map(Moments.slots, self.edges)
        self.grid = [
            own if limit else times for own, times, limit in zip(slots, self.grid, self.limits, strict=True)
        ]

    def unconstrained(self) -> Spent:
        """Return the minimum delta-v of each craft alone within its limit, without keep-out zones.

        Raises TooLittleThrust if a craft's limit is proven to be too low, and ValueError if its thrusters
        cannot perform its transfer.
        """
        problem, paths, least = self.problem, [], 0.0
        if problem.beside is not None:  # switching burns without slots are known for Hill's equations only
            alone = self.alone()
            if alone is None:
                words = "no burns within the thrust limit were found; raise it, or allow more time"
                raise TooLittleThrust(words, int(self.limits.argmax()), np.full(NEEDED + 1, UNDECIDED))
            return alone
        for i, limit in enumerate(self.limits):
            ends = problem.base[i : i + 1], self.finals[i : i + 1]
            own = self.thrusters[i : i + 1], self.names[i : i + 1]
            found, task = answers_alone(problem.orbit, *ends, *own), (problem.orbit.mean_motion, *ends)
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
                arcs, _ = impulse_trajectories(*task, found)
                least += float(found[0, LOWER])
            path = Path(problem.orbit, arcs, np.array([0, len(arcs)]), ())
            paths.append(extended(path, problem.first, problem.arrival))
        trajectories, spent = problem.with_path(*paths), float(sum(path.delta_v for path in paths))
        none = [Moments.slots(np.empty(1))] * problem.count
        impulses = np.empty((problem.count, 0, 3))
        checked = self.checked(trajectories, Contacts.none())
        return Spent(trajectories, spent, least, checked, Contacts.none(), 1.0, none, impulses, none)

    def alone(self) -> Spent | None:
        """Return the unconstrained optimum on slots, with the bound of impulses; None without one."""
        found = super().alone()
        if found is None:
            return None
        impulses = ImpulseSolver(self.problem, self.thrusters, self.names)
        return replace(found, least=impulses.unconstrained().least)

    def tightened(self, safe: Spent) -> Spent | None:
        """Return clear burns within the limits near safe impulsive paths; None without any.

        Where burns at the impulses are not safe and cannot be made so by short steps, the limits are reduced
        gradually from higher ones.  `enough` is set to the smallest factor that was reached.
        """
        sizes = [own[own > 0.0] for own in sizes_of(safe.impulses)]
        short = [own.max(initial=0.0) / (SHORT * time) for own, time in zip(sizes, self.times, strict=True)]
        limited = self.limits > 0.0
        reached = max(1.0, float((np.array(short)[limited] / self.limits[limited]).max()))
        found, self.enough = tightened(self.tried, safe, reached)
        return found

    def instead_of(self, trajectories: Trajectories, known: Spent) -> Spent | None:
        """Return clear burns near clear paths of continuous thrust; None without any, or for high limits.

        A thrust slightly above the limits is reduced gradually.
        """
        peaks = self.problem.path(trajectories).peak_thrust
        if not (self.limits > 0.0).all() or (self.limits > BRIEF_BURNS * peaks).all():
            return None
        reached = float(max((peaks / self.limits).max(), 1.0))
        for parts in PARTS:
            near = self.staircase(trajectories, parts, known)
            found = cleared(self, near) if reached == 1.0 else None
            found = found or tightened(self.tried, near, ROOMY * reached)[0]
            if found is not None:
                return found
        return None

    def staircase(self, trajectories: Trajectories, parts: int, known: Spent) -> Spent:
        """Return burns with the mean thrust of paths in each slot of the grid, cut into equal parts."""
        moments, pushes = [], []
        for k, edges in enumerate(self.edges):
            number = np.arange(parts * (len(edges) - 1) + 1) / parts
            own = Moments.slots(np.interp(number, np.arange(len(edges)), edges))
            middles = own.times[:, None] + own.widths[:, None] * np.array(POINTS)
            thrust = self.problem.path(trajectories)[k].thrust(middles.ravel()).reshape(*middles.shape, 3)
            moments.append(own)
            pushes.append(own.widths[:, None] * np.einsum("p,jpa->ja", np.array(WEIGHTS), thrust))
        return self.fired_at(moments, pushes_table(pushes), known)

    def tried(self, factor: float, safe: Spent) -> tuple[Self, Spent] | None:
        """Return the solver for `factor` times the limits, and its burns near safe paths, if they fit."""
        solver = self.within(factor)
        near = solver.about(safe)
        return None if near is None else (solver, near)

    def within(self, factor: float) -> Self:
        """Return the solver for `factor` times the limits."""
        other = copy(self)
        other.limits = factor * self.limits
        other.closest = self.closest if factor == 1.0 else Closest()
        return other

    def about(self, paths: Spent) -> Spent | None:
        """Return paths with burns slightly below the limits at the times of given impulses or burns.

        Overlapping burns are moved apart by as little as necessary; None where the time is too short.
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
        """Return the maximum duration [s] of slots in which a craft burns."""
        n = self.problem.orbit._rate
        return float(min(FINEST * self.times[i], FINE / n) if n > 0.0 else FINEST * self.times[i])

    def following(self, found: Spent) -> list[Moments]:
        """Return the slots of the next round, cut where burns begin and end.

        Thrust that alternates between sides of a cone would cut them without end; its slots stay.
        """
        if self.requirements.steer:
            return found.moments
        sizes, following = sizes_of(found.impulses), super().following(found)
        for i, slots in enumerate(found.moments):
            if self.limits[i]:
                shares = sizes[i, : len(slots.times)] / (self.limits[i] * slots.widths)
                edges = self.cut(i, burn_times(slots, shares, found.peaks[i].times))
                following[i] = Moments.slots(edges)
        return following

    def cut(self, i: int, burns: Floats) -> Floats:
        """Return the edges (J + 1,) of a craft's slots, refined in and near its `burns` (B, 2)."""
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
        """Return the solution unchanged: the rounds already converge to full or zero thrust."""
        return best

    def fewest(self, best: Spent) -> Spent:
        """Return the solution without insignificant burns if that is clear; longer burns replace them."""
        for share, further in product((FIRED, IDLE), (0.0, FURTHER)):
            large = sizes_of(best.impulses) > share * best.cost
            used, start = self.kept(best, large), replace(best, margin=best.margin + further)

            found = self.refired_at(used, start, 1.0 + FEWER)
            if found is not None and found.cost <= (1.0 + FEWER) * best.cost:
                return found
        return best

    def kept(self, best: Spent, left: Any) -> list[Moments]:
        """Return each craft's slots in a mask (N, J), and unused or insignificant slots next to them."""
        near = left.copy()
        near[:, 1:] |= left[:, :-1]
        near[:, :-1] |= left[:, 1:]
        near &= left | ~self.small(best)
        return some_of_each(best.moments, np.where(self.limits[:, None] > 0.0, near, left))

    def small(self, found: Spent) -> Any:
        """Return which slots (N, J) are burns too small to be planned, or throttled parts of burns."""
        sizes = sizes_of(found.impulses)
        for i in np.flatnonzero(self.limits):
            own, row = found.moments[i], sizes[i, : len(found.moments[i].times)]
            apart = np.abs(own.times[1:] - own.times[:-1] - own.widths[:-1]) > TOUCHING * self.times[i]
            used = row > THROTTLED * self.limits[i] * own.widths
            burns = np.cumsum(np.append(True, apart | (used[1:] != used[:-1])))
            row[used] = np.bincount(burns, row)[burns][used]
        return (sizes > 0.0) & (sizes < min(SMALL, SMALL_SHARE * found.cost))

    def settled(self, best: Spent) -> Contacts:
        """Return the contacts with the multipliers of the last round, whose slots are already fine."""
        return best.contacts


def burn_times(slots: Moments, shares: Floats, peaks: Floats) -> Floats:
    """Return the burns (B, 2) in slots: used parts, next to a used neighbour.

    Without such a neighbour a burn is centred on a maximum of the primer in `peaks`.
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
    """Return the start times (B,) of burns without overlap, after `first` and before `last`.

    They are nearest to `begins` in the weighted mean square; all burns fit.
    """
    from scipy.optimize import isotonic_regression  # half a second to import

    if not len(begins):
        return begins
    ahead = np.cumsum(lengths) - lengths
    found = isotonic_regression(begins - ahead, weights=weights).x
    moved: Floats = np.clip(found, first, last - lengths.sum()) + ahead
    return moved


def without_gaps(burns: Floats, apart: float) -> list[list[Any]]:
    """Return the burns (B, 2) in order, with those merged that are at most `apart` apart."""
    found: list[list[Any]] = []
    for start, end in burns:
        if found and start - found[-1][1] <= apart:
            found[-1][1] = end
        else:
            found.append([start, end])
    return found
