"""Integration of simulations in a force model: thrust, impulses, thruster burns, feedback and process noise.

The integrated state is the difference from the chief, whose own motion is known. The error of a fourth-order
step is then proportional to that difference. Simulations run in parallel lanes, one column each: shared data
is read once for all of them, and loops over lanes become vector instructions.
"""

from math import cos, inf, sin, sqrt
from typing import Any, NamedTuple

from numba import float64, int64, types, void

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.dynamics.force_model.forces import accelerate_lanes
from closeform.kernel_loans import borrowed, lent, stack_matrix, stack_vector

LANES = 16  # simulations in parallel
# Rows of lanes: inertial state relative to the chief, deviation in effect, deviation measured, constant
# errors of thrust, delta-v and time at the limit, spacecraft, its thrust limit and ballistic coefficient,
# thruster order and its burn, errors of the planned burn, errors of the feedback burn, and zeros.
Y, BELIEVED, SEEN, ERROR, SPENT, CRAFT, LIMIT, BALLISTIC = 0, 6, 12, 18, 22, 24, 25, 26
ORDER, BURN, OWN, BACK, NONE, LANE = 27, 36, 39, 43, 47, 51
SIDE, BIT, STRENGTH, THRUSTER = 0, 3, 4, 5  # of a thruster: direction, minimum bit, acceleration
CORNER, INVERSE, FACET = 0, 3, 12  # of a facet: its thrusters, and the inverse of their directions


class Steps(NamedTuple):
    """K steps of all simulations of N spacecraft: the motion of the chief, and the commands.

    With M sets of thrusters there is one spacecraft.
    """

    lengths: Floats  # (K,) [s]
    positions: Floats  # (2 K + 1, 3) [m] of the chief at half steps, inertial
    velocities: Floats  # (2 K + 1, 3) [m/s]
    accelerations: Floats  # (2 K + 1, 3) [m/s^2], acceleration of the chief
    axes: Floats  # (2 K + 1, 3, 3)
    rotation: Floats  # (2 K + 1, 3) [rad/s]
    thrust: Floats  # (N, K, 3, 3) [m/s^2] at start, middle and end of each step, in the chief's axes
    # (N, K or 0, 3, 3) [m/s^2] at the same times, inertial: forces that kernels cannot compute
    extra: Floats
    planned_impulses: Floats  # (N, K + 1, 3) [m/s], in the chief's axes
    reference: Floats  # (N, K + 1, 6) [m, m/s], after jumps
    measurements: Any  # (K + 1,) index of the measurement made, or -1
    updates: Any  # (K + 1,) index of the measurement that takes effect, or -1
    prediction: (
        Floats  # (2, 6, 6): transitions then of the measured deviation and of the one in effect before
    )
    law_rows: Any  # (K,) row of the law at the start of each step
    law: Floats  # (L, 3, 6): gains at start, middle and end of a step, from deviation to thrust
    feedback_impulses: Any  # (K + 1,) index of the gain of an impulse, or -1
    impulse_gains: Floats  # (G, 3, 6): gains from deviation to impulse
    outputs: Any  # (K + 1,) row of the states that is filled, or -1
    impulses: Any  # (K + 1,) row of the impulses that is filled, or -1
    ballistics: Floats  # (N,) [m^2/kg]
    limits: Floats  # (N, K + 1) [m/s^2] from each node on, 0 without an engine
    minimum_bit: float  # [m/s]
    thrusters: Floats  # (M, J, 5), see SIDE to STRENGTH
    facets: Floats  # (M, F, 12), see CORNER and INVERSE
    angles: Floats  # (M, K + 1) [rad] from the frame of the thrusters to the chief's axes
    free: Floats  # (M, J, K + 1) [s], accumulated time without planned firing
    sets: Any  # (K + 1,) set of thrusters in use from a node on, or -1 for thrust in any direction
    order_ends: Any  # (K + 1,) node at which a thruster order ends
    planned_burns: Any  # (N, K) error event of the planned thrust in each step
    feedback_burns: Any  # (K,) error event of the feedback thrust in each step, or -1
    impulse_events: Any  # (K + 1,) error event of an impulse, or -1
    gates: Floats  # (N, 4) Gates parameters of its error: theory (50)


