"""Engines: the thrust limits of craft in simulations; a craft without an engine coasts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, shown
from closeform.dynamics.field import Field
from closeform.motion.arc import START
from closeform.motion.path import Path

SAMPLED = 1.0  # m: tolerance between a sampled natural path and natural motion


class Engines(NamedTuple):
    """Largest thrust of N craft, `limits` (N,) [m/s^2], and minimum impulse, `bits` (N,) [m/s].

    A craft without an engine has limit 0 and bit inf, so that it ignores all commands.
    """

    limits: Floats
    bits: Floats

    @classmethod
    def of(cls, running: Any, limit: ArrayLike = np.inf, bit: ArrayLike = 0.0) -> Engines:
        """Return the engines of craft, some of which are `running` (N,), with a limit and a minimum bit."""
        return cls(np.where(running, limit, 0.0), np.where(running, bit, np.inf))

    @property
    def running(self) -> Any:
        """Craft that have an engine (N,)."""
        return self.limits > 0.0

    def among(self, which: Any) -> Engines:
        """Return the engines of the selected craft."""
        return Engines(self.limits[which], self.bits[which])


def running_engines(engine: Any, paths: Path, field: Field, thrusters: Sequence[Any] = ()) -> Any:
    """Return the argument `engine` for each craft (N,); a planned path must not thrust without an engine.

    The exception is a path sampled from natural motion in the known field.
    """
    count, given = len(paths), np.asarray(engine)
    if given.dtype != bool or given.shape not in ((), (count,)):
        raise ValueError(f"engine: True or False, or one for each of {count} craft, got {shown(engine)}")
    running = np.broadcast_to(given, count).copy()
    for k in np.flatnonzero(~running).tolist():
        if paths[k].delta_v > 0.0 and not _natural(paths[k : k + 1], field._of([k])):
            raise ValueError(f"engine: craft {k} has none, but its path thrusts; give its coast instead")
        if thrusters and thrusters[k] is not None:
            raise ValueError(f"thrusters: craft {k} has no engine; give None for it")
    return running


def _natural(path: Path, field: Field) -> bool:
    """Return True if a path (1,) is natural motion in a field."""
    drift = field._drift(path)
    times = drift.arcs[:, START]
    return bool(np.abs(path.position(times) - drift.position(times)).max() < SAMPLED)
