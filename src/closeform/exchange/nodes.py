"""Nodes: where states of a path are told, so that polynomials between them give the rest."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from closeform.arrays import Floats
from closeform.exchange.interpolation import nearest
from closeform.motion.arc import END, IMPULSE, START
from closeform.motion.path import Path, path_of

COUNT = 4  # nodes that one of Hermite's polynomials goes through
DEGREE = 2 * COUNT - 1
SMOOTH = 1e-6  # of the greatest thrust: a jump that is rounding, or a piece of saturated thrust
NEAR = 0.25  # of a step: nodes that are nearer to another node are left out
SHORTEST = 1e-6  # s: what lasts no longer has no nodes
APART = 1e-3  # s: kicks of two craft that are nearer are one


def smooth_pieces(path: Path) -> list[Path]:
    """One craft's path cut where its velocity or its thrust jumps."""
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
    """When the pieces of one craft begin and end [s], to a nanosecond."""
    return np.unique(np.round([[piece.start, piece.end] for piece in pieces], 9))


def kicks_of(path: Path) -> Floats:
    """When the velocity of one craft jumps [s], to a nanosecond."""
    jumps = path.arcs[:, IMPULSE : IMPULSE + 3].any(axis=1)
    times: Floats = np.round(path.arcs[jumps, START], 9)
    return times


def common_nodes(edges: Sequence[Floats], kicks: Sequence[Floats], step: float) -> tuple[Floats, Floats]:
    """Times for everybody: multiples of a step, and between them the edges of all craft; those of all kicks.

    Nodes much nearer to each other than to the rest make polynomials of rounding, so that only kicks, which a
    screening needs, may be.
    """
    first, last = min(times[0] for times in edges), max(times[-1] for times in edges)
    fired = spaced(np.unique(np.concatenate([[first, last], *kicks])), APART)
    others = np.unique(np.concatenate(edges))
    others = spaced(others[distance(others, fired) > NEAR * step], NEAR * step)
    every = np.union1d(fired, others)
    grid = np.round(step * np.arange(np.ceil(first / step), np.floor(last / step) + 1), 9)
    return np.union1d(grid[distance(grid, every) > NEAR * step], every), fired


def spaced(times: Floats, gap: float) -> Floats:
    """Of times that rise those that are a gap behind the last that is kept."""
    kept: list[float] = []
    for time in times.tolist():
        if not kept or time - kept[-1] > gap:
            kept.append(time)
    return np.array(kept)


def distance(times: Floats, others: Floats) -> Floats:
    """How far each time is from the nearest of some others, which rise."""
    apart: Floats = np.abs(times - others[nearest(others, times)])
    return apart


def nodes_of(piece: Path, common: Floats, fired: Floats, step: float) -> Floats:
    """The nodes of a smooth piece: its ends, and of the common ones those between; COUNT at least."""
    ends: Floats = np.round([piece.start, piece.end], 9)
    room = np.where(np.isin(common, fired), APART, NEAR * step)
    inside = common[(common > ends[0] + room) & (common < ends[1] - room)]
    times = np.concatenate([ends[:1], inside, ends[1:]])
    return times if len(times) >= COUNT else np.linspace(ends[0], ends[1], COUNT)
