"""What thrusters make of a stage: pulses that fly its plan, with the room that they need, certified."""

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
from closeform.scenario.stage_table import Thrusting

if TYPE_CHECKING:
    from closeform.fuel.firing import ThrusterFiring

Result = TypeVar("Result", bound=StageResult[Any, Any])

TRIES = 12  # plans that are made for room that grows
SPARE = 1.02  # times the time that burns stick out: another plan has other burns
GROWTH = 1.5  # times what pulses lead a pair nearer than planned: those of another plan lead elsewhere
# Of a zone: by no more it grows from plan to plan, as small pulses before a long drift lead far from some
# plans and not from those beside them; and by less than that there is no plan between two.
LEAP, FINEST = 0.15, 0.02
REMEDY = "give it more thrust or time, or try cost 'energy', which spreads it"


@dataclass(frozen=True, eq=False)
class Pulsed:
    """A stage whose craft `names` fire pulses: the `firing` counts them in this order.

    `planned` is the flight that the pulses follow, in the `room` that it leaves them; `short`: where that is
    not enough, which room there is no plan for, and why.  `off` (N, 2): distance [m] and speed [m/s] between
    the state of each spacecraft at the end of the stage and its target.
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
                f": pulses below its minimum_bit are not fired ({dropped}); give more time or finer thrusters"
            )
        return Asked(words, broken, bool(shares[k] <= 1.0), 1.0 - float(shares[k]), "arrival")


def pulsed(start: StageStart, plan: Callable[[StageStart], Result]) -> Result:
    """The StageResult of a `plan`, flown by the thrusters of those that have some.

    Burns that would begin before the stage or end after it, and pulses that lead into a zone, or would where
    thrust is lost, ask for room: the plan is made anew within coasts, or for larger zones.  Where there is
    none, conflicts remain, or drifts that are not safe.
    """
    stage = start.scenario.stages[start.number - 1]
    room = BurnRoom(whole=getattr(stage, "drift", None) is not None)  # such a plan is one of pulses
    kept: Result | None = None
    resized = False  # impulses, as those below the minimum bit would end too far from the target
    clearest, planned = -1.0, 1.0  # the least norm of what is kept, and for which zones there was a plan last
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
        from closeform.fuel.order import Overlap  # whose kernels only thrusters need

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
    return without(kept, found, room, f"{TRIES} plans are not enough; {REMEDY}")


def without(kept: Result | None, found: Result, room: BurnRoom, why: str) -> Result:
    """What is kept though pulses need more `room`, which was asked for in vain, or else a failure."""
    if kept is None or kept.pulsed is None:
        return replace(found, failure=why, flown=False)
    short = f"zones {100.0 * (room.larger - 1.0):.3g} % larger: {why}"
    return replace(kept, pulsed=replace(kept.pulsed, short=short))


def shooters(start: StageStart, flight: WatchedFlight) -> list[int]:
    """Who has thrusters and needs them on a flight."""
    craft = enumerate(start.scenario.craft)
    return [k for k, one in craft if one.thrusters is not None and flight.paths[k].delta_v > 0.0]


def fired(
    start: StageStart, flight: WatchedFlight, shooting: list[int]
) -> "tuple[tuple[str, ...], ThrusterFiring]":
    """What some craft fire on a flight, with their names.

    Raises ValueError that counts craft by their names and thrusters from 1.
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
    from closeform.fuel.firing import fire_thrusters  # whose kernels only thrusters need

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
    """A flight on which some craft fire, and the others do as planned, from the stage's start to its end."""
    from closeform.fuel.pulses import extended

    flies = dict(zip(names, [shot.path[k] for k in range(len(names))], strict=True))
    paths = [flies.get(name, planned.path(name)) for name in planned.names]
    return start.flight([extended(path, start.time, end) for path in paths])


def missed(
    start: StageStart, planned: WatchedFlight, names: tuple[str, ...], shot: "ThrusterFiring", end: float
) -> Floats:
    """Return distance [m] and speed [m/s] (N, 2) of each fired path from its target at the end."""
    from closeform.fuel.pulses import extended

    coast = start.orbit.transition(end - planned.end)
    targets = [coast @ planned.path(name).state(planned.end) for name in names]
    fired = [extended(shot.path[k], start.time, end).state(end) for k in range(len(names))]
    off = (np.array(fired) - targets).reshape(len(names), 2, 3)
    found: Floats = np.linalg.norm(off, axis=2)
    return found


def nearest(flight: WatchedFlight, planned: WatchedFlight) -> float:
    """The least norm in conflicts of a flight, of pairs that are planned to have none; inf without."""
    asked = {(conflict.first, conflict.second) for conflict in planned.conflicts}
    norms = [one.ratio for one in flight.conflicts if (one.first, one.second) not in asked]
    return min(norms, default=np.inf)


def adrift(start: StageStart, stage: Any, flight: WatchedFlight) -> float:
    """The least norm where craft lose their thrust on a flight that is planned for that; inf without."""
    if not isinstance(stage, Avoid | Joint) or stage.drift is None or start.planned_drift(stage) is None:
        return np.inf
    from closeform.mission.passive_safety import nearest as nearest_drifts  # whose kernels only a drift needs

    until = flight.end + stage.drift.on(start.orbit.mean_motion)
    pairs, _ = nearest_drifts(flight, start.scenario.zones, until, stage.what_fails)
    fail = stage.moving(flight.names)[: 1 if isinstance(stage, Avoid) else None]  # fellows are not planned
    return min((pair.proven for pair in pairs if pair.fails in fail), default=np.inf)
