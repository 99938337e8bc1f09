"""Probabilities of histories with white noise, against plain ones in short exact steps, and Rice's formula.

What noise adds to a state in a step is integrated here by Gauss's rule over matrix exponentials.
"""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import expm
from scipy.stats import norm

import closeform as cf
from closeform.uncertainty.columns import columns_of
from closeform.uncertainty.noisy_trajectories import NoisyTrajectories
from closeform.uncertainty.white_noise import OFF, kicks_of
from test_probability import AHEAD, DEEP, ORBIT, PERIOD, SLOW, ZONE, N, coasts, hill


def noise_of(density, n, step):
    """Covariance (6, 6) of what white noise adds to a state in a step."""
    nodes, weights = np.polynomial.legendre.leggauss(20)
    pushed = np.array([expm(hill(n) * t)[:, 3:] for t in 0.5 * step * (nodes + 1.0)])
    return density * np.einsum("t,tik,tjk->ij", 0.5 * step * weights, pushed, pushed)


def shaken(cases, covariance, duration, n=N, samples=6_000, seed=3):
    """Plain Monte Carlo in exact steps: who is inside at the start, ever, and entries, of each case.

    A case has means (T, 3), a density of noise and a zone; all have the same errors at the start, and the
    same noise but for its density.
    """
    step = duration / (len(cases[0][0]) - 1)
    root, moved = np.linalg.cholesky(noise_of(1.0, n, step)), expm(hill(n) * step)
    random = np.random.default_rng(seed)
    carried = random.multivariate_normal(np.zeros(6), covariance, size=samples, method="eigh")
    pushed = np.zeros_like(carried)

    def within(k):
        for means, density, zone in cases:
            states = carried[:, :3] + np.sqrt(density) * pushed[:, :3]
            yield zone.norm(means[k] + states) <= 1.0

    began = [*within(0)]
    before, ever, entries = began, [one.copy() for one in began], [np.zeros(samples) for _ in cases]
    for k in range(1, len(cases[0][0])):
        carried, pushed = carried @ moved.T, pushed @ moved.T + random.standard_normal(pushed.shape) @ root.T
        now = [*within(k)]
        for inside, last, some, count in zip(now, before, ever, entries, strict=True):
            count += inside > last
            some |= inside
        before = now
    return list(zip(began, ever, entries, strict=True))


def drawn(path, other, zone, *errors, **more):
    asked = {"method": "monte-carlo", "samples": 8_000} | more
    return cf.collision_probability(path, other, zone, *errors, **asked)


def compared(figure, began, ever, entries):
    """A drawn figure against drawn ones: four deviations of both."""
    for found, sample in (
        (figure.value, ever),
        (figure.at_start, began),
        (figure.mean_entries, entries),
    ):
        error = np.std(sample) * np.sqrt(1.0 / len(sample) + 1.0 / figure.samples)
        assert abs(found - np.mean(sample)) <= 4.0 * max(error, 1.0 / len(sample))
    assert figure.low <= np.mean(ever) + 4.0 * np.std(ever) / np.sqrt(len(ever))
    assert figure.high >= np.mean(ever) - 4.0 * np.std(ever) / np.sqrt(len(ever))


SHAKEN = [  # mean, zone, density, mean motion
    (AHEAD, ZONE, 1e-8, N),
    (AHEAD, ZONE, 1e-6, N),  # spreads to ten times the zone
    ([0, 14, 0, 0, 0, 0], ZONE, 1e-7, N),  # many begin inside, and come again
    ([5, 30, -10, 0, -0.01, 0.01], cf.Box([10, 30, 15]), 1e-8, N),
    ([5, 30, -10, 0, -0.01, 0.01], cf.HalfSpaces([[0, -1, 0], [1, 0, 1]], [25.0, 30.0]), 1e-8, N),
    ([30, 30, 0, -0.01, -0.01, 0], ZONE, 1e-8, 0.0),
]


@cache
def all_shaken(n):
    """Every case of a mean motion, in one march."""
    times = np.linspace(0.0, PERIOD, 801)
    flow = np.array([expm(hill(n) * t)[:3] for t in times])
    cases = [(flow @ mean, density, zone) for mean, zone, density, motion in SHAKEN if motion == n]
    return shaken(cases, SLOW, PERIOD, n)


@pytest.mark.parametrize("case", [1, 3, *(pytest.param(k, marks=pytest.mark.slow) for k in (0, 2, 4, 5))])
def test_plain_monte_carlo_of_short_steps(case):
    mean, zone, density, n = SHAKEN[case]
    path, other = coasts(mean, PERIOD, cf.Orbit(n))
    figure = drawn(path, other, zone, cf.Uncertainty(SLOW, noise=density))
    place = [motion == n for *_, motion in SHAKEN[:case]].count(True)
    compared(figure, *all_shaken(n)[place])


def test_burns_of_both_craft_with_noise():
    """A plan of two arcs that is shaken, past one that is, too: densities add."""
    path = cf.join(
        [
            ORBIT.transfer([0, 200, 0, 0, 0, 0], [0, 60, 0, 0, 0, 0], 2000.0),
            ORBIT.coast([0, 60, 0, 0, 0.02, 0], 1500.0, start=2000.0),
        ]
    )
    other, zone = ORBIT.coast([5.0, 0, 0, 0, 0, 0], 3500.0), cf.Sphere(30.0)
    means = path.position(np.linspace(0.0, 3500.0, 801)) - other.position(np.linspace(0.0, 3500.0, 801))
    figure = drawn(path, other, zone, cf.Uncertainty(0.3 * SLOW, noise=2e-7), cf.Uncertainty(noise=3e-7))
    assert 0.02 < figure.value < 0.98
    compared(figure, *shaken([(means, 5e-7, zone)], 0.3 * SLOW, 3500.0)[0])


