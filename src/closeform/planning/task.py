"""What is planned jointly: craft on their base arcs, obstacles, zones of pairs, and contacts between them."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.all_pairs import search_pairs
from closeform.motion.arc import END, MEAN_MOTION, START, WIDTH
from closeform.motion.effort import ENERGY, totals
from closeform.planning.joint import deflect, prepare_all, seen
from closeform.zones.shapes import CUBE
from closeform.zones.zone import Zone

MARGIN = 1e-7  # of a craft's duration: contacts keep this far from its ends

Flown = tuple[Floats, Any]  # arcs of all bodies, and where each one's begin


@dataclass(frozen=True, eq=False)
class Contacts:
    """K contacts: which of a task's pairs, time, normal in zone coordinates (K, 3), and force (K,)."""

    which: Any
    times: Floats
    normals: Floats
    force: Floats

    @classmethod
    def none(cls) -> "Contacts":
        return cls.unpressed(np.empty(0, dtype=np.int64), np.empty(0))

    @classmethod
    def unpressed(cls, which: Any, times: Floats) -> "Contacts":
        """Contacts without normal and force."""
        return cls(which, times, np.zeros((len(times), 3)), np.zeros(len(times)))

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
        return self.which, self.times, self.normals, self.force


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
    first: float
    last: float

    @classmethod
    def of(cls, base: Floats, others: Floats, other_offsets: Any, zones: Any) -> "Task":
        """`zones`: each with the pairs for which it holds, as from `PairZones.groups`."""
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
            float(base[:, START].min()),
            float(base[:, END].max()),
        )

    @cached_property
    def boxes(self) -> Any:
        """For which pairs the zone is a box (P,)."""
        return np.array([zone.shape == CUBE for zone in self.zones], dtype=bool)[self.kinds]

    @cached_property
    def forms(self) -> Floats:
        """The matrix of each pair's zone (P, 3, 3)."""
        matrices: Floats = np.array([zone.matrix for zone in self.zones]).reshape(-1, 3, 3)
        return np.ascontiguousarray(matrices[self.kinds])

    @cached_property
    def windows(self) -> Floats:
        """Within which contacts of each pair can lie (P, 2): one can give way, and both are there."""
        never = np.full(len(self.other_offsets) - 1, np.inf)
        margin = MARGIN * (self.base[:, END] - self.base[:, START])
        starts = np.concatenate([self.base[:, START] + margin, never])[self.pairs]
        ends = np.concatenate([self.base[:, END] - margin, -never])[self.pairs]
        there = np.full(len(self.base), self.first), self.others[self.other_offsets[:-1], START]
        gone = np.full(len(self.base), self.last), self.others[self.other_offsets[1:] - 1, END]
        early = np.maximum(starts.min(axis=1), np.concatenate(there)[self.pairs].max(axis=1))
        late = np.minimum(ends.max(axis=1), np.concatenate(gone)[self.pairs].min(axis=1))
        return np.stack([early, late], axis=1)

    @cached_property
    def index(self) -> dict[tuple[int, int], int]:
        """Where each pair stands among `pairs`."""
        return {(i, j): k for k, (i, j) in enumerate(self.pairs.tolist())}

    @cached_property
    def direct(self) -> Flown:
        """The unconstrained optima, with the coasts before and after them."""
        return self.flown(Contacts.none())

    def flown(self, contacts: Contacts) -> Flown:
        """The paths of all bodies under the contacts' forces."""
        arcs = np.zeros((3 * len(self.base) + 2 * len(contacts) + len(self.others), WIDTH))
        offsets = np.zeros(len(self.base) + 1, dtype=np.int64)
        pushes = np.einsum(
            "kji,kj,k->ki", self.forms[contacts.which], contacts.normals, contacts.force, order="C"
        )
        deflect(
            self.base,
            self.inverses,
            self.pairs[contacts.which],
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
        which = [self.index[pair]]
        motion = np.zeros((1, 3, 3))
        seen(*flown, self.pairs[which], np.array([time]), self.forms[which], motion)
        place = np.abs(motion[0, 0])
        return float(place.max() if self.boxes[which] else np.linalg.norm(place))

    def conflicts(self, flown: Flown, factor: float = 1.0) -> list[tuple[tuple[int, int], Floats]]:
        """Every stay of a pair in its zone, made `factor` times as large: pair and (start, end, time, ratio).

        Certified, see `find_conflicts`.
        """
        found = []
        for kind, zone in enumerate(self.zones):
            pairs = np.ascontiguousarray(self.pairs[self.kinds == kind].T)
            table = search_pairs(*flown, *flown, zone if factor == 1.0 else zone.enlarged(factor), *pairs)
            found += [((int(i), int(j)), row) for (i, j), row in zip(*table, strict=True)]
        return found
