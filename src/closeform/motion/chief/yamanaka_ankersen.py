"""Table of a chief on an ellipse: closed form, with a proven bound of the remainder.

Six independent motions (Yamanaka and Ankersen 2002) are sums of terms

    coefficient * sin(nu)^a * cos(nu)^b * rho^c * J^d
    rho = 1 + e cos nu,   J = (1 - e^2)^(-3/2) n (t - t_k)

with the true anomaly nu.  In the eccentric anomaly s, with D = 1 - e cos s,

    cos nu = (cos s - e) / D,   sin nu = sqrt(1 - e^2) sin s / D,   rho = (1 - e^2) / D

so a motion is analytic in s wherever D is not 0.  A Chebyshev interpolant of degree m of a function that is
analytic in the Bernstein ellipse of a window, and there at most M, is off by at most

    4 M rho_b^-m / (rho_b - 1)    # theory (98), rho_b the sum of the half-axes, the window being [-1, 1]

(Trefethen 2013, theorem 8.2).  In that ellipse |Im s| <= b, so with x = Re s

    |cos s|, |sin s| <= cosh b,   |D| <= 1 + e cosh b,   |D| >= Re D >= 1 - e cosh b max(cos x, 0)

and |J| <= (1 - e^2)^(-3/2) max|D| |s - s_k|, as dt/ds = D.  Put into the terms, with absolute coefficients,
these are a bound M in closed form: nothing is sampled.  The least bound over several rho_b is taken.  `table`
uses it for interpolants of degree 29, of which the remainder is far below rounding.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Self

import numpy as np

from closeform.arrays import Floats
from closeform.motion.chief.table import CHECKS, COLUMNS, Table, build

# Bound of the error of a column, relative to its largest entry, that sets the number of windows.
WANTED = 3e-12
FEWEST, MOST = 6, 100  # windows of a revolution
ELLIPSES = np.geomspace(1.5, 400.0, 90)  # sums of half-axes that are tried
FINE = 2048  # steps of the integral that spaces windows


def _terms(e: float) -> list[tuple[int, int, float, int, int, int, int]]:
    """Return the terms of six motions: row of (r, v), motion, coefficient, powers of sin, cos, rho and J.

    Velocities are by the mean anomaly, multiplied by (1 - e^2)^(3/2) except for position rows.
    """
    x, y, z, vx, vy, vz = range(6)
    return [
        (y, 0, 1.0, 0, 0, -1, 0),
        (vy, 0, e, 1, 0, 0, 0),
        (x, 1, -1.0, 1, 0, 0, 0),
        (y, 1, -1.0, 0, 1, 0, 0),
        (y, 1, -1.0, 0, 1, -1, 0),
        (vx, 1, -1.0, 0, 1, 2, 0),
        (vy, 1, 1.0, 1, 0, 2, 0),
        (vy, 1, 1.0, 1, 0, 1, 0),
        (vy, 1, -e, 1, 1, 0, 0),
        (x, 2, -1.0, 0, 1, 0, 0),
        (y, 2, 1.0, 1, 0, 0, 0),
        (y, 2, 1.0, 1, 0, -1, 0),
        (vx, 2, 1.0, 1, 0, 2, 0),
        (vy, 2, 1.0, 0, 1, 2, 0),
        (vy, 2, 1.0, 0, 1, 1, 0),
        (vy, 2, e, 2, 0, 0, 0),
        (x, 3, 3.0 * e, 1, 0, 0, 1),
        (x, 3, -2.0, 0, 0, -1, 0),
        (y, 3, 3.0, 0, 0, 1, 1),
        (vx, 3, 3.0 * e, 0, 1, 2, 1),
        (vx, 3, e, 1, 0, 0, 0),
        (vy, 3, -3.0 * e, 1, 0, 2, 1),
        (vy, 3, 3.0, 0, 0, 1, 0),
        (z, 4, 1.0, 0, 1, -1, 0),
        (vz, 4, -1.0, 1, 0, 1, 0),
        (vz, 4, e, 1, 1, 0, 0),
        (z, 5, 1.0, 1, 0, -1, 0),
        (vz, 5, 1.0, 0, 1, 1, 0),
        (vz, 5, e, 2, 0, 0, 0),
    ]


def _sum(
    e: float, sine: Floats, cosine: Floats, rho: Floats, inverse: Floats, passed: Floats, sign: float
) -> Floats:
    """Return the six motions as columns (..., 6, 6); with `sign` 0 the sums of their terms' magnitudes.

    They are positions, and velocities by the mean anomaly.
    """
    out = np.zeros((*rho.shape, 6, 6))
    scale = (1.0 - e * e) ** -1.5
    powers = {-1: inverse, 0: np.ones_like(rho), 1: rho, 2: rho * rho}
    for row, motion, coefficient, a, b, c, d in _terms(e):
        value = coefficient if sign else abs(coefficient)
        term = value * sine**a * cosine**b * powers[c] * passed**d
        out[..., row, motion] += term if row < 3 else scale * term
    return out


def _real(e: float, s: Floats, begin: Floats) -> Floats:
    """Return the motions at angles (K, Q), with J from the beginnings (K,) of windows."""
    d = 1.0 - e * np.cos(s)
    root = np.sqrt(1.0 - e * e)
    start = begin[:, None]
    # the difference of two sines as a product: no digit is lost in a short window
    passed = (s - start) - 2.0 * e * np.cos(0.5 * (s + start)) * np.sin(0.5 * (s - start))
    cosine, sine = (np.cos(s) - e) / d, root * np.sin(s) / d
    scaled = passed * (1.0 - e * e) ** -1.5
    return _sum(e, sine, cosine, (1.0 - e * e) / d, d / (1.0 - e * e), scaled, 1.0)


def _form(e: float, columns: Floats, s: Floats) -> Floats:
    """Return the symplectic products (K, 6, 6) of the motions (K, 6, 6) at angles (K,), constant in time."""
    rate = (1.0 - e * e) ** 0.5 / (1.0 - e * np.cos(s)) ** 2
    place, speed = columns[:, :3], columns[:, 3:].copy()
    speed[:, 0] -= rate[:, None] * place[:, 1]  # v + w x r
    speed[:, 1] += rate[:, None] * place[:, 0]
    product = np.swapaxes(place, 1, 2) @ speed
    return product - np.swapaxes(product, 1, 2)


def _tails(e: float, joints: Floats) -> tuple[Floats, Floats]:
    """Return proven bounds (K, 15) on the interpolation errors of positions, and (K, 9) of returns."""
    half, middle = 0.5 * np.diff(joints)[:, None], 0.5 * (joints[1:] + joints[:-1])[:, None]
    tall = half * 0.5 * (ELLIPSES - 1.0 / ELLIPSES)
    wide = half * 0.5 * (ELLIPSES + 1.0 / ELLIPSES)
    grown = np.cosh(tall)
    away = np.abs((middle + np.pi) % (2.0 * np.pi) - np.pi) - wide  # of the nearest perigee
    ahead = np.where(away > 0.0, np.cos(np.clip(away, 0.0, np.pi)), 1.0)
    least = 1.0 - e * grown * np.maximum(ahead, 0.0)
    valid = least > 0.0
    least, grown = np.where(valid, least, 1.0), np.where(valid, grown, 1.0)
    most = 1.0 + e * grown
    far = half + wide  # |s - s_k|
    shape = 1.0 - e * e
    places = _sum(
        e,
        np.sqrt(shape) * grown / least,
        (grown + e) / least,
        shape / least,
        most / shape,
        shape**-1.5 * most * far,
        0.0,
    )[..., :3, :]
    start = _real(e, joints[:-1, None], joints[:-1])[:, 0]
    fit = np.abs(np.linalg.inv(start))[:, None]
    mixed = np.abs(np.linalg.inv(_form(e, start, joints[:-1])))[:, None]
    states = places @ fit
    # Phi(t, t') B = E^T-sums of the motions: positions at t, the inverse of their products, positions at t'
    answers = (most * far)[..., None, None] * (places @ mixed @ np.swapaxes(places, -1, -2))
    bounds = np.concatenate([states, answers @ states, answers], axis=-1).max(axis=-2)  # (K, ellipses, 15)
    share = np.where(valid, 4.0 * ELLIPSES**-CHECKS / (ELLIPSES - 1.0), np.inf)
    # twice, as the integrals are those of an interpolant as well
    sensed = np.concatenate([states, np.broadcast_to(np.eye(3), (*states.shape[:2], 3, 3))], axis=-1)
    back = np.abs(start)[:, None] @ mixed @ np.swapaxes(places, -1, -2) @ sensed
    back *= (most * far)[..., None, None]
    tails = 2.0 * share[..., None] * np.concatenate([bounds, back.max(axis=-2)], axis=-1)
    return tails[..., :COLUMNS].min(axis=1), tails[..., COLUMNS:].min(axis=1)


def joints_of(e: float, count: int, first: float, last: float) -> Floats:
    """Return joints from one angle to another, so many to a revolution."""
    turn = _joints(e, count)[:-1]
    turns = np.arange(np.floor(first / (2.0 * np.pi)), np.floor(last / (2.0 * np.pi)) + 1.0)
    joints = (2.0 * np.pi * turns[:, None] + turn).ravel()
    inside = joints[(joints > first + 1e-6) & (joints < last - 1e-6)]
    return np.concatenate([[first], inside, [last]])


def _joints(e: float, count: int) -> Floats:
    """Return joints of a revolution from perigee, at equal integrals of D^(-1/2) ds."""
    s = np.linspace(0.0, 2.0 * np.pi, FINE + 1)
    density = (1.0 - e * np.cos(s)) ** -0.5
    gathered = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]))])
    joints = np.interp(np.linspace(0.0, gathered[-1], count + 1), gathered, s)
    joints[0], joints[-1] = 0.0, 2.0 * np.pi
    return np.asarray(joints)


@lru_cache(maxsize=64)
def _revolution(e: float) -> Table:
    """Return the table of an eccentricity, for a chief of mean motion 1 that is at perigee at time 0."""
    count = FEWEST + int(26.0 * e)
    while True:
        made = _with(e, _joints(e, count))
        size = np.maximum(1.0, np.abs(made.rows[:, :, :3]).max(axis=(2, 3)))
        if (made.errors / size).max() <= WANTED or count >= MOST:
            return made
        count += 1 + count // 16


def _with(e: float, joints: Floats) -> Table:
    """Return the table with given joints."""
    lengths = np.diff(joints)

    def flow(u: Floats) -> tuple[Floats, Floats]:
        values = _real(e, joints[:-1, None] + lengths[:, None] * u, joints[:-1])
        fit = np.linalg.inv(_real(e, joints[:-1, None], joints[:-1]))
        return values @ fit, np.abs(values).max(axis=1) @ np.abs(fit[:, 0])

    return build(np.array([1.0, e, 0.0]), joints, 2.0 * np.pi, flow, *_tails(e, joints))


@dataclass(frozen=True)
class KeplerChief:
    """Chief on an ellipse about a point mass.

    `mean_motion` [rad/s], `eccentricity`, and `mean_anomaly` [rad] at time 0.
    """

    mean_motion: float
    eccentricity: float
    mean_anomaly: float

    span = -np.inf, np.inf  # times of the table [s]

    @classmethod
    def at(cls, semi_major_axis: float, eccentricity: float, true_anomaly: float, mu: float) -> Self:
        """Return the chief at a true anomaly [rad] at time 0; lengths in m, `mu` in m^3/s^2."""
        lean = eccentricity / (1.0 + np.sqrt(1.0 - eccentricity**2))
        cosine, sine = np.cos(true_anomaly), np.sin(true_anomaly)
        s = true_anomaly - 2.0 * np.arctan2(lean * sine, 1.0 + lean * cosine)
        rate = float(np.sqrt(mu / semi_major_axis) / semi_major_axis)
        return cls(rate, float(eccentricity), float(s - eccentricity * np.sin(s)))

    def __str__(self) -> str:
        return f"an eccentric chief (e = {self.eccentricity:g})"

    @property
    def period(self) -> float:
        """Duration of one revolution [s]."""
        return 2.0 * np.pi / self.mean_motion

    def growth(self, angle: float) -> float:
        """Return the rate of the radius over the radius [1/s] at an eccentric anomaly [rad]."""
        e = self.eccentricity
        return float(self.mean_motion * e * np.sin(angle) / (1.0 - e * np.cos(angle)) ** 2)

    @cached_property
    def table(self) -> Table:
        """Table of one revolution, which repeats."""
        clock = np.array([self.mean_motion, self.eccentricity, self.mean_anomaly])
        return _revolution(self.eccentricity)._replace(clock=clock)
