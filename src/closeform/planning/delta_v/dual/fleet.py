"""Kernel arguments for craft with impulses and the planes that they must satisfy."""

from typing import Any, NamedTuple

import numpy as np
from numba import types

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.kernel_loans import Lent, stack_matrix
from closeform.motion.arc import END, MEAN_MOTION, START, STATE
from closeform.motion.hill import coast
from closeform.motion.minimum_delta_v.primer import functional, position_rows, rate_rows
from closeform.planning.delta_v.firing_times import Moments
from closeform.planning.problem.scene import BLOCKS, INDICES, NUMBERS, ROWS

# Gauss points and weights on [0, 1]: exact to rounding over a tenth of a radian.
POINTS: tuple[float, ...] = (0.06943184420297371, 0.33000947820757187)
POINTS += (0.6699905217924281, 0.9305681557970263)
WEIGHTS: tuple[float, ...] = (0.17392742256872692, 0.3260725774312731)
WEIGHTS += (0.3260725774312731, 0.17392742256872692)
BRIEF = 1e-7  # of a craft's time: half the duration of the burn that stands for an impulse


class Fleet(NamedTuple):
    """N craft that fire at some of their moments: base arcs, final states, moments and directions.

    `times` (N, J) are in order, the first `counts` (N,) of each valid.  An impulse is along the unit vector
    `along` (N, J, 3), or free in direction where that is zero.  Where `widths` (N, J) [s] are positive, it is
    a burn of constant thrust that begins at its time, of at most `most` (N, J) [m/s].  `span` (2,) are the
    first and last time of the paths.
    """

    base: Floats  # (N, 21): a row with each craft's times and initial state
    finals: Floats  # (N, 6)
    times: Floats
    along: Floats
    widths: Floats
    most: Floats
    counts: Any
    span: Floats
    directions: Floats  # (N, M, 3) of each craft's thrusters at time 0; zero: free
    numbers: Any  # (N,) of them
    spins: Floats  # (N,) [rad/s]: with which the directions turn backwards


class Planes(NamedTuple):
    """K planes: times, rows (K, 6) [1/m, s/m] in the state, shortfalls of unforced paths, and bodies.

    `first` and `second` (K,) are craft that are still controllable, or -1.  Impulses from the `cuts` (K, 2)
    on have no effect: after a loss of thrust the cut is earlier than the plane's time.  Where `moments` (K,)
    is a time instead of nan, the plane restricts the thrust of that one moment, by its row in the velocity.
    """

    times: Floats
    rows: Floats
    misses: Floats
    first: Any
    second: Any
    cuts: Floats
    moments: Floats

    @classmethod
    def room(cls, count: int) -> "Planes":
        """Return empty arrays for `count` planes."""
        (times, misses), (first, second) = np.empty((2, count)), np.empty((2, count), dtype=np.int64)
        cuts, moments = np.empty((count, 2)), np.full(count, np.nan)
        return cls(times, np.zeros((count, 6)), misses, first, second, cuts, moments)

    def some(self, chosen: Any) -> "Planes":
        """Return the planes in a mask."""
        return Planes(*(column[chosen] for column in self))

    def joined(self, *others: "Planes") -> "Planes":
        """Return these planes followed by the others."""
        return Planes(*map(np.concatenate, zip(self, *others, strict=True)))


class Dual(NamedTuple):
    """Point of the dual: primers as natural motions, and the multipliers of the planes."""

    starts: Floats  # (N, 6): c of each craft
    multipliers: Floats  # (K,)


class Priced(NamedTuple):
    """Solution of the dual: cost, multipliers, impulses, and maxima of the primers."""

    cost: float  # [m/s]
    multipliers: Floats  # (K,)
    impulses: Floats  # (N, J, 3)
    longest: float
    least: float  # [m/s]: certified lower bound for these planes and any firing times
    peaks: list[Moments]


FLEET = Lent(
    types.NamedTuple(
        (ROWS, ROWS, ROWS, BLOCKS, ROWS, ROWS, INDICES, NUMBERS, BLOCKS, INDICES, NUMBERS), Fleet
    )
)
PLANES = Lent(types.NamedTuple((NUMBERS, ROWS, NUMBERS, INDICES, INDICES, ROWS, NUMBERS), Planes))
DUAL = Lent(types.NamedTuple((ROWS, NUMBERS), Dual))


