"""Convex program of planes: the minimum energy of paths that stay beyond all of them."""

from math import inf

import numpy as np
from numba import float64

from closeform._jit import kernel
from closeform.kernel_loans import stack_matrix
from closeform.planning.energy.quadratic_program import solve_qp
from closeform.planning.problem.deflection import fill_factors, fill_gram
from closeform.planning.problem.relative_motion import motion_after
from closeform.planning.problem.scene import CONTACTS, SCENE

ALONE, TOGETHER = 1e5, 30.0  # maximum displacement in zones by one plane, and by all


@kernel()
def fill_gaps(scene, contacts, count, gaps):
    """Fill the shortfalls of the unconstrained paths below the aim along the contacts' normals."""
    motion = stack_matrix(3, 3)
    for k in range(count):
        which, t = contacts.which[k], contacts.times[k]
        motion_after(scene, scene.direct, scene.direct_offsets, which, t, contacts.drifts[k], motion)
        gaps[k] = scene.aims[scene.kinds[which]]
        for i in range(3):
            gaps[k] -= contacts.normals[k, i] * motion[0, i]


@kernel()
def solve_planes(scene, contacts, count, gram, gaps, lift, give, most, work):
    """Fill the multipliers that keep the paths beyond planes at `lift` aims; return their energy.

    The initial active set are the contacts with positive multipliers.  Each plane gives way by `give` of its
    own compliance.  Returns inf for incompatible planes: one moves a pair by more than `most` zones.
    """
    active, target = np.empty(count, dtype=np.bool_), np.empty(count)
    for k in range(count):
        active[k] = contacts.multipliers[k] > 0.0
        target[k] = gaps[k] + (lift - 1.0) * scene.aims[scene.kinds[contacts.which[k]]]
    solve_qp(gram, target, count, active, give, work, contacts.multipliers)
    energy = 0.0
    for k in range(count):
        push = contacts.multipliers[k]
        if not push * gram[k, k] < most:
            return inf
        for m in range(count):
            energy += 0.5 * push * gram[k, m] * contacts.multipliers[m]
    return energy if energy >= 0.0 else inf


@kernel(float64(SCENE, CONTACTS, float64, float64, float64, float64))
def press(scene, contacts, lift, give, stride, most):
    """Fill the multipliers that keep craft, also after a loss of thrust, beyond planes; return the energy.

    See `solve_planes`.  If a displacement exceeds `stride` zones, all are reduced.  Returns inf also where
    all planes together move a pair by more than `most` zones.                               # theory (72)
    """
    count = len(contacts.times)
    factors, gaps = np.empty((count, 2, 2, 3, 6)), np.empty(count)
    gram, work = np.empty((count, count)), np.empty((count, count))
    fill_factors(scene, contacts, count, factors)
    fill_gram(scene, contacts, count, factors, gram)
    fill_gaps(scene, contacts, count, gaps)
    alone = ALONE * max(1.0, most / TOGETHER)
    energy = solve_planes(scene, contacts, count, gram, gaps, lift, give, alone, work)
    farthest = 0.0
    for k in range(count):
        moved = 0.0
        for m in range(count):
            moved += gram[k, m] * contacts.multipliers[m]
        farthest = max(farthest, abs(moved))
    if farthest > most:
        return inf
    if energy < inf and farthest > stride:
        energy *= (stride / farthest) ** 2
        for k in range(count):
            contacts.multipliers[k] *= stride / farthest
    return energy
