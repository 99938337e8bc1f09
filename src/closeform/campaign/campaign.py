"""Study of a scenario: evaluate many sampled cases and collect their statistics.

    scenario -> kind of cases -> chunks of them, on all cores -> tally -> shares -> result folder

`draws` samples the cases, and `search` and `mission` evaluate them.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from closeform.arrays import instance, whole
from closeform.campaign.cases import Cases
from closeform.campaign.chunks import Held, in_threads
from closeform.campaign.search_cases import Campaign, GatherCases, LockCases
from closeform.scenario import Scenario, ScenarioError, load
from closeform.scenario.stages import Gather, Lock, StageTable

if TYPE_CHECKING:
    from closeform.campaign.error_cases import ErrorCampaign
    from closeform.campaign.mission_cases import MissionCampaign
    from closeform.campaign.sweep_cases import SweepCampaign

MOST_CASES = 100_000_000
MOST_NUMBERS = 500_000_000  # of cases held as arrays: 8 GB for lock times with their legs
Progress = Callable[[int], None]
KINDS: dict[type[StageTable], Callable[[Scenario, int], Cases]] = {Lock: LockCases.of, Gather: GatherCases.of}


def study(
    file: str | Path, cases: int | None = None, seed: int | None = None
) -> Campaign | ErrorCampaign | MissionCampaign | SweepCampaign:
    """Run a Monte Carlo study of a scenario: evaluate many cases, each with its own samples.

    The samples come from [study.vary], or from the uncertainty of the craft. Case K is the same in every
    study of the file with the same seed, however many cases it has; `closeform run FILE --case K` shows one.

    Parameters
    ----------
    file : str or path-like
        A scenario with a [study].
    cases : int, optional
        Number of cases C, instead of that in the [study] table.
    seed : int, optional
        Seed, instead of that in the [study] table.

    Returns
    -------
    Campaign, ErrorCampaign, MissionCampaign or SweepCampaign
        For one search a LockCampaign or a GatherCampaign with arrays (C,) of times [s] and, for gatherings,
        delta-v [m/s]; failed cases stay in the denominators of its `shares`. For sampled errors the pairs
        that are ever `inside` a zone, case by case. For any other scenario the `statuses` (C,) and `column`
        of delta-v [m/s], end times [s] and minimum clearance ratios. For a sweep its `points`, each with
        such a `campaign`.

    Raises
    ------
    ScenarioError
        If the scenario cannot be read or studied; a ValueError.
    ValueError
        If `file` is not a path, or the number of cases or the seed is out of range.

    Notes
    -----
    The arrays stay in memory: some 20 bytes for each case and pair. `closeform study` writes finished cases
    to files, and its memory does not grow with the number of cases.
    """
    found: Campaign | ErrorCampaign | MissionCampaign | SweepCampaign
    found = evaluated(load(instance("file", file, str, Path)), cases, seed)
    return found


def evaluated(
    scenario: Scenario,
    cases: int | None = None,
    seed: int | None = None,
    progress: Progress = lambda done: None,
) -> Any:
    """Return the campaign of a loaded scenario as arrays; `progress` receives the number of cases done."""
    kind, count = requested(scenario, cases, seed)
    if count * kind.numbers > MOST_NUMBERS:
        line = f"{count} with {kind.numbers} numbers each are too many to hold in memory"
        most = MOST_NUMBERS // kind.numbers
        raise ScenarioError(scenario.file, [f"study.cases: {line}; give at most {most}"])
    held, done = Held(kind, count), 0
    every = ((cases.start, cases.stop) for cases in kind.ranges(count))
    for (first, end), columns in in_threads(kind.prepared().columns, every):
        held.take(first, columns)
        done += end - first
        progress(done)
    return kind.campaign(held)


def requested(scenario: Scenario, cases: int | None, seed: int | None) -> tuple[Cases, int]:
    """Return the kind of cases that a study of the scenario evaluates, and their number.

    Raises ScenarioError if the scenario cannot be studied, and ValueError for a number out of range.
    """
    if scenario.study is None:
        raise ScenarioError(scenario.file, ["study: missing; add [study] with cases = 1000 and seed = 1"])
    if lines := scenario.refused("study"):
        raise ScenarioError(scenario.file, lines)
    each = whole("cases", scenario.study.cases if cases is None else cases, 1)
    chosen = whole("seed", scenario.study.seed if seed is None else seed)
    if each * max(1, len(scenario.points)) > MOST_CASES:
        points = f" at each of {len(scenario.points)} points" * bool(scenario.points)
        most = MOST_CASES // max(1, len(scenario.points))
        raise ValueError(f"cases: {each}{points} are too many; give at most {most}")
    if not scenario.points:
        return kind_of(scenario, chosen), each
    from closeform.campaign.sweep_cases import SweepCases

    kinds = tuple(kind_of(point, chosen) for point in scenario.points)
    return SweepCases(scenario, chosen, kinds, each), each * len(kinds)


def kind_of(scenario: Scenario, seed: int) -> Cases:
    """Return the kind of cases of a scenario."""
    if scenario.study is not None and scenario.study.draws == "errors":
        from closeform.campaign.error_cases import ErrorCases  # imported late: compiles kernels

        return ErrorCases(scenario, seed)
    if not scenario.searches_alone:
        from closeform.campaign.mission_cases import MissionCases  # imported late: the planner

        return MissionCases(scenario, seed)
    try:
        return KINDS[type(scenario.stages[0])](scenario, seed)
    except ScenarioError:
        raise
    except ValueError as error:
        raise ScenarioError(scenario.file, [f"stage[1]: {error}; change [craft] or its draws"]) from error
