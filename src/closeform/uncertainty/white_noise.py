"""Process noise: increments of a craft's state in steps, equivalent to velocity changes between them.

The increments of steps are normal and independent. Of all motions that lead to them, natural motion within
each step is used, with a change of velocity between two: paths stay continuous, and states are exact at the
ends of steps. The remaining deviation within a step is bounded.

Steps of a block's half, quarter and so on are sampled by halving (Levy's construction), so that the samples
of long steps do not change if shorter ones or more of them are requested.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from math import ceil, log2
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.motion.arc import END, IMPULSE, MEAN_MOTION, PUSH, START, STATE, THRUST, WIDTH
from closeform.motion.path import Path, path_of
from closeform.motion.steering import transition_matrices
from closeform.uncertainty.covariance_propagation import fill_noise_root

# theory (65)
# In units of sqrt(q h^3): deviation in a step h that is exceeded with a probability below 1e-13.
OFF = 1.2
ENOUGH, MOST_OFF = 1e-3, 0.1  # of the zone's inner radius: target and largest deviation
STEPS = 10_000  # maximum number of steps
ANGLE = 0.2  # largest n h for which (65) holds
BLOCK = 4096.0  # s, length of the interval that is halved
SAME = 1e-6  # of a step: tolerance of equal times
ROUNDED = 1e-9  # of a path's duration: the same

Normal = Callable[[int, int], Floats]  # from level and rows to normal numbers (C, rows, 6)


def step_for_zone(n: float, density: float, radius: float, span: float) -> float:
    """Return the step [s] for noise [m^2/s^3] whose deviation is a thousandth of a zone.

    The step is longer if the span would otherwise have more than ten thousand steps.
    """
    longest = (ENOUGH * radius / OFF) ** (2 / 3) / density ** (1 / 3)
    return float(min(max(longest, span / STEPS), ANGLE / n if n > 0.0 else np.inf, span))


def deviation_in_step(density: float, step: float) -> float:
    """Return the deviation by noise [m^2/s^3] within a step [s], in metres.

    theory (65)
    """
    return OFF * float(np.sqrt(density * step**3))


def halvings_for(step: float) -> int:
    """Return the number of halvings of a block down to steps that are no longer than `step`."""
    return max(0, ceil(log2(BLOCK / step) - SAME))


def increments(n: float, level: int, count: int, normal: Normal) -> Floats:
    """Return the increments of a state by noise of density 1 in `count` steps (C, count, 6), of a `level`.

    theory (66)
    """
    step = BLOCK
    found = normal(0, _steps_before_halving(count, level)) @ step_noise(n, step)[1].T
    for k in range(1, level + 1):
        step *= 0.5
        flow, gain, root = _midpoint(n, step)
        first = found @ gain.T + normal(k, found.shape[1]) @ root.T
        both = np.stack([first, found - first @ flow.T], axis=2)
        found = both.reshape(len(found), -1, 6)[:, : _steps_before_halving(count, level - k)]
    return np.ascontiguousarray(found)


@lru_cache
def step_noise(n: float, step: float) -> tuple[Floats, Floats]:
    """Return the transition of a step (6, 6), and a root (6, 6) of the covariance of unit noise.

    theory (9)
    """
    root = np.empty((6, 6))
    fill_noise_root(n, step, root)
    return transition_matrices(n, np.array(step)), root


def velocity_changes(n: float, step: float, pushes: Floats) -> Floats:
    """Return the changes of velocity (C, K, 3) at step starts that give increments `pushes` (C, K, 6)."""
    both = pushes @ end_changes(n, step).T
    kicks = both[..., :3].copy()
    kicks[:, 1:] += both[:, :-1, 3:]
    return kicks


@lru_cache
def end_changes(n: float, step: float) -> Floats:
    """Return the changes of velocity at a step's start and end, (6, 6), from the increment of the state."""
    flow = step_noise(n, step)[0]
    first = np.hstack([np.linalg.inv(flow[:3, 3:]), np.zeros((3, 3))])
    last = np.hstack([np.zeros((3, 3)), np.eye(3)]) - flow[3:, 3:] @ first
    return np.vstack([first, last])


def instants_until(times: Floats, step: float) -> Any:
    """Return the number of instants, from 0 onward, up to and including some times [s]."""
    return np.floor(times / step + SAME).astype(np.int64) + 1


