"""Interpolation of an ephemeris by polynomials through positions and velocities (Hermite)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, numbers
from closeform.exchange.ephemerides.ephemeris import SAME_EPOCH, Ephemeris
from closeform.exchange.epochs import Epoch

MOST = 6  # states of one polynomial, of degree 11


def states_of(ephemeris: Ephemeris, epoch: Epoch, times: ArrayLike) -> tuple[Floats, Floats]:
    """Return states (T, 6) at times (T,) [s] after an epoch, and their estimated errors (T,) [m].

    Raises ValueError outside of the span of the ephemeris.
    """
    own = Epoch(ephemeris.epoch, ephemeris.time_system)
    begin, end = ephemeris.times[0], ephemeris.times[-1]
    wanted = numbers("times", times) + own.until(epoch)
    outside = (wanted < begin - SAME_EPOCH) | (wanted > end + SAME_EPOCH)
    if outside.any():
        first, last, missed = own.stamps([begin, end, wanted[np.argmax(outside)]])
        raise ValueError(
            f"{ephemeris.name}: has states from {first} to {last} {own.system}, and none at {missed}; "
            "give an epoch within them, or a longer file"
        )
    return interpolated(ephemeris, wanted.clip(begin, end))


def nearest(epochs: Floats, times: Floats) -> Any:
    """Return the index (K,) of the epoch (T,) nearest to each time (K,), the later of two equally near."""
    after = np.clip(np.searchsorted(epochs, times), 1, len(epochs) - 1)
    return after - (times - epochs[after - 1] < epochs[after] - times)


def interpolated(ephemeris: Ephemeris, times: Floats) -> tuple[Floats, Floats]:
    """Return states (K, 6) at `times` (K,) [s] within an ephemeris, and estimated errors (K,) [m]."""
    return hermite(ephemeris.times, ephemeris.states, times)


def hermite(epochs: Floats, known: Floats, times: Floats, most: int = MOST) -> tuple[Floats, Floats]:
    """Return states (K, 6) at `times` (K,) [s], and estimated errors (K,) [m], from `known` (T, 6).

    Each polynomial uses the `most` nearest of the `epochs` (T,). The estimate is the size of the last two
    terms of Newton's form, the contribution of the farthest state to the position. It is 0 at the epochs.
    """
    count = min(most, len(epochs))
    last = len(epochs) - count
    first = np.clip(np.searchsorted(epochs, times) - count // 2, 0, last)
    index = first[:, None] + np.arange(count)
    unit = epochs[index[:, -1]] - epochs[index[:, 0]]  # keeps differences near positions
    away = np.abs(epochs[index] - times[:, None])
    index = np.take_along_axis(index, np.argsort(away, axis=1), axis=1)  # the farthest is last
    nodes = np.repeat((epochs[index] - times[:, None]) / unit[:, None], 2, axis=1)
    positions = np.repeat(known[index, :3], 2, axis=1)
    rates = known[index, 3:] * unit[:, None, None]
    middle = positions[:, :1].copy()
    differences = positions - middle
    coefficients = [differences[:, 0]]
    for order in range(1, 2 * count):
        gap = nodes[:, order:] - nodes[:, :-order]
        twice = gap == 0.0
        slope = np.diff(differences, axis=1) / np.where(twice, 1.0, gap)[..., None]
        if order == 1:
            slope[:, ::2] = rates  # at a double node
        differences = slope
        coefficients.append(differences[:, 0])
    place, rate = np.zeros_like(coefficients[0]), np.zeros_like(coefficients[0])
    for order in range(2 * count - 1, -1, -1):  # Horner's scheme at 0, the wanted time
        ahead = -nodes[:, order, None]
        rate = rate * ahead + place
        place = place * ahead + coefficients[order]
    factor = np.prod(-nodes[:, : 2 * count - 2], axis=1)[:, None]
    ahead = -nodes[:, 2 * count - 2, None]
    lost = factor * (coefficients[-2] + coefficients[-1] * ahead)
    states = np.concatenate([place + middle[:, 0], rate / unit[:, None]], axis=1)
    return states, np.linalg.norm(lost, axis=1)
