"""Proof by branch and bound that every pair in a box of initial states locks, with bounded errors.

A box is proven if all of its states lock at one instant, with the sensors narrowed by the largest effect of
the errors. Otherwise it is halved, as long as nodes are left. Without offset and range the problem is
scale-invariant: states and their multiples lock alike, and a box around the origin is proven on its faces, in
one dimension less.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, finite, instance, number, size, whole
from closeform.result import Result
from closeform.search.lock_march import in_parts
from closeform.search.lock_times import lock_times
from closeform.search.proofs.adversary import DRAWN, ROUNDS, Adversary
from closeform.search.proofs.error_bounds import ErrorBounds, errors_numbered, instants_of
from closeform.search.proofs.state_boxes import PROVEN, UNSEEN, StateBoxes, joined, judge
from closeform.search.schedule import Search
from closeform.search.search_errors import SearchErrors

EACH_ROUND = 5000  # number of boxes that take as long as a round of an adversary's climb
CHUNK = 4096  # number of boxes that one core judges in a row


@dataclass(frozen=True, eq=False, repr=False)
class LockProof(Result):
    """Result of a lock proof: the proven fraction of a box of initial states, and counterexamples.

    Attributes
    ----------
    open : float, no unit
        The fraction of the box, by volume, that is not proven.
    undecided : array of shape (K, 2, 6) [m, m/s]
        Minimum and maximum states of the undecided boxes, in the inertial frame. In a scale-invariant problem
        with the origin in the given box they are flat, in its faces, and each represents its multiples.
    counterexamples : array of shape (C, 6) [m, m/s]
        States that certainly do not lock in time with errors within the bounds, in the inertial frame.
    errors : SearchErrors
        Errors (C, 2) of the craft in A and in B with which these states do not lock; `lock_times` confirms
        it.
    nodes : int
        Number of boxes judged.
    """

    open: float
    undecided: Floats
    counterexamples: Floats
    errors: SearchErrors
    nodes: int

    @property
    def proven(self) -> float:
        """Fraction of the box, by volume, in which every pair certainly locks [no unit]."""
        return 1.0 - self.open

    @property
    def ok(self) -> bool:
        """True if every pair of the whole box is proven to lock."""
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
    """Prove that every pair in a box of initial states locks, with errors within given bounds.

    Parameters
    ----------
    search : Search
        The schedule of both craft.
    low : array_like of shape (6,) [m, m/s]
        Minimum position and velocity of the box, B minus A at the start of the search, in the inertial frame.
    high : array_like of shape (6,) [m, m/s]
        Maximum position and velocity of the box, in the same frame. Equal components make a flat box.
    pointing_error : float [rad], default 0
        Bound on each boresight's error, in any direction, constant or not.
    timing_error : float [s], default 0
        Bound on each clock's error.
    rate_error : float, no unit, default 0
        Bound on each slew rate's error, relative to the search's rate; below 1.
    slew_acceleration : float [rad/s^2], default inf
        Minimum acceleration at the start and end of each craft's turns; any larger value is covered.
    latest : float [s], optional
        Time by which all pairs must lock. Default: the end of the search.
    nodes : int, default 1_000_000
        Maximum number of boxes to judge.

    Returns
    -------
    LockProof
        The result, which does not depend on the number of cores.

    Raises
    ------
    ValueError
        If the box holds only the origin, a minimum component is above the maximum, shapes do not match, or a
        number is negative or not finite.

    Notes
    -----
    The proof includes rounding: g of theory (13) is below 0 by 1e-12 of all lengths in its sum. A
    counterexample is a pair that the certified march of `lock_times` never sees lock with errors as bad as
    the bounds allow. Boresights then always tilt away from the other craft, which is equivalent to sensors
    narrower by the pointing error, and clocks are exact, or of a craft behind or ahead of all others.
    Sensors with an offset are treated as not tilted.

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
    instants, worst = instants_of(search, until, bounds), bounds.worst(sensor)
    boxes = roots(search, least, greatest)
    judged, left, found = 0, [boxes[:0]], [refuted(search, boxes.centres[:0], until, worst)]
    while len(boxes) and judged < most:
        left.append(boxes[most - judged :])
        boxes = boxes[: most - judged]
        axes, verdicts = verdicts_of(search, instants, until, boxes)
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


def verdicts_of(search: Search, instants: Floats, until: float, boxes: StateBoxes) -> tuple[Any, Any]:
    """Return the axis along which to halve each box, and its verdict (M,); update `nearest` of the boxes."""
    sensor, verdicts = search.sensor, np.zeros(len(boxes), dtype=np.int64)
    # an unseen box is halved along its longest side; velocities count for half the duration
    axes = np.argmax(boxes.halves * np.repeat([1.0, 0.5 * until], 3), axis=1)

    def part(some: slice) -> None:
        rows = boxes.centres[some], boxes.halves[some]
        found = boxes.nearest[some], axes[some], verdicts[some]
        judge(instants, *rows, sensor.baseline, sensor.range, *found)

    in_parts(part, len(boxes), CHUNK)
    return axes, verdicts


def refuted(search: Search, states: Floats, until: float, worst: list[SearchErrors]) -> tuple[Floats, Any]:
    """Return the states among (M, 6) that do not lock in time with some of the errors, and which (C,)."""
    states = states[states[:, :3].any(axis=1)]  # two craft at the same position are no example
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
    """Return states (M, 6) that may never lock: random ones, else the latest of each adversary's climb."""
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
    """Return the initial boxes: the box itself, or its faces in a scale-invariant problem with the origin."""
    return StateBoxes.faces(low, high) if scales(search, low, high) else StateBoxes.of(low, high)


def scales(search: Search, low: Floats, high: Floats) -> bool:
    """Return True if the problem is scale-invariant, and the faces of the box represent all its states."""
    of_all_sizes = search.sensor.offset == 0.0 and search.sensor.range == inf
    return of_all_sizes and bool((low <= 0.0).all() and (high >= 0.0).all())


def ends_of_box(low: ArrayLike, high: ArrayLike) -> tuple[Floats, Floats]:
    """Return the minimum and maximum states (6,) of a box; ValueError for invalid ones."""
    least, greatest = finite("low", low), finite("high", high)
    for name, state in (("low", least), ("high", greatest)):
        if state.shape != (6,):
            raise ValueError(f"{name}: expected shape (6,), position and velocity, got {state.shape}")
    if (least > greatest).any():
        which = int(np.argmax(least > greatest))
        pair = f"{least[which]:g} is above {greatest[which]:g}"
        raise ValueError(f"low: component {which} of {pair} of high; exchange them")
    if not (least.any() or greatest.any()):
        raise ValueError("high: the box contains only the origin, two craft at one position; give it a width")
    return least, greatest
