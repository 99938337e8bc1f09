"""The local solver: contacts are relaxed until the paths are clear at the least energy on their sides.

A round solves the quadratic program of the known contacts (the zones' supporting planes there),
deflects all paths by its forces, and lets every contact slide to where its two paths now come
closest.  A contact that slid far keeps its old time beside the new one, which damps the
rounds.  Once paths are nearly clear, Newton's method takes the contacts to the conditions of
optimality; where a path hugs a zone for a while it has no single contact to go to, and the planes
are raised by the little that is missing.  The cheapest clear solution is never lost.        # theory 4
"""

from math import inf
from typing import Any, NamedTuple

import numpy as np
from numba import float64, int64, types

from closeform.arrays import Floats
from closeform.compiled import borrowed, kernel
from closeform.planning.approaches import find_minima, sample_craft, slide, spread
from closeform.planning.deflection import deflect, fill_factors, fill_gram, relative_motion
from closeform.planning.optimality import newton
from closeform.planning.qp import solve_qp
from closeform.planning.rounding import gradient, rounded_norm
from closeform.planning.scene import BLOCKS, CONTACTS, INDICES, NUMBERS, ROWS, SCENE, Contacts, Scene

ROUNDS, HOPELESS = 60, 15  # rounds, and those without getting nearer to clear that are waited for
SAME = 1e-3  # of the time in which a pair can give way: contacts that are closer are one
SOFT, FADE = 1e-2, 0.3  # how far contacts give way at first, and how fast that fades: normals turn meanwhile
CLOSE = 0.05  # how little normals and times change in a round before Newton's method is tried
NEARLY = 1e-2  # how deep inside the zone paths may be to be raised out of it
ENOUGH, STEADY = 1e-6, 1e-6  # depth and relative change of energy at which rounds end
RAISES = 4
GIVEN_UP = 1.5  # times the energy to beat
TOO_FAR = 1e5  # zones that a contact alone would push its craft
MEET = 1e-9  # norm below which two craft meet and no side of the zone is nearer
LEFT = 1e-9  # what Newton's method may leave of a minimum below the aim
SMALL = 120  # contacts of which the dense conditions of optimality are solved
BLOCKED, CLEAR, OPTIMAL = 0, 1, 2  # how it ended; optimal: the conditions of optimality hold to rounding


class Sides(NamedTuple):
    """On which side a contact begins that no start gives: the nearer one, unless its norm is below `depth`.

    Then as though every body were shifted a little, so that the choices for all pairs agree: across the
    motion, or `along` it, to pass before or behind by being early or late.
    """

    shifts: Floats  # (N + M, 3) in zones
    depth: float
    along: bool


class Samples(NamedTuple):
    """All bodies at a problem's sample times: states (B, T, 6), positions (B, 3, T), greatest speeds (B,)."""

    states: Floats
    places: Floats
    speeds: Floats


class Workspace(NamedTuple):
    """Room for one problem's local solver: its samples, K contacts, their compliance and paths."""

    states: Floats
    places: Floats
    speeds: Floats
    slid: Contacts
    following: Contacts
    trial: Contacts
    factors: Floats
    gram: Floats
    work: Floats
    gaps: Floats
    found: Floats
    arcs: Floats
    offsets: Any

    @classmethod
    def of(cls, scene: Scene, count: int) -> "Workspace":
        """For as many contacts."""
        bodies, samples, craft = len(scene.states), len(scene.times), len(scene.base)
        return cls(
            np.empty((bodies, samples, 6)),
            np.empty((bodies, 3, samples)),
            np.empty(bodies),
            Contacts.none(count),
            Contacts.none(count),
            Contacts.none(count),
            np.empty((count, 2, 4, 3, 6)),
            np.empty((count, count)),
            np.empty((count, count)),
            np.empty(count),
            np.empty((count, 3)),
            np.empty((3 * craft + 2 * count, scene.base.shape[1])),
            np.empty(craft + 1, dtype=np.int64),
        )


SIDES = types.NamedTuple((ROWS, float64, types.boolean), Sides)
FACTORS = float64[:, :, :, :, ::1]
WORKSPACE = types.NamedTuple(
    (
        *(BLOCKS, BLOCKS, NUMBERS, CONTACTS, CONTACTS, CONTACTS, FACTORS),
        *(ROWS, ROWS, NUMBERS, ROWS, ROWS, INDICES),
    ),
    Workspace,
)


