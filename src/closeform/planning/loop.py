"""The loop of planning: minimise a cost subject to planes, and place the planes at the minimum anew.

A plan minimises a cost subject to requirements.  Requirements produce supporting planes: a pair of craft or
one craft, a time, the instant of a loss of thrust or none, a normal and an offset.  A program of planes is
convex and is solved exactly.

    program = planes of a start
    until settled:
        candidate = task.minimise(program)        # paths, cost, multipliers, bound, and violations
        program = task.relinearise(candidate)     # planes turned to the paths, and planes of the violations

A task is a cost with its requirements.  A method is a state machine that leads a task from a start to clear
paths: `init` begins, `step` does a round, `done` ends the loop of `run`:

    Rounds      whole steps from any planes to the lowest-cost clear paths near them
    Approach    short steps from nearly clear paths to clear ones
    Descent     steps from clear paths to cheaper ones, all of them clear

`continuous/safe_energy` derives rounds of soft planes, and has a descent of its own, for loss of thrust at
minimum energy.

From a problem to a plan:

1. `request.Request` holds the checked arguments and makes a `problem.Problem`: base arcs, obstacles, zones.
2. `planner.planned` keeps clear paths, or calls `least_energy` (`continuous/`) or
   `solve_impulses` (`delta_v/`).  Where none are found, `violations` names what remains.
3. A search (`delta_v/delta_v_search`, `continuous/`, `energy/side_search`) proposes starts: planes on
   different sides of the zones.  A method above leads from each start to clear paths; the best are kept.
4. `planner` turns them into a `Plan`.  `bounds/` and `delta_v/impulse_bound` bound the cost of all clear
   plans.

The task for each cost (row) and requirement (column); one task combines all the columns in which it stands:

                    zones            k sigma          loss of thrust    states          thrust
    energy          `energy/`        EnergySolver     EnergySolver      EnergySolver    refused
    impulses        ImpulseSolver    ImpulseSolver    ImpulseSolver     ImpulseSolver   ImpulseSolver
    burns           BurnSolver       BurnSolver       BurnSolver        BurnSolver      BurnSolver
    pulses          PulseSolver      PulseSolver      PulseSolver       PulseSolver     PulseSolver

`energy/` is compiled for plain zones and does not use this loop.  Pulses are planned only where thrust may be
lost, near safe impulses.

To add a cost, derive from `ImpulseSolver`, as the other three solvers do: the methods above need only a
`Task`, the searches for starts also its firing times and checks.  To add a requirement on one craft, derive a
class in `requirements/`; every task of its column then keeps it.  To add one on pairs, override the methods
of `Problem` that `sigmas.sigma_problem` does, first `conflicts` and `normals`.  A conflict is a violation.
A normal a is divided by the extent of the region to avoid, so that its plane is a . q >= 1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import Any, Generic, NamedTuple, Protocol, TypeVar

ROUNDS = 30  # maximum rounds; fewer leave up to a per cent of the cost
NEARLY = 0.99  # norm above which planes are moved out by the shortfall: below it they still turn
PATIENCE = 3  # clear rounds without a lower cost that end the rounds
SETTLED = 1e-5  # of the cost: change of clear rounds below which they end
HALF = 0.5  # maximum share of the way in a short step
SHARES = 0.5, 0.25, 0.125  # of the way to the minimum of planes, in steps to clear paths
GAINED = 1e-4  # of the cost: minimum saving for another step down
DESCENTS, APPROACHES = 30, 12  # maximum steps to cheaper paths, and to clear ones
CUTS, CROWDED = 16, 250  # maximum rounds of a step down that add planes, and maximum planes
SHORTENED, SHORTER = 4, 0.25  # rounds after which a step down is shorter, and by which factor
LIFTS = 0.0, 1e-3, 1e-2  # distances in zones by which planes are moved out for a step to clear paths


class Candidate(Protocol):
    """Paths that satisfy planes, and their violations of the requirements."""

    @property
    def cost(self) -> float:
        """Minimised cost of the paths."""

    @property
    def clear(self) -> bool:
        """True if the paths keep all requirements, by proof."""

    @property
    def worst(self) -> float:
        """Smallest clearance ratio, at most 1."""


C = TypeVar("C", bound=Candidate)
P = TypeVar("P")  # program: planes, and where a cost has them, firing times


class Task(Protocol[C, P]):
    """Cost with its requirements."""

    @property
    def least(self) -> float:
        """Minimum distance of planes, in zones."""

    def minimise(self, program: P, accuracy: float, aim: float, bar: float) -> C | None:
        """Return the minimum for planes at distance `aim` [zones]; None above `bar` or without any."""

    def relinearise(self, candidate: C) -> P:
        """Return the program of the next round: planes turned to the paths, and those of violations."""


class SteppingTask(Task[C, P], Protocol[C, P]):
    """Task whose paths can be blended, for short steps."""

    def crowd(self, program: P) -> int:
        """Return the number of planes of a program."""

    def supported(self, clear: C, found: C, program: P) -> P:
        """Return a program with added planes at violations of `found` that `clear` paths keep."""

    def displacement(self, one: C, other: C) -> float:
        """Return the largest displacement of a pair from one candidate to another, in zones."""

    def part_way(self, one: C, other: C, share: float) -> C:
        """Return paths a fraction of the way from one candidate to another, simplified."""

    def blend(self, one: C, other: C, share: float) -> C:
        """Return paths a fraction of the way from one candidate to another, exactly."""

    def arrives(self, candidate: C) -> bool:
        """Return whether paths reach their final states."""

    def exhausted(self) -> bool:
        """Return whether the search has used its effort."""


def run(method: Any, start: Any) -> Any:
    """Return the best candidate of a method from a start; None without any."""
    state = method.init(start)
    while not method.done(state):
        state = method.step(state)
    return state.best


def moved_out(aim: float, least: float, found: Candidate, nearly: float = NEARLY) -> float:
    """Return the distance of planes in the next round: by the shortfall farther, or half-way back."""
    if found.worst <= nearly:
        return aim
    return 0.5 * (aim + least) if found.clear else aim + 1.0 - found.worst


def fading(first: float, factor: float, last: float) -> tuple[float, ...]:
    """Return accuracies from the first to the last, each `factor` times the one before."""
    found = [first]
    while found[-1] > last:
        found.append(max(factor * found[-1], last))
    return tuple(found)


class Round(NamedTuple, Generic[C, P]):
    """State of `Rounds`: the next program, its planes' distance, and the results so far."""

    program: P
    aim: float
    found: C | None = None  # of the last round
    best: C | None = None
    idle: int = 0
    turn: int = 0
    over: bool = False


