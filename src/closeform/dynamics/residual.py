"""Residual: the acceleration along a path that Hill's equations do not contain."""

from dataclasses import replace

import numpy as np

from closeform.arrays import Floats
from closeform.dynamics.chief_frame import ChiefFrame
from closeform.dynamics.drag import ballistics_of
from closeform.dynamics.field import Field


def residuals(field: Field, frame: ChiefFrame, states: Floats, n: float) -> Floats:
    """Return the residual of Hill's equations with mean motion `n` (N, T, 3) [m/s^2].

    `states` (N, T, 6) [m, m/s] are in the chief's axes, with craft in the order of the field's ballistic
    coefficients.  # theory (82)
    """
    place, speed = states[..., :3], states[..., 3:]
    turn, swing = frame.turn, np.cross(frame.turn, place)
    own = ballistics_of(field.drag, len(states))[:, None]
    felt = field.accelerations(frame.times, inertial(frame, states), own) - frame.felt
    d = applied(frame.axes, felt)
    d -= 2.0 * np.cross(turn, speed) + np.cross(frame.turn_rate, place) + np.cross(turn, swing)
    x, z, vx, vy = place[..., 0], place[..., 2], speed[..., 0], speed[..., 1]
    d[..., 0] -= 3.0 * n * n * x + 2.0 * n * vy  # theory (1)
    d[..., 1] += 2.0 * n * vx
    d[..., 2] += n * n * z
    return d


def applied(matrices: Floats, vectors: Floats) -> Floats:
    """Return matrices (T, I, J), one for each instant, times vectors (N, T, J): (N, T, I)."""
    return np.ascontiguousarray((matrices @ vectors.transpose(1, 2, 0)).transpose(2, 0, 1))


def inertial(frame: ChiefFrame, states: Floats) -> Floats:
    """Return inertial states (N, T, 6) from relative ones."""
    place, speed = states[..., :3], states[..., 3:] + np.cross(frame.turn, states[..., :3])
    there = np.empty_like(states)
    outward = frame.axes.transpose(0, 2, 1)
    there[..., :3] = frame.states[:, :3] + applied(outward, place)
    there[..., 3:] = frame.states[:, 3:] + applied(outward, speed)
    return there


def beyond(field: Field, frame: ChiefFrame, states: Floats) -> Floats:
    """Return the acceleration of a user function minus its zonals (N, T, 3) [m/s^2], inertial."""
    there = inertial(frame, states)
    zonal = replace(field, acceleration=None)
    return field.accelerations(frame.times, there) - zonal.accelerations(frame.times, there)
