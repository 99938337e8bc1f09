"""Conflicts of k-sigma tubes: the intervals in which k sigmas reach the zone."""

from collections.abc import Sequence
from math import inf, nan, sqrt
from typing import Any

import numpy as np
from numba import float64, int64

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.conflicts.pair_search import all_rows, conflicts_from, pair_conflicts
from closeform.conflicts.quick_rejection import count_near, interval, mark_near
from closeform.conflicts.tracks import NO_TRACKS, Tracks, follow
from closeform.kernel_loans import borrowed, lent, stack_vector
from closeform.motion.certified_march import LESS_PATIENCE, locate
from closeform.uncertainty.covariance_propagation import ERRORS_TYPE, PropagatedErrors
from closeform.uncertainty.sigmas.ellipsoid_planes import gap_of_plane
from closeform.uncertainty.sigmas.levels import begin_pair, least_of_pair
from closeform.uncertainty.sigmas.moving_planes import (
    HALVINGS,
    STALLED,
    count_stalls,
    errors_of_point,
    first_try,
    moving_plane_time,
    reset_stalls,
    short_step,
    stays_inside,
)
from closeform.uncertainty.sigmas.rejection import widened
from closeform.uncertainty.sigmas.tube import (
    HINT,
    STALLS,
    TUBE,
    WIDTH,
    column_bound,
    evaluate_tube,
    gap_at_sigmas,
    load_tube,
    plane_time,
    position_inside,
    tube_for,
)
from closeform.zones.shapes import inside_step
from closeform.zones.zone import Zone

# As in `conflicts.pair_search`, with the accuracy of covariances and planes.
TOUCH = 1e-11
ENTRY_AIM, ENTERED, LEFT, EXIT_AIM = 1 + 0.08 * TOUCH, 1 + 0.16 * TOUCH, 1 + 0.4 * TOUCH, 1 + 0.5 * TOUCH


@kernel(inline=True)
def march_outside(tube, t, span, k, patience):
    """March outside until k sigmas reach the zone, or may do so: (time reached, True if so)."""
    for _ in range(patience):
        norm = evaluate_tube(tube, t)
        g = gap_at_sigmas(tube, k, ENTRY_AIM) if norm > ENTERED else norm
        if not g > ENTERED:
            return t, True
        if not t < span:
            return t, False
        h = plane_time(tube, k, g - ENTRY_AIM)
        if t == 0.0 and patience == LESS_PATIENCE:
            h = max(h, moving_plane_time(tube, k, ENTRY_AIM, span))
            if count_stalls(tube, h, span) > 0.0:
                return t, True
        t = min(span, max(t + h, t * (1.0 + 2.3e-16)))
    return t, False


@kernel(inline=True)
def moving_errors_time(tube, k, longest):
    """Return the time from the window's start for which moving errors provably keep a position inside."""
    xi, eta = stack_vector(14), stack_vector(14)
    used, _ = position_inside(tube, evaluate_tube(tube, 0.0), k)
    errors_of_point(tube, used, xi)
    h = first_try(tube, longest)
    for _ in range(HALVINGS):
        used, g = position_inside(tube, evaluate_tube(tube, h), k)
        if g < EXIT_AIM:
            errors_of_point(tube, used, eta)
            if stays_inside(tube, xi, eta, h, EXIT_AIM):
                tube.state[HINT] = h
                return h
        h *= 0.5
    return 0.0


@kernel()
def inside_time(tube, used, span):
    """Return the time for which the errors found last provably keep a position inside."""
    place, best, at, bounds = tube.place, tube.best, tube.at, tube.bounds
    x, y, z, vx, vy, vz = place[0], place[1], place[2], place[3], place[4], place[5]
    if used > 0.0 and tube.along[0] > 0.0:
        share = used / sqrt(tube.along[0])
        _, x, y, z = gap_of_plane(place, tube.square, used, best[0], best[1], best[2])
        for j in range(0, int(tube.state[WIDTH]), 3):
            length = best[0] * at[0, j] + best[1] * at[0, j + 1] + best[2] * at[0, j + 2]
            vx -= share * length * at[1, j]
            vy -= share * length * at[1, j + 1]
            vz -= share * length * at[1, j + 2]
    ax = bounds[0] + used * column_bound(tube, 1.0, 0.0, 0.0)
    ay = bounds[1] + used * column_bound(tube, 0.0, 1.0, 0.0)
    az = bounds[2] + used * column_bound(tube, 0.0, 0.0, 1.0)
    a = sqrt(ax * ax + ay * ay + az * az)
    speed = sqrt(vx * vx + vy * vy + vz * vz) + a * span
    return inside_step(tube.shape, tube.faces, x, y, z, vx, vy, vz, ax, ay, az, a, speed, EXIT_AIM)


@kernel(inline=True)
def is_doubtful(tube, k, span):
    """Return True if k sigmas are outside but not certain to stay there for a while."""
    return not plane_time(tube, k, gap_at_sigmas(tube, k, inf) - ENTRY_AIM) > short_step(tube, span)


