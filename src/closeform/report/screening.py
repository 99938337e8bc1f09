"""Reports of a screening of ephemerides and of a conjunction data message."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from closeform.conflicts.flight import WatchedFlight
from closeform.exchange.ccsds.cdm import write_cdm
from closeform.exchange.ccsds.conjunction import Conjunction
from closeform.exchange.common_frame import CommonFrame
from closeform.exchange.epochs import Epoch
from closeform.exchange.export_tracks.track import file_names
from closeform.mission.verdict import MET, NOT_MET, Verdict, conflicts_in
from closeform.report import page
from closeform.report.description import Column, Section, Stamps, Table, counted, some_of, state_columns
from closeform.report.page import Command, Head
from closeform.report.picture import Picture, Progress
from closeform.report.sections import conflicts, model, uncertain
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
SURE = (
    "Conflicts, closest approaches",
    "certified for the interpolated motion; the interpolation error is an estimate",
)


@dataclass(frozen=True, eq=False)
class ScreenReport:
    """Report on a flight along ephemerides in a common frame, with the command that requested it."""

    frame: CommonFrame
    flight: WatchedFlight
    zones: PairZones
    command: Command
    uncertain: "UncertainFlight | None" = None
    messages: tuple[tuple[str, Conjunction, tuple[str, ...]], ...] | None = None  # None: not requested

    @property
    def title(self) -> str:
        """The title, with the names or the number of the spacecraft."""
        names = self.frame.names
        return f"Screening of {' and '.join(names) if len(names) == 2 else f'{len(names)} craft'}"

    @property
    def opening(self) -> tuple[str, ...]:
        """The spacecraft, the epochs, the frame, manoeuvres, interpolation and covariances."""
        frame = self.frame
        return (
            f"{len(frame.names)} craft, {len(frame.times)} common epochs from {frame.epoch} "
            f"{frame.time_system}, {frame.times[-1] - frame.times[0]:.1f} s",
            f"Frame: radial, along-track (arc), cross-track of {frame.names[0]}, "
            f"on a circle of {frame.radius / 1e3:.3f} km",
            *self.fired,
            *self.interpolated,
            *self.known,
        )

    @property
    def fired(self) -> tuple[str, ...]:
        """The manoeuvres between segments, with their count and total delta-v per spacecraft."""
        pairs = zip(self.frame.names, self.frame.manoeuvres, strict=True)
        found = [
            f"{name} {len(some)} ({sum(size for _, size in some):.4g} m/s)" for name, some in pairs if some
        ]
        return (f"Manoeuvres between segments: {', '.join(found)}",) if found else ()

    @property
    def interpolated(self) -> tuple[str, ...]:
        """The spacecraft with states interpolated to common epochs, and the estimated error."""
        pairs = zip(self.frame.names, self.frame.interpolation_errors.tolist(), strict=True)
        moved = {name: error for name, error in pairs if error > 0.0}
        if not moved:
            return ()
        worst = max(moved, key=lambda name: moved[name])
        error = f"error up to {moved[worst]:.2g} m ({worst}, estimate)"
        return (f"States of {some_of(list(moved))} interpolated, {error}",)

    @property
    def known(self) -> tuple[str, ...]:
        """The covariances in use, their age, and the spacecraft that are assumed to be known exactly."""
        if self.uncertain is None:
            return ()
        pairs = [
            (name, age)
            for name, age in zip(self.frame.names, self.frame.ages, strict=True)
            if age is not None
        ]
        oldest = max(pairs, key=lambda pair: abs(pair[1]))
        line = f"Covariances of {counted(len(pairs), 'ephemeris', 'ephemerides')}"
        if oldest[1]:
            line += f", propagated by Hill's equations for up to {abs(oldest[1]):.1f} s ({oldest[0]})"
        exact, looked = self.uncertain.exact, len(self.flight.approaches)
        lines = [line, *([f"States taken as exact: {', '.join(exact)}"] if exact else [])]
        if looked < self.flight.pairs:
            lines.append(f"Clearance in sigmas only for the {looked} closest of {self.flight.pairs} pairs")
        return tuple(lines)

    @property
    def sigmas(self) -> tuple[Table, ...]:
        """The table of clearance in sigmas and probability of zone violation."""
        if self.uncertain is None:
            return ()
        rows = [row(pair) for pair in self.uncertain.pairs[:MOST_PAIRS]]
        return (Table("Clearance in sigmas, and probability of zone violation", SIGMAS, rows),)

    @cached_property
    def found(self) -> tuple[tuple[str, ...], tuple[Table, ...]]:
        """Conflicts as lines and as tables."""
        lines, tables = conflicts.listed("Conflicts", self.flight)
        return tuple(lines), tuple(tables)

    @property
    def lines(self) -> tuple[str, ...]:
        """The interpolation error, the zones, the conflicts, and the number of messages."""
        found = (*conflicts.between_samples(self.flight), *conflicts.zones(self.flight), *self.found[0])
        if self.messages is None:
            return found
        return (*found, f"{counted(len(self.messages), 'conjunction data message')} in {CDM}/")

    @property
    def stamps(self) -> Stamps:
        """The UTC of its times."""
        return Stamps(Epoch(self.frame.epoch, self.frame.time_system))

    @property
    def tables(self) -> tuple[Table, ...]:
        """Conflicts, closest approaches and clearance in sigmas."""
        near = conflicts.approaches("Closest approaches", self.flight)
        return tuple(map(self.stamps.dated, (*self.found[1], *near, *self.sigmas)))

    @property
    def verdict(self) -> Verdict:
        """The number of conflicts, or of pairs within the required sigmas."""
        if self.uncertain is None:
            return Verdict(None, *conflicts_in([self.flight]), exceeded=None, searched=False)
        within = len(self.uncertain.within)
        return Verdict(None, within, within, exceeded=None, searched=False, sigmas=self.uncertain.sigmas)

    @cached_property
    def chapters(self) -> tuple[Section, ...]:
        """The sections of the page except the one on reproduction."""
        lines, frame = self.opening, self.frame
        rows = [
            (name, file.name, error or None, age)
            for name, file, error, age in zip(
                frame.names,
                self.command.files,
                frame.interpolation_errors.tolist(),
                frame.ages,
                strict=True,
            )
        ]
        columns = [
            column if any(row[k] is not None for row in rows) else replace(column, heading=None)
            for k, column in enumerate(EPHEMERIDES)
        ]
        asked = Table("Ephemerides", tuple(columns), rows), self.command.table
        sure = [SURE, *model.of_errors(self.uncertain is not None)]
        return (
            Section("Request", tables=asked),
            Section("Results", (*lines[2:], *self.lines), self.tables, pictures=tuple(self.pictures)),
            Section("Limits of the model", tuple(self.limits), (model.certain(sure),)),
        )

    @property
    def limits(self) -> Iterator[str]:
        """The approximations of the model, and their size."""
        frame = self.frame
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
        if self.uncertain is not None:
            yield (
                "State errors are Gaussian, propagated by Hill's equations from the first epoch, and "
                "independent between craft."
            )

    @property
    def pictures(self) -> Iterator[Picture]:
        """All paths, the closest pairs, and the uncertainty of their clearance."""
        flight, zones = self.flight, self.zones
        yield from conflicts.coasting(flight, zones)
        if self.uncertain is not None:
            errors = dict(zip(self.frame.names, self.frame.errors, strict=True))
            pairs = self.uncertain.pairs
            yield from uncertain.clearances(flight, errors, pairs, self.uncertain.sigmas)
            likely = [(one.probability.high, one) for one in pairs if one.probability is not None]
            likeliest = max(likely, key=lambda one: one[0], default=(0.0, None))[1]
            yield from uncertain.collisions(flight, likeliest, None)

    @property
    def figures(self) -> dict[str, Any]:
        """The printed figures in full precision and SI units, for `summary.json`."""
        frame = self.frame
        found = {} if self.uncertain is None else {"sigmas": self.sigmas[0].records}
        return {
            "kind": "screen",
            "title": self.title,
            **self.command.figures,
            **self.verdict.figures,
            "frame": {
                "chief": frame.names[0],
                "epoch": frame.epoch,
                "time_system": frame.time_system,
                "epochs": len(frame.times),
                "end_s": float(frame.times[-1]),
                "radius_m": frame.radius,
            },
            "mean_motion_rad_s": frame.mean_motion,
            "craft": list(frame.names),
            **self.stamps.record({"flight": conflicts.figures(self.flight), **found}),
        }

    def write(
        self, folder: Folder, progress: Progress = lambda text: None, viewer: page.Viewer | None = None
    ) -> None:
        """Fill a result folder with the files of a screening; `viewer` writes the animated page."""
        frame, flight = self.frame, self.flight
        near = [conflicts.approach_row(one) for one in flight.approaches]
        tables = {
            "conflicts": Table("", CONFLICT, [conflicts.conflict_row(met) for met in flight.conflicts]),
            "approaches": Table("", APPROACH, near),
        }
        if self.uncertain is not None:
            tables["sigmas"] = Table("", SIGMAS, [row(pair) for pair in self.uncertain.pairs])
        progress("writing tables")
        for name, table in tables.items():
            folder.table(name, self.stamps.dated(table).stored)
        folder.table("states", state_columns(frame.names, frame.times, frame.states, self.stamps.epoch))
        if self.messages is not None:
            place = folder.path / CDM
            place.mkdir()
            names = file_names([name for name, _, _ in self.messages])
            for name, (_, conjunction, comments) in zip(names, self.messages, strict=True):
                write_cdm(place / f"{name}.cdm", conjunction, comments=comments)
        head = Head(self.title, self.opening[:2], str(self.verdict), self.verdict.ok)
        page.write(folder, head, self.chapters, self.command.repeat, self.figures, progress, viewer)


FIGURES = (
    Column("figure", "figure", words=True),
    Column("definition", "counts", words=True),
    Column("value", "value", "{:.5g}".format),
    Column("95 % interval", None, "{:.5g} to {:.5g}".format, parts=("low", "high")),
)
SAMPLES = 201  # instants in states.parquet
TUBE = 3.0  # sigmas
SURE_OF_ENCOUNTER = (
    ("Clearance in sigmas", "certified for the Gaussian errors of the message, in Hill's equations"),
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
class EncounterReport:
    """Report of a conjunction data message for two bodies with a combined `radius` [m]."""

    message: Conjunction
    radius: float
    encounter: Encounter
    clearance: SigmaApproach
    probability: Probability
    short: Probability | None  # None if the two do not pass each other in the window
    limit: float | None
    command: Command

    @property
    def names(self) -> tuple[str, str]:
        """The names of the two objects."""
        first, second = self.message.objects
        return first.name, second.name

    @property
    def title(self) -> str:
        """The title, with the names of both objects."""
        return f"Encounter of {' and '.join(self.names)}"

    @property
    def opening(self) -> tuple[str, ...]:
        """The two objects, the miss distance, the relative speed and the window."""
        message, encounter = self.message, self.encounter
        first, second = (f"{each.name} ({each.designator})" for each in message.objects)
        place = ", ".join(
            f"{axis} {value:.3f}"
            for axis, value in zip(
                ("radial", "along-track", "cross-track"), message.relative_state, strict=False
            )
        )
        span = encounter.path.end
        return (
            f"{first} and {second}, closest at {message.tca} UTC",
            f"Miss distance {encounter.distance:.3f} m ({place}), relative speed {encounter.speed:.6g} m/s",
            f"Radius of both bodies {self.radius:g} m; evaluated for {span:.6g} s before and after, "
            f"in the Hill frame of {message.objects[0].name}",
        )

    @property
    def lines(self) -> tuple[str, ...]:
        """The clearance in sigmas, and warnings about the figures."""
        sigmas, time = float(self.clearance.sigmas), round(float(self.clearance.time), 1) + 0.0
        clear = f"Clear by {sigmas:.4g} sigmas, minimum at {time:.1f} s"
        if sigmas == 0.0:
            clear = f"Clear by 0 sigmas: the bodies overlap even without errors, at {time:.1f} s"
        return (clear, *self.notes, *(f"Warning: {line}" for line in self.encounter.warnings))

    @property
    def notes(self) -> Iterator[str]:
        """Notes on the limits of the time window."""
        if self.short is None:
            yield "No short encounter: the closest approach is at an edge of the window"
        found = self.probability
        grows = len(found.rates) > 0 and found.rates[-1] > EDGE * found.rates.max()
        if found.at_start > EDGE * found.value or grows:
            yield "The probability still grows at an edge of the window: give a longer --window"

    @property
    def tables(self) -> Sequence[Table]:
        """The table of collision probabilities by method."""
        found, short, message = self.probability, self.short, self.message
        sure = found.low, found.high
        rows = [
            ("ever inside", "trajectories with at least one contact", found.value, sure),
            ("inside at the start", "part of the above", found.at_start, None),
            ("mean entries", "mean number after the start", found.mean_entries, None),
            ("short encounter (2-D)", "straight motion, constant errors", short and short.value, None),
        ]
        if message.collision_probability is not None:
            method = message.collision_probability_method or "method not stated"
            rows.append(("the message", method, message.collision_probability, None))
        return (Table("Probability of collision", FIGURES, rows),)

    @property
    def verdict(self) -> Judgement:
        """The comparison of the collision probability with its limit."""
        return Judgement(self.probability.value, self.limit)

    @property
    def chapters(self) -> tuple[Section, ...]:
        """The sections of the page except the one on reproduction."""
        return (
            Section("Request", self.opening[:1], (self.command.table,) if self.command.given else ()),
            Section("Results", (*self.opening[1:], *self.lines), tuple(self.tables), pictures=self.pictures),
            Section("Limits of the model", tuple(self.limits), (model.certain(list(SURE_OF_ENCOUNTER)),)),
        )

    @property
    def limits(self) -> Iterator[str]:
        """The assumptions of Hill's equations for this encounter."""
        yield (
            "Both objects follow Hill's equations about the first one: a circular orbit, a point mass, no "
            "other force. Errors are Gaussian and propagated by the same equations."
        )
        looked = 2.0 * self.encounter.path.end
        yield f"The time before and after these {looked:.6g} s is not evaluated."

    @property
    def pictures(self) -> tuple[Picture, ...]:
        """The uncertainty tube, the clearance in sigmas, and the collision probability over time."""
        met, (one, other) = self.encounter, self.names
        pair = met.path, met.other, Sphere(self.radius), met.errors, met.other_errors
        options: dict[str, Any] = {"sigmas": TUBE, "names": (one, other)}
        caption = f"Position of {one} relative to {other}, within {TUBE:g} sigma"
        found = [Picture("tube", caption, "tube", pair, options)]
        caption = "Clearance in sigmas against time"
        curves = tuple([each] for each in pair)
        found.append(Picture("sigmas", caption, "sigmas", curves, {"names": [f"{one} - {other}"]}))
        if len(self.probability.rate_times) > 1:
            caption = "Rate and probability of contact"
            options = {"what": f"{one} - {other}", "limit": self.limit}
            found.append(Picture("collision", caption, "collision", (self.probability, met.path), options))
        return tuple(found)

    @property
    def figures(self) -> dict[str, Any]:
        """The printed figures in full precision and SI units, for `summary.json`."""
        met, verdict = self.encounter, self.verdict
        return {
            "kind": "encounter",
            "title": self.title,
            **self.command.figures,
            "status": verdict.status,
            "verdict": str(verdict),
            "limit": self.limit,
            "tca": self.message.tca,
            "craft": list(self.names),
            "radius_m": self.radius,
            "miss_distance_m": met.distance,
            "relative_speed_m_s": met.speed,
            "window_s": met.path.end,
            "mean_motion_rad_s": met.path.orbit.mean_motion,
            "sigmas": float(self.clearance.sigmas),
            "sigmas_time_s": float(self.clearance.time),
            "warnings": list(met.warnings),
            "probabilities": self.tables[0].records,
        }

    def write(
        self, folder: Folder, progress: Progress = lambda text: None, viewer: page.Viewer | None = None
    ) -> None:
        """Fill a result folder with the report of the encounter; `viewer` writes the animated page."""
        met = self.encounter
        times = np.linspace(float(met.path.start), float(met.path.end), SAMPLES)
        states = np.array([met.path.state(times), met.other.state(times)])
        folder.table("states", state_columns(self.names, times, states, None))
        verdict = self.verdict
        head = Head(self.title, self.opening[:1], str(verdict), verdict.status == MET, met.warnings)
        page.write(folder, head, self.chapters, self.command.repeat, self.figures, progress, viewer)
