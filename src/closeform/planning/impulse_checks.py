"""What paths of impulses are asked: whether they are clear, and stay so where thrust may be lost."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from closeform.arrays import Floats
from closeform.motion.arc import END
from closeform.planning.firing_times import Moments, sizes_of, some_of_each
from closeform.planning.problem import Flown, PairRow, Problem
from closeform.planning.scene import Contacts

ASTRAY = 1e-6  # of how far away ends are, or of a metre: by more nobody has arrived
WEAK = 1e-3  # of the mean multiplier: planes that hardly push


class Checked(NamedTuple):
    """Conflicts of paths, and where craft that lost their thrust come near others; the least norm there."""

    missed: list[PairRow]
    lost: Contacts
    nearest: float

    @property
    def clear(self) -> bool:
        """Whether there is no conflict, with thrust or without."""
        return not self.missed and self.nearest >= 1.0

    @property
    def worst(self) -> float:
        """The least norm of all conflicts, at most 1."""
        return min([1.0, self.nearest, *(float(row[3]) for _, row in self.missed)])


@dataclass(frozen=True, eq=False)
class Spent:
    """What one round came to: paths, their delta-v [m/s], conflicts left, and what it was found with.

    Delta-v is the sum of the sizes of all `impulses`: of two thrusters that fire at once, of both.
    """

    flown: Flown
    delta_v: float
    least: float  # [m/s]: nothing that keeps these planes costs less, fired at any time; certified
    checked: Checked
    contacts: Contacts
    margin: float  # of the zones, to which planes were moved out
    moments: list[Moments]  # of each craft
    impulses: Floats  # (N, J, 3)
    peaks: list[Moments]  # when each craft's primer is longest, or most along one of its thrusters

    @property
    def pushing(self) -> Any:
        """Which contacts (K,) push their pairs apart."""
        return pushing(self.contacts)

    def fired(self, share: float) -> list[Moments]:
        """When each craft fires more than a share of all."""
        return some_of_each(self.moments, sizes_of(self.impulses) > share * self.delta_v)


class Failures(Protocol):
    """What lost thrust leads to, for plans that are to be passively safe."""

    holding: bool  # planes that push, although paths have left them

    def checked(self, flown: Flown, known: Contacts) -> Checked:
        """Conflicts of paths, and where failed craft come near others, at `known` instants among others."""

    def starts(self, margin: float = ...) -> Iterator[Contacts]:
        """Contacts of other plans that are safe, to begin with, for zones larger by a margin."""

    def merged(
        self, contacts: Contacts, before: list[Moments], impulses: Floats, after: list[Moments]
    ) -> Contacts:
        """The contacts for fewer moments `after`, each of which stands for those of `before` near it."""

    def touching(self, flown: Flown, contacts: Contacts) -> tuple[Contacts, bool]:
        """Those that are touched, amid impulses where their chords are, and whether all of them are."""

    def brief(self, flown: Flown) -> Flown:
        """The same paths, their impulses as brief burns, in the midst of which thrust may be lost."""


def arrive(problem: Problem, flown: Flown, finals: Floats) -> bool:
    """Whether craft come to their final states (N, 6), as few impulses along few directions may not."""
    paths, ends = problem.path(flown), problem.base[:, END]
    off = np.abs(np.stack([paths[i].state(end) for i, end in enumerate(ends)]) - finals)[:, :3].max()
    return bool(off <= ASTRAY * np.abs(finals[:, :3]).max(initial=1.0))


def pushing(contacts: Contacts) -> Any:
    """Which contacts (K,) push their pairs apart."""
    pushes = contacts.multipliers
    return pushes > WEAK * pushes.sum() / max(len(pushes), 1)


def drifting(contacts: Contacts) -> Any:
    """Which contacts (K,) are of a craft that lost its thrust before."""
    return contacts.drifts.any(axis=1)
