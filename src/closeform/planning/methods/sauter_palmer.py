"""Method of SP11 (Sauter and Palmer 2011): one deviation point for each conflict.

The deviations are perpendicular to the cost's gradients.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import nan
from typing import Any

import numpy as np

from closeform.arrays import Floats, instance
from closeform.motion.arc import IMPULSE, MEAN_MOTION, PUSH, THRUST
from closeform.motion.elements.palmer import state_from_palmer
from closeform.motion.joining import join
from closeform.motion.path import Path
from closeform.planning.energy.exit_directions import exit_normals
from closeform.planning.energy.side_search import MARGINS
from closeform.planning.minimum_energy import Outcome
from closeform.planning.plan import Contact
from closeform.planning.problem.problem import Problem, deepest

LEGS = 12  # at most, of one path
SCALES = np.geomspace(1.0, 4.0, 25)  # of a deviation, tried until both of its legs are clear


def end_gradients(path: Path) -> tuple[Floats, Floats]:
    """Return the first-order change of a path's energy with its initial and final states.

    Parameters
    ----------
    path : Path
        Energy-optimal between its ends, in one arc or shaped by `avoid`; of one craft or a batch.

    Returns
    -------
    initial : array of shape (*path, 6) [m/s^3, m/s^2]
        Slopes dJ/d(initial) for positions and velocities in the rotating frame; energy per unit mass.
    final : array of shape (*path, 6) [m/s^3, m/s^2]
        Slopes dJ/d(final), in the rotating frame.

    Raises
    ------
    ValueError
        If the path has impulses, constant thrust or samples.

    Notes
    -----
    The slopes are the costates at the two ends, in rectangular coordinates.

    References
    ----------
    SP11 (Sauter and Palmer 2011) eqs. 20-21; docs/theory.md section 4.
    """
    n = instance("path", path, Path).orbit.mean_motion
    if (
        path.arcs[:, IMPULSE : IMPULSE + 3].any()
        or path.arcs[:, PUSH:].any()
        or (path.arcs[:, MEAN_MOTION] != n).any()
    ):
        raise ValueError("path: must be energy-optimal; plan one with transfer")
    first, last = path.arcs[path.offsets[:-1]], path.arcs[path.offsets[1:] - 1]
    begin = first[:, THRUST : THRUST + 6]
    end = path.orbit.transition(last[:, 1] - last[:, 0]) @ last[:, THRUST : THRUST + 6, None]
    return (-_costate(n, begin)).reshape(*path.shape, 6), _costate(n, end[..., 0]).reshape(*path.shape, 6)


def _costate(n: float, steering: Floats) -> Floats:
    thrust, rate = steering[:, :3], steering[:, 3:]
    turned = 2.0 * n * np.stack([thrust[:, 1], -thrust[:, 0], 0.0 * thrust[:, 0]], axis=1)
    return np.concatenate([turned - rate, thrust], axis=1)


def cost_of_moving(path: Path, time: float) -> Floats:
    """Return the matrix A (6, 6): moving the state at `time` by d costs d.A.d / 2 of energy; theory (11)."""
    pairs = np.eye(6)[:, None] + np.eye(6)[None]
    initial = path.orbit.transfer(np.zeros(6), pairs, time - path.start).energy
    terminal = path.orbit.transfer(pairs, np.zeros(6), path.end - time).energy
    both: Floats = initial + terminal
    single = both.diagonal() / 4
    matrix: Floats = both - single[:, None] - single[None]
    return matrix


def _across(leg: Path, time: float) -> Floats:
    """Return three state deviations (3, 6), each perpendicular to the gradient in one of Palmer's planes.

    (e1, e2), (d, l) and (h1, h2) decouple, and in each the first-order cost vanishes along one
    direction (SP11 section 4).  On an optimal path the gradients of the two legs at the
    deviation point are equal and opposite, so both legs give the same directions.
    """
    n = leg.orbit.mean_motion
    whole = leg.orbit.transfer(leg.state(leg.start), leg.state(time), time - leg.start)
    columns = state_from_palmer(np.eye(6), n)  # rows: states of unit Palmer coordinates
    gradient = columns @ end_gradients(whole)[1]
    deviations = np.zeros((3, 6))
    for plane in range(3):
        a, b = gradient[2 * plane : 2 * plane + 2]
        size = np.hypot(a, b)
        deviations[plane, 2 * plane : 2 * plane + 2] = (-b / size, a / size) if size > 0.0 else (1.0, 0.0)
    return state_from_palmer(deviations, n)


def _two_legs(leg: Path, time: float, deviation: Floats) -> Path:
    middle = leg.state(time) + deviation
    before = leg.orbit.transfer(leg.state(leg.start), middle, time - leg.start, leg.start)
    return join([before, leg.orbit.transfer(middle, leg.state(leg.end), leg.end - time, time)])


def _deviation(
    leg: Path, which: int, time: float, at: float, problem: Problem
) -> tuple[Path, Contact] | None:
    """Return the lowest-cost pair of legs through a deviation point at time `at` that clears one obstacle.

    The size of the deviation is that which the closest approach at `time` requires.
    """
    deviations = _across(leg, at)
    flexibility = np.linalg.inv(deviations @ cost_of_moving(leg, at) @ deviations.T)
    there = leg.state(time)[:3]
    moved = np.array([_two_legs(leg, at, one).state(time)[:3] - there for one in deviations])
    pair = (0, int(problem.pairs[which, 1]))
    zone = problem.zones[problem.kinds[which]]
    reach = zone.matrix @ moved.T
    gap, speed, _ = problem.motions(problem.with_path(leg), problem.at(pair, time))[0]
    best: tuple[Path, Contact] | None = None
    compliance = reach @ flexibility @ reach.T
    for _, normal in exit_normals(zone.shape, zone.faces, MARGINS[0], gap, speed, compliance):
        multiplier = (MARGINS[0] - normal @ gap) / (normal @ compliance @ normal)
        weights = flexibility @ reach.T @ normal * multiplier
        for scale in SCALES:
            legs = _two_legs(leg, at, scale * weights @ deviations)
            if best is not None and legs.energy >= best[0].energy:
                break
            if not any(met == pair for met, _ in problem.conflicts(problem.with_path(legs))):
                push = zone.matrix.T @ normal
                size = float(np.linalg.norm(push))
                where = legs.state(at)[:3]
                pushed = float(multiplier * scale)
                best = legs, Contact(at, *pair, where, push / size, pushed * size, 1.0 / size)
                break
    return best


def deviated(problem: Problem, names: Sequence[str]) -> Outcome:
    """Return the paths of method "sauter-palmer" for one craft; raise ValueError in deep space."""
    if problem.orbit.mean_motion == 0.0:
        raise ValueError("method: 'sauter-palmer' requires an orbit; in deep space use 'exact'")
    optimum = legs = problem.path(problem.direct)[0]
    contacts: list[Contact] = []

    def refused(why: str) -> Outcome:
        none: Outcome = Outcome(None, (), nan, MARGINS[0], len(contacts))
        return replace(none, reason=f"{why}; use 'exact'")

    while conflicts := problem.conflicts(problem.with_path(legs)):
        pair, (start, _, time, _) = deepest(conflicts)
        obstacle = names[pair[1]]
        k = max(int(np.searchsorted(legs.arcs[:, 0], time, side="right")) - 1, 0)
        leg = _alone(legs, k)
        if len(contacts) >= LEGS or not 1e-6 < (time - leg.start) / (leg.end - leg.start) < 1.0 - 1e-6:
            return refused(f"no path past {obstacle} at {time:.6g} s")
        inside = [at for at in (time, start) if (at - leg.start) / (leg.end - leg.start) > 1e-6]
        both = [_deviation(leg, problem.index[pair], time, at, problem) for at in inside]
        found = min((one for one in both if one is not None), key=lambda one: one[0].energy, default=None)
        if found is None:
            return refused(f"no single deviation clears {obstacle} at {time:.6g} s")
        contacts.append(found[1])
        parts: list[Any] = [_alone(legs, i) for i in range(len(legs.arcs)) if i != k]
        legs = join(sorted([*parts, *(_alone(found[0], i) for i in range(2))], key=lambda part: part.start))
    number = len(contacts)
    return Outcome(
        problem.with_path(legs),
        tuple(sorted(contacts, key=lambda contact: contact.time)),
        legs.energy - optimum.energy,
        MARGINS[0],
        number,
        priced=False,
        reason=f"{number} deviation point{'s' * (number != 1)} after Sauter & Palmer (2011)",
    )


def _alone(path: Path, arc: int) -> Path:
    return Path(path.orbit, path.arcs[arc : arc + 1], np.array([0, 1]), ())
