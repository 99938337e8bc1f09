"""First locks from samples of every pair each second, as in the simulations of S04.

Three compiled variants and two in NumPy:

    table     compiled; one table of boresights for all pairs, prepared in advance; a pair stops at its
              first lock; squares are compared to avoid roots
    vector    as `table`, by blocks of samples without branches, so that the processor tests eight at
              once; only the block with the lock is searched again
    turning   compiled; computes the boresight at each sample of each pair from the quaternion of the
              turn in the leg, so that errors do not accumulate; otherwise as `table`
    numpy     all pairs of a batch, sample by sample; locked pairs are dropped at each sample
    blocks    NumPy by blocks of samples: one matrix product of all boresights and all pairs of a
              batch; locked pairs are dropped after each block

All variants take pairs that coast in deep space, positions and velocities (M, 3) of B relative to A at
time 0. They find the first sample (M,) at which both see each other, -1 for none. Sensors are at the
centres of mass, have any range and a half-angle of at most 90 deg. Times are late by half a step on
average, and a lock shorter than a step may be missed. The compiled variants release the interpreter, so
that `scan` can use threads; NumPy runs on one core.
"""

from concurrent.futures import ThreadPoolExecutor
from math import cos, sin

import numba
import numpy as np
from numpy.typing import NDArray

from peers.motion import Array

BLOCK = 128  # best of 16 ... 256
CHUNK = 16_384  # pairs that a thread takes at once
BATCH = {"numpy": 200_000, "blocks": 8192}  # best of 1024 ... 200 000
SAMPLES = 32  # of a block in NumPy; best of 16 ... 128
Samples = NDArray[np.int64]

# Peers may reorder sums (fastmath); without it LLVM tests one sample at a time.
compiled = numba.njit(nogil=True, fastmath=True, error_model="numpy", cache=True)


@compiled
def scaled_square(x, y, z, vx, vy, vz, weight):
    """|r + v t|^2 times a weight, as the coefficients of 1, t and t^2."""
    rr, rv, vv = x * x + y * y + z * z, x * vx + y * vy + z * vz, vx * vx + vy * vy + vz * vz
    return weight * rr, 2.0 * weight * rv, weight * vv


@compiled
def sees(along, t, rr, rv, vv):
    """Whether b.p >= |p| cos(half-angle), from `along`, b.p, and |p|^2 cos^2 as coefficients."""
    return along >= 0.0 and along * along >= rr + t * (rv + t * vv)


@compiled
def table(positions, velocities, boresights, step, weight, found):
    bx, by, bz = boresights[0], boresights[1], boresights[2]
    for m in range(len(positions)):
        x, y, z = positions[m, 0], positions[m, 1], positions[m, 2]
        vx, vy, vz = velocities[m, 0], velocities[m, 1], velocities[m, 2]
        rr, rv, vv = scaled_square(x, y, z, vx, vy, vz, weight)
        found[m] = -1
        for k in range(len(bx)):
            t = step * k
            if sees(bx[k] * (x + vx * t) + by[k] * (y + vy * t) + bz[k] * (z + vz * t), t, rr, rv, vv):
                found[m] = k
                break


@compiled
def count(x, y, z, vx, vy, vz, rr, rv, vv, bx, by, bz, times):
    """Samples of a block that are locks."""
    locks = 0
    for k in range(len(times)):
        t = times[k]
        along = bx[k] * (x + vx * t) + by[k] * (y + vy * t) + bz[k] * (z + vz * t)
        locks += 1 if along * abs(along) >= rr + t * (rv + t * vv) else 0
    return locks


@compiled
def vector(positions, velocities, boresights, step, weight, found):
    bx, by, bz = boresights[0], boresights[1], boresights[2]
    times = step * np.arange(len(bx))
    for m in range(len(positions)):
        x, y, z = positions[m, 0], positions[m, 1], positions[m, 2]
        vx, vy, vz = velocities[m, 0], velocities[m, 1], velocities[m, 2]
        rr, rv, vv = scaled_square(x, y, z, vx, vy, vz, weight)
        found[m] = 0 if sees(bx[0] * x + by[0] * y + bz[0] * z, 0.0, rr, rv, vv) else -1
        begin = 0
        while found[m] < 0 and begin < len(times):
            end = min(begin + BLOCK, len(times))
            b = bx[begin:end], by[begin:end], bz[begin:end]
            if count(x, y, z, vx, vy, vz, rr, rv, vv, b[0], b[1], b[2], times[begin:end]) > 0:
                for k in range(begin, end):
                    t = times[k]
                    along = bx[k] * (x + vx * t) + by[k] * (y + vy * t) + bz[k] * (z + vz * t)
                    if sees(along, t, rr, rv, vv):
                        found[m] = k
                        break
            begin = end


