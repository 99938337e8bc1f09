"""Orbital elements: mean motion, Palmer's coordinates, relative orbital elements.

Pure NumPy; every function broadcasts over leading shapes.  SI units and radians.

    mean motion              of an altitude, a period or a semi-major axis, and back
    Palmer's coordinates     [e1, e2, d, l, h1, h2] of a state in the Hill frame, and back
    orbital elements         [a, u, ex, ey, i, O] of an inertial state, and back
    relative elements (ROE)  [da, dl, dex, dey, dix, diy] of two sets of elements, exactly, or of
                             a state in the Hill frame, to first order; both invertible

ROE are those of D'Amico (Autonomous Formation Flying in Low Earth Orbit, TU Delft 2010).
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, broadcast, number, numbers

EARTH_MU = 3.986004418e14
"""Earth's gravitational parameter [m^3/s^2], WGS 84 (also IERS Conventions 2010, table 1.1)."""

EARTH_RADIUS = 6378137.0
"""Earth's equatorial radius [m], WGS 84."""

LEAST_SIN_INCLINATION = 1e-6
"""Below this sine of the chief's inclination the node, and with it the ROE, is refused."""

KEPLER_ITERATIONS = 50  # Newton needs 3 to 8 from the start used here


def checked(name: str, value: ArrayLike, *, positive: bool = False, last: int | None = None) -> Any:
    """`value` as finite floats; ValueError names the argument and what is wrong with it."""
    array = numbers(name, value)
    if last is not None and (array.ndim == 0 or array.shape[-1] != last):
        raise ValueError(f"{name}: expected shape (..., {last}), got {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name}: every value must be finite")
    if positive and not (array > 0.0).all():
        raise ValueError(f"{name}: must be positive, got {array.min():g}")
    return array if array.ndim else float(array)


def mean_motion_from_semi_major_axis(semi_major_axis: ArrayLike, mu: float = EARTH_MU) -> Any:
    """Mean motion [rad/s] of an orbit of `semi_major_axis` [m] about a body of `mu` [m^3/s^2].

    Raises ValueError unless both are positive and finite.  Kepler's third law.
    """
    a = checked("semi_major_axis", semi_major_axis, positive=True)
    return np.sqrt(checked("mu", mu, positive=True) / a) / a


def mean_motion_from_altitude(altitude: ArrayLike, mu: float = EARTH_MU, radius: float = EARTH_RADIUS) -> Any:
    """Mean motion [rad/s] of a circular orbit at `altitude` [m] above a body of `radius` [m].

    Raises ValueError unless mu, radius and their sum with the altitude are positive and finite.
    """
    a = checked("altitude", altitude) + checked("radius", radius, positive=True)
    return mean_motion_from_semi_major_axis(checked("altitude + radius", a, positive=True), mu)


def mean_motion_from_period(period: ArrayLike) -> Any:
    """Mean motion [rad/s] of an orbit of `period` [s].  Raises ValueError unless that is positive."""
    return 2.0 * np.pi / checked("period", period, positive=True)


def semi_major_axis_from_mean_motion(mean_motion: ArrayLike, mu: float = EARTH_MU) -> Any:
    """Semi-major axis [m] of an orbit of `mean_motion` [rad/s] about a body of `mu` [m^3/s^2].

    Raises ValueError unless both are positive and finite.
    """
    n = checked("mean_motion", mean_motion, positive=True)
    return np.cbrt(checked("mu", mu, positive=True) / (n * n))


def altitude_from_mean_motion(
    mean_motion: ArrayLike, mu: float = EARTH_MU, radius: float = EARTH_RADIUS
) -> Any:
    """Altitude [m] of the circular orbit of `mean_motion` [rad/s] above a body of `radius` [m].

    Raises ValueError unless the mean motion, `mu` [m^3/s^2] and the radius are positive and finite.
    """
    return semi_major_axis_from_mean_motion(mean_motion, mu) - checked("radius", radius, positive=True)


def period_from_mean_motion(mean_motion: ArrayLike) -> Any:
    """Period [s] of an orbit of `mean_motion` [rad/s].  Raises ValueError unless that is positive."""
    return 2.0 * np.pi / checked("mean_motion", mean_motion, positive=True)


