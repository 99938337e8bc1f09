"""Pulsed ways: where the pulses of thrusters lead without errors, which is what feedback leads back to."""

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
    """One craft's states (T, 6) when some are shown: by its pulses, and of the plan on coasts that are held.

    What is flown is `missed` by the plan where such a coast begins: when, and by which state.
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
        """Of a plan, as commanded in a field: each span of pulses from the planned state before it."""
        table = commands.table
        states, missed = plan.state(table.shown_times), []
        for first, last in _spans(table, holding, pulses):
            part, _, shown = commands.alone(first, last)
            # what begins with an impulse begins before it
            begin = plan.state(table.nodes[first])[None] if first else None
            during = frame.during(slice(2 * first, 2 * last + 1))
            led = flown(part, field, during, exactly(1, 1), begin).states[0, 0]
            missed.append((float(table.nodes[last]), led[-1] - states[shown[-1]]))
            states[shown] = led
        return cls(states, tuple(missed))


def _spans(table: Timetable, holding: Holding, pulses: Pulses) -> Iterator[tuple[int, int]]:
    """The first and the last node of each span in which one craft thrusts by plan, the latest pulse included.

    Both are shown, and the first is before all that is fired; spans that meet are one.
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
