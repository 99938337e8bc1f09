"""Report of a run: one section per stage, shared by the terminal, the page and the files."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from math import degrees, hypot, pi
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from closeform.arrays import Floats
from closeform.mission.mission_result import Mission, StageResult
from closeform.report import (
    budget,
    coast,
    conflicts,
    drift,
    effort,
    gather,
    limits,
    lock,
    model,
    model_error,
    move,
    reconfigure,
    reproduction,
    requirements,
    scenario_summary,
    transfer,
    uncertain,
)
from closeform.report.page import Head
from closeform.report.picture import Film, Progress
from closeform.report.results import Viewer
from closeform.report.results import leave as leave_all
from closeform.report.section import Section, fate, not_filmed, not_flown
from closeform.report.table import STATE_COLUMNS, Table, counted
from closeform.report.utc_columns import Stamps
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
from closeform.storage import arc_tables
from closeform.storage.result_folder import Folder

if TYPE_CHECKING:
    from closeform.report.simulation import FlightTold

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
SAMPLES = 201  # instants per spacecraft and stage in paths.parquet
FLOWN = "Flown in the field"
FLOWN_PATHS = "flown"  # the table of the worst simulation, next to the planned paths
THRUST_COLUMNS = ("ux_m_s2", "uy_m_s2", "uz_m_s2")


@dataclass(frozen=True, eq=False)
class RunReport:
    """Report on a mission."""

    mission: Mission

    @property
    def opening(self) -> str:
        """One line on the spacecraft, the orbit, the duration and the epoch."""
        n, results = self.mission.orbit.mean_motion, self.mission.results
        where = f"an orbit of {2 * pi / n / 60.0:.2f} min" if n else "deep space"
        craft = counted(len(self.mission.scenario.craft), "craft", "craft")
        epoch = self.mission.scenario.epoch
        begun = "" if epoch is None else f" from {epoch}"
        return f"{craft} in {where}, {results[-1].end if results else 0.0:.1f} s{begun}"

    @cached_property
    def sections(self) -> tuple[Section, ...]:
        """The sections of the stages, in order."""
        return tuple(section(self.mission, result) for result in self.mission.results)

    @cached_property
    def flights(self) -> "FlightTold | None":
        """The content on simulations in the high-fidelity model; None if there are none."""
        if self.mission.flights is None:
            return None
        from closeform.report.simulation import FlightTold  # most runs do not need these kernels

        return FlightTold(self.mission.flights)

    @cached_property
    def in_flight(self) -> tuple[Section, ...]:
        """The section on simulations, or on the reason for their absence if they were requested."""
        mission = self.mission
        if mission.grounded is not None:
            return (Section(FLOWN, (f"Cannot be flown: {mission.grounded}",)),)
        if mission.scenario.flights is not None and not mission.flown:
            return (Section(FLOWN, ("Nothing is flown: the mission stopped in its first stage",)),)
        return () if self.flights is None else (self.flights.section(FLOWN, self.flights.opening[1:]),)

    @property
    def origin(self) -> tuple[str, ...]:
        """The chief's orbit, notes on interpolated states, and the estimated model error."""
        chief, inputs = self.mission.scenario.chief, self.mission.scenario.inputs
        estimate = tuple(model_error.estimate(self.mission))
        if chief is None:
            return estimate
        a, _, ex, ey, inclination, node = chief.elements
        shape = f"a {a / 1e3:.3f} km, e {hypot(ex, ey):.5f}"
        plane = f"i {degrees(inclination):.4f} deg, node {round(degrees(node), 4) % 360.0:.4f} deg"
        notes = () if inputs is None else inputs.notes
        return f"Chief at the epoch: {shape}, {plane} in {chief.frame}", *notes, *estimate

    @cached_property
    def closing(self) -> tuple[Table, ...]:
        """The table of use in the whole mission, if there is one."""
        return limits.used_up(self.mission)

    @cached_property
    def thrusting(self) -> Floats:
        """The thrust time of each spacecraft in each stage (S, N) [s]."""
        return budget.thrusting(self.mission, [told.files for told in self.sections])

    @cached_property
    def chapters(self) -> tuple[Section, ...]:
        """The sections of the page except the one on reproduction, with the stages in the middle."""
        mission, epoch = self.mission, self.mission.scenario.epoch
        whole = requirements.section(mission)
        if epoch is not None:
            whole = replace(whole, tables=tuple(map(Stamps(epoch).dated, whole.tables)))
        before = scenario_summary.section(mission.scenario), whole
        told = budget.section(mission, self.thrusting), *self.sections, *self.in_flight
        sure = () if self.flights is None else (self.flights.sure,)
        return *before, *told, model.section(mission), *sure

    @property
    def seed(self) -> int | None:
        """The seed of a sampled case; None if the mission is not a case of a study."""
        scenario = self.mission.scenario
        return scenario.study.seed if scenario.study is not None and scenario.case is not None else None

    def repeat(self, out: Path | None, beside: Sequence[str]) -> Section:
        """Return the section on reproduction, with the files next to the page."""
        scenario = self.mission.scenario
        case = "" if scenario.case is None else f" --case {scenario.case}"
        point = "" if scenario.place is None else f" --point {scenario.place}"
        return reproduction.by_scenario(scenario, "run", f"{point}{case}", beside, out, self.seed)

    @property
    def summary(self) -> dict[str, Any]:
        """The printed figures in full precision and SI units."""
        mission, scenario = self.mission, self.mission.scenario
        delta_v, propellant = mission.spent_of_each
        return {
            "kind": "run",
            "title": scenario.title,
            "inputs": reproduction.inputs(scenario),
            **origin(scenario),
            "seed": self.seed,
            "case": scenario.case,
            **mission.verdict.figures,
            "stopped": mission.stopped,
            "warnings": list(mission.warnings),
            "mean_motion_rad_s": mission.orbit.mean_motion,
            "craft": list(scenario.names),
            "delta_v_m_s": dict(zip(scenario.names, delta_v.tolist(), strict=True)),
            "propellant_kg": dict(zip(scenario.names, propellant.tolist(), strict=True)),
            "used": limits.used(mission).records if self.closing else [],
            "asked": requirements.figures(mission),
            **({} if not mission.lost else {"lost": [one.figures for one in mission.lost]}),
            "budget": budget.figures(mission, self.thrusting),
            "stages": [section.figures for section in self.sections],
            **({} if self.flights is None else {"flights": self.flights.figures}),
            **({} if mission.grounded is None else {"grounded": mission.grounded}),
        }

    @property
    def files(self) -> dict[str, dict[str, list[Any]]]:
        """The tables for Parquet, by name; rows of all stages follow each other."""
        found: dict[str, dict[str, list[Any]]] = {}
        for result, told in zip(self.mission.results, self.sections, strict=True):
            for name, table in told.files.items():
                columns = {"stage": [result.number] * len(table.rows), **table.stored}
                below = found.setdefault(name, {key: [] for key in columns})
                for key, cells in columns.items():
                    below[key] += cells
        return found


