"""Gathering: what became of lost craft that searched, locked and joined."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from math import inf
from typing import Any

import numpy as np

from closeform.arrays import Floats, instance, number
from closeform.conflicts.all_pairs import screen
from closeform.conflicts.two_paths import PairConflict
from closeform.motion.path import Path
from closeform.search.schedule import Group, Search
from closeform.search.sets import LOST
from closeform.zones.pair_zones import PairZones


class EventKind(StrEnum):
    """What happened.

    - `LOCK`: two craft see each other and know where they are; the sets of both become one.
    - `BURN`: a craft nulls its velocity relative to the formation set, which it joins.
    - `CORRECTION`: a craft burns against a collision in its set; what is left: `Gathering.conflicts`.
    - `NEAR_FIELD`: a lost craft burns against its boresight, out of the region that no cone covers.
    """

    LOCK = "lock"
    BURN = "burn"
    CORRECTION = "correction"
    NEAR_FIELD = "near field"


class GatherStatus(StrEnum):
    """How a gathering ended.

    - `GATHERED`: all craft are in the formation set.
    - `INCOMPLETE`: some are still lost after all rounds; allow more `rounds`, or look at the sensor's reach.
    """

    GATHERED = "gathered"
    INCOMPLETE = "incomplete"


@dataclass(frozen=True, eq=False)
class Event:
    """A lock of craft `first` and `second`, or a burn of `first` (then `second` is -1), at `time` [s].

    `kind` tells which.  `phase` and `round` are those of the search; `case` is the lock's number
    in H03's table of joins (1 to 9; 0 for burns); `label` the set after it: 0 the formation set,
    k >= 1 knowledge set k, -1 lost.  A burn joins the formation set, or is a correction against a
    collision inside a set, or the near-field search's; `delta_v` (3,) [m/s].  A craft that need
    not change its velocity joins without one.
    """

    time: float
    kind: EventKind
    first: int
    second: int
    phase: str
    round: int
    case: int
    label: int
    delta_v: Floats


@dataclass(frozen=True, eq=False)
class Gathering:
    """What became of N lost craft.

    `search`: over all rounds, with the near-field search, its boresights hold to the end;
    `groups`: "A" or "B" of each; `paths`: shape (N,), burns as impulses; `events` in order of
    time; `delta_v` (N,) [m/s]; `totals`: total delta-v [m/s] of the three ways in which the first
    pair can burn, of which `burns` was flown; `sets`: the formation set first, if there is one,
    then knowledge sets; `lost`: craft in none; `duration` [s] until gathered, or of all rounds;
    `rounds`: searches begun; `keep_out`: the zones of pairs, if any.  `status`, and `reason`: who is left
    and why, None if gathered.
    """

    search: Search
    groups: tuple[Group, ...]
    paths: Path
    events: tuple[Event, ...]
    delta_v: Floats
    totals: dict[str, float]
    burns: str
    sets: tuple[tuple[int, ...], ...]
    lost: tuple[int, ...]
    duration: float
    rounds: int
    status: GatherStatus
    reason: str | None
    keep_out: PairZones | None = field(repr=False)

    @property
    def ok(self) -> bool:
        """Whether one formation set holds all craft."""
        return self.status is GatherStatus.GATHERED

    @cached_property
    def conflicts(self) -> tuple[PairConflict, ...]:
        """Every conflict of two craft, by index, whether or not they were `known` to each other.

        Empty without a `keep_out`.  Only craft of one set can avoid each other.
        """
        return () if self.keep_out is None else screen(self.paths, self.keep_out).conflicts

    @cached_property
    def history(self) -> Any:
        """The label of each craft before the first event and after each one: (E + 1, N)."""
        rows = np.full((len(self.events) + 1, len(self.groups)), LOST)
        for k, event in enumerate(self.events):
            rows[k + 1] = rows[k]
            if event.kind is EventKind.LOCK:
                rows[k + 1, self._sets_of(event, rows[k])] = event.label
        return rows

    def _sets_of(self, event: Event, labels: Any) -> Any:
        """Which craft (N,) are in the set of one of the two that lock, by the labels before."""
        pair = [event.first, event.second]
        joined = np.isin(labels, labels[pair]) & (labels != LOST)
        joined[pair] = True
        return joined

    @cached_property
    def _acquainted(self) -> Floats:
        """When each two craft came into one set (N, N) [s]; inf if never."""
        times = np.full((len(self.groups),) * 2, inf)
        for event, labels in zip(self.events, self.history, strict=False):
            if event.kind is EventKind.LOCK:
                known = np.flatnonzero(self._sets_of(event, labels))
                times[np.ix_(known, known)] = np.minimum(times[np.ix_(known, known)], event.time)
        return times

    def acquainted(self, first: int, second: int) -> float:
        """When craft `first` and `second`, given by index, came into one set [s]; inf if never.

        Raises IndexError for a craft that is not there.
        """
        for name, craft in (("first", first), ("second", second)):
            instance(name, craft, int, np.integer)
            if not -len(self.groups) <= craft < len(self.groups):
                raise IndexError(f"{name}: there is no craft {craft} among {len(self.groups)}")
        return float(self._acquainted[first, second])

    def known(self, first: int, second: int, time: float) -> bool:
        """Whether craft `first` and `second`, given by index, knew each other before a `time` [s].

        Raises IndexError for a craft that is not there.
        """
        return self.acquainted(first, second) < number("time", time)


@dataclass(frozen=True, eq=False)
class Gatherings:
    """What became of C gatherings, arrays (C,).

    `duration` [s] until gathered, or of all rounds; `leg` of `search` in which they ended, -1 if
    incomplete; `rounds`: searches begun; `left`: craft not in the formation set; `delta_v` of all
    craft together [m/s], `each_delta_v` (C, N) of each; `met_unknown`: pairs that came within the
    keep-out zone before they knew each other; `met_known`: those that did so only after.
    """

    search: Search
    duration: Floats
    leg: Any
    rounds: Any
    left: Any
    delta_v: Floats
    each_delta_v: Floats
    met_unknown: Any
    met_known: Any

    def __len__(self) -> int:
        return len(self.duration)


def who_is_left(
    sets: tuple[tuple[int, ...], ...], lost: tuple[int, ...], rounds: int, names: Sequence[str] | None = None
) -> str:
    """Who is not in the formation set after `rounds`, and why; craft by index, or by their `names`."""

    def told(some: tuple[int, ...]) -> str:
        return listed([names[k] if names is not None else str(k) for k in some])

    lines = []
    if lost:
        lines.append(f"craft {told(lost)} locked nobody")
    lines += [f"craft {told(some)} know each other but met nobody of the formation set" for some in sets[1:]]
    return "; ".join(lines) + f" in {rounds} round{'s' * (rounds > 1)}"


def listed(names: Sequence[str]) -> str:
    """Names as one says them: A, B and C."""
    return names[0] if len(names) == 1 else ", ".join(names[:-1]) + f" and {names[-1]}"
