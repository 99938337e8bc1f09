"""Flights: craft that are integrated in a field, with thrust as commanded and as corrected.

What is integrated is the difference from the chief, whose own motion is known: steps of fourth order are
then off in proportion to that.
"""

from math import sqrt
from typing import NamedTuple

from numba import float64, int64, types, void

from closeform.arrays import Floats
from closeform.compiled import kernel
from closeform.field.gravity import pull
from closeform.kernel_loans import borrowed, lent, stack_vector


class Course(NamedTuple):
    """What all flights of N craft share, at 2 K + 1 half steps: the chief's motion, and what is commanded."""

    places: Floats  # (2 K + 1, 3) [m] of the chief, inertial
    speeds: Floats  # (2 K + 1, 3) [m/s]
    felt: Floats  # (2 K + 1, 3) [m/s^2], by the chief
    axes: Floats  # (2 K + 1, 3, 3)
    turn: Floats  # (2 K + 1, 3) [rad/s]
    commanded: Floats  # (N, 2 K + 1, 3) [m/s^2], in the chief's axes
    planned: Floats  # (N, K + 1, 6) [m, m/s]
    law: Floats  # (2 P + 1, 3, 6): thrust at half steps after a measurement, of what is measured then
    ballistics: Floats  # (N,) [m^2/kg]
    limits: Floats  # (N,) [m/s^2]


NUMBERS, ROWS, BLOCKS = float64[::1], float64[:, ::1], float64[:, :, ::1]
COURSE = types.NamedTuple(
    (ROWS, ROWS, ROWS, BLOCKS, ROWS, BLOCKS, BLOCKS, BLOCKS, NUMBERS, NUMBERS),
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
def push(course, i, half, since, deviation, error, out):
    """Fill `out` (3,) with the thrust of craft i at a half step, inertial; returns what is commanded."""
    u = stack_vector(3)
    size = 0.0
    for axis in range(3):
        u[axis] = course.commanded[i, half, axis]
        for k in range(6):
            u[axis] += course.law[since, axis, k] * deviation[k]
        size += u[axis] * u[axis]
    size = sqrt(size)
    if size > course.limits[i]:
        for axis in range(3):
            u[axis] *= course.limits[i] / size
        size = course.limits[i]
    grown = 1.0 + error[0]
    x = grown * (u[0] + error[2] * u[2] - error[3] * u[1])
    y = grown * (u[1] + error[3] * u[0] - error[1] * u[2])
    z = grown * (u[2] + error[1] * u[1] - error[2] * u[0])
    a = course.axes[half]
    for k in range(3):
        out[k] = a[0, k] * x + a[1, k] * y + a[2, k] * z
    return size


@kernel(
    void(
        float64[::1],
        COURSE,
        float64,
        int64,
        float64[:, :, :, ::1],
        BLOCKS,
        float64[:, :, :, ::1],
        float64[:, ::1],
    )
)
def fly_all(constants, course, h, measured, wrong, errors, states, spent):
    """Fill `states` (S, N, K + 1, 6) of S flights in the chief's axes, and what they spend (S, N) [m/s].

    By Runge and Kutta's method of fourth order with steps of h; measured anew after as many of them, 0 is
    never, `wrong` by (S, N, M, 6).  `errors` (S, N, 4) are those of thrust: of its size, and a small turn.
    """
    course = lent(course)
    wrong, errors, states, spent = borrowed(wrong), borrowed(errors), borrowed(states), borrowed(spent)
    steps = course.planned.shape[1] - 1
    y, middle, force, thrust = stack_vector(6), stack_vector(6), stack_vector(3), stack_vector(3)
    rate, total, deviation, there = stack_vector(6), stack_vector(6), stack_vector(6), stack_vector(6)
    for flight in range(len(states)):
        for i in range(len(course.ballistics)):
            for k in range(6):
                states[flight, i, 0, k] = course.planned[i, 0, k]
                deviation[k] = 0.0
            inertial(course, 0, states[flight, i, 0], y)
            spent[flight, i], since = 0.0, 0
            for step in range(steps):
                if measured > 0 and step % measured == 0:
                    since = 0
                    for k in range(6):
                        deviation[k] = states[flight, i, step, k] - course.planned[i, step, k]
                        deviation[k] += wrong[flight, i, step // measured, k]
                for stage in range(4):
                    share = 0.0 if stage == 0 else (0.5 if stage < 3 else 1.0)
                    half = (stage + 1) // 2
                    node = 2 * step + half
                    for k in range(6):
                        middle[k] = y[k] + (share * h * rate[k] if stage > 0 else 0.0)
                    for k in range(3):
                        there[k] = course.places[node, k] + middle[k]
                        there[3 + k] = course.speeds[node, k] + middle[3 + k]
                    size = push(course, i, node, since + half, deviation, errors[flight, i], thrust)
                    pull(constants, course.ballistics[i], there, force)
                    weight = h / 6.0 if stage in (0, 3) else h / 3.0
                    for k in range(3):
                        rate[k], rate[3 + k] = middle[3 + k], force[k] - course.felt[node, k] + thrust[k]
                    for k in range(6):
                        total[k] = weight * rate[k] + (total[k] if stage > 0 else 0.0)
                    spent[flight, i] += weight * size
                for k in range(6):
                    y[k] += total[k]
                since += 2
                relative(course, 2 * step + 2, y, states[flight, i, step + 1])
