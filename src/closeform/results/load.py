"""What a run or a study left, opened again: its paths evaluate bit for bit as they did."""

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
from closeform.search.gather_result import Event, EventKind, Gathering, GatherStatus, who_is_left
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
NO_BURNS = {key: np.empty(0) for key in ("stage", *COLUMNS)}  # of a run in which nobody moves


@dataclass(frozen=True, eq=False, repr=False)
class LoadedStage(Result):
    """A stage of a run that was loaded, as `results` of a `Mission` holds it.

    Attributes
    ----------
    number : int
        Of the stage, from 1.
    stage : StageTable
        What the scenario says of it; `stage.verb` is its `do`, `stage.name` its name or None.
    start : float [s]
        When it begins.
    before, after, planned : WatchedFlight
        The paths of all craft before avoidance, as flown and as thrusters were to follow, `paths` (N,) by
        `names`; with `conflicts` and closest `approaches` by name, but of a plan that thrusters follow.
    result : Gathering, FirstLocks or None
        What a search came to: of a lock the `search`, its `pairs` and their `locks`; None of other stages, of
        whose plans the paths and the `figures` are kept.
    burns : Mapping of str to array of shape (K,) [s, m/s, kg]
        The columns of `burns.parquet`, one row for each burn or pulse.
    figures : Mapping of str
        What `summary.json` says of it.
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
        """When it ends [s]."""
        return self.after.end

    @property
    def flown(self) -> bool:
        """Whether its paths count, which those of a plan that failed do not."""
        return bool(self.figures["flown"])

    @property
    def failure(self) -> str | None:
        """Why the mission cannot go on after it; None where it can."""
        found: str | None = self.figures["failure"]
        return found


@dataclass(frozen=True, eq=False, repr=False)
class LoadedRun(Stages):
    """What a run left, made by `load`.

    Attributes
    ----------
    scenario : Scenario
        What `scenario.toml` says; of one case of a study with the states of that case.
    orbit : Orbit
        In whose frame the paths are.
    results : tuple of LoadedStage
        The stages as flown.
    summary : Mapping of str
        The content of `summary.json`: verdict, limits, every figure that was printed.
    lost : tuple of LostThrust
        Whose thrust was lost in a case of a study, and when; `planned` of stages is what guidance knew.
    """

    scenario: Scenario
    orbit: Orbit
    results: tuple[LoadedStage, ...]
    summary: Mapping[str, Any]
    lost: tuple[LostThrust, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """The craft's names."""
        return self.scenario.names

    @property
    def stopped(self) -> str | None:
        """Why there are fewer stages than in the file; None if there are not."""
        found: str | None = self.summary["stopped"]
        return found

    @property
    def verdict(self) -> str:
        """What the last line of the run said."""
        return str(self.summary["verdict"])

    @cached_property
    def burns(self) -> Columns:
        """Every burn in columns, as in `burns.parquet`, with its stage."""
        return arc_tables.together([one.burns for one in self.flown])

    @property
    def clear(self) -> bool:
        """Whether every stage was flown and no conflict remains."""
        return bool(self.summary["clear"])


@dataclass(frozen=True, eq=False, repr=False)
class LoadedStudy(Result):
    """What a study left, made by `load`.

    Attributes
    ----------
    scenario : Scenario
        What `scenario.toml` says.
    cases : Mapping of str to array of shape (K,) [s, m, m/s]
        The columns of `cases/*.parquet`, all cases one after another.
    summary : Mapping of str
        The content of `summary.json`: shares with their intervals, times, every figure that was printed.
    """

    scenario: Scenario
    cases: Columns
    summary: Mapping[str, Any]


