"""Proof of locks: by branch and bound, that every pair of a box of initial states locks, whatever the errors.

A box is proven if all of its states lock at one instant, with the sensors narrowed by all that errors can
turn them; else it is halved, as long as nodes are left.  Without offset and range lengths scale: states
and their multiples lock alike, and a box around the origin is proven on its faces, in a dimension less.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, cos, inf, isfinite, pi
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import LARGEST, Floats, instance, number, numbers, whole
from closeform.result import Result
from closeform.search.lock_boxes import FAILS, PROVEN, judge
from closeform.search.lock_march import in_parts
from closeform.search.schedule import Search
from closeform.search.state_boxes import StateBoxes, joined

STEP = pi / 90.0  # between two looks, of the boresight's turn
CHUNK = 4096  # boxes that one core judges in a row
BLIND = 1.5  # a cosine that no direction has


@dataclass(frozen=True, eq=False, repr=False)
class LockProof(Result):
    """For which initial states of a box every pair certainly locks, and some for which it does not.

    Attributes
    ----------
    open : float, no unit
        The share of the box, by volume, of which that is not proven.
    undecided : array of shape (K, 2, 6) [m, m/s]
        Least and greatest states of the boxes that are left, in the inertial frame.  Where lengths scale and
        the given box holds the origin they are flat, in its faces, and each stands for all its multiples.
    counterexamples : array of shape (C, 6) [m, m/s]
        States that certainly do not lock in time with errors within the bounds, in the inertial frame.
    nodes : int
        How many boxes were judged.
    """

    open: float
    undecided: Floats
    counterexamples: Floats
    nodes: int

    @property
    def proven(self) -> float:
        """The share of the box, by volume, in which every pair certainly locks [no unit]."""
        return 1.0 - self.open

    @property
    def ok(self) -> bool:
        """Whether it is proven that every pair of the whole box locks."""
        return len(self.undecided) == 0


def prove_locks(
    search: Search,
    low: ArrayLike,
    high: ArrayLike,
    *,
    pointing_error: float = 0.0,
    timing_error: float = 0.0,
    rate_error: float = 0.0,
    latest: float | None = None,
    nodes: int = 1_000_000,
) -> LockProof:
    """Prove that every pair of a box of initial states locks, whatever errors do within their bounds.

    Parameters
    ----------
    search : Search
        Which both carry out.
    low : array_like of shape (6,) [m, m/s]
        Least position and velocity of the box, B minus A at the start of the search, in the inertial frame.
    high : array_like of shape (6,) [m, m/s]
        The greatest, in the same frame; where it is equal to the least the box is flat.
    pointing_error : float [rad], default 0
        The most by which each boresight is off, in any direction, changing as it may.
    timing_error : float [s], default 0
        The most by which each clock is off.
    rate_error : float, no unit, default 0
        The most by which each slew rate is off, relative to the search's, from its start on.
    latest : float [s], optional
        Until when they must have locked: the end of the search unless given.
    nodes : int, default 1_000_000
        How many boxes are judged at most.

    Returns
    -------
    LockProof
        The same on any number of cores.

    Raises
    ------
    ValueError
        If the box holds no state but the origin, a least component is above the greatest, shapes do not fit,
        or a number is negative or not finite.

    Notes
    -----
    What is proven allows for rounding: g of theory (13) is below 0 by 1e-12 of all lengths that it is summed
    from.  A counterexample is a state whose pair the certified march of `lock_times` never sees lock, though
    clocks and rates are right, with sensors narrower by the pointing error: boresights that always lean away
    from the other craft.  Sensors with an offset are flown without any error.

    References
    ----------
    docs/theory.md (57) and docs/theory.md (58).

    Examples
    --------
    >>> search = cf.Search.modified(cf.Sensor(np.radians(70.0)), np.radians(0.25), np.radians(25.0))
    >>> near, reach = np.array([300, 40, -60, 0, 0.1, 0]), np.array([9, 9, 9, 0.01, 0.01, 0.01])
    >>> cf.prove_locks(search, near - reach, near + reach, pointing_error=0.01).ok
    True
    """
    sensor = instance("search", search, Search).sensor
    least, greatest = ends_of_box(low, high)
    pointing = bound("pointing_error", pointing_error)
    errors = pointing, bound("timing_error", timing_error), bound("rate_error", rate_error)
    until = search.duration if latest is None else min(bound("latest", latest), search.duration)
    most = whole("nodes", nodes, 1)
    looks = looks_of(search, until, *errors)
    lean = pointing if sensor.offset == 0.0 else 0.0
    narrowed = sensor.cosine if lean == 0.0 else cos(sensor.half_angle - lean)
    narrowed = narrowed if lean < sensor.half_angle else BLIND

    boxes = roots(search, least, greatest)
    judged, left, failing = 0, [boxes[:0]], [boxes.centres[:0]]
    while len(boxes) and judged < most:
        left.append(boxes[most - judged :])
        boxes = boxes[: most - judged]
        axes, verdicts = verdicts_of(search, looks, narrowed, until, boxes)
        judged += len(boxes)
        failing.append(boxes.centres[verdicts == FAILS])
        open_ones = verdicts != PROVEN
        boxes = boxes[open_ones].halved(axes[open_ones])
    rest = joined([*left, boxes])
    return LockProof(float(rest.shares.sum()), rest.edges, np.concatenate(failing), judged)


def verdicts_of(
    search: Search, looks: Floats, cosine: float, until: float, boxes: StateBoxes
) -> tuple[Any, Any]:
    """Where each box is to be halved, and its verdict (M,); the look that came nearest into the boxes."""
    axes, verdicts = np.zeros((2, len(boxes)), dtype=np.int64)

    def part(some: slice) -> None:
        judge(
            looks,
            search.table,
            boxes.centres[some],
            boxes.halves[some],
            search.sensor.baseline,
            cosine,
            search.sensor.range,
            until,
            boxes.looks[some],
            axes[some],
            verdicts[some],
        )

    in_parts(part, len(boxes), CHUNK)
    return axes, verdicts


def roots(search: Search, low: Floats, high: Floats) -> StateBoxes:
    """The boxes to begin with: the faces of one that holds the origin, where lengths scale, or itself."""
    return StateBoxes.faces(low, high) if scales(search, low, high) else StateBoxes.of(low, high)


def scales(search: Search, low: Floats, high: Floats) -> bool:
    """Whether pairs lock as their multiples do, and the faces of a box hold one of each of its states."""
    of_all_sizes = search.sensor.offset == 0.0 and search.sensor.range == inf
    return of_all_sizes and bool((low <= 0.0).all() and (high >= 0.0).all())


def looks_of(search: Search, until: float, pointing: float, timing: float, rate: float) -> Floats:
    """Times at which boxes are looked at, densely, with the cone in which both certainly see each other then.

    Rows (N, 6): time [s], boresight of A, cosine of the narrowed cone, and by how much [m] errors
    displace the two sensors.                                                            # theory (57)
    """
    times = [0.0]
    for leg in search.legs:
        count = ceil(abs(leg.angle) / STEP)
        times += [leg.start + (leg.end - leg.start) * k / count for k in range(1, count)] + [leg.end]
    when = np.array([t for t in times if t < until] + [until])
    error = pointing + search.slew_rate * ((1.0 + rate) * timing + rate * when)
    half_angle = search.sensor.half_angle - error
    # the cone is convex up to half of the sky: of a wider one that half is looked at
    cosines = np.where(half_angle < pi / 2.0, np.cos(half_angle), 0.0)
    shift = 2.0 * search.sensor.baseline * np.sin(np.minimum(error, pi) / 2.0)
    rows = np.column_stack([when, search.boresight(when), cosines, shift])
    return np.ascontiguousarray(rows[half_angle > 0.0])


def ends_of_box(low: ArrayLike, high: ArrayLike) -> tuple[Floats, Floats]:
    """Least and greatest states (6,) of a box; ValueError naming what is wrong with them."""
    least, greatest = numbers("low", low), numbers("high", high)
    for name, state in (("low", least), ("high", greatest)):
        if state.shape != (6,):
            raise ValueError(f"{name}: expected shape (6,), position and velocity, got {state.shape}")
        if not (np.abs(state) < LARGEST).all():
            raise ValueError(f"{name}: must be finite, got {state.tolist()}")
    if (least > greatest).any():
        which = int(np.argmax(least > greatest))
        pair = f"{least[which]:g} is above {greatest[which]:g}"
        raise ValueError(f"low: component {which} of {pair} of high; give the lesser one first")
    if not (least.any() or greatest.any()):
        raise ValueError("high: the box is the origin alone, two craft at one place; give it a width")
    return least, greatest


def bound(name: str, value: float) -> float:
    """An argument as a finite float from 0 on."""
    size = number(name, value)
    if not (isfinite(size) and size >= 0.0):
        raise ValueError(f"{name}: must be finite and at least 0, got {size:g}")
    return size
