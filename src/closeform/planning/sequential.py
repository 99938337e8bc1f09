"""One craft after another: each plans alone around the published paths of those before it.

The distributed setting of SP11: a craft needs to know the initial states, targets and durations of those
before it, from which it works out their paths.  Its work grows with their number, not with its square.
"""

from typing import Any

import numpy as np

from closeform.motion.arc import END, START
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path, stack
from closeform.planning.plan import Touch
from closeform.planning.result import Obstacles
from closeform.planning.shaping import shaped
from closeform.planning.task import Flown, Task
from closeform.planning.ways import Outcome
from closeform.zones.zone import Zone


def one_by_one(orbit: Orbit, task: Task, order: Any, more: bool = False) -> Outcome:
    """Paths of all craft planned in `order`; with `more`, who finds none goes first, and all begin anew."""
    count, tried = len(task.base), 0
    order = [int(k) for k in order]
    changed = False
    for _ in range(count if more else 1):
        outcome = _in_order(orbit, task, order)
        tried += outcome.tried
        if outcome.blocked is None or order[0] == outcome.blocked[0]:
            break
        if more:
            last, changed = outcome.blocked[0], True
            order = [last, *(k for k in order if k != last)]
    blocked = outcome.blocked and (min(outcome.blocked), max(outcome.blocked))
    return Outcome(outcome.flown, outcome.touches, False, tried, blocked, tuple(order) if changed else ())


def _in_order(orbit: Orbit, task: Task, order: list[int]) -> Outcome:
    base = Path(orbit, task.base, np.arange(len(task.base) + 1), (len(task.base),))
    arcs, offsets = task.direct
    bodies = Path(orbit, arcs, offsets, (len(offsets) - 1,))
    zones = _zones(task)
    published: dict[int, Path] = {k: bodies[k] for k in range(len(base), len(bodies))}
    touches: list[Touch] = []
    tried = 0
    for k in order:
        path, tried = base[k], tried + 1
        others = [j for j in published if (min(j, k), max(j, k)) in zones]
        if others:
            around = [zones[min(j, k), max(j, k)] for j in others]
            known = Obstacles.of([published[j] for j in others], around)
            deepest = known.deepest(path.arcs)
            if deepest is not None:
                way = None if known.at_end(path) else shaped(path, known)  # its ends are where they are
                tried += way.tried if way is not None else 0
                if way is None or way.path is None:
                    return Outcome(None, (), False, tried, (k, others[deepest[0]]))
                path = way.path
                touches += [Touch(c.time, k, others[c.obstacle], c.normal, c.force) for c in way.contacts]
        published[k] = _spanned(path, bodies[k])
    flown = _together([published[k] for k in range(len(bodies))])
    found = task.conflicts(flown)
    if found:  # a craft that coasts cannot give way to those that planned before it
        (i, j), _ = min(found, key=lambda one: one[1][3])
        late = max(i, j, key=lambda k: order.index(k) if k < len(base) else -1)
        return Outcome(None, (), False, tried, (late, i + j - late))
    return Outcome(flown, tuple(sorted(touches, key=lambda one: one.time)), False, tried)


def _zones(task: Task) -> dict[tuple[int, int], Zone]:
    rows = zip(task.pairs.tolist(), task.kinds.tolist(), strict=True)
    return {(i, j): task.zones[kind] for (i, j), kind in rows}


def _spanned(path: Path, direct: Path) -> Path:
    """A craft's path with the coasts before and after it, which are those of its direct path."""
    rows = direct.arcs
    early, late = rows[:, END] <= path.start, rows[:, START] >= path.end
    arcs = np.concatenate([rows[early], path.arcs, rows[late]])
    return Path(path.orbit, arcs, np.array([0, len(arcs)]), ())


def _together(paths: list[Path]) -> Flown:
    both = stack(paths)
    return both.arcs, both.offsets
