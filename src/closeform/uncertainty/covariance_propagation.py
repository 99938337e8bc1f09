"""Covariance of a craft's state along its path, as square roots at the starts of its arcs.

Only the current covariance matters, however many errors contributed. Completed errors (of the state,
impulses, finished burns and noise) are six columns that move naturally. Errors of a burn in progress are up
to four further columns, which its thrust continues to drive:

    P = R R^T + sum x_j x_j^T                                                        # theory (51)

Columns keep the digits of directions that are known much better than others, which a covariance would lose.
Householder reflections, which keep the digits of every row, reduce many columns to six.
"""

from collections.abc import Sequence
from math import copysign, inf, sqrt
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numba import float64, int64, types, void

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.kernel_loans import borrowed, stack_matrix, stack_vector
from closeform.motion.arc import (
    END,
    IMPULSE,
    MEAN_MOTION,
    PUSH,
    START,
    STATE,
    THRUST,
    WIDTH,
    acceleration,
    state_at,
    thrusts,
)
from closeform.motion.certified_march import locate
from closeform.motion.chief_orbit import ChiefOrbit
from closeform.motion.hill import coast, response
from closeform.motion.linear import triangle
from closeform.motion.path import Path

if TYPE_CHECKING:
    from closeform.uncertainty.errors import Uncertainty

ACTIVE = 36  # first column of the four states of burn errors in progress, after the root (6, 6)
BURN_ERRORS = 4  # errors of a burn: magnitude, and pointing about x, y and z
ROW = ACTIVE + 6 * BURN_ERRORS
MAGNITUDE, POINTING, GATES, NOISE = 0, 1, 2, 6  # columns of `Uncertainty.execution`


class PropagatedErrors(NamedTuple):
    """Paths with their errors: `rows` (M, 60), one for each arc at its start, and `execution` (N, 7)."""

    arcs: Floats
    offsets: Any
    rows: Floats
    execution: Floats


ROWS = float64[:, ::1]
ERRORS_TYPE = types.NamedTuple((ROWS, int64[::1], ROWS, ROWS), PropagatedErrors)


def propagate_errors(path: Path, errors: "Sequence[Uncertainty | None]") -> PropagatedErrors:
    """Propagate the uncertainties of a batch along its paths; None for an exact craft."""
    return propagate_to_ends(path, errors)[0]


def propagate_to_ends(path: Path, errors: "Sequence[Uncertainty | None]") -> tuple[PropagatedErrors, Floats]:
    """Propagate the uncertainties, also to roots (N, 6, 6) of the covariances at the ends of all paths."""
    count = len(path.offsets) - 1
    roots, execution = np.zeros((count, 6, 6)), np.zeros((count, 7))
    for each in {one for one in errors if one is not None}:
        each._check_for(path)
    for k, one in enumerate(errors):
        if one is not None:
            roots[k], execution[k] = one._root, one._execution
    rows = np.zeros((len(path.arcs), ROW))
    propagate(path.arcs, path.offsets, path.orbit.mean_motion, roots, execution, rows)
    return PropagatedErrors(path.arcs, path.offsets, rows, execution), roots


@kernel()
def compress(a, width):
    """Rotate the columns of `a` (6, `width`) into its first six: lower triangular, same covariance."""
    for i in range(6):
        square = 0.0
        for j in range(i, width):
            square += a[i, j] * a[i, j]
        if square == 0.0:
            continue
        head = -copysign(sqrt(square), a[i, i])
        share = 1.0 / (square - a[i, i] * head)
        first = a[i, i] - head
        for r in range(i + 1, 6):
            s = a[r, i] * first
            for j in range(i + 1, width):
                s += a[r, j] * a[i, j]
            s *= share
            a[r, i] -= s * first
            for j in range(i + 1, width):
                a[r, j] -= s * a[i, j]
        a[i, i] = head
        for j in range(i + 1, width):
            a[i, j] = 0.0


@kernel()
def coast_columns(n, t, a, first, last):
    """Propagate some columns of `a` by natural motion."""
    for j in range(first, last):
        moved = coast(n, t, a[0, j], a[1, j], a[2, j], a[3, j], a[4, j], a[5, j])
        for i in range(6):
            a[i, j] = moved[i]


