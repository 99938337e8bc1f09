"""Relative motion of two bodies in zone coordinates, under thrust or after its loss."""

from closeform._jit import kernel
from closeform.kernel_loans import stack_matrix, stack_vector
from closeform.motion.arc import derivatives_at, state_at
from closeform.motion.certified_march import locate
from closeform.planning.problem.natural_motion import add_natural, state_at_first
from closeform.planning.problem.pieces import add_piece, fill_gap


@kernel()
def row_of(scene, rows, offsets, body, t):
    """Return the row of a body's path just after time t."""
    if body < len(scene.base):
        return rows[locate(rows, offsets[body], offsets[body + 1], t)]
    body -= len(scene.base)
    first, last = scene.other_offsets[body], scene.other_offsets[body + 1]
    return scene.others[locate(scene.others, first, last, t)]


@kernel()
def add_body(scene, rows, offsets, body, t, out, sign):
    """Add `sign` times position, velocity and acceleration (rows) of a body at time t to `out`."""
    row = row_of(scene, rows, offsets, body, t)
    if len(scene.clock) == 0:
        derivatives_at(row, t, 3, out, sign)
    else:
        add_piece(scene.clock, row, t, out, sign)


@kernel()
def state_at_loss(scene, rows, offsets, body, s, state):
    """Fill `state` (6,) with the state at the first time of the drift after a loss of thrust at s."""
    row = rows[locate(rows, offsets[body], offsets[body + 1], s)]
    if len(scene.clock) == 0:
        x = state_at(row, s)
        for i in range(6):
            state[i] = x[i]
    else:
        motion = stack_matrix(3, 3)
        motion[:] = 0.0
        add_piece(scene.clock, row, s, motion, 1.0)
        for i in range(6):
            state[i] = motion[i // 3, i % 3]
    state_at_first(scene, s, state)


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
def motion_after(scene, arcs, offsets, which, t, drifts, out):
    """Fill `relative_motion` for craft without thrust for `drifts` (2,)."""
    if drifts[0] == 0.0 and drifts[1] == 0.0:
        relative_motion(scene, arcs, offsets, which, t, out)
        return
    out[:] = 0.0
    lost = stack_vector(6)
    for side in range(2):
        sign = 1.0 if side == 0 else -1.0
        body, drift = scene.pairs[which, side], drifts[side]
        if drift > 0.0:
            state_at_loss(scene, arcs, offsets, body, t - drift, lost)
            add_natural(scene, t, lost, out, sign)
        else:
            add_body(scene, arcs, offsets, body, t, out, sign)
    in_zone(scene, which, out)
