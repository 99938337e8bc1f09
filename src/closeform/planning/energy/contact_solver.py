"""Local solver: contacts are relaxed until the paths are clear at minimum energy on their sides.

A round solves the quadratic program of the known contacts (the zones' supporting planes there), deflects all
paths by its forces, and moves every contact to the current closest approach of its paths. A contact that
moved far also keeps its old time, which damps the rounds.  Once the paths are nearly clear, Newton's method
solves the conditions of optimality.  A path that slides along a zone has no single contact to converge to;
its planes are raised by the remaining shortfall.  The lowest-cost clear solution is always kept.  # theory 4
"""

from math import inf
from typing import Any, NamedTuple

import numpy as np
from numba import float64, int64, types

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.kernel_loans import Lent, borrowed, lent, stack_matrix
from closeform.planning.energy.optimality import newton
from closeform.planning.energy.quadratic_program import solve_qp
from closeform.planning.problem.approaches import find_minima, sample_craft, spread
from closeform.planning.problem.contacts import SIDES, add_fresh, copy_contacts, next_contacts, slide_all
from closeform.planning.problem.deflection import deflect, fill_factors, fill_gram
from closeform.planning.problem.relative_motion import relative_motion
from closeform.planning.problem.scene import BLOCKS, CONTACTS, INDICES, NUMBERS, ROWS, SCENE, Contacts, Scene

ROUNDS, HOPELESS = 60, 15  # maximum rounds, in total and without progress towards clear paths
SOFT, FADE = 1e-2, 0.3  # initial softness of contacts, and its decay per round, while normals turn
CLOSE = 0.05  # change of normals and times in a round below which Newton's method is tried
NEARLY = 1e-2  # shortfall, in zones, up to which planes are raised
ENOUGH, STEADY = 1e-6, 1e-6  # depth and relative change of energy at which rounds end
RAISES = 4
GIVEN_UP = 1.5  # times the energy to beat
PACE = 10  # rounds at the last rate of progress, within which the energy must reach the bar
TOO_FAR = 1e5  # displacement in zones by one contact: more is an incompatible set
LEFT = 1e-9  # accepted shortfall of Newton's method
HUGGING = 16  # contacts for each craft, beyond which paths slide along zones
BLOCKED, CLEAR, OPTIMAL = 0, 1, 2  # status; optimal: the conditions of optimality hold to rounding


class Bodies(NamedTuple):
    """All bodies at a problem's sample times: states (B, T, 6), positions (B, 3, T), maximum speeds (B,)."""

    states: Floats
    places: Floats
    speeds: Floats


class Workspace(NamedTuple):
    """Arrays of the local solver: its samples, K contacts, their compliance and the paths."""

    states: Floats
    places: Floats
    speeds: Floats
    slid: Contacts
    following: Contacts
    trial: Contacts
    hand: Contacts
    best: Contacts
    factors: Floats
    gram: Floats
    work: Floats
    gaps: Floats
    found: Floats
    arcs: Floats
    offsets: Any

    @classmethod
    def of(cls, scene: Scene, count: int) -> "Workspace":
        """Return an empty workspace for `count` contacts."""
        bodies, samples, (rows, width) = len(scene.states), len(scene.times), scene.room
        return cls(
            np.empty((bodies, samples, 6)),
            np.empty((bodies, 3, samples)),
            np.empty(bodies),
            Contacts.none(count),
            Contacts.none(count),
            Contacts.none(count),
            Contacts.none(count),
            Contacts.none(count),
            np.empty((count, 2, 4, 3, 6)),
            np.empty((count, count)),
            np.empty((count, count)),
            np.empty(count),
            np.empty((count, 3)),
            np.empty((rows + 2 * count, width)),
            np.empty(len(scene.base) + 1, dtype=np.int64),
        )


FACTORS = float64[:, :, :, :, ::1]
WORKSPACE = Lent(
    types.NamedTuple(
        (
            *(BLOCKS, BLOCKS, NUMBERS, *(CONTACTS.of,) * 5, FACTORS),
            *(ROWS, ROWS, NUMBERS, ROWS, ROWS, INDICES),
        ),
        Workspace,
    )
)


@kernel()
def solve_multipliers(scene, contacts, count, gram, gaps, lift, give, work):
    """Fill the multipliers that keep the paths `lift` times the aim away; return their energy.

    Returns inf for incompatible contacts, whose forces grow without bound.
    """
    active, target = np.empty(count, dtype=np.bool_), np.empty(count)
    for k in range(count):
        active[k] = contacts.multipliers[k] > 0.0
        target[k] = gaps[k] + (lift - 1.0) * scene.aims[scene.kinds[contacts.which[k]]]
    solve_qp(gram, target, count, active, give, work, contacts.multipliers)
    energy = 0.0
    for k in range(count):
        push = contacts.multipliers[k]
        if not push * gram[k, k] < TOO_FAR:
            return inf
        for m in range(count):
            energy += 0.5 * push * gram[k, m] * contacts.multipliers[m]
    return energy if energy >= 0.0 else inf


@kernel()
def shortfall(found, number):
    """Return the largest shortfall of the minima below the aim, as a fraction of it."""
    short = 0.0
    for row in range(number):
        short = max(short, 1.0 - found[row, 2])
    return short


@kernel()
def look(scene, arcs, offsets, contacts, count, samples, found):
    """Fill `found` with minima below the aim of the paths under the contacts; return the number of rows."""
    sample_craft(scene, arcs, offsets, contacts, count, samples.states, samples.places, samples.speeds)
    number = find_minima(scene, arcs, offsets, samples.states, samples.places, samples.speeds, found)
    return min(number, len(found))


