"""Paths with velocity disturbances: changes of velocity without a thruster firing."""

from __future__ import annotations

from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.motion.arc import END, IMPULSE, MEAN_MOTION, PUSH, START, STATE, THRUST, WIDTH
from closeform.motion.path import Path, path_of

ROUNDED = 1e-9  # of a path's duration


def kicked(path: Path, times: Floats, kicks: Floats) -> Path:
    """Return one craft's path with changes of velocity (K, 3) [m/s] at sorted times (K,) [s].

    Changes before its start have acted by natural motion; those after its end are ignored. They are no
    impulses of the path and have no cost.
    """
    times = np.where(np.abs(times - path.end) < ROUNDED * (path.end - path.start), path.end, times)
    times = np.where(np.abs(times - path.start) < ROUNDED * (path.end - path.start), path.start, times)
    after = _led(path, times, kicks)
    arcs = _cut(path, times[(times > path.start) & (times < path.end)])
    if len(times) and times[-1] == path.end:
        arcs = np.vstack([arcs, _at_end(path)])
    begins = arcs[:, START]
    last = np.searchsorted(times, begins, side="right") - 1
    some = last >= 0
    moved = path.orbit.transition(begins[some] - times[last[some]])
    arcs[some, STATE : STATE + 6] += np.einsum("kij,kj->ki", moved, after[last[some]])
    return path_of(path.orbit, arcs, np.array([0, len(arcs)]), ())


def _led(path: Path, times: Floats, kicks: Floats) -> Floats:
    """Return the states (K, 6) that result from changes of velocity, from rest, after each of them."""
    found, state = np.zeros((len(times), 6)), np.zeros(6)
    flows = path.orbit.transition(np.diff(times, prepend=times[:1]))
    for k, (flow, kick) in enumerate(zip(flows, kicks, strict=True)):
        state = flow @ state
        state[3:] += kick
        found[k] = state
    return found


def _cut(path: Path, times: Floats) -> Floats:
    """Return the arcs of a path, each cut at the times within it."""
    old = path.arcs
    begins = np.concatenate([old[:, START], np.setdiff1d(times, old[:, START])])
    rows = np.concatenate(
        [np.arange(len(old)), np.searchsorted(old[:, START], begins[len(old) :], side="right") - 1]
    )
    order = np.lexsort((rows, begins))
    begins, rows = begins[order], rows[order]
    arcs, own = old[rows], begins == old[rows, START]
    later = ~own
    arcs[later] = _since(path, arcs[later], begins[later])
    same = np.append(rows[1:] == rows[:-1], False)
    arcs[same, END] = begins[1:][same[:-1]]
    return np.asarray(arcs)


def _since(path: Path, arcs: Floats, times: Floats) -> Floats:
    """Return the remainders of arcs (K, 30) from times (K,) within them on."""
    found, n, span = arcs.copy(), arcs[:, MEAN_MOTION], times - arcs[:, START]
    each = path_of(path.orbit, np.ascontiguousarray(arcs), np.arange(len(arcs) + 1), (len(arcs),))
    found[:, STATE : STATE + 6] = each._evaluate_rows(np.ascontiguousarray(times[:, None]))[:, 0]
    found[:, START], found[:, IMPULSE : IMPULSE + 3] = times, 0.0
    primer = path.orbit.transition(span)
    found[:, THRUST:PUSH] = np.einsum("kij,kj->ki", primer, arcs[:, THRUST:PUSH])
    rates = arcs[:, PUSH:].reshape(-1, 4, 3)
    found[:, PUSH:] = np.einsum("kij,kjl->kil", _shifts(n, span), rates).reshape(-1, WIDTH - PUSH)
    return found


def _shifts(n: Floats, span: Floats) -> Any:
    """Return the transition (K, 4, 4) of a thrust and its first three derivatives: of 1, t, P1, P2."""
    turn = n * span
    found = np.zeros((len(span), 4, 4))
    sine, versed = np.sinc(turn / np.pi), np.sinc(0.5 * turn / np.pi)
    p0, p1 = span * sine, 0.5 * (span * versed) ** 2
    small = np.abs(turn) < 0.1
    whole = np.where(small, 1.0, turn)
    near = (1.0 - turn**2 / 20.0 * (1.0 - turn**2 / 42.0 * (1.0 - turn**2 / 72.0))) / 6.0
    p2 = span**3 * np.where(small, near, (whole - np.sin(whole)) / whole**3)
    found[:, [0, 1, 2, 3], [0, 1, 2, 3]] = np.stack([span**0, span**0, np.cos(turn), np.cos(turn)], axis=1)
    found[:, 0, 1], found[:, 0, 2], found[:, 0, 3] = span, p1, p2
    found[:, 1, 2], found[:, 1, 3], found[:, 2, 3] = p0, p1, p0
    found[:, 3, 2] = -n * n * p0
    return found


def _at_end(path: Path) -> Floats:
    """Return an arc of zero duration at a path's end."""
    arc = np.zeros((1, WIDTH))
    arc[0, [START, END, MEAN_MOTION]] = path.end, path.end, path.orbit.mean_motion
    arc[0, STATE : STATE + 6] = path.state(path.end)
    return arc
