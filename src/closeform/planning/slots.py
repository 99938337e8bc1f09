"""Slot assignment: that of minimum unconstrained cost, revised if avoidance makes another one cheaper."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.planning.plan import Plan
from closeform.planning.request import Request

REVISIONS = 12  # maximum number of other assignments planned


def revised(request: Request, plan: Plan, attempt: Callable[[Request], Plan]) -> Plan:
    """Return the lowest-cost plan found by successive exchanges of slots that could lower the cost."""
    costs = request.costs
    seen = {tuple(plan.slots)}
    left = REVISIONS
    while left > 0:
        bar = plan.spent if plan.ok else np.inf
        for slots in exchanges(plan.slots, costs, bar):
            if tuple(slots) in seen:
                continue
            seen.add(tuple(slots))
            left -= 1
            other = attempt(request.assigned(slots))
            if other.ok and (not plan.ok or other.spent < plan.spent):
                plan = other
                break
            if left == 0:
                return plan
        else:
            return plan
    return plan


def exchanges(slots: Any, costs: Floats, bar: float) -> Iterator[Any]:
    """Yield assignments one exchange away with an unconstrained cost below `bar`, lowest cost first."""
    count, places = costs.shape
    craft = np.arange(count)
    total = costs[craft, slots].sum()
    found = []
    for i in range(count):
        for j in range(i + 1, count):
            change = costs[i, slots[j]] + costs[j, slots[i]] - costs[i, slots[i]] - costs[j, slots[j]]
            found.append((total + change, i, int(slots[j]), j, int(slots[i])))
        for free in set(range(places)) - set(slots.tolist()):
            change = costs[i, free] - costs[i, slots[i]]
            found.append((total + change, i, free, i, free))
    for bound, i, here, j, there in sorted(found):
        if bound < bar:
            other = slots.copy()
            other[i], other[j] = here, there
            yield other
