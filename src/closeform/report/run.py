"""Report of a run: the request, the outcome, and one section per stage."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import degrees, hypot, inf, pi
from pathlib import Path
from textwrap import shorten
from typing import TYPE_CHECKING, Any

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.flight import ALL_PAIRS, PairApproach
from closeform.conflicts.two_paths import nearest_first
from closeform.mission.mission_result import FirstLocks, Mission, StageResult
from closeform.mission.simulation_verdict import asked_of
from closeform.mission.verdict import Verdict, conflicts_of
from closeform.report import page
from closeform.report.description import (
    PAIR,
    Column,
    Section,
    Stamps,
    Table,
    called,
    counted,
    fate,
    in_short,
    plan_of,
    state_columns,
)
from closeform.report.page import Repeat
from closeform.report.picture import Film, Picture, Progress
from closeform.report.sections import conflicts, effort, model_limits, moves, passive, searches, uncertain
from closeform.report.sections.conflicts import RATIO
from closeform.report.sections.effort import first_of_each
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
    from closeform.report.simulation import SimulationContent

DRAWN = {  # words for a case of a study, by its `draws`
    "vary": "its states are drawn",
    "errors": "executed as planned, with errors drawn",
    "replanned": "each stage planned from the state that errors cause, drawn",
}
REQUIREMENTS = (
    Column("requirement", "asked", words=True),
    Column("result", "found", words=True),
    Column("met", "met", lambda met: "yes" if met else "no", words=True, absent="-", judges=True),
)
STAGES = (
    Column("stage", "number"),
    Column("do", "do", words=True),
    Column("from [s]", "start_s", "{:.1f}".format, since="mission"),
    Column("to [s]", "end_s", "{:.1f}".format),
    Column("conflicts before", "before"),
    Column("after", "after"),
    RATIO,
    PAIR,
    Column("at [s]", "time_s", "{:.1f}".format),
    Column("delta-v of all [m/s]", "delta_v_m_s", "{:.6g}".format),
)
SECTIONS: dict[type[StageTable], Callable[[Mission, Any], Section]] = {
    Coast: moves.coast,
    Transfer: moves.transfer,
    Avoid: moves.avoid,
    Scatter: moves.scatter,
    Regather: moves.regather,
    Reconfigure: moves.reconfigure,
    Lock: searches.lock,
    Gather: searches.gather,
}
MOST_CRAFT = 100  # maximum number of spacecraft in the overview
WHY = 80  # maximum characters of the reason for a stop, above the overview
SAMPLES = 201  # instants per spacecraft and stage in paths.parquet
SIMULATED = "Simulation in the high-fidelity model"
WORST_PATHS = "worst"  # the table of the worst simulation, next to the planned paths
THRUST_COLUMNS = ("ux_m_s2", "uy_m_s2", "uz_m_s2")


def request(scenario: Scenario) -> Section:
    """Return the section on what is requested: the scenario file."""
    lines: tuple[str, ...] = ()
    if scenario.case is not None and scenario.study is not None:
        how = DRAWN[scenario.study.draws]
        lines = (f"This is case {scenario.case} of the study: {how} with seed {scenario.study.seed}",)
    return Section("Request", lines, listing=scenario.text.removeprefix("\ufeff"))


def outcome(mission: Mission) -> Section:
    """Return the section on requirements and stages, with an overview picture."""
    return Section(
        "Results",
        tables=(
            Table("Requirements", REQUIREMENTS, [*requirements(mission)]),
            Table("Stages", STAGES, [stage_row(result) for result in mission.results]),
        ),
        pictures=overview(mission),
    )


def requirements(mission: Mission) -> Iterator[tuple[Any, ...]]:
    """Yield the rows of REQUIREMENTS: those of the whole mission, then those of each stage."""
    if mission.stopped is not None:
        yield "Every stage is executed", f"stopped in {short(mission.stopped)}", False
    yield from clearance(mission)
    for use in first_of_each(mission.uses, idle=True):
        used, limit, unit = use.shown(mission.grams)
        most = f"at most {used:.4g} of {limit:g} {unit}, {100.0 * use.share:.3g} % ({use.craft})"
        yield f"{use.what.capitalize()} of each craft within its limit", most, not use.exceeded
    for result in mission.results:
        yield from of_stage(mission, result)
    for one in mission.lost:
        yield f"{one.craft} reaches its target", one.asked.kept or one.asked.broken, one.asked.met
    simulated = "No craft enters a keep-out zone in the simulation, with errors as given"
    if mission.flights is not None:
        entered = mission.flights.entered
        yield simulated, entered.zones, entered.clear
    if mission.grounded is not None:
        yield simulated, f"not simulated: {mission.grounded}", False


def short(stopped: str) -> str:
    """Return the first words of why a mission stopped; the verdict has all of them."""
    return shorten(stopped.split(";")[0], WHY, placeholder=" …")


def clearance(mission: Mission) -> Iterator[tuple[Any, ...]]:
    """Yield the requirement that no keep-out zone is violated in the stages that were executed."""
    verdict = mission.verdict
    if verdict.conflicts is None or not any(result.executed for result in mission.results):
        return
    found = "only one craft"
    if (near := closest(mission)) is not None:
        result, pair = near
        found = (
            f"closest approach {pair.ratio:.4f} x zone, {pair.first} - {pair.second} at {pair.time:.1f} s "
            f"({pair.distance:.3f} m), stage {result.number}"
        )
    if verdict.conflicts:
        found = f"{conflicts_of(verdict.conflicts, verdict.pairs)}: {found}"
    met: bool | None = not verdict.conflicts and not verdict.enters
    if verdict.enters and not verdict.conflicts:
        found += f"; predicted in {verdict.field}: {verdict.predicted:.4f} x zone"
    if met and (least := verdict.zone_distance) is not None and least.exceeded:
        met, found = None, f"{found}; not shown beyond {verdict.model}: {least}"
    yield "No craft enters a keep-out zone at any instant", found, met


def closest(mission: Mission) -> tuple[StageResult[Any, Any], PairApproach] | None:
    """Return the stage and the pair of the closest approach in the mission; None if there is none."""
    executed = [(result, result.after.closest) for result in mission.results if result.executed]
    near = [(result, pair) for result, pair in executed if pair is not None]
    return min(near, key=lambda one: nearest_first(one[1].ratio, one[1].time), default=None)


def of_stage(mission: Mission, result: StageResult[Any, Any]) -> Iterator[tuple[Any, ...]]:
    """Yield the other requirements of a stage."""
    stage, where = result.stage, called(result)
    if stage.searches:
        goal = "every pair locks" if isinstance(result.result, FirstLocks) else "no craft stays lost"
        done = f"after {result.end - result.start:.1f} s"
        yield f"{where}: {goal}", result.failure or done, result.failure is None
    if not result.executed:
        return
    if "within" in stage.durations:
        asked = stage.durations["within"].on(mission.orbit.period)
        took = f"takes {result.end - result.start:.1f} s"
        yield f"{where}: within {asked:.1f} s", took, result.late is None
    arrival = getattr(stage, "arrival", None)
    tolerance = f"{arrival.position:g} m and {1e3 * arrival.velocity:g} mm/s" if arrival is not None else ""
    for one in asked_of(mission, result):
        what = {
            "sigmas": f"clear at {stage.sigmas} sigma",
            "probability": f"probability of collision at most {stage.max_probability}",
            "likelihood": "probability of collision",
            "sun": "body x within the sun limit in every turn, with attitude errors",
            "drift": f"passively safe {getattr(stage, 'lasting', '')}",
            "arrival": f"arrives within {tolerance}",
        }.get(one.kind, f"keeps its {one.kind}")
        met = None if one.kind == "likelihood" else one.shown  # no limit is set
        yield f"{where}: {what}", str(one), met


def stage_row(result: StageResult[Any, Any]) -> tuple[Any, ...]:
    """Return a row of STAGES; a failed stage has no clearance."""
    near = result.after.closest if result.executed else None
    close = (None, None, None) if near is None else (near.ratio, (near.first, near.second), near.time)
    before, after = (
        len(flight.conflicts) if flight.pairs else None for flight in (result.before, result.after)
    )
    spent = float(result.delta_v.sum()) if result.executed else 0.0
    ends = result.start, result.end
    return result.number, result.stage.verb, *ends, before, after if result.executed else None, *close, spent


def overview(mission: Mission) -> tuple[Picture, ...]:
    """Return one picture of all stages, if there are at least two."""
    executed = [result for result in mission.results if result.executed]
    names = mission.scenario.names
    if len(executed) < 2 or len(names) > MOST_CRAFT or executed[0].after.pairs > ALL_PAIRS:
        return ()
    titles = [f"{result.number} {result.stage.name or result.stage.verb}" for result in executed]
    options = {
        "names": names,
        "zone": mission.scenario.zones,
        "titles": titles,
        "locks": [
            (result.start + time, *pair)
            for result in executed
            for time, *pair in searches.locks_of(result.result)
        ],
    }
    paths = [result.after.paths for result in executed]
    whole = Picture("overview", "The whole mission", "overview", (paths,), options)
    if mission.stopped is None:
        return (whole,)
    return (
        replace(
            whole, stage=f"Stopped in {short(mission.stopped)}; shown are the stages before that", failed=True
        ),
    )


@dataclass(frozen=True, eq=False)
class RunReport:
    """Report on a mission."""

    mission: Mission
    hint = ()
    wraps = True  # whether a long verdict is broken into lines

    @property
    def printed(self) -> tuple[Section, ...]:
        """Sections of the terminal: the opening, stages, simulations, and the use in the whole mission."""
        opening = Section("", (self.mission.scenario.title, self.opening, *self.origin))
        return opening, *self.sections, *self.in_flight, Section("", tables=self.closing)

    @property
    def printed_warnings(self) -> Sequence[str]:
        """Warnings."""
        return self.mission.warnings

    @property
    def verdict(self) -> Verdict:
        """The verdict on the mission."""
        return self.mission.verdict

    @property
    def opening(self) -> str:
        """One line on the spacecraft, the orbit, the duration and the epoch."""
        period, results = self.mission.orbit.period, self.mission.results
        where = f"an orbit of {period / 60.0:.2f} min" if period < inf else "deep space"
        craft = counted(len(self.mission.scenario.craft), "craft", "craft")
        epoch = self.mission.scenario.epoch
        begun = "" if epoch is None else f" from {epoch}"
        return f"{craft} in {where}, {results[-1].end if results else 0.0:.1f} s{begun}"

    @cached_property
    def sections(self) -> tuple[Section, ...]:
        """The sections of the stages, in order."""
        return tuple(section(self.mission, result) for result in self.mission.results)

    @cached_property
    def flights(self) -> "SimulationContent | None":
        """The content on simulations in the high-fidelity model; None if there are none."""
        if self.mission.flights is None:
            return None
        from closeform.report.simulation import SimulationContent  # most runs do not need these kernels

        return SimulationContent.of(self.mission.flights)

    @cached_property
    def in_flight(self) -> tuple[Section, ...]:
        """The section on simulations, or on the reason for their absence if they were requested."""
        mission = self.mission
        if mission.grounded is not None:
            return (Section(SIMULATED, (f"Not simulated: {mission.grounded}",)),)
        if mission.scenario.flights is not None and not mission.executed:
            return (Section(SIMULATED, ("Not simulated: the mission stopped in its first stage",)),)
        return () if self.flights is None else (self.flights.section(SIMULATED, self.flights.opening),)

    @property
    def origin(self) -> tuple[str, ...]:
        """The chief's orbit, notes on interpolated states, and the estimated model error."""
        chief, inputs = self.mission.scenario.chief, self.mission.scenario.inputs
        estimate = tuple(model_limits.estimate(self.mission))
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
        return effort.used_up(self.mission)

    @cached_property
    def thrusting(self) -> Floats:
        """The thrust time of each spacecraft in each stage (S, N) [s]."""
        return effort.thrusting(self.mission, [section.files for section in self.sections])

    @cached_property
    def chapters(self) -> tuple[Section, ...]:
        """The sections of the page except the one on reproduction, with the stages in the middle."""
        mission, epoch = self.mission, self.mission.scenario.epoch
        whole = outcome(mission)
        if epoch is not None:
            whole = replace(whole, tables=tuple(map(Stamps(epoch).dated, whole.tables)))
        return (
            request(mission.scenario),
            whole,
            effort.budget(mission, self.thrusting),
            *self.sections,
            *self.in_flight,
            model_limits.section(mission),
            *(() if self.flights is None else (self.flights.sure,)),
        )

    @property
    def seed(self) -> int | None:
        """The seed of a sampled case; None if the mission is not a case of a study."""
        scenario = self.mission.scenario
        return scenario.study.seed if scenario.study is not None and scenario.case is not None else None

    def repeat(self, out: Path | None) -> Repeat:
        """Return the command that reproduces the run; `out` is the option for the folder."""
        scenario = self.mission.scenario
        point = "" if scenario.place is None else f" --point {scenario.place}"
        case = "" if scenario.case is None else f" --case {scenario.case}"
        return Repeat.of(scenario, "run", f"{point}{case}", out, self.seed)

    @property
    def summary(self) -> dict[str, Any]:
        """The printed figures in full precision and SI units."""
        mission, scenario = self.mission, self.mission.scenario
        delta_v, propellant = mission.spent_of_each
        return {
            "kind": "run",
            "title": scenario.title,
            "inputs": page.inputs(scenario),
            **origin(scenario),
            "seed": self.seed,
            "case": scenario.case,
            **mission.verdict.figures,
            "stopped": mission.stopped,
            "warnings": list(mission.warnings),
            "mean_motion_rad_s": 2.0 * pi / mission.orbit.period,
            "craft": list(scenario.names),
            "delta_v_m_s": dict(zip(scenario.names, delta_v.tolist(), strict=True)),
            "propellant_kg": dict(zip(scenario.names, propellant.tolist(), strict=True)),
            "used": effort.used(mission).records if self.closing else [],
            "asked": Table("", REQUIREMENTS, [*requirements(mission)]).records,
            **({} if not mission.lost else {"lost": [one.figures for one in mission.lost]}),
            "budget": effort.budget_figures(mission, self.thrusting),
            "stages": [section.figures for section in self.sections],
            **({} if self.flights is None else {"flights": self.flights.figures}),
            **({} if mission.grounded is None else {"grounded": mission.grounded}),
        }

    @property
    def files(self) -> dict[str, dict[str, list[Any]]]:
        """The tables for Parquet, by name; rows of all stages follow each other."""
        found: dict[str, dict[str, list[Any]]] = {}
        for result, section in zip(self.mission.results, self.sections, strict=True):
            for name, table in section.files.items():
                columns = {"stage": [result.number] * len(table.rows), **table.stored}
                below = found.setdefault(name, {key: [] for key in columns})
                for key, cells in columns.items():
                    below[key] += cells
        return found

    def write(
        self,
        folder: Folder,
        progress: Progress = lambda text: None,
        viewer: page.Viewer | None = None,
        out: Path | None = None,
    ) -> None:
        """Fill a result folder with the files of a run; `progress` is called with the current step.

        `viewer` writes the animated page, next to the pictures; `out` is the option for the folder.
        """
        scenario, verdict = self.mission.scenario, self.mission.verdict
        folder.scenario(scenario)
        progress("writing tables")
        tables = {**self.files, "paths": states(self.mission), **exact(self.mission)}
        if self.flights is not None:
            from closeform.report.simulation import stored

            simulated = stored(self.flights.simulated)
            tables |= {WORST_PATHS if name == "paths" else name: one for name, one in simulated}
        for name, columns in tables.items():
            folder.table(name, columns)
        folder.csv("burns", self.files.get("burns", {}))
        lines = [f"{self.opening}; {Path(scenario.file).name}", *self.origin]
        head = page.Head(scenario.title, lines, str(verdict), verdict.ok, self.mission.warnings)
        page.write(folder, head, self.chapters, self.repeat(out), self.summary, progress, viewer)


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
    own = SECTIONS[type(result.stage)](mission, result)
    own = uncertain.extended(own, result, mission.scenario.names)
    count, plan = len(result.after.names), plan_of(result)
    found = result.result is not None
    failed = []
    if not result.executed and result.failure is not None:  # the verdict has the full reason
        why = result.failure if plan is None or plan.ok else str(plan.status)
        failed.append(f"Not executed: {in_short(why)}")
    safe = passive.section(result)
    pictures = own.pictures + safe.pictures
    drawn = [one for one in pictures if not (isinstance(one, Film) and one.most < count)]
    whole = replace(
        own,
        lines=(
            *failed,
            *safe.lines,
            *model_limits.predicted(mission, result),
            *conflicts.zones(result.before),
            *own.lines,
        ),
        tables=own.tables + safe.tables,
        closing=(
            *model_limits.margin(result),
            *own.closing,
            *(effort.limit_lines(mission, result) if found else ()),
            *(f"Animation left out: {count} craft are more than it can show",) * (len(drawn) < len(pictures)),
        ),
        pictures=tuple(
            replace(
                picture,
                name=f"stage-{result.number}-{picture.name}",
                stage=fate(result),
                failed=result.failure is not None,
                executed=result.executed or picture.plot == "trade",  # which shows the cost of any path
            )
            for picture in drawn
        ),
        figures={
            "number": result.number,
            "name": result.stage.name,
            "do": result.stage.verb,
            "start_s": result.start,
            "end_s": result.end,
            "executed": result.executed,
            "failure": result.failure,
            "before": conflicts.figures(result.before),
            "after": conflicts.figures(result.after),
            **own.figures,
            **(effort.limit_figures(mission, result) if found else {}),
            **safe.figures,
            **model_limits.error_figures(result),
        },
        files={
            **conflicts.tables_of({"before": result.before, "after": result.after}),
            **effort.files(mission, result),
            **own.files,
            **safe.files,
        },
    )
    epoch = mission.scenario.epoch
    return whole if epoch is None else Stamps(epoch, result.start).stage(whole, result.end)


def states(mission: Mission) -> dict[str, Any]:
    """Return states and thrusts at equally spaced times of every stage, as columns for plots."""
    names, epoch = mission.scenario.names, mission.scenario.epoch
    parts: list[dict[str, Any]] = []
    for result in mission.results:
        times = np.linspace(result.start, result.end, SAMPLES)
        paths = result.after.paths
        parts.append(
            {
                "stage": np.full(len(names) * SAMPLES, result.number),
                **state_columns(names, times, paths.state(times), epoch),
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
