"""Tip angle of the out-of-plane turns of a search, and the region that it covers."""

from math import acos, atan2, cos, degrees, inf, pi, sin, sqrt, tan

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
