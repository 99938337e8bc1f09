"""Passively safe plans of minimum delta-v against failures at any instant and cone programs."""

import re
from functools import lru_cache

import clarabel
import numpy as np
import pytest
from scipy import sparse
from scipy.linalg import expm

import closeform as cf
from passive_plans import MATRIX, ORBIT, failed_states, fired, least_ratio
from ring_transfers import RADIUS, ring_transfers

PERIOD = ORBIT.period
SOME = [
    *(pytest.param(k, marks=pytest.mark.slow) for k in (18, 20, 22, 28)),
    8,
]  # of the thirty ring transfers
BRIEF = 1e-7  # of the duration: the ramp over which an impulse is cut
ZONE = cf.Sphere(RADIUS)


@lru_cache
def planned(k):
    case = ring_transfers("thirty")[k]
    return case, cf.avoid(case.path, case.client, case.zone, drift=case.drift, cost="delta-v")


@pytest.mark.parametrize("k", SOME)
def test_failures_stay_outside_also_within_impulses(k):
    case, plan = planned(k)
    assert (plan.ok, plan.drift, plan.cost) == (True, case.drift, "delta-v")
    times, pushes = fired(plan.path)
    rng = np.random.default_rng(k)
    lost = np.concatenate([rng.uniform(0.0, case.duration, 150), rng.choice(times, 150)])
    states = failed_states(case.initial, plan.path, lost, rng.uniform(size=300))
    assert least_ratio(states, lost, case.duration + case.drift) > 1.0 - 1e-5
    assert plan.delta_v == pytest.approx(np.linalg.norm(pushes, axis=1).sum(), rel=1e-9)
    end = failed_states(case.initial, plan.path, np.array([case.duration]), np.ones(1))[0]
    assert np.abs(end - case.final).max() < 1e-6


@pytest.mark.parametrize("k", SOME)
def test_delta_v_equals_that_of_a_cone_program_with_the_same_planes(k):
    """The cone program may fire at many times; few impulses may cost half a per cent more."""
    case, plan = planned(k)
    own, _ = fired(plan.path)
    times = np.union1d(np.linspace(0.0, case.duration, 240), own)
    ends = np.hstack([expm(MATRIX * (case.duration - time))[:, 3:] for time in times])
    rows, gaps = [], []
    for one in plan.contacts:
        lost = one.time if np.isnan(one.failed_at) else one.failed_at
        shares = np.clip(0.5 * (lost - times) / (BRIEF * case.duration) + 0.5, 0.0, 1.0)
        felt = [
            s * one.normal @ expm(MATRIX * (one.time - t))[:3, 3:] for s, t in zip(shares, times, strict=True)
        ]
        rows.append(np.concatenate(felt))
        gaps.append(one.reach - one.normal @ (expm(MATRIX * one.time) @ case.initial)[:3])
    count, width = len(times), 3 * len(times)
    missing = case.final - expm(MATRIX * case.duration) @ case.initial
    planes = np.array(rows).reshape(-1, width)
    norms = np.zeros((4 * count, width + count))
    for j in range(count):  # (size, impulse) in the cone
        norms[4 * j, width + j] = -1.0
        norms[4 * j + 1 : 4 * j + 4, 3 * j : 3 * j + 3] = -np.eye(3)
    units = np.repeat([1e-3, 1.0], 3)
    sizes = np.linalg.norm(planes, axis=1)
    a = np.vstack([ends * units[:, None], -planes / sizes[:, None]])
    a = np.vstack([np.hstack([a, np.zeros((len(a), count))]), norms])
    b = np.concatenate([missing * units, -np.array(gaps) / sizes, np.zeros(4 * count)])
    cones = [clarabel.ZeroConeT(6), clarabel.NonnegativeConeT(len(rows))] + [
        clarabel.SecondOrderConeT(4)
    ] * count
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    cost = np.repeat([0.0, 1.0], [width, count])
    zero = sparse.csc_matrix((width + count, width + count))
    solution = clarabel.DefaultSolver(zero, cost, sparse.csc_matrix(a), b, cones, settings).solve()
    assert str(solution.status) == "Solved"
    assert plan.lower_bound <= plan.delta_v
    assert (1.0 - 1e-4) * solution.obj_val <= plan.delta_v <= 1.012 * solution.obj_val


