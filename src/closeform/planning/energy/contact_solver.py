"""Local solver: contacts are relaxed until the paths are clear at minimum energy on their sides.

A round solves the quadratic program of the known contacts (the zones' supporting planes there), deflects all
paths by its forces, and moves every contact to the current closest approach of its paths. A contact that
moved far also keeps its old time, which damps the rounds.  Where the energy has settled, the planes are
raised by the shortfall that remains between them; late rounds, in which a path slides along a zone, do so as
well.  The lowest-cost clear solution is kept.  The rounds of exact contacts are extrapolated.   # theory 4
"""

from math import inf
from typing import Any, NamedTuple

import numpy as np
from numba import float64, int64, types

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.kernel_loans import Lent, borrowed, lent
from closeform.motion.linear import solve
from closeform.planning.energy.plane_program import ALONE, fill_gaps, solve_planes
from closeform.planning.problem.approaches import find_minima, sample_craft, spread
from closeform.planning.problem.contacts import (
    SIDES,
    add_fresh,
    copy_contacts,
    join_equal,
    next_contacts,
    slide_all,
)
from closeform.planning.problem.deflection import deflect, fill_factors, fill_gram
from closeform.planning.problem.scene import BLOCKS, CONTACTS, INDICES, NUMBERS, ROWS, SCENE, Contacts, Scene

ROUNDS, HOPELESS = 60, 15  # maximum rounds, in total and without progress towards clear paths
SOFT, FADE = 1e-2, 0.1  # initial softness of contacts, and its decay per round, while normals turn
NEARLY = 1e-2  # shortfall, in zones, up to which planes are raised
ENOUGH, STEADY = 1e-5, 1e-6  # shortfall and relative change of energy at which rounds end
LATE = 12  # rounds after which each is a candidate: the energy of a path that slides hardly settles
RAISES = 4
MEMORY, ALIKE = 6, 1e-12  # rounds of an extrapolation, and regularisation of equal ones
STEP = 3e-3  # of windows and normals: maximum change of exact contacts in a round
GIVEN_UP = 2.0  # times the energy to beat, after the first round, which is costly at exits
PACE = 3  # rounds at the last rate of change, within which the energy must reach the bar


class Bodies(NamedTuple):
    """All bodies at a problem's sample times: states (B, T, 6), positions (B, 3, T), maximum speeds (B,)."""

    states: Floats
    places: Floats
    speeds: Floats


class Workspace(NamedTuple):
    """Arrays of the local solver: its samples, K contacts, their compliance and the paths."""

    samples: Bodies
    slid: Contacts
    following: Contacts
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
            Bodies(np.empty((bodies, samples, 6)), np.empty((bodies, 3, samples)), np.empty(bodies)),
            Contacts.none(count),
            Contacts.none(count),
            Contacts.none(count),
            Contacts.none(count),
            np.empty((count, 2, 2, 3, 6)),
            np.empty((count, count)),
            np.empty((count, count)),
            np.empty(count),
            np.empty((count, 3)),
            np.empty((rows + 2 * count, width)),
            np.empty(len(scene.base) + 1, dtype=np.int64),
        )