NUMBERS, ROWS, BLOCKS, WHICH = float64[::1], float64[:, ::1], float64[:, :, ::1], int64[::1]
EACH = int64[:, ::1]
FOUR = float64[:, :, :, ::1]
STEPS = types.NamedTuple(
    (
        *(NUMBERS, ROWS, ROWS, ROWS, BLOCKS, ROWS, FOUR, FOUR, BLOCKS, BLOCKS, WHICH),
        *(WHICH, BLOCKS, WHICH, BLOCKS),
        *(WHICH, BLOCKS, WHICH, WHICH, NUMBERS, ROWS, float64, BLOCKS, BLOCKS, ROWS),
        *(BLOCKS, WHICH, WHICH, EACH, WHICH, WHICH, ROWS),
    ),
    Steps,
)


@kernel(inline=True)
def with_errors(lanes, m, row, x, y, z):
    """Return a thrust or an impulse of a lane with its errors, common ones and those in a `row`."""
    grown, a = 1.0 + lanes[ERROR, m] + lanes[row, m], lanes[ERROR + 1, m] + lanes[row + 1, m]
    b, c = lanes[ERROR + 2, m] + lanes[row + 2, m], lanes[ERROR + 3, m] + lanes[row + 3, m]
    return grown * (x + b * z - c * y), grown * (y + c * x - a * z), grown * (z + a * y - b * x)


