"""Source of an export: the craft with their paths and burns, from a mission, a loaded run or paths."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from closeform.arrays import Floats
from closeform.exchange.ccsds.aem import quaternions
from closeform.exchange.chief import Chief
from closeform.exchange.epochs import Epoch
from closeform.exchange.export_tracks.sampled_paths import ExportedCraft
from closeform.exchange.export_tracks.track import Shots
from closeform.fuel.burns import burns_of
from closeform.mission.mission_result import Mission
from closeform.motion.chief_orbit import ChiefOrbit
from closeform.motion.path import Path
from closeform.results.load import LoadedRun
from closeform.scenario import Craft, Scenario
from closeform.search.search_errors import SearchErrors, errors_of_each
from closeform.search.slew_profile import ExecutedTurns

if TYPE_CHECKING:
    from closeform.uncertainty.errors import Uncertainty

UNKNOWN = "UNKNOWN"  # the CCSDS word for a missing designator
SAME_ORBIT = 1e-6  # relative difference allowed between the mean motions of chief and paths
FILE_REMEDY = "give [orbit] an epoch and a chief, or chief=cf.Chief(...) from Python"
PATH_REMEDY = "give chief=cf.Chief(...)"
TURNS_EACH = np.radians(5.0)  # largest angle between two quaternions of a turn
PUSH = ("radial_m_s", "along_track_m_s", "cross_track_m_s")


@dataclass(frozen=True, eq=False)
class Source:
    """Content of an export: `craft` through all executed stages, `chief` and `epoch` if known.

    `results` are the stages of a `scenario`, empty for paths. `remedy` states how the user gives a chief.
    """

    title: str
    craft: tuple[ExportedCraft, ...]
    mean_motion: float
    chief: Chief | None
    epoch: Epoch | None
    remedy: str
    results: Sequence[Any] = ()
    scenario: Scenario | None = None
    beside: str = ""  # model of a chief that is not on a circle

    @property
    def designators(self) -> Mapping[str, str]:
        """OBJECT_ID of each craft."""
        return {one.name: one.object_id for one in self.craft}

    @cached_property
    def attitudes(self) -> dict[str, list[tuple[Floats, Floats]]]:
        """Turns of each searching craft: times (T,) [s] and quaternions (T, 4)."""
        found: dict[str, list[tuple[Floats, Floats]]] = {}
        for result in self.results:
            if not result.stage.searches or self.scenario is None:
                continue
            errors = errors_of_each(
                self.scenario.search_errors or SearchErrors(), (len(self.scenario.names),)
            )
            own = ExecutedTurns(result.result.search, self.scenario.groups, errors)
            for k, name in enumerate(self.scenario.names):
                parts = executed_turns(own, k, result.end - result.start)
                found.setdefault(name, []).extend((times + result.start, rows) for times, rows in parts)
        return {name: some for name, some in found.items() if some}


def executed_turns(own: ExecutedTurns, k: int, last: float) -> list[tuple[Floats, Floats]]:
    """Return the turns of craft k by its own clock up to the time `last` [s], including its waits."""
    found = []
    for start, end in pairwise(np.clip([0.0, *own.begins[k], last], 0.0, last).tolist()):
        if end > start:
            turned = 2.0 * (end - start) * own.search.slew_rate * (1.0 + own.errors.slew_rate[k])
            count = max(2, int(np.ceil(turned / TURNS_EACH)) + 1)
            times = np.round(np.linspace(start, end, count), 9).astype(float)
            inside = np.clip(times, start, np.nextafter(end, start))  # not yet in the next turn
            found.append((times, quaternions(np.stack([own.attitudes(time)[k] for time in inside]))))
    return found


def source_of(result: Mission | LoadedRun | Path, chief: Chief | None, names: Sequence[str] | None) -> Source:
    """Return the source of an export. Raises ValueError for a chief or names that do not fit."""
    if isinstance(result.orbit, ChiefOrbit) and (isinstance(result, Path) or chief is not None):
        raise ValueError(
            f"result: about {result.orbit.chief} only the run of a scenario can be exported, without another "
            "chief; write a scenario, or read Path.state"
        )
    if isinstance(result, Path):
        return checked(of_paths(result, chief, names))
    if names is not None:
        raise ValueError("names: a run takes its names from the scenario; leave them out")
    scenario = result.scenario
    if not result.executed:
        raise ValueError(f"result: no stage was executed, {result.stopped}; correct the scenario first")
    paths = [through(result.orbit, result.executed, k) for k in range(len(scenario.names))]
    craft = tuple(
        ExportedCraft(
            one.name, UNKNOWN, path, shots(result.burns, one.name), one.mass, spread(result.executed, one)
        )
        for one, path in zip(scenario.craft, paths, strict=True)
    )
    found = chief or scenario.chief
    return checked(
        Source(
            scenario.title,
            craft,
            result.orbit._rate,
            found,
            scenario.epoch if found is None else found.instant,
            FILE_REMEDY,
            tuple(result.results),
            scenario,
            result.orbit._model if isinstance(result.orbit, ChiefOrbit) else "",
        )
    )


def checked(source: Source) -> Source:
    """Return the source after a check that the chief's mean motion is that of the paths."""
    if source.chief is not None and source.mean_motion > 0.0 and not source.beside:
        theirs = source.chief.orbit.mean_motion
        if abs(theirs / source.mean_motion - 1.0) > SAME_ORBIT:
            what = f"has a mean motion of {theirs:.9g} rad/s, the paths {source.mean_motion:.9g} rad/s"
            raise ValueError(f"chief: {what}; give the orbit of the plan")
    return source