@kernel()
def add_noise(n, t, density, a, width):
    """Add six columns for process noise of density W(t) on an exactly known state.

    theory (9). W = R P Phi^T: R is the response to thrusts and their rates at the start, P gives these from
    the costate there, and Phi^T propagates that back. Nothing cancels as n t -> 0.
    """
    answers, flow, noise = stack_matrix(6, 6), stack_matrix(6, 6), stack_matrix(6, 6)
    response(n, t, answers)
    for i in range(6):
        for j in range(6):
            flow[i, j] = 1.0 if i == j else 0.0
    coast_columns(n, t, flow, 0, 6)
    for j in range(6):
        ux, uy, uz = flow[j, 3], flow[j, 4], flow[j, 5]
        wx, wy, wz = 2.0 * n * uy - flow[j, 0], -2.0 * n * ux - flow[j, 1], -flow[j, 2]
        for i in range(6):
            total = answers[i, 0] * ux + answers[i, 1] * uy + answers[i, 2] * uz
            total += answers[i, 3] * wx + answers[i, 4] * wy + answers[i, 5] * wz
            noise[i, j] = density * total
    triangle(noise, 6)
    for i in range(6):
        for j in range(6):
            a[i, width + j] = noise[i, j] if j <= i and noise[j, j] < inf else 0.0


@kernel(void(float64, float64, ROWS))
def fill_noise_root(n, t, root):
    """Fill `root` (6, 6) with that of the covariance that process noise of density 1 adds over a time t."""
    add_noise(n, t, 1.0, root, 0)


@kernel()
def add_gates(arc, execution, a, width):
    """Add three columns for an impulse at the start of an arc, if there is one; return the new width."""
    jx, jy, jz = arc[IMPULSE], arc[IMPULSE + 1], arc[IMPULSE + 2]
    square = jx * jx + jy * jy + jz * jz
    if square == 0.0:
        return width
    g = GATES
    along = execution[g] * execution[g] + execution[g + 1] * execution[g + 1] * square
    across = execution[g + 2] * execution[g + 2] + execution[g + 3] * execution[g + 3] * square
    # across I + (along - across) e e^T has the root c I + (d - c) e e^T
    c, d = sqrt(across), sqrt(along)
    for j in range(3):
        for i in range(3):
            a[i, width + j] = 0.0
            a[3 + i, width + j] = (d - c) * arc[IMPULSE + i] * arc[IMPULSE + j] / square + (
                c if i == j else 0.0
            )
    return width + 3


@kernel()
def burn_error_arc(n, arc, row, execution, j, out):
    """Fill the arc of one error of a burn in progress: 0 its magnitude, 1 to 3 its pointing about x, y, z."""
    out[START], out[END], out[MEAN_MOTION] = arc[START], arc[END], n
    for k in range(3):
        out[IMPULSE + k] = 0.0
    for k in range(6):
        out[STATE + k] = row[ACTIVE + 6 * j + k]
    if j == 0:
        for k in range(THRUST, WIDTH):
            out[k] = execution[MAGNITUDE] * arc[k]
        return
    size = execution[POINTING]
    ux, uy, uz, wx, wy, wz = arc[12], arc[13], arc[14], arc[15], arc[16], arc[17]
    for k in range(THRUST, PUSH):
        out[k] = 0.0
    for k in range(PUSH, WIDTH, 3):  # an optimal thrust is a natural motion: on each axis in the span of PUSH
        x, y, z = size * (ux + arc[k]), size * (uy + arc[k + 1]), size * (uz + arc[k + 2])
        out[k] = 0.0 if j == 1 else (z if j == 2 else -y)
        out[k + 1] = 0.0 if j == 2 else (x if j == 3 else -z)
        out[k + 2] = 0.0 if j == 3 else (y if j == 1 else -x)
        ax, ay, az = acceleration(n, ux, uz, wx, wy)
        ux, uy, uz, wx, wy, wz = wx, wy, wz, ax, ay, az


