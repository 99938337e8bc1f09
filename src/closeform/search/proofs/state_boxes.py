"""Boxes of initial states, and the certified test of whether every state of a box locks at one instant.

At one time the vectors q between the two sensors of all states of a box also fill a box, because
q = r + v t - 2 offset b is linear in each component. The cone in which both see each other is convex up to a
half-angle of 90 deg. All states therefore lock if the eight corners do.  # theory (57)
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np
from numba import float64, int64, void

from closeform._jit import kernel
from closeform.arrays import Floats

ROUNDING = 1e-12  # of the terms of q: a thousand times the rounding error of g
ALONG = 0.01  # weight of a width along the line of sight, relative to one across
PROVEN, OPEN, UNSEEN = 0, 1, 2  # verdicts: all lock; undecided; the centre is not seen at any instant
ROWS = float64[:, ::1]


@kernel(inline=True)
def line_of_sight(instant, centre, baseline):
    """Return the vector between the sensors of the centre of a box at an instant."""
    t, bx, by, bz = instant[0], instant[1], instant[2], instant[3]
    return (
        centre[0] + t * centre[3] - baseline * bx,
        centre[1] + t * centre[4] - baseline * by,
        centre[2] + t * centre[5] - baseline * bz,
    )


@kernel()
def shortfalls(instant, centre, half, baseline, longest):
    """Return the margins by which a box is out of sight at an instant: centre, one corner, worst corner.

    A shortfall is g or, if greater, the distance beyond the range. All states lock if the last value, which
    includes the rounding error, is not positive. It equals an earlier value if that one is already positive.
    # theory (57)
    """
    t, bx, by, bz, c, shift = instant[0], instant[1], instant[2], instant[3], instant[4], instant[5]
    qx, qy, qz = line_of_sight(instant, centre, baseline)
    length = sqrt(qx * qx + qy * qy + qz * qz)
    middle = max(c * length - (bx * qx + by * qy + bz * qz), length - longest)
    if middle >= 0.0:
        return middle, middle, middle
    dx, dy, dz = half[0] + t * half[3] + shift, half[1] + t * half[4] + shift, half[2] + t * half[5] + shift
    # the corner farthest from the boresight
    ax, ay, az = (
        qx - (dx if bx >= 0.0 else -dx),
        qy - (dy if by >= 0.0 else -dy),
        qz - (dz if bz >= 0.0 else -dz),
    )
    corner = c * sqrt(ax * ax + ay * ay + az * az) - (bx * ax + by * ay + bz * az)
    if corner > 0.0:
        return middle, corner, corner
    lx, ly, lz, hx, hy, hz = qx - dx, qy - dy, qz - dz, qx + dx, qy + dy, qz + dz
    worst = corner
    for k in range(8):
        px, py, pz = lx if k & 1 else hx, ly if k & 2 else hy, lz if k & 4 else hz
        length = sqrt(px * px + py * py + pz * pz)
        worst = max(worst, c * length - (bx * px + by * py + bz * pz), length - longest)
    size = abs(centre[0]) + abs(centre[1]) + abs(centre[2])
    size += t * (abs(centre[3]) + abs(centre[4]) + abs(centre[5]))
    slack = ROUNDING * (size + dx + dy + dz + baseline)
    return middle, corner, worst + slack


@kernel()
def widest_axis(instant, centre, half, baseline):
    """Return the component along which a box is widest across the line of sight of its centre."""
    qx, qy, qz = line_of_sight(instant, centre, baseline)
    xx, yy, zz = qx * qx, qy * qy, qz * qz
    best, axis = -1.0, 0
    for k in range(3):
        across = yy + zz if k == 0 else (xx + zz if k == 1 else xx + yy)
        weight = sqrt(across + ALONG * (xx + yy + zz))
        for m in (k, 3 + k):
            reach = weight * (half[m] if m < 3 else instant[0] * half[m])
            if reach > best:
                best, axis = reach, m
    return axis


@kernel()
def nearest_instant(instants, first, centre, half, baseline, longest):
    """Return the instant nearest to a proof, -1 if the centre is never seen, and whether it is a proof."""
    nearest, best = -1, 0.0
    count = len(instants)
    for k in range(count):
        # outwards in both directions from the best instant for the parent box
        index = first + ((k + 1) // 2 if k & 1 else -(k // 2))
        index = index - count if index >= count else (index + count if index < 0 else index)
        middle, corner, worst = shortfalls(instants[index], centre, half, baseline, longest)
        if worst <= 0.0 and middle < 0.0:
            return index, True
        if middle < 0.0:
            share = -middle / (max(corner, worst) - middle)  # fraction of the width of the box that locks
            if share > best:
                nearest, best = index, share
    return nearest, False


@kernel(void(ROWS, ROWS, ROWS, float64, float64, int64[::1], int64[::1], int64[::1]))
def judge(
    instants: Floats,
    centres: Floats,
    halves: Floats,
    baseline: float,
    longest: float,
    nearest: Any,
    axes: Any,
    verdicts: Any,
) -> None:
    """Write the verdict of each box, its instant nearest to a proof, and the axis to halve an open box along.

    `instants` (T, 6): time [s], boresight of A, cosine of the cone, and the displacement of the sensors [m].
    """
    for m in range(len(centres)):
        centre, half = centres[m], halves[m]
        index, proven = nearest_instant(instants, nearest[m], centre, half, baseline, longest)
        verdicts[m] = PROVEN if proven else OPEN if index >= 0 else UNSEEN
        if verdicts[m] == OPEN:
            nearest[m], axes[m] = index, widest_axis(instants[index], centre, half, baseline)


@dataclass(frozen=True, eq=False)
class StateBoxes:
    """Boxes by centres and half-widths (M, 6), their shares (M,) of the whole, and `nearest` (M,).

    `nearest`: the index of the instant that came nearest to a proof.
    """

    centres: Floats
    halves: Floats
    shares: Floats
    nearest: Any

    def __len__(self) -> int:
        return len(self.centres)

    def __getitem__(self, which: Any) -> StateBoxes:
        return StateBoxes(self.centres[which], self.halves[which], self.shares[which], self.nearest[which])

    @classmethod
    def of(cls, low: Floats, high: Floats) -> StateBoxes:
        """Return the box between two states (6,)."""
        middle = 0.5 * (low + high)
        reach = np.maximum(high - middle, middle - low)
        return cls(middle[None], reach[None], np.ones(1), np.zeros(1, dtype=np.int64))

    @classmethod
    def faces(cls, low: Floats, high: Floats) -> StateBoxes:
        """Return the faces of a box around the origin that do not contain it.

        Their multiples fill the box. The fraction of a face is that of the pyramid on it with its tip at the
        origin.  # theory (58)
        """
        widths = np.where(high > low, high - low, 1.0)
        found, volumes = [], []
        for axis in range(6):
            for end in (low[axis], high[axis]):
                if end != 0.0:
                    least, greatest = low.copy(), high.copy()
                    least[axis] = greatest[axis] = end
                    found.append(cls.of(least, greatest))
                    volumes.append(abs(end) / widths[axis])
        boxes = joined(found)
        return cls(boxes.centres, boxes.halves, np.array(volumes) / sum(volumes), boxes.nearest)

    def halved(self, axes: Any) -> StateBoxes:
        """Return two boxes for each, halved along the given component."""
        rows = np.arange(len(self))
        halves = self.halves.copy()
        halves[rows, axes] *= 0.5
        step = np.zeros_like(halves)
        step[rows, axes] = halves[rows, axes]
        low = StateBoxes(self.centres - step, halves, 0.5 * self.shares, self.nearest)
        return joined([low, StateBoxes(self.centres + step, halves, 0.5 * self.shares, self.nearest)])

    @property
    def edges(self) -> Floats:
        """Minimum and maximum states (M, 2, 6)."""
        return np.stack([self.centres - self.halves, self.centres + self.halves], axis=1)


def joined(boxes: list[StateBoxes]) -> StateBoxes:
    """Return the concatenation of several sets of boxes."""
    columns = ("centres", "halves", "shares", "nearest")
    return StateBoxes(*(np.concatenate([getattr(some, name) for some in boxes]) for name in columns))
