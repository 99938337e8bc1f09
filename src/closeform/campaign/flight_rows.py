"""What the flights of cases in the field came to: columns of their rows, and what a study counts of them."""

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

NEAREST = 0.5, 0.05, 0.001  # quantiles of least ratios: small ones are the bad ones
BY_CAUSE = ("plan", "field", "feedback")


def names(scenario: Scenario) -> tuple[str, ...]:
    """The columns of flights; none of a scenario that flies none."""
    if scenario.flights is None:
        return ()
    ends = (end_of(number) for number in range(1, len(scenario.stages) + 1))
    return SEED, RATIO, END, OFF, SPENT, FIELD, FEEDBACK, *map(spent_by, scenario.names), *ends


def figures(flown: FlownRun) -> dict[str, Any]:
    """What the one flight of a case came to: delta-v of all craft, how far off the one is that is most."""
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
    """What is spread of them, in words, and its column."""
    if scenario.flights is None:
        return
    yield "flown: delta-v of all craft [m/s]", SPENT
    yield from ((f"flown: delta-v of {name} [m/s]", spent_by(name)) for name in scenario.names)
    for number, stage in enumerate(scenario.stages, 1):
        yield f"flown: stage {number}, {stage.verb}, ends off [m]", end_of(number)
    yield "flown: off at most [m]", OFF


def spent_by(name: str) -> str:
    """The column of what a craft spends in flight."""
    return f"{name}_flown_delta_v_m_s"


def end_of(number: int) -> str:
    """The column of how far off a stage ends in flight."""
    return f"stage_{number}_end_m"


@dataclass(frozen=True)
class FlightTally:
    """Of `count` flights to the end: in how many a zone is `entered`, the `mean` delta-v by cause [m/s].

    `nearest`: the least ratio of any pair and its case; `nearness`: the spread of the least ratio of each
    flight.  None where nobody has a zone.
    """

    count: int
    entered: int
    mean: dict[str, float]
    nearest: tuple[float, int] | None
    nearness: Spread | None

    @classmethod
    def of(cls, chunks: CaseChunks) -> Self | None:
        """Counted chunk after chunk, so that no more than one is held; None where nothing was flown."""
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