@pytest.mark.slow
def test_departure_from_a_v_bar_hold_point_has_low_cost():
    """The passively safe path of minimum energy spends 0.18 m/s."""
    orbit = cf.Orbit.circular(550e3)
    end = cf.targets.safety_ellipse(orbit, 1, 50.0, 50.0)[0]
    path = orbit.transfer([0, 200, 0, 0, 0, 0], end, 0.8 * orbit.period)
    client = orbit.coast(np.zeros(6), 2 * orbit.period)
    by_energy = cf.avoid(path, client, cf.Sphere(20.0), drift=orbit.period)
    found = cf.avoid(path, client, cf.Sphere(20.0), drift=orbit.period, cost="delta-v")
    assert found.ok
    assert found.delta_v == pytest.approx(float(found.path.delta_v))
    assert found.lower_bound < found.delta_v <= 1.1 * float(by_energy.path.delta_v)
    assert cf.passively_safe(found.path, client, cf.Sphere(20.0), found.path.end + orbit.period)


@pytest.mark.parametrize("thrusters", [None, cf.Thrusters.rtn()], ids=["any direction", "thrusters"])
def test_a_search_without_result_ends_at_its_effort_and_reports_the_nearest_miss(monkeypatch, thrusters):
    """A hold point cannot be left or reached safely in deep drift: a box makes each start expensive."""
    monkeypatch.setattr("closeform.planning.problem.problem.EFFORT", 1e6)
    path = ORBIT.transfer([0, -200, 0, 0, 0, 0], [0, 60, 0, 0, 0, 0], 0.7 * PERIOD)
    client = ORBIT.coast(np.zeros(6), 3.7 * PERIOD)
    given = path, client, cf.Box([20.0, 30.0, 25.0])
    found = cf.avoid(*given, drift=3 * PERIOD, cost="delta-v", thrusters=thrusters)
    assert not found.ok
    miss = r"path reaches [\d.]+ x zone from the obstacle at [\d.]+ s"
    assert re.search(miss, found.reason)


@pytest.mark.slow
def test_delta_v_grows_with_the_horizon():
    case = ring_transfers("thirty")[18]
    client = ORBIT.coast(np.zeros(6), case.duration + 3.0 * PERIOD)
    spent = [
        cf.avoid(case.path, client, case.zone, drift=share * PERIOD, cost="delta-v").delta_v
        for share in (0.0, 0.5, 1.0, 2.0)
    ]
    assert spent[-1] > 1.01 * spent[0]
    assert (np.diff(spent) >= -5e-3 * spent[0]).all()  # a plan of few impulses may cost so much more


def drifts(path, until, count=300):
    """Return the least distance of failures at even instants, in zone radii."""
    lost = np.linspace(path.start, path.end, count)
    return least_ratio(path.state(lost), lost, until)


@pytest.mark.slow
def test_thrust_limit_and_fixed_thrusters_are_safe():
    case = ring_transfers("thirty")[20]
    given = case.path, case.client, case.zone
    limited = cf.avoid(*given, drift=case.drift, cost="delta-v", max_acceleration=3e-4)
    axes = cf.Thrusters(np.vstack([np.eye(3), -np.eye(3)]))
    fixed = cf.avoid(*given, drift=case.drift, cost="delta-v", thrusters=axes)
    free = planned(20)[1]
    assert (limited.ok, fixed.ok) == (True, True)
    assert limited.path.peak_thrust <= 3e-4 * (1.0 + 1e-9)
    assert (np.count_nonzero(fired(fixed.path)[1], axis=1) <= 3).all()
    for plan in (limited, fixed):
        assert drifts(plan.path, case.duration + case.drift) > 1.0 - 1e-5
        assert plan.delta_v > free.lower_bound
        assert plan.drift == case.drift


