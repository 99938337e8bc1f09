"""Batch integration of craft in a force model, with thrust as commanded and as corrected.

The integrated state is the difference from the chief, whose own motion is known. The error of a fourth-order
step is then proportional to that difference. Simulations run in parallel lanes: shared data is read once for
all of them, and loops over lanes become vector instructions.
"""

from math import sqrt
from typing import Any, NamedTuple

from numba import float64, int64, types, void

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.dynamics.batch_layout import (
    BACK,
    BALLISTIC,
    BURN,
    COUNTED,
    CRAFT,
    ERROR,
    LANE,
    LANES,
    LIMIT,
    NONE,
    ORDER,
    OWN,
    SEEN,
    SPENT,
    Y,
    correct,
    erred,
)
from closeform.dynamics.gravity import pull_all
from closeform.dynamics.thruster_commands import burn_all, order
from closeform.kernel_loans import borrowed, lent, stack_matrix, stack_vector


class Course(NamedTuple):
    """Data shared by all simulations of N craft over K steps: the chief's motion and the commands."""

    steps: Floats  # (K,) [s]
    places: Floats  # (2 K + 1, 3) [m] of the chief at half steps, inertial
    speeds: Floats  # (2 K + 1, 3) [m/s]
    felt: Floats  # (2 K + 1, 3) [m/s^2], acceleration of the chief
    axes: Floats  # (2 K + 1, 3, 3)
    turn: Floats  # (2 K + 1, 3) [rad/s]
    commanded: Floats  # (N, K, 3, 3) [m/s^2] at start, middle and end of each step, in the chief's axes
    # (N, K or 0, 3, 3) [m/s^2] at the same times, inertial: forces that kernels cannot compute
    beyond: Floats
    jumps: Floats  # (N, K + 1, 3) [m/s], in the chief's axes
    planned: Floats  # (N, K + 1, 6) [m, m/s], after jumps
    looks: Any  # (K + 1,) index of the measurement made, or -1
    answers: Any  # (K + 1,) index of the measurement that takes effect, or -1
    late: Floats  # (2, 6, 6): transitions then of the measured deviation and of the one in effect before
    rows: Any  # (K,) row of the law at the start of each step
    law: Floats  # (L, 3, 6): gains at start, middle and end of a step, from deviation to thrust
    kicks: Any  # (K + 1,) index of the gain of an impulse, or -1
    gains: Floats  # (G, 3, 6): gains from deviation to impulse
    shown: Any  # (K + 1,) row of the states that is filled, or -1
    fires: Any  # (K + 1,) row of the impulses that is filled, or -1
    ballistics: Floats  # (N,) [m^2/kg]
    limits: Floats  # (N,) [m/s^2]
    bits: Floats  # (N,) [m/s], minimum impulse bit
    thrusters: Floats  # (N, J, 5), see `thruster_commands`; J = 0 for impulses in any direction
    facets: Floats  # (N, F, 12)
    angles: Floats  # (N, K + 2) [rad] from the frame of the thrusters to the chief's axes
    free: Floats  # (N, J, K + 2) [s], accumulated time without planned firing
    slots: Any  # (K + 1,) node at which a thruster order ends; K + 1 for the last one
    burns: Any  # (N, K) error event of the planned thrust in each step
    led: Any  # (K,) error event of the feedback thrust in each step, or -1
    struck: Any  # (K + 1,) error event of an impulse, or -1
    gates: Floats  # (N, 4) Gates parameters of its error: theory (50)


NUMBERS, ROWS, BLOCKS, WHICH = float64[::1], float64[:, ::1], float64[:, :, ::1], int64[::1]
EACH = int64[:, ::1]
FOUR = float64[:, :, :, ::1]
COURSE = types.NamedTuple(
    (
        *(NUMBERS, ROWS, ROWS, ROWS, BLOCKS, ROWS, FOUR, FOUR, BLOCKS, BLOCKS, WHICH),
        *(WHICH, BLOCKS, WHICH, BLOCKS),
        *(WHICH, BLOCKS, WHICH, WHICH, NUMBERS, NUMBERS, NUMBERS, BLOCKS, BLOCKS, ROWS),
        *(BLOCKS, WHICH, EACH, WHICH, WHICH, ROWS),
    ),
    Course,
)


