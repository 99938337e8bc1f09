"""Tracking-error tube: bound on the deviation of a spacecraft under feedback from its planned path."""

from __future__ import annotations

from dataclasses import dataclass
from math import erfc, pi, sqrt
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike
from scipy import special

from closeform.arrays import Floats, instance, number, whole
from closeform.dynamics.control.closed_loop import ClosedLoop, greatest_sigma
from closeform.dynamics.control.feedback import Feedback, Navigation, nonnegative
from closeform.motion.elements.mean_motion import checked
from closeform.motion.orbit import Orbit, circular_orbit
from closeform.result import Result

BETWEEN = 8  # number of instants between two measurements at which a tube is evaluated
# quadrature nodes of polar cosine and azimuth over a half sphere; four times as many agree to 1e-8
NODES = 12, 16
WIDEST = 40.0  # of the largest standard deviation: the probability beyond is negligible
HALVINGS = 60


@dataclass(frozen=True, eq=False, repr=False)
class Tube(Result):
    """Tracking-error tube of spacecraft under feedback, by cause; returned by `tube`.

    `radius` counts `sigmas` standard deviations along the one direction in which a zone is approached, at an
    instant; `containment` bounds the deviation in any direction over a whole flight.

    Attributes
    ----------
    model : float or array of shape (N,) [m]
        Bound on the deviation due to unknown accelerations.
    thrust : float or array of shape (N,) [m]
        Bound on the deviation due to thrust errors.
    bias : float [m]
        Bound on the deviation due to constant measurement errors.
    covariances : array of shape (S, 6, 6) [m, m/s]
        Covariances, in the chief's axes, of deviations due to random measurement errors, at equally spaced
        instants between measurements.
    sigmas : float, no unit
        Number of standard deviations that count.
    """

    _told: ClassVar = ("radius", "model", "thrust", "bias", "noise", "sigmas")

    model: Any
    thrust: Any
    bias: float
    covariances: Floats
    sigmas: float

    @property
    def noise(self) -> float:
        """Standard deviation due to random errors, in the worst direction [m]."""
        return greatest_sigma(self.covariances[:, :3, :3])

    @property
    def radius(self) -> Any:
        """Deviation of a spacecraft along any one direction (N,) or () [m]."""
        return self.model + self.thrust + self.bias + self.sigmas * self.noise

    @property
    def probability(self) -> float:
        """Probability that random errors stay within `sigmas` in one direction, no unit: 0.99997 for 4."""
        return 1.0 - self._chance

    @property
    def _chance(self) -> float:
        return 0.5 * erfc(self.sigmas / sqrt(2.0))

    def containment(self, duration: float, probability: float | None = None, craft: int = 1) -> Any:
        """Return a bound on the deviation in any direction, at any time of a flight, with a probability.

        Parameters
        ----------
        duration : float [s]
            Duration of the flight.
        probability : float, no unit, optional
            Probability that all of `craft` always stay within the bound. Default: that of the tube along one
            direction (`Tube.probability`).
        craft : int, default 1
            Number of spacecraft.

        Returns
        -------
        float or array of shape (N,) [m]
            Bound on the deviation: all bounded errors, plus the random part for that probability.

        Raises
        ------
        ValueError
            If the duration is not positive, the probability is not between 0 and 1, or there is no
            spacecraft.

        Notes
        -----
        A flight is outside if it begins there or crosses outward; the mean number of crossings bounds the
        probability of any. Random deviations are in steady state, and measurement errors are normal.

        References
        ----------
        docs/theory.md (95); Belyaev, Theory of Probability and its Applications 13(2), 320-324, 1968.
        """
        time, count = (
            checked("duration", number("duration", duration), positive=True),
            whole("craft", craft, 1),
        )
        chance = self._chance if probability is None else 1.0 - number("probability", probability)
        if not 0.0 < chance < 1.0:
            raise ValueError(f"probability: must be between 0 and 1, got {1.0 - chance:g}")
        most = self.model + self.thrust + self.bias
        if not self.noise > 0.0:
            return most
        # without the last instant, which is the first of the next interval
        return most + Outcrossings(self.covariances[:-1]).radius(float(time), chance / count)

    @property
    def of_a_pair(self) -> float:
        """Deviation of the distance of any two spacecraft [m]: the margin to add to their zone."""
        count = np.size(self.radius) if np.ndim(self.radius) else 2
        return float(self.of_pairs(count)[np.triu_indices(count, 1)].max(initial=0.0))

    def of_pairs(self, craft: int, fixed: int = 0) -> Floats:
        """Return the deviation of the distance of each pair: the `margin` of a plan.

        Parameters
        ----------
        craft : int
            Number of spacecraft.
        fixed : int, default 0
            Number of bodies after them, such as obstacles. A tube of one number applies to all bodies; in a
            tube of N spacecraft these bodies have no deviation.

        Returns
        -------
        array of shape (B, B) [m]
            Bounded errors of both, and `sigmas` standard deviations of both.

        Raises
        ------
        ValueError
            If the tube has another number of spacecraft, or an argument is not a whole number.

        References
        ----------
        docs/theory.md section 10.
        """
        craft, fixed = whole("craft", craft, 1), whole("fixed", fixed)
        most = np.asarray(self.model + self.thrust) + self.bias
        if most.shape not in ((), (craft,), (craft + fixed,)):
            raise ValueError(f"margin: a tube of {most.size} craft for {craft}; the numbers must agree")
        bodies = craft + fixed if most.shape == () else most.size
        off, variance = np.zeros(craft + fixed), np.zeros(craft + fixed)
        off[:bodies], variance[:bodies] = most, np.square(self.noise)
        return off[:, None] + off + self.sigmas * np.sqrt(variance[:, None] + variance)


