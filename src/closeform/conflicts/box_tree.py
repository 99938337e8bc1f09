"""Overlaps of boxes: a tree over boxes that contain spacecraft for an interval of their tracks.

A spacecraft is inside a box around its chord and its distance from that chord.  Boxes are halved along
their widest direction at the median, again and again, until few are left: a balanced tree without
pointers, in which node m of level l contains boxes m N / 2^l to (m + 1) N / 2^l.  Two nodes whose boxes do
not overlap contain no pair that meets, and their pairs are skipped.
"""

from math import inf

from numba import float64, int64

from closeform._jit import kernel
from closeform.conflicts.quick_rejection import CLEAR, OFF_CHORD, count_near
from closeform.kernel_loans import borrowed

LEAF = 8  # boxes of a node that is not divided
OPEN = 256  # nodes that may wait: three for each level and some
WIDTH = 7  # of a box: minimum and maximum coordinates, and the index of the spacecraft


@kernel()
def swap(boxes, i, j):
    for column in range(WIDTH):
        boxes[i, column], boxes[j, column] = boxes[j, column], boxes[i, column]


@kernel()
def select(boxes, first, last, middle, axis):
    """Sort boxes [first, last) partially: those before `middle` are below those behind it."""
    low, high = first, last - 1
    while low < high:
        centre = (low + high) // 2
        pivot = boxes[centre, axis] + boxes[centre, axis + 3]
        i, j = low, high
        while i <= j:
            while boxes[i, axis] + boxes[i, axis + 3] < pivot:
                i += 1
            while boxes[j, axis] + boxes[j, axis + 3] > pivot:
                j -= 1
            if i <= j:
                swap(boxes, i, j)
                i += 1
                j -= 1
        if middle <= j:
            high = j
        elif middle >= i:
            low = i
        else:
            return


@kernel()
def widest(boxes, first, last):
    """Return the direction in which the centres of boxes [first, last) are furthest apart."""
    best, found = -inf, 0
    for axis in range(3):
        least, most = inf, -inf
        for k in range(first, last):
            centre = boxes[k, axis] + boxes[k, axis + 3]
            least, most = min(least, centre), max(most, centre)
        if most - least > best:
            best, found = most - least, axis
    return found


@kernel()
def enclose(tracks, k, craft, boxes):
    """Fill `boxes` with the boxes of spacecraft in interval k."""
    for row in range(len(craft)):
        body = craft[row]
        reach = 0.5 * CLEAR + tracks[body, OFF_CHORD, k]
        for axis in range(3):
            begin, end = tracks[body, axis, k], tracks[body, axis, k + 1]
            low, high = min(begin, end) - reach, max(begin, end) + reach
            boxes[row, axis] = low if low > -inf else -inf  # nan is everywhere
            boxes[row, axis + 3] = high if high < inf else inf
        boxes[row, 6] = body


@kernel()
def first_box(node, number, depth):
    """Return the first box of a leaf among `number`; the last is before that of the next leaf."""
    return ((node - (1 << depth)) * number) >> depth


@kernel()
def grow(boxes, count, depth, nodes):
    """Sort the boxes into a tree, and fill the box of every node; node k has children 2 k and 2 k + 1."""
    for level in range(depth):
        for m in range(1 << level):
            first, last = (m * count) >> level, ((m + 1) * count) >> level
            select(boxes, first, last, ((2 * m + 1) * count) >> (level + 1), widest(boxes, first, last))
    for leaf in range(1 << depth, 2 << depth):
        for axis in range(3):
            least, most = inf, -inf
            for k in range(first_box(leaf, count, depth), first_box(leaf + 1, count, depth)):
                least, most = min(least, boxes[k, axis]), max(most, boxes[k, axis + 3])
            nodes[leaf, axis], nodes[leaf, axis + 3] = least, most
    for node in range((1 << depth) - 1, 0, -1):
        for axis in range(3):
            nodes[node, axis] = min(nodes[2 * node, axis], nodes[2 * node + 1, axis])
            nodes[node, axis + 3] = max(nodes[2 * node, axis + 3], nodes[2 * node + 1, axis + 3])


@kernel()
def follow_order(tracks, k, boxes, count, chords):
    """Copy the chords of interval k in the order of the boxes, so that neighbours are adjacent in memory."""
    for row in range(count):
        body = int(boxes[row, 6])
        for part in range(4):
            for side in range(2):
                chords[row, part, side] = tracks[body, part, k + side]


@kernel()
def overlap(boxes, i, others, j):
    return (
        (boxes[i, 0] <= others[j, 3])
        & (others[j, 0] <= boxes[i, 3])
        & (boxes[i, 1] <= others[j, 4])
        & (others[j, 1] <= boxes[i, 4])
        & (boxes[i, 2] <= others[j, 5])
        & (others[j, 2] <= boxes[i, 5])
    )


@kernel()
def compare(chords, total, boxes, number, depth, nodes, one, two, codes, count):
    """Append the pairs of two leaves that may meet; return the new count and the number of overlaps."""
    overlaps = 0
    for i in range(first_box(one, number, depth), first_box(one + 1, number, depth)):
        if not overlap(boxes, i, nodes, two):
            continue
        begin = i + 1 if one == two else first_box(two, number, depth)
        for j in range(begin, first_box(two + 1, number, depth)):
            if overlap(boxes, i, boxes, j):
                overlaps += 1
                if count_near(chords, i, chords, j, 0, 1) > 0:
                    own, other = int(boxes[i, 6]), int(boxes[j, 6])
                    codes[count] = min(own, other) * total + max(own, other)
                    count += 1
    return count, overlaps


@kernel(
    int64(
        float64[:, :, ::1],
        int64,
        int64[::1],
        float64[:, ::1],
        float64[:, :, ::1],
        float64[:, ::1],
        int64[:, ::1],
        int64[::1],
        int64,
        int64[::1],
    )
)
def meeting(tracks, k, craft, boxes, chords, nodes, waiting, state, most, codes):
    """Fill `codes` with pairs that may be within the unit ball in interval k, as i N + j with i < j.

    Returns the number that fits. `state` holds the number of nodes left in `waiting`, to continue with in
    another call (-1 to begin), and the number of overlapping boxes; the search ends if that exceeds `most`.
    """
    tracks, boxes, chords = borrowed(tracks), borrowed(boxes), borrowed(chords)
    nodes, codes = borrowed(nodes), borrowed(codes)
    number, depth, count = len(craft), 0, 0
    while number > LEAF << depth:
        depth += 1
    if state[0] < 0:
        enclose(tracks, k, craft, boxes)
        grow(boxes, number, depth, nodes)
        follow_order(tracks, k, boxes, number, chords)
        waiting[0, 0], waiting[0, 1] = 1, 1
        state[0], state[1] = 1, 0
    left = state[0]
    while left > 0 and count + LEAF * LEAF <= len(codes) and state[1] <= most:
        left -= 1
        one, two = waiting[left, 0], waiting[left, 1]
        if one != two and not overlap(nodes, one, nodes, two):
            continue
        if one >= 1 << depth:
            count, more = compare(chords, len(tracks), boxes, number, depth, nodes, one, two, codes, count)
            state[1] += more
            continue
        for half in range(2):
            for other_half in range(half if one == two else 0, 2):
                waiting[left, 0], waiting[left, 1] = 2 * one + half, 2 * two + other_half
                left += 1
    state[0] = left
    return count
