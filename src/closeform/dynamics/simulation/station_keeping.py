"""Spans in which impulses or continuous thrust move spacecraft, and station keeping on the coasts between."""

from __future__ import annotations

from typing import Any, NamedTuple, Self

import numpy as np

from closeform.arrays import Floats
from closeform.dynamics.control.feedback import Feedback
from closeform.dynamics.simulation.time_grid import SAME
from closeform.motion.arc import END, IMPULSE, START, THRUST
from closeform.motion.path import Path, runs_of


class ThrustSpans(NamedTuple):
    """Spans (M, 2) [s] of each spacecraft (N) that are `impulsive`, and those of `continuous` thrust.

    In the remaining time it coasts and is held on its path. If feedback is `by_thrust`, the hold compensates
    the model error.
    """

    impulsive: tuple[Floats, ...]
    continuous: tuple[Floats, ...]
    by_thrust: bool

    @classmethod
    def of(cls, paths: Path, law: Feedback | None) -> Self:
        """Return the spans of paths (N,) under feedback; without it impulses move a spacecraft throughout.

        A coast is held if it begins without an impulse and is as long as the horizon or an orbit. A coast
        after an impulse belongs to the transfer.
        """
        each = [paths.arcs[a:b] for a, b in zip(paths.offsets, paths.offsets[1:], strict=False)]
        if law is None:
            whole = tuple(_times(arcs, [(0, len(arcs))] if fires(arcs).any() else []) for arcs in each)
            return cls(whole, (np.zeros((0, 2)),) * len(each), True)
        long = min(law.horizon, 2.0 * np.pi / paths.orbit.mean_motion)
        impulsive, continuous = zip(*(_spans(arcs, long) for arcs in each), strict=True)
        return cls(impulsive, continuous, not law.impulses)

    def among(self, which: Any) -> Self:
        """Return the spans of the selected spacecraft."""
        some = np.arange(len(self.impulsive))[which]
        return self._replace(
            impulsive=tuple(self.impulsive[k] for k in some),
            continuous=tuple(self.continuous[k] for k in some),
        )

    @property
    def bounds(self) -> Floats:
        """Start and end times of the spans of all spacecraft [s]."""
        return np.unique(np.concatenate([np.zeros(0), *map(np.ravel, self.impulsive + self.continuous)]))

    def impulsive_at(self, times: Floats) -> Any:
        """Return which spacecraft are moved by impulses (N, T) at given times."""
        return np.array([_inside(spans, times) for spans in self.impulsive])

    def compensated(self, times: Floats) -> Any:
        """Return which spacecraft compensate the model error (N, T) at given times."""
        thrusting = self.by_thrust | np.array([_inside(spans, times) for spans in self.continuous])
        return np.asarray(thrusting & ~self.impulsive_at(times))


def fires(arcs: Floats) -> Any:
    """Return which arcs (M,) begin with an impulse."""
    return np.asarray(arcs[:, IMPULSE : IMPULSE + 3].any(axis=1))


def _spans(arcs: Floats, long: float) -> tuple[Floats, Floats]:
    """Return the impulsive and the continuous spans of one spacecraft; coasts of `long` [s] are neither."""
    fired, thrusts = fires(arcs), np.asarray(arcs[:, THRUST:].any(axis=1))
    held = ~fired & ~thrusts & (arcs[:, END] - arcs[:, START] >= long)
    continuous = []
    for a, b in runs_of(~fired & ~held):
        burning = np.flatnonzero(thrusts[a:b])
        if not len(burning):
            continue
        if b < len(arcs) and fired[b]:  # the wait before the impulse belongs to its span
            b = a + int(burning[-1]) + 1
        continuous.append((a, b))
        held[a:b] = True
    impulsive = [(a, b) for a, b in runs_of(~held) if fired[a:b].any()]
    return _times(arcs, impulsive), _times(arcs, continuous)


def _times(arcs: Floats, runs: list[tuple[int, int]]) -> Floats:
    """Return the start and end times of runs of arcs (R, 2) [s]."""
    return np.array([(arcs[a, START], arcs[b - 1, END]) for a, b in runs]).reshape(-1, 2)


def _inside(spans: Floats, times: Floats) -> Any:
    """Return which times (T,) lie in any of the spans (M, 2), both ends included."""
    return ((spans[:, :1] - SAME <= times) & (times <= spans[:, 1:] + SAME)).any(axis=0)
