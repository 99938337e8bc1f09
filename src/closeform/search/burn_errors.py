"""Gatherings with imperfect burns: lost thrust, or execution errors."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats
from closeform.search.burn_flaws import BurnFlaws
from closeform.search.gather import EACH_CALL, WAYS, flown_least, gathering, gatherings
from closeform.search.gather_events import END_TIME
from closeform.search.gather_result import Gathering
from closeform.search.gatherings import Gatherings
from closeform.search.lock_march import in_parts
from closeform.search.request import states
from closeform.search.schedule import Search
from closeform.search.spacecraft_set import lost_fleet


def gather_flawed(
    planned: Gathering,
    search: Search,
    positions: ArrayLike,
    velocities: ArrayLike,
    flaws: BurnFlaws,
    **arguments: Any,
) -> Gathering:
    """Return the outcome of a gathering as `planned`, with the `flaws` (1, N) of its burns.

    `arguments`: the remaining arguments of the plan. The first pair burns as planned, and `totals` are those
    of the plan, because the flaws are not known in advance.
    """
    where, speeds = states(positions, velocities, 2)
    fleet = lost_fleet(search, shape=where.shape[:2], **arguments)
    flight = fleet.fly(where, speeds, [WAYS[planned.burns]], 8 * where.shape[1], flaws=flaws)
    return gathering(fleet, where[0], speeds[0], planned.burns, planned.totals, *flight)


def gather_failing(
    search: Search, positions: ArrayLike, velocities: ArrayLike, shares: Floats, **arguments: Any
) -> tuple[Gatherings, Floats]:
    """Return gatherings as `gather_cases` does, with losses of thrust, and the times of these (C, N) [s].

    `shares` (C, N): fractions of the duration without failures, nan for a craft that does not fail. Times are
    nan for such craft and after the end of the case.
    """
    where, speeds = states(positions, velocities, 3)
    fleet = lost_fleet(search, shape=where.shape[:2], **arguments)
    results, ways = flown_least(fleet, where, speeds, arguments["burns"])
    fails = shares * results[:, END_TIME, None]
    (failing,) = np.nonzero(~np.isnan(fails).all(axis=1))

    def part(some: slice) -> None:
        which = failing[some]
        flaws = BurnFlaws.of_thrust(np.nan_to_num(fails[which], nan=np.inf))
        each = fleet.fly(where[which], speeds[which], [*WAYS.values()], some=which, flaws=flaws)[2]
        results[which] = each[np.arange(len(which)), ways[which]]

    in_parts(part, len(failing), EACH_CALL)
    return gatherings(fleet, results), np.where(fails <= results[:, END_TIME, None], fails, np.nan)