@kernel()
def relative(axes, turn, s, out):
    """Fill `out` (6, LANES) with states in the chief's axes from inertial differences `s` from it."""
    for m in range(LANES):
        for k in range(3):
            out[k, m] = axes[k, 0] * s[0, m] + axes[k, 1] * s[1, m] + axes[k, 2] * s[2, m]
            out[3 + k, m] = axes[k, 0] * s[3, m] + axes[k, 1] * s[4, m] + axes[k, 2] * s[5, m]
        out[3, m] -= turn[1] * out[2, m] - turn[2] * out[1, m]
        out[4, m] -= turn[2] * out[0, m] - turn[0] * out[2, m]
        out[5, m] -= turn[0] * out[1, m] - turn[1] * out[0, m]


@kernel()
def inertial(axes, turn, r, out):
    """Fill `out` (6,) with the inertial difference from the chief of a state in its axes."""
    vx = r[3] + turn[1] * r[2] - turn[2] * r[1]
    vy = r[4] + turn[2] * r[0] - turn[0] * r[2]
    vz = r[5] + turn[0] * r[1] - turn[1] * r[0]
    for k in range(3):
        out[k] = axes[0, k] * r[0] + axes[1, k] * r[1] + axes[2, k] * r[2]
        out[3 + k] = axes[0, k] * vx + axes[1, k] * vy + axes[2, k] * vz


@kernel(inline=True)
def draw(course, lanes, step, events):
    """Load the errors of the planned thrust and of the feedback thrust in a step."""
    for m in range(len(events)):
        own, back = course.burns[int(lanes[CRAFT, m]), step], course.led[step]
        for k in range(4):
            lanes[OWN + k, m] = events[m, own, k]
            lanes[BACK + k, m] = events[m, back, k] if back >= 0 else 0.0


@kernel()
def shake(course, lanes, step, pushes):
    """Add the process noise of a step, given as state increments in the chief's axes."""
    axes, turn, added = course.axes[2 * step + 2], course.turn[2 * step + 2], stack_vector(6)
    for m in range(len(pushes)):
        inertial(axes, turn, pushes[m, step], added)
        for k in range(6):
            lanes[Y + k, m] += added[k]


@kernel(inline=True)
def push(course, lanes, step, half, weight, u, back, out):
    """Fill `out` (3, LANES) with the inertial thrust in a step; add its weighted size to the delta-v."""
    law, axes = course.law[course.rows[step] + half], course.axes[2 * step + half]
    for m in range(LANES):
        for axis in range(3):
            u[axis, m] = course.commanded[int(lanes[CRAFT, m]), step, half, axis]
            back[axis, m] = 0.0
            for k in range(6):
                back[axis, m] += law[axis, k] * lanes[COUNTED + k, m]
    for m in range(LANES):
        x, y, z = u[0, m] + back[0, m], u[1, m] + back[1, m], u[2, m] + back[2, m]
        size, most = sqrt(x * x + y * y + z * z), lanes[LIMIT, m]
        share = most / size if size > most else 1.0
        lanes[SPENT, m] += weight * min(size, most)
        lanes[SPENT + 1, m] += weight if size > most else 0.0
        x, y, z = erred(lanes, m, BACK, share * back[0, m], share * back[1, m], share * back[2, m])
        u[0, m], u[1, m], u[2, m] = erred(lanes, m, OWN, share * u[0, m], share * u[1, m], share * u[2, m])
        u[0, m], u[1, m], u[2, m] = u[0, m] + x, u[1, m] + y, u[2, m] + z
    if course.thrusters.shape[1] > 0:
        for m in range(LANES):
            for k in range(3):
                u[k, m] += lanes[BURN + k, m]
    for m in range(LANES):
        for k in range(3):
            out[k, m] = axes[0, k] * u[0, m] + axes[1, k] * u[1, m] + axes[2, k] * u[2, m]


@kernel()
def miss(gates, drawn, fired):
    """Add the execution error to an impulse, from three normal numbers.

    theory (50)
    """
    square = fired[0] * fired[0] + fired[1] * fired[1] + fired[2] * fired[2]
    if square == 0.0:
        return
    along = sqrt(gates[0] * gates[0] + gates[1] * gates[1] * square)
    across = sqrt(gates[2] * gates[2] + gates[3] * gates[3] * square)
    ahead = (drawn[0] * fired[0] + drawn[1] * fired[1] + drawn[2] * fired[2]) * (along - across) / square
    for k in range(3):
        fired[k] += across * drawn[k] + ahead * fired[k]


