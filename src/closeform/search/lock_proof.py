"""Proof of locks: by branch and bound, that every pair of a box of initial states locks, whatever the errors.

A box is proven if all of its states lock at one instant, with the sensors narrowed by all that errors can
turn them; else it is halved, as long as nodes are left.  Without offset and range lengths scale: states
and their multiples lock alike, and a box around the origin is proven on its faces, in a dimension less.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, inf, pi
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, finite, instance, number, size, whole
from closeform.result import Result
from closeform.search.adversary import DRAWN, ROUNDS, Adversary
from closeform.search.error_bounds import ErrorBounds, errors_numbered
from closeform.search.lock_boxes import PROVEN, UNSEEN, judge
from closeform.search.lock_march import in_parts
from closeform.search.locks import lock_times
from closeform.search.schedule import Search
from closeform.search.search_errors import SearchErrors
from closeform.search.state_boxes import StateBoxes, joined

STEP = pi / 90.0  # between two looks, of the boresight's turn
EACH_ROUND = 5000  # boxes that take as long as a round of an adversary's climb
CHUNK = 4096  # boxes that one core judges in a row


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
    errors : SearchErrors
        With which they do not (C, 2), of the craft in A and in B: `lock_times` with them says so.
    nodes : int
        How many boxes were judged.
    """

    open: float
    undecided: Floats
    counterexamples: Floats
    errors: SearchErrors
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
    slew_acceleration: float = inf,
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
        The most by which each slew rate is off, relative to the search's, from its start on; below 1.
    slew_acceleration : float [rad/s^2], default inf
        The least with which each craft's turns gain and lose their rate: it may have any from there on.
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
    from.  A counterexample is a state whose pair the certified march of `lock_times` never sees lock with
    errors as bad as the bounds allow: boresights that always lean away from the other craft, which is told as
    sensors narrower by the pointing error, and clocks that are right, or of who is behind or ahead of all
    others.  Sensors with an offset do not lean.

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
    bounds = ErrorBounds(
        size("pointing_error", pointing_error),
        size("timing_error", timing_error),
        size("rate_error", rate_error),
        number("slew_acceleration", slew_acceleration),
    )
    if bounds.rate >= 1.0:
        raise ValueError(f"rate_error: must be below 1, got {bounds.rate:g}")
    if not bounds.acceleration > 0.0:
        raise ValueError(f"slew_acceleration: must be positive, got {bounds.acceleration:g}")
    until = search.duration if latest is None else min(size("latest", latest), search.duration)
    most = whole("nodes", nodes, 1)
    looks, worst = looks_of(search, until, bounds), bounds.worst(sensor)
    boxes = roots(search, least, greatest)
    judged, left, found = 0, [boxes[:0]], [refuted(search, boxes.centres[:0], until, worst)]
    while len(boxes) and judged < most:
        left.append(boxes[most - judged :])
        boxes = boxes[: most - judged]
        axes, verdicts = verdicts_of(search, looks, until, boxes)
        judged += len(boxes)
        found.append(refuted(search, boxes.centres[verdicts == UNSEEN], until, worst))
        open_ones = verdicts != PROVEN
        boxes = boxes[open_ones].halved(axes[open_ones])
    rest = joined([*left, boxes])
    if len(rest) and bounds != ErrorBounds() and not any(len(states) for states, _ in found):
        box = search, least, greatest, scales(search, least, greatest)
        states = sought([Adversary(*box, errors) for errors in worst], most)
        found.append(refuted(search, states, until, worst))
    failing, which = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return LockProof(float(rest.shares.sum()), rest.edges, failing, errors_numbered(worst, which), judged)


def verdicts_of(search: Search, looks: Floats, until: float, boxes: StateBoxes) -> tuple[Any, Any]:
    """Where each box is to be halved, and its verdict (M,); the look that came nearest into the boxes."""
    axes, verdicts = np.zeros((2, len(boxes)), dtype=np.int64)
    sensor = search.sensor

    def part(some: slice) -> None:
        judge(
            looks,
            boxes.centres[some],
            boxes.halves[some],
            sensor.baseline,
            sensor.range,
            until,
            boxes.looks[some],
            axes[some],
            verdicts[some],
        )

    in_parts(part, len(boxes), CHUNK)
    return axes, verdicts


