"""What is exported of a craft: states at nodes along the axes of a file, and its burns."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from closeform.arrays import Floats
from closeform.exchange.chief import Chief
from closeform.exchange.epochs import Epoch
from closeform.exchange.nodes import COUNT, DEGREE

ROTATING = "RSW_ROTATING"  # of SANA's registry: radial, along-track, cross-track, turning with the chief
LARGE = 1e3  # m/s: of a vector that is turned as a velocity, beside which rounding is nothing


@dataclass(frozen=True, eq=False)
class FileFrame:
    """Along whose axes a file is, about which `center`, and which `epoch` time 0 is.

    Paths are those of Hill's frame that the `chief` carries, or with None in the axes of the file already.
    `about` says in words what readers should know.
    """

    name: str
    center: str
    epoch: Epoch
    chief: Chief | None
    about: tuple[str, ...] = ()
    _told: dict[bytes, list[str]] = field(default_factory=dict, repr=False)

    def stamps(self, times: Floats) -> list[str]:
        """Times (T,) [s] as epochs with nine decimals; those that many craft share are written once."""
        key = times.tobytes()
        if key not in self._told:
            self._told[key] = self.epoch.stamps(times)
        return self._told[key]

    def utc(self, times: Floats) -> list[str]:
        """The same in UTC, with a Z at the end, whatever the time system of the epoch."""
        return self.epoch.utc(times)

    def states(self, times: Floats, relative: Floats) -> Floats:
        """States (T, 6) along the file's axes, of those of the paths."""
        return relative if self.chief is None else self.chief.inertial_from_relative(times, relative)

    def vectors(self, times: Floats, relative: Floats, vectors: Floats) -> Floats:
        """Thrusts or velocity increments (T, 3) along the file's axes, of craft at `relative` (T, 6)."""
        size = np.abs(vectors).max(initial=0.0)
        if self.chief is None or size == 0.0:
            return vectors
        pushed = relative.copy()
        pushed[:, 3:] += vectors * (LARGE / size)
        gained = self.states(times, pushed) - self.states(times, relative)
        turned: Floats = gained[:, 3:] * (size / LARGE)
        return turned

    def covariances(self, times: Floats, relative: Floats, matrices: Floats) -> Floats:
        """Covariances (C, 6, 6) along the file's axes, of those of the paths about `relative` (C, 6)."""
        if self.chief is None:
            return matrices
        steps = np.diag([1.0, 1.0, 1.0, 1e-3, 1e-3, 1e-3])  # m, m/s, within which the map is straight
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
    """A smooth part of a craft's motion, told at `times` (T,) [s], T >= COUNT.

    `states` (T, 6) [m, m/s] and `thrust` (T, 3) [m/s^2]; `covariances` (C, 6, 6) [m^2, m^2/s, m^2/s^2] at
    `known` (C,) [s], some of the times, none of a craft without errors.
    """

    times: Floats
    states: Floats
    thrust: Floats
    known: Floats = field(default_factory=lambda: np.empty(0))
    covariances: Floats = field(default_factory=lambda: np.empty((0, 6, 6)))


@dataclass(frozen=True, eq=False)
class Shots:
    """K burns in order of time: `start` and `duration` (K,) [s], 0 of an impulse, `push` (K, 3) [m/s].

    The push is the integral of the thrust; `propellant` (K,) [kg] is nan where that is not known; `thruster`
    (K,) counts from 1, and is 0 where the burn is that of no thruster.
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
    """All that is exported of one craft.

    `pieces` in order of time; `error` [m]: how far Hermite's polynomials through COUNT states of a piece are
    off, measured.  `mass` [kg] is that at the start, None where it is not known.
    """

    name: str
    object_id: str
    pieces: tuple[Piece, ...]
    error: float
    burns: Shots
    mass: float | None = None

    @property
    def span(self) -> tuple[float, float]:
        """From when until when there are states [s]."""
        return float(self.pieces[0].times[0]), float(self.pieces[-1].times[-1])

    @property
    def count(self) -> int:
        """How many states there are."""
        return sum(len(piece.times) for piece in self.pieces)

    @property
    def accuracy(self) -> str:
        """What to say of states between those that are told."""
        text = f"between epochs Hermite's polynomials of degree {DEGREE} (through {COUNT} states)"
        return f"{text} are off by up to {self.error:.1e} m, measured against the closed form"


def text_rows(stamps: list[str], form: str, values: Floats) -> str:
    """A line for each stamp and its row of numbers, in one go: `form` is that of a line, its stamp first."""
    width = values.shape[1] + 1
    cells: list[object] = [None] * (len(stamps) * width)
    cells[::width] = stamps
    for k, column in enumerate(np.asarray(values, dtype=float).T):
        cells[k + 1 :: width] = column.tolist()
    return (f"{form}\n" * len(stamps)) % tuple(cells)


def file_names(names: Sequence[str]) -> list[str]:
    """Return names of files, all different, also where case does not count."""
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
