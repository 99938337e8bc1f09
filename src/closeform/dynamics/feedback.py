"""Feedback: how a craft is brought back to its planned path, and how well it is measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, number, shown, whole
from closeform.dynamics.infeasible import Grounded
from closeform.motion.arc import THRUST
from closeform.motion.mean_motion import checked
from closeform.motion.orbit import Orbit

BLIND = 1e12  # of a Gramian's condition, in a length for velocities: half orbits apart none is met across


@dataclass(frozen=True)
class Feedback:
    """The optimal way back to the planned path within a constant horizon, begun anew at each measurement.

    Parameters
    ----------
    every : float [s], default 60
        From one measurement to the next.
    horizon : float [s], default 600
        In which a deviation would be brought to zero, also at the plan's end.
    impulses : int, default 0
        By how many: the first at once, the others evenly over the horizon, and of them those before the next
        measurement are fired.  0 is thrust that lasts.
    delay : float [s], default 0
        From a measurement until thrust answers to it, at most one interval; for so long the state is
        predicted, with the thrust that is known.

    Raises
    ------
    ValueError
        If a time is not positive, the horizon shorter or the delay longer than the interval, the delay
        negative, or there is one impulse.

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
                "give a longer one"
            )
        if whole("impulses", self.impulses) == 1:
            raise ValueError("impulses: one brings no state to zero; give two or more, or 0")
        object.__setattr__(self, "delay", checked("delay", number("delay", self.delay)))
        if not 0.0 <= self.delay <= self.every:
            raise ValueError(f"delay: 0 s to the {self.every:g} s between measurements, got {self.delay:g} s")
        if self.delay > 0.0 and self.impulses:
            raise ValueError("delay: goes with thrust that lasts; leave it out, or give 0 impulses")


BY_IMPULSES, BY_PLANS = Feedback(300.0, 1800.0, 6), Feedback(300.0, 900.0)


def usual_feedback(control: str, by_impulses: bool) -> Feedback:
    """What leads craft back unless given, of plans that are made anew, fly impulses or thrust that lasts."""
    if control == "replan":
        return BY_PLANS
    return BY_IMPULSES if by_impulses else Feedback()


@dataclass(frozen=True)
class Navigation:
    """How well states are measured: random errors of each axis, and constant ones.

    Parameters
    ----------
    position : float [m], default 0
        Standard deviation of each axis.
    velocity : float [m/s], default 0
        Standard deviation of each axis.
    position_bias : float [m], default 0
        Length of an error that stays through a flight, in any direction.
    velocity_bias : float [m/s], default 0
        The same of velocity.
    correlation : float [s], default 0
        In which random errors fade to 1/e, as a filter's do; 0: new at each measurement.

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
        """Which share of a random error is left after some time."""
        return float(np.exp(-seconds / self.correlation)) if self.correlation > 0.0 else 0.0


def nonnegative(name: str, value: ArrayLike) -> Floats:
    """An argument as finite numbers, none below 0."""
    sizes = np.asarray(checked(name, value))
    if not (sizes >= 0.0).all():
        raise ValueError(f"{name}: must be 0 or more, got {sizes.min():g}")
    return sizes


def thrust_errors(value: ArrayLike, count: int) -> Floats:
    """The argument `thrust_error` of each craft (N, 2): a share of thrust, and an angle [rad]."""
    sizes = np.asarray(checked("thrust_error", value))
    if sizes.shape not in ((2,), (count, 2)) or not (sizes >= 0.0).all():
        raise ValueError(f"thrust_error: two numbers, 0 or more, got {shown(value)}")
    return np.broadcast_to(sizes, (count, 2))


def way_back(orbit: Orbit, horizon: float, times: Floats) -> tuple[Floats, Floats, Floats]:
    """M, Phi (T, 6, 6) and the thrust law (T, 3, 6) of the optimum that brings a state to zero in a horizon.

    At times (T,) of it: the state that is left of one, that of a coast, and the thrust.     # theory (85)
    """
    paths = orbit.transfer(np.eye(6), np.zeros(6), horizon)
    left = np.moveaxis(paths.state(times), 0, -1)
    primers = paths.arcs[:, THRUST : THRUST + 6].T
    moved = orbit.transition(times)
    return left, moved, moved[:, :3] @ primers


def slots_of(law: Feedback) -> tuple[Floats, Floats]:
    """From when and until when after a measurement each impulse has time to be fired (J,) and (J,) [s]."""
    begin = np.asarray(np.arange(law.impulses) * (law.horizon / law.impulses), dtype=float)
    over = begin + law.horizon / law.impulses
    return begin, np.where(begin < law.every, np.minimum(over, law.every), over)


def kicks_back(orbit: Orbit, law: Feedback, lasting: bool = False) -> tuple[Floats, Floats]:
    """When after a measurement impulses are (J,) [s], and the gains (J, 3, 6) that make them of a deviation.

    The least sum of squares that brings it to zero in the horizon; at the begin of their slots, or of burns
    that are `lasting` about the middle.                                                      # theory (88)
    """
    begin, over = slots_of(law)
    times = 0.5 * (begin + over) if lasting else begin
    scale = np.repeat([1.0, law.horizon], 3)  # velocities as lengths
    pushed = orbit.transition(law.horizon - times)[:, :, 3:] * scale[:, None]
    gramian = np.einsum("jik,jlk->il", pushed, pushed)
    if np.linalg.cond(gramian) > BLIND:
        raise Grounded(
            f"feedback: {law.impulses} impulses, {law.horizon / law.impulses:g} s apart, cannot steer to all "
            "sides; give more of them, or another horizon"
        )
    wanted = np.linalg.solve(gramian, scale[:, None] * orbit.transition(law.horizon))
    return times, -np.asarray(np.einsum("jik,il->jkl", pushed, wanted))


def delayed(orbit: Orbit, law: Feedback, every: float) -> tuple[Floats, Floats]:
    """What is made of a measurement (6, 6) when it counts, and of that which counted until then (6, 6).

    The state as predicted: after a coast, and with what the last answer has thrust meanwhile.  # theory (92)
    """
    wait = min(law.delay, every)
    left, moved, _ = way_back(orbit, law.horizon, np.array([every - wait, every]))
    late = np.asarray(orbit.transition(wait))
    return late, np.asarray(left[1] - moved[1] - late @ (left[0] - moved[0]))


def left_of(orbit: Orbit, fired: Floats, gains: Floats, times: Floats) -> tuple[Floats, Floats]:
    """M and Phi (T, 6, 6) as of `way_back`, at times (T,) after one measurement, by impulses."""
    moved = orbit.transition(times)
    return moved + (kicked(orbit, fired, times) @ gains).sum(axis=1), moved


def kicked(orbit: Orbit, fired: Floats, times: Floats) -> Floats:
    """What impulses of 1 m/s along each axis have become (T, J, 6, 3); 0 until they are fired."""
    since = times[:, None] - fired
    moved = orbit.transition(np.maximum(since, 0.0))[..., 3:]
    return np.asarray(moved * (since >= 0.0)[..., None, None])