@kernel()
def burn_errors(arc, execution):
    """Return the number of burn errors in progress along an arc."""
    return BURN_ERRORS if (execution[MAGNITUDE] > 0.0 or execution[POINTING] > 0.0) and thrusts(arc) else 0


@kernel()
def add_burn_errors(n, arc, row, execution, t, a, width):
    """Add columns for the errors of a burn in progress, with their states at time t; return the new width."""
    out = stack_vector(30)
    for j in range(burn_errors(arc, execution)):
        burn_error_arc(n, arc, row, execution, j, out)
        moved = state_at(out, t)
        for i in range(6):
            a[i, width] = moved[i]
        width += 1
    return width


@kernel()
def is_exact(row, execution):
    """Return True if no completed error and no noise moves a craft by the start of an arc."""
    most = execution[NOISE]
    for i in range(36):
        most = max(most, abs(row[i]))
    return most == 0.0


@kernel()
def add_settled(n, arc, row, execution, t, a, width):
    """Add columns for completed errors, propagated to time t within the arc, and noise; return the width."""
    for i in range(6):
        for j in range(6):
            a[i, width + j] = row[6 * i + j]
    h = t - arc[START]
    if h > 0.0:
        coast_columns(n, h, a, width, width + 6)
    width += 6
    if h > 0.0 and execution[NOISE] > 0.0:
        add_noise(n, h, execution[NOISE], a, width)
        width += 6
    return width


@kernel(void(ROWS, int64[::1], float64, float64[:, :, ::1], ROWS, ROWS))
def propagate(arcs, offsets, n, roots, execution, rows):
    """Fill the rows of all paths from `roots` (N, 6, 6) at their starts; replace these by the final ones."""
    arcs, rows, execution = borrowed(arcs), borrowed(rows), borrowed(execution)
    a = stack_matrix(6, 16)
    for p in range(len(offsets) - 1):
        for i in range(6):
            for j in range(6):
                a[i, j] = roots[p, i, j]
        for m in range(offsets[p], offsets[p + 1]):
            arc, row = arcs[m], rows[m]
            width = add_gates(arc, execution[p], a, 6)
            if width > 6:
                compress(a, width)
            for i in range(6):
                for j in range(6):
                    row[6 * i + j] = a[i, j]
            width = add_settled(n, arc, row, execution[p], arc[END], a, 0)
            before = width
            width = add_burn_errors(n, arc, row, execution[p], arc[END], a, width)
            if m + 1 < offsets[p + 1] and thrusts(arcs[m + 1]):  # the burn goes on
                for j in range(width - before):
                    for i in range(6):
                        rows[m + 1, ACTIVE + 6 * j + i] = a[i, before + j]
                width = before
            if width > 6:
                compress(a, width)
        for i in range(6):
            for j in range(6):
                roots[p, i, j] = a[i, j]


@kernel(void(ROWS, float64, ROWS, ROWS, float64[::1], float64[:, :, ::1]))
def covariances(arcs, n, rows, execution, times, out):
    """Write the covariances (T, 6, 6) of one craft at times on its path."""
    a = stack_matrix(6, 16)
    for k in range(len(times)):
        m = locate(arcs, 0, len(arcs), times[k])
        t = min(max(times[k], arcs[m, START]), arcs[m, END])
        width = add_settled(n, arcs[m], rows[m], execution[0], t, a, 0)
        width = add_burn_errors(n, arcs[m], rows[m], execution[0], t, a, width)
        for i in range(6):
            for j in range(6):
                out[k, i, j] = 0.0
                for c in range(width):
                    out[k, i, j] += a[i, c] * a[j, c]


def uncertainty_at_end(errors: "Uncertainty", path: Path) -> "Uncertainty":
    """Return the uncertainty at the end of a path, with all errors so far in the state covariance.

    Burns, impulses and noise on the path have added their errors; the execution errors ahead are unchanged.
    Roots are propagated, so that directions keep their digits.  # theory (51)
    """
    if isinstance(path.orbit, ChiefOrbit):
        (root,) = errors._roots(path, np.array([path.end]))
        return errors._with_root(np.asarray(np.linalg.qr(root.T, mode="r")).T)
    _, roots = propagate_to_ends(path, [errors])
    return errors._with_root(roots[0])
