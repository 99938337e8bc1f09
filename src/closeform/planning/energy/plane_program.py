"""Convex program of the planes for failed craft: minimum energy."""

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


@kernel(float64(SCENE, CONTACTS, float64, float64, float64, float64))
def press(scene, contacts, lift, give, stride, most):
    """Fill the multipliers that keep failed craft beyond all planes at `lift` aims; return the energy.

    The initial active set are the contacts with positive multipliers.  Each plane gives way by `give` of its
    own compliance.  If a displacement exceeds `stride` zones, all are reduced.
    Returns inf for incompatible planes, or where one moves a craft by more than `most` zones.
                                                                                         # theory (72)
    """
    count = len(contacts.times)
    factors, motion = np.empty((count, 2, 4, 3, 6)), stack_matrix(3, 3)
    gram, work, gaps = np.empty((count, count)), np.empty((count, count)), np.empty(count)
    fill_factors(scene, contacts, count, factors)
    fill_gram(scene, contacts, count, factors, gram)
    for k in range(count):
        which, t = contacts.which[k], contacts.times[k]
        motion_after(scene, scene.direct, scene.direct_offsets, which, t, contacts.drifts[k], motion)
        gaps[k] = lift * scene.aims[scene.kinds[which]]
        for i in range(3):
            gaps[k] -= contacts.normals[k, i] * motion[0, i]
    solve_qp(gram, gaps, count, contacts.multipliers > 0.0, give, work, contacts.multipliers)
    energy, farthest = 0.0, 0.0
    for k in range(count):
        push, moved = contacts.multipliers[k], 0.0
        if not push * gram[k, k] < ALONE * max(1.0, most / TOGETHER):
            return inf
        for m in range(count):
            moved += gram[k, m] * contacts.multipliers[m]
        energy += 0.5 * push * moved
        farthest = max(farthest, abs(moved))
    if farthest > most:
        return inf
    if farthest > stride:
        energy *= (stride / farthest) ** 2
        for k in range(count):
            contacts.multipliers[k] *= stride / farthest
    return energy
