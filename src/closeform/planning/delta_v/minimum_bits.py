"""Impulses of thrusters that are each zero or at least the minimum impulse bit.

A plan of minimum delta-v may contain impulses that its thrusters cannot give.  Without them the path ends
elsewhere.  A mixed-integer linear program recomputes the sizes of one spacecraft's impulses:

    minimise sum v_j   subject to   sum e_j v_j = w,   sum f_kj v_j >= h_k,   v_j = 0 or v_j >= bit_j

e_j is the effect of a unit impulse on the end state, w the miss of a coast, and f_kj the effect on plane k of
the plan.  Opposed thrusters never fire at the same time: only their difference would act, and it may be
below the bit.  Spacecraft are planned in turn, with the impulses of the others fixed.
"""

from dataclasses import replace
from math import inf

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, milp

from closeform.arrays import Floats
from closeform.motion.arc import END, START, STATE
from closeform.planning.delta_v.checks import Spent
from closeform.planning.delta_v.dual.fleet import Planes
from closeform.planning.delta_v.firing_times import Moments, pushes_table
from closeform.planning.delta_v.impulse_solver import ImpulseSolver

ROUNDS = 6  # planning rounds while the new impulses cause a conflict; two or three are enough
LARGEST = 4.0  # times the delta-v and the bit, the upper bound on an impulse: a tight one shortens the search
OPTIONS = {"node_limit": 50, "mip_rel_gap": 5e-3}  # about a second; more nodes rarely find less
SPARE = 1.001  # times the bit: constraints hold to 1e-6, and the repair of the ends changes sizes
OPPOSED = -1.0 + 1e-9  # cosine of the angle between two thrusters that push against each other, at most
DEAREST = 3.0  # times the delta-v of the plan with smaller impulses: beyond it the thrusters are too coarse


def in_whole_bits(solver: ImpulseSolver, best: Spent) -> Spent | None:
    """Return clear paths without an impulse below its minimum bit; None where none are found."""
    found, changed = best, solver.below_bit(best).any(axis=1)
    for turn in range(ROUNDS):
        planes, moments = solver.planes(found.contacts, found.margin), list(found.moments)
        pushes = [row[: len(own.times)] for row, own in zip(found.impulses, moments, strict=True)]
        for i in np.flatnonzero(changed).tolist():
            felt = sum(
                (
                    effects(solver, planes, j, moments[j], pushes[j]).sum(axis=1)
                    for j in range(len(moments))
                    if j != i
                ),
                0.0,
            )
            own, thrusters = solver.grid[i].joined(moments[i]), solver.thrusters[i]
            assert thrusters is not None
            units = thrusters.directions_at(solver.problem.orbit, own.times)[
                np.arange(len(own.times)), own.which
            ]
            sizes = resized(solver, i, own, units, planes, planes.misses - felt)
            if sizes is None:
                return None
            moments[i], pushes[i] = own.some(sizes > 0.0), (sizes[:, None] * units)[sizes > 0.0]
        found = solver.fired_at(moments, pushes_table(pushes), found)
        if found.checked.clear:
            kept = found.cost <= DEAREST * best.cost and not solver.below_bit(found).any()
            return found if kept else None
        changed[:] = False
        for pair, _ in found.checked.missed:  # the two take turns in being planned again
            able = [i for i in pair if i < len(changed) and solver.thrusters[i] is not None]
            changed[able[turn % len(able) :][:1]] = True
        if not changed.any():
            return None
        found = replace(found, contacts=solver.turned(found))
    return None


def effects(solver: ImpulseSolver, planes: Planes, i: int, own: Moments, pushes: Floats) -> Floats:
    """Return the effects (K, J) of a spacecraft's impulses (J, 3) on planes."""
    sides = 1.0 * (planes.first == i) - 1.0 * (planes.second == i)
    after = planes.times[:, None] - own.times
    fired = own.times < planes.cuts[np.arange(len(sides)), 1 * (planes.second == i), None]
    moved = solver.problem.orbit.transition(np.maximum(after, 0.0))[..., 3:] @ pushes[..., None]
    found: Floats = sides[:, None] * fired * (planes.rows[:, None] * moved[..., 0]).sum(axis=2)
    return found


def resized(
    solver: ImpulseSolver, i: int, own: Moments, units: Floats, planes: Planes, missing: Floats
) -> Floats | None:
    """Return the sizes (J,) of impulses along unit vectors (J, 3); None without a solution."""
    orbit, base, thrusters = solver.problem.orbit, solver.problem.base[i], solver.thrusters[i]
    assert thrusters is not None
    lasts = base[END] - base[START]
    scale = np.repeat([orbit._rate + 1.0 / lasts, 1.0], 3)[:, None]  # positions as velocities
    ends = scale * (orbit.transition(base[END] - own.times)[..., 3:] @ units[..., None])[..., 0].T
    wanted = scale[:, 0] * (solver.finals[i] - orbit.transition(lasts) @ base[STATE : STATE + 6])
    felt = (planes.first == i) | (planes.second == i)
    walls = effects(solver, planes, i, own, units)[felt]
    unit = float(np.abs(wanted).sum())  # of velocity, by which the program's tolerances are relative
    bits = SPARE * solver.bits(i, own) / unit
    count, most = len(bits), LARGEST * (1.0 + bits.max())
    none = np.zeros((6 + len(walls), count))
    one, other = np.nonzero(np.triu((own.times[:, None] == own.times) & (units @ units.T < OPPOSED)))
    either = np.eye(count)[one] + np.eye(count)[other]
    found = milp(
        np.repeat([1.0, 0.0], count),
        integrality=np.repeat([0, 1], count),
        bounds=Bounds(0.0, np.repeat([most, 1.0], count)),
        constraints=[
            LinearConstraint(
                np.hstack([np.vstack([ends, walls]), none]),
                np.append(wanted, missing[felt]) / unit,
                np.append(wanted / unit, np.full(len(walls), inf)),
            ),
            LinearConstraint(np.hstack([np.eye(count), -np.diag(bits)]), 0.0, inf),
            LinearConstraint(np.hstack([np.eye(count), -most * np.eye(count)]), -inf, 0.0),
            LinearConstraint(np.hstack([0.0 * either, either]), -inf, 1.0),
        ],
        options=OPTIONS,
    )
    if found.x is None:
        return None
    sizes: Floats = np.where(found.x[count:] > 0.5, np.maximum(found.x[:count], bits) * unit, 0.0)
    return sizes
