"""Process noise: increments of a craft's state in steps, equivalent to velocity changes between them.

The increments of steps are normal and independent. Of all motions that lead to them, natural motion within
each step is used, with a change of velocity between two: paths stay continuous, and states are exact at the
ends of steps. The remaining deviation within a step is bounded.

Steps of a block's half, quarter and so on are sampled by halving (Levy's construction), so that the samples
of long steps do not change if shorter ones or more of them are requested.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from math import ceil, log2
from typing import Any

import numpy as np
from scipy.linalg import expm

from closeform.arrays import Floats

# theory (65)
# In units of sqrt(q h^3): deviation in a step h that is exceeded with a probability below 1e-13.
OFF = 1.2
ENOUGH, MOST_OFF = 1e-3, 0.1  # of the zone's inner radius: target and largest deviation
STEPS = 10_000  # maximum number of steps
ANGLE = 0.2  # largest n h for which (65) holds
BLOCK = 4096.0  # s, length of the interval that is halved
SAME = 1e-6  # of a step: tolerance of equal times

Normal = Callable[[int, int], Floats]  # from level and rows to normal numbers (C, rows, 6)


def step_beside(n: float, density: float, radius: float, span: float) -> float:
    """Return the step [s] for noise [m^2/s^3] whose deviation is a thousandth of a zone.

    The step is longer if the span would otherwise have more than ten thousand steps.
    """
    longest = (ENOUGH * radius / OFF) ** (2 / 3) / density ** (1 / 3)
    return float(min(max(longest, span / STEPS), ANGLE / n if n > 0.0 else np.inf, span))


def off_beside(density: float, step: float) -> float:
    """Return the deviation [m] that noise [m^2/s^3] causes within a step [s].

    theory (65)
    """
    return OFF * float(np.sqrt(density * step**3))


def level_of(step: float) -> int:
    """Return the number of halvings of a block down to steps that are no longer than `step`."""
    return max(0, ceil(log2(BLOCK / step) - SAME))


def increments(n: float, level: int, count: int, normal: Normal) -> Floats:
    """Return the increments of a state by noise of density 1 in `count` steps (C, count, 6), of a `level`.

    theory (66)
    """
    step = BLOCK
    found = normal(0, _whole(count, level)) @ growth(n, step)[1].T
    for k in range(1, level + 1):
        step *= 0.5
        flow, gain, root = _halved(n, step)
        first = found @ gain.T + normal(k, found.shape[1]) @ root.T
        both = np.stack([first, found - first @ flow.T], axis=2)
        found = both.reshape(len(found), -1, 6)[:, : _whole(count, level - k)]
    return np.ascontiguousarray(found)


@lru_cache
def growth(n: float, step: float) -> tuple[Floats, Floats]:
    """Return the transition of a step (6, 6), and a root (6, 6) of the covariance of unit noise.

    theory (9)
    """
    sizes = np.repeat([step**1.5, step**0.5], 3)
    flow, gained = _scaled(n, step)
    return flow * np.outer(sizes, 1.0 / sizes), sizes[:, None] * np.linalg.cholesky(gained)


def kicks_of(n: float, step: float, pushes: Floats) -> Floats:
    """Return the changes of velocity (C, K, 3) at step starts that give increments `pushes` (C, K, 6)."""
    both = pushes @ ends_of(n, step).T
    kicks = both[..., :3].copy()
    kicks[:, 1:] += both[:, :-1, 3:]
    return kicks


@lru_cache
def ends_of(n: float, step: float) -> Floats:
    """Return the changes of velocity at a step's start and end, (6, 6), from the increment of the state."""
    flow = growth(n, step)[0]
    first = np.hstack([np.linalg.inv(flow[:3, 3:]), np.zeros((3, 3))])
    last = np.hstack([np.zeros((3, 3)), np.eye(3)]) - flow[3:, 3:] @ first
    return np.vstack([first, last])


def by_then(times: Floats, step: float) -> Any:
    """Return the number of instants, from 0 on, up to and including some times [s]."""
    return np.floor(times / step + SAME).astype(np.int64) + 1


def _whole(count: int, times: int) -> int:
    """Return the number of steps that give at least `count` after some halvings."""
    return -(-count // (1 << times))


@lru_cache
def _halved(n: float, step: float) -> tuple[Floats, Floats, Floats]:
    """Return for two steps: transition of one, gain of the first from the sum, and a residual root."""
    sizes = np.repeat([step**1.5, step**0.5], 3)
    flow, gained = _scaled(n, step)
    moved = flow @ gained
    gain = np.linalg.solve(moved @ flow.T + gained, moved).T
    rest = gained - gain @ moved
    back = np.outer(sizes, 1.0 / sizes)
    root = np.linalg.cholesky(0.5 * (rest + rest.T))
    return flow * back, np.asarray(gain * back), np.asarray(sizes[:, None] * root)


def _scaled(n: float, step: float) -> tuple[Floats, Floats]:
    """Return the transition of a step and the noise covariance, in units of the step (Van Loan 1978)."""
    angle = n * step
    motion = np.zeros((12, 12))
    motion[:3, 3:6] = np.eye(3)
    motion[3:6, :3] = np.diag([3.0, 0.0, -1.0]) * angle**2
    motion[3, 4], motion[4, 3] = 2.0 * angle, -2.0 * angle
    motion[6:, 6:] = -motion[:6, :6].T
    motion[3:6, 9:] = np.eye(3)
    both = expm(motion)
    flow = both[:6, :6]
    gained = both[:6, 6:] @ flow.T
    return flow, 0.5 * (gained + gained.T)