@dataclass(frozen=True)
class Rounds(Generic[C, P]):
    """Whole steps from any planes to the lowest-cost clear paths near them.

    Paths that are clear stay clear when the planes turn, and their cost decreases.  Programs have the
    `accuracies` of the first rounds, then always the last of these; only then are planes moved out.  With a
    `stride`, a round that is not clear goes only so far that no pair moves by more than `stride` zones.
    """

    task: Any  # Task[C, P], with a stride SteppingTask[C, P]
    bar: Callable[[int], float]  # cost above which a round ends the search, by its number
    most: int = ROUNDS  # maximum rounds
    stride: float = inf
    accuracies: tuple[float, ...] = (0.0,)
    settled: float = SETTLED
    patience: int = PATIENCE
    nearly: float = NEARLY
    aim: float = 0.0  # first distance of the planes, if it is not the least
    steady: bool = False  # keep this distance
    first: bool = False  # end with the first clear paths
    relinearise: Callable[[C], P] | None = None  # other than the task's

    def init(self, program: P) -> Round[C, P]:
        """Return the state before the first round."""
        return Round(program, self.aim or self.task.least)

    def done(self, state: Round[C, P]) -> bool:
        """Return whether the rounds have settled, failed or reached their number."""
        return state.over or state.turn >= self.most

    def step(self, state: Round[C, P]) -> Round[C, P]:
        """Return the state after a round."""
        accuracy = self.accuracies[min(state.turn, len(self.accuracies) - 1)]
        found = self.task.minimise(state.program, accuracy, state.aim, self.bar(state.turn))
        if found is None:
            return state._replace(over=True)
        aim = state.aim
        if accuracy == self.accuracies[-1] and not self.steady:
            aim = moved_out(aim, self.task.least, found, self.nearly)
        if self.stride < inf and state.found is not None and not found.clear:
            far = self.task.displacement(state.found, found)
            share = HALF if HALF * far <= self.stride else self.stride / far
            found = self.task.part_way(state.found, found, share)
        best, idle, over = self.judge(state, found)
        if over:
            return state._replace(best=best, over=True)
        program = (self.relinearise or self.task.relinearise)(found)
        return Round(program, aim, found, best, idle, state.turn + 1)

    def judge(self, state: Round[C, P], found: C) -> tuple[C | None, int, bool]:
        """Return the best paths so far, the clear rounds without a lower cost, and if rounds are over."""
        if not found.clear:
            return state.best, state.idle, False
        gained = inf if state.best is None else state.best.cost - found.cost
        idle = 0 if gained > self.settled * found.cost else state.idle + 1
        level = abs(gained) < self.settled * found.cost or idle == self.patience
        over = self.first or (level and state.turn >= len(self.accuracies))
        return found if gained > 0.0 else state.best, idle, over


