"""Search of lost spacecraft by the flight core: legs and first locks."""

from __future__ import annotations

from math import nan
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import LARGEST, finite
from closeform.flight.library import complete, core, filled
from closeform.search.lock_times import Locks
from closeform.search.schedule import Search
from closeform.search.sensor import Sensor


def legs_of(search: Search) -> Any:
    """Return the legs of a search as the flight core reads them."""
    rows = [[leg.start, leg.end, leg.angle, *leg.axis, *leg.attitude.T.ravel()] for leg in search.legs]
    return filled("cff_leg_t[]", rows)


def sensor_of(sensor: Sensor) -> Any:
    """Return the `cff_sensor_t *` of a sensor."""
    numbers = sensor.half_angle, sensor.offset, min(sensor.range, LARGEST)
    return core().types.new("cff_sensor_t *", numbers)


def first_lock(legs: Any, sensor: Any, state: Any) -> Any:
    """Return the `cff_lock_t *` of a pair with this relative state, B minus A, at the start of the legs."""
    types, functions = core()
    pair, lock = filled("cff_state_t *", state), types.new("cff_lock_t *")
    complete(
        lambda budget: functions.cff_first_lock(
            legs, len(legs), sensor, pair, lock.certified_until_s, budget, lock
        )
    )
    return lock


def lock_times(search: Search, relative_position: ArrayLike, relative_velocity: ArrayLike) -> Locks:
    """Return the first lock of each pair of a craft in group A and one in B (H03 eqs. 1-2).

    Parameters
    ----------
    search : Search
        The schedule of both craft.
    relative_position : array_like of shape (M, 3) [m]
        Relative position, B minus A, at the start of the search, in the inertial frame; (3,) for one pair.
    relative_velocity : array_like of shape (M, 3) [m/s]
        Relative velocity, B minus A, in the inertial frame, of the same shape.

    Returns
    -------
    Locks
        First locks of M pairs, as `closeform.lock_times` returns them.
    """
    places = np.atleast_2d(finite("relative_position", relative_position, 3))
    speeds = np.atleast_2d(finite("relative_velocity", relative_velocity, 3))
    legs, sensor = legs_of(search), sensor_of(search.sensor)
    locks = [first_lock(legs, sensor, state) for state in np.hstack([places, speeds])]
    times = [lock.time_s if lock.leg >= 0 else nan for lock in locks]
    return Locks(np.array(times), np.array([lock.leg for lock in locks]))
