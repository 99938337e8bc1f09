"""The best plane beside a kink of a zone's norm, by a small linear program.

Where faces meet, none of their planes keeps what a cell spans as far away as it is.  That is the mix with
shares l_k of normals g_k for which the parallelotope of centre c and edges e_j is farthest at its worst,

    max sum l_k g_k.c - sum |w_j| / 2,   w_j = sum l_k g_k.e_j,   sum l_k = 1,   l >= 0       # theory (47a)

the least norm in the parallelotope.  Its multipliers are a point, at which the steepest part of the norm
is the next to be mixed in, round ones with the gradient that they have there.

Of failures alone that drift one `way`, 1 or -1, along the track less is asked: where the point drifts the
other way, as much of the drift is mixed in as levels that.                            # theory (49a)
"""

from math import inf

from closeform._jit import kernel
from closeform.kernel_loans import stack_matrix, stack_vector
from closeform.safety.edges import place_at
from closeform.safety.failure_family import OTHER
from closeform.zones.shapes import part, part_count

EDGES = 4  # of two craft with two unknowns each; of more no plane is mixed here
PIVOTS, LEVEL = 16, 1e-14
AGAINST = 1e-12  # of what a cell drifts by


@kernel()
def steepest(form, x, y, z):
    """The norm, and the gradient of the part that it is."""
    shape, _, faces = form
    s, ax, ay, az = -inf, 0.0, 0.0, 0.0
    for k in range(part_count(shape, faces)):
        value, gx, gy, gz = part(shape, faces, k, x, y, z)
        if value > s:
            s, ax, ay, az = value, gx, gy, gz
    return s, ax, ay, az


@kernel()
def along(room, j, x, y, z):
    """A direction along the j-th edge."""
    return x * room.edges[j, 0] + y * room.edges[j, 1] + z * room.edges[j, 2]


@kernel()
def begin_mix(room, count, x, y, z, inverse, shares):
    """Make a basis of one normal, with all of the share, and what it is along each edge."""
    inverse[0, 0], shares[0] = 1.0, 1.0
    for j in range(count):
        dot = along(room, j, x, y, z)
        sign = 1.0 if dot >= 0.0 else -1.0
        for k in range(count + 1):
            inverse[k, j + 1] = 0.0
        inverse[j + 1, 0], inverse[j + 1, j + 1] = sign * dot, -sign
        shares[j + 1] = sign * dot


@kernel()
def exchange(inverse, shares, column, size):
    """Take a column into a basis: which one it replaces, or -1 where nothing keeps it out."""
    turned, row, least = stack_vector(5), -1, inf
    for i in range(size):
        turned[i] = 0.0
        for k in range(size):
            turned[i] += inverse[i, k] * column[k]
        if turned[i] > LEVEL and shares[i] < least * turned[i]:
            row, least = i, shares[i] / turned[i]
    if row >= 0:
        for k in range(size):
            inverse[row, k] /= turned[row]
        for i in range(size):
            if i != row:
                shares[i] = max(0.0, shares[i] - least * turned[i])
                for k in range(size):
                    inverse[i, k] -= turned[i] * inverse[row, k]
        shares[row] = least
    return row


@kernel()
def point_of(room, count, costs, inverse, u):
    """The point that a basis takes for the nearest: its shares of edges from the centre on, the norm first.

    And which edge it is farthest beyond the end of, or -1.
    """
    x, y, z = place_at(room, count, 0.5)
    beyond, which = 0.5 + LEVEL, -1
    for k in range(count + 1):
        u[k] = 0.0
        for i in range(count + 1):
            u[k] -= costs[i] * inverse[i, k]
    for j in range(count):
        share = -u[j + 1]
        x, y, z = x + share * room.edges[j, 0], y + share * room.edges[j, 1], z + share * room.edges[j, 2]
        if abs(share) > beyond:
            beyond, which = abs(share), j
    return x, y, z, which


@kernel()
def leaning(room, count, u, way):
    """What of the drift is mixed in where the point of a basis drifts against a way, and the centre's drift.

    0 where it does not: in units of what edges drift by, that normals and drifts are of a size.
    """
    centre = room.drifts[0] - room.drifts[OTHER]
    drift, unit = centre, 0.0
    for j in range(count):
        centre += 0.5 * room.edges[j, 3]
        drift += (0.5 - u[j + 1]) * room.edges[j, 3]
        unit += abs(room.edges[j, 3])
    return -way / unit if way * drift < -AGAINST * unit else 0.0, centre


@kernel()
def mixed_normal(room, count, form, x, y, z, way):
    """The mix of normals that keeps the parallelotope farthest away, from that at (x, y, z) on; and of drift.

    `shares` become where the norm is least in it.
    """
    inverse, normals, size = stack_matrix(5, 5), stack_matrix(5, 4), count + 1
    shares, costs, column, u = stack_vector(5), stack_vector(5), stack_vector(5), stack_vector(5)
    cx, cy, cz = place_at(room, count, 0.5)
    _, ax, ay, az = steepest(form, x, y, z)
    begin_mix(room, count, ax, ay, az, inverse, shares)
    for i in range(size):
        costs[i] = 0.5 if i > 0 else -(ax * cx + ay * cy + az * cz)
        normals[i, 0] = normals[i, 1] = normals[i, 2] = normals[i, 3] = 0.0
    normals[0, 0], normals[0, 1], normals[0, 2] = ax, ay, az
    for _ in range(PIVOTS):
        px, py, pz, which = point_of(room, count, costs, inverse, u)
        s, gx, gy, gz = steepest(form, px, py, pz)
        cost = -(gx * cx + gy * cy + gz * cz)
        lean, drift = leaning(room, count, u, way) if which < 0 else (0.0, 0.0)
        if which < 0 and lean == 0.0 and s - u[0] <= LEVEL * max(abs(s), 1.0):
            break
        column[0] = 1.0 if which < 0 and lean == 0.0 else 0.0
        if lean != 0.0:
            gx, gy, gz, cost = 0.0, 0.0, 0.0, -lean * drift
        for j in range(count):
            column[j + 1] = along(room, j, gx, gy, gz) + lean * room.edges[j, 3] if which < 0 else 0.0
        if which >= 0:  # first back into the parallelotope
            gx, gy, gz, cost = 0.0, 0.0, 0.0, 0.5
            column[which + 1] = -1.0 if u[which + 1] > 0.0 else 1.0
        row = exchange(inverse, shares, column, size)
        if row < 0:
            break
        costs[row], normals[row, 3] = cost, lean
        normals[row, 0], normals[row, 1], normals[row, 2] = gx, gy, gz
    ax, ay, az, lean = 0.0, 0.0, 0.0, 0.0
    for i in range(size):
        share = shares[i]
        ax, ay, az = ax + share * normals[i, 0], ay + share * normals[i, 1], az + share * normals[i, 2]
        lean += share * normals[i, 3]
    for j in range(count):
        room.shares[j] = min(max(0.5 - u[j + 1], 0.0), 1.0)
    return ax, ay, az, lean
