"""Simulation results of the cases of a study: the columns of their rows, and their counts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from closeform.arrays import Floats
from closeform.campaign.chunks import CaseChunks
from closeform.campaign.spread import Spread
from closeform.scenario import Scenario

if TYPE_CHECKING:
    from closeform.mission.simulation import FlownRun

SEED, RATIO, END, OFF = "flight_seed", "flown_ratio", "flown_end_m", "flown_off_m"
SPENT, FIELD, FEEDBACK = "flown_delta_v_m_s", "field_delta_v_m_s", "feedback_delta_v_m_s"

NEAREST = 0.5, 0.05, 0.001  # quantiles of minimum clearance ratios, for which small values are bad
BY_CAUSE = ("plan", "field", "feedback")


def names(scenario: Scenario) -> tuple[str, ...]:
    """Return the names of the simulation columns; none if the scenario is not simulated."""
    if scenario.flights is None:
        return ()
    ends = (end_of(number) for number in range(1, len(scenario.stages) + 1))
    return SEED, RATIO, END, OFF, SPENT, FIELD, FEEDBACK, *map(spent_by, scenario.names), *ends


def figures(flown: FlownRun) -> dict[str, Any]:
    """Return the simulation results of a case: delta-v of all craft, greatest deviations."""
    flight = flown.flight
    return {
        RATIO: flight.least_ratio if flight.ratios.size else np.nan,
        END: flight.greatest_end,
        OFF: flight.greatest_deviation,
        SPENT: flight.delta_v.sum(),
        FIELD: flight.field_delta_v.sum(),
        FEEDBACK: flight.feedback_delta_v.sum(),
        **dict(zip(map(spent_by, flown.names), flight.delta_v[0], strict=True)),
        **{end_of(stage.number): stage.ends.max() for stage in flown.stages},
    }


def named(scenario: Scenario) -> Iterator[tuple[str, str]]:
    """Yield the label and the column of each quantity with a spread."""
    if scenario.flights is None:
        return
    yield "simulated: delta-v of all craft [m/s]", SPENT
    yield from ((f"simulated: delta-v of {name} [m/s]", spent_by(name)) for name in scenario.names)
    for number, stage in enumerate(scenario.stages, 1):
        yield f"simulated: stage {number}, {stage.verb}, end position error [m]", end_of(number)
    yield "simulated: greatest deviation [m]", OFF


def spent_by(name: str) -> str:
    """Return the column of the delta-v of a craft in the simulation."""
    return f"{name}_flown_delta_v_m_s"


def end_of(number: int) -> str:
    """Return the column of the position error at the end of a stage in the simulation."""
    return f"stage_{number}_end_m"


@dataclass(frozen=True)
class FlightTally:
    """Counts over `count` complete simulations.

    The number with a zone `entered` and the `mean` delta-v by cause [m/s]. `nearest`: the minimum clearance
    ratio of any pair and its case; `nearness`: the spread of the minimum ratio of each simulation. None if no
    pair has a zone.
    """

    count: int
    entered: int
    mean: dict[str, float]
    nearest: tuple[float, int] | None
    nearness: Spread | None

    @classmethod
    def of(cls, chunks: CaseChunks) -> Self | None:
        """Count chunk after chunk, so that only one is in memory; None without complete simulations."""
        count, entered, sums, nearest = 0, 0, np.zeros(3), (inf, -1)
        for first, part in chunks.read(RATIO, SPENT, FIELD, FEEDBACK, "end_s"):
            done = ~np.isnan(part["end_s"])
            count += int(done.sum())
            spent, field, feedback = (float(part[name][done].sum()) for name in (SPENT, FIELD, FEEDBACK))
            sums += [spent - field - feedback, field, feedback]
            ratio = np.where(done & ~np.isnan(part[RATIO]), part[RATIO], inf)
            entered += int((ratio < 1.0).sum())
            nearest = min(nearest, (float(ratio.min()), first + int(ratio.argmin())))
        if not count:
            return None

        def values() -> Iterator[tuple[Floats, Any]]:
            for first, part in chunks.read(RATIO, "end_s"):
                known = np.flatnonzero(~np.isnan(part["end_s"] + part[RATIO]))
                yield part[RATIO][known], first + known

        mean = dict(zip(BY_CAUSE, (sums / count).tolist(), strict=True))
        spread = Spread.of(values, NEAREST)
        return cls(count, entered, mean, nearest if nearest[0] < inf else None, spread)
