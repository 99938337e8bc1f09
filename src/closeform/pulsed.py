"""What thrusters make of a stage: pulses that fly its plan, with the room that they need, certified."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from closeform.conflicts.flight import WatchedFlight
from closeform.mission_result import StageResult
from closeform.named_craft import as_listed
from closeform.stage_start import BurnRoom, StageStart

if TYPE_CHECKING:
    from closeform.fuel.firing import Firing

Result = TypeVar("Result", bound=StageResult[Any, Any])

TRIES = 12  # plans that are made for room that grows
SPARE = 1.02  # times the time that burns stick out: another plan has other burns
GROWTH = 1.5  # times what pulses lead a pair nearer than planned: those of another plan lead elsewhere
REMEDY = "give it more thrust or time, or cost 'energy', which spreads it"


@dataclass(frozen=True, eq=False)
class Pulsed:
    """A stage whose craft `names` fire pulses: the `firing` counts them in this order.

    `planned` is the flight that the pulses follow, in the `room` that it leaves them.
    """

    names: tuple[str, ...]
    firing: "Firing"
    planned: WatchedFlight
    room: BurnRoom


def pulsed(start: StageStart, plan: Callable[[StageStart], Result]) -> Result:
    """The StageResult of a `plan`, flown by the thrusters of those that have some.

    Burns that would begin before the stage or end after it, and pulses that lead into a zone, ask for room:
    the plan is made anew within coasts, or for larger zones.  Where there is none, conflicts remain.
    """
    room = BurnRoom()
    kept: Result | None = None
    clearest = -1.0  # the norm in conflicts of what is kept
    for _ in range(TRIES):
        later = start.leaving(room)
        found = plan(later)
        if found.failure is not None:
            return found if kept is None else kept
        if not (shooting := shooters(start, found.after)):
            return found
        from closeform.fuel.order import Overlap  # whose kernels only thrusters need
        from closeform.fuel.pulses import extended

        try:
            names, shot = fired(start, found.after, shooting)
        except Overlap as overlap:
            failure = f"{str(overlap).partition(': ')[2].partition(';')[0]}; {REMEDY}"
            return replace(found, failure=failure, flown=False) if kept is None else kept
        end = found.after.end + room.after
        early, late = start.time - float(np.min(shot.path.start)), float(np.max(shot.path.end)) - end
        if max(early, late) > 0.0:
            before, after = (SPARE * max(one, 0.0) for one in (early, late))
            room = replace(room, before=room.before + before, after=room.after + after)
            asked = start.asked(found.stage)
            if kept is None and room.time >= asked:
                break
            continue
        flies = dict(zip(names, [shot.path[k] for k in range(len(names))], strict=True))
        paths = [flies.get(name, found.after.path(name)) for name in found.after.names]
        flight = start.flight([extended(path, start.time, end) for path in paths])
        norm = nearest(flight, found.after)
        if norm > clearest:
            flies_now = Pulsed(names, shot, found.after, room)
            kept, clearest = replace(found, start=start.time, after=flight, pulsed=flies_now), norm
        if norm >= 1.0:
            break
        room = replace(room, larger=1.0 + GROWTH * (room.larger - norm))
    if kept is None:
        failure = f"burns at its ends take {room.time:.6g} s of the {asked:.6g} s that it has; {REMEDY}"
        return replace(found, failure=failure, flown=False)
    return kept


def shooters(start: StageStart, flight: WatchedFlight) -> list[int]:
    """Who has thrusters and needs them on a flight."""
    craft = enumerate(start.scenario.craft)
    return [k for k, one in craft if one.thrusters is not None and flight.paths[k].delta_v > 0.0]


def fired(start: StageStart, flight: WatchedFlight, shooting: list[int]) -> "tuple[tuple[str, ...], Firing]":
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
    from closeform.fuel.firing import fire  # whose kernels only thrusters need

    names = tuple(scenario.names[k] for k in shooting)
    try:
        return names, fire(flight.paths[shooting], [one for one in thrusters if one is not None], **tanks)
    except ValueError as error:
        raise type(error)(as_listed(str(error), names)) from None


def nearest(flight: WatchedFlight, planned: WatchedFlight) -> float:
    """The least norm in conflicts of a flight, of pairs that are planned to have none; inf without."""
    asked = {(conflict.first, conflict.second) for conflict in planned.conflicts}
    norms = [one.ratio for one in flight.conflicts if (one.first, one.second) not in asked]
    return min(norms, default=np.inf)
