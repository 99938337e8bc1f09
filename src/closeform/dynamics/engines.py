"""Engines: with what craft thrust in flight; who has none coasts in the field."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, shown
from closeform.dynamics.field import Field
from closeform.dynamics.natural import drifting
from closeform.motion.arc import START
from closeform.motion.path import Path

SAMPLED = 1.0  # m: a path through samples of natural motion is nearer to it, one that leads elsewhere is not


class Engines(NamedTuple):
    """The most thrust of N craft, `limits` (N,) [m/s^2], and the least impulse, `bits` (N,) [m/s].

    Of a craft without an engine 0 and inf: whatever it is told, it fires nothing.
    """

    limits: Floats
    bits: Floats

    @classmethod
    def of(cls, running: Any, limit: ArrayLike = np.inf, bit: ArrayLike = 0.0) -> Engines:
        """Of craft of which some are `running` (N,), within a limit and from a bit on."""
        return cls(np.where(running, limit, 0.0), np.where(running, bit, np.inf))

    @property
    def running(self) -> Any:
        """Who has an engine (N,)."""
        return self.limits > 0.0

    def among(self, which: Any) -> Engines:
        """Those of some of the craft."""
        return Engines(self.limits[which], self.bits[which])


def running_engines(engine: Any, paths: Path, field: Field, thrusters: Sequence[Any] = ()) -> Any:
    """The argument `engine` as who has one (N,) of planned paths, which thrust for nobody who has none.

    But where they are sampled, as natural motion in the field that is known.
    """
    count, given = len(paths), np.asarray(engine)
    if given.dtype != bool or given.shape not in ((), (count,)):
        raise ValueError(f"engine: True or False, or one for each of {count} craft, got {shown(engine)}")
    running = np.broadcast_to(given, count).copy()
    for k in np.flatnonzero(~running).tolist():
        if paths[k].delta_v > 0.0 and not _natural(paths[k : k + 1], field._of([k])):
            raise ValueError(f"engine: craft {k} has none, and its path thrusts; give that of its coast")
        if thrusters and thrusters[k] is not None:
            raise ValueError(f"thrusters: craft {k} has no engine; give None in its place")
    return running


def _natural(path: Path, field: Field) -> bool:
    """Whether a path (1,) is natural motion in a field."""
    drift = drifting(path, field)
    times = drift.arcs[:, START]
    return bool(np.abs(path.position(times) - drift.position(times)).max() < SAMPLED)
