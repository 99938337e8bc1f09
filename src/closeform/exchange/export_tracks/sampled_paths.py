"""Exported tracks of spacecraft: paths sampled at nodes dense enough for polynomials between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np

from closeform.arrays import Floats
from closeform.exchange.ephemerides.interpolation import hermite
from closeform.exchange.export_tracks.interpolation_nodes import (
    COUNT,
    common_nodes,
    edges_of,
    kicks_of,
    nodes_of,
    smooth_pieces,
)
from closeform.exchange.export_tracks.track import FileFrame, Piece, Shots, Track
from closeform.motion.arc import START
from closeform.motion.path import Path

if TYPE_CHECKING:
    from closeform.uncertainty.errors import Uncertainty

STEPS = (20.0, 10.0, 5.0, 2.0, 1.0, 0.5, 0.2, 0.1)  # s; with 60 a screening is millimetres off under thrust
GOAL, COARSE = 1e-6, 1e-3  # m: error of states between nodes, for automatic and for given steps
LOOKED_AT = 300  # intervals of a piece in whose middles the error of polynomials is measured
NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)
KNOWN = 24  # epochs with covariances in an orbit
TURN = 0.5  # rad of the frame's rotation, within which 16 Gauss points integrate thrust to the last digits


@dataclass(frozen=True, eq=False)
class ExportedCraft:
    """One spacecraft's `path` through all stages, with its `burns` in Hill's frame; its `mass` [kg] if known.

    `spread` holds its path in each stage, with its errors at the start of the stage; empty without errors.
    """

    name: str
    object_id: str
    path: Path
    burns: Shots
    mass: float | None = None
    spread: tuple[tuple[Path, Uncertainty], ...] = ()


def tracks(craft: Sequence[ExportedCraft], frame: FileFrame, step: float | None = None) -> tuple[Track, ...]:
    """Return all spacecraft at common nodes, `step` [s] or the longest accurate step apart, and at edges.

    Raises ValueError if a given step causes a larger error between nodes.
    """
    pieces = [smooth_pieces(one.path) for one in craft]
    edges, kicks = [edges_of(parts) for parts in pieces], [kicks_of(one.path) for one in craft]
    nodes: list[list[Floats]] = []
    errors = [inf]
    for wanted in STEPS if step is None else (step,):
        common, fired = common_nodes(edges, kicks, wanted)
        denser = [[nodes_of(part, common, fired, wanted) for part in parts] for parts in pieces]
        found = [
            max(error(part, times, frame) for part, times in zip(parts, own, strict=True))
            for parts, own in zip(pieces, denser, strict=True)
        ]
        if max(found) >= max(errors):
            break  # by rounding
        nodes, errors = denser, found
        if max(errors) <= GOAL:
            break
    if step is not None and max(errors) > COARSE:
        off = f"causes errors between nodes of up to {max(errors):.2g} m, more than {COARSE:g} m"
        raise ValueError(f"step: {step:g} s {off}; reduce it, or leave it out")
    return tuple(
        Track(
            one.name,
            one.object_id,
            tuple(
                sampled_piece(part, times, frame, one.spread) for part, times in zip(parts, own, strict=True)
            ),
            off,
            turned(one, frame),
            one.mass,
        )
        for one, parts, own, off in zip(craft, pieces, nodes, errors, strict=True)
    )


def sampled_piece(
    piece: Path, times: Floats, frame: FileFrame, spread: Sequence[tuple[Path, Uncertainty]] = ()
) -> Piece:
    """Return states and thrust of a piece at its nodes, and covariances at some of them."""
    relative, thrust = rows(piece, times), rows(piece, times, 3)
    found = Piece(times, frame.states(times, relative), frame.vectors(times, relative, thrust))
    if not spread:
        return found
    some = sparse(times, piece.orbit._rate)
    known = times[some]
    matrices = frame.covariances(known, relative[some], covariances(spread, known))
    return replace(found, known=known, covariances=matrices)


def sparse(times: Floats, mean_motion: float) -> Any:
    """Return the indices of the nodes (T,) of a piece with covariances, always the first, never the last.

    A covariance at a burn belongs to the next piece, after the burn.
    """
    whole = 2.0 * np.pi / mean_motion if mean_motion > 0.0 else times[-1] - times[0]
    return np.unique(np.searchsorted(times[:-1], np.arange(times[0], times[-2], whole / KNOWN)))


def covariances(spread: Sequence[tuple[Path, Uncertainty]], times: Floats) -> Floats:
    """Return covariances (C, 6, 6) at increasing times, in the frame of the paths, after impulses."""
    begins = np.array([path.start for path, _ in spread])
    stage = np.maximum(np.searchsorted(begins, times, side="right") - 1, 0)
    found = np.empty((len(times), 6, 6))
    for k, (path, errors) in enumerate(spread):
        found[stage == k] = errors.covariance(path, np.clip(times[stage == k], path.start, path.end))
    return found


def error(piece: Path, times: Floats, frame: FileFrame) -> float:
    """Return the error of polynomials through the nodes of a piece [m], in the middle between two nodes."""
    which = np.unique(np.linspace(0, len(times) - 2, LOOKED_AT).astype(int))
    middles = 0.5 * (times[which] + times[which + 1])
    truth, states = (frame.states(some, rows(piece, some)) for some in (middles, times))
    off = hermite(times, states, middles, COUNT)[0][:, :3] - truth[:, :3]
    return float(np.linalg.norm(off, axis=1).max())


def rows(piece: Path, times: Floats, columns: int = 6) -> Floats:
    """Return states (T, 6), or thrusts (T, 3), of one spacecraft; at an end of its path those inside it."""
    found: Floats = piece._evaluate_rows(times[None], columns)[0]
    return found


def turned(craft: ExportedCraft, frame: FileFrame) -> Shots:
    """Return the burns of a spacecraft along the axes of the file; a long burn is integrated along them."""
    burns, path = craft.burns, craft.path
    if frame.chief is None or not len(burns):
        return burns
    middles = burns.start + 0.5 * burns.duration
    push = frame.vectors(middles, rows(path, middles), burns.push)
    for k in np.flatnonzero((burns.duration > 0.0) & (burns.thruster == 0)):
        push[k] = integral(path, burns.start[k], burns.duration[k], frame)
    return replace(burns, push=push)


def integral(path: Path, start: float, duration: float, frame: FileFrame) -> Floats:
    """Return the integral of thrust over a burn along the axes of the file (3,) [m/s], by Gauss's rule."""
    inside = path.arcs[:, START]
    inside = inside[(inside > start) & (inside < start + duration)]
    edges = np.concatenate([[start], inside, [start + duration]])
    found = np.zeros(3)
    for first, last in zip(edges[:-1], edges[1:], strict=True):
        count = int(np.ceil(path.orbit._rate * (last - first) / TURN)) or 1
        half = 0.5 * (last - first) / count
        times = (first + half * (2.0 * np.arange(count)[:, None] + 1.0 + NODES)).ravel()
        thrust = frame.vectors(times, rows(path, times), rows(path, times, 3))
        found += half * np.tile(WEIGHTS, count) @ thrust
    return found
