"""The paths of many craft, each deflected by the forces of the contacts that it takes part in.

A contact of craft i and j pushes both with one force, opposite in sign.  The kernel of paths
with fixed ends (see `kernel`) belongs to a craft's own start and duration, so the answer of
contact k to contact m is a signed sum over the craft that they share, and nothing where they
share none: a sparse table of `links` (k, m).                             # theory 4, "many craft"
"""

import numpy as np
from numba import float64, int64, void

from closeform.compiled import kernel
from closeform.motion.arc import END, MEAN_MOTION, START, STATE, state_at
from closeform.motion.hill import coast, response
from closeform.planning.kernel import force_columns, invert_response, pull, relative, shape


@kernel(void(float64[:, ::1], float64[:, :, ::1]))
def prepare_all(base, inverses):
    """Fill `inverses` (N, 6, 6) with each craft's F(T)^-1."""
    work, rhs = np.empty((6, 6)), np.empty(6)
    for c in range(len(base)):
        invert_response(base[c, MEAN_MOTION], base[c, END] - base[c, START], inverses[c], work, rhs)


@kernel()
def feels(base, c, t):
    """Whether craft c answers to a force at time t: obstacles do not, nor craft that coast."""
    return c < len(base) and base[c, START] < t < base[c, END]


@kernel(
    void(
        float64[:, ::1],
        float64[:, :, ::1],
        int64[:, ::1],
        float64[::1],
        int64[:, ::1],
        float64[:, :, ::1],
        float64[:, :, ::1],
    )
)
def answers(base, inverses, pairs, times, links, blocks, rates):
    """Relative state at contact k after a unit force at contact m, and its derivative in m's time.

    For every link (k, m) fills `blocks` and `rates` (L, 6, 3); `pairs` (K, 2) are the craft of
    each contact, the force pushing the first and pulling the second.
    """
    count = len(times)
    pulls, pull_rates = np.zeros((count, 2, 6, 3)), np.zeros((count, 2, 6, 3))
    responses = np.zeros((count, 2, 6, 6))
    matrix, jump, jump_rate = np.empty((6, 6)), np.empty((6, 3)), np.empty((6, 3))
    for k in range(count):
        for side in range(2):
            c = pairs[k, side]
            if feels(base, c, times[k]):
                n = base[c, MEAN_MOTION]
                left = base[c, END] - times[k]
                pull(n, left, inverses[c], matrix, jump, jump_rate, pulls[k, side], pull_rates[k, side])
                response(n, times[k] - base[c, START], responses[k, side])
    for link in range(len(links)):
        k, m = links[link]
        blocks[link] = 0.0
        rates[link] = 0.0
        for a in range(2):
            for b in range(2):
                c = pairs[k, a]
                if c != pairs[m, b] or not (feels(base, c, times[k]) and feels(base, c, times[m])):
                    continue
                sign = 1.0 if a == b else -1.0
                force_columns(base[c, MEAN_MOTION], times[k] - times[m], matrix, jump, jump_rate)
                for i in range(6):
                    for j in range(3):
                        total, slope = jump[i, j], -jump_rate[i, j]
                        for h in range(6):
                            total += responses[k, a, i, h] * pulls[m, b, h, j]
                            slope += responses[k, a, i, h] * pull_rates[m, b, h, j]
                        blocks[link, i, j] += sign * total
                        rates[link, i, j] += sign * slope


@kernel()
def coast_row(n, start, end, state, row):
    """An arc of natural motion."""
    row[:] = 0.0
    row[START], row[END], row[MEAN_MOTION] = start, end, n
    for i in range(6):
        row[STATE + i] = state[i]


