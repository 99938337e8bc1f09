"""Campaign: a scenario's search flown over many drawn cases.

    scenario -> draws -> arrays of states -> lock_times or gather_cases -> shares -> result folder

No mathematics: what a case is stands in `draws`, what becomes of it in `search`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from closeform.arrays import Floats, instance, shown
from closeform.campaign.draws import drawn
from closeform.campaign.shares import Share, shares
from closeform.conflicts.two_paths import closest_approach
from closeform.planning.limits import FULL, propellant
from closeform.result import Result
from closeform.scenario import Scenario, ScenarioError, load
from closeform.scenario.stage_table import StageTable
from closeform.scenario.stages import Gather, Lock
from closeform.search.gather import gather_cases
from closeform.search.gather_result import Gatherings
from closeform.search.locks import lock_times
from closeform.search.phases import labels, tally
from closeform.search.sampled import sampled_times
from closeform.search.schedule import Search
from closeform.zones.pair_zones import portions

if TYPE_CHECKING:
    from closeform.campaign.error_cases import ErrorCampaign

MOST_CASES = 100_000_000  # arrays of this length still fit a workstation
MOST_LOCKS = 500_000_000  # times with their legs: 8 GB
PAIRS_AT_ONCE, GATHERINGS_AT_ONCE = 131_072, 4096
NAMED = 10  # cases that are named where more have failed

WORDS = {"clear": "clear", "delta-v": "within delta_v_budget", "propellant": "within propellant"}
Progress = Callable[[int], None]


class CampaignStatus(StrEnum):
    """How a campaign ended: all that was asked for is met, or not in some cases, or some were never done."""

    COMPLETE = "complete"
    UNMET = "a clearance or a limit not met"
    INCOMPLETE = "incomplete"


@dataclass(frozen=True, eq=False, repr=False)
class Campaign(Result):
    """What became of C cases, drawn with `seed`: arrays (C,), case K at index K.

    `time` [s] at which the case was done, nan where it never was, and the `leg` of `search`, then -1.
    `kept` (C,) of each clearance and limit that the file asks for: "clear" of keep-out zones, within the
    "delta-v" budget, within the "propellant" on board of every craft.
    """

    scenario: Scenario
    seed: int
    search: Search
    time: Floats
    leg: Any
    kept: dict[str, Any]
    done: ClassVar[str] = "done"  # what a case is at that time, in words
    _told: ClassVar = ("title", "seed", "time", "status", "reason")

    @property
    def title(self) -> str:
        """That of its scenario."""
        return self.scenario.title

    def __len__(self) -> int:
        return len(self.time)

    @property
    def failed(self) -> Any:
        """The numbers (F,) of the cases that were never done."""
        return np.flatnonzero(self.leg < 0)

    @cached_property
    def met(self) -> dict[str, Any]:
        """Of all that was asked for, in which cases (C,) it is met: to be done, and what is to be kept."""
        return {self.done: self.leg >= 0, **{WORDS[what]: kept for what, kept in self.kept.items()}}

    @cached_property
    def good(self) -> Any:
        """In which cases (C,) all of it is met, as in a run that ends with status 0."""
        return np.all(list(self.met.values()), axis=0)

    @property
    def ok(self) -> bool:
        """Whether all that was asked for is met in every case."""
        return bool(self.good.all())

    @property
    def status(self) -> CampaignStatus:
        """How it ended."""
        if len(self.failed):
            return CampaignStatus.INCOMPLETE
        return CampaignStatus.COMPLETE if self.ok else CampaignStatus.UNMET

    @property
    def reason(self) -> str | None:
        """In how many cases what is not met, and which come first; None where all is met."""
        parts = []
        for what, met in self.met.items():
            if len(cases := np.flatnonzero(~met)):
                named = ", ".join(map(str, cases[:NAMED])) + ", ..." * (len(cases) > NAMED)
                parts.append(f"{len(cases)} of {len(self)} cases not {what}: {named}")
        return "; ".join(parts) or None

    @cached_property
    def shares(self) -> tuple[Share, ...]:
        """How many cases were done at once, in each phase, and never, with confidence intervals."""
        return shares(labels(self.search), tally(self.search, self.time, self.leg))


@dataclass(frozen=True, eq=False)
class SampledLocks:
    """When C cases were done for a simulation that looks every `step` [s]: `time` (C,) [s] and `leg` (C,)."""

    step: float
    time: Floats
    leg: Any


@dataclass(frozen=True, eq=False, repr=False)
class LockCampaign(Campaign):
    """First locks of all pairs of a craft in A and one in B; a case is done when its last pair has locked.

    `pairs` (P, 2) of craft; `pair_time` (C, P) [s], nan where there is no lock, and `pair_leg` (C, P),
    then -1; `sampled`: the same by detection at samples, for the steps of the scenario's [study].
    """

    pairs: Any
    pair_time: Floats
    pair_leg: Any
    sampled: tuple[SampledLocks, ...]
    done: ClassVar[str] = "locked"


@dataclass(frozen=True, eq=False, repr=False)
class GatherCampaign(Campaign):
    """Gatherings, each done when one formation set holds all craft.

    `rounds` (C,): searches begun; `left` (C,): craft not in the formation set; `delta_v` (C,) of
    all craft together [m/s]; `met_unknown` (C,): pairs that came within their keep-out zone before
    they knew each other, `met_known` (C,): only after.
    """

    rounds: Any
    left: Any
    delta_v: Floats
    met_unknown: Any
    met_known: Any
    done: ClassVar[str] = "gathered"


def study(file: str | Path, cases: int | None = None, seed: int | None = None) -> Campaign | ErrorCampaign:
    """Fly many cases of a scenario's search, each with its own draws from [study.vary], or of its errors.

    Case K is the same in every study of the file with the same seed, however many cases it has;
    `closeform run FILE --case K` shows one.

    Parameters
    ----------
    file : str or path-like
        A scenario with one stage, lock or gather; or with `draws = "errors"` in its [study].
    cases : int, optional
        C, instead of the number in its [study] table.
    seed : int, optional
        Instead of that in its [study] table.

    Returns
    -------
    Campaign or ErrorCampaign
        A LockCampaign or a GatherCampaign: arrays (C,) of times [s] and, of gatherings, delta-v [m/s]; failed
        cases stay in the denominators of its `shares`.  Of errors who is ever `inside` what, in which cases.

    Raises
    ------
    ScenarioError
        If the scenario cannot be read or studied; a ValueError.
    ValueError
        If `file` is no path, or a number of cases or a seed makes no sense.
    """
    return flown(load(instance("file", file, str, Path)), cases, seed)


def flown(
    scenario: Scenario,
    cases: int | None = None,
    seed: int | None = None,
    progress: Progress = lambda done: None,
) -> Campaign | ErrorCampaign:
    """The campaign of a scenario that has been read; `progress` is told how many cases are done."""
    if scenario.study is None:
        raise ScenarioError(scenario.file, ["study: missing; add [study] with cases = 1000 and seed = 1"])
    if lines := scenario.refused("study"):
        raise ScenarioError(scenario.file, lines)
    count = whole("cases", scenario.study.cases if cases is None else cases, 1, MOST_CASES)
    chosen = whole("seed", scenario.study.seed if seed is None else seed, 0, None)
    if scenario.study.draws == "errors":
        from closeform.campaign import error_cases  # whose kernels searches can spare

        return error_cases.flown(scenario, count, chosen, progress)
    (stage,) = scenario.stages
    try:
        return FLIES[type(stage)](scenario, stage, scenario.plan, count, chosen, progress)
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


def relative(states: Floats, pairs: Any) -> Floats:
    """States (..., P, 6) of the second craft of each pair relative to the first."""
    return np.asarray(states[..., pairs[:, 1], :] - states[..., pairs[:, 0], :])


def apart(scenario: Scenario, states: Floats, pairs: Any, first: int) -> None:
    """Refuse cases in which two craft of a pair are at one place."""
    same = (relative(states, pairs)[..., :3] == 0.0).all(axis=-1)
    if same.any():
        case, pair = np.argwhere(same)[0]
        one, other = (scenario.names[k] for k in pairs[pair])
        line = f"{one} and {other} are at one place in case {first + case}; draw their positions"
        raise ScenarioError(scenario.file, [f"study.vary: {line}"])


def locked(
    scenario: Scenario, stage: Lock, search: Search, cases: int, seed: int, progress: Progress
) -> LockCampaign:
    """First locks of all A-B pairs in all cases."""
    pairs = scenario.opposite
    steps = scenario.study.sampled if scenario.study is not None else ()
    shape = (1 + len(steps), cases, len(pairs))  # exact detection first, then at each step
    if prod(shape) > MOST_LOCKS:
        most = MOST_LOCKS // (shape[0] * shape[2])
        line = f"{cases} of {len(pairs)} pairs, {shape[0]} ways of detection, are too many at once"
        raise ScenarioError(scenario.file, [f"study.cases: {line}; give {most} at most"])
    times, legs = np.empty(shape), np.empty(shape, dtype=np.int64)
    watched = any(zone is not None for zone in scenario.keep_out)
    clear = np.ones(cases, dtype=bool)
    size = max(1, PAIRS_AT_ONCE // len(pairs))
    for first in range(0, cases, size):
        some = slice(first, min(first + size, cases))
        states = drawn(scenario, seed, some.start, some.stop)
        apart(scenario, states, pairs, first)
        moves = relative(states, pairs).reshape(-1, 6)
        found = lock_times(search, moves[:, :3], moves[:, 3:])
        results = [(found.time, found.leg)]
        results += [sampled_times(search, moves[:, :3], moves[:, 3:], step) for step in steps]
        for k, (time, leg) in enumerate(results):
            times[k, some], legs[k, some] = time.reshape(-1, len(pairs)), leg.reshape(-1, len(pairs))
        if watched:
            clear[some] = coasts_clear(scenario, states, search.duration)
        progress(some.stop)
    exact, *others = (last(*result) for result in zip(times, legs, strict=True))
    sampled = tuple(SampledLocks(step, *other) for step, other in zip(steps, others, strict=True))
    kept = {"clear": clear} if watched else {}
    return LockCampaign(scenario, seed, search, *exact, kept, pairs, times[0], legs[0], sampled)


def coasts_clear(scenario: Scenario, states: Floats, duration: float) -> Any:
    """In which cases (C,) no two craft that coast from states (C, N, 6) come into each other's zone."""
    paths = scenario.orbit.build().coast(states, duration)
    clear = np.ones(len(states), dtype=bool)
    for zone, first, second in portions(scenario.zones):
        near = closest_approach(paths[:, first], paths[:, second], zone)
        clear &= (np.asarray(near.ratio) > 1.0).all(axis=1)
    return clear


