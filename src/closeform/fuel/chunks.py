"""Chunks: the parts of a planned thrust that are each fired as one pulse, with their moments.

A chunk is the push of one thruster without a change of sign, during one cycle of its period, or as
many cycles as its minimum impulse bit needs.  Its delta-v is fired about its centroid in time, theory (41).
"""

from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np

from closeform.arrays import Floats, subdivided
from closeform.fuel.allocation import Allocation
from closeform.fuel.thrusters import Thrusters, turn
from closeform.motion.arc import END, IMPULSE, MEAN_MOTION, START, THRUST, WIDTH
from closeform.motion.path import Path

NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)
# Limits of n t, and of the share of the thrust's duration: within them, 8 Gauss points integrate natural
# motion to the last digit, and no thruster is assumed to start and stop.
ANGLE, SHARE = 0.02, 1.0 / 64.0
NOTHING = 1e-9  # of the largest thrust: no thruster fires for less
UNREACHED = 1e-6  # share of all delta-v: a smaller part is rounding of a plan
PUSHES = "the plan requires thrust"  # replaced where the high-fidelity model causes the thrust
MOST = 1_000_000  # cycles and pieces of a path


@dataclass(frozen=True, eq=False)
class Chunks:
    """K chunks: thruster, `start` and `end` [s], `impulse` [m/s] and moments in time of each.

    The moments are the `centroid` [s] and the central moments `variance` [s^2] and `skew` [s^3]; `peak`
    [m/s^2] is the largest thrust found, inf for an impulse.
    """

    thruster: Any
    start: Floats
    end: Floats
    impulse: Floats
    centroid: Floats
    variance: Floats
    skew: Floats
    peak: Floats

    def __len__(self) -> int:
        return len(self.impulse)

    def __getitem__(self, index: Any) -> Self:
        return type(self)(*(getattr(self, one.name)[index] for one in fields(self)))

    def joined(self, first: Any) -> Self:
        """Return one chunk for the chunks from each index in `first` to the next."""
        counts = np.diff(np.append(first, len(self)))
        impulse = np.add.reduceat(self.impulse, first)
        centroid = np.add.reduceat(self.impulse * self.centroid, first) / impulse
        off = self.centroid - np.repeat(centroid, counts)
        square = self.variance + off**2
        cube = self.skew + off * (3.0 * self.variance + off**2)
        return type(self)(
            self.thruster[first],
            self.start[first],
            self.end[first + counts - 1],
            impulse,
            centroid,
            np.add.reduceat(self.impulse * square, first) / impulse,
            np.add.reduceat(self.impulse * cube, first) / impulse,
            np.maximum.reduceat(self.peak, first),
        )


def cells_of(path: Path, thrusters: Thrusters) -> Chunks:
    """Return the thrust of one spacecraft's `path` as small chunks, sorted by thruster and time.

    Raises ValueError for thrust in a direction in which no thruster pushes.
    """
    allocation = Allocation.of(thrusters.directions)
    steady, kicks = _steady(path, thrusters, allocation), _kicks(path, thrusters, allocation)
    every = Chunks(
        *(np.concatenate([getattr(one, f.name) for one in (steady, kicks)]) for f in fields(Chunks))
    )
    real = every.thruster < allocation.count
    if every.impulse[~real].sum() > UNREACHED * every.impulse.sum():
        k = np.flatnonzero(~real)[every.impulse[~real].argmax()]
        sign, axis = divmod(int(every.thruster[k]) - allocation.count, 3)
        raise ValueError(
            f"thrusters: at {every.centroid[k]:.6g} s {PUSHES} that they lack, along "
            f"{'+-'[sign]}{'xyz'[axis]} of their frame; plan with these thrusters, or add one"
        )
    return every[real][np.lexsort((every.centroid[real], every.thruster[real]))]


def gathered(cells: Chunks, begin: float, period: float | None, bits: Floats) -> Chunks:
    """Combine cells into chunks of one cycle, or of enough cycles for one of the `bits` (m,).

    Cycles start at `begin` [s]. A lobe of one sign with less than a minimum impulse bit is one chunk.
    """
    return cells.joined(_firsts(cells, begin, period, bits)) if len(cells) else cells


def thrust_in_frame(path: Path, thrusters: Thrusters, times: Floats) -> Floats:
    """Return the path's thrust (K, 3) at `times` (K,) in the frame of the thrusters."""
    return in_frame(path.thrust(times), path.orbit.mean_motion * times, thrusters)


def in_frame(vectors: Floats, angles: Floats, thrusters: Thrusters) -> Floats:
    """Return vectors (K, 3) of the rotating frame, turned by `angles` (K,), in the frame of the thrusters."""
    if thrusters.frame == "orbit":
        return vectors
    turned: Floats = np.einsum("kji,kj->ki", turn(angles), vectors)
    return turned


