"""Sequential and distributed planning: each craft plans alone around the published paths of others.

This is the distributed setting of SP11.  A craft publishes its boundary conditions: times and states at its
start, its end and its contacts.  Between two of them its path is the one of minimum energy, which every other
craft can compute.  The work of a craft grows with the number of others, not with its square.

Of two craft in conflict, the later in the `order` gives way.  In sequential planning each craft waits for
those before it.  In distributed planning all plan at once, and again where a message shows a conflict with a
craft that has right of way.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import nan
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.motion.arc import END, START
from closeform.motion.joining import stack
from closeform.motion.path import Path
from closeform.planning.energy.side_search import MARGINS
from closeform.planning.infeasible_ends import end_conflict
from closeform.planning.minimum_energy import Outcome, solve
from closeform.planning.plan import Contact
from closeform.planning.problem.problem import Problem, deepest


def one_by_one(
    problem: Problem, order: Sequence[int], budget: int | None = None, more: bool = False
) -> Outcome:
    """Return paths of all craft planned in `order`.

    With `more`, a craft without a clear path is moved to the front, and planning restarts.
    """
    order = [int(k) for k in order]
    tried, changed = 0, False
    for _ in range(problem.count if more else 1):
        found = _in_order(problem, order, budget)
        tried += found.tried
        if found.blocked is None or order[0] == found.blocked[0]:
            break
        if more:
            last, changed = found.blocked[0], True
            order = [last, *(k for k in order if k != last)]
    blocked = found.blocked and (min(found.blocked), max(found.blocked))
    return replace(found, tried=tried, blocked=blocked, order=tuple(order) if changed else ())


@dataclass(frozen=True, eq=False)
class OwnPlan:
    """Plan of one craft around given paths; with a `blocked` pair it is not clear of them."""

    path: Path
    contacts: tuple[Contact, ...] = ()
    extra: float = 0.0
    margin: float = MARGINS[0]
    tried: int = 1
    blocked: tuple[int, int] | None = None


def _in_order(problem: Problem, order: list[int], budget: int | None) -> Outcome:
    published = _obstacles(problem)
    plans: dict[int, OwnPlan] = {}
    for k in order:
        plans[k] = _planned(problem, k, published, budget)
        if pair := plans[k].blocked:
            return _blocked(sum(own.tried for own in plans.values()), pair)
        published[k] = plans[k].path
    return _together(problem, order, plans)


@dataclass(frozen=True, eq=False)
class Settled(Outcome):
    """Outcome of distributed planning: number of published new plans, and the last round with one."""

    messages: int = 0
    rounds: int = 0


def by_messages(
    problem: Problem, order: Sequence[int], budget: int | None = None, delays: int | Floats = 1
) -> Settled:
    """Return paths of all craft that plan at once, in rounds, each from the messages that have reached it.

    At first each knows the boundary conditions of all, and so their paths of minimum energy.  In each round
    every craft with a plan in conflict with a received one of a craft before it in `order` plans again,
    around the received plans of all craft before it.  What it publishes reaches craft j after `delays` (N, N)
    rounds, [sender, receiver].  A craft is final once those before it are, so the rounds end.
    """
    order = [int(k) for k in order]
    late = np.broadcast_to(np.maximum(delays, 1), (problem.count, problem.count)).astype(int)
    direct = problem.path(problem.direct)
    plans = {k: OwnPlan(_spanned(direct[k], direct[k])) for k in order}
    sent = [{k: plan.path for k, plan in plans.items()}]  # published plans after each round
    heard: dict[int, list[Path]] = {}
    tried = messages = quiet = 0
    while quiet <= late.max():
        replanned: dict[int, OwnPlan] = {}
        for place, k in enumerate(order):
            before = {j: sent[max(0, len(sent) - late[j, k])][j] for j in order[:place]}
            if heard.get(k) == (paths := list(before.values())):
                continue
            heard[k], known = paths, _obstacles(problem) | before
            if _conflicts(problem, k, plans[k].path, known):
                replanned[k] = _planned(problem, k, known, budget)
        plans |= replanned
        tried += sum(plan.tried for plan in replanned.values())
        messages += len(replanned)
        quiet = 0 if replanned else quiet + 1
        sent.append({k: plan.path for k, plan in plans.items()})
    found = _together(problem, order, plans)
    rounds = len(sent) - 1 - quiet
    reason = f"distributed planning: {messages} new plans published, settled after round {rounds}"
    said = {"tried": tried, "reason": reason if found.trajectories is not None else ""}
    return Settled(**vars(found) | said, messages=messages, rounds=rounds)


def _together(problem: Problem, order: Sequence[int], plans: Mapping[int, OwnPlan]) -> Outcome:
    """Return the plans of all craft as one outcome, after a check of all pairs."""
    trajectories = problem.with_path(*(plans[k].path for k in range(problem.count)))
    tried = sum(own.tried for own in plans.values())
    if conflicts := problem.conflicts(trajectories):  # a craft that coasts cannot give way to those before it
        (i, j), _ = deepest(conflicts)
        late = max(i, j, key=lambda k: order.index(k) if k < problem.count else -1)
        return _blocked(tried, (late, i + j - late))
    contacts = sorted((one for own in plans.values() for one in own.contacts), key=lambda one: one.time)
    extra, margin = sum(own.extra for own in plans.values()), max(own.margin for own in plans.values())
    return Outcome(trajectories, tuple(contacts), extra, margin, tried, priced=not contacts)


def _obstacles(problem: Problem) -> dict[int, Path]:
    """Return the paths that the plan does not change, by body."""
    bodies = problem.bodies(problem.direct)
    return {k: bodies[k] for k in range(problem.count, len(bodies))}


def _conflicts(problem: Problem, craft: int, path: Path, known: dict[int, Path]) -> bool:
    """Return True if a craft's path has a conflict with any of the known ones."""
    alone, _ = _alone(problem, craft, known)
    return bool(alone.conflicts(alone.with_path(path)))


