"""Legs of a whole gathering: repetitions of the search, each followed by its near-field search."""

from dataclasses import replace
from math import atan2, degrees, isinf, pi
from typing import Any

import numpy as np

from closeform.search.leg import START_ATTITUDE, SUN, Leg
from closeform.search.schedule import Search

PHASE = "NFS"
MOST_ROUNDS = 1000  # some months of searching
SHORTEST = 1e-9  # of the search: a shorter wait is lost in rounding
ALIGNED = 1e-9  # rad: a boresight back at its start up to rounding


def repeated_search(search: Search, rounds: int, max_speed: float | None) -> tuple[Search, Any]:
    """Return the search repeated `rounds` times, and the indices of the legs with a near-field burn.

    Each round ends with a turn back to the start attitude, if needed. With a `max_speed` [m/s] and a near
    field, the near-field search follows: all wait for near_field / max_speed (H03's t*), lost craft burn, and
    all wait as long again. Raises ValueError for an unbounded near field, or for a speed whose wait is out of
    range.
    """
    near_field = max_speed is not None and search.near_field > 0.0
    legs = [*search.legs, *_back(search, near_field)]
    if max_speed is not None and near_field:
        if isinf(search.near_field):
            raise ValueError(
                f"max_speed: with tips of {degrees(search.tip_angle):g} deg the near field is unbounded; "
                "increase the tip angle, or omit max_speed"
            )
        wait = search.near_field / max_speed
        if not SHORTEST < wait / search.duration < 1.0 / SHORTEST:
            raise ValueError(f"max_speed: {max_speed:g} m/s causes a wait of {wait:g} s; correct its unit")
        for _ in ("wait", "drift"):
            start, end = legs[-1].end, legs[-1].end + wait
            number, attitude = legs[-1].round, START_ATTITUDE["A"]
            legs.append(Leg(start, end, PHASE, number, "none", SUN, 0.0, attitude))
    span, numbers = legs[-1].end, legs[-1].round
    every = tuple(
        replace(leg, start=leg.start + k * span, end=leg.end + k * span, round=leg.round + k * numbers)
        for k in range(rounds)
        for leg in legs
    )
    burn_legs = np.arange(1, rounds + 1) * len(legs) - 1 if near_field else np.empty(0)
    return replace(search, legs=every), burn_legs.astype(np.int64)


def _back(search: Search, near_field: bool) -> list[Leg]:
    """Return the turn about the sun line from the end of the search to the start attitude, the short way."""
    last: Leg = search.legs[-1]
    attitude: Any = last.attitude_at(last.end)
    boresight = attitude[:, 2]
    angle = atan2(boresight[1], boresight[0])  # right-handed about the sun's direction, -z, turns it back
    if abs(angle) < ALIGNED:
        return []
    if abs(angle) > pi - ALIGNED:
        angle = pi  # so that rounding does not choose the direction
    phase = PHASE if near_field else last.phase
    end = last.end + abs(angle) / search.slew_rate
    return [Leg(last.end, end, phase, last.round, "sun line", SUN, angle, attitude)]
