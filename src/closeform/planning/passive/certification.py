"""Certification of passively safe plans: loss of thrust that leads into a zone."""

import numpy as np

from closeform.arrays import Floats
from closeform.motion.path import Path
from closeform.planning.problem.problem import Problem
from closeform.planning.problem.scene import Contacts
from closeform.safety.drift_approach import SAME, failures_at, passively_safe, worst_loss
from closeform.safety.drift_screen import worst_drifts
from closeform.safety.failure_cells import side_of
from closeform.safety.failure_search import RATIO, TIME
from closeform.safety.failures import ThrustLost

FEW_LOSSES = 60, 21, 21  # beside any chief, to find one of them that leads into a zone


def failures(problem: Problem, planned: Path, trajectories: Path) -> Contacts:
    """Return the deepest conflict after a loss of thrust of each pair and failing craft; empty if safe.

    `planned` (N,) are the craft's paths until they arrive, `trajectories` (N + M,) all, with the drift.
    """
    return failures_with_norms(problem, planned, trajectories)[0]


def failures_with_norms(problem: Problem, planned: Path, trajectories: Path) -> tuple[Contacts, Floats]:
    """Return the contacts of `failures`, and the norms (K,) there."""
    found, norms, end = Contacts.none(), [np.empty(0)], problem.last
    if problem.beside is not None:
        return failures_beside_chief(problem, planned, trajectories)
    sides = side_of(planned, ThrustLost(), end), side_of(trajectories, None, end)
    for kind, zone in enumerate(problem.zones):
        those = np.flatnonzero(problem.kinds == kind)
        for side in range(2):
            which = those[problem.pairs[those, side] < problem.count]
            craft, others = problem.pairs[which, side], problem.pairs[which, 1 - side]
            around = zone.mirrored if side else zone
            unsafe, rows = worst_drifts(sides, craft, others, end, problem.orbit, around, SAME)
            drifts, time = np.zeros((len(unsafe), 2)), rows[:, TIME]
            drifts[:, side] = time - failures_at("path", rows, sides, (craft[unsafe], others[unsafe]))
            found = found.joined(Contacts.at(which[unsafe], time, drifts))
            norms.append(rows[:, RATIO])
    return found, np.concatenate(norms)


def failures_beside_chief(problem: Problem, planned: Path, trajectories: Path) -> tuple[Contacts, Floats]:
    """Return `failures_with_norms` about a chief that is not on a circle."""
    which, times, drifts, norms = [], [], [], []
    for k, pair in enumerate(problem.pairs.tolist()):
        for side in range(2):
            craft, other = pair[side], pair[1 - side]
            if craft >= problem.count:
                continue
            zone = problem.zones[problem.kinds[k]]
            given = planned[craft], trajectories[other], zone.mirrored if side else zone, problem.last
            if passively_safe(*given):
                continue
            lost, time, norm, _ = worst_loss(*given, True, FEW_LOSSES, 1)
            lost = lost if lost == lost else float(planned[craft].start)
            which.append(k)
            times.append(time)
            drifts.append([0.0, time - lost] if side else [time - lost, 0.0])
            norms.append(norm)
    found = np.array(which, dtype=np.int64), np.array(times, dtype=float)
    return Contacts.at(*found, np.array(drifts).reshape(-1, 2)), np.array(norms)
