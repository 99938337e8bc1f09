"""Passive safety of two paths, and the closest approach after a failure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from closeform.arrays import Floats, broadcast, instance, number, shown
from closeform.conflicts.two_paths import check_comparable, closest_approach, craft_of, every_pair
from closeform.motion.arc import END, IMPULSE, START, THRUST
from closeform.motion.chief_orbit import ChiefOrbit
from closeform.motion.duration import MOST_ORBITS
from closeform.motion.orbit import Orbit
from closeform.motion.path import FORGIVEN, Path
from closeform.result import Rows
from closeform.safety.drift_beside_chief import loss_of_thrust_is_safe
from closeform.safety.failure_cells import INTACT, KIND, LOW, MISSED, OFFSET, PIECE, SIDE, Side, side_of
from closeform.safety.failure_motions import room_for
from closeform.safety.failure_search import FAILURE, LOWER, PLACE, RATIO, TIME, worst_failures
from closeform.safety.failures import DegradedThrust, Failure, MissedBurns, StuckOnThrust, ThrustLost
from closeform.safety.infinite_horizon import continue_failures
from closeform.safety.shadow import floor_of, shadow_form, shadow_of_faces
from closeform.safety.single_failures import MEETS
from closeform.zones.shapes import FACES
from closeform.zones.zone import Zone

SOON = 100.0  # orbits of a drift without end that are searched directly
FAILURES = (ThrustLost, MissedBurns, DegradedThrust, StuckOnThrust)
Failing = Literal["path", "other", "either", "both"]
Losses = Callable[[Floats], tuple[Floats, Floats]]  # times (K,) of losses and states (K, 6) from places (K,)
SAME = 5e-10  # of a minimum ratio, or of 1: accepted uncertainty of cells
# About any chief: sampled losses of thrust along a path, then near the MINIMA lowest of all, and equally
# spaced fractions of an impulse.  The nearest fractions at INSTANTS of the drift are sampled as well.
LOSSES, MINIMA, SHARES, INSTANTS = (200, *(21,) * 5), 4, 65, 1000
CERTAIN, HALVINGS = 0.999, 8  # of the minimum found: bound that is proven, or else halvings to one that is


@dataclass(frozen=True, eq=False, repr=False)
class DriftApproach(Rows):
    """Closest approach of two spacecraft, or of the pairs of two batches, after a failure of thrust.

    Attributes
    ----------
    failed_at : float or array of shape (...) [s]
        Time of the worst failure; for missed burns the first burn that is incomplete.  Where
        both spacecraft fail (..., 2), that of `path` first; nan without a common time.
    time : float or array of shape (...) [s]
        Time of the minimum norm after it; nan without a common time, and inf where ever slower drifts
        approach it as a limit.
    ratio : float or array of shape (...), no unit
        Clearance ratio: the minimum norm after a failure that was found; inf without a common time.  It is
        the minimum over all instants of failure and all of the drift if `lower` is next to it, else an upper
        bound.
    distance : float or array of shape (...) [m]
        Distance of the centres at that time, not necessarily the minimum; inf without a time.
    failing : str or array of str of shape (...)
        Which spacecraft fails in the worst case: "path", "other" or "both".
    lower : float or array of shape (...), no unit
        Lower bound on the norm after any failure: 1e-9 below the ratio, or that fraction of it.  It is lower
        if the search reached its maximum number of cells, as with several missed burns of both spacecraft. It
        is -inf if unlimited drift may lead ever deeper into half-spaces.  Use this bound to judge safety.
    """

    _columns: ClassVar = {
        "failed_at": "failed_at_s other_failed_at_s",
        "time": "time_s",
        "ratio": "ratio",
        "distance": "distance_m",
        "failing": "failing",
        "lower": "lower",
    }

    failed_at: Any
    time: Any
    ratio: Any
    distance: Any
    failing: Any
    lower: Any


def passively_safe(
    path: Path,
    other: Path,
    zone: Zone,
    until: float,
    failure: Failure = ThrustLost(),  # noqa: B008 (it is frozen)
    failing: Failing = "path",
) -> Any:
    """Return True if a spacecraft stays out of a zone whenever its thrust fails, during all of the drift.

    Parameters
    ----------
    path : Path
        Path of one spacecraft, or a batch.
    other : Path
        Path of the spacecraft that the zone is around, or a batch, in the same orbit; batch shapes broadcast.
    zone : Zone
        Zone of the pair.
    until : float [s]
        End of the drift, in the time of the paths, not before the failing path ends. inf stands for
        a million orbits. A spacecraft that does not fail coasts once its path has ended.
    failure : ThrustLost, MissedBurns, DegradedThrust or StuckOnThrust, default ThrustLost()
        Failure of thrust; about a chief that is not on a circle only `ThrustLost`.
    failing : {"path", "other", "either", "both"}, default "path"
        Which spacecraft fails: one while the other continues as planned, either (the worse of the
        two), or both, each at its own instant.  About a chief that is not on a circle not both.

    Returns
    -------
    bool or array of bool of shape (...)
        True if no failure leads into the zone, which is certified; also without a common time.  False
        if one does, or if many cells left it undecided (failures that graze it, with many unknowns).

    Raises
    ------
    ValueError
        If a path that does not fail ends before `until`, `until` is before the end of a path that fails,
        impulses would be stuck on, the orbits differ, batch shapes do not broadcast, or an argument is
        of another type; about a chief that is not on a circle if `until` is inf.

    References
    ----------
    docs/theory.md sections 8 and 11; docs/passive_safety.md.

    Examples
    --------
    >>> orbit = cf.Orbit.circular(500e3)
    >>> client = orbit.coast(np.zeros(6), 3 * orbit.period)
    >>> approach = orbit.transfer([0, -200, 0, 0, 0, 0], [0, -30, 0, 0, 0, 0], orbit.period)
    >>> bool(cf.passively_safe(approach, client, cf.Sphere(10.0), client.end))
    False
    """
    if isinstance(instance("path", path, Path).orbit, ChiefOrbit):
        safe = _safe_beside_chief(path, other, zone, until, failure, failing)
    else:
        ratios = [rows[:, RATIO] for _, rows, *_ in _worst(path, other, zone, until, failure, failing, 0.0)]
        safe = np.isinf(np.minimum.reduce(ratios))
    shape = broadcast(path=path.shape, other=other.shape)
    return safe.reshape(shape) if shape else bool(safe[0])


def _safe_beside_chief(
    path: Path, other: Path, zone: Zone, until: float, failure: Any, failing: Any
) -> NDArray[np.bool_]:
    """Return whether each pair (P,) about a chief that is not on a circle is passively safe."""
    end = _checked_beside_chief(path, other, zone, until, failure, failing)
    return np.array(
        [
            (failing == "other" or loss_of_thrust_is_safe(mine, its, zone, end))
            and (failing == "path" or loss_of_thrust_is_safe(its, mine, zone, end, around=False))
            for mine, its in every_pair(path, other)
        ],
        dtype=bool,
    )


def _checked_beside_chief(
    path: Path, other: Path, zone: Zone, until: float, failure: Any, failing: Any
) -> float:
    """Validate the arguments about a chief that is not on a circle; return the end of the drift."""
    chief = path.orbit.chief  # type: ignore[attr-defined]
    if not isinstance(failure, ThrustLost) or failing == "both":
        raise ValueError(
            f"failure, failing: only ThrustLost of one spacecraft is supported about {chief}; failures with "
            "several unknowns require a circular orbit"
        )
    if not np.isfinite(number("until", until)):
        raise ValueError(
            f"until: must be finite about {chief}; an infinite horizon requires a circular orbit"
        )
    return _checked(path, other, zone, until, failure, failing)


def _columns_beside_chief(
    path: Path, other: Path, zone: Zone, until: float, failure: Any, failing: Any
) -> list[list[Any]]:
    """Return the columns of a `DriftApproach` about a chief, for each spacecraft of a pair that may fail."""
    end = _checked_beside_chief(path, other, zone, until, failure, failing)
    found = []
    for side in ("path", "other") if failing == "either" else (failing,):
        mine = side == "path"
        rows = [
            _after_loss(*(pair if mine else pair[::-1]), zone, end, mine) for pair in every_pair(path, other)
        ]
        at, time, ratio, distance, lower = np.array(rows).reshape(-1, 5).T
        found.append([at, time, ratio, distance, np.full(len(rows), side), lower])
    return found


def _after_loss(
    fails: Path, meets: Path, zone: Zone, end: float, around: bool
) -> tuple[float, float, float, float, float]:
    """Return `worst_loss`, and a bound that no loss at any instant goes below."""
    at, time, ratio, distance = worst_loss(fails, meets, zone, end, around)
    if at != at or ratio == np.inf:
        return at, time, ratio, distance, ratio

    def clears(level: float) -> bool:
        larger = Zone(zone.shape, zone.matrix / level, zone.faces)
        return loss_of_thrust_is_safe(fails, meets, larger, end, around)

    lower, above = 0.0 if zone.shape != FACES else -np.inf, CERTAIN * ratio
    for level in (above, 1.0):
        if max(lower, 0.0) < level < ratio and clears(level):
            lower = level
    for _ in range(HALVINGS if 0.0 < above > lower else 0):
        level = 0.5 * (max(lower, 0.0) + above)
        lower, above = (level, above) if clears(level) else (lower, level)
    return at, time, ratio, distance, lower


def worst_loss(
    fails: Path,
    meets: Path,
    zone: Zone,
    end: float,
    around: bool,
    counts: Sequence[int] = LOSSES,
    minima: int = MINIMA,
) -> tuple[float, float, float, float]:
    """Return the time of the worst loss of thrust found, that of the minimum norm, the norm and the distance.

    The zone is around `meets`, or around `fails` if not `around`.  Instants of a path and shares of each
    impulse are sampled, then again near the lowest `minima` of all.  Without thrust the first time is nan.
    """
    thrusts = fails.arcs[:, THRUST:].any() or fails.arcs[:, IMPULSE : IMPULSE + 3].any()
    last = min(float(fails.end), np.nextafter(end, -np.inf))
    worst = np.nan, np.nan, np.inf, np.inf

    def examined(times: Floats, states: Floats) -> Floats:
        nonlocal worst
        drifts = fails.orbit.coast(states, end - times, times)
        near = closest_approach(*((drifts, meets) if around else (meets, drifts)), zone)
        k = int(np.argmin(near.ratio))
        if near.ratio[k] < worst[2]:
            worst = times[k], near.time[k], near.ratio[k], near.distance[k]
        return np.asarray(near.ratio)

    def along(times: Floats) -> tuple[Floats, Floats]:
        return times, fails.state(times)

    parts: list[tuple[Losses, Floats]] = [
        (along, np.linspace(fails.start, last, counts[0] if thrusts else 1))
    ]
    for at, jump in fails.impulses:
        if at < end:
            amid = partial(amid_impulse, fails.state(at), jump, at)
            near = nearest_shares(fails, meets, zone, amid(np.array([0.0, 1.0]))[1], at, end)
            parts.append((amid, np.union1d(near, np.linspace(0.0, 1.0, SHARES))))
    each = [losses(places) for losses, places in parts]
    ratios = examined(*map(np.concatenate, zip(*each, strict=True)))
    basins: list[tuple[float, int, int]] = []
    for part, own in enumerate(np.split(ratios, np.cumsum([len(places) for _, places in parts])[:-1])):
        beside = np.pad(own, 1, constant_values=np.inf)
        lowest = np.flatnonzero((own <= beside[:-2]) & (own <= beside[2:]))
        basins += [(float(own[k]), part, int(k)) for k in lowest]
    for _, part, k in sorted(basins)[: minima * thrusts]:
        losses, places = parts[part]
        for count in counts[1:]:
            places = np.linspace(places[max(k - 1, 0)], places[min(k + 1, len(places) - 1)], count)
            k = int(np.argmin(examined(*losses(places))))
    at, time, ratio, distance = map(float, worst)
    return at if thrusts else np.nan, time, ratio, distance


def amid_impulse(after: Floats, jump: Floats, at: float, shares: Floats) -> tuple[Floats, Floats]:
    """Return the times (K,) and states (K, 6) of losses of thrust after `shares` (K,) of an impulse."""
    states = np.repeat(after[None], len(shares), axis=0)
    states[:, 3:] -= (1.0 - shares)[:, None] * jump
    return np.full(len(shares), at), states


def nearest_shares(fails: Path, meets: Path, zone: Zone, states: Floats, at: float, end: float) -> Floats:
    """Return shares (K,) of an impulse after which a drift comes nearest to another path, at some instant.

    Drifts are on the chord between those of `states` (2, 6), without and with all of the impulse.
    """
    times = np.linspace(at, end, INSTANTS)
    first, last = fails.orbit.coast(states, end - at, at).position(times)
    start = (first - meets.position(np.clip(times, meets.start, meets.end))) @ zone.matrix.T
    chord = (last - first) @ zone.matrix.T
    share = -(start * chord).sum(axis=1) / np.maximum((chord * chord).sum(axis=1), np.finfo(float).tiny)
    share = np.clip(share, 0.0, 1.0)
    apart = np.pad(np.linalg.norm(start + share[:, None] * chord, axis=1), 1, constant_values=np.inf)
    return np.asarray(share[(apart[1:-1] <= apart[:-2]) & (apart[1:-1] <= apart[2:])])


def drift_approach(
    path: Path,
    other: Path,
    zone: Zone,
    until: float,
    failure: Failure = ThrustLost(),  # noqa: B008 (it is frozen)
    failing: Failing = "path",
) -> DriftApproach:
    """Return the closest approach after a failure at any instant, over all of the drift after it.

    Parameters
    ----------
    path : Path
        Path of one spacecraft, or a batch.
    other : Path
        Path of the spacecraft that the zone is around, or a batch, in the same orbit; batch shapes broadcast.
    zone : Zone
        Zone that defines the norm.
    until : float [s]
        End of the drift, in the time of the paths, not before the failing path ends. inf stands for
        a million orbits. A spacecraft that does not fail coasts once its path has ended.
    failure : ThrustLost, MissedBurns, DegradedThrust or StuckOnThrust, default ThrustLost()
        Failure of thrust; about a chief that is not on a circle only `ThrustLost`.
    failing : {"path", "other", "either", "both"}, default "path"
        Which spacecraft fails: one while the other continues as planned, either (the worse of the
        two), or both, each at its own instant.  About a chief that is not on a circle not both.

    Returns
    -------
    DriftApproach
        Floats for two spacecraft, arrays for batches. No failure at any instant leads below `lower`
        during the drift. The `ratio` is that of a failure that was found: it is the minimum to 1e-9,
        or to that fraction of itself where it is above 1, unless failures with many unknowns need more
        cells than are searched; then the minimum lies between `lower` and `ratio`.  About a chief that is
        not on a circle `lower` is mostly 0.1 % below the ratio; where it is lower, the minimum lies between.

    Raises
    ------
    ValueError
        If a path that does not fail ends before `until`, `until` is before the end of a path that fails,
        impulses would be stuck on, the orbits differ, batch shapes do not broadcast, or an argument is
        of another type; about a chief that is not on a circle if `until` is inf.

    References
    ----------
    docs/theory.md sections 8 and 11; docs/passive_safety.md.
    """
    if isinstance(instance("path", path, Path).orbit, ChiefOrbit):
        found = _columns_beside_chief(path, other, zone, until, failure, failing)
    else:
        found = [_columns_of(*one) for one in _worst(path, other, zone, until, failure, failing, SAME)]
    best = found[0]
    for other_one in found[1:]:
        lower = np.minimum(best[-1], other_one[-1])
        best = [np.where(other_one[2] < best[2], b, a) for a, b in zip(best, other_one, strict=True)]
        best[-1] = lower
    shape = broadcast(path=path.shape, other=other.shape)
    if not shape:
        at, time, ratio, distance, which, lower = (column[0] for column in best)
        failed_at = float(at) if np.ndim(at) == 0 else at
        return DriftApproach(failed_at, float(time), float(ratio), float(distance), str(which), float(lower))
    return DriftApproach(*(column.reshape(shape + column.shape[1:]) for column in best))


def drift_end(until: float, orbit: Orbit) -> float:
    """Return the validated end of a drift in an orbit."""
    end = number("until", until)
    if np.isnan(end) or end == -np.inf:
        raise ValueError(f"until: expected a time in s, or inf, got {end:g}")
    if end == np.inf and orbit.mean_motion == 0.0:
        raise ValueError("until: inf requires an orbit; in deep space give a time")
    return end


def last_times(path: Path) -> Floats:
    """Return the end times of the spacecraft of a path (N,) [s]."""
    found: Floats = path.arcs[path.offsets[1:] - 1, END]
    return found


def forgiven(path: Path) -> Any:
    """Return the accepted rounding of the end of a drift, of the path's shape [s]."""
    return FORGIVEN * np.asarray(path.end - path.start)


