"""Semi-major axis and eccentricity of a chief from the arguments that users pass, validated."""

import warnings
from typing import cast

import numpy as np

from closeform.arrays import number, positive
from closeform.motion.elements.mean_motion import EARTH_RADIUS, low

# Above, the shortest windows are those of seconds, and the transition matrix of a revolution loses digits.
LARGEST = 0.9


def ellipse_of(
    eccentricity: float,
    semi_major_axis: float | None,
    perigee_altitude: float | None,
    mu: float,
    radius: float,
) -> tuple[float, float]:
    """Return semi-major axis [m] and eccentricity; raise ValueError for an orbit that is none."""
    e, body = number("eccentricity", eccentricity), number("radius", radius)
    positive("mu", mu, " m^3/s^2")
    if not 0.0 <= e <= LARGEST:
        raise ValueError(
            f"eccentricity: must be from 0 to {LARGEST:g}, got {e:g}; closer to 1 the tables lose accuracy"
        )
    if not 0.0 <= body < np.inf:
        raise ValueError(f"radius: must be finite and at least 0 m, got {body:g}")
    if (semi_major_axis is None) == (perigee_altitude is None):
        raise ValueError("semi_major_axis, perigee_altitude: give exactly one of them")
    if semi_major_axis is None:
        altitude = number("perigee_altitude", cast(float, perigee_altitude))
        if not 0.0 < altitude < np.inf:
            raise ValueError(
                f"perigee_altitude: must be finite and above the surface, got {altitude:g} m; raise it"
            )
        if body == EARTH_RADIUS and (line := low(altitude)):
            warnings.warn(f"perigee_altitude: {line}", stacklevel=3)
        return (body + altitude) / (1.0 - e), e
    size = positive("semi_major_axis", semi_major_axis, " m")
    if size * (1.0 - e) <= body:
        raise ValueError(
            f"semi_major_axis: perigee is {body - size * (1.0 - e):.6g} m below the surface; it must exceed "
            f"{body / (1.0 - e):.7g} m at this eccentricity, or set `radius` to that of the body"
        )
    return size, e
