"""Kernels for the shapes of zones: a ball, a cube, a cylinder and a set of half-spaces.

A zone is (shape, matrix, faces): `matrix` (3, 3) maps metres to zone coordinates q, where the
shape is a unit set. Its norm is the largest of the shape's parts, each smooth and convex:

    BALL      |q|                     one part, round over three axes
    CUBE      |q_0|, |q_1|, |q_2|     three flat parts
    CYLINDER  hypot(q_0, q_1), |q_2|  its side, round over two axes, and its two ends
    FACES     f_k . q                 a one-sided flat part for each row f_k of `faces` (F, 3)

The norm is 1 on the surface and below 1 inside; for `FACES` it is negative at points where every
f_k . q is. A new shape needs a branch in each function here, and a class in `solids`.

Kernels with `faces` have a single `return`: with a second one numba no longer sees that the array
is not kept, and counts its references in every step of the march.
"""

from math import inf, sqrt

from numba import float64, int64, types

from closeform._jit import kernel

BALL, CUBE, CYLINDER, FACES = 0, 1, 2, 3
FORM = types.Tuple((int64, float64[:, ::1], float64[:, ::1]))  # numba's type of a zone's `form`


@kernel()
def part_count(shape, faces):
    """Return the number of parts of a shape's norm."""
    count = 1 if shape == BALL else (3 if shape == CUBE else 2)
    if shape == FACES:
        count = len(faces)
    return count


@kernel()
def rank(shape, k):
    """Return the number of leading axes over which part k is round: 1 for a flat part."""
    if shape == BALL:
        return 3
    return 2 if shape == CYLINDER and k == 0 else 1


@kernel()
def part(shape, faces, k, x, y, z):
    """Return value and gradient of part k at q = (x, y, z), or a subgradient where it has a kink."""
    gx = gy = gz = 0.0
    if shape == FACES:
        gx, gy, gz = faces[k, 0], faces[k, 1], faces[k, 2]
        s = gx * x + gy * y + gz * z
    elif shape == BALL or (shape == CYLINDER and k == 0):
        height = z if shape == BALL else 0.0
        s = sqrt(x * x + y * y + height * height)
        if s > 0.0:
            gx, gy, gz = x / s, y / s, height / s
    elif shape == CUBE and k == 0:
        s, gx = abs(x), 1.0 if x >= 0.0 else -1.0
    elif shape == CUBE and k == 1:
        s, gy = abs(y), 1.0 if y >= 0.0 else -1.0
    else:
        s, gz = abs(z), 1.0 if z >= 0.0 else -1.0
    return s, gx, gy, gz


@kernel()
def solid_norm(shape, x, y, z):
    """Return the norm of any shape but `FACES`."""
    if shape == BALL:
        return sqrt(x * x + y * y + z * z)
    if shape == CUBE:
        return max(abs(x), abs(y), abs(z))
    return max(sqrt(x * x + y * y), abs(z))


@kernel()
def faces_norm(faces, x, y, z):
    """Return the norm of `FACES`."""
    s = -inf
    for k in range(len(faces)):
        s = max(s, faces[k, 0] * x + faces[k, 1] * y + faces[k, 2] * z)
    return s


@kernel(inline=True)
def norm(shape, faces, x, y, z):
    """Return the norm, the largest part, at q = (x, y, z)."""
    return faces_norm(faces, x, y, z) if shape == FACES else solid_norm(shape, x, y, z)


@kernel()
def support(shape, wx, wy, wz):
    """Return the largest w . q over a unit set; not for `FACES`."""
    if shape == CUBE:
        return abs(wx) + abs(wy) + abs(wz)
    if shape == CYLINDER:
        return sqrt(wx * wx + wy * wy) + abs(wz)
    return sqrt(wx * wx + wy * wy + wz * wz)


@kernel()
def rate_round(s, x, y, z, vx, vy, vz):
    """Return the right-sided rate of a Euclidean length s."""
    return (x * vx + y * vy + z * vz) / s if s > 0.0 else sqrt(vx * vx + vy * vy + vz * vz)


@kernel()
def rate_flat(x, vx):
    """Return the right-sided rate of |x|."""
    return abs(vx) if x == 0.0 else (vx if x > 0.0 else -vx)


@kernel()
def solid_rate(shape, x, y, z, vx, vy, vz):
    """Return the right-sided rate of the norm of any shape but `FACES`."""
    s = solid_norm(shape, x, y, z)
    if shape == BALL:
        return rate_round(s, x, y, z, vx, vy, vz)
    steepest = rate_flat(z, vz) if abs(z) == s else -inf
    if shape == CYLINDER:
        if sqrt(x * x + y * y) == s:
            steepest = max(steepest, rate_round(s, x, y, 0.0, vx, vy, 0.0))
        return steepest
    if abs(x) == s:
        steepest = max(steepest, rate_flat(x, vx))
    if abs(y) == s:
        steepest = max(steepest, rate_flat(y, vy))
    return steepest


