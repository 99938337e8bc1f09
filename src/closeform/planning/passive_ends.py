"""Ends of a plan that are not passively safe by themselves, and ends beside them that would do."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.two_paths import closest_approach
from closeform.motion.arc import END, START
from closeform.motion.palmer import palmer_from_state
from closeform.motion.path import Path
from closeform.planning.problem import Problem
from closeform.zones.shapes import BALL
from closeform.zones.zone import ON, Zone

ROOMY = 1.3  # zones that are left around an end that is named as one that would do


@dataclass(frozen=True, eq=False)
class UnsafeEnd:
    """Two bodies (i < j) that come to `ratio` of their zone, a time `after` one end, without any thrust.

    Or one `stayed` where it began, without thrust, while the other, of which it fails, has arrived.
    """

    pair: tuple[int, int]
    end: str
    ratio: float
    after: float
    stayed: int | None = None

    def reason(self, problem: Problem, names: Sequence[str]) -> str:
        """What is wrong with it, and an end that would do."""
        i, j = self.pair
        if self.stayed is not None:
            i, j = (i, j) if self.stayed == i else (j, i)
            return (
                f"without thrust from the start of its plan {names[i]} comes to {self.ratio:.2f} x zone from "
                f"{names[j]}, which has arrived, {self.after:.6g} s later: no plan with that start, that "
                "arrival and these times is passively safe; move one of them"
            )
        told = (
            f"without thrust from the {self.end} of its plan {names[i]} comes to {self.ratio:.2f} x zone "
            f"from {names[j]} {self.after:.6g} s later: no plan with that {self.end} is passively safe"
        )
        return f"{told}; {remedy(problem, self.pair, self.end, names)}"


def unsafe_end(problem: Problem) -> UnsafeEnd | None:
    """The end of a plan at which two bodies come nearest without thrust, where that is inside their zone.

    At the start a craft alone may fail to thrust, and who is planned beside it is under way until it arrives;
    at the end nobody thrusts.
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
    """The natural motion from a state of a path on."""
    return path.orbit.coast(path.state(since), until - since, since)


def separation(problem: Problem, craft: int, other: int) -> float:
    """How far apart, in zones, a craft's arrival is from an obstacle for a slow drift of any length.

    Across the track, by eccentricity and inclination.                                     # theory (73)
    """
    pair = problem.index[craft, other]
    zone, arrived = problem.zones[problem.kinds[pair]], float(problem.base[craft, END])
    state = problem.path(problem.direct)[craft].state(arrived)
    state = state - problem.obstacles[other - problem.count].state(arrived)
    e1, e2, _, _, h1, h2 = palmer_from_state(state, problem.orbit.mean_motion)
    return float(np.linalg.svd(shadow(zone) @ np.array([[-e1, e2], [h1, h2]]), compute_uv=False)[-1])


def shadow(zone: Zone) -> Floats:
    """The matrix (3, 2) that takes x and z to coordinates of a zone's shadow along the track.

    Of a zone with edges that of the ball that holds it.
    """
    if zone.shape != BALL:
        return np.eye(3)[:, ::2] / zone.radius
    along = zone.matrix[:, 1] / np.linalg.norm(zone.matrix[:, 1])
    return (zone.matrix - np.outer(along, along @ zone.matrix))[:, ::2]


def remedy(problem: Problem, pair: tuple[int, int], end: str, names: Sequence[str]) -> str:
    """An end that is safe by eccentricity and inclination, in words."""
    zone = problem.zones[problem.kinds[problem.index[pair]]]
    if not problem.orbit.mean_motion or not zone.bounded:
        return f"move that {end}, or ask for less drift"
    swing = f"{ROOMY * zone.radius:.4g}"
    return (
        f"a safety_ellipse with radial and cross_track of {swing} m around {names[pair[1]]} would do, "
        f"{ROOMY:g} x zone away however it drifts"
    )


def unseparated(problem: Problem, names: Sequence[str]) -> str:
    """What to try, in words: an end for who arrives without separation across the track, or else more."""
    found = (
        [(separation(problem, i, j), (i, j)) for i, j in problem.pairs.tolist() if problem.count <= j]
        if problem.orbit.mean_motion
        else []
    )
    if not found or min(found)[0] > ON:
        return "; give it more time, arrive at another phase, or ask for less drift"
    ratio, (i, j) = min(found)
    return (
        f"; {names[i]} arrives {ratio:.2f} x zone from {names[j]} across the track, where any slow drift "
        f"along it leads into the zone from one side: {remedy(problem, (i, j), 'end', names)}"
    )
