"""State of the formation at the start of a stage, with the coasts, transfers and arrivals that follow."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from math import pi
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.flight import WatchedFlight, watch
from closeform.exchange.ephemerides.spans import JUMP
from closeform.exchange.ephemerides.spans import LEAST as LEAST_JUMP
from closeform.fuel.thrusters import Thrusters
from closeform.mission.verdict import Late, thrust_use
from closeform.motion.arc import IMPULSE
from closeform.motion.chief_orbit import ChiefOrbit
from closeform.motion.duration import far_beyond
from closeform.motion.joining import join, stack
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path
from closeform.scenario import Avoid, Destination, Joint, Scenario, Target, Transfer
from closeform.scenario.stages import Cost, StageTable
from closeform.zones.combined_zones import OwnZone, enlarged
from closeform.zones.pair_zones import PairZones

if TYPE_CHECKING:
    from closeform.mission.mission_result import StageResult
    from closeform.planning.plan import Plan
    from closeform.planning.request import Request

FIRING = "thrusters", "max_thrust", "acceleration", "minimum_bit", "period"  # keys of a craft's thrusters
LATE = 1.0 + 1e-6  # multiple of the requested duration above which a stage is late
KNOWN, LONGER = 10.0, 4.0  # orbits, and multiples of a move, for which coasts beside a chief are known
Clear = Callable[[Floats], Any]  # final states (S, 6) -> mask (S,) of those outside of all zones
PHASES, A_DEGREE = 36_000, 100  # searched phases of a relative orbit: in all, and per degree


@dataclass(frozen=True)
class BurnRoom:
    """Reserve of a plan for thruster burns: coasts at both ends [s], and zones enlarged by a factor `larger`.

    A burn centred on an impulse at an end of the plan begins before the plan, or ends after it.  With
    `whole`, each impulse of the plan has at least the minimum impulse bit of its thruster.
    """

    before: float = 0.0
    after: float = 0.0
    larger: float = 1.0
    whole: bool = False

    @property
    def time(self) -> float:
        """Total duration of both coasts [s], by which the plan is shorter."""
        return self.before + self.after


@dataclass(frozen=True, eq=False)
class StageStart:
    """State of all spacecraft at the start of a stage, at `time` [s].

    - `states` (N, 6): states of the spacecraft.
    - `past`: time and states at the start of each named stage.
    - `shares` (N,): remaining fraction of the initial mass of each spacecraft.
    - `room`: reserve for thruster burns; with it, `time` is the later start of the plan.
    - `errors`: uncertainty of each spacecraft; empty if none has any.
    - `executed`: previous stages; empty if each stage is replanned from known states.
    - `whole`: scenario of all stages; `scenario` has the engines of this one.
    - `planner`: function that plans a request instead of the planner; its plans are not fired.
    """

    scenario: Scenario
    orbit: Orbit
    number: int
    states: Floats
    time: float
    past: dict[str, tuple[float, Floats]]
    shares: Floats
    room: BurnRoom = BurnRoom()
    errors: tuple[Any, ...] = ()
    executed: "tuple[StageResult[Any, Any], ...]" = ()
    whole: Scenario | None = None
    planner: "Callable[[Request], Plan] | None" = None

    def plan(self, request: "Request") -> "Plan":
        """Return the plan of a request."""
        from closeform.planning.planner import planned  # kernels that only these stages need

        return (self.planner or planned)(request)

    def leaving(self, room: BurnRoom) -> Self:
        """Return the start of a plan that leaves the reserve `room`, after the coast before it."""
        if not room.before:
            return replace(self, room=room)
        states = self.states @ self.orbit.transition(room.before, self.time).T
        errors = tuple(self.later(k, room.before) for k in range(len(self.errors)))
        return replace(self, states=states, time=self.time + room.before, room=room, errors=errors)

    def later(self, k: int, duration: float) -> Any:
        """Return the uncertainty of craft k after a coast of `duration` [s]; None without any."""
        if self.errors[k] is None:
            return None
        from closeform.uncertainty.covariance_propagation import (
            uncertainty_at_end,  # kernels that only this needs
        )

        return uncertainty_at_end(self.errors[k], self.coast(k, duration))

    def planned_errors(self, stage: Avoid | Joint, chosen: list[int]) -> list[Any] | None:
        """Return the uncertainty of the craft `chosen` for the planner; None if the stage requires no sigmas.

        Methods that are not exact do not plan with uncertainty; their plans are only checked afterwards.
        """
        if stage.sigmas is None or not self.errors or not stage.is_exact:
            return None
        return [self.errors[k] for k in chosen]

    def asked(self, stage: Avoid | Joint | Transfer) -> float:
        """Return the duration [s] of plans of a stage, without the reserve for burns at both ends."""
        asked = stage.within.on(self.orbit.period)
        if asked <= self.room.time:
            raise ValueError(
                f"within: {asked:.6g} s is too short for burns at both ends, which take "
                f"{self.room.time:.6g} s of it; give more time or thrust"
            )
        return asked - self.room.time

    def known_for(self, duration: float) -> float:
        """Return the time [s] over which plans of a `duration`, which may be lengthened, know coasting craft.

        About a chief that is not on a circle it is ten orbits, within the span of the chief.
        """
        if not isinstance(self.orbit, ChiefOrbit):
            return far_beyond(duration, self.orbit.mean_motion)
        most = max(KNOWN * self.orbit.period, LONGER * duration)
        return float(min(most, self.orbit.chief.span[1] - self.time))

    def planned_drift(self, stage: Avoid | Joint) -> float | None:
        """Return the passive-safety horizon [s] after the plan; None if the planner does not consider it.

        Passive safety of such a stage is only checked afterwards.
        """
        if stage.drift is None or not (stage.plans_drift and stage.is_exact):
            return None
        return stage.drift.on(self.orbit.period) + self.room.after

    @cached_property
    def keep_out(self) -> tuple[OwnZone | None, ...]:
        """Own zone of each spacecraft, as plans keep it; None for a spacecraft without a zone."""
        if self.room.larger == 1.0:
            return self.scenario.keep_out
        return tuple(
            None if own is None else enlarged(own, self.room.larger) for own in self.scenario.keep_out
        )

    @cached_property
    def zones(self) -> PairZones:
        """Keep-out zone of each pair, as plans keep it."""
        if self.room.larger == 1.0:
            return self.scenario.zones
        return PairZones.of(self.keep_out, self.scenario.names)

    def flight(self, paths: list[Path]) -> WatchedFlight:
        """Return the flight of the paths, with its conflicts over their common time."""
        return watch(stack(paths), self.scenario.names, self.scenario.zones)

    def coast(self, k: int, duration: float) -> Path:
        """Return the coast of craft k for a `duration` [s]."""
        return self.orbit.coast(self.states[k], duration, self.time)

    def coasts(self, duration: float) -> WatchedFlight:
        """Return the flight in which all spacecraft coast for a `duration` [s]."""
        return self.flight([self.coast(k, duration) for k in range(len(self.states))])

    def fired(self, k: int, burns: Sequence[tuple[float, Floats]], duration: float) -> Path:
        """Return craft k's path with `burns`, given as times after the start [s] and delta-v (3,) [m/s]."""
        state, at, first, pieces = self.states[k], 0.0, np.zeros(3), []
        for time, push in sorted(burns, key=lambda burn: burn[0]):
            if time > at:
                pieces.append(self.orbit.coast(state, time - at, self.time + at))
                state, at = pieces[-1].state(self.time + time), time
            state = state + np.concatenate([np.zeros(3), push])
            first = first if pieces else first + push
        pieces.append(self.orbit.coast(state, duration - at, self.time + at))
        pieces[0].arcs[0, IMPULSE : IMPULSE + 3] = first
        return join(pieces)

    def followed(self, k: int, duration: float) -> Path:
        """Return craft k's path along its ephemeris file; a velocity jump at its start is an impulse."""
        from closeform.scenario.start_state import along  # reads files that only this needs

        name = self.scenario.names[k]
        times, states, arrivals = along(self.scenario, name, self.time, self.time + duration)
        jump = states[0] - self.states[k]
        if (apart := float(np.linalg.norm(jump[:3]))) > JUMP:
            raise ValueError(
                f"follow: the file of {name} begins {apart:.4g} m from its position at {self.time:.6g} s; "
                "follow it in all earlier coasts, or correct the file"
            )
        arrivals[0], arrivals[-1, :3] = states[0], states[-1, :3]
        if np.linalg.norm(jump[3:]) > LEAST_JUMP:
            arrivals[0, 3:] = self.states[k, 3:]
        return self.orbit._through(times, states[None], arrivals[None])[0]

    def latitude(self, duration: float) -> float:
        """Return the argument of latitude [rad] of the origin after a `duration` [s]."""
        return self.scenario.orbit.latitude + 2.0 * pi / self.orbit.period * (self.time + duration)

    def earlier(self, states: Floats) -> Floats:
        """Return the end states (..., 6) of plans from which a coast reaches `states` at the stage's end."""
        return states @ self.orbit.transition(-self.room.after).T if self.room.after else states

    def goal(self, target: Target, duration: float) -> Floats:
        """Return the final state (6,) at a target for a plan of this `duration` [s]."""
        return self.earlier(target.state(self.orbit, self.latitude(duration + self.room.after)))

    def arrival(
        self, asked: Destination, k: int, duration: float, cost: Cost, clear: Clear | None = None
    ) -> "Arrival":
        """Return the arrival of craft k after a `duration` [s], at the phase of lowest cost if it is open."""
        given = Arrival(self, asked, asked, k, duration, cost, clear)
        return given.cheapest if asked.is_open else given

    def cheapest(self, k: int, finals: Floats, duration: float, cost: Cost) -> tuple[int, float]:
        """Return the index of the final state (S, 6) with the lowest cost for craft k, and that cost."""
        if cost == "energy":
            spent = self.orbit.transfer(self.states[k], finals, duration, self.time).energy
            return int(np.argmin(spent)), float(np.min(spent))
        from closeform.fuel.arrivals import transfer_cost_table  # kernels that only this needs

        slots = finals @ self.orbit.transition(-duration).T
        found = transfer_cost_table(self.orbit, self.states[k], slots, [duration])
        return int(found.slot[0]), float(found.delta_v[0])

    def transfer(self, target: Target, k: int, duration: float, cost: Cost) -> Path:
        """Return craft k's transfer of minimum cost to a target, with unlimited thrust in any direction."""
        final = self.goal(target, duration)
        return self.orbit.transfer(self.states[k], final, duration, self.time, cost=cost)

    def thrusters(self, k: int, cost: Cost) -> Thrusters | None:
        """Return the thrusters for which craft k is planned: its own for cost "delta-v", otherwise None."""
        own = self.scenario.craft[k].fired(float(self.shares[k])) if cost == "delta-v" else None
        return own if own is None or self.room.whole else replace(own, minimum_bit=0.0)

    def limit(self, k: int) -> float:
        """Return the maximum acceleration [m/s^2] of craft k with its remaining mass; inf without a limit."""
        return self.scenario.craft[k].max_acceleration / float(self.shares[k])

    def own_transfer(self, target: Target, k: int, duration: float, cost: Cost) -> Path:
        """Return craft k's transfer of minimum cost to a target, feasible for its thrusters or engine.

        Raises ValueError, which names the spacecraft, if the limits do not permit a transfer.
        """
        task = self.states[k], self.goal(target, duration), duration, self.time
        thrusters = self.thrusters(k, cost)
        try:
            if thrusters is not None and thrusters.minimum_bit.any():
                return self.in_whole_bits(task, thrusters)
            if thrusters is not None:
                return self.orbit.impulsive(*task, thrusters)
            limit = self.limit(k) if self.scenario.craft[k].limited else None
            return self.orbit.transfer(*task, limit, cost)
        except ValueError as error:
            what, _, words = str(error).partition(": ")
            error.args = (f"{what}: {self.scenario.names[k]}: {words}",)
            raise

    def in_whole_bits(self, task: tuple[Floats, Floats, float, float], thrusters: Thrusters) -> Path:
        """Return the transfer of minimum delta-v whose impulses are not below the minimum impulse bit."""
        from closeform.planning.reconfigure import reconfigure  # kernels that only this needs

        initial, final, duration, time = task
        goal = initial[None], final[None], duration
        plan = reconfigure(self.orbit, *goal, (None,), start=time, cost="delta-v", thrusters=thrusters)
        assert plan.paths is not None
        return plan.paths[0]

    def mixed(self, chosen: list[int], paths: Path) -> WatchedFlight:
        """Return the flight with the `paths` of the craft `chosen`; the others coast meanwhile."""
        duration = float(np.max(paths.end)) - self.time
        flying = {k: paths[place] if paths.shape else paths for place, k in enumerate(chosen)}
        flying |= {k: self.coast(k, duration) for k in range(len(self.states)) if k not in flying}
        return self.flight([flying[k] for k in sorted(flying)])


