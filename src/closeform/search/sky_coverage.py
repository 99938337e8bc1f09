"""Sky that a search covers: tip angle of the out-of-plane turns, near field, and share swept by the cone."""

from collections.abc import Sequence
from math import acos, atan2, cos, degrees, inf, pi, sin, sqrt, tan
from typing import Any

import numpy as np

from closeform.search.leg import Leg, greatest
from closeform.search.sensor import Sensor


def full_tip(half_angle: float) -> float:
    """Return the tip [rad] that covers a complementary cone, for a half-angle of at least 45 deg.

    S04 eq. 1. Raises ValueError for a smaller half-angle.
    """
    c = cos(half_angle)
    if half_angle >= pi / 2.0:
        return 0.0  # no complementary cone
    if 1.0 - 2.0 * c * c < 0.0 and half_angle < pi / 4.0:
        raise ValueError(
            f"half_angle: {degrees(half_angle):g} deg is below 45 deg; no tip covers the complementary "
            "cones; use a wider sensor, or the basic search"
        )
    return atan2(c, sqrt(max(0.0, 1.0 - 2.0 * c * c)))


def least_half_angle(tip: float) -> float:
    """Return the half-angle [rad] for which a tip covers a complementary cone: S04 eq. 1 inverted."""
    return acos(tan(tip) / sqrt(1.0 + 2.0 * tan(tip) ** 2))


def near_field(sensor: Sensor, tip: float) -> float:
    """Return the length [m] along the sun line of the region that the own cone never covers.

    `tip`: the tip angle [rad].
    """
    if sensor.offset == 0.0:
        return 0.0
    # a point h up the sun line, seen from the sensor at its highest tip, lies on the cone:
    # h sin(tip) - rho = c sqrt(rho^2 + h^2 - 2 rho h sin(tip))                     # theory (16)
    reach, c = sin(tip), sensor.cosine
    if reach <= c:
        return inf
    a, b, ss = reach * reach - c * c, reach * (1.0 - c * c), 1.0 - c * c
    root = sqrt(max(0.0, b * b - a * ss))
    return sensor.offset * ((b + root) / a if c > 0.0 else ss / (b + root))


def covered_share(legs: Sequence[Leg], cosine: float) -> float:
    """Return the share of all directions that come within the cone in any leg.

    Along each meridian the largest cosine to the boresight is sampled at equal steps of height, which are
    equal areas. Its crossings of the cone are interpolated.
    """
    height = np.linspace(-1.0, 1.0, 1001)
    longitude = (np.arange(360) + 0.5) * pi / 180.0
    radius = np.sqrt(1.0 - height * height)
    best = np.full((360, 1001), -1.0)
    for leg in legs:
        parts: list[Any] = []
        for vector in leg.parts[:, :, 2]:
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