def _planned(problem: Problem, craft: int, known: dict[int, Path], budget: int | None) -> OwnPlan:
    """Return the plan of one craft of minimum energy around the known paths."""
    direct = problem.path(problem.direct)[craft]
    alone, others = _alone(problem, craft, known)
    own = OwnPlan(_spanned(alone.path(alone.direct)[0], direct))
    if not (conflicts := alone.conflicts(alone.direct, MARGINS[0])):
        return own
    held = end_conflict(alone)  # its ends cannot change
    found = solve(alone, budget) if held is None else None
    tried = 1 if found is None else 1 + found.tried
    if found is None or found.trajectories is None:
        _, other = deepest(conflicts)[0]
        return replace(own, tried=tried, blocked=(craft, others[other - 1]))
    contacts = tuple(replace(one, first=craft, second=others[one.second - 1]) for one in found.contacts)
    path = _spanned(alone.path(found.trajectories)[0], direct)
    return OwnPlan(path, contacts, found.extra, max(found.margin, MARGINS[0]), tried)


def _blocked(tried: int, pair: tuple[int, int]) -> Outcome:
    return Outcome(None, (), nan, MARGINS[0], tried, blocked=pair)


def _alone(problem: Problem, craft: int, published: dict[int, Path]) -> tuple[Problem, list[int]]:
    """Return the problem of one craft among the published paths, and the body of each of its obstacles."""
    base = Path(problem.orbit, problem.base[craft : craft + 1], np.array([0, 1]), (1,))
    others: list[int] = []
    groups: dict[int, list[int]] = {}
    for other in published:
        which = problem.index.get((min(craft, other), max(craft, other)))
        if which is not None:
            groups.setdefault(int(problem.kinds[which]), []).append(len(others) + 1)
            others.append(other)
    around = stack([published[other] for other in others]) if others else None
    zones = [(problem.zones[kind], _pairs(members)) for kind, members in groups.items()]
    return Problem.of(base, around, zones), others


def _pairs(members: list[int]) -> Any:
    return np.array([[0, k] for k in members], dtype=np.int64)


def _spanned(path: Path, direct: Path) -> Path:
    """Return a craft's path with the coasts of its direct path before and after it."""
    rows = direct.arcs
    early, late = rows[:, END] <= path.start, rows[:, START] >= path.end
    arcs = np.concatenate([rows[early], path.arcs, rows[late]])
    return Path(path.orbit, arcs, np.array([0, len(arcs)]), ())
