"""The set of possible positions in a cell at one time, as a parallelotope: its edges and nearest point."""

from math import sqrt

from closeform._jit import kernel
from closeform.safety.failure_cells import BURN, BURNS, INTACT, KIND, LOST, MISSED, STUCK
from closeform.safety.failure_family import GENERATORS, OTHER, next_seen
from closeform.zones.shapes import norm

GOLDEN = 0.6180339887498949


@kernel()
def find_edges(one, two, room, window):
    """Fill the edges of the set, one for each parameter of one side, then of the other.

    Returns their number.
    """
    edges, places, count = room.edges, room.places, 0
    for second in range(2):
        kind = two.now[KIND] if second else one.now[KIND]
        base = OTHER if second else 0
        sign = -1.0 if second else 1.0
        if kind == MISSED:
            first = window.generators if second else GENERATORS
            side = two if second else one
            for j in range(side.now[BURNS] - side.now[BURN]):
                for axis in range(3):
                    edges[count, axis] = places[first + j, axis]
                edges[count, 3] = room.drifts[first + j]
                count += 1
        elif kind != INTACT:
            for k in range(1 if kind == LOST else 2):
                corner = base + (3 if k == 0 else (8 if kind == STUCK else 4))
                for axis in range(3):
                    edges[count, axis] = sign * (places[corner, axis] - places[base, axis])
                edges[count, 3] = sign * (room.drifts[corner] - room.drifts[base])
                count += 1
    return count


@kernel()
def make_edges(one, two, room, window):
    """Replace the motions by that of a corner of the set followed by those of its edges.

    Returns their number.
    """
    count = 0
    for m in range(window.order):
        k = 0
        while k < window.last:
            for axis in range(3):
                room.places[k, axis] = room.motions[k, m, axis]
            k = next_seen(window, k)
        count = find_edges(one, two, room, window)
        for axis in range(3):
            room.motions[0, m, axis] = room.places[0, axis] - room.places[OTHER, axis]
            for j in range(count):
                room.motions[1 + j, m, axis] = room.edges[j, axis]
    return count


@kernel()
def place_at(room, count, share):
    """Return a point of the parallelotope: at `share` of all edges, or at `shares` if that is negative."""
    x = room.places[0, 0] - room.places[OTHER, 0]
    y = room.places[0, 1] - room.places[OTHER, 1]
    z = room.places[0, 2] - room.places[OTHER, 2]
    for k in range(count):
        by = share if share >= 0.0 else room.shares[k]
        x, y, z = x + by * room.edges[k, 0], y + by * room.edges[k, 1], z + by * room.edges[k, 2]
    return x, y, z


@kernel()
def norm_at(room, count, form):
    """Return the norm of the parallelotope's point at `shares`."""
    shape, _, faces = form
    x, y, z = place_at(room, count, -1.0)
    return norm(shape, faces, x, y, z)


@kernel()
def sink(room, count, form, fine):
    """Move `shares` to the minimum of the norm, along one edge after another: it is convex along each."""
    for _ in range(3 if count > 1 else 1):
        for k in range(count):
            low, high = 0.0, 1.0
            left, right = 1.0 - GOLDEN, GOLDEN
            room.shares[k] = left
            lower = norm_at(room, count, form)
            room.shares[k] = right
            upper = norm_at(room, count, form)
            while high - low > fine:
                if lower < upper:
                    high, right, upper = right, left, lower
                    left = high - GOLDEN * (high - low)
                    room.shares[k] = left
                    lower = norm_at(room, count, form)
                else:
                    low, left, lower = left, right, upper
                    right = low + GOLDEN * (high - low)
                    room.shares[k] = right
                    upper = norm_at(room, count, form)
            room.shares[k] = 0.5 * (low + high)


@kernel()
def nearest(room, count):
    """Return the point of a parallelotope nearest to the origin; `shares` receives its edge coordinates."""
    edges, shares = room.edges, room.shares
    x, y, z = place_at(room, count, -1.0)
    for _ in range(1 if count == 1 else 12):  # one coordinate after another
        moved = 0.0
        for k in range(count):
            ex, ey, ez = edges[k, 0], edges[k, 1], edges[k, 2]
            square = ex * ex + ey * ey + ez * ez
            if square > 0.0:
                share = min(1.0, max(0.0, shares[k] - (x * ex + y * ey + z * ez) / square))
                by = share - shares[k]
                x, y, z = x + by * ex, y + by * ey, z + by * ez
                shares[k] = share
                moved = max(moved, abs(by))
        if moved < 1e-3:
            break
    return x, y, z


@kernel()
def widest(room, count):
    """Return the index of the longest edge of a set, and its length."""
    which, longest = 0, 0.0
    for k in range(count):
        x, y, z = room.edges[k, 0], room.edges[k, 1], room.edges[k, 2]
        length = sqrt(x * x + y * y + z * z)
        if length > longest:
            which, longest = k, length
    return which, longest
