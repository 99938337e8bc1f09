"""Flights of craft some of which lose their thrust, as nobody planned, and drift from then on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, of_each, shown
from closeform.field.chief_frame import ChiefFrame
from closeform.field.course import Commands, Flights, flown, in_order
from closeform.field.drawn import Draws
from closeform.field.field import Field
from closeform.motion.joining import drifting, stack
from closeform.motion.path import Path


def losses(lost: ArrayLike | None, count: int) -> Floats:
    """The argument `lost` of each craft (N,) [s]: inf of those that keep their thrust."""
    if lost is None:
        return np.full(count, np.inf)
    times = of_each("lost", lost, count)
    if np.isnan(times).any():
        raise ValueError(f"lost: a time, or inf of who loses nothing, got {shown(lost)}")
    return times


def until_lost(paths: Path, lost: Floats) -> Path:
    """Paths (N,) with natural motion from when thrust is lost (N,) [s]."""
    ends = np.ravel(paths.end)
    if not (lost < ends).any():
        return paths
    return stack([drifting(paths[k], time) if time < ends[k] else paths[k] for k, time in enumerate(lost)])


def flown_by_each(
    commands: Commands,
    field: Field,
    frame: ChiefFrame,
    draws: Draws,
    who: Sequence[int],
    lost: Floats,
    measured: tuple[Floats, Floats] | None = None,
) -> Flights:
    """Flights of the craft `who` (N,) as commanded: those that lose their thrust, at times of all, alone."""
    measured = measured or draws.measured(commands.table)
    times = lost[list(who)]
    if not np.isfinite(times).any():
        return flown(commands, field, frame, draws.of(commands, who, measured))
    groups = [np.flatnonzero(np.isinf(times)), *np.flatnonzero(np.isfinite(times))[:, None]]
    parts, order = [], []
    for some in groups:
        if len(some):
            told = replace(commands.of(some), lost=float(times[some[0]]))
            parts.append(flown(told, field, frame, draws.of(told, [who[k] for k in some], measured)))
            order += some.tolist()
    return in_order(parts, order)
