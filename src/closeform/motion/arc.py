"""An arc: natural, optimal or constant-thrust motion, stored as one row of floats.

A row holds the arc's times, its mean motion, the impulse at its start, the state after that
impulse, the optimal thrust and its rate at the start, and a thrust constant in the rotating
frame.  Coefficients of a basis are never stored: they cancel as n t -> 0.

For the search of conflicts an arc is seen as derivatives of its position at one instant.
Per axis it is the sum of `derivative k` times a function that is t^k/k! at n = 0:

    natural motion (order 4)   1, t, (1 - cos nt)/n^2, (nt - sin nt)/n^3
    with thrust    (order 8)   1, t, t^2/2, t^3/6, and four that solve D^4 (D^2 + n^2)^2 f = 0

Both spans are closed under differences, shifts in time and d/dt, so the relative motion of
any two craft is one such arc again.                                # theory 2, "closure"
"""

from closeform.compiled import kernel
from closeform.motion.hill import coast, driven, pushed

START, END, MEAN_MOTION = 0, 1, 2
IMPULSE, STATE, THRUST, CONSTANT = 3, 6, 12, 18  # first column of 3, 6, 6 and 3
WIDTH = 21

# An arc with thrust is seen anew every ANGLE of n t; the bounds of `march` hold up to 1.
ANGLE = 1.0


@kernel()
def thrusts(arc):
    """Whether any thrust acts along the arc."""
    for k in range(THRUST, WIDTH):
        if arc[k] != 0.0:
            return True
    return False


@kernel()
def has_primer(arc):
    """Whether an optimal thrust acts along the arc."""
    for k in range(THRUST, CONSTANT):
        if arc[k] != 0.0:
            return True
    return False


@kernel()
def pushes(arc):
    """Whether a constant thrust acts along the arc."""
    return arc[CONSTANT] != 0.0 or arc[CONSTANT + 1] != 0.0 or arc[CONSTANT + 2] != 0.0


@kernel()
def state_at(arc, t):
    """State at time t (absolute, within the arc)."""
    dt = t - arc[START]
    n = arc[MEAN_MOTION]
    x, y, z, vx, vy, vz = arc[6], arc[7], arc[8], arc[9], arc[10], arc[11]
    if dt != 0.0:
        x, y, z, vx, vy, vz = coast(n, dt, x, y, z, vx, vy, vz)
        if has_primer(arc):
            fx, fy, fz, gx, gy, gz = driven(n, dt, arc[12], arc[13], arc[14], arc[15], arc[16], arc[17])
            x, y, z, vx, vy, vz = x + fx, y + fy, z + fz, vx + gx, vy + gy, vz + gz
        if pushes(arc):
            fx, fy, fz, gx, gy, gz = pushed(n, dt, arc[18], arc[19], arc[20])
            x, y, z, vx, vy, vz = x + fx, y + fy, z + fz, vx + gx, vy + gy, vz + gz
    return x, y, z, vx, vy, vz


@kernel()
def primer_at(arc, t):
    """Optimal thrust and its rate at time t: itself a natural motion."""
    return coast(arc[MEAN_MOTION], t - arc[START], arc[12], arc[13], arc[14], arc[15], arc[16], arc[17])


@kernel()
def acceleration(n, x, z, vx, vy):
    """Hill's acceleration without thrust."""
    return 3.0 * n * n * x + 2.0 * n * vy, -2.0 * n * vx, -n * n * z


@kernel()
def derivatives_at(arc, t, order, out, sign):
    """Add `sign` times the first `order` derivatives of the position at time t to `out` (8, 3)."""
    n = arc[MEAN_MOTION]
    x, y, z, vx, vy, vz = state_at(arc, t)
    ux, uy, uz, wx, wy, wz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if has_primer(arc):
        ux, uy, uz, wx, wy, wz = primer_at(arc, t)
    px, py, pz = arc[CONSTANT], arc[CONSTANT + 1], arc[CONSTANT + 2]  # acts on the second only
    k = 0
    while True:
        out[k, 0] += sign * x
        out[k, 1] += sign * y
        out[k, 2] += sign * z
        if k == order - 1:
            return
        ax, ay, az = acceleration(n, x, z, vx, vy)
        x, y, z, vx, vy, vz = vx, vy, vz, ax + ux + px, ay + uy + py, az + uz + pz
        bx, by, bz = acceleration(n, ux, uz, wx, wy)
        ux, uy, uz, wx, wy, wz = wx, wy, wz, bx, by, bz
        px = py = pz = 0.0
        k += 1
