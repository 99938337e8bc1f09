"""The least-energy path that touches the zones at given contacts, each free to slide.

A contact is a time, an obstacle and the zone's outward normal there; its force pushes along
the normal.  With the contacts fixed the path solves a small quadratic program; each contact
then moves to where the shaped path comes closest.  Near the optimum Newton's method on the
conditions of optimality (touching, force along the normal, no speed along the normal) takes
over and converges to rounding.
"""

import numpy as np
from numba import float64, int64, types

from closeform.compiled import kernel
from closeform.motion.arc import END, START
from closeform.planning.kernel import influences, relative, shape
from closeform.planning.newton import TOUCHING, approach_rate, in_zone, newton, outward, push_back
from closeform.planning.pressing import press

ROUNDS = 40  # of the quadratic program with contacts moved
CLOSE = 0.3  # how little contacts move in a round, in normals and times, before Newton is tried
MARGIN = 1e-7  # of the duration: contacts keep this far from the path's ends and from each other
SETTLED, UNSETTLED, IDLE = 0, 1, 2


@kernel()
def slide(rows, count, others, first, last, matrix, power, t, start, end, tolerance, work, normal):
    """The time near t, within [start, end], of the locally least norm, to `tolerance` of that span."""
    step = 1e-3 * (end - start)
    relative(rows, count, others, first, last, matrix, t, work)
    here = approach_rate(power, work, normal)
    sign = -1.0 if here > 0.0 else 1.0
    a = t
    while True:
        b = min(max(t + sign * step, start), end)
        relative(rows, count, others, first, last, matrix, b, work)
        there = approach_rate(power, work, normal)
        if there * here <= 0.0 or b in (start, end):
            break
        a = b
        step *= 2.0
    if there * here > 0.0:
        return b
    for k in range(60):
        middle = 0.5 * (a + b)
        if k % 3 and here != there:
            middle = a + (b - a) * here / (here - there)
        relative(rows, count, others, first, last, matrix, middle, work)
        slope = approach_rate(power, work, normal)
        if slope * here > 0.0:
            a, here = middle, slope
        else:
            b, there = middle, slope
        if abs(b - a) <= tolerance * abs(end - start):
            break
    return b


@kernel()
def touch(base, scene, contacts, blocks, normal_gram, gaps):
    """Compliance along the contacts' normals, and how far the base path falls short there."""
    obstacles, offsets, matrices, _, aims = scene
    which, times, normals, _ = contacts
    motion = np.empty((3, 3))
    block = np.empty((3, 3))
    alone = base.reshape(1, len(base))
    for k in range(len(which)):
        o = which[k]
        relative(alone, 1, obstacles, offsets[o], offsets[o + 1], matrices[o], times[k], motion)
        gaps[k] = aims[o]
        for i in range(3):
            gaps[k] -= normals[k, i] * motion[0, i]
        for m in range(len(which)):
            in_zone(blocks[k, m], matrices[o], matrices[which[m]], 0, block)
            normal_gram[k, m] = 0.0
            for i in range(3):
                for j in range(3):
                    normal_gram[k, m] += normals[k, i] * block[i, j] * normals[m, j]


@kernel()
def slide_all(base, rows, arcs, scene, contacts, windows, slid, turned):
    """Where each contact slides to on a shaped path: how far they move, -1 where one is idle."""
    obstacles, offsets, matrices, powers, _ = scene
    which, times, normals, force = contacts
    motion = np.empty((3, 3))
    margin = MARGIN * (base[END] - base[START])
    moved = 0.0
    for k in range(len(which)):
        if force[k] <= 0.0:
            return -1.0
        o = which[k]
        a, b = offsets[o], offsets[o + 1]
        slid[k] = slide(
            rows,
            arcs,
            obstacles,
            a,
            b,
            matrices[o],
            powers[o],
            times[k],
            windows[k, 0],
            windows[k, 1],
            1e-14,
            motion,
            turned[k],
        )
        for m in range(k):
            if which[m] == o and abs(slid[m] - slid[k]) < margin:
                if abs(times[m] - times[k]) < margin:
                    force[k] = 0.0  # two contacts have become one
                    return -1.0
                # one would slide into the other: the one that is further off stays
                if abs(slid[k] - times[k]) > abs(slid[m] - times[m]):
                    slid[k] = times[k]
                else:
                    slid[m] = times[m]
                    relative(rows, arcs, obstacles, a, b, matrices[o], slid[m], motion)
                    outward(powers[o], motion, turned[m])
        moved = max(moved, abs(slid[k] - times[k]) / (base[END] - base[START]))
        relative(rows, arcs, obstacles, a, b, matrices[o], slid[k], motion)
        for i in range(3):
            turned[k, i] = normals[k, i]
        outward(powers[o], motion, turned[k])
        for i in range(3):
            moved = max(moved, abs(normals[k, i] - turned[k, i]))
    return moved