@kernel()
def feedback_impulse(steps, lanes, m, node, out):
    """Fill `out` (3,) with the feedback impulse for the deviation in effect."""
    for axis in range(3):
        out[axis] = 0.0
        if steps.feedback_impulses[node] >= 0:
            for k in range(6):
                out[axis] += (
                    steps.impulse_gains[steps.feedback_impulses[node], axis, k] * lanes[BELIEVED + k, m]
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
def load_errors(steps, lanes, step, events):
    """Load the errors of the planned thrust and of the feedback thrust in a step."""
    for m in range(len(events)):
        own, back = steps.planned_burns[int(lanes[CRAFT, m]), step], steps.feedback_burns[step]
        for k in range(4):
            lanes[OWN + k, m] = events[m, own, k]
            lanes[BACK + k, m] = events[m, back, k] if back >= 0 else 0.0


@kernel()
def add_noise(steps, lanes, step, pushes):
    """Add the process noise of a step, given as state increments in the chief's axes."""
    axes, turn, added = steps.axes[2 * step + 2], steps.rotation[2 * step + 2], stack_vector(6)
    for m in range(len(pushes)):
        inertial(axes, turn, pushes[m, step], added)
        for k in range(6):
            lanes[Y + k, m] += added[k]


@kernel(inline=True)
def thrust_of_step(steps, lanes, step, half, weight, u, back, out):
    """Fill `out` (3, LANES) with the inertial thrust in a step; add its weighted size to the delta-v.

    Planned pulses have no limit, and their delta-v is counted per thruster elsewhere.
    """
    law, axes = steps.law[steps.law_rows[step] + half], steps.axes[2 * step + half]
    free = steps.sets[step] < 0
    for m in range(LANES):
        for axis in range(3):
            u[axis, m] = steps.thrust[int(lanes[CRAFT, m]), step, half, axis]
            back[axis, m] = 0.0
            for k in range(6):
                back[axis, m] += law[axis, k] * lanes[BELIEVED + k, m]
    for m in range(LANES):
        x, y, z = u[0, m] + back[0, m], u[1, m] + back[1, m], u[2, m] + back[2, m]
        size = sqrt(x * x + y * y + z * z)
        most = lanes[LIMIT, m] if free | (lanes[LIMIT, m] == 0.0) else inf
        share = most / size if size > most else 1.0
        lanes[SPENT, m] += weight * min(size, most) if free else 0.0
        lanes[SPENT + 1, m] += weight if (size > most) & (most > 0.0) else 0.0
        x, y, z = with_errors(lanes, m, BACK, share * back[0, m], share * back[1, m], share * back[2, m])
        u[0, m], u[1, m], u[2, m] = with_errors(
            lanes, m, OWN, share * u[0, m], share * u[1, m], share * u[2, m]
        )
        u[0, m], u[1, m], u[2, m] = u[0, m] + x, u[1, m] + y, u[2, m] + z
    if not free:
        for m in range(LANES):
            for k in range(3):
                u[k, m] += lanes[BURN + k, m]
    for m in range(LANES):
        for k in range(3):
            out[k, m] = axes[0, k] * u[0, m] + axes[1, k] * u[1, m] + axes[2, k] * u[2, m]


@kernel()
def add_gates_error(gates, normal, fired):
    """Add the execution error to an impulse, from three normal numbers.

    theory (50)
    """
    square = fired[0] * fired[0] + fired[1] * fired[1] + fired[2] * fired[2]
    if square == 0.0:
        return
    along = sqrt(gates[0] * gates[0] + gates[1] * gates[1] * square)
    across = sqrt(gates[2] * gates[2] + gates[3] * gates[3] * square)
    ahead = (normal[0] * fired[0] + normal[1] * fired[1] + normal[2] * fired[2]) * (along - across) / square
    for k in range(3):
        fired[k] += across * normal[k] + ahead * fired[k]


@kernel()
def fire_impulses(steps, lanes, node, events, impulses, here):
    """Apply the impulses at a node to lanes and to states `here` (6, LANES) in the chief's axes.

    Planned impulses and corrections are fired and recorded in `impulses` (W, Q, 3). With thrusters, orders
    replace them.
    """
    fired, axes = stack_vector(3), steps.axes[2 * node]
    for m in range(len(impulses)):
        i = int(lanes[CRAFT, m])
        if not lanes[LIMIT, m] > 0.0:
            continue
        if steps.sets[node] >= 0:
            if steps.feedback_impulses[node] >= 0:
                order_thrusters(steps, lanes, m, node, fired)
                for k in range(3):
                    impulses[m, steps.impulses[node], k] = fired[k]
            continue
        feedback_impulse(steps, lanes, m, node, fired)
        for k in range(3):
            fired[k] += steps.planned_impulses[i, node, k]
        size = sqrt(fired[0] * fired[0] + fired[1] * fired[1] + fired[2] * fired[2])
        if size < steps.minimum_bit:
            continue
        lanes[SPENT, m] += size
        fired[0], fired[1], fired[2] = with_errors(lanes, m, NONE, fired[0], fired[1], fired[2])
        if events.shape[1] > 0:
            add_gates_error(steps.gates[i], events[m, steps.impulse_events[node]], fired)
        for k in range(3):
            impulses[m, steps.impulses[node], k] = fired[k]
            here[3 + k, m] += fired[k]
            lanes[Y + 3 + k, m] += axes[0, k] * fired[0] + axes[1, k] * fired[1] + axes[2, k] * fired[2]


@kernel(inline=True)
def facet_share(facet, k, x, y, z):
    """Return the part of a thrust vector that thruster `k` of a facet gives."""
    return x * facet[INVERSE + k] + y * facet[INVERSE + 3 + k] + z * facet[INVERSE + 6 + k]


@kernel()
def order_thrusters(steps, lanes, m, node, given):
    """Order the thrusters of a lane for the slot that begins at a node.

    The order holds for three thrusters: index, and on and off times, counted in time without planned firing
    and centred in the slot. `given` (3,) is the delta-v in the chief's axes, which is added to the spent one.
    A slot counts as limited if the thrusters cannot give the whole feedback.
    """
    used, until, v = steps.sets[node], steps.order_ends[node], stack_vector(3)
    feedback_impulse(steps, lanes, m, node, v)
    angle = 0.5 * (steps.angles[used, node] + steps.angles[used, until])
    c, s = cos(angle), sin(angle)
    x, y, z = c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]
    facets = steps.facets[used]
    best, least = 0, -1e300
    for f in range(len(facets)):
        lowest = 1e300
        for k in range(3):
            lowest = min(lowest, facet_share(facets[f], k, x, y, z))
        if lowest > least:
            best, least = f, lowest
    fx, fy, fz, short = 0.0, 0.0, 0.0, False
    for k in range(3):
        j = int(facets[best, CORNER + k])
        own, free = steps.thrusters[used, j], steps.free[used, j]
        q = facet_share(facets[best], k, x, y, z)
        most = own[STRENGTH] * (free[until] - free[node])
        if q < own[BIT] or q <= 0.0:
            q = 0.0
        elif q > most:
            q, short = most if most >= own[BIT] else 0.0, True
        half = 0.5 * q / own[STRENGTH] if q > 0.0 else 0.0
        middle = 0.5 * (free[node] + free[until])
        lanes[ORDER + 3 * k, m], lanes[ORDER + 3 * k + 1, m], lanes[ORDER + 3 * k + 2, m] = (
            j,
            middle - half,
            middle + half,
        )
        lanes[SPENT, m] += q
        fx, fy, fz = fx + q * own[SIDE], fy + q * own[SIDE + 1], fz + q * own[SIDE + 2]
    given[0], given[1], given[2] = c * fx + s * fy, c * fy - s * fx, fz
    if short:
        never = steps.free[used, steps.free.shape[1] - 1]
        lanes[SPENT + 1, m] += never[until] - never[node]


