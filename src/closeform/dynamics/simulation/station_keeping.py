"""Station keeping along coasts, and the spans in which impulses or thrust move the spacecraft."""

from __future__ import annotations

from typing import Any, NamedTuple, Self

import numpy as np

from closeform.arrays import Floats
from closeform.dynamics.control.feedback import Feedback
from closeform.dynamics.simulation.time_grid import SAME
from closeform.motion.arc import END, IMPULSE, START, THRUST
from closeform.motion.path import Path, runs_of


class Holding(NamedTuple):
    """Spans (M, 2) [s] of each craft (N) in which impulses move it, and (D, 2) of continuous thrust.

    In the remaining time it coasts and is held on its path. With `lasting` (continuous) feedback, the hold
    compensates the model error.
    """

    moves: tuple[Floats, ...]
    burns: tuple[Floats, ...]
    lasting: bool

    @classmethod
    def of(cls, paths: Path, law: Feedback | None) -> Self:
        """Return the spans of paths (N,) under feedback; without it impulses move a craft throughout.

        A coast is held if it begins without an impulse and is as long as the horizon or an orbit. A coast
        after an impulse belongs to the transfer.
        """
        each = [paths.arcs[a:b] for a, b in zip(paths.offsets, paths.offsets[1:], strict=False)]
        if law is None:
            moves = tuple(_times(arcs, [(0, len(arcs))] if fires(arcs).any() else []) for arcs in each)
            return cls(moves, (np.zeros((0, 2)),) * len(each), True)
        long = min(law.horizon, 2.0 * np.pi / paths.orbit.mean_motion)
        found = [_spans(arcs, long) for arcs in each]
        return cls(tuple(moves for moves, _ in found), tuple(burns for _, burns in found), not law.impulses)

    def among(self, which: Any) -> Self:
        """Return the spans of the selected craft."""
        some = np.arange(len(self.moves))[which]
        return self._replace(
            moves=tuple(self.moves[k] for k in some), burns=tuple(self.burns[k] for k in some)
        )

    @property
    def bounds(self) -> Floats:
        """Start and end times of the spans of all craft [s]."""
        return np.unique(
            np.concatenate([np.zeros(0), *map(np.ravel, self.moves), *map(np.ravel, self.burns)])
        )

    def moved(self, times: Floats) -> Any:
        """Return which craft are moved by impulses (N, T) at given times."""
        return np.array([_inside(spans, times) for spans in self.moves])

    def opposed(self, times: Floats) -> Any:
        """Return which craft compensate the model error (N, T) at given times."""
        burning = self.lasting | np.array([_inside(spans, times) for spans in self.burns])
        return np.asarray(burning & ~self.moved(times))


def fires(arcs: Floats) -> Any:
    """Return which arcs (M,) begin with an impulse."""
    return np.asarray(arcs[:, IMPULSE : IMPULSE + 3].any(axis=1))


def _spans(arcs: Floats, long: float) -> tuple[Floats, Floats]:
    """Return the impulsive and the thrust spans of one craft; coasts of `long` [s] or more are neither."""
    fired, thrusts = fires(arcs), np.asarray(arcs[:, THRUST:].any(axis=1))
    held = ~fired & ~thrusts & (arcs[:, END] - arcs[:, START] >= long)
    burns = []
    for a, b in runs_of(~fired & ~held):
        burning = np.flatnonzero(thrusts[a:b])
        if not len(burning):
            continue
        if b < len(arcs) and fired[b]:  # the wait before the impulse belongs to its span
            b = a + int(burning[-1]) + 1
        burns.append((a, b))
        held[a:b] = True
    moves = [(a, b) for a, b in runs_of(~held) if fired[a:b].any()]
    return _times(arcs, moves), _times(arcs, burns)


def _times(arcs: Floats, runs: list[tuple[int, int]]) -> Floats:
    """Return the start and end times of runs of arcs (R, 2) [s]."""
    return np.array([(arcs[a, START], arcs[b - 1, END]) for a, b in runs]).reshape(-1, 2)


def _inside(spans: Floats, times: Floats) -> Any:
    """Return which times (T,) lie in any of the spans (M, 2), both ends included."""
    return ((spans[:, :1] - SAME <= times) & (times <= spans[:, 1:] + SAME)).any(axis=0)
