"""Cases that search in deep space: first locks of all A-B pairs, and gatherings; and their statistics."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import compress
from typing import Any, ClassVar, Self

import numpy as np

from closeform.arrays import Floats
from closeform.campaign.cases import CaseChunks, Cases, Columns, Quantity, Statistics
from closeform.campaign.draws import drawn, failures, lost_by, searching, varied
from closeform.campaign.spread import Spread
from closeform.confidence import Estimate, estimate
from closeform.conflicts.two_paths import closest_approach
from closeform.mission.verdict import ROUNDING
from closeform.planning.limits import FULL, propellant
from closeform.scenario import Gather, Scenario, ScenarioError
from closeform.scenario.study import FAILS
from closeform.search.gathering.gather import gather_cases, gather_cases_with_losses
from closeform.search.gathering.result import Gatherings
from closeform.search.lock_statistics import NEVER, count_by_phase, phase_index, phase_labels
from closeform.search.lock_times import lock_times
from closeform.search.repeated_search import repeated_search
from closeform.search.schedule import Search
from closeform.search.search_errors import SearchErrors, errors_of_each, errors_of_pairs
from closeform.search.slew_profile import ExecutedTurns
from closeform.zones.pair_zones import portions

PAIRS_AT_ONCE = 100_000  # number of pairs in a chunk of locks; some megabytes
GATHERINGS_AT_ONCE = 8192  # number of gatherings in a chunk
LATER = "time, not at once [s]"
STATE = ("x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s")  # columns of a relative state
KEPT = {  # columns of clearances and limits, by requirement
    "clear": "clear",
    "delta-v": "delta_v_kept",
    "propellant": "propellant_kept",
    "thrust": "none_adrift",
    "sun": "within_sun_limit",
}
WORDS = {
    "clear": "clear",
    "delta-v": "within delta_v_budget",
    "propellant": "within propellant",
    "thrust": "without craft adrift",
    "sun": "within the sun limit",
}
CAUSES = {  # columns of delta-v other than for joining, with their labels
    "corrections_m_s": "on corrections against collisions",
    "near_field_m_s": "in the near-field search",
}


MEASURED = {  # columns of the largest final errors within the formation set, with their labels
    "residual_speed_m_s": "residual speed in the formation set [m/s]",
    "position_error_m": "error of an estimated position [m]",
}


def _by_bearing(scenario: Scenario) -> bool:
    """Return True if hemisphere antennas assign the groups of each case."""
    return scenario.search is not None and scenario.search.bearing


@dataclass(frozen=True, eq=False)
class SearchCases(Cases):
    """Cases of a `search`, which covers all rounds; each has the same number of `rows`."""

    search: Search
    unfinished: ClassVar = ("done",)

    @property
    def rows(self) -> int:
        """Number of rows of a case."""
        return 1

    @abstractmethod
    def ended(self, columns: Columns) -> tuple[Floats, Any]:
        """Return the time [s] and the leg in which each case (C,) was done; nan and -1 if it never was."""

    def met(self, columns: Columns) -> dict[str, Any]:
        """Return the cases (C,) that are done, and in which each clearance and limit is kept."""
        kept = {what: columns[name][:: self.rows] for what, name in KEPT.items() if name in columns}
        return {"done": self.ended(columns)[1] >= 0, **kept}

    def quantities(self) -> dict[str, Quantity]:
        """Return the times [s] of the cases done, and of those not done at once."""

        def later(columns: Columns) -> Floats:
            time = self.ended(columns)[0]
            return np.where(time > 0.0, time, np.nan)

        return {"time [s]": lambda columns: self.ended(columns)[0], LATER: later}

    def phases(self, leg: Any) -> dict[str, Any]:
        """Return the columns of phase, round and leg; null for an absent leg."""
        import pyarrow

        phases = list(dict.fromkeys(one.phase for one in self.search.legs))
        phase = np.array([phases.index(one.phase) for one in self.search.legs] + [-1])
        rounds = np.array([one.round for one in self.search.legs] + [0], dtype=np.int16)
        return {
            "phase": named(phases, phase[leg]),
            "round": pyarrow.array(rounds[leg], mask=leg < 0),
            "leg": pyarrow.array(leg, mask=leg < 0),
        }

    def states(self, first: int, last: int, pairs: Any) -> tuple[Floats, Floats]:
        """Return states (C, N, 6), and those (C, P, 6) of the second craft of pairs relative to the first.

        Raises ScenarioError if two craft start at the same position.
        """
        states = drawn(self.scenario, self.seed, first, last)
        moves = np.asarray(states[:, pairs[:, 1]] - states[:, pairs[:, 0]])
        same = (moves[..., :3] == 0.0).all(axis=-1)
        if same.any():
            case, pair = np.argwhere(same)[0]
            one, other = (self.scenario.names[k] for k in pairs[pair])
            line = f"{one} and {other} start at the same position in case {first + case}"
            raise ScenarioError(self.scenario.file, [f"study.vary: {line}; vary their positions"])
        return states, moves

    def within_sun_limit(self, errors: SearchErrors | None, cases: int) -> dict[str, Any]:
        """Return a mask of the cases that keep the sun limit; empty without pointing errors."""
        key = "craft.pointing_error"
        if errors is None or not (key in varied(self.scenario) or np.any(self.scenario.given(key))):
            return {}
        each = errors_of_each(errors, (cases, len(self.scenario.craft)))
        angles = ExecutedTurns(self.search, self.scenario.groups, each).sun_angles
        kept = (angles <= self.search.sun_limit + ROUNDING).all(axis=-1)
        return {KEPT["sun"]: np.repeat(kept, self.rows)}


@dataclass(frozen=True, eq=False)
class LockCases(SearchCases):
    """Cases with a row for each pair (P, 2) of craft, one in A and one in B, done when all pairs have locked.

    Columns: the state of the second relative to the first, `time_s` and `leg` of the lock, the same as
    `every_60_s_time_s` and `every_60_s_leg` for detection every 60 s, `clear`.
    """

    pairs: Any
    steps: tuple[float, ...]
    failures: ClassVar = {"done": "not locked", **{what: f"not {words}" for what, words in WORDS.items()}}
    drawn: ClassVar = STATE

    @classmethod
    def of(cls, scenario: Scenario, seed: int) -> Self:
        """Return the cases of a scenario that locks."""
        steps = scenario.study.sampled if scenario.study is not None else ()
        pairs = np.array([[0, 1]]) if _by_bearing(scenario) else scenario.opposite
        return cls(scenario, seed, scenario.plan, pairs, steps)

    @property
    def rows(self) -> int:
        """Number of pairs."""
        return len(self.pairs)

    @property
    def numbers(self) -> int:
        """Number of lock times of a case: for each pair, one exact time and one for each sampling step."""
        return self.rows * (1 + len(self.steps))

    def chunk_size(self, count: int) -> int:
        """Return the number of cases in a chunk."""
        return max(1, PAIRS_AT_ONCE // self.rows)

    def evaluate(self, first: int, last: int) -> Columns:
        """Return the first locks of all pairs in the given cases."""
        states, moves = self.states(first, last, self.pairs)
        moves = moves.reshape(-1, 6)
        craft = searching(self.scenario, self.seed, first, last)
        errors = None if craft is None else errors_of_pairs(craft, self.pairs)
        pairs, bearing = (self.search, moves[:, :3], moves[:, 3:]), _by_bearing(self.scenario)
        found = lock_times(*pairs, errors, bearing=bearing)
        columns = dict(zip(STATE, moves.T, strict=True)) | {"time_s": found.time, "leg": found.leg}
        for step in self.steps:
            late = lock_times(*pairs, errors, step, bearing)
            columns |= dict(zip(lock_columns(step), (late.time, late.leg), strict=True))
        if any(zone is not None for zone in self.scenario.keep_out):
            clear = coasts_clear(self.scenario, states, self.search.duration)
            columns["clear"] = np.repeat(clear, self.rows)
        return columns | self.within_sun_limit(craft, last - first)

    def ended(self, columns: Columns, step: float | None = None) -> tuple[Floats, Any]:
        """Return time [s] and leg in which the last pair of each case locked; nan and -1 unless all did.

        With `step`, locks are detected only every `step` [s].
        """
        time, leg = (columns[name].reshape(-1, self.rows) for name in lock_columns(step))
        return time.max(axis=1), np.where((leg < 0).any(axis=1), -1, leg.max(axis=1))

    def stored(self, first: int, last: int, columns: Columns) -> dict[str, Any]:
        """Return a row for each case and pair."""
        one, other = (np.tile(self.pairs[:, k], last - first) for k in (0, 1))
        return {
            "case": np.repeat(np.arange(first, last), self.rows),
            "first": named(self.scenario.names, one),
            "second": named(self.scenario.names, other),
            **columns,
            **self.phases(columns["leg"]),
        }

    def campaign(self, chunks: CaseChunks) -> LockCampaign:
        """Return the statistics of the cases."""
        return LockCampaign(self, chunks)


@dataclass(frozen=True, eq=False)
class GatherCases(SearchCases):
    """Cases of gatherings with a row each, done when one formation set holds all craft.

    Columns: `duration_s`, `leg`, `rounds`, `left`, `delta_v_m_s`, the numbers of conflicts, and each
    requirement. Further columns, where they apply: the delta-v of corrections and of the near-field search,
    the time of each loss of thrust, the number `adrift`, and the final errors of MEASURED.
    """

    stage: Gather
    failures: ClassVar = LockCases.failures | {"done": "not gathered"}

    @classmethod
    def of(cls, scenario: Scenario, seed: int) -> Self:
        """Return the cases of a scenario that gathers."""
        (stage,) = scenario.stages
        assert isinstance(stage, Gather)
        arguments = scenario.gathering(stage)
        search, _ = repeated_search(scenario.plan, arguments["rounds"], arguments["max_speed"])
        return cls(scenario, seed, search, stage)

    def chunk_size(self, count: int) -> int:
        """Return the number of cases in a chunk."""
        return GATHERINGS_AT_ONCE

    @property
    def causes(self) -> tuple[str, ...]:
        """Those of CAUSES that can occur."""
        near = any(leg.phase == "NFS" for leg in self.search.legs)
        return tuple(compress(CAUSES, (bool(self.scenario.zones.pairs), near)))

    @property
    def measured(self) -> Mapping[str, str]:
        """MEASURED if the sensor has measurement errors."""
        return {} if self.search.sensor._exact else MEASURED

    def evaluate(self, first: int, last: int) -> Columns:
        """Return the results of the gatherings of the given cases."""
        scenario = self.scenario
        pairs = np.stack(np.triu_indices(len(scenario.craft), 1), axis=1)
        states, _ = self.states(first, last, pairs)
        arguments = scenario.gathering(self.stage) | {"errors": searching(scenario, self.seed, first, last)}
        arguments |= {"seed": self.seed, "case": first}
        arguments |= {"groups": "bearing"} if _by_bearing(scenario) else {}
        begun, lost = (scenario.plan, states[..., :3], states[..., 3:]), {}
        if FAILS in varied(scenario):
            found, fails = gather_cases_with_losses(
                *begun, failures(scenario, self.seed, first, last), **arguments
            )
            lost = {lost_by(name): fails[:, k] for k, name in enumerate(scenario.names)}
            lost |= {"adrift": found.adrift}
        else:
            found = gather_cases(*begun, **arguments)
        return {
            "duration_s": np.where(found.leg < 0, np.nan, found.duration),
            "leg": found.leg,
            "rounds": found.rounds,
            "left": found.left,
            "delta_v_m_s": found.delta_v,
            **{name: found.columns()[name] for name in (*self.causes, *self.measured)},
            "met_unknown": found.met_unknown,
            "met_known": found.met_known,
            **lost,
            **{KEPT[what]: kept for what, kept in within_limits(scenario, found).items()},
            **self.within_sun_limit(arguments["errors"], last - first),
        }

    def ended(self, columns: Columns) -> tuple[Floats, Any]:
        """Return the time [s] and the leg in which each case ended."""
        return columns["duration_s"], columns["leg"]

    def quantities(self) -> dict[str, Quantity]:
        """Return the quantities of the study: times [s], delta-v [m/s], and errors left by measurements."""

        def left(name: str) -> Quantity:
            return lambda columns: np.where(columns["leg"] >= 0, columns[name], np.nan)

        errors = {label: left(name) for name, label in self.measured.items()}
        return super().quantities() | {"delta-v of all craft [m/s]": self.spent} | errors

    def spent(self, columns: Columns) -> Floats:
        """Return the delta-v of all craft [m/s] in the cases that are gathered."""
        return np.asarray(np.where(columns["leg"] >= 0, columns["delta_v_m_s"], np.nan))

    def costs(self, phases: Mapping[int, str]) -> dict[str, Quantity]:
        """Return the delta-v [m/s] by cause, and by phase of the end, given the labels of some."""

        def caused(name: str) -> Quantity:
            return lambda columns: np.where(columns["leg"] >= 0, columns[name], np.nan)

        def joining(columns: Columns) -> Floats:
            rest = self.spent(columns) - sum(columns[name] for name in self.causes)
            return np.asarray(np.maximum(rest, 0.0))  # rounding can make it negative

        def until(number: int) -> Quantity:
            return lambda columns: np.where(
                phase_index(self.search, *self.ended(columns)) == number, self.spent(columns), np.nan
            )

        return {
            **({"to join the formation set": joining} if self.causes else {}),
            **{CAUSES[name]: caused(name) for name in self.causes},
            **{f"gathered {'in ' * (number > 0)}{label}": until(number) for number, label in phases.items()},
        }

    def stored(self, first: int, last: int, columns: Columns) -> dict[str, Any]:
        """Return a row for each case, with its phase and round."""
        return super().stored(first, last, {**columns, **self.phases(columns["leg"])})

    def campaign(self, chunks: CaseChunks) -> GatherCampaign:
        """Return the statistics of the cases."""
        return GatherCampaign(self, chunks)


def named(names: Sequence[Any], which: Any) -> Any:
    """Return a column of names by index; a negative index gives null."""
    import pyarrow

    index = which.astype(np.int32)
    return pyarrow.DictionaryArray.from_arrays(pyarrow.array(index, mask=index < 0), pyarrow.array(names))


def lock_columns(step: float | None = None) -> tuple[str, str]:
    """Return the columns of time and leg of a lock, with `step` for detection every `step` [s]."""
    return ("time_s", "leg") if step is None else (f"every_{step:g}_s_time_s", f"every_{step:g}_s_leg")


def coasts_clear(scenario: Scenario, states: Floats, duration: float) -> Any:
    """Return a mask (C,) of the cases in which craft that coast from states (C, N, 6) have no conflict."""
    paths = scenario.orbit.build().coast(states, duration)
    clear = np.ones(len(states), dtype=bool)
    for zone, first, second in portions(scenario.zones):
        near = closest_approach(paths[:, first], paths[:, second], zone)
        clear &= (np.asarray(near.ratio) > 1.0).all(axis=1)
    return clear


def within_limits(scenario: Scenario, found: Gatherings) -> dict[str, Any]:
    """Return masks (C,) of the gatherings that keep each clearance and limit of the file."""
    kept: dict[str, Any] = {}
    if scenario.zones.pairs:
        kept["clear"] = found.met_unknown + found.met_known == 0
    if FAILS in varied(scenario):
        kept["thrust"] = found.adrift == 0
    for k, craft in enumerate(scenario.craft):
        spent = found.each_delta_v[:, k]
        if craft.delta_v_budget is not None:
            kept["delta-v"] = kept.get("delta-v", True) & (spent <= FULL * craft.delta_v_budget)
        if craft.propellant is not None and craft.mass is not None and craft.specific_impulse is not None:
            burnt = propellant(craft.mass, spent, craft.specific_impulse)
            kept["propellant"] = kept.get("propellant", True) & (burnt <= FULL * craft.propellant)
    return kept


@dataclass(frozen=True)
class Share:
    """Number of `cases` that ended in one phase, as a fraction `inside` it and, cumulatively, `by_end` of it.

    `label` is "at once" (at time 0), a phase and its round like "IPS 1", or "never".
    """

    label: str
    cases: int
    inside: Estimate
    by_end: Estimate | None  # None for "never"


def shares(search: Search, counts: Sequence[int]) -> tuple[Share, ...]:
    """Return the shares of cases by phase from their numbers; the last one counts cases never done."""
    every, ended, found = sum(counts), 0, []
    for label, count in zip(phase_labels(search), counts, strict=True):
        ended += count
        by_end = None if label == NEVER else estimate(ended, every)
        found.append(Share(label, count, estimate(count, every), by_end))
    return tuple(found)


@dataclass(frozen=True, eq=False, repr=False)
class Campaign(Statistics):
    """Statistics of C cases of a search, sampled with its seed.

    Arrays (C,) are read on request. `time` [s] is when the case was done, nan if it never was. `leg` is that
    of `search`, -1 if it never was. `kept` has a mask for each clearance and limit of the file: "clear" of
    keep-out zones, within the "delta-v" budget, within the "propellant" of each craft, with the "thrust" that
    each craft needs.
    """

    kind: Any
    done: ClassVar[str]  # the label of a case that is done
    _told: ClassVar = ("title", "seed", "time", "status", "reason")

    @property
    def search(self) -> Search:
        """Search in which the cases were done, over all rounds."""
        found: Search = self.kind.search
        return found

    @cached_property
    def _ended(self) -> tuple[Floats, Any]:
        time, leg = zip(*(self.kind.ended(part) for _, part in self.parts()), strict=True)
        return np.concatenate(time), np.concatenate(leg)

    @property
    def time(self) -> Floats:
        """Time at which each case was done [s]."""
        return self._ended[0]

    @property
    def leg(self) -> Any:
        """Leg in which each case was done."""
        return self._ended[1]

    @property
    def kept(self) -> dict[str, Any]:
        """Cases in which each clearance and limit is kept."""
        return {what: met for what, met in self.met.items() if what != "done"}

    @property
    def failed(self) -> Any:
        """Numbers (F,) of the cases that were never done."""
        return np.flatnonzero(self.leg < 0)

    def requirement_label(self, what: str) -> str:
        """Return a requirement as text."""
        return WORDS.get(what, self.done)

    @property
    def times(self) -> Iterator[Floats]:
        """Times of the events of a histogram [s], chunk after chunk: of each pair, or of each case."""
        name = "time_s" if isinstance(self.kind, LockCases) else "duration_s"
        return (part[name] for _, part in self.parts())

    @cached_property
    def costs(self) -> dict[str, Spread]:
        """Spreads of the delta-v [m/s] up to the end of a gathering, by cause and phase."""
        return {}

    @cached_property
    def shares(self) -> tuple[Share, ...]:
        """Shares of cases done at once, in each phase, and never, with confidence intervals."""
        counts = self.total(lambda part: np.array(count_by_phase(self.search, *self.kind.ended(part))))
        return shares(self.search, counts.tolist())


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
    done: ClassVar = "locked"

    @property
    def pairs(self) -> Any:
        """Pairs (P, 2) of craft."""
        return self.kind.pairs

    @cached_property
    def pair_time(self) -> Floats:
        """Lock time of each pair (C, P) [s]."""
        return np.asarray(self.column("time_s").reshape(-1, self.kind.rows))

    @cached_property
    def pair_leg(self) -> Any:
        """Leg of the lock of each pair (C, P)."""
        return self.column("leg").reshape(-1, self.kind.rows)

    @property
    def sampled(self) -> tuple[SampledLocks, ...]:
        """Locks for detection at samples."""
        found = []
        for step in self.kind.steps:
            each = [self.kind.ended(part, step) for _, part in self.parts()]
            found.append(SampledLocks(step, *map(np.concatenate, zip(*each, strict=True))))
        return tuple(found)

    def detected(self, step: float) -> tuple[list[int], int]:
        """Return the cases by phase for detection every `step` [s], and those that miss their first lock."""

        def counts(part: Columns) -> Any:
            time, leg = self.kind.ended(part)
            later, late = self.kind.ended(part, step)
            over = (late < 0) & (leg >= 0) | (later - time > step)
            return np.array([*count_by_phase(self.search, later, late), over.sum()])

        *phases, over = self.total(counts).tolist()
        return phases, over


@dataclass(frozen=True, eq=False, repr=False)
class GatherCampaign(Campaign):
    """Statistics of gatherings, each done when one formation set holds all craft.

    `rounds` (C,): searches begun; `left` (C,): craft not in the formation set; `delta_v` (C,) of all craft
    together [m/s]; `met_unknown` (C,): pairs with a conflict before they knew each other; `met_known` (C,):
    pairs with conflicts only after that.
    """

    kind: GatherCases
    done: ClassVar = "gathered"

    @cached_property
    def costs(self) -> dict[str, Spread]:
        """Spreads of the delta-v [m/s] up to the end of the gathering, by cause and phase."""
        phases = {number: share.label for number, share in enumerate(self.shares[:-1]) if share.cases}
        return self.each_spread(self.kind.costs(phases))

    rounds = property(lambda self: self.column("rounds"), doc="Number of searches started.")
    left = property(lambda self: self.column("left"), doc="Number of craft not in the formation set.")
    delta_v = property(lambda self: self.column("delta_v_m_s"), doc="Delta-v of all craft together [m/s].")
    met_unknown = property(lambda self: self.column("met_unknown"), doc="Conflicts of pairs without a lock.")
    met_known = property(lambda self: self.column("met_known"), doc="Conflicts of pairs after a lock.")

    def conflicts(self, column: str) -> tuple[int, int]:
        """Return the numbers of cases and of pairs with a conflict: `met_unknown` or `met_known`."""
        cases, pairs = self.total(lambda part: np.array([(part[column] > 0).sum(), part[column].sum()]))
        return int(cases), int(pairs)
