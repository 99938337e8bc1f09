"""Passively safe plans of minimum delta-v from and to V-bar holds: safety, ends and cost."""

import numpy as np
import pytest

import closeform as cf
from closeform.planning.delta_v.firing_times import Moments, blended
from hold_transfers import COSTS, DEARER, NUMBER, SEVERAL, hold_transfers
from passive_plans import failed_states, fired, least_ratio


@pytest.mark.parametrize(
    "k", [8, *(pytest.param(k, marks=pytest.mark.slow) for k in range(NUMBER) if k != 8)]
)
def test_plans_from_and_to_holds_are_safe_at_known_cost(k):
    case = hold_transfers()[k]
    plan = cf.avoid(case.path, case.client, case.zone, drift=case.drift, cost="delta-v")
    assert plan.ok, plan.reason
    assert plan.lower_bound <= plan.delta_v <= SEVERAL.get(k, DEARER) * COSTS[case.name]
    times, pushes = fired(plan.path)
    assert plan.delta_v == pytest.approx(np.linalg.norm(pushes, axis=1).sum(), rel=1e-9)
    rng = np.random.default_rng(k)
    lost = np.concatenate([rng.uniform(0.0, case.duration, 300), rng.choice(times, 300)])
    states = failed_states(case.initial, plan.path, lost, rng.uniform(size=600))
    assert least_ratio(states, lost, case.duration + case.drift) > 1.0 - 1e-5
    end = failed_states(case.initial, plan.path, np.array([case.duration]), np.ones(1))[0]
    assert np.abs(end - case.final).max() < 1e-6


def test_blended_impulses_have_blended_effects():
    """Blended impulses have a blended effect; tiny impulses are dropped."""
    orbit, end = cf.Orbit.circular(500e3), 3000.0
    times = np.array([0.0, 700.0, 2000.0]), np.array([0.0, 900.0])
    impulses = np.array([[[1.0, 0, 0], [1e-170, 0, 0], [0, 2, 0]]]), np.array([[[0.0, 1, 0], [0, 0, 4]]])

    def effect_of(times, impulses):
        return sum(
            orbit.transition(end - t)[:, 3:] @ push for t, push in zip(times, impulses[0], strict=True)
        )

    moments = [[Moments.instants(own, np.zeros(len(own), dtype=np.int64))] for own in times]
    (found,), pushes = blended(tuple(moments), impulses, 0.25)
    assert found.times.tolist() == [0.0, 900.0, 2000.0]
    expected = 0.75 * effect_of(times[0], impulses[0]) + 0.25 * effect_of(times[1], impulses[1])
    np.testing.assert_allclose(effect_of(found.times, pushes), expected, rtol=1e-12)


def test_times_of_firing_are_equal_or_apart():
    """Near times become one, known times stay, and each thruster remains at its time."""
    rng, apart = np.random.default_rng(5), 1.0
    kept = np.arange(0.0, 1000.0, 50.0)
    times = np.concatenate([rng.uniform(0.0, 1000.0, 60), kept + rng.uniform(-0.9, 0.9, len(kept))])
    which = rng.integers(0, 6, len(times))
    found = Moments.instants(times, which).distinct(kept, apart)
    assert np.diff(np.unique(found.times)).min() >= apart
    assert np.isin(kept, found.times).all()
    for time, one in zip(times, which, strict=True):
        assert np.abs(found.times[found.which == one] - time).min() < 3.0 * apart
