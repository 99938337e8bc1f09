"""Reduction of the number of impulses: joins and omissions, in order of their approximate cost."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.planning.delta_v.firing_times import Moments


class Step(NamedTuple):
    """One impulse less of a `craft`: its approximate cost [m/s], and the remaining moments."""

    loss: float
    craft: int
    left: Moments


def steps_to_fewer(
    fired: Sequence[Moments], sizes: Sequence[Floats], rates: Floats, most: float
) -> list[Step]:
    """Return the steps of all craft, lowest cost first, up to `most` [m/s] each; those of one craft in order.

    `sizes` are those of the `fired` moments, and `rates` (N,) [rad/s] the rates of each craft's motion.
    """
    every = [
        step
        for i, (moments, own, rate) in enumerate(zip(fired, sizes, rates.tolist(), strict=True))
        for step in steps_of(i, moments, own, rate, most)
    ]
    return sorted(every, key=lambda step: step.loss)


def steps_of(craft: int, moments: Moments, sizes: Floats, rate: float, most: float) -> list[Step]:
    """Return the steps of one craft.

    Two impulses of one direction, of sizes q and r and t apart, are joined at their centroid for about
    q r / (q + r) (rate t)^2, the difference of second moments.  An impulse far from all others is omitted
    for q.
    """
    order = np.lexsort((moments.times, moments.which))
    times, which, q = moments.times[order], moments.which[order], sizes[order]
    found: list[Step] = []
    worst = 0.0
    while len(q) > 1:
        joins = q[1:] * q[:-1] / (q[1:] + q[:-1]) * (rate * np.diff(times)) ** 2
        joins[which[1:] != which[:-1]] = np.inf
        j, k = int(np.argmin(joins)), int(np.argmin(q))
        if min(joins[j], q[k]) > most:
            break
        worst = max(worst, float(min(joins[j], q[k])))
        if joins[j] < q[k]:
            times[j] = (q[j] * times[j] + q[j + 1] * times[j + 1]) / (q[j] + q[j + 1])
            q[j] += q[j + 1]
            k = j + 1
        times, which, q = np.delete(times, k), np.delete(which, k), np.delete(q, k)
        in_order = np.lexsort((which, times))
        found.append(Step(worst, craft, Moments.instants(times[in_order], which[in_order])))
    return found
