"""Arcs: natural or thrusted motion over a time interval, each stored as one row of floats.

A row holds the times of the arc, its mean motion, the impulse at its start, the state after that impulse,
the optimal thrust and its rate at the start, and a prescribed thrust.  Along each axis the prescribed thrust
is a combination of the four functions of order 4 below, given by its first four derivatives at the start:
the first alone for thrust that is constant in the rotating frame, cos nt and sin nt for thrust that is
constant in inertial space, and several short arcs for saturated thrust.  The row stores derivatives because
coefficients in a fixed basis cancel as n t -> 0.

The conflict search represents an arc by the derivatives of its position at one instant.
Per axis the position is the sum of `derivative k` times a function that is t^k/k! at n = 0:

    natural motion (order 4)   1, t, P_1 = (1 - cos nt)/n^2, P_2 = (nt - sin nt)/n^3
    with thrust    (order 8)   1, t, t^2/2, t^3/6, and four that solve D^4 (D^2 + n^2)^2 f = 0

Both function spaces are closed under differences, shifts in time and d/dt, so the relative motion of
two spacecraft is again such an arc.                                # theory 2, "closure"
"""

from closeform._jit import kernel
from closeform.motion.hill import coast, driven, oscillation, pushed

START, END, MEAN_MOTION = 0, 1, 2
IMPULSE, STATE, THRUST, PUSH = 3, 6, 12, 18  # first column of 3, 6, 6 and 12
WIDTH = 30

# The expansion of an arc with thrust is renewed every ANGLE of n t; the bounds of `certified_march` hold up
# to 1.
ANGLE = 1.0


@kernel()
def thrusts(arc):
    """Return True if any thrust acts along the arc."""
    for k in range(THRUST, WIDTH):
        if arc[k] != 0.0:
            return True
    return False


@kernel()
def has_primer(arc):
    """Return True if an optimal thrust acts along the arc."""
    for k in range(THRUST, PUSH):
        if arc[k] != 0.0:
            return True
    return False


@kernel()
def pushes(arc):
    """Return True if a prescribed thrust acts along the arc."""
    for k in range(PUSH, WIDTH):
        if arc[k] != 0.0:
            return True
    return False


@kernel()
def is_cubic(arc):
    """Return True if the position is a cubic of time: in deep space, under thrust that is linear in time."""
    if arc[MEAN_MOTION] != 0.0:
        return False
    for k in range(PUSH + 3, WIDTH):
        if arc[k] != 0.0:
            return False
    return True


@kernel()
def state_at(arc, t):
    """Return the state at time t (absolute, within the arc)."""
    dt = t - arc[START]
    n = arc[MEAN_MOTION]
    x, y, z, vx, vy, vz = arc[6], arc[7], arc[8], arc[9], arc[10], arc[11]
    if dt != 0.0:
        x, y, z, vx, vy, vz = coast(n, dt, x, y, z, vx, vy, vz)
        if has_primer(arc):
            fx, fy, fz, gx, gy, gz = driven(n, dt, arc[12], arc[13], arc[14], arc[15], arc[16], arc[17])
            x, y, z, vx, vy, vz = x + fx, y + fy, z + fz, vx + gx, vy + gy, vz + gz
        if pushes(arc):
            fx, fy, fz, gx, gy, gz = pushed(n, dt, arc, PUSH)
            x, y, z, vx, vy, vz = x + fx, y + fy, z + fz, vx + gx, vy + gy, vz + gz
    return x, y, z, vx, vy, vz


@kernel()
def primer_at(arc, t):
    """Return the optimal thrust and its rate at time t; both follow natural motion."""
    return coast(arc[MEAN_MOTION], t - arc[START], arc[12], arc[13], arc[14], arc[15], arc[16], arc[17])


@kernel()
def push_at(arc, axis, t):
    """Return the prescribed thrust along one axis at time t, and its first three derivatives."""
    n = arc[MEAN_MOTION]
    p0, p1, p2 = oscillation(n, t - arc[START])
    k = PUSH + axis
    c = 1.0 - n * n * p1
    bend, twist = arc[k + 6] * c + arc[k + 9] * p0, arc[k + 9] * c - n * n * arc[k + 6] * p0
    rate = arc[k + 3] + arc[k + 6] * p0 + arc[k + 9] * p1
    return arc[k] + arc[k + 3] * (t - arc[START]) + arc[k + 6] * p1 + arc[k + 9] * p2, rate, bend, twist


@kernel()
def acceleration(n, x, z, vx, vy):
    """Return the acceleration of natural motion by Hill's equations."""
    return 3.0 * n * n * x + 2.0 * n * vy, -2.0 * n * vx, -n * n * z


@kernel()
def derivatives_at(arc, t, order, out, sign):
    """Add `sign` times the first `order` derivatives of the position at time t to `out` (8, 3)."""
    n = arc[MEAN_MOTION]
    x, y, z, vx, vy, vz = state_at(arc, t)
    ux, uy, uz, wx, wy, wz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if has_primer(arc):
        ux, uy, uz, wx, wy, wz = primer_at(arc, t)
    push = pushes(arc)
    px = py = pz = qx = qy = qz = bx = by = bz = cx = cy = cz = 0.0
    if push:
        px, qx, bx, cx = push_at(arc, 0, t)
        py, qy, by, cy = push_at(arc, 1, t)
        pz, qz, bz, cz = push_at(arc, 2, t)
    k = 0
    while True:
        out[k, 0] += sign * x
        out[k, 1] += sign * y
        out[k, 2] += sign * z
        if k == order - 1:
            return
        ax, ay, az = acceleration(n, x, z, vx, vy)
        x, y, z, vx, vy, vz = vx, vy, vz, ax + ux + px, ay + uy + py, az + uz + pz
        ax, ay, az = acceleration(n, ux, uz, wx, wy)
        ux, uy, uz, wx, wy, wz = wx, wy, wz, ax, ay, az
        if push:
            px, qx, bx, cx = qx, bx, cx, -n * n * bx
            py, qy, by, cy = qy, by, cy, -n * n * by
            pz, qz, bz, cz = qz, bz, cz, -n * n * bz
        k += 1
