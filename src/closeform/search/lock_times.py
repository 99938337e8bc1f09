"""First locks of pairs of craft: the time at which two craft first see each other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import LARGEST, Floats, instance, numbers, positive
from closeform.result import Rows
from closeform.search.lock_march import CHUNK, COINCIDENT, NOT_FINITE, first_locks, in_parts
from closeform.search.schedule import Search
from closeform.search.search_errors import SearchErrors, craft_rows, errors_of_swapped


@dataclass(frozen=True, eq=False, repr=False)
class Locks(Rows):
    """First locks of M pairs.

    Attributes
    ----------
    time : array of shape (M,) [s]
        Time from the start of the search; nan without a lock.
    leg : array of int of shape (M,)
        Index of the leg of the lock; -1 without a lock.
    """

    _columns: ClassVar = {
        "time": "time_s",
        "leg": "leg",
    }

    time: Floats
    leg: Any

    def __len__(self) -> int:
        return len(self.time)


def lock_times(
    search: Search,
    relative_position: ArrayLike,
    relative_velocity: ArrayLike,
    errors: SearchErrors | None = None,
    step: float | None = None,
    bearing: bool = False,
) -> Locks:
    """Return the first lock of each pair of a craft in group A and one in B, coasting in deep space.

    Parameters
    ----------
    search : Search
        The schedule of both craft.
    relative_position : array_like of shape (M, 3) [m]
        Relative position, B minus A, at the start of the search, in the inertial frame; (3,) for one pair.
    relative_velocity : array_like of shape (M, 3) [m/s]
        Relative velocity, B minus A, in the inertial frame; both shapes broadcast.
    errors : SearchErrors, optional
        Search errors of the craft of each pair, in A and in B: of shape (M, 2), or (2,) for all pairs. Locks
        are then found until both have completed their turns, and a leg is that of the craft in A.
    step : float [s], optional
        Detect locks only at multiples of this time, as a simulation with time steps does. It finds a lock up
        to a step late, and misses one that begins and ends between two steps. Default: at any time.
    bearing : bool, default False
        True if hemisphere antennas determine the side of body x-y on which the other craft of a pair is. The
        pair then takes the groups whose boresights begin towards each other: the second is in A if it is
        behind.

    Returns
    -------
    Locks
        First locks of M pairs, in their order.

    Raises
    ------
    ValueError
        If shapes do not match, a number is not finite, two craft are at the same position, `step` is not
        positive, or errors leave no cone.

    Notes
    -----
    Certified without `step`: no lock is missed, however short. A margin below 1e-12 of the distance counts as
    a lock. Times are accurate to 1e-6 s if the margin changes faster than 1e-6 per second. All cores are
    used.

    References
    ----------
    H03 (Hadaegh, Scharf and Ploen 2003) eqs. 1-2; docs/theory.md (13) and docs/theory.md (14).

    Examples
    --------
    >>> search = cf.Search.modified(cf.Sensor(np.radians(70.0)), np.radians(0.25), np.radians(25.0))
    >>> cf.lock_times(search, [[300.0, 40.0, -60.0]], [[0.0, 0.1, 0.0]]).time.tolist()
    [0.0]
    """
    positions, velocities = _vectors(relative_position=relative_position, relative_velocity=relative_velocity)
    sensor, count = instance("search", search, Search).sensor, len(positions)
    alike = errors is None or len(instance("errors", errors, SearchErrors).shape) < 2
    times, legs = np.empty(count), np.empty(count, dtype=np.int64)
    every = 0.0 if step is None else positive("step", step)
    if instance("bearing", bearing, bool, np.bool_):
        behind = positions[:, 0] < 0.0
        positions, velocities = (np.where(behind[:, None], -both, both) for both in (positions, velocities))
        errors, alike = errors_of_swapped(errors, behind), errors is None
    asked = f"{count} pairs is (M, 2{{}}), or common to all pairs"

    def part(some: slice) -> None:
        shape, which = ((1, 2), slice(None)) if alike else ((count, 2), some)
        craft = craft_rows(errors, sensor, shape, [False, True], asked, which)
        where, speeds = positions[some], velocities[some]
        first_locks(search.table, where, speeds, craft, sensor.offset, every, times[some], legs[some])

    in_parts(part, count, CHUNK)
    if (legs == NOT_FINITE).any():
        which = int(np.argmax(legs == NOT_FINITE))
        sound = np.abs(positions[which]).sum() < 0.5 * LARGEST  # otherwise the velocity is at fault
        name = "relative_velocity" if sound else "relative_position"
        raise ValueError(f"{name}: pair {which} has a number that is not finite, or too large")
    if (legs == COINCIDENT).any():
        which = int(np.argmax(legs == COINCIDENT))
        raise ValueError(f"relative_position: the two craft of pair {which} are at the same position")
    return Locks(times, legs)


def _vectors(**given: ArrayLike) -> tuple[Floats, ...]:
    """Return arguments broadcast to one shape (M, 3)."""
    arrays = {name: np.atleast_2d(numbers(name, value)) for name, value in given.items()}
    for name, array in arrays.items():
        if array.ndim != 2 or array.shape[1] != 3:
            raise ValueError(f"{name}: expected shape (M, 3), got {np.shape(given[name])}")
    try:
        shape = np.broadcast_shapes(*(array.shape for array in arrays.values()))
    except ValueError:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        raise ValueError(f"shapes do not broadcast: {shapes}") from None
    return tuple(
        np.ascontiguousarray(array if array.shape == shape else np.broadcast_to(array, shape))
        for array in arrays.values()
    )