def checked_end(name: str, path: Path, until: float, failure: Any) -> float:
    """Return the validated end of the drift of a path that can fail and ends before it."""
    end = drift_end(until, path.orbit)
    if last_times(path).max(initial=-np.inf) > end and (path.end > end + forgiven(path)).any():
        raise ValueError(
            f"until: {end:g} s is before the end of {name}, {last_times(path).max():g} s; give that or later"
        )
    known = (
        not isinstance(instance("failure", failure, *FAILURES), StuckOnThrust)
        or failure.acceleration is not None
    )
    if not known and path.arcs[:, IMPULSE : IMPULSE + 3].any():
        raise ValueError(f"failure: {name} has impulses, whose thrust is unknown; give an acceleration")
    return end


def soon_after(path: Path, other: Path) -> float:
    """Return the time up to which a drift without end is searched directly."""
    last = max(last_times(path).max(initial=0.0), np.max(other.start, initial=0.0))
    return float(last + SOON * path.orbit.period)


def _checked(path: Path, other: Path, zone: Zone, until: float, failure: Any, failing: Any) -> float:
    """Validate the arguments together; return the end of the drift."""
    check_comparable(path, other, zone)
    instance("failure", failure, *FAILURES)
    if not isinstance(failing, str) or failing not in ("path", "other", "either", "both"):
        raise ValueError(f"failing: expected 'path', 'other', 'either' or 'both', got {shown(failing)}")
    end = drift_end(until, path.orbit)
    for name, one, rest in (("path", path, "other"), ("other", other, "path")):
        if failing != rest:  # it fails, in some or all cases
            checked_end(name, one, end, failure)
        continues = failing not in (name, "both")
        if (
            continues
            and last_times(one).min(initial=np.inf) < end < np.inf
            and (one.end < end - forgiven(one)).any()
        ):
            raise ValueError(
                f"{name}: ends at {last_times(one).min():g} s, but must continue while the other fails; "
                f"extend it to {end:g} s, for example by a coast"
            )
    return end


