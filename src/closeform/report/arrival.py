"""Arrival phase of a spacecraft on a relative orbit, its cost, and the phase of minimum cost."""

from collections.abc import Iterator
from math import degrees
from typing import Any

from closeform.mission.stage_start import Arrival
from closeform.planning.plan import UNITS

SAME = 0.02  # deg: phases that are reported as equal


def lines(craft: str, goal: Arrival | None, drifts: bool = False, safe: bool = False) -> Iterator[str]:
    """Yield the arrival phase of a spacecraft and the phase of minimum cost, if its orbit has phases.

    `drifts`: a passive-safety horizon is set; `safe`: the phase of minimum cost takes it into account.
    """
    if goal is None or (phase := phase_of(goal)) is None:
        return
    orbit, spent = str(goal.target.called).replace("_", " "), f"{goal.spent:.4g} {UNITS[goal.cost]}"
    arrives = f"{craft} arrives on the {orbit} at {phase:.2f} deg"
    best, shape, asked = goal.cheapest, goal.target.shape, goal.asked.is_open
    cheapest = phase_of(best)
    assert shape is not None
    assert cheapest is not None
    if asked or abs((cheapest - phase + 180.0) % 360.0 - 180.0) < SAME:
        yield f"{arrives}, {'' if asked else 'as given, '}the cheapest: {spent} by free thrust"
    else:
        yield f"{arrives}, as given; the cheapest would be {cheapest:.2f} deg"
        less = f"at the cheapest {best.spent:.4g} {UNITS[goal.cost]}"
        yield f'By free thrust, with nobody in the way: {spent}, {less} ({shape.phased} = "cheapest")'
    if safe:
        yield "The cheapest of those from which it drifts into no zone; a safe way there may not exist"
    elif drifts:
        yield "The cheapest takes no account of where drifts from there lead"


def phase_of(goal: Arrival) -> float | None:
    """Return the phase at which a spacecraft arrives [deg]; None if its orbit has no phases."""
    shape = goal.target.shape
    return None if shape is None or shape.phase_angle is None else degrees(shape.phase_angle)


def figures(goal: Arrival | None) -> dict[str, Any] | None:
    """Return the arrival phases and their costs for `summary.json`."""
    if goal is None or (phase := phase_of(goal)) is None:
        return None
    unit = {"energy": "m2_s3", "delta-v": "m_s"}[goal.cost]
    return {
        "orbit": goal.target.called,
        "phase_deg": phase,
        "cheapest": goal.asked.is_open,
        f"free_{unit}": goal.spent,
        "cheapest_deg": phase_of(goal.cheapest),
        f"cheapest_free_{unit}": goal.cheapest.spent,
    }