@kernel(inline=True)
def march_inside(tube, t, span, k, patience):
    """March while some position of the tube is inside; return the time reached, and True if none is.

    After too many short steps, k sigmas count as inside until they are clear for longer than such a step.
    """
    for _ in range(patience):
        used, g = position_inside(tube, evaluate_tube(tube, t), k)
        doubtful = tube.state[STALLS] >= STALLED
        if g > LEFT and not (doubtful and is_doubtful(tube, k, span)):
            return t, True
        if not t < span:
            return t, False
        h = inside_time(tube, used, span - t) if not g > LEFT else 0.0
        if t == 0.0 and patience == LESS_PATIENCE:
            h = max(h, moving_errors_time(tube, k, span))
            count_stalls(tube, h, span)
        if doubtful:
            h = max(h, short_step(tube, span))
        t = min(span, max(t + h, t * (1.0 + 2.3e-16)))
    return t, False


@kernel()
def load_pair(scene, i, j, t, span):
    """Load arcs i and j of a pair from time t on, for at most `span`; return `span`."""
    tube, one, first, two, second, _ = scene
    load_tube(tube, one, i, first, two, j, second, t, span)
    return span


@kernel()
def cross_sigmas(scene, _, t, span, inside, patience):
    """March until k sigmas begin or cease to reach the zone; return the time reached and True if they do."""
    tube, k = scene[0], scene[5]
    return march_inside(tube, t, span, k, patience) if inside else march_outside(tube, t, span, k, patience)


@kernel()
def meet_tubes(scene, one, two):
    """Return False for a pair that is never close, and the arcs and times at which the search begins."""
    tube, first, second, _, times, tracks, other_tracks, near = scene
    start, end = begin_pair(tube, first, one, second, two)
    m = 0
    if not start <= end:
        return False, (one, two, start, end, m)
    if len(near) > 0:
        m, last = interval(times, start), interval(times, end) + 1
        if count_near(tracks, one, other_tracks, two, m, last) == 0:
            return False, (one, two, start, end, m)
        mark_near(tracks, one, other_tracks, two, m, last, near)
    reset_stalls(tube)
    return True, (one, two, start, end, m)


@kernel()
def search_tubes(scene, begin, pair, rows, count):
    """Append the conflicts of a pair; return the new count."""
    tube, first, second, k, times, _, _, near = scene
    one, two, start, end, m = begin
    i_end, j_end = first.offsets[one + 1], second.offsets[two + 1]
    i = locate(first.arcs, first.offsets[one], i_end, start)
    j = locate(second.arcs, second.offsets[two], j_end, start)
    search = first.arcs, i, i_end, second.arcs, j, j_end, start, end, times, near, m, pair, rows, count
    return pair_conflicts(load_pair, cross_sigmas, (tube, first, one, second, two, k), *search)


@kernel()
def nearest_tubes(scene, begin, row):
    """Write the time of the minimum level in a conflict, and the level."""
    tube, first, second, k, _, _, _, _ = scene
    one, two, _, _, _ = begin
    row[4], row[3] = least_of_pair(tube, first, one, second, two, row[1], row[2], k, inf, nan)


@kernel(
    int64(
        *(ERRORS_TYPE, ERRORS_TYPE, int64[::1], int64[::1], int64, TUBE, float64),
        *(float64[::1], float64[:, :, ::1], float64[:, :, ::1], float64[:, ::1], int64[::1]),
    )
)
def sigma_conflicts_of_pairs(one, two, first, second, pair, tube, k, times, tracks, other_tracks, rows, done):
    """Write the conflicts of pairs from `pair` onward: pair, start, end, time and level of the minimum."""
    one, two, tube = lent(one), lent(two), lent(tube)
    times, tracks, other_tracks = borrowed(times), borrowed(tracks), borrowed(other_tracks)
    near = np.empty(max(0, len(times) - 1), dtype=np.bool_)
    scene = tube, one, two, k, times, tracks, other_tracks, borrowed(near)
    count = conflicts_from(meet_tubes, search_tubes, nearest_tubes, scene, first, second, pair, rows, done)
    near[:] = False  # a counted use: the loan ends here
    return count


def sigma_conflicts(
    one: PropagatedErrors,
    two: PropagatedErrors,
    first: Any,
    second: Any,
    zone: Zone,
    mean_motion: float,
    sigmas: float,
    tracks: Tracks = NO_TRACKS,
) -> Floats:
    """Return the conflicts of pairs `first` and `second` (P,) of two batches, as sorted rows.

    Columns: pair, start, end, time of the minimum, ratio.
    """
    tube = tube_for(zone, mean_motion)
    return all_rows(
        lambda pair, rows, done: sigma_conflicts_of_pairs(
            one, two, first, second, pair, tube, sigmas, *tracks, rows, done
        ),
        len(first),
        min(4096, 16 + len(first)),
    )


def search_of(errors: PropagatedErrors, zones: Sequence[Zone], mean_motion: float, sigmas: float) -> Any:
    """Return a function that finds the conflicts of the given pairs of a batch with a zone.

    `zones`: the zones that most pairs have.
    """
    bodies = errors.arcs, errors.offsets
    followed = follow(*bodies, *bodies, zones, (len(errors.offsets) - 1) ** 2 // 2)
    tracks = {zone: widened(followed[zone], errors, zone, mean_motion, sigmas) for zone in zones}

    def search(zone: Zone, first: Any, second: Any) -> tuple[Any, Floats]:
        near = tracks.get(zone, NO_TRACKS)
        rows = sigma_conflicts(errors, errors, first, second, zone, mean_motion, sigmas, near)
        index = rows[:, 0].astype(np.int64)
        return np.stack([first[index], second[index]], axis=1), rows[:, 1:]

    return search
