"""Natural motion from a problem's first time: Hill's closed forms, or a chief's table as polynomials.

Kernels read it from anything with these fields, a `Scene` or a `Fleet`: `base`, whose arcs hold the mean
motion, `span`, which begins with the first time, and `clock`, `joints` and `flows`.  For Hill's equations the
last three are empty.  Beside any chief `joints` (W + 1,) are the angles of windows, and `flows`
(W, 6, 6, 12) the coefficients in them of the transition matrix from the first time.
"""

from typing import Any

import numpy as np

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.kernel_loans import stack_matrix, stack_vector
from closeform.motion.arc import MEAN_MOTION, acceleration
from closeform.motion.chief.bernstein import TERMS, value_at, weights
from closeform.motion.chief.clock import RATE, angle_at, pace
from closeform.motion.chief.impulses import primer_rows
from closeform.motion.chief.segments import FIRST, LAST, window_at
from closeform.motion.chief_orbit import ChiefOrbit
from closeform.motion.hill import coast
from closeform.motion.linear import solve
from closeform.motion.minimum_delta_v.primer import position_rows, rate_rows


def windows_of(orbit: Any, first: float, last: float) -> tuple[Floats, Floats]:
    """Return `joints` and `flows` of natural motion between two times, empty for Hill's equations."""
    if not isinstance(orbit, ChiefOrbit):
        return np.empty(0), np.empty((0, 6, 6, TERMS))
    segments, _ = orbit._segments(orbit.coast(np.zeros(6), last - first, first).arcs, np.array([0, 1]))
    rows, whole = np.empty((len(segments), 6, 6, TERMS)), np.empty((6, 6))
    primer_rows(orbit.chief.table.form, segments, rows, whole)
    unit = np.repeat([1.0, orbit._rate], 3)
    back = np.linalg.inv(rows[0, :, :, 0])  # the rows begin with the window of the first time
    flows = np.einsum("wijb,jk->wikb", rows, back) * unit[:, None, None] / unit[:, None]
    return np.append(segments[:, FIRST], segments[-1, LAST]), np.ascontiguousarray(flows)


@kernel()
def rate_of(scene):
    """Return the mean rate of the chief's motion [rad/s]."""
    return scene.base[0, MEAN_MOTION] if len(scene.clock) == 0 else scene.clock[RATE]


@kernel()
def fill_flow(scene, t, out):
    """Fill `out` (3, 6) or (6, 6) with the first rows of the transition matrix from the first time to t."""
    if len(scene.clock) == 0:
        n, passed = scene.base[0, MEAN_MOTION], t - scene.span[0]
        position_rows(n, passed, out)
        if len(out) == 6:
            rate_rows(n, passed, out[3:])
        return
    s = angle_at(scene.clock, t)
    w, basis = window_at(scene.joints, 0.0, s)[0], stack_vector(12)
    low, high = scene.joints[w], scene.joints[w + 1]
    weights(min(max((s - low) / (high - low), 0.0), 1.0), basis)
    for i in range(len(out)):
        for j in range(6):
            total = 0.0
            for b in range(TERMS):
                total += basis[b] * scene.flows[w, i, j, b]
            out[i, j] = total


@kernel()
def state_at_first(scene, t, state):
    """Replace a state (6,) at time t by the state at the first time."""
    if len(scene.clock) == 0:
        n, passed = scene.base[0, MEAN_MOTION], scene.span[0] - t
        x, y, z, vx, vy, vz = coast(n, passed, state[0], state[1], state[2], state[3], state[4], state[5])
        state[0], state[1], state[2], state[3], state[4], state[5] = x, y, z, vx, vy, vz
        return
    flow = stack_matrix(6, 6)
    fill_flow(scene, t, flow)
    solve(flow, state, 6)


@kernel()
def state_after(scene, t, until, state):
    """Replace a state (6,) at time t by the state at time `until` of natural motion."""
    if until == t:
        return
    if len(scene.clock) == 0:
        n = scene.base[0, MEAN_MOTION]
        x, y, z, vx, vy, vz = coast(n, until - t, state[0], state[1], state[2], state[3], state[4], state[5])
        state[0], state[1], state[2], state[3], state[4], state[5] = x, y, z, vx, vy, vz
        return
    flow, begun = stack_matrix(6, 6), stack_vector(6)
    state_at_first(scene, t, state)
    fill_flow(scene, until, flow)
    for i in range(6):
        begun[i] = state[i]
    for i in range(6):
        state[i] = 0.0
        for j in range(6):
            state[i] += flow[i, j] * begun[j]


@kernel()
def add_natural(scene, t, begun, out, sign):
    """Add `sign` times position, velocity and acceleration (rows) at time t of a state at the first time."""
    if len(scene.clock) == 0:
        n = scene.base[0, MEAN_MOTION]
        moved = coast(n, t - scene.span[0], begun[0], begun[1], begun[2], begun[3], begun[4], begun[5])
        bend = acceleration(n, moved[0], moved[2], moved[3], moved[4])
        for i in range(3):
            out[0, i] += sign * moved[i]
            out[1, i] += sign * moved[3 + i]
            out[2, i] += sign * bend[i]
        return
    s, line = angle_at(scene.clock, t), stack_vector(12)
    w = window_at(scene.joints, 0.0, s)[0]
    low, high = scene.joints[w], scene.joints[w + 1]
    u = min(max((s - low) / (high - low), 0.0), 1.0)
    speed = scene.clock[RATE] / (pace(scene.clock, s) * (high - low))  # du/dt
    for i in range(6):
        for b in range(TERMS):
            line[b] = 0.0
            for j in range(6):
                line[b] += scene.flows[w, i, j, b] * begun[j]
        value, slope = value_at(line, TERMS, u)
        out[i // 3, i % 3] += sign * value
        if i >= 3:
            out[2, i - 3] += sign * slope * speed
