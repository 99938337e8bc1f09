"""Passively safe plans from a V-bar hold onto a ring: their cost, and plans of thrusters."""

from functools import lru_cache

import numpy as np
import pytest

import closeform as cf
from hold_transfers import hold_transfers
from ring_transfers import ring_transfers
from test_passive_delta_v import failed_states, fired, least_ratio

ORBIT = cf.Orbit.circular(500e3)
HOLD = np.array([0.0, -200.0, 0.0, 0.0, 0.0, 0.0])
ZONE = cf.Sphere(20.0)
PHASES = (158, 166, 168, 174)  # deg
SIX = cf.Thrusters.rtn()


def onto_a_ring(degrees):
    ring = cf.targets.safety_ellipse(ORBIT, 1, 60.0, 60.0, phase=np.radians(degrees))[0]
    return ORBIT.transfer(HOLD, ring, ORBIT.period), ring


@lru_cache
def planned(degrees):
    client = ORBIT.coast(np.zeros(6), 2.0 * ORBIT.period)
    return cf.avoid(onto_a_ring(degrees)[0], client, ZONE, drift=ORBIT.period, cost="delta-v")


def check_failures(path, initial, final, until, radius, seed):
    """Check 1000 losses of thrust, half of them during impulses, and the end, by matrix exponentials."""
    rng, (times, _) = np.random.default_rng(seed), fired(path)
    lost = np.concatenate([rng.uniform(path.start, path.end, 500), rng.choice(times, 500)])
    states = failed_states(initial, path, lost, rng.uniform(size=1000))
    assert least_ratio(states, lost, until) * 30.0 / radius > 1.0 - 1e-5
    end = failed_states(initial, path, np.array([path.end]), np.ones(1))[0]
    assert np.abs(end - final).max() < 1e-5


@pytest.mark.slow
def test_cost_varies_little_with_the_arrival_phase():
    """The cost changes by less than 25 % with the phase."""
    plans = [planned(degrees) for degrees in PHASES]
    assert all(plan.ok for plan in plans)
    assert max(plan.delta_v for plan in plans) < 1.25 * min(plan.delta_v for plan in plans)
    assert max(plan.delta_v for plan in plans) < 0.135


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [158, 166, 168])
def test_plans_onto_a_ring_are_safe(degrees):
    path, ring = planned(degrees).path, onto_a_ring(degrees)[1]
    assert planned(degrees).delta_v == pytest.approx(np.linalg.norm(fired(path)[1], axis=1).sum(), rel=1e-9)
    check_failures(path, HOLD, ring, 2.0 * ORBIT.period, 20.0, degrees)


def six(case):
    return cf.avoid(case.path, case.client, case.zone, drift=case.drift, cost="delta-v", thrusters=SIX)


@pytest.mark.slow
@pytest.mark.parametrize("k", [0, 6, 9])
def test_plans_of_thrusters_between_holds(k):
    """Six thrusters along axes cost at most √3 times free impulses."""
    case = hold_transfers()[k]
    plan, free = six(case), cf.avoid(case.path, case.client, case.zone, drift=case.drift, cost="delta-v")
    assert plan.ok, plan.reason
    assert free.lower_bound <= plan.delta_v <= np.sqrt(3.0) * free.delta_v
    assert plan.delta_v == pytest.approx(np.abs(fired(plan.path)[1]).sum(), rel=1e-9)
    check_failures(plan.path, case.initial, case.final, case.duration + case.drift, 30.0, k)


@pytest.mark.slow
@pytest.mark.parametrize("k", [7, 9])
def test_plans_of_thrusters_between_rings(k):
    """Plans for six thrusters are safe and reach their ends."""
    case = ring_transfers("thirty")[k]
    plan = six(case)
    assert plan.ok, plan.reason
    check_failures(plan.path, case.initial, case.final, case.duration + case.drift, 30.0, k)


def test_plan_of_inertial_thrusters():
    """The sum over three orthogonal thrusters is at most √3 times the impulse."""
    case = hold_transfers()[1]
    turned = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    stars = cf.Thrusters(np.vstack([turned, -turned]), frame="inertial")
    plan = cf.avoid(case.path, case.client, case.zone, drift=case.drift, cost="delta-v", thrusters=stars)
    assert plan.ok, plan.reason
    check_failures(plan.path, case.initial, case.final, case.duration + case.drift, 30.0, 1)
    for time, push in plan.path.impulses:
        ways = stars.directions_at(case.orbit, time)
        assert np.abs(ways[:3] @ push).sum() < 1.8 * np.linalg.norm(push)


@pytest.mark.slow
def test_closest_attempt_is_reported():
    low = np.array([0.0, -40.0, 0.0, 0.0, 0.0, 0.0])
    path = ORBIT.transfer(low, [0.0, 40.0, 0.0, 0.0, 0.0, 0.0], 0.4 * ORBIT.period)
    client = ORBIT.coast(np.zeros(6), 1.5 * ORBIT.period)
    axes = cf.Thrusters(np.vstack([np.eye(3)[:2], -np.eye(3)[:2]]))  # none across the track
    plan = cf.avoid(path, client, cf.Sphere(30.0), drift=ORBIT.period, cost="delta-v", thrusters=axes)
    assert not plan.ok
    assert "path reaches 0." in plan.reason
