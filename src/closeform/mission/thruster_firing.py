"""Realization of a stage with thruster pulses that follow its plan, certified to be clear.

The plan leaves the reserve in time and clearance that the pulses need.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.flight import WatchedFlight
from closeform.mission.mission_result import StageResult
from closeform.mission.stage_start import BurnRoom, StageStart
from closeform.mission.verdict import Asked
from closeform.named_craft import as_listed
from closeform.scenario import Avoid, Joint
from closeform.scenario.stages import Thrusting

if TYPE_CHECKING:
    from closeform.fuel.firing import ThrusterFiring

Result = TypeVar("Result", bound=StageResult[Any, Any])

TRIES = 12  # maximum number of plans, each with a larger reserve
SPARE = 1.02  # factor on the time by which burns exceed the stage, because another plan has other burns
GROWTH = 1.5  # factor on the lost clearance ratio, because the pulses of another plan deviate differently
# Maximum and minimum enlargement of zones from plan to plan, relative to the zone.  The maximum is small,
# because small pulses before a long drift cause large deviations from some plans but not from similar ones.
LEAP, FINEST = 0.15, 0.02
REMEDY = "give it more thrust or time, or try cost 'energy', which spreads it"


@dataclass(frozen=True, eq=False)
class Pulsed:
    """Pulses of a stage, fired by the spacecraft `names` in the order of `firing`.

    `planned` is the flight that the pulses follow, and `room` is the reserve that it leaves for them.
    `short` states why there is no plan with a sufficient reserve; it is None if the reserve suffices.
    `off` (N, 2) holds the distance [m] and speed [m/s] between the state of each spacecraft at the end of the
    stage and its target.
    """

    names: tuple[str, ...]
    firing: "ThrusterFiring"
    planned: WatchedFlight
    room: BurnRoom
    off: Floats
    short: str | None = None

    def arrival(self, number: int, stage: Thrusting) -> Asked:
        """Return whether the spacecraft reach their targets within the tolerance of the stage."""
        limits = np.array([stage.arrival.position, stage.arrival.velocity])
        shares = (self.off / limits).max(axis=1)
        k = int(np.argmax(shares))
        distance, speed = self.off[k]
        words = f"arrival off by {distance:.3g} m and {1e3 * speed:.3g} mm/s ({self.names[k]})"
        broken = (
            f"{words} in stage {number} ({stage.verb}), allowed {limits[0]:g} m and {1e3 * limits[1]:g} mm/s"
        )
        if dropped := int((self.firing.dropped.craft == k).sum()):
            broken += (
                f": {dropped} pulses below minimum_bit are not fired; allow more time, or use finer thrusters"
            )
        return Asked(words, broken, bool(shares[k] <= 1.0), 1.0 - float(shares[k]), "arrival")


def pulsed(start: StageStart, plan: Callable[[StageStart], Result]) -> Result:
    """Return the StageResult of a `plan`, realized by thrusters on the spacecraft that have some.

    The stage is planned again, between coasts, if burns begin before the stage or end after it.  It is
    planned again with larger zones if the pulses cause a conflict, or would after a loss of thrust.  If no
    such plan exists, conflicts or unsafe drifts remain.
    """
    if start.planner is not None:
        return plan(start)
    stage = start.scenario.stages[start.number - 1]
    room = BurnRoom(whole=getattr(stage, "drift", None) is not None)  # a passively safe plan is one of pulses
    kept: Result | None = None
    resized = False  # True after planning again with whole minimum impulse bits, to arrive at the target
    clearest, planned = -1.0, 1.0  # clearance ratio of `kept`; zone factor of the last successful plan
    for _ in range(TRIES):
        later = start.leaving(room)
        found = plan(later)
        if found.failure is not None:
            if kept is not None and resized:
                return kept
            if kept is None or room.larger - planned < FINEST:
                return without(kept, found, room, found.failure)
            room = replace(room, larger=0.5 * (planned + room.larger))
            continue
        if not (shooting := shooters(start, found.after)):
            return found
        from closeform.fuel.order import Overlap  # kernels that only thrusters need

        try:
            names, shot = fired(start, found.after, shooting)
        except Overlap as overlap:
            if kept is not None and resized:
                return kept
            failure = f"{str(overlap).partition(': ')[2].partition(';')[0]}; {REMEDY}"
            return without(kept, found, room, failure)
        end = found.after.end + room.after
        early, late = start.time - float(np.min(shot.path.start)), float(np.max(shot.path.end)) - end
        if max(early, late) > 0.0:
            before, after = (SPARE * max(one, 0.0) for one in (early, late))
            room = replace(room, before=room.before + before, after=room.after + after)
            if room.time < (asked := start.asked(found.stage)):
                continue
            failure = f"burns at its ends take {room.time:.6g} s of the {asked:.6g} s that it has; {REMEDY}"
            return without(kept, found, room, failure)
        flight = shooting_flight(start, found.after, names, shot, end)
        norm = min(nearest(flight, found.after), adrift(later, found.stage, flight))
        if norm > clearest:
            flies_now = Pulsed(names, shot, found.after, room, missed(start, found.after, names, shot, end))
            kept, clearest = replace(found, start=start.time, after=flight, pulsed=flies_now), norm
        if kept is not None and norm > 1.0:
            small = kept.pulsed is not None and len(kept.pulsed.firing.dropped) > 0
            if room.whole or not small or found.stage.cost != "delta-v" or all(one.met for one in kept.asked):
                return kept
            room, resized, clearest = replace(room, whole=True), True, -1.0
            continue
        planned = room.larger
        room = replace(room, larger=min(1.0 + GROWTH * (planned - norm), planned + LEAP))
    return without(kept, found, room, f"no sufficient reserve after {TRIES} plans; {REMEDY}")


def without(kept: Result | None, found: Result, room: BurnRoom, why: str) -> Result:
    """Return the best result so far, marked as short of reserve, if no plan with the reserve `room` exists.

    Without such a result, return `found` as a failure with the reason `why`.
    """
    if kept is None or kept.pulsed is None:
        return replace(found, failure=why, executed=False)
    short = f"zones {100.0 * (room.larger - 1.0):.3g} % larger: {why}"
    return replace(kept, pulsed=replace(kept.pulsed, short=short))


def shooters(start: StageStart, flight: WatchedFlight) -> list[int]:
    """Return the indices of the spacecraft that have thrusters and need delta-v in a flight."""
    craft = enumerate(start.scenario.craft)
    return [k for k, one in craft if one.thrusters is not None and flight.paths[k].delta_v > 0.0]


def fired(
    start: StageStart, flight: WatchedFlight, shooting: list[int]
) -> "tuple[tuple[str, ...], ThrusterFiring]":
    """Return the names of the spacecraft `shooting`, by index, and the pulses that realize their paths.

    Raises ValueError that refers to spacecraft by name and numbers thrusters from 1.
    """
    scenario = start.scenario
    thrusters = [scenario.craft[k].fired(float(start.shares[k])) for k in shooting]
    masses = [scenario.craft[k].mass for k in shooting]
    impulses = [scenario.craft[k].specific_impulse for k in shooting]
    tanks: dict[str, Any] = {}
    if None not in masses and None not in impulses:
        tanks = {
            "mass": np.array(masses, dtype=float) * start.shares[shooting],
            "specific_impulse": np.array(impulses, dtype=float),
        }
    from closeform.fuel.firing import fire_thrusters  # kernels that only thrusters need

    names = tuple(scenario.names[k] for k in shooting)
    try:
        return names, fire_thrusters(
            flight.paths[shooting], [one for one in thrusters if one is not None], **tanks
        )
    except ValueError as error:
        raise type(error)(as_listed(str(error), names)) from None


def shooting_flight(
    start: StageStart, planned: WatchedFlight, names: tuple[str, ...], shot: "ThrusterFiring", end: float
) -> WatchedFlight:
    """Return the flight from the start of the stage to `end` [s], with the pulses of the craft `names`.

    The other spacecraft follow their planned paths.
    """
    from closeform.fuel.pulses import extended

    flies = dict(zip(names, [shot.path[k] for k in range(len(names))], strict=True))
    paths = [flies.get(name, planned.path(name)) for name in planned.names]
    return start.flight([extended(path, start.time, end) for path in paths])


def missed(
    start: StageStart, planned: WatchedFlight, names: tuple[str, ...], shot: "ThrusterFiring", end: float
) -> Floats:
    """Return distance [m] and speed [m/s] (N, 2) of each fired path from its target at the end."""
    from closeform.fuel.pulses import extended

    coast = start.orbit.transition(end - planned.end, planned.end)
    targets = [coast @ planned.path(name).state(planned.end) for name in names]
    fired = [extended(shot.path[k], start.time, end).state(end) for k in range(len(names))]
    off = (np.array(fired) - targets).reshape(len(names), 2, 3)
    found: Floats = np.linalg.norm(off, axis=2)
    return found


def nearest(flight: WatchedFlight, planned: WatchedFlight) -> float:
    """Return the minimum clearance ratio in conflicts of pairs without a planned conflict; inf if none."""
    asked = {(conflict.first, conflict.second) for conflict in planned.conflicts}
    norms = [one.ratio for one in flight.conflicts if (one.first, one.second) not in asked]
    return min(norms, default=np.inf)


def adrift(start: StageStart, stage: Any, flight: WatchedFlight) -> float:
    """Return the minimum proven clearance ratio after a failure of spacecraft that are planned to be safe.

    Return inf if passive safety is not planned.
    """
    if not isinstance(stage, Avoid | Joint) or stage.drift is None or start.planned_drift(stage) is None:
        return np.inf
    from closeform.mission.passive_safety import nearest as nearest_drifts  # kernels of drifts only

    until = flight.end + stage.drift.on(start.orbit.period)
    pairs, _ = nearest_drifts(flight, start.scenario.zones, until, stage.what_fails)
    fail = stage.moving(flight.names)[: 1 if isinstance(stage, Avoid) else None]  # `meanwhile` is not planned
    return min((pair.proven for pair in pairs if pair.fails in fail), default=np.inf)
