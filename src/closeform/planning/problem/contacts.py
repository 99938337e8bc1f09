"""Update of contacts between rounds: sliding, merging, new contacts, and the choice of passing sides."""

from typing import NamedTuple

from numba import float64, types, void

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.kernel_loans import Lent, stack_matrix, stack_vector
from closeform.planning.problem.approaches import slide
from closeform.planning.problem.relative_motion import motion_after, relative_motion
from closeform.planning.problem.rounded_norm import gradient, rounded_norm
from closeform.planning.problem.scene import CONTACTS, INDICES, ROWS, SCENE
from closeform.zones.shapes import BALL, norm

SAME = 1e-3  # of a pair's window: contacts closer than this are merged
SLID = 1e-10  # of a pair's window: accuracy of a contact's instant between rounds
HELD = 0.9  # position along the normal, in zones, from which a plane holds
MEET = 1e-9  # norm below which two craft meet, so that no side is nearer


class Sides(NamedTuple):
    """Rule for the side of a new contact: the nearer side, unless its norm is below `depth`.

    Below it, every body is treated as slightly displaced, so that the choices for all pairs agree. The
    displacement is across the relative motion, or `along` it, to pass earlier or later.
    """

    shifts: Floats  # (N + M, 3) in zones
    depth: float
    along: bool


SIDES = Lent(types.NamedTuple((ROWS, float64, types.boolean), Sides))


@kernel()
def turn_normal(scene, which, motion, out):
    """Fill the zone's outward normal at a relative motion; leave `out` unchanged where two craft meet."""
    kind = scene.kinds[which]
    faces = scene.faces[scene.face_offsets[kind] : scene.face_offsets[kind + 1]]
    shape, power = scene.shapes[kind], scene.powers[kind]
    if abs(rounded_norm(shape, faces, power, motion[0, 0], motion[0, 1], motion[0, 2])) > MEET:
        gradient(shape, faces, power, motion, out)


@kernel(void(SCENE, ROWS, INDICES, CONTACTS, float64, ROWS))
def turn_normals(scene, arcs, offsets, contacts, least, normals):
    """Update the `normals` (K, 3) of contacts to the positions of their pairs, after any loss of thrust.

    Normals where the norm is at most `least` stay, and so do flat faces whose planes hold: another face
    would be no nearer, and the two would alternate.
    """
    motion = stack_matrix(8, 3)
    for k in range(len(contacts.times)):
        which = contacts.which[k]
        motion_after(scene, arcs, offsets, which, contacts.times[k], contacts.drifts[k], motion)
        kind = scene.kinds[which]
        faces = scene.faces[scene.face_offsets[kind] : scene.face_offsets[kind + 1]]
        along = 0.0
        for i in range(3):
            along += normals[k, i] * motion[0, i]
        holds = scene.shapes[kind] != BALL and along >= HELD
        if not holds and norm(scene.shapes[kind], faces, motion[0, 0], motion[0, 1], motion[0, 2]) > least:
            turn_normal(scene, which, motion, normals[k])


@kernel()
def choose_side(scene, sides, which, motion, out):
    """Fill the normal of a new contact at a relative motion, which is overwritten."""
    kind = scene.kinds[which]
    faces = scene.faces[scene.face_offsets[kind] : scene.face_offsets[kind + 1]]
    shape, power = scene.shapes[kind], scene.powers[kind]
    depth = rounded_norm(shape, faces, power, motion[0, 0], motion[0, 1], motion[0, 2])
    if depth < sides.depth:
        first, second = scene.pairs[which, 0], scene.pairs[which, 1]
        pace, slip = 0.0, 0.0
        for i in range(3):
            shift = sides.shifts[first, i] - sides.shifts[second, i]
            pace += motion[1, i] * motion[1, i]
            slip += (motion[0, i] + shift) * motion[1, i]
        sign = 1.0 if sides.shifts[first, 0] > sides.shifts[second, 0] else -1.0
        for i in range(3):
            shift = sides.shifts[first, i] - sides.shifts[second, i]
            if sides.along and pace > 0.0:
                motion[0, i] = sign * motion[1, i]
            else:
                motion[0, i] += shift - (slip / pace * motion[1, i] if pace > 0.0 else 0.0)
    out[0], out[1], out[2] = 1.0, 0.0, 0.0
    gradient(shape, faces, power, motion, out)