@kernel()
def faces_rate(faces, x, y, z, vx, vy, vz):
    """Return the right-sided rate of the norm of `FACES`."""
    s, steepest = faces_norm(faces, x, y, z), -inf
    for k in range(len(faces)):
        if faces[k, 0] * x + faces[k, 1] * y + faces[k, 2] * z == s:
            steepest = max(steepest, faces[k, 0] * vx + faces[k, 1] * vy + faces[k, 2] * vz)
    return steepest


@kernel(inline=True)
def rate(shape, faces, x, y, z, vx, vy, vz):
    """Return the right-sided rate of the norm: the largest rate of the parts that attain it."""
    if shape == FACES:
        found = faces_rate(faces, x, y, z, vx, vy, vz)
    else:
        found = solid_rate(shape, x, y, z, vx, vy, vz)
    return found


@kernel()
def time_to_level(gap, rate, curvature):
    """Return the first h > 0 with gap + rate h - curvature h^2 / 2 = 0, without cancellation."""
    root = sqrt(rate * rate + 2.0 * curvature * gap)
    if rate < 0.0:
        return 2.0 * gap / (root - rate)
    return (rate + root) / curvature if curvature > 0.0 else inf


@kernel()
def outside_flat(x, v, a, target):
    """Return the time for which |x| provably stays above the target; 0 if it is not above."""
    if x > target:
        return time_to_level(x - target, v, a)
    if -x > target:
        return time_to_level(-x - target, -v, a)
    return 0.0


@kernel()
def outside_solid(shape, x, y, z, vx, vy, vz, ax, ay, az, a, target):
    if shape == BALL:
        s = sqrt(x * x + y * y + z * z)
        return time_to_level(s - target, (x * vx + y * vy + z * vz) / s, a)
    longest = outside_flat(z, vz, az, target)
    if shape == CUBE:
        return max(longest, outside_flat(x, vx, ax, target), outside_flat(y, vy, ay, target))
    s = sqrt(x * x + y * y)
    if s > target:
        most = sqrt(ax * ax + ay * ay)
        longest = max(longest, time_to_level(s - target, (x * vx + y * vy) / s, most))
    return longest


@kernel()
def outside_faces(faces, x, y, z, vx, vy, vz, ax, ay, az, target):
    longest = 0.0
    for k in range(len(faces)):
        fx, fy, fz = faces[k, 0], faces[k, 1], faces[k, 2]
        gap = fx * x + fy * y + fz * z - target
        if gap > 0.0:
            most = abs(fx) * ax + abs(fy) * ay + abs(fz) * az
            longest = max(longest, time_to_level(gap, fx * vx + fy * vy + fz * vz, most))
    return longest


@kernel(inline=True)
def outside_step(shape, faces, x, y, z, vx, vy, vz, ax, ay, az, a, target):
    """Return the time for which the norm provably stays above the target: the longest of the parts above it.

    ax, ay, az bound the acceleration along each axis, `a` its length; theory (10).
    """
    if shape == FACES:
        h = outside_faces(faces, x, y, z, vx, vy, vz, ax, ay, az, target)
    else:
        h = outside_solid(shape, x, y, z, vx, vy, vz, ax, ay, az, a, target)
    return h


@kernel()
def inside_flat(x, v, a, target):
    """Return the time for which |x| provably stays below the target."""
    return min(time_to_level(target - x, -v, a), time_to_level(target + x, v, a))


@kernel()
def inside_round(x, y, z, vx, vy, vz, a, speed, target):
    """Return the time for which a Euclidean length provably stays below the target, by its square."""
    gap = target * target - (x * x + y * y + z * z)
    return time_to_level(gap, -2.0 * (x * vx + y * vy + z * vz), 2.0 * (speed * speed + target * a))


@kernel()
def inside_solid(shape, x, y, z, vx, vy, vz, ax, ay, az, a, speed, target):
    if shape == BALL:
        return inside_round(x, y, z, vx, vy, vz, a, speed, target)
    shortest = inside_flat(z, vz, az, target)
    if shape == CUBE:
        return min(shortest, inside_flat(x, vx, ax, target), inside_flat(y, vy, ay, target))
    side = inside_round(x, y, 0.0, vx, vy, 0.0, sqrt(ax * ax + ay * ay), speed, target)
    return min(shortest, side)


@kernel()
def inside_faces(faces, x, y, z, vx, vy, vz, ax, ay, az, target):
    shortest = inf
    for k in range(len(faces)):
        fx, fy, fz = faces[k, 0], faces[k, 1], faces[k, 2]
        most = abs(fx) * ax + abs(fy) * ay + abs(fz) * az
        gap = target - (fx * x + fy * y + fz * z)
        shortest = min(shortest, time_to_level(gap, -(fx * vx + fy * vy + fz * vz), most))
    return shortest


@kernel(inline=True)
def inside_step(shape, faces, x, y, z, vx, vy, vz, ax, ay, az, a, speed, target):
    """Return the time for which the norm provably stays below the target: the shortest of the parts.

    Bounds on the acceleration are as for `outside_step`; `speed` bounds the speed.
    """
    if shape == FACES:
        h = inside_faces(faces, x, y, z, vx, vy, vz, ax, ay, az, target)
    else:
        h = inside_solid(shape, x, y, z, vx, vy, vz, ax, ay, az, a, speed, target)
    return h
