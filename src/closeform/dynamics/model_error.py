"""Model error of Hill's equations in a force model, and the deviations that it causes.

The model error (residual) is the acceleration along a path that Hill's equations do not contain.
"""

from __future__ import annotations

import numpy as np

from closeform.arrays import Floats
from closeform.dynamics.force_model.field import Field
from closeform.dynamics.force_model.hill_frame import ChiefFrame, applied
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path

FINE, FEWEST = 150, 30  # samples of the model error in each orbit, and at least


def residuals(field: Field, frame: ChiefFrame, states: Floats, n: float) -> Floats:
    """Return the model error (N, T, 3) [m/s^2] of Hill's equations with mean motion `n`.

    States (N, T, 6) [m, m/s] and result are in the chief's axes; spacecraft are in the order of the field's
    ballistic coefficients.  # theory (82)
    """
    place, speed = states[..., :3], states[..., 3:]
    turn, swing = frame.rotation, np.cross(frame.rotation, place)
    own = field._ballistics(len(states))[:, None]
    acceleration = field.accelerations(frame.times, frame.inertial(states), own) - frame.acceleration
    d = applied(frame.axes, acceleration)
    d -= 2.0 * np.cross(turn, speed) + np.cross(frame.rotation_rate, place) + np.cross(turn, swing)
    x, z, vx, vy = place[..., 0], place[..., 2], speed[..., 0], speed[..., 1]
    d[..., 0] -= 3.0 * n * n * x + 2.0 * n * vy  # theory (1)
    d[..., 1] += 2.0 * n * vx
    d[..., 2] += n * n * z
    return d


def path_residuals(field: Field, paths: Path, times: Floats) -> Floats:
    """Return the model error (N, T, 3) [m/s^2] along planned paths (N,), in the chief's axes."""
    return residuals(field, ChiefFrame.of(field, times), paths.state(times), paths.orbit.mean_motion)


def greatest_residual(field: Field, paths: Path) -> Floats:
    """Return the largest model error of Hill's equations along each of the paths (N,) [m/s^2]."""
    start, end, orbit = float(paths.start[0]), float(paths.end[0]), paths.orbit
    times = np.linspace(start, end, max(FEWEST, int(np.ceil(FINE * (end - start) / orbit.period))) + 1)
    return np.asarray(np.linalg.norm(path_residuals(field, paths, times), axis=2).max(axis=1))


def deviations_of(orbit: Orbit, times: Floats, left_out: Floats) -> Floats:
    """Return the deviations (N, T, 6) due to accelerations (N, T, 3) at an even number of equal steps.

    Simpson's rule, whose parabola gives both of its steps.  # theory (83)
    """
    since = times - times[0]
    back = applied(orbit.transition(-since)[:, :, 3:], left_out)
    one, two, three = back[:, :-2:2], back[:, 1::2], back[:, 2::2]
    both = [5.0 * one + 8.0 * two - three, -one + 8.0 * two + 5.0 * three]
    steps = np.stack(both, axis=2).reshape(len(back), -1, 6) * (since[1] / 12.0)
    off = np.zeros_like(back)
    off[:, 1:] = applied(orbit.transition(since[1:]), np.cumsum(steps, axis=1))
    return off
