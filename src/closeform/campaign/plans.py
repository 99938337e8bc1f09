"""Plans: those that cases of a study have in common, each made once, and the missions that a report shows."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Future
from math import isnan
from threading import Lock
from typing import Any

from closeform.campaign.draws import drawn, values, varied
from closeform.mission.mission_result import Mission
from closeform.scenario import Scenario
from closeform.scenario.study import FAILS, STATES, UNPLANNED

MOST = 32  # plans that are held, the last ones
KEPT = 2  # missions that are kept of each rank: more than a report has pages for would only take memory

Known = tuple[bytes, ...]


class Plans:
    """The plans of some cases, by what they know of a case; threads wait for the one that makes theirs.

    Beside them the missions of the cases that a report will show, as they were flown.
    """

    def __init__(self) -> None:
        self.lock = Lock()
        self.held: dict[Known, Future[Mission]] = {}
        self.kept: dict[str, list[tuple[float, int, Mission]]] = {}

    def keep(self, case: int, mission: Mission, ranks: Mapping[str, float]) -> None:
        """Keep the mission of a case as long as it is among the first `KEPT` of a rank; nan is no rank."""
        with self.lock:
            for name, rank in ranks.items():
                if not isnan(rank):
                    first = [*self.kept.get(name, ()), (rank, case, mission)]
                    self.kept[name] = sorted(first, key=lambda one: one[:2])[:KEPT]

    def mission(self, case: int) -> Mission | None:
        """Return the mission of a case, None where it was not kept."""
        with self.lock:
            every = (one for first in self.kept.values() for one in first)
            return next((mission for _, number, mission in every if number == case), None)

    def __reduce__(self) -> Any:
        return Plans, ()  # a copy, here or in another process, holds none

    def of(self, known: Known, make: Callable[[], Mission]) -> Mission:
        """The plan that is known so, made where it is not held; what it raises, it raises for each."""
        with self.lock:
            found, new = self.held.get(known), Future[Mission]()
            if found is None:
                self.held[known] = new
                if len(self.held) > MOST:
                    del self.held[next(iter(self.held))]
        if found is not None:
            return found.result()
        try:
            new.set_result(make())
        except BaseException as error:  # or others would wait forever
            new.set_exception(error)
        return new.result()


def recurring(scenario: Scenario) -> bool:
    """Whether cases of a study may have the same plan, which knows a few values at most of what they draw."""
    study = scenario.study
    if study is None or study.draws == "replanned":  # each stage is planned from where errors led
        return False
    planned = planned_keys(scenario)
    return all(study.vary[key].kind in ("choice", "chance") for key in planned)


def known(scenario: Scenario, seed: int, case: int) -> Known:
    """What plans know of what a case of a study draws."""
    some = case, case + 1
    others = [key for key in planned_keys(scenario) if key not in STATES]
    each: list[Any] = [drawn(scenario, seed, *some), *(values(scenario, seed, key, *some) for key in others)]
    return tuple(one.tobytes() for one in each)


def planned_keys(scenario: Scenario) -> list[str]:
    """The keys of draws that plans know: not how flights go, nor who fails."""
    return [key for key in varied(scenario) if key != FAILS and not key.startswith(UNPLANNED)]
