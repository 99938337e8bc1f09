"""Natural motion in a force model: coasts, and state transition matrices."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, instance, number
from closeform.dynamics.drag import ballistics_of
from closeform.dynamics.field import Field
from closeform.motion.following import followed
from closeform.motion.frames import inertial_from_relative, relative_from_inertial
from closeform.motion.mean_motion import checked
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path

# Central differences about the chief: second-order terms cancel, those of third order are 1e-11 of the first
# in an orbit, and rounding is 1e-9.
BESIDE = np.repeat([10.0, 0.01], 3)  # m, m/s


def coast(
    states: ArrayLike,
    field: Field,
    duration: float,
    start: float = 0.0,
    within: float = 1e-3,
    orbit: Orbit | None = None,
) -> Path:
    """Propagate the natural motion of craft in a field, without thrust.

    Parameters
    ----------
    states : array_like of shape (..., 6) [m, m/s]
        Initial states in the chief's Hill frame with straight axes; as many as the field's drag has ballistic
        coefficients.
    field : Field
        Force model of the craft and the chief.
    duration : float [s]
        Duration, above 0.
    start : float [s], default 0
        Time of the states, since the chief's epoch.
    within : float [m], default 1e-3
        Greatest error of the path between samples, whose density is chosen accordingly.
    orbit : Orbit, optional
        Orbit of the paths with which the result is to be screened. Default: `field.chief.orbit`. The motion
        does not depend on it.

    Returns
    -------
    Path
        Path with the leading shape of the states, in that orbit, for `screen`, `find_conflicts` and `avoid`.

    Raises
    ------
    ValueError
        If the duration is not positive or too long, `within` is below 1e-6 m or not reached, shapes do not
        match, a number is not finite, or a time is outside the chief's ephemeris.

    Notes
    -----
    Nothing is linearised: the motion includes the chief's eccentricity, curvature and the whole force model.

    References
    ----------
    docs/field.md; docs/theory.md section 10.

    Examples
    --------
    >>> import closeform as cf
    >>> chief = cf.Chief.from_elements("2026-11-22T12:00:00", [6.878e6, 0.0, 1e-2, 0.0, 0.9, 0.0])
    >>> path = cf.coast([0, 200, 0, 0, 0, 0], cf.Field(chief), 3000.0)
    >>> hill = chief.orbit.coast([0, 200, 0, 0, 0, 0], 3000.0)
    >>> bool(abs(path.position(3000.0) - hill.position(3000.0)).max() > 1.0)
    True
    """
    instance("field", field, Field)
    instance("orbit", orbit, Orbit, type(None))
    given, begin = checked("states", states, last=6), float(checked("start", number("start", start)))
    rows = np.ascontiguousarray(given.reshape(-1, 6))
    ballistics = ballistics_of(field.drag, len(rows))
    chief, felt = _chief_at(field, np.array([begin]))
    craft = inertial_from_relative(chief, rows, acceleration=felt)

    def states_at(times: Floats) -> Floats:
        chief, felt = _chief_at(field, times)
        flown = [
            field._craft_states(one, ballistic, begin, times)
            for one, ballistic in zip(craft, ballistics, strict=True)
        ]
        relative = relative_from_inertial(chief, np.reshape(flown, (-1, len(times), 6)), acceleration=felt)
        return relative.reshape((*given.shape[:-1], len(times), 6))

    return followed(orbit or field.chief.orbit, states_at, duration, begin, within)


def drift_from(state: Floats, field: Field, times: Floats, chief: Floats, felt: Floats) -> Floats:
    """Return the states (T, 6) of one craft from a state (6,) on.

    `chief` (T, 6) and `felt` (T, 3): inertial states and accelerations of the chief.
    """
    (ballistic,) = ballistics_of(field.drag, 1)
    craft = inertial_from_relative(chief[0], state, acceleration=felt[0])
    flown = field._craft_states(craft, ballistic, float(times[0]), times)
    return np.asarray(relative_from_inertial(chief, flown, acceleration=felt))


def drifting(paths: Path, field: Field) -> Path:
    """Return the natural motion in a field from the start of paths (N,), for their duration."""
    begin, over = float(paths.start[0]), float(paths.end[0])
    return coast(paths.state(begin), field, over - begin, begin, orbit=paths.orbit)


def transition(field: Field, duration: ArrayLike, start: float = 0.0) -> Floats:
    """Return state transition matrices of natural motion near the chief of a field.

    Parameters
    ----------
    field : Field
        Force model of the chief, and of craft with its ballistic coefficient.
    duration : array_like of shape (...) [s]
        Durations of any sign.
    start : float [s], default 0
        Start time since the chief's epoch.

    Returns
    -------
    array of shape (..., 6, 6) [no unit, s, 1/s]
        Matrices that propagate small states in the chief's frame, accurate to 1e-7 within ten orbits.

    Raises
    ------
    ValueError
        If a number is not finite, or a time is outside the chief's ephemeris.

    Notes
    -----
    For a point mass these are the matrices of Yamanaka and Ankersen (`EccentricOrbit`). For J2 those of Gim
    and Alfriend are first order in J2, in mean elements; here all orders are included, for any field.

    References
    ----------
    Gim and Alfriend, Journal of Guidance, Control, and Dynamics 26(6), 956-971, 2003, for the problem;
    docs/field.md for the method of finite differences.
    """
    instance("field", field, Field)
    lengths = np.asarray(checked("duration", duration))
    begin = float(checked("start", number("start", start)))
    times = begin + lengths.ravel()
    chief, felt = _chief_at(field, np.array([begin]))
    beside = np.concatenate([np.diag(BESIDE), -np.diag(BESIDE)])
    craft = inertial_from_relative(chief, beside, acceleration=felt)
    chiefs, felt = _chief_at(field, times)
    flown = np.stack([field._craft_states(one, field._chief_ballistic, begin, times) for one in craft])
    ahead, behind = relative_from_inertial(chiefs, flown, acceleration=felt).reshape(2, 6, -1, 6)
    columns = (ahead - behind) / (2.0 * BESIDE[:, None, None])
    return np.ascontiguousarray(np.moveaxis(columns, 0, -1)).reshape((*lengths.shape, 6, 6))


def _chief_at(field: Field, times: Floats) -> tuple[Floats, Floats]:
    """Return the chief's inertial states (T, 6) at times, and its acceleration (T, 3) [m/s^2]."""
    states = field.chief_states(times)
    return states, field.accelerations(times, states, field._chief_ballistic)
