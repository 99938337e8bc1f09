"""Plans that are passively safe, clear at three sigmas and quiet at times, against matrix exponentials."""

import numpy as np
import pytest
from scipy.linalg import expm

import closeform as cf
from passive_plans import MATRIX, failed_states, fired, least_ratio
from ring_transfers import ring_transfers

SIGMAS = 3.0
KNOWN = np.diag([1.0, 1.0, 1.0, 1e-3, 1e-3, 1e-3]) ** 2
ERRORS = cf.Uncertainty(KNOWN)


def planned(k, cost, **wanted):
    case = ring_transfers("thirty")[k]
    plan = cf.avoid(case.path, case.client, case.zone, cost=cost, **wanted)
    assert plan.ok, plan.reason
    return plan


@pytest.mark.parametrize(("k", "cost"), [(21, "energy"), (25, "delta-v")])
def test_plan_is_passively_safe_and_clear_at_three_sigmas(k, cost):
    """Neither requirement alone leads to the other, and both cost hardly more than the costlier one."""
    case = ring_transfers("thirty")[k]
    both = planned(k, cost, drift=case.drift, errors=ERRORS, sigmas=SIGMAS)
    safe, sure = planned(k, cost, drift=case.drift), planned(k, cost, errors=ERRORS, sigmas=SIGMAS)
    assert (both.drift, both.sigmas) == (case.drift, SIGMAS)
    assert clear_sigmas(safe.path, case) < SIGMAS
    assert not cf.passively_safe(sure.path, case.client, case.zone, case.duration + case.drift)
    assert both.lower_bound <= both.spent <= 1.1 * max(safe.spent, sure.spent)
    assert clear_sigmas(both.path, case) >= SIGMAS
    assert sampled_sigmas(both.path, case) > 1.0
    lost, shares = np.random.default_rng(k).uniform(0.0, case.duration, 200), np.ones(200)
    if cost == "delta-v":
        lost[:100] = np.random.default_rng(k).choice(fired(both.path)[0], 100)
        shares[:100] = np.linspace(0.0, 1.0, 100)
        states = failed_states(case.initial, both.path, lost, shares)
    else:
        states = both.path.state(lost)
    assert least_ratio(states, lost, case.duration + case.drift) > 1.0 - 1e-5


def clear_sigmas(path, case):
    """Return the certified clearance until the arrival, in standard deviations."""
    return cf.clearance_in_sigmas(
        path, case.orbit.coast(np.zeros(6), case.duration), case.zone, ERRORS
    ).sigmas


def sampled_sigmas(path, case):
    """Return the least clearance ratio of errors of three sigmas, at samples."""
    draws = np.random.default_rng(1).normal(size=(500, 6))
    draws *= SIGMAS / np.linalg.norm(draws, axis=1)[:, None]
    times = np.linspace(0.0, case.duration, 500)
    flow = np.array([expm(MATRIX * t)[:3] for t in times])
    moved = path.position(times)[:, None] + np.einsum("tij,kj->tki", flow, draws @ np.sqrt(KNOWN))
    return float(case.zone.norm(moved).min())


def test_energy_keeps_a_speed_limit_after_any_loss_of_thrust():
    """Dense states keep the limit that the safe path breaks; integrated failures stay outside the zone."""
    case = ring_transfers("thirty")[21]
    times = np.linspace(0.0, case.duration, 4001)
    safe = planned(21, "energy", drift=case.drift)
    limit = 0.97 * np.linalg.norm(safe.path.velocity(times), axis=1).max()
    required = [cf.requirements.SpeedLimit(limit=limit)]
    slow = planned(21, "energy", requirements=required)
    both = planned(21, "energy", drift=case.drift, requirements=required)
    assert np.linalg.norm(both.path.velocity(times), axis=1).max() <= limit
    assert least_ratio(slow.path.state(times[::20]), times[::20], case.duration + case.drift) < 1.0
    assert least_ratio(both.path.state(times[::20]), times[::20], case.duration + case.drift) > 1.0 - 1e-5
    assert both.lower_bound <= both.energy <= 1.05 * max(safe.energy, slow.energy)
    assert np.abs(both.path.state(case.duration) - case.final).max() < 1e-6


def test_burns_are_safe_and_keep_sigmas_and_a_quiet_time():
    """Within a thrust limit, with a loss of thrust, errors and a time without thrust."""
    case = ring_transfers("thirty")[5]
    quiet = cf.requirements.NoThrust(start=0.4 * case.duration, end=0.5 * case.duration)
    limit = 2e-4
    plan = planned(
        *(5, "delta-v"),
        drift=case.drift,
        errors=ERRORS,
        sigmas=SIGMAS,
        requirements=[quiet],
        max_acceleration=limit,
        longer=False,
    )
    assert plan.path.peak_thrust <= limit * (1.0 + 1e-9)
    assert clear_sigmas(plan.path, case) >= SIGMAS
    lost = np.linspace(0.0, case.duration, 200)
    assert least_ratio(plan.path.state(lost), lost, case.duration + case.drift) > 1.0 - 1e-5
    amid = np.linspace(quiet.start, quiet.end, 200)[1:-1]
    assert not plan.path.thrust(amid).any()
