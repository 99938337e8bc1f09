"""Search over passing sides by impulses: choice of the contacts from which minimum delta-v is sought."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import chain, islice
from math import inf, nan

import numpy as np

from closeform.arrays import Floats
from closeform.fuel.thrusters import Thrusters
from closeform.motion.arc import END, START
from closeform.motion.minimum_delta_v.saturated import CLOSE
from closeform.motion.minimum_delta_v.within_limit import TooLittleThrust
from closeform.planning.delta_v.checks import Spent
from closeform.planning.delta_v.firing_times import Moments
from closeform.planning.delta_v.impulse_descent import at_rest, descended
from closeform.planning.delta_v.impulse_solver import AIM, NEAR, WIDEST, ImpulseSolver, beside
from closeform.planning.delta_v.thruster_allocation import shared
from closeform.planning.delta_v.waits import COARSE, firing_times, scheduled, waiting
from closeform.planning.energy.exit_directions import ranked_exits
from closeform.planning.energy.plane_program import TOGETHER
from closeform.planning.energy.side_search import FEW
from closeform.planning.limits import FULL
from closeform.planning.minimum_energy import Outcome, contacts_of
from closeform.planning.passive.two_impulse_plans import HOPS, two_impulse_plans
from closeform.planning.plan import ThrustShortfall
from closeform.planning.problem.problem import Problem, deepest
from closeform.planning.problem.scene import Contacts

ONE, MANY = 6, 1  # starts examined for one craft and for many
ALONE = 200  # for one craft without limit or drift, at a few ms each; most searches end sooner
LEAST = 1.0 + 1e-6  # times the bound: further starts save no more than rounding
ENOUGH = 1.01  # times the bound of requirements: more starts save too little
FELT = 1e-6  # of delta-v, for a zone twice as large: cheaper contacts are dropped
MORE = 4  # factor of the starts where none of these is clear
STRIDE = 1.0  # zones, maximum displacement of a pair in a step: other failures become critical farther away
# Of the free delta-v: above it, planes are also moved out by these distances in zones, and the cheapest
# results are followed down.
COSTLY, ROOMS, CHEAPEST = 1.2, (0.1, 0.2, 0.3), 12
ABOUT = 5  # safe impulsive paths near which pulses are sought
PULSED = 1.02  # times the cost of the best impulses: pulses near others are sought above it
PULSING = 0.6  # of the effort, in addition for pulses where these are not found
IN_ANY_DIRECTION, STARTING, ROOMY = 0.4, 0.6, 0.7  # of the effort, until which each part may last


def solve_impulses(
    problem: Problem,
    thrusters: Sequence[Thrusters | None],
    names: Sequence[str],
    by_energy: Callable[[], Outcome],
    safe_starts: Callable[[float], Iterator[Contacts]],
    budget: int | None = None,
    more: bool = False,
    limits: Floats | None = None,
) -> tuple[Outcome, Spent]:
    """Return the best paths of minimum delta-v, and the unconstrained optima; `budget` limits the starts.

    `safe_starts` yields contacts of passively safe paths for zones enlarged by a margin.

    Burns are within `limits` (N,) [m/s^2], if given.  If no impulses are clear, craft without thrusters
    receive the paths of minimum energy of `by_energy`, with their delta-v.  Raises ValueError, naming the
    craft, if its thrusters cannot reach its final state, and TooLittleThrust if its limit is too low.
    """
    failures = None
    if problem.drift is not None:
        from closeform.planning.delta_v.thrust_loss import ImpulseFailures

        failures = ImpulseFailures(problem, safe_starts)
        problem.effort.allow(problem.count, budget, MORE * (ONE if problem.count == 1 else MANY))
    impulses = ImpulseSolver(problem, thrusters, names, failures)
    if limits is None:
        fixed = failures is not None and impulses.pushes.fixed.any()

        def in_any_direction() -> Spent | None:
            anywhere = ImpulseSolver(problem, (None,) * problem.count, names, failures)
            free = anywhere.unconstrained()
            best, _ = searched(anywhere, free, by_energy, budget, more, until=IN_ANY_DIRECTION)
            return None if best is None else shared(impulses, best)

        return solved(impulses, by_energy, budget, more, in_any_direction if fixed else None)
    from closeform.planning.delta_v.burn_solver import BurnSolver  # only with limits

    burns = BurnSolver(problem, limits, thrusters, names, failures)
    safe: list[Spent] = []

    def near() -> Spent | None:
        free, lasting = impulses.unconstrained(), by_energy()
        long = None if lasting.trajectories is None else burns.instead_of(lasting.trajectories, free)
        problem.effort.begin()  # after continuous thrust, impulses and the burns near them
        best, _ = searched(impulses, free, by_energy, budget, more, until=IN_ANY_DIRECTION)
        safe.extend([] if best is None else [best])
        short = None if best is None else burns.tightened(best)
        clear = [one for one in (long, short) if one is not None]
        return min(clear, key=lambda one: one.cost, default=None)

    found, free = solved(burns, by_energy, budget, more, None if failures is None else near)
    if found.trajectories is not None:
        peaks = problem.path(found.trajectories).peak_thrust
        if (peaks <= FULL * limits).all():
            return found, free
    known = np.isfinite(limits)
    times = (
        inf if found.trajectories is None else float((peaks[known] / limits[known]).max())
    )  # of minimum energy
    times = min(times, burns.enough)
    enough = None if times == inf else np.where(known, times * limits, 0.0)
    none = Outcome(
        None,
        (),
        nan,
        1.0,
        found.tried,
        found.blocked,
        enough=enough,
        limited=bool(safe),
        closest=burns.closest,
        needed=burns.needed,
    )
    return none, free


def unconstrained(problem: Problem, thrusters: Sequence[Thrusters | None], names: Sequence[str]) -> Spent:
    """Return the minimum delta-v of each craft alone, without keep-out zones; raise as `solve_impulses`."""
    return ImpulseSolver(problem, thrusters, names).unconstrained()


def solved(
    solver: ImpulseSolver,
    by_energy: Callable[[], Outcome],
    budget: int | None = None,
    more: bool = False,
    near: Callable[[], Spent | None] | None = None,
) -> tuple[Outcome, Spent]:
    """Return the result of one solver.

    `by_energy` returns the paths of minimum energy, and `near` other clear paths.
    """
    problem, free = solver.problem, solver.unconstrained()
    best, begun = searched(solver, free, by_energy, budget, more, near)
    if problem.requirements and solver.required is not None:
        free = replace(free, least=max(free.least, solver.required.least))
    alone = clear_optimum(solver, free, best)
    if alone is not None:
        alone = in_bits(solver, alone) or alone
        small = int(solver.below_bit(alone).sum())
        found = Outcome(alone.trajectories, (), 0.0, alone.margin, 0, delta_v=alone.cost, below_bit=small)
        return found, free
    tried, safe = len(begun), best is not None
    if best is not None and fires(solver):
        solver, best = pulses_near(solver, free, begun, best)
    if best is not None:
        return outcome_of(solver, best, tried), free
    if solver.pushes.fixed.any() or problem.requirements:
        blocking = blocked(solver, free)
        return Outcome(None, (), nan, 1.0, tried, blocking, closest=solver.closest, unfired=safe), free
    other = thrusting(problem, by_energy())
    return replace(other, tried=tried + other.tried, closest=solver.closest), free


def outcome_of(solver: ImpulseSolver, best: Spent, tried: int) -> Outcome:
    """Return the outcome of a search that found clear paths."""
    problem = solver.problem
    touched = solver.settled(best).some(best.pushing) if best.contacts.number else best.contacts
    at, priced = best.trajectories, True
    if solver.failures is not None:
        touched = touched.some(touched.multipliers > FELT * best.cost)
        touched, priced = solver.failures.touching(at, touched)
        at = solver.failures.brief(at)
    elif (whole := in_bits(solver, best)) is not None:
        best, at, priced = whole, whole.trajectories, False
        places = problem.motions(at, touched)[:, 0]
        touched = touched.some((touched.normals * places).sum(axis=1) < NEAR)
    answer = best.trajectories, contacts_of(problem, touched, at), nan, best.margin, tried
    small = int(solver.below_bit(best).sum())
    return Outcome(*answer, delta_v=best.cost, priced=priced, below_bit=small)


def clear_optimum(solver: ImpulseSolver, free: Spent, best: Spent | None) -> Spent | None:
    """Return an unconstrained optimum that is clear: `free`, or one that `best` leads to; None without.

    Of optima of equal cost, rounding decides which one `free` is.
    """
    if free.checked.clear:
        return free
    if best is None or solver.failures is not None or best.cost > LEAST * free.cost:
        return None
    optimum = solver.by_few(best.moments, best.impulses.copy(), best, Contacts.none())
    return optimum if optimum.checked.clear else None


def in_bits(solver: ImpulseSolver, found: Spent) -> Spent | None:
    """Return clear paths without the impulses below the minimum bit in `found`; None if there are none."""
    if solver.failures is not None or solver.limits.any() or not solver.below_bit(found).any():
        return None
    from closeform.planning.delta_v.minimum_bits import in_whole_bits  # which only thrusters with a bit need

    return in_whole_bits(solver, found)


def searched(
    solver: ImpulseSolver,
    free: Spent,
    by_energy: Callable[[], Outcome],
    budget: int | None,
    more: bool,
    near: Callable[[], Spent | None] | None = None,
    until: float = ROOMY,
) -> tuple[Spent | None, list[Contacts]]:
    """Return the lowest-cost clear paths found, and the starts that were examined.

    With a loss of thrust the search ends when a share `until` of the effort is used.
    """
    if free.checked.clear:
        return free, []
    solver.requirements.add(free.checked.required)
    required = solver.required if solver.problem.requirements else free
    if required is None:
        if not (solver.requirements.steer or solver.limits.any()):  # all is convex: there are no such paths
            return None, []
        required = free
    if required.clear and required.cost <= ENOUGH * required.least:
        return fewest(solver, required), [required.contacts]
    other = None if near is None else near()
    solver.closest.note(required.checked.worst, required.trajectories, required.checked.outside)
    best, begun = from_starts(solver, free, required, by_energy, budget, more, until)
    if other is not None and other.checked.clear and (best is None or other.cost < best.cost):
        best = other
    may_wait = solver.failures is not None and not (solver.limits.any() or solver.pushes.fixed.any())
    if may_wait and not near_bound(solver, best):
        best = two_impulses(solver, required, best) or best
        best = with_waits(solver, by_energy, best) or best
    best = None if best is None else fewest(solver, best)
    may_cost_less = solver.failures is not None and not solver.limits.any() and not near_bound(solver, best)
    costly = best is None or (not solver.problem.requirements and best.cost > COSTLY * required.cost)
    if may_cost_less and costly:  # with requirements these rounds are slow, and waits lead to cheaper paths
        best = roomier(solver, required, begun, best, until)
    return best, begun


def from_starts(
    solver: ImpulseSolver,
    free: Spent,
    required: Spent,
    by_energy: Callable[[], Outcome],
    budget: int | None,
    more: bool = False,
    until: float = ROOMY,
) -> tuple[Spent | None, list[Contacts]]:
    """Return the lowest-cost clear paths to which rounds from starts lead, and these starts.

    `free` and `required` are the paths of minimum delta-v without zones, without and with requirements.
    """
    best: Spent | None = None
    begun: list[Contacts] = []
    effort, single = solver.problem.effort, solver.problem.count == 1
    alone = single and solver.failures is None and not solver.limits.any()
    usual = ALONE if alone else (ONE if single else MANY) * (MORE if more or solver.failures else 1)
    most = budget or usual
    for start in chain(starts(solver, required, by_energy), turns(solver, lambda: best) if alone else ()):  # noqa: B023
        if len(begun) == most or (alone and best is not None and best.cost <= LEAST * free.least):
            break
        if solver.failures is not None and begun and effort.beyond(until * STARTING / ROOMY):
            break
        for holding, stride in ways_on(solver):
            if solver.failures is not None:
                solver.failures.holding = holding
            # planes turn, so that both options of the first start are completed whatever they cost
            bar = inf if best is None or not begun else best.cost
            found = solver.solve(start, bar, stride)
            if found is not None and solver.failures is not None and strayed(solver.problem, required, found):
                continue
            best = found if best is None or (found is not None and found.cost < best.cost) else best
            if near_bound(solver, best):
                break
        else:
            begun.append(start)
            continue
        begun.append(start)
        break
    if solver.failures is not None:
        solver.failures.holding = False
    return best, begun


def near_bound(solver: ImpulseSolver, best: Spent | None) -> bool:
    """Return whether paths cost hardly more than any that keep the requirements on single craft.

    Only a loss of thrust has so many starts that the bound pays.
    """
    if best is None or solver.failures is None or not solver.problem.requirements:
        return False
    return solver.required is not None and best.cost <= ENOUGH * solver.required.least


def two_impulses(solver: ImpulseSolver, free: Spent, best: Spent | None) -> Spent | None:
    """Return the lowest-cost safe plan of two impulses with waits, if it costs less than the best one."""
    for times, impulses in islice(two_impulse_plans(solver.problem), HOPS):
        if best is not None and np.linalg.norm(impulses, axis=2).sum() >= best.cost:
            return None
        moments = [Moments.instants(own, np.zeros(2, dtype=np.int64)) for own in times]
        found = replace(solver.fired_at(moments, impulses, free), margin=AIM)
        if found.checked.clear:
            return found
    return None


def with_waits(solver: ImpulseSolver, by_energy: Callable[[], Outcome], best: Spent | None) -> Spent | None:
    """Return the lowest-cost safe paths found with waits, if they cost less than the best; None without.

    Longer times to fire lead from these to cheaper paths, step by step, as they would for a shorter duration.
    Without requirements only waits that already cost less than the best paths pay, beside two impulses.
    """
    found, firing = waiting(solver, best.cost if best and not solver.problem.requirements else inf)
    if found is None and best is None:
        for time in firing_times(solver.problem, COARSE):
            short, firing = scheduled(solver, time), time
            if short is not None and short.required is not None:
                found, _ = from_starts(short, short.required, short.required, by_energy, 1)
            if found is not None:
                break
    if found is not None:
        for time in reversed([one for one in firing_times(solver.problem, COARSE) if one > firing]):
            if (short := scheduled(solver, time)) is not None:
                found = min(found, fewer(short, found), key=lambda one: one.cost)
    return found if best is None or (found is not None and found.cost < best.cost) else None


def fewest(solver: ImpulseSolver, best: Spent) -> Spent:
    """Return clear paths with few impulses, none of them small, at hardly more cost."""
    return solver.without_small(fewer(solver, best))


def fewer(solver: ImpulseSolver, best: Spent) -> Spent:
    """Return clear paths with few impulses at hardly more cost, with a loss of thrust after a descent."""
    best = solver.fewest(solver.focused(best))
    if solver.failures is not None and not near_bound(solver, best):
        best = solver.fewest(descended(solver, best))
    return best


def roomier(
    solver: ImpulseSolver, free: Spent, begun: list[Contacts], best: Spent | None, until: float
) -> Spent | None:
    """Return the lowest-cost safe paths found with planes farther out, after descent to the zones.

    With a loss of thrust, rounds converge to one of many costs, and small changes decide which.  With planes
    farther out, more of them reach safe paths at all.
    """
    found = [*([] if best is None else [best]), *with_room(solver, free, begun, until)]
    found = sorted(found, key=lambda one: one.cost)[:CHEAPEST]
    down = [at_rest(solver, one, solver.following) for one in found]
    cheapest = min(down, key=lambda one: one.cost, default=None)
    if cheapest is None or (best is not None and not cheapest.cost < best.cost):
        return best
    return fewest(solver, cheapest)


def with_room(solver: ImpulseSolver, free: Spent, begun: list[Contacts], until: float) -> Iterator[Spent]:
    """Yield safe paths found with planes farther out, the nearer planes first."""
    assert solver.failures is not None
    for room in ROOMS:
        solver.least = AIM + room
        for start in (*begun, *islice(solver.failures.starts(solver.least), ONE)):
            if solver.problem.effort.beyond(until):
                return
            for holding, stride in ways_on(solver):
                solver.least, solver.failures.holding = AIM + room, holding
                one = solver.solve(start, inf, stride)
                solver.least, solver.failures.holding = AIM, False
                if one is not None and not strayed(solver.problem, free, one):
                    yield replace(one, margin=AIM)


def fires(solver: ImpulseSolver) -> bool:
    """Return whether thrust may be lost, and the acceleration of all craft's thrusters is known."""
    strong = all(own is not None and own.acceleration is not None for own in solver.thrusters)
    return solver.failures is not None and strong


