"""Continuous-time minimum of a keep-out margin by V-BAR, called in its fastest way.

`vbar.constraints.segment_minima` takes many segments sampled at the same times and refines only the intervals
that its bounds leave open. It returns the minimum margin of each pair to a sphere, not the times of entry and
exit. Sample spacing and batch size are free: `fastest` tries several.
"""

import importlib.util
import time
from itertools import product

import numpy as np
from numpy.typing import NDArray

from peers.motion import Array

SPACINGS = (30.0, 60.0, 120.0)  # its bounds are infinite from 0.41 radians of n h
BATCHES = (64, 256, 1024)
MISSING = "V-BAR is left out: it needs Python 3.12 or later and `pip install vbar`."


def available() -> bool:
    """Whether it is installed."""
    return importlib.util.find_spec("vbar") is not None


def minima(
    states: Array,
    pairs: NDArray[np.int64],
    duration: float,
    n: float,
    radius: float,
    spacing: float,
    batch: int,
) -> Array:
    """Least margin [m] of each pair (M, 2) of coasting spacecraft (N, 6); negative is a conflict."""
    from vbar.constraints import KeepOut, segment_minima
    from vbar.dynamics.cw import cw_discrete

    keep_out = KeepOut(radius)
    times = np.linspace(0, duration, int(np.ceil(duration / spacing)) + 1)
    table = np.ascontiguousarray(cw_discrete(n, times)[0].transpose(2, 0, 1).reshape(6, -1))
    margins = np.empty(len(pairs))
    for begin in range(0, len(pairs), batch):
        chosen = pairs[begin : begin + batch]
        start = states[chosen[:, 1]] - states[chosen[:, 0]]

        def state_at(rows, tau, start=start):
            return np.einsum("kab,kb->ka", cw_discrete(n, tau)[0], start[rows])

        samples = (start @ table).reshape(len(start), len(times), 6)
        still = np.zeros(len(start))
        margins[begin : begin + batch] = segment_minima(keep_out, state_at, times, samples, still, n, still)[
            1
        ]
    return margins


def fastest(
    states: Array, pairs: NDArray[np.int64], duration: float, n: float, radius: float
) -> tuple[float, int]:
    """Spacing [s] and batch size that take the minimum time on these pairs."""
    taken = {}
    for spacing, batch in product(SPACINGS, BATCHES):
        begin = time.perf_counter()
        minima(states, pairs, duration, n, radius, spacing, batch)
        taken[spacing, batch] = time.perf_counter() - begin
    return min(taken, key=taken.__getitem__)