def test_entries_are_as_many_as_their_rate_says():
    """Into a slab in deep space (Rice 1944), from a state that is known: noise is all there is."""
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
    figure = drawn(path, other, slab, cf.Uncertainty(noise=density), samples=20_000)
    assert 0.2 < expected < 0.9
    assert figure.at_start == 0.0
    assert abs(figure.mean_entries - expected) < 4.0 * np.sqrt(expected / 20_000)


def test_next_to_no_noise_is_none():
    """Of 1e-16 m^2/s^3, 1 mm in an orbit: the exact figure without any, within the interval."""
    path, other = coasts(AHEAD, 2 * PERIOD)
    exact = cf.collision_probability(path, other, ZONE, cf.Uncertainty(SLOW))
    figure = drawn(path, other, ZONE, cf.Uncertainty(SLOW, noise=1e-16))
    error = np.sqrt(exact.value / figure.samples)
    assert abs(figure.value - exact.value) < 4.0 * error
    assert abs(figure.repeated - exact.repeated * exact.mean_entries) < 0.01
    assert figure.low < exact.value + 2.0 * error
    assert figure.high > exact.value - 2.0 * error


@pytest.mark.parametrize(("n", "length"), [(0.0, 50.0), (N, 0.2 / N)])
def test_what_a_step_leaves_out(n, length):
    """Noise in 40 exact parts of a step beside the path that is marched: theory (65), and its variance."""
    density, parts, samples = 1e-8, 40, 6_000
    root, moved = np.linalg.cholesky(noise_of(density, n, length / parts)), expm(hill(n) * length / parts)
    random, states = np.random.default_rng(1), [np.zeros((samples, 6))]
    for _ in range(parts):
        states.append(states[-1] @ moved.T + random.standard_normal((samples, 6)) @ root.T)
    times = np.linspace(0.0, length, parts + 1)
    kick = kicks_of(n, length, states[-1][:, None, :])[:, 0]
    chord = np.einsum("tij,sj->tsi", np.array([expm(hill(n) * t)[:3, 3:] for t in times]), kick)
    off = np.array(states)[..., :3] - chord
    assert np.abs(off[-1]).max() < 1e-9 * np.abs(states[-1][:, :3]).max()
    expected = density * (times * (length - times)) ** 2 / (3.0 * length)
    variance = (off**2).mean(axis=(1, 2))
    assert (
        np.abs(variance - expected).max() < 0.06 * expected.max()
    )  # 1.6 %, four deviations of 18 000: 4.2 %
    assert np.linalg.norm(off, axis=2).max() < 0.8 * OFF * np.sqrt(density * length**3)


def test_noise_is_marched_as_it_is_drawn():
    """Windows that a burn cuts: every history's positions, from its normal numbers by matrix exponentials."""
    zone, before = cf.Sphere(30.0), ORBIT.coast([0, 45, 0, 0, 0, 0], 777.0)
    path = cf.join([before, ORBIT.burn(before.state(777.0), [0, -1e-4, 0], 500.0, start=777.0)])
    other = ORBIT.coast(np.zeros(6), 1277.0)
    seen = NoisyTrajectories.in_steps(path, other, columns_of(path, cf.Uncertainty(SLOW)), 0.0, zone, 100.0)
    random = np.random.default_rng(2)
    errors = random.standard_normal((50, len(seen.histories.columns)))
    pushes = random.standard_normal((50, seen.changes, 6)) * np.repeat([1.0, 0.02], 3)
    found = seen.counted(errors, pushes)
    kicks, times = kicks_of(N, 100.0, pushes), np.linspace(0.0, 1277.0, 2555)
    places = (path.position(times) - other.position(times))[None] + np.einsum(
        "nj,jti->nti", errors, seen.histories.columns.position(times)
    )
    for k in range(seen.changes):
        late = np.maximum(times - 100.0 * k, 0.0)
        places += np.einsum("tij,nj->nti", np.array([expm(hill(N) * t)[:3, 3:] for t in late]), kicks[:, k])
    inside = zone.norm(places) <= 1.0
    assert 5 < inside.any(axis=1).sum() < 45
    np.testing.assert_array_equal(found[:, 0] > 0, inside[:, 0])
    np.testing.assert_array_equal(found[:, 1], (inside[:, 1:] > inside[:, :-1]).sum(axis=1))


def test_the_chance_to_leave_a_step():
    """Rice's rate at which three such bridges leave a ball: the mean number of exits bounds the chance."""

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
def test_bound_holds_what_is_drawn():
    path, other = coasts(AHEAD, PERIOD)
    errors = cf.Uncertainty(SLOW, noise=1e-8)
    bound = cf.collision_probability(path, other, ZONE, errors, method="bound")
    figure = drawn(path, other, ZONE, errors, samples=100_000)
    assert bound.low < figure.value < bound.high + 4.0 * np.sqrt(bound.high / 100_000)
    assert abs(bound.mean_entries - figure.mean_entries) < 4.0 * np.sqrt(bound.mean_entries / 100_000)


def test_noise_beyond_all_steps_is_refused():
    path, other = coasts(AHEAD, PERIOD)
    with pytest.raises(ValueError, match=r"^errors: noise of 1e\+06 m\^2/s\^3 moves craft too far"):
        drawn(path, other, ZONE, cf.Uncertainty(SLOW, noise=1e6))
