"""Tube: how far a craft under feedback is off its planned path."""

from __future__ import annotations

from dataclasses import dataclass
from math import erfc, sqrt
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, instance, number, whole
from closeform.dynamics.closed_loop import ClosedLoop, greatest_sigma
from closeform.dynamics.feedback import Feedback, Navigation, nonnegative
from closeform.motion.mean_motion import checked
from closeform.motion.orbit import Orbit
from closeform.result import Result

BETWEEN = 8  # instants between two measurements at which a tube is looked at


@dataclass(frozen=True, eq=False, repr=False)
class Tube(Result):
    """How far craft under feedback are off their paths, and from what; made by `tube`.

    Its `radius` counts so many standard deviations along the one direction in which a zone is approached, at
    an instant; `containment` is how far off in any direction a craft is at any time of a whole flight.

    Attributes
    ----------
    model : float or array of shape (N,) [m]
        From accelerations that nobody knows, at most.
    thrust : float or array of shape (N,) [m]
        From thrust that is not as commanded, at most.
    bias : float [m]
        From measurements that are off by something constant, at most.
    covariances : array of shape (S, 6, 6) [m, m/s]
        In the chief's axes, of deviations from measurements that are off at random; at instants evenly from
        one measurement to the next.
    sigmas : float, no unit
        As many standard deviations of these count.
    """

    _told: ClassVar = ("radius", "model", "thrust", "bias", "noise", "sigmas")

    model: Any
    thrust: Any
    bias: float
    covariances: Floats
    sigmas: float

    @property
    def noise(self) -> float:
        """The standard deviation from errors at random, in the worst direction [m]."""
        return greatest_sigma(self.covariances[:, :3, :3])

    @property
    def radius(self) -> Any:
        """How far off a craft is along any one direction (N,) or () [m]."""
        return self.model + self.thrust + self.bias + self.sigmas * self.noise

    @property
    def probability(self) -> float:
        """With which what is random stays within `sigmas` along one direction, no unit: 0.99997 of four."""
        return 1.0 - self._chance

    @property
    def _chance(self) -> float:
        return 0.5 * erfc(self.sigmas / sqrt(2.0))

    def containment(self, duration: float, probability: float | None = None, craft: int = 1) -> Any:
        """How far off craft are at most in any direction, at any time of a flight, with a probability.

        Parameters
        ----------
        duration : float [s]
            Of the flight.
        probability : float, no unit, optional
            With which all of `craft` stay so near their paths all the time, at least; as sure as the tube is
            along one direction (`Tube.probability`) unless given.
        craft : int, default 1
            How many.

        Returns
        -------
        float or array of shape (N,) [m]
            What is bounded at most, and so much of what is random.

        Raises
        ------
        ValueError
            If the duration is not positive, the probability not between 0 and 1, or there is no craft.

        Notes
        -----
        A flight is outside if it begins there or crosses outward; the mean number of crossings bounds the
        chance of any.  What is random is in steady state, and errors of measurements are normal.

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
            raise ValueError(f"probability: between 0 and 1, got {1.0 - chance:g}; nothing random is bounded")
        most = self.model + self.thrust + self.bias
        if not self.noise > 0.0:
            return most
        from closeform.dynamics.outcrossings import Outcrossings  # which loads scipy.special

        # of an interval: its last instant is the first of the next
        return most + Outcrossings(self.covariances[:-1]).radius(float(time), chance / count)

    @property
    def of_a_pair(self) -> float:
        """How far off the distance of any two of them is [m]: by this much zones have to grow."""
        count = np.size(self.radius) if np.ndim(self.radius) else 2
        return float(self.of_pairs(count)[np.triu_indices(count, 1)].max(initial=0.0))

    def of_pairs(self, craft: int, fixed: int = 0) -> Floats:
        """How far off the distance of each pair is: the `margin` of a plan.

        Parameters
        ----------
        craft : int
            How many there are.
        fixed : int, default 0
            How many bodies after them, such as obstacles.  A tube of one is everybody's; one of N craft
            leaves them where they are.

        Returns
        -------
        array of shape (B, B) [m]
            What both are off at most, and as many sigmas of both.

        Raises
        ------
        ValueError
            If the tube is of another number of craft, or these are no whole numbers.

        References
        ----------
        docs/theory.md section 10.
        """
        craft, fixed = whole("craft", craft, 1), whole("fixed", fixed)
        most = np.asarray(self.model + self.thrust) + self.bias
        if most.shape not in ((), (craft,), (craft + fixed,)):
            raise ValueError(f"margin: a tube of {most.size} craft for {craft}; make it of as many")
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
    """How far craft are off their planned paths under feedback, along any one direction.

    Parameters
    ----------
    orbit : Orbit
        In which they fly.
    feedback : Feedback
        How often they are measured, and within which horizon brought back.
    navigation : Navigation
        How well.
    residual : array_like of shape (N,) or () [m/s^2], default 0
        Accelerations that are not commanded against, at most: `Validity.residual`, or where `thrust` flies
        the plan what is not known of the field.
    thrust_error : array_like of shape (N,) or () [m/s^2], default 0
        By how much thrust is off what is commanded, at most: the greatest thrust times the error of its size
        and direction, 0.0175 for each degree.
    sigmas : float, no unit, default 4
        Of the noise, which count.

    minimum_bit : float [m/s], default 0
        The least impulse that is fired, of feedback by impulses: those below are missed.

    Returns
    -------
    Tube
        By cause; missed impulses count as thrust.

    Raises
    ------
    ValueError
        If a number is negative or not finite, or an argument is of another kind.

    Notes
    -----
    Exact for the linear equations, in steady state: noise by Lyapunov's equation, what is bounded by the sum
    of all that it can do.  Times are those of measurements and seven between; at `sigmas` = 4 one touch of a
    zone in thirty thousand ends inside, of errors that are white.

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
    instance("orbit", orbit, Orbit)
    instance("feedback", feedback, Feedback)
    instance("navigation", navigation, Navigation)
    k = float(nonnegative("sigmas", number("sigmas", sigmas)))
    unknown, off = nonnegative("residual", residual), nonnegative("thrust_error", thrust_error)
    loop = ClosedLoop.of(orbit, feedback, feedback.every, BETWEEN)
    gain, missed = loop.gains[0], float(nonnegative("minimum_bit", number("minimum_bit", minimum_bit)))
    if missed > 0.0:
        if not feedback.impulses:
            raise ValueError("minimum_bit: of impulses; give a Feedback by some, or leave it out")
        missed *= loop.missed
    random, bias = loop.covariances(navigation)[0], loop.biased(navigation)[0]
    return Tube(gain * unknown[()], gain * off[()] + missed, bias, random, k)
