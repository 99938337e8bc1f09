r"""Exact collision probability for one or two independent errors, by lines through the space of errors.

The trajectories of errors x e along a line are, at a time t, the points m(t) + x c(t) of a line, and those
inside a ball form an interval of x. Over time, intervals begin, move and end. The trajectories that are ever
inside form their union. Those that enter are in an interval when it begins, or are swept by an end that moves
outward, which it does where its own trajectory moves inward.

           x |      ____hi
             |   __/    \____        entries: from `first` on upward along hi, downward along lo
             |  (first        )
             |   \__lo_____/
             +--------------------- t

One error is a line. For two, the result is integrated over the angle of lines through the centre of their
plane; the integral is split at the angles where the zone, seen in the space of errors, is widest.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from math import erf, erfc, exp, expm1, sqrt

import numpy as np
from numba import boolean, float64, void

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.kernel_loans import borrowed, stack_matrix, stack_vector
from closeform.motion.chief.bernstein import TERMS
from closeform.uncertainty.collision.expected_entries import integral
from closeform.uncertainty.collision.sampled_trajectories import SampledTrajectories
from closeform.uncertainty.collision.short_encounter import probability_inside
from closeform.uncertainty.table_windows import polynomial_state

BIG = 40.0  # standard deviations: the probability beyond is negligible
NOTHING = 1e-9  # of the zone: a smaller effect of an error is negligible
SAMPLES = 512  # samples in an orbit (or a window or a piece, in deep space); at most one event between two
TURN = 0.2  # largest relative change of a line's direction between samples
FINEST = 1.0 / 4096.0  # of a sample's time: smallest step, where a line passes through zero length
HALVINGS = 50  # bisections of a sample's time for the start of an interval, or the reversal of an end
MOST = 1024  # maximum number of disjoint intervals of a line

AT_START, EVER, ENTRIES = 0, 1, 2  # columns of the result of a line
MET, LOW, HIGH, LEAST, GREATEST, SPANS, ENTERED = 0, 1, 2, 3, 4, 5, 6  # entries of `run`, the current state
THIN = 1e-7, 1e-6  # of the largest effect, and of the zone: rounding of a singular covariance
LINE = 1e-6  # relative half-interval of the probability for one error
PLANE = 1e-5  # the same for two errors
EVEN = np.linspace(0.0, np.pi, 13)


@kernel()
def weight(low, high, plane):
    """Return the probability of an interval of a line: a normal number, or (twice) a ray's in a plane."""
    if not low < high:
        return 0.0
    if high <= 0.0:
        low, high = -high, -low
    if plane:
        if low >= 0.0:
            return -0.5 * exp(-0.5 * low * low) * expm1(0.5 * (low - high) * (low + high))
        return -0.5 * (expm1(-0.5 * low * low) + expm1(-0.5 * high * high))
    if low >= 0.0:
        return 0.5 * (erfc(low / sqrt(2.0)) - erfc(high / sqrt(2.0)))
    return 0.5 * (erf(high / sqrt(2.0)) - erf(low / sqrt(2.0)))


@kernel()
def place_line(mean, line, t, at):
    """Fill `at` (4, 3) with a line at a time of a window: midpoint, direction, and the rates of both."""
    at[0, 0], at[0, 1], at[0, 2], at[2, 0], at[2, 1], at[2, 2] = polynomial_state(mean, t)
    at[1, 0], at[1, 1], at[1, 2], at[3, 0], at[3, 1], at[3, 2] = polynomial_state(line, t)


