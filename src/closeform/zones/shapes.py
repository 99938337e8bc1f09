"""Shapes of zones: all that kernels know of a ball, a cube, a cylinder and a set of half-spaces.

A zone is (shape, matrix, faces): `matrix` (3, 3) takes metres to zone coordinates q, where the
shape is a unit set. Its norm is the largest of the shape's parts, each smooth and convex:

    BALL      |q|                     one part, round over three axes
    CUBE      |q_0|, |q_1|, |q_2|     three flat parts
    CYLINDER  hypot(q_0, q_1), |q_2|  its side, round over two axes, and its two ends
    FACES     f_k . q                 a one-sided flat part for each row f_k of `faces` (F, 3)

The norm is 1 on the surface and below 1 inside; of `FACES` it is negative where all faces fall
away. To add a shape: its branch in each function here, and a class in `zone`.
"""

from math import inf, sqrt

from numba import float64, int64, types

from closeform.compiled import kernel

BALL, CUBE, CYLINDER, FACES = 0, 1, 2, 3
FORM = types.Tuple((int64, float64[:, ::1], float64[:, ::1]))  # numba's type of a zone's `form`


@kernel()
def part_count(shape, faces):
    """How many parts a shape's norm is the largest of."""
    if shape == BALL:
        return 1
    if shape == CUBE:
        return 3
    return 2 if shape == CYLINDER else len(faces)


@kernel()
def rank(shape, k):
    """Over how many of the leading axes part k is round: 1 for a flat one."""
    if shape == BALL:
        return 3
    return 2 if shape == CYLINDER and k == 0 else 1


@kernel()
def part(shape, faces, k, x, y, z):
    """Value and gradient of part k at q = (x, y, z); where it has no gradient, any subgradient."""
    if shape == FACES:
        gx, gy, gz = faces[k, 0], faces[k, 1], faces[k, 2]
        return gx * x + gy * y + gz * z, gx, gy, gz
    if shape == BALL or (shape == CYLINDER and k == 0):
        height = z if shape == BALL else 0.0
        s = sqrt(x * x + y * y + height * height)
        return (s, x / s, y / s, height / s) if s > 0.0 else (0.0, 0.0, 0.0, 0.0)
    if shape == CUBE and k == 0:
        return (x, 1.0, 0.0, 0.0) if x >= 0.0 else (-x, -1.0, 0.0, 0.0)
    if shape == CUBE and k == 1:
        return (y, 0.0, 1.0, 0.0) if y >= 0.0 else (-y, 0.0, -1.0, 0.0)
    return (z, 0.0, 0.0, 1.0) if z >= 0.0 else (-z, 0.0, 0.0, -1.0)


@kernel()
def norm(shape, faces, x, y, z):
    """The largest part at q = (x, y, z)."""
    if shape == BALL:
        return sqrt(x * x + y * y + z * z)
    if shape == CUBE:
        return max(abs(x), abs(y), abs(z))
    if shape == CYLINDER:
        return max(sqrt(x * x + y * y), abs(z))
    largest = -inf
    for k in range(len(faces)):
        largest = max(largest, faces[k, 0] * x + faces[k, 1] * y + faces[k, 2] * z)
    return largest


@kernel()
def round_rate(s, x, y, z, vx, vy, vz):
    """Rate to the right of a Euclidean length s."""
    return (x * vx + y * vy + z * vz) / s if s > 0.0 else sqrt(vx * vx + vy * vy + vz * vz)


@kernel()
def flat_rate(x, vx):
    """Rate of |x|, to the right where it has a kink."""
    return abs(vx) if x == 0.0 else (vx if x > 0.0 else -vx)


