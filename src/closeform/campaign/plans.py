"""Plans shared by the cases of a study, each computed once, and the missions that a report shows."""

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

MOST = 32  # number of plans in memory, the most recent ones
KEPT = 2  # missions kept for each rank; a report has no pages for more

Known = tuple[bytes, ...]


class Plans:
    """Plans by the inputs of a case that they depend on; threads wait for one that is being computed.

    Also holds the missions of the cases that a report will show.
    """

    def __init__(self) -> None:
        self.lock = Lock()
        self.held: dict[Known, Future[Mission]] = {}
        self.kept: dict[str, list[tuple[float, int, Mission]]] = {}

    def keep(self, case: int, mission: Mission, ranks: Mapping[str, float]) -> None:
        """Keep the mission of a case if it is among the first `KEPT` of a rank; nan is no rank."""
        with self.lock:
            for name, rank in ranks.items():
                if not isnan(rank):
                    first = [*self.kept.get(name, ()), (rank, case, mission)]
                    self.kept[name] = sorted(first, key=lambda one: one[:2])[:KEPT]

    def mission(self, case: int) -> Mission | None:
        """Return the mission of a case, None if it was not kept."""
        with self.lock:
            every = (one for first in self.kept.values() for one in first)
            return next((mission for _, number, mission in every if number == case), None)

    def __reduce__(self) -> Any:
        return Plans, ()  # a copy, in this or another process, is empty

    def of(self, known: Known, make: Callable[[], Mission]) -> Mission:
        """Return the plan for the given inputs, computed if absent; an error is raised in every thread."""
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
        except BaseException as error:  # else other threads would wait forever
            new.set_exception(error)
        return new.result()


def recurring(scenario: Scenario) -> bool:
    """Return True if cases can share plans: the planner sees only values from a finite set."""
    study = scenario.study
    if study is None or study.draws == "replanned":  # each stage is planned from a state with errors
        return False
    planned = planned_keys(scenario)
    return all(study.vary[key].kind in ("choice", "chance") for key in planned)


def known(scenario: Scenario, seed: int, case: int) -> Known:
    """Return the sampled values of a case that plans depend on, as bytes."""
    some = case, case + 1
    others = [key for key in planned_keys(scenario) if key not in STATES]
    each: list[Any] = [drawn(scenario, seed, *some), *(values(scenario, seed, key, *some) for key in others)]
    return tuple(one.tobytes() for one in each)


def planned_keys(scenario: Scenario) -> list[str]:
    """Return the varied keys that plans depend on: neither simulation errors nor failures."""
    return [key for key in varied(scenario) if key != FAILS and not key.startswith(UNPLANNED)]