@kernel()
def burn_thrusters(steps, lanes, step):
    """Fill the mean thrust of ordered burns within a step, with errors."""
    used = steps.sets[step]
    for m in range(LANES):
        fx, fy, fz = 0.0, 0.0, 0.0
        for k in range(3):
            j = int(lanes[ORDER + 3 * k, m])
            free, own = steps.free[used, j], steps.thrusters[used, j]
            lasts = min(lanes[ORDER + 3 * k + 2, m], free[step + 1])
            lasts -= max(lanes[ORDER + 3 * k + 1, m], free[step])
            if lasts > 0.0:
                size = own[STRENGTH] * lasts / steps.lengths[step]
                fx, fy, fz = fx + size * own[SIDE], fy + size * own[SIDE + 1], fz + size * own[SIDE + 2]
        angle = 0.5 * (steps.angles[used, step] + steps.angles[used, step + 1])
        c, s = cos(angle), sin(angle)
        lanes[BURN, m], lanes[BURN + 1, m], lanes[BURN + 2, m] = with_errors(
            lanes, m, BACK, c * fx + s * fy, c * fy - s * fx, fz
        )


@kernel()
def measure(steps, lanes, node, wrong, here):
    """Measure the deviations of states `here` (6, LANES) from the plan, with errors `wrong` (W, M, 6)."""
    for m in range(len(wrong)):
        i = int(lanes[CRAFT, m])
        for k in range(6):
            jump = steps.planned_impulses[i, node, k - 3] if k > 2 else 0.0
            off = here[k, m] - steps.reference[i, node, k]
            lanes[SEEN + k, m] = off + wrong[m, steps.measurements[node], k] + jump


@kernel()
def update_feedback(late, lanes):
    """Put the last measurement into effect, propagated to now with the thrust applied since then."""
    found = stack_matrix(6, LANES)
    for m in range(LANES):
        for axis in range(6):
            found[axis, m] = 0.0
            for k in range(6):
                found[axis, m] += late[0, axis, k] * lanes[SEEN + k, m]
                found[axis, m] += late[1, axis, k] * lanes[BELIEVED + k, m]
    for m in range(LANES):
        for k in range(6):
            lanes[BELIEVED + k, m] = found[k, m]


@kernel()
def integrate_step(constants, steps, step, lanes):
    """Integrate one step with the classical fourth-order Runge-Kutta method."""
    u, thrust, force = stack_matrix(3, LANES), stack_matrix(3, LANES), stack_matrix(3, LANES)
    back = stack_matrix(3, LANES)
    middle, rate, after = stack_matrix(6, LANES), stack_matrix(6, LANES), stack_matrix(6, LANES)
    for m in range(LANES):
        for k in range(6):
            rate[k, m], after[k, m] = 0.0, lanes[Y + k, m]
    h = steps.lengths[step]
    for stage in range(4):
        half = (stage + 1) // 2
        share, weight = 0.5 * h * half, h / 6.0 if stage in (0, 3) else h / 3.0
        if stage != 2:  # both middle stages have the same thrust
            thrust_of_step(steps, lanes, step, half, h / 6.0 if stage != 1 else h / 1.5, u, back, thrust)
        node = 2 * step + half
        place, speed, chief = steps.positions[node], steps.velocities[node], steps.accelerations[node]
        for m in range(LANES):
            for k in range(3):
                middle[k, m] = place[k] + (lanes[Y + k, m] + share * rate[k, m])
                rate[k, m] = lanes[Y + 3 + k, m] + share * rate[3 + k, m]
                middle[3 + k, m] = speed[k] + rate[k, m]
        accelerate_lanes(constants, lanes[BALLISTIC], middle, force)
        if steps.extra.shape[1] > 0:
            for m in range(LANES):
                for k in range(3):
                    force[k, m] += steps.extra[int(lanes[CRAFT, m]), step, half, k]
        for m in range(LANES):
            for k in range(3):
                rate[3 + k, m] = force[k, m] - chief[k] + thrust[k, m]
                after[k, m] += weight * rate[k, m]
                after[3 + k, m] += weight * rate[3 + k, m]
    for m in range(LANES):
        for k in range(6):
            lanes[Y + k, m] = after[k, m]


