"""Impulses of minimum delta-v that keep all pairs clear: planes at contacts, updated until they hold.

A round solves the program for the planes of the contacts (`dual/dual_program`), propagates the impulses, and
searches for conflicts.  Each plane is then turned to its pair's position, and pairs still in conflict get
another one.  Paths that are clear stay clear when the planes turn, and their cost decreases.  Craft may fire
at the times of a grid, at the maxima of their primers, and when they last did; finally only at necessary
times.  Each thruster has moments of its own: a time and its direction.                         # theory 6
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property
from math import ceil, inf, pi
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.fuel.thrusters import Thrusters
from closeform.motion.arc import END, START, STATE, THRUST, WIDTH
from closeform.motion.minimum_delta_v.nonnegative import MOST
from closeform.motion.minimum_delta_v.reduced import COUNT, LOWER
from closeform.motion.minimum_delta_v.reduced import FIRST as FIRED_FROM
from closeform.planning.delta_v.checks import Checked, Spent, arrive, drifting, pushing
from closeform.planning.delta_v.dual.dual_program import price
from closeform.planning.delta_v.dual.fleet import Dual, Fleet, Planes, Priced
from closeform.planning.delta_v.dual.impulse_paths import fill_trajectories, keep_fewest
from closeform.planning.delta_v.dual.plane_shortfalls import fill_planes
from closeform.planning.delta_v.dual.primer_maxima import find_peaks
from closeform.planning.delta_v.fewer_impulses import steps_to_fewer
from closeform.planning.delta_v.firing_times import Moments, Pushes, blended, sizes_of, some_of_each, table_of
from closeform.planning.delta_v.path_requirements import PathRequirements
from closeform.planning.delta_v.unconstrained import answers_alone
from closeform.planning.energy.local_solver import AHEAD
from closeform.planning.loop import ROUNDS, SETTLED, Rounds, fading, run
from closeform.planning.problem.problem import Closest, Problem, Trajectories
from closeform.planning.problem.scene import Contacts

if TYPE_CHECKING:
    from closeform.planning.delta_v.thrust_loss import ImpulseFailures

LEAST, A_TURN = 12, 12  # times at which craft may fire, and additional ones for each orbit
LEVEL, ROOM = 0.9, 32  # primer length above which a maximum becomes a firing time; capacity
FIRED, IDLE = 1e-3, 1e-5  # of all delta-v: significant impulses, and negligible ones
NEAR = 1.05  # norm beyond which insignificant planes are dropped
SAME = 1e-6  # of a craft's time: impulses closer than this are one
APART = 0.02  # of a craft's duration: closer impulses are merged
AIM = 1.0 + 1e-6  # of a zone: distance of planes, so that moving contacts stay clear
ALIKE = 0.002  # of a pair's window: closer planes are merged
TURNED = 0.3  # norm above which a plane is turned to its pair's position
WIDEST, LAST = 1e-2, 1e-5  # relative gap of the first and of the last round
FINER = 0.2  # factor of the gap from round to round
TURNING = 1e-3  # gap above which turning planes may still lower the cost below the bar
WORTH = 1e-4  # of the cost: minimum saving for which another start is completed
FOCUSING = 8  # maximum rounds with few times
ALONE = 8  # rounds without keep-out zones
STEPS = 60  # maximum rounds of short steps to a first plan
ROUNDING = 1e-12  # of a bound
JUST_AFTER = 1e-9  # of a craft's time: a plane does not hold for an impulse that follows it by this much
BOUNDING = 4  # rounds of the bound of requirements
SHARED = 1e-3  # of the cost: change that ends rounds with requirements, whose planes alternate below it
TURNS = 5  # of the half-spaces that keep thrust out of cones; fewer find no thrust between two cones
PRICINGS, PRICED = 6, 1e-7  # rounds with fixed planes, and the tolerance of primers above 1
INSIDE = 1.0 - 1e-6  # of thrust limits: reserve for the repair of the ends
DEARER, SAFER = 1.0002, 1.005  # cost ratio allowed for few impulses; with loss of thrust
FEWER = 1e-4  # of the cost: additional cost allowed for even fewer
# Impulses and burns below SMALL m/s, and this share of the delta-v, are dropped where the others can replace
# them at hardly more cost: most engines have no shorter pulse, and a tenth of it saves next to nothing.
SMALL, SMALL_SHARE, REPLACED = 1e-4, 1e-2, 1.001
DROPS = 12  # maximum attempts to drop small impulses
LIGHTER = 1.01  # times the minimum bit: a pulse gives up to 1 % more as propellant is used
COARSE = 8  # bisection of the steps to fewer ends at this fraction of them


class Program(NamedTuple):
    """Contacts whose planes are to be satisfied, and the moments at which each craft may fire."""

    contacts: Contacts
    moments: list[Moments]


class ImpulseSolver:
    """Solver of one problem from any contacts, by impulses."""

    keeps_zones = True
    given: Any = 0.0  # impulses (N, J, 3) of a round beyond those of its program

    def __init__(
        self,
        problem: Problem,
        thrusters: Sequence[Thrusters | None],
        names: Sequence[str],
        failures: ImpulseFailures | None = None,
    ) -> None:
        self.problem, self.thrusters, self.names, self.failures = problem, thrusters, names, failures
        self.pushes = Pushes.of(thrusters, problem.orbit._rate)
        self.limits = np.zeros(problem.count)  # [m/s^2], of burns
        self.needed = inf  # smallest factor of these limits that planes without a solution require
        self.least = AIM  # of a zone: minimum distance of planes
        self.closest = Closest()
        self.requirements = PathRequirements(problem, self.pushes)
        base = problem.base
        self.grid = self.spaced(base[:, START], base[:, END])
        arcs, offsets = problem.direct
        optima = problem.path(problem.direct)
        self.finals = np.stack([optima[i].state(base[i, END]) for i in range(problem.count)])
        drift = arcs.copy()
        drift[: offsets[problem.count], THRUST : THRUST + 6] = 0.0
        self.drift = problem._own_rows((drift, offsets))  # coasting craft
        never = np.full((len(problem.other_offsets) - 1, 2), inf)
        self.free = np.concatenate([base[:, [START, END]], never])[problem.pairs]  # controllable times
        self.span = np.array([problem.first, problem.arrival])
        self.motion, self.gains = self.natural_motion()

    def spaced(self, starts: Floats, ends: Floats) -> list[Moments]:
        """Return moments between times (N,), equally spaced about a circular orbit."""
        turns = self.problem.orbit._rate * float((ends - starts).max()) / (2.0 * pi)
        times = self.problem.orbit._spaced(starts, ends, LEAST + ceil(A_TURN * turns))
        begun = [self.requirements.with_edges(i, row) for i, row in enumerate(times)]
        grid = self.requirements.paired(list(map(Moments.every, begun, self.pushes.counts)))
        return self.requirements.allowed(grid)

    def natural_motion(self) -> tuple[tuple[Floats, Floats, Floats, Floats], Floats]:
        """Return natural motion for a `Fleet`, and the gains (N, 6) of the craft's changes of state."""
        problem, orbit, base = self.problem, self.problem.orbit, self.problem.base
        scene, form = problem.bare, orbit._rate * orbit._skew(problem.first)
        begins, ends = base[:, START], base[:, END]
        arrived = orbit.transition(problem.first - ends, ends) @ self.finals[:, :, None]
        begun = orbit.transition(problem.first - begins, begins) @ base[:, STATE : STATE + 6, None]
        return (scene.clock, scene.joints, scene.flows, form), gains_of((arrived - begun)[..., 0], form)

    def unconstrained(self) -> Spent:
        """Return the minimum delta-v of each craft alone, without keep-out zones.

        Raises ValueError if the thrusters of a craft cannot perform its transfer.
        """
        base = self.problem.base
        if self.problem.beside is not None and self.pushes.fixed.any():
            alone = self.alone()
            if alone is None:
                named = ", ".join(self.names[i] for i in np.flatnonzero(self.pushes.fixed).tolist())
                raise ValueError(
                    f"thrusters: {named}: no firing achieves the transfer; add thrusters, or allow more time"
                )
            return alone
        given = self.problem.orbit, base, self.finals, self.thrusters, self.names
        found = answers_alone(*given)
        tables = [row[FIRED_FROM:].reshape(-1, 4)[: int(row[COUNT])] for row in found]
        times, impulses = np.zeros((len(base), MOST)), np.zeros((len(base), MOST, 3))
        for i, table in enumerate(tables):
            times[i, : len(table)] = base[i, START] + table[:, 0]
            impulses[i, : len(table)] = table[:, 1:]
        which = self.pushes.nearest(times, impulses)
        fired = [
            Moments.instants(row[: len(table)], own[: len(table)])
            for row, own, table in zip(times, which, tables, strict=True)
        ]
        fleet = self.fleet(fired)
        impulses = np.ascontiguousarray(impulses[:, : fleet.times.shape[1]])
        trajectories, least = self.trajectories(fleet, impulses), float(found[:, LOWER].sum())
        spent, none = float(sizes_of(impulses).sum()), Contacts.none()  # after the repair of the ends
        return Spent(
            trajectories, spent, least, self.checked(trajectories, none), none, 1.0, fired, impulses, fired
        )

    def alone(self) -> Spent | None:
        """Return the optimum without keep-out zones among these moments; None without one."""
        found = self.minimise(Program(Contacts.none(), self.grid), WIDEST, self.least, inf)
        for _ in range(ALONE):
            if found is None:
                return None
            found = self.minimise(Program(Contacts.none(), self.following(found)), LAST, self.least, inf)
        return found

    def solve(self, contacts: Contacts, bar: float = inf, stride: float = inf) -> Spent | None:
        """Return the lowest-cost clear paths found from a start; None without any well below `bar`."""
        accuracies = fading(WIDEST, FINER, LAST)

        def allowed(turn: int) -> float:
            accuracy = accuracies[min(turn, len(accuracies) - 1)]
            turning = accuracy > TURNING or self.failures is not None
            return (1.0 + accuracy if turning else 1.0 - WORTH) * bar

        most = ROUNDS if stride == inf or bar < inf else STEPS
        settled = SHARED if self.problem.requirements else SETTLED
        method: Rounds[Spent, Program] = Rounds(self, allowed, most, stride, accuracies, settled)
        found: Spent | None = run(method, Program(contacts, self.grid))
        return found

    def displacement(self, one: Spent, other: Spent) -> float:
        """Return the largest displacement of a pair at its contacts, in zones."""
        known = one.checked.lost.joined(other.contacts)
        here, there = (self.problem.motions(paths.trajectories, known)[:, 0] for paths in (one, other))
        return float(np.linalg.norm(there - here, axis=1).max(initial=0.0))

    def part_way(self, one: Spent, other: Spent, share: float) -> Spent:
        """Return paths a `share` of the way from one to the other, by few impulses."""
        moments, impulses = blended((one.moments, other.moments), (one.impulses, other.impulses), share)
        return self.by_few(moments, impulses, other, other.contacts.some(other.pushing))

    def blend(self, one: Spent, other: Spent, share: float) -> Spent:
        """Return paths a `share` of the way from one to the other, by the impulses of both."""
        moments, impulses = blended((one.moments, other.moments), (one.impulses, other.impulses), share)
        return self.fired_at(moments, impulses, other)

    def crowd(self, program: Program) -> int:
        """Return the number of planes of a program."""
        return program.contacts.number

    def arrives(self, found: Spent) -> bool:
        """Return whether paths reach their final states."""
        return arrive(self.problem, found.trajectories, self.finals)

    def exhausted(self) -> bool:
        """Return whether the search has used its effort."""
        return self.problem.effort.beyond()

    def supported(self, clear: Spent, found: Spent, program: Program) -> Program:
        """Return a program with added planes at conflicts of found paths that clear paths satisfy."""
        problem, lost, met = self.problem, found.checked.lost, self.problem.met(found.checked.missed)
        if self.failures is not None:
            lost = lost._replace(normals=problem.normals(self.failures.brief(clear.trajectories), lost, -inf))
        met = met._replace(normals=problem.normals(clear.trajectories, met, -inf))
        return program._replace(contacts=program.contacts.joined(lost.joined(met)))

    def by_few(self, moments: list[Moments], impulses: Floats, known: Spent, contacts: Contacts) -> Spent:
        """Return the result of as few impulses as the ends and `contacts` require."""
        keep_fewest(self.fleet(moments), self.planes(contacts, self.least), impulses)
        return self.fired_at(moments, impulses, known)

    def fired_at(self, moments: list[Moments], impulses: Floats, known: Spent) -> Spent:
        """Return the result of impulses at moments, checked at the contacts of `known` paths."""
        trajectories = self.trajectories(self.fleet(moments), impulses)
        spent, checked = float(sizes_of(impulses).sum()), self.checked(trajectories, known.contacts)
        return replace(
            known,
            trajectories=trajectories,
            cost=spent,
            checked=checked,
            moments=moments,
            impulses=impulses,
        )

    def relinearise(self, found: Spent) -> Program:
        """Return the program of the next round: turned planes, those of conflicts, and firing times."""
        return Program(self.turned(found), self.following(found))

    def following(self, found: Spent) -> list[Moments]:
        """Return the moments at which each craft may fire in the next round."""
        every = map(Moments.joined, self.grid, self.requirements.paired(found.peaks), found.fired(FIRED))
        return self.distinct(list(every), found.moments)

    def distinct(self, moments: list[Moments], before: list[Moments]) -> list[Moments]:
        """Return each craft's moments without distinct times closer than SAME.

        Those near its ends or moments `before` move there: a failure amid such an impulse remains amid it.
        """
        ends = self.problem.base[:, [START, END]]
        kept = [np.append(own, near.times) for own, near in zip(ends, before, strict=True)]
        return list(map(Moments.distinct, moments, kept, SAME * np.ptp(ends, axis=1)))

    def focused(self, best: Spent) -> Spent:
        """Return the solution fired at few times near maxima of the primers, if that costs hardly more."""
        apart = APART * (self.problem.base[:, END] - self.problem.base[:, START])
        dearer = DEARER if self.failures is None else SAFER
        for share in (FIRED, IDLE):

            def near_peaks(found: Spent, share: float = share) -> list[Moments]:
                return list(map(Moments.merged, found.fired(share), found.peaks, apart, self.pushes.fixed))

            few = self.refired(best, near_peaks, dearer, patience=1)
            if few is not None:
                return few
        return best

    def fewest(self, best: Spent) -> Spent:
        """Return the solution with as many impulses joined or omitted as possible at hardly more cost."""
        dearer = SAFER if self.problem.requirements else 1.0 + FEWER
        base, most = self.problem.base, dearer * best.cost
        sizes = [row[row > 0.0] for row in sizes_of(best.impulses)]
        rates = np.maximum(self.problem.orbit._rate, pi / (base[:, END] - base[:, START]))
        fired = best.fired(0.0)
        steps = steps_to_fewer(fired, sizes, rates, most - best.cost)
        kept, low, high, middle = best, 0, len(steps), len(steps)
        while high - low > len(steps) // COARSE:
            left = {step.craft: step.left for step in steps[:middle]}
            moments = [left.get(i, own) for i, own in enumerate(fired)]
            found = self.refired_at(moments, best, dearer)
            if found is None or found.cost > most:
                high = middle - 1
            else:
                kept, low = found, middle
            middle = (low + high + 1) // 2
        return kept

    def without_small(self, best: Spent) -> Spent:
        """Return the solution without small impulses or burns, as far as the others can replace them."""
        most, tries = REPLACED * best.cost, DROPS
        while tries and (small := self.small(best)).any():
            sizes = np.where(small, sizes_of(best.impulses), inf)
            order = np.argsort(sizes, axis=None, kind="stable")[: np.count_nonzero(small)]
            for those in (order, *order[:, None])[:tries]:
                tries -= 1
                left = sizes_of(best.impulses) > 0.0
                left.flat[those] = False
                found = self.refired_at(self.kept(best, left), best, REPLACED)
                if found is not None and found.cost <= most:
                    best = found
                    break
            else:
                break
        return best

    def refired_at(self, moments: list[Moments], best: Spent, dearer: float) -> Spent | None:
        """Return the first clear paths fired at moments, of at most `dearer` times the cost; None without.

        No plane is farther out than those of the best paths.
        """
        return self.refired(best, lambda _: moments, dearer, steady=True, first=True)

    def refired(
        self, best: Spent, moments: Callable[[Spent], list[Moments]], dearer: float, **options: Any
    ) -> Spent | None:
        """Return clear paths fired at `moments` of the previous round, of at most `dearer` times the cost."""

        def following(found: Spent) -> Program:
            after, contacts = self.distinct(moments(found), found.moments), self.turned(found, 0.0)
            if self.failures is not None:
                contacts = self.failures.merged(contacts, found.moments, found.impulses, after)
            return Program(contacts, after)

        method = Rounds(
            *(self, lambda _: dearer * best.cost, FOCUSING, inf, (LAST,)),
            aim=best.margin,
            relinearise=following,
            **options,
        )
        found: Spent | None = run(method, following(best))
        return found

    def small(self, found: Spent) -> Any:
        """Return which impulses (N, J) are too small to be planned."""
        sizes = sizes_of(found.impulses)
        return (sizes > 0.0) & (sizes < min(SMALL, SMALL_SHARE * found.cost))

    def kept(self, best: Spent, left: Any) -> list[Moments]:
        """Return the moments in a mask (N, J)."""
        return some_of_each(best.moments, left)

    def bits(self, i: int, own: Moments) -> Floats:
        """Return the minimum impulse bit (J,) [m/s] of a spacecraft's thrusters at its moments."""
        thrusters = self.thrusters[i]
        if thrusters is None:
            return np.zeros(len(own.times))
        found: Floats = LIGHTER * thrusters.minimum_bit[own.which]
        return found

    def below_bit(self, found: Spent) -> Any:
        """Return which impulses (N, J) are below the minimum bit of their thruster."""
        least = np.zeros(found.impulses.shape[:2])
        for i, own in enumerate(found.moments):
            least[i, : len(own.times)] = self.bits(i, own)
        sizes = sizes_of(found.impulses)
        return (sizes > 0.0) & (sizes < least)

    def settled(self, best: Spent) -> Contacts:
        """Return the contacts with the multipliers for firing at any time, not only at the chosen moments."""
        contacts, planes = best.contacts, self.planes(best.contacts, best.margin)
        moments = list(map(Moments.joined, self.grid, best.peaks, best.fired(IDLE)))
        for _ in range(PRICINGS):
            found = self.dual(self.fleet(moments), planes, PRICED, inf)
            if found is None:
                break
            contacts = contacts._replace(multipliers=found.multipliers[: contacts.number])
            if found.longest <= 1.0 + PRICED:
                break
            moments = list(map(Moments.joined, moments, found.peaks))
        return contacts

    def minimise(self, program: Program, accuracy: float, aim: float, bar: float) -> Spent | None:
        """Return the minimum delta-v that satisfies a program's planes; None above `bar`."""
        contacts, moments = program.contacts, self.requirements.allowed(program.moments)
        fleet, planes = self.fleet(moments), self.planes(contacts, aim)
        found = self.dual(fleet, planes, accuracy, bar)
        if found is None:
            return None
        impulses, number = found.impulses, contacts.number
        contacts = contacts._replace(multipliers=found.multipliers[:number])
        felt = np.ones(number, dtype=bool) if self.failures is None else pushing(contacts)
        active = self.requirements.keep(found.multipliers[number:])
        keep_fewest(fleet, planes.some(np.append(felt, active)), impulses)
        impulses += self.given
        trajectories = self.trajectories(fleet, impulses)
        if self.pushes.fixed.any() and not arrive(self.problem, trajectories, self.finals):
            return None
        checked = self.checked(trajectories, contacts)
        self.requirements.relinearise(trajectories, checked.required)
        self.closest.note(checked.worst, trajectories, checked.outside)
        spent = float(sizes_of(impulses).sum())
        return Spent(trajectories, spent, found.least, checked, contacts, aim, moments, impulses, found.peaks)

    def checked(self, trajectories: Trajectories, contacts: Contacts) -> Checked:
        """Return conflicts of paths, with thrust and after its loss, and the checks of requirements."""
        if self.failures is None:
            missed = self.problem.conflicts(trajectories) if self.keeps_zones else []
            found = Checked(missed, Contacts.none(), 1.0, [])
        else:
            found = self.failures.checked(trajectories, contacts.some(pushing(contacts) & drifting(contacts)))
        if not self.problem.requirements:
            return found
        return found._replace(required=self.problem.requirement_checks(trajectories))

    @cached_property
    def required(self) -> Spent | None:
        """Lowest-cost paths that keep the requirements, without zones, with their bound; None without any.

        Their planes remain for the rounds with zones.
        """
        alone = copy(self)
        alone.keeps_zones, alone.failures, alone.closest = False, None, Closest()
        found = alone.solve(Contacts.none())
        if found is None:
            self.closest = alone.closest
            return None
        checked = self.checked(found.trajectories, found.contacts)
        return replace(found, checked=checked, least=self.requirement_bound(found))

    def requirement_bound(self, best: Spent) -> float:
        """Return a lower bound on the delta-v [m/s] of all paths that keep the requirements, from one."""
        own = self.requirements
        least, known = 0.0, (best.peaks, best.fired(IDLE), own.moments(self.pushes.counts))
        moments = own.allowed(list(map(Moments.joined, self.grid, *known)))
        for _ in range(BOUNDING):
            found = self.priced(self.fleet(moments), own.planes, LAST, inf)
            if found is None:
                break
            least = max(least, found.least)
            if found.longest <= 1.0 + SETTLED:
                break
            jumps = own.moments(self.pushes.counts, JUST_AFTER)
            moments = list(map(Moments.joined, moments, found.peaks, jumps))
        return least

    def dual(self, fleet: Fleet, planes: Planes, tolerance: float, bar: float) -> Priced | None:
        """Return the minimum cost of satisfying the planes at the fleet's moments; None above `bar`.

        Thrust is kept out of the cones without thrust, which the bound does not count.
        """
        free = self.priced(fleet, planes, tolerance, bar)
        if free is None or not self.requirements.steer:
            return free
        found = free
        impulses, halves = self.requirements.on_last_sides(fleet, free.impulses), self.requirements.halves
        for _ in range(TURNS):
            halves = self.requirements.half_spaces(fleet, impulses, halves)
            turned = self.priced(fleet, planes, tolerance, bar, halves)
            if turned is None:  # none near the last paths: the next may lead elsewhere
                self.requirements.halves = Planes.room(0)
                return free if bar == inf else None
            found, impulses = turned, turned.impulses
        return found._replace(least=free.least)

    def priced(
        self, fleet: Fleet, planes: Planes, tolerance: float, bar: float, halves: Planes | None = None
    ) -> Priced | None:
        """Return the minimum cost, also with planes of single moments; None above `bar`."""
        count, number = self.problem.count, len(planes.times)
        every = planes if halves is None else planes.joined(halves)
        dual = Dual(np.zeros((count, 6)), np.zeros(len(every.times)))
        impulses = np.zeros((*fleet.times.shape, 3))
        cost, needed = price(fleet, every, tolerance, bar, dual, impulses)
        if cost == inf:
            self.needed = min(self.needed, needed) if needed > 1.0 else self.needed
            return None
        dual = Dual(dual.starts, dual.multipliers[:number])
        instants, which = np.empty((count, ROOM)), np.empty((count, ROOM), dtype=np.int64)
        counts = np.zeros(count, dtype=np.int64)
        longest = find_peaks(fleet, planes, dual, LEVEL, instants, which, counts)
        found = zip(instants, which, counts, strict=True)
        peaks = [Moments.instants(times[:number], own[:number]) for times, own, number in found]
        peaks, least = self.requirements.allowed(peaks), (1.0 - ROUNDING) * cost / max(longest, 1.0)
        return Priced(cost, dual.multipliers, impulses, longest, least, peaks)

    def fleet(self, moments: list[Moments]) -> Fleet:
        """Return all craft with the moments at which they may fire."""
        (times, which, widths), counts = table_of(moments)
        most = np.full(times.shape, inf)
        if self.limits.any():
            most = np.where(widths > 0.0, INSIDE * self.limits[:, None] * widths, inf)
        along = self.pushes.along(which, times)
        given = self.problem.bare.base, self.gains, times, along, widths, most, counts, self.span
        return Fleet(*given, *self.pushes, *self.motion)

    def planes(self, contacts: Contacts, aim: float) -> Planes:
        """Return the planes of contacts at a distance [zones], and those of requirements.

        Their shortfalls are those of coasting craft.
        """
        planes = Planes.room(contacts.number)
        fill_planes(self.problem.bare, *self.drift, contacts, self.free, aim, planes)
        return planes.joined(self.requirements.placed()) if self.problem.requirements else planes

    def turned(self, found: Spent, nearer: float = NEAR) -> Contacts:
        """Return active and near contacts, turned to their pairs' positions, and those of conflicts."""
        problem, contacts, kept = self.problem, found.contacts, found.pushing
        if self.failures is not None:
            undrifting = ~drifting(contacts)
            contacts, kept = contacts.some(undrifting), kept[undrifting]
        contacts = contacts._replace(normals=problem.normals(found.trajectories, contacts, TURNED))
        if not kept.all():
            kept |= (contacts.normals * problem.motions(found.trajectories, contacts)[:, 0]).sum(
                axis=1
            ) < nearer
            contacts = contacts.some(kept)
        for pair, row in found.checked.missed:
            one = problem.at(pair, row[2])
            start, end = problem.windows[0][one.which[0]]
            when = np.abs(contacts.times - row[2])
            same = (when <= ALIKE * (end - start)) & (contacts.which == one.which[0])
            if same.any():
                contacts = contacts._replace(times=np.where(same, row[2], contacts.times))
            else:
                near = np.flatnonzero(contacts.which == one.which[0])
                if len(near):  # start from the pair's other plane
                    one.normals[0] = contacts.normals[near[np.argmin(when[near])]]
                contacts = contacts.joined(beside(problem, found.trajectories, one))
        return contacts.joined(found.checked.lost)

    def trajectories(self, fleet: Fleet, impulses: Floats) -> Trajectories:
        """Return the paths of all bodies under impulses."""
        count = self.problem.count
        arcs = np.empty((count * (2 * fleet.times.shape[1] + 2), WIDTH))
        offsets = np.empty(count + 1, dtype=np.int64)
        number = fill_trajectories(fleet, impulses, arcs, offsets)
        return self.problem.with_obstacles(arcs[:number], offsets)


def gains_of(changes: Floats, form: Floats) -> Floats:
    """Return the gains (N, 6) of changes of state at the first time."""
    moved, sped = changes[:, :3], changes[:, 3:]
    return np.concatenate([sped + moved @ form.T, -moved], axis=1)  # theory (27)


def beside(problem: Problem, trajectories: Trajectories, contacts: Contacts) -> Contacts:
    """Return contacts with normals towards the sides on which paths pass, or forward where two craft meet."""
    normals = problem.normals(trajectories, contacts, -inf)
    return contacts._replace(normals=np.where(normals.any(axis=1, keepdims=True), normals, AHEAD))
