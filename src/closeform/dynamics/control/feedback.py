"""Feedback law that corrects deviations from a planned path, and the accuracy of the navigation behind it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, number, whole
from closeform.dynamics.infeasible import Infeasible
from closeform.motion.arc import THRUST
from closeform.motion.elements.mean_motion import checked
from closeform.motion.orbit import Orbit

REPLACED = 1e-6  # of an interval: an impulse this close to the next measurement is replaced by its response
BLIND = 1e12  # condition number of a Gramian: half an orbit apart, impulses do not control cross-track motion


@dataclass(frozen=True)
class Feedback:
    """Optimal return to the planned path within a constant horizon, recomputed at each measurement.

    Parameters
    ----------
    every : float [s], default 60
        Time between measurements.
    horizon : float [s], default 600
        Time in which a deviation is brought to zero, also at the plan's end.
    impulses : int, default 0
        Number of impulses: the first at once, the others evenly over the horizon. Those before the next
        measurement are fired. 0 for continuous thrust.
    delay : float [s], default 0
        Time from a measurement to the thrust that responds to it, at most one interval. The state is
        predicted over the delay with the known thrust.

    Raises
    ------
    ValueError
        If a time is not positive, the horizon is shorter or the delay longer than the interval, the delay is
        negative, or `impulses` is 1.

    References
    ----------
    docs/theory.md (85) and (88).
    """

    every: float = 60.0
    horizon: float = 600.0
    impulses: int = 0
    delay: float = 0.0

    def __post_init__(self) -> None:
        for name in ("every", "horizon"):
            object.__setattr__(self, name, checked(name, number(name, getattr(self, name)), positive=True))
        if self.horizon < self.every:
            raise ValueError(
                f"horizon: {self.horizon:g} s is shorter than the {self.every:g} s between measurements; "
                "increase the horizon"
            )
        if whole("impulses", self.impulses) == 1:
            raise ValueError("impulses: one impulse cannot bring a state to zero; give two or more, or 0")
        object.__setattr__(self, "delay", checked("delay", number("delay", self.delay)))
        if not 0.0 <= self.delay <= self.every:
            raise ValueError(
                f"delay: must be from 0 s to the {self.every:g} s between measurements, got {self.delay:g} s"
            )
        if self.delay > 0.0 and self.impulses:
            raise ValueError("delay: requires continuous thrust; remove it, or give 0 impulses")


@dataclass(frozen=True)
class Navigation:
    """Navigation accuracy: random errors of each axis, and constant ones.

    Parameters
    ----------
    position : float [m], default 0
        Standard deviation of the position on each axis.
    velocity : float [m/s], default 0
        Standard deviation of the velocity on each axis.
    position_bias : float [m], default 0
        Size of a constant position error, in any direction.
    velocity_bias : float [m/s], default 0
        Size of a constant velocity error, in any direction.
    correlation : float [s], default 0
        Correlation time of random errors (decay to 1/e), as of a filter; 0: independent measurements.

    Raises
    ------
    ValueError
        If a number is negative or not finite.

    References
    ----------
    docs/theory.md (86).
    """

    position: float = 0.0
    velocity: float = 0.0
    position_bias: float = 0.0
    velocity_bias: float = 0.0
    correlation: float = 0.0

    def __post_init__(self) -> None:
        for name in ("position", "velocity", "position_bias", "velocity_bias", "correlation"):
            object.__setattr__(self, name, float(nonnegative(name, number(name, getattr(self, name)))))

    def _kept(self, seconds: float) -> float:
        """Return the fraction of a random error that remains after some time."""
        return float(np.exp(-seconds / self.correlation)) if self.correlation > 0.0 else 0.0


def nonnegative(name: str, value: ArrayLike) -> Floats:
    """Return an argument as finite non-negative numbers."""
    sizes = np.asarray(checked(name, value))
    if not (sizes >= 0.0).all():
        raise ValueError(f"{name}: must be 0 or more, got {sizes.min():g}")
    return sizes


BY_IMPULSES, BY_PLANS = Feedback(300.0, 1800.0, 6), Feedback(300.0, 900.0)


def default_feedback(control: str, by_impulses: bool) -> Feedback:
    """Return the default feedback for replanning, for impulses, or for continuous thrust."""
    if control == "replan":
        return BY_PLANS
    return BY_IMPULSES if by_impulses else Feedback()


def optimal_return(orbit: Orbit, horizon: float, times: Floats) -> tuple[Floats, Floats, Floats]:
    """Return M, Phi (T, 6, 6) and the gains (T, 3, 6) of the optimal return to zero within a horizon.

    M is the transition with feedback at times (T,), Phi that of a coast, and the gains give the thrust.  #
    theory (85)
    """
    paths = orbit.transfer(np.eye(6), np.zeros(6), horizon)
    left = np.moveaxis(paths.state(times), 0, -1)
    primers = paths.arcs[:, THRUST : THRUST + 6].T
    moved = orbit.transition(times)
    return left, moved, moved[:, :3] @ primers


def impulse_slots(law: Feedback) -> tuple[Floats, Floats]:
    """Return the start and end times after a measurement of the slot of each impulse (J,) and (J,) [s]."""
    every = law.horizon / max(law.impulses, 1)
    begin = np.asarray(np.arange(law.impulses) * every, dtype=float)
    over = begin + every
    return begin, np.where(begin < law.every, np.minimum(over, law.every), over)


def slots_before_next(law: Feedback, every: float) -> Floats:
    """Return the times after a measurement (J,) [s] of impulses before the next one, `every` [s] later."""
    begin = impulse_slots(law)[0]
    return np.asarray(begin[begin < every * (1.0 - REPLACED)])


def impulse_gains(orbit: Orbit, law: Feedback, lasting: bool = False) -> tuple[Floats, Floats]:
    """Return the times of impulses after a measurement (J,) [s], and their gains (J, 3, 6).

    The gains minimise the sum of squares of the impulses that remove a deviation within the horizon. Impulses
    act at the start of their slots, finite burns (`lasting`) about the middle.  # theory (88)
    """
    begin, over = impulse_slots(law)
    times = 0.5 * (begin + over) if lasting else begin
    scale = np.repeat([1.0, law.horizon], 3)  # velocities as lengths
    pushed = orbit.transition(law.horizon - times)[:, :, 3:] * scale[:, None]
    gramian = np.einsum("jik,jlk->il", pushed, pushed)
    if np.linalg.cond(gramian) > BLIND:
        raise Infeasible(
            f"feedback: {law.impulses} impulses, {law.horizon / law.impulses:g} s apart, do not control "
            "all axes; give more impulses, or another horizon"
        )
    wanted = np.linalg.solve(gramian, scale[:, None] * orbit.transition(law.horizon))
    return times, -np.asarray(np.einsum("jik,il->jkl", pushed, wanted))


def delay_transitions(orbit: Orbit, law: Feedback, every: float) -> tuple[Floats, Floats]:
    """Return the transitions over the delay (6, 6) of the new measurement, and of the previous one.

    The state is predicted by free motion plus the thrust of the last feedback in the meantime.  # theory (92)
    """
    wait = min(law.delay, every)
    left, moved, _ = optimal_return(orbit, law.horizon, np.array([every - wait, every]))
    late = np.asarray(orbit.transition(wait))
    return late, np.asarray(left[1] - moved[1] - late @ (left[0] - moved[0]))


def return_by_impulses(orbit: Orbit, fired: Floats, gains: Floats, times: Floats) -> tuple[Floats, Floats]:
    """Return M and Phi (T, 6, 6) of `optimal_return` for impulses, at times (T,) after one measurement."""
    moved = orbit.transition(times)
    return moved + (impulse_effects(orbit, fired, times) @ gains).sum(axis=1), moved


def impulse_effects(orbit: Orbit, fired: Floats, times: Floats) -> Floats:
    """Return the effect (T, J, 6, 3) of impulses of 1 m/s along each axis; 0 before they are fired."""
    since = times[:, None] - fired
    moved = orbit.transition(np.maximum(since, 0.0))[..., 3:]
    return np.asarray(moved * (since >= 0.0)[..., None, None])
