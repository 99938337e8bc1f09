"""Two-impulse plans with waits, the starts of passively safe plans.

A craft waits on its initial natural motion A, drifts for a time on a natural motion M, and waits on the
natural motion B that leads to its final state.  One impulse leads from A to M, one from M to B.  The radial
hop between two hold points on the V-bar is such a plan: M lasts half an orbit.  Whenever thrust is lost, the
craft is left on A, M or B, or, during an impulse, on a motion between two of them.  Propagated back to one
epoch, these motions are a chain of two straight lines in the space of states, which is sampled here.

The drift times are multiples of a fixed part of the orbit, whatever the duration, and so are the waits at
the end.  A longer duration therefore admits every plan of a shorter one, with a later start.
"""

from collections.abc import Iterator
from math import ceil

import numpy as np

from closeform.arrays import Floats
from closeform.motion.arc import END, START, STATE
from closeform.motion.construction.two_impulse import start_velocities
from closeform.planning.problem.problem import Problem
from closeform.zones.zone import Zone

PARTS = 24  # of an orbit, in deep space of the duration: grid of drifts and waits; fewer miss windows
SHARES = np.linspace(0.0, 1.0, 65)  # of an interrupted impulse; with fewer, plans that fail the proof pass
CHUNK = 256  # plans sampled at a time
HOPS = 100  # maximum plans without a sampled conflict to certify
MISSED = 1e-9  # of the positions and drift distances: larger misses are not a solution


def two_impulse_plans(problem: Problem) -> Iterator[tuple[Floats, Floats]]:
    """Yield times (N, 2) and impulses (N, 2, 3) of plans without a sampled conflict, lowest cost first.

    All craft wait and drift for the same times.  Conflicts are sampled with obstacles only.
    """
    base, orbit = problem.base, problem.orbit
    begins = base[:, STATE : STATE + 6]
    optima = problem.path(problem.direct)
    finals = np.stack([optima[i].state(end) for i, end in enumerate(base[:, END])])
    lasts = base[:, END] - base[:, START]
    drifts, waits = schedules(float(lasts.min()), orbit.period)
    first, last = base[:, [START]], base[:, [END]]
    begun = np.maximum(last - waits - drifts, first)  # (N, C), the times of the first impulse
    flow = orbit.transition(drifts, begun)
    left = (orbit.transition(begun - first, first) @ begins[:, None, :, None])[..., 0]
    joined = (orbit.transition(-waits, last) @ finals[:, None, :, None])[..., 0]
    each = zip(flow, left, joined, strict=True)
    speeds = np.stack([start_velocities(own, drifts, *ends) for own, *ends in each])
    moved = np.concatenate([left[..., :3], speeds], axis=-1)
    arrived = (flow @ moved[..., None])[..., 0]
    impulses = np.stack([speeds - left[..., 3:], joined[..., 3:] - arrived[..., 3:]], axis=2)
    off = np.abs(arrived - joined)[..., :3].max(axis=-1)
    scale = np.abs(left)[..., :3].max(axis=-1) + drifts * np.abs(speeds).max(axis=-1)
    costs = np.linalg.norm(impulses, axis=-1).sum(axis=(0, 2))
    reached = np.flatnonzero((off <= MISSED * scale).all(axis=0))
    ties = np.round(costs / (costs[reached].min(initial=np.inf) or 1.0), 9)  # equal costs: sort by the wait
    order = reached[np.lexsort((waits[reached], ties[reached]))]
    chain = np.stack([left, moved, joined], axis=2)  # A, M and B (N, C, 3, 6), each where it begins or ends
    since = np.stack([begun, begun, begun + drifts], axis=-1)
    chain = (orbit.transition(problem.first - since, since) @ chain[..., None])[..., 0]
    times = since[..., 1:]
    look = Look(problem)
    for place in range(0, len(order), CHUNK):
        some = order[place : place + CHUNK]
        for c in some[look.clear(chain[:, some, 1], times[:, some])]:
            if look.stays_clear(chain[:, c], times[:, c]):
                yield times[:, c], np.ascontiguousarray(impulses[:, c])


def schedules(duration: float, period: float) -> tuple[Floats, Floats]:
    """Return the drift times and the waits after them (C,) that fit into a duration."""
    part = (period if np.isfinite(period) else duration) / PARTS
    drifts = np.append(part * np.arange(1, ceil(duration / part)), duration)
    found = []
    for drift in drifts[drifts <= duration]:
        rest = duration - drift
        waits = part * np.arange(PARTS + 1)
        waits = np.append(waits[waits < rest], rest)
        found.append(np.column_stack([np.full(len(waits), drift), waits]))
    both = np.concatenate(found)
    return both[:, 0], both[:, 1]


class Look:
    """Sampled positions relative to obstacles after failures of plans."""

    def __init__(self, problem: Problem) -> None:
        self.problem, self.times = problem, problem.seen.times
        self.flow = problem.orbit.transition(self.times - problem.first, problem.first)[:, :3]
        self.pairs = [
            (int(i), problem.zones[kind], problem.seen.states[j, :, :3])
            for (i, j), kind in zip(problem.pairs, problem.kinds, strict=True)
            if j >= problem.count
        ]

    def clear(self, motions: Floats, times: Floats) -> Floats:
        """Return which plans (C,) with natural `motions` (N, C, 6) are clear from their first impulse."""
        clear = np.ones(motions.shape[1], dtype=bool)
        for i, zone, places in self.pairs:
            rows = np.flatnonzero(clear)
            late = self.times >= times[i, rows, :1]
            clear[rows] = (~late | (self.norms(motions[i, rows], zone, places) > 1.0)).all(axis=1)
        return clear

    def stays_clear(self, chain: Floats, times: Floats) -> bool:
        """Return whether one plan (N, 3, 6) stays clear when its impulses at times (N, 2) are cut short."""
        for i, zone, places in self.pairs:
            for k in range(2):
                late = self.times >= times[i, k]
                cut = chain[i, k] + SHARES[:, None] * (chain[i, k + 1] - chain[i, k])
                if (self.norms(cut, zone, places)[:, late] <= 1.0).any():
                    return False
        return True

    def norms(self, motions: Floats, zone: Zone, places: Floats) -> Floats:
        """Return the norms (C, T) of natural motions, given at the first time (C, 6)."""
        return np.asarray(zone.norm(np.moveaxis(self.flow @ motions.T, 2, 0) - places))
