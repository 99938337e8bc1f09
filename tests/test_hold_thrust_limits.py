"""Passively safe plans within thrust limits, from and to V-bar holds, against an integrator."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import closeform as cf
from closeform.planning.delta_v import delta_v_search
from closeform.planning.delta_v.burn_solver import apart
from closeform.planning.delta_v.firing_times import Moments, blended
from closeform.planning.delta_v.impulse_solver import ImpulseSolver
from hold_transfers import COSTS, DEARER, NUMBER, SEVERAL, hold_transfers
from passive_plans import MATRIX, least_ratio
from ring_transfers import RADIUS, ring_transfers

FULL = 1.0 + 1e-9  # of a limit


@pytest.fixture(scope="module", autouse=True)
def impulses_once():
    """Search the safe impulses that burns start from once per transfer; they take most of the time."""
    search, known = delta_v_search.searched, {}

    def searched(solver, *asked, **limits):
        if type(solver) is not ImpulseSolver:  # of burns
            return search(solver, *asked, **limits)
        problem = solver.problem
        assert not solver.pushes.fixed.any()
        task = problem.base.tobytes(), problem.others.tobytes(), problem.last, problem.drift, *limits.items()
        if task not in known:
            known[task] = search(solver, *asked, **limits)
        return known[task]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(delta_v_search, "searched", searched)
        yield


NODES, WEIGHTS = np.polynomial.legendre.leggauss(5)


def arcs_of(path):
    """Return begin and end (K, 2) of a path's arcs, and thrust (K, 5) at Gauss points of each."""
    edges = np.unique(np.concatenate([path.arcs[:, 0], [path.end]]))
    arcs = np.stack([edges[:-1], edges[1:]], axis=1)
    times = arcs.mean(axis=1)[:, None] + 0.5 * np.diff(arcs, axis=1) * NODES
    return arcs, np.linalg.norm(path.thrust(times.ravel()), axis=1).reshape(times.shape)


def flown_states(initial, path, times):
    """Return states (K, 6) at sorted times (K,) and the final state, by DOP853."""
    state, states = np.asarray(initial, dtype=float), np.empty((len(times), 6))
    for begin, end in arcs_of(path)[0]:
        first, last = begin + 1e-9 * (end - begin), end - 1e-9 * (end - begin)  # within this arc

        def rate(t, x, first=first, last=last):
            return MATRIX @ x + np.concatenate([np.zeros(3), path.thrust(min(max(t, first), last))])

        inside = (times >= begin) & (times < end)
        wanted = np.append(times[inside], end)
        done = solve_ivp(rate, (begin, end), state, "DOP853", wanted, rtol=1e-12, atol=1e-10)
        states[inside], state = done.y.T[:-1], done.y[:, -1]
    return states, state


def check(case, plan, limit, seed):
    """Check losses of thrust, half of them during burns, and the plan's limit, cost and end."""
    assert plan.ok, plan.reason
    assert plan.proven or plan.status == cf.Status.AVOIDED  # clear paths are proven
    arcs, sizes = arcs_of(plan.path)
    lasting = np.diff(arcs, axis=1)[:, 0]
    assert sizes.max() <= limit * FULL
    assert plan.delta_v == pytest.approx(0.5 * lasting @ sizes @ WEIGHTS, rel=1e-9)
    least = cf.least_delta_v(case.orbit, case.initial, case.final, case.duration).lower
    assert least * (1.0 - 1e-9) <= plan.lower_bound <= plan.delta_v
    rng = np.random.default_rng(seed)
    burning = rng.choice(np.flatnonzero(sizes.any(axis=1)), 200)
    amid = arcs[burning, 0] + rng.uniform(size=200) * lasting[burning]
    lost = np.unique(np.concatenate([rng.uniform(0.0, case.duration, 200), amid]))
    states, end = flown_states(case.initial, plan.path, lost)
    assert least_ratio(states, lost, case.duration + case.drift) > 1.0 - 1e-5
    assert np.abs(end - case.final).max() < 1e-5
    assert cf.passively_safe(plan.path, case.client, case.zone, case.duration + case.drift)


@pytest.mark.parametrize(
    ("k", "limit"),
    [
        pytest.param(k, limit, marks=[] if (k, limit) == (4, 0.02) else pytest.mark.slow)
        for k in range(NUMBER)
        for limit in (2.0, 0.02)
    ],
)
def test_short_burns_are_safe_and_cost_as_impulses(k, limit):
    """Burns of 25 ms to some seconds cost less than 1 % more than impulses."""
    case = hold_transfers()[k]
    given = case.path, case.client, case.zone
    plan = cf.avoid(*given, drift=case.drift, cost="delta-v", max_acceleration=limit, longer=False)
    check(case, plan, limit, k)
    assert plan.delta_v <= SEVERAL.get(k, DEARER) * COSTS[case.name]