def load(directory: str | PathLike[str]) -> LoadedRun | LoadedStudy:
    """Open what `closeform run` or `closeform study` left.

    Paths evaluate bit for bit as those of the run did; nothing is flown or searched again.

    Parameters
    ----------
    directory : str or path-like
        The result folder.

    Returns
    -------
    LoadedRun or LoadedStudy
        Of a run its scenario, orbit, stages with flown paths, conflicts, burns and locks; of a study its
        cases; of both what `summary.json` says.

    Raises
    ------
    ValueError
        If there is no such folder, or it is not one that a run or a study left, is damaged, or comes from
        another version; in one line that names the file and the remedy.

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
        raise FolderError(f"{place}: was left by an earlier version or another command; {AGAIN}")
    scenario = _scenario(place, summary)
    if kind == "study":
        names = sorted(name for name in summary["files"] if name.startswith("cases/"))
        with intact(place, "cases"):
            cases = arc_tables.together([table(place, summary, name) for name in names])
        return LoadedStudy(scenario, cases, summary)
    orbit = Orbit(summary["mean_motion_rad_s"])
    with intact(place, "its tables"):
        stages = tuple(RunTables(place, scenario, orbit, summary).stages)
        lost = tuple(LostThrust.of(one) for one in summary.get("lost", ()))
        return LoadedRun(scenario, orbit, stages, summary, lost)


def _scenario(place: FilePath, summary: Mapping[str, Any]) -> Scenario:
    """The scenario as it was flown."""
    text = content(place, summary, SCENARIO).decode()
    for name in summary["files"]:
        if name.startswith(INPUTS):
            content(place, summary, name)
    try:
        found = parse(text, str(place / SCENARIO), summary["kind"])
    except ScenarioError as error:
        raise FolderError(error.lines[0]) from None
    if (case := summary.get("case")) is not None:
        from closeform.campaign import case_of

        return case_of(found, case)
    return found


@dataclass(frozen=True)
class RunTables:
    """The tables of a run."""

    place: FilePath
    scenario: Scenario
    orbit: Orbit
    summary: Mapping[str, Any]

    @cached_property
    def tables(self) -> dict[str, dict[str, Any]]:
        """Those of which stages are made, by name; an absent one has no rows."""
        names = ("arcs", "legs", "conflicts", "approaches", "burns", "events", "locks")
        held = [name for name in names if f"{name}.parquet" in self.summary["files"]]
        return {name: table(self.place, self.summary, f"{name}.parquet") for name in held}

    def rows(self, name: str, **wanted: Any) -> dict[str, Any]:
        """The rows of a table that have what is wanted in its columns; none of an absent table."""
        columns = self.tables.get(name, {})
        kept = np.logical_and.reduce([columns[key] == value for key, value in wanted.items() if columns])
        return {key: values[kept] for key, values in columns.items()}

    @property
    def stages(self) -> Iterator[LoadedStage]:
        """In order."""
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
        """The paths of a stage with what was found of them."""
        names, zones = self.scenario.names, self.scenario.zones
        wanted = {"stage": number, "when": when}
        arcs, met, near = (self.rows(name, **wanted) for name in ("arcs", "conflicts", "approaches"))
        where = {name: k for k, name in enumerate(names)}
        between: Any = zones.between  # never None of two that came near each other
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
        """What a search came to."""
        if verb == "gather":
            return self.gathering(figures, after)
        return self.first_locks(figures) if verb == "lock" else None

    def search(self, number: int) -> Search:
        """The search of a stage, over all rounds."""
        plan = self.scenario.plan
        legs = arc_tables.legs_in(self.rows("legs", stage=number))
        return Search(plan.sensor, plan.slew_rate, plan.sun_limit, plan.tip_angle, legs)

    def first_locks(self, figures: Mapping[str, Any]) -> FirstLocks:
        """The first locks of all pairs."""
        from closeform.search.locks import Locks

        search, rows = self.search(figures["number"]), self.rows("locks", stage=figures["number"])
        legs = np.full(len(rows["first"]), -1)
        for k, (phase, number, time) in enumerate(_tuples(rows, "phase", "round", "time_s")):
            if phase is not None:
                there = [j for j, leg in enumerate(search.legs) if (leg.phase, leg.round) == (phase, number)]
                # a craft that is late is still in it when it should be over
                legs[k] = next((j for j in there if time <= search.legs[j].end), there[-1])
        return FirstLocks(search, self.scenario.opposite, Locks(rows["time_s"].astype(float), legs))

    def gathering(self, figures: Mapping[str, Any], after: WatchedFlight) -> Gathering:
        """What became of lost craft; its times count from the start of the stage."""
        told, where = figures["gathering"], {name: k for k, name in enumerate(after.names)}
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
        sets = tuple(tuple(where[name] for name in some) for some in told["sets"])
        lost, adrift = (tuple(where[name] for name in told[some]) for some in ("lost", "adrift"))
        return Gathering(
            self.search(figures["number"]),
            self.scenario.groups,
            replace(after.paths, arcs=arcs),
            events,
            np.array([told["delta_v_m_s"][name] for name in after.names]),
            dict(told["totals_m_s"]),
            told["burns"],
            sets,
            lost,
            told["duration_s"],
            told["rounds"],
            GatherStatus(told["status"]),
            who_is_left(sets, lost, told["rounds"], adrift=adrift) or None,
            self.scenario.zones,
            self.scenario.search_errors,
            adrift,
        )


def _tuples(columns: Columns, *keys: str) -> Iterator[tuple[Any, ...]]:
    """The rows of some columns as Python's own numbers."""
    return zip(*(columns[key].tolist() for key in keys), strict=True) if columns else iter(())
