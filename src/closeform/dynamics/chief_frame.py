"""Hill frame of a chief in a force model: its axes and their rotation."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.dynamics.field import Field
from closeform.motion.frames import turning_axes

BESIDE = 1.0  # s, half-interval of the central difference of the cross-track force


class ChiefFrame(NamedTuple):
    """T instants of a chief and its axes: radial outward, along the motion, orbit normal (rows).

    The frame rotates at h/r^2 about its z axis and, if a force f_z acts across the orbit, at r f_z / h about
    its x axis.
    """

    times: Floats  # (T,) [s]
    states: Floats  # (T, 6) [m, m/s]
    felt: Floats  # (T, 3) [m/s^2], inertial
    axes: Floats  # (T, 3, 3)
    turn: Floats  # (T, 3) [rad/s], in these axes
    turn_rate: Floats  # (T, 3) [rad/s^2]

    @classmethod
    def of(cls, field: Field, times: Floats) -> ChiefFrame:
        """Return the frame of the chief in a field at given times (T,) [s]."""
        ballistic, states = field._chief_ballistic, field.chief_states(times)
        place, speed = states[:, :3], states[:, 3:]
        felt = field.accelerations(times, states, ballistic)
        axes, r, climb, spin = turning_axes(states)
        h = spin * r**2
        push = np.einsum("tij,tj->ti", axes, felt)
        turn, rate = np.zeros((2, len(times), 3))
        turn[:, 2], turn[:, 0] = spin, r * push[:, 2] / h
        rate[:, 2] = push[:, 1] / r - 2.0 * spin * climb / r  # h' = r f_y
        across = []
        for dt in (-BESIDE, BESIDE):
            there = np.hstack([place + dt * speed + 0.5 * dt * dt * felt, speed + dt * felt])
            normal = turning_axes(there)[0][:, 2]
            across.append((normal * field.accelerations(times + dt, there, ballistic)).sum(axis=1))
        push_rate = (across[1] - across[0]) / (2.0 * BESIDE)
        rate[:, 0] = (climb * push[:, 2] + r * push_rate) / h - turn[:, 0] * r * push[:, 1] / h
        return cls(times, states, felt, axes, turn, rate)

    def during(self, some: slice) -> ChiefFrame:
        """Return the frame at the given instants."""
        return ChiefFrame(*(part[some] for part in self))