@kernel()
def kick_all(course, lanes, node, events, impulses, here):
    """Apply the impulses at a node to lanes and to states `here` (6, LANES) in the chief's axes.

    Planned impulses and corrections are fired and recorded in `impulses` (W, Q, 3). With thrusters, orders
    replace them.
    """
    fired, axes = stack_vector(3), course.axes[2 * node]
    for m in range(len(impulses)):
        i = int(lanes[CRAFT, m])
        if course.thrusters.shape[1] > 0:
            if course.kicks[node] >= 0:
                order(course, lanes, m, node, fired)
                for k in range(3):
                    impulses[m, course.fires[node], k] = fired[k]
            continue
        correct(course, lanes, m, node, fired)
        for k in range(3):
            fired[k] += course.jumps[i, node, k]
        size = sqrt(fired[0] * fired[0] + fired[1] * fired[1] + fired[2] * fired[2])
        if size < course.bits[i]:
            continue
        lanes[SPENT, m] += size
        fired[0], fired[1], fired[2] = erred(lanes, m, NONE, fired[0], fired[1], fired[2])
        if events.shape[1] > 0:
            miss(course.gates[i], events[m, course.struck[node]], fired)
        for k in range(3):
            impulses[m, course.fires[node], k] = fired[k]
            here[3 + k, m] += fired[k]
            lanes[Y + 3 + k, m] += axes[0, k] * fired[0] + axes[1, k] * fired[1] + axes[2, k] * fired[2]


@kernel()
def measure(course, lanes, node, wrong, here):
    """Measure the deviations of states `here` (6, LANES) from the plan, with errors `wrong` (W, M, 6)."""
    for m in range(len(wrong)):
        i = int(lanes[CRAFT, m])
        for k in range(6):
            jump = course.jumps[i, node, k - 3] if k > 2 else 0.0
            off = here[k, m] - course.planned[i, node, k]
            lanes[SEEN + k, m] = off + wrong[m, course.looks[node], k] + jump


@kernel()
def answer(late, lanes):
    """Put the last measurement into effect, propagated to now with the thrust applied since then."""
    found = stack_matrix(6, LANES)
    for m in range(LANES):
        for axis in range(6):
            found[axis, m] = 0.0
            for k in range(6):
                found[axis, m] += late[0, axis, k] * lanes[SEEN + k, m]
                found[axis, m] += late[1, axis, k] * lanes[COUNTED + k, m]
    for m in range(LANES):
        for k in range(6):
            lanes[COUNTED + k, m] = found[k, m]


@kernel()
def advance(constants, course, step, lanes):
    """Integrate one step with the classical fourth-order Runge-Kutta method."""
    u, thrust, force = stack_matrix(3, LANES), stack_matrix(3, LANES), stack_matrix(3, LANES)
    back = stack_matrix(3, LANES)
    middle, rate, after = stack_matrix(6, LANES), stack_matrix(6, LANES), stack_matrix(6, LANES)
    for m in range(LANES):
        for k in range(6):
            rate[k, m], after[k, m] = 0.0, lanes[Y + k, m]
    h = course.steps[step]
    for stage in range(4):
        half = (stage + 1) // 2
        share, weight = 0.5 * h * half, h / 6.0 if stage in (0, 3) else h / 3.0
        if stage != 2:  # both middle stages have the same thrust
            push(course, lanes, step, half, h / 6.0 if stage != 1 else h / 1.5, u, back, thrust)
        node = 2 * step + half
        place, speed, felt = course.places[node], course.speeds[node], course.felt[node]
        for m in range(LANES):
            for k in range(3):
                middle[k, m] = place[k] + (lanes[Y + k, m] + share * rate[k, m])
                rate[k, m] = lanes[Y + 3 + k, m] + share * rate[3 + k, m]
                middle[3 + k, m] = speed[k] + rate[k, m]
        pull_all(constants, lanes[BALLISTIC], middle, force)
        if course.beyond.shape[1] > 0:
            for m in range(LANES):
                for k in range(3):
                    force[k, m] += course.beyond[int(lanes[CRAFT, m]), step, half, k]
        for m in range(LANES):
            for k in range(3):
                rate[3 + k, m] = force[k, m] - felt[k] + thrust[k, m]
                after[k, m] += weight * rate[k, m]
                after[3 + k, m] += weight * rate[3 + k, m]
    for m in range(LANES):
        for k in range(6):
            lanes[Y + k, m] = after[k, m]


