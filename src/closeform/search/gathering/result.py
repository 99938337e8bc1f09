"""Results of gatherings: the events, sets and paths of lost craft that searched, locked and joined."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from math import inf
from typing import Any, ClassVar

import numpy as np

from closeform.arrays import Floats, instance, number
from closeform.conflicts.all_pairs import screen
from closeform.conflicts.two_paths import PairConflict
from closeform.motion.path import Path
from closeform.result import Result, Rows
from closeform.search.gathering.join_rule import LOST
from closeform.search.leg import Group
from closeform.search.schedule import Search
from closeform.search.search_errors import SearchErrors
from closeform.zones.pair_zones import PairZones


class EventKind(StrEnum):
    """Kind of an event.

    - `LOCK`: two craft see each other and know their relative motion; their sets become one.
    - `BURN`: a craft nulls its velocity relative to the formation set, which it joins.
    - `CORRECTION`: a craft avoids a collision in its set; `Gathering.conflicts` holds the remaining ones.
    - `NEAR_FIELD`: a lost craft burns against its boresight, to leave the region that no cone covers.
    """

    LOCK = "lock"
    BURN = "burn"
    CORRECTION = "correction"
    NEAR_FIELD = "near field"


class GatherStatus(StrEnum):
    """Status of a gathering.

    - `GATHERED`: all craft are in the formation set.
    - `ADRIFT`: it holds them all, but some lost their thrust before they could join: only in studies.
    - `INCOMPLETE`: some are still lost after all rounds; allow more `rounds`, or check the sensor's range.
    """

    GATHERED = "gathered"
    ADRIFT = "adrift"
    INCOMPLETE = "incomplete"


@dataclass(frozen=True, eq=False, repr=False)
class Event(Result):
    """Lock of two craft, or burn of one.

    A burn joins the formation set, is a correction against a collision within a set, or belongs to the
    near-field search. A craft that need not change its velocity joins without a burn.

    Attributes
    ----------
    time : float [s]
        Time from the start of the search.
    kind : EventKind
        Kind of the event.
    first, second : int
        Indices of the two that lock; for a burn the craft that burns, and -1.
    phase : str
        Phase of the search.
    round : int
        Round of the search, from 1.
    case : int
        The lock's number in H03's table of joins, 1 to 9; 0 for burns.
    label : int
        The set after the event: 0 the formation set, k >= 1 knowledge set k, -1 lost.
    delta_v : array of shape (3,) [m/s]
        Delta-v of the burn, in the inertial frame.
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