@kernel()
def rate(shape, faces, x, y, z, vx, vy, vz):
    """Rate of the norm, to the right where it has a kink: the greatest of the parts that attain it."""
    s = norm(shape, faces, x, y, z)
    if shape == BALL:
        return round_rate(s, x, y, z, vx, vy, vz)
    steepest = -inf
    if shape == FACES:
        for k in range(len(faces)):
            if faces[k, 0] * x + faces[k, 1] * y + faces[k, 2] * z == s:
                steepest = max(steepest, faces[k, 0] * vx + faces[k, 1] * vy + faces[k, 2] * vz)
        return steepest
    if abs(z) == s:
        steepest = flat_rate(z, vz)
    if shape == CYLINDER:
        if sqrt(x * x + y * y) == s:
            steepest = max(steepest, round_rate(s, x, y, 0.0, vx, vy, 0.0))
        return steepest
    if abs(x) == s:
        steepest = max(steepest, flat_rate(x, vx))
    if abs(y) == s:
        steepest = max(steepest, flat_rate(y, vy))
    return steepest


@kernel()
def time_to_level(gap, rate, curvature):
    """First h > 0 with gap + rate h - curvature h^2 / 2 = 0, without cancellation."""
    root = sqrt(rate * rate + 2.0 * curvature * gap)
    if rate < 0.0:
        return 2.0 * gap / (root - rate)
    return (rate + root) / curvature if curvature > 0.0 else inf


@kernel()
def outside_flat(x, v, a, target):
    """How long |x| certainly stays above the target; 0 where it is not above."""
    if x > target:
        return time_to_level(x - target, v, a)
    if -x > target:
        return time_to_level(-x - target, -v, a)
    return 0.0


@kernel()
def outside_step(shape, faces, x, y, z, vx, vy, vz, ax, ay, az, a, target):
    """How long the norm certainly stays above the target: the best of the parts above it.

    ax, ay, az bound the acceleration along each axis, `a` its length.             # theory (10)
    """
    if shape == BALL:
        s = sqrt(x * x + y * y + z * z)
        return time_to_level(s - target, (x * vx + y * vy + z * vz) / s, a)
    longest = 0.0
    if shape == FACES:
        for k in range(len(faces)):
            fx, fy, fz = faces[k, 0], faces[k, 1], faces[k, 2]
            gap = fx * x + fy * y + fz * z - target
            if gap > 0.0:
                most = abs(fx) * ax + abs(fy) * ay + abs(fz) * az
                longest = max(longest, time_to_level(gap, fx * vx + fy * vy + fz * vz, most))
        return longest
    longest = outside_flat(z, vz, az, target)
    if shape == CYLINDER:
        s = sqrt(x * x + y * y)
        if s > target:
            side = time_to_level(s - target, (x * vx + y * vy) / s, sqrt(ax * ax + ay * ay))
            longest = max(longest, side)
        return longest
    return max(longest, outside_flat(x, vx, ax, target), outside_flat(y, vy, ay, target))


@kernel()
def inside_flat(x, v, a, target):
    """How long |x| certainly stays below the target."""
    return min(time_to_level(target - x, -v, a), time_to_level(target + x, v, a))


@kernel()
def inside_round(square, half_slope, a, speed, target):
    """How long a Euclidean length certainly stays below the target, by its square's second derivative."""
    gap = target * target - square
    return time_to_level(gap, -2.0 * half_slope, 2.0 * (speed * speed + target * a))


@kernel()
def inside_step(shape, faces, x, y, z, vx, vy, vz, ax, ay, az, a, speed, target):
    """How long the norm certainly stays below the target: the least of the parts.

    Bounds of the acceleration as for `outside_step`, and `speed` of the velocity's length.
    """
    if shape == BALL:
        return inside_round(x * x + y * y + z * z, x * vx + y * vy + z * vz, a, speed, target)
    if shape == FACES:
        shortest = inf
        for k in range(len(faces)):
            fx, fy, fz = faces[k, 0], faces[k, 1], faces[k, 2]
            most = abs(fx) * ax + abs(fy) * ay + abs(fz) * az
            gap = target - (fx * x + fy * y + fz * z)
            shortest = min(shortest, time_to_level(gap, -(fx * vx + fy * vy + fz * vz), most))
        return shortest
    shortest = inside_flat(z, vz, az, target)
    if shape == CYLINDER:
        side = inside_round(x * x + y * y, x * vx + y * vy, sqrt(ax * ax + ay * ay), speed, target)
        return min(shortest, side)
    return min(shortest, inside_flat(x, vx, ax, target), inside_flat(y, vy, ay, target))
