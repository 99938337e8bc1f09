"""From safe paths down to the least energy beside them: planes are turned ahead, and kept after all failures.

Planes that touch a zone are outside it whatever path they are turned to, so that whoever keeps them after all
failures is safe.  Turned to the paths at hand they give way by little where failures touch the zone in a
whole row of instants; so a step turns them to where the last two steps lead, farther ahead as long as that
pays.                                                                                    # theory (75)
"""

from math import inf
from typing import Any

from closeform.arrays import Floats
from closeform.planning.passive_rounds import BEYOND, FORGOTTEN, Relaxed, Rounds, pressing
from closeform.planning.scene import Contacts

STEPS = 60
STEADY, IDLE = 1e-5, 3  # share of all energy, by which so many steps in a row gain less at the end
AHEAD, FARTHEST = 0.5, 32.0  # steps, by which planes are turned ahead of the paths at first, and at most
FARTHER, NEARER = 2.0, 0.25  # times as far where that has paid, and where it has not
GIVING = 1e-7  # of their own compliance, by which planes give way: many that are almost one share their force
ADDED, MOST = 12, 150  # times that planes are added in a step, and how many there may be
LASTLY = 2  # times as often and as many before planes are raised
COARSE, FINE = 1e-4, 1e-5  # zones, by which failures are left inside on the way, and before planes are raised


def settled(rounds: Rounds, safe: Relaxed) -> Relaxed:
    """What safe paths come to; these, where nothing is cheaper."""
    now, before, ahead, idle, planes, short = safe, Contacts.none(), 0.0, 0, safe.contacts, 0.0
    for _ in range(STEPS):
        there = rounds.flown(extrapolated(now.contacts, before, ahead))
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
    found = held(rounds, *rounds.flown(now.contacts), now.contacts)
    return found if found.energy < inf else rounds.raised(planes, short)


def held(rounds: Rounds, arcs: Floats, offsets: Any, known: Contacts, farther: float = 0.0) -> Relaxed:
    """The safe paths of least energy that keep planes of some paths, `known` ones among them.

    And some zones `farther` out, than they are raised to be safe.
    """
    planes, energy, short = kept(rounds, arcs, offsets, known, FINE, most=LASTLY)
    return rounds.raised(planes, short + farther) if energy < inf else Relaxed(pressing(planes), inf)


def extrapolated(now: Contacts, before: Contacts, ahead: float) -> Contacts:
    """Contacts that shape paths farther ahead, by so many times the last step."""
    if not ahead:
        return now
    there = now._replace(multipliers=(1.0 + ahead) * now.multipliers)
    return there.joined(before._replace(multipliers=-ahead * before.multipliers))


def kept(
    rounds: Rounds,
    arcs: Floats,
    offsets: Any,
    known: Contacts,
    tolerance: float,
    bar: float = inf,
    most: int = 1,
) -> tuple[Contacts, float, float]:
    """Planes of some paths, that keep all failures outside: with what energy, and what is still inside.

    The energy is inf where planes ask for what cannot be together, for more than the `bar`, or for more and
    more planes: `most` times as many as otherwise.
    """
    pushing = known.some(known.multipliers > FORGOTTEN * known.multipliers.max(initial=0.0))
    planes, short = rounds.failures(arcs, offsets, pushing)[0], inf
    for _ in range(most * ADDED):
        energy, there, own = rounds.pressed(planes, 1.0 + BEYOND, GIVING)
        if energy >= bar or planes.number > most * MOST:
            break
        inside, short = rounds.inside(there, own, pressing(planes))
        if short <= tolerance:
            return planes, energy, short
        planes = planes.joined(rounds.turned(arcs, offsets, inside))
    return planes, inf, short
