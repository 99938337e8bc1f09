"""Which of a craft's errors of execution counts when: those of burns by plan, and of what leads back."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.dynamics.timetable import Timetable
from closeform.motion.arc import END, START
from closeform.motion.path import Path
from closeform.uncertainty.columns import burning


class Events(NamedTuple):
    """What N craft do at K steps, each with an error of its own: by plan, then back, then impulses.

    `burns` (N, K) and `led` (K,) are the numbers of what thrusts in a step by plan and of what leads back,
    `shot` (K + 1,) those of impulses; -1 for none.  There are so many `planned`, `backward` and `struck`.
    """

    burns: Any
    led: Any
    shot: Any
    planned: int
    backward: int
    struck: int

    @classmethod
    def of(cls, paths: Path, table: Timetable, lasting: bool, ordered: bool) -> Events:
        """Those of paths (N,), led back by thrust that is `lasting`, or by burns that are `ordered`."""
        middle = table.times[1::2]
        edges = [burn_edges(paths[k]) for k in range(len(paths))]
        burns = np.array([np.searchsorted(own, middle) for own in edges])
        planned = max(map(len, edges)) + 1
        told = table.answers >= 0 if lasting else (table.kicks >= 0) & ordered
        led = np.cumsum(told)[:-1] - 1
        backward = int(told.sum())
        shot = np.where(table.fires >= 0, planned + backward + table.fires, -1)
        struck = int(table.fires.max()) + 1
        return cls(burns, np.where(led >= 0, planned + led, -1), shot, planned, backward, struck)

    def during(self, steps: slice) -> tuple[Any, Any, Any]:
        """Which they are in some steps."""
        burns = np.ascontiguousarray(self.burns[:, steps])
        return burns, self.led[steps].copy(), self.shot[steps.start : steps.stop + 1].copy()


def nothing_of(count: int, table: Timetable) -> Events:
    """Of so many craft of which nothing is drawn."""
    steps = len(table.rows)
    burns, led, shot = (np.full(shape, -1) for shape in ((count, steps), steps, steps + 1))
    return Events(burns, led, shot, 0, 0, 0)


def burn_edges(path: Path) -> Floats:
    """When burns of one craft begin and end, within its path [s]; what thrusts between two is one, too."""
    found = [time for a, b in burning(path) for time in (path.arcs[a, START], path.arcs[b - 1, END])]
    edges = np.unique(np.array(found))
    return np.asarray(edges[(edges > path.start) & (edges < path.end)])
