"""The rounds of a passively safe plan: planes are kept and turned until no failed craft enters a zone.

A round solves the program of the known planes (the zones' supporting planes where failed craft come
near), deflects all paths, and looks at all failures of the new paths: their minima over time become planes,
and so do the places to which those that press slide, where over the instant of failure and time craft come
closest.  In the beginning planes give way, while their normals turn.  All planes are those of the
paths at hand, so that safe paths stay safe and get cheaper.                                       # theory 4
"""

from math import inf
from typing import Any, NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.motion.arc import END, START
from closeform.planning.deflection import fly, room_for
from closeform.planning.failures import find_failures, slide_failures
from closeform.planning.passive_planes import TOGETHER, press_in
from closeform.planning.problem import MARGIN, Problem
from closeform.planning.scene import Contacts
from closeform.zones.shapes import BALL

ROUNDS, BLIND, HOPELESS = 40, 12, 6  # rounds at most, to a first plan, and to a better one
SOFT, FADE, HARD = 0.1, 0.5, 1e-9  # how far planes give way at first, how fast that fades, and in the end
# Zones, within which a sampled minimum becomes a plane, and slides to the lowest beside it.
REACH, NEAR = 1.8, 1.4
MOMENTS = 48  # instants of failure that are sampled, of each craft; of each orbit where that is more
EARLY = 1e-4, 1e-3, 4e-3  # of a craft's time: more of them near its ends
SAME = 0.25  # of the time between them: contacts that are closer are one
NEARLY = 1e-2  # how deep inside the zone failed craft may be for planes to be raised by as much
DEAR = 10.0  # shares of its energy, which a plan is taken to cost more for each zone that it falls short
STEADY = 1e-3  # relative change of energy at which rounds end
RAISES, BEYOND = 4, 1e-9  # times that planes are raised, by more than is missing
ROOM = 400  # minima, and for each pair
POWER = 32.0  # of norms whose balls stand in for zones with edges, and hold them
GIVEN_UP = 2.0  # times the energy to beat
CHEAP = 0.2  # of the unconstrained energy: plans that add less are not looked for as long
STEPS, STRIDE = 60, 0.3  # short steps of a formation, and how long one is, in zones
HELD, FORGOTTEN = 0.95, 1e-3  # shares of pushes that the next step begins with, and below which they end
OUTWARD = 1.002  # zones, to which nearly safe paths step
LOOSE, LOOSER = 3.0, 0.7  # how far planes give way in the first step, and how fast that fades
SETTLING = 1e-2  # and in the first round after the last of them


class Relaxed(NamedTuple):
    """What rounds came to: contacts that press, and their energy; inf where craft are not safe."""

    contacts: Contacts
    energy: float


