"""The rule of thumb of how far off craft end in a real field, where thrust is played as planned."""

from math import hypot
from typing import Any

from closeform.motion.mean_motion import EARTH_J2, EARTH_RADIUS

# Of 240 plans at 500 km flown open loop: what half of them, and 95 %, do not exceed.      # theory (84)
HALF, MOST = (7.7, 13.0, 9.4, 1.5), (15.3, 20.0, 17.0, 1.5)


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
    return turns * (off + curved * distance**2 / semi_major_axis) + by_drag * dragged
