"""Target states (N, 6) [m, m/s]: named relative orbits, and destinations of a formation's manoeuvres."""

from closeform.planning.targets.dispersal import (
    added_member,
    regathered,
    scattered,
    scattered_from,
    without_altitude_difference,
    without_eccentricity,
)
from closeform.planning.targets.relative_orbits import (
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
