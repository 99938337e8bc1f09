"""The rule of thumb of how far off craft end in a real field, where thrust is played as planned."""

from math import hypot
from typing import Any

from closeform.motion.mean_motion import EARTH_J2, EARTH_RADIUS

# What half of plans, and 95 %, do not exceed: of those that tools/rule_of_thumb.py draws.      # theory (84)
HALF, MOST = (7.7, 6.2, 5.8, 1.5), (15.3, 19.4, 26.6, 1.5)
SHORTEST = 1.0  # turns: what ends sooner is about as far off as what lasts an orbit


def flattening_at(semi_major_axis: float, j2: float = EARTH_J2, radius: float = EARTH_RADIUS) -> float:
    """How much of the pull is that of the flattening, no unit: K = J2 (R / a)^2."""
    return j2 * (radius / semi_major_axis) ** 2


def ends_off(
    distance: Any,
    turns: float,
    semi_major_axis: float,
    eccentricity: float,
    flattening: float,
    rule: tuple[float, ...],
    dragged: Any = 0.0,
) -> Any:
    """How far off [m] craft end that come so far from the chief [m], after some turns.

    `dragged` is what air alone brings craft apart: difference of accelerations times the time squared [m].
    """
    curved, eccentric, flattened, by_drag = rule
    off = hypot(eccentric * eccentricity, flattened * flattening) * distance
    return max(turns, SHORTEST) * (off + curved * distance**2 / semi_major_axis) + by_drag * dragged
