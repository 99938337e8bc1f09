"""Report of a screening: ephemerides in a common frame, and their conflicts and closest approaches."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from closeform.conflicts.flight import WatchedFlight
from closeform.exchange.cdm import write_cdm
from closeform.exchange.common_frame import CommonFrame
from closeform.exchange.conjunction import Conjunction
from closeform.exchange.epochs import Epoch
from closeform.exchange.exported import file_names
from closeform.mission.verdict import MOST_NAMES, Verdict, conflicts_in
from closeform.report import conflicts, model, results, uncertain
from closeform.report.conflicts import APPROACH, CONFLICT, MOST_PAIRS
from closeform.report.page import Head
from closeform.report.picture import Picture, Progress
from closeform.report.reproduction import Command
from closeform.report.section import Section
from closeform.report.table import STATE_COLUMNS, Column, Table, counted
from closeform.report.uncertain import SIGMAS, row
from closeform.report.utc_columns import Stamps
from closeform.storage.result_folder import Folder
from closeform.zones.pair_zones import PairZones

if TYPE_CHECKING:  # a screening without covariances does not need these kernels
    from closeform.uncertainty.uncertain_flight import UncertainFlight


EPHEMERIDES = (
    Column("craft", "craft", words=True),
    Column("file", "file", words=True),
    Column("interpolated, off by [m]", "interpolation_error_m", "{:.2g}".format),
    Column("covariance carried for [s]", "covariance_carried_s", "{:.1f}".format),
)
CDM = "cdm"  # the folder of conjunction messages
SURE = (
    "Conflicts, closest approaches",
    "certified for the motion between epochs that is told above; how far craft may be off it is an estimate",
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
        told = [
            f"{name} {len(some)} ({sum(size for _, size in some):.4g} m/s)" for name, some in pairs if some
        ]
        return (f"Manoeuvres between segments: {', '.join(told)}",) if told else ()

    @property
    def interpolated(self) -> tuple[str, ...]:
        """The spacecraft with states interpolated to common epochs, and the estimated error."""
        pairs = zip(self.frame.names, self.frame.interpolation_errors.tolist(), strict=True)
        moved = {name: error for name, error in pairs if error > 0.0}
        if not moved:
            return ()
        worst = max(moved, key=lambda name: moved[name])
        names = ", ".join(list(moved)[:MOST_NAMES]) + f" and {len(moved) - MOST_NAMES} more" * (
            len(moved) > MOST_NAMES
        )
        return (f"States of {names} interpolated, off by up to {moved[worst]:.2g} m ({worst}), by estimate",)

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
            line += f", carried by Hill's equations for up to {abs(oldest[1]):.1f} s ({oldest[0]})"
        exact, looked = self.uncertain.exact, len(self.flight.approaches)
        told = [line, *([f"Taken for known exactly: {', '.join(exact)}"] if exact else [])]
        if looked < self.flight.pairs:
            told.append(f"Sigmas of the {looked} closest of {self.flight.pairs} pairs only")
        return tuple(told)

    @property
    def sigmas(self) -> tuple[Table, ...]:
        """The table of clearance in sigmas and probability of zone violation."""
        if self.uncertain is None:
            return ()
        rows = [row(pair) for pair in self.uncertain.pairs[:MOST_PAIRS]]
        return (Table("Clearance in sigmas, and probability to come within the zone", SIGMAS, rows),)

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
            Section("What was asked", tables=asked),
            Section("What was found", (*lines[2:], *self.lines), self.tables, pictures=tuple(self.pictures)),
            Section("Limits of the model", tuple(self.limits), (model.certain(sure),)),
        )

    @property
    def limits(self) -> Iterator[str]:
        """The approximations of the model, and their size."""
        frame = self.frame
        radial, _, across = np.abs(frame.states[..., :3]).max(axis=(0, 1)) / frame.radius
        yield (
            "States at epochs are those of the files. Between them craft move as it is told above: Hill's "
            "equations, a circular orbit, hold from one epoch to the next only."
        )
        share = 100.0 * (radial + 0.5 * across**2)
        yield (
            f"Along-track and cross-track are arcs on the circle of {frame.names[0]}: lengths along them are "
            f"off by up to {share:.2g} % of themselves. Zones keep its axes, which turn along these arcs."
        )
        if self.uncertain is not None:
            yield (
                "Errors of states are Gaussian, and grow by Hill's equations from the first epoch on; those "
                "of two craft are independent."
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

    def leave(
        self, folder: Folder, progress: Progress = lambda text: None, viewer: results.Viewer | None = None
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
        folder.table("states", states(frame))
        if self.messages is not None:
            place = folder.path / CDM
            place.mkdir()
            names = file_names([name for name, _, _ in self.messages])
            for name, (_, conjunction, comments) in zip(names, self.messages, strict=True):
                write_cdm(place / f"{name}.cdm", conjunction, comments=comments)
        head = Head(self.title, self.opening[:2], str(self.verdict), self.verdict.ok)
        results.leave(folder, head, self.chapters, self.command.repeated, self.figures, progress, viewer)


def states(frame: CommonFrame) -> dict[str, Any]:
    """Return all states of all spacecraft in the common frame, as columns."""
    count, stamps = len(frame.times), Stamps(Epoch(frame.epoch, frame.time_system))
    return {
        "craft": np.repeat(frame.names, count),
        "time_s": np.tile(frame.times, len(frame.names)),
        "time_utc": stamps.column(frame.times, len(frame.names)),
        **dict(zip(STATE_COLUMNS, frame.states.reshape(-1, 6).T, strict=True)),
    }
