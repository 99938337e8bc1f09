"""Violations of zones and requirements that keep paths from being a plan: their sizes and times."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from closeform.planning.problem.problem import Problem, Trajectories

MOST = 2  # violations that are reported


class Violation(NamedTuple):
    """Violation as text, with the two bodies of a conflict or the name of a requirement on one spacecraft."""

    text: str
    pair: tuple[int, int] | None = None
    requirement: str = ""


def violations(problem: Problem, trajectories: Trajectories, names: Sequence[str]) -> list[Violation]:
    """Return the violations of paths, at most `MOST`: conflicts first, each pair where it is deepest."""
    found = [*conflicts(problem, trajectories, names), *broken_requirements(problem, trajectories, names)]
    return found[:MOST]


def conflicts(problem: Problem, trajectories: Trajectories, names: Sequence[str]) -> Iterator[Violation]:
    """Yield the deepest conflict of each pair, with thrust or after its loss, the deepest first."""
    whole = problem.whole(trajectories)
    met = problem.conflicts(whole)
    every, ratios = problem.met(met), np.array([row[3] for _, row in met])
    if problem.drift is not None:
        from closeform.planning.passive.certification import failures_with_norms  # needs kernels of its own

        failed, norms = failures_with_norms(problem, problem.path(trajectories), problem.bodies(whole))
        every, ratios = every.joined(failed), np.append(ratios, norms)
    seen = set()
    for k in np.argsort(ratios, kind="stable").tolist():
        if every.which[k] in seen:
            continue
        seen.add(every.which[k])
        (one, other), drifts, time = problem.pairs[every.which[k]].tolist(), every.drifts[k], every.times[k]
        one, other = (other, one) if drifts[1] > 0.0 else (one, other)
        near = f"reaches {ratios[k]:.4f} x zone from" if ratios[k] < 1.0 else "is not shown to be clear of"
        lost = f" after a loss of thrust at {time - drifts.max():.6g} s" if drifts.any() else ""
        text = f"{names[one]} {near} {names[other]} at {time:.6g} s{lost}"
        yield Violation(text, (min(one, other), max(one, other)))


def broken_requirements(
    problem: Problem, trajectories: Trajectories, names: Sequence[str]
) -> Iterator[Violation]:
    """Yield each requirement on a single spacecraft that its path violates, where it does so most."""
    for i, one, worst, kept in problem.requirement_checks(trajectories):
        if kept:
            continue
        by = f"by {-worst.margin:.3g} {one.unit} at {worst.time:.6g} s"
        says = f"violates its {one.called} {by}"
        if not worst.margin < 0.0:
            says = f"is not shown to keep its {one.called}"
        yield Violation(f"{names[i]} {says}", requirement=one.called)
