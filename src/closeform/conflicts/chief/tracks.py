"""Tracks about a chief: bounds on the positions of a batch at common angles (see `quick_rejection`)."""

from collections.abc import Sequence
from math import pi, sqrt
from typing import Any

import numpy as np
from numba import float64, int64, void

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.conflicts.quick_rejection import OFF_CHORD
from closeform.conflicts.tracks import LARGEST, NO_TRACKS, PAYS, Tracks
from closeform.kernel_loans import borrowed, stack_matrix, stack_vector
from closeform.motion.chief.bernstein import TERMS
from closeform.motion.chief.positions import keep, polynomial, slack
from closeform.motion.chief.segments import (
    COLUMN,
    FIRST,
    LAST,
    ON_JOINT,
    ORIGIN,
    TABLE,
    WINDOW,
    columns_in,
    share,
)
from closeform.motion.chief.table import COLUMNS, Table
from closeform.zones.zone import Zone, enclosing

PER_TURN = 48  # chords of a revolution: with half as many twice the pairs are searched


@kernel()
def many_off(joints, rows, errors, segs, q, last, low, high, matrix, chord, p, c, left):
    """Return the largest distance from their chord of all segments from q on that begin before `high`.

    The chord's end, which is that of the last of them, is filled in.
    """
    end, most, off = q + 1, 0.0, np.empty(3)
    while end < last and segs[end, FIRST] < high - ON_JOINT:
        end += 1
    for m in range(end - 1, q - 1, -1):
        row = segs[m]
        window = int(row[WINDOW])
        polynomial(rows, window, row[COLUMN:], COLUMNS, matrix, p, c)
        slack(errors, window, row[COLUMN:], COLUMNS, matrix, c, off)
        first, final = share(joints, window, row[ORIGIN], low), share(joints, window, row[ORIGIN], high)
        keep(c, first, final, left)
        for axis in range(3 if m == end - 1 else 0):
            chord[axis, 1] = c[axis, TERMS - 1]
        for b in range(TERMS):
            part = b / (TERMS - 1.0)
            square = 0.0
            for axis in range(3):
                square += (c[axis, b] - (1.0 - part) * chord[axis, 0] - part * chord[axis, 1]) ** 2
            most = max(most, sqrt(square) + off[0] + off[1] + off[2])
    return most


@kernel(
    void(
        TABLE,
        float64[:, ::1],
        float64[:, :, :, ::1],
        float64[:, ::1],
        int64[::1],
        float64[:, ::1],
        float64[::1],
        float64[:, :, ::1],
    )
)
def fill_tracks(table, errors, apart, segs, firsts, matrix, angles, tracks):
    """Fill the tracks (N, 4, K + 1) of all spacecraft at `angles`; entries outside of a path stay unchanged.

    A track has the position at each angle in coordinates of a ball, and the largest deviation from the
    chord to the next one: the hull of the polynomial less its chord.  `apart` has the
    rows of that difference for equal pieces of each window (see `Table.apart`).
    """
    joints, rows, errors, apart = borrowed(table[1]), borrowed(table[3]), borrowed(errors), borrowed(apart)
    segs, matrix, angles, tracks = borrowed(segs), borrowed(matrix), borrowed(angles), borrowed(tracks)
    p, c, off, chord, left = (
        stack_matrix(3, TERMS),
        stack_matrix(3, TERMS),
        stack_vector(3),
        stack_matrix(3, 2),
        stack_vector(TERMS),
    )
    pieces = len(apart) // (len(joints) - 1)
    for craft in range(len(firsts) - 1):
        track, q, last = tracks[craft], firsts[craft], firsts[craft + 1]
        count, known, before = 0, -1, -1
        for k in range(len(angles) - 1):
            low, high = angles[k], angles[k + 1]
            while q + 1 < last and segs[q, LAST] <= low + ON_JOINT:
                q += 1
            if segs[q, FIRST] >= high or segs[last - 1, LAST] < low:
                continue
            row = segs[q]
            window = int(row[WINDOW])
            if known != q:
                count, known = columns_in(row), q
                polynomial(rows, window, row[COLUMN:], count, matrix, p, c)
                slack(errors, window, row[COLUMN:], count, matrix, c, off)
            piece = window * pieces + int(pieces * share(joints, window, row[ORIGIN], 0.5 * (low + high)))
            polynomial(apart, min(piece, len(apart) - 1), row[COLUMN:], count, matrix, p, c)
            most = 0.0
            for b in range(1, TERMS - 1):
                most = max(most, c[0, b] * c[0, b] + c[1, b] * c[1, b] + c[2, b] * c[2, b])
            reach = sqrt(most) + off[0] + off[1] + off[2]
            for axis in range(3):
                chord[axis, 0], chord[axis, 1] = c[axis, 0], c[axis, TERMS - 1]
            if q + 1 < last and segs[q + 1, FIRST] < high - ON_JOINT:
                reach = many_off(joints, rows, errors, segs, q, last, low, high, matrix, chord, p, c, left)
            for axis in range(3):
                if before == k:  # a jump of position that `join` accepts
                    track[OFF_CHORD, k - 1] += abs(track[axis, k] - chord[axis, 0])
                track[axis, k], track[axis, k + 1] = chord[axis, 0], chord[axis, 1]
            track[OFF_CHORD, k], before = reach, k + 1


def follow_segments(
    table: Table, segments: Floats, firsts: Any, zones: Sequence[Zone], pairs: int
) -> dict[Zone, Tracks]:
    """Return the tracks of a batch for each of the zones, as `tracks.follow`, with angles for times."""
    craft = len(firsts) - 1
    if not 0 < PAYS * craft * len(zones) <= pairs:
        return dict.fromkeys(zones, NO_TRACKS)
    windows = (len(table.joints) - 1) * 2.0 * pi / (table.joints[-1] - table.joints[0])
    pieces = max(2, round(PER_TURN / windows))
    angles = table.angles(segments[:, FIRST].min(), segments[:, LAST].max(), pieces)
    if not 4 * craft * len(zones) * len(angles) <= LARGEST:
        return dict.fromkeys(zones, NO_TRACKS)
    tracks = {}
    for zone in zones:
        own = np.zeros((craft, 4, len(angles)))
        bodies = table.form, table.errors, table.apart(pieces), segments, firsts
        fill_tracks(*bodies, enclosing(zone), angles, own)
        tracks[zone] = Tracks(angles, own, own)
    return tracks