@pytest.mark.slow
def test_long_burns_between_rings_are_safe():
    """Burns of several minutes are safe and cost little."""
    case, limit = ring_transfers("thirty")[16], 3e-4
    given = case.path, case.client, case.zone
    plan = cf.avoid(*given, drift=case.drift, cost="delta-v", max_acceleration=limit, longer=False)
    check(case, plan, limit, 16)
    assert plan.delta_v < 0.222


@pytest.mark.slow
def test_higher_limits_cost_no_more():
    case = hold_transfers()[1]
    given = case.path, case.client, case.zone
    limits = 1e-4, 3e-4, 1e-3, 0.02
    spent = [
        cf.avoid(*given, drift=case.drift, cost="delta-v", max_acceleration=limit, longer=False).delta_v
        for limit in limits
    ]
    assert (np.diff(spent) < 1e-3 * spent[-1]).all()  # tolerance of the planner
    assert spent[0] > 1.05 * spent[-1]


def test_overlapping_burns_move_apart_minimally():
    """The heavier of two overlapping burns moves less."""
    begins, weights = np.array([-3.0, 10.0, 12.0, 40.0]), np.array([1.0, 3.0, 1.0, 1.0])
    moved = apart(begins, np.full(4, 6.0), weights, 0.0, 100.0)
    np.testing.assert_allclose(moved, [0.0, 9.0, 15.0, 40.0])


@pytest.mark.slow
def test_low_limit_reports_a_sufficient_one():
    case, limit = hold_transfers()[6], 4e-5
    given = case.path, case.client, case.zone
    plan = cf.avoid(*given, drift=case.drift, cost="delta-v", max_acceleration=limit, longer=False)
    assert plan.status == cf.Status.TOO_WEAK
    assert f"its limit is {limit:.4g} m/s²" in plan.reason
    enough = 1.01 * plan.weak.needed
    other = cf.avoid(*given, drift=case.drift, cost="delta-v", max_acceleration=enough, longer=False)
    check(case, other, enough, 6)


@pytest.mark.slow
def test_burns_of_a_formation_are_safe():
    orbit = cf.Orbit.circular(500e3)
    begins = cf.targets.separated_ring(orbit, 2, 100.0, 100.0)
    ends = cf.targets.separated_ring(orbit, 2, 120.0, 110.0, 0.8 * np.pi)
    duration, drift, limit = 1.3 * orbit.period, orbit.period, 3e-4
    final = (orbit.transition(duration) @ ends[:, :, None])[..., 0]
    client = orbit.coast(np.zeros(6), duration + drift)
    given = orbit, begins, final, duration, cf.Sphere(RADIUS)
    wanted = {"obstacles": client, "drift": drift, "cost": "delta-v", "if_blocked": ()}
    impulses = cf.reconfigure(*given, **wanted)
    plan = cf.reconfigure(*given, **wanted, max_acceleration=limit)
    assert plan.status == cf.Status.AVOIDED
    assert plan.delta_v <= DEARER * impulses.delta_v
    for k, (path, other) in enumerate(zip(plan.paths, plan.paths[::-1], strict=True)):
        assert arcs_of(path)[1].max() <= limit * FULL
        lost = np.sort(np.random.default_rng(k).uniform(0.0, duration, 300))
        states, end = flown_states(begins[k], path, lost)
        assert np.abs(end - final[k]).max() < 1e-5
        assert least_ratio(states, lost, duration + drift) > 1.0 - 1e-5

        def there(time, other=other):
            early = min(time, duration)
            return (expm(MATRIX * (time - early)) @ other.state(early))[:3]

        assert least_ratio(states, lost, duration + drift, there) > 1.0 - 1e-5


def test_blended_burns_have_blended_thrust():
    """Slots are divided where either set begins or ends."""
    slots = Moments.slots(np.array([0.0, 10.0, 30.0])), Moments.slots(np.array([5.0, 20.0, 50.0, 60.0]))
    impulses = np.array([[[2.0, 0, 0], [0, 4.0, 0]]]), np.array([[[0, 0, 3.0], [0, 0, 0], [5.0, 0, 0]]])
    (found,), pushes = blended(tuple([own] for own in slots), impulses, 0.25)
    assert found.times.tolist() == [0.0, 5.0, 10.0, 20.0, 50.0]
    assert found.widths.tolist() == [5.0, 5.0, 10.0, 10.0, 10.0]
    first, second, third = [0.15, 0, 0], [0, 0.15, 0], [0, 0, 0.05]
    both = np.add(first, third), np.add(second, third)
    np.testing.assert_allclose(pushes[0] / found.widths[:, None], [first, *both, second, [0.125, 0, 0]])
