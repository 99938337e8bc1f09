"""Collision probabilities with process noise against Monte Carlo in short exact steps, and the Rice formula.

The covariance that noise adds in a step is integrated by Gauss quadrature over matrix exponentials.
"""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import expm
from scipy.stats import norm

import closeform as cf
from bridge import hill
from closeform.uncertainty.collision.sampled_trajectories import SampledTrajectories
from closeform.uncertainty.error_columns import columns_of
from closeform.uncertainty.white_noise import OFF, velocity_changes
from passing import AHEAD, DEEP, ORBIT, PERIOD, SLOW, ZONE, N, coasts, noise_of


def sampled_with_noise(means, density, zone, covariance, duration, n=N, samples=2_000, seed=3):
    """Sample trajectories in exact steps; return those inside at the start and ever, and entries."""
    step = duration / (len(means) - 1)
    root, moved = np.linalg.cholesky(noise_of(density, n, step)), expm(hill(n) * step)
    random = np.random.default_rng(seed)
    states = random.multivariate_normal(np.zeros(6), covariance, size=samples, method="eigh")
    began = zone.norm(means[0] + states[:, :3]) <= 1.0
    before, ever, entries = began, began.copy(), np.zeros(samples)
    for mean in means[1:]:
        states = states @ moved.T + random.standard_normal(states.shape) @ root.T
        now = zone.norm(mean + states[:, :3]) <= 1.0
        entries += now > before
        ever |= now
        before = now
    return began, ever, entries


def monte_carlo(path, other, zone, *errors, **more):
    asked = {"method": "monte-carlo", "samples": 4_000} | more
    return cf.collision_probability(path, other, zone, *errors, **asked)


def assert_agrees(figure, began, ever, entries):
    """Compare two Monte Carlo figures, to four standard errors of both."""
    for found, sample in (
        (figure.value, ever),
        (figure.at_start, began),
        (figure.mean_entries, entries),
    ):
        error = np.std(sample) * np.sqrt(1.0 / len(sample) + 1.0 / figure.samples)
        assert abs(found - np.mean(sample)) <= 4.0 * max(error, 1.0 / len(sample))
    assert figure.low <= np.mean(ever) + 4.0 * np.std(ever) / np.sqrt(len(ever))
    assert figure.high >= np.mean(ever) - 4.0 * np.std(ever) / np.sqrt(len(ever))


CASES = [  # mean, zone, density, mean motion
    (AHEAD, ZONE, 1e-8, N),
    (AHEAD, ZONE, 1e-6, N),  # spreads to ten times the zone size
    ([0, 14, 0, 0, 0, 0], ZONE, 1e-7, N),  # many start inside and enter again
    ([5, 30, -10, 0, -0.01, 0.01], cf.Box([10, 30, 15]), 1e-8, N),
    ([5, 30, -10, 0, -0.01, 0.01], cf.HalfSpaces([[0, -1, 0], [1, 0, 1]], [25.0, 30.0]), 1e-8, N),
    ([30, 30, 0, -0.01, -0.01, 0], ZONE, 1e-8, 0.0),
]


@pytest.mark.parametrize("case", [1, 3, *(pytest.param(k, marks=pytest.mark.slow) for k in (0, 2, 4, 5))])
def test_noise_agrees_with_monte_carlo_in_short_steps(case):
    mean, zone, density, n = CASES[case]
    path, other = coasts(mean, PERIOD, cf.Orbit(n))
    figure = monte_carlo(path, other, zone, cf.Uncertainty(SLOW, noise=density))
    means = np.array([expm(hill(n) * t)[:3] @ mean for t in np.linspace(0.0, PERIOD, 801)])
    assert_agrees(figure, *sampled_with_noise(means, density, zone, SLOW, PERIOD, n))


