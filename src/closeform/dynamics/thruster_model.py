"""Thrusters of one craft as the simulation kernels use them, with their planned firing."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.dynamics.thruster_commands import BIT, STRENGTH, THRUSTER
from closeform.fuel.allocation import Allocation
from closeform.fuel.pulses import Pulses
from closeform.fuel.thrusters import Thrusters

NEGLIGIBLE = 1e-9  # m/s: tolerance along an axis without a thruster


class Nozzles(NamedTuple):
    """Thrusters of one craft for kernels, see `thruster_commands`, and their planned pulses.

    `turns`: their frame is inertial; pulses last from `begins` to `ends` (P,) [s], each of the thruster
    `whose` (P,).
    """

    thrusters: Floats  # (J, 5)
    facets: Floats  # (F, 12)
    turns: bool
    whose: Any
    begins: Floats
    ends: Floats

    def free(self, times: Floats) -> Floats:
        """Return the time (J, T) [s] without planned firing of each thruster since the first time."""
        found = np.tile(times - times[0], (len(self.thrusters), 1))
        for j in np.unique(self.whose):
            edges = np.stack([self.begins[self.whose == j], self.ends[self.whose == j]], axis=1)
            on = np.concatenate([[0.0], np.cumsum(np.diff(edges, axis=1))])
            since = np.interp(times, edges.ravel(), np.repeat(on, 2)[1:-1])
            found[j] -= since - since[0]
        return found


def nozzles_of(thrusters: Thrusters, pulses: Pulses) -> Nozzles:
    """Return one craft's thrusters with its planned pulses; six absent thrusters complete the axes."""
    allocation = Allocation.of(thrusters.directions)
    rows = np.zeros((allocation.count + 6, THRUSTER))
    rows[: allocation.count, :BIT] = thrusters.directions
    rows[: allocation.count, BIT] = thrusters.minimum_bit
    rows[: allocation.count, STRENGTH] = thrusters.acceleration
    rows[allocation.count :, BIT] = NEGLIGIBLE
    facets = np.hstack([allocation.corners.astype(float), allocation.inverses.reshape(-1, 9)])
    ends = pulses.start + pulses.duration
    return Nozzles(rows, facets, thrusters.frame == "inertial", pulses.thruster, pulses.start, ends)
