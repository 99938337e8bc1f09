"""Hill frame of a chief in a force model, and the model error of Hill's equations in it.

The model error (residual) is the acceleration along a path that Hill's equations do not contain.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.dynamics.force_model.drag import ballistics_of
from closeform.dynamics.force_model.field import Field
from closeform.motion.frames import turning_axes

BESIDE = 1.0  # s, half-interval of the central difference of the cross-track force


class ChiefFrame(NamedTuple):
    """T instants of a chief and its axes: radial outward, along the motion, orbit normal (rows).

    The frame rotates at h/r^2 about its z axis and, if a force f_z acts across the orbit, at r f_z / h about
    its x axis.
    """

    times: Floats  # (T,) [s]
    states: Floats  # (T, 6) [m, m/s]
    acceleration: Floats  # (T, 3) [m/s^2], inertial
    axes: Floats  # (T, 3, 3)
    rotation: Floats  # (T, 3) [rad/s], in these axes
    rotation_rate: Floats  # (T, 3) [rad/s^2]

    @classmethod
    def of(cls, field: Field, times: Floats) -> ChiefFrame:
        """Return the frame of the chief in a field at given times (T,) [s]."""
        ballistic, states = field._chief_ballistic, field.chief_states(times)
        place, speed = states[:, :3], states[:, 3:]
        acceleration = field.accelerations(times, states, ballistic)
        axes, r, climb, spin = turning_axes(states)
        h = spin * r**2
        push = np.einsum("tij,tj->ti", axes, acceleration)
        turn, rate = np.zeros((2, len(times), 3))
        turn[:, 2], turn[:, 0] = spin, r * push[:, 2] / h
        rate[:, 2] = push[:, 1] / r - 2.0 * spin * climb / r  # h' = r f_y
        across = []
        for dt in (-BESIDE, BESIDE):
            there = np.hstack([place + dt * speed + 0.5 * dt * dt * acceleration, speed + dt * acceleration])
            normal = turning_axes(there)[0][:, 2]
            across.append((normal * field.accelerations(times + dt, there, ballistic)).sum(axis=1))
        push_rate = (across[1] - across[0]) / (2.0 * BESIDE)
        rate[:, 0] = (climb * push[:, 2] + r * push_rate) / h - turn[:, 0] * r * push[:, 1] / h
        return cls(times, states, acceleration, axes, turn, rate)

    def during(self, some: slice) -> ChiefFrame:
        """Return the frame at the given instants."""
        return ChiefFrame(*(part[some] for part in self))


def residuals(field: Field, frame: ChiefFrame, states: Floats, n: float) -> Floats:
    """Return the model error (N, T, 3) [m/s^2] of Hill's equations with mean motion `n`.

    States (N, T, 6) [m, m/s] and result are in the chief's axes; spacecraft are in the order of the field's
    ballistic coefficients.  # theory (82)
    """
    place, speed = states[..., :3], states[..., 3:]
    turn, swing = frame.rotation, np.cross(frame.rotation, place)
    own = ballistics_of(field.drag, len(states))[:, None]
    acceleration = field.accelerations(frame.times, inertial(frame, states), own) - frame.acceleration
    d = applied(frame.axes, acceleration)
    d -= 2.0 * np.cross(turn, speed) + np.cross(frame.rotation_rate, place) + np.cross(turn, swing)
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
    place, speed = states[..., :3], states[..., 3:] + np.cross(frame.rotation, states[..., :3])
    there = np.empty_like(states)
    outward = frame.axes.transpose(0, 2, 1)
    there[..., :3] = frame.states[:, :3] + applied(outward, place)
    there[..., 3:] = frame.states[:, 3:] + applied(outward, speed)
    return there


def beyond_zonals(field: Field, frame: ChiefFrame, states: Floats) -> Floats:
    """Return the acceleration of a user function minus its zonals (N, T, 3) [m/s^2], inertial."""
    there = inertial(frame, states)
    zonal = replace(field, acceleration=None)
    return field.accelerations(frame.times, there) - zonal.accelerations(frame.times, there)
