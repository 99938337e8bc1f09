"""Minimum delta-v around a sphere by sequential convex programs (Clarabel), from 61 times, then bisected.

The certified search of closeform finds the conflicts, an advantage that such programs usually do not have.
"""

from dataclasses import dataclass
from typing import Any

import clarabel
import numpy as np
from scipy import sparse
from scipy.linalg import expm

import closeform as cf
from peers.motion import Array

TIMES, ROUNDS = 61, 25
AIM = 1.0001  # of the zone, for its planes
LEAST, USED, CLOSEST = 1e-7, 1e-4, 2e-4  # of all delta-v, twice; of the duration, to which times are bisected
SETTLED = 3e-5  # share by which a clear round must be cheaper
TURNED = 0.3  # of the zone, from which on planes are turned


@dataclass
class Passage:
    """A transfer past an obstacle with a sphere about it."""

    orbit: cf.Orbit
    initial: Array
    final: Array
    duration: float
    obstacle: cf.Path
    radius: float


def plan(passage: Passage, sides: int) -> float:
    """Delta-v of the cheapest clear path from some sides of the obstacle [m/s]; nan where none is found."""
    times = np.linspace(0.0, passage.duration, TIMES)
    free = solve(passage, times, [])
    if free is None:
        return np.nan
    path = flown(passage, times, free)
    missed = cf.find_conflicts(path, passage.obstacle, cf.Sphere(passage.radius))
    if not missed:
        return float(np.linalg.norm(free, axis=1).sum())
    time = min(missed, key=lambda one: one.ratio).time
    apart = path.position(time) - passage.obstacle.position(time)
    ahead = path.velocity(time) - passage.obstacle.velocity(time)
    ahead /= np.linalg.norm(ahead)
    across = apart - (apart @ ahead) * ahead
    across /= np.linalg.norm(across)
    beside = np.cross(ahead, across)
    angles = 2 * np.pi * np.arange(sides) / sides
    found = [refined(passage, time, np.cos(angle) * across + np.sin(angle) * beside) for angle in angles]
    return float(np.nanmin(found))


def refined(passage: Passage, time: float, normal: Array) -> float:
    """Delta-v of the path that one side leads to [m/s]; nan where it is not clear."""
    times = np.linspace(0.0, passage.duration, TIMES)
    zone = cf.Sphere(passage.radius)
    contacts = [(time, normal)]
    best = np.nan
    for _ in range(ROUNDS):
        pushes = solve(passage, times, contacts)
        if pushes is None:
            break
        sizes = np.linalg.norm(pushes, axis=1)
        used = sizes > LEAST * sizes.sum()
        path = flown(passage, times[used], pushes[used])
        missed = cf.find_conflicts(path, passage.obstacle, zone)
        if not missed:
            if best - sizes.sum() < SETTLED * best:
                return float(min(best, sizes.sum()))
            best = float(np.nanmin([best, sizes.sum()]))
        contacts = [(when, turned(passage, path, when, side)) for when, side in contacts]
        for one in missed:
            if all(abs(one.time - when) > CLOSEST * passage.duration for when, _ in contacts):
                contacts.append((one.time, turned(passage, path, one.time, normal)))
        times = bisected(times, sizes, passage.duration)
    return best


def turned(passage: Passage, path: cf.Path, time: float, normal: Array) -> Array:
    """The side on which a path is at a time."""
    apart = path.position(time) - passage.obstacle.position(time)
    size = np.linalg.norm(apart)
    return apart / size if size > TURNED * passage.radius else normal


def bisected(times: Array, sizes: Array, duration: float) -> Array:
    """Times with new ones on both sides of those in use."""
    used = np.flatnonzero(sizes > USED * sizes.sum())
    steps = np.diff(times)
    wide = {k for j in used for k in (j - 1, j) if 0 <= k < len(steps) and steps[k] > CLOSEST * duration}
    return np.sort(np.concatenate([times, [times[k] + 0.5 * steps[k] for k in wide]]))


def flown(passage: Passage, times: Array, pushes: Array) -> cf.Path:
    """The path of some impulses."""
    state, now, pieces = passage.initial.copy(), 0.0, []
    for time, push in zip(times, pushes, strict=True):
        if time > now:
            pieces.append(passage.orbit.coast(state, time - now, start=now))
            state, now = pieces[-1].state(time).copy(), time
        state[3:] += push
    if now < passage.duration:
        pieces.append(passage.orbit.coast(state, passage.duration - now, start=now))
    return cf.join(pieces)


def solve(passage: Passage, times: Array, contacts: list[tuple[float, Array]]) -> Array | None:
    """The cheapest impulses (J, 3) at times that keep planes; None where there are none."""
    count, duration, n = len(times), passage.duration, passage.orbit.mean_motion
    rates = np.zeros((6, 6))
    rates[:3, 3:] = np.eye(3)
    rates[3, 0], rates[3, 4], rates[4, 3], rates[5, 2] = 3 * n * n, 2 * n, -2 * n, -n * n
    scale = np.array([1 / duration] * 3 + [1.0] * 3)
    rows, right = np.zeros((6 + len(contacts), 4 * count)), np.zeros(6 + len(contacts))
    for j, time in enumerate(times):
        rows[:6, 4 * j + 1 : 4 * j + 4] = scale[:, None] * expm(rates * (duration - time))[:, 3:]
    right[:6] = scale * (passage.final - expm(rates * duration) @ passage.initial)
    for k, (time, normal) in enumerate(contacts, 6):
        drift = (expm(rates * time) @ passage.initial)[:3] - passage.obstacle.position(time)
        right[k] = (normal @ drift - AIM * passage.radius) / duration
        for j in np.flatnonzero(times < time):
            effect = expm(rates * (time - times[j]))[:3, 3:]
            rows[k, 4 * j + 1 : 4 * j + 4] = -normal @ effect / duration
    size = float(np.abs(right[:6]).max())
    costs = np.zeros(4 * count)
    costs[::4] = 1.0
    settings: Any = clarabel.DefaultSettings()
    settings.verbose, settings.max_threads = False, 1
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-9
    cones = [clarabel.ZeroConeT(6), *([clarabel.NonnegativeConeT(len(contacts))] if contacts else [])]
    found = clarabel.DefaultSolver(
        sparse.csc_matrix((4 * count, 4 * count)),
        costs,
        sparse.vstack([sparse.csc_matrix(rows), -sparse.eye(4 * count)]).tocsc(),
        np.concatenate([right / size, np.zeros(4 * count)]),
        [*cones, *[clarabel.SecondOrderConeT(4)] * count],
        settings,
    ).solve()
    if "Solved" not in str(found.status):
        return None
    return np.array(found.x).reshape(-1, 4)[:, 1:] * size
