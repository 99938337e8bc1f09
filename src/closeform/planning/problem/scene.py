"""Kernel arguments of a problem and of its contacts: named tuples of arrays."""

from typing import Any, NamedTuple

import numpy as np
from numba import float64, int64, types

from closeform.arrays import Floats
from closeform.kernel_loans import Lent


class Scene(NamedTuple):
    """A problem at one aim: N craft on unconstrained optima, M obstacles, P pairs with Z kinds of zones.

    Rows of paths are arcs of Hill's equations, W = 30, or pieces about any chief, W = 40 (see `pieces`).
    Then `clock` is that of the chief, and each craft's paths are combinations of its polynomials `units`.
    The bodies are numbered from the first craft to the last obstacle.  A zone with a `power` below inf is
    rounded: its norm is the p-norm of its parts.  Paths are to keep the norm at `aims` or above.
    """

    base: Floats  # (N, 30): each craft's unconstrained optimum, over its own time
    inverses: Floats  # (N, 6, 6): initial thrust and thrust rate that reach a state at its end
    direct: Floats  # (A, W): the same paths with the coasts before and after them
    direct_offsets: Any  # (N + 1,)
    others: Floats  # (B, W): the obstacles
    other_offsets: Any  # (M + 1,)
    pairs: Any  # (P, 2), i < j, at least one craft in each
    kinds: Any  # (P,): which of the zones
    windows: Floats  # (P, 2): the times at which a contact of the pair can lie
    presence: Floats  # (P, 2): the times at which both are present
    shapes: Any  # (Z,)
    matrices: Floats  # (Z, 3, 3)
    faces: Floats  # (F, 3), of all zones
    face_offsets: Any  # (Z + 1,)
    radii: Floats  # (Z,): of a ball in metres that holds the zone
    powers: Floats  # (Z,)
    aims: Floats  # (Z,)
    times: Floats  # (T,): samples
    states: Floats  # (N + M, T, 6): of all bodies at the samples, unconstrained; inf where absent
    span: Floats  # (2,): first and last time
    clock: Floats  # (3,): of the chief; (0,) for Hill's equations, whose closed forms need no polynomials
    spans: Floats  # (U, 4): start, end, angle and length of the window of every craft's polynomials
    units: Floats  # (U, 13, 36): their coefficients, of the base path, A and B^T
    unit_offsets: Any  # (N + 1,)
    bases: Floats  # (T, 25): weights of the coefficients at the samples
    joints: Floats  # (W + 1,): windows of natural motion, see `natural_motion`
    flows: Floats  # (W, 6, 6, 12)

    @property
    def room(self) -> tuple[int, int]:
        """Rows of all craft's paths without contacts, at most, and their width W."""
        return 3 * len(self.base) + len(self.spans), self.others.shape[1]


class Contacts(NamedTuple):
    """K contacts: index of the pair, time, outward normal in zone coordinates, and multiplier.

    The multiplier is the force that pushes the pair apart: the thrust's rate jumps by
    `multiplier * matrix^T normal` for the first of the two, and by the opposite for the second.  For a craft
    that has drifted without thrust, the force acts at the loss of thrust, propagated back by natural motion.
    """

    which: Any  # (K,)
    times: Floats  # (K,)
    normals: Floats  # (K, 3)
    multipliers: Floats  # (K,)
    drifts: Floats  # (K, 2): time since the loss of thrust of each; 0: no loss

    @classmethod
    def none(cls, count: int = 0) -> "Contacts":
        """Return empty contacts with capacity `count`."""
        return cls.at(np.zeros(count, dtype=np.int64), np.zeros(count))

    @classmethod
    def at(cls, which: Any, times: Floats, drifts: Floats | None = None) -> "Contacts":
        """Return contacts of pairs at times, without normals, multipliers and, by default, `drifts`."""
        count = len(times)
        none = np.zeros((count, 2)) if drifts is None else drifts
        return cls(np.ascontiguousarray(which), times, np.zeros((count, 3)), np.zeros(count), none)

    def first(self, count: int) -> "Contacts":
        """Return a copy of the first `count` contacts."""
        return Contacts(*(column[:count].copy() for column in self))

    def some(self, chosen: Any) -> "Contacts":
        """Return the contacts selected by a mask or by indices."""
        return Contacts(*(np.ascontiguousarray(column[chosen]) for column in self))

    def joined(self, other: "Contacts") -> "Contacts":
        """Return these contacts followed by the other ones."""
        if not self.number or not other.number:
            return other if other.number else self
        return Contacts(*map(np.concatenate, zip(self, other, strict=True)))

    @property
    def number(self) -> int:
        """Number of contacts; `len` of the tuple is that of its fields."""
        return len(self.times)


ROWS, BLOCKS, WINDOWS, NUMBERS, INDICES, PAIRS = (
    float64[:, ::1],
    float64[:, :, ::1],
    float64[:, :, :, ::1],
    float64[::1],
    int64[::1],
    int64[:, ::1],
)
SCENE = Lent(
    types.NamedTuple(
        (
            *(ROWS, BLOCKS, ROWS, INDICES, ROWS, INDICES, PAIRS, INDICES, ROWS, ROWS),
            *(INDICES, BLOCKS, ROWS, INDICES, NUMBERS, NUMBERS, NUMBERS, NUMBERS, BLOCKS, NUMBERS),
            *(NUMBERS, ROWS, BLOCKS, INDICES, ROWS, NUMBERS, WINDOWS),
        ),
        Scene,
    )
)
CONTACTS = Lent(types.NamedTuple((INDICES, NUMBERS, ROWS, NUMBERS, ROWS), Contacts))