def test_noise_of_two_spacecraft_adds():
    """A plan of two arcs and an obstacle both have process noise: the densities add."""
    path = cf.join(
        [
            ORBIT.transfer([0, 200, 0, 0, 0, 0], [0, 60, 0, 0, 0, 0], 2000.0),
            ORBIT.coast([0, 60, 0, 0, 0.02, 0], 1500.0, start=2000.0),
        ]
    )
    other, zone = ORBIT.coast([5.0, 0, 0, 0, 0, 0], 3500.0), cf.Sphere(30.0)
    means = path.position(np.linspace(0.0, 3500.0, 801)) - other.position(np.linspace(0.0, 3500.0, 801))
    figure = monte_carlo(
        path, other, zone, cf.Uncertainty(0.3 * SLOW, noise=2e-7), cf.Uncertainty(noise=3e-7)
    )
    assert 0.02 < figure.value < 0.98
    assert_agrees(figure, *sampled_with_noise(means, 5e-7, zone, 0.3 * SLOW, 3500.0))


def test_mean_entries_from_noise_alone_follow_rice():
    """A slab in deep space (Rice 1944) from a known state."""
    width, mean, speed, density, duration = 10.0, 14.0, -0.005, 1e-6, 800.0

    def rate(time):
        spread = density * np.array([[time**3 / 3, time**2 / 2], [time**2 / 2, time]])
        total = 0.0
        for level in (-width, width):
            centre, gain = mean + speed * time, spread[0, 1] / spread[0, 0]
            inward = -np.sign(level) * (speed + gain * (level - centre))
            sigma = np.sqrt(spread[1, 1] - gain * spread[0, 1])
            flow = sigma * norm.pdf(inward / sigma) + inward * norm.cdf(inward / sigma)
            total += norm.pdf(level, centre, np.sqrt(spread[0, 0])) * flow
        return total

    expected = quad(rate, 1.0, duration, limit=200)[0]
    path, other = coasts([mean, 0, 0, speed, 0, 0], duration, DEEP)
    slab = cf.Ellipsoid([width, 1e6, 1e6])
    figure = monte_carlo(path, other, slab, cf.Uncertainty(noise=density), samples=8_000)
    assert 0.2 < expected < 0.9
    assert figure.at_start == 0.0
    assert abs(figure.mean_entries - expected) < 4.0 * np.sqrt(expected / 8_000)


def test_negligible_noise_changes_nothing():
    """1e-16 m^2/s^3 moves 1 mm in an orbit: the figure without noise is within the interval."""
    path, other = coasts(AHEAD, 2 * PERIOD)
    exact = cf.collision_probability(path, other, ZONE, cf.Uncertainty(SLOW))
    figure = monte_carlo(path, other, ZONE, cf.Uncertainty(SLOW, noise=1e-16))
    error = np.sqrt(exact.value / figure.samples)
    assert abs(figure.value - exact.value) < 4.0 * error
    assert abs(figure.repeated - exact.repeated * exact.mean_entries) < 0.01
    assert figure.low < exact.value + 2.0 * error
    assert figure.high > exact.value - 2.0 * error


@pytest.mark.parametrize(("n", "length"), [(0.0, 50.0), (N, 0.2 / N)])
def test_deviation_from_the_path_within_a_step(n, length):
    """Noise in 40 exact parts of a step deviates from the marched path as theory (65) states."""
    density, parts, samples = 1e-8, 40, 6_000
    root, moved = np.linalg.cholesky(noise_of(density, n, length / parts)), expm(hill(n) * length / parts)
    random, states = np.random.default_rng(1), [np.zeros((samples, 6))]
    for _ in range(parts):
        states.append(states[-1] @ moved.T + random.standard_normal((samples, 6)) @ root.T)
    times = np.linspace(0.0, length, parts + 1)
    kick = velocity_changes(n, length, states[-1][:, None, :])[:, 0]
    chord = np.einsum("tij,sj->tsi", np.array([expm(hill(n) * t)[:3, 3:] for t in times]), kick)
    off = np.array(states)[..., :3] - chord
    assert np.abs(off[-1]).max() < 1e-9 * np.abs(states[-1][:, :3]).max()
    expected = density * (times * (length - times)) ** 2 / (3.0 * length)
    variance = (off**2).mean(axis=(1, 2))
    assert (
        np.abs(variance - expected).max() < 0.06 * expected.max()
    )  # 1.6 %, four deviations of 18 000: 4.2 %
    assert np.linalg.norm(off, axis=2).max() < 0.8 * OFF * np.sqrt(density * length**3)


