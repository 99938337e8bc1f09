"""What kernels see of a problem, and of its contacts: arrays with names."""

from typing import Any, NamedTuple

import numpy as np
from numba import float64, int64, types

from closeform.arrays import Floats
from closeform.kernel_loans import Lent


class Scene(NamedTuple):
    """A problem at one aim: N craft on unconstrained optima, M obstacles, P pairs with Z kinds of zones.

    Bodies are numbered craft first.  A zone with a `power` below inf is rounded: its norm is the p-norm
    of its parts.  Paths are to keep the norm at `aims` or above.
    """

    base: Floats  # (N, 30): each craft's unconstrained optimum, over its own time
    inverses: Floats  # (N, 6, 6): start thrust and thrust rate that reach a state at its end
    direct: Floats  # (A, 30): the same paths with the coasts before and after them
    direct_offsets: Any  # (N + 1,)
    others: Floats  # (B, 30): the obstacles
    other_offsets: Any  # (M + 1,)
    pairs: Any  # (P, 2), i < j, a craft at least in each
    kinds: Any  # (P,): which of the zones
    windows: Floats  # (P, 2): the times at which a contact of the pair can lie
    presence: Floats  # (P, 2): the times at which both are there
    shapes: Any  # (Z,)
    matrices: Floats  # (Z, 3, 3)
    faces: Floats  # (F, 3), of all zones
    face_offsets: Any  # (Z + 1,)
    radii: Floats  # (Z,): of a ball in metres that holds the zone
    powers: Floats  # (Z,)
    aims: Floats  # (Z,)
    times: Floats  # (T,): samples, between which a minimum may hide
    states: Floats  # (N + M, T, 6): of all bodies there, unconstrained; inf where one is not there
    span: Floats  # (2,): first and last time


class Contacts(NamedTuple):
    """K contacts: which of a problem's pairs, time, outward normal in zone coordinates, multiplier.

    The multiplier is the force with which the zone pushes the pair apart: the thrust's rate
    jumps by `multiplier * matrix^T normal` for the first of the two, by as much the other way for the second.
    A craft that has been drifting without thrust until then feels it as its thrust stops, carried back there.
    """

    which: Any  # (K,)
    times: Floats  # (K,)
    normals: Floats  # (K, 3)
    multipliers: Floats  # (K,)
    drifts: Floats  # (K, 2): how long before the time the thrust of each has stopped; 0: it has not

    @classmethod
    def none(cls, count: int = 0) -> "Contacts":
        """TrackingMargins for `count` contacts."""
        return cls.at(np.zeros(count, dtype=np.int64), np.zeros(count))

    @classmethod
    def at(cls, which: Any, times: Floats, drifts: Floats | None = None) -> "Contacts":
        """Some of the pairs, each at an instant, without normals and multipliers; nobody need drift."""
        count = len(times)
        none = np.zeros((count, 2)) if drifts is None else drifts
        return cls(np.ascontiguousarray(which), times, np.zeros((count, 3)), np.zeros(count), none)

    def first(self, count: int) -> "Contacts":
        """A copy of the first `count`."""
        return Contacts(*(column[:count].copy() for column in self))

    def some(self, chosen: Any) -> "Contacts":
        """Those of a mask or of indices."""
        return Contacts(*(np.ascontiguousarray(column[chosen]) for column in self))

    def joined(self, other: "Contacts") -> "Contacts":
        """These, then the other ones."""
        if not self.number or not other.number:
            return other if other.number else self
        return Contacts(*map(np.concatenate, zip(self, other, strict=True)))

    @property
    def number(self) -> int:
        """How many there are; `len` of a tuple is that of its fields."""
        return len(self.times)


ROWS, BLOCKS, NUMBERS, INDICES, PAIRS = (
    float64[:, ::1],
    float64[:, :, ::1],
    float64[::1],
    int64[::1],
    int64[:, ::1],
)
SCENE = Lent(
    types.NamedTuple(
        (
            *(ROWS, BLOCKS, ROWS, INDICES, ROWS, INDICES, PAIRS, INDICES, ROWS, ROWS),
            *(INDICES, BLOCKS, ROWS, INDICES, NUMBERS, NUMBERS, NUMBERS, NUMBERS, BLOCKS, NUMBERS),
        ),
        Scene,
    )
)
CONTACTS = Lent(types.NamedTuple((INDICES, NUMBERS, ROWS, NUMBERS, ROWS), Contacts))