@pytest.mark.slow
def test_either_of_two_spacecraft_may_fail():
    begins = cf.targets.separated_ring(ORBIT, 2, 100.0, 100.0)
    ends = cf.targets.separated_ring(ORBIT, 2, 120.0, 110.0, 0.8 * np.pi)
    duration = 1.3 * PERIOD
    final = (ORBIT.transition(duration) @ ends[:, :, None])[..., 0]
    client = ORBIT.coast(np.zeros(6), duration + PERIOD)
    given = ORBIT, begins, final, duration, ZONE
    plan = cf.reconfigure(*given, obstacles=client, drift=PERIOD, cost="delta-v")
    assert (plan.ok, plan.drift, plan.cost) == (True, PERIOD, "delta-v")
    assert plan.lower_bound <= plan.delta_v < 1.05 * plan.lower_bound
    for k, path in enumerate(plan.paths):
        times, _ = fired(path)
        rng = np.random.default_rng(k)
        lost = np.concatenate([rng.uniform(0.0, duration, 100), rng.choice(times, 100)])
        states = failed_states(begins[k], path, lost, rng.uniform(size=200))
        assert least_ratio(states, lost, duration + PERIOD) > 1.0 - 1e-5

        def other(time, there=plan.paths[1 - k]):
            early = min(time, duration)
            return (expm(MATRIX * (time - early)) @ there.state(early))[:3]

        assert least_ratio(states, lost, duration + PERIOD, other) > 1.0 - 1e-5


def test_unsafe_end_is_rejected_with_a_lower_bound():
    low = np.array([-8.0, -250.0, 0.0, 0.0, 12.0 * ORBIT.mean_motion, 0.0])
    ellipse = cf.targets.safety_ellipse(ORBIT, 1, 100.0, 100.0)[0]
    path = ORBIT.transfer(low, ellipse, PERIOD)
    client = ORBIT.coast(np.zeros(6), 9.0 * PERIOD)
    plan = cf.avoid(path, client, cf.Sphere(20.0), drift=8.0 * PERIOD, cost="delta-v")
    assert (plan.status, plan.path, plan.cost) == (cf.Status.END_UNSAFE, None, "delta-v")
    least = cf.least_delta_v(ORBIT, low, ellipse, PERIOD)
    assert plan.lower_bound == pytest.approx(least.lower, rel=1e-9)
    assert "the start of its plan path reaches" in plan.reason


@pytest.mark.parametrize("radius", [24.0, *(pytest.param(r, marks=pytest.mark.slow) for r in (25.0, 28.0))])
def test_hold_point_beside_the_zone_is_reached_safely(radius):
    """The last impulse is fired at the closest approach."""
    sphere, drift = 20.0, 2.0 * PERIOD
    begin = cf.targets.safety_ellipse(ORBIT, 1, 150.0, 150.0, along_track=200.0)[0]
    final = np.array([radius, 0.0, 0.0, 0.0, -2.0 * radius * ORBIT.mean_motion, 0.0])
    path, client = ORBIT.transfer(begin, final, PERIOD), ORBIT.coast(np.zeros(6), 3.0 * PERIOD)
    plan = cf.avoid(path, client, cf.Sphere(sphere), drift=drift, cost="delta-v")
    assert plan.ok
    times, _ = fired(plan.path)
    rng = np.random.default_rng(1)
    lost = np.concatenate([rng.uniform(0.0, PERIOD, 100), rng.choice(times, 100)])
    states = failed_states(begin, plan.path, lost, rng.uniform(size=200))
    assert least_ratio(states, lost, PERIOD + drift) * RADIUS / sphere > 1.0 - 1e-5
    assert np.abs(failed_states(begin, plan.path, np.array([PERIOD]), np.ones(1))[0] - final).max() < 1e-6


@pytest.mark.slow
def test_infinite_thrust_limit_changes_nothing() -> None:
    far = cf.targets.safety_ellipse(ORBIT, 1, 150.0, 150.0, along_track=200.0)[0]
    close = [25.0, 0.0, 50.0, 0.0, -2.0 * ORBIT.mean_motion * 25.0, 0.0]
    direct, zone, drift = ORBIT.transfer(far, close, ORBIT.period), cf.Sphere(20.0), ORBIT.period
    client = ORBIT.coast(np.zeros(6), 2.0 * ORBIT.period)
    free = cf.avoid(direct, client, zone, drift=drift, cost="delta-v")
    unlimited = cf.avoid(direct, client, zone, drift=drift, cost="delta-v", max_acceleration=np.inf)
    assert free.ok
    assert unlimited.delta_v == free.delta_v
    ends = ORBIT, [far], [close], ORBIT.period, zone
    given = {"obstacles": [client], "drift": drift, "cost": "delta-v"}
    free = cf.reconfigure(*ends, **given)
    unlimited = cf.reconfigure(*ends, **given, max_acceleration=[np.inf])
    assert free.ok
    assert unlimited.delta_v == free.delta_v
