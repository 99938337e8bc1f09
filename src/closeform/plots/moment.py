"""Moment: what a gathering looks like at one time."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np

from closeform.arrays import Floats
from closeform.motion.arc import END, START
from closeform.motion.path import Path
from closeform.search.gather_result import Event, EventKind, Gathering
from closeform.search.leg import Leg

SEEN = 1e-6  # of the distance: a pair counts as in lock at the very time of its lock


@dataclass(frozen=True, eq=False)
class Knots:
    """Where and when a craft starts, burns and ends: `times` (K,) [s] and `points` (K, 3) [m]."""

    times: Floats
    points: Floats

    @classmethod
    def of(cls, path: Path) -> Self:
        times = np.append(path.arcs[:, START], path.arcs[-1, END])
        return cls(times, path.position(times))


@dataclass(frozen=True, eq=False)
class Moment:
    """A gathering at a `time` [s]: where its craft are, which way they look, which set holds each."""

    gathering: Gathering
    knots: Sequence[Knots]
    time: float

    @cached_property
    def positions(self) -> Floats:
        """Positions (N, 3) [m]."""
        return self.gathering.paths.position(self.time)

    @cached_property
    def attitudes(self) -> dict[str, Floats]:
        """Attitude (3, 3) of each group; columns are the body axes."""
        search = self.gathering.search
        return {"A": search.attitude(self.time, "A"), "B": search.attitude(self.time, "B")}

    @property
    def leg(self) -> Leg:
        """The turn that is under way, or just done at the end."""
        legs = self.gathering.search.legs
        return next((leg for leg in legs if leg.start <= self.time < leg.end), legs[-1])

    @cached_property
    def locks(self) -> list[Event]:
        """Locks so far."""
        return [one for one in self.gathering.events if one.kind == EventKind.LOCK and one.time <= self.time]

    @cached_property
    def labels(self) -> Any:
        """The set of each craft (N,): -1 lost, 0 the formation set, k >= 1 knowledge set k."""
        times = [event.time for event in self.gathering.events]
        return self.gathering.history[np.searchsorted(times, self.time, side="right")]

    @cached_property
    def trails(self) -> list[Floats]:
        """The way of each craft so far: its start, its burns and where it is now, (K, 3) each."""
        both = zip(self.knots, self.positions, strict=True)
        return [np.vstack([one.points[one.times < self.time], now]) for one, now in both]

    def in_lock(self, pairs: Any) -> Any:
        """Which of the pairs (M, 2), one of A and one of B each, see each other now: (M,).  # theory (13)"""
        sensor, where = self.gathering.search.sensor, self.positions
        boresight = self.attitudes["A"][:, 2]
        sign = np.where(np.array(self.gathering.groups)[pairs[:, 0]] == "A", 1.0, -1.0)
        gap = sign[:, None] * (where[pairs[:, 1]] - where[pairs[:, 0]]) - sensor.baseline * boresight
        distance = np.linalg.norm(gap, axis=1)
        near = distance <= sensor.range * (1.0 + SEEN)
        return near & (gap @ boresight >= distance * (sensor.cosine - SEEN))


def clock_text(time: float) -> str:
    """A time [s] as minutes and seconds."""
    minutes, seconds = divmod(int(time + 0.5), 60)
    return f"{minutes:02d}:{seconds:02d}"
