"""Primers of constant length: a lower bound on delta-v in closed form.

The bound is exact for a third of transfers of up to three orbits.

|p| is 1 throughout for thrust along the track, and where p moves on a circle in space:

    p = (0, s, 0)     or     p = (cos f / 2, -sin f, s sqrt(3)/2 cos f),   f = n t + phi, s = 1, -1

There are no others: p_x = 2 d - E cos, p_y = l - 3 d n t + 2 E sin, p_z = H cos; a constant |p|^2 has no t^2,
so d = 0, no sin, so l E = 0, and no double angle, so H^2 = 3 E^2 in phase, or E = H = 0.  With the
cross-track p = (0, 0, cos f), which is at most 1, and the best phase for each, (27) gives

    delta-v >= n max(|dd|, |dH|, |dE + sqrt(3) dH*|/2, |dE - sqrt(3) dH*|/2)                     # theory (28)

for any thrust, in Palmer's elements (dE, dH as complex numbers, at one time).
"""

from math import sqrt

from numba import float64, void

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.kernel_loans import stack_vector
from closeform.motion.minimum_delta_v.primer import gained

STEEP = sqrt(0.75)  # cross-track amplitude of the circle; its radial amplitude is a half


@kernel()
def constant_primer(n, g, c):
    """Fill `c` with the best of these primers; return its lower bound and True if |p| is constant."""
    best, constant = abs(g[1]), True
    for k in range(6):
        c[k] = 0.0
    c[1] = 1.0 if g[1] > 0.0 else -1.0
    across = sqrt(g[2] * g[2] + n * n * g[5] * g[5])
    if across > best:
        best, constant = across, False
        c[1], c[2], c[5] = 0.0, g[2] / across, n * n * g[5] / across
    for side in (-STEEP, STEEP):
        in_phase = 0.5 * g[0] + side * g[2] - n * g[4]
        ahead = -g[1] - n * (0.5 * g[3] + side * g[5])
        worth = sqrt(in_phase * in_phase + ahead * ahead)
        if worth > best and n > 0.0:
            best, constant = worth, True
            u, v = in_phase / worth, ahead / worth
            c[0], c[1], c[2] = 0.5 * u, -v, side * u
            c[3], c[4], c[5] = -0.5 * n * v, -n * u, -side * n * v
    return best, constant


@kernel(void(float64, float64[:, ::1], float64[:, ::1], float64[::1]))
def constant_bounds(n: float, arcs: Floats, finals: Floats, out: Floats) -> None:
    """Fill `out` (P,) with lower bounds on delta-v [m/s]; in deep space the norm of the velocity change."""
    g, c = stack_vector(6), stack_vector(6)
    for p in range(len(out)):
        gained(n, arcs[p], finals[p], g)
        out[p] = sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]) if n == 0.0 else constant_primer(n, g, c)[0]
