"""Relative motion of two bodies in zone coordinates, under thrust or after its loss."""

from closeform._jit import kernel
from closeform.motion.arc import MEAN_MOTION, acceleration, derivatives_at, state_at
from closeform.motion.certified_march import locate
from closeform.motion.hill import coast
from closeform.planning.problem.pieces import fill_gap


@kernel()
def row_of(scene, rows, offsets, body, t):
    """Return the row of a body's path just after time t."""
    if body < len(scene.base):
        return rows[locate(rows, offsets[body], offsets[body + 1], t)]
    body -= len(scene.base)
    first, last = scene.other_offsets[body], scene.other_offsets[body + 1]
    return scene.others[locate(scene.others, first, last, t)]


@kernel()
def add_body(scene, arcs, offsets, body, t, order, out, sign):
    """Add `sign` times the derivatives of a body's position at time t to `out`."""
    derivatives_at(row_of(scene, arcs, offsets, body, t), t, order, out, sign)


@kernel()
def in_zone(scene, which, out):
    """Transform the rows of a pair's relative motion to its zone's coordinates."""
    matrix = scene.matrices[scene.kinds[which]]
    for k in range(3):
        x, y, z = out[k, 0], out[k, 1], out[k, 2]
        for i in range(3):
            out[k, i] = matrix[i, 0] * x + matrix[i, 1] * y + matrix[i, 2] * z


@kernel()
def relative_motion(scene, arcs, offsets, which, t, out):
    """Fill relative position, velocity and acceleration (rows) of a pair at time t, in zone coordinates."""
    one = row_of(scene, arcs, offsets, scene.pairs[which, 0], t)
    other = row_of(scene, arcs, offsets, scene.pairs[which, 1], t)
    if len(scene.clock) == 0:
        out[:] = 0.0
        derivatives_at(one, t, 3, out, 1.0)
        derivatives_at(other, t, 3, out, -1.0)
    else:
        fill_gap(scene.clock, one, other, t, out)
    in_zone(scene, which, out)


@kernel()
def add_coasting(n, drift, state, out, sign):
    """Add `sign` times the derivatives of natural motion a `drift` after a state."""
    x, y, z, vx, vy, vz = coast(n, drift, state[0], state[1], state[2], state[3], state[4], state[5])
    ax, ay, az = acceleration(n, x, z, vx, vy)
    out[0, 0], out[0, 1], out[0, 2] = out[0, 0] + sign * x, out[0, 1] + sign * y, out[0, 2] + sign * z
    out[1, 0], out[1, 1], out[1, 2] = out[1, 0] + sign * vx, out[1, 1] + sign * vy, out[1, 2] + sign * vz
    out[2, 0], out[2, 1], out[2, 2] = out[2, 0] + sign * ax, out[2, 1] + sign * ay, out[2, 2] + sign * az


@kernel()
def motion_after(scene, arcs, offsets, which, t, drifts, out):
    """Fill `relative_motion` for craft without thrust for `drifts` (2,); a drift follows Hill's equations."""
    if drifts[0] == 0.0 and drifts[1] == 0.0:
        relative_motion(scene, arcs, offsets, which, t, out)
        return
    out[:] = 0.0
    for side in range(2):
        sign = 1.0 if side == 0 else -1.0
        body, drift = scene.pairs[which, side], drifts[side]
        if drift > 0.0:
            arc = arcs[locate(arcs, offsets[body], offsets[body + 1], t - drift)]
            add_coasting(arc[MEAN_MOTION], drift, state_at(arc, t - drift), out, sign)
        else:
            add_body(scene, arcs, offsets, body, t, 3, out, sign)
    in_zone(scene, which, out)
