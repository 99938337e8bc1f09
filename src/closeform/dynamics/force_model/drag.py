"""Atmospheric drag: an exponential atmosphere, and the ballistic coefficients of spacecraft.

An atmosphere that rotates with the body gives

    -B/2 rho |w| w,  w = v - spin e_z x r,  B = Cd A/m                                       # theory (81)
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, sqrt
from typing import Any

import numpy as np

from closeform._jit import kernel
from closeform.arrays import Floats, number, numbers, of_each, shown
from closeform.dynamics.force_model.gravity import DEGREES, ZONALS
from closeform.motion.elements.mean_motion import EARTH_RADIUS, checked

EARTH_SPIN = 7.292115e-5  # rad/s: GRS 80
DENSITY = ZONALS + DEGREES  # index of the atmosphere among the constants of a force model
REFERENCE, SCALE_HEIGHT, SPIN, WIDTH = DENSITY + 1, DENSITY + 2, DENSITY + 3, DENSITY + 4


@dataclass(frozen=True, eq=False)
class Drag:
    """Exponential atmosphere, and the ballistic coefficients of a formation.

    Parameters
    ----------
    density : float [kg/m^3]
        Density at `altitude`.
    altitude : float [m]
        Reference altitude above the Earth's equatorial radius.
    scale_height : float [m]
        Height over which the density falls by a factor of e.
    ballistic : array of shape (N,) [m^2/kg]
        Drag coefficient times area over mass of each spacecraft, in the order of the paths; one number for
        all. Any array_like is accepted.
    chief : float [m^2/kg]
        Coefficient of the chief; 0 for a reference orbit without drag.
    spin : float [rad/s], default that of the Earth
        Rotation rate of the atmosphere; 0 for an atmosphere at rest.

    Raises
    ------
    ValueError
        If a number is negative or not finite, or a density or scale height is not positive.

    References
    ----------
    docs/theory.md (81).

    Examples
    --------
    >>> import closeform as cf
    >>> air = cf.Drag(5.2e-13, 500e3, 60e3, ballistic=[0.02, 0.022], chief=0.02)
    """

    density: float
    altitude: float
    scale_height: float
    ballistic: Floats
    chief: float
    spin: float = EARTH_SPIN

    def __post_init__(self) -> None:
        for name in ("density", "scale_height"):
            object.__setattr__(self, name, checked(name, number(name, getattr(self, name)), positive=True))
        for name in ("altitude", "chief", "spin"):
            object.__setattr__(self, name, checked(name, number(name, getattr(self, name))))
        ballistic = numbers("ballistic", self.ballistic)
        if (
            ballistic.ndim > 1
            or not (np.isfinite(ballistic) & (ballistic >= 0.0)).all()
            or not self.chief >= 0.0
        ):
            got = shown(self.ballistic if self.chief >= 0.0 else self.chief)
            raise ValueError(f"ballistic: expected m^2/kg of each craft, 0 or more, got {got}")
        object.__setattr__(self, "ballistic", ballistic)


def ballistics_of(drag: Drag | None, count: int) -> Floats:
    """Return the coefficients (N,) [m^2/kg] of `count` spacecraft; 0 without drag."""
    return of_each("ballistic", 0.0 if drag is None else drag.ballistic, count)


def air_of(drag: Drag | None) -> list[float]:
    """Return density [kg/m^3], its radius [m], scale height [m] and spin [rad/s], for kernels."""
    if drag is None:
        return [0.0, 0.0, 1.0, 0.0]
    return [drag.density, EARTH_RADIUS + drag.altitude, drag.scale_height, drag.spin]


@kernel(inline=True)
def drag_acceleration(
    constants: Floats, ballistic: float, x: float, y: float, z: float, vx: float, vy: float, vz: float
) -> Any:
    """Return the acceleration by drag of a spacecraft with a ballistic coefficient."""
    r = sqrt(x * x + y * y + z * z)
    density = constants[DENSITY] * exp((constants[REFERENCE] - r) / constants[SCALE_HEIGHT])
    wx, wy = vx + constants[SPIN] * y, vy - constants[SPIN] * x
    slowed = -0.5 * ballistic * density * sqrt(wx * wx + wy * wy + vz * vz)
    return slowed * wx, slowed * wy, slowed * vz
