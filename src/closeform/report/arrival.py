"""At which phase one craft arrives on a relative orbit, and whether that is the cheapest."""

from collections.abc import Iterator
from math import degrees
from typing import Any

from closeform.scenario import Destination


def lines(
    craft: str, asked: Destination | None, goal: Destination | None, drifts: bool = False
) -> Iterator[str]:
    """Where a craft that was `asked` to go somewhere goes: its phase, where it has one.

    What is cheapest takes no account of where it `drifts` from there, which is said where that is asked.
    """
    if asked is None or goal is None or goal.shape is None or goal.shape.phase_angle is None:
        return
    how = "the cheapest" if asked.is_open else f'as given; {goal.shape.phased} = "cheapest" is the cheapest'
    if drifts:
        how += ", whatever drifts from there lead to"
    orbit = str(goal.called).replace("_", " ")
    yield f"{craft} arrives on the {orbit} at {degrees(goal.shape.phase_angle):.2f} deg, {how}"


def figures(asked: Destination | None, goal: Destination | None) -> dict[str, Any] | None:
    """The same for `summary.json`."""
    if asked is None or goal is None or goal.shape is None or goal.shape.phase_angle is None:
        return None
    return {"orbit": goal.called, "phase_deg": degrees(goal.shape.phase_angle), "cheapest": asked.is_open}
