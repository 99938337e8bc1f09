"""Reference path of feedback for pulsed thrust: the motion that the pulses produce without errors."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, Self

import numpy as np

from closeform.arrays import Floats
from closeform.dynamics.chief_frame import ChiefFrame
from closeform.dynamics.drawn import exactly
from closeform.dynamics.field import Field
from closeform.dynamics.holding import Holding
from closeform.dynamics.reference_trajectory import Commands, flown
from closeform.dynamics.timetable import SAME, Timetable
from closeform.fuel.pulses import Pulses
from closeform.motion.path import Path


class PulsedWay(NamedTuple):
    """One craft's states (T, 6) at shown times: by its pulses, and of the plan on held coasts.

    `missed`: the time and the state error at the start of each held coast.
    """

    states: Floats
    missed: tuple[tuple[float, Floats], ...]

    @classmethod
    def of(
        cls,
        commands: Commands,
        plan: Path,
        holding: Holding,
        pulses: Pulses,
        field: Field,
        frame: ChiefFrame,
    ) -> Self:
        """Return the reference of a plan in a field; each span of pulses starts from the planned state."""
        table = commands.table
        states, missed = plan.state(table.shown_times), []
        for first, last in _spans(table, holding, pulses):
            part, _, shown = commands.alone(first, last)
            # a span that begins with an impulse starts before it
            begin = plan.state(table.nodes[first])[None] if first else None
            during = frame.during(slice(2 * first, 2 * last + 1))
            led = flown(part, field, during, exactly(1, 1), begin).states[0, 0]
            missed.append((float(table.nodes[last]), led[-1] - states[shown[-1]]))
            states[shown] = led
        return cls(states, tuple(missed))


def _spans(table: Timetable, holding: Holding, pulses: Pulses) -> Iterator[tuple[int, int]]:
    """Return the first and the last node of each span with planned thrust, up to its last pulse.

    Both nodes are shown, and the first precedes all firing; spans that touch are merged.
    """
    shown = np.flatnonzero(table.shown >= 0)
    times, ends = table.nodes[shown], pulses.start + pulses.duration
    spans = np.concatenate([holding.moves[0], holding.burns[0]])
    found = list[tuple[int, int]]()
    for begin, end in spans[np.argsort(spans[:, 0])]:
        during = (pulses.start < end) & (ends > begin)
        begin, end = pulses.start[during].min(initial=begin), ends[during].max(initial=end)
        first = max(int(np.searchsorted(times, begin - SAME)) - 1, 0)
        last = min(int(np.searchsorted(times, end - SAME)), len(times) - 1)
        if found and first <= found[-1][1]:
            first, last = found[-1][0], max(last, found[-1][1])
            found.pop()
        found.append((first, last))
    return ((int(shown[first]), int(shown[last])) for first, last in found)
