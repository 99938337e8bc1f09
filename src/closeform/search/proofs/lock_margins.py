"""Margins of a lock: the angle by which each leg misses a pair, and the set of pairs that behave alike.

A leg misses by an angle m exactly if sensors wider by m do not lock in it. The certified march with a
wider cone decides this, and bisection finds the largest m. Initial states that differ by dr and dv move
the line between the two sensors by at most |dr| + t |dv|, and so turn it by at most the arc sine of that
over its length |q(t)|. A miss by an angle m at a distance of at least L persists while |dr| + t |dv| <= L sin
m. For a lock to persist, one instant well inside both cones is enough.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import acos, atan2, cos, inf, nan, pi, sin, sqrt
from typing import Any

import numpy as np
from numba import float64, void
from numpy.typing import ArrayLike

from closeform._jit import kernel
from closeform.arrays import Floats, instance
from closeform.result import Result
from closeform.search.field_of_view import TOLERANCE, Sensors
from closeform.search.lock_march import lock_in_leg
from closeform.search.lock_times import lock_times
from closeform.search.proofs.theorem import one_pair
from closeform.search.schedule import END, START, Search

PIECES = 32  # pieces of a leg, each with its own margin and length
HALVINGS = 45
ROUNDING = 16.0 * 2.2e-16  # of the terms of q
ANYWHERE = -2.0  # the cosine of a cone that holds every direction, whatever the rounding


@dataclass(frozen=True, eq=False, repr=False)
class LockMargins(Result):
    """Margins of a pair's first lock: the angles by which earlier legs miss, and the depth of the lock.

    Attributes
    ----------
    leg : int
        The index of the leg of the first lock, -1 for none.
    margins : array of shape (L,) [rad]
        Lower bound on the angle by which each leg up to that one misses, L = leg + 1; the last is negative,
        minus the depth of the lock. Without a lock one for each leg of the search.
    position, velocity : float [m, m/s]
        Half-axes of a set of initial states that certainly lock in the same leg (or never, as this pair):
        all that differ by dr and dv with |dr| / position + |dv| / velocity <= 1. A larger set may exist.
        `velocity` is inf for an immediate lock that does not depend on it.
    """

    leg: int
    margins: Floats
    position: float
    velocity: float

    @property
    def depth(self) -> float:
        """Lower bound on the depth [rad] of the other's sensor inside the cone, in the leg of the lock."""
        return -float(self.margins[-1]) if self.leg >= 0 else nan


@kernel(void(float64[::1], float64[::1], float64, float64, float64[:, ::1]))
def misses(leg: Floats, state: Floats, baseline: float, half_angle: float, pieces: Floats) -> None:
    """Write the end, minimum margin and sensor distance of each piece of a leg that misses."""
    position, velocity = (state[0], state[1], state[2]), (state[3], state[4], state[5])
    step = (leg[END] - leg[START]) / len(pieces)
    for k in range(len(pieces)):
        start = leg[START] + k * step
        end = leg[END] if k == len(pieces) - 1 else leg[START] + (k + 1) * step
        size = sqrt(state[0] ** 2 + state[1] ** 2 + state[2] ** 2) + baseline
        size += end * sqrt(state[3] ** 2 + state[4] ** 2 + state[5] ** 2)
        near, far = 0.0, size
        for _ in range(HALVINGS):
            middle = 0.5 * (near + far)
            near_by = Sensors(0.5 * baseline, ANYWHERE, ANYWHERE, middle)
            _, found = lock_in_leg(leg, start, end, position, velocity, near_by)
            near, far = (near, middle) if found else (middle, far)
        noise = ROUNDING * size
        pieces[k] = (end, 0.0, 0.0)
        if near <= 2.0 * noise:
            continue
        low, high = 0.0, pi - half_angle
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            cosine = cos(half_angle + middle)
            wider = Sensors(0.5 * baseline, cosine, cosine, inf)
            _, found = lock_in_leg(leg, start, end, position, velocity, wider)
            low, high = (low, middle) if found else (middle, high)
        # the tolerance of the march, and the rotation of q by rounding
        counted = 4.0 * TOLERANCE * (1.0 + 2.0 * baseline / near)
        certain = acos(min(1.0, cos(half_angle + low) + counted)) - half_angle - 2.0 * noise / near
        pieces[k] = (end, max(0.0, certain), near - noise)