@dataclass(frozen=True, eq=False)
class Arrival:
    """Arrival of craft k of a stage at its `target`, which is the destination `asked` with a chosen phase.

    The cost of a phase is that of unlimited thrust in this `duration` [s], without avoidance.
    """

    start: StageStart
    asked: Destination
    target: Destination
    k: int
    duration: float
    cost: Cost
    clear: Clear | None = None

    @cached_property
    def spent(self) -> float:
        """Cost of the arrival [m/s for delta-v, m^2/s^3 for energy]."""
        finals = self.start.goal(self.target, self.duration)[None]
        return self.start.cheapest(self.k, finals, self.duration, self.cost)[1]

    @cached_property
    def cheapest(self) -> "Arrival":
        """Arrival at the phase of lowest cost, to 0.01 deg, among the `clear` phases if there are any."""
        if self.asked.is_open and not self.target.is_open:
            return self
        shape, start = self.asked.at_phase(0.0).shape, self.start
        assert shape is not None
        every = start.earlier(shape.states(start.orbit, PHASES))

        def best(phases: Any) -> Any:
            kept = phases if self.clear is None else phases[self.clear(every[phases])]
            kept = kept if len(kept) else phases
            return kept[start.cheapest(self.k, every[kept], self.duration, self.cost)[0]]

        about = best(np.arange(0, PHASES, A_DEGREE)) + np.arange(-A_DEGREE, A_DEGREE + 1)
        phase = 2.0 * pi * float(best(about % PHASES)) / PHASES
        return replace(self, target=self.asked.at_phase(phase))


