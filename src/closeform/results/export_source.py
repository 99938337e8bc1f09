"""What an export takes from a mission, a run that was loaded, or paths: who flew where, what was burnt."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from closeform.arrays import Floats
from closeform.exchange.aem import quaternions
from closeform.exchange.chief import Chief
from closeform.exchange.epochs import Epoch
from closeform.exchange.exported import Shots
from closeform.exchange.tracks import FlownCraft
from closeform.fuel.burns import burns_of
from closeform.mission.mission_result import Mission
from closeform.motion.path import Path
from closeform.results.load import LoadedRun
from closeform.scenario import Craft, Scenario
from closeform.search.imperfect_attitude import OwnTurns
from closeform.search.leg import Group
from closeform.search.schedule import Search
from closeform.search.search_errors import of_each

if TYPE_CHECKING:
    from closeform.uncertainty.errors import Uncertainty

UNKNOWN = "UNKNOWN"  # as CCSDS calls what has no designator
SAME_ORBIT = 1e-6  # of the mean motion, of the chief's and that of the paths
FILE_REMEDY = "give [orbit] an epoch and a chief, or chief=cf.Chief(...) from Python"
PATH_REMEDY = "give chief=cf.Chief(...)"
TURNS_EACH = np.radians(5.0)  # from one quaternion of a turn to the next, at most
PUSH = ("radial_m_s", "along_track_m_s", "cross_track_m_s")


@dataclass(frozen=True, eq=False)
class Source:
    """Who is exported: `craft` through all stages flown, about the `chief` from the `epoch` on, if known.

    `results` are the stages of a `scenario`; none of paths.  `remedy`: how a chief is given.
    """

    title: str
    craft: tuple[FlownCraft, ...]
    mean_motion: float
    chief: Chief | None
    epoch: Epoch | None
    remedy: str
    results: Sequence[Any] = ()
    scenario: Scenario | None = None

    @property
    def designators(self) -> Mapping[str, str]:
        """What OBJECT_ID says of each craft."""
        return {one.name: one.object_id for one in self.craft}

    @cached_property
    def attitudes(self) -> dict[str, list[tuple[Floats, Floats]]]:
        """Of each craft that searches its turns: times (T,) [s] and quaternions (T, 4)."""
        found: dict[str, list[tuple[Floats, Floats]]] = {}
        for result in self.results:
            if not result.stage.searches or self.scenario is None:
                continue
            search, last = result.result.search, result.end - result.start
            if (errors := self.scenario.search_errors) is not None:
                craft = of_each(errors, (len(self.scenario.names),))
                own = OwnTurns(search, self.scenario.groups, craft)
                for k, name in enumerate(self.scenario.names):
                    parts = flown_turns(own, k, last)
                    found.setdefault(name, []).extend((times + result.start, rows) for times, rows in parts)
                continue
            both: dict[Group, list[tuple[Floats, Floats]]] = {
                group: [(times + result.start, values) for times, values in turns(search, group, last)]
                for group in ("A", "B")
            }
            for name, group in zip(self.scenario.names, self.scenario.groups, strict=True):
                found.setdefault(name, []).extend(both[group])
        return {name: some for name, some in found.items() if some}


def turns(search: Search, group: Group, last: float) -> list[tuple[Floats, Floats]]:
    """The turns of a group until a `last` time [s], at most 5 degrees from one quaternion to the next."""
    found = []
    for leg in search.legs:
        end = min(leg.end, last)
        if end <= leg.start:
            break
        share = (end - leg.start) / (leg.end - leg.start)
        count = max(2, int(np.ceil(abs(leg.angle) * share / TURNS_EACH)) + 1)
        times = np.round(np.linspace(leg.start, end, count), 9)
        attitudes = leg.attitude_at(times)
        found.append((times, quaternions(attitudes if group == "A" else attitudes * [1.0, -1.0, -1.0])))
    return found


def flown_turns(own: OwnTurns, k: int, last: float) -> list[tuple[Floats, Floats]]:
    """The turns of craft k by its own clock until a `last` time [s], also while it waits to begin."""
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
    """What is to be exported. Raises ValueError for a chief or names that do not fit."""
    if isinstance(result, Path):
        return checked(of_paths(result, chief, names))
    if names is not None:
        raise ValueError("names: those of a run are its scenario's; leave them out")
    scenario = result.scenario
    if not result.flown:
        raise ValueError(f"result: nothing was flown, {result.stopped}; mend the scenario first")
    paths = [through(result.orbit, result.flown, k) for k in range(len(scenario.names))]
    craft = tuple(
        FlownCraft(
            one.name, UNKNOWN, path, shots(result.burns, one.name), one.mass, spread(result.flown, one)
        )
        for one, path in zip(scenario.craft, paths, strict=True)
    )
    found = chief or scenario.chief
    return checked(
        Source(
            scenario.title,
            craft,
            result.orbit.mean_motion,
            found,
            scenario.epoch if found is None else found.instant,
            FILE_REMEDY,
            tuple(result.results),
            scenario,
        )
    )


def checked(source: Source) -> Source:
    """The same, if the chief is on the orbit in whose frame the paths are."""
    if source.chief is not None and source.mean_motion > 0.0:
        theirs = source.chief.orbit.mean_motion
        if abs(theirs / source.mean_motion - 1.0) > SAME_ORBIT:
            what = f"has a mean motion of {theirs:.9g} rad/s, the paths one of {source.mean_motion:.9g} rad/s"
            raise ValueError(f"chief: {what}; give the orbit that the paths were planned in")
    return source


def of_paths(path: Path, chief: Chief | None, names: Sequence[str] | None) -> Source:
    """Paths by themselves."""
    each = [path] if not path.shape else [path[k] for k in range(len(path))]
    if len(path.shape) > 1:
        raise ValueError(f"result: paths of shape (N,) can be exported, got {path.shape}; index them first")
    called = [f"C{k}" for k in range(1, len(each) + 1)] if names is None else list(names)
    if len(called) != len(each) or len(set(called)) != len(called):
        raise ValueError(f"names: expected {len(each)} names, each another, got {', '.join(called)}")
    craft = []
    for name, one in zip(called, each, strict=True):
        found = burns_of(one).told
        unknown = np.full(len(found.start), np.nan)
        burns = Shots(found.start, found.duration, found.push, unknown, np.zeros(len(found.start), dtype=int))
        craft.append(FlownCraft(name, UNKNOWN, one, burns))
    epoch = None if chief is None else chief.instant
    return Source("Paths", tuple(craft), path.orbit.mean_motion, chief, epoch, PATH_REMEDY)


def through(orbit: Any, stages: Sequence[Any], k: int) -> Path:
    """The path of craft k through stages that follow one another."""
    arcs = np.concatenate([stage.after.paths[k].arcs for stage in stages])
    return Path(orbit, arcs, np.array([0, len(arcs)]), ())


def spread(stages: Sequence[Any], craft: Craft) -> tuple[tuple[Path, Uncertainty], ...]:
    """A craft's path in each stage, with its errors when that begins; none of one that is known exactly."""
    errors, found = craft.errors, []
    if errors is None:
        return ()
    from closeform.uncertainty.propagated_errors import carried  # with kernels that few exports need

    for stage in stages:
        path = stage.after.path(craft.name)
        found.append((path, errors))
        errors = carried(errors, path)
    return tuple(found)


def shots(burns: Mapping[str, Any], name: str) -> Shots:
    """Of the columns of all burns those of one craft."""
    own = np.asarray(burns["craft"], dtype=object) == name
    keys = ("start_s", "duration_s", *PUSH, "propellant_kg", "thruster")
    numbers = {key: np.asarray(burns[key], dtype=object)[own].astype(float) for key in keys}
    thruster = np.nan_to_num(numbers["thruster"]).astype(int)
    push = np.stack([numbers[key] for key in PUSH], axis=1)
    return Shots(numbers["start_s"], numbers["duration_s"], push, numbers["propellant_kg"], thruster)
