"""Zones of pairs, combined from the own zones of the two bodies."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from closeform.arrays import Floats, sequence, shown
from closeform.zones.combined_zones import COVARIANCE, Body, CovarianceZone, OwnZone, key, pair_zone
from closeform.zones.made_table import NONE, MadeTable, never_refused
from closeform.zones.zone import Zone

AT_ONCE = 1 << 18  # pairs that are processed together: some tens of megabytes
MANY = 64  # number of different own zones up to which the zones of all pairs are made at once
TWICE = (
    "zone: a CovarianceZone together with errors counts them twice; put its covariance into the errors, "
    "and give the size of spacecraft as Body(Sphere(radius))"
)


@dataclass(frozen=True, eq=False)
class PairZones:
    """Zone of every pair among N bodies, combined from their own zones by `PairZones.of`.

    An own zone is a region (any `Zone`), a `CovarianceZone` or a `Body`.  Of two regions, the one that
    contains the other applies.  Covariances add.  Bodies add as sets, as do zones of different kinds.  A body
    without a zone is a point with a known position. A pair with one such body has the own zone of the other;
    a pair of two has none.  A pair of two bodies that do not move has none either.

    The zone of a pair i < j applies to r_i - r_j: it is the zone around j, or the mirrored zone around i.

    Attributes
    ----------
    zones : sequence of Zone
        Zones of all pairs, each once; of more than 64 different spheres or covariances only the zones
        that have been looked up.
    kinds : array of int of shape (N,)
        Index of each body's own zone, equal for equal own zones; -1 without one.
    table : array of int of shape (K + 1, K + 1)
        Index into `zones` by the kinds of i < j, -1 for none; the last row and column belong to
        bodies without an own zone.  No attribute grows with the number of pairs.
    moves : array of bool of shape (N,)
        True for bodies that move.
    rules : sequence of str
        How each zone was made, as text.

    References
    ----------
    docs/theory.md section 3, zones of pairs.
    """

    zones: Sequence[Zone]
    kinds: Any  # (N,)
    table: Any  # (K + 1, K + 1), by the kinds of i < j; the last row and column are NONE's
    moves: Any  # (N,) of bool
    rules: Sequence[str] = ()

    @classmethod
    def of(
        cls,
        zones: Sequence[OwnZone | None],
        names: Sequence[str] | None = None,
        moves: Sequence[bool] | None = None,
    ) -> Self:
        """Return the zones of pairs from each body's own zone.

        Parameters
        ----------
        zones : sequence of Zone, CovarianceZone, Body or None
            Own zone of each body; None for a point with a known position.
        names : sequence of str, optional
            Names of the bodies for error messages, in their order.
        moves : sequence of bool, optional
            Which bodies move; all by default.

        Returns
        -------
        PairZones
            Zones of the pairs of these bodies.

        Raises
        ------
        ValueError
            If `zones` contains another type, or if `names` or `moves` differ from it in length. If, for two
            bodies that the message names, neither region contains the other, the covariances have different
            `sigmas`, or the sum of the regions is unbounded.

        References
        ----------
        docs/theory.md section 3, zones of pairs.
        """
        zones = sequence("zones", zones, Zone, CovarianceZone, Body, type(None))
        for name, value, kind in (("names", names, str), ("moves", moves, bool | np.bool_)):
            if value is not None and len(given_for := sequence(name, value, kind)) != len(zones):
                raise ValueError(f"{name}: expected one for each of {len(zones)} zones, got {len(given_for)}")
        given: dict[Any, OwnZone] = {}
        for zone in zones:
            if zone is not None:
                given.setdefault(key(zone), zone)
        order = {one: kind for kind, one in enumerate(given)}
        kinds = np.array([NONE if zone is None else order[key(zone)] for zone in zones], dtype=np.int64)
        mobile = np.ones(len(zones), dtype=bool) if moves is None else np.array(moves, dtype=bool)
        own: list[OwnZone | None] = [*given.values(), None]
        if len(own) > MANY and never_refused(own):
            made = MadeTable(own)
            return cls(made.zones, kinds, made, mobile, made.rules)
        members = [np.flatnonzero(kinds == kind) for kind in (*order.values(), NONE)]
        table = np.full((len(own), len(own)), NONE)
        held: dict[Any, tuple[int, Zone, str]] = {}
        for one, other in np.ndindex(table.shape):
            pair = _first_pair(members[one], members[other], mobile)
            if pair is None or (own[one] is None and own[other] is None):
                continue
            try:
                zone, rule = pair_zone(around=own[other], seen=own[one])
            except ValueError as error:
                called = " and ".join(f"craft {body}" if names is None else names[body] for body in pair)
                raise ValueError(f"{called}: {error}") from None
            table[one, other], *_ = held.setdefault((rule, key(zone)), (len(held), zone, rule))
        found = held.values()
        return cls(tuple(one[1] for one in found), kinds, table, mobile, tuple(one[2] for one in found))

    def __len__(self) -> int:
        return len(self.kinds)

    def which(self, first: Any, second: Any) -> Any:
        """Return the index of the zone of each pair.

        Parameters
        ----------
        first, second : int or array of int of shape (M,)
            Bodies i < j of each pair, by index.

        Returns
        -------
        array of int of shape (M,)
            Indices of `zones`; -1 for a pair without one.
        """
        found = self.table[self.kinds[first], self.kinds[second]]
        return np.where(self.moves[first] | self.moves[second], found, NONE)

    def between(self, one: int, other: int) -> Zone | None:
        """Return the zone of one body about another.

        Parameters
        ----------
        one : int
            Index of the body whose position is taken relative to the other.
        other : int
            Index of the body that the zone is around.

        Returns
        -------
        Zone or None
            The zone; None for a pair without one.
        """
        k = int(self.which(min(one, other), max(one, other)))
        if k == NONE:
            return None
        return self.zones[k] if one < other else self.zones[k].mirrored

    def rule(self, one: int, other: int) -> str | None:
        """Return the rule by which the zone of a pair was made.

        Parameters
        ----------
        one, other : int
            The two bodies by index, in either order.

        Returns
        -------
        str or None
            Such as "covariances added, 3 sigma"; None for a pair without a zone.
        """
        k = int(self.which(min(one, other), max(one, other)))
        return None if k == NONE else self.rules[k] if self.rules else "given"

    def around(self, body: int) -> tuple[Zone | None, ...]:
        """Return the zones of one body about every other.

        Parameters
        ----------
        body : int
            Index of the body.

        Returns
        -------
        tuple of Zone or None
            In the others' order; None for a pair without one.
        """
        return tuple(self.between(body, other) for other in range(len(self)) if other != body)

    @property
    def pairs(self) -> int:
        """Number of pairs that have a zone."""
        bare, still = self.kinds == NONE, ~self.moves
        without = count_pairs(bare.sum()) + count_pairs(still.sum()) - count_pairs((bare & still).sum())
        return count_pairs(len(self)) - without

    def groups(self) -> Iterator[tuple[Zone, Any]]:
        """Iterate over the zones with the pairs that they apply to.

        Returns
        -------
        iterator of tuple of a Zone and an array of int of shape (M, 2)
            Each zone with its pairs i < j, by index.
        """
        found: dict[int, list[Any]] = {k: [np.empty((0, 2), dtype=np.int64)] for k in range(len(self.zones))}
        for first, second in pairs_of(len(self)):
            for k, some in by_zone(self.which(first, second)):
                found.setdefault(k, []).append(np.stack([first[some], second[some]], axis=1))
        for k in sorted(found):
            yield self.zones[k], np.concatenate(found[k])


def by_zone(which: Any) -> Iterator[tuple[int, Any]]:
    """Yield each zone index in a result of `PairZones.which`, and the positions where it occurs."""
    if len(which) and (which == which[0]).all():
        order, begins = np.arange(len(which)), np.zeros(1, dtype=np.int64)
    else:
        order = np.argsort(which, kind="stable")
        begins = np.unique(which[order], return_index=True)[1]
    for some in np.split(order, begins[1:]):
        if len(some) and which[some[0]] != NONE:
            yield int(which[some[0]]), some


def count_pairs(bodies: int) -> int:
    """Return the number of pairs of `bodies`."""
    return int(bodies) * (int(bodies) - 1) // 2


def pairs_of(count: int, at_once: int = AT_ONCE) -> Iterator[tuple[Any, Any]]:
    """Yield the pairs i < j of `count` bodies in order, in parts that fit into memory."""
    row, column = 0, 1
    while row < count - 1:
        first, second = [], []
        room = at_once
        while room > 0 and row < count - 1:
            taken = np.arange(column, min(count, column + room))
            first.append(np.full(len(taken), row))
            second.append(taken)
            room -= len(taken)
            column += len(taken)
            if column == count:
                row, column = row + 1, row + 2
        yield np.concatenate(first), np.concatenate(second)


def portions(zones: PairZones, at_once: int = AT_ONCE) -> Iterator[tuple[Zone, Any, Any]]:
    """Yield the pairs of many bodies in parts: a zone, i (M,) and j (M,)."""
    for first, second in pairs_of(len(zones), at_once):
        for k, some in by_zone(zones.which(first, second)):
            yield zones.zones[k], first[some], second[some]


def portions_near(zones: PairZones, places: Floats) -> Iterator[tuple[Zone, Any, Any]]:
    """Yield the pairs of `portions` that positions (N, 3) [m] place within the reach of a zone."""
    reach = reach_of(zones)
    if zones.pairs <= AT_ONCE or not reach < np.inf:
        yield from portions(zones)
        return
    from scipy.spatial import cKDTree  # imported here: few pairs do without it

    pairs = cKDTree(places).query_pairs((1.0 + 1e-9) * reach, output_type="ndarray")
    first, second = pairs[np.lexsort(pairs.T[::-1])].T
    for k, some in by_zone(zones.which(first, second)):
        yield zones.zones[k], first[some], second[some]


def made_by_need(zones: PairZones) -> bool:
    """Return True if zones are made when they are looked up, as there may be one for each pair."""
    return isinstance(zones.table, MadeTable)


def counts_covariances(zones: PairZones) -> bool:
    """Return True if a `CovarianceZone` contributes to the zone of any pair."""
    if isinstance(zones.table, MadeTable):
        return any(isinstance(own, CovarianceZone) for own in zones.table.own)
    return any(COVARIANCE in rule for rule in zones.rules)


def all_made(zones: PairZones) -> PairZones:
    """Return pair zones in which the zones of all kinds exist, for kernels that look them up in a table."""
    if not isinstance(zones.table, MadeTable):
        return zones
    count = len(zones.table.own)
    table = zones.table[np.arange(count)[:, None], np.arange(count)]
    return replace(zones, zones=tuple(zones.zones), table=table, rules=tuple(zones.rules))


def reach_of(zones: PairZones) -> float:
    """Return a distance [m] beyond which no pair is in its zone."""
    if isinstance(zones.table, MadeTable):
        return zones.table.reach
    return max((zone.radius for zone in zones.zones), default=0.0)


def enlarged(zones: PairZones, factor: float) -> PairZones:
    """Return zones of pairs that are all scaled by `factor`."""
    if isinstance(zones.table, MadeTable):
        made = zones.table.enlarged(factor)
        return replace(zones, zones=made.zones, rules=made.rules, table=made)
    return replace(zones, zones=tuple(zone.enlarged(factor) for zone in zones.zones))


def pair_zones(
    argument: str, zones: Any, craft: int, fixed: int = 0, names: Sequence[str] | None = None
) -> PairZones:
    """Return the zones of pairs of `craft` spacecraft and then `fixed` bodies, from a function's `argument`.

    `zones` is one own zone for all, one for each spacecraft or for each body (None: no own zone), or
    `PairZones` of all. Raises ValueError that names the argument for anything else.
    """
    count = craft + fixed
    if isinstance(zones, PairZones):
        if len(zones) != count:
            raise ValueError(f"{argument}: zones of {len(zones)} spacecraft for {count} paths")
        return zones
    own: list[OwnZone | None] = [zones] * count
    if not isinstance(zones, OwnZone):
        own = list(zones) if isinstance(zones, Sequence) else [zones]
        if not own or not all(one is None or isinstance(one, OwnZone) for one in own):
            raise ValueError(
                f"{argument}: expected a zone, one for each spacecraft, or PairZones, got {shown(zones)}"
            )
        if len(own) not in (craft, count):
            more = f" or {count} with the obstacles" * bool(fixed)
            counts = f"{len(own)} zones for {craft} spacecraft; give one, or {craft}{more}"
            raise ValueError(f"{argument}: {counts}")
        own += [None] * (count - len(own))
    try:
        return PairZones.of(own, names, [True] * craft + [False] * fixed)
    except ValueError as error:
        raise ValueError(f"{argument}: {error}") from None


def _first_pair(first: Any, second: Any, moves: Any) -> tuple[int, int] | None:
    """Return the first pair i < j with one body of `first` and one of `second` that are not both fixed."""
    for body in first:
        later = second[np.searchsorted(second, body, side="right") :]
        later = later if moves[body] else later[moves[later]]
        if len(later):
            return int(body), int(later[0])
    return None