def _worst(
    path: Path, other: Path, zone: Zone, until: float, failure: Any, failing: Any, certain: float
) -> list[tuple[str, Floats, Zone, tuple[Side, Side], Any]]:
    """Return for each combination of failing spacecraft its name and the rows of `worst_failures`."""
    end = _checked(path, other, zone, until, failure, failing)
    soon = end if np.isfinite(end) else soon_after(path, other)
    shape = broadcast(path=path.shape, other=other.shape)
    first, second = craft_of(path, shape), craft_of(other, shape)
    found = []
    for which in ("path", "other") if failing == "either" else (failing,):
        one = side_of(path, None if which == "other" else failure, soon, end == np.inf)
        two = side_of(other, None if which == "path" else failure, soon, end == np.inf)
        most = np.inf if certain > 0.0 else MEETS
        rows = search_pairs(one, two, first, second, soon, path.orbit, zone, certain, most, end == np.inf)
        found.append((which, rows, zone, (one, two), (first, second)))
    return found


def search_pairs(
    one: Side,
    two: Side,
    first: Any,
    second: Any,
    end: float,
    orbit: Orbit,
    zone: Zone,
    certain: float,
    most: float,
    for_ever: bool = False,
) -> Floats:
    """Return the rows of `worst_failures` for pairs, with as much work space as they need."""
    room = room_for(one, two)
    one, two = one._replace(now=one.now.copy()), two._replace(now=two.now.copy())  # which the search changes
    two.now[OFFSET] = (room.cells.shape[1] + SIDE) // 2
    rows = np.zeros((len(first), FAILURE + room.cells.shape[1]))
    shadow = shadow_of_faces(zone)
    if shadow is None:
        shadow = zone.form if zone.shape == FACES and not (for_ever and certain == 0.0) else shadow_form(zone)
    task = orbit.mean_motion, zone.form, zone.stretch, certain, most, shadow, floor_of(zone)
    left = np.arange(len(first))
    while len(left):
        some = np.zeros((len(left), rows.shape[1]))
        pairs = first[left], second[left], np.full(len(left), end)
        worst_failures(one, two, *pairs, *task, room, some)
        if for_ever:
            far = end + MOST_ORBITS * orbit.period
            continue_failures(one, two, *pairs, *task, far, room, some)
        rows[left] = some
        left = left[some[:, RATIO] == -np.inf]
        if len(left):
            room = room_for(one, two, 4 * int(rows[left, TIME].max()))
    return rows


