"""The report of a run: a section for each stage, the same for the terminal, the page and the files."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice
from math import degrees, hypot, pi
from pathlib import Path
from typing import Any

import numpy as np

from closeform import arc_tables
from closeform.mission_result import Mission, StageResult
from closeform.report import (
    coast,
    conflicts,
    drift,
    effort,
    gather,
    limits,
    lock,
    move,
    page,
    reconfigure,
    transfer,
    uncertain,
)
from closeform.report.clock import Clock
from closeform.report.drawing import drawn
from closeform.report.picture import Film, Progress
from closeform.report.section import Section, fate, not_filmed
from closeform.report.table import Table, counted
from closeform.result_folder import REPORT, Folder
from closeform.scenario import (
    Avoid,
    Coast,
    Gather,
    Lock,
    Reconfigure,
    Regather,
    Scatter,
    Scenario,
    StageTable,
    Transfer,
)
from closeform.verdict import Verdict

SUBJECTS: dict[type[StageTable], Callable[[Mission, Any], Section]] = {
    Coast: coast.section,
    Transfer: transfer.section,
    Avoid: move.section,
    Scatter: reconfigure.scatter,
    Regather: reconfigure.regather,
    Reconfigure: reconfigure.section,
    Lock: lock.section,
    Gather: gather.section,
}
Drawn = list[tuple[Path, str]]  # files of pictures, each with its caption
SAMPLES = 201  # instants of each craft and stage in paths.parquet
STATE_COLUMNS = ("x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s")
THRUST_COLUMNS = ("ux_m_s2", "uy_m_s2", "uz_m_s2")


@dataclass(frozen=True, eq=False)
class RunReport:
    """What there is to say of a mission."""

    mission: Mission

    @property
    def opening(self) -> str:
        """One line on who flies where."""
        n, results = self.mission.orbit.mean_motion, self.mission.results
        where = f"an orbit of {2 * pi / n / 60.0:.2f} min" if n else "deep space"
        craft = counted(len(self.mission.scenario.craft), "craft", "craft")
        epoch = self.mission.scenario.epoch
        begun = "" if epoch is None else f" from {epoch}"
        return f"{craft} in {where}, {results[-1].end if results else 0.0:.1f} s{begun}"

    @cached_property
    def sections(self) -> tuple[Section, ...]:
        """One for each stage flown."""
        return tuple(section(self.mission, result) for result in self.mission.results)

    @property
    def origin(self) -> tuple[str, ...]:
        """The chief's orbit; which states at the epoch were interpolated, and how far they may be off."""
        chief, inputs = self.mission.scenario.chief, self.mission.scenario.inputs
        if chief is None:
            return ()
        a, _, ex, ey, inclination, node = chief.elements
        shape = f"a {a / 1e3:.3f} km, e {hypot(ex, ey):.5f}"
        plane = f"i {degrees(inclination):.4f} deg, node {degrees(node) % 360.0:.4f} deg"
        notes = () if inputs is None else inputs.notes
        return f"Chief at the epoch: {shape}, {plane} in {chief.frame}", *notes

    @cached_property
    def closing(self) -> tuple[Table, ...]:
        """What each craft used in the whole mission."""
        return limits.used_up(self.mission)

    @property
    def summary(self) -> dict[str, Any]:
        """Every figure printed, in full and in SI units."""
        mission, scenario = self.mission, self.mission.scenario
        delta_v, propellant = mission.spent_of_each
        return {
            "kind": "run",
            "title": scenario.title,
            "inputs": {name: f"sha256:{digest}" for name, digest in scenario.digests.items()},
            **origin(scenario),
            "seed": scenario.study.seed if scenario.study is not None and scenario.case is not None else None,
            "case": scenario.case,
            **verdict(mission.verdict),
            "stopped": mission.stopped,
            "warnings": list(mission.warnings),
            "mean_motion_rad_s": mission.orbit.mean_motion,
            "craft": list(scenario.names),
            "delta_v_m_s": dict(zip(scenario.names, delta_v.tolist(), strict=True)),
            "propellant_kg": dict(zip(scenario.names, propellant.tolist(), strict=True)),
            "used": [record for table in self.closing for record in table.records],
            "stages": [section.figures for section in self.sections],
        }

    @property
    def files(self) -> dict[str, dict[str, list[Any]]]:
        """The tables for Parquet: the rows of every stage below those of the one before."""
        found: dict[str, dict[str, list[Any]]] = {}
        for result, told in zip(self.mission.results, self.sections, strict=True):
            for name, table in told.files.items():
                columns = {"stage": [result.number] * len(table.rows), **table.stored}
                below = found.setdefault(name, {key: [] for key in columns})
                for key, cells in columns.items():
                    below[key] += cells
        return found


def origin(scenario: Scenario) -> dict[str, Any]:
    """The epoch and the chief at it, of a scenario that has them."""
    epoch, chief = scenario.epoch, scenario.chief
    found: dict[str, Any] = {} if epoch is None else {"epoch": str(epoch), "epoch_utc": epoch.utc([0.0])[0]}
    if chief is not None:
        found["chief"] = {
            "frame": chief.frame,
            "center": chief.center,
            "state_m_m_s": chief.state.tolist(),
            "mu_m3_s2": chief.mu,
            "eccentricity": chief.eccentricity,
        }
    return found


