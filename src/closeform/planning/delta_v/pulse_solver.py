"""Pulses of on-off thrusters near safe impulses, with durations that give their delta-v.

A round solves the planes for pulses with the durations of the round before.  Then each pulse gets the
duration of its own delta-v, and thrust is lost amid it.  The paths are therefore those of the executed
pulses, and the zones need no extra margin.  Pulses below the minimum impulse bit of their thruster are
omitted, the smallest first, and the others compensate.  Where that costs more, they give their bit, and the
program is that of the rest.                                                          # theory (38), (74)
"""

from copy import copy
from dataclasses import replace
from math import inf, sqrt
from typing import Any, Self

import numpy as np

from closeform.arrays import Floats
from closeform.fuel.pulses import extended, pulsed_path
from closeform.fuel.thrusters import Thrusters
from closeform.motion.arc import END, START, STATE
from closeform.motion.path import Path
from closeform.planning.delta_v.burn_solver import apart
from closeform.planning.delta_v.checks import Spent
from closeform.planning.delta_v.dual.fleet import Fleet, Planes
from closeform.planning.delta_v.firing_times import Moments, pushes_table, sizes_of, some_of_each
from closeform.planning.delta_v.impulse_descent import cleared, descended, tightened
from closeform.planning.delta_v.impulse_solver import AIM, LAST, ImpulseSolver, Program, gains_of
from closeform.planning.delta_v.minimum_bits import SPARE, effects
from closeform.planning.loop import moved_out
from closeform.planning.problem.problem import Trajectories
from closeform.planning.problem.scene import Contacts

REPAIRS, MET = 8, 1e-13  # corrections of the ends, and the accepted error, of delta-v
WITHIN = 1e-9  # of a craft's time: distance of pulses from its ends, for rounding
DEPENDENT = 1e-9  # of the largest singular value: below it pulses have no effect
ROOM = 1e-3  # of a zone: reserve of planes for pulses that change with the craft's mass
STRONGER = 1e3  # times the thrust: pulses as short as impulses
STRIDE = 0.3  # zones, maximum displacement of a pair in a step
DEARER = 1.001  # times the cost: maximum without a pulse below its bit; otherwise it gives its bit
RAISED = 0.5  # of the largest pulse below its bit: smaller ones are omitted
ADDED, REPLACED = 12, 1.02  # rounds with further planes, and the maximum cost of bits
LEFT_OUT = 40  # maximum rounds that omit pulses below a bit
PART = 3  # fraction 1 / PART of those below a bit that is omitted at a time