def tube(
    orbit: Orbit,
    feedback: Feedback,
    navigation: Navigation,
    residual: ArrayLike = 0.0,
    thrust_error: ArrayLike = 0.0,
    sigmas: float = 4.0,
    minimum_bit: float = 0.0,
) -> Tube:
    """Compute the tracking-error tube of spacecraft under feedback, along any one direction.

    Parameters
    ----------
    orbit : Orbit
        Orbit of the spacecraft.
    feedback : Feedback
        Feedback law.
    navigation : Navigation
        Navigation accuracy.
    residual : array_like of shape (N,) or () [m/s^2], default 0
        Bound on the uncompensated acceleration: `Validity.residual`, or with `compensated_thrust` the unknown
        part of the field.
    thrust_error : array_like of shape (N,) or () [m/s^2], default 0
        Bound on the thrust error: the largest thrust times the error of its size and direction, 0.0175 for
        each degree.
    sigmas : float, no unit, default 4
        Number of standard deviations of the noise that count.
    minimum_bit : float [m/s], default 0
        Minimum impulse bit, for feedback by impulses; smaller impulses are not fired.

    Returns
    -------
    Tube
        Tube by cause; impulses that are not fired count as thrust errors.

    Raises
    ------
    ValueError
        If a number is negative or not finite, or an argument has the wrong type.

    Notes
    -----
    Exact for the linear equations in steady state: noise by the Lyapunov equation, bounded errors by the sum
    of their worst effects. Evaluated at measurements and seven instants between; with `sigmas` = 4 and white
    errors, one approach to a zone in thirty thousand enters it.

    References
    ----------
    docs/theory.md (86) and (87).

    Examples
    --------
    >>> import closeform as cf
    >>> found = cf.tube(cf.Orbit.circular(500e3), cf.Feedback(60.0, 600.0), cf.Navigation(0.1, 3e-4))
    >>> round(found.of_a_pair, 2)
    0.28
    """
    circular_orbit("orbit", orbit)
    instance("feedback", feedback, Feedback)
    instance("navigation", navigation, Navigation)
    k = float(nonnegative("sigmas", number("sigmas", sigmas)))
    unknown, off = nonnegative("residual", residual), nonnegative("thrust_error", thrust_error)
    loop = ClosedLoop.of(orbit, feedback, feedback.every, BETWEEN)
    gain = loop.acceleration_gains[0]
    missed = float(nonnegative("minimum_bit", number("minimum_bit", minimum_bit)))
    if missed > 0.0:
        if not feedback.impulses:
            raise ValueError("minimum_bit: requires feedback by impulses; give such a Feedback, or remove it")
        missed *= loop.missed_gain
    random, bias = loop.steady_covariances(navigation)[0], loop.bias(navigation)[0]
    return Tube(gain * unknown[()], gain * off[()] + missed, bias, random, k)


class Outcrossings:
    """Random deviation with covariances (S, 6, 6) of position and velocity at S instants of an interval.

    Positions are A y, with y standard normal and A A^T their covariance. Directions of y are uniform, and its
    length has a chi distribution with three degrees of freedom. In the direction of A y the velocity is
    normal.
    """

    def __init__(self, covariances: Floats) -> None:
        places, across = covariances[:, :3, :3], covariances[:, 3:, :3]
        values, axes = np.linalg.eigh(places)  # the longest axis last: nodes are densest around it
        cosine, weights = np.polynomial.legendre.leggauss(NODES[0])
        cosine, azimuth = 0.5 + 0.5 * cosine[:, None], 2.0 * pi * np.arange(NODES[1]) / NODES[1]
        sine = np.sqrt(1.0 - cosine**2)
        y = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine + 0.0 * azimuth], axis=-1)
        points = np.einsum("sij,sj,abj->sabi", axes, np.sqrt(np.maximum(values, 0.0)), y)
        self.lengths = np.linalg.norm(points, axis=-1)  # (S, ...) of A y
        self.weights = 0.5 * weights[:, None] / NODES[1]
        n = points / self.lengths[..., None]
        slope = np.swapaxes(np.linalg.solve(places, np.swapaxes(across, 1, 2)), 1, 2)
        left = covariances[:, 3:, 3:] - slope @ np.swapaxes(across, 1, 2)
        self.growth = np.einsum("sabi,sij,sabj->sab", n, slope, n)  # [1/s] outward, of the radius
        spread = np.maximum(np.einsum("sabi,sij,sabj->sab", n, left, n), np.finfo(float).tiny)
        self.spread = np.sqrt(spread)  # [m/s] about that

    def chance(self, radius: float, duration: float) -> float:
        """Return an upper bound on the probability to begin outside, or to leave within a time.

        Rice's formula for vectors.  # theory (95)
        """
        q, mean = radius / self.lengths, radius * self.growth
        density, u = np.exp(-0.5 * q * q), mean / self.spread
        outward = self.spread * np.exp(-0.5 * u * u) / sqrt(2.0 * pi) + mean * special.ndtr(u)
        outside = special.erfc(q / sqrt(2.0)) + sqrt(2.0 / pi) * q * density
        rate = sqrt(2.0 / pi) * q * q * density * outward / self.lengths
        return float((self.weights * (outside + duration * rate)).sum(axis=(1, 2)).mean())

    def radius(self, duration: float, chance: float) -> float:
        """Return the radius of the sphere that is left within a time with at most that probability."""
        inside, outside = sqrt(2.0) * self.lengths.max(), WIDEST * self.lengths.max()
        for _ in range(HALVINGS):
            middle = 0.5 * (inside + outside)
            if self.chance(middle, duration) > chance:
                inside = middle
            else:
                outside = middle
        return float(outside)
