"""White noise as it comes out: what it makes of a craft's velocity at instants a step apart.

What noise adds to a state in a step is normal, and of each step independent.  Of all motions that lead there
the one that is flown is natural within each step, with a change of velocity between two: paths stay
continuous, and states are exact at the instants.  What noise does beside that within a step is bounded.

Steps of a block's half, quarter and so on are drawn by halving (Levy's construction): what is drawn of long
steps stays as it is where shorter ones are asked for, and of a time as more of it is.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from math import ceil, log2
from typing import Any

import numpy as np
from scipy.linalg import expm

from closeform.arrays import Floats

# Of sqrt(q h^3): beyond it a step of length h leaves its chord with a chance below 1e-13.      # theory (65)
OFF = 1.2
ENOUGH, MOST_OFF = 1e-3, 0.1  # of the zone's inner radius
STEPS = 10_000  # at most, of a zone's time
ANGLE = 0.2  # of n h, up to which (65) holds
BLOCK = 4096.0  # s, which is halved
SAME = 1e-6  # of a step: as late as an instant, but for rounding

Normal = Callable[[int, int], Floats]  # of a level, so many rows of six: (C, rows, 6)


def step_beside(n: float, density: float, radius: float, span: float) -> float:
    """Of noise [m^2/s^3] how long a step may be [s] that leaves out a thousandth of a zone.

    Of ten thousand in a span if those leave more.
    """
    longest = (ENOUGH * radius / OFF) ** (2 / 3) / density ** (1 / 3)
    return float(min(max(longest, span / STEPS), ANGLE / n if n > 0.0 else np.inf, span))


def off_beside(density: float, step: float) -> float:
    """How far noise [m^2/s^3] leads off within a step [s], in metres.                        # theory (65)"""
    return OFF * float(np.sqrt(density * step**3))


def level_of(step: float) -> int:
    """How often a block is halved into steps that are no longer."""
    return max(0, ceil(log2(BLOCK / step) - SAME))


def increments(n: float, level: int, count: int, normal: Normal) -> Floats:
    """What noise of density 1 adds to a state in each of `count` steps (C, count, 6), of a `level`.

    # theory (66)
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
    """What a state becomes in a step (6, 6), the root (6, 6) of what noise of density 1 adds. # theory (9)"""
    sizes = np.repeat([step**1.5, step**0.5], 3)
    flow, gained = _scaled(n, step)
    return flow * np.outer(sizes, 1.0 / sizes), sizes[:, None] * np.linalg.cholesky(gained)


def kicks_of(n: float, step: float, pushes: Floats) -> Floats:
    """Changes of velocity (C, K, 3) at the starts of steps that add `pushes` (C, K, 6) to the state."""
    both = pushes @ ends_of(n, step).T
    kicks = both[..., :3].copy()
    kicks[:, 1:] += both[:, :-1, 3:]
    return kicks


@lru_cache
def ends_of(n: float, step: float) -> Floats:
    """Changes of velocity at a step's start, and at its end, (6, 6) of what they add to the state."""
    flow = growth(n, step)[0]
    first = np.hstack([np.linalg.inv(flow[:3, 3:]), np.zeros((3, 3))])
    last = np.hstack([np.zeros((3, 3)), np.eye(3)]) - flow[3:, 3:] @ first
    return np.vstack([first, last])


def by_then(times: Floats, step: float) -> Any:
    """How many instants, from that at 0 on, there are up to some times [s], and at these."""
    return np.floor(times / step + SAME).astype(np.int64) + 1


def _whole(count: int, times: int) -> int:
    """How many steps that are halved so many times make so many at least."""
    return -(-count // (1 << times))


@lru_cache
def _halved(n: float, step: float) -> tuple[Floats, Floats, Floats]:
    """Of two steps: motion in one, what of a sum the first adds, and the root of what it adds beside."""
    sizes = np.repeat([step**1.5, step**0.5], 3)
    flow, gained = _scaled(n, step)
    moved = flow @ gained
    gain = np.linalg.solve(moved @ flow.T + gained, moved).T
    rest = gained - gain @ moved
    back = np.outer(sizes, 1.0 / sizes)
    root = np.linalg.cholesky(0.5 * (rest + rest.T))
    return flow * back, np.asarray(gain * back), np.asarray(sizes[:, None] * root)


def _scaled(n: float, step: float) -> tuple[Floats, Floats]:
    """Motion in a step and the covariance of noise, in units of the step's own (Van Loan 1978)."""
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
