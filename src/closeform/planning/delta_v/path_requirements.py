"""Requirements on single spacecraft as planes of the program, and as times at which it may fire.

The planes support the sets of the requirements at states outside of them, on all paths so far.  They cut off
no path that keeps the requirements.  Cones without thrust are those at the places of the last paths; planes
of single moments keep thrust out of them.
"""

from collections.abc import Sequence
from math import pi
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.motion.arc import END, START, STATE
from closeform.planning.delta_v.dual.fleet import Fleet, Planes
from closeform.planning.delta_v.firing_times import Moments, Pushes
from closeform.planning.problem.problem import Problem, Trajectories
from closeform.planning.requirements.requirement import (
    AFTER,
    Requirement,
    RequirementCheck,
    largest_shortfall,
)
from closeform.planning.requirements.thrust_directions import ThrustRequirement

ACTIVE = 1e-6  # of the largest multiplier: planes below it are dropped
ALONG = 1e-6  # of a thrust: smaller parts perpendicular to a cone's axis are rounding
PAIRED = 1e-3  # of a craft's time: between impulses on opposite sides of a cone
INSTANTS = 0.0, 0.5, 1.0  # shares of a burn at which its direction is kept out of cones
GIVEN = 1e-5  # of a craft's time: so near its ends its position is given, and a plane takes a huge impulse
SHORT = 1e3  # reserves: paths that are less outside a requirement are nearly inside


