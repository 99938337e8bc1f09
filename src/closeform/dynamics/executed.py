"""Error events of execution: which planned burn, feedback burn or impulse acts in which step."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.dynamics.timetable import Timetable
from closeform.motion.arc import END, START
from closeform.motion.path import Path
from closeform.uncertainty.error_columns import burn_ranges


class Events(NamedTuple):
    """Thrust events of N craft in K steps, each with its own error: planned, feedback, then impulses.

    `burns` (N, K) and `led` (K,) are the indices of the planned and the feedback thrust in a step, `shot` (K
    + 1,) those of impulses; -1 for none. Their numbers are `planned`, `backward` and `struck`.
    """

    burns: Any
    led: Any
    shot: Any
    planned: int
    backward: int
    struck: int

    @classmethod
    def of(cls, paths: Path, table: Timetable, lasting: bool, ordered: bool) -> Events:
        """Return the events of paths (N,), with `lasting` (continuous) feedback or `ordered` burns."""
        middle = table.times[1::2]
        edges = [burn_edges(paths[k]) for k in range(len(paths))]
        burns = np.array([np.searchsorted(own, middle) for own in edges])
        planned = max(map(len, edges)) + 1
        begins = table.answers >= 0 if lasting else (table.kicks >= 0) & ordered
        led = np.cumsum(begins)[:-1] - 1
        backward = int(begins.sum())
        shot = np.where(table.fires >= 0, planned + backward + table.fires, -1)
        struck = int(table.fires.max()) + 1
        return cls(burns, np.where(led >= 0, planned + led, -1), shot, planned, backward, struck)

    def during(self, steps: slice) -> tuple[Any, Any, Any]:
        """Return the indices during some steps."""
        burns = np.ascontiguousarray(self.burns[:, steps])
        return burns, self.led[steps].copy(), self.shot[steps.start : steps.stop + 1].copy()


def nothing_of(count: int, table: Timetable) -> Events:
    """Return the events of craft without random errors: none."""
    steps = len(table.rows)
    burns, led, shot = (np.full(shape, -1) for shape in ((count, steps), steps, steps + 1))
    return Events(burns, led, shot, 0, 0, 0)


def burn_edges(path: Path) -> Floats:
    """Return the times at which burns of one craft begin and end, within its path [s].

    Thrust between two burns counts as one burn, too.
    """
    found = [time for a, b in burn_ranges(path) for time in (path.arcs[a, START], path.arcs[b - 1, END])]
    edges = np.unique(np.array(found))
    return np.asarray(edges[(edges > path.start) & (edges < path.end)])