@kernel()
def place(contacts, times, normals):
    """Put contacts at given times and normals."""
    for k in range(len(times)):
        contacts[1][k] = times[k]
        for i in range(3):
            contacts[2][k, i] = normals[k, i]


@kernel()
def part_way(rows, arcs, scene, contacts, old_times, slid, step):
    """Move contacts by a fraction of their slide, with the normals that hold there."""
    obstacles, offsets, matrices, powers, _ = scene
    which, times, normals, _ = contacts
    motion = np.empty((3, 3))
    for k in range(len(which)):
        times[k] = old_times[k] + step * (slid[k] - old_times[k])
        o = which[k]
        relative(rows, arcs, obstacles, offsets[o], offsets[o + 1], matrices[o], times[k], motion)
        outward(powers[o], motion, normals[k])


SCENE = types.Tuple((float64[:, ::1], int64[::1], float64[:, :, ::1], float64[::1], float64[::1]))
CONTACTS = types.Tuple((int64[::1], float64[::1], float64[:, ::1], float64[::1]))


@kernel(int64(float64[::1], float64[:, ::1], SCENE, CONTACTS, float64[:, ::1], float64[:, ::1]))
def relax(base, inverse, scene, contacts, rows, gram):
    """Slide contacts to the least-energy path that touches the zones at them.

    `scene`: the obstacles' arcs and offsets; their zones' matrices, powers (of the norm) and
    aims (the norm to keep).  `contacts`:
    obstacle, time, normal (count, 3) in zone coordinates, force; all but the first are moved.
    Fills `rows` (count + 1 arcs) and `gram` (3 count, 3 count), the kernel between the contacts
    in zone coordinates.  SETTLED: the conditions of optimality hold to rounding.  UNSETTLED: the
    path touches only approximately.  IDLE: a contact has no force, drop it.
    """
    which, times, normals, force = contacts
    matrices = scene[2]
    count = len(which)
    pulls = np.empty((count, 6, 3))
    blocks = np.empty((count, count, 6, 3))
    rates = np.empty((count, count, 6, 3))
    normal_gram = np.empty((count, count))
    pressing = np.empty(count, dtype=np.bool_)
    gaps, pushes = np.empty(count), np.empty((count, 3))
    old_times, slid, turned = np.empty(count), np.empty(count), np.empty((count, 3))
    windows = np.empty((count, 2))
    margin = MARGIN * (base[END] - base[START])
    for k in range(count):
        a, b = scene[1][which[k]], scene[1][which[k] + 1]
        windows[k, 0] = max(base[START] + margin, scene[0][a, START])
        windows[k, 1] = min(base[END] - margin, scene[0][b - 1, END])
    status = UNSETTLED
    moved, step = np.inf, 1.0
    for _ in range(ROUNDS):
        influences(base, inverse, times, count, pulls, blocks, rates)
        touch(base, scene, contacts, blocks, normal_gram, gaps)
        pressing[:] = True
        press(normal_gram, gaps, pressing, 0.0, force)
        push_back(contacts, matrices, pushes)
        arcs = shape(base, pulls, times, pushes, count, rows)
        before = moved
        moved = slide_all(base, rows, arcs, scene, contacts, windows, slid, turned)
        if moved < 0.0:
            return IDLE
        if moved < TOUCHING:
            status = SETTLED
            break
        for k in range(count):
            old_times[k] = times[k]
        place(contacts, slid, turned)
        if moved < CLOSE:
            if newton(base, inverse, scene, contacts, windows, rows, pulls, blocks, rates):
                status = SETTLED
                break
            place(contacts, slid, turned)
        if moved > 0.7 * before:  # to and fro
            step *= 0.5
        part_way(rows, arcs, scene, contacts, old_times, slid, step)
    block = np.empty((3, 3))
    for k in range(count):
        for m in range(count):
            in_zone(blocks[k, m], matrices[which[k]], matrices[which[m]], 0, block)
            for i in range(3):
                for j in range(3):
                    gram[3 * k + i, 3 * m + j] = block[i, j]
    return status