def _steps_before_halving(count: int, times: int) -> int:
    """Return the number of steps that give at least `count` after some halvings."""
    return -(-count // (1 << times))


@lru_cache
def _midpoint(n: float, step: float) -> tuple[Floats, Floats, Floats]:
    """Return for two steps: transition of one, gain of the first from the sum, and a residual root."""
    sizes = np.repeat([step**1.5, step**0.5], 3)[:, None]
    moves, scaled = step_noise(n, step)
    flow, scaled = moves * sizes.T / sizes, scaled / sizes
    gained = scaled @ scaled.T
    moved = flow @ gained
    gain = np.linalg.solve(moved @ flow.T + gained, moved).T
    rest = gained - gain @ moved
    root = np.linalg.cholesky(0.5 * (rest + rest.T))
    return moves, np.asarray(gain * sizes / sizes.T), np.asarray(sizes * root)


def with_velocity_changes(path: Path, times: Floats, kicks: Floats) -> Path:
    """Return one craft's path with changes of velocity (K, 3) [m/s] at sorted times (K,) [s].

    Changes before its start have acted by natural motion; those after its end are ignored. They are no
    impulses of the path and have no cost.
    """
    times = np.where(np.abs(times - path.end) < ROUNDED * (path.end - path.start), path.end, times)
    times = np.where(np.abs(times - path.start) < ROUNDED * (path.end - path.start), path.start, times)
    after = _states_after(path, times, kicks)
    arcs = _cut_arcs(path, times[(times > path.start) & (times < path.end)])
    if len(times) and times[-1] == path.end:
        arcs = np.vstack([arcs, _arc_at_end(path)])
    begins = arcs[:, START]
    last = np.searchsorted(times, begins, side="right") - 1
    some = last >= 0
    moved = path.orbit.transition(begins[some] - times[last[some]])
    arcs[some, STATE : STATE + 6] += np.einsum("kij,kj->ki", moved, after[last[some]])
    return path_of(path.orbit, arcs, np.array([0, len(arcs)]), ())


def _states_after(path: Path, times: Floats, kicks: Floats) -> Floats:
    """Return the states (K, 6) that result from changes of velocity, from rest, after each of them."""
    found, state = np.zeros((len(times), 6)), np.zeros(6)
    flows = path.orbit.transition(np.diff(times, prepend=times[:1]))
    for k, (flow, kick) in enumerate(zip(flows, kicks, strict=True)):
        state = flow @ state
        state[3:] += kick
        found[k] = state
    return found


def _cut_arcs(path: Path, times: Floats) -> Floats:
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
    arcs[later] = _remainders(path, arcs[later], begins[later])
    same = np.append(rows[1:] == rows[:-1], False)
    arcs[same, END] = begins[1:][same[:-1]]
    return np.asarray(arcs)


def _remainders(path: Path, arcs: Floats, times: Floats) -> Floats:
    """Return the remainders of arcs (K, 30) from times (K,) within them on."""
    found, n, span = arcs.copy(), arcs[:, MEAN_MOTION], times - arcs[:, START]
    each = path_of(path.orbit, np.ascontiguousarray(arcs), np.arange(len(arcs) + 1), (len(arcs),))
    found[:, STATE : STATE + 6] = each._evaluate_rows(np.ascontiguousarray(times[:, None]))[:, 0]
    found[:, START], found[:, IMPULSE : IMPULSE + 3] = times, 0.0
    primer = path.orbit.transition(span)
    found[:, THRUST:PUSH] = np.einsum("kij,kj->ki", primer, arcs[:, THRUST:PUSH])
    rates = arcs[:, PUSH:].reshape(-1, 4, 3)
    found[:, PUSH:] = np.einsum("kij,kjl->kil", _thrust_transition(n, span), rates).reshape(-1, WIDTH - PUSH)
    return found


def _thrust_transition(n: Floats, span: Floats) -> Any:
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


def _arc_at_end(path: Path) -> Floats:
    """Return an arc of zero duration at a path's end."""
    arc = np.zeros((1, WIDTH))
    arc[0, [START, END, MEAN_MOTION]] = path.end, path.end, path.orbit.mean_motion
    arc[0, STATE : STATE + 6] = path.state(path.end)
    return arc