@kernel()
def copy_contact(source, k, target, m):
    """Copy contact k of `source` to place m of `target`."""
    target.which[m], target.times[m] = source.which[k], source.times[k]
    target.multipliers[m] = source.multipliers[k]
    for i in range(3):
        target.normals[m, i] = source.normals[k, i]


@kernel()
def merge(scene, source, k, target, count):
    """Add contact k of `source` to `target`, or merge it with the nearby contact of its pair."""
    span = scene.windows[source.which[k], 1] - scene.windows[source.which[k], 0]
    for m in range(count):
        if target.which[m] == source.which[k] and abs(target.times[m] - source.times[k]) < SAME * span:
            push = target.multipliers[m]
            if source.multipliers[k] > push:  # keep the time of the largest multiplier
                copy_contact(source, k, target, m)
                target.multipliers[m] += push
            else:
                target.multipliers[m] += source.multipliers[k]
            return count
    if count < len(target.times):
        copy_contact(source, k, target, count)
        count += 1
    return count


@kernel()
def slide_all(scene, arcs, offsets, contacts, count, slid):
    """Fill `slid` with the contacts at their pairs' current closest approaches; return the largest change."""
    motion, work = stack_matrix(3, 3), stack_vector(3)
    moved = 0.0
    for k in range(count):
        copy_contact(contacts, k, slid, k)
        if contacts.multipliers[k] <= 0.0:
            continue
        which = contacts.which[k]
        slid.times[k] = slide(scene, arcs, offsets, which, contacts.times[k], SLID, motion, work)
        relative_motion(scene, arcs, offsets, which, slid.times[k], motion)
        turn_normal(scene, which, motion, slid.normals[k])
        span = scene.windows[which, 1] - scene.windows[which, 0]
        moved = max(moved, abs(slid.times[k] - contacts.times[k]) / span)
        for i in range(3):
            moved = max(moved, abs(slid.normals[k, i] - contacts.normals[k, i]))
    return moved


@kernel()
def join_equal(scene, contacts, count, slid):
    """Let one of two contacts of a pair that are close, and stay close when they slide, have both forces."""
    for k in range(count):
        for m in range(k):
            which = contacts.which[k]
            same = SAME * (scene.windows[which, 1] - scene.windows[which, 0])
            near = abs(contacts.times[k] - contacts.times[m]) < same
            if which == contacts.which[m] and near and abs(slid.times[k] - slid.times[m]) < same:
                slid.multipliers[k] += slid.multipliers[m]
                slid.multipliers[m] = 0.0


@kernel()
def next_contacts(scene, arcs, offsets, contacts, count, slid, following):
    """Fill the contacts of the next round: the new instants, and old instants that are far from them."""
    motion = stack_matrix(3, 3)
    total = 0
    for k in range(count):
        if contacts.multipliers[k] > 0.0:
            total = merge(scene, slid, k, following, total)
    for k in range(count):
        which, t = contacts.which[k], contacts.times[k]
        span = scene.windows[which, 1] - scene.windows[which, 0]
        if contacts.multipliers[k] > 0.0 and abs(slid.times[k] - t) > SAME * span:
            relative_motion(scene, arcs, offsets, which, t, motion)
            copy_contact(contacts, k, slid, k)
            turn_normal(scene, which, motion, slid.normals[k])
            total = merge(scene, slid, k, following, total)
    return total


@kernel()
def add_fresh(scene, sides, arcs, offsets, found, number, following, count):
    """Add contacts without force at minima that have no contact nearby; return the number of contacts."""
    motion = stack_matrix(3, 3)
    total = count
    for row in range(number):
        which = int(found[row, 0])
        start, end = scene.windows[which, 0], scene.windows[which, 1]
        t = min(max(found[row, 1], start), end)
        near = total == len(following.times)
        for m in range(count):
            if following.which[m] == which and abs(following.times[m] - t) < 2.0 * SAME * (end - start):
                near = True
        if near:
            continue
        following.which[total], following.times[total], following.multipliers[total] = which, t, 0.0
        relative_motion(scene, arcs, offsets, which, t, motion)
        choose_side(scene, sides, which, motion, following.normals[total])
        total += 1
    return total


@kernel()
def copy_contacts(source, count, target):
    """Copy those of the first `count` contacts that have positive multipliers."""
    total = 0
    for k in range(count):
        if source.multipliers[k] > 0.0:
            copy_contact(source, k, target, total)
            total += 1
    return total
