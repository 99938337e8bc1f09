"""Primers of craft as rows: their values at each moment in terms of the dual's unknowns."""

from math import inf, sqrt

from closeform._jit import kernel
from closeform.kernel_loans import stack_matrix, stack_vector
from closeform.motion.linear import triangle
from closeform.planning.delta_v.dual.fleet import forces, is_free, mean_rows

REACHED = 1e-9  # of the gain: tolerance of its consistency
FIRST_PULL = 0.3  # initial length of a primer from the planes alone


@kernel()
def fill_members(planes, members, sizes):
    """Fill the planes of each craft (N, K), and their number; return the largest number."""
    widest = 0
    for i in range(len(sizes)):
        sizes[i] = 0
    for k in range(len(planes.times)):
        for side in range(2):
            i = planes.first[k] if side == 0 else planes.second[k]
            if i >= 0:
                members[i, sizes[i]] = k
                sizes[i] += 1
                widest = max(widest, sizes[i])
    return widest


@kernel()
def fill_rows(fleet, planes, effects, i, members, size, rows):
    """Fill `rows` (J, 3, 6 + M): the primer of a craft at each moment in terms of c and its multipliers.

    Where the impulse has a fixed direction, the first of the three is the primer along it, the others are 0.
    """
    psi, pushed = stack_matrix(3, 6), stack_vector(3)
    for j in range(fleet.counts[i]):
        mean_rows(fleet, fleet.times[i, j], fleet.widths[i, j], psi)
        for axis in range(3):
            for k in range(6):
                rows[j, axis, k] = psi[axis, k]
        for m in range(size):
            k = members[m]
            sign = 1.0 if planes.first[k] == i else -1.0
            forces(fleet, planes, effects, k, i, j, psi, pushed)
            for axis in range(3):
                rows[j, axis, 6 + m] = sign * pushed[axis]
        along = fleet.along[i, j]
        if not is_free(along):
            for k in range(6 + size):
                x, y, z = rows[j, 0, k], rows[j, 1, k], rows[j, 2, k]
                rows[j, 0, k] = along[0] * x + along[1] * y + along[2] * z
                rows[j, 1, k] = rows[j, 2, k] = 0.0


@kernel()
def normalise(rows, count, g, root):
    """Orthonormalise the first six columns over the times, and adapt the gain; fill the `root` (6, 6).

    A dependent column, where thrusters do not control all components, becomes zero.  Returns False where its
    gain is inconsistent with the others', so that no impulses achieve it.
    """
    for a in range(6):
        for b in range(a + 1):
            total = 0.0
            for j in range(count):
                for axis in range(3):
                    total += rows[j, axis, a] * rows[j, axis, b]
            root[a, b] = total / count
    triangle(root, 6)
    for a in range(6):
        size = abs(g[a])
        for b in range(a):
            g[a] -= root[a, b] * g[b]
            size += abs(root[a, b] * g[b])
        if root[a, a] == inf and abs(g[a]) > REACHED * size:
            return False
        g[a] /= root[a, a]
        for j in range(count):
            for axis in range(3):
                for b in range(a):
                    rows[j, axis, a] -= root[a, b] * rows[j, axis, b]
                rows[j, axis, a] /= root[a, a]
    return True


@kernel()
def begin(rows, count, members, size, multipliers):
    """Lower a craft's multipliers so that its planes alone give short primers."""
    for m in range(size):
        greatest = 0.0
        for j in range(count):
            square = 0.0
            for axis in range(3):
                square += rows[j, axis, 6 + m] ** 2
            greatest = max(greatest, square)
        if greatest > 0.0:
            k = members[m]
            multipliers[k] = min(multipliers[k], FIRST_PULL / (size * sqrt(greatest)))
