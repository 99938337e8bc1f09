"""Optimal thrust that brings arcs to their final states, and thrust that is constant in inertial space."""

import numpy as np
from numba import float64, void

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.kernel_loans import stack_matrix, stack_vector
from closeform.motion.arc import END, PUSH, START, THRUST
from closeform.motion.hill import coast, response
from closeform.motion.linear import solve


@kernel(void(float64, float64[:, ::1], float64[:, ::1]))
def steer(n: float, arcs: Floats, finals: Floats) -> None:
    """Set the optimal thrust of each arc so that it ends in its final state, theory (7, 8)."""
    matrix = stack_matrix(6, 6)
    work = stack_matrix(6, 6)
    rhs = stack_vector(6)
    for p in range(len(arcs)):
        arc = arcs[p]
        t = arc[END] - arc[START]
        response(n, t, matrix)
        gap = stack_vector(6)
        reached = coast(n, t, arc[6], arc[7], arc[8], arc[9], arc[10], arc[11])
        for i in range(6):
            gap[i] = finals[p, i] - reached[i]
        for _ in range(2):  # one iteration of refinement
            for i in range(6):
                rhs[i] = gap[i]
                for j in range(6):
                    rhs[i] -= matrix[i, j] * arc[THRUST + j]
                    work[i, j] = matrix[i, j]
            solve(work, rhs, 6)
            for i in range(6):
                arc[THRUST + i] += rhs[i]


def transition_matrices(n: float, times: Floats) -> Floats:
    """Return the transition matrices of natural motion (..., 6, 6) over times (...) [s]."""
    out = np.empty((times.size, 6, 6))
    transitions(n, np.ascontiguousarray(times).ravel(), out)
    return out.reshape((*times.shape, 6, 6))


@kernel(void(float64, float64[::1], float64[:, :, ::1]))
def transitions(n: float, times: Floats, out: Floats) -> None:
    for p in range(len(times)):
        for k in range(6):
            column = coast(
                n,
                times[p],
                1.0 * (k == 0),
                1.0 * (k == 1),
                1.0 * (k == 2),
                1.0 * (k == 3),
                1.0 * (k == 4),
                1.0 * (k == 5),
            )
            for i in range(6):
                out[p, i, k] = column[i]


def fix_inertially(n: float, arcs: Floats) -> None:
    """Rotate constant inertial thrusts of arcs (..., 30) into the rotating frame, with their derivatives."""
    angle = n * arcs[..., START]
    c, s = np.cos(angle), np.sin(angle)
    x, y = arcs[..., PUSH].copy(), arcs[..., PUSH + 1].copy()
    arcs[..., PUSH], arcs[..., PUSH + 1] = x * c + y * s, y * c - x * s
    for k in range(PUSH, PUSH + 9, 3):  # each derivative is a quarter turn against the orbit's rotation
        arcs[..., k + 3], arcs[..., k + 4] = n * arcs[..., k + 1], -n * arcs[..., k]
