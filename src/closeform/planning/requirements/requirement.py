"""Requirements on the path of one spacecraft: on its firings, or on its states.

A `Requirement` may forbid firing times.  A `StateRequirement` is a convex set of states that the path must
not leave.  It has a margin m(x), a concave function of the state x that is negative outside of its set.  So
the plane of its slope at any state holds in the whole set:

    m(x) <= m(x_0) + s(x_0) . (x - x_0)        hence s(x_0) . x >= s(x_0) . x_0 - m(x_0) is required

Planes of states outside the set are added to the program of least cost until its paths leave the set no
more.  They cut off no path that keeps the requirement, so the program's cost is a lower bound.

A path is certified between states h apart.  It differs from their chord by at most h^2/8 of its largest
acceleration, and its velocity by h^2/8 of its largest jerk.  On the chord the margin is at least the smaller
one of the two ends.

To add a requirement, derive a class in a file of its own: from `StateRequirement` with `_margin` and
`_slope`, from `ThrustRequirement` with `_cones`, or from `Requirement` with `_holds`, `_worst`, `_forbids`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, nan
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, numbers
from closeform.motion.arc import END, PUSH, START
from closeform.motion.path import Path, of_one_craft, path_of

SAMPLES = 16  # intervals of an arc, and of an interval that is refined
FINER = 3  # refinements of a minimum
AFTER = 1e-6  # of a path's time: planes follow an impulse by this much, so that it counts
SMALLEST = 1e-10  # of a path's time: intervals are not cut further
SLACK = 1e-6  # relative error of margins and slopes
UNPROVEN = 1e-6  # reserves: shortfall of paths that keep the requirements without proof


class Worst(NamedTuple):
    """Least margin of a path, at a `time` [s], and times (K,) and states (K, 6) of shortfalls of states."""

    margin: float = inf
    time: float = nan
    times: Floats = np.empty(0)
    states: Floats = np.empty((0, 6))


class RequirementCheck(NamedTuple):
    """Requirement on a craft, the worst states of its path, and whether the path is proven to keep it."""

    craft: int
    requirement: Requirement
    worst: Worst
    kept: bool

    @property
    def shortfall(self) -> float:
        """Violation in reserves of the requirement: above 0 also where only the proof is missing."""
        return 0.0 if self.kept else max(-self.worst.margin / self.requirement.reserve, UNPROVEN)


def largest_shortfall(checked: Sequence[RequirementCheck]) -> float:
    """Return the largest shortfall in reserves, 0 if all are kept by proof."""
    return max((one.shortfall for one in checked), default=0.0)


@dataclass(frozen=True, kw_only=True)
class Requirement(ABC):
    """Condition on the path of one spacecraft, from a `start` to an `end` [s], by default always.

    `reserve` [m or m/s] is the margin that is planned, so that rounding does not leave the set.
    """

    start: float = -inf
    end: float = inf

    called = "requirement"  # in messages
    unit = "m"  # of the margin
    reserve = 1e-4

    def holds(self, path: Path) -> bool:
        """Return whether a path keeps the requirement at all times, by proof.

        Parameters
        ----------
        path : Path
            Coasts, impulses, burns and arcs of minimum energy of one spacecraft.

        Returns
        -------
        bool
            False also where the path touches the surface so closely that rounding decides.  Thrust of
            thrusters in inertial axes is evaluated at samples, without a proof.

        Raises
        ------
        ValueError
            If the path is that of several spacecraft.

        References
        ----------
        docs/avoidance.md, corridors.
        """
        return self._holds(path)

    @abstractmethod
    def _holds(self, path: Path) -> bool:
        """Return `holds` of a path."""

    def _among(self, bodies: Path, i: int) -> Requirement:
        """Return the requirement for spacecraft i of all `bodies`: this one, without regard to the others."""
        return self

    def _forbids(self, begins: Floats, ends: Floats) -> Any:
        """Return whether firings (...) from `begins` to `ends` [s] break the requirement: none does."""
        return np.zeros(np.shape(begins), dtype=bool)

    def _margin(self, states: Floats) -> Floats:
        """Return margins (...) of states (..., 6), negative outside: inf, because any state is allowed."""
        return np.full(states.shape[:-1], inf)

    def _slope(self, states: Floats) -> Floats:
        """Return the slopes (..., 6) of the margin at states (..., 6)."""
        return np.zeros_like(states)

    @abstractmethod
    def _worst(self, path: Path) -> Worst:
        """Return where a path violates the requirement most, or has its least margin."""


class StateRequirement(Requirement):
    """Convex set of states that the path must not leave; derive a class for a requirement of your own.

    The class defines `_margin`, a concave function of states (..., 6), and its `_slope`.  Certificate and
    lower bound hold only for such functions.  `per_metre` and `per_speed` are upper bounds on the slope in
    position and in velocity, by which paths are certified between samples.  A plan samples these properties
    and refuses a class that lacks them.  With fields of its own, the class is a `dataclass(frozen=True,
    kw_only=True)`.  `reserve` is the margin that is planned.

    Parameters
    ----------
    start, end : float [s], default always
        Times between which the spacecraft must be in the set.

    References
    ----------
    docs/avoidance.md, corridors.

    Examples
    --------
    >>> class Floor(cf.requirements.StateRequirement):  # at most 8 m below the V-bar, also in a minute
    ...     per_speed = 60.0
    ...     slope = np.array([1.0, 0, 0, 60.0, 0, 0])
    ...     def _margin(self, states):
    ...         return 8.0 + states @ self.slope
    ...     def _slope(self, states):
    ...         return np.broadcast_to(self.slope, states.shape)
    >>> float(Floor().margin([-5, 0, 0, 0.05, 0, 0]))
    6.0
    """

    per_metre, per_speed = 1.0, 0.0

    @abstractmethod
    def _margin(self, states: Floats) -> Floats:
        """Return margins (...) of states (..., 6) [m, m/s]: a concave function, negative outside the set."""

    @abstractmethod
    def _slope(self, states: Floats) -> Floats:
        """Return the slopes (..., 6) of the margin at states (..., 6)."""

    def margin(self, states: ArrayLike) -> Any:
        """Return the distance of states from the limit of the requirement, negative outside.

        Parameters
        ----------
        states : array_like of shape (..., 6) [m, m/s]
            States in the rotating frame.

        Returns
        -------
        float or array of shape (...) [m, or m/s of a speed limit]
            Margins; a lower bound on the distance from the surface for a `KeepIn`.

        Raises
        ------
        ValueError
            If the last axis does not have six numbers.

        References
        ----------
        docs/avoidance.md, corridors.
        """
        given = numbers("states", states)
        if given.shape[-1:] != (6,):
            raise ValueError(f"states: expected shape (..., 6), got {given.shape}")
        return self._margin(given)

    def _refuse_unless_concave(self, states: Floats) -> None:
        """Raise ValueError if states (K, 6) show a margin that is not concave, or too large slopes."""
        name, margins, slopes = type(self).__name__, self._margin(states), self._slope(states)
        for part, bound in (("per_metre", self.per_metre), ("per_speed", self.per_speed)):
            columns = slopes[:, :3] if part == "per_metre" else slopes[:, 3:]
            if (steepest := np.linalg.norm(columns, axis=1).max()) > (1.0 + SLACK) * bound:
                raise ValueError(
                    f"requirements: {name}.{part} is {bound:g}; its slope is up to {steepest:.6g}"
                )
        planes = margins + (states @ slopes.T - (states * slopes).sum(axis=1))
        if (margins[:, None] - planes > SLACK * (1.0 + np.abs(planes))).any():
            raise ValueError(
                f"requirements: {name}._margin is not concave, or {name}._slope is not its slope"
            )

    def worst_margin(self, path: Path) -> float:
        """Return the least margin of one spacecraft's path while the requirement holds.

        Parameters
        ----------
        path : Path
            Coasts, impulses and burns of constant thrust of one spacecraft.

        Returns
        -------
        float [m, or m/s of a speed limit]
            Least margin, found between samples as well, but not certified; inf at other times.

        Raises
        ------
        ValueError
            If the path is that of several spacecraft.

        References
        ----------
        docs/avoidance.md, corridors.
        """
        return self._worst(of_one_craft(path)).margin

    def _worst(self, path: Path) -> Worst:
        """Return the least margin of a path, between samples too; shortfalls are minima below the reserve."""
        arcs, spans = self._spans(path)
        if not len(arcs):
            return Worst()
        spans[:, 0] += np.minimum(AFTER * float(path.end - path.start), 0.1 * (spans[:, 1] - spans[:, 0]))
        shares = np.linspace(0.0, 1.0, SAMPLES + 1)
        times = spans[:, :1] + (spans[:, 1:] - spans[:, :1]) * shares
        margins = self._margin(on_arcs(path, arcs, times))
        around = np.pad(margins, ((0, 0), (1, 1)), constant_values=inf)
        lowest_near = margins - self._off_chord(path, arcs, spans)[:, None]
        sampled = Worst(float(margins.min()), float(times.flat[margins.argmin()]))
        low = lowest_near < max(self.reserve, sampled.margin)
        row, column = np.nonzero(low & (margins <= around[:, :-2]) & (margins <= around[:, 2:]))
        if not len(row):
            return sampled
        width = (spans[row, 1] - spans[row, 0]) / SAMPLES
        lowest = times[row, column]
        for _ in range(FINER):
            near = np.clip(
                lowest[:, None] + (2.0 * shares - 1.0) * width[:, None], spans[row, :1], spans[row, 1:]
            )
            there = on_arcs(path, arcs[row], near)
            each = self._margin(there)
            best = each.argmin(axis=1)[:, None]
            lowest = np.take_along_axis(near, best, 1)[:, 0]
            width = 2.0 * width / SAMPLES
        found = np.take_along_axis(there, best[:, :, None], 1)[:, 0]
        least = np.take_along_axis(each, best, 1)[:, 0]
        short = least < self.reserve
        refined = Worst(float(least.min()), float(lowest[least.argmin()]))
        return min(refined, sampled, key=lambda one: one.margin)._replace(
            times=lowest[short], states=found[short]
        )

    def _holds(self, path: Path) -> bool:
        """Return `holds` of a path."""
        arcs = of_one_craft(path).arcs
        if arcs[:, PUSH + 3 :].any():
            return self._worst(path).margin >= 0.0
        arcs, spans = self._spans(path)
        if not len(arcs):
            return True
        which = np.arange(len(arcs))
        smallest = SMALLEST * float(path.end - path.start)
        while len(which):
            shares = np.linspace(0.0, 1.0, SAMPLES + 1)
            times = spans[:, :1] + (spans[:, 1:] - spans[:, :1]) * shares
            margins = self._margin(on_arcs(path, arcs[which], times))
            if (margins < 0.0).any():
                return False
            off = self._off_chord(path, arcs[which], spans)
            row, column = np.nonzero(np.minimum(margins[:, 1:], margins[:, :-1]) < off[:, None])
            if len(row) and (spans[row, 1] - spans[row, 0]).min() < smallest:
                return False
            which, spans = which[row], np.stack([times[row, column], times[row, column + 1]], axis=1)
        return True

    def _off_chord(self, path: Path, arcs: Floats, spans: Floats) -> Floats:
        """Return bounds (A,) by which the margin falls below that of chords between samples of arcs."""
        h = (spans[:, 1] - spans[:, 0]) / SAMPLES
        bend, jerk = path.orbit._bends(arcs)
        return (self.per_metre * bend + self.per_speed * jerk) * h * h / 8.0

    def _spans(self, path: Path) -> tuple[Floats, Floats]:
        """Return the arcs (A, 30) of a path during the requirement, and their times (A, 2) in it."""
        times = np.clip(path.arcs[:, [START, END]], self.start, self.end)
        during = (path.arcs[:, END] >= self.start) & (path.arcs[:, START] <= self.end)
        return path.arcs[during], times[during]


def on_arcs(path: Path, arcs: Floats, times: Floats) -> Floats:
    """Return states (A, T, 6) on each of A arcs at its own times (A, T)."""
    rows = path_of(path.orbit, np.ascontiguousarray(arcs), np.arange(len(arcs) + 1), (len(arcs),))
    return rows._evaluate_rows(times)


def units(vectors: Floats) -> Floats:
    """Return unit vectors (..., 3) along vectors (..., 3), and zeros for zeros."""
    sizes = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(sizes > 0.0, sizes, 1.0)
