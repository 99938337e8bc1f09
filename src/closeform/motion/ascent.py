"""Newton's method on the dual of transfers under a thrust limit (see `costates`)."""

from math import inf, sqrt

from closeform._jit import kernel
from closeform.kernel_loans import stack_matrix, stack_vector
from closeform.motion.costates import sum_up
from closeform.motion.linear import back_substitute, dot, factorise

DONE, IMPOSSIBLE, STUCK = 0, 1, 2
STEPS = 60
BEYOND = 1e-12  # of the integral of |p|: less is rounding, and no proof
SETTLED, ROUNDING = 1e-12, 3e-15  # of what is to be gained
SHARP = 2e-7  # by so much delta-v may be above its bound while e falls: thrust is (|p| - 1)/e, and rounds
FIRST, STEEPEST, TRIES = 0.1, 0.03, 40  # by how much e falls at first and at most, and how often


@kernel()
def distance(g, gained, scale):
    """What is still to be gained, in units in which each number weighs the same."""
    total = 0.0
    for k in range(6):
        rest = g[k] - gained[k]
        total += rest * rest / scale[k]
    return sqrt(total)


@kernel()
def damped_step(g, gained, hessian, scale, damping, work, step):
    """Fill `step` with Newton's, of a `hessian` to which so much of the scales is added."""
    for i in range(6):
        for j in range(i, 6):
            work[i, j] = hessian[i, j]
        work[i, i] += damping * scale[i]
        step[i] = g[i] - gained[i]
    factorise(work, 6)
    back_substitute(work, step, 6)


@kernel()
def downhill(g, gained, hessian, scale, work, step):
    """Fill `step` with Newton's, of a `hessian` that is made definite; returns the slope along it."""
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
    """Climb from `c` to the greatest of the dual; `gained` and `hessian` are those of where it ends.

    Returns DONE, IMPOSSIBLE (by theory (33), which `c` then proves) or STUCK; the dual's value; the
    integral of |u|; and that of |p|.
    """
    work, step, trial = stack_matrix(6, 6), stack_vector(6), stack_vector(6)
    new_gained, new_hessian = stack_vector(6), stack_matrix(6, 6)
    total, length, spent, _ = sum_up(n, duration, c, low, e, limit, gained, hessian)
    value = dot(g, c) - total
    aim = 0.0
    for k in range(6):
        aim += g[k] * g[k] / scale[k]
    # thrust of size (|p| - 1) / e rounds by more the smaller e
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
    """From the start `c` of least energy to that of least delta-v, by smaller and smaller e.

    Returns DONE or STUCK, the e that it ends with (0 where thrust is full or none), a lower bound
    of delta-v, which `proof` (6,) is the start of a primer to prove, and the integral of |u|.
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
            for k in range(6):  # as far as it goes straight on
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
    """Two bounds of the least limit that makes a transfer, `close` to each other, relatively.

    `c` proves that it is more than `least` by theory (33), and ends as what proves the lower bound.
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