@kernel()
def solve_multipliers(scene, contacts, count, gram, gaps, lift, give, work):
    """Multipliers that keep the paths `lift` times the aim away, and the energy of that.

    inf where contacts ask for what cannot be together: their forces grow beyond all bounds.
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
def turn_normal(scene, which, motion, out):
    """The zone's outward normal at a relative motion; `out` stays where two craft meet."""
    kind = scene.kinds[which]
    faces = scene.faces[scene.face_offsets[kind] : scene.face_offsets[kind + 1]]
    shape, power = scene.shapes[kind], scene.powers[kind]
    if abs(rounded_norm(shape, faces, power, motion[0, 0], motion[0, 1], motion[0, 2])) > MEET:
        gradient(shape, faces, power, motion, out)


@kernel()
def choose_side(scene, sides, which, motion, out):
    """Fill the normal of a new contact at a relative motion, which is spoilt."""
    kind = scene.kinds[which]
    faces = scene.faces[scene.face_offsets[kind] : scene.face_offsets[kind + 1]]
    shape, power = scene.shapes[kind], scene.powers[kind]
    depth = rounded_norm(shape, faces, power, motion[0, 0], motion[0, 1], motion[0, 2])
    if depth < sides.depth:
        first, second = scene.pairs[which, 0], scene.pairs[which, 1]
        pace, slip = 0.0, 0.0
        for i in range(3):
            shift = sides.shifts[first, i] - sides.shifts[second, i]
            pace += motion[1, i] * motion[1, i]
            slip += (motion[0, i] + shift) * motion[1, i]
        sign = 1.0 if sides.shifts[first, 0] > sides.shifts[second, 0] else -1.0
        for i in range(3):
            shift = sides.shifts[first, i] - sides.shifts[second, i]
            if sides.along and pace > 0.0:
                motion[0, i] = sign * motion[1, i]
            else:
                motion[0, i] += shift - (slip / pace * motion[1, i] if pace > 0.0 else 0.0)
    out[0], out[1], out[2] = 1.0, 0.0, 0.0
    gradient(shape, faces, power, motion, out)


@kernel()
def copy_contact(source, k, target, m):
    """Copy contact k of `source` to place m of `target`."""
    target.which[m], target.times[m] = source.which[k], source.times[k]
    target.multipliers[m] = source.multipliers[k]
    for i in range(3):
        target.normals[m, i] = source.normals[k, i]


@kernel()
def merge(scene, source, k, target, count):
    """Add contact k of `source` to `target`, or to the one of its pair that it has come together with."""
    span = scene.windows[source.which[k], 1] - scene.windows[source.which[k], 0]
    for m in range(count):
        if target.which[m] == source.which[k] and abs(target.times[m] - source.times[k]) < SAME * span:
            push = target.multipliers[m]
            if source.multipliers[k] > push:  # the time of the hardest pressed
                copy_contact(source, k, target, m)
                target.multipliers[m] += push
            else:
                target.multipliers[m] += source.multipliers[k]
            return count
    if count < len(target.times):
        copy_contact(source, k, target, count)
        count += 1
    return count


@kernel()
def slide_all(scene, arcs, offsets, contacts, count, slid):
    """Fill `slid` with the contacts where their pairs now come closest: how far the farthest has moved."""
    motion, work = np.empty((3, 3)), np.empty(3)
    moved = 0.0
    for k in range(count):
        copy_contact(contacts, k, slid, k)
        if contacts.multipliers[k] <= 0.0:
            continue
        which = contacts.which[k]
        slid.times[k] = slide(scene, arcs, offsets, which, contacts.times[k], 1e-10, motion, work)
        relative_motion(scene, arcs, offsets, which, slid.times[k], motion)
        turn_normal(scene, which, motion, slid.normals[k])
        span = scene.windows[which, 1] - scene.windows[which, 0]
        moved = max(moved, abs(slid.times[k] - contacts.times[k]) / span)
        for i in range(3):
            moved = max(moved, abs(slid.normals[k, i] - contacts.normals[k, i]))
    return moved


@kernel()
def next_contacts(scene, arcs, offsets, contacts, count, slid, turned, following):
    """The contacts of the next round: where they have slid to, and old times that are far from there."""
    motion = np.empty((3, 3))
    total = 0
    for k in range(count):
        if contacts.multipliers[k] > 0.0:
            total = merge(scene, slid, k, following, total)
    for k in range(count):
        which, t = contacts.which[k], contacts.times[k]
        span = scene.windows[which, 1] - scene.windows[which, 0]
        if contacts.multipliers[k] > 0.0 and abs(slid.times[k] - t) > SAME * span:
            relative_motion(scene, arcs, offsets, which, t, motion)
            copy_contact(contacts, k, turned, 0)
            turn_normal(scene, which, motion, turned.normals[0])
            total = merge(scene, turned, 0, following, total)
    return total


