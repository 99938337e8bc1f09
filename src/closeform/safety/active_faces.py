"""The best separating plane at a kink of a zone's norm, by a small linear program.

Where faces meet, no plane of a single face gives the distance of the set that a cell spans.  The best plane
is the mix with shares l_k of normals g_k whose lowest value on the parallelotope of centre c and edges e_j is
largest,

    max sum l_k g_k.c - sum |w_j| / 2,   w_j = sum l_k g_k.e_j,   sum l_k = 1,   l >= 0       # theory (47a)

which equals the minimum norm in the parallelotope.  The multipliers are a point; the steepest part of the
norm at that point enters the basis next, round parts with their gradient there.

A weaker condition suffices if all failures drift along the track with the sign `way`, 1 or -1: where the
point drifts the other way, enough drift is mixed into the normal to compensate it.
# theory (49a)
"""

from math import inf

from closeform._jit import kernel
from closeform.kernel_loans import stack_matrix, stack_vector
from closeform.safety.edges import place_at
from closeform.safety.failure_family import OTHER
from closeform.zones.shapes import part, part_count

EDGES = 4  # two spacecraft with two unknowns each; with more, no plane is mixed here
PIVOTS, LEVEL = 16, 1e-14
AGAINST = 1e-12  # of the drifts in a cell


@kernel()
def steepest(form, x, y, z):
    """Return the norm, and the gradient of its largest part."""
    shape, _, faces = form
    s, ax, ay, az = -inf, 0.0, 0.0, 0.0
    for k in range(part_count(shape, faces)):
        value, gx, gy, gz = part(shape, faces, k, x, y, z)
        if value > s:
            s, ax, ay, az = value, gx, gy, gz
    return s, ax, ay, az


@kernel()
def along(room, j, x, y, z):
    """Return the component of a direction along the j-th edge."""
    return x * room.edges[j, 0] + y * room.edges[j, 1] + z * room.edges[j, 2]


@kernel()
def begin_mix(room, count, x, y, z, inverse, shares):
    """Start with a basis of one normal with the whole share, and its components along the edges."""
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
    """Bring a column into a basis; return the index that it replaces, or -1 if the program is unbounded."""
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
    """Return the point of a basis, and the edge that it exceeds most, or -1.

    `u` receives the norm, and the coordinates of the point along the edges from the centre.
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
    """Return the weight of drift in the mix if a basis' point drifts against `way`, and the centre's drift.

    Otherwise the weight is 0. It is scaled by the drifts of the edges, so that normals and drifts are of
    similar size.
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
    """Return the mix of normals and drift that keeps the parallelotope farthest, starting at (x, y, z).

    `shares` receives the point of minimum norm in the parallelotope.
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