def refuted(search: Search, states: Floats, until: float, worst: list[SearchErrors]) -> tuple[Floats, Any]:
    """Of some states (M, 6) those that do not lock in time with one of the errors, and with which (C,)."""
    states = states[states[:, :3].any(axis=1)]  # two at one place are nobody's example
    lost, which = [states[:0]], [np.empty(0, dtype=np.int64)]
    for kind, errors in enumerate(worst):
        if not len(states):
            break
        found = lock_times(search, states[:, :3], states[:, 3:], errors)
        late = (found.leg < 0) | (found.time > until)
        lost.append(states[late])
        which.append(np.full(int(late.sum()), kind))
        states = states[~late]
    return np.concatenate(lost), np.concatenate(which)


def sought(adversaries: list[Adversary], effort: int) -> Floats:
    """States (M, 6) that may never lock: of those that adversaries draw, else the latest of each climb."""
    random = np.random.Generator(np.random.Philox(0))
    begun = []
    for one in adversaries:
        states = one.drawn(random, min(effort, DRAWN))
        times = one.times(states)
        never: Floats = states[times == inf]
        if len(never):
            return never
        begun.append((one, states, times))
    rounds = min(effort // EACH_ROUND, ROUNDS)
    return np.array([one.climbed(states, times, random, rounds)[0] for one, states, times in begun])


def roots(search: Search, low: Floats, high: Floats) -> StateBoxes:
    """The boxes to begin with: the faces of one that holds the origin, where lengths scale, or itself."""
    return StateBoxes.faces(low, high) if scales(search, low, high) else StateBoxes.of(low, high)


def scales(search: Search, low: Floats, high: Floats) -> bool:
    """Whether pairs lock as their multiples do, and the faces of a box hold one of each of its states."""
    of_all_sizes = search.sensor.offset == 0.0 and search.sensor.range == inf
    return of_all_sizes and bool((low <= 0.0).all() and (high >= 0.0).all())


def looks_of(search: Search, until: float, bounds: ErrorBounds) -> Floats:
    """Times at which boxes are looked at, densely, with the cone in which both certainly see each other then.

    Rows (N, 6): time [s], boresight of A midway between the slowest and the fastest, cosine of the narrowed
    cone, and by how much [m] errors displace the two sensors.                           # theory (57)
    """
    times = [0.0]
    for leg in search.legs:
        count = ceil(abs(leg.angle) / STEP)
        times += [leg.start + (leg.end - leg.start) * k / count for k in range(1, count)] + [leg.end]
    when = np.array([t for t in times if t < until] + [until])
    behind, ahead = bounds.searched(search, when)
    error = bounds.pointing + search.slew_rate * 0.5 * (ahead - behind)
    half_angle = search.sensor.half_angle - error
    # the cone is convex up to half of the sky: of a wider one that half is looked at
    cosines = np.where(half_angle < pi / 2.0, np.cos(half_angle), 0.0)
    shift = 2.0 * search.sensor.baseline * np.sin(np.minimum(error, pi) / 2.0)
    rows = np.column_stack([when, search.boresight(0.5 * (behind + ahead)), cosines, shift])
    return np.ascontiguousarray(rows[half_angle > 0.0])


def ends_of_box(low: ArrayLike, high: ArrayLike) -> tuple[Floats, Floats]:
    """Least and greatest states (6,) of a box; ValueError naming what is wrong with them."""
    least, greatest = finite("low", low), finite("high", high)
    for name, state in (("low", least), ("high", greatest)):
        if state.shape != (6,):
            raise ValueError(f"{name}: expected shape (6,), position and velocity, got {state.shape}")
    if (least > greatest).any():
        which = int(np.argmax(least > greatest))
        pair = f"{least[which]:g} is above {greatest[which]:g}"
        raise ValueError(f"low: component {which} of {pair} of high; give the lesser one first")
    if not (least.any() or greatest.any()):
        raise ValueError("high: the box is the origin alone, two craft at one place; give it a width")
    return least, greatest
