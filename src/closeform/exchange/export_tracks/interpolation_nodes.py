"""Nodes at which states of a path are exported, for interpolation between them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from closeform.arrays import Floats
from closeform.exchange.ephemerides.interpolation import nearest
from closeform.motion.arc import END, IMPULSE, START
from closeform.motion.path import Path, path_of

COUNT = 4  # nodes of one Hermite polynomial
DEGREE = 2 * COUNT - 1
SMOOTH = 1e-6  # of the largest thrust: a smaller jump is rounding, or a joint of saturated thrust
NEAR = 0.25  # of a step: nodes that are closer to another node are omitted
SHORTEST = 1e-6  # s: shorter intervals have no nodes
APART = 1e-3  # s: impulses of two spacecraft that are closer are treated as simultaneous


def smooth_pieces(path: Path) -> list[Path]:
    """Return one spacecraft's path in parts, cut where its velocity or its thrust jumps."""
    arcs = path.arcs
    alone = path_of(path.orbit, arcs, np.arange(len(arcs) + 1), (len(arcs),))
    begun, ended = (alone._evaluate_rows(arcs[:, edge : edge + 1], 3)[:, 0] for edge in (START, END))
    size = np.abs(begun).max(initial=0.0)
    apart = np.abs(begun[1:] - ended[:-1]).max(axis=1, initial=0.0) > SMOOTH * size
    kicked = arcs[1:, IMPULSE : IMPULSE + 3].any(axis=1)
    edges = [0, *(np.flatnonzero(apart | kicked) + 1).tolist(), len(arcs)]
    parts = (arcs[first:last] for first, last in zip(edges[:-1], edges[1:], strict=True))
    return [
        path_of(path.orbit, part, np.array([0, len(part)]), ())
        for part in parts
        if part[-1, END] - part[0, START] > SHORTEST
    ]


def edges_of(pieces: Sequence[Path]) -> Floats:
    """Return the start and end times of the pieces of one spacecraft [s], to a nanosecond."""
    return np.unique(np.round([[piece.start, piece.end] for piece in pieces], 9))


def kicks_of(path: Path) -> Floats:
    """Return the times of the velocity jumps of one spacecraft [s], to a nanosecond."""
    jumps = path.arcs[:, IMPULSE : IMPULSE + 3].any(axis=1)
    times: Floats = np.round(path.arcs[jumps, START], 9)
    return times


def common_nodes(edges: Sequence[Floats], kicks: Sequence[Floats], step: float) -> tuple[Floats, Floats]:
    """Return common nodes: multiples of a step and the edges of all spacecraft; and the times of impulses.

    Nodes that are much closer than the others amplify rounding in polynomials. Only impulses, which a
    screening needs, may be so close.
    """
    first, last = min(times[0] for times in edges), max(times[-1] for times in edges)
    fired = spaced(np.unique(np.concatenate([[first, last], *kicks])), APART)
    others = np.unique(np.concatenate(edges))
    others = spaced(others[distance(others, fired) > NEAR * step], NEAR * step)
    every = np.union1d(fired, others)
    grid = np.round(step * np.arange(np.ceil(first / step), np.floor(last / step) + 1), 9)
    return np.union1d(grid[distance(grid, every) > NEAR * step], every), fired


def spaced(times: Floats, gap: float) -> Floats:
    """Return increasing times without those closer than a gap to the previous one that is kept."""
    kept: list[float] = []
    for time in times.tolist():
        if not kept or time - kept[-1] > gap:
            kept.append(time)
    return np.array(kept)


def distance(times: Floats, others: Floats) -> Floats:
    """Return the distance of each time from the nearest of some increasing times."""
    apart: Floats = np.abs(times - others[nearest(others, times)])
    return apart


def nodes_of(piece: Path, common: Floats, fired: Floats, step: float) -> Floats:
    """Return the nodes of a smooth piece: its ends, and the common ones between; at least COUNT."""
    ends: Floats = np.round([piece.start, piece.end], 9)
    room = np.where(np.isin(common, fired), APART, NEAR * step)
    inside = common[(common > ends[0] + room) & (common < ends[1] - room)]
    times = np.concatenate([ends[:1], inside, ends[1:]])
    return times if len(times) >= COUNT else np.linspace(ends[0], ends[1], COUNT)
