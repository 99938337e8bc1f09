"""Thrusters of one spacecraft in a simulation: minimum bits, planned pulses, and controllable axes."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

from closeform.arrays import Floats
from closeform.dynamics.simulation.integrator import BIT, STRENGTH, THRUSTER
from closeform.fuel.allocation import Allocation
from closeform.fuel.pulses import Pulses
from closeform.fuel.thrusters import Thrusters, turn

NEGLIGIBLE = 1e-9  # m/s: tolerance along an axis without a thruster
FLAT = 1e-9  # relative singular value below which directions span only a plane or a line


class ThrusterModel(NamedTuple):
    """Thrusters of one spacecraft as the integrator uses them, and their planned `pulses`.

    Six absent thrusters complete the axes. The frame of the thrusters `rotates` in the chief's axes if it is
    inertial.
    """

    thrusters: Floats  # (J, 5)
    facets: Floats  # (F, 12)
    rotates: bool
    pulses: Pulses

    @classmethod
    def of(cls, thrusters: Thrusters, pulses: Pulses) -> Self:
        """Return the model of thrusters with planned pulses."""
        allocation = Allocation.of(thrusters.directions)
        rows = np.zeros((allocation.count + 6, THRUSTER))
        rows[: allocation.count, :BIT] = thrusters.directions
        rows[: allocation.count, BIT] = thrusters.minimum_bit
        rows[: allocation.count, STRENGTH] = thrusters.acceleration
        rows[allocation.count :, BIT] = NEGLIGIBLE
        facets = np.hstack([allocation.corners.astype(float), allocation.inverses.reshape(-1, 9)])
        return cls(rows, facets, thrusters.frame == "inertial", pulses)

    def free(self, times: Floats) -> Floats:
        """Return the time (J, T) [s] without planned firing of each thruster since the first time."""
        found = np.tile(times - times[0], (len(self.thrusters), 1))
        for j in np.unique(self.pulses.thruster):
            own = self.pulses[self.pulses.thruster == j]
            edges = np.stack([own.start, own.start + own.duration], axis=1)
            on = np.concatenate([[0.0], np.cumsum(np.diff(edges, axis=1))])
            since = np.interp(times, edges.ravel(), np.repeat(on, 2)[1:-1])
            found[j] -= since - since[0]
        return found


def impulse_until(pulses: Pulses, time: float) -> float:
    """Return the total impulse of pulses up to a time [m/s], counted per thruster."""
    return float(pulses.impulse @ np.clip((time - pulses.start) / pulses.duration, 0.0, 1.0))


def controllable_axes(thrusters: Thrusters, angles: Floats) -> Floats:
    """Return projections (T, 3, 3) onto the span of the thrusters, after rotations by `angles` (T,) [rad].

    In the orbit's axes. For thrusters that control all axes the projection is the unit matrix.
    """
    sides, sizes, _ = np.linalg.svd(thrusters.directions.T, full_matrices=False)
    span = sides[:, sizes > FLAT * sizes[0]]
    turned = turn(angles if thrusters.frame == "inertial" else 0.0 * angles) @ span
    return np.asarray(turned @ turned.swapaxes(-1, -2))


def lacks_axis(thrusters: Thrusters) -> bool:
    """Return True if there is an axis along which no thruster acts in either direction."""
    return bool(np.linalg.matrix_rank(thrusters.directions, tol=FLAT) < 3)
