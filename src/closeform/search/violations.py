"""Violations: which craft came within their keep-out zone, before they knew each other or only after.

`eyes` are whether there is a zone, the zone, until when each pair i < j was looked at (N, N), and
what was seen (N, N).  A pair is looked at before one of the two changes its velocity, when they
come to know each other, and at the end.
"""

from closeform.compiled import kernel
from closeform.search.clearance import SINCE, VELOCITY, within
from closeform.search.sets import LOST

APART, KNOWN, UNKNOWN = 0, 1, 2


@kernel()
def look(eyes, craft, labels, i, j, t):
    """Look at the straight line of a pair i < j until time t."""
    keeps, zone, looked, met, scratch = eyes
    box, matrix, half_axes = zone
    since, r, v = looked[i, j], scratch[0], scratch[1]
    for k in range(3):
        v[k] = craft[j, VELOCITY + k] - craft[i, VELOCITY + k]
        r[k] = craft[j, k] + craft[j, VELOCITY + k] * (since - craft[j, SINCE])
        r[k] -= craft[i, k] + craft[i, VELOCITY + k] * (since - craft[i, SINCE])
    if met[i, j] != UNKNOWN and within(box, matrix, r, v, t - since):
        met[i, j] = KNOWN if labels[i] == labels[j] and labels[i] != LOST else UNKNOWN
    looked[i, j] = t


@kernel()
def look_around(eyes, craft, labels, i, t):
    """Look at all pairs of craft i."""
    if eyes[0]:
        for j in range(len(labels)):
            if j != i:
                look(eyes, craft, labels, min(i, j), max(i, j), t)


@kernel()
def look_between(eyes, craft, labels, one, other, t):
    """Look at all pairs that come to know each other when craft `one` and `other` lock."""
    if eyes[0]:
        for i in range(len(labels)):
            if i == one or (labels[i] == labels[one] and labels[i] != LOST):
                for j in range(len(labels)):
                    if j == other or (labels[j] == labels[other] and labels[j] != LOST):
                        look(eyes, craft, labels, min(i, j), max(i, j), t)


@kernel()
def count_violations(eyes, craft, labels, t):
    """How many pairs have met before they knew each other, and how many only after, by time t."""
    keeps, zone, looked, met, scratch = eyes
    unknown = known = 0
    if keeps:
        for i in range(len(labels)):
            for j in range(i + 1, len(labels)):
                look(eyes, craft, labels, i, j, t)
                unknown += met[i, j] == UNKNOWN
                known += met[i, j] == KNOWN
    return unknown, known
