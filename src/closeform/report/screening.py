"""Reports of a screening of ephemerides and of a conjunction data message."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from closeform.conflicts.flight import WatchedFlight
from closeform.exchange.ccsds.cdm import write_cdm
from closeform.exchange.ccsds.conjunction import Conjunction
from closeform.exchange.common_frame import CommonFrame
from closeform.exchange.epochs import Epoch
from closeform.exchange.export_tracks.track import file_names
from closeform.mission.verdict import MET, NOT_MET, Verdict, conflicts_in
from closeform.report.description import Column, Section, Stamps, Table, counted, some_of, state_columns
from closeform.report.page import Command, CommandReport
from closeform.report.picture import Picture
from closeform.report.sections import conflicts, model_limits, uncertain
from closeform.report.sections.conflicts import APPROACH, CONFLICT, MOST_PAIRS
from closeform.report.sections.uncertain import SIGMAS, row
from closeform.storage.result_folder import Folder
from closeform.uncertainty.clearance import SigmaApproach
from closeform.uncertainty.encounter import Encounter
from closeform.uncertainty.probability import Probability
from closeform.zones.pair_zones import PairZones
from closeform.zones.solids import Sphere

if TYPE_CHECKING:
    from closeform.uncertainty.uncertain_flight import UncertainFlight

EPHEMERIDES = (
    Column("craft", "craft", words=True),
    Column("file", "file", words=True),
    Column("interpolation error [m]", "interpolation_error_m", "{:.2g}".format),
    Column("covariance propagated [s]", "covariance_carried_s", "{:.1f}".format),
)
CDM = "cdm"  # the folder of conjunction messages
Message = tuple[str, Conjunction, tuple[str, ...]]  # name of its file, and comments
SURE = (
    "Conflicts, closest approaches",
    "certified for the interpolated motion; the interpolation error is an estimate",
)


@dataclass(frozen=True, eq=False)
class Screened:
    """Flight along ephemerides in a common frame, and its clearance in sigmas, None without covariances."""

    frame: CommonFrame
    flight: WatchedFlight
    zones: PairZones
    uncertain: "UncertainFlight | None" = None


def screen_report(
    screened: Screened, command: Command, messages: Sequence[Message] | None = None
) -> CommandReport:
    """Return the report of a screening; `messages` are its conjunction messages, None if not requested."""
    frame, flight, found = screened.frame, screened.flight, screened.uncertain
    names, stamps = frame.names, Stamps(Epoch(frame.epoch, frame.time_system))
    opening = (
        f"{len(names)} craft, {len(frame.times)} common epochs from {frame.epoch} "
        f"{frame.time_system}, {frame.times[-1] - frame.times[0]:.1f} s",
        f"Frame: radial, along-track (arc), cross-track of {names[0]}, "
        f"on a circle of {frame.radius / 1e3:.3f} km",
        *inputs(screened),
    )
    met, met_tables = conflicts.listed("Conflicts", flight)
    written = () if messages is None else (f"{counted(len(messages), 'conjunction data message')} in {CDM}/",)
    lines = (*conflicts.between_samples(flight), *conflicts.zones(flight), *met, *written)
    pairs = () if found is None else found.pairs
    title = "Clearance in sigmas, and probability of zone violation"
    sigmas = () if found is None else (Table(title, SIGMAS, [row(pair) for pair in pairs[:MOST_PAIRS]]),)
    near = conflicts.approaches("Closest approaches", flight)
    tables = tuple(map(stamps.dated, (*met_tables, *near, *sigmas)))
    if found is None:
        verdict = Verdict(None, *conflicts_in([flight]), exceeded=None, searched=False)
    else:
        within = len(found.within)
        verdict = Verdict(None, within, within, exceeded=None, searched=False, sigmas=found.sigmas)
    asked = ephemerides(frame, command.files), command.table
    sure = model_limits.certain([SURE, *model_limits.of_errors(found is not None)])
    stored = {
        "conflicts": Table("", CONFLICT, [conflicts.conflict_row(one) for one in flight.conflicts]),
        "approaches": Table("", APPROACH, [conflicts.approach_row(one) for one in flight.approaches]),
        **({} if found is None else {"sigmas": Table("", SIGMAS, [row(pair) for pair in pairs])}),
    }
    figures = {
        "kind": "screen",
        **verdict.figures,
        "frame": {
            "chief": names[0],
            "epoch": frame.epoch,
            "time_system": frame.time_system,
            "epochs": len(frame.times),
            "end_s": float(frame.times[-1]),
            "radius_m": frame.radius,
        },
        "mean_motion_rad_s": frame.mean_motion,
        "craft": list(names),
        **stamps.record(
            {"flight": conflicts.figures(flight)} | ({"sigmas": sigmas[0].records} if sigmas else {})
        ),
    }
    return CommandReport(
        command,
        screened,
        f"Screening of {' and '.join(names) if len(names) == 2 else f'{len(names)} craft'}",
        opening,
        opening[:2],
        lines,
        tables,
        verdict,
        (
            Section("Request", tables=asked),
            Section("Results", (*opening[2:], *lines), tables, pictures=tuple(pictures(screened))),
            Section("Limits of the model", tuple(limits(screened)), (sure,)),
        ),
        figures,
        {
            **{name: stamps.dated(table).stored for name, table in stored.items()},
            "states": state_columns(names, frame.times, frame.states, stamps.epoch),
        },
        beside=partial(write_messages, messages),
    )


def inputs(screened: Screened) -> Iterator[str]:
    """Yield manoeuvres between segments, interpolated states, and covariances with their age."""
    frame, found = screened.frame, screened.uncertain
    pairs = zip(frame.names, frame.manoeuvres, strict=True)
    fired = [f"{name} {len(some)} ({sum(size for _, size in some):.4g} m/s)" for name, some in pairs if some]
    if fired:
        yield f"Manoeuvres between segments: {', '.join(fired)}"
    errors = zip(frame.names, frame.interpolation_errors.tolist(), strict=True)
    moved = {name: error for name, error in errors if error > 0.0}
    if moved:
        worst = max(moved, key=lambda name: moved[name])
        error = f"error up to {moved[worst]:.2g} m ({worst}, estimate)"
        yield f"States of {some_of(list(moved))} interpolated, {error}"
    if found is None:
        return
    ages = [(name, age) for name, age in zip(frame.names, frame.ages, strict=True) if age is not None]
    oldest, age = max(ages, key=lambda pair: abs(pair[1]))
    carried = f", propagated by Hill's equations for up to {abs(age):.1f} s ({oldest})" if age else ""
    yield f"Covariances of {counted(len(ages), 'ephemeris', 'ephemerides')}{carried}"
    if found.exact:
        yield f"States taken as exact: {', '.join(found.exact)}"
    looked = len(screened.flight.approaches)
    if looked < screened.flight.pairs:
        yield f"Clearance in sigmas only for the {looked} closest of {screened.flight.pairs} pairs"


def ephemerides(frame: CommonFrame, files: Sequence[Path]) -> Table:
    """Return the ephemerides, with interpolation errors and the age of covariances if there are any."""
    columns = frame.names, files, frame.interpolation_errors.tolist(), frame.ages
    rows = [(name, file.name, error or None, age) for name, file, error, age in zip(*columns, strict=True)]
    return Table("Ephemerides", EPHEMERIDES, rows)


def limits(screened: Screened) -> Iterator[str]:
    """Yield the approximations of the model, and their size."""
    frame = screened.frame
    radial, _, across = np.abs(frame.states[..., :3]).max(axis=(0, 1)) / frame.radius
    yield (
        "States at epochs are those of the files. Between them craft are interpolated as stated above; "
        "Hill's equations on a circular orbit apply from one epoch to the next only."
    )
    share = 100.0 * (radial + 0.5 * across**2)
    yield (
        f"Along-track and cross-track are arcs on the circle of {frame.names[0]}, with relative errors "
        f"of up to {share:.2g} %. Zones keep its axes, which turn along these arcs."
    )
    if screened.uncertain is not None:
        yield (
            "State errors are Gaussian, propagated by Hill's equations from the first epoch, and "
            "independent between craft."
        )


def pictures(screened: Screened) -> Iterator[Picture]:
    """Yield all paths, the closest pairs, and the uncertainty of their clearance."""
    flight, found, frame = screened.flight, screened.uncertain, screened.frame
    yield from conflicts.coasting(flight, screened.zones)
    if found is not None:
        errors = dict(zip(frame.names, frame.errors, strict=True))
        yield from uncertain.clearances(flight, errors, found.pairs, found.sigmas)
        likely = [(one.probability.high, one) for one in found.pairs if one.probability is not None]
        likeliest = max(likely, key=lambda one: one[0], default=(0.0, None))[1]
        yield from uncertain.collisions(flight, likeliest, None)


def write_messages(messages: Sequence[Message] | None, folder: Folder) -> None:
    """Write conjunction messages into a result folder, if they were requested."""
    if messages is None:
        return
    place = folder.path / CDM
    place.mkdir()
    names = file_names([name for name, _, _ in messages])
    for name, (_, conjunction, comments) in zip(names, messages, strict=True):
        write_cdm(place / f"{name}.cdm", conjunction, comments=comments)


FIGURES = (
    Column("figure", "figure", words=True),
    Column("definition", "counts", words=True),
    Column("value", "value", "{:.5g}".format),
    Column("95 % interval", None, "{:.5g} to {:.5g}".format, parts=("low", "high")),
)
SAMPLES = 201  # instants in states.parquet
TUBE = 3.0  # sigmas
SURE_OF_ENCOUNTER = (
    ("Clearance in sigmas", "certified for the Gaussian errors of the message, in linear relative motion"),
    ("ever inside, mean entries", "estimated: the 95 % interval covers sampling and quadrature"),
    ("short encounter (2-D)", "its assumptions, straight motion and constant errors, may not hold"),
)
EDGE = 0.01  # share of the probability, or of the peak rate, allowed at an edge of the window


@dataclass(frozen=True)
class Judgement:
    """Comparison of a probability with its limit, if there is one."""

    value: float
    limit: float | None

    @property
    def status(self) -> int:
        """The exit status of the command."""
        return MET if self.limit is None or self.value <= self.limit else NOT_MET

    def __str__(self) -> str:
        if self.limit is None:
            return f"collision probability {self.value:.5g}"
        found, how = ("clear", "at most") if self.status == MET else ("not clear", "above")
        return f"{found}: collision probability {self.value:.5g}, {how} {self.limit:g}"


@dataclass(frozen=True, eq=False)
class Met:
    """Encounter of a conjunction data message, for two bodies with a combined `radius` [m]."""

    message: Conjunction
    radius: float
    encounter: Encounter

    @property
    def names(self) -> tuple[str, str]:
        """The names of the two objects."""
        first, second = self.message.objects
        return first.name, second.name


def encounter_report(
    met: Met,
    clearance: SigmaApproach,
    probability: Probability,
    short: Probability | None,
    limit: float | None,
    command: Command,
) -> CommandReport:
    """Return the report of an encounter; `short` is None if the two do not pass each other in the window."""
    message, encounter, names = met.message, met.encounter, met.names
    first, second = (f"{each.name} ({each.designator})" for each in message.objects)
    axes = zip(("radial", "along-track", "cross-track"), message.relative_state, strict=False)
    place = ", ".join(f"{axis} {value:.3f}" for axis, value in axes)
    window = encounter.path.end
    opening = (
        f"{first} and {second}, closest at {message.tca} UTC",
        f"Miss distance {encounter.distance:.3f} m ({place}), relative speed {encounter.speed:.6g} m/s",
        f"Radius of both bodies {met.radius:g} m; evaluated for {window:.6g} s before and after, "
        f"in the turning frame of {names[0]}",
    )
    sigmas, time = float(clearance.sigmas), round(float(clearance.time), 1) + 0.0
    clear = f"Clear by {sigmas:.4g} sigmas, minimum at {time:.1f} s"
    if sigmas == 0.0:
        clear = f"Clear by 0 sigmas: the bodies overlap even without errors, at {time:.1f} s"
    lines = (
        clear,
        *notes(probability, short),
        *(f"Warning: {line}" for line in encounter.warnings),
    )
    table, verdict = probabilities(message, probability, short), Judgement(probability.value, limit)
    neglected = (
        "The second object moves relative to the first one to first order in their distance. The first "
        "is on an ellipse about a point mass, with no other force. Errors are Gaussian and move likewise.",
        f"The time before and after these {2.0 * window:.6g} s is not evaluated.",
    )
    times = np.linspace(float(encounter.path.start), float(window), SAMPLES)
    states = np.array([encounter.path.state(times), encounter.other.state(times)])
    shown = tuple(encounter_pictures(met, probability, limit))
    return CommandReport(
        command,
        met,
        f"Encounter of {' and '.join(names)}",
        opening,
        opening[:1],
        lines,
        (table,),
        verdict,
        (
            Section("Request", opening[:1], (command.table,) if command.given else ()),
            Section("Results", (*opening[1:], *lines), (table,), pictures=shown),
            Section("Limits of the model", neglected, (model_limits.certain(list(SURE_OF_ENCOUNTER)),)),
        ),
        {
            "kind": "encounter",
            "status": verdict.status,
            "verdict": str(verdict),
            "limit": limit,
            "tca": message.tca,
            "craft": list(names),
            "radius_m": met.radius,
            "miss_distance_m": encounter.distance,
            "relative_speed_m_s": encounter.speed,
            "window_s": window,
            "mean_motion_rad_s": 2.0 * np.pi / encounter.path.orbit.period,
            "sigmas": float(clearance.sigmas),
            "sigmas_time_s": float(clearance.time),
            "warnings": list(encounter.warnings),
            "probabilities": table.records,
        },
        {"states": state_columns(names, times, states, None)},
        encounter.warnings,
    )


def notes(found: Probability, short: Probability | None) -> Iterator[str]:
    """Yield notes on the limits of the time window."""
    if short is None:
        yield "No short encounter: the closest approach is at an edge of the window"
    grows = len(found.rates) > 0 and found.rates[-1] > EDGE * found.rates.max()
    if found.at_start > EDGE * found.value or grows:
        yield "The probability still grows at an edge of the window: give a longer --window"


def probabilities(message: Conjunction, found: Probability, short: Probability | None) -> Table:
    """Return the table of collision probabilities by method."""
    rows = [
        ("ever inside", "trajectories with at least one contact", found.value, (found.low, found.high)),
        ("inside at the start", "part of the above", found.at_start, None),
        ("mean entries", "mean number after the start", found.mean_entries, None),
        ("short encounter (2-D)", "straight motion, constant errors", short and short.value, None),
    ]
    if message.collision_probability is not None:
        method = message.collision_probability_method or "method not stated"
        rows.append(("the message", method, message.collision_probability, None))
    return Table("Probability of collision", FIGURES, rows)


def encounter_pictures(found: Met, odds: Probability, limit: float | None) -> Iterator[Picture]:
    """Yield the uncertainty tube, the clearance in sigmas, and the collision probability over time."""
    met, (one, other) = found.encounter, found.names
    pair = met.path, met.other, Sphere(found.radius), met.errors, met.other_errors
    options: dict[str, Any] = {"sigmas": TUBE, "names": (one, other)}
    yield Picture(
        "tube", f"Position of {one} relative to {other}, within {TUBE:g} sigma", "tube", pair, options
    )
    curves, both = tuple([each] for each in pair), f"{one} - {other}"
    yield Picture("sigmas", "Clearance in sigmas against time", "sigmas", curves, {"names": [both]})
    if len(odds.rate_times) > 1:
        options = {"what": both, "limit": limit}
        yield Picture("collision", "Rate and probability of contact", "collision", (odds, met.path), options)