def origin(scenario: Scenario) -> dict[str, Any]:
    """Return the epoch and the chief's state, if the scenario has them, for `summary.json`."""
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


def section(mission: Mission, result: StageResult[Any, Any]) -> Section:
    """Return the section of a stage: the part specific to its kind and the part common to all stages."""
    told = uncertain.told(SUBJECTS[type(result.stage)](mission, result), result, mission.scenario.names)
    used = limits.figures(mission, result) if result.result is not None else {}
    closing = limits.lines(mission, result) if result.result is not None else ()
    count = len(result.after.names)
    whole = replace(
        told,
        lines=(
            *not_flown(result),
            *drift.lines(result),
            *model_error.lines(mission, result),
            *conflicts.zones(result.before),
            *told.lines,
        ),
        tables=told.tables + drift.tables(result),
        closing=(
            *model_error.margin(result),
            *told.closing,
            *closing,
            *not_filmed(told.pictures, count),
        ),
        pictures=tuple(
            replace(
                picture,
                name=f"stage-{result.number}-{picture.name}",
                stage=fate(result),
                failed=result.failure is not None,
                flown=result.flown or picture.plot == "trade",  # which shows the cost of any path
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
            **model_error.figures(result),
        },
        files={
            **conflicts.files(result),
            **effort.files(mission, result),
            **told.files,
            **drift.files(result),
        },
    )
    epoch = mission.scenario.epoch
    return whole if epoch is None else Stamps(epoch, result.start).told(whole, result.end)


def states(mission: Mission) -> dict[str, Any]:
    """Return states and thrusts at equally spaced times of every stage, as columns for plots."""
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
                **({} if epoch is None else {"time_utc": Stamps(epoch).column(times, len(names))}),
                **dict(zip(STATE_COLUMNS, paths.state(times).reshape(-1, 6).T, strict=True)),
                **dict(zip(THRUST_COLUMNS, paths.thrust(times).reshape(-1, 3).T, strict=True)),
            }
        )
    return {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}


def exact(mission: Mission) -> dict[str, dict[str, Any]]:
    """Return the tables from which `load` rebuilds the paths and searches of a mission exactly."""
    arcs, legs = [], []
    for result in mission.results:
        flights = {"after": result.after} | (
            {"before": result.before} if result.before is not result.after else {}
        )
        if result.planned is not result.after:  # with pulsed thrusters, or in a case with sampled errors
            flights["planned"] = result.planned
        for when, flight in flights.items():
            arcs.append(arc_tables.of_paths(flight.paths, flight.names, result.number, when))
        if result.stage.searches:
            legs.append(arc_tables.of_legs(result.result.search.legs, result.number))
    return {name: arc_tables.together(parts) for name, parts in {"arcs": arcs, "legs": legs}.items() if parts}


def leave(
    report: RunReport,
    folder: Folder,
    progress: Progress = lambda text: None,
    viewer: Viewer | None = None,
    out: Path | None = None,
) -> None:
    """Fill a result folder with the files of a run; `progress` is called with the current step.

    `viewer` writes the animated page, next to the pictures; `out` is the option for the folder.
    """
    mission = report.mission
    folder.scenario(mission.scenario)
    progress("writing tables")
    tables = {**report.files, "paths": states(mission), **exact(mission)}
    if report.flights is not None:
        tables |= {FLOWN_PATHS if name == "paths" else name: table for name, table in report.flights.stored}
    for name, columns in tables.items():
        folder.table(name, columns)
    folder.csv("burns", report.files.get("burns", {}))
    scenario, found = mission.scenario, mission.verdict
    lines = [f"{report.opening}; {Path(scenario.file).name}", *report.origin]
    head = Head(scenario.title, lines, str(found), found.ok, mission.warnings)
    repeated = partial(report.repeat, out)
    leave_all(folder, head, report.chapters, repeated, report.summary, progress, viewer)