@kernel()
def add_fresh(scene, sides, arcs, offsets, found, number, following, count):
    """Add contacts without force at minima that no contact is near: how many contacts there are then."""
    motion = np.empty((3, 3))
    total = count
    for row in range(number):
        which = int(found[row, 0])
        start, end = scene.windows[which, 0], scene.windows[which, 1]
        t = min(max(found[row, 1], start), end)
        near = total == len(following.times)
        for m in range(count):
            if following.which[m] == which and abs(following.times[m] - t) < 2.0 * SAME * (end - start):
                near = True
        if near:
            continue
        following.which[total], following.times[total], following.multipliers[total] = which, t, 0.0
        relative_motion(scene, arcs, offsets, which, t, motion)
        choose_side(scene, sides, which, motion, following.normals[total])
        total += 1
    return total


@kernel()
def shortfall(found, number):
    """By how much the deepest of the minima misses the aim, as a share of it."""
    short = 0.0
    for row in range(number):
        short = max(short, 1.0 - found[row, 2])
    return short


@kernel()
def look(scene, arcs, offsets, contacts, count, samples, found):
    """Minima below the aim of the paths that contacts shape: rows of `found`, and how many."""
    sample_craft(scene, arcs, offsets, contacts, count, samples.states, samples.places, samples.speeds)
    number = find_minima(scene, arcs, offsets, samples.states, samples.places, samples.speeds, found)
    return min(number, len(found))


@kernel()
def fill_gaps(scene, contacts, count, gaps):
    """How far the unconstrained paths fall short of the aim along the contacts' normals."""
    motion = np.empty((3, 3))
    for k in range(count):
        which, t = contacts.which[k], contacts.times[k]
        relative_motion(scene, scene.direct, scene.direct_offsets, which, t, motion)
        gaps[k] = scene.aims[scene.kinds[which]]
        for i in range(3):
            gaps[k] -= contacts.normals[k, i] * motion[0, i]


@kernel()
def raise_planes(scene, contacts, count, short, gram, gaps, work, factors, paths, samples, found):
    """Clear paths with the contacts where they are, aimed a little higher: their energy, inf without."""
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
    """Take contacts to the conditions of optimality: the energy there, inf where that fails."""
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


@kernel()
def copy_contacts(source, count, target):
    """Copy the first `count` contacts that push."""
    total = 0
    for k in range(count):
        if source.multipliers[k] > 0.0:
            copy_contact(source, k, target, total)
            total += 1
    return total


@kernel()
def lend(scene):
    """The same scene, its arrays not counted while they are passed around (see `borrowed`)."""
    return Scene(
        borrowed(scene.base),
        borrowed(scene.inverses),
        borrowed(scene.direct),
        borrowed(scene.direct_offsets),
        borrowed(scene.others),
        borrowed(scene.other_offsets),
        borrowed(scene.pairs),
        borrowed(scene.kinds),
        borrowed(scene.windows),
        borrowed(scene.presence),
        borrowed(scene.shapes),
        borrowed(scene.matrices),
        borrowed(scene.faces),
        borrowed(scene.face_offsets),
        borrowed(scene.radii),
        borrowed(scene.powers),
        borrowed(scene.aims),
        borrowed(scene.times),
        borrowed(scene.states),
        borrowed(scene.span),
    )


@kernel()
def lend_contacts(contacts):
    """The same contacts, their arrays not counted while they are passed around."""
    return Contacts(
        borrowed(contacts.which),
        borrowed(contacts.times),
        borrowed(contacts.normals),
        borrowed(contacts.multipliers),
    )


@kernel(types.Tuple((int64, int64, float64))(SCENE, SIDES, CONTACTS, int64, float64, CONTACTS, WORKSPACE))
def solve_local(scene, sides, contacts, count, bar, best, room):
    """Relax the first `count` contacts, and those that turn up: (how it ended, how many contacts, energy).

    `best` is filled with the contacts of the cheapest clear solution; BLOCKED: with those it came to.
    Given up where it costs well above `bar` when nearly clear.  `contacts` has room for more, and is spoilt.
    """
    scene, best, contacts = lend(scene), lend_contacts(best), lend_contacts(contacts)
    samples = Samples(borrowed(room.states), borrowed(room.places), borrowed(room.speeds))
    slid, following, trial = (
        lend_contacts(room.slid),
        lend_contacts(room.following),
        lend_contacts(room.trial),
    )
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
    before, close, least, latest = inf, CLOSE, inf, 0
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
            if total == settled and moved < close:
                if settled <= SMALL:
                    copy_contacts(following, settled, trial)
                    polished = polish(scene, trial, settled, factors, gram, paths, samples, found)
                    if polished < least_energy:
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
            steady = energy == inf or abs(energy - before) <= STEADY * energy
            if least_energy < inf and short < ENOUGH and steady:
                return CLEAR, kept, least_energy
            before = energy
        contacts, following = following, contacts
        count = total
    if least_energy < inf:
        return CLEAR, kept, least_energy
    return BLOCKED, copy_contacts(contacts, count, best), inf
