"""Fraction of the sky that the cone of a sensor sweeps during a search."""

from collections.abc import Sequence
from math import pi

import numpy as np

from closeform.arrays import Floats
from closeform.search.leg import Leg, greatest


def covered_share(legs: Sequence[Leg], cosine: float) -> float:
    """Return the fraction of all directions that come within the cone in any leg.

    Along each meridian the largest cosine to the boresight is sampled at equal steps of height, which are
    equal areas. Its crossings of the cone are interpolated.
    """
    height = np.linspace(-1.0, 1.0, 1001)
    longitude = (np.arange(360) + 0.5) * pi / 180.0
    radius = np.sqrt(1.0 - height * height)
    best = np.full((360, 1001), -1.0)
    for leg in legs:
        parts: list[Floats] = []
        for vector in leg.attitude_parts[:, :, 2]:
            around = vector[0] * np.cos(longitude) + vector[1] * np.sin(longitude)
            parts.append(around[:, None] * radius + vector[2] * height)
        steady, cosine_part, sine_part = parts
        best = np.maximum(best, greatest(steady, cosine_part, sine_part, leg.angle))
    margin = best - cosine
    low, high = margin[:, :-1], margin[:, 1:]
    rise = np.where(low == high, 1.0, high - low)
    crossed = np.clip(np.where(low < 0.0, high, low) / np.abs(rise), 0.0, 1.0)
    share = np.where((low < 0.0) == (high < 0.0), low >= 0.0, crossed)
    return float(share.mean())
