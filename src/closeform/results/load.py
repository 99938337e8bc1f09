"""Load the results of a run or a study; loaded paths evaluate bit for bit as the original ones."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from os import PathLike
from pathlib import Path as FilePath
from typing import Any, ClassVar

import numpy as np

from closeform.arrays import instance
from closeform.conflicts.flight import PairApproach, WatchedFlight
from closeform.conflicts.two_paths import PairConflict
from closeform.mission.mission_result import FirstLocks, Stages
from closeform.mission.stage_burns import COLUMNS
from closeform.mission.verdict import LostThrust
from closeform.motion.arc import END, START
from closeform.motion.orbit import Orbit
from closeform.result import Result
from closeform.scenario import Scenario, ScenarioError, StageTable, parse
from closeform.search.gathering.result import Event, EventKind, Gathering, GatherStatus, reason_incomplete
from closeform.search.schedule import Search
from closeform.storage import arc_tables
from closeform.storage.publishing import settle
from closeform.storage.result_folder import (
    AGAIN,
    INPUTS,
    SCENARIO,
    FolderError,
    content,
    intact,
    summary_of,
    table,
)

Columns = Mapping[str, Any]
NO_BURNS = {key: np.empty(0) for key in ("stage", *COLUMNS)}  # of a run without burns


@dataclass(frozen=True, eq=False, repr=False)
class LoadedStage(Result):
    """Stage of a loaded run, the counterpart of an item of `Mission.results`.

    Attributes
    ----------
    number : int
        Number of the stage, from 1.
    stage : StageTable
        Its table in the scenario; `stage.verb` is its `do`, `stage.name` its name or None.
    start : float [s]
        Start time.
    before, after, planned : WatchedFlight
        The paths of all craft before avoidance, as executed, and as planned for the thrusters: `paths` (N,)
        by `names`, with `conflicts` and closest `approaches` (none for a plan that thrusters follow).
    result : Gathering, FirstLocks or None
        Result of a search; for a lock stage the `search`, its `pairs` and their `locks`. None for other
        stages, of which the paths and the `figures` are kept.
    burns : Mapping of str to array of shape (K,) [s, m/s, kg]
        The columns of `burns.parquet`, one row for each burn or pulse.
    figures : Mapping of str
        Its entry in `summary.json`.
    """

    number: int
    stage: StageTable
    start: float
    before: WatchedFlight
    after: WatchedFlight
    planned: WatchedFlight
    result: Gathering | FirstLocks | None
    burns: Columns
    figures: Mapping[str, Any]
    _told: ClassVar = ("number", "start", "end", "before", "after", "result", "failure")

    @property
    def end(self) -> float:
        """End time [s]."""
        return self.after.end

    @property
    def executed(self) -> bool:
        """True if the stage was executed, so that its paths count; False for a failed plan."""
        return bool(self.figures["executed"])

    @property
    def failure(self) -> str | None:
        """Reason why the mission cannot continue after the stage; None if it can."""
        found: str | None = self.figures["failure"]
        return found


@dataclass(frozen=True, eq=False, repr=False)
class LoadedRun(Stages):
    """Results of a run, returned by `load`.

    Attributes
    ----------
    scenario : Scenario
        The content of `scenario.toml`; for one case of a study with the states of that case.
    orbit : Orbit
        The orbit whose Hill frame the paths are in.
    results : tuple of LoadedStage
        The stages as executed.
    summary : Mapping of str
        The content of `summary.json`: verdict, limits, every figure that was printed.
    lost : tuple of LostThrust
        Craft that lost thrust in a case of a study, and when; `planned` of a stage is the plan before that.
    """

    scenario: Scenario
    orbit: Orbit
    results: tuple[LoadedStage, ...]
    summary: Mapping[str, Any]
    lost: tuple[LostThrust, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the craft."""
        return self.scenario.names

    @property
    def stopped(self) -> str | None:
        """Reason why the run has fewer stages than the file; None if it has all."""
        found: str | None = self.summary["stopped"]
        return found

    @property
    def verdict(self) -> str:
        """Last line that the run printed."""
        return str(self.summary["verdict"])

    @cached_property
    def burns(self) -> Columns:
        """Every burn with its stage, in the columns of `burns.parquet`."""
        return arc_tables.together([one.burns for one in self.executed])

    @property
    def clear(self) -> bool:
        """True if every stage was executed and no conflict remains."""
        return bool(self.summary["clear"])


