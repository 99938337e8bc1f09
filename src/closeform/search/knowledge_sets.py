"""Sets of craft that know each other, and the effect of a lock on them (H03 section IV).

The label of a craft is its set: LOST for none, FORMATION for the formation set, whose craft move with one
velocity, and k >= 1 for knowledge set k, whose craft know each other's motion and coast. The first pair to
lock begins the formation set.
"""

from closeform._jit import kernel

LOST, FORMATION = -1, 0


@kernel()
def case_number(one, other):
    """Return the number in H03's table (figure 8) of a lock between craft of these labels, 1 to 9.

    Its rows are the set of the one, its columns that of the other: lost, knowledge, formation.
    """
    row = 0 if one == LOST else (2 if one == FORMATION else 1)
    column = 0 if other == LOST else (2 if other == FORMATION else 1)
    return 3 * row + column + 1


@kernel()
def joined(one, other, formed, unused):
    """Return the label of the set that results from a lock between craft of these labels.

    `formed`: whether there is a formation set yet; `unused`: the label of the next knowledge set.
    """
    if one == LOST and other == LOST:
        return unused if formed else FORMATION
    if one == LOST or other == LOST:
        return max(one, other)
    return min(one, other)  # a knowledge set joins the formation set, or the older knowledge set


@kernel()
def relabel(labels, old, new):
    """Replace a label."""
    for k in range(len(labels)):
        if labels[k] == old:
            labels[k] = new
