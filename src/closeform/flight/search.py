"""Search of lost spacecraft by the flight core: turns, attitudes, first locks and joins."""

from __future__ import annotations

from math import nan
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import LARGEST, finite
from closeform.flight.library import BUDGET, check, core, filled
from closeform.search.lock_times import Locks
from closeform.search.schedule import Search


def legs_of(search: Search) -> Any:
    """Return the legs of a search as the flight core reads them."""
    rows = [[leg.start, leg.end, leg.angle, *leg.axis, *leg.attitude.T.ravel()] for leg in search.legs]
    return filled("cff_leg_t[]", rows)


def lock_times(search: Search, relative_position: ArrayLike, relative_velocity: ArrayLike) -> Locks:
    """Return the first lock of each pair of a craft in group A and one in B, found by the flight core.

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

    Raises
    ------
    RuntimeError
        If there is no C compiler or no cffi.
    ValueError
        If shapes do not match, a number is not finite, or two craft are at the same position.

    References
    ----------
    docs/on_board.md; H03 (Hadaegh, Scharf and Ploen 2003) eqs. 1-2.
    """
    types, functions = core()
    places = np.atleast_2d(finite("relative_position", relative_position, 3))
    speeds = np.atleast_2d(finite("relative_velocity", relative_velocity, 3))
    states = np.hstack([places, speeds])
    legs, lock = legs_of(search), types.new("cff_lock_t *")
    sensor = types.new(
        "cff_sensor_t *", (search.sensor.half_angle, search.sensor.offset, min(search.sensor.range, LARGEST))
    )
    times, found = np.full(len(states), nan), np.full(len(states), -1)
    for k, state in enumerate(states):
        pair, since, status = filled("cff_state_t *", state), 0.0, "MORE"
        while status == "MORE":
            status = check(
                functions.cff_first_lock(legs, len(search.legs), sensor, pair, since, BUDGET, lock), "MORE"
            )
            since = lock.certified_until_s
        if lock.leg >= 0:
            times[k], found[k] = lock.time_s, lock.leg
    return Locks(times, found)
