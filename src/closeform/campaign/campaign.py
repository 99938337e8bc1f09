"""Campaign: a scenario flown over many drawn cases.

    scenario -> kind of cases -> chunks of them, flown on all cores -> tally -> shares -> result folder

No mathematics: what a case is stands in `draws`, what becomes of it in `search`.
"""

from __future__ import annotations

from collections.abc import Callable
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from closeform.arrays import instance, shown
from closeform.campaign.cases import Cases
from closeform.campaign.chunks import Held
from closeform.campaign.gather_cases import GatherCases
from closeform.campaign.lock_cases import LockCases
from closeform.campaign.search_campaign import Campaign
from closeform.campaign.threads import in_threads
from closeform.scenario import Scenario, ScenarioError, load
from closeform.scenario.stage_table import StageTable
from closeform.scenario.stages import Gather, Lock

if TYPE_CHECKING:
    from closeform.campaign.error_cases import ErrorCampaign
    from closeform.campaign.mission_cases import MissionCampaign
    from closeform.campaign.sweep_cases import SweepCampaign

MOST_CASES = 100_000_000
MOST_LOCKS = 500_000_000  # times with their legs that arrays hold: 8 GB
Progress = Callable[[int], None]
FLIES: dict[type[StageTable], Callable[[Scenario, int], Cases]] = {Lock: LockCases.of, Gather: GatherCases.of}


def study(
    file: str | Path, cases: int | None = None, seed: int | None = None
) -> Campaign | ErrorCampaign | MissionCampaign | SweepCampaign:
    """Fly many cases of a scenario, each with its own draws from [study.vary], or of its errors.

    Case K is the same in every study of the file with the same seed, however many cases it has;
    `closeform run FILE --case K` shows one.

    Parameters
    ----------
    file : str or path-like
        A scenario with a [study].
    cases : int, optional
        C, instead of the number in its [study] table.
    seed : int, optional
        Instead of that in its [study] table.

    Returns
    -------
    Campaign, ErrorCampaign, MissionCampaign or SweepCampaign
        Of one search a LockCampaign or a GatherCampaign: arrays (C,) of times [s] and, of gatherings, delta-v
        [m/s]; failed cases stay in the denominators of its `shares`.  Of errors who is ever `inside` what, in
        which cases.  Of any other scenario the `statuses` (C,) and `column` of delta-v [m/s], ends [s] and
        least ratios.  Of a sweep its `points`, each with such a `campaign`.

    Raises
    ------
    ScenarioError
        If the scenario cannot be read or studied; a ValueError.
    ValueError
        If `file` is no path, or a number of cases or a seed makes no sense.

    Notes
    -----
    The arrays are held: some 20 bytes for each case and pair.  `closeform study` writes cases to files as
    they are flown, and needs the same memory for any number of them.
    """
    found: Campaign | ErrorCampaign | MissionCampaign | SweepCampaign
    found = flown(load(instance("file", file, str, Path)), cases, seed)
    return found


def flown(
    scenario: Scenario,
    cases: int | None = None,
    seed: int | None = None,
    progress: Progress = lambda done: None,
) -> Any:
    """The campaign of a scenario that has been read, in arrays; `progress` is told how many are done."""
    kind, count = asked(scenario, cases, seed)
    if isinstance(kind, LockCases):
        shape = (1 + len(kind.steps), count, len(kind.pairs))  # exact detection first, then at each step
        if prod(shape) > MOST_LOCKS:
            most = MOST_LOCKS // (shape[0] * shape[2])
            line = f"{count} of {len(kind.pairs)} pairs, {shape[0]} ways of detection, are too many at once"
            raise ScenarioError(scenario.file, [f"study.cases: {line}; give {most} at most"])
    held, done = Held(kind, count), 0
    size = kind.in_chunk(count)
    for (first, end), columns in in_threads(
        kind.prepared().flown, ((k, min(k + size, count)) for k in range(0, count, size))
    ):
        held.take(first, columns)
        done += end - first
        progress(done)
    return kind.campaign(held)


def asked(scenario: Scenario, cases: int | None, seed: int | None) -> tuple[Cases, int]:
    """The kind of cases that a study of a scenario flies, and how many.

    Raises ScenarioError where it cannot be studied, and ValueError for a number that makes no sense.
    """
    if scenario.study is None:
        raise ScenarioError(scenario.file, ["study: missing; add [study] with cases = 1000 and seed = 1"])
    if lines := scenario.refused("study"):
        raise ScenarioError(scenario.file, lines)
    count = whole("cases", scenario.study.cases if cases is None else cases, 1, MOST_CASES)
    chosen = whole("seed", scenario.study.seed if seed is None else seed, 0, None)
    if not scenario.points:
        return kind_of(scenario, chosen), count
    from closeform.campaign.sweep_cases import SweepCases

    if count * len(scenario.points) > MOST_CASES:
        most = MOST_CASES // len(scenario.points)
        line = f"{count} at each of {len(scenario.points)} points are too many; give {most} at most"
        raise ScenarioError(scenario.file, [f"study.cases: {line}"])
    kinds = tuple(kind_of(point, chosen) for point in scenario.points)
    return SweepCases(scenario, chosen, kinds, count), count * len(kinds)


def kind_of(scenario: Scenario, seed: int) -> Cases:
    """The kind of cases of a scenario."""
    if scenario.study is not None and scenario.study.draws == "errors":
        from closeform.campaign.error_cases import ErrorCases  # whose kernels searches can spare

        return ErrorCases(scenario, seed)
    if not scenario.searches_alone:
        from closeform.campaign.mission_cases import MissionCases  # whose plans searches can spare

        return MissionCases(scenario, seed)
    try:
        return FLIES[type(scenario.stages[0])](scenario, seed)
    except ScenarioError:
        raise
    except ValueError as error:
        raise ScenarioError(scenario.file, [f"stage[1]: {error}; change [craft] or its draws"]) from error


def whole(name: str, value: Any, least: int, most: int | None) -> int:
    """An argument that is a whole number within bounds."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise ValueError(f"{name}: must be a whole number, got {shown(value)}; give one")
    if value < least or (most is not None and value > most):
        bounds = f"at least {least}" + (f" and at most {most}" if most is not None else "")
        raise ValueError(f"{name}: {value} is out of range; give {bounds}")
    return int(value)
