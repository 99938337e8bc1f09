"""Kernel arguments for craft with impulses and the planes that they must satisfy."""

from typing import Any, NamedTuple

import numpy as np
from numba import types

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.kernel_loans import Lent, stack_matrix, stack_vector
from closeform.motion.arc import END, START
from closeform.planning.delta_v.firing_times import Moments
from closeform.planning.problem.natural_motion import fill_flow
from closeform.planning.problem.scene import BLOCKS, INDICES, NUMBERS, ROWS, WINDOWS

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
    first and last time of the paths.  Natural motion is that of `problem.natural_motion`; primers are given
    by their values and rates c at the first time.
    """

    base: Floats  # (N, 30): a row with each craft's times and initial state
    gains: Floats  # (N, 6): of the required changes of state in terms of primers; theory (27)
    times: Floats
    along: Floats
    widths: Floats
    most: Floats
    counts: Any
    span: Floats
    directions: Floats  # (N, M, 3) of each craft's thrusters at time 0; zero: free
    numbers: Any  # (N,) of them
    spins: Floats  # (N,) [rad/s]: with which the directions turn backwards
    clock: Floats  # (3,) of a chief, or (0,)
    joints: Floats
    flows: Floats
    form: Floats  # (3, 3): W at the first time, of `effect_of`


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
        (
            *(ROWS, ROWS, ROWS, BLOCKS, ROWS, ROWS, INDICES, NUMBERS, BLOCKS, INDICES, NUMBERS),
            *(NUMBERS, NUMBERS, WINDOWS, ROWS),
        ),
        Fleet,
    )
)
PLANES = Lent(types.NamedTuple((NUMBERS, ROWS, NUMBERS, INDICES, INDICES, ROWS, NUMBERS), Planes))
DUAL = Lent(types.NamedTuple((ROWS, NUMBERS), Dual))


@kernel()
def mean_rows(fleet, t, width, psi):
    """Fill `psi` (3, 6): p(t) = Psi c at time t, or its mean over the `width` after it."""
    if not width > 0.0:
        fill_flow(fleet, t, psi)
        return
    one = stack_matrix(3, 6)
    for axis in range(3):
        for k in range(6):
            psi[axis, k] = 0.0
    for q in range(4):
        fill_flow(fleet, t + width * POINTS[q], one)
        for axis in range(3):
            for k in range(6):
                psi[axis, k] += WEIGHTS[q] * one[axis, k]


@kernel()
def effect_of(fleet, row, t, out):
    """Fill `out` (6,) with w at the first time, for which Psi w is the effect of impulses on a row.

    An impulse v changes the state by dx, seen at the first time, with Psi^T v = (dr' + W dr, -dr).  A row
    (6,) in the state at time t therefore changes by (Psi w) . v.                          # theory (27), (38)
    """
    flow, q = stack_matrix(6, 6), stack_vector(6)
    fill_flow(fleet, t, flow)
    for a in range(6):
        q[a] = 0.0
        for i in range(6):
            q[a] += row[i] * flow[i, a]
    for a in range(3):
        out[a], out[3 + a] = q[3 + a], -q[a]
        for b in range(3):
            out[3 + a] -= fleet.form[a, b] * q[3 + b]


@kernel()
def fill_effects(fleet, planes, effects):
    """Fill `effects` (K, 6) of impulses on planes."""
    for k in range(len(effects)):
        effect_of(fleet, planes.rows[k], planes.times[k], effects[k])


@kernel()
def cut_of(planes, k, i):
    """Return the time until which impulses of craft i affect plane k."""
    return planes.cuts[k, 0 if planes.first[k] == i else 1]


@kernel()
def forces(fleet, planes, effects, k, i, j, psi, out):
    """Fill `out` (3,): the effect of plane k on craft i's primer at its moment j, of mean rows `psi`.

    The plane or its cut may lie in a burn, whose later part has no effect.  An impulse is cut like a brief
    burn of constant thrust.                                                            # theory (38), (74)
    """
    t, width, part = fleet.times[i, j], fleet.widths[i, j], stack_matrix(3, 6)
    only = planes.moments[k]
    if only == only:
        for axis in range(3):
            out[axis] = planes.rows[k, 3 + axis] if only == t else 0.0
        return
    brief = BRIEF * (fleet.base[i, END] - fleet.base[i, START])
    trajectories = cut_of(planes, k, i) - t
    active = max(min(trajectories, width), 0.0)
    share = active / width if width > 0.0 else min(max(0.5 * trajectories / brief + 0.5, 0.0), 1.0)
    out[0], out[1], out[2] = 0.0, 0.0, 0.0
    if not (planes.times[k] > t and share > 0.0):
        return
    cut = active < width
    if cut:
        mean_rows(fleet, t, active, part)
    for axis in range(3):
        for a in range(6):
            out[axis] += share * (part[axis, a] if cut else psi[axis, a]) * effects[k, a]


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