def palmer_from_state(state: ArrayLike, mean_motion: ArrayLike) -> Floats:
    """Palmer's phase-space coordinates [e1, e2, d, l, h1, h2] (..., 6) in m.

    state: (..., 6) in m and m/s in the Hill frame of a circular orbit of `mean_motion` [rad/s],
    a scalar or of the states' leading shape.  (e1, e2) is the eccentricity difference, d and l
    the difference of semi-major axis and of mean longitude, (h1, h2) that of inclination; all
    are constant or turn uniformly, save l, which drifts.  Raises ValueError at n = 0, where the
    coordinates do not exist.                                                     # theory (2)
    """
    n, states = checked("mean_motion", mean_motion, positive=True), checked("state", state, last=6)
    broadcast(state=states.shape[:-1], mean_motion=np.shape(n))
    x, y, z, vx, vy, vz = np.moveaxis(states, -1, 0)
    e1, d = 3.0 * x + 2.0 * vy / n, 2.0 * x + vy / n
    return np.stack(np.broadcast_arrays(e1, vx / n, d, y - 2.0 * vx / n, z, vz / n), axis=-1)


def state_from_palmer(palmer: ArrayLike, mean_motion: ArrayLike) -> Floats:
    """State (..., 6) in m and m/s in the Hill frame: the inverse of `palmer_from_state`.

    palmer: [e1, e2, d, l, h1, h2] (..., 6) in m; `mean_motion` [rad/s].  Raises ValueError unless
    that is above zero.                                                            # theory (3)
    """
    n, given = checked("mean_motion", mean_motion, positive=True), checked("palmer", palmer, last=6)
    broadcast(palmer=given.shape[:-1], mean_motion=np.shape(n))
    e1, e2, d, l, h1, h2 = np.moveaxis(given, -1, 0)  # noqa: E741
    vy = n * (2.0 * e1 - 3.0 * d)
    return np.stack(np.broadcast_arrays(2.0 * d - e1, l + 2.0 * e2, h1, n * e2, vy, n * h2), axis=-1)


