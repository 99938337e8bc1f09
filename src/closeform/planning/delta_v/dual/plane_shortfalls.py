"""Planes for craft with impulses: shortfalls of coasting craft."""

from numba import float64, void

from closeform._jit import kernel
from closeform.kernel_loans import borrowed, stack_matrix, stack_vector
from closeform.planning.delta_v.dual.fleet import BRIEF, PLANES
from closeform.planning.problem.relative_motion import motion_after
from closeform.planning.problem.scene import BLOCKS, CONTACTS, INDICES, ROWS, SCENE


@kernel(void(SCENE, ROWS, INDICES, CONTACTS, BLOCKS, float64, PLANES))
def fill_planes(scene, arcs, offsets, contacts, spans, aim, planes):
    """Fill the planes of contacts at distance `aim`; `arcs` are those of coasting craft.

    `spans` (P, 2, 2) are the controllable times of each pair.  An impulse in which thrust may be lost is a
    brief burn.                                                                          # theory (38), (74)
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
                drifts[side] = t - min(cut, 0.5 * (start + end))  # any instant of a coast is the same
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
