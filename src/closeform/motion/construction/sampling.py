"""Arcs through states at given times."""

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, finite
from closeform.motion.arc import END, IMPULSE, MEAN_MOTION, START, STATE, WIDTH
from closeform.motion.duration import flaw
from closeform.motion.effort import ENERGY, totals
from closeform.motion.path import Path, path_of
from closeform.motion.steering import steer

# Share of the energy of cubics through the same samples up to which natural motion is preferred. Ten times as
# much: where oblateness or thrust bends paths, natural motion is chosen with samples half an hour apart, with
# 1.5 times the error of cubics (GRACE). A tenth: an hour apart cubics are chosen, with five times the error.
COASTING = 0.1


def nodes_of(times: ArrayLike, states: ArrayLike) -> tuple[Floats, Floats]:
    """Return increasing times (T,) and the states (..., T, 6) at them, validated."""
    instants = finite("times", times)
    nodes = finite("states", states, 6)
    if instants.ndim != 1 or len(instants) < 2 or nodes.shape[-2:-1] != instants.shape:
        raise ValueError(
            "states: expected shape (..., T, 6) for T >= 2 times, "
            f"got {nodes.shape} for times of shape {instants.shape}"
        )
    if not (np.diff(instants) > 0).all():
        raise ValueError("times: must increase strictly")
    return instants, nodes


def arcs_through(
    mean_motion: float, times: ArrayLike, states: ArrayLike, arrivals: Floats | None = None
) -> Floats:
    """Return arcs (..., T - 1, 30) that connect states (..., T, 6) at times (T,).

    Where `arrivals` (..., T, 6) differ from `states`, arcs end there, and an impulse follows.
    """
    instants, nodes = nodes_of(times, states)
    if wrong := flaw(np.diff(instants), mean_motion):
        raise ValueError(f"times: each interval {wrong}")
    arcs = np.zeros((*nodes.shape[:-2], len(instants) - 1, WIDTH))
    arcs[..., START] = instants[:-1]
    arcs[..., END] = instants[1:]
    arcs[..., STATE : STATE + 6] = nodes[..., :-1, :]
    ends = nodes if arrivals is None else arrivals
    arcs[..., 1:, IMPULSE : IMPULSE + 3] = (nodes - ends)[..., 1:-1, 3:]
    finals = np.ascontiguousarray(ends[..., 1:, :]).reshape(-1, 6)
    return interpolated(mean_motion, arcs.reshape(-1, WIDTH), finals).reshape(arcs.shape)


def fired_at_ends(path: Path, jumps: Floats) -> Path:
    """Return paths (N,) of one time span with added velocity jumps (N, 2, 3) [m/s] at its start and end."""
    arcs = path.arcs.copy()
    arcs[path.offsets[:-1], IMPULSE : IMPULSE + 3] = jumps[:, 0]
    last = np.flatnonzero(jumps[:, 1].any(axis=1))
    after = np.zeros((len(last), WIDTH))  # arcs of zero duration, as in planned impulses
    after[:, START] = after[:, END] = path.end[last]
    after[:, MEAN_MOTION] = path.orbit.mean_motion
    after[:, STATE : STATE + 6] = path.state(float(path.end[0]))[last]
    after[:, STATE + 3 : STATE + 6] += jumps[last, 1]
    after[:, IMPULSE : IMPULSE + 3] = jumps[last, 1]
    more = np.isin(np.arange(len(path)), last)
    offsets = path.offsets + np.concatenate([[0], np.cumsum(more)])
    return path_of(path.orbit, np.insert(arcs, path.offsets[last + 1], after, axis=0), offsets, path.shape)


def interpolated(n: float, arcs: Floats, finals: Floats) -> Floats:
    """Return arcs from their states to the final ones: natural motion in coasts, cubics elsewhere."""
    cubic, hill = arcs.copy(), arcs.copy()
    hill[:, MEAN_MOTION] = n
    each = np.arange(len(arcs) + 1)
    energies = np.empty((2, len(arcs)))
    for rows, motion, energy in ((cubic, 0.0, energies[0]), (hill, n, energies[1])):
        steer(motion, rows, finals)
        totals(rows, each, n, ENERGY, energy)
    coasts = energies[1] <= COASTING * energies[0]
    return np.where(coasts[:, None], hill, cubic)