@kernel()
def dot(a, b):
    """Return the dot product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel()
def inward(at, x):
    """Return half the rate of the squared distance of a trajectory: below 0 where it moves inward."""
    total = 0.0
    for i in range(3):
        total += (at[0, i] + x * at[1, i]) * (at[2, i] + x * at[3, i])
    return total


@kernel()
def nearest(at):
    """Return the trajectory of the line nearest to the centre, and how deep it is within the ball."""
    a = dot(at[1], at[1])
    x = -dot(at[0], at[1]) / a if a > NOTHING * NOTHING else 0.0
    square = 0.0
    for i in range(3):
        p = at[0, i] + x * at[1, i]
        square += p * p
    return x, 1.0 - square


@kernel()
def inside_range(at):
    """Return the errors between which trajectories are inside: (low, high), low above high for none."""
    x, depth = nearest(at)
    if depth < 0.0:
        return 1.0, -1.0
    a = dot(at[1], at[1])
    half = sqrt(depth / a) if a > NOTHING * NOTHING else 2.0 * BIG
    return min(max(x - half, -BIG), BIG), min(max(x + half, -BIG), BIG)


@kernel()
def add_span(spans, run):
    """Add an interval that ended to the union; the stored ones are disjoint, in no order."""
    low, high, kept = run[LEAST], run[GREATEST], 0
    for k in range(int(run[SPANS])):
        if spans[k, 0] <= high and low <= spans[k, 1]:
            low, high = min(low, spans[k, 0]), max(high, spans[k, 1])
        else:
            spans[kept, 0], spans[kept, 1] = spans[k, 0], spans[k, 1]
            kept += 1
    kept = min(kept, MOST - 1)
    spans[kept, 0], spans[kept, 1] = low, high
    run[SPANS] = kept + 1


@kernel()
def begin(run, low, high, plane):
    """Begin an interval."""
    run[MET], run[LOW], run[HIGH], run[LEAST], run[GREATEST] = 1.0, low, high, low, high
    run[ENTERED] += weight(low, high, plane)


@kernel()
def finish(spans, run):
    """End the interval."""
    if run[MET] > 0.0:
        add_span(spans, run)
    run[MET] = 0.0


@kernel()
def move_end(run, side, x, plane):
    """Move an end of the interval monotonically; `side` is LOW or HIGH."""
    out = weight(x, run[LOW], plane) if side == LOW else weight(run[HIGH], x, plane)
    run[ENTERED] += out
    run[side] = x
    run[LEAST], run[GREATEST] = min(run[LEAST], x), max(run[GREATEST], x)


@kernel()
def move_ends(mean, line, t, stop, outward, outward_then, at, run, plane):
    """Move both ends from t to `stop`, where `at` is the line; each may reverse once.

    `outward`, `outward_then` (LOW and HIGH): below 0 if an end moves outward, at t and at `stop`.
    """
    low, high = inside_range(at)
    for side in (LOW, HIGH):
        if outward[side] * outward_then[side] < 0.0:
            first, last = t, stop
            turned = run[side]
            for _ in range(HALVINGS):
                middle = 0.5 * (first + last)
                place_line(mean, line, middle, at)
                one, other = inside_range(at)
                if one > other:
                    break
                turned = one if side == LOW else other
                if inward(at, turned) * outward[side] > 0.0:
                    first = middle
                else:
                    last = middle
            move_end(run, side, turned, plane)
        move_end(run, side, low if side == LOW else high, plane)


@kernel()
def contact_time(mean, line, t, stop, met, at):
    """Return the time between two at which a line begins or ceases to meet the ball; `at` is it then."""
    for _ in range(HALVINGS):
        middle = 0.5 * (t + stop)
        place_line(mean, line, middle, at)
        if (nearest(at)[1] >= 0.0) == met:
            t = middle
        else:
            stop = middle
    inner = t if met else stop
    place_line(mean, line, inner, at)
    return inner


@kernel()
def deepest(mean, line, t, stop, at):
    """Return the time between two at which a line is nearest to the centre, with the line in `at`."""
    for _ in range(HALVINGS):
        middle = 0.5 * (t + stop)
        place_line(mean, line, middle, at)
        if inward(at, nearest(at)[0]) < 0.0:
            t = middle
        else:
            stop = middle
    place_line(mean, line, t, at)
    return t


@kernel()
def advance(mean, line, t, stop, before, after, at, outward, spans, run, plane):
    """Advance from one sample to the next, where the line is `before` and `after`."""
    low, high = inside_range(after)
    met, meets = run[MET] > 0.0, low <= high
    if met and meets:
        if dot(before[1], after[1]) < 0.0 and (low > run[HIGH] or high < run[LOW]):
            # through infinity, and back from the other side
            far = BIG if run[LOW] + run[HIGH] > 0.0 else -BIG
            move_end(run, LOW, far, plane)
            move_end(run, HIGH, far, plane)
            finish(spans, run)
            begin(run, -far, -far, plane)
            move_end(run, LOW, low, plane)
            move_end(run, HIGH, high, plane)
            return
        for side in (LOW, HIGH):
            outward[0, side] = inward(before, run[side])
        outward[1, LOW], outward[1, HIGH] = inward(after, low), inward(after, high)
        copy(after, at)
        move_ends(mean, line, t, stop, outward[0], outward[1], at, run, plane)
    elif met:
        for side in (LOW, HIGH):
            outward[0, side], outward[1, side] = inward(before, run[side]), 1.0
        last = contact_time(mean, line, t, stop, True, at)
        move_ends(mean, line, t, last, outward[0], outward[1], at, run, plane)
        finish(spans, run)
    elif meets:
        first = contact_time(mean, line, t, stop, False, at)
        low, high = inside_range(at)
        begin(run, low, high, plane)
        outward[0, LOW], outward[0, HIGH] = -1.0, -1.0
        low, high = inside_range(after)
        outward[1, LOW], outward[1, HIGH] = inward(after, low), inward(after, high)
        copy(after, at)
        move_ends(mean, line, first, stop, outward[0], outward[1], at, run, plane)


@kernel()
def copy(source, target):
    """Copy one line's state into another's."""
    for i in range(4):
        for k in range(3):
            target[i, k] = source[i, k]


@kernel()
def comes_between(before, after):
    """Return True if a line that misses the ball at two samples may meet it in between."""
    return inward(before, nearest(before)[0]) < 0.0 < inward(after, nearest(after)[0])


@kernel()
def sample_time(turn, at):
    """Return the part of a window to the next sample; the window takes `turn` of a revolution."""
    base = 1.0 / (SAMPLES * turn)
    size, rate = sqrt(dot(at[1], at[1])), sqrt(dot(at[3], at[3]))
    if TURN * size < base * rate:
        return max(TURN * size / rate, FINEST * base)
    return base


@kernel()
def follow_line(turns, windows, way, plane, result):
    """Write the probabilities to begin inside and to be ever inside, and the expected entries."""
    line, spans = stack_matrix(TERMS, 3), np.empty((MOST, 2))
    before, between = stack_matrix(4, 3), stack_matrix(4, 3)
    after, at = stack_matrix(4, 3), stack_matrix(4, 3)
    outward, run = stack_matrix(2, 3), stack_vector(7)
    for k in range(7):
        run[k] = 0.0
    for w in range(len(windows)):
        mean = windows[w, 0]
        for k in range(TERMS):
            for i in range(3):
                line[k, i] = 0.0
                for j in range(len(way)):
                    line[k, i] += way[j] * windows[w, j + 1, k, i]
        place_line(mean, line, 0.0, before)
        if w == 0:
            low, high = inside_range(before)
            if low <= high:
                begin(run, low, high, plane)
            result[AT_START] = run[ENTERED]
            run[ENTERED] = 0.0
        t = 0.0
        while t < 1.0:
            stop = min(1.0, t + sample_time(turns[w], before))
            place_line(mean, line, stop, after)
            if run[MET] == 0.0 and nearest(after)[1] < 0.0 and comes_between(before, after):
                middle = deepest(mean, line, t, stop, at)
                if nearest(at)[1] >= 0.0:
                    copy(at, between)
                    advance(mean, line, t, middle, before, between, at, outward, spans, run, plane)
                    copy(between, before)
                    t = middle
            advance(mean, line, t, stop, before, after, at, outward, spans, run, plane)
            copy(after, before)
            t = stop
    finish(spans, run)
    result[EVER], result[ENTRIES] = 0.0, run[ENTERED]
    for k in range(int(run[SPANS])):
        result[EVER] += weight(spans[k, 0], spans[k, 1], plane)


@kernel(void(float64[::1], float64[:, :, :, ::1], float64[:, ::1], boolean, float64[:, ::1]))
def follow_lines(turns, windows, directions, plane, out):
    """Write the results (K, 3) of `follow_line` for each line of errors along `directions` (K, M).

    `plane`: weighted as lines through the centre of a plane, for a mean over all directions.
    """
    windows, directions, out = borrowed(windows), borrowed(directions), borrowed(out)
    for p in range(len(directions)):
        follow_line(turns, windows, directions[p], plane, out[p])


@dataclass(frozen=True, eq=False)
class LowRankProbability:
    """Probabilities to be inside at the start and ever inside, and the expected number of entries.

    `off` is their relative error.
    """

    at_start: float
    ever: float
    entries: float
    off: float

    @classmethod
    def of(cls, sampled: SampledTrajectories, directions: Floats) -> LowRankProbability:
        """Return the result for one or two orthonormal directions of errors (1 or 2, M), or zeros."""
        if len(directions) == 1:
            at_start, ever, entries = map(float, _along_lines(sampled, directions, plane=False)[0])
            return cls(at_start, ever, entries, LINE)
        edges = _split_angles(sampled, directions)
        within, entered = (
            integral(partial(_at_angles, sampled, directions, what), edges, PLANE) for what in (EVER, ENTRIES)
        )
        at_start, _ = probability_inside(sampled, float(sampled.edges[0]))
        off = PLANE + (within.error / within.value if within.value > 0.0 else 0.0)
        return cls(at_start, min(within.value / np.pi, 1.0), entered.value / np.pi, off)


def _at_angles(sampled: SampledTrajectories, directions: Floats, what: int, angles: Floats) -> Floats:
    """Return one result of lines through the centre of a plane, at the given angles (K,)."""
    along = np.cos(angles)[:, None] * directions[0] + np.sin(angles)[:, None] * directions[1]
    return np.asarray(_along_lines(sampled, along, plane=True)[:, what])


def _along_lines(sampled: SampledTrajectories, directions: Floats, plane: bool) -> Floats:
    """Return the results of lines along some directions (K, M): (K, 3)."""
    out = np.empty((len(directions), 3))
    follow_lines(sampled.turns, sampled.windows, np.ascontiguousarray(directions), plane, out)
    return out


def low_rank_directions(sampled: SampledTrajectories) -> Floats | None:
    """Return the 1 or 2 error directions (K, M) that displace the craft.

    Return one row of zeros if no error displaces them, and None if there are more than two directions.
    """
    moved = _effects(sampled)[1].reshape(-1, len(sampled.columns))
    _, sizes, directions = np.linalg.svd(moved / np.sqrt(len(moved) / 3), full_matrices=False)
    if sizes[0] <= NOTHING:
        return np.zeros((1, moved.shape[1]))
    many = 1 + int((sizes[1:] > max(NOTHING, min(THIN[0] * sizes[0], THIN[1]))).sum())
    return np.ascontiguousarray(directions[:many]) if many <= 2 else None


def _effects(sampled: SampledTrajectories) -> tuple[Floats, Floats]:
    """Return positions (T, 3) and the effect of each error (T, 3, M) over time, in zone coordinates."""
    mean, factor = sampled.states(sampled.spread(SAMPLES))
    matrix = sampled.zone.matrix
    return mean[:, :3] @ matrix.T, np.einsum("ij,tjm->tim", matrix, factor[:, :3])


def _split_angles(sampled: SampledTrajectories, directions: Floats) -> Floats:
    """Return angles from 0 to pi, including the extremes of those between which lines meet the zone."""
    middle, moved = _effects(sampled)
    both = moved @ directions.T  # (T, 3, 2)
    along = np.einsum("ti,tij->tj", middle, both)
    # a line along e meets the ball where e K e >= 0
    square = (middle**2).sum(axis=1)[:, None, None] - 1.0
    form = along[:, :, None] * along[:, None, :] - square * np.einsum("tij,tik->tjk", both, both)
    mid, swing = (
        0.5 * (form[:, 0, 0] + form[:, 1, 1]),
        np.stack([0.5 * (form[:, 0, 0] - form[:, 1, 1]), form[:, 0, 1]]),
    )
    size = np.hypot(*swing)
    some = np.abs(mid) < size
    axis = np.unwrap(np.arctan2(swing[1], swing[0]))
    half = np.arccos(np.divide(-mid, size, out=np.zeros_like(mid), where=some))
    found = [EVEN]
    change = np.flatnonzero(np.diff(some.astype(int), prepend=0, append=0))
    for first, last in change.reshape(-1, 2):
        for track in ((axis - half)[first:last], (axis + half)[first:last]):
            rate = np.sign(np.diff(track))
            turns = 1 + np.flatnonzero(rate[1:] != rate[:-1])
            found.append(0.5 * track[[0, *turns, len(track) - 1]] % np.pi)
    edges = np.unique(np.concatenate(found))
    return np.asarray(edges[np.concatenate([[True], np.diff(edges) > 1e-9])])
