"""Uncertainty of a stage: clearance in sigmas and probability of collision, as tables, lines and pictures."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import inf
from typing import TYPE_CHECKING, Any

from closeform.report.description import MOST_ROWS, PAIR, Column, Section, Table, record
from closeform.report.picture import Picture

if TYPE_CHECKING:  # a stage without uncertainty does not need these kernels
    from closeform.conflicts.flight import WatchedFlight
    from closeform.mission.mission_result import StageResult
    from closeform.mission.uncertainty import UncertainStage
    from closeform.uncertainty.errors import Uncertainty
    from closeform.uncertainty.probability import Probability
    from closeform.uncertainty.uncertain_flight import UncertainPair

FEWEST = (
    PAIR,
    Column("sigmas", "sigmas", "{:.4g}".format),
    Column("at [s]", "time_s", "{:.3f}".format, since="mission"),
)
SIGMAS = (
    *FEWEST,
    Column("ever inside", "probability", "{:.5g}".format),
    Column("95 % interval", None, "{:.5g} to {:.5g}".format, parts=("low", "high")),
    Column("inside at the start", "at_start", "{:.5g}".format),
    Column("mean entries", "mean_entries", "{:.5g}".format),
)
STORED = (Column(None, "of"), *SIGMAS)
CURVES = 4  # maximum number of pairs whose clearance in sigmas is plotted
TUBE_SIGMAS = 3.0  # width of a tube if no sigmas are required
SURE = {  # name of the interval of each method other than "entries"
    "bound": "certified",
    "monte-carlo": "95 % Monte Carlo interval, because the errors are too thin for a rate of entries,",
}
DRAWN = 1e-15  # expected entries above which they are plotted


def probable(found: "Probability | None") -> tuple[Any, ...]:
    """Return the cells of SIGMAS that describe a probability, all None if it is unknown."""
    if found is None:
        return None, None, None, None
    return found.value, (found.low, found.high), found.at_start, found.mean_entries


def row(pair: "UncertainPair") -> tuple[Any, ...]:
    """Return a row of SIGMAS; a pair that no error brings into contact has neither sigmas nor time."""
    known = pair.sigmas < inf
    cells = (pair.sigmas, pair.time) if known else (None, None)
    return (pair.first, pair.second), *cells, *probable(pair.probability)


def extended(section: Section, result: "StageResult[Any, Any]", names: Sequence[str]) -> Section:
    """Return a section extended by the uncertainty results of its stage."""
    found = result.uncertain
    if found is None or len(names) < 2:
        return section
    return replace(
        section,
        tables=section.tables + tables(found),
        closing=section.closing + lines(found),
        pictures=section.pictures + pictures(found, result),
        figures={**section.figures, "uncertain": figures(found)},
        files={**section.files, "sigmas": stored(found)},
    )


def lines(found: "UncertainStage") -> tuple[str, ...]:
    """Return the clearance in sigmas and the probability of collision as text."""
    from closeform.mission.uncertainty import fewest, radius

    many, near = found.stage.sigmas, found.nearest
    lead = "Clear"
    if many is not None:
        lead = f"{'Clear' if near is None or near.sigmas >= many else 'Not clear'} at {many:g} sigma"
    of = "keep-out zones" if found.zones is not None else "the hard bodies"
    judged = found.zones is not None or found.bodies is not None
    sized = "a keep-out zone" if found.zones is not None else "hard bodies"
    words = [f"No pair of craft with {sized} has an uncertain relative state"] if judged else []
    if near is not None:
        words = [f"{lead}: {fewest(near)}, of {of}"]
    pair = found.likeliest
    if (unknown := found.undrawn) is not None:
        both = f"{unknown.first} - {unknown.second}"
        words.append(f"Probability of collision of {both}: unknown, too many burns with execution errors")
    if pair is None or (odds := pair.probability) is None:
        return tuple(words)
    about = radius(pair)
    within = "within their hard bodies" if about is None else f"within the hard bodies' {about:g} m"
    sure = SURE.get(odds.method, "95 % interval")
    most = f"at most {odds.high:.4g} ({sure} {odds.low:.4g} to {odds.high:.4g})"
    counts = f"; inside at its start {odds.at_start:.3g}, expected entries {odds.mean_entries:.4g}"
    if odds.high == 0.0:
        most, counts = "below 1e-300", ""
    both = f"{pair.first} - {pair.second}"
    words.append(f"Probability of collision of {both} in this stage: {most}; of ever being {within}{counts}")
    if (bound := together(found)) is not None:
        flight = found.bodies
        every = f"the sum of {0 if flight is None else len(flight.pairs)} pairs"
        words.append(f"Probability that any two collide: at most {bound:.4g}, {every}")
    return tuple(words)


def together(found: "UncertainStage") -> float | None:
    """Return the upper bound on the probability that any pair collides; None for one pair or if unknown."""
    return found.bodies.any_pair if found.bodies is not None and len(found.bodies.pairs) > 1 else None


def tables(found: "UncertainStage") -> tuple[Table, ...]:
    """Return the tables of the pairs with the smallest clearance in sigmas."""
    made = []
    for title, flight, columns in (
        ("Clearance of keep-out zones in sigmas", found.zones, FEWEST),
        ("Hard bodies: clearance in sigmas, and probability of contact", found.bodies, SIGMAS),
    ):
        pairs = flight.pairs if flight is not None else ()
        if pairs:
            some = (
                f", the {MOST_ROWS} with the lowest clearance of {len(pairs)}"
                if len(pairs) > MOST_ROWS
                else ""
            )
            rows = [row(pair)[: len(columns)] for pair in pairs[:MOST_ROWS]]
            made.append(Table(title + some, columns, rows))
    return tuple(made)


def stored(found: "UncertainStage") -> Table:
    """Return all pairs as one table for Parquet."""
    both = ("keep-out zone", found.zones), ("hard bodies", found.bodies)
    rows = [(of, *row(pair)) for of, flight in both if flight is not None for pair in flight.pairs]
    return Table("", STORED, rows)


def figures(found: "UncertainStage") -> dict[str, Any]:
    """Return the critical pairs and the requirements for `summary.json`."""
    near, likeliest = found.nearest, found.likeliest
    odds = None if likeliest is None else likeliest.probability
    return {
        "sigmas_asked": found.stage.sigmas,
        "max_probability": found.stage.max_probability,
        "met": all(one.met for one in found.asked),
        "fewest": None if near is None else record(FEWEST, row(near)[: len(FEWEST)]),
        "likeliest": None if likeliest is None else record(SIGMAS, row(likeliest)),
        "any_pair_at_most": together(found),
        "method": None if odds is None else odds.method,
    }


def pictures(found: "UncertainStage", result: "StageResult[Any, Any]") -> tuple[Picture, ...]:
    """Return the pictures of a stage's uncertainty."""
    errors = dict(zip(result.after.names, found.errors, strict=True))
    judged, stage = found.zones or found.bodies, found.stage
    pairs = judged.pairs if judged is not None else ()
    made = clearances(result.after, errors, pairs, stage.sigmas)
    return (*made, *collisions(result.after, found.likeliest, stage.max_probability))