@dataclass(frozen=True, eq=False, repr=False)
class Gathering(Result):
    """Result of a gathering of N lost craft.

    Attributes
    ----------
    search : Search
        The search over all rounds, with the near-field search.
    groups : tuple of "A" or "B"
        Group of each craft.
    paths : Path
        Paths of shape (N,), with burns as impulses.
    events : tuple of Event
        Events in order of time.
    known_locks : tuple of Event
        First locks of two craft that already were in one set, which join nothing, until the gathering ends.
    delta_v : array of shape (N,) [m/s]
        Delta-v of each craft.
    totals : dict of str to float [m/s]
        Total delta-v of the three choices of burns of the first pair, without burn errors.
    burns : str
        The choice that was executed, or planned in a case of a study with burn errors.
    sets : tuple of tuple of int
        Members by index: the formation set first, if there is one, then knowledge sets.
    lost : tuple of int
        Craft in no set.
    duration : float [s]
        Time until gathered, or of all rounds.
    rounds : int
        Number of searches started.
    status : GatherStatus
        Status of the gathering.
    reason : str or None
        The craft not gathered and why; None if gathered.
    keep_out : PairZones or None
        Keep-out zones of pairs.
    errors : SearchErrors or None
        Search errors of the craft (N,), as given.
    adrift : tuple of int
        Craft of the formation set without the thrust to match its velocity, in a case of a study.
    estimates : array of shape (N, 6) [m, m/s]
        Error of each craft's estimated state at the end, in the inertial frame, relative to a reference that
        its set shares: zero for a sensor without measurement errors.
    """

    search: Search
    groups: tuple[Group, ...]
    paths: Path
    events: tuple[Event, ...]
    known_locks: tuple[Event, ...]
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
    errors: SearchErrors | None = field(repr=False)
    adrift: tuple[int, ...]
    estimates: Floats = field(repr=False)

    @property
    def ok(self) -> bool:
        """True if one formation set holds all craft, and all of them have matched its velocity."""
        return self.status is GatherStatus.GATHERED

    @cached_property
    def conflicts(self) -> tuple[PairConflict, ...]:
        """Conflicts of all pairs, by index, whether or not they were `known` to each other.

        Empty without a `keep_out`. Only craft of one set can avoid each other.
        """
        return () if self.keep_out is None else screen(self.paths, self.keep_out).conflicts

    def columns(self) -> dict[str, Any]:
        """Return the events as columns, for a data frame of pandas, polars or pyarrow.

        Returns
        -------
        dict of str to array of shape (E,) [s, m/s, or no unit, as the names say]
            One row for each event, in order of time; craft by index, the second of a burn is -1.

        References
        ----------
        docs/results.md.
        """
        pushes = np.array([event.delta_v for event in self.events]).reshape(-1, 3)
        names = ("kind", "first", "second", "phase", "round", "case", "label")
        labels = {name: np.array([getattr(event, name) for event in self.events]) for name in names}
        times = np.array([event.time for event in self.events], dtype=float)
        return {
            "time_s": times,
            **labels,
            **dict(zip(("dvx_m_s", "dvy_m_s", "dvz_m_s"), pushes.T, strict=True)),
        }

    @property
    def join_table(self) -> Any:
        """Number of locks in each of H03's nine cases (3, 3), no unit, with those within a set.

        The rows are the set of the one before the lock, the columns that of the other: lost, knowledge,
        formation.
        """
        cases = [event.case for event in (*self.events, *self.known_locks) if event.kind is EventKind.LOCK]
        return np.bincount(cases, minlength=10)[1:].reshape(3, 3)

    @property
    def residual_speeds(self) -> Floats:
        """Final speed of each craft relative to the mean of the formation set (N,) [m/s]; nan outside of it.

        Exact measurements and burns leave none.
        """
        return self._from_mean(self.paths.velocity(self.duration))

    @property
    def position_errors(self) -> Floats:
        """Final error of each estimated position, relative to the mean error of the formation set (N,) [m].

        It is nan outside of the set, and grows with the residual velocity from the lock on.
        """
        return self._from_mean(self.estimates[:, :3])

    def _from_mean(self, vectors: Floats) -> Floats:
        """Return the distance of each vector (N, 3) from the mean of the formation set; nan outside of it."""
        inside = np.zeros(len(self.groups), dtype=bool)
        inside[list(self.sets[0]) if self.sets else []] = True
        mean = vectors[inside].mean(axis=0) if self.sets else np.zeros(3)
        return np.where(inside, np.linalg.norm(vectors - mean, axis=1), np.nan)

    @cached_property
    def history(self) -> Any:
        """Label of each craft before the first event and after each, (E + 1, N), no unit; see `Event`."""
        rows = np.full((len(self.events) + 1, len(self.groups)), LOST)
        for k, event in enumerate(self.events):
            rows[k + 1] = rows[k]
            if event.kind is EventKind.LOCK:
                rows[k + 1, self._sets_of(event, rows[k])] = event.label
        return rows

    def _sets_of(self, event: Event, labels: Any) -> Any:
        """Return which craft (N,) are in the set of either of the two that lock, by the labels before."""
        pair = [event.first, event.second]
        joined = np.isin(labels, labels[pair]) & (labels != LOST)
        joined[pair] = True
        return joined

    @cached_property
    def _acquainted(self) -> Floats:
        """Time at which each pair of craft came into one set (N, N) [s]; inf if never."""
        times = np.full((len(self.groups),) * 2, inf)
        for event, labels in zip(self.events, self.history, strict=False):
            if event.kind is EventKind.LOCK:
                known = np.flatnonzero(self._sets_of(event, labels))
                times[np.ix_(known, known)] = np.minimum(times[np.ix_(known, known)], event.time)
        return times

    def acquainted(self, first: int, second: int) -> float:
        """Return the time at which two craft first belonged to the same set.

        Parameters
        ----------
        first, second : int
            Indices of the craft.

        Returns
        -------
        float [s]
            Time from the start of the search; inf if never.

        Raises
        ------
        ValueError
            If `first` or `second` is not a whole number.
        IndexError
            If there is no such craft.

        References
        ----------
        H03 (Hadaegh, Scharf and Ploen 2003) section IV.
        """
        for name, craft in (("first", first), ("second", second)):
            instance(name, craft, int, np.integer)
            if not -len(self.groups) <= craft < len(self.groups):
                raise IndexError(f"{name}: there is no craft {craft} among {len(self.groups)}")
        return float(self._acquainted[first, second])

    def known(self, first: int, second: int, time: float) -> bool:
        """Return True if two craft knew each other before a time.

        Parameters
        ----------
        first, second : int
            Indices of the craft.
        time : float [s]
            Time from the start of the search.

        Returns
        -------
        bool
            True if they came into one set before that time.

        Raises
        ------
        ValueError
            If `first` or `second` is not a whole number, or `time` is not one number.
        IndexError
            If there is no such craft.

        References
        ----------
        H03 (Hadaegh, Scharf and Ploen 2003) section IV.
        """
        return self.acquainted(first, second) < number("time", time)


