"""Report of a conjunction data message: miss distance, clearance in sigmas and probability of collision."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from closeform.exchange.conjunction import Conjunction
from closeform.mission.verdict import MET, NOT_MET
from closeform.report import model, results
from closeform.report.page import Head
from closeform.report.picture import Picture, Progress
from closeform.report.reproduction import Command
from closeform.report.section import Section
from closeform.report.table import STATE_COLUMNS, Column, Table
from closeform.storage.result_folder import Folder
from closeform.uncertainty.clearance import SigmaApproach
from closeform.uncertainty.encounter import Encounter
from closeform.uncertainty.probability import Probability
from closeform.zones.solids import Sphere

FIGURES = (
    Column("figure", "figure", words=True),
    Column("what it counts or assumes", "counts", words=True),
    Column("value", "value", "{:.5g}".format),
    Column("95 % interval", None, "{:.5g} to {:.5g}".format, parts=("low", "high")),
)
SAMPLES = 201  # instants in states.parquet
TUBE = 3.0  # sigmas
SURE = (
    ("Clearance in sigmas", "certified for the Gaussian errors of the message, in Hill's equations"),
    ("ever inside, mean entries", "estimated: the interval of 95 % holds sampling and quadrature"),
    ("short encounter (2-D)", "what it assumes, straight flight and errors of one instant, may not hold"),
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
            f"Radius of both bodies {self.radius:g} m; followed for {span:.6g} s before and after, "
            f"in the Hill frame of {message.objects[0].name}",
        )

    @property
    def lines(self) -> tuple[str, ...]:
        """The clearance in sigmas, and warnings about the figures."""
        sigmas, time = float(self.clearance.sigmas), round(float(self.clearance.time), 1) + 0.0
        clear = f"Clear by {sigmas:.4g} sigmas, fewest at {time:.1f} s"
        if sigmas == 0.0:
            clear = f"Clear by 0 sigmas: the bodies overlap even without errors, most at {time:.1f} s"
        return (clear, *self.notes, *(f"Warning: {line}" for line in self.encounter.warnings))

    @property
    def notes(self) -> Iterator[str]:
        """Notes on the limits of the time window."""
        if self.short is None:
            yield "No short encounter: the two are nearest at an edge of the window, and do not pass"
        found = self.probability
        grows = len(found.rates) > 0 and found.rates[-1] > EDGE * found.rates.max()
        if found.at_start > EDGE * found.value or grows:
            yield "The probability still grows at an edge of the window: a longer --window gives more"

    @property
    def tables(self) -> Sequence[Table]:
        """The table of collision probabilities by method."""
        found, short, message = self.probability, self.short, self.message
        sure = found.low, found.high
        rows = [
            ("ever inside", "histories that touch, however often", found.value, sure),
            ("inside at the start", "a part of it", found.at_start, None),
            ("mean entries", "entries after the start, each counted", found.mean_entries, None),
            ("short encounter (2-D)", "straight flight, errors of one instant", short and short.value, None),
        ]
        if message.collision_probability is not None:
            method = message.collision_probability_method or "method not told"
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
            Section("What was asked", self.opening[:1], (self.command.table,) if self.command.given else ()),
            Section(
                "What was found", (*self.opening[1:], *self.lines), tuple(self.tables), pictures=self.pictures
            ),
            Section("Limits of the model", tuple(self.limits), (model.certain(list(SURE)),)),
        )

    @property
    def limits(self) -> Iterator[str]:
        """The assumptions of Hill's equations for this encounter."""
        yield (
            "Both are followed by Hill's equations about the first: its orbit is taken for a circle, the "
            "Earth for a point, and nothing else acts; errors are Gaussian, and grow by the same equations."
        )
        looked = 2.0 * self.encounter.path.end
        yield f"Nothing is said of what comes before and after the {looked:.6g} s looked at."

    @property
    def pictures(self) -> tuple[Picture, ...]:
        """The uncertainty tube, the clearance in sigmas, and the collision probability over time."""
        met, (one, other) = self.encounter, self.names
        pair = met.path, met.other, Sphere(self.radius), met.errors, met.other_errors
        options: dict[str, Any] = {"sigmas": TUBE, "names": (one, other)}
        caption = f"Where {one} may be relative to {other}, within {TUBE:g} sigma"
        found = [Picture("tube", caption, "tube", pair, options)]
        caption = "By how many sigmas the two are clear, against time"
        curves = tuple([each] for each in pair)
        found.append(Picture("sigmas", caption, "sigmas", curves, {"names": [f"{one} - {other}"]}))
        if len(self.probability.rate_times) > 1:
            caption = "When the two are expected to meet, and how probable that is"
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

    def leave(
        self, folder: Folder, progress: Progress = lambda text: None, viewer: results.Viewer | None = None
    ) -> None:
        """Fill a result folder with the report of the encounter; `viewer` writes the animated page."""
        met = self.encounter
        times = np.linspace(float(met.path.start), float(met.path.end), SAMPLES)
        columns: dict[str, Any] = {
            "craft": np.repeat(self.names, SAMPLES),
            "time_s": np.tile(times, 2),
            **dict(
                zip(STATE_COLUMNS, np.vstack([met.path.state(times), met.other.state(times)]).T, strict=True)
            ),
        }
        folder.table("states", columns)
        verdict = self.verdict
        head = Head(self.title, self.opening[:1], str(verdict), verdict.status == MET, met.warnings)
        results.leave(folder, head, self.chapters, self.command.repeated, self.figures, progress, viewer)
