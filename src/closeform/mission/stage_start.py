"""Where everybody is when a stage begins, and what follows from that: coasts, transfers, being late."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from math import pi
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.flight import WatchedFlight, watch
from closeform.exchange.spans import JUMP
from closeform.exchange.spans import LEAST as LEAST_JUMP
from closeform.fuel.thrusters import Thrusters
from closeform.mission.verdict import Late, thrust_use
from closeform.motion.arc import IMPULSE
from closeform.motion.joining import join, stack
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path
from closeform.scenario import Avoid, Destination, Joint, Scenario, Target, Transfer
from closeform.scenario.stage_table import Cost
from closeform.zones.combined_zones import OwnZone, enlarged
from closeform.zones.pair_zones import PairZones

if TYPE_CHECKING:
    from closeform.mission.mission_result import StageResult

LATE = 1.0 + 1e-6  # times the duration asked for: longer is later than asked
Clear = Callable[[Floats], Any]  # of final states (S, 6) which (S,) are in nobody's zone
PHASES, A_DEGREE = 36_000, 100  # of a relative orbit, among which the cheapest is looked for


@dataclass(frozen=True)
class BurnRoom:
    """What a plan leaves for the burns of thrusters: zones so many times `larger`, coasts at both ends [s].

    A burn about an impulse at an end of a plan begins before it, or ends after it.  `whole`: impulses of the
    plan are at least the minimum bit of their thruster.
    """

    before: float = 0.0
    after: float = 0.0
    larger: float = 1.0
    whole: bool = False

    @property
    def time(self) -> float:
        """By how much the plan is shorter [s]."""
        return self.before + self.after


@dataclass(frozen=True, eq=False)
class StageStart:
    """Where everybody is when a stage begins, at `time` [s]; `past` has time and states of named stages.

    `shares` (N,) of each craft's first mass are left.  With `room` it is a later moment: when plans begin.
    `errors` of the craft then, none where nobody has any.  `flown`: the stages before, none where everybody
    is known anew.
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
    flown: "tuple[StageResult[Any, Any], ...]" = ()

    def leaving(self, room: BurnRoom) -> Self:
        """When a plan begins that leaves some room."""
        if not room.before:
            return replace(self, room=room)
        states = self.states @ self.orbit.transition(room.before).T
        errors = tuple(self.later(k, room.before) for k in range(len(self.errors)))
        return replace(self, states=states, time=self.time + room.before, room=room, errors=errors)

    def later(self, k: int, duration: float) -> Any:
        """The errors of craft k after a coast."""
        if self.errors[k] is None:
            return None
        from closeform.uncertainty.propagated_errors import carried  # whose kernels nothing else needs

        return carried(self.errors[k], self.coast(k, duration))

    def planned_errors(self, stage: Avoid | Joint, who: list[int]) -> list[Any] | None:
        """The errors of craft with which a stage plans; None where it has no sigmas to plan for.

        A plan of another method does not know them: it is judged.
        """
        if stage.sigmas is None or not self.errors or not stage.is_exact:
            return None
        return [self.errors[k] for k in who]

    def asked(self, stage: Avoid | Joint | Transfer) -> float:
        """For how long plans of a stage are to last [s]."""
        asked = stage.within.on(self.orbit.mean_motion)
        if asked <= self.room.time:
            raise ValueError(
                f"within: {asked:.6g} s is too short for burns at both ends, which take "
                f"{self.room.time:.6g} s of it; give more time or thrust"
            )
        return asked - self.room.time

    def planned_drift(self, stage: Avoid | Joint) -> float | None:
        """How long after a stage's plan thrust that was lost in it must not lead into a zone [s].

        None where no plan can be made for it, or not by its method: it is judged.
        """
        if stage.drift is None or not stage.plans_drift or not stage.is_exact:
            return None
        return stage.drift.on(self.orbit.mean_motion) + self.room.after

    @cached_property
    def keep_out(self) -> tuple[OwnZone | None, ...]:
        """Each craft's own zone, as plans keep it; None for a craft without one."""
        if self.room.larger == 1.0:
            return self.scenario.keep_out
        return tuple(
            None if own is None else enlarged(own, self.room.larger) for own in self.scenario.keep_out
        )

    @cached_property
    def zones(self) -> PairZones:
        """Who keeps which zone with whom in plans."""
        if self.room.larger == 1.0:
            return self.scenario.zones
        return PairZones.of(self.keep_out, self.scenario.names)

    def flight(self, paths: list[Path]) -> WatchedFlight:
        """The paths, watched over their common time."""
        return watch(stack(paths), self.scenario.names, self.scenario.zones)

    def coast(self, k: int, duration: float) -> Path:
        """Craft k does not burn for a `duration` [s]."""
        return self.orbit.coast(self.states[k], duration, self.time)

    def coasts(self, duration: float) -> WatchedFlight:
        """Nobody burns for a `duration` [s]."""
        return self.flight([self.coast(k, duration) for k in range(len(self.states))])

    def fired(self, k: int, burns: Sequence[tuple[float, Floats]], duration: float) -> Path:
        """Craft k's path under impulses (3,) [m/s], each so long after the start [s]."""
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
        """Return craft k's path along the file of its start; a velocity jump at its begin is an impulse."""
        from closeform.scenario.start_state import along  # whose files nothing else reads

        name = self.scenario.names[k]
        times, states, arrivals = along(self.scenario, name, self.time, self.time + duration)
        jump = states[0] - self.states[k]
        if (apart := float(np.linalg.norm(jump[:3]))) > JUMP:
            what = f"begins {apart:.4g} m from where {name} is at {self.time:.6g} s"
            raise ValueError(f"follow: its file {what}; name it in all coasts before, or correct the file")
        arrivals[0], arrivals[-1, :3] = states[0], states[-1, :3]
        if np.linalg.norm(jump[3:]) > LEAST_JUMP:
            arrivals[0, 3:] = self.states[k, 3:]
        return self.orbit._through(times, states[None], arrivals[None])[0]

    def latitude(self, duration: float) -> float:
        """The origin's argument of latitude [rad] after a `duration` [s]."""
        return self.scenario.orbit.latitude + self.orbit.mean_motion * (self.time + duration)

    def earlier(self, states: Floats) -> Floats:
        """Where plans end (..., 6), to coast to the states asked for at the stage's end."""
        return states @ self.orbit.transition(-self.room.after).T if self.room.after else states

    def goal(self, target: Target, duration: float) -> Floats:
        """The state (6,) in which a plan of this `duration` [s] ends that leads to a target."""
        return self.earlier(target.state(self.orbit, self.latitude(duration + self.room.after)))

    def arrival(
        self, asked: Destination, k: int, duration: float, cost: Cost, clear: Clear | None = None
    ) -> "Arrival":
        """Where craft k arrives after a `duration` [s]: at the cheapest phase where that is left open."""
        given = Arrival(self, asked, asked, k, duration, cost, clear)
        return given.cheapest if asked.is_open else given

    def cheapest(self, k: int, finals: Floats, duration: float, cost: Cost) -> tuple[int, float]:
        """Which of some final states (S, 6) it costs craft k least to be in, and how much that is."""
        if cost == "energy":
            spent = self.orbit.transfer(self.states[k], finals, duration).energy
            return int(np.argmin(spent)), float(np.min(spent))
        from closeform.fuel.arrivals import transfer_cost_table  # whose kernels only this needs

        slots = finals @ self.orbit.transition(-duration).T
        found = transfer_cost_table(self.orbit, self.states[k], slots, [duration])
        return int(found.slot[0]), float(found.delta_v[0])

    def transfer(self, target: Target, k: int, duration: float, cost: Cost) -> Path:
        """Craft k's way to a target at the least cost, by thrust without limit in any direction."""
        final = self.goal(target, duration)
        return self.orbit.transfer(self.states[k], final, duration, self.time, cost=cost)

    def thrusters(self, k: int, cost: Cost) -> Thrusters | None:
        """Those that a plan for craft k is made for: with least delta-v its own, if it has some."""
        own = self.scenario.craft[k].fired(float(self.shares[k])) if cost == "delta-v" else None
        return own if own is None or self.room.whole else replace(own, minimum_bit=0.0)

    def limit(self, k: int) -> float:
        """What craft k's engine gives the mass that is left [m/s^2]; inf without a limit."""
        return self.scenario.craft[k].max_acceleration / float(self.shares[k])

    def own_transfer(self, target: Target, k: int, duration: float, cost: Cost) -> Path:
        """Craft k's way to a target at the least cost, as its thrusters or its engine can.

        Raises ValueError, which names the craft, where they cannot.
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
        """Return the transfer of minimum delta-v whose impulses keep the minimum bit, where there is one."""
        from closeform.planning.reconfigure import reconfigure  # whose kernels only this needs

        initial, final, duration, time = task
        goal = initial[None], final[None], duration
        plan = reconfigure(self.orbit, *goal, (None,), start=time, cost="delta-v", thrusters=thrusters)
        assert plan.paths is not None
        return plan.paths[0]

    def mixed(self, who: list[int], paths: Path) -> WatchedFlight:
        """The `paths` of the craft `who`; the others coast meanwhile."""
        duration = float(np.max(paths.end)) - self.time
        flying = {k: paths[place] if paths.shape else paths for place, k in enumerate(who)}
        flying |= {k: self.coast(k, duration) for k in range(len(self.states)) if k not in flying}
        return self.flight([flying[k] for k in sorted(flying)])


@dataclass(frozen=True, eq=False)
class Arrival:
    """That craft k of a stage's `start`, which was `asked` to go somewhere, arrives at its `target`.

    What a phase costs is told of free thrust in this `duration` [s], with nothing in the way.
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
        """What arriving there costs [m/s; of energy m^2/s^3]."""
        finals = self.start.goal(self.target, self.duration)[None]
        return self.start.cheapest(self.k, finals, self.duration, self.cost)[1]

    @cached_property
    def cheapest(self) -> "Arrival":
        """At the phase that costs least, to a hundredth of a degree; of those that are `clear`, if any."""
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
    """What craft follow in flight (N,): the planned thrust of stages, each from where that before led."""
    from closeform.dynamics.flown_plan import following, spanning  # which only flights need

    plans = (spanning(one.planned.paths, np.array([one.start, one.end])) for one in stages)
    return reduce(following, plans)


def too_late(
    start: StageStart, stage: Avoid | Joint, after: WatchedFlight, punctual: dict[str, float | None]
) -> Late | None:
    """That a stage takes longer than it was asked to, where it does.

    `punctual`: with which thrust [m/s^2] each craft would not, None where that is not known.
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
