"""Monte Carlo cases of first locks of all pairs of coasting craft, one in A and one in B, and statistics."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from closeform.arrays import Floats
from closeform.campaign.cases import Cases, Columns
from closeform.campaign.chunks import CaseChunks
from closeform.campaign.draws import drawn, searching, varied
from closeform.campaign.phase_columns import NAMES, ended, named
from closeform.campaign.search_campaign import Campaign
from closeform.campaign.tally import Settled
from closeform.conflicts.two_paths import closest_approach
from closeform.mission.verdict import ROUNDING
from closeform.scenario import Scenario, ScenarioError
from closeform.search.imperfect_attitude import OwnTurns
from closeform.search.locks import lock_times
from closeform.search.sampled import sampled_times
from closeform.search.schedule import Search
from closeform.search.search_errors import SearchErrors, between, of_each
from closeform.zones.pair_zones import portions

WITHIN_SUN = "within_sun_limit"
KEPT = {"clear": "clear", "sun": WITHIN_SUN}  # columns by requirement
PAIRS_AT_ONCE = 100_000  # number of pairs in a chunk; some megabytes


@dataclass(frozen=True, eq=False)
class LockCases(Cases):
    """Cases with a row for each pair (P, 2) of craft, done when the last pair has locked.

    Columns: the state of the second relative to the first, `time_s` and `leg` of the lock, the same as
    `every_60_s_time_s` and `every_60_s_leg` for detection every 60 s, `clear`.
    """

    search: Search
    pairs: Any
    steps: tuple[float, ...]
    drawn: ClassVar = NAMES

    @classmethod
    def of(cls, scenario: Scenario, seed: int) -> Self:
        """Return the cases of a scenario that locks."""
        steps = scenario.study.sampled if scenario.study is not None else ()
        return cls(scenario, seed, scenario.plan, scenario.opposite, steps)

    @property
    def at_once(self) -> int:
        """Greatest number of cases in a chunk."""
        return max(1, PAIRS_AT_ONCE // len(self.pairs))

    @property
    def watched(self) -> bool:
        """True if any craft keeps a zone."""
        return any(zone is not None for zone in self.scenario.keep_out)

    def fly(self, first: int, last: int) -> Columns:
        """Return the first locks of all A-B pairs in some cases."""
        states = drawn(self.scenario, self.seed, first, last)
        moves = apart(self.scenario, states, self.pairs, first).reshape(-1, 6)
        craft = searching(self.scenario, self.seed, first, last)
        errors = None if craft is None else between(craft, self.pairs)
        found = lock_times(self.search, moves[:, :3], moves[:, 3:], errors)
        columns = dict(zip(NAMES, moves.T, strict=True)) | {"time_s": found.time, "leg": found.leg}
        for step in self.steps:
            time, leg = sampled_times(self.search, moves[:, :3], moves[:, 3:], step)
            columns |= dict(zip(sampled_names(step), (time, leg), strict=True))
        if self.watched:
            clear = coasts_clear(self.scenario, states, self.search.duration)
            columns["clear"] = np.repeat(clear, len(self.pairs))
        sun = within_sun_limit(self.scenario, self.search, craft, last - first)
        return columns | {name: np.repeat(kept, len(self.pairs)) for name, kept in sun.items()}

    def good(self, columns: Columns) -> Any:
        """Return the cases in which all pairs lock and all requirements are met."""
        kept = [columns[name][:: len(self.pairs)] for name in KEPT.values() if name in columns]
        return np.all([(columns["leg"].reshape(-1, len(self.pairs)) >= 0).all(axis=1), *kept], axis=0)

    def stored(self, first: int, last: int, columns: Columns) -> Columns:
        """Return a row for each case and pair."""
        one, other = (np.tile(self.pairs[:, k], last - first) for k in (0, 1))
        return {
            "case": np.repeat(np.arange(first, last), len(self.pairs)),
            "first": named(self.scenario.names, one),
            "second": named(self.scenario.names, other),
            **columns,
            **ended(self.search, columns["leg"]),
        }

    def campaign(self, chunks: CaseChunks) -> LockCampaign:
        """Return the statistics of the cases."""
        return LockCampaign(self, chunks)


@dataclass(frozen=True, eq=False)
class SampledLocks:
    """Times (C,) [s] and legs (C,) of the locks of C cases for a simulation that detects every `step` [s]."""

    step: float
    time: Floats
    leg: Any


@dataclass(frozen=True, eq=False, repr=False)
class LockCampaign(Campaign):
    """Statistics of first locks of all A-B pairs; a case is done when its last pair has locked.

    `pairs` (P, 2) of craft; `pair_time` (C, P) [s], nan without a lock, and `pair_leg` (C, P), then -1;
    `sampled`: the same for detection at samples, with the steps of the scenario's [study].
    """

    kind: LockCases
    done: ClassVar[str] = "locked"

    @property
    def wanted(self) -> tuple[str, ...]:
        """Columns with the outcome of a case."""
        return (
            "time_s",
            "leg",
            *KEPT.values(),
            *(name for step in self.kind.steps for name in sampled_names(step)),
        )

    @property
    def pairs(self) -> Any:
        """Pairs (P, 2) of craft."""
        return self.kind.pairs

    def settled(self, columns: Columns) -> Settled:
        """Return time and leg at which the last pair of each case has locked; nan and -1 unless all have."""
        pairs = len(self.pairs)
        time, leg = last_of(columns["time_s"], columns["leg"], pairs)
        kept = {what: columns[name][::pairs] for what, name in KEPT.items() if name in columns}
        names = {step: sampled_names(step) for step in self.kind.steps}
        sampled = {
            step: last_of(columns[when], columns[where], pairs) for step, (when, where) in names.items()
        }
        return Settled(time, leg, kept, sampled, columns["time_s"])

    @cached_property
    def _pairs(self) -> tuple[Floats, Any]:
        parts = [part for _, part in self.chunks.read("time_s", "leg")]
        time, leg = (np.concatenate([part[name] for part in parts]) for name in ("time_s", "leg"))
        return time.reshape(-1, len(self.pairs)), leg.reshape(-1, len(self.pairs))

    @property
    def pair_time(self) -> Floats:
        """Lock time of each pair (C, P) [s]."""
        return self._pairs[0]

    @property
    def pair_leg(self) -> Any:
        """Leg of the lock of each pair (C, P)."""
        return self._pairs[1]

    @property
    def sampled(self) -> tuple[SampledLocks, ...]:
        """Locks for detection at samples."""
        return tuple(SampledLocks(step, *found) for step, found in self._settled.sampled.items())


def last_of(time: Floats, leg: Any, pairs: int) -> tuple[Floats, Any]:
    """Return the time and leg at which the last of `pairs` pairs of each case has locked; else nan and -1."""
    if pairs == 1:
        return time, leg
    time, leg = time.reshape(-1, pairs), leg.reshape(-1, pairs)
    return time.max(axis=1), np.where((leg < 0).any(axis=1), -1, leg.max(axis=1))


def sampled_names(step: float) -> tuple[str, str]:
    """Return the columns of time and leg for detection every `step` [s]."""
    return f"every_{step:g}_s_time_s", f"every_{step:g}_s_leg"


def apart(scenario: Scenario, states: Floats, pairs: Any, first: int) -> Floats:
    """Return states (C, P, 6) of the second craft of each pair relative to the first.

    Raises ScenarioError if two craft start at the same position.
    """
    moves = np.asarray(states[:, pairs[:, 1]] - states[:, pairs[:, 0]])
    same = (moves[..., :3] == 0.0).all(axis=-1)
    if same.any():
        case, pair = np.argwhere(same)[0]
        one, other = (scenario.names[k] for k in pairs[pair])
        line = f"{one} and {other} start at the same position in case {first + case}; vary their positions"
        raise ScenarioError(scenario.file, [f"study.vary: {line}"])
    return moves


def coasts_clear(scenario: Scenario, states: Floats, duration: float) -> Any:
    """Return in which cases (C,) no two craft that coast from states (C, N, 6) enter each other's zone."""
    paths = scenario.orbit.build().coast(states, duration)
    clear = np.ones(len(states), dtype=bool)
    for zone, first, second in portions(scenario.zones):
        near = closest_approach(paths[:, first], paths[:, second], zone)
        clear &= (np.asarray(near.ratio) > 1.0).all(axis=1)
    return clear


def within_sun_limit(scenario: Scenario, search: Search, errors: SearchErrors | None, cases: int) -> Columns:
    """Return in which cases all craft keep the sun limit, as a column; empty without pointing errors."""
    wrong = "craft.pointing_error" in varied(scenario) or np.any(scenario.given("craft.pointing_error"))
    if errors is None or not wrong:
        return {}
    turns = OwnTurns(search, scenario.groups, of_each(errors, (cases, len(scenario.craft))))
    return {WITHIN_SUN: (turns.sun_angles <= search.sun_limit + ROUNDING).all(axis=-1)}
