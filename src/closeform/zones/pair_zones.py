"""Zones of pairs: who keeps which zone with whom. It is that of the two bodies that holds the other's."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from closeform.arrays import Floats
from closeform.zones.shapes import BALL, CYLINDER, FACES
from closeform.zones.zone import Zone

ROUNDING = 1e-9
NONE = -1  # the kind of a body without a zone of its own; and of a pair without one, in the table


@dataclass(frozen=True, eq=False)
class PairZones:
    """The zone of every pair among N bodies: of the two bodies' own, the one that holds the other.

    A pair in which one body has no zone goes by the other's; without any it has none.  Nor has a
    pair of two bodies of which neither `moves` (N,).  `kinds` (N,) tells which bodies have equal
    zones, `table` which of the `zones` holds between kind and kind: nothing here grows with the
    number of pairs.

    The zone of a pair i < j is about r_i - r_j: around j, or what is around i as j sees it.
    """

    zones: tuple[Zone, ...]
    kinds: Any  # (N,)
    table: Any  # (K + 1, K + 1), by the kinds of i < j; the last row and column are NONE's
    moves: Any  # (N,) of bool

    @classmethod
    def of(
        cls,
        zones: Sequence[Zone | None],
        names: Sequence[str] | None = None,
        moves: Sequence[bool] | None = None,
    ) -> Self:
        """From each body's own among `zones` (N,), or None; whether it `moves` (N,), all unless given.

        Raises ValueError, with their `names` (N,) if any, for two bodies of which neither zone
        holds the other.
        """
        given: dict[Any, Zone] = {}
        for zone in zones:
            if zone is not None:
                given.setdefault(_key(zone), zone)
        order = {key: kind for kind, key in enumerate(given)}
        kinds = np.array([NONE if zone is None else order[_key(zone)] for zone in zones], dtype=np.int64)
        mobile = np.ones(len(zones), dtype=bool) if moves is None else np.array(moves, dtype=bool)
        members = [np.flatnonzero(kinds == kind) for kind in (*order.values(), NONE)]
        own: list[Zone | None] = [*given.values(), None]
        table = np.full((len(own), len(own)), NONE)
        held: dict[Any, tuple[int, Zone]] = {}
        for one, other in np.ndindex(table.shape):
            pair = _first_pair(members[one], members[other], mobile)
            around, seen = own[other], own[one]
            if pair is None or (around is None and seen is None):
                continue
            zone = containing_zone(*(z for z in (around, seen and seen.mirrored) if z is not None))
            if zone is None:
                called = " and ".join(f"craft {body}" if names is None else names[body] for body in pair)
                raise ValueError(f"{called}: neither zone holds the other; give both one that holds both")
            table[one, other], _ = held.setdefault(_key(zone), (len(held), zone))
        return cls(tuple(zone for _, zone in held.values()), kinds, table, mobile)

    def __len__(self) -> int:
        return len(self.kinds)

    def which(self, first: Any, second: Any) -> Any:
        """Which of the `zones` holds for pairs `first` < `second`, arrays of one shape; -1 for none."""
        found = self.table[self.kinds[first], self.kinds[second]]
        return np.where(self.moves[first] | self.moves[second], found, NONE)

    def between(self, one: int, other: int) -> Zone | None:
        """The zone of `one` about `other`, which holds for the position of `one` less that of `other`."""
        k = int(self.which(min(one, other), max(one, other)))
        if k == NONE:
            return None
        return self.zones[k] if one < other else self.zones[k].mirrored

    def around(self, body: int) -> tuple[Zone | None, ...]:
        """The zones of one `body` about every other, in the others' order."""
        return tuple(self.between(body, other) for other in range(len(self)) if other != body)

    def groups(self) -> Iterator[tuple[Zone, Any]]:
        """Every zone with the pairs (M, 2), i < j, for which it holds."""
        for k, zone in enumerate(self.zones):
            yield zone, self._pairs(k)

    def _pairs(self, k: int) -> Any:
        found = [np.empty((0, 2), dtype=np.int64)]
        for body in range(len(self) - 1):
            others = np.arange(body + 1, len(self))
            others = others[self.which(body, others) == k]
            found.append(np.stack([np.full(len(others), body), others], axis=1))
        return np.concatenate(found)


def _key(zone: Zone) -> tuple[Any, ...]:
    """What equals that of every other zone of the same numbers."""
    return zone.shape, zone.matrix.tobytes(), zone.faces.tobytes()


def _first_pair(first: Any, second: Any, moves: Any) -> tuple[int, int] | None:
    """The first pair i < j of a body of `first` and one of `second`, of which one moves."""
    for body in first:
        later = second[np.searchsorted(second, body, side="right") :]
        later = later if moves[body] else later[moves[later]]
        if len(later):
            return int(body), int(later[0])
    return None


def containing_zone(*zones: Zone) -> Zone | None:
    """The zone that holds all others; None where none does: a cigar and a disc, say."""
    for zone in zones:
        if all(greatest_norm(zone, other) <= 1.0 + ROUNDING for other in zones):
            return zone
    return None


def greatest_norm(outer: Zone, inner: Zone) -> float:
    """Greatest norm of `outer` over the zone `inner`: at most 1 where it holds all of it, inf at most."""
    if outer.shape == FACES:
        return float(np.max(inner.support(outer.faces @ outer.matrix)))
    leading = {BALL: 3, CYLINDER: 2}.get(outer.shape, 0)  # axes of the round part
    flat = outer.matrix[leading:]
    parts = [np.max(inner.support(way)) for way in (flat, -flat) if len(flat)]
    if leading:
        parts.append(_greatest_length(outer.matrix[:leading], inner))
    return float(max(parts))


def _greatest_length(rows: Floats, inner: Zone) -> float:
    """Greatest |rows r| over a zone: convex, so at a corner, along an axis or on a rim."""
    if not inner.bounded:
        return np.inf
    image = rows @ np.linalg.inv(inner.matrix)
    if inner.shape == BALL:
        return float(np.linalg.norm(image, 2))
    if inner.shape != CYLINDER:
        return float(np.linalg.norm(inner.vertices @ rows.T, axis=1).max())
    # |a cos u + b sin u + c|^2 around the rim turns at roots of a quartic in exp(iu); the other
    # rim is this one's mirror image
    a, b, c = image.T
    second = a @ b + 0.5j * (a @ a - b @ b)
    first = b @ c + 1j * (a @ c)
    turns = np.roots([second, first, 0.0, first.conjugate(), second.conjugate()])
    angles = np.append(np.angle(turns), 0.0)
    rim = a * np.cos(angles)[:, None] + b * np.sin(angles)[:, None] + c
    return float(np.linalg.norm(rim, axis=1).max())
