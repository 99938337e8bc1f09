"""What is planned jointly: craft on their base arcs, obstacles, zones of pairs, and contacts between them."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from closeform.arc import END, MEAN_MOTION, START, WIDTH
from closeform.avoidance.joint import deflect, prepare_all, seen
from closeform.effort import ENERGY, totals
from closeform.screening import search_pairs
from closeform.zones import Floats, Zone

MARGIN = 1e-7  # of a craft's duration: contacts keep this far from its ends

Flown = tuple[Floats, Any]  # arcs of all bodies, and where each one's begin


@dataclass(frozen=True, eq=False)
class Contacts:
    """K contacts: pair (K, 2), kind of zone, time, normal in zone coordinates (K, 3), and force (K,)."""

    pairs: Any
    kinds: Any
    times: Floats
    normals: Floats
    force: Floats

    @classmethod
    def none(cls) -> "Contacts":
        whole = np.empty(0, dtype=np.int64)
        return cls(whole.reshape(0, 2), whole, np.empty(0), np.empty((0, 3)), np.empty(0))

    def __len__(self) -> int:
        return len(self.times)

    def some(self, chosen: Any) -> "Contacts":
        """Those of a mask or of indices."""
        return Contacts(*(column[chosen] for column in self.columns))

    def joined(self, other: "Contacts") -> "Contacts":
        """These, then the other ones."""
        both = zip(self.columns, other.columns, strict=True)
        return Contacts(*(np.concatenate(columns) for columns in both))

    @property
    def columns(self) -> tuple[Any, ...]:
        return self.pairs, self.kinds, self.times, self.normals, self.force


@dataclass(frozen=True, eq=False)
class Task:
    """N base arcs (the unconstrained optima), M obstacles after them, and the zone of every pair.

    Bodies are numbered craft first; `pairs` (P, 2), i < j, hold a craft at least, `kinds` (P,) tells
    the zone of each among `zones`.  Paths are flown from `first` to `last`: craft coast
    before and after their own arcs.
    """

    base: Floats  # (N, 21)
    inverses: Floats  # (N, 6, 6), see joint
    others: Floats
    other_offsets: Any  # (M + 1,)
    pairs: Any
    kinds: Any
    zones: tuple[Zone, ...]
    matrices: Floats  # (Z, 3, 3)
    first: float
    last: float

    @classmethod
    def of(cls, base: Floats, others: Floats, other_offsets: Any, zones: Any) -> "Task":
        """`zones`: each with the pairs for which it holds, as from `pairwise`."""
        inverses = np.empty((len(base), 6, 6))
        prepare_all(base, inverses)
        held = [(pairs[pairs[:, 0] < len(base)], kind) for kind, (_, pairs) in enumerate(zones)]
        return cls(
            base,
            inverses,
            others,
            other_offsets,
            np.concatenate([np.empty((0, 2), dtype=np.int64), *(pairs for pairs, _ in held)]),
            np.concatenate([np.empty(0, dtype=np.int64), *(np.full(len(p), k) for p, k in held)]),
            tuple(zone for zone, _ in zones),
            np.array([zone.matrix for zone, _ in zones]).reshape(-1, 3, 3),
            float(base[:, START].min()),
            float(base[:, END].max()),
        )

    @property
    def length(self) -> float:
        """Of the time that is flown [s]."""
        return self.last - self.first

    @property
    def boxes(self) -> Any:
        """Which of the zones are boxes (Z,)."""
        return np.array([zone.box for zone in self.zones], dtype=bool)

    def free(self, pairs: Any) -> Floats:
        """From when to when one of each pair at least can give way (K, 2)."""
        never = np.full(len(self.other_offsets) - 1, np.inf)
        starts = np.concatenate([self.base[:, START], never])[pairs]
        ends = np.concatenate([self.base[:, END], -never])[pairs]
        return np.stack([starts.min(axis=1), ends.max(axis=1)], axis=1)

    def windows(self, pairs: Any) -> Floats:
        """Within which contacts of each pair can lie (K, 2)."""
        margin = MARGIN * (self.base[:, END] - self.base[:, START]).max()
        there = np.full(len(self.base), self.first), self.others[self.other_offsets[:-1], START]
        gone = np.full(len(self.base), self.last), self.others[self.other_offsets[1:] - 1, END]
        windows: Floats = self.free(pairs) + np.array([margin, -margin])
        windows[:, 0] = np.maximum(windows[:, 0], np.concatenate(there)[pairs].max(axis=1))
        windows[:, 1] = np.minimum(windows[:, 1], np.concatenate(gone)[pairs].min(axis=1))
        return windows

    def flown(self, contacts: Contacts) -> Flown:
        """The paths of all bodies under the contacts' forces."""
        arcs = np.zeros((3 * len(self.base) + 2 * len(contacts) + len(self.others), WIDTH))
        offsets = np.zeros(len(self.base) + 1, dtype=np.int64)
        pushes = np.einsum(
            "kji,kj,k->ki", self.matrices[contacts.kinds], contacts.normals, contacts.force, order="C"
        )
        deflect(
            self.base,
            self.inverses,
            contacts.pairs,
            contacts.times,
            pushes,
            self.first,
            self.last,
            arcs,
            offsets,
        )
        own = offsets[-1]
        arcs[own : own + len(self.others)] = self.others
        return arcs[: own + len(self.others)], np.concatenate([offsets, own + self.other_offsets[1:]])

    def energy(self, flown: Flown) -> float:
        """Of all craft together."""
        arcs, offsets = flown
        own = offsets[: len(self.base) + 1]
        each = np.empty(len(self.base))
        totals(np.ascontiguousarray(arcs[: own[-1]]), own, self.base[0, MEAN_MOTION], ENERGY, each)
        return float(each.sum())

    def ratio(self, flown: Flown, pair: tuple[int, int], time: float) -> float:
        """Norm of a pair at one instant."""
        kind = self.kinds[(self.pairs == pair).all(axis=1)][0]
        motion = np.zeros((1, 3, 3))
        seen(*flown, np.array([pair]), np.array([time]), self.matrices[[kind]], motion)
        place = np.abs(motion[0, 0])
        return float(place.max() if self.zones[kind].box else np.linalg.norm(place))

    def conflicts(self, flown: Flown, factor: float = 1.0) -> list[tuple[tuple[int, int], Floats]]:
        """Every stay of a pair in its zone, made `factor` times as large: pair and (start, end, time, ratio).

        Certified, see `find_conflicts`.
        """
        found = []
        for kind, zone in enumerate(self.zones):
            pairs = np.ascontiguousarray(self.pairs[self.kinds == kind].T)
            table = search_pairs(*flown, zone if factor == 1.0 else zone.enlarged(factor), *pairs)
            found += [((int(i), int(j)), row) for (i, j), row in zip(*table, strict=True)]
        return found