def verdict(reached: Verdict) -> dict[str, Any]:
    """What it has come to."""
    exceeded = [vars(use) for use in reached.exceeded or ()]
    return {
        "status": reached.status,
        "verdict": str(reached),
        "clear": reached.clear,
        "conflicts": reached.conflicts,
        "pairs_in_conflict": reached.pairs if reached.conflicts is not None else None,
        "limits_kept": None if reached.exceeded is None else not exceeded,
        "exceeded": exceeded,
        "late": [
            {
                "stage": late.number,
                "do": late.verb,
                "asked_s": late.asked,
                "took_s": late.took,
                "keeping_N": {use.craft: use.used for use in late.punctual},
            }
            for late in reached.late
        ],
    }


def section(mission: Mission, result: StageResult[Any, Any]) -> Section:
    """What its subject says of a stage, and what is said of every one."""
    told = uncertain.told(SUBJECTS[type(result.stage)](mission, result), result, mission.scenario.names)
    used = limits.figures(mission, result) if result.result is not None else {}
    closing = limits.lines(mission, result) if result.result is not None else ()
    count = len(result.after.names)
    whole = replace(
        told,
        lines=conflicts.zones(result.before) + told.lines,
        tables=told.tables + drift.tables(result),
        closing=(*told.closing, *closing, *drift.lines(result), *not_filmed(told.pictures, count)),
        pictures=tuple(
            replace(
                picture,
                name=f"stage-{result.number}-{picture.name}",
                stage=fate(result),
                failed=result.failure is not None,
            )
            for picture in told.pictures + drift.pictures(result)
            if not (isinstance(picture, Film) and picture.most < count)
        ),
        figures={
            "number": result.number,
            "name": result.stage.name,
            "do": result.stage.verb,
            "start_s": result.start,
            "end_s": result.end,
            "flown": result.flown,
            "failure": result.failure,
            "before": conflicts.figures(result.before),
            "after": conflicts.figures(result.after),
            **told.figures,
            **used,
            **drift.figures(result),
        },
        files={
            **conflicts.files(result),
            **effort.files(mission, result),
            **told.files,
            **drift.files(result),
        },
    )
    epoch = mission.scenario.epoch
    return whole if epoch is None else Clock(epoch, result.start).told(whole, result.end)


def states(mission: Mission) -> dict[str, Any]:
    """States and thrusts as flown, at equal steps of every stage, to look at and to plot."""
    names, epoch = np.array(mission.scenario.names), mission.scenario.epoch
    parts: list[dict[str, Any]] = []
    for result in mission.results:
        times = np.linspace(result.start, result.end, SAMPLES)
        paths = result.after.paths
        parts.append(
            {
                "stage": np.full(len(names) * SAMPLES, result.number),
                "craft": np.repeat(names, SAMPLES),
                "time_s": np.tile(times, len(names)),
                **({} if epoch is None else {"time_utc": np.tile(epoch.utc(times), len(names))}),
                **dict(zip(STATE_COLUMNS, paths.state(times).reshape(-1, 6).T, strict=True)),
                **dict(zip(THRUST_COLUMNS, paths.thrust(times).reshape(-1, 3).T, strict=True)),
            }
        )
    return {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}


def exact(mission: Mission) -> dict[str, dict[str, Any]]:
    """What `load` makes the paths and searches of a mission from again, to the last bit."""
    arcs, legs = [], []
    for result in mission.results:
        flights = {"after": result.after} | (
            {"before": result.before} if result.before is not result.after else {}
        )
        for when, flight in flights.items():
            arcs.append(arc_tables.of_paths(flight.paths, flight.names, result.number, when))
        if result.stage.searches:
            legs.append(arc_tables.of_legs(result.result.search.legs, result.number))
    return {name: arc_tables.together(parts) for name, parts in {"arcs": arcs, "legs": legs}.items() if parts}


def leave(
    report: RunReport,
    folder: Folder,
    progress: Progress = lambda text: None,
    viewer: Callable[[Mission, Folder, Drawn], None] | None = None,
) -> None:
    """Fill a result folder with everything that a run leaves; `progress` is told what is under way.

    `viewer` writes the page in which the mission moves, beside the pictures that were drawn.
    """
    mission = report.mission
    folder.scenario(mission.scenario)
    progress("writing tables")
    for name, columns in {**report.files, "paths": states(mission), **exact(mission)}.items():
        folder.table(name, columns)
    pictures = [picture for told in report.sections for picture in told.pictures]
    files = drawn(pictures, folder, progress)
    shown = iter(files)
    folder.csv("burns", report.files.get("burns", {}))
    faint = f"{report.opening}; {Path(mission.scenario.file).name}"
    parts = page.head(
        mission.scenario.title, [faint, *report.origin], str(mission.verdict), mission.verdict.ok
    )
    parts += [page.paragraph(line, "bad") for line in mission.warnings]
    for told in report.sections:
        parts += page.section(told, islice(shown, len(told.pictures)))
    parts += map(page.titled, report.closing)
    folder.text(REPORT, page.document(mission.scenario.title, parts))
    if viewer is not None:
        progress("writing viewer.html")
        viewer(mission, folder, files)
    folder.summary(report.summary)
