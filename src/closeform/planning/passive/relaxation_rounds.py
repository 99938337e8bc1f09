"""Rounds of a passively safe plan: planes are satisfied and turned until no failed craft enters a zone.

A round solves the program of the known planes (the zones' supporting planes at close approaches of failed
craft), deflects all paths, and samples all failures of the new paths.  Planes are added at their minima over
time, and at closest approaches over failure instant and time near active planes.  At first the planes are
soft, while their normals turn.  All planes are those of the current paths, so that safe paths stay safe and
become cheaper.                                                                                # theory 4
"""

from dataclasses import dataclass
from math import inf
from typing import Any, NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.motion.arc import END, START
from closeform.planning.energy.plane_program import TOGETHER, press
from closeform.planning.loop import Round, Rounds, fading, run
from closeform.planning.passive.failure_minima import find_failures, slide_failures
from closeform.planning.problem.problem import MARGIN, Closest, Problem
from closeform.planning.problem.scene import Contacts, Scene
from closeform.zones.shapes import BALL

ROUNDS, BLIND, HOPELESS = 40, 12, 6  # maximum rounds, in total, to a first plan, and without improvement
SOFT, FADE, HARD = 0.1, 0.5, 1e-9  # softness of planes: initial, decay per round, and final
# Zones, within which a sampled minimum becomes a plane, and is refined to the nearest minimum.
REACH, NEAR = 1.8, 1.4
TOUCHED = 1.02  # of zone and sigmas: closer pairs get a plane
MOMENTS = 48  # sampled instants of failure of each craft, or of each orbit where that is more
EARLY = 1e-4, 1e-3, 4e-3  # of a craft's time: additional instants near its ends
SAME = 0.25  # of the time between them: closer contacts are merged
NEARLY = 1e-2  # shortfall in zones up to which planes are raised
DEAR = 10.0  # penalty of a plan, as a share of its energy, for each zone of shortfall
STEADY = 1e-3  # relative change of energy at which rounds end
RAISES, BEYOND = 4, 1e-9  # maximum raises, and their excess over the shortfall
ROOM = 400  # capacity for minima, for each pair
POWER = 32.0  # of the norms whose balls enclose zones with edges
GIVEN_UP = 2.0  # times the energy to beat
CHEAP = 0.2  # of the unconstrained energy: bar below which the rounds are fewer
STEPS, STRIDE = 60, 0.3  # maximum short steps of a formation, and their length in zones
HELD, FORGOTTEN = (
    0.95,
    1e-3,
)  # share of the multipliers kept in the next step, and below which they are dropped
OUTWARD = 1.002  # zones: target of steps from nearly safe paths
LOOSE, LOOSER = 3.0, 0.7  # softness of planes in the first step, and its decay
SETTLING = 1e-2  # softness in the first round after the steps


class Relaxed(NamedTuple):
    """Result of rounds: active contacts, and their energy; inf where craft are not safe."""

    contacts: Contacts
    energy: float


class Pressed(NamedTuple):
    """Paths of minimum energy for planes: these planes, and those of the next round."""

    cost: float
    short: float  # largest shortfall of a sampled failure, in zones
    planes: Contacts
    following: Contacts

    @property
    def clear(self) -> bool:
        """True if no sampled failure leads into a zone."""
        return self.short == 0.0

    @property
    def worst(self) -> float:
        """Smallest clearance ratio, at most 1."""
        return 1.0 - self.short

    @property
    def penalised(self) -> float:
        """Cost with a penalty for the shortfall."""
        return self.cost * (1.0 + DEAR * self.short)


@dataclass(frozen=True)
class SoftRounds(Rounds[Pressed, Contacts]):
    """Rounds of soft planes that end with nearly safe paths, whose planes are raised afterwards.

    Where failures touch a zone over a range of instants, planes alternate, and few rounds are clear.
    """

    beaten: float = inf  # penalised cost that is too much
    blind: int = ROUNDS  # rounds without nearly safe paths

    def judge(self, state: Round[Pressed, Contacts], found: Pressed) -> tuple[Pressed | None, int, bool]:
        """Return the best nearly safe paths, the rounds without better ones, and whether rounds are over."""
        best, idle, before = state.best, state.idle + 1, inf if state.found is None else state.found.cost
        if found.short < NEARLY and (best is None or found.penalised < best.penalised):
            best, idle = found, 0
        if best is None:
            return best, idle, state.turn == self.blind
        steady = idle > self.patience or abs(found.cost - before) <= self.settled * found.cost
        return best, idle, steady or best.penalised > self.beaten


