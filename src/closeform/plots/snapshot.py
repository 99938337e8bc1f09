"""State of a gathering at one time, as it is drawn."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np

from closeform.arrays import Floats
from closeform.motion.arc import END, START
from closeform.motion.path import Path
from closeform.search.gather_result import Event, EventKind, Gathering
from closeform.search.imperfect_attitude import OwnTurns
from closeform.search.leg import Leg
from closeform.search.search_errors import SearchErrors, of_each

SEEN = 1e-6  # of the distance: tolerance, so that a pair is in lock at the time of its lock


@dataclass(frozen=True, eq=False)
class Knots:
    """Start, burns and end of one path: `times` (K,) [s] and `points` (K, 3) [m]."""

    times: Floats
    points: Floats

    @classmethod
    def of(cls, path: Path) -> Self:
        times = np.append(path.arcs[:, START], path.arcs[-1, END])
        return cls(times, path.position(times))


@dataclass(frozen=True, eq=False)
class Moment:
    """Gathering at a `time` [s]: positions, attitudes, locks and sets of its spacecraft."""

    gathering: Gathering
    knots: Sequence[Knots]
    time: float

    @cached_property
    def positions(self) -> Floats:
        """Positions (N, 3) [m]."""
        return self.gathering.paths.position(self.time)

    @cached_property
    def attitudes(self) -> Floats:
        """Actual attitudes (N, 3, 3); columns are the body axes."""
        gathering = self.gathering
        return OwnTurns(gathering.search, gathering.groups, self.errors).attitudes(self.time)

    @cached_property
    def errors(self) -> SearchErrors:
        """Errors of each spacecraft (N,) relative to the search."""
        return of_each(self.gathering.errors or SearchErrors(), (len(self.gathering.groups),))

    @cached_property
    def half_angles(self) -> Floats:
        """Half-angles (N,) [rad] of the sensor cones."""
        return np.asarray(self.gathering.search.sensor.half_angle + self.errors.half_angle)

    @property
    def leg(self) -> Leg:
        """Current leg of the search; the last one at the end."""
        legs = self.gathering.search.legs
        return next((leg for leg in legs if leg.start <= self.time < leg.end), legs[-1])

    @cached_property
    def locks(self) -> list[Event]:
        """Locks up to this time."""
        return [one for one in self.gathering.events if one.kind == EventKind.LOCK and one.time <= self.time]

    @cached_property
    def labels(self) -> Any:
        """Set of each spacecraft (N,): -1 lost, 0 the formation set, k >= 1 knowledge set k."""
        times = [event.time for event in self.gathering.events]
        return self.gathering.history[np.searchsorted(times, self.time, side="right")]

    @cached_property
    def trails(self) -> list[Floats]:
        """Track of each spacecraft so far, (K, 3) each: its start, its burns and its position now."""
        both = zip(self.knots, self.positions, strict=True)
        return [np.vstack([one.points[one.times < self.time], now]) for one, now in both]

    def in_lock(self, pairs: Any) -> Any:
        """Return which pairs (M, 2) of one A and one B see each other now, as (M,) of bool; theory (13)."""
        sensor, look = self.gathering.search.sensor, self.attitudes[:, :, 2]
        sensors = self.positions + sensor.offset * look
        gap = sensors[pairs[:, 1]] - sensors[pairs[:, 0]]
        distance = np.linalg.norm(gap, axis=1)
        ranges = np.full(len(look), sensor.range) if self.errors.range is None else self.errors.range
        mute = self.errors.silent
        if (outages := self.errors.outages) is not None:
            mute = mute | ((outages[..., 0] <= self.time) & (self.time < outages[..., 1])).any(axis=-1)
        reach = np.where(mute, 0.0, ranges)[pairs].min(axis=1)
        both = distance <= reach * (1.0 + SEEN)
        cosines = np.cos(self.half_angles)
        for one, way in ((pairs[:, 0], 1.0), (pairs[:, 1], -1.0)):
            ahead = way * (gap * look[one]).sum(axis=1)
            both &= ahead >= distance * (cosines[one] - SEEN)
        return both


def clock_text(time: float) -> str:
    """Return a time [s] as minutes and seconds."""
    minutes, seconds = divmod(int(time + 0.5), 60)
    return f"{minutes:02d}:{seconds:02d}"