class Step(NamedTuple, Generic[C]):
    """State of `Descent` and `Approach`: the paths so far, and the number of steps."""

    best: C | None
    gained: float = inf  # by the last step
    turn: int = 0
    over: bool = False


@dataclass(frozen=True)
class Descent(Generic[C, P]):
    """Steps from clear paths to cheaper ones, all of them clear.

    The planes are those of the clear paths, which satisfy them.  Paths part of the way to the minimum of
    these planes satisfy them as well, cost less, and are clear as far as the planes represent all nearby
    violations.
    """

    task: Any  # SteppingTask[C, P]
    program: Callable[[C], P]  # planes of clear paths, and the firing times of a step
    accuracy: float

    def init(self, clear: C) -> Step[C]:
        """Return the state before the first step."""
        return Step(clear)

    def done(self, state: Step[C]) -> bool:
        """Return whether the last step saved hardly anything, or the effort is used."""
        assert state.best is not None
        level = state.gained < GAINED * state.best.cost
        return state.over or level or state.turn == DESCENTS or self.task.exhausted()

    def step(self, state: Step[C]) -> Step[C]:
        """Return the state after a step."""
        assert state.best is not None
        better = self.below(state.best)
        if better is None:
            return state._replace(over=True)
        return Step(better, state.best.cost - better.cost, state.turn + 1)

    def below(self, here: C) -> C | None:
        """Return clear paths that cost less than clear ones; None without any.

        Planes are added where a short step leads into a zone: there `here` keeps them, and so do all later
        steps.  Planes at the far minimum would not represent the violations near `here`.
        """
        program, share = self.program(here), HALF
        for cut in range(1, CUTS + 1):
            if self.task.crowd(program) > CROWDED:
                return None
            found: C | None = self.task.minimise(
                program, self.accuracy, self.task.least, (1.0 - SETTLED) * here.cost
            )
            if found is None or found.clear:
                return found if found is not None and found.cost < here.cost else None
            part: C = self.task.blend(here, found, share)
            if part.clear and part.cost < here.cost:
                return part
            program = self.task.supported(here, part, program)
            if cut % SHORTENED == 0:
                share *= SHORTER
        return None


@dataclass(frozen=True)
class Approach(Generic[C, P]):
    """Short steps from nearly clear paths to clear ones that reach their final states."""

    task: Any  # SteppingTask[C, P]
    program: Callable[[C], P]
    accuracy: float

    def init(self, near: C) -> Step[C]:
        """Return the state before the first step."""
        return Step(near)

    def done(self, state: Step[C]) -> bool:
        """Return whether paths are clear, or there are none."""
        # pulses that are left when others are omitted may be clear only because they lead elsewhere
        return state.best is None or (state.best.clear and bool(self.task.arrives(state.best)))

    def step(self, state: Step[C]) -> Step[C]:
        """Return the state after a step to clear paths, or to those nearest to them."""
        if state.turn == APPROACHES - 1 or self.task.exhausted():
            return Step(None)
        assert state.best is not None
        return Step(self.nearer(state.best), turn=state.turn + 1)

    def nearer(self, here: C) -> C | None:
        """Return paths that are clear or nearest to it, also with planes farther out; None without any."""
        program, best = self.program(here), None
        for lift in LIFTS:
            found = self.task.minimise(program, self.accuracy, self.task.least + lift, inf)
            if found is None:
                break
            for share in (1.0, *SHARES):
                part: C = found if share == 1.0 else self.task.part_way(here, found, share)
                if part.clear:
                    return part
                if best is None or part.worst > best.worst:
                    best = part
        return best