class SafeTask:
    """Minimum energy with passive safety as a task of the loop, with zones enlarged by `margin`."""

    least = 1.0  # distance of planes, of the margin

    def __init__(self, problem: Problem, margin: float) -> None:
        self.problem, self.margin, scene = problem, margin, problem.seen
        edged = scene.shapes != BALL
        self.scene = scene._replace(
            powers=np.where(edged, POWER, inf),
            aims=np.where(edged, margin * 3.0 ** (1.0 / POWER), margin),
        )
        start, end = problem.base[:, START], problem.base[:, END]
        longest = float((end - start).max())
        count = int(MOMENTS * max(1.0, longest * problem.orbit._rate / (2.0 * np.pi)))
        shares = np.concatenate([EARLY, (np.arange(count) + 0.5) / count, 1.0 - np.array(EARLY)])
        shares = MARGIN + (1.0 - 2.0 * MARGIN) * np.sort(shares)
        self.moments = start[:, None] + (end - start)[:, None] * shares
        self.same = SAME * longest / count
        self.direct_energy = problem.energy(problem.direct)
        self.unshifted = np.zeros((len(scene.states), 6))
        self.room = Contacts.none(ROOM * (1 + len(scene.pairs)))
        self.norms = np.empty(self.room.number)
        self.closest = Closest()

    def shifted(self, shifts: Floats) -> Contacts:
        """Return initial planes: those of the unconstrained paths, shifted by natural motions."""
        return self.sampled(self.scene.direct, self.scene.direct_offsets, shifts)[0]

    def relaxed(self, planes: Contacts, bar: float = inf, soft: float = SOFT) -> Relaxed:
        """Return the result of rounds from planes with initial softness `soft`; stop well above `bar`."""
        cheap = bar < CHEAP * self.direct_energy
        method = SoftRounds(
            *(self, lambda _: inf, ROUNDS, inf, fading(max(soft, HARD), FADE, HARD), STEADY, HOPELESS),
            steady=True,
            beaten=GIVEN_UP * bar,
            blind=BLIND if cheap else ROUNDS,
        )
        best: Pressed | None = run(method, planes)
        return Relaxed(pressing(planes), inf) if best is None else self.raised(best.planes, best.short)

    def minimise(self, planes: Contacts, accuracy: float, aim: float, bar: float) -> Pressed | None:
        """Return the paths of minimum energy that satisfy planes of a softness; None above `bar`."""
        energy = self.pressed(planes, aim, accuracy)
        if energy == inf or energy > bar:
            return None
        following, short = self.failures(*self.trajectories(planes), pressing(planes))
        return Pressed(energy, short, planes, following)

    def relinearise(self, found: Pressed) -> Contacts:
        """Return the planes of the next round."""
        return found.following

    def raised(self, planes: Contacts, short: float) -> Relaxed:
        """Return the result with planes raised by the remaining shortfall."""
        lift = 1.0
        for _ in range(RAISES):
            lift += 1.5 * short + BEYOND
            energy = self.pressed(planes, lift, HARD)
            if energy == inf:
                break
            short = self.failures(*self.trajectories(planes), pressing(planes))[1]
            if short == 0.0:
                return Relaxed(pressing(planes), energy)
            if short > NEARLY:
                break
        return Relaxed(pressing(planes), inf)

    def walked(self, planes: Contacts, bar: float = inf) -> Relaxed:
        """Return the result of rounds from paths made safe by short steps, or these paths if cheaper."""
        safe, planes = self.stepped(Contacts.none(), planes, LOOSE)
        if not safe.energy < inf:
            return safe
        best = self.relaxed(planes, bar, soft=SETTLING)
        return best if best.energy < safe.energy else safe

    def stepped(self, held: Contacts, planes: Contacts, loose: float = HARD) -> tuple[Relaxed, Contacts]:
        """Return safe paths reached by short steps from those of the `held` contacts, and their planes.

        Each step starts with most of the previous multipliers, for nearly safe paths with a growing share,
        and moves these slightly out of the zones.  Planes have initial softness `loose`.
        """
        keep, short = HELD, inf
        for turn in range(STEPS):
            held = held._replace(multipliers=keep * held.multipliers)
            if short >= NEARLY:
                held = held.some(held.multipliers > FORGOTTEN * held.multipliers.max(initial=0.0))
            direct, direct_offsets = self.rows(*self.trajectories(held))
            there = self.scene._replace(direct=direct, direct_offsets=direct_offsets)
            lift = 1.0 if short >= NEARLY else OUTWARD
            give = max(loose * LOOSER**turn, HARD)
            if self.pressed(planes, lift, give, scene=there, stride=STRIDE) == inf:
                break
            pressed = pressing(planes)
            held = held.joined(pressed)
            arcs, offsets = self.trajectories(held)
            planes, short = self.failures(arcs, offsets, pressed)
            if short == 0.0:
                energy = self.problem.energy((arcs, offsets)) - self.direct_energy
                return Relaxed(held, energy), planes
            keep = 0.5 * (1.0 + keep) if short < NEARLY else HELD
        return Relaxed(held, inf), planes

    def trajectories(self, contacts: Contacts) -> tuple[Floats, Any]:
        """Return the craft's arcs under the contacts' multipliers."""
        return self.problem.deflected(self.scene, contacts)

    def rows(self, arcs: Floats, offsets: Any) -> tuple[Floats, Any]:
        """Return the craft's paths as the rows that kernels read."""
        return self.problem.rows((arcs, offsets))

    def pressed(
        self,
        planes: Contacts,
        lift: float,
        give: float,
        most: float = TOGETHER,
        *,
        scene: Scene | None = None,
        stride: float = inf,
    ) -> float:
        """Fill the planes' multipliers; return their energy."""
        self.problem.effort.used += planes.number**2  # a pair of planes costs as much as a sample
        energy: float = press(scene or self.scene, planes, lift, give, stride, most)
        return energy

    def failures(self, arcs: Floats, offsets: Any, known: Contacts) -> tuple[Contacts, float]:
        """Return planes at close approaches of failed craft of the given paths, and the largest shortfall.

        They are sampled failures, closest approaches near these and the `known` contacts, and the previous
        places of the known contacts.
        """
        fresh, norms = self.sampled(*self.rows(arcs, offsets), self.unshifted)
        near = known.joined(fresh.some(norms < NEAR)).joined(self.unsure(arcs, offsets))
        slid, stayed, ratios = self.slid(arcs, offsets, near)
        order = np.argsort(ratios, kind="stable")
        both = slid.some(order).joined(stayed.first(known.number))
        nearest = float(min(norms.min(initial=inf), ratios.min(initial=inf)))
        self.closest.note(nearest, self.problem.arrived(arcs, offsets))
        return both.some(self.once(both)).joined(fresh), max(1.0 - nearest, 0.0)

    def inside(self, arcs: Floats, offsets: Any, known: Contacts) -> tuple[Contacts, float]:
        """Return the failures of the given paths inside zones, without duplicates, and the largest shortfall.

        They are the closest approaches near sampled failures and the `known` contacts.
        """
        fresh, norms = self.sampled(*self.rows(arcs, offsets), self.unshifted)
        near = known.joined(fresh.some(norms < NEAR)).joined(self.unsure(arcs, offsets))
        slid, _, ratios = self.slid(arcs, offsets, near)
        found = slid.some(np.argsort(ratios, kind="stable")[: np.count_nonzero(ratios < 1.0)])
        return found.some(self.once(found)), max(1.0 - float(ratios.min(initial=inf)), 0.0)

    def turned(self, arcs: Floats, offsets: Any, contacts: Contacts) -> Contacts:
        """Return contacts with the normals of the given paths, and without force."""
        _, turned, _ = self.slid(arcs, offsets, contacts)
        return turned._replace(multipliers=np.zeros(turned.number))

    def slid(self, arcs: Floats, offsets: Any, contacts: Contacts) -> tuple[Contacts, Contacts, Floats]:
        """Return contacts at their closest approaches, at their old times, and norms (K,) of the first.

        Contacts that keep sigmas clear remain at their times.
        """
        slid, stayed = contacts.some(np.arange(contacts.number)), contacts.first(contacts.number)
        ratios = np.empty(contacts.number)
        slide_failures(self.scene, *self.rows(arcs, offsets), slid, stayed.normals, ratios)
        unsure = self.problem.with_errors(contacts)
        if unsure.any():
            trajectories, own = self.problem.with_obstacles(arcs, offsets), contacts.some(unsure)
            slid.times[unsure], slid.drifts[unsure] = own.times, own.drifts
            slid.normals[unsure] = stayed.normals[unsure] = self.problem.normals(trajectories, own, -inf)
            places = self.problem.motions(trajectories, own)[:, 0]
            ratios[unsure] = (slid.normals[unsure] * places).sum(axis=1) / self.margin
        return slid, stayed, ratios

    def unsure(self, arcs: Floats, offsets: Any) -> Contacts:
        """Return the closest approaches of zones with sigmas along paths; empty without errors."""
        if not self.problem.sigmas:
            return Contacts.none()
        near = self.problem.met(self.problem.conflicts(self.problem.with_obstacles(arcs, offsets), TOUCHED))
        return near.some(self.problem.with_errors(near))

    def once(self, contacts: Contacts) -> Any:
        """Return the indices of distinct contacts, the first of each."""
        cells = np.rint(np.column_stack([contacts.times, contacts.drifts]) / self.same)
        order = np.lexsort((*cells.T[::-1], contacts.which))
        rows = np.column_stack([contacts.which, cells])[order]
        return order[np.append(True, (rows[1:] != rows[:-1]).any(axis=1))[: len(order)]]

    def sampled(self, rows: Floats, offsets: Any, shifts: Floats) -> tuple[Contacts, Floats]:
        """Return the minima within REACH after sampled failures of shifted bodies, and their norms."""
        given = self.scene, rows, offsets, self.moments, shifts, REACH, self.room, self.norms
        self.problem.effort.used += self.moments.shape[1] * len(self.scene.times) * len(self.scene.pairs)
        count = find_failures(*given)
        return self.room.first(count), self.norms[:count].copy()


def pressing(planes: Contacts) -> Contacts:
    """Return the planes with positive multipliers."""
    return planes.some(planes.multipliers > 0.0)
