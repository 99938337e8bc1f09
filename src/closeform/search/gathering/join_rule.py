"""Join rule: the set of each craft, and the effect of a lock on the sets (H03 section IV).

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
def know_each_other(labels, i, j):
    """Return True if two craft are in the same set."""
    return labels[i] == labels[j] and labels[i] != LOST


@kernel()
def joint_label(one, other, formed, unused):
    """Return the label of the set that results from a lock between craft of these labels.

    `formed`: whether there is a formation set yet; `unused`: the label of the next knowledge set.
    """
    if one == LOST and other == LOST:
        return unused if formed else FORMATION
    if one == LOST or other == LOST:
        return max(one, other)
    return min(one, other)  # a knowledge set joins the formation set, or the older knowledge set


@kernel()
def join(labels, fresh, low, high, label):
    """Give both craft and their sets this label, and mark the craft that are new to the set of that label.

    New are the craft whose label changes. Of two lost craft it is the higher index; the lower keeps its
    velocity.
    """
    one, other = labels[low], labels[high]
    for m in range(len(labels)):
        joins = labels[m] != LOST and (labels[m] == one or labels[m] == other)
        fresh[m] = joins and labels[m] != label
        if joins:
            labels[m] = label
    fresh[low] = fresh[low] or (one == LOST and other != LOST)
    fresh[high] = fresh[high] or other == LOST
    labels[low] = labels[high] = label
