"""Relative motion of two craft, with its error columns, as polynomials in common windows.

In each window of a chief's table the position of a path is a polynomial of the window's variable.  Windows
are cut here wherever a window of the table, an arc of a path or one of a column begins, so that in each of
them the mean and every column are Bernstein polynomials of one u from 0 to 1, and a trajectory is the mean
plus the columns times its errors.  In Hill's equations polynomials through twelve states have the same form.
"""

from __future__ import annotations

import numpy as np
from numba import float64, int64, void

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.kernel_loans import stack_matrix
from closeform.motion.chief.bernstein import DEGREE, TERMS, bernstein_of, chebyshev_of, nodes, value_at
from closeform.motion.chief.positions import keep, polynomial, slack
from closeform.motion.chief.segments import COLUMN, FIRST, LAST, ON_JOINT, ORIGIN, TABLE, WINDOW, share
from closeform.motion.chief.table import COLUMNS
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path
from closeform.zones.zone import Zone

SAME = 1e-12  # [rad]: edges closer than this are one
ANGLE = 1.0  # longest window of Hill's motion, in n t: the polynomials are off by 3e-16 of the oscillation
FIT = bernstein_of() @ chebyshev_of(DEGREE)  # from values at Chebyshev's nodes to coefficients


@kernel(
    void(
        *(TABLE, float64[:, ::1], float64[:, ::1], int64[::1], float64[::1], float64[:, ::1]),
        *(float64[:, :, :, ::1], float64[:, :, ::1]),
    )
)
def fill_polynomials(table, errors, segments, firsts, angles, matrix, out, off):
    """Fill coefficients (W, N, 12, 3) in zone coordinates of N paths in windows between `angles` (W + 1,).

    `off` (W, N, 3) receives bounds of their errors along the axes.
    """
    joints, rows = table[1], table[3]
    p, c = stack_matrix(3, TERMS), stack_matrix(3, TERMS)
    for path in range(len(firsts) - 1):
        q, last = firsts[path], firsts[path + 1]
        for w in range(len(angles) - 1):
            while q + 1 < last and segments[q, LAST] <= angles[w] + ON_JOINT:
                q += 1
            row = segments[q]
            k = int(row[WINDOW])
            polynomial(rows, k, row[COLUMN:], COLUMNS, matrix, p, c)
            slack(errors, k, row[COLUMN:], COLUMNS, matrix, c, off[w, path])
            low, high = (
                share(joints, k, row[ORIGIN], angles[w]),
                share(joints, k, row[ORIGIN], angles[w + 1]),
            )
            keep(c, low, high, p[0])
            for b in range(TERMS):
                for axis in range(3):
                    out[w, path, b, axis] = c[axis, b]


@kernel()
def polynomial_state(q, u):
    """Return the position and its rate by u from coefficients (12, 3)."""
    x, vx = value_at(q[:, 0], TERMS, u)
    y, vy = value_at(q[:, 1], TERMS, u)
    z, vz = value_at(q[:, 2], TERMS, u)
    return x, y, z, vx, vy, vz


def table_windows(path: Path, other: Path, columns: Path, zone: Zone) -> tuple[Floats, Floats, Floats]:
    """Return angles (W + 1,), coefficients (W, 1 + M, 12, 3), and bounds of their errors (W, 1 + M, 3).

    The angles are the edges of windows.  The first row is the position of `path` relative to `other`, the
    others are those of the columns (M,).
    """
    every = [path._segments, other._segments, columns._segments]
    begin = max(float(segments[0, FIRST]) for segments, _ in every[:2])
    end = min(float(segments[-1, LAST]) for segments, _ in every[:2])
    edges = np.unique(np.concatenate([[begin, end], *(segments[:, FIRST] for segments, _ in every)]))
    edges = edges[(begin <= edges) & (edges <= end)]
    angles = edges[np.append(np.diff(edges) > SAME, True)]
    angles[0] = begin
    table = path.orbit.chief.table  # type: ignore[attr-defined]
    found, wrong = [], []
    for segments, firsts in every:
        shape = len(angles) - 1, len(firsts) - 1
        found.append(np.empty((*shape, TERMS, 3)))
        wrong.append(np.empty((*shape, 3)))
        given = table.form, table.errors, segments, firsts, angles, zone.matrix
        fill_polynomials(*given, found[-1], wrong[-1])
    windows = np.concatenate([found[0] - found[1], found[2]], axis=1)
    return angles, windows, np.concatenate([wrong[0] + wrong[1], wrong[2]], axis=1)


def hill_windows(path: Path, other: Path, columns: Path, zone: Zone, edges: Floats) -> Floats:
    """Return coefficients (W, 1 + M, 12, 3) as `table_windows` does, between times (W + 1,) [s].

    No arc may begin within a window, and none may be longer than `ANGLE`.
    """
    times = (edges[:-1, None] + np.diff(edges)[:, None] * nodes(DEGREE)).reshape(1, -1)
    mean = path._evaluate_rows(times) - other._evaluate_rows(times)
    places = np.concatenate([mean, columns._evaluate_rows(times)])[..., :3] @ zone.matrix.T
    return np.ascontiguousarray(_fitted(places.reshape(len(places), -1, TERMS, 3)).swapaxes(0, 1))


def natural_windows(orbit: Orbit, zone: Zone, lengths: Floats) -> Floats:
    """Return coefficients (W, 6, 12, 3) of natural motions after each unit state, over lengths (W,) [s]."""
    flows = zone.matrix @ orbit.transition(lengths[:, None] * nodes(DEGREE))[..., :3, :]
    return _fitted(flows.transpose(0, 3, 1, 2))


def _fitted(values: Floats) -> Floats:
    """Return coefficients (..., 12, 3) from values at Chebyshev's nodes; those of a constant are exact."""
    first = values[..., :1, :]
    return np.asarray(first + FIT @ (values - first))