class PulseSolver(ImpulseSolver):
    """Solver of another solver's problem near its impulses, by pulses of on-off thrusters.

    Moments are the centres of the pulses.
    """

    stronger = 1.0  # factor of the thrust
    fired_by: list[Thrusters]  # of each craft
    now: list[Moments]  # of the current pulses
    lasting: list[tuple[Moments, Floats]]  # durations of the previous round's pulses [s]
    whole: list[Moments]  # of pulses that give at least their bit

    @classmethod
    def of(cls, impulses: ImpulseSolver) -> Self:
        """Return the pulse solver for a solver of craft with thrusters of given acceleration."""
        solver = cls(impulses.problem, impulses.thrusters, impulses.names, impulses.failures)
        solver.least += ROOM
        solver.fired_by = [own for own in impulses.thrusters if own is not None]
        solver.whole = [Moments.every(np.empty(0), 1)] * impulses.problem.count
        return solver

    def nearby(self, safe: Spent, gradually: bool = False) -> Spent | None:
        """Return clear pulses near safe impulses, none below its minimum bit; None without any.

        Pulses can be lengthened `gradually` from those of stronger thrusters.
        """
        self.last_as(safe)
        self.whole = [own.some([]) for own in self.whole]
        if gradually:
            found, _ = tightened(self.tried, safe, STRONGER, sqrt(STRONGER))
        else:
            found = self.cleared(safe, sizes_of(safe.impulses) > 0.0) or self.solve(
                safe.contacts, stride=STRIDE
            )
        found = None if found is None else descended(self, replace(found, margin=AIM))
        for _ in range(LEFT_OUT):
            if found is None or not (small := self.below_bit(found)).any():
                return found
            found = (
                self.without(found, small, DEARER)
                or self.with_bits(found, small)
                or self.without(found, small, inf)
            )
        return None

    def tried(self, factor: float, safe: Spent) -> tuple[Self, Spent]:
        """Return the solver for `factor` times the thrust, and its pulses at the impulses of safe paths."""
        other = copy(self)
        other.stronger = factor
        other.last_as(safe)
        return other, other.some(safe, sizes_of(safe.impulses) > 0.0)

    def cleared(self, found: Spent, left: Any) -> Spent | None:
        """Return clear pulses reached by steps from those in a mask (N, J), at their moments or at more."""
        some = self.some(found, left)
        few = cleared(self, some)
        return few if few is not None else cleared(self, some, self.following)

    def without(self, found: Spent, small: Any, dearer: float) -> Spent | None:
        """Return clear pulses of at most `dearer` times the cost without some or one of the small ones."""
        sizes = sizes_of(found.impulses)
        order = np.argsort(np.where(small, sizes, inf), axis=None)[: np.count_nonzero(small)]
        for those in (order[: -(-len(order) // PART)], *order[:, None]):
            left = sizes > 0.0
            left.flat[those] = False
            clear = cleared(self, self.some(found, left)) if dearer < inf else self.cleared(found, left)
            if clear is not None and clear.cost <= dearer * found.cost and self.whole_in(clear):
                return clear
        return None

    def with_bits(self, found: Spent, small: Any) -> Spent | None:
        """Return clear pulses of which the largest small ones give their bit; None if that costs much more.

        Smaller ones are omitted.  Pulses at the same moments or at further ones compensate.
        """
        sizes = np.where(small, sizes_of(found.impulses), 0.0)
        raised = some_of_each(found.moments, sizes > RAISED * sizes.max())
        before, self.whole = self.whole, list(map(Moments.joined, self.whole, raised))
        own = some_of_each(found.moments, sizes_of(found.impulses) > 0.0)
        more = list(map(Moments.joined, self.following(found), self.whole))
        clear = self.supporting(found, own) or self.supporting(found, more)
        self.whole = before if clear is None else self.whole
        return clear

    def supporting(self, clear: Spent, moments: list[Moments]) -> Spent | None:
        """Return clear pulses at moments, with planes that `clear` ones keep; None if they cost much more."""
        program, aim = Program(self.turned(clear), moments), self.least
        for _ in range(ADDED):
            near = self.minimise(program, LAST, aim, REPLACED * clear.cost)
            if near is None or near.clear:
                return near
            self.last_as(near)
            aim = moved_out(aim, self.least, near)
            program = self.supported(clear, near, program)
        return None

    def whole_in(self, found: Spent) -> bool:
        """Return whether pulses that were given their bit have it."""
        small = some_of_each(found.moments, self.below_bit(found))
        return not any(own.among(whole).any() for own, whole in zip(small, self.whole, strict=True))

    def some(self, found: Spent, left: Any) -> Spent:
        """Return the result of the pulses in a mask (N, J)."""
        pushes = [given[row] for given, row in zip(found.impulses, left, strict=True)]
        return self.fired_at(some_of_each(found.moments, left), pushes_table(pushes), found)

    def settled(self, best: Spent) -> Contacts:
        """Return the contacts with the multipliers of the last round."""
        return best.contacts

    def turned(self, found: Spent, *nearer: float) -> Contacts:
        """Return the turned contacts, and set the durations of the next round's pulses."""
        self.last_as(found)
        return super().turned(found, *nearer)

    def last_as(self, found: Spent) -> None:
        """Set the durations of pulses to those of a result."""
        self.lasting = [
            (own, self.lengths(i, own.which, row[: len(own.times)]))
            for i, (own, row) in enumerate(zip(found.moments, sizes_of(found.impulses), strict=True))
        ]

    def fleet(self, moments: list[Moments]) -> Fleet:
        """Return all craft with pulses about their moments, beyond those that are `given`."""
        self.now, fleet = moments, super().fleet(moments)
        self.given = given = np.zeros((*fleet.times.shape, 3))
        changes = np.zeros(fleet.gains.shape)
        for i, (own, (before, lengths)) in enumerate(zip(moments, self.lasting, strict=True)):
            widths, whole = own.among(before) @ lengths, own.among(self.whole[i]).any(axis=1)
            row, along = given[i, : len(widths)], fleet.along[i, : len(widths)]
            row[:] = (SPARE * whole * self.bits(i, own))[:, None] * along
            seen = self.problem.orbit.transition(self.problem.first - own.times)[..., 3:]
            changes[i] = (seen @ row[..., None])[..., 0].sum(axis=0)
            fleet.widths[i, : len(widths)] = widths
            fleet.times[i, : len(widths)] = self.begins(i, own, widths)
        return fleet._replace(gains=fleet.gains - gains_of(changes, fleet.form))

    def planes(self, contacts: Contacts, aim: float) -> Planes:
        """Return the planes of contacts, and of requirements, as the given pulses leave them."""
        planes = super().planes(contacts, aim)
        for i, own in enumerate(self.now):
            planes.misses[:] -= effects(self, planes, i, own, self.given[i, : len(own.times)]).sum(axis=1)
        return planes

    def lengths(self, i: int, which: Any, sizes: Floats) -> Floats:
        """Return the durations of thrusters (J,) of a craft for their delta-v (J,) [m/s]."""
        return sizes / self.strength(i, which)

    def strength(self, i: int, which: Any) -> Floats:
        """Return the accelerations (J,) of thrusters of a craft [m/s^2]."""
        found: Floats = self.stronger * self.fired_by[i].acceleration[which]
        return found

    def begins(self, i: int, own: Moments, lengths: Floats) -> Floats:
        """Return start times of pulses of durations (J,) [s], nearest to their moments, without overlap."""
        first, last = self.problem.base[i, [START, END]]
        inside = WITHIN * (last - first)
        first, last = first + inside, last - inside
        begins: Floats = np.clip(own.times - 0.5 * lengths, first, last - lengths)
        for one in np.unique(own.which):
            mine = np.flatnonzero(own.which == one)
            if (begins[mine][1:] < (begins + lengths)[mine][:-1]).any():
                begins[mine] = apart(begins[mine], lengths[mine], lengths[mine] + inside, first, last)
        return begins

    def trajectories(self, fleet: Fleet, impulses: Floats) -> Trajectories:
        """Return the paths of all bodies under pulses with the sizes of impulses, with corrected ends."""
        return self.problem.with_path(*(self.pulsed(i, own) for i, own in enumerate(impulses)))

    def pulsed(self, i: int, impulses: Floats) -> Path:
        """Return one craft's path by pulses with the sizes of `impulses` (J, 3)."""
        problem, every, thrusters = self.problem, self.now[i], self.fired_by[i]
        orbit, (start, end) = problem.orbit, problem.base[i, [START, END]]
        initial, final = problem.base[i, STATE : STATE + 6], self.finals[i]
        sizes = np.linalg.norm(impulses[: len(every.times)], axis=1)
        fired = np.flatnonzero(sizes)
        own, sizes = every.some(fired), sizes[fired]
        units = np.array([orbit._rate or 1.0 / (end - start)] * 3 + [1.0] * 3)
        for _ in range(REPAIRS):
            lengths = self.lengths(i, own.which, sizes)
            begins = self.begins(i, own, lengths)
            middle, strength = begins + 0.5 * lengths, self.strength(i, own.which)
            times = np.stack([begins, begins + lengths])
            path = pulsed_path(orbit, thrusters, own.which, times, strength, initial, (start, end))
            along = thrusters.directions_at(orbit, middle)[np.arange(len(own.times)), own.which]
            off = units * (final - path.state(end))
            if np.abs(off).max() <= MET * sizes.sum():
                break
            effects = (
                units[:, None] * (orbit.transition(end - middle)[:, :, 3:] @ along[:, :, None])[..., 0].T
            )
            change = np.linalg.pinv(effects * sizes, rcond=DEPENDENT) @ off
            sizes = np.maximum(sizes * (1.0 + change), 0.0)
        impulses[:] = 0.0
        impulses[fired] = sizes[:, None] * along
        return extended(path, problem.first, problem.arrival)
