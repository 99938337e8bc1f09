"""Targets: relative orbits that people name, and where a formation can go, as states (N, 6) in m and m/s."""

from closeform.planning.dispersal import (
    added_member,
    regathered,
    scattered,
    scattered_from,
    without_altitude_difference,
    without_eccentricity,
)
from closeform.planning.relative_orbits import (
    line,
    pendulum,
    projected_circular,
    safety_ellipse,
    separated_ring,
    string_of_pearls,
)

__all__ = [
    "added_member",
    "line",
    "pendulum",
    "projected_circular",
    "regathered",
    "safety_ellipse",
    "scattered",
    "scattered_from",
    "separated_ring",
    "string_of_pearls",
    "without_altitude_difference",
    "without_eccentricity",
]