def pulses_near(
    solver: ImpulseSolver, free: Spent, begun: list[Contacts], best: Spent
) -> tuple[ImpulseSolver, Spent | None]:
    """Return a pulse solver, and the cheapest safe pulses near safe impulses; None without any."""
    from closeform.planning.delta_v.pulse_solver import PulseSolver  # only for pulsed thrusters

    pulses, effort = PulseSolver.of(solver), solver.problem.effort
    found: Spent | None = None
    effort.extend(PULSING)
    for safe in islice(chain([best], with_room(solver, free, begun, 1.0)), ABOUT):
        near = pulses.nearby(safe)
        found = near if found is None or (near is not None and near.cost < found.cost) else found
        if found is not None and found.cost <= PULSED * best.cost:
            break
    if found is None:
        effort.extend(PULSING)
        found = pulses.nearby(best) or pulses.nearby(best, gradually=True)
    return pulses, found


def ways_on(solver: ImpulseSolver) -> tuple[tuple[bool, float], ...]:
    """Return the options of the rounds: whether active planes are held, and the maximum step."""
    if solver.failures is None:
        return ((False, inf),)
    held = (False, inf), (True, inf)
    return held if solver.limits.any() else (*held, (False, STRIDE))  # steps would refine slots without end


def strayed(problem: Problem, free: Spent, found: Spent) -> bool:
    """Return whether contacts displace a craft so far from its unconstrained path that no plan results."""
    there, here = (problem.motions(one.trajectories, found.contacts)[:, 0] for one in (free, found))
    pushed = (found.contacts.normals * (here - there)).sum(axis=1)
    return bool((np.abs(pushed) > TOGETHER).any())


