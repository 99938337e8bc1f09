"""Flights: craft that are integrated in a field, with thrust as commanded and as corrected.

What is integrated is the difference from the chief, whose own motion is known: steps of fourth order are
then off in proportion to that.
"""

from math import cos, sin, sqrt
from typing import Any, NamedTuple

from numba import float64, int64, types, void

from closeform.arrays import Floats
from closeform.compiled import kernel
from closeform.field.gravity import pull
from closeform.kernel_loans import borrowed, lent, stack_vector

SIDE, BIT, MOST, THRUSTER = 0, 3, 4, 5  # of a thruster: where it pushes, the least and the most at a time
CORNER, INVERSE, FACET = 0, 3, 12  # of a facet: its thrusters, and what tells how much of each


class Course(NamedTuple):
    """What all flights of N craft share, in K steps: the chief's motion, and what is commanded."""

    steps: Floats  # (K,) [s]
    places: Floats  # (2 K + 1, 3) [m] of the chief at half steps, inertial
    speeds: Floats  # (2 K + 1, 3) [m/s]
    felt: Floats  # (2 K + 1, 3) [m/s^2], by the chief
    axes: Floats  # (2 K + 1, 3, 3)
    turn: Floats  # (2 K + 1, 3) [rad/s]
    commanded: Floats  # (N, K, 3, 3) [m/s^2] at begin, middle and end of each step, in the chief's axes
    beyond: Floats  # (N, K or 0, 3, 3) [m/s^2] at the same times, inertial: what kernels do not know
    jumps: Floats  # (N, K + 1, 3) [m/s], in the chief's axes
    planned: Floats  # (N, K + 1, 6) [m, m/s], after jumps
    looks: Any  # (K + 1,) which measurement is made, or -1
    answers: Any  # (K + 1,) which measurement begins to count, or -1
    late: Floats  # (2, 6, 6): what is made then of what was measured, and of what counted before
    rows: Any  # (K,) of the law, at the begin of each step
    law: Floats  # (L, 3, 6): thrust at begin, middle and end of a step, of what was measured
    kicks: Any  # (K + 1,) which gain makes an impulse, or -1
    gains: Floats  # (G, 3, 6): impulses of what was measured
    shown: Any  # (K + 1,) which row of states is filled, or -1
    fires: Any  # (K + 1,) which row of impulses is filled, or -1
    ballistics: Floats  # (N,) [m^2/kg]
    limits: Floats  # (N,) [m/s^2]
    bits: Floats  # (N,) [m/s], the least impulse that is fired
    thrusters: Floats  # (N, J, 5), see above; J = 0 where impulses go anywhere
    facets: Floats  # (N, F, 12)
    angles: Floats  # (N, K + 1) [rad] from the frame of the thrusters to the chief's axes


NUMBERS, ROWS, BLOCKS, WHICH = float64[::1], float64[:, ::1], float64[:, :, ::1], int64[::1]
FOUR = float64[:, :, :, ::1]
COURSE = types.NamedTuple(
    (
        *(NUMBERS, ROWS, ROWS, ROWS, BLOCKS, ROWS, FOUR, FOUR, BLOCKS, BLOCKS, WHICH),
        *(WHICH, BLOCKS, WHICH, BLOCKS),
        *(WHICH, BLOCKS, WHICH, WHICH, NUMBERS, NUMBERS, NUMBERS, BLOCKS, BLOCKS, ROWS),
    ),
    Course,
)


@kernel()
def relative(course, node, s, out):
    """Fill `out` (6,) with a state in the chief's axes, of an inertial difference from it."""
    for axis in range(3):
        out[axis], out[3 + axis] = 0.0, 0.0
        for k in range(3):
            out[axis] += course.axes[node, axis, k] * s[k]
            out[3 + axis] += course.axes[node, axis, k] * s[3 + k]
    wx, wy, wz = course.turn[node, 0], course.turn[node, 1], course.turn[node, 2]
    out[3] -= wy * out[2] - wz * out[1]
    out[4] -= wz * out[0] - wx * out[2]
    out[5] -= wx * out[1] - wy * out[0]


