"""Confidence intervals of probabilities cover the truth; results depend on the seed, not on the threads."""

import dataclasses

import numpy as np
import pytest
from scipy.stats import binom

import closeform as cf
from closeform.confidence import CONFIDENCE
from closeform.uncertainty.collision import sampled_trajectories as histories_module
from closeform.uncertainty.collision.entry_sampling import (
    interval_of_mean,
    repeated_shares,
    sample_entries,
    strata,
)
from closeform.uncertainty.collision.expected_entries import expected_entries
from closeform.uncertainty.collision.sampled_trajectories import SampledTrajectories, relative_errors

ORBIT = cf.Orbit.circular(500e3)
PERIOD = ORBIT.period
ZONE = cf.Sphere(15.0)
AHEAD = [0, 120, 0, 0, 0, 0]
SLOW = np.diag([3.0, 6.0, 3.0, 2e-3, 2e-3, 2e-3]) ** 2  # a hold 120 m ahead: 4 % enter twice in two orbits


def coasts(state, duration):
    return ORBIT.coast(state, duration), ORBIT.coast(np.zeros(6), duration)


def test_intervals_cover_the_truth_at_the_stated_rate():
    """Use 40 seeds; tools/interval_coverage.py uses 1000."""
    path, other = coasts(AHEAD, 2 * PERIOD)
    columns, _ = relative_errors(path, other, ZONE, cf.Uncertainty(SLOW), None)
    seen = SampledTrajectories.of(path, other, columns, 0.0, ZONE)
    flux = expected_entries(seen)
    truth, *_ = interval_of_mean(repeated_shares(seen.count(sample_entries(seen, flux, 60_000, 99))))
    held = 0
    for seed in range(40):
        _, low, high = interval_of_mean(repeated_shares(seen.count(sample_entries(seen, flux, 1000, seed))))
        held += low < truth < high
    assert binom.ppf(1e-3, 40, CONFIDENCE) <= held <= binom.ppf(1 - 1e-3, 40, CONFIDENCE)


@pytest.mark.parametrize(("ahead", "repeated"), [(120.0, 0.047), (400.0, 0.0)])
def test_default_samples_give_an_interval_of_a_thousandth(ahead, repeated):
    """Fewer samples suffice where almost no trajectory enters again."""
    paths = coasts([0, ahead, 0, 0, 0, 0], 2 * PERIOD)
    found = cf.collision_probability(*paths, ZONE, cf.Uncertainty(SLOW))
    assert 0.5 * (found.high - found.low) <= 1e-3 * found.value
    assert abs(found.repeated - repeated) <= 0.1 * repeated + 0.003
    exact = cf.collision_probability(*paths, ZONE, cf.Uncertainty(SLOW), samples=50_000, seed=7)
    assert exact.samples == 50_000
    assert abs(found.value - exact.value) <= 2.0 * (found.high - found.low)  # independent: four halves
    assert found.samples == 8000 if repeated == 0.0 else 12_000 < found.samples < 80_000


def test_entries_are_sampled_over_the_whole_surface():
    """Compare with 0.39760 +- 0.00015, from 11 million Monte Carlo trajectories (seeds 3, 11, 12)."""
    paths = coasts([5, 30, -10, 0, -0.01, 0.01], 2 * PERIOD)
    zone, errors = cf.Ellipsoid([10, 30, 15]), cf.Uncertainty(4 * SLOW)
    found = cf.collision_probability(*paths, zone, errors, samples=100_000, seed=5)
    assert abs(found.value - 0.39760) <= 3.0 * np.hypot(0.00015, 0.25 * (found.high - found.low))


@pytest.mark.parametrize("samples", [101, 777, 8191])
def test_stratified_sampling(samples):
    """Each stratum has two or more samples; mean and interval follow the strata."""
    stratum, axes = strata(samples)
    sizes = np.bincount(stratum)
    assert len(sizes) == np.prod(axes)
    assert sizes.min() >= 2
    assert sizes.max() <= 4
    cells = np.stack(np.unravel_index(stratum, axes), axis=1)
    random = np.random.default_rng(samples)
    means, halves = [], []
    for _ in range(400):
        places = (cells + random.uniform(size=cells.shape)) / axes
        mean, low, high = interval_of_mean(places.sum(axis=1) / 3.0)
        means.append(mean)
        halves.append(0.5 * (high - low))
    # uniform within each stratum: a twelfth of the square of what it is wide, along each axis
    exact = np.sqrt((1.0 / (12.0 * 9.0 * np.square(axes))).sum() * (1.0 / sizes).mean() / len(sizes))
    assert np.std(means) == pytest.approx(exact, rel=0.15)  # of 400: five deviations
    assert np.mean(halves) == pytest.approx(1.96 * exact, rel=0.05)
    assert abs(np.mean(means) - 0.5) < 5.0 * exact / np.sqrt(400)


def test_result_depends_on_the_seed_and_not_on_the_threads(monkeypatch):
    path, other = coasts(AHEAD, 2 * PERIOD)
    asked = {"method": "monte-carlo", "samples": 10_000}
    one, again, third = (
        cf.collision_probability(path, other, ZONE, cf.Uncertainty(SLOW), **asked, seed=seed)
        for seed in (1, 1, 2)
    )
    assert one.value == again.value != third.value
    monkeypatch.setattr(histories_module, "CORES", 1)
    alone = cf.collision_probability(path, other, ZONE, cf.Uncertainty(SLOW), **asked, seed=1)
    assert dataclasses.astuple(alone)[:6] == dataclasses.astuple(one)[:6]
    entries = [
        cf.collision_probability(path, other, ZONE, cf.Uncertainty(SLOW), samples=2000, seed=s).value
        for s in (1, 1, 2)
    ]
    assert entries[0] == entries[1] != entries[2]
