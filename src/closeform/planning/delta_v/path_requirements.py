"""Requirements on single spacecraft as planes of the program, and as times at which it may fire.

The planes support the sets of the requirements at states outside of them, on all paths so far.  They cut off
no path that keeps the requirements.
"""

from collections.abc import Sequence
from math import inf
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.motion.arc import END, START, STATE
from closeform.planning.delta_v.dual.fleet import Planes
from closeform.planning.delta_v.firing_times import Moments
from closeform.planning.problem.problem import Flown, Problem
from closeform.planning.requirements.requirement import AFTER, Requirement

ACTIVE = 1e-6  # of the largest multiplier: planes below it are dropped
SHORT = 1e3  # reserves: paths that are less outside a requirement are nearly inside


class PathRequirements:
    """Requirements on each craft of a problem, with their planes."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.planes, self.reserves = Planes.room(0), np.empty(0)
        self.inward = 1.0  # factor of the reserves
        self.outside = 0.0  # shortfall of the last paths, in reserves

    def violations(self, flown: Flown) -> float:
        """Add planes where paths leave the requirements; return the largest shortfall in reserves."""
        paths, short = self.problem.path(flown), -inf
        for i, own in enumerate(self.problem.requirements):
            for one in own:
                worst, times, states = one._worst(paths[i])
                fresh = self.supporting(i, one, times, states)
                self.planes = self.planes.joined(fresh)
                self.reserves = np.append(self.reserves, np.full(len(fresh.times), one.reserve))
                short = max(short, -worst / one.reserve)
        return short

    def hold(self, flown: Flown) -> bool:
        """Return whether paths keep all requirements, by proof; add planes where they do not."""
        self.outside, paths = max(self.violations(flown), 0.0), self.problem.path(flown)
        return self.outside == 0.0 and all(
            one.holds(paths[i]) for i, own in enumerate(self.problem.requirements) for one in own
        )

    def supporting(self, i: int, one: Requirement, times: Floats, states: Floats) -> Planes:
        """Return the supporting planes of a craft's requirement at states (K, 6) outside of it."""
        start, end = self.problem.base[i, [START, END]]
        inside = (times > start) & (times < end)
        times, states = times[inside], states[inside]
        planes = Planes.room(len(times))
        planes.times[:], planes.first[:], planes.second[:] = times, i, -1
        planes.cuts[:] = times[:, None]
        coasts = self.problem.orbit.transition(times - start, start) @ self.problem.base[i, STATE : STATE + 6]
        margins = one._margin(states)
        for k, state in enumerate(states):
            slope = one._slope(state)
            planes.rows[k] = slope
            planes.misses[k] = slope @ (state - coasts[k]) - margins[k]
        return planes

    def placed(self) -> Planes:
        """Return the planes, moved inward by their reserves."""
        return self.planes._replace(misses=self.planes.misses + self.inward * self.reserves)

    def relinearise(self, kept: bool) -> None:
        """Move planes further inward if the last paths do not keep the requirements, else back."""
        if kept:
            self.inward = max(1.0, 0.5 * self.inward)
        elif self.outside < SHORT:  # a small step inward replaces many more planes
            self.inward += self.outside

    def keep(self, multipliers: Floats, share: float = ACTIVE) -> Any:
        """Keep only the planes with significant multipliers; return their mask."""
        active = multipliers > share * multipliers.max(initial=0.0)
        self.planes, self.reserves = self.planes.some(active), self.reserves[active]
        return active

    def moments(self, counts: Any) -> list[Moments]:
        """Return the moments just before the planes, where primers have kinks or jumps."""
        found = []
        for i, count in enumerate(counts):
            start, end = self.problem.base[i, [START, END]]
            times = self.planes.times[self.planes.first == i] - AFTER * (end - start)
            found.append(Moments.every(np.unique(times[times > start]), count))
        return found

    def allowed(self, moments: Sequence[Moments]) -> list[Moments]:
        """Return the moments of each craft at which no requirement forbids to fire."""
        if not self.problem.requirements:
            return list(moments)
        found = []
        for own, requirements in zip(moments, self.problem.requirements, strict=True):
            free = np.ones(len(own.times), dtype=bool)
            for one in requirements:
                free &= ~one._forbids(own.times, own.times + own.widths)
            found.append(own.some(free))
        return found