def test_sampled_noise_moves_each_trajectory():
    """Compare with matrix exponentials of the sampled noise, in windows that a burn cuts."""
    zone, before = cf.Sphere(30.0), ORBIT.coast([0, 45, 0, 0, 0, 0], 777.0)
    path = cf.join([before, ORBIT.burn(before.state(777.0), [0, -1e-4, 0], 500.0, start=777.0)])
    other = ORBIT.coast(np.zeros(6), 1277.0)
    seen = SampledTrajectories.of(path, other, columns_of(path, cf.Uncertainty(SLOW)), 0.0, zone, 100.0)
    random = np.random.default_rng(2)
    errors = random.standard_normal((50, len(seen.columns)))
    pushes = random.standard_normal((50, seen.changes, 6)) * np.repeat([1.0, 0.02], 3)
    found = seen.count(errors, pushes)
    kicks, times = velocity_changes(N, 100.0, pushes), np.linspace(0.0, 1277.0, 2555)
    places = (path.position(times) - other.position(times))[None] + np.einsum(
        "nj,jti->nti", errors, seen.columns.position(times)
    )
    for k in range(seen.changes):
        late = np.maximum(times - 100.0 * k, 0.0)
        places += np.einsum("tij,nj->nti", np.array([expm(hill(N) * t)[:3, 3:] for t in late]), kicks[:, k])
    inside = zone.norm(places) <= 1.0
    assert 5 < inside.any(axis=1).sum() < 45
    np.testing.assert_array_equal(found[:, 0] > 0, inside[:, 0])
    np.testing.assert_array_equal(found[:, 1], (inside[:, 1:] > inside[:, :-1]).sum(axis=1))


def test_probability_of_leaving_the_step_bound():
    """The mean number of exits of three such bridges from a ball bounds it (Rice)."""

    def rate(s, radius):
        early = np.array([[s**3 / 3, s**2 / 2], [s**2 / 2, s]])
        ahead = early @ [1.0, 1.0 - s]  # with where the step ends, at 1
        joint = np.block([[early, ahead[:, None]], [ahead[None], np.array([[1.0 / 3.0]])]])
        beside = np.array([[1.0, 0.0, -s], [0.0, 1.0, -1.0]])  # the chord
        left = beside @ joint @ beside.T
        assert left[0, 0] == pytest.approx((s * (1 - s)) ** 2 / 3, rel=1e-6)
        speed = left[0, 1] / left[0, 0] * radius
        sigma = np.sqrt(left[1, 1] - left[0, 1] ** 2 / left[0, 0])
        density = np.sqrt(2 / np.pi) * radius**2 / left[0, 0] ** 1.5 * np.exp(-0.5 * radius**2 / left[0, 0])
        return density * (sigma * norm.pdf(speed / sigma) + speed * norm.cdf(speed / sigma))

    turned = 1.016  # of the variance, up to n h = 0.2
    chance = quad(lambda s: rate(s, OFF / np.sqrt(turned)), 0.1, 0.9, points=[0.5], epsabs=0.0, limit=200)[0]
    assert 1e-16 < chance < 1e-13


@pytest.mark.slow
def test_bound_contains_monte_carlo_with_noise():
    path, other = coasts(AHEAD, PERIOD)
    errors = cf.Uncertainty(SLOW, noise=1e-8)
    bound = cf.collision_probability(path, other, ZONE, errors, method="bound")
    figure = monte_carlo(path, other, ZONE, errors, samples=100_000)
    assert bound.low < figure.value < bound.high + 4.0 * np.sqrt(bound.high / 100_000)
    assert abs(bound.mean_entries - figure.mean_entries) < 4.0 * np.sqrt(bound.mean_entries / 100_000)


def test_excessive_noise_is_rejected():
    path, other = coasts(AHEAD, PERIOD)
    with pytest.raises(ValueError, match=r"^errors: noise of 1e\+06 m\^2/s\^3 moves craft too far"):
        monte_carlo(path, other, ZONE, cf.Uncertainty(SLOW, noise=1e6))