@kernel()
def inertial(course, node, r, out):
    """Fill `out` (6,) with the inertial difference from the chief, of a state in its axes."""
    wx, wy, wz = course.turn[node, 0], course.turn[node, 1], course.turn[node, 2]
    vx = r[3] + wy * r[2] - wz * r[1]
    vy = r[4] + wz * r[0] - wx * r[2]
    vz = r[5] + wx * r[1] - wy * r[0]
    for k in range(3):
        a = course.axes[node]
        out[k] = a[0, k] * r[0] + a[1, k] * r[1] + a[2, k] * r[2]
        out[3 + k] = a[0, k] * vx + a[1, k] * vy + a[2, k] * vz


@kernel()
def erred(error, u, axes, out):
    """Fill `out` (3,), inertial, with a thrust or an impulse as it comes out, and `u` in the chief's axes."""
    grown = 1.0 + error[0]
    x = grown * (u[0] + error[2] * u[2] - error[3] * u[1])
    y = grown * (u[1] + error[3] * u[0] - error[1] * u[2])
    z = grown * (u[2] + error[1] * u[1] - error[2] * u[0])
    u[0], u[1], u[2] = x, y, z
    for k in range(3):
        out[k] = axes[0, k] * x + axes[1, k] * y + axes[2, k] * z


@kernel()
def push(course, i, step, half, deviation, error, spent, weight, out):
    """Fill `out` (3,) with the thrust of craft i in a step, inertial; `spent` adds it up, by a weight."""
    u = stack_vector(3)
    size = 0.0
    for axis in range(3):
        u[axis] = course.commanded[i, step, half, axis]
        for k in range(6):
            u[axis] += course.law[course.rows[step] + half, axis, k] * deviation[k]
        size += u[axis] * u[axis]
    size = sqrt(size)
    if size > course.limits[i]:
        for axis in range(3):
            u[axis] *= course.limits[i] / size
        size = course.limits[i]
        spent[1] += weight
    spent[0] += weight * size
    erred(error, u, course.axes[2 * step + half], out)


@kernel()
def allocated(course, i, angle, v):
    """Make an impulse `v` (3,) what the thrusters of craft i fire for it; returns the sum of that."""
    c, s = cos(angle), sin(angle)
    x, y, z = c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]
    facets = course.facets[i]
    best, least = 0, -1e300
    for f in range(len(facets)):
        lowest = 1e300
        for k in range(3):
            q = x * facets[f, INVERSE + k] + y * facets[f, INVERSE + 3 + k] + z * facets[f, INVERSE + 6 + k]
            lowest = min(lowest, q)
        if lowest > least:
            best, least = f, lowest
    total, fx, fy, fz = 0.0, 0.0, 0.0, 0.0
    for k in range(3):
        own = course.thrusters[i, int(facets[best, CORNER + k])]
        q = (
            x * facets[best, INVERSE + k]
            + y * facets[best, INVERSE + 3 + k]
            + z * facets[best, INVERSE + 6 + k]
        )
        q = min(q, own[MOST]) if q >= own[BIT] and q > 0.0 else 0.0
        total += q
        fx, fy, fz = fx + q * own[SIDE], fy + q * own[SIDE + 1], fz + q * own[SIDE + 2]
    v[0], v[1], v[2] = c * fx + s * fy, c * fy - s * fx, fz
    return total


@kernel()
def kick(course, i, node, deviation, error, spent, y, fired):
    """Change the state `y` (6,) by the impulses of craft i at a node, planned and corrected: `fired` (3,)."""
    planned, way_back, change = stack_vector(3), stack_vector(3), stack_vector(3)
    for axis in range(3):
        planned[axis], way_back[axis] = course.jumps[i, node, axis], 0.0
        if course.kicks[node] >= 0:
            for k in range(6):
                way_back[axis] += course.gains[course.kicks[node], axis, k] * deviation[k]
    if course.thrusters.shape[1] > 0:
        spent[0] += allocated(course, i, course.angles[i, node], way_back)
    else:
        for axis in range(3):
            planned[axis] += way_back[axis]
            way_back[axis] = 0.0
    size = sqrt(planned[0] * planned[0] + planned[1] * planned[1] + planned[2] * planned[2])
    if size < course.bits[i]:
        size = 0.0
    spent[0] += size
    for axis in range(3):
        way_back[axis] += planned[axis] if size > 0.0 else 0.0
    erred(error, way_back, course.axes[2 * node], change)
    for k in range(3):
        y[3 + k] += change[k]
        fired[k] = way_back[k]


