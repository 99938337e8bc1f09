"""Pulses of thrusters, and the path under them."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, ClassVar, Self

import numpy as np

from closeform.arrays import Floats
from closeform.fuel.thrusters import Thrusters
from closeform.motion.arc import END, MEAN_MOTION, PUSH, START, WIDTH
from closeform.motion.joining import linked
from closeform.motion.orbit import Orbit
from closeform.motion.path import FORGIVEN, Path, ends_of
from closeform.motion.steering import fix_inertially
from closeform.result import Rows


@dataclass(frozen=True, eq=False, repr=False)
class Pulses(Rows):
    """Pulses of thrusters, ordered by spacecraft and time: columns of K rows.

    Attributes
    ----------
    craft : array of int of shape (K,)
        Index of the spacecraft; 0 if there is one.
    thruster : array of int of shape (K,)
        Index among the directions of the spacecraft.
    start : array of shape (K,) [s]
        Time at which the thruster is switched on.
    duration : array of shape (K,) [s]
        Time for which it is on.
    direction : array of shape (K, 3), no unit
        Direction of the push in the orbit's frame (radial, along-track, cross-track) at the pulse's centroid.
    impulse : array of shape (K,) [m/s]
        Delta-v of the pulse.
    propellant : array of shape (K,) [kg]
        Propellant used; nan without a mass.
    """

    _columns: ClassVar = {
        "craft": "craft",
        "thruster": "thruster",
        "start": "start_s",
        "duration": "duration_s",
        "direction": "radial along_track cross_track",
        "impulse": "impulse_m_s",
        "propellant": "propellant_kg",
    }

    craft: Any
    thruster: Any
    start: Floats
    duration: Floats
    direction: Floats
    impulse: Floats
    propellant: Floats

    def __len__(self) -> int:
        return len(self.impulse)

    def __getitem__(self, index: Any) -> Self:
        return type(self)(*(getattr(self, one.name)[index] for one in fields(self)))


def one_table(some: list[Pulses]) -> Pulses:
    """Return the pulses of several spacecraft as one table, in their order."""
    return Pulses(*(np.concatenate([getattr(one, field.name) for one in some]) for field in fields(Pulses)))


def extended(path: Path, start: float, end: float) -> Path:
    """Return one spacecraft's path with coasts before and after it, from `start` to `end` [s]."""
    rounding = FORGIVEN * (path.end - path.start)
    if start < path.start - rounding:
        state = path.orbit.transition(start - path.start) @ ends_of(path)[0]
        rows = np.concatenate([path.orbit.coast(state, path.start - start, start).arcs, path.arcs])
        path = Path(path.orbit, rows, np.array([0, len(rows)]), ())
    return path.extended(end) if end > path.end + rounding else path


def pulsed_path(
    orbit: Orbit,
    thrusters: Thrusters,
    thruster: Any,
    times: Floats,
    strength: Floats,
    state: Floats,
    ends: Any,
) -> Path:
    """Return the path between two `ends` [s], from a `state` (6,), under pulses at `times` (2, K).

    `times` are their starts and ends; each pulse has a `thruster` (K,) and a `strength` (K,) [m/s^2].
    """
    edges = np.unique(np.concatenate([ends, times.ravel()]))
    begin, over = np.searchsorted(edges, times)
    push = np.zeros((len(edges), 3))
    pushes = thrusters.directions[thruster] * strength[:, None]
    changes = np.zeros((len(edges), len(thrusters)))
    np.add.at(changes, (begin, thruster), 1.0)
    np.add.at(changes, (over, thruster), -1.0)
    np.add.at(push, begin, pushes)
    np.add.at(push, over, -pushes)
    on: Any = np.cumsum(changes, axis=0).any(axis=1)
    arcs = np.zeros((len(edges) - 1, WIDTH))
    arcs[:, START], arcs[:, END], arcs[:, MEAN_MOTION] = edges[:-1], edges[1:], orbit.mean_motion
    arcs[:, PUSH : PUSH + 3] = np.where(on[:, None], np.cumsum(push, axis=0), 0.0)[:-1]
    if thrusters.frame == "inertial":
        fix_inertially(orbit.mean_motion, arcs)
    return linked(orbit, arcs, state)
