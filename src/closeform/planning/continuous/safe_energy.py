"""Passively safe paths of minimum energy: rounds from many starts, and a descent from the best.

Starts are the planes of the unconstrained paths, shifted by natural motions.  Soft planes turn in rounds
until no failed craft is deep inside a zone.  Planes that support a zone lie outside it whatever their
direction, so that paths that satisfy them after all failures are safe.  Planes of nearly safe paths are
raised by the remaining shortfall, or are first added until the paths of minimum energy for all of them are
nearly safe, too.                                                                               # theory 4

Planes that are turned to the current paths reduce the cost only slightly where failures touch the zone over a
range of instants.  A step of the descent therefore turns them to an extrapolation of the last two steps,
farther as long as that lowers the cost.  Paths that are not nearly safe are followed a part of the way.
                                                                                               # theory (75)

Where no start leads to safe paths, the descent begins with a safe plan of two impulses and waits, whose
impulses are spread over burns.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from math import inf, nan

import numpy as np

from closeform.arrays import Floats
from closeform.motion.arc import END, MEAN_MOTION, PUSH, START, STATE, WIDTH
from closeform.motion.elements.palmer import state_from_palmer
from closeform.planning.continuous.energy_solver import HARD, ROUNDING, EnergySolver, states
from closeform.planning.delta_v.checks import Spent
from closeform.planning.delta_v.impulse_solver import Program
from closeform.planning.loop import Round, Rounds, fading, run
from closeform.planning.minimum_energy import Outcome, contacts_of
from closeform.planning.passive.two_impulse_plans import HOPS, two_impulse_plans
from closeform.planning.problem.problem import Problem
from closeform.planning.problem.scene import Contacts

STARTS, PATIENCE = 24, 8  # starts examined at most, and without a better plan
FORMATION, STARTS_OF_MANY = 4, 2  # number of craft from which the starts are few, and their number
FIRST_STARTS, MORE_STARTS = 16, 64  # of impulses, and where these give fewer than ENOUGH paths
STARTING = 0.3  # of the effort, for the starts of impulses
ENOUGH, ANOTHER = 4, 0.01  # paths, and the relative energy difference of distinct ones
SEARCHING = 0.6  # of the effort: the rest is for the descent from the best start
ROUNDS, BLIND, HOPELESS = 40, 12, 6  # maximum rounds, in total, to a first plan, and without improvement
SOFT, FADE = 0.1, 0.5  # softness of planes: initial, and decay per round to HARD
SHALLOW = 0.95  # norm below which planes are added where a part of the way to these paths enters a zone
NEARLY = 1e-2  # shortfall in zones up to which planes are raised
COARSE = 1e-4  # accepted shortfall in zones on the way
DEAR = 10.0  # penalty of a plan, as a share of its energy, for each zone of shortfall
STEADY = 1e-3  # relative change of energy at which rounds end
GIVEN_UP = 2.0  # times the energy to beat
CHEAP = 0.2  # of the unconstrained energy: bar below which the rounds are fewer
RAISES, BEYOND = 4, 1e-9  # maximum raises, and their excess over the shortfall
CUTS, CROWDED = 24, 250  # maximum rounds that add planes, and maximum planes
GAINED = 3e-6  # of the cost: saving below which a step fails
AHEAD, FARTHEST = 0.5, 32.0  # extrapolation in steps, initial and maximum
FARTHER, NEARER = 2.0, 0.25  # factors of the extrapolation after success and failure
SHARES = tuple(2.0**-k for k in range(1, 9))  # of the way to paths that are not nearly safe
SIZE, DRIFT = 1.2, 0.2  # of the zone: amplitudes of the shifts of starts, and of their semi-major axis
SPREADS = 0.25, 0.1, 0.03, 0.01, 1e-3  # of the drift between two impulses, over which each is spread
OUTSIDE = 1.0  # reserves: shortfall of requirements of nearly safe paths


def safe_energy(problem: Problem, budget: int | None, more: bool, waiting: bool) -> Outcome:
    """Return the best safe paths found; see `least_energy.least_energy` for the arguments.

    With `waiting`, a plan of two impulses with waits is another start, where the others fail.
    """
    solver = EnergySolver(problem)
    starts = STARTS if problem.count < FORMATION else STARTS_OF_MANY
    problem.effort.allow(problem.count, budget, starts)
    best, tried = searched(solver, budget or starts * (1 + more), inf if budget else PATIENCE)
    if best is None and waiting:
        best, tried = two_impulses(solver), tried + 1
    least = solver.requirement_bound() if problem.requirements else 0.0
    solver.closest.trajectories = solver.arrived(solver.closest.trajectories or problem.direct)
    if best is None:
        return Outcome(None, (), nan, solver.least, tried, closest=solver.closest, least=least)
    if best.cost > solver.least_energy:
        best = descended(solver, best)
    pressing = best.contacts.some(best.contacts.multipliers > 0.0)
    touched = contacts_of(problem, pressing, best.trajectories)
    extra = max(best.cost - solver.least_energy, 0.0)
    priced = bool(touched) or extra == 0.0
    return Outcome(
        *(solver.arrived(best.trajectories), touched, extra, solver.least, tried),
        priced=priced,
        least=min(least, best.cost),
    )


def safe_starts(problem: Problem, margin: float) -> Iterator[Contacts]:
    """Yield the contacts of safe paths of different energies, for zones enlarged by a margin."""
    solver, known = EnergySolver(problem, margin), np.empty(0)
    for number in range(MORE_STARTS):
        if problem.effort.beyond(STARTING) or (number >= FIRST_STARTS and len(known) >= ENOUGH):
            return
        found = examined(solver, number, inf)
        if found is None:
            continue
        if (np.abs(known - found.cost) > ANOTHER * (found.cost - solver.least_energy)).all():
            known = np.append(known, found.cost)
            yield found.contacts.some(found.contacts.multipliers > 0.0)


def searched(solver: EnergySolver, most: int, patience: float) -> tuple[Spent | None, int]:
    """Return the best of the safe paths from at most so many starts, and the number of starts."""
    best, tried, improved = None, 0, 0
    for tried in range(1, most + 1):
        found = examined(solver, tried - 1, inf if best is None else best.cost)
        if found is not None and (best is None or found.cost < best.cost):
            best, improved = found, tried
            if not found.contacts.number:  # the unconstrained paths are the cheapest
                break
        elif best is not None and tried - improved >= patience:
            break
        if best is not None and solver.problem.effort.beyond(SEARCHING):
            break
    return best, tried


def examined(solver: EnergySolver, seed: int, bar: float) -> Spent | None:
    """Return safe paths from a start; None without any well below `bar`, or near safe ones above it."""
    assert solver.lost is not None
    least, given = solver.least_energy, shifts(solver.problem, seed) if seed else solver.lost.unshifted
    accuracies = fading(SOFT, FADE, HARD)
    method = SoftRounds(
        *(solver, lambda _: inf, ROUNDS, inf, accuracies, STEADY, HOPELESS),
        steady=True,
        beaten=GIVEN_UP * (bar - least),
        blind=BLIND if bar - least < CHEAP * least else ROUNDS,
    )
    near: Spent | None = run(method, Program(solver.lost.shifted(given), []))
    if near is None or near.cost > bar:
        return None
    found = raised(solver, near)
    if found is None:
        better = beyond_planes(solver, near, bar)
        found = better and raised(solver, better)
    return found


@dataclass(frozen=True)
class SoftRounds(Rounds[Spent, Program]):
    """Rounds of soft planes that end with nearly safe paths.

    Where failures touch a zone over a range of instants, planes alternate, and few rounds are clear.
    """

    beaten: float = inf  # penalised energy beyond the least that is too much
    blind: int = ROUNDS  # rounds without nearly safe paths

    def judge(self, state: Round[Spent, Program], found: Spent) -> tuple[Spent | None, int, bool]:
        """Return the best nearly safe paths, the rounds without better ones, and whether rounds are over."""
        best, idle, before = state.best, state.idle + 1, inf if state.found is None else state.found.cost
        if is_near(found, NEARLY) and (best is None or self.penalised(found) < self.penalised(best)):
            best, idle = found, 0
        if best is None:
            return best, idle, state.turn == self.blind
        steady = idle > self.patience or abs(found.cost - before) <= self.settled * self.extra(found)
        return best, idle, steady or self.penalised(best) > self.beaten

    def extra(self, found: Spent) -> float:
        """Return the energy beyond the least."""
        return found.cost - float(self.task.least_energy)

    def penalised(self, found: Spent) -> float:
        """Return the energy beyond the least with a penalty for the shortfall."""
        return self.extra(found) * (1.0 + DEAR * (1.0 - found.worst))


def is_near(found: Spent, shortfall: float) -> bool:
    """Return whether paths are safe but for a shortfall in zones."""
    return found.worst >= 1.0 - shortfall and found.checked.outside <= OUTSIDE


def beyond_planes(solver: EnergySolver, about: Spent, bar: float) -> Spent | None:
    """Return the paths of minimum energy beyond planes of the paths `about`, nearly safe if all are kept.

    None above `bar`, and the last ones after too many planes.
    """
    program, last = Program(solver.turned(about), []), None
    for _ in range(CUTS):
        last = solver.minimise(program, HARD, solver.least, bar)
        if last is None or is_near(last, COARSE) or program.contacts.number > CROWDED:
            break
        program = solver.supported(about, last, active(last))
        if last.worst < SHALLOW:  # planes where these paths are deep inside would lead to others beside them
            part = solver.blend(about, last, (1.0 - SHALLOW) / (1.0 - last.worst), False)
            program = solver.supported(about, part, program)
    return last


def active(found: Spent) -> Program:
    """Return the program of the planes that paths touch."""
    return Program(found.contacts.some(found.contacts.multipliers > 0.0), [])


def part_way(solver: EnergySolver, here: Spent, far: Spent, shortfall: float, bar: float) -> Spent | None:
    """Return nearly safe paths below `bar` a part of the way to others; None without any."""
    for share in SHARES:
        part = solver.blend(here, far, share, False)
        if part.cost > bar:
            return None
        if is_near(part, max(shortfall, BEYOND)):
            part = solver.blend(here, far, share)
            if is_near(part, shortfall):
                return part
    return None


def raised(solver: EnergySolver, near: Spent) -> Spent | None:
    """Return safe paths: those of nearly safe ones, with planes raised by their shortfall; None without."""
    aim, found, program = solver.least, near, Program(near.contacts, [])
    for _ in range(RAISES):
        if found.clear or not is_near(found, NEARLY):
            break
        aim += 1.5 * (1.0 - found.worst) + BEYOND
        higher = solver.minimise(program, HARD, aim, inf)
        if higher is None:
            return None
        found, program = higher, solver.supported(near, higher, active(higher))
    return found if found.clear else None


def descended(solver: EnergySolver, safe: Spent) -> Spent:
    """Return the safe paths of a descent, or the given ones if none is cheaper."""
    kept, now, before, last, ahead = safe, safe, safe, safe, 0.0
    while not solver.exhausted():
        about = solver.blend(before, now, 1.0 + ahead, False) if ahead else now
        bar = (1.0 - GAINED) * now.cost
        found, farther = beyond_planes(solver, about, bar if ahead else inf), FARTHER * ahead
        if found is not None and not is_near(found, COARSE):
            found = None if ahead else part_way(solver, now, found, COARSE, bar)
            farther = 0.0
        elif found is not None:
            last, farther = found, min(max(farther, AHEAD), FARTHEST)
            found = None if found.cost > bar else found
        if found is not None:
            now, before, ahead = found, now, farther
            kept = now if now.clear else kept
        elif ahead:
            ahead = NEARER * ahead if ahead >= AHEAD else 0.0
        else:
            break
    found = raised(solver, last) if last.contacts.number else None
    if found is not None and found.cost <= (1.0 + COARSE) * kept.cost:
        return found  # with the multipliers of its own planes
    found = part_way(solver, kept, now, 0.0, kept.cost) if now is not kept else None
    return found if found is not None and found.clear else kept


def two_impulses(solver: EnergySolver) -> Spent | None:
    """Return the lowest-cost two-impulse plan that is safe with its impulses as burns; None without any."""
    problem = solver.problem
    for times, _ in islice(two_impulse_plans(problem), HOPS):
        for share in SPREADS:
            arcs = [burned(problem, i, when[0], when[1], share) for i, when in enumerate(times)]
            plan = solver.of_arcs(arcs, Contacts.none(), True)
            if plan.clear:
                return plan
    return None


def burned(problem: Problem, i: int, first: float, last: float, share: float) -> Floats:
    """Return craft i's arcs, with burns for a `share` of the drift after `first` and before `last` [s]."""
    orbit, start, end = problem.orbit, *problem.base[i, [START, END]]
    state, final = problem.base[i, STATE : STATE + 6], problem.path(problem.direct)[i].state(end)
    begin = orbit.transition(problem.first - start, start) @ state
    lasts = share * (last - first)
    early, late = (
        orbit.burn(np.zeros((3, 6)), np.eye(3), lasts, at).state(at + lasts).T for at in (first, last - lasts)
    )
    pushed = np.hstack([orbit.transition(last - lasts - first, first + lasts) @ early, late])
    coasted = orbit.transition(last - problem.first, problem.first) @ begin
    missing = orbit.transition(last - end, end) @ final - coasted
    pushes = np.linalg.solve(pushed, missing).reshape(2, 3)
    edges = np.array([problem.first, first, first + lasts, last - lasts, last, problem.last])
    arcs = np.zeros((5, WIDTH))
    arcs[:, START], arcs[:, END], arcs[:, MEAN_MOTION] = edges[:-1], edges[1:], orbit._column
    arcs[[1, 3], PUSH : PUSH + 3] = pushes
    arcs[0, STATE : STATE + 6] = begin
    for before, after in zip(arcs[:-1], arcs[1:], strict=True):
        after[STATE : STATE + 6] = states(problem, before[None], before[None, END])[0]
    left: Floats = arcs[np.diff(edges) > ROUNDING * (edges[-1] - edges[0])]
    return left


def shifts(problem: Problem, seed: int) -> Floats:
    """Return random natural motions (N + M, 6) of about one zone's size for the craft; zero for obstacles."""
    draws = np.random.default_rng(seed).uniform(size=(problem.count, 6))
    size = max((float(zone.radius) for zone in problem.zones), default=0.0)
    moved = np.zeros((problem.count + len(problem.other_offsets) - 1, 6))
    n = problem.orbit._rate
    if not n:
        spread = np.array([size] * 3 + [size / (problem.arrival - problem.first)] * 3)
        moved[: problem.count] = spread * (2.0 * draws - 1.0)
        return moved
    swing, phase, across, cross_phase, along, d = draws.T
    swing, across = SIZE * swing, SIZE * across
    phase, cross_phase = 2.0 * np.pi * phase, 2.0 * np.pi * cross_phase
    parts = (
        *(swing * np.cos(phase), swing * np.sin(phase), DRIFT * (d - 0.5), along - 0.5),
        *(across * np.cos(cross_phase), across * np.sin(cross_phase)),
    )
    moved[: problem.count] = state_from_palmer(size * np.stack(parts, axis=1), n)
    return moved
