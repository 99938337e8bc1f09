"""Moments at which a craft may fire, each with a time and one of its thrust directions."""

from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np

from closeform.arrays import Floats
from closeform.fuel.thrusters import Thrusters

SLIVER = 1e-15  # of times: shorter slots are rounding


class Moments(NamedTuple):
    """Times (J,) in order, and the index (J,) of an impulse's direction; 0 where the direction is free.

    Where `widths` (J,) [s] are positive, the moment is a burn that begins at its time.
    """

    times: Floats
    which: Any
    widths: Floats

    @classmethod
    def instants(cls, times: Floats, which: Any) -> Self:
        """Return moments of impulses."""
        return cls(times, which, np.zeros(len(times)))

    @classmethod
    def slots(cls, edges: Floats) -> Self:
        """Return burns in any direction between edges (J + 1,), each up to the next."""
        return cls(edges[:-1], np.zeros(len(edges) - 1, dtype=np.int64), np.diff(edges))

    @classmethod
    def every(cls, times: Floats, count: int) -> Self:
        """Return moments of all `count` directions at each time."""
        return cls.instants(np.repeat(times, count), np.tile(np.arange(count), len(times)))

    def some(self, chosen: Any) -> "Moments":
        """Return the moments at indices or in a mask."""
        return Moments(*(column[chosen] for column in self))

    def among(self, others: "Moments") -> Any:
        """Return which of these moments and of others (J, K) are the same."""
        return (self.times[:, None] == others.times) & (self.which[:, None] == others.which)

    def joined(self, *others: "Moments") -> "Moments":
        """Return the union with other moments, in order."""
        every = Moments(*map(np.concatenate, zip(self, *others, strict=True)))
        order = np.lexsort((every.which, every.times))
        times, which = every.times[order], every.which[order]
        new = np.ones(len(order), dtype=bool)
        new[1:] = (times[1:] != times[:-1]) | (which[1:] != which[:-1])
        return every.some(order[new])

    def distinct(self, kept: Floats, apart: float) -> "Moments":
        """Return moments without different times closer than `apart` [s]; near `kept` ones they are these."""
        if self.widths.any():
            return self
        kept, order = np.sort(kept), np.argsort(self.times, kind="stable")
        times = self.times[order]
        after = np.clip(np.searchsorted(kept, times), 1, len(kept) - 1)
        nearest = np.where(times - kept[after - 1] < kept[after] - times, kept[after - 1], kept[after])
        times = np.where(np.abs(times - nearest) < apart, nearest, times)
        new = np.diff(times, prepend=-np.inf) >= apart
        return Moments.instants(times[new][np.cumsum(new) - 1], self.which[order]).joined()

    def burns(self, brief: float) -> Floats:
        """Return start and end (J, 2) of each moment; an impulse begins and ends `brief` from its time."""
        about = np.where(self.widths > 0.0, 0.0, brief)
        return np.stack([self.times - about, self.times + self.widths + about], axis=1)

    def crossed(self, other: "Moments") -> "Moments":
        """Return the union of both, with slots cut at the edges of either."""
        if not (self.widths.any() or other.widths.any()):
            return self.joined(other)
        ends = [own.times + own.widths for own in (self, other)]
        edges = np.unique(np.concatenate([self.times, other.times, *ends]))
        cut = Moments.slots(edges[np.diff(edges, append=np.inf) > SLIVER * np.abs(edges).max()])
        return cut.some(cut.shares(self).any(axis=1) | cut.shares(other).any(axis=1))

    def shares(self, other: "Moments") -> Floats:
        """Return the fraction (J, K) of each moment in `other` that each of these moments overlaps."""
        if not self.widths.any():
            return np.where(self.among(other), 1.0, 0.0)
        middles, widths = self.times + 0.5 * self.widths, self.widths[:, None]
        within = (middles[:, None] > other.times) & (middles[:, None] < other.times + other.widths)
        found: Floats = np.where(within, widths / other.widths, 0.0)
        return found

    def merged(self, peaks: "Moments", apart: float, fixed: bool) -> "Moments":
        """Return moments that replace groups closer than `apart` in one direction, at `peaks` if possible.

        With `fixed` directions two impulses are equivalent to one between them, so all moments are kept too.
        """
        if not len(self.times):
            return peaks
        found = []
        for one in np.unique(self.which):
            times, tops = self.times[self.which == one], peaks.times[peaks.which == one]
            for group in np.split(times, np.flatnonzero(np.diff(times) > apart) + 1):
                near = tops[(tops >= group[0] - apart) & (tops <= group[-1] + apart)]
                near = near if len(near) else group[[len(group) // 2]]
                found.append(Moments.instants(near, np.full(len(near), one)))
        return found[0].joined(*found[1:], *([self] if fixed else []))


def table_of(moments: Sequence[Moments]) -> tuple[Moments, Any]:
    """Return the moments of N craft as one table (N, J), and the number (N,) of valid ones in each row."""
    counts = np.array([len(own.times) for own in moments])
    shape = len(counts), int(counts.max())
    table = Moments(np.zeros(shape), np.zeros(shape, dtype=np.int64), np.zeros(shape))
    for i, own in enumerate(moments):
        for column, values in zip(table, own, strict=True):
            column[i, : counts[i]] = values
    return table, counts


def pushes_table(pushes: Sequence[Floats]) -> Floats:
    """Return impulses (J, 3) of N craft as one table (N, J, 3), padded with zeros."""
    table = np.zeros((len(pushes), max(map(len, pushes)), 3))
    for row, given in zip(table, pushes, strict=True):
        row[: len(given)] = given
    return table


def sizes_of(impulses: Floats) -> Floats:
    """Return the sizes (N, J) of impulses (N, J, 3)."""
    sizes: Floats = np.sqrt((impulses * impulses).sum(axis=2))
    return sizes


def some_of_each(moments: Sequence[Moments], chosen: Any) -> list[Moments]:
    """Return each craft's moments in a mask (N, J), whose rows may be longer than its moments."""
    return [own.some(row[: len(own.times)]) for own, row in zip(moments, chosen, strict=True)]


def blended(
    moments: tuple[list[Moments], list[Moments]], impulses: tuple[Floats, Floats], share: float
) -> tuple[list[Moments], Floats]:
    """Return moments (N) and impulses (N, J, 3) a `share` of the way from the first paths to the second."""
    fired = [sizes_of(given) > 0.0 for given in impulses]
    used = list(map(some_of_each, moments, fired))
    every = list(map(Moments.crossed, *used))
    found = np.zeros((len(every), max(len(own.times) for own in every), 3))
    for rows, given, chosen, part in zip(used, impulses, fired, (1.0 - share, share), strict=True):
        for all_own, own, pushes, some, into in zip(every, rows, given, chosen, found, strict=True):
            into[: len(all_own.times)] += part * all_own.shares(own) @ pushes[: len(some)][some]
    return every, found


class Pushes(NamedTuple):
    """Thrust directions of N craft: `directions` (N, M, 3) at time 0, the first `counts` (N,) of each valid.

    A craft with free direction has one zero vector.  Directions that are fixed in inertial axes rotate
    backwards in the orbit's axes, at `spins` (N,) [rad/s].
    """

    directions: Floats
    counts: Any
    spins: Floats

    @classmethod
    def of(cls, thrusters: Sequence[Thrusters | None], mean_motion: float) -> Self:
        """Return the directions of each craft's thrusters; None is free direction."""
        counts = np.array([1 if own is None else len(own) for own in thrusters])
        directions, spins = np.zeros((len(counts), counts.max(), 3)), np.zeros(len(counts))
        for i, own in enumerate(thrusters):
            if own is not None:
                directions[i, : counts[i]] = own.directions
                spins[i] = mean_motion * (own.frame == "inertial")
        return cls(directions, counts, spins)

    @property
    def fixed(self) -> Any:
        """Mask (N,) of the craft without free direction."""
        return self.directions.any(axis=(1, 2))

    def nearest(self, times: Floats, impulses: Floats) -> Any:
        """Return the index (N, J) of the craft's direction nearest to each impulse (N, J, 3)."""
        every = np.arange(self.directions.shape[1])
        shape = *times.shape, len(every)
        each, when = np.broadcast_to(every, shape), np.broadcast_to(times[..., None], shape)
        ways = self.along(each.reshape(len(times), -1), when.reshape(len(times), -1)).reshape(*shape, 3)
        return (ways @ impulses[..., None])[..., 0].argmax(axis=-1)

    def along(self, which: Any, times: Floats) -> Floats:
        """Return directions (N, J, 3) in the orbit's axes for indices (N, J) at finite times (N, J)."""
        if not self.directions.any():
            return np.zeros((*which.shape, 3))
        found: Floats = self.directions[np.arange(len(which))[:, None], which]
        if self.spins.any():
            angles = self.spins[:, None] * times
            c, s, x, y = np.cos(angles), np.sin(angles), *np.moveaxis(found[..., :2], -1, 0)
            found[..., 0], found[..., 1] = x * c + y * s, y * c - x * s
        return found