FACTORS = float64[:, :, :, :, ::1]
BODIES = types.NamedTuple((BLOCKS, BLOCKS, NUMBERS), Bodies)
WORKSPACE = Lent(
    types.NamedTuple(
        (BODIES, *(CONTACTS.of,) * 4, FACTORS, ROWS, ROWS, NUMBERS, ROWS, ROWS, INDICES), Workspace
    )
)


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
def raise_planes(scene, contacts, count, short, gram, gaps, work, factors, paths, samples, found):
    """Raise the planes at fixed contacts until the paths are clear; return the energy, or inf."""
    arcs, offsets = paths
    lift = 1.0
    for _ in range(RAISES):
        lift += 1.5 * short + 1e-11
        energy = solve_planes(scene, contacts, count, gram, gaps, lift, 0.0, ALONE, work)
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
def extrapolate(scene, contacts, count, following, images, changes, turn):
    """Replace the contacts of the next round by extrapolations of the last rounds (Anderson 1965).

    Rows of `images` and `changes` (MEMORY, 4 K) hold the next contacts of a round, and the difference from
    its own; `turn` is the number of rounds since the contacts were others.
    """
    here, size, known = turn % MEMORY, 4 * count, min(turn, MEMORY - 1)
    for k in range(count):
        which = contacts.which[k]
        span = scene.windows[which, 1] - scene.windows[which, 0]
        images[here, 4 * k] = following.times[k] / span
        changes[here, 4 * k] = (following.times[k] - contacts.times[k]) / span
        for i in range(3):
            images[here, 4 * k + 1 + i] = following.normals[k, i]
            changes[here, 4 * k + 1 + i] = following.normals[k, i] - contacts.normals[k, i]
    matrix, shares = np.zeros((MEMORY, MEMORY)), np.zeros(MEMORY)
    for a in range(known):
        one = (turn - 1 - a) % MEMORY
        for j in range(size):
            apart = changes[here, j] - changes[one, j]
            shares[a] += apart * changes[here, j]
            for b in range(known):
                matrix[a, b] += apart * (changes[here, j] - changes[(turn - 1 - b) % MEMORY, j])
    for a in range(known):
        matrix[a, a] *= 1.0 + ALIKE
        if not matrix[a, a] > 0.0:
            return
    solve(matrix, shares, known)
    farthest, step = 0.0, np.empty(size)
    for j in range(size):
        step[j] = changes[here, j]
        for a in range(known):
            step[j] -= shares[a] * (images[here, j] - images[(turn - 1 - a) % MEMORY, j])
        farthest = max(farthest, abs(step[j]))
    share = min(1.0, STEP / farthest) if farthest > 0.0 else 1.0
    for k in range(count):
        which = contacts.which[k]
        start, end = scene.windows[which, 0], scene.windows[which, 1]
        time = contacts.times[k] + share * step[4 * k] * (end - start)
        following.times[k] = min(max(time, start), end)
        for i in range(3):
            following.normals[k, i] = contacts.normals[k, i] + share * step[4 * k + 1 + i]


@kernel(types.Tuple((int64, float64))(SCENE, SIDES, int64, float64, float64, float64, WORKSPACE))
def solve_local(scene, sides, count, bar, soft, accuracy, room):
    """Relax the first `count` contacts in `hand` and new ones; return the number of contacts, and the energy.

    Fills `best` with the contacts of the lowest-cost clear solution, or else with the last contacts, for
    which the energy is inf.  Planes have initial softness `soft`.  Rounds end where the energy is steady and
    contacts move by at most `accuracy`, or where the energy stays above `bar`.
    """
    best, contacts, samples = lent(room.best), lent(room.hand), lent(room.samples)
    slid, following = lent(room.slid), lent(room.following)
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
    before, least, latest, alike = inf, inf, 0, 0
    size = 4 * len(gaps) if accuracy < inf else 0
    images, changes = np.empty((MEMORY, size)), np.empty((MEMORY, size))
    for turn in range(ROUNDS):
        fill_factors(scene, contacts, count, factors)
        fill_gram(scene, contacts, count, factors, gram)
        fill_gaps(scene, contacts, count, gaps)
        energy = solve_planes(scene, contacts, count, gram, gaps, 1.0, soft * FADE**turn, ALONE, work)
        if energy == inf:
            solve_planes(scene, contacts, count, gram, gaps, 1.0, SOFT, ALONE, work)
        deflect(scene, contacts, count, factors, arcs, offsets)
        moved = slide_all(scene, arcs, offsets, contacts, count, slid)
        number = look(scene, arcs, offsets, contacts, count, samples, found)
        short = shortfall(found, number)
        if accuracy < inf:
            join_equal(scene, contacts, count, slid)
            settled = copy_contacts(slid, count, following)
        else:
            settled = next_contacts(scene, arcs, offsets, contacts, count, slid, following)
        total = add_fresh(scene, sides, arcs, offsets, found, number, following, settled)
        if short < max(least, NEARLY):
            least, latest = short, turn
        elif turn - latest > HOPELESS:
            break
        if short < NEARLY:
            if turn > 0 and energy > GIVEN_UP * bar:
                break
            beaten = energy - bar > PACE * abs(before - energy)
            steady = short < ENOUGH and abs(energy - before) <= STEADY * energy and moved <= accuracy
            before = energy
            if steady or beaten or turn >= LATE:
                energy = raise_planes(
                    scene, contacts, count, short, gram, gaps, work, factors, paths, samples, found
                )
                if energy < least_energy:
                    kept, least_energy = copy_contacts(contacts, count, best), energy
                if beaten or (steady and least_energy < inf):
                    break
        same = total == count
        for k in range(min(count, total)):
            same = same and following.which[k] == contacts.which[k]
        if accuracy < inf and same:
            extrapolate(scene, contacts, count, following, images, changes, alike)
            alike += 1
        else:
            alike = 0
        contacts, following = following, contacts
        count = total
    if least_energy == inf:
        kept = copy_contacts(contacts, count, best)
    return kept, least_energy
