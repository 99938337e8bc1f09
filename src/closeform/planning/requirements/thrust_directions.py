"""Requirements on the direction of thrust: cones into which a spacecraft must not thrust.

A cone of half-angle a about an axis e may change with time and with the position of the spacecraft.  Its
outside is not convex.  Where the lowest-cost thrust v points into the cone, the planner allows instead the
half-space that touches the cone on the side of v, with w the direction of v perpendicular to e:

    m . v >= 0    with    m = cos(a) w - sin(a) e

Any thrust in it is outside the cone.  The half-spaces are turned to the new thrusts until these settle.  They
exclude other plans that keep the requirement, so bounds on the cost do not use them.

An impulse is checked exactly.  A burn is certified in periods, each with cones that contain those of all its
instants; periods that this does not prove are halved.

To add a requirement, derive a class from `ThrustRequirement` with `_cones`, in a file of its own.
"""

from __future__ import annotations

from abc import abstractmethod
from math import inf, pi
from typing import Any

import numpy as np

from closeform.arrays import Floats, number
from closeform.motion.arc import END, IMPULSE, PUSH, START, THRUST
from closeform.motion.path import Path, of_one_craft
from closeform.planning.requirements.requirement import SMALLEST, Requirement, Worst, on_arcs

PERIODS = 8  # of a burn, at first


class ThrustRequirement(Requirement):
    """Cones of directions into which a spacecraft must not thrust."""

    unit = "deg"
    reserve = 1e-3  # [deg]

    @abstractmethod
    def _cones(self, times: Floats, places: Floats, about: Floats, speeds: Floats) -> tuple[Floats, Floats]:
        """Return unit axes (C, J, 3) and half-angles (C, J) [rad] of excluded cones; -inf without one.

        A cone contains those of all instants up to `about` (J,) [s] from the `times` (J,), when the
        spacecraft is at `places` (J, 3) [m] and its speed is at most `speeds` (J,) [m/s].
        """

    def _excluded(
        self, times: Floats, places: Floats, about: Floats, speeds: Floats
    ) -> tuple[Floats, Floats]:
        """Return `_cones` during the requirement."""
        axes, angles = self._cones(times, places, about, speeds)
        during = (times + about >= self.start) & (times - about <= self.end)
        return axes, np.where(during, angles, -inf)

    def _holds(self, path: Path) -> bool:
        """Return whether no thrust of a path points into a cone, by proof."""
        arcs, spans, impulses = self._firings(path)
        smallest = SMALLEST * float(path.end - path.start)
        while len(arcs):
            if (self._clearances(path, arcs, spans, impulses, 0.0) < 0.0).any():
                return False
            left = self._clearances(path, arcs, spans, impulses, 1.0) < 0.0
            arcs, spans, impulses = arcs[left], spans[left], impulses[left]
            if len(arcs) and np.ptp(spans, axis=1).min() < smallest:
                return False
            arcs, impulses = np.repeat(arcs, 2, axis=0), np.repeat(impulses, 2)
            spans = np.repeat(spans, 2, axis=0)
            spans[::2, 1] = spans[1::2, 0] = spans[::2].mean(axis=1)
        return True

    def _worst(self, path: Path) -> Worst:
        """Return the least angle [deg] between thrust and the cones."""
        arcs, spans, impulses = self._firings(path)
        if not len(arcs):
            return Worst()
        angles = self._clearances(path, arcs, spans, impulses, 0.0)
        least = int(angles.argmin())
        return Worst(float(angles[least]), float(spans[least].mean()))

    def _firings(self, path: Path) -> tuple[Floats, Floats, Any]:
        """Return arcs (F, 30) with thrust, the periods (F, 2) to check, and which (F,) are impulses."""
        arcs = of_one_craft(path).arcs
        jumps = arcs[arcs[:, IMPULSE : IMPULSE + 3].any(axis=1)]
        burns = np.repeat(arcs[arcs[:, THRUST:].any(axis=1)], PERIODS, axis=0)
        parts = np.tile(np.arange(PERIODS), len(burns) // PERIODS)[:, None] + np.array([0, 1])
        periods = burns[:, [START]] + (burns[:, [END]] - burns[:, [START]]) * parts / PERIODS
        impulses = np.arange(len(jumps) + len(burns)) < len(jumps)
        return np.concatenate([jumps, burns]), np.concatenate([jumps[:, [START, START]], periods]), impulses

    def _clearances(self, path: Path, arcs: Floats, spans: Floats, impulses: Any, share: float) -> Floats:
        """Return angles (F,) [deg] of thrust outside of all cones, in the middle `share` of each period."""
        middle, about = spans.mean(axis=1), 0.5 * share * np.ptp(spans, axis=1)
        states = on_arcs(path, arcs, middle[:, None])[:, 0]
        speeds = np.linalg.norm(states[:, 3:], axis=1) + path.orbit._bends(arcs)[0] * about
        along = np.where(impulses[:, None], arcs[:, IMPULSE : IMPULSE + 3], path.thrust(middle))
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), np.finfo(float).tiny)
        turned = np.where(arcs[:, PUSH + 3 :].any(axis=1), path.orbit._rate * about, 0.0)
        axes, angles = self._excluded(middle, states[:, :3], about, speeds)
        off = np.arccos(np.clip((axes * along).sum(axis=-1), -1.0, 1.0)) - angles - turned
        found: Floats = np.degrees(off.min(axis=0, initial=inf))
        return found


def checked_half_angle(half_angle: float) -> None:
    """Raise ValueError unless the half-angle of a cone is above 0 and below pi/2 rad."""
    if not 0.0 < number("half_angle", half_angle) < pi / 2.0:
        raise ValueError(f"half_angle: must be above 0 and below pi/2 rad, got {half_angle}")
