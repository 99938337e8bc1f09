"""Orbital elements [a, u, ex, ey, i, O] of an inertial state, and back.

Pure NumPy; both broadcast over leading shapes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, number
from closeform.motion.elements.mean_motion import EARTH_MU, checked

KEPLER_ITERATIONS = 50  # Newton needs 3 to 8 from the start used here


def elements_from_inertial(state: ArrayLike, mu: float = EARTH_MU) -> Floats:
    """Return the quasi-nonsingular orbital elements of an inertial state.

    Parameters
    ----------
    state : array_like of shape (..., 6) [m, m/s]
        State in an inertial frame centred on the body; it must be on an ellipse.
    mu : float [m^3/s^2], default that of the Earth
        Gravitational parameter of the body.

    Returns
    -------
    array of shape (..., 6) [m, rad, no unit, no unit, rad, rad]
        Elements [a, u, ex, ey, i, O]: semi-major axis, mean argument of latitude u = M + w,
        (ex, ey) = e (cos w, sin w), inclination, right ascension of the ascending node.  They stay
        regular at e = 0; at i = 0 or pi the node is arbitrary, and u with it.

    Raises
    ------
    ValueError
        If the orbit is open (e >= 1), the motion along a straight line, `mu` not positive, shapes do not
        fit, or a value is not finite.

    References
    ----------
    D'Amico, Autonomous Formation Flying in Low Earth Orbit, TU Delft 2010; docs/elements.md.
    """
    inertial = checked("state", state, last=6)
    mu = checked("mu", number("mu", mu), positive=True)
    position, velocity = inertial[..., :3], inertial[..., 3:]
    momentum = np.cross(position, velocity)
    r, h = _length(position), _length(momentum)
    if not (h > 0.0).all():
        raise ValueError("state: position and velocity must span an orbital plane")
    a = 1.0 / (2.0 / r - (velocity * velocity).sum(-1) / mu)
    radial = (position * velocity).sum(-1) / r
    e_cos, e_sin = h * h / (mu * r) - 1.0, h * radial / mu  # e (cos, sin) of the true anomaly
    if not ((a > 0.0) & (np.hypot(e_cos, e_sin) < 1.0)).all():
        raise ValueError("state: the orbit must be an ellipse (e < 1); check the units, m and m/s")

    inclination = np.arctan2(np.hypot(momentum[..., 0], momentum[..., 1]), momentum[..., 2])
    node = np.arctan2(momentum[..., 0], -momentum[..., 1])
    to_node, across = _plane(node, inclination)
    x, y = (position * to_node).sum(-1), (position * across).sum(-1)
    cos, sin = x / r, y / r  # of the true argument of latitude
    ex, ey = e_cos * cos + e_sin * sin, e_cos * sin - e_sin * cos
    root = np.sqrt(1.0 - ex * ex - ey * ey)
    beta = 1.0 / (1.0 + root)
    cos_f = ex + ((1.0 - beta * ex * ex) * x - beta * ex * ey * y) / (a * root)
    sin_f = ey + ((1.0 - beta * ey * ey) * y - beta * ex * ey * x) / (a * root)
    u = np.arctan2(sin_f, cos_f) - ex * sin_f + ey * cos_f  # Kepler's equation
    return np.stack([a, u, ex, ey, inclination, node], axis=-1)


def inertial_from_elements(elements: ArrayLike, mu: float = EARTH_MU) -> Floats:
    """Return the inertial state of orbital elements: the inverse of `elements_from_inertial`.

    Parameters
    ----------
    elements : array_like of shape (..., 6) [m, rad, no unit, no unit, rad, rad]
        Elements [a, u, ex, ey, i, O].
    mu : float [m^3/s^2], default that of the Earth
        Gravitational parameter of the body.

    Returns
    -------
    array of shape (..., 6) [m, m/s]
        State in the inertial frame, centred on the body.

    Raises
    ------
    ValueError
        If a is not positive, e not below 1, `mu` not positive, shapes do not fit, or a value is not
        finite.

    References
    ----------
    D'Amico, Autonomous Formation Flying in Low Earth Orbit, TU Delft 2010; docs/elements.md.
    """
    a, u, ex, ey, inclination, node = ellipse("elements", elements)
    mu = checked("mu", number("mu", mu), positive=True)
    f = eccentric_latitude(u, ex, ey)
    cos, sin = np.cos(f), np.sin(f)
    beta = 1.0 / (1.0 + np.sqrt(1.0 - ex * ex - ey * ey))
    xx, xy, yy = 1.0 - beta * ey * ey, beta * ex * ey, 1.0 - beta * ex * ex
    rate = np.sqrt(mu / a) / (1.0 - ex * cos - ey * sin)  # a times the rate of f
    to_node, across = _plane(node, inclination)
    x, y = a * (xx * cos + xy * sin - ex), a * (yy * sin + xy * cos - ey)
    vx, vy = rate * (xy * cos - xx * sin), rate * (yy * cos - xy * sin)
    position = x[..., None] * to_node + y[..., None] * across
    return np.concatenate([position, vx[..., None] * to_node + vy[..., None] * across], axis=-1)


def inertial_later(state: ArrayLike, time: ArrayLike, mu: float = EARTH_MU) -> Floats:
    """Return inertial states (..., 6) [m, m/s] after times (...) [s] of Keplerian motion."""
    elements = elements_from_inertial(state, mu)
    ahead = np.sqrt(mu / elements[..., 0]) / elements[..., 0] * np.asarray(time)
    turned = np.broadcast_to(elements, np.shape(ahead) + (6,)).copy()
    turned[..., 1] += ahead
    return inertial_from_elements(turned, mu)


def ellipse(name: str, elements: ArrayLike) -> Any:
    """Return the six elements of an argument; raise ValueError unless they are those of ellipses."""
    parts = np.moveaxis(checked(name, elements, last=6), -1, 0)
    if not ((parts[0] > 0.0) & (np.hypot(parts[2], parts[3]) < 1.0)).all():
        raise ValueError(f"{name}: the orbit must be an ellipse: a > 0 and ex^2 + ey^2 < 1")
    return parts


def _plane(node: Any, inclination: Any) -> tuple[Floats, Floats]:
    """Return unit vectors (..., 3) in the orbital plane: to the ascending node, and 90 degrees ahead."""
    cos, sin, tilt = np.cos(node), np.sin(node), np.cos(inclination)
    to_node = np.stack([cos, sin, np.zeros_like(cos)], axis=-1)
    return to_node, np.stack([-sin * tilt, cos * tilt, np.sin(inclination)], axis=-1)


def eccentric_latitude(u: Any, ex: Any, ey: Any) -> Any:
    """Solve Kepler's equation u = f - ex sin f + ey cos f for f, the eccentric anomaly plus w."""
    perigee = np.arctan2(ey, ex)
    # Danby's start: M + 0.85 e on the side of M, from which Newton's method converges.
    f = u + 0.85 * np.hypot(ex, ey) * np.sign(np.sin(u - perigee))
    for _ in range(KEPLER_ITERATIONS):
        cos, sin = np.cos(f), np.sin(f)
        step = (f - ex * sin + ey * cos - u) / (1.0 - ex * cos - ey * sin)
        f = f - step
        if np.abs(step).max(initial=0.0) < 1e-15 * max(1.0, np.abs(f).max(initial=0.0)):
            break
    return f


def _length(vector: Floats) -> Any:
    return np.sqrt((vector * vector).sum(-1))
