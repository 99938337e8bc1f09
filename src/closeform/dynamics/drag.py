"""Drag: air whose density falls by e each scale height, and what each craft gives it to push on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from closeform.arrays import Floats, number, numbers, of_each, shown
from closeform.motion.mean_motion import EARTH_RADIUS, checked

EARTH_SPIN = 7.292115e-5  # rad/s: GRS 80


@dataclass(frozen=True, eq=False)
class Drag:
    """Air about the Earth, and the ballistic coefficients of a formation.

    Parameters
    ----------
    density : float [kg/m^3]
        At `altitude`.
    altitude : float [m]
        Above the Earth's equatorial radius, at which it is that.
    scale_height : float [m]
        Over which the density falls by a factor e.
    ballistic : array of shape (N,) [m^2/kg]
        Drag coefficient times area over mass of each craft of a formation, in the order of its paths; one
        number for all.  Anything array_like will do.
    chief : float [m^2/kg]
        That of the chief; 0 if it is no craft but an orbit without drag.
    spin : float [rad/s], default that of the Earth
        At which the air turns with the body; 0 is air at rest.

    Raises
    ------
    ValueError
        If a number is not finite, negative, or a density or scale height is not positive.

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
    """The coefficients (N,) [m^2/kg] of `count` craft; 0 without drag."""
    return of_each("ballistic", 0.0 if drag is None else drag.ballistic, count)


def air_of(drag: Drag | None) -> list[float]:
    """Density [kg/m^3], its radius [m], scale height [m] and spin [rad/s], as kernels know air."""
    if drag is None:
        return [0.0, 0.0, 1.0, 0.0]
    return [drag.density, EARTH_RADIUS + drag.altitude, drag.scale_height, drag.spin]
