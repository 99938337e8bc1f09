"""Tracks of all craft as executed, before avoidance and as planned, by cubics; and their uncertainty."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.mission.mission_result import StageResult
from closeform.motion.arc import IMPULSE, START, STATE
from closeform.motion.path import Path
from closeform.viewer.numbers import Numbers
from closeform.viewer.shown import Shown

Record = dict[str, Any]
DETAIL = 1e-4  # of the scene's size: tolerance of a track
ZONE_DETAIL = 0.01  # of the smallest zone, which can fill the page in a close view
ROUNDING = 2.0**-22  # of the largest coordinate: two roundings to Float32
PIECES = 16  # minimum per orbit: n h = 0.4, where the error of a cubic is about 1e-4 of the path
PROBES = np.arange(1, 8) / 8.0  # shares of a piece at which it is compared with the path
HALVED = 40  # largest number of bisections: the pieces are then a few rounding errors of time long
USUAL = 3.0  # sigmas of a tube by default
SAMPLES, ALL_SAMPLES, FEWEST = 96, 4800, 24  # times: most of one craft, of all; fewest
UPPER = np.triu_indices(3)


def error_for(corners: Floats, smallest: float | None) -> float:
    """Return the tolerance [m] of tracks within two `corners`; `smallest`: radius of the smallest zone."""
    wide = float(np.linalg.norm(corners[1] - corners[0]))
    wanted = DETAIL * wide if smallest is None else min(DETAIL * wide, ZONE_DETAIL * smallest)
    return max(wanted, ROUNDING * float(np.abs(corners).max()), 1e-6)


def track(numbers: Numbers, path: Path, craft: int, stage: int, kind: str, error: float) -> Record:
    """Return one `Track` of web/scene.d.ts for one craft's path."""
    nodes = nodes_of(path, 0.5 * error)  # Float32 rounding takes the other half
    return {
        "craft": craft,
        "stage": stage,
        "kind": kind,
        "start": float(path.start),
        "end": float(path.end),
        "times": numbers.block(nodes.times, "f8"),
        "states": numbers.block(nodes.states),
    }


def tracks(shown: Shown, numbers: Numbers, error: float) -> list[Record]:
    """Return every track except drifts after a failure; executed paths ("executed") come first."""
    return [
        track(numbers, path, craft, result.number, kind, error)
        for kind, ways in (("executed", executed), ("before", before), ("planned", planned))
        for result in shown.results
        for craft, path in ways(result)
    ]


def executed(result: StageResult[Any, Any]) -> Iterator[tuple[int, Path]]:
    """Yield the index and the executed path of every craft."""
    paths = result.after.paths
    yield from ((k, paths[k]) for k in range(len(paths)))


def before(result: StageResult[Any, Any]) -> Iterator[tuple[int, Path]]:
    """Yield the paths before avoidance of craft whose planned paths differ."""
    yield from differing(result.before.paths, result.planned.paths)


def planned(result: StageResult[Any, Any]) -> Iterator[tuple[int, Path]]:
    """Yield the planned paths of craft that fire pulses instead."""
    yield from differing(result.planned.paths, result.after.paths)


def differing(paths: Path, others: Path) -> Iterator[tuple[int, Path]]:
    """Yield the index and path of each craft whose path differs from that in `others`."""
    if paths is others:
        return
    for k in range(len(paths)):
        one, other = paths[k], others[k]
        if one.arcs.shape != other.arcs.shape or (one.arcs != other.arcs).any():
            yield k, one


# ----- nodes of cubic Hermite pieces


class Nodes(NamedTuple):
    """States (K, 6) [m, m/s] at `times` (K,) [s]; an impulse has two, before and after it."""

    times: Floats
    states: Floats


def nodes_of(path: Path, error: float) -> Nodes:
    """Return the nodes of a path; the cubic pieces between them deviate from it by at most `error` [m]."""
    arcs = path.arcs
    kicked = arcs[np.abs(arcs[:, IMPULSE : IMPULSE + 3]).any(axis=1)]
    edges = [float(path.start), *kicked[:, START].tolist(), float(path.end)]
    before = kicked[:, STATE : STATE + 6].copy()
    before[:, 3:] -= kicked[:, IMPULSE : IMPULSE + 3]
    ends = [*before, states_at(path, np.array([path.end]))[0]]
    parts = [
        between(path, start, end, last, error)
        for start, end, last in zip(edges[:-1], edges[1:], ends, strict=True)
    ]
    if len(kicked) and kicked[-1, START] == path.end:  # the path ends with an impulse
        parts.append(Nodes(np.array([path.end]), kicked[-1:, STATE : STATE + 6]))
    return Nodes(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def between(path: Path, start: float, end: float, last: Floats, error: float) -> Nodes:
    """Return the nodes between two impulses; `last` (6,) is the state before the second."""
    if end <= start:
        return Nodes(np.array([end]), last[None])
    pieces = max(1, int(np.ceil(PIECES * (end - start) / path.orbit.period)))
    times = np.linspace(start, end, pieces + 1)
    states = states_at(path, times)
    states[-1] = last
    fresh = np.arange(pieces)  # pieces that are not yet checked
    for _ in range(HALVED):
        begin, length = times[fresh], times[fresh + 1] - times[fresh]
        looked = begin[:, None] + length[:, None] * PROBES
        true = states_at(path, looked.ravel())[:, :3].reshape(*looked.shape, 3)
        off = cubic(states[fresh], states[fresh + 1], length, PROBES) - true
        wrong = fresh[np.linalg.norm(off, axis=2).max(axis=1) > error]
        if not len(wrong):
            break
        middles = 0.5 * (times[wrong] + times[wrong + 1])
        times = np.insert(times, wrong + 1, middles)
        states = np.insert(states, wrong + 1, states_at(path, middles), axis=0)
        firsts = wrong + np.arange(len(wrong))
        fresh = np.stack([firsts, firsts + 1], axis=1).ravel()
    return Nodes(times, states)


def cubic(start: Floats, end: Floats, length: Floats, shares: Floats) -> Floats:
    """Return positions (M, S, 3) at `shares` (S,) of cubic Hermite pieces from states to states (M, 6)."""
    s, h = shares[None, :, None], length[:, None, None]
    r, v, q, w = start[:, None, :3], start[:, None, 3:], end[:, None, :3], end[:, None, 3:]
    blend = s * s * (3.0 - 2.0 * s)
    return np.asarray(r + blend * (q - r) + h * s * (1.0 - s) * ((1.0 - s) * v - s * w))


def states_at(path: Path, times: Floats) -> Floats:
    """Return the states (K, 6) of one craft."""
    return np.asarray(path._evaluate_rows(times[None])[0])


# ----- uncertainty along the executed paths


def tubes(shown: Shown, numbers: Numbers) -> list[dict[str, Any]]:
    """Return every `Tube` of web/scene.d.ts."""
    found = []
    for result in shown.results:
        if result.uncertain is None:
            continue
        many = result.stage.sigmas or USUAL
        count = int(np.clip(ALL_SAMPLES / len(result.after.names), FEWEST, SAMPLES))
        times = np.linspace(result.start, result.end, count + 1)
        for craft, errors in enumerate(result.uncertain.errors):
            if errors is None:
                continue
            spread = many**2 * errors.covariance(result.after.paths[craft], times)[:, :3, :3]
            rows = np.column_stack([times - result.start, spread[:, *UPPER]])
            found.append(
                {"craft": craft, "stage": result.number, "sigmas": float(many), "rows": numbers.block(rows)}
            )
    return found
