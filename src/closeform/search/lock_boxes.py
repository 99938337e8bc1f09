"""Lock boxes: whether every initial state of a box locks, at an instant that they all share.

A box holds the states within its half-widths of a centre.  At one time the vectors q between the two
sensors fill a box too, q = r + v t - 2 offset b being linear in each component by itself, and the cone in
which both see each other is convex up to half of the sky: all of them lock where the eight corners do.
                                                                                        # theory (57)
"""

from __future__ import annotations

from math import sqrt
from typing import Any, NamedTuple

from numba import float64, int64, void

from closeform._jit import kernel
from closeform.arrays import Floats

TIME, BORESIGHT, COSINE, SHIFT = 0, 1, 4, 5  # columns of a table of looks
ROUNDING = 1e-12  # of all that q is summed from: a thousand times what rounding can do to g
ALONG = 0.01  # how much a width along the line of sight counts, beside one across
PROVEN, OPEN, UNSEEN = 0, 1, 2  # verdicts: all lock; not known; no look sees the centre


class LockBox(NamedTuple):
    """A centre and half-widths, of position and velocity by components."""

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
    return LockBox(
        *(centre[0], centre[1], centre[2], centre[3], centre[4], centre[5]),
        *(half[0], half[1], half[2], half[3], half[4], half[5]),
    )


@kernel()
def shortfalls(look, box, baseline, longest):
    """What a look makes of a box: what misses at its centre, at one corner, at the worst with the slack.

    That is g or, if more, the length beyond the range: all lock if the last is not positive.  It is that of
    one corner where that one, or the centre, is not seen.                               # theory (57)
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
    """The component along which a box is widest across the line of sight of its centre, seen by a look."""
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
    """The component along which a box is widest, velocities by what they come to in half of the search."""
    best, axis = box.rx, 0
    half = 0.5 * duration
    for k, side in enumerate((box.ry, box.rz, half * box.sx, half * box.sy, half * box.sz)):
        if side > best:
            best, axis = side, k + 1
    return axis


@kernel()
def nearest_look(looks, hot, box, baseline, longest):
    """Whether a look proves that a box locks, and which comes nearest to it: -1 if none sees its centre."""
    nearest, best = -1, 0.0
    count = len(looks)
    for k in range(count):
        # from the look that came nearest for the box that this is half of, outwards in both directions
        index = hot + ((k + 1) // 2 if k & 1 else -(k // 2))
        index = index - count if index >= count else (index + count if index < 0 else index)
        centre, corner, worst = shortfalls(looks[index], box, baseline, longest)
        if worst <= 0.0 and centre < 0.0:
            return index, True
        if centre < 0.0:
            share = -centre / (max(corner, worst) - centre)  # how much of the box would lock, of its width
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
    """What is known of each box: its verdict, the look nearest to a proof (into `hot`), where to halve it."""
    for m in range(len(centres)):
        box = as_box(centres[m], halves[m])
        nearest, proven = nearest_look(looks, hot[m], box, baseline, longest)
        if proven:
            verdicts[m] = PROVEN
        elif nearest >= 0:
            verdicts[m], hot[m], axes[m] = OPEN, nearest, axis_to_halve(looks[nearest], box, baseline)
        else:
            verdicts[m], axes[m] = UNSEEN, longest_side(box, duration)