def thrusting(problem: Problem, found: Outcome) -> Outcome:
    """Return an outcome of minimum energy as one of delta-v."""
    spent = nan if found.trajectories is None else float(np.sum(problem.path(found.trajectories).delta_v))
    return replace(found, delta_v=spent, priced=False)


def shortage(problem: Problem, limits: Floats, shown: TooLittleThrust | Floats) -> ThrustShortfall:
    """Return the largest shortfall of thrust, as proven for one craft, or from sufficient thrusts (N,)."""
    peaks = problem.path(problem.direct).peak_thrust
    if isinstance(shown, TooLittleThrust):
        craft, proven = shown.which, shown.needed
        needed = min(shown.enough * (1.0 + CLOSE), float(peaks[craft]))
    else:
        craft = int(np.argmax(shown / limits))
        needed, proven = float(shown[craft]), 0.0
    duration = float(problem.base[craft, END] - problem.base[craft, START])
    remedy = "raise the limit, or allow more time"
    return ThrustShortfall(craft, needed, float(limits[craft]), duration, remedy, duration, needed, proven)


def starts(solver: ImpulseSolver, free: Spent, by_energy: Callable[[], Outcome]) -> Iterator[Contacts]:
    """Yield contacts as starts: sides of other plans, the nearer sides, and each exit of a conflict.

    The other plans are: for many craft or within a limit, that of minimum energy; for thrusters, or one craft
    within a limit, that of impulses in any direction; with a loss of thrust, safe plans of minimum energy.
    """
    problem, limited = solver.problem, solver.limits.any()
    near = beside(problem, free.trajectories, problem.met(free.checked.missed))
    if problem.requirements:
        yield near.joined(free.checked.lost)  # sides on which requirements can be kept
    if solver.failures is not None:
        yield from solver.failures.starts()
    elif problem.count > 1 or limited:
        yield from touched(problem, by_energy())
    if solver.failures is None and (solver.pushes.fixed.any() or (limited and problem.count == 1)):
        anywhere = ImpulseSolver(problem, (None,) * problem.count, ("",) * problem.count)
        yield from touched(problem, solved(anywhere, by_energy, ONE)[0])
    if not problem.requirements:
        yield near.joined(free.checked.lost)
    if near.number > FEW:
        return
    for _, k, normal in ranked_exits(problem, free.trajectories, near):
        normals = near.normals.copy()
        normals[k] = normal
        yield near._replace(normals=normals)


