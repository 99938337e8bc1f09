"""Descent from safe paths to minimum energy nearby: planes are turned ahead and satisfied after all failures.

Planes that support a zone lie outside it whatever their direction, so that paths that satisfy them after
all failures are safe.  Planes that are turned to the current paths reduce the cost only slightly where
failures touch the zone over a range of instants.  A step therefore turns them to an extrapolation of the last
two steps, farther as long as that lowers the cost.
# theory (75)
"""

from math import inf
from typing import Any

from closeform.arrays import Floats
from closeform.planning.passive.relaxation_rounds import BEYOND, FORGOTTEN, Relaxed, SafeTask, pressing
from closeform.planning.problem.scene import Contacts

STEPS = 60
STEADY, IDLE = 1e-5, 3  # minimum relative saving, and the number of steps below it that end the descent
AHEAD, FARTHEST = 0.5, 32.0  # extrapolation in steps, initial and maximum
FARTHER, NEARER = 2.0, 0.25  # factors of the extrapolation after success and failure
GIVING = 1e-7  # softness of planes, of their compliance: nearly equal ones share their force
ADDED, MOST = 12, 150  # maximum rounds that add planes in a step, and maximum planes
LASTLY = 2  # factor of both before planes are raised
COARSE, FINE = 1e-4, 1e-5  # accepted shortfall in zones on the way, and before planes are raised


def settled(rounds: SafeTask, safe: Relaxed) -> Relaxed:
    """Return the safe paths of the descent, or the given ones if none is cheaper."""
    now, before, ahead, idle, planes, short = safe, Contacts.none(), 0.0, 0, safe.contacts, 0.0
    for _ in range(STEPS):
        if rounds.problem.effort.beyond():
            break
        there = rounds.trajectories(extrapolated(now.contacts, before, ahead))
        tried, energy, left = kept(rounds, *there, now.contacts, COARSE, now.energy)
        gained = now.energy - energy
        if gained > 0.0:
            planes, short = tried, left
            now, before = Relaxed(pressing(planes), energy), now.contacts
            idle = idle + 1 if gained <= STEADY * (rounds.direct_energy + energy) else 0
            if idle == IDLE:
                break
            ahead = min(max(FARTHER * ahead, AHEAD), FARTHEST)
        elif ahead == 0.0:
            break
        else:
            ahead = NEARER * ahead if ahead >= AHEAD else 0.0
    if now is safe:
        return safe
    found = held(rounds, *rounds.trajectories(now.contacts), now.contacts)
    return found if found.energy < inf else rounds.raised(planes, short)


def held(rounds: SafeTask, arcs: Floats, offsets: Any, known: Contacts, farther: float = 0.0) -> Relaxed:
    """Return the safe paths of minimum energy for the planes of the given paths and `known` ones.

    Planes are raised by `farther` zones beyond the shortfall.
    """
    planes, energy, short = kept(rounds, arcs, offsets, known, FINE, most=LASTLY)
    return rounds.raised(planes, short + farther) if energy < inf else Relaxed(pressing(planes), inf)


def extrapolated(now: Contacts, before: Contacts, ahead: float) -> Contacts:
    """Return contacts of paths extrapolated by `ahead` times the last step."""
    if not ahead:
        return now
    there = now._replace(multipliers=(1.0 + ahead) * now.multipliers)
    return there.joined(before._replace(multipliers=-ahead * before.multipliers))


def kept(
    rounds: SafeTask,
    arcs: Floats,
    offsets: Any,
    known: Contacts,
    tolerance: float,
    bar: float = inf,
    most: int = 1,
) -> tuple[Contacts, float, float]:
    """Return planes of the given paths that keep all failures outside, their energy, and the shortfall left.

    The energy is inf for incompatible planes, above the `bar`, or for too many planes: `most` times the usual
    number.
    """
    pushing = known.some(known.multipliers > FORGOTTEN * known.multipliers.max(initial=0.0))
    planes, short = rounds.failures(arcs, offsets, pushing)[0], inf
    for _ in range(most * ADDED):
        energy = rounds.pressed(planes, 1.0 + BEYOND, GIVING)
        if energy >= bar or planes.number > most * MOST:
            break
        inside, short = rounds.inside(*rounds.trajectories(planes), pressing(planes))
        if short <= tolerance:
            return planes, energy, short
        planes = planes.joined(rounds.turned(arcs, offsets, inside))
    return planes, inf, short