@dataclass(frozen=True, eq=False, repr=False)
class LoadedStudy(Result):
    """Results of a study, returned by `load`.

    Attributes
    ----------
    scenario : Scenario
        The content of `scenario.toml`.
    cases : Mapping of str to array of shape (K,) [s, m, m/s]
        The columns of `cases/*.parquet`, all cases one after another.
    summary : Mapping of str
        The content of `summary.json`: shares with their intervals, times, every figure that was printed.
    """

    scenario: Scenario
    cases: Columns
    summary: Mapping[str, Any]


def load(directory: str | PathLike[str]) -> LoadedRun | LoadedStudy:
    """Load the results of `closeform run` or `closeform study`.

    Loaded paths evaluate bit for bit as those of the run. No stage is planned, simulated or searched again.

    Parameters
    ----------
    directory : str or path-like
        The result folder.

    Returns
    -------
    LoadedRun or LoadedStudy
        For a run its scenario, orbit, and stages with executed paths, conflicts, burns and locks; for a study
        its cases; for both the content of `summary.json`.

    Raises
    ------
    ValueError
        If the folder does not exist, is not the result folder of a run or a study, is damaged, or comes from
        another version. The message names the file and the remedy in one line.

    References
    ----------
    docs/command-line.md.
    """
    place = FilePath(instance("directory", directory, str, PathLike))
    settle(place)
    summary = summary_of(place)
    kind = summary.get("kind")
    if kind in ("screen", "encounter"):
        what = f"was left by closeform {kind}, which has no burns and no scenario"
        raise FolderError(f"{place}: {what}; give a folder of run or study (screen --cdm writes CDMs)")
    if kind not in ("run", "study"):
        raise FolderError(f"{place}: was written by an earlier version or another command; {AGAIN}")
    scenario = _scenario(place, summary)
    if kind == "study":
        names = sorted(name for name in summary["files"] if name.startswith("cases/"))
        with intact(place, "cases"):
            cases = arc_tables.together([table(place, summary, name) for name in names])
        return LoadedStudy(scenario, cases, summary)
    hill = scenario.orbit.model == "hill"
    orbit = Orbit(summary["mean_motion_rad_s"]) if hill else scenario.orbit.build()
    with intact(place, "a table"):
        stages = tuple(RunTables(place, scenario, orbit, summary).stages)
        lost = tuple(LostThrust.of(one) for one in summary.get("lost", ()))
        return LoadedRun(scenario, orbit, stages, summary, lost)


def _scenario(place: FilePath, summary: Mapping[str, Any]) -> Scenario:
    """Return the scenario of a result folder, with the values of one case if it holds one."""
    text = content(place, summary, SCENARIO).decode()
    for name in summary["files"]:
        if name.startswith(INPUTS):
            content(place, summary, name)
    try:
        found = parse(text, str(place / SCENARIO))
    except ScenarioError as error:
        raise FolderError(error.lines[0]) from None
    if (case := summary.get("case")) is not None:
        from closeform.campaign import case_of

        return case_of(found, case)
    return found