def last(time: Floats, leg: Any) -> tuple[Floats, Any]:
    """When the last pair of each case has locked, and in which leg; nan and -1 unless all have."""
    return time.max(axis=1), np.where((leg < 0).any(axis=1), -1, leg.max(axis=1))


def gathered(
    scenario: Scenario, stage: Gather, search: Search, cases: int, seed: int, progress: Progress
) -> GatherCampaign:
    """Gatherings of all craft in all cases."""
    pairs = np.stack(np.triu_indices(len(scenario.craft), 1), axis=1)
    parts, kept = [], []
    for first in range(0, cases, GATHERINGS_AT_ONCE):
        states = drawn(scenario, seed, first, min(first + GATHERINGS_AT_ONCE, cases))
        apart(scenario, states, pairs, first)
        parts.append(gather_cases(search, states[..., :3], states[..., 3:], **scenario.gathering(stage)))
        kept.append(within_limits(scenario, parts[-1]))
        progress(first + len(parts[-1]))

    def column(name: str) -> Any:
        return np.concatenate([getattr(part, name) for part in parts])

    leg = column("leg")
    time = np.where(leg < 0, np.nan, column("duration"))
    rest = (column(name) for name in ("rounds", "left", "delta_v", "met_unknown", "met_known"))
    limits = {what: np.concatenate([part[what] for part in kept]) for what in kept[0]}
    return GatherCampaign(scenario, seed, parts[0].search, time, leg, limits, *rest)


def within_limits(scenario: Scenario, flown: Gatherings) -> dict[str, Any]:
    """In which gatherings (C,) each clearance and limit that the file asks for is kept."""
    kept: dict[str, Any] = {}
    if scenario.zones.pairs:
        kept["clear"] = flown.met_unknown + flown.met_known == 0
    for k, craft in enumerate(scenario.craft):
        spent = flown.each_delta_v[:, k]
        if craft.delta_v_budget is not None:
            kept["delta-v"] = kept.get("delta-v", True) & (spent <= FULL * craft.delta_v_budget)
        if craft.propellant is not None and craft.mass is not None and craft.specific_impulse is not None:
            burnt = propellant(craft.mass, spent, craft.specific_impulse)
            kept["propellant"] = kept.get("propellant", True) & (burnt <= FULL * craft.propellant)
    return kept


FLIES: dict[type[StageTable], Callable[..., Campaign]] = {Lock: locked, Gather: gathered}