class PathRequirements:
    """Requirements on each craft of a problem, with their planes."""

    def __init__(self, problem: Problem, pushes: Pushes) -> None:
        self.problem, self.pushes = problem, pushes
        self.trajectories = problem.direct  # last paths
        self.planes, self.reserves = Planes.room(0), np.empty(0)
        self.halves = Planes.room(0)  # last half-spaces of thrust
        self.inward = 1.0  # factor of the reserves

    def add(self, checked: Sequence[RequirementCheck]) -> None:
        """Add the supporting planes of requirements at the states in which paths leave them, or nearly do."""
        for i, one, worst, _ in checked:
            if len(worst.times):
                fresh = self.supporting(i, one, worst.times, worst.states)
                self.planes = self.planes.joined(fresh)
                self.reserves = np.append(self.reserves, np.full(len(fresh.times), one.reserve))

    def supporting(self, i: int, one: Requirement, times: Floats, states: Floats) -> Planes:
        """Return the supporting planes of a craft's requirement at states (K, 6) outside of it."""
        start, end = self.problem.base[i, [START, END]]
        rows, near = one._slope(states), GIVEN * (end - start)
        free = rows[:, 3:].any(axis=1) | ((times > start + near) & (times < end - near))
        kept = free & (times > start) & (times <= end)
        times, states, rows = times[kept], states[kept], rows[kept]
        times = np.minimum(times, end - AFTER * (end - start))  # before an impulse at the end
        planes = Planes.room(len(times))
        planes.times[:], planes.rows[:], planes.first[:], planes.second[:] = times, rows, i, -1
        planes.cuts[:] = times[:, None]
        coasts = self.problem.orbit.transition(times - start, start) @ self.problem.base[i, STATE : STATE + 6]
        planes.misses[:] = (rows * (states - coasts)).sum(axis=1) - one._margin(states)
        return planes

    def placed(self) -> Planes:
        """Return the planes, moved inward by their reserves."""
        return self.planes._replace(misses=self.planes.misses + self.inward * self.reserves)

    def relinearise(self, trajectories: Trajectories, checked: Sequence[RequirementCheck]) -> None:
        """Add planes where the last paths leave requirements; move all inward by the shortfall, or back."""
        self.trajectories, outside = trajectories, largest_shortfall(checked)
        self.add(checked)
        if not outside:
            self.inward = max(1.0, 0.5 * self.inward)
        elif outside < SHORT:  # a small step inward replaces many more planes
            self.inward += max(outside, 1.0)  # by less, the shortfall would only halve round by round

    def keep(self, multipliers: Floats, share: float = ACTIVE) -> Any:
        """Keep only the planes with significant multipliers; return their mask."""
        active = multipliers > share * multipliers.max(initial=0.0)
        self.planes, self.reserves = self.planes.some(active), self.reserves[active]
        return active

    def moments(self, counts: Any, later: float = -AFTER) -> list[Moments]:
        """Return the moments `later` than the planes, by a share of a craft's time.

        Primers have kinks at planes of positions, and jump at planes of velocities.
        """
        found = []
        for i, count in enumerate(counts):
            start, end = self.problem.base[i, [START, END]]
            times = np.unique(self.planes.times[self.planes.first == i] + later * (end - start))
            found.append(Moments.every(times[(times > start) & (times < end)], count))
        return found

    def allowed(self, moments: Sequence[Moments]) -> list[Moments]:
        """Return the moments of each craft at which, and with the direction in which, it may fire."""
        if not self.problem.requirements:
            return list(moments)
        found = []
        for i, (own, requirements) in enumerate(zip(moments, self.problem.requirements, strict=True)):
            free = np.ones(len(own.times), dtype=bool)
            for one in requirements:
                free &= ~one._forbids(own.times, own.times + own.widths)
            axes, angles = self.cones(i, own.times, own.widths)
            if self.pushes.fixed[i]:
                along = self.pushes.along(own.which[None], own.times[None])[0]
                free &= (np.arccos(np.clip((axes * along).sum(axis=-1), -1.0, 1.0)) >= angles).all(axis=0)
            free &= (angles < pi / 2.0).all(axis=0)  # no half-space is outside of a wider cone
            found.append(own.some(free))
        return found

    def with_edges(self, i: int, times: Floats) -> Floats:
        """Return times in order, with those at which requirements of a craft begin or end."""
        start, end = self.problem.base[i, [START, END]]
        own = self.problem.requirements[i] if self.problem.requirements else ()
        edges = np.unique([time for one in own for time in (one.start, one.end)])
        edges = edges[(edges > start) & (edges < end)]
        far = np.abs(edges[:, None] - times).min(axis=1) > AFTER * (end - start)
        return np.sort(np.concatenate([times, edges[far]]))

    def paired(self, moments: Sequence[Moments]) -> list[Moments]:
        """Return moments for thrust on two sides of a cone: another one beside each, if thrust is steered.

        Thrusters in fixed directions get times of their own, because two at once add up to one thrust.
        """
        if not self.steer:
            return list(moments)
        found = []
        for i, (own, (start, end)) in enumerate(
            zip(moments, self.problem.base[:, [START, END]], strict=True)
        ):
            fixed, apart = self.pushes.fixed[i], PAIRED * (end - start)
            later = apart * (own.which / self.pushes.counts[i] if fixed else own.widths == 0.0)
            times = np.where(own.times + later <= end, own.times + later, own.times - later)
            found.append(own._replace(times=times).joined(*([] if fixed else [own])))
        return found

    @property
    def steer(self) -> bool:
        """True if any requirement excludes directions of thrust."""
        return any(isinstance(one, ThrustRequirement) for own in self.problem.requirements for one in own)

    def cones(self, i: int, times: Floats, widths: Floats) -> tuple[Floats, Floats]:
        """Return axes (C, J, 3) and half-angles (C, J) without thrust of a craft, during moments (J,)."""
        axes, angles = [np.empty((0, len(times), 3))], [np.empty((0, len(times)))]
        path, none = self.problem.path(self.trajectories)[i], np.zeros(len(times))
        for one in self.problem.requirements_among(self.trajectories)[i]:
            if isinstance(one, ThrustRequirement):
                for share in INSTANTS if widths.any() else INSTANTS[:1]:
                    instants = times + share * widths
                    fresh, wide = one._excluded(instants, path.position(instants), none, none)
                    axes.append(fresh)
                    angles.append(np.minimum(wide + np.radians(self.inward * one.reserve), pi / 2.0))
        return np.concatenate(axes), np.concatenate(angles)

    def on_last_sides(self, fleet: Fleet, impulses: Floats) -> Floats:
        """Return impulses (N, J, 3), turned to the sides of the last half-spaces at the same moments."""
        turned = impulses.copy()
        for i, count in enumerate(fleet.counts):
            own = self.halves.some(self.halves.first == i)
            which, j = np.nonzero(own.moments[:, None] == fleet.times[i, :count])
            turned[i, j] = own.rows[which, 3:]
        return turned

    def half_spaces(self, fleet: Fleet, impulses: Floats, before: Planes) -> Planes:
        """Return planes that keep impulses (N, J, 3) out of the cones without thrust.

        They restrict the moments whose impulse is in a cone, and those of the planes `before`.  Neighbours
        begin on opposite sides of a cone, so that both together can thrust along its axis.
        """
        found = []
        for i, count in enumerate(fleet.counts):
            times, given = fleet.times[i, :count], impulses[i, :count]
            axes, angles = self.cones(i, times, fleet.widths[i, :count])
            sizes = np.linalg.norm(given, axis=1, keepdims=True)
            along = given / np.where(sizes > 0.0, sizes, 1.0)
            share = (axes * along).sum(axis=-1)
            old = np.isin(times, before.moments[before.first == i])
            held = old | (np.arccos(np.clip(share, -1.0, 1.0)) < angles)
            which, j = np.nonzero(held & np.isfinite(angles) & ~fleet.along[i, :count].any(axis=1))
            axes, angles, planes = axes[which, j], angles[which, j, None], Planes.room(len(j))
            across = along[j] - share[which, j, None] * axes
            across = np.where(np.abs(across).max(axis=1, keepdims=True) > ALONG, across, beside(axes))
            across *= np.where(old[j] | (j % 2 == 0), 1.0, -1.0)[:, None]
            across /= np.linalg.norm(across, axis=1, keepdims=True)
            planes.rows[:, 3:] = np.cos(angles) * across - np.sin(angles) * axes
            planes.times[:], planes.misses[:], planes.moments[:] = times[j], 0.0, times[j]
            planes.first[:], planes.second[:], planes.cuts[:] = i, -1, times[j, None]
            found.append(planes)
        self.halves = Planes.room(0).joined(*found)
        return self.halves


def beside(axes: Floats) -> Floats:
    """Return directions (K, 3) perpendicular to unit vectors (K, 3)."""
    return np.cross(axes, np.eye(3)[np.abs(axes).argmin(axis=1)])