@dataclass(frozen=True)
class RunTables:
    """Tables of a run."""

    place: FilePath
    scenario: Scenario
    orbit: Orbit
    summary: Mapping[str, Any]

    @cached_property
    def tables(self) -> dict[str, dict[str, Any]]:
        """Tables from which stages are built, by name; an absent table has no rows."""
        names = ("arcs", "legs", "conflicts", "approaches", "burns", "events", "locks")
        held = [name for name in names if f"{name}.parquet" in self.summary["files"]]
        return {name: table(self.place, self.summary, f"{name}.parquet") for name in held}

    def rows(self, name: str, **wanted: Any) -> dict[str, Any]:
        """Return the rows of a table whose columns have the wanted values; none of an absent table."""
        columns = self.tables.get(name, {})
        kept = np.logical_and.reduce([columns[key] == value for key, value in wanted.items() if columns])
        return {key: values[kept] for key, values in columns.items()}

    @property
    def stages(self) -> Iterator[LoadedStage]:
        """Stages in order."""
        if "arcs.parquet" not in self.summary["files"]:
            raise FolderError(f"{self.place}: arcs.parquet is missing; {AGAIN}")
        for figures in self.summary["stages"]:
            number = int(figures["number"])
            stage, start = self.scenario.stages[number - 1], float(figures["start_s"])
            kept = set(self.rows("arcs", stage=number)["when"])
            after = self.flight(number, "after")
            others = (self.flight(number, when) if when in kept else after for when in ("before", "planned"))
            before, planned = others
            found = self.found(stage.verb, figures, after)
            yield LoadedStage(
                *(number, stage, start, before, after, planned, found),
                self.rows("burns", stage=number) or NO_BURNS,
                figures,
            )

    def flight(self, number: int, when: str) -> WatchedFlight:
        """Return the paths of a stage with their conflicts and approaches."""
        names, zones = self.scenario.names, self.scenario.zones
        wanted = {"stage": number, "when": when}
        arcs, met, near = (self.rows(name, **wanted) for name in ("arcs", "conflicts", "approaches"))
        where = {name: k for k, name in enumerate(names)}
        between: Any = zones.between  # never None for a pair with an approach
        approaches = [
            PairApproach(one, other, time, ratio, distance, between(where[one], where[other]), rule)
            for one, other, time, ratio, distance, rule in _tuples(
                near, "first", "second", "time_s", "ratio", "distance_m", "zone"
            )
        ]
        conflicts = [
            PairConflict(*row)
            for row in _tuples(met, "start_s", "end_s", "time_s", "ratio", "first", "second")
        ]
        path = arc_tables.path_in(arcs, self.orbit, names)
        return WatchedFlight(path, names, tuple(conflicts), tuple(approaches), zones.pairs)

    def found(
        self, verb: str, figures: Mapping[str, Any], after: WatchedFlight
    ) -> Gathering | FirstLocks | None:
        """Return the result of a search stage, None for any other stage."""
        if verb == "gather":
            return self.gathering(figures, after)
        return self.first_locks(figures) if verb == "lock" else None

    def search(self, number: int) -> Search:
        """Return the search of a stage, over all rounds."""
        plan = self.scenario.plan
        legs = arc_tables.legs_in(self.rows("legs", stage=number))
        return Search(plan.sensor, plan.slew_rate, plan.sun_limit, plan.tip_angle, legs)

    def first_locks(self, figures: Mapping[str, Any]) -> FirstLocks:
        """Return the first locks of all pairs."""
        from closeform.search.lock_times import Locks

        search, rows = self.search(figures["number"]), self.rows("locks", stage=figures["number"])
        legs = np.full(len(rows["first"]), -1)
        for k, (phase, number, time) in enumerate(_tuples(rows, "phase", "round", "time_s")):
            if phase is not None:
                there = [j for j, leg in enumerate(search.legs) if (leg.phase, leg.round) == (phase, number)]
                # a late craft can lock after the nominal end of the leg
                legs[k] = next((j for j in there if time <= search.legs[j].end), there[-1])
        return FirstLocks(search, self.scenario.opposite, Locks(rows["time_s"].astype(float), legs))

    def gathering(self, figures: Mapping[str, Any], after: WatchedFlight) -> Gathering:
        """Return the result of a gathering; its times count from the start of the stage."""
        entry, where = figures["gathering"], {name: k for k, name in enumerate(after.names)}
        arcs = after.paths.arcs.copy()
        arcs[:, [START, END]] -= figures["start_s"]
        rows = self.rows("events", stage=figures["number"])
        pushes = np.stack([rows[f"dv{axis}_m_s"] for axis in "xyz"], axis=1).astype(float)
        events = tuple(
            Event(
                *(time, EventKind(kind), where[first], -1 if second is None else where[second], *rest, push)
            )
            for (time, kind, first, second, *rest), push in zip(
                _tuples(rows, "time_s", "kind", "first", "second", "phase", "round", "case", "label"),
                pushes,
                strict=True,
            )
        )
        sets = tuple(tuple(where[name] for name in some) for some in entry["sets"])
        lost, adrift = (tuple(where[name] for name in entry[some]) for some in ("lost", "adrift"))
        return Gathering(
            self.search(figures["number"]),
            self.scenario.groups,
            replace(after.paths, arcs=arcs),
            events,
            tuple(
                Event(time, EventKind.LOCK, where[one], where[other], phase, number, case, label, np.zeros(3))
                for time, one, other, phase, number, case, label in entry["known_locks"]
            ),
            np.array([entry["delta_v_m_s"][name] for name in after.names]),
            dict(entry["totals_m_s"]),
            entry["burns"],
            sets,
            lost,
            entry["duration_s"],
            entry["rounds"],
            GatherStatus(entry["status"]),
            reason_incomplete(sets, lost, entry["rounds"], adrift=adrift) or None,
            self.scenario.zones,
            self.scenario.search_errors,
            adrift,
            np.array([entry["estimate_errors"][name] for name in after.names]),
        )


def _tuples(columns: Columns, *keys: str) -> Iterator[tuple[Any, ...]]:
    """Iterate over the rows of the given columns as Python numbers."""
    return zip(*(columns[key].tolist() for key in keys), strict=True) if columns else iter(())