@compiled
def turned(axis, half, v):
    """Vector v turned about a unit axis by twice the angle `half`, by its quaternion (w, q)."""
    w, s = cos(half), sin(half)
    qx, qy, qz = s * axis[0], s * axis[1], s * axis[2]
    tx, ty, tz = (  # v + w t + q x t with t = 2 q x v
        2.0 * (qy * v[2] - qz * v[1]),
        2.0 * (qz * v[0] - qx * v[2]),
        2.0 * (qx * v[1] - qy * v[0]),
    )
    return (
        v[0] + w * tx + qy * tz - qz * ty,
        v[1] + w * ty + qz * tx - qx * tz,
        v[2] + w * tz + qx * ty - qy * tx,
    )


@compiled
def turning(positions, velocities, legs, step, weight, found):
    for m in range(len(positions)):
        x, y, z = positions[m, 0], positions[m, 1], positions[m, 2]
        vx, vy, vz = velocities[m, 0], velocities[m, 1], velocities[m, 2]
        rr, rv, vv = scaled_square(x, y, z, vx, vy, vz, weight)
        found[m] = -1
        k = 0
        for leg in range(len(legs)):
            start, end, half_rate = legs[leg, 0], legs[leg, 1], legs[leg, 2]
            axis = legs[leg, 3], legs[leg, 4], legs[leg, 5]
            boresight = legs[leg, 6], legs[leg, 7], legs[leg, 8]
            while found[m] < 0 and step * k <= end:
                t = step * k
                bx, by, bz = turned(axis, half_rate * (t - start), boresight)
                if sees(bx * (x + vx * t) + by * (y + vy * t) + bz * (z + vz * t), t, rr, rv, vv):
                    found[m] = k
                k += 1
            if found[m] >= 0:
                break


COMPILED = {"table": table, "vector": vector, "turning": turning}


def boresights(search, step: float) -> Array:
    """The table: boresights of group A (3, samples) from time 0 to the end of the search."""
    times = step * np.arange(int(search.duration / step) + 1)
    return np.ascontiguousarray(search.boresight(times).T)


def turns(search) -> Array:
    """The legs as rows: start, end, half of the slew rate, axis (3), boresight at the start (3)."""
    return np.array(
        [
            [leg.start, leg.end, leg.angle / (leg.end - leg.start) / 2, *leg.axis, *leg.attitude[:, 2]]
            for leg in search.legs
        ]
    )


def scan(
    way: str, looks: Array, positions: Array, velocities: Array, cosine: float, step: float, threads: int
) -> Samples:
    """First samples by a compiled way; `looks` are its `turns` or `boresights`, `cosine` the half-angle's."""
    found = np.empty(len(positions), dtype=np.int64)

    def part(first: int) -> None:
        some = slice(first, first + CHUNK)
        COMPILED[way](positions[some], velocities[some], looks, step, cosine * cosine, found[some])

    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(part, range(0, len(positions), CHUNK)))
    return found


def scan_numpy(
    looks: Array, positions: Array, velocities: Array, cosine: float, step: float, *, blocks: bool
) -> Samples:
    """First samples by NumPy, batch by batch."""
    batch = BATCH["blocks" if blocks else "numpy"]
    search = by_blocks if blocks else by_samples
    parts = [
        search(looks, positions[k : k + batch], velocities[k : k + batch], cosine, step)
        for k in range(0, len(positions), batch)
    ]
    return np.concatenate(parts)


def by_samples(looks: Array, positions: Array, velocities: Array, cosine: float, step: float) -> Samples:
    found, left = np.full(len(positions), -1), np.arange(len(positions))
    r, v = positions.T.copy(), velocities.T.copy()
    for k, boresight in enumerate(looks.T):
        p = v * (step * k)
        p += r
        far = np.einsum("ij,ij->j", p, p)
        np.sqrt(far, out=far)
        far *= cosine
        locked = boresight @ p >= far
        if locked.any():
            found[left[locked]] = k
            keep = np.flatnonzero(~locked)
            left, r, v = left[keep], r.take(keep, axis=1), v.take(keep, axis=1)
            if not len(left):
                break
    return found


def by_blocks(looks: Array, positions: Array, velocities: Array, cosine: float, step: float) -> Samples:
    found, left = np.full(len(positions), -1), np.arange(len(positions))
    times = step * np.arange(looks.shape[1])
    swept = np.ascontiguousarray(np.vstack([looks, looks * times]).T)  # b.(r + v t) = (b, b t).(r, v)
    powers = np.column_stack([np.ones_like(times), times, times * times])
    motions = np.vstack([positions.T, velocities.T])
    dots = [(positions * positions).sum(1), 2 * (positions * velocities).sum(1), (velocities**2).sum(1)]
    squares = cosine * cosine * np.stack(dots)
    for begin in range(0, len(times), SAMPLES):
        along = swept[begin : begin + SAMPLES] @ motions
        along *= np.abs(along)
        locks = along >= powers[begin : begin + SAMPLES] @ squares
        locked = locks.any(axis=0)
        if locked.any():
            found[left[locked]] = begin + locks[:, locked].argmax(axis=0)
            keep = np.flatnonzero(~locked)
            left, motions, squares = left[keep], motions.take(keep, axis=1), squares.take(keep, axis=1)
            if not len(left):
                break
    return found
