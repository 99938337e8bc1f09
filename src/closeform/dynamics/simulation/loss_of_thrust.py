"""Sampled losses of thrust: the natural motion of a formation after each."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, nan
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.dynamics.force_model.field import Field
from closeform.dynamics.planned_paths import impulses_of
from closeform.exchange.ephemerides.interpolation import hermite
from closeform.motion.joining import drift
from closeform.motion.path import Path
from closeform.zones.zone import Zone

INSTANTS = 25  # sampled times of a loss, evenly over a path; half as many miss minima between impulses
STEP = 60.0  # s: cubics over such steps are within a millimetre of a drift over a kilometre
FINER = 8  # samples of each cubic between two states
SAME = 1e-3  # s: an instant within this of an impulse is replaced by that of the impulse


@dataclass(frozen=True, eq=False)
class Loss:
    """Motion of N spacecraft after the `craft`, by its index, loses its thrust at a `time` [s].

    `craft` is -1, and `time` nan, where no spacecraft has thrust.  `states` (N, T, 6) are at `times` (T,),
    and `arrivals` the same before impulses.
    """

    craft: int
    time: float
    times: Floats
    states: Floats
    arrivals: Floats

    def nearest(self, one: int, two: int, zone: Zone) -> tuple[float, float]:
        """Return the time [s] and the distance [m] of the closest approach of two spacecraft."""
        apart = self.states[one] - self.states[two]
        k = int(np.argmin(zone.norm(apart[:, :3])))
        some = slice(max(k - 1, 0), k + 2)
        known, count = self.times[some], len(self.times[some])
        times = np.interp(np.arange(FINER * (count - 1) + 1) / FINER, np.arange(count), known)
        places = hermite(known, apart[some], times, 2)[0][:, :3]
        i = int(np.argmin(zone.norm(places)))
        return float(times[i]), float(np.linalg.norm(places[i]))


def sampled_losses(
    paths: Path,
    held: Any,
    until: float,
    field: Field | None,
    also: Sequence[float] = (),
    instants: int = INSTANTS,
) -> Iterator[Loss]:
    """Yield the motion after losses of thrust at times along paths (N,), for one spacecraft at a time.

    Craft that are `held` (N,) follow their paths up to the end and then drift. The others drift from the
    start. The drift is propagated in the field, or with Hill's equations without one. `instants`: number
    of times along the paths; `also`: further times [s].
    """
    start, end = float(np.max(paths.start)), float(np.max(paths.end))
    craft, fired, sizes = impulses_of(paths)
    fixed = np.unique([start, end, *fired[(fired >= start) & (fired <= end)]])
    more = np.array([*np.linspace(start, end, instants), *also])
    apart = np.abs(more[:, None] - fixed).min(axis=1) > SAME
    chosen = np.unique([*fixed, *more[apart & (more > start) & (more < end)]])
    edges = [*chosen, until] if until > end else [*chosen]
    parts = [np.linspace(a, b, ceil((b - a) / STEP), endpoint=False) for a, b in pairwise(edges)]
    times = np.array([*np.concatenate(parts), edges[-1]])
    last = int(np.searchsorted(times, end))
    free = _drifts(paths, field, times)
    states = np.empty((len(paths), len(times), 6))
    states[:, : last + 1] = paths.state(times[: last + 1])
    for k in range(len(paths)):
        begin = last if held[k] else 0
        states[k, begin:] = free(k, begin, states[k, begin])
    arrivals, nodes = states.copy(), np.searchsorted(times, fired)
    for k, node, size in zip(craft, nodes, sizes, strict=True):
        arrivals[k, node, 3:] -= size * held[k]
    yield Loss(-1, nan, times, states, arrivals)
    for k in np.flatnonzero(held).tolist():
        for i in np.searchsorted(times, chosen).tolist():
            for state in {tuple(one[k, i].tolist()) for one in (states, arrivals)}:
                lost, before = states[:, i:].copy(), arrivals[:, i:].copy()
                lost[k] = before[k] = free(k, i, np.array(state))
                yield Loss(k, float(times[i]), times[i:], lost, before)


def _drifts(paths: Path, field: Field | None, times: Floats) -> Callable[[int, int, Floats], Floats]:
    """Return a function for the drift (T, 6) of a spacecraft from a state at one of the times (T,) on."""
    chief, acceleration = (times, times) if field is None else field._chief_at(times)

    def drifting(k: int, i: int, state: Floats) -> Floats:
        if field is None:
            return drift(paths.orbit, float(times[i]), float(times[-1]), state).state(times[i:])
        own, chiefs = field._of([k]), (chief[i:], acceleration[i:])
        return np.asarray(own._drift_from(state[None], own._ballistics(1), times[i:], chiefs)[0])

    return drifting