@dataclass(frozen=True, eq=False, repr=False)
class Gatherings(Rows):
    """Results of C gatherings of N craft.

    Attributes
    ----------
    search : Search
        The search over all rounds, with the near-field search.
    duration : array of shape (C,) [s]
        Time until gathered, or of all rounds.
    leg : array of int of shape (C,)
        Leg of `search` in which they ended; -1 if incomplete.
    rounds : array of int of shape (C,)
        Number of searches started.
    left : array of int of shape (C,)
        Number of craft not in the formation set.
    delta_v : array of shape (C,) [m/s]
        Delta-v of all craft together.
    corrections, near_field : array of shape (C,) [m/s]
        Its parts for corrections against collisions and in the near-field search; the rest joins craft.
    each_delta_v : array of shape (C, N) [m/s]
        Delta-v of each craft.
    met_unknown : array of int of shape (C,)
        Number of pairs that entered their keep-out zone before they knew each other.
    met_known : array of int of shape (C,)
        Number of pairs that did so only after.
    adrift : array of int of shape (C,)
        Number of craft of the formation set without the thrust to match its velocity, in a study.
    residual_speed : array of shape (C,) [m/s]
        Largest final speed of a craft relative to the mean of the formation set.
    position_error : array of shape (C,) [m]
        Largest final error of an estimated position, relative to the mean error of the formation set.
    """

    _columns: ClassVar = {
        "duration": "duration_s",
        "leg": "leg",
        "rounds": "rounds",
        "left": "left",
        "delta_v": "delta_v_m_s",
        "corrections": "corrections_m_s",
        "near_field": "near_field_m_s",
        "met_unknown": "met_unknown",
        "met_known": "met_known",
        "adrift": "adrift",
        "residual_speed": "residual_speed_m_s",
        "position_error": "position_error_m",
    }

    search: Search
    duration: Floats
    leg: Any
    rounds: Any
    left: Any
    delta_v: Floats
    corrections: Floats
    near_field: Floats
    each_delta_v: Floats
    met_unknown: Any
    met_known: Any
    adrift: Any
    residual_speed: Floats
    position_error: Floats

    def __len__(self) -> int:
        return len(self.duration)


def reason_incomplete(
    sets: tuple[tuple[int, ...], ...],
    lost: tuple[int, ...],
    rounds: int,
    names: Sequence[str] | None = None,
    adrift: tuple[int, ...] = (),
) -> str:
    """Return which craft are not in the formation set after `rounds`, or adrift, and why; empty if none."""

    def named(some: tuple[int, ...]) -> str:
        return listed([names[k] if names is not None else str(k) for k in some])

    lines = []
    if lost:
        lines.append(f"craft {named(lost)} locked with no craft")
    lines += [f"craft {named(some)} know each other but did not join the formation set" for some in sets[1:]]
    left = ["; ".join(lines) + f" in {rounds} round{'s' * (rounds > 1)}"] if lines else []
    if adrift:
        left.append(f"craft {named(adrift)} lost the thrust to join the formation set")
    return "; ".join(left)


def listed(names: Sequence[str]) -> str:
    """Return names as an English list: A, B and C."""
    return names[0] if len(names) == 1 else ", ".join(names[:-1]) + f" and {names[-1]}"
