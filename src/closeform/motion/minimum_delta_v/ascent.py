"""Newton's method on the dual of transfers under a thrust limit (see `costates`)."""

from math import inf, sqrt

from closeform._jit import kernel
from closeform.kernel_loans import stack_matrix, stack_vector
from closeform.motion.costates import sum_up
from closeform.motion.linear import back_substitute, dot, factorise

DONE, IMPOSSIBLE, STUCK = 0, 1, 2
STEPS = 60
BEYOND = 1e-12  # share of the integral of |p|: a smaller excess is rounding and no proof
SETTLED, ROUNDING = 1e-12, 3e-15  # shares of the impulse to be gained
SHARP = 2e-7  # accepted excess of delta-v over its bound as e falls: thrust is (|p| - 1)/e, and rounds
FIRST, STEEPEST, TRIES = 0.1, 0.03, 40  # factors of e, first and least, and attempts


@kernel()
def distance(g, gained, scale):
    """Return the weighted norm of g - gained, in which the six numbers have equal weight."""
    total = 0.0
    for k in range(6):
        rest = g[k] - gained[k]
        total += rest * rest / scale[k]
    return sqrt(total)


@kernel()
def damped_step(g, gained, hessian, scale, damping, work, step):
    """Fill `step` with Newton's step for `hessian` plus `damping` times `scale` on its diagonal."""
    for i in range(6):
        for j in range(i, 6):
            work[i, j] = hessian[i, j]
        work[i, i] += damping * scale[i]
        step[i] = g[i] - gained[i]
    factorise(work, 6)
    back_substitute(work, step, 6)


@kernel()
def downhill(g, gained, hessian, scale, work, step):
    """Fill `step` with Newton's step for a `hessian` that is made definite; return the slope along it."""
    most = 0.0
    for i in range(6):
        most = max(most, hessian[i, i] / scale[i])
    damping = 1e-15 * most
    while True:
        damped_step(g, gained, hessian, scale, damping, work, step)
        slope = dot(g, step) - dot(gained, step)
        if slope > 0.0 or damping > 1e3 * most or most == 0.0:
            return slope
        damping *= 100.0


@kernel()
def climb(n, duration, g, scale, c, low, e, limit, gained, hessian):
    """Maximise the dual from `c`, in place; fill `gained` and `hessian` at its final value.

    Returns DONE, IMPOSSIBLE (proven by `c`, theory (33)) or STUCK; the value of the dual; the integral of
    |u|; and the integral of |p|.
    """
    work, step, trial = stack_matrix(6, 6), stack_vector(6), stack_vector(6)
    new_gained, new_hessian = stack_vector(6), stack_matrix(6, 6)
    total, length, spent, _ = sum_up(n, duration, c, low, e, limit, gained, hessian)
    value = dot(g, c) - total
    aim = 0.0
    for k in range(6):
        aim += g[k] * g[k] / scale[k]
    # thrust of size (|p| - 1) / e rounds more as e falls
    aim = sqrt(aim) * (SETTLED if low == 0.0 or e == 0.0 else SETTLED + ROUNDING * duration / (e * spent))
    for _ in range(STEPS):
        off = distance(g, gained, scale)
        if off <= aim:
            return DONE, value, spent, length
        if dot(g, c) > limit * length * (1.0 + BEYOND):
            return IMPOSSIBLE, value, spent, length
        slope = downhill(g, gained, hessian, scale, work, step)
        if not 0.0 < slope < inf:
            return (DONE if off <= 1e4 * aim else STUCK), value, spent, length
        share = 1.0
        while True:
            for k in range(6):
                trial[k] = c[k] + share * step[k]
            total, new_length, new_spent, _ = sum_up(
                n, duration, trial, low, e, limit, new_gained, new_hessian
            )
            new_value = dot(g, trial) - total
            near = distance(g, new_gained, scale)
            if new_value >= value + 1e-4 * share * slope or (share == 1.0 and near < 0.9 * off):
                break
            share *= 0.5
            if share < 1e-7:
                return (DONE if off <= 1e4 * aim else STUCK), value, spent, length
        value, spent, length = new_value, new_spent, new_length
        for k in range(6):
            c[k], gained[k] = trial[k], new_gained[k]
            for j in range(6):
                hessian[k, j] = new_hessian[k, j]
    return STUCK, value, spent, length


@kernel()
def sharpen(n, duration, g, scale, c, limit, spent, gained, hessian, proof):
    """Follow the optimum from the start `c` of minimum energy to that of minimum delta-v as e falls.

    Returns DONE or STUCK, the final e (0 where thrust is full or zero), a lower bound on delta-v, and the
    integral of |u|. `proof` (6,) receives the start of the primer that proves the bound.
    """
    kept, slope = stack_vector(6), stack_vector(6)
    mean = spent / duration
    e, fresh, factor, bound = 0.0, 10.0 / mean, FIRST, 0.0
    for k in range(6):
        kept[k], slope[k] = c[k] * (fresh + 1.0 / mean), c[k]
    for _ in range(TRIES):
        status, _, found, _ = climb(n, duration, g, scale, kept, 1.0, fresh, limit, gained, hessian)
        if status == DONE:
            for k in range(6):
                if e > 0.0:
                    slope[k] = (kept[k] - c[k]) / (fresh - e)
                c[k] = kept[k]
            e, spent = fresh, found
            factor = max(STEEPEST, factor * factor)
            for k in range(6):  # extrapolate to e = 0
                kept[k] = c[k] - e * slope[k]
            value = dot(g, kept) - sum_up(n, duration, kept, 1.0, 0.0, limit, gained, hessian)[0]
            if value > bound:
                bound = value
                for k in range(6):
                    proof[k] = kept[k]
            if spent <= bound * (1.0 + SHARP):
                break
        else:
            factor = sqrt(factor)
        fresh = e * factor
        for k in range(6):
            kept[k] = c[k] + (fresh - e) * slope[k]
    if not spent <= bound * (1.0 + SHARP):
        return STUCK, e, bound, spent
    status, value, found, _ = climb(n, duration, g, scale, kept, 1.0, 0.0, limit, gained, hessian)
    if status == DONE:
        for k in range(6):
            c[k] = proof[k] = kept[k]
        return DONE, 0.0, value, found
    sum_up(n, duration, c, 1.0, e, limit, gained, hessian)
    return DONE, e, bound, spent


@kernel()
def least_limit(n, duration, g, scale, c, least, close):
    """Return bounds on the smallest feasible thrust limit, below and above, relatively `close` to each other.

    On entry `c` proves by theory (33) that the limit exceeds `least`; on return `c` proves the lower bound.
    """
    kept, gained, hessian = stack_vector(6), stack_vector(6), stack_matrix(6, 6)
    for k in range(6):
        kept[k] = c[k]
    enough, share = inf, 0.02
    for _ in range(60):
        if enough < inf and enough - least <= close * enough:
            break
        limit = least + share * (enough - least) if enough < inf else 1.05 * least
        status, _, _, length = climb(n, duration, g, scale, kept, 0.0, 1.0, limit, gained, hessian)
        found = dot(g, kept) / length
        if found > least:
            least = found
            for k in range(6):
                c[k] = kept[k]
        if status == DONE:
            enough = limit
        elif status == STUCK:
            share = 0.5
            for k in range(6):
                kept[k] = c[k]
    return least, enough