def _columns_of(which: str, rows: Floats, zone: Zone, sides: tuple[Side, Side], craft: Any) -> list[Any]:
    """Return the columns of a `DriftApproach`."""
    at = failures_at(which, rows, sides, craft)
    time, ratio = rows[:, TIME], rows[:, RATIO]
    distance = np.linalg.norm(rows[:, PLACE : PLACE + 3] @ _to_metres(zone), axis=1)
    distance[~np.isfinite(time)] = np.inf  # of a slow drift only the ratio is known
    at[np.isnan(time)] = np.nan
    return [at, time, ratio, distance, np.full(len(rows), which), rows[:, LOWER]]


@lru_cache(maxsize=64)
def _to_metres(zone: Zone) -> Floats:
    """Return the matrix that maps rows of zone coordinates to metres."""
    return np.asarray(np.linalg.inv(zone.matrix).T)


def failures_at(failing: str, rows: Floats, sides: tuple[Side, Side], craft: Any) -> Floats:
    """Return the times of the worst failures of pairs (M,), or (M, 2) where both spacecraft fail."""
    width = (rows.shape[1] - FAILURE - SIDE) // 2
    instants = [
        failed_at(sides[k], rows[:, FAILURE + SIDE + k * width :][:, :width], craft[k])
        for k in {"path": (0,), "other": (1,), "both": (0, 1)}[failing]
    ]
    return np.stack(instants, axis=1) if failing == "both" else instants[0]


def failed_at(side: Side, failures: Floats, craft: Any) -> Floats:
    """Return when one side fails in each of the failures (M, W), columns of a cell; nan if it does not."""
    kind, pieces = side.now[KIND], failures[:, PIECE].astype(np.int64)
    if kind == MISSED:
        instants = np.full(len(failures), np.nan)
        for k, one in enumerate(craft):
            first, last = side.burn_offsets[one], side.burn_offsets[one + 1]
            weak = np.flatnonzero(failures[k, LOW : LOW + 2 * (last - first) : 2] < 1.0)
            if len(weak):
                instants[k] = side.burns[first + weak[0], 0, START]
        return instants
    if kind == INTACT:
        return np.full(len(failures), np.nan)
    return np.where(pieces % 2 == 1, side.arcs[pieces // 2, START], failures[:, LOW])
