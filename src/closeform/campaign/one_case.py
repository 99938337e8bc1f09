"""One case of a study as a scenario of its own."""

from __future__ import annotations

from dataclasses import replace
from operator import attrgetter
from typing import TYPE_CHECKING, Any

from closeform.campaign.draws import drawn, failing, flight_seed, searching, values, varied
from closeform.scenario import Craft, Scenario, ScenarioError
from closeform.scenario.study import FAILS, STATES, UNPLANNED
from closeform.search.search_errors import errors_of_cases

if TYPE_CHECKING:
    from closeform.mission.executed_mission import History


def case_of(scenario: Scenario, case: int) -> Scenario:
    """Return the scenario with the samples of one `case` of its study, with the file's seed.

    Raises ScenarioError for an unsupported scenario or for craft at the same position in that case, and
    ValueError for a scenario without a study or a negative case.
    """
    if scenario.study is None:
        raise ValueError(f"{scenario.file} has no cases; add a [study] table, or leave the case out")
    if case < 0:
        raise ValueError(f"{case} is negative, cases count from 0; give 0 or more")
    if lines := scenario.refused("run --case"):
        raise ScenarioError(scenario.file, lines)
    found = one_case(scenario, scenario.study.seed, case)
    if lines := found.coincident() if any(stage.searches for stage in found.stages) else ():
        raise ScenarioError(scenario.file, lines)
    return found


def one_case(scenario: Scenario, seed: int, case: int) -> Scenario:
    """Return the scenario with the samples of one case of its study, with a given seed."""
    title, history = f"{scenario.title}: case {case}", history_of(scenario, seed, case)
    if history is not None and history.draws == "errors":
        return replace(scenario, title=title, case=case, history=history)
    states = drawn(scenario, seed, case, case + 1)[0]
    replanned = history is not None and history.replanned
    if history is not None and replanned:
        states = states + [history.starts(craft) for craft in scenario.craft]
    columns = {"position": states[:, :3], "velocity": states[:, 3:]}
    for key in varied(scenario):
        if key.startswith("craft.") and not key.startswith((*STATES, FAILS, *UNPLANNED)):
            columns[field_of(key)] = values(scenario, seed, key, case, case + 1)[0]
    found = replace(
        scenario,
        title=title,
        craft=drawn_craft(scenario.craft, columns, replanned),
        case=case,
        astray=errors_of_cases(searching(scenario, seed, case, case + 1), (1, len(scenario.craft)), 0),
        history=history,
    )
    if scenario.flights is None:
        return found
    own = flight_seed(seed, case)
    return replace(found, flight_seed=own, drawn_flight=flight_of(found, seed, case))


def drawn_craft(craft: tuple[Craft, ...], columns: dict[str, Any], replanned: bool) -> tuple[Craft, ...]:
    """Return craft with the values (N,) or (N, 3) of the given fields replaced."""
    known = {"start": None, "states": None} | ({"covariance": None} if replanned else {})
    found = []
    for k, one in enumerate(craft):
        cells = {name: column[k].tolist() for name, column in columns.items()}
        drawn_now = {name: tuple(cell) if isinstance(cell, list) else cell for name, cell in cells.items()}
        found.append(one.model_copy(update={**known, **drawn_now}))
    return tuple(found)


def flight_of(scenario: Scenario, seed: int, case: int) -> Scenario | None:
    """Return a case with the sampled values that its plan does not know; None without any."""
    found = scenario
    for key in varied(scenario):
        if not key.startswith(UNPLANNED):
            continue
        value = values(scenario, seed, key, case, case + 1)[0]
        table, _, name = key.rpartition(".")
        if table == "craft":
            found = replace(found, craft=drawn_craft(found.craft, {field_of(key): value}, False))
        else:
            own = attrgetter(table)(found).model_copy(update={name: float(value[0])})
            orbit = found.orbit.model_copy(update={"field": own})
            found = replace(found, **({"orbit": orbit} if table == "orbit.field" else {table: own}))
    return None if found is scenario else found


def history_of(scenario: Scenario, seed: int, case: int) -> History | None:
    """Return the sampled errors and failures of one case; None if its study samples none."""
    study = scenario.study
    if study is None or (study.draws == "vary" and FAILS not in study.vary):
        return None
    from closeform.mission.executed_mission import History  # imported late: compiles kernels

    return History(seed, case, study.draws, failing(scenario, seed, case))


def field_of(key: str) -> str:
    """Return the field of a craft that a key such as craft.mass sets."""
    return next(name for name in Craft.model_fields if f"craft.{Craft.key_of(name)}" == key)
