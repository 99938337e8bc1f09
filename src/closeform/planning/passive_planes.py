"""The program of planes that failed craft are to keep: the least energy, and the paths that it shapes."""

from math import inf
from typing import Any

import numpy as np
from numba import float64

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.kernel_loans import borrowed, stack_matrix
from closeform.planning.deflection import deflect, fill_factors, fill_gram, room_for
from closeform.planning.qp import solve_qp
from closeform.planning.relative_motion import motion_after
from closeform.planning.scene import CONTACTS, INDICES, ROWS, SCENE, Contacts, Scene

ALONE, TOGETHER = 1e5, 30.0  # zones that one plane, and all of them, may push a craft: no plan comes of more


@kernel(float64(SCENE, CONTACTS, float64, float64, float64, float64, ROWS, INDICES))
def press(scene, contacts, lift, give, stride, most, arcs, offsets):
    """Multipliers that keep failed craft beyond all planes at `lift` aims: the energy; fills the paths.

    It begins with the contacts that push.  Each gives way by `give` of its own compliance.  Where a push is
    farther than `stride` zones all are shorter.  inf where planes ask for what cannot be together, or where
    one moves a craft by more than `most` zones.
                                                                                         # theory (72)
    """
    arcs, offsets, count = borrowed(arcs), borrowed(offsets), len(contacts.times)
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
    deflect(scene, contacts, count, factors, arcs, offsets)
    return energy


def press_in(
    scene: Scene, planes: Contacts, lift: float, give: float, stride: float, most: float = TOGETHER
) -> tuple[float, Floats, Any]:
    """`press` with room for the craft's arcs: the energy and these."""
    arcs, offsets = room_for(scene, planes)
    return press(scene, planes, lift, give, stride, most, arcs, offsets), arcs, offsets