def clearances(
    flight: "WatchedFlight",
    errors: "Mapping[str, Uncertainty | None]",
    pairs: "Sequence[UncertainPair]",
    asked: float | None,
) -> tuple[Picture, ...]:
    """Return the uncertainty tube of the critical pair, and the clearance in sigmas over time."""
    from closeform.uncertainty.errors import Uncertainty

    near = [pair for pair in pairs if pair.sigmas < inf]
    if not near:
        return ()
    one, many = near[0], asked or TUBE_SIGMAS
    pair = flight.facing(one.first, one.second)
    zone = one.zone if pair[0] == one.first else one.zone.mirrored
    known = errors[pair[0]] or Uncertainty(), errors[pair[1]]
    caption = f"Position of {pair[0]} relative to {pair[1]}, within {many:g} sigma"
    ways = *(flight.path(name) for name in pair), zone, *known
    tube = Picture("tube", caption, "tube", ways, {"sigmas": many, "names": pair})
    some = near[:CURVES]
    places: list[Any] = [
        [flight.path(name) for name in names] for names in zip(*map(ends, some), strict=True)
    ]
    theirs = [[errors[name] for name in names] for names in zip(*map(ends, some), strict=True)]
    options = {"asked": asked, "names": [f"{each.first} - {each.second}" for each in some]}
    caption = "Clearance of pairs in sigmas against time"
    curves = *places, [each.zone for each in some], *theirs
    return tube, Picture("sigmas", caption, "sigmas", curves, options)


def collisions(
    flight: "WatchedFlight", likeliest: "UncertainPair | None", limit: float | None
) -> tuple[Picture, ...]:
    """Return the picture of the collision rate of the likeliest pair, if a collision is likely at all."""
    odds = None if likeliest is None else likeliest.probability
    if likeliest is None or odds is None or len(odds.rate_times) <= 1 or odds.mean_entries <= DRAWN:
        return ()
    both = f"{likeliest.first} - {likeliest.second}"
    caption = f"Rate and probability of contact of the hard bodies of {both}"
    options = {"what": both, "limit": limit}
    path = flight.path(likeliest.first)
    return (Picture("collision", caption, "collision", (odds, path), options),)


def ends(pair: "UncertainPair") -> tuple[str, str]:
    """Return the names of the two spacecraft of a pair."""
    return pair.first, pair.second
