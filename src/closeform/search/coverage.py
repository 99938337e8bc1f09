"""Share of the sky that the cone of a sensor sweeps during a search."""

from math import cos, pi, sin
from typing import Any

import numpy as np

from closeform.arrays import Floats


def covered(table: Floats, cosine: float) -> float:
    """Return the share of all directions that come within the cone in any leg.

    Along each meridian the largest cosine to the boresight is sampled at equal steps of height, which are
    equal areas. Its crossings of the cone are interpolated.
    """
    height = np.linspace(-1.0, 1.0, 1001)
    longitude = (np.arange(360) + 0.5) * pi / 180.0
    radius = np.sqrt(1.0 - height * height)
    best = np.full((360, 1001), -1.0)
    for start, end, rate, *vectors in table:
        parts = []
        for vector in np.reshape(vectors, (3, 3)):
            around = vector[0] * np.cos(longitude) + vector[1] * np.sin(longitude)
            parts.append(around[:, None] * radius + vector[2] * height)
        steady, cosine_part, sine_part = parts
        swept = greatest(steady, cosine_part, sine_part, rate * (end - start))
        best = np.maximum(best, swept)
    margin = best - cosine
    low, high = margin[:, :-1], margin[:, 1:]
    rise = np.where(low == high, 1.0, high - low)
    crossed = np.clip(np.where(low < 0.0, high, low) / np.abs(rise), 0.0, 1.0)
    share = np.where((low < 0.0) == (high < 0.0), low >= 0.0, crossed)
    return float(share.mean())


def greatest(steady: Any, cosine: Any, sine: Any, angle: float) -> Any:
    """Return the largest value of steady + cosine cos(a) + sine sin(a) for a from 0 to `angle`."""
    turn = abs(angle)
    sine = sine if angle >= 0.0 else -sine
    if turn >= 2.0 * pi:
        return steady + np.hypot(cosine, sine)
    ends = np.maximum(cosine, cosine * cos(turn) + sine * sin(turn))
    rises, falls = sine >= 0.0, sine * cos(turn) <= cosine * sin(turn)  # at the start, at the end
    inside = rises & falls if turn <= pi else rises | falls  # the crest, at the angle of (cosine, sine)
    return steady + np.where(inside, np.hypot(cosine, sine), ends)