@kernel(float64(float64[::1], float64[::1], float64, float64))
def deepest(leg: Floats, state: Floats, baseline: float, half_angle: float) -> Any:
    """Return the time, in a leg that locks, at which the other's sensor is deepest inside the cone."""
    position, velocity = (state[0], state[1], state[2]), (state[3], state[4], state[5])
    time, low, high = leg[START], 0.0, half_angle
    for halving in range(HALVINGS + 1):
        middle = 0.5 * (low + high) if halving else 0.0  # first the lock itself
        cosine = cos(half_angle - middle)
        narrower = Sensors(0.5 * baseline, cosine, cosine, inf)
        when, found = lock_in_leg(leg, leg[START], leg[END], position, velocity, narrower)
        if found:
            time, low = when, middle
        else:
            high = middle
    return time


def lock_margins(search: Search, position: ArrayLike, velocity: ArrayLike) -> LockMargins:
    """Return the angles by which each leg misses a pair until one locks, and the states that behave alike.

    Parameters
    ----------
    search : Search
        The schedule of both craft, with a sensor of unlimited range.
    position : array_like of shape (3,) [m]
        Relative position, B minus A, at the start of the search, in the inertial frame.
    velocity : array_like of shape (3,) [m/s]
        Relative velocity, B minus A, in the inertial frame; both coast in deep space.

    Returns
    -------
    LockMargins
        Certified bounds, which include the rounding of the march. Margins of a leg are accurate to about
        1e-9 rad.

    Raises
    ------
    ValueError
        If the sensor has a range, shapes do not match, a number is not finite, or the two craft are at the
        same position.

    References
    ----------
    docs/theory.md section 5.
    """
    sensor = instance("search", search, Search).sensor
    if sensor.range < inf:
        raise ValueError(f"search: margins require a sensor of unlimited range, got {sensor.range:g} m")
    r, v = one_pair(position, velocity)
    leg = int(lock_times(search, r, v).leg[0])
    state, half_angle = np.concatenate([r, v]), acos(sensor.cosine)
    missed = search.table if leg < 0 else search.table[:leg]
    pieces = np.empty((len(missed), PIECES, 3))
    for row, rows in zip(missed, pieces, strict=True):
        misses(row, state, sensor.baseline, half_angle, rows)
    margins = pieces[:, :, 1].min(axis=1)
    ends = pieces[:, :, 0].ravel()
    reaches = (pieces[:, :, 2] * np.sin(np.minimum(pieces[:, :, 1], pi / 2.0))).ravel()
    if leg >= 0:
        time = deepest(search.table[leg], state, sensor.baseline, half_angle)
        depth, distance = _depth(search, leg, time, r + v * time)
        margins = np.append(margins, -depth)
        ends, reaches = np.append(ends, time), np.append(reaches, distance * sin(min(depth, pi / 2.0)))
    with np.errstate(divide="ignore", invalid="ignore"):
        speeds = np.where(ends > 0.0, reaches / ends, inf)
    safety = 1.0 - 1e-9  # rounding, for states on the edge of the set
    return LockMargins(leg, margins, safety * float(reaches.min()), safety * float(speeds.min()))


def _depth(search: Search, leg: int, time: float, separation: Floats) -> tuple[float, float]:
    """Return the angle [rad] of the other craft's sensor inside the cone at a time, and its distance [m]."""
    boresight = search.legs[leg].attitude_at(time)[:, 2]
    q = separation - search.sensor.baseline * boresight
    angle = atan2(float(np.linalg.norm(np.cross(q, boresight))), float(q @ boresight))
    return max(0.0, acos(search.sensor.cosine) - angle), float(np.linalg.norm(q))
