"""Ends of a plan that no plan between them can keep clear: in conflict, or not passively safe."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.two_paths import closest_approach
from closeform.motion.arc import END, START
from closeform.motion.elements.palmer import palmer_from_state
from closeform.motion.path import Path
from closeform.planning.energy.side_search import MARGINS
from closeform.planning.problem.problem import Problem
from closeform.zones.shapes import BALL
from closeform.zones.zone import ON, Zone

ROOMY = 1.3  # clearance ratio of suggested ends


class EndConflict(NamedTuple):
    """Conflict of a `pair` at a `time` at which no plan moves it: its clearance ratio, and when it is."""

    ratio: float
    pair: tuple[int, int]
    when: str
    time: float


def end_conflict(problem: Problem) -> EndConflict | None:
    """Return the deepest conflict at an end of both paths, which no plan can avoid; None without one."""
    found, direct = [], problem.direct
    for pair, (begin, end, time, ratio) in problem.direct_conflicts(MARGINS[0]):
        spans = sorted(tuple(problem.base[c, [START, END]]) for c in pair if c < problem.count)
        first, last = spans[0][0], max(span[1] for span in spans)
        if begin <= first:
            at = ratio if time <= first else problem.ratio(direct, pair, first)
            found.append(EndConflict(at, pair, "at their start", first))
        elif end >= last:
            at = ratio if time >= last else problem.ratio(direct, pair, last)
            found.append(EndConflict(at, pair, "at their end", last))
        elif spans[0][1] <= spans[-1][0] and begin <= spans[-1][0] and end >= spans[0][1]:
            found.append(EndConflict(ratio, pair, "at a time when both coast", time))
    return min(found, default=None)


@dataclass(frozen=True, eq=False)
class UnsafeEnd:
    """Conflict of two bodies (i < j) in free drift from an end of a plan: `ratio`, time `after` it.

    `stayed` is the body without thrust from its start, if the other one has arrived.
    """

    pair: tuple[int, int]
    end: str
    ratio: float
    after: float
    stayed: int | None = None

    def reason(self, problem: Problem, names: Sequence[str]) -> str:
        """Return the reason why the end is unsafe, with a safe alternative."""
        i, j = self.pair
        if self.stayed is not None:
            i, j = (i, j) if self.stayed == i else (j, i)
            return (
                f"without thrust from the start of its plan {names[i]} reaches {self.ratio:.2f} x zone from "
                f"{names[j]}, which has arrived, {self.after:.6g} s later: no plan with that start, that "
                "arrival and these times is passively safe; move one of them"
            )
        told = (
            f"without thrust from the {self.end} of its plan {names[i]} reaches {self.ratio:.2f} x zone "
            f"from {names[j]} {self.after:.6g} s later: no plan with that {self.end} is passively safe"
        )
        return f"{told}; {remedy(problem, self.pair, self.end, names)}"


def unsafe_end(problem: Problem) -> UnsafeEnd | None:
    """Return the end of a plan with the closest approach in free drift, if that is a conflict; else None.

    At the start one craft alone may lose its thrust, while another planned craft continues until it arrives;
    at the end no craft thrusts.
    """
    direct, others = problem.path(problem.direct), problem.obstacles
    start, end = problem.base[:, START], problem.base[:, END]
    worst = None
    for (i, j), kind in zip(problem.pairs.tolist(), problem.kinds, strict=True):
        planned = j < problem.count
        if planned:
            both = float(max(end[i], end[j]))
            ends = [("end", both, both, None), ("start", start[i], end[j], i), ("start", end[i], start[j], j)]
        else:
            ends = [("start", start[i], start[i], None), ("end", end[i], end[i], None)]
        for word, own, others_own, stayed in ends:
            if not max(own, others_own) < problem.last:
                continue
            one = adrift(direct[i], own, problem.last)
            other = adrift(direct[j], others_own, problem.last) if planned else others[j - problem.count]
            met = closest_approach(one, other, problem.zones[kind])
            if met.ratio <= ON and (worst is None or met.ratio < worst.ratio):
                since = own if stayed is None else start[stayed]
                worst = UnsafeEnd((i, j), word, float(met.ratio), float(met.time - since), stayed)
    return worst


def adrift(path: Path, since: float, until: float) -> Path:
    """Return the natural motion from a state of a path."""
    return path.orbit.coast(path.state(since), until - since, since)


def separation(problem: Problem, craft: int, other: int) -> float:
    """Return the separation of a craft's arrival from an obstacle for a slow drift of any length, in zones.

    It is across the track, by eccentricity and inclination.                                 # theory (73)
    """
    pair = problem.index[craft, other]
    zone, arrived = problem.zones[problem.kinds[pair]], float(problem.base[craft, END])
    state = problem.path(problem.direct)[craft].state(arrived)
    state = state - problem.obstacles[other - problem.count].state(arrived)
    e1, e2, _, _, h1, h2 = palmer_from_state(state, problem.orbit.mean_motion)
    return float(np.linalg.svd(shadow(zone) @ np.array([[-e1, e2], [h1, h2]]), compute_uv=False)[-1])


def shadow(zone: Zone) -> Floats:
    """Return the matrix (3, 2) from x and z to coordinates of a zone's projection along the track.

    A zone with edges is replaced by its circumscribed ball.
    """
    if zone.shape != BALL:
        return np.eye(3)[:, ::2] / zone.radius
    along = zone.matrix[:, 1] / np.linalg.norm(zone.matrix[:, 1])
    return (zone.matrix - np.outer(along, along @ zone.matrix))[:, ::2]


def remedy(problem: Problem, pair: tuple[int, int], end: str, names: Sequence[str]) -> str:
    """Return a description of an end that is safe by eccentricity and inclination."""
    zone = problem.zones[problem.kinds[problem.index[pair]]]
    if problem.beside is not None or not problem.orbit.mean_motion or not zone.bounded:
        return f"move that {end}, or reduce drift"
    swing = f"{ROOMY * zone.radius:.4g}"
    return (
        f"use a safety_ellipse with radial and cross_track of {swing} m around {names[pair[1]]}, "
        f"which stays at {ROOMY:g} x zone in any drift"
    )


def unseparated(problem: Problem, names: Sequence[str]) -> str:
    """Return what helps against free drifts: an end with cross-track separation, or another phase."""
    found = (
        [(separation(problem, i, j), (i, j)) for i, j in problem.pairs.tolist() if problem.count <= j]
        if problem.beside is None and problem.orbit.mean_motion
        else []
    )
    if not found or min(found)[0] > ON:
        return "arrive at another phase, or reduce drift"
    pair = min(found)[1]
    safe = remedy(problem, pair, "end", names)
    return f"reduce drift, or move the end off the track of {names[pair[1]]}: {safe}"
