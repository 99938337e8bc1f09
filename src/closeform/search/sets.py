"""Sets of craft that know each other, and how a lock joins them (H03 section IV).

A craft's label says to which set it belongs: LOST to none, FORMATION to the formation set, whose
craft fly at one velocity, k >= 1 to knowledge set k, whose craft know each other's motion and
coast.  The first pair ever to lock begins the formation set.
"""

from closeform._jit import kernel

LOST, FORMATION = -1, 0


@kernel()
def case_number(one, other):
    """Number in H03's table (figure 8) of a lock between craft of these labels, 1 to 9.

    Its rows are the set of the one, its columns that of the other: lost, knowledge, formation.
    """
    row = 0 if one == LOST else (2 if one == FORMATION else 1)
    column = 0 if other == LOST else (2 if other == FORMATION else 1)
    return 3 * row + column + 1


@kernel()
def joined(one, other, formed, unused):
    """Label of the set that a lock between craft of these labels leads to.

    `formed` says whether there is a formation set yet, `unused` is the next knowledge set's label.
    """
    if one == LOST and other == LOST:
        return unused if formed else FORMATION
    if one == LOST or other == LOST:
        return max(one, other)
    return min(one, other)  # the formation set takes a knowledge set; the older of two stays


@kernel()
def relabel(labels, old, new):
    for k in range(len(labels)):
        if labels[k] == old:
            labels[k] = new