def elements_from_inertial(state: ArrayLike, mu: float = EARTH_MU) -> Floats:
    """Quasi-nonsingular orbital elements [a, u, ex, ey, i, O] (..., 6) in m and rad.

    state: (..., 6) inertial, m and m/s, on an ellipse.  u = M + w is the mean argument of
    latitude, (ex, ey) = e (cos w, sin w), O the right ascension of the ascending node.  They stay
    regular at e = 0; at i = 0 or pi the node is arbitrary, and u with it.  `mu` [m^3/s^2].
    Raises ValueError for an open orbit (e >= 1) and for motion along a straight line.
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
    """Inertial state (..., 6) in m and m/s: the inverse of `elements_from_inertial`.

    elements: [a, u, ex, ey, i, O] (..., 6); `mu` [m^3/s^2].  Raises ValueError unless a > 0 and
    e < 1.
    """
    a, u, ex, ey, inclination, node = _ellipse("elements", elements)
    mu = checked("mu", number("mu", mu), positive=True)
    f = _eccentric_latitude(u, ex, ey)
    cos, sin = np.cos(f), np.sin(f)
    beta = 1.0 / (1.0 + np.sqrt(1.0 - ex * ex - ey * ey))
    xx, xy, yy = 1.0 - beta * ey * ey, beta * ex * ey, 1.0 - beta * ex * ex
    rate = np.sqrt(mu / a) / (1.0 - ex * cos - ey * sin)  # a times the rate of f
    to_node, across = _plane(node, inclination)
    x, y = a * (xx * cos + xy * sin - ex), a * (yy * sin + xy * cos - ey)
    vx, vy = rate * (xy * cos - xx * sin), rate * (yy * cos - xy * sin)
    position = x[..., None] * to_node + y[..., None] * across
    return np.concatenate([position, vx[..., None] * to_node + vy[..., None] * across], axis=-1)


def roe_from_elements(chief: ArrayLike, deputy: ArrayLike) -> Floats:
    """Exact relative orbital elements [da, dl, dex, dey, dix, diy] (..., 6), no units and rad.

    chief, deputy: orbital elements [a, u, ex, ey, i, O] (..., 6).  With differences deputy minus
    chief and the chief's a and i

        da = Da / a   dl = Du + DO cos i   dex, dey = Dex, Dey   dix = Di   diy = DO sin i

    (D'Amico 2010).  Times a they are lengths.  dix and diy are the tilt of the orbital plane only
    while it is small against i; Raises ValueError where sin i of the chief is below 1e-6, as the
    node is then noise: use Palmer's coordinates there.
    """
    c, d = _ellipse("chief", chief), _ellipse("deputy", deputy)
    sine = _sine("chief", c[4])
    node = _wrapped(d[5] - c[5])
    longitude = _wrapped(d[1] - c[1] + node * np.cos(c[4]))
    return np.stack(
        [(d[0] - c[0]) / c[0], longitude, d[2] - c[2], d[3] - c[3], d[4] - c[4], node * sine], axis=-1
    )


def elements_from_roe(chief: ArrayLike, roe: ArrayLike) -> Floats:
    """The deputy's orbital elements [a, u, ex, ey, i, O] (..., 6): inverse of `roe_from_elements`.

    chief: orbital elements (..., 6); roe: [da, dl, dex, dey, dix, diy] (..., 6).  Raises ValueError
    where sin i of the chief is below 1e-6, and where no ellipse results.
    """
    a, u, ex, ey, inclination, right_ascension = _ellipse("chief", chief)
    da, dl, dex, dey, dix, diy = np.moveaxis(checked("roe", roe, last=6), -1, 0)
    node = diy / _sine("chief", inclination)
    longitude = u + dl - node * np.cos(inclination)
    tilted, turned = inclination + dix, right_ascension + node
    deputy = np.stack([a * (1.0 + da), longitude, ex + dex, ey + dey, tilted, turned], axis=-1)
    _ellipse("roe", deputy)
    return deputy


def scaled_roe_from_state(state: ArrayLike, mean_motion: ArrayLike, latitude: ArrayLike = 0.0) -> Floats:
    """Relative orbital elements a [da, dl, dex, dey, dix, diy] (..., 6) in m of a state, to first order.

    state: (..., 6) in m and m/s in the Hill frame of a chief on a circular orbit of `mean_motion`
    [rad/s], whose argument of latitude at that time is `latitude` [rad].  The error falls with the
    square of the separation and is of the order of the eccentricity times it for a chief that is not
    on a circle.  Linear, and regular at any inclination; all are constant on a natural orbit but for
    a dl, which drifts by -3/2 n a da.        (D'Amico 2010, eqs. 2.2 and 2.17; Palmer's coordinates turned)

    Raises ValueError for wrong shapes and unless the mean motion is positive.
    """
    palmer, u = palmer_from_state(state, mean_motion), checked("latitude", latitude)
    broadcast(state=palmer.shape[:-1], latitude=np.shape(u))
    e1, e2, d, l, h1, h2 = np.moveaxis(palmer, -1, 0)  # noqa: E741
    cos, sin = np.cos(u), np.sin(u)
    turned = e1 * cos + e2 * sin, e1 * sin - e2 * cos, h1 * sin + h2 * cos, h2 * sin - h1 * cos
    return np.stack(np.broadcast_arrays(2.0 * d, l, *turned), axis=-1)


def state_from_scaled_roe(scaled: ArrayLike, mean_motion: ArrayLike, latitude: ArrayLike = 0.0) -> Floats:
    """State (..., 6) in m and m/s in the Hill frame: the inverse of `scaled_roe_from_state`.

    scaled: a [da, dl, dex, dey, dix, diy] (..., 6) in m; `mean_motion` [rad/s] and `latitude` [rad]
    of the chief, on a circular orbit.  Raises ValueError as `scaled_roe_from_state`.
    """
    given, u = checked("scaled", scaled, last=6), checked("latitude", latitude)
    n = checked("mean_motion", mean_motion, positive=True)
    broadcast(scaled=given.shape[:-1], mean_motion=np.shape(n), latitude=np.shape(u))
    da, dl, dex, dey, dix, diy = np.moveaxis(given, -1, 0)
    cos, sin = np.cos(u), np.sin(u)
    eccentricity = dex * cos + dey * sin, dex * sin - dey * cos
    inclination = dix * sin - diy * cos, dix * cos + diy * sin
    palmer = np.stack(np.broadcast_arrays(*eccentricity, 0.5 * da, dl, *inclination), axis=-1)
    return state_from_palmer(palmer, n)


def roe_from_state(
    state: ArrayLike, semi_major_axis: ArrayLike, latitude: ArrayLike, mu: float = EARTH_MU
) -> Floats:
    """Relative orbital elements (..., 6), no units and rad, of a state in the Hill frame, to first order.

    state: (..., 6) in m and m/s beside a chief on a circular orbit of `semi_major_axis` [m] about a body
    of `mu` [m^3/s^2], at argument of latitude `latitude` [rad]: those of `scaled_roe_from_state`, by a.
    Raises ValueError for wrong shapes and unless the semi-major axis and `mu` are positive.
    """
    a = checked("semi_major_axis", semi_major_axis, positive=True)
    _agree(checked("state", state, last=6), a, latitude, mu)
    scaled = scaled_roe_from_state(state, mean_motion_from_semi_major_axis(a, mu), latitude)
    return np.asarray(scaled / np.asarray(a)[..., None])


def state_from_roe(
    roe: ArrayLike, semi_major_axis: ArrayLike, latitude: ArrayLike, mu: float = EARTH_MU
) -> Floats:
    """State (..., 6) in m and m/s in the Hill frame: the inverse of `roe_from_state`.

    roe: [da, dl, dex, dey, dix, diy] (..., 6); `semi_major_axis` [m] and `latitude` [rad] of the
    chief, on a circular orbit about a body of `mu` [m^3/s^2].  Raises as `roe_from_state`.
    """
    a = checked("semi_major_axis", semi_major_axis, positive=True)
    _agree(checked("roe", roe, last=6), a, latitude, mu)
    scaled = checked("roe", roe, last=6) * np.asarray(a)[..., None]
    return state_from_scaled_roe(scaled, mean_motion_from_semi_major_axis(a, mu), latitude)


def _agree(rows: Floats, semi_major_axis: Any, latitude: ArrayLike, mu: float) -> None:
    """ValueError unless the arguments of `roe_from_state` broadcast."""
    number("mu", mu)
    shapes = {"semi_major_axis": np.shape(semi_major_axis), "latitude": numbers("latitude", latitude).shape}
    broadcast(rows=rows.shape[:-1], **shapes)


def _length(vector: Floats) -> Any:
    return np.sqrt((vector * vector).sum(-1))


def _wrapped(angle: Any) -> Any:
    return angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi))


def _sine(name: str, inclination: Floats) -> Any:
    sine = np.sin(inclination)
    if not (sine > LEAST_SIN_INCLINATION).all():
        raise ValueError(f"{name}: inclination 0 or pi has no node; use palmer_from_state instead")
    return sine


def _ellipse(name: str, elements: ArrayLike) -> Any:
    parts = np.moveaxis(checked(name, elements, last=6), -1, 0)
    if not ((parts[0] > 0.0) & (np.hypot(parts[2], parts[3]) < 1.0)).all():
        raise ValueError(f"{name}: the orbit must be an ellipse: a > 0 and ex^2 + ey^2 < 1")
    return parts


def _plane(node: Any, inclination: Any) -> tuple[Floats, Floats]:
    """Unit vectors (..., 3) in the orbital plane: to the ascending node, and 90 degrees ahead."""
    cos, sin, tilt = np.cos(node), np.sin(node), np.cos(inclination)
    to_node = np.stack([cos, sin, np.zeros_like(cos)], axis=-1)
    return to_node, np.stack([-sin * tilt, cos * tilt, np.sin(inclination)], axis=-1)


def _eccentric_latitude(u: Any, ex: Any, ey: Any) -> Any:
    """Eccentric anomaly plus w: the root f of u = f - ex sin f + ey cos f (Kepler's equation)."""
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
