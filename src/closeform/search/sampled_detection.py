"""Detection of locks at fixed time steps, as in a conventional simulation, for comparison only.

It finds a lock at the first sample within it, up to a step late, and misses a lock that begins and ends
between two samples.
"""

from math import nan
from typing import Any

import numpy as np
from numba import float64, int64, void

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.search.field_of_view import Sensors, view
from closeform.search.lock_march import in_parts
from closeform.search.schedule import Search

CHUNK = 16_384
ROWS = float64[:, ::1]


@kernel(void(float64[::1], ROWS, int64[::1], ROWS, ROWS, float64[::1], float64[::1], int64[::1]))
def scan(
    samples: Floats,
    boresights: Floats,
    legs: Any,
    positions: Floats,
    velocities: Floats,
    sensor: Floats,
    times: Floats,
    found: Any,
) -> None:
    """Write the first sample at which each pair locks. `sensor` (3,): offset, cosine, range."""
    sensors = Sensors(sensor[0], sensor[1], sensor[1], sensor[2])
    for m in range(len(positions)):
        times[m], found[m] = nan, -1
        for k in range(len(samples)):
            t = samples[k]
            x = positions[m, 0] + velocities[m, 0] * t
            y = positions[m, 1] + velocities[m, 1] * t
            z = positions[m, 2] + velocities[m, 2] * t
            bx, by, bz = boresights[k, 0], boresights[k, 1], boresights[k, 2]
            _, _, gap, _, beyond, tolerance = view((bx, by, bz), (-bx, -by, -bz), (x, y, z), sensors)
            if gap <= tolerance and beyond <= tolerance:
                times[m], found[m] = t, legs[k]
                break


def sampled_times(
    search: Search, relative_position: Floats, relative_velocity: Floats, step: float
) -> tuple[Floats, Any]:
    """Return the first locks of M pairs at samples every `step` [s] from 0 on: times (M,) [s], legs (M,).

    Positions [m] and velocities [m/s] are (M, 3), B minus A. Without a lock at any sample, nan and -1.
    """
    samples = np.arange(int(search.duration / step) + 1) * step
    boresights = np.ascontiguousarray(search.boresight(samples))
    legs = np.searchsorted([leg.end for leg in search.legs], samples).astype(np.int64)
    positions = np.ascontiguousarray(relative_position, dtype=float)
    velocities = np.ascontiguousarray(relative_velocity, dtype=float)
    times, found = np.empty(len(positions)), np.empty(len(positions), dtype=np.int64)
    sensor = np.array([search.sensor.offset, search.sensor.cosine, search.sensor.range])

    def part(some: slice) -> None:
        scan(samples, boresights, legs, positions[some], velocities[some], sensor, times[some], found[some])

    in_parts(part, len(positions), CHUNK)
    return times, found
