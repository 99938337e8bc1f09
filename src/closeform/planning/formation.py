"""Reconfiguration: many craft move at once, every pair certified clear, at the least energy found."""

from collections.abc import Sequence
from dataclasses import replace
from math import nan
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from closeform.motion.arc import END, START
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path
from closeform.planning.asked import Asked
from closeform.planning.plan import Plan
from closeform.planning.remedies import FALLBACKS, Attempt, Fallback, remedied, within_limits
from closeform.planning.result import PLANNED, Status
from closeform.planning.sequential import one_by_one
from closeform.planning.slots import revised
from closeform.planning.task import Flown, Task
from closeform.planning.ways import from_sequence, searched
from closeform.zones.zone import Zone


def reconfigure(
    orbit: Orbit,
    initial: ArrayLike,
    final: ArrayLike,
    duration: ArrayLike,
    zone: Zone | Sequence[Zone | None],
    *,
    assign: bool = False,
    start: ArrayLike = 0.0,
    obstacles: Path | Sequence[Path] = (),
    max_acceleration: ArrayLike | None = None,
    if_blocked: Sequence[Fallback] = FALLBACKS,
    method: Literal["joint", "sequential"] = "joint",
    order: Sequence[int] | None = None,
    names: Sequence[str] | None = None,
) -> Plan:
    """Paths of N craft from `initial` to `final` states, every pair certified clear of its zone.

    In the frame of `orbit`, `initial` (N, 6) holds at each craft's `start` [s] and `final` (N, 6) a
    `duration` [s] later, one for all or (N,) each; before and after their own time craft coast.  With
    `assign`, `final` (S, 6), S >= N, are slots, and craft go to those of least total energy.  `zone`:
    one for all, or one for each craft and, after them, obstacle (None: none of its own); of two zones
    the larger holds.  `obstacles`: paths that do not give way, and are gone when they end.
    `max_acceleration` [m/s^2], one for all or (N,), bounds the thrust: a plan beyond it takes the
    shortest longer duration that was found to respect it.

    `method` "joint": all paths are deflected together, by forces between pairs (theory 4).
    "sequential": craft plan one after another in `order` (indices; 0, 1, ... unless given), as in
    SP11.  Where no clear plan is found, `if_blocked` says what is tried, in order; () forbids all.
    `names` are used in reasons.

    The result says how it ended; it raises ValueError for arguments that do not fit: shapes,
    fewer slots than craft, zones of which neither holds the other, unknown words.
    """
    asked = Asked.of(orbit, initial, final, duration, zone, assign, start, obstacles, max_acceleration, names)
    count = len(asked.initial)
    if unknown := [word for word in if_blocked if word not in FALLBACKS]:
        raise ValueError(f"if_blocked: {', '.join(map(repr, FALLBACKS))}, not {unknown[0]!r}")
    if method not in ("joint", "sequential"):
        raise ValueError(f"method: 'joint' or 'sequential', not {method!r}")
    if order is not None and (method == "joint" or sorted(order) != list(range(count))):
        raise ValueError(f"order: with method 'sequential' each of 0 to {count - 1} once, got {list(order)}")
    attempt = _attempts(method, range(count) if order is None else order)
    if not assign:
        return _followed(asked, attempt(asked, False), attempt, if_blocked)[1]
    plan = revised(asked, attempt(asked, False), lambda other: attempt(other, False))
    flown, plan = _followed(asked.assigned(plan.slots), plan, attempt, if_blocked)
    return replace(plan, lower_bound=flown.least_slots()[1])


def _followed(
    asked: Asked, plan: Plan, attempt: Attempt, if_blocked: Sequence[Fallback]
) -> tuple[Asked, Plan]:
    """A plan after what is to be done where it is blocked or beyond a limit, and what it answers."""
    if plan.status == Status.NOT_FOUND:
        asked, plan = remedied(asked, plan, attempt, if_blocked)
    if plan.ok and asked.limits is not None:
        asked, plan = within_limits(asked, plan, attempt, "longer" in if_blocked)
    return asked, plan


def _attempts(method: str, order: Sequence[int]) -> Attempt:
    """How one set of times and slots is planned; with True, more ways are tried."""

    def attempt(asked: Asked, more: bool) -> Plan:
        task = asked.task()
        direct = _path(asked, task.direct)
        bound = float(np.sum(direct.energy))
        times = asked.starts, asked.durations
        plan = Plan(None, direct, asked.slots, *times, nan, nan, bound, (), Status.NOT_FOUND, "")
        held = _held(task)
        if held is not None:
            pair, words = held
            reason = f"{asked.names[pair[0]]} and {asked.names[pair[1]]} {words}"
            return replace(plan, status=Status.END_INSIDE, reason=reason, blocked=pair)
        if method == "joint":
            outcome = searched(task, more)
            if outcome.flown is None:
                outcome = from_sequence(task, one_by_one(asked.orbit, task, order, more), outcome)
        else:
            outcome = one_by_one(asked.orbit, task, order, more)
        plan = replace(plan, proven=outcome.proven, tried=outcome.tried, blocked=outcome.blocked)
        if outcome.flown is None:
            return replace(plan, reason=_blocked(asked, outcome.blocked, outcome.tried))
        paths = _path(asked, outcome.flown)
        ways = "proven the global optimum" if outcome.proven else f"the best of {outcome.tried} ways tried"
        if outcome.order:
            ways += f", one after another: {', '.join(asked.names[k] for k in outcome.order)}"
        number = len(outcome.touches)
        return replace(
            plan,
            paths=paths,
            energy=max(float(np.sum(paths.energy)), bound),
            delta_v=float(np.sum(paths.delta_v)),
            touches=outcome.touches,
            status=Status.AVOIDED if number else Status.CLEAR,
            reason=f"{number} contact{'s' * (number != 1)}, {ways}" if number else "no conflict",
        )

    return attempt


def _path(asked: Asked, flown: Flown) -> Path:
    arcs, offsets = flown
    count = len(asked.initial)
    own = offsets[: count + 1]
    return Path(asked.orbit, np.ascontiguousarray(arcs[: own[-1]]), own, (count,))


def _blocked(asked: Asked, pair: tuple[int, int] | None, tried: int) -> str:
    """Why no plan was found."""
    who = f"{asked.names[pair[0]]} and {asked.names[pair[1]]}" if pair else "craft"
    return f"{who} are in each other's way in all of {tried} ways tried"


def _held(task: Task) -> tuple[tuple[int, int], str] | None:
    """The two bodies deepest in conflict while neither can give way, and in words when and how deep."""
    found, flown = [], task.direct
    for pair, (begin, end, time, ratio) in task.conflicts(flown, PLANNED[0]):
        spans = sorted(tuple(task.base[c, [START, END]]) for c in pair if c < len(task.base))
        first, last = spans[0][0], max(span[1] for span in spans)
        if begin <= first:
            found.append((ratio if time <= first else task.ratio(flown, pair, first), pair, "their start"))
        elif end >= last:
            found.append((ratio if time >= last else task.ratio(flown, pair, last), pair, "their end"))
        elif spans[0][1] <= spans[-1][0] and begin <= spans[-1][0] and end >= spans[0][1]:
            found.append((ratio, pair, "a time when both coast"))
    if not found:
        return None
    ratio, pair, when = min(found)
    return pair, f"come to {ratio:.2f} x zone at {when}; move one of them"