def turns(solver: ImpulseSolver, best_of: Callable[[], Spent | None]) -> Iterator[Contacts]:
    """Yield the contacts of the best plan with one obstacle passed on another side, cheaper ones first.

    Continue from each better plan as soon as it is found, until no better one is found.
    """
    before = None
    while (best := best_of()) is not None and best is not before:
        before, ways = best, []
        contacts = best.contacts.some(best.pushing)
        for which in np.unique(contacts.which):
            others = contacts.some(contacts.which != which)
            own = contacts.some(contacts.which == which)
            one = own.some([int(own.multipliers.argmax())])
            for _, _, normal in ranked_exits(solver.problem, best.trajectories, one):
                start = others.joined(one._replace(normals=normal[None]))
                found = solver.dual(
                    solver.fleet(solver.grid), solver.planes(start, solver.least), WIDEST, best.cost
                )
                if found is not None:
                    ways.append((found.cost, start))
        for _, start in sorted(ways, key=lambda way: way[0]):
            yield start
            if best_of() is not best:
                break


def blocked(solver: ImpulseSolver, free: Spent) -> tuple[int, int] | None:
    """Return the pair in the deepest conflict on the unconstrained paths; None without any."""
    if free.checked.missed:
        return deepest(free.checked.missed)[0]
    if not free.checked.lost.number:
        return None
    first, second = solver.problem.pairs[free.checked.lost.which[:1].sum()]
    return int(first), int(second)


def touched(problem: Problem, found: Outcome) -> Iterator[Contacts]:
    """Yield the contacts of another plan, if it has any."""
    if found.trajectories is not None and found.contacts:
        yield beside(problem, found.trajectories, problem.touched(found.contacts))