@kernel()
def begin(course, first, errors, now, spent, lanes):
    """Fill lanes with rows from `first` on; repeat the last row if there are fewer."""
    there = stack_vector(6)
    for m in range(LANES):
        row = min(first + m, len(now) - 1)
        i = row % len(course.ballistics)
        inertial(course.axes[0], course.turn[0], now[row], there)
        lanes[CRAFT, m], lanes[LIMIT, m], lanes[BALLISTIC, m] = i, course.limits[i], course.ballistics[i]
        for k in range(6):
            lanes[Y + k, m], lanes[COUNTED + k, m], lanes[SEEN + k, m] = (
                there[k],
                now[row, 6 + k],
                now[row, 12 + k],
            )
        for k in range(4):
            lanes[ERROR + k, m] = errors[row, k]
        for k in range(2):
            lanes[SPENT + k, m] = spent[row, k]
        for k in range(ORDER, LANE):
            lanes[k, m] = 0.0


@kernel(void(float64[::1], COURSE, BLOCKS, ROWS, BLOCKS, BLOCKS, ROWS, BLOCKS, BLOCKS, ROWS))
def fly_all(constants, course, wrong, errors, events, pushes, now, states, impulses, spent):
    """Simulate R = S N times, N craft per simulation, from `now` (R, 18), which receives the last values.

    `now` holds the states before impulses in the chief's axes, the deviations in effect for feedback, and
    those measured. Fills `states` (R, T, 6) at output nodes, after impulses. `impulses` (R, Q, 3) [m/s] are
    planned impulses, or delta-v that thrusters are ordered to give from that time on. Adds the delta-v [m/s]
    and the time at the thrust limit [s] to `spent` (R, 2). Measurements have errors `wrong` (R, M, 6); thrust
    has `errors` (R, 4), of its size and a small rotation. `events` (R, E, 4) are the same for continuous
    burns, and normal numbers for impulses. Process noise adds `pushes` (R, K or 0, 6) to the states at the
    end of each step.
    """
    course = lent(course)
    wrong, errors, events, now = borrowed(wrong), borrowed(errors), borrowed(events), borrowed(now)
    pushes = borrowed(pushes)
    states, impulses, spent = borrowed(states), borrowed(impulses), borrowed(spent)
    steps, lanes, here = len(course.steps), stack_matrix(LANE, LANES), stack_matrix(6, LANES)
    for first in range(0, len(now), LANES):
        some = slice(first, first + LANES)
        begin(course, first, errors, now, spent, lanes)
        for node in range(steps + 1):
            looks, answers = course.looks[node], course.answers[node]
            relative(course.axes[2 * node], course.turn[2 * node], lanes, here)
            if answers >= 0 and answers != looks:
                answer(course.late, lanes)
            if looks >= 0:
                measure(course, lanes, node, wrong[some], here)
                if answers == looks:
                    answer(course.late, lanes)
            if course.fires[node] >= 0:
                kick_all(course, lanes, node, events[some], impulses[some], here)
            if course.shown[node] >= 0:
                for m in range(min(LANES, len(now) - first)):
                    for k in range(6):
                        states[first + m, course.shown[node], k] = here[k, m]
            if node < steps:
                if events.shape[1] > 0:
                    draw(course, lanes, node, events[some])
                if course.thrusters.shape[1] > 0:
                    burn_all(course, lanes, node)
                advance(constants, course, node, lanes)
                if pushes.shape[1] > 0:
                    shake(course, lanes, node, pushes[some])
        for m in range(min(LANES, len(now) - first)):
            for k in range(6):
                now[first + m, k] = here[k, m]
                now[first + m, 6 + k], now[first + m, 12 + k] = lanes[COUNTED + k, m], lanes[SEEN + k, m]
            for k in range(2):
                spent[first + m, k] = lanes[SPENT + k, m]
