"""Nodes of the cubic Hermite pieces that represent a path on the page."""

from typing import NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.motion.arc import IMPULSE, START, STATE
from closeform.motion.path import Path

PIECES = 16  # minimum per orbit: n h = 0.4, where the error of a cubic is about 1e-4 of the path
PROBES = np.arange(1, 8) / 8.0  # shares of a piece at which it is compared with the path
HALVED = 40  # largest number of bisections: the pieces are then a few rounding errors of time long


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