def _firsts(cells: Chunks, begin: float, period: float | None, bits: Floats) -> Any:
    """Return the first cell of each chunk; cells are sorted, and cycles are merged up to a minimum bit."""
    impulsive = np.isinf(cells.peak)
    cycle = np.floor((cells.centroid - begin) / (period or np.inf))
    near = 1e-6 * np.maximum(cells.end - cells.start, np.roll(cells.end - cells.start, 1))
    breaks = np.abs(cells.start - np.roll(cells.end, 1)) > near
    breaks |= (cells.thruster != np.roll(cells.thruster, 1)) | impulsive | np.roll(impulsive, 1)
    breaks[0] = True
    firsts = np.flatnonzero(breaks | (cycle != np.roll(cycle, 1)))
    parts, lobes = cells.joined(firsts), breaks[firsts]
    least, sizes = bits[parts.thruster].tolist(), parts.impulse.tolist()
    if all(size >= bit for size, bit in zip(sizes, least, strict=True)):
        return firsts
    kept: list[int] = []
    held = 0.0
    for k, lobe in enumerate(lobes.tolist()):
        if lobe or held >= least[k]:
            if lobe and len(kept) > 1 and held < least[k - 1] and not lobes[kept[-1]]:
                kept.pop()  # the rest of a lobe joins the previous chunk
            kept.append(k)
            held = 0.0
        held += sizes[k]
    if len(kept) > 1 and held < least[-1] and not lobes[kept[-1]]:
        kept.pop()
    return firsts[np.array(kept)]


def _kicks(path: Path, thrusters: Thrusters, allocation: Allocation) -> Chunks:
    """Return impulses as chunks of zero duration."""
    rows = path.arcs[path.arcs[:, IMPULSE : IMPULSE + 3].any(axis=1)]
    times, jumps = rows[:, START], rows[:, IMPULSE : IMPULSE + 3]
    jumps = in_frame(jumps, path.orbit.mean_motion * times, thrusters)
    nothing = NOTHING * float(np.abs(jumps).max(initial=0.0))
    facets = allocation.facets(jumps, nothing)
    sizes = allocation.amounts(facets, jumps)
    which, corner = np.nonzero(sizes > nothing)
    at, none = times[which], np.zeros(len(which))
    thruster = allocation.corners[facets[which], corner]
    return Chunks(thruster, at, at, sizes[which, corner], at, none, none, none + np.inf)


def _steady(path: Path, thrusters: Thrusters, allocation: Allocation) -> Chunks:
    """Return continuous thrust as chunks, cut where cycles end and where the active thrusters change."""
    active = path.arcs[:, THRUST:WIDTH].any(axis=1) | (path.arcs[:, MEAN_MOTION] != path.orbit.mean_motion)
    spans = path.arcs[active & (path.arcs[:, END] > path.arcs[:, START])][:, [START, END]]
    peak = path.peak_thrust if len(spans) else 0.0
    if not peak > 0.0:
        return Chunks(np.empty(0, dtype=np.int64), *np.empty((7, 0)))

    def facet(times: Floats) -> Any:
        return allocation.facets(thrust_in_frame(path, thrusters, times), NOTHING * peak)

    n = path.orbit.mean_motion
    low, high = _taken_over(facet, *_cut(spans, path.start, thrusters.period, n))
    half, middle = 0.5 * (high - low), 0.5 * (high + low)
    facets = facet(middle)
    times = middle[:, None] + half[:, None] * NODES
    thrust = thrust_in_frame(path, thrusters, times.ravel()).reshape(*times.shape, 3)
    sizes = np.maximum(allocation.amounts(facets, thrust), 0.0)  # (C, 8, 3)
    mass = sizes * WEIGHTS[:, None] * half[:, None, None]
    impulse = mass.sum(axis=1)
    which, corner = np.nonzero(impulse > NOTHING * peak * 2.0 * half[:, None])
    mass, impulse = mass[which, :, corner], impulse[which, corner]
    off = half[which, None] * NODES
    mean = (mass * off).sum(axis=1) / impulse
    off = off - mean[:, None]
    return Chunks(
        allocation.corners[facets[which], corner],
        low[which],
        high[which],
        impulse,
        middle[which] + mean,
        (mass * off**2).sum(axis=1) / impulse,
        (mass * off**3).sum(axis=1) / impulse,
        sizes[which, :, corner].max(axis=1),
    )


def _cut(spans: Floats, begin: float, period: float | None, n: float) -> tuple[Floats, Floats]:
    """Return spans (S, 2) cut where cycles of `period` from `begin` on end, and into small angles of n t."""
    total = float((spans[:, 1] - spans[:, 0]).sum())
    if (total / (period or np.inf)) > MOST or total * n / ANGLE > MOST:
        raise ValueError(
            f"period: {total:.6g} s of thrust are more than {MOST} cycles or pieces of an orbit; give a "
            "longer one, or fire the plan piece by piece"
        )
    low, high = [], []
    for start, end in spans.tolist():
        cuts = [np.array([start, end])]
        if period is not None:
            ticks = begin + period * np.arange(
                np.ceil((start - begin) / period), np.ceil((end - begin) / period)
            )
            near = 1e-9 * period
            cuts.append(ticks[(ticks > start + near) & (ticks < end - near)])
        edges = np.unique(np.concatenate(cuts))
        most = min(ANGLE / n if n else np.inf, SHARE * total)
        finer = subdivided(edges, np.ceil(np.diff(edges) / most))
        low.append(finer[:-1])
        high.append(finer[1:])
    return np.concatenate(low), np.concatenate(high)


def _taken_over(facet: Any, low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """Return intervals cut at the changes of the thrust's facet, found by bisection to the last digit."""
    for _ in range(8):  # several changes in one interval
        first, last = facet(low), facet(np.nextafter(high, low))
        changes = np.flatnonzero(first != last)
        if not len(changes):
            break
        left, right, before = low[changes], high[changes], first[changes]
        for _ in range(60):
            middle = 0.5 * (left + right)
            same = facet(middle) == before
            left, right = np.where(same, middle, left), np.where(same, right, middle)
        inner = (right > low[changes]) & (right < high[changes])
        low, high = np.append(low, right[inner]), np.append(high, right[inner])
        low.sort()
        high.sort()
        if not inner.any():
            break
    return low, high
