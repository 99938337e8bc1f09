"""Primer of one spacecraft along a plan with zone contacts, per unit of delta-v or per thruster."""

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

GRID = 600  # instants at which a primer along thrusters is constrained to at most 1
DEAR = 100.0  # penalty for exceeding 1, in units of the sum of all impulses


@dataclass(frozen=True, eq=False)
class PlanePushes:
    """Contact terms of a spacecraft's primer: `times` (K,) [s] and `pushes` (K, 3) [1/m].

    A push is the multiplier of a contact along its normal, with opposite sign for the second spacecraft.
    """

    orbit: Orbit
    times: Floats
    pushes: Floats

    @classmethod
    def of(cls, plan: Path | Avoidance | Plan, craft: int, path: Path) -> Self:
        """Return the pushes at contacts inside the manoeuvre; none for a path or a minimum-energy plan."""
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
        """Return the sum (T, 3) of the contributions of all later contacts at some times [s]."""
        ahead = self.times - np.asarray(times)[:, None]
        moves = self.orbit.transition(-ahead)[..., :3, 3:]
        felt = np.where(ahead > 0.0, 1.0, 0.0)[..., None] * -np.einsum("tkij,kj->tki", moves, self.pushes)
        return np.asarray(felt.sum(axis=1))


@dataclass(frozen=True, eq=False)
class Worth:
    """Primer p(t) = Psi(t) c plus the contact terms of `planes`, theory (38).

    With `thrusters`, its component along the best thruster counts; otherwise its length.
    """

    start: float
    first: Floats  # (6,): c
    planes: PlanePushes
    thrusters: Thrusters | None = None

    @classmethod
    def of(cls, path: Path, planes: PlanePushes, thrusters: Thrusters | None) -> Self:
        """Fit the primer to a path's impulses: along them and of length 1, as closely as possible."""
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
        """Return the primer p (T, 3) at some times [s]."""
        return positions(self.planes.orbit, times - self.start) @ self.first + self.planes(times)

    def heights(self, times: Floats) -> Floats:
        """Return the maximum value (T,) of an impulse per metre per second."""
        primer = self(times)
        if self.thrusters is None:
            return np.asarray(np.linalg.norm(primer, axis=1))
        toward = self.thrusters.directions_at(self.planes.orbit, times)
        return np.asarray(np.einsum("tmi,ti->tm", toward, primer).max(axis=1))

    def spent(self, time: float, push: Floats) -> float:
        """Return the cost [m/s] of an impulse (3,), summed over thrusters."""
        if self.thrusters is None:
            return float(np.linalg.norm(push))
        allocation = Allocation.of(self.thrusters.directions_at(self.planes.orbit, time))
        return float(allocation.amounts(allocation.facets(push[None], 0.0), push[None]).sum())


def positions(orbit: Orbit, times: Any) -> Floats:
    """Return Psi (T, 3, 6), which maps an initial state to the positions of its natural motion."""
    return orbit.transition(times)[..., :3, :]


def _along(path: Path, planes: PlanePushes, thrusters: Thrusters, pushes: Floats, rows: Floats) -> Floats:
    """Return the initial c of the primer that maximises the value of impulses, d . p <= 1, theory (36)."""
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
