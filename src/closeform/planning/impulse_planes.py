"""Planes between craft that fire: by how much those who coast on miss them, and which sets are alike."""

from collections.abc import Iterable

import numpy as np
from numba import float64, void

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.kernel_loans import borrowed, stack_matrix, stack_vector
from closeform.planning.impulse_scene import BRIEF, PLANES
from closeform.planning.relative_motion import motion_after
from closeform.planning.scene import BLOCKS, CONTACTS, INDICES, ROWS, SCENE, Contacts

ASIDE = 0.52  # between unit normals of planes on one side of a zone: 30 degrees


@kernel(void(SCENE, ROWS, INDICES, CONTACTS, BLOCKS, float64, PLANES))
def fill_planes(scene, arcs, offsets, contacts, spans, aim, planes):
    """Fill the planes of contacts, `aim` zones out; `arcs` are those of craft that coast on.

    `spans` (P, 2, 2) are when each of a pair can give way.  An impulse in which thrust may be lost is a brief
    burn.                                                                                # theory (38), (74)
    """
    arcs, offsets, spans = borrowed(arcs), borrowed(offsets), borrowed(spans)
    motion, drifts = stack_matrix(3, 3), stack_vector(2)
    for k in range(len(contacts.times)):
        which, t = contacts.which[k], contacts.times[k]
        for side in range(2):
            start, end = spans[which, side, 0], spans[which, side, 1]
            cut = t - contacts.drifts[k, side]
            planes.cuts[k, side], drifts[side] = cut, 0.0
            if contacts.drifts[k, side] > 0.0:
                brief = BRIEF * (end - start)
                drifts[side] = t - min(cut, 0.5 * (start + end))  # who coasts is where it would be, whenever
                start, end = start - brief, end + brief
            body = scene.pairs[which, side] if start < cut < end else -1
            if side == 0:
                planes.first[k] = body
            else:
                planes.second[k] = body
        motion_after(scene, arcs, offsets, which, t, drifts, motion)
        matrix, normal = scene.matrices[scene.kinds[which]], contacts.normals[k]
        planes.times[k], planes.misses[k] = t, aim
        for axis in range(3):
            planes.misses[k] -= normal[axis] * motion[0, axis]
            planes.rows[k, axis] = 0.0
            for i in range(3):
                planes.rows[k, axis] += normal[i] * matrix[i, axis]


def sides_of(contacts: Contacts, apart: Floats) -> Floats:
    """Contacts, in order, as rows (K, 5) of pair, time and normal; each is at most 1 off in those alike.

    `apart` (P,) [s] is how far apart in time contacts of each pair may be.
    """
    lengths = np.sqrt((contacts.normals * contacts.normals).sum(axis=1))
    rows = np.empty((contacts.number, 5))
    rows[:, 0], rows[:, 1] = 2.0 * contacts.which, contacts.times / apart[contacts.which]
    rows[:, 2:] = contacts.normals / (ASIDE * lengths[:, None])
    return rows


def is_among(sides: Floats, others: Iterable[Floats]) -> bool:
    """Whether contacts lie on the same sides of the same pairs, at about the same times, as some others."""
    same = [other for other in others if len(other) == len(sides)]
    if not same:
        return False
    away = np.abs(np.array(same) - sides)
    near = (away[..., :2] <= 1.0).all(axis=2) & ((away[..., 2:] ** 2).sum(axis=2) <= 1.0)
    return bool(near.all(axis=1).any())
