"""Certified test of whether every initial state of a box locks at one common instant.

A box holds the states within its half-widths of a centre. At one time the vectors q between the two sensors
also fill a box, because q = r + v t - 2 offset b is linear in each component. The cone in which both see each
other is convex up to a half-angle of 90 deg. All states therefore lock if the eight corners do.  # theory
(57)
"""

from __future__ import annotations

from math import sqrt
from typing import Any, NamedTuple

from numba import float64, int64, void

from closeform._jit import kernel
from closeform.arrays import Floats

TIME, BORESIGHT, COSINE, SHIFT = 0, 1, 4, 5  # columns of a table of looks (instants of a test)
ROUNDING = 1e-12  # of the terms of q: a thousand times the rounding error of g
ALONG = 0.01  # weight of a width along the line of sight, relative to one across
PROVEN, OPEN, UNSEEN = 0, 1, 2  # verdicts: all lock; undecided; no look sees the centre


class LockBox(NamedTuple):
    """Center and half-widths, of position and velocity by components."""

    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float
    rx: float
    ry: float
    rz: float
    sx: float
    sy: float
    sz: float


@kernel(inline=True)
def as_box(centre, half):
    """Return a box from arrays of its centre and half-widths."""
    return LockBox(
        *(centre[0], centre[1], centre[2], centre[3], centre[4], centre[5]),
        *(half[0], half[1], half[2], half[3], half[4], half[5]),
    )


@kernel()
def shortfalls(look, box, baseline, longest):
    """Return the shortfalls of a look at a box: at its centre, at one corner, at the worst corner.

    A shortfall is g or, if greater, the distance beyond the range. All states lock if the last value, which
    includes the rounding error, is not positive. It equals an earlier value if that one is already positive.
    # theory (57)
    """
    t, bx, by, bz, c, shift = look[0], look[1], look[2], look[3], look[4], look[5]
    qx, qy, qz = (
        box.x + t * box.vx - baseline * bx,
        box.y + t * box.vy - baseline * by,
        box.z + t * box.vz - baseline * bz,
    )
    along = bx * qx + by * qy + bz * qz
    length = sqrt(qx * qx + qy * qy + qz * qz)
    centre = max(c * length - along, length - longest)
    if centre >= 0.0:
        return centre, centre, centre
    dx, dy, dz = box.rx + t * box.sx + shift, box.ry + t * box.sy + shift, box.rz + t * box.sz + shift
    # the corner farthest from the boresight
    ax, ay, az = (
        qx - (dx if bx >= 0.0 else -dx),
        qy - (dy if by >= 0.0 else -dy),
        qz - (dz if bz >= 0.0 else -dz),
    )
    corner = c * sqrt(ax * ax + ay * ay + az * az) - (bx * ax + by * ay + bz * az)
    if corner > 0.0:
        return centre, corner, corner
    lx, ly, lz, hx, hy, hz = qx - dx, qy - dy, qz - dz, qx + dx, qy + dy, qz + dz
    worst = corner
    for k in range(8):
        px, py, pz = lx if k & 1 else hx, ly if k & 2 else hy, lz if k & 4 else hz
        length = sqrt(px * px + py * py + pz * pz)
        worst = max(worst, c * length - (bx * px + by * py + bz * pz), length - longest)
    size = abs(box.x) + abs(box.y) + abs(box.z) + t * (abs(box.vx) + abs(box.vy) + abs(box.vz))
    slack = ROUNDING * (size + dx + dy + dz + baseline)
    return centre, corner, worst + slack


@kernel()
def axis_to_halve(look, box, baseline):
    """Return the component along which a box is widest across the line of sight of its centre."""
    t, bx, by, bz = look[0], look[1], look[2], look[3]
    qx, qy, qz = (
        box.x + t * box.vx - baseline * bx,
        box.y + t * box.vy - baseline * by,
        box.z + t * box.vz - baseline * bz,
    )
    xx, yy, zz = qx * qx, qy * qy, qz * qz
    best, axis = -1.0, 0
    for k in range(3):
        across = yy + zz if k == 0 else (xx + zz if k == 1 else xx + yy)
        weight = sqrt(across + ALONG * (xx + yy + zz))
        for m in (k, 3 + k):
            reach = weight * (box[6 + m] if m < 3 else t * box[6 + m])
            if reach > best:
                best, axis = reach, m
    return axis


@kernel()
def longest_side(box, duration):
    """Return the component along which a box is widest; velocities count for half the duration."""
    best, axis = box.rx, 0
    half = 0.5 * duration
    for k, side in enumerate((box.ry, box.rz, half * box.sx, half * box.sy, half * box.sz)):
        if side > best:
            best, axis = side, k + 1
    return axis


@kernel()
def nearest_look(looks, hot, box, baseline, longest):
    """Return the look that comes nearest to a proof, -1 if none sees the centre, and whether it proves it."""
    nearest, best = -1, 0.0
    count = len(looks)
    for k in range(count):
        # outwards in both directions from the best look for the parent box
        index = hot + ((k + 1) // 2 if k & 1 else -(k // 2))
        index = index - count if index >= count else (index + count if index < 0 else index)
        centre, corner, worst = shortfalls(looks[index], box, baseline, longest)
        if worst <= 0.0 and centre < 0.0:
            return index, True
        if centre < 0.0:
            share = -centre / (max(corner, worst) - centre)  # fraction of the width of the box that locks
            if share > best:
                nearest, best = index, share
    return nearest, False


@kernel(
    void(
        float64[:, ::1],
        float64[:, ::1],
        float64[:, ::1],
        float64,
        float64,
        float64,
        int64[::1],
        int64[::1],
        int64[::1],
    )
)
def judge(
    looks: Floats,
    centres: Floats,
    halves: Floats,
    baseline: float,
    longest: float,
    duration: float,
    hot: Any,
    axes: Any,
    verdicts: Any,
) -> None:
    """Write the verdict of each box, the look nearest to a proof (`hot`), and the axis to halve it along."""
    for m in range(len(centres)):
        box = as_box(centres[m], halves[m])
        nearest, proven = nearest_look(looks, hot[m], box, baseline, longest)
        if proven:
            verdicts[m] = PROVEN
        elif nearest >= 0:
            verdicts[m], hot[m], axes[m] = OPEN, nearest, axis_to_halve(looks[nearest], box, baseline)
        else:
            verdicts[m], axes[m] = UNSEEN, longest_side(box, duration)