class Rounds:
    """Of one problem, with zones `margin` times as large."""

    def __init__(self, problem: Problem, margin: float) -> None:
        self.problem, scene = problem, problem.seen
        edged = scene.shapes != BALL
        self.scene = scene._replace(
            powers=np.where(edged, POWER, inf),
            aims=np.where(edged, margin * 3.0 ** (1.0 / POWER), margin),
        )
        start, end = problem.base[:, START], problem.base[:, END]
        longest = float((end - start).max())
        count = int(MOMENTS * max(1.0, longest * problem.orbit.mean_motion / (2.0 * np.pi)))
        shares = np.concatenate([EARLY, (np.arange(count) + 0.5) / count, 1.0 - np.array(EARLY)])
        shares = MARGIN + (1.0 - 2.0 * MARGIN) * np.sort(shares)
        self.moments = start[:, None] + (end - start)[:, None] * shares
        self.same = SAME * longest / count
        self.direct_energy = problem.energy(problem.direct)
        self.unshifted = np.zeros((len(scene.states), 6))
        self.room = Contacts.none(ROOM * (1 + len(scene.pairs)))
        self.norms = np.empty(self.room.number)

    def shifted(self, shifts: Floats) -> Contacts:
        """Planes to begin with: those of the unconstrained paths, shifted in thought by natural motions."""
        direct = self.scene.direct, self.scene.direct_offsets
        return self.sampled(*direct, shifts)[0]

    def relaxed(self, planes: Contacts, bar: float = inf, soft: float = SOFT) -> Relaxed:
        """What planes come to, that give way by `soft` at first; given up well above the energy `bar`."""
        best, before, least, latest = None, inf, inf, 0
        for turn in range(ROUNDS):
            energy, arcs, offsets = self.pressed(planes, 1.0, max(soft * FADE**turn, HARD))
            if energy == inf:
                break
            found, short = self.failures(arcs, offsets, pressing(planes))
            cost = energy * (1.0 + DEAR * short)
            if short < NEARLY and cost < least:
                best, least, latest = (planes, short), cost, turn
            steady = turn - latest > HOPELESS or abs(energy - before) <= STEADY * energy
            if best is None and turn == BLIND and bar < CHEAP * self.direct_energy:
                break
            if best is not None and (steady or least > GIVEN_UP * bar):
                break
            before, planes = energy, found
        return self.raised(*best) if best is not None else Relaxed(pressing(planes), inf)

    def raised(self, planes: Contacts, short: float) -> Relaxed:
        """The planes raised by the little that is missing."""
        lift = 1.0
        for _ in range(RAISES):
            lift += 1.5 * short + BEYOND
            energy, arcs, offsets = self.pressed(planes, lift, HARD)
            if energy == inf:
                break
            short = self.failures(arcs, offsets, pressing(planes))[1]
            if short == 0.0:
                return Relaxed(pressing(planes), energy)
            if short > NEARLY:
                break
        return Relaxed(pressing(planes), inf)

    def walked(self, planes: Contacts, bar: float = inf) -> Relaxed:
        """The same by rounds from paths that short steps make safe; else these."""
        safe, planes = self.stepped(Contacts.none(), planes, LOOSE)
        if not safe.energy < inf:
            return safe
        best = self.relaxed(planes, bar, soft=SETTLING)
        return best if best.energy < safe.energy else safe

    def stepped(self, held: Contacts, planes: Contacts, loose: float = HARD) -> tuple[Relaxed, Contacts]:
        """Safe paths, in short steps from those of contacts that are `held` to the next; and their planes.

        Each step begins with most of what the ones before have pushed, of nearly safe paths with more and
        more of it, and leads these a little out of the zones.  Planes give way by `loose` at first.
        """
        keep, short = HELD, inf
        for turn in range(STEPS):
            held = held._replace(multipliers=keep * held.multipliers)
            if short >= NEARLY:
                held = held.some(held.multipliers > FORGOTTEN * held.multipliers.max(initial=0.0))
            direct, direct_offsets = self.flown(held)
            there = self.scene._replace(direct=direct, direct_offsets=direct_offsets)
            lift = 1.0 if short >= NEARLY else OUTWARD
            if press_in(there, planes, lift, max(loose * LOOSER**turn, HARD), STRIDE)[0] == inf:
                break
            pressed = pressing(planes)
            held = held.joined(pressed)
            arcs, offsets = self.flown(held)
            planes, short = self.failures(arcs, offsets, pressed)
            if short == 0.0:
                energy = self.problem.energy((arcs, offsets)) - self.direct_energy
                return Relaxed(held, energy), planes
            keep = 0.5 * (1.0 + keep) if short < NEARLY else HELD
        return Relaxed(held, inf), planes

    def flown(self, contacts: Contacts) -> tuple[Floats, Any]:
        """The craft's arcs under the contacts' multipliers."""
        arcs, offsets = room_for(self.scene, contacts)
        return arcs[: fly(self.scene, contacts, arcs, offsets)], offsets

    def pressed(
        self, planes: Contacts, lift: float, give: float, most: float = TOGETHER
    ) -> tuple[float, Floats, Any]:
        """The energy with which planes are kept, which fills their multipliers, and the craft's arcs then."""
        return press_in(self.scene, planes, lift, give, inf, most)

    def failures(self, arcs: Floats, offsets: Any, known: Contacts) -> tuple[Contacts, float]:
        """Planes where failed craft of some paths come near others, and what the nearest misses of the aim.

        At sampled failures, where the near ones and `known` contacts slide to, and where these were.
        """
        fresh, norms = self.sampled(arcs, offsets, self.unshifted)
        slid, stayed, ratios = self.slid(arcs, offsets, known.joined(fresh.some(norms < NEAR)))
        order = np.argsort(ratios, kind="stable")
        both = slid.some(order).joined(stayed.first(known.number))
        nearest = min(norms.min(initial=inf), ratios.min(initial=inf))
        return both.some(self.once(both)).joined(fresh), max(1.0 - float(nearest), 0.0)

    def inside(self, arcs: Floats, offsets: Any, known: Contacts) -> tuple[Contacts, float]:
        """Where failed craft of some paths are inside, once each, and what the nearest misses of the aim.

        At sampled failures, and where the near ones and `known` contacts slide to.
        """
        fresh, norms = self.sampled(arcs, offsets, self.unshifted)
        slid, _, ratios = self.slid(arcs, offsets, known.joined(fresh.some(norms < NEAR)))
        found = slid.some(np.argsort(ratios, kind="stable")[: np.count_nonzero(ratios < 1.0)])
        return found.some(self.once(found)), max(1.0 - float(ratios.min(initial=inf)), 0.0)

    def turned(self, arcs: Floats, offsets: Any, contacts: Contacts) -> Contacts:
        """Contacts with the normals of some paths, and without force."""
        _, turned, _ = self.slid(arcs, offsets, contacts)
        return turned._replace(multipliers=np.zeros(turned.number))

    def slid(self, arcs: Floats, offsets: Any, contacts: Contacts) -> tuple[Contacts, Contacts, Floats]:
        """Contacts where their pairs now come closest, and where they were, with norms (K,) of the first."""
        slid, stayed = contacts.some(np.arange(contacts.number)), contacts.first(contacts.number)
        ratios = np.empty(contacts.number)
        slide_failures(self.scene, arcs, offsets, slid, stayed.normals, ratios)
        return slid, stayed, ratios

    def once(self, contacts: Contacts) -> Any:
        """Indices of contacts of which none is the same as another, the first ones."""
        cells = np.rint(np.column_stack([contacts.times, contacts.drifts]) / self.same)
        order = np.lexsort((*cells.T[::-1], contacts.which))
        rows = np.column_stack([contacts.which, cells])[order]
        return order[np.append(True, (rows[1:] != rows[:-1]).any(axis=1))[: len(order)]]

    def sampled(self, arcs: Floats, offsets: Any, shifts: Floats) -> tuple[Contacts, Floats]:
        """The minima within REACH after sampled failures, and their norms, as though bodies were shifted."""
        given = self.scene, arcs, offsets, self.moments, shifts, REACH, self.room, self.norms
        count = find_failures(*given)
        return self.room.first(count), self.norms[:count].copy()


def pressing(planes: Contacts) -> Contacts:
    """Those that push."""
    return planes.some(planes.multipliers > 0.0)