@kernel()
def load_lanes(steps, first, begin, errors, lanes):
    """Fill lanes with rows from `first` onward; repeat the last row if there are fewer."""
    there = stack_vector(6)
    for m in range(LANES):
        row = min(first + m, len(begin) - 1)
        i = row % len(steps.ballistics)
        inertial(steps.axes[0], steps.rotation[0], begin[row], there)
        for k in range(LANE):
            lanes[k, m] = 0.0
        for k in range(6):
            lanes[Y + k, m] = there[k]
        for k in range(4):
            lanes[ERROR + k, m] = errors[row, k]
        lanes[CRAFT, m], lanes[BALLISTIC, m] = i, steps.ballistics[i]


@kernel()
def change_engines(steps, node, lanes):
    """Load the thrust limits from a node on; end the orders of thrusters that fail or are replaced there."""
    replaced = node > 0 and steps.sets[node] != steps.sets[node - 1]
    for m in range(LANES):
        lanes[LIMIT, m] = steps.limits[int(lanes[CRAFT, m]), node]
        if replaced or lanes[LIMIT, m] == 0.0:
            for k in range(ORDER, OWN):
                lanes[k, m] = 0.0


@kernel(void(float64[::1], STEPS, ROWS, BLOCKS, ROWS, BLOCKS, BLOCKS, BLOCKS, BLOCKS, ROWS))
def integrate(constants, steps, begin, wrong, errors, events, pushes, states, impulses, spent):
    """Integrate S simulations of N spacecraft, R = S N, from states `begin` (R, 6) before impulses.

    The states are in the chief's axes. Fills `states` (R, T, 6) at shown nodes, after `impulses` (R, Q, 3)
    [m/s], or the delta-v that thrusters are ordered to give from then on, and `spent` (R, 2), the delta-v
    [m/s] and the time at the thrust limit [s]. Measurements have errors `wrong` (R, M, 6); thrust has
    `errors` (R, 4), of its size and a small rotation. `events` (R, E, 4) are the same for continuous burns,
    and normal numbers for impulses. Process noise adds `pushes` (R, K or 0, 6) to the states at the end of
    each step.
    """
    steps = lent(steps)
    wrong, errors, events, begin = borrowed(wrong), borrowed(errors), borrowed(events), borrowed(begin)
    pushes = borrowed(pushes)
    states, impulses, spent = borrowed(states), borrowed(impulses), borrowed(spent)
    last, lanes, here = len(steps.lengths), stack_matrix(LANE, LANES), stack_matrix(6, LANES)
    for first in range(0, len(begin), LANES):
        some, count = slice(first, first + LANES), min(LANES, len(begin) - first)
        load_lanes(steps, first, begin, errors, lanes)
        for node in range(last + 1):
            measured, updated = steps.measurements[node], steps.updates[node]
            relative(steps.axes[2 * node], steps.rotation[2 * node], lanes, here)
            change_engines(steps, node, lanes)
            if updated >= 0 and updated != measured:
                update_feedback(steps.prediction, lanes)
            if measured >= 0:
                measure(steps, lanes, node, wrong[some], here)
                if updated == measured:
                    update_feedback(steps.prediction, lanes)
            if steps.impulses[node] >= 0:
                fire_impulses(steps, lanes, node, events[some], impulses[some], here)
            if steps.outputs[node] >= 0:
                for m in range(count):
                    for k in range(6):
                        states[first + m, steps.outputs[node], k] = here[k, m]
            if node < last:
                if events.shape[1] > 0:
                    load_errors(steps, lanes, node, events[some])
                if steps.sets[node] >= 0:
                    burn_thrusters(steps, lanes, node)
                integrate_step(constants, steps, node, lanes)
                if pushes.shape[1] > 0:
                    add_noise(steps, lanes, node, pushes[some])
        for m in range(count):
            for k in range(2):
                spent[first + m, k] = lanes[SPENT + k, m]
