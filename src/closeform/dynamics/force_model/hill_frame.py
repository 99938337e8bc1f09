"""Hill frame of a chief in a force model: its axes and their rotation."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.dynamics.force_model.field import Field
from closeform.motion.elements.frames import turning_axes

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
        states, acceleration = field._chief_at(times)
        place, speed = states[:, :3], states[:, 3:]
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
            pushed = field.accelerations(times + dt, there, field._chief_ballistic)
            across.append((normal * pushed).sum(axis=1))
        push_rate = (across[1] - across[0]) / (2.0 * BESIDE)
        rate[:, 0] = (climb * push[:, 2] + r * push_rate) / h - turn[:, 0] * r * push[:, 1] / h
        return cls(times, states, acceleration, axes, turn, rate)

    def during(self, some: slice) -> ChiefFrame:
        """Return the frame at the given instants."""
        return ChiefFrame(*(part[some] for part in self))

    def inertial(self, states: Floats) -> Floats:
        """Return inertial states (N, T, 6) from those in the frame."""
        place, speed = states[..., :3], states[..., 3:] + np.cross(self.rotation, states[..., :3])
        there = np.empty_like(states)
        outward = self.axes.transpose(0, 2, 1)
        there[..., :3] = self.states[:, :3] + applied(outward, place)
        there[..., 3:] = self.states[:, 3:] + applied(outward, speed)
        return there


def applied(matrices: Floats, vectors: Floats) -> Floats:
    """Return matrices (T, I, J), one for each instant, times vectors (N, T, J): (N, T, I)."""
    return np.ascontiguousarray((matrices @ vectors.transpose(1, 2, 0)).transpose(2, 0, 1))
