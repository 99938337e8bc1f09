"""Ephemeris of one object in segments; nothing is interpolated across manoeuvres at their edges."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from closeform.arrays import Floats
from closeform.exchange.ephemerides.ephemeris import SAME_EPOCH, Ephemeris
from closeform.exchange.ephemerides.interpolation import interpolated, nearest
from closeform.exchange.epochs import seconds_of

JUMP = 1.0  # m: a larger position jump is an error in a file, not a manoeuvre
LEAST = 1e-9  # m/s: a smaller velocity jump is rounding


@dataclass(frozen=True, eq=False)
class Spans:
    """Segments in order of time, each with the `starts` [s] of its own time 0, after the first epoch."""

    segments: tuple[Ephemeris, ...]
    starts: tuple[float, ...]

    @classmethod
    def of(cls, ephemeris: Ephemeris | Sequence[Ephemeris]) -> Spans:
        """Return the spans of one ephemeris or of several that follow each other.

        Raises ValueError for gaps, in which the orbit is unknown, and for positions that jump.
        """
        segments = (ephemeris,) if isinstance(ephemeris, Ephemeris) else tuple(ephemeris)
        starts = seconds_of([one.epoch for one in segments], segments[0].time_system).tolist()
        found = cls(segments, tuple(starts))
        for number, (one, other) in enumerate(itertools.pairwise(range(len(segments))), 2):
            gap = found.edges[2 * other] - found.edges[2 * one + 1]
            if gap > SAME_EPOCH:
                what = f"has no states for the {gap:.6g} s before segment {number}"
                raise ValueError(f"{found.name}: {what}; give a file without gaps, or spans apart")
            apart = float(np.linalg.norm((segments[other].states[0] - segments[one].states[-1])[:3]))
            if apart > JUMP:
                what = f"segment {number} begins {apart:.3g} m from the end of the previous one"
                raise ValueError(
                    f"{found.name}: {what}; a manoeuvre changes only the velocity; correct the file"
                )
        return found

    @property
    def first(self) -> Ephemeris:
        """First segment, whose metadata hold for all."""
        return self.segments[0]

    @property
    def name(self) -> str:
        """Name of the object."""
        return self.first.name

    @cached_property
    def edges(self) -> Floats:
        """Start and end of each segment (2 S,) [s], after the first epoch."""
        pairs = zip(self.segments, self.starts, strict=True)
        return np.array([start + one.times[k] for one, start in pairs for k in (0, -1)])

    @cached_property
    def times(self) -> Floats:
        """Epochs of all states (T,) [s], after the first epoch; the epoch of a manoeuvre appears once."""
        pairs = list(zip(self.segments, self.starts, strict=True))
        every = np.concatenate([one.times + start for one, start in pairs])
        return every[np.diff(every, prepend=-np.inf) > SAME_EPOCH]

    @cached_property
    def manoeuvres(self) -> tuple[tuple[float, float], ...]:
        """Times of velocity jumps [s], after the first epoch, and their sizes [m/s]."""
        pairs = itertools.pairwise(self.segments)
        jumps = [float(np.linalg.norm((other.states[0] - one.states[-1])[3:])) for one, other in pairs]
        whens = self.edges[2::2].tolist()
        return tuple((when, jump) for when, jump in zip(whens, jumps, strict=True) if jump > LEAST)

    def states(self, times: Floats, before: bool = False) -> tuple[Floats, Floats]:
        """Return states (K, 6) at `times` (K,) [s], and the estimated position errors (K,) [m].

        At a manoeuvre the states are those after it, or before it with `before`. At an epoch they are those
        of the file.
        """
        starts = self.edges[::2]
        side = -SAME_EPOCH if before else SAME_EPOCH
        which = np.clip(np.searchsorted(starts, times + side, side="right") - 1, 0, len(starts) - 1)
        states, errors = np.empty((len(times), 6)), np.zeros(len(times))
        for k in np.unique(which):
            one, some = self.segments[k], which == k
            wanted = (times[some] - self.starts[k]).clip(one.times[0], one.times[-1])
            closest = nearest(one.times, wanted)
            at_epoch = np.abs(one.times[closest] - wanted) <= SAME_EPOCH
            found, off = one.states[closest], np.zeros(len(wanted))
            if not at_epoch.all():
                found[~at_epoch], off[~at_epoch] = interpolated(one, wanted[~at_epoch])
            states[some], errors[some] = found, off
        return states, errors
