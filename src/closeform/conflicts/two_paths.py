"""Conflicts and closest approaches of two paths, certified between any two instants."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

from closeform.arrays import Floats, broadcast, instance, shown, size
from closeform.conflicts.pair_rows import approaches_of, conflicts_of
from closeform.conflicts.zero_crossings import zero_crossings
from closeform.motion.arc import MEAN_MOTION, START, STATE
from closeform.motion.path import Path
from closeform.result import Result, Rows
from closeform.zones.combined_zones import Body, CovarianceZone
from closeform.zones.pair_zones import PairZones
from closeform.zones.zone import Zone

if TYPE_CHECKING:
    from closeform.uncertainty.errors import Uncertainty

EQUAL = 6  # digits of ratios after the point: symmetric spacecraft have equal ratios up to rounding


@dataclass(frozen=True, repr=False)
class Conflict(Result):
    """Interval in which a spacecraft is inside a zone.

    Attributes
    ----------
    start, end : float [s]
        Start and end of the conflict, or the edge of the common time.
    time : float [s]
        Time of the minimum norm.
    ratio : float, no unit
        Clearance ratio: the minimum norm, below 1, and 0 where the two centres meet.
    """

    start: float
    end: float
    time: float
    ratio: float


@dataclass(frozen=True, repr=False)
class PairConflict(Conflict):
    """A conflict with the two spacecraft in it.

    Attributes
    ----------
    start, end : float [s]
        Start and end of the conflict, or the edge of the common time.
    time : float [s]
        Time of the minimum norm.
    ratio : float, no unit
        Clearance ratio: the minimum norm, below 1, and 0 where the two centres meet.
    first, second : int or str
        The two spacecraft: indices, or in a mission names.
    """

    first: Any
    second: Any


@dataclass(frozen=True, eq=False, repr=False)
class Approach(Rows):
    """Closest approach of two paths, or of the pairs of two batches.

    Attributes
    ----------
    time : float or array of shape (...) [s]
        Time of the minimum norm; nan without a common time.  Arrays have the paths' broadcast shape.
    ratio : float or array of shape (...), no unit
        Clearance ratio: the minimum norm; inf without a common time.
    distance : float or array of shape (...) [m]
        Distance of the centres at that time, not necessarily the minimum; inf without a common time.
    """

    _columns: ClassVar = {
        "time": "time_s",
        "ratio": "ratio",
        "distance": "distance_m",
    }

    time: Any
    ratio: Any
    distance: Any


def nearest_first(ratio: float, time: float) -> tuple[float, float]:
    """Return the sort key of approaches: by clearance ratio, and equal ones by time."""
    return round(ratio, EQUAL), time


def check_comparable(path: Path, other: Path, zone: Zone) -> None:
    """Raise ValueError for two paths in different orbits, or a zone that is not that of a pair."""
    for name, one in (("path", path), ("other", other)):
        instance(name, one, Path)
    if isinstance(zone, PairZones | CovarianceZone | Body):
        raise ValueError(
            "zone: expected the zone of the pair; from own zones use PairZones.of([one, other]).between(0, 1)"
        )
    instance("zone", zone, Zone)
    if path.orbit != other.orbit:
        raise ValueError(f"other: must be in the orbit of path, {path.orbit}, got {other.orbit}")


def find_conflicts(
    path: Path,
    other: Path,
    zone: Zone,
    errors: Uncertainty | None = None,
    other_errors: Uncertainty | None = None,
    sigmas: float = 3.0,
    method: Literal["exact", "sauter-palmer"] = "exact",
    extend: bool = False,
) -> tuple[Conflict, ...]:
    """Return every conflict of one spacecraft with the zone around another, in order of time.

    Only the common time of the two paths is searched: a spacecraft may be anywhere before its path starts and
    after it ends.  With `extend`, the one that ends first coasts until the other ends.

    Parameters
    ----------
    path : Path
        Path of one spacecraft.
    other : Path
        Path of the spacecraft that the zone is around, in the same orbit.
    zone : Zone
        Zone of the pair.
    errors : Uncertainty, optional
        Errors of `path`, or without `other_errors` of its position relative to `other`. A conflict is
        then an interval in which errors within `sigmas` standard deviations can bring them together.
    other_errors : Uncertainty, optional
        Errors of `other`, independent of `errors`.
    sigmas : float, no unit, default 3
        Number of standard deviations, if there are errors.
    method : "exact" or "sauter-palmer", default "exact"
        "exact": the certified search, which misses no conflict.
        "sauter-palmer": the paper's zero crossings, to compare with. They miss conflicts that begin and end
        between two of their starts, which are half a period apart, and are not certified; see Notes.
    extend : bool, default False
        True to search until the later end of the two, for different times of flight: see `Path.extended`.

    Returns
    -------
    tuple of Conflict
        Conflicts; empty without a common time. A conflict at the edge of the common time starts or
        ends there.

    Raises
    ------
    ValueError
        If a path is a batch (use `screen`), the orbits differ, an argument is of another type, or `sigmas` is
        negative or not finite; with "sauter-palmer" also if there are errors, the orbit is deep space or
        not circular, the zone is not a box or an ellipsoid, or a path has other thrust than that of
        minimum energy, or samples.

    Notes
    -----
    Certified, with method "exact": between two conflicts the norm of the relative position is above 1.  This
    holds without a time step, for conflicts of any duration, up to rounding: of positions, about 1e-15 of the
    largest relative coordinate; of time, one unit in its last place.  A norm of up to 1 + 8e-14 is
    a conflict, one above 1 + 4e-13 is none.  At every start and end inside the common time
    |norm - 1| <= 1e-12 where rounding allows (coordinates of a few tens of zones, times whose
    last place is small against zone / speed), so times are accurate to 1e-6 s wherever the norm
    changes faster than 1e-6 per second.  The clearance ratio is accurate to 1e-9.

    With errors the zone is the Minkowski sum of itself and the ellipsoid of `sigmas` standard deviations,
    which moves and grows with the covariance; the norm is that of the paths in this sum. Between conflicts,
    no errors within the ellipsoid cause a conflict; with cylinders, the end of a conflict may be too late by
    1e-5 of the sigmas.

    Method "sauter-palmer" finds when each coordinate enters and leaves the half-width of the zone, to 1e-9
    radians of n t, with one search between two extremes of natural motion, or two peaks with thrust. A
    drifting coordinate peaks near the extreme of its oscillation, and thrust can turn it twice in the quarter
    of a period in which peaks are sought. Events between them are not detected: a short conflict is missed,
    and a short interruption of a conflict is ignored; `ratio`, the minimum of samples, may then exceed 1.

    References
    ----------
    docs/theory.md section 3; SP11 (Sauter and Palmer 2011) section 3, eqs. 12-19.

    Examples
    --------
    >>> orbit = cf.Orbit.circular(500e3)
    >>> client = orbit.coast(np.zeros(6), 300.0)
    >>> visitor = orbit.transfer([0, 200, 0, 0, 0, 0], [0, -200, 0, 0, 0, 0], 300.0)
    >>> (stay,) = cf.find_conflicts(visitor, client, cf.Sphere(30.0))
    >>> round(stay.start, 1), round(stay.end, 1)
    (137.5, 162.5)
    """
    check_comparable(path, other, zone)
    if path.shape or other.shape:
        raise ValueError(
            f"path, other: require one spacecraft each, got shapes {path.shape} and {other.shape}; "
            "index them, or use screen"
        )
    sigmas = size("sigmas", sigmas)
    if instance("extend", extend, bool, np.bool_):
        path, other = (one.extended(max(path.end, other.end)) for one in (path, other))
    if not isinstance(method, str) or method not in ("exact", "sauter-palmer"):
        raise ValueError(f"method: must be 'exact' or 'sauter-palmer', got {shown(method)}")
    if method == "sauter-palmer":
        if errors is not None or other_errors is not None:
            raise ValueError("method: 'sauter-palmer' cannot be combined with errors; use 'exact'")
        return tuple(Conflict(*row) for row in zero_crossings(path, other, zone).tolist())
    if known := one_of([("errors", errors), ("other_errors", other_errors)]):
        stays: tuple[Conflict, ...] = known._find_conflicts(path, other, zone, errors, other_errors, sigmas)
        return stays
    one = np.zeros(1, dtype=np.int64)
    _, rows = conflicts_of(path, other, zone, one, one)
    return tuple(Conflict(*map(float, row)) for row in rows)


def one_of(errors: Sequence[tuple[str, Any]]) -> Any:
    """Return any of the given errors, by argument name; their methods search paths with errors."""
    given = [(name, one) for name, one in errors if one is not None]
    for name, one in given:
        if not hasattr(one, "_find_conflicts"):
            raise ValueError(f"{name}: expected Uncertainty, got {shown(one)}")
    return given[0][1] if given else None


def closest_approach(path: Path, other: Path, zone: Zone) -> Approach:
    """Return the minimum norm of one spacecraft's position relative to another, over their common time.

    `Path.extended` adds a coast to a path that ends too early.

    Parameters
    ----------
    path : Path
        Path of one spacecraft, or a batch.
    other : Path
        Path of the spacecraft that the zone is around, or a batch, in the same orbit; batch shapes broadcast.
    zone : Zone
        Zone that defines the norm.

    Returns
    -------
    Approach
        Floats for two spacecraft, arrays for batches.  The ratio is accurate to a relative 1e-9: no closer
        approach exists between any two instants.

    Raises
    ------
    ValueError
        If the orbits differ, batch shapes do not broadcast, or an argument is of another type.

    References
    ----------
    docs/theory.md section 3, minimum norm.

    Examples
    --------
    >>> orbit = cf.Orbit.circular(500e3)
    >>> client = orbit.coast(np.zeros(6), 300.0)
    >>> visitor = orbit.transfer([0, 200, 0, 0, 0, 0], [0, -200, 20, 0, 0, 0], 300.0)
    >>> nearest = cf.closest_approach(visitor, client, cf.Sphere(10.0))
    >>> round(nearest.ratio, 3), round(nearest.distance, 2)
    (1.939, 19.39)
    """
    check_comparable(path, other, zone)
    shape = broadcast(path=path.shape, other=other.shape)
    first = craft_of(path, shape)
    second = craft_of(other, shape)
    out = approaches_of(path, other, zone, first, second)
    time, ratio = out[:, 0].reshape(shape), out[:, 1].reshape(shape)
    distance = np.full(len(first), inf)
    met = np.isfinite(out[:, 0])
    gap = path._at(first[met], out[met, 0]) - other._at(second[met], out[met, 0])
    distance[met] = np.linalg.norm(gap[:, :3], axis=1)
    if not shape:
        return Approach(float(time), float(ratio), float(distance[0]))
    return Approach(time, ratio, distance.reshape(shape))


def craft_of(path: Path, shape: tuple[int, ...]) -> Any:
    """Return the index in a batch for each of the pairs of a broadcast shape, flattened."""
    craft = np.arange(len(path.offsets) - 1, dtype=np.int64)
    if path.shape == shape:
        return craft
    return np.broadcast_to(craft.reshape(path.shape), shape).flatten()  # numba requires a writable array


def each_pair(path: Path, other: Path, first: Any, second: Any) -> Iterator[tuple[Path, Path]]:
    """Yield the two paths of each pair, given by indices in two flattened batches."""
    for one, two in zip(first, second, strict=True):
        yield path._gathered(np.array([one]), ()), other._gathered(np.array([two]), ())


def every_pair(path: Path, other: Path) -> Iterator[tuple[Path, Path]]:
    """Yield the two paths of each pair of two batches, whose shapes broadcast."""
    shape = broadcast(path=path.shape, other=other.shape)
    return each_pair(path, other, craft_of(path, shape), craft_of(other, shape))


def _drifted(path: Path, craft: Any, time: Floats) -> Any:
    """Return states (M, 6) of coasting spacecraft at any times (M,), extrapolated beyond their paths."""
    rows = path.arcs[path.offsets[craft]]
    moved = path.orbit.transition(time - rows[:, START]) @ rows[:, STATE : STATE + 6, None]
    return moved[..., 0]


def last_possible_conflict(path: Path, other: Path, zone: Zone) -> Any:
    """Return the latest time at which one coasting spacecraft can be inside the zone around another.

    Parameters
    ----------
    path : Path
        Coasting path of one spacecraft or a batch.
    other : Path
        Coasting path of the spacecraft that the zone is around, or a batch; batch shapes broadcast.
    zone : Zone
        Zone of the pair.

    Returns
    -------
    float or array of shape (...) [s]
        Latest time, for coasts of any length: inf if the mean motions agree, so that no drift separates them;
        -inf if they are never close radially.

    Raises
    ------
    ValueError
        If the orbit is deep space, a path thrusts or has impulses, the orbits differ, batch shapes do
        not broadcast, or an argument is of another type.

    Notes
    -----
    Drift separates them permanently once 3 n |d| t exceeds |l| + 2E + the zone's along-track extent,
    with t from the later start.  They are never close if |2d| - E exceeds its radial extent.

    References
    ----------
    SP11 (Sauter and Palmer 2011) eq. 15; docs/theory.md (6).
    """
    check_comparable(path, other, zone)
    n = path.orbit.mean_motion
    if n == 0:
        raise ValueError("path: the bound requires an orbit; in deep space use closest_approach")
    if any(
        p.arcs[:, 3:6].any() or p.arcs[:, 12:].any() or (p.arcs[:, MEAN_MOTION] != n).any()
        for p in (path, other)
    ):
        raise ValueError("path, other: the bound requires coasting spacecraft without impulses")
    shape = broadcast(path=path.shape, other=other.shape)
    first, second = craft_of(path, shape), craft_of(other, shape)
    start = np.maximum(path.arcs[path.offsets[first], START], other.arcs[other.offsets[second], START])
    x, y, _, vx, vy, _ = (_drifted(path, first, start) - _drifted(other, second, start)).T
    e1, e2, d, along_track = 3 * x + 2 * vy / n, vx / n, 2 * x + vy / n, y - 2 * vx / n  # theory (2)
    swing = np.hypot(e1, e2)
    radial, transverse, _ = zone.extents
    with np.errstate(divide="ignore", over="ignore"):
        last = start + (np.abs(along_track) + 2 * swing + transverse) / (3 * n * np.abs(d))
    last = np.where(np.abs(2 * d) - swing > radial, -inf, last)
    return last.reshape(shape) if shape else float(last[0])