def followed(stages: "Sequence[StageResult[Any, Any]]") -> Path:
    """Return the reference paths (N,) of a simulation: the stages with their planned thrust, joined.

    Each stage starts from the end state that the planned thrust of the previous stages causes.
    """
    from closeform.dynamics.planned_paths import appended_paths, extended_paths  # which only simulations need

    plans = (extended_paths(one.planned.paths, np.array([one.start, one.end])) for one in stages)
    return reduce(appended_paths, plans)


def too_late(
    start: StageStart, stage: Avoid | Joint, after: WatchedFlight, punctual: dict[str, float | None]
) -> Late | None:
    """Return the delay of a stage that takes longer than requested; None for a stage in time.

    `punctual` maps each spacecraft to the thrust [m/s^2] that would avoid the delay, or None if unknown.
    """
    took, asked = after.end - start.time, start.asked(stage)
    if took <= asked * LATE:
        return None
    short = [
        thrust_use(craft, needed)
        for craft in start.scenario.craft
        if (needed := punctual.get(craft.name)) is not None and craft.limited
    ]
    room = start.room.time
    uses = tuple(use for use in short if use.exceeded)
    return Late(start.number, stage.verb, asked + room, took + room, uses)


def thrusters_by_stage(
    scenario: Scenario, stages: Sequence[tuple[float, StageTable]]
) -> list[Thrusters | dict[float, Thrusters | None] | None]:
    """Return the thrusters of each craft in stages, given with their start times [s], as for `simulate`.

    None for a craft without any; a dict by start time for one whose thrusters differ between stages.
    """
    found = list[Thrusters | dict[float, Thrusters | None] | None]()
    crews = [(start, scenario.craft_in(stage), set(stage.moving(scenario.names))) for start, stage in stages]
    for k, name in enumerate(scenario.names):
        sets, last = dict[float, Thrusters | None](), None
        for start, craft in ((start, crew[k]) for start, crew, moving in crews if name in moving):
            if last is None or any(getattr(craft, key) != getattr(last, key) for key in FIRING):
                sets[start], last = craft.fired(1.0), craft
        own = list(sets.values()) or [scenario.craft[k].fired(1.0)]
        found.append(own[0] if len(own) == 1 else sets if any(one is not None for one in own) else None)
    return found
