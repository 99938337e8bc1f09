"""Simulation results of a study of missions: violations, clearance and causes of delta-v."""

from typing import Any

from closeform.campaign.mission_cases import END, RATIO, SPENT, SimulationTally
from closeform.confidence import estimate
from closeform.report.cases import percent
from closeform.report.study import quantiles, resolved
from closeform.report.table import Column, Table

ENTERED = Column("flown once in the field", words=True), Column("cases"), *percent("share [%]")
NEAREST = (
    Column("nearest pair of a flight", words=True),
    *(Column(heading, form="{:.4f}".format) for heading in ("median", "5 %", "0.1 %", "least")),
    Column("in case"),
)
CAUSES = tuple(
    Column(heading, form="{:.6g}".format) for heading in ("plan [m/s]", "field [m/s]", "feedback [m/s]")
)
SURE = (
    "Flights",
    "one of each case, with errors of its own; least ratios at instants some seconds apart, and on cubics "
    "between them: closeform run FILE --case K certifies those of one",
)
PICTURES = (  # names, captions, axis labels, columns, and the quantile on the bad side
    ("flown-delta-v", "What all craft spend in flight", "delta-v of all craft in flight [m/s]", SPENT, 0.95),
    (
        "flown-ends",
        "How far off its plan the craft that is off most ends",
        "deviation at the end [m]",
        END,
        0.95,
    ),
    (
        "flown-ratios",
        "How near the nearest pair of each flight comes",
        "nearest pair [times its zone]",
        RATIO,
        0.05,
    ),
)


def tables(flights: SimulationTally) -> tuple[Table, ...]:
    """Return tables of keep-out violations, of clearance, and of the delta-v by cause."""
    share = estimate(flights.entered, flights.count)
    found = [Table("Mean delta-v of all craft in flight, by cause", CAUSES, [tuple(flights.mean.values())])]
    if flights.nearest is not None and flights.nearness is not None:
        row = (
            "in terms of its zone",
            *(one.value for one in flights.nearness.quantiles.values()),
            *flights.nearest,
        )
        entered = ("a zone is entered", flights.entered, share, share)
        near = resolved(NEAREST, flights.nearness.count, [*flights.nearness.quantiles])
        found = [Table("Flights in the field", ENTERED, [entered]), Table("", near, [row]), *found]
    return tuple(found)


def figures(flights: SimulationTally) -> dict[str, Any]:
    """Return the simulation results of a study for `summary.json`."""
    near = flights.nearness
    return {
        "flown": flights.count,
        "entered": {"cases": flights.entered} | vars(estimate(flights.entered, flights.count)),
        "mean_delta_v_m_s": flights.mean,
        "least_ratio": None if flights.nearest is None else flights.nearest[0],
        "ratios": None if near is None else quantiles(near),
    }
