"""Slots of least unconstrained cost, revised where avoidance makes others cheaper."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.planning.plan import Plan
from closeform.planning.request import Request

REVISIONS = 12  # other assignments that are planned


def revised(request: Request, plan: Plan, attempt: Callable[[Request], Plan]) -> Plan:
    """The cheapest plan among those with one exchange of slots after another that could be cheaper."""
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
    """Assignments one exchange away whose unconstrained cost is below `bar`, cheapest first."""
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
