"""Covariance of an object at a time, propagated from those of its ephemeris."""

from __future__ import annotations

import numpy as np

from closeform.arrays import Floats
from closeform.exchange.ephemerides.covariance import inertial
from closeform.exchange.ephemerides.ephemeris import SAME_EPOCH, Ephemeris
from closeform.motion.elements.elements import elements_from_inertial, inertial_later
from closeform.motion.elements.frames import relative_jacobian
from closeform.motion.elements.mean_motion import mean_motion_from_semi_major_axis
from closeform.motion.steering import transition_matrices


def covariance_at(ephemeris: Ephemeris, time: float, mu: float) -> tuple[Floats, float] | None:
    """Return a covariance (6, 6) [m^2, m^2/s, m^2/s^2] at a time, along inertial axes, and its age [s].

    It is propagated by Hill's equations in the object's own orbit, from the latest covariance up to that time
    or backwards from the first one. The result is None if the ephemeris has no covariance.
    """
    held = ephemeris.covariances
    if held is None or not len(held):
        return None
    index = max(int(np.searchsorted(held.times, time + SAME_EPOCH)) - 1, 0)
    age = float(time - held.times[index])
    then, now = (state_near(ephemeris, instant, mu) for instant in (held.times[index], time))
    fixed = inertial(held.matrices[index], held.frames[index], then)
    if abs(age) <= SAME_EPOCH:
        return fixed, 0.0
    rate = mean_motion_from_semi_major_axis(elements_from_inertial(now, mu)[0], mu)
    moved = transition_matrices(rate, np.array(age)) @ relative_jacobian(then, then)
    whole = np.linalg.solve(relative_jacobian(now, now), moved)
    return whole @ fixed @ whole.T, age


def state_near(ephemeris: Ephemeris, time: float, mu: float) -> Floats:
    """Return the state (6,) at a time, by Keplerian motion from the nearest known state."""
    nearest = int(np.argmin(np.abs(ephemeris.times - time)))
    known, ahead = ephemeris.states[nearest], time - ephemeris.times[nearest]
    if ahead == 0.0:
        return np.asarray(known)
    return inertial_later(known, ahead, mu)