@kernel()
def fill_gaps(scene, contacts, count, gaps):
    """Fill the shortfalls of the unconstrained paths below the aim along the contacts' normals."""
    motion = stack_matrix(3, 3)
    for k in range(count):
        which, t = contacts.which[k], contacts.times[k]
        relative_motion(scene, scene.direct, scene.direct_offsets, which, t, motion)
        gaps[k] = scene.aims[scene.kinds[which]]
        for i in range(3):
            gaps[k] -= contacts.normals[k, i] * motion[0, i]


@kernel()
def raise_planes(scene, contacts, count, short, gram, gaps, work, factors, paths, samples, found):
    """Raise the planes at fixed contacts until the paths are clear; return the energy, or inf."""
    arcs, offsets = paths
    lift = 1.0
    for _ in range(RAISES):
        lift += 1.5 * short + 1e-11
        energy = solve_multipliers(scene, contacts, count, gram, gaps, lift, 0.0, work)
        if energy == inf:
            return inf
        deflect(scene, contacts, count, factors, arcs, offsets)
        short = shortfall(found, look(scene, arcs, offsets, contacts, count, samples, found))
        if short == 0.0:
            return energy
        if short > NEARLY:
            return inf
    return inf


@kernel()
def polish(scene, contacts, count, factors, gram, paths, samples, found):
    """Solve the conditions of optimality from the contacts; return the energy, or inf on failure."""
    arcs, offsets = paths
    if not newton(scene, contacts, count, factors, arcs, offsets):
        return inf
    if shortfall(found, look(scene, arcs, offsets, contacts, count, samples, found)) > LEFT:
        return inf
    fill_gram(scene, contacts, count, factors, gram)
    energy = 0.0
    for k in range(count):
        for m in range(count):
            energy += 0.5 * contacts.multipliers[k] * gram[k, m] * contacts.multipliers[m]
    return energy


@kernel(types.Tuple((int64, int64, float64))(SCENE, SIDES, int64, float64, WORKSPACE))
def solve_local(scene, sides, count, bar, room):
    """Relax the first `count` contacts in `hand` and new ones; return (status, contacts, energy).

    Fills `best` with the contacts of the lowest-cost clear solution, or for BLOCKED with the last contacts.
    Stops where the energy is well above `bar` when nearly clear.
    """
    best, contacts = lent(room.best), lent(room.hand)
    samples = lent(Bodies(room.states, room.places, room.speeds))
    slid, following, trial = lent(room.slid), lent(room.following), lent(room.trial)
    factors, gram, work = borrowed(room.factors), borrowed(room.gram), borrowed(room.work)
    gaps, found = borrowed(room.gaps), borrowed(room.found)
    arcs, offsets = borrowed(room.arcs), borrowed(room.offsets)
    paths = arcs, offsets
    for body in range(len(scene.base), len(scene.states)):
        samples.speeds[body] = spread(scene.states[body], samples.places[body])
        for k in range(len(scene.times)):
            for i in range(6):
                samples.states[body, k, i] = scene.states[body, k, i]
    kept, least_energy = 0, inf
    before, close, least, latest, closing = inf, CLOSE, inf, 0, False
    for turn in range(ROUNDS):
        fill_factors(scene, contacts, count, factors)
        fill_gram(scene, contacts, count, factors, gram)
        fill_gaps(scene, contacts, count, gaps)
        energy = solve_multipliers(scene, contacts, count, gram, gaps, 1.0, SOFT * FADE**turn, work)
        if energy == inf:
            solve_multipliers(scene, contacts, count, gram, gaps, 1.0, SOFT, work)
        deflect(scene, contacts, count, factors, arcs, offsets)
        moved = slide_all(scene, arcs, offsets, contacts, count, slid)
        number = look(scene, arcs, offsets, contacts, count, samples, found)
        short = shortfall(found, number)
        settled = next_contacts(scene, arcs, offsets, contacts, count, slid, trial, following)
        total = add_fresh(scene, sides, arcs, offsets, found, number, following, settled)
        if short < max(least, NEARLY):
            least, latest = short, turn
        elif turn - latest > HOPELESS:
            break
        if short < NEARLY:
            if energy > GIVEN_UP * bar:
                break
            if total == settled and (moved < close or closing):
                copy_contacts(following, settled, trial)
                polished = polish(scene, trial, settled, factors, gram, paths, samples, found)
                if polished < inf and polished <= least_energy * (1.0 + STEADY):  # exact contacts
                    return OPTIMAL, copy_contacts(trial, settled, best), polished
                if polished < inf:
                    return CLEAR, kept, least_energy
                fill_factors(scene, contacts, count, factors)
                fill_gram(scene, contacts, count, factors, gram)
                close = 0.5 * moved
            energy = raise_planes(
                scene, contacts, count, short, gram, gaps, work, factors, paths, samples, found
            )
            if energy < least_energy:
                kept, least_energy = copy_contacts(contacts, count, best), energy
            if least_energy < inf and energy - bar > PACE * (before - energy) and before < inf:
                return CLEAR, kept, least_energy
            steady = energy == inf or abs(energy - before) <= STEADY * energy
            if least_energy < inf and short < ENOUGH and steady:
                if closing or settled > HUGGING * len(scene.base):
                    return CLEAR, kept, least_energy
                closing = True  # finish with Newton's method, even if contacts still move
            before = energy
        contacts, following = following, contacts
        count = total
    if least_energy < inf:
        return CLEAR, kept, least_energy
    return BLOCKED, copy_contacts(contacts, count, best), inf