@kernel(
    void(
        float64[:, ::1],
        float64[:, :, ::1],
        int64[:, ::1],
        float64[::1],
        float64[:, ::1],
        float64,
        float64,
        float64[:, ::1],
        int64[::1],
    )
)
def deflect(base, inverses, pairs, times, pushes, first, last, arcs, offsets):
    """Paths of all craft from time `first` to `last` under the contacts' forces `pushes` (K, 3).

    Fills `arcs` and `offsets` (N + 1,): one arc more than a craft has contacts in its own time, and a
    coast before and after it where there is such time.
    """
    count = len(times)
    pulls, forces, own_times = np.empty((count, 6, 3)), np.empty((count, 3)), np.empty(count)
    matrix, jump, jump_rate = np.empty((6, 6)), np.empty((6, 3)), np.empty((6, 3))
    spare = np.empty((6, 3))
    row = 0
    for c in range(len(base)):
        offsets[c] = row
        n, start, end = base[c, MEAN_MOTION], base[c, START], base[c, END]
        if first < start:
            b = base[c]
            back = coast(n, first - start, b[6], b[7], b[8], b[9], b[10], b[11])
            coast_row(n, first, start, back, arcs[row])
            row += 1
        own = 0
        for k in range(count):
            for side in range(2):
                if pairs[k, side] == c and feels(base, c, times[k]):
                    pull(n, end - times[k], inverses[c], matrix, jump, jump_rate, pulls[own], spare)
                    own_times[own] = times[k]
                    for i in range(3):
                        forces[own, i] = pushes[k, i] if side == 0 else -pushes[k, i]
                    own += 1
        row += shape(base[c], pulls, own_times, forces, own, arcs[row:])
        if end < last:
            coast_row(n, end, last, state_at(arcs[row - 1], end), arcs[row])
            row += 1
    offsets[len(base)] = row


@kernel(
    void(
        float64[:, ::1],
        int64[::1],
        int64[:, ::1],
        float64[::1],
        float64[:, :, ::1],
        float64[:, :, ::1],
    )
)
def seen(arcs, offsets, pairs, times, matrices, motions):
    """Relative position, velocity and acceleration (K, 3, 3) of pairs at times, in zone coordinates."""
    for k in range(len(times)):
        i, j = pairs[k]
        rows = arcs[offsets[i] : offsets[i + 1]]
        relative(rows, len(rows), arcs, offsets[j], offsets[j + 1], matrices[k], times[k], motions[k])


@kernel(
    void(float64[:, ::1], float64[:, :, ::1], int64[:, ::1], float64[::1], float64[:, ::1], float64[:, ::1])
)
def compliances(base, inverses, pairs, times, along, gram):
    """How far a force along `along` (K, 3) at contact m moves the pair of contact k along its own.

    Fills `gram` (K, K), symmetric: the kernel between the earlier time of two and the later one is
    a product of what depends on the one and on the other alone.           # theory (12), t <= s
    """
    count = len(times)
    felt = np.zeros((count, 2), dtype=np.bool_)
    earlier, later = np.zeros((count, 2, 6)), np.zeros((count, 2, 6))
    matrix, jump, jump_rate = np.empty((6, 6)), np.empty((6, 3)), np.empty((6, 3))
    pulls, spare = np.empty((6, 3)), np.empty((6, 3))
    for k in range(count):
        for side in range(2):
            c = pairs[k, side]
            if not feels(base, c, times[k]):
                continue
            felt[k, side] = True
            n = base[c, MEAN_MOTION]
            pull(n, base[c, END] - times[k], inverses[c], matrix, jump, jump_rate, pulls, spare)
            response(n, times[k] - base[c, START], matrix)
            for j in range(6):
                for i in range(3):
                    earlier[k, side, j] += along[k, i] * matrix[i, j]
                    later[k, side, j] += pulls[j, i] * along[k, i]
    for k in range(count):
        for m in range(k + 1):
            first, last = (k, m) if times[k] <= times[m] else (m, k)
            total = 0.0
            for a in range(2):
                for b in range(2):
                    if pairs[first, a] == pairs[last, b] and felt[first, a] and felt[last, b]:
                        part = 0.0
                        for j in range(6):
                            part += earlier[first, a, j] * later[last, b, j]
                        total += part if a == b else -part
            gram[k, m] = gram[m, k] = total
