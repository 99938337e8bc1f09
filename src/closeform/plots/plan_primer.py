"""What a push is worth along a plan: the primer of a craft that keeps planes, by what it fires."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from closeform.arrays import Floats
from closeform.fuel.allocation import Allocation
from closeform.fuel.thrusters import Thrusters
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path
from closeform.planning.plan import Avoidance, Plan

GRID = 600  # instants at which a primer along thrusters is to be at most 1
DEAR = 100.0  # what it costs where it is more, in the sizes of all impulses


@dataclass(frozen=True, eq=False)
class PlanePushes:
    """What contacts add to the primer of one craft: at `times` (K,) [s], `pushes` (K, 3), no unit times 1/m.

    A contact's multiplier along its normal, for the second craft against it.
    """

    orbit: Orbit
    times: Floats
    pushes: Floats

    @classmethod
    def of(cls, plan: Path | Avoidance | Plan, craft: int, path: Path) -> Self:
        """Those of a craft's contacts at which it can still give way; none of a path or a plan of energy."""
        first, last = path.start, path.end
        if isinstance(plan, Plan):
            first, last = plan.starts[craft], plan.starts[craft] + plan.durations[craft]
        touches = [] if isinstance(plan, Path) or plan.cost == "energy" else plan.contacts
        mine = [one for one in touches if craft in (one.first, one.second) and first < one.time < last]
        signs = [1.0 if one.first == craft else -1.0 for one in mine]
        pushes = [sign * one.multiplier * one.normal for sign, one in zip(signs, mine, strict=True)]
        return cls(path.orbit, np.array([one.time for one in mine]), np.reshape(pushes, (-1, 3)))

    def __len__(self) -> int:
        return len(self.times)

    def __call__(self, times: Floats) -> Floats:
        """The sum (T, 3) of what those that are still ahead add."""
        ahead = self.times - np.asarray(times)[:, None]
        moves = self.orbit.transition(-ahead)[..., :3, 3:]
        felt = np.where(ahead > 0.0, 1.0, 0.0)[..., None] * -np.einsum("tkij,kj->tki", moves, self.pushes)
        return np.asarray(felt.sum(axis=1))


@dataclass(frozen=True, eq=False)
class Worth:
    """A primer p(t) = Psi(t) c, and what `planes` add to it.                                # theory (38)

    `thrusters` are those along which it counts; without any its length does.
    """

    start: float
    first: Floats  # (6,): c
    planes: PlanePushes
    thrusters: Thrusters | None = None

    @classmethod
    def of(cls, path: Path, planes: PlanePushes, thrusters: Thrusters | None) -> Self:
        """The primer that is along a path's impulses, and 1 there, as nearly as there is one."""
        times = np.array([time for time, _ in path.impulses])
        pushes = np.array([push for _, push in path.impulses])
        rows = positions(path.orbit, times - path.start)
        if thrusters is not None:
            return cls(path.start, _along(path, planes, thrusters, pushes, rows), planes, thrusters)
        sizes = np.linalg.norm(pushes, axis=1, keepdims=True)
        scale = np.array([1.0] * 3 + [1.0 / (path.end - path.start)] * 3)
        weights = np.sqrt(sizes)
        aim = weights * (pushes / sizes - planes(times))
        found = np.linalg.lstsq((weights[..., None] * rows * scale).reshape(-1, 6), aim.ravel(), rcond=1e-9)
        return cls(path.start, scale * found[0], planes)

    def __call__(self, times: Floats) -> Floats:
        """p (T, 3) at some times."""
        return positions(self.planes.orbit, times - self.start) @ self.first + self.planes(times)

    def heights(self, times: Floats) -> Floats:
        """What a push is worth at most (T,), for each metre per second of it."""
        primer = self(times)
        if self.thrusters is None:
            return np.asarray(np.linalg.norm(primer, axis=1))
        toward = self.thrusters.directions_at(self.planes.orbit, times)
        return np.asarray(np.einsum("tmi,ti->tm", toward, primer).max(axis=1))

    def spent(self, time: float, push: Floats) -> float:
        """What an impulse (3,) costs [m/s], summed over thrusters."""
        if self.thrusters is None:
            return float(np.linalg.norm(push))
        allocation = Allocation.of(self.thrusters.directions_at(self.planes.orbit, time))
        return float(allocation.amounts(allocation.facets(push[None], 0.0), push[None]).sum())


def positions(orbit: Orbit, times: Any) -> Floats:
    """Psi (T, 3, 6): positions of a natural motion by its start."""
    return orbit.transition(times)[..., :3, :]


def _along(path: Path, planes: PlanePushes, thrusters: Thrusters, pushes: Floats, rows: Floats) -> Floats:
    """The start c of the primer that is worth most to impulses, with d . p at most 1.       # theory (36)"""
    from scipy.optimize import linprog

    orbit, start = path.orbit, path.start
    scale = np.array([1.0] * 3 + [1.0 / (path.end - start)] * 3)
    times = np.union1d(np.linspace(start, path.end, GRID), [time for time, _ in path.impulses])
    toward = thrusters.directions_at(orbit, times)
    limits = np.einsum("tmi,tij->tmj", toward, positions(orbit, times - start) * scale).reshape(-1, 6)
    room = 1.0 - np.einsum("tmi,ti->tm", toward, planes(times)).ravel()
    gain = np.einsum("ji,jik->k", pushes, rows * scale)
    dear = DEAR * np.linalg.norm(pushes, axis=1).sum()
    found = linprog(
        np.append(-gain, dear),
        A_ub=np.column_stack([limits, -np.ones(len(limits))]),
        b_ub=room,
        bounds=[(None, None)] * 6 + [(0.0, None)],
    )
    return np.asarray(scale * found.x[:6])