@kernel()
def answer(course, seen, counted):
    """Make what was `seen` (6,) what is `counted`, as far on as it is by now: with what that has thrust."""
    found = stack_vector(6)
    for axis in range(6):
        found[axis] = 0.0
        for k in range(6):
            found[axis] += course.late[0, axis, k] * seen[k] + course.late[1, axis, k] * counted[k]
    for k in range(6):
        counted[k] = found[k]


@kernel(void(float64[::1], COURSE, FOUR, BLOCKS, BLOCKS, FOUR, FOUR, BLOCKS))
def fly_all(constants, course, wrong, errors, now, states, impulses, spent):
    """Fly S times, on from `now` (S, N, 18), which becomes what is last.

    That is states before jumps in the chief's axes, which deviations count for feedback, and which were seen.

    Fills `states` (S, N, T, 6) at nodes that are shown, after `impulses` (S, N, Q, 3) [m/s], and adds to
    `spent` (S, N, 2) the delta-v [m/s] and how long thrust was at its limit [s].  By Runge and Kutta's method
    of fourth order.  Measurements are off by `wrong` (S, N, M, 6); `errors` (S, N, 4) are those of thrust: of
    its size, and a small turn.
    """
    course = lent(course)
    wrong, errors, now = borrowed(wrong), borrowed(errors), borrowed(now)
    states, impulses, spent = borrowed(states), borrowed(impulses), borrowed(spent)
    steps, fired = len(course.steps), stack_vector(3)
    y, middle, force, thrust = stack_vector(6), stack_vector(6), stack_vector(3), stack_vector(3)
    rate, total, there = stack_vector(6), stack_vector(6), stack_vector(6)
    for flight in range(len(now)):
        for i in range(len(course.ballistics)):
            error, used = errors[flight, i], spent[flight, i]
            inertial(course, 0, now[flight, i], y)
            deviation, seen = now[flight, i, 6:12], now[flight, i, 12:]
            for step in range(steps + 1):
                if course.answers[step] >= 0 and course.answers[step] != course.looks[step]:
                    answer(course, seen, deviation)
                if course.looks[step] >= 0:
                    relative(course, 2 * step, y, middle)
                    for k in range(6):
                        seen[k] = middle[k] - course.planned[i, step, k]
                        seen[k] += wrong[flight, i, course.looks[step], k]
                    for k in range(3):
                        seen[3 + k] += course.jumps[i, step, k]
                    if course.answers[step] == course.looks[step]:
                        answer(course, seen, deviation)
                if course.fires[step] >= 0:
                    kick(course, i, step, deviation, error, used, y, fired)
                    for k in range(3):
                        impulses[flight, i, course.fires[step], k] = fired[k]
                if course.shown[step] >= 0:
                    relative(course, 2 * step, y, states[flight, i, course.shown[step]])
                h = course.steps[step] if step < steps else 0.0
                for stage in range(4 if step < steps else 0):
                    share = 0.0 if stage == 0 else (0.5 if stage < 3 else 1.0)
                    half = (stage + 1) // 2
                    node = 2 * step + half
                    for k in range(6):
                        middle[k] = y[k] + (share * h * rate[k] if stage > 0 else 0.0)
                    for k in range(3):
                        there[k] = course.places[node, k] + middle[k]
                        there[3 + k] = course.speeds[node, k] + middle[3 + k]
                    weight = h / 6.0 if stage in (0, 3) else h / 3.0
                    if stage != 2:  # in the middle twice the same
                        counted = h / 6.0 if stage != 1 else h / 1.5
                        push(course, i, step, half, deviation, error, used, counted, thrust)
                    pull(constants, course.ballistics[i], there, force)
                    if course.beyond.shape[1] > 0:
                        for k in range(3):
                            force[k] += course.beyond[i, step, half, k]
                    for k in range(3):
                        rate[k], rate[3 + k] = middle[3 + k], force[k] - course.felt[node, k] + thrust[k]
                    for k in range(6):
                        total[k] = weight * rate[k] + (total[k] if stage > 0 else 0.0)
                if step < steps:
                    for k in range(6):
                        y[k] += total[k]
            relative(course, 2 * steps, y, now[flight, i])
