"""Lower bound on the delta-v of burns under a thrust limit, from nearly optimal primers."""

from math import inf

from numba import float64

from closeform._jit import kernel
from closeform.kernel_loans import borrowed, stack_matrix, stack_vector
from closeform.motion.costates import FREE, sum_up
from closeform.motion.linear import dot
from closeform.motion.minimum_delta_v.ascent import damped_step

CLIMBS, RISE = 60, 1e-10  # steps to a better bound, and the relative increase at which they stop
GENTLE = 1e-6  # share of Newton's matrix that is added as damping at first


@kernel(float64(float64, float64, float64[::1], float64, float64[:, ::1], float64[::1]))
def prove_burns(n, duration, g, limit, starts, proof):
    """Return the largest lower bound on delta-v under a thrust limit that the primer starts (K, 6) prove.

    `g` (6,) is the required change; `proof` (6,) receives the start that proves the bound. # theory (32)
    """
    starts = borrowed(starts)
    c, scale, gained, hessian = stack_vector(6), stack_vector(6), stack_vector(6), stack_matrix(6, 6)
    tried, step, there, work = stack_vector(6), stack_vector(6), stack_vector(6), stack_matrix(6, 6)
    sum_up(n, duration, starts[0], 0.0, 1.0, FREE, gained, hessian)
    for i in range(6):
        scale[i] = hessian[i, i]
    bound = -inf
    for k in range(len(starts)):
        for i in range(6):
            c[i] = starts[k, i]
        value = dot(g, c) - sum_up(n, duration, c, 1.0, 0.0, limit, gained, hessian)[0]
        damping = 0.0
        for i in range(6):
            damping = max(damping, GENTLE * hessian[i, i] / scale[i])
        damped = damping
        for _ in range(CLIMBS):  # Newton's step overshoots where a burn appears or vanishes
            damped_step(g, gained, hessian, scale, damping, work, step)
            for i in range(6):
                tried[i] = c[i] + step[i]
            higher = dot(g, tried) - sum_up(n, duration, tried, 1.0, 0.0, limit, there, work)[0]
            if not higher > value:
                if damping > damped / GENTLE**2:
                    break
                damping *= 10.0
                continue
            settled = damping <= damped and higher - value <= RISE * higher
            damping *= 0.1
            value = higher
            for i in range(6):
                c[i], gained[i] = tried[i], there[i]
                for j in range(6):
                    hessian[i, j] = work[i, j]
            if settled:
                break
        if value > bound:
            bound = value
            for i in range(6):
                proof[i] = c[i]
    return bound
