"""Sequential planning: each craft plans alone around the published paths of those before it.

This is the distributed setting of SP11.  A craft needs to know the initial states, targets and durations of
those before it, from which it computes their paths.  Its work grows with their number, not with its square.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import nan
from typing import Any

import numpy as np

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


def _in_order(problem: Problem, order: list[int], budget: int | None) -> Outcome:
    arcs, offsets = problem.direct
    bodies = Path(problem.orbit, arcs, offsets, (len(offsets) - 1,))
    published: dict[int, Path] = {k: bodies[k] for k in range(problem.count, len(bodies))}
    contacts: list[Contact] = []
    extra, margin, tried = 0.0, MARGINS[0], 0
    for k in order:
        alone, others = _alone(problem, k, published)
        path, tried = alone.path(alone.direct)[0], tried + 1
        if conflicts := alone.conflicts(alone.direct, MARGINS[0]):
            held = end_conflict(alone)  # its ends cannot change
            found = solve(alone, budget) if held is None else None
            tried += found.tried if found is not None else 0
            if found is None or found.flown is None:
                _, other = deepest(conflicts)[0]
                return _blocked(tried, (k, others[other - 1]))
            path, extra, margin = alone.path(found.flown)[0], extra + found.extra, max(margin, found.margin)
            contacts += [replace(c, first=k, second=others[c.second - 1]) for c in found.contacts]
        published[k] = _spanned(path, bodies[k])
    flown = problem.with_path(*(published[k] for k in range(problem.count)))
    if conflicts := problem.conflicts(flown):  # a craft that coasts cannot give way to those before it
        (i, j), _ = deepest(conflicts)
        late = max(i, j, key=lambda k: order.index(k) if k < problem.count else -1)
        return _blocked(tried, (late, i + j - late))
    in_time = tuple(sorted(contacts, key=lambda one: one.time))
    return Outcome(flown, in_time, extra, margin, False, tried, priced=not in_time)


def _blocked(tried: int, pair: tuple[int, int]) -> Outcome:
    return Outcome(None, (), nan, MARGINS[0], False, tried, blocked=pair)


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