@kernel()
def gain(fleet, i, g):
    """Fill `g` (6,) with the gradient of the dual with respect to a craft's primer; theory (27)."""
    n, t = fleet.base[i, MEAN_MOTION], fleet.base[i, END] - fleet.base[i, START]
    f = fleet.finals[i]
    x, y, z, vx, vy, vz = coast(n, -t, f[0], f[1], f[2], f[3], f[4], f[5])
    b = fleet.base[i, STATE : STATE + 6]
    functional(n, x - b[0], y - b[1], z - b[2], vx - b[3], vy - b[4], vz - b[5], g)


@kernel()
def mean_rows(n, t, width, psi, rates=False):
    """Fill `psi` (3, 6): Psi at time t, or its mean over the `width` after it; or else its `rates`."""
    one = stack_matrix(3, 6)
    for axis in range(3):
        for k in range(6):
            psi[axis, k] = 0.0
    for q in range(4 if width > 0.0 else 1):
        at, weight = t + width * POINTS[q], WEIGHTS[q] if width > 0.0 else 1.0
        if rates:
            rate_rows(n, at, one)
        else:
            position_rows(n, at, one)
        for axis in range(3):
            for k in range(6):
                psi[axis, k] += weight * one[axis, k]


@kernel()
def cut_of(planes, k, i):
    """Return the time until which impulses of craft i affect plane k."""
    return planes.cuts[k, 0 if planes.first[k] == i else 1]


@kernel()
def forces(fleet, planes, k, i, j, psi, out):
    """Fill `out` (3,): Phi_v(dt)^T a, the effect of plane k on craft i's primer at its moment j.

    It is the mean over a burn, in which the plane or its cut may lie.  An impulse is cut like a brief burn of
    constant thrust.                                                                    # theory (38), (74)
    """
    n, t, width = fleet.base[i, MEAN_MOTION], fleet.times[i, j], fleet.widths[i, j]
    only = planes.moments[k]
    if only == only:
        for axis in range(3):
            out[axis] = planes.rows[k, 3 + axis] if only == t else 0.0
        return
    brief = BRIEF * (fleet.base[i, END] - fleet.base[i, START])
    dt, flown, row = planes.times[k] - t, cut_of(planes, k, i) - t, planes.rows[k]
    active = max(min(flown, width), 0.0)
    share = active / width if width > 0.0 else min(max(0.5 * flown / brief + 0.5, 0.0), 1.0)
    if not (dt > 0.0 and share > 0.0):
        out[0], out[1], out[2] = 0.0, 0.0, 0.0
        return
    mean_rows(n, dt - active, active, psi)
    for axis in range(3):
        out[axis] = share * (
            psi[0, 3 + axis] * row[0] + psi[1, 3 + axis] * row[1] + psi[2, 3 + axis] * row[2]
        )
    if row[3] != 0.0 or row[4] != 0.0 or row[5] != 0.0:
        mean_rows(n, dt - active, active, psi, True)
        for axis in range(3):
            out[axis] += share * (
                psi[0, 3 + axis] * row[3] + psi[1, 3 + axis] * row[4] + psi[2, 3 + axis] * row[5]
            )


@kernel()
def is_free(along):
    """Return whether an impulse may have any direction."""
    return along[0] == 0.0 and along[1] == 0.0 and along[2] == 0.0


@kernel()
def project(along, psi):
    """Project `psi` (3, 6) onto the direction of an impulse, if that is fixed."""
    if is_free(along):
        return
    for a in range(6):
        share = along[0] * psi[0, a] + along[1] * psi[1, a] + along[2] * psi[2, a]
        for axis in range(3):
            psi[axis, a] = along[axis] * share


@kernel()
def coast_state(n, t, s, out):
    """Fill `out` (6,) with the state `s` after time t; both may be the same array."""
    x, y, z, vx, vy, vz = coast(n, t, s[0], s[1], s[2], s[3], s[4], s[5])
    out[0], out[1], out[2], out[3], out[4], out[5] = x, y, z, vx, vy, vz
