"""Exported data of a spacecraft: states at nodes along the axes of a file, and burns."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from closeform.arrays import Floats
from closeform.exchange.chief import Chief
from closeform.exchange.epochs import Epoch
from closeform.exchange.export_tracks.interpolation_nodes import COUNT, DEGREE

ROTATING = "RSW_ROTATING"  # in SANA's registry: radial, along-track, cross-track, rotating with the chief
LARGE = 1e3  # m/s: size to which a vector is scaled before it is rotated as a velocity


@dataclass(frozen=True, eq=False)
class FileFrame:
    """Frame of a file: its axes, `center`, and the `epoch` of time 0.

    Paths are in the frame of the `chief`, or already in the axes of the file if it is None. `mapped` returns
    inertial states for times and states in a frame that turns with the chief; without it, the frame is Hill's
    with arcs. `about` contains comments for readers.
    """

    name: str
    center: str
    epoch: Epoch
    chief: Chief | None
    about: tuple[str, ...] = ()
    mapped: Callable[[Floats, Floats], Floats] | None = None
    _stamps: dict[bytes, list[str]] = field(default_factory=dict, repr=False)

    def stamps(self, times: Floats) -> list[str]:
        """Return times (T,) [s] as epochs with nine decimals; shared times are converted once."""
        key = times.tobytes()
        if key not in self._stamps:
            self._stamps[key] = self.epoch.stamps(times)
        return self._stamps[key]

    def utc(self, times: Floats) -> list[str]:
        """Return times (T,) [s] as UTC epochs with a Z at the end, for any time system of the epoch."""
        return self.epoch.utc(times)

    def states(self, times: Floats, relative: Floats) -> Floats:
        """Return states (T, 6) along the file's axes, from those of the paths."""
        if self.chief is None:
            return relative
        return (self.mapped or self.chief.inertial_from_relative)(times, relative)

    def vectors(self, times: Floats, relative: Floats, vectors: Floats) -> Floats:
        """Return thrusts or velocity changes (T, 3) along the file's axes, for states `relative` (T, 6)."""
        size = np.abs(vectors).max(initial=0.0)
        if self.chief is None or size == 0.0:
            return vectors
        pushed = relative.copy()
        pushed[:, 3:] += vectors * (LARGE / size)
        gained = self.states(times, pushed) - self.states(times, relative)
        turned: Floats = gained[:, 3:] * (size / LARGE)
        return turned

    def covariances(self, times: Floats, relative: Floats, matrices: Floats) -> Floats:
        """Return covariances (C, 6, 6) along the file's axes, from those of paths at `relative` (C, 6)."""
        if self.chief is None:
            return matrices
        steps = np.diag([1.0, 1.0, 1.0, 1e-3, 1e-3, 1e-3])  # m, m/s, within which the map is linear
        six = np.repeat(times, 6)
        ahead, behind = (
            self.states(six, (relative[:, None] + sign * steps).reshape(-1, 6)).reshape(-1, 6, 6)
            for sign in (1.0, -1.0)
        )
        slopes = np.swapaxes((ahead - behind) / (2.0 * steps.diagonal()[:, None]), 1, 2)
        found: Floats = slopes @ matrices @ np.swapaxes(slopes, 1, 2)
        return 0.5 * (found + np.swapaxes(found, 1, 2))


@dataclass(frozen=True, eq=False)
class Piece:
    """Smooth part of a spacecraft's motion, given at `times` (T,) [s], T >= COUNT.

    It has `states` (T, 6) [m, m/s] and `thrust` (T, 3) [m/s^2], and `covariances` (C, 6, 6) [m^2, m^2/s,
    m^2/s^2] at `known` (C,) [s], some of the times; none for a spacecraft without errors.
    """

    times: Floats
    states: Floats
    thrust: Floats
    known: Floats = field(default_factory=lambda: np.empty(0))
    covariances: Floats = field(default_factory=lambda: np.empty((0, 6, 6)))


@dataclass(frozen=True, eq=False)
class Shots:
    """K burns in order of time: `start` and `duration` (K,) [s], 0 for an impulse, `push` (K, 3) [m/s].

    The push is the integral of the thrust; `propellant` (K,) [kg] is nan where unknown; `thruster` (K,)
    counts from 1, and is 0 for a burn that is not assigned to a thruster.
    """

    start: Floats
    duration: Floats
    push: Floats
    propellant: Floats
    thruster: Floats

    def __len__(self) -> int:
        return len(self.start)


@dataclass(frozen=True, eq=False)
class Track:
    """Exported data of one spacecraft.

    `pieces` are in order of time; `error` [m] is the measured error of Hermite's polynomials through COUNT
    states of a piece. `mass` [kg] is the mass at the start; None if unknown.
    """

    name: str
    object_id: str
    pieces: tuple[Piece, ...]
    error: float
    burns: Shots
    mass: float | None = None

    @property
    def span(self) -> tuple[float, float]:
        """Start and end of the states [s]."""
        return float(self.pieces[0].times[0]), float(self.pieces[-1].times[-1])

    @property
    def count(self) -> int:
        """Number of states."""
        return sum(len(piece.times) for piece in self.pieces)

    @property
    def accuracy(self) -> str:
        """Statement about the accuracy between states."""
        text = f"between epochs Hermite's polynomials of degree {DEGREE} (through {COUNT} states)"
        return f"{text} are off by up to {self.error:.1e} m, measured against the closed form"


def text_rows(stamps: list[str], form: str, values: Floats) -> str:
    """Return a line for each stamp and its row of numbers; `form` formats a line with its stamp first."""
    width = values.shape[1] + 1
    cells: list[object] = [None] * (len(stamps) * width)
    cells[::width] = stamps
    for k, column in enumerate(np.asarray(values, dtype=float).T):
        cells[k + 1 :: width] = column.tolist()
    return (f"{form}\n" * len(stamps)) % tuple(cells)


def file_names(names: Sequence[str]) -> list[str]:
    """Return unique file names, also for file systems that ignore case."""
    found: list[str] = []
    taken: set[str] = set()
    for name in names:
        plain = re.sub(r"[^A-Za-z0-9._-]+", "_", name).strip("._") or "craft"
        wanted, count = plain, 1
        while wanted.lower() in taken:
            count += 1
            wanted = f"{plain}-{count}"
        taken.add(wanted.lower())
        found.append(wanted)
    return found