def of_paths(path: Path, chief: Chief | None, names: Sequence[str] | None) -> Source:
    """Return the source of an export of bare paths."""
    each = [path] if not path.shape else [path[k] for k in range(len(path))]
    if len(path.shape) > 1:
        raise ValueError(f"result: paths of shape (N,) can be exported, got {path.shape}; index them first")
    called = [f"C{k}" for k in range(1, len(each) + 1)] if names is None else list(names)
    if len(called) != len(each) or len(set(called)) != len(called):
        raise ValueError(f"names: expected {len(each)} distinct names, got {', '.join(called)}")
    craft = []
    for name, one in zip(called, each, strict=True):
        found = burns_of(one).significant
        unknown = np.full(len(found.start), np.nan)
        burns = Shots(found.start, found.duration, found.push, unknown, np.zeros(len(found.start), dtype=int))
        craft.append(ExportedCraft(name, UNKNOWN, one, burns))
    epoch = None if chief is None else chief.instant
    return Source("Paths", tuple(craft), path.orbit.mean_motion, chief, epoch, PATH_REMEDY)


def through(orbit: Any, stages: Sequence[Any], k: int) -> Path:
    """Return the path of craft k through consecutive stages."""
    arcs = np.concatenate([stage.after.paths[k].arcs for stage in stages])
    return Path(orbit, arcs, np.array([0, len(arcs)]), ())


def spread(stages: Sequence[Any], craft: Craft) -> tuple[tuple[Path, Uncertainty], ...]:
    """Return a craft's path and initial uncertainty in each stage; empty if its state is known exactly."""
    errors, found = craft.errors, []
    if errors is None:
        return ()
    from closeform.uncertainty.covariance_propagation import (
        uncertainty_at_end,  # imported late: compiles kernels
    )

    for stage in stages:
        path = stage.after.path(craft.name)
        found.append((path, errors))
        errors = uncertainty_at_end(errors, path)
    return tuple(found)


def shots(burns: Mapping[str, Any], name: str) -> Shots:
    """Return the burns of one craft from the columns of all burns."""
    own = np.asarray(burns["craft"], dtype=object) == name
    keys = ("start_s", "duration_s", *PUSH, "propellant_kg", "thruster")
    numbers = {key: np.asarray(burns[key], dtype=object)[own].astype(float) for key in keys}
    thruster = np.nan_to_num(numbers["thruster"]).astype(int)
    push = np.stack([numbers[key] for key in PUSH], axis=1)
    return Shots(numbers["start_s"], numbers["duration_s"], push, numbers["propellant_kg"], thruster)
