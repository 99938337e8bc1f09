"""Collision probabilities against Monte Carlo, published integrals and importance sampling.

The Monte Carlo here is independent: states are propagated by matrix exponentials and sampled densely.
"""

import numpy as np
import pytest
from scipy.integrate import dblquad, quad
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.stats import norm

import closeform as cf
from bridge import hill
from closeform.uncertainty.collision.expected_entries import entry_rates
from closeform.uncertainty.collision.sampled_trajectories import SampledTrajectories, relative_errors
from closeform.uncertainty.collision.short_encounter import probability_inside
from closeform.uncertainty.error_columns import columns_of
from passing import AHEAD, DEEP, ORBIT, PERIOD, SLOW, ZONE, N, coasts


def zone_entries(positions, zone):
    """Return which trajectories (S, T, 3) start inside and are ever inside, and their entries."""
    inside = zone.norm(positions) <= 1.0
    entries = (inside[:, 1:] & ~inside[:, :-1]).sum(axis=1)
    return inside[:, 0], inside.any(axis=1), entries


def sampled_coasts(mean, covariance, duration, zone, samples=4_000, times=800, n=N, seed=5):
    """Sample coasting spacecraft; return the same three figures as `zone_entries`."""
    random = np.random.default_rng(seed)
    states = random.multivariate_normal(mean, covariance, size=samples, method="eigh")
    moved = np.array([expm(hill(n) * t)[:3] for t in np.linspace(0.0, duration, times)])
    began, ever, entries = [], [], []
    for some in np.array_split(states, 20):
        found = zone_entries(np.einsum("tij,sj->sti", moved, some), zone)
        for held, one in zip((began, ever, entries), found, strict=True):
            held.append(one)
    return tuple(np.concatenate(one) for one in (began, ever, entries))


def assert_agrees(found, sample, least=0.0):
    """Compare a figure with the mean of samples, to four standard errors."""
    error = max(np.std(sample) / np.sqrt(len(sample)), least)
    assert abs(found - np.mean(sample)) < 4.0 * error


@pytest.mark.parametrize(
    ("mean", "covariance", "zone", "n"),
    [
        (AHEAD, SLOW, ZONE, N),
        pytest.param([0, 14, 0, 0, 0, 0], SLOW, ZONE, N, marks=pytest.mark.slow),  # many start inside
        pytest.param(
            [5, 30, -10, 0, -0.01, 0.01], 4 * SLOW, cf.Ellipsoid([10, 30, 15]), N, marks=pytest.mark.slow
        ),
        ([30, 30, 0, -0.01, -0.01, 0], SLOW, ZONE, 0.0),
    ],
)
def test_coasting_agrees_with_monte_carlo(mean, covariance, zone, n):
    duration = 2 * PERIOD
    path, other = coasts(mean, duration, cf.Orbit(n))
    began, ever, entries = sampled_coasts(mean, covariance, duration, zone, n=n)
    figure = cf.collision_probability(path, other, zone, cf.Uncertainty(covariance))
    assert_agrees(figure.value, ever)
    assert_agrees(figure.at_start, began, 1.0 / len(began))
    assert_agrees(figure.mean_entries, entries)
    drawn_figure = cf.collision_probability(
        path, other, zone, cf.Uncertainty(covariance), method="monte-carlo", samples=50_000
    )
    assert drawn_figure.low < figure.high
    assert figure.low < drawn_figure.high
    bound = cf.collision_probability(path, other, zone, cf.Uncertainty(covariance), method="bound")
    assert bound.low < figure.low < figure.high <= bound.high
    assert bound.high == pytest.approx(figure.at_start + figure.mean_entries, rel=2e-4)


WIDTH = 7.0  # of errors 4 m off the centre of a sphere of 15 m
OFF_CENTRE = coasts([0, 4.0, 0, 0, 0, 0], 1.0)


@pytest.mark.parametrize("thin", [0.0, 1e-6, 1e-3, 0.2])
def test_start_inside_with_thin_errors(thin):
    """Errors fill a disc of almost no thickness."""

    def slice_of(d):
        return norm.pdf(d) * -np.expm1(-0.5 * (225.0 - (4.0 + thin * d) ** 2) / WIDTH**2)

    errors = cf.Uncertainty(np.diag([WIDTH, thin, WIDTH, 1e-2, 1e-2, 1e-2]) ** 2)
    columns, noise = relative_errors(*OFF_CENTRE, ZONE, errors, None)
    share, _ = probability_inside(SampledTrajectories.of(*OFF_CENTRE, columns, noise, ZONE), 0.0)
    assert share == pytest.approx(quad(slice_of, -9.0, 9.0, epsabs=1e-12)[0], rel=1e-6)
    bound = cf.collision_probability(*OFF_CENTRE, ZONE, errors, method="bound")
    assert bound.at_start == share
    if thin < 0.1:  # in 1 s: over a circle of positions, at the speed inward of three independent ones
        rate = 15.0 / WIDTH**2 * np.exp(-0.5 * (225.0 - 16.0) / WIDTH**2) * 1e-2 / np.sqrt(2.0 * np.pi)
        assert bound.mean_entries == pytest.approx(rate, rel=5e-3)  # it falls by 7e-3 in that second


def test_start_inside_with_errors_along_a_line():
    line = np.diag([0.0, WIDTH, 0.0, 1e-3, 1e-3, 1e-3]) ** 2
    figure = cf.collision_probability(*OFF_CENTRE, ZONE, cf.Uncertainty(line), method="bound")
    assert figure.at_start == pytest.approx(norm.cdf(11.0 / WIDTH) - norm.cdf(-19.0 / WIDTH), rel=1e-6)


def test_velocity_errors_alone():
    """Only the velocity is uncertain, and half of the trajectories never enter."""
    mean = [8.4, -34.3, -3.2, 7e-4, -0.031, 8.6e-3]
    root = np.zeros((6, 3))
    root[3:] = [[0.0177, -0.0034, -0.009], [0.0034, -0.0118, -0.0026], [0.0079, 0.0032, -0.0062]]
    duration = 2.125 * PERIOD
    _, ever, entries = sampled_coasts(mean, root @ root.T, duration, ZONE, times=800)
    figure = cf.collision_probability(*coasts(mean, duration), ZONE, cf.Uncertainty(root @ root.T))
    assert_agrees(figure.value, ever)
    assert_agrees(figure.mean_entries, entries)
    assert figure.repeated > 0.1


def test_uncertainties_of_two_spacecraft_add():
    """Two independent spacecraft equal one with the sum of both covariances."""
    path, other = coasts(AHEAD, 2 * PERIOD)
    half = cf.Uncertainty(0.5 * SLOW)
    one = cf.collision_probability(path, other, ZONE, cf.Uncertainty(SLOW), method="bound")
    both = cf.collision_probability(path, other, ZONE, half, half, method="bound")
    assert both.mean_entries == pytest.approx(one.mean_entries, rel=2e-4)
    assert both.at_start == pytest.approx(one.at_start, rel=2e-4, abs=1e-12)


def test_execution_errors_of_burns_and_impulses():
    """With more than six error sources, the whole trajectory is sampled."""
    path = cf.join(
        [
            ORBIT.transfer([0, 200, 0, 0, 0, 0], [0, 60, 0, 0, 0, 0], 2000.0),
            ORBIT.coast([0, 60, 0, 0, 0.02, 0], 1500.0, start=2000.0),
        ]
    )
    path = cf.join([path, ORBIT.transfer(path.state(3500.0), [0, 60, 0, 0, 0, 0], 2000.0, start=3500.0)])
    other = ORBIT.coast(np.zeros(6), 5500.0)
    errors = cf.Uncertainty(0.3 * SLOW, magnitude=0.05, pointing=0.03, impulse=(2e-3, 0.05, 2e-3, 0.02))
    zone = cf.Sphere(30.0)
    columns = columns_of(path, errors)
    assert len(columns) > 12
    times = np.linspace(0.0, 5500.0, 500)
    random = np.random.default_rng(8)
    sizes = random.standard_normal((4_000, len(columns)))
    began, ever, entries = [], [], []
    for some in np.array_split(sizes, 20):
        histories = path.position(times) + np.einsum("sm,mti->sti", some, columns.position(times))
        for held, one in zip((began, ever, entries), zone_entries(histories, zone), strict=True):
            held.append(one)
    figure = cf.collision_probability(path, other, zone, errors)
    assert figure.repeated > 0.01
    assert_agrees(figure.value, np.concatenate(ever))
    assert_agrees(figure.mean_entries, np.concatenate(entries))


def test_pointing_errors_alone():
    """Three error sources span a plane that turns with time."""
    arriving = ORBIT.transfer([0, 200, 0, 0, 0, 0], [0, 60, 0, 0, 0, 0], 2000.0)
    path = cf.join([arriving, ORBIT.coast([0, 60, 0, 0, 0, 0], 3000.0, start=2000.0)])
    errors = cf.Uncertainty(pointing=0.05)
    times = np.linspace(0.0, 5000.0, 2000)
    sizes = np.random.default_rng(9).standard_normal((12_000, 3))
    motions = columns_of(path, errors).position(times)
    ever = [
        zone_entries(path.position(times) + np.einsum("sm,mti->sti", some, motions), ZONE)[1]
        for some in np.array_split(sizes, 40)
    ]
    figure = cf.collision_probability(path, ORBIT.coast(np.zeros(6), 5000.0), ZONE, errors)
    assert_agrees(figure.value, np.concatenate(ever))
    assert figure.high - figure.low < 2e-3 * figure.value


def test_planar_errors_that_miss_a_flat_zone():
    """Pointing errors act along track and cross track; the zone is flat in that plane."""
    arriving = ORBIT.transfer([0, 200, 0, 0, 0, 0], [0, 60, 0, 0, 0, 0], 2000.0)
    path = cf.join([arriving, ORBIT.coast([0, 60, 0, 0, 0, 0], 3000.0, start=2000.0)])
    asked = path, ORBIT.coast(np.zeros(6), 5000.0), cf.Ellipsoid([0.2, 20, 20]), cf.Uncertainty(pointing=0.1)
    assert cf.collision_probability(*asked).high == 0.0
    assert cf.collision_probability(*asked, method="monte-carlo", samples=20_000).value == 0.0


def test_bound_includes_process_noise():
    """Acceleration noise is sampled with the exact covariance of each short step."""
    density, duration, steps = 1e-8, PERIOD, 1000
    step = duration / steps
    inner = np.linspace(0.0, step, 41)
    pushed = np.array([expm(hill(N) * t)[:, 3:] for t in inner])
    covariance = density * np.trapezoid(pushed @ pushed.transpose(0, 2, 1), inner, axis=0)
    root = np.linalg.cholesky(covariance)
    moved = expm(hill(N) * step)
    random = np.random.default_rng(3)
    states = random.multivariate_normal(AHEAD, SLOW, size=4_000)
    inside = np.linalg.norm(states[:, :3], axis=1) <= 15.0
    ever, entries = inside.copy(), np.zeros(len(states))
    for _ in range(steps):
        states = states @ moved.T + random.standard_normal(states.shape) @ root.T
        now = np.linalg.norm(states[:, :3], axis=1) <= 15.0
        entries += now & ~inside
        inside, ever = now, ever | now
    path, other = coasts(AHEAD, duration)
    errors = cf.Uncertainty(SLOW, noise=density)
    figure = cf.collision_probability(path, other, ZONE, errors, method="bound")
    assert_agrees(figure.mean_entries, entries)
    assert figure.low < ever.mean() < figure.high
    assert figure.high < 2.0 * ever.mean()
    without = cf.collision_probability(path, other, ZONE, cf.Uncertainty(SLOW), method="bound")
    assert figure.mean_entries < 0.9 * without.mean_entries  # it carries craft away, too


def slab(width):
    return cf.Ellipsoid([width, 1e6, 1e6])


def test_entry_rate_is_rice_formula_in_one_dimension():
    """A slab has two levels of one Gaussian motion (Rice 1944); its surface is flat to 1e-9."""
    width, mean, speed = 10.0, 14.0, -0.02
    root = np.array([[4.0, 0.0], [0.01, 0.03]])
    covariance = np.diag([16.0, 9.0, 9.0, 1e-3, 1e-4, 1e-4])
    covariance[np.ix_([0, 3], [0, 3])] = root @ root.T
    path, other = coasts([mean, 0, 0, speed, 0, 0], 800.0, DEEP)
    columns, _ = relative_errors(path, other, slab(width), cf.Uncertainty(covariance), None)
    seen = SampledTrajectories.of(path, other, columns, 0.0, slab(width))
    times = np.linspace(1.0, 799.0, 9)
    found = entry_rates(seen, times, 4.0)[:, 0]
    for time, rate in zip(times, found, strict=True):
        moved = np.array([[1.0, time], [0.0, 1.0]])
        spread = moved @ root @ root.T @ moved.T
        expected = 0.0
        for level in (-width, width):
            centre = mean + speed * time
            gain = spread[0, 1] / spread[0, 0]
            inward = -np.sign(level) * (speed + gain * (level - centre))
            sigma = np.sqrt(spread[1, 1] - gain * spread[0, 1])
            flow = sigma * norm.pdf(inward / sigma) + inward * norm.cdf(inward / sigma)
            expected += norm.pdf(level, centre, np.sqrt(spread[0, 0])) * flow
        assert rate == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("miss", [0.0, 25.0, 60.0])
def test_known_velocity_gives_foster_integral(miss):
    """Each spacecraft that crosses the zone in deep space enters once."""
    radius, speed = 15.0, 0.5
    deviations = np.array([8.0, 20.0, 3.0])
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    covariance = np.zeros((6, 6))
    covariance[:3, :3] = turn @ np.diag(deviations**2) @ turn.T
    path, other = coasts([miss, -300 * speed, 0.3 * miss, 0, speed, 0], 600.0, DEEP)
    flat = covariance[np.ix_([0, 2], [0, 2])]
    inverse, scale = np.linalg.inv(flat), 2 * np.pi * np.sqrt(np.linalg.det(flat))

    def density(z, x):
        gap = np.array([x - miss, z - 0.3 * miss])
        return np.exp(-0.5 * gap @ inverse @ gap) / scale

    expected, _ = dblquad(
        density, -radius, radius, lambda x: -np.sqrt(radius**2 - x**2), lambda x: np.sqrt(radius**2 - x**2)
    )
    errors = cf.Uncertainty(covariance)
    figure = cf.collision_probability(path, other, cf.Sphere(radius), errors)
    assert figure.value == pytest.approx(expected, rel=2e-4)
    assert figure.low <= expected <= figure.high
    assert figure.repeated == 0.0
    short = cf.collision_probability(path, other, cf.Sphere(radius), errors, method="short-encounter")
    assert short.value == pytest.approx(expected, rel=1e-7)


@pytest.mark.parametrize("share", [1e-2, 1e-4, 1e-6])
def test_errors_small_against_the_zone(share):
    """A grazed keep-out sphere of 1 km: the error crosses the limb of its disc."""
    sigma = 1000.0 * share
    covariance = np.diag([sigma, 2 * sigma, 3 * sigma, 0, 0, 0]) ** 2
    path, other = coasts([1000.0 + sigma, -500, 0, 0, 1.0, 0], 1000.0, DEEP)
    figure = cf.collision_probability(path, other, cf.Sphere(1000.0), cf.Uncertainty(covariance))

    def strip(d):
        depth = (1000.0 - np.sqrt(1e6 - (3 * sigma * d) ** 2)) / sigma
        return norm.pdf(d) * norm.cdf(-1.0 - depth)

    assert figure.value == pytest.approx(quad(strip, -9.0, 9.0)[0], rel=3e-4)


def test_thin_and_singular_covariances():
    """A deviation of 1 mm beside 100 m, and errors within one plane."""
    for thin in (1e-3, 0.0):
        covariance = np.zeros((6, 6))
        covariance[:3, :3] = np.diag([100.0, 50.0, thin]) ** 2
        path, other = coasts([30, -400, 4.0, 0, 1.0, 0], 800.0, DEEP)
        figure = cf.collision_probability(path, other, cf.Sphere(10.0), cf.Uncertainty(covariance))
        half = np.sqrt(10.0**2 - 4.0**2)
        expected = norm.cdf((half - 30) / 100.0) - norm.cdf((-half - 30) / 100.0)
        assert figure.value == pytest.approx(expected, rel=3e-4)


def test_invariance_under_rotation_and_scaling():
    """An ellipsoid in deep space, rotated and a thousand times as large."""
    mean = np.array([40.0, -20.0, 10.0, -0.05, 0.02, 0.0])
    factor = np.random.default_rng(4).normal(size=(6, 6)) * np.repeat([8.0, 0.02], 3)[:, None]
    one = cf.Ellipsoid([10.0, 25.0, 18.0])
    turn = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    both = 1e3 * np.kron(np.eye(2), turn)
    figure = cf.collision_probability(*coasts(mean, 2000.0, DEEP), one, cf.Uncertainty(factor @ factor.T))
    turned = cf.collision_probability(
        *coasts(both @ mean, 2000.0, DEEP),
        cf.Ellipsoid([1e4, 2.5e4, 1.8e4], turn.T),
        cf.Uncertainty(both @ factor @ factor.T @ both.T),
    )
    assert turned.mean_entries == pytest.approx(figure.mean_entries, rel=2e-4)
    assert turned.at_start == pytest.approx(figure.at_start, rel=2e-4)
    assert turned.low < figure.high
    assert figure.low < turned.high


def most_likely_errors(centre, root, radius):
    """Return the shortest standard normals that reach the sphere (Lagrange condition)."""
    variances, axes = np.linalg.eigh(root @ root.T)
    b = axes.T @ centre

    def outside(x):
        return ((b / (1 + x * variances)) ** 2).sum() - radius**2

    x = brentq(outside, 0.0, np.linalg.norm(b) / radius / variances[0])
    place = axes @ (b / (1 + x * variances))
    return root.T @ np.linalg.solve(root @ root.T, place - centre)


def test_probability_of_1e_17_by_importance_sampling():
    """Samples are shifted to the most likely errors over time and reweighted."""
    mean = np.array([60, 0, 0, 0, -2 * N * 60, N * 60])
    deviations = np.array([3, 6, 3, 3e-3, 3e-3, 3e-3])
    duration, radius = 2 * PERIOD, 15.0
    times = np.linspace(0.0, duration, 1200)
    moved = np.array([expm(hill(N) * t)[:3] for t in times])
    points = [most_likely_errors(m @ mean, m * deviations, radius) for m in moved[::8]]
    points = sorted(points, key=np.linalg.norm)
    chosen = []
    for point in points:
        if np.linalg.norm(point) < np.linalg.norm(points[0]) + 1.5 and all(
            np.linalg.norm(point - one) > 0.7 for one in chosen
        ):
            chosen.append(point)
    centres = np.array(chosen[:24])
    weights = np.exp(-0.5 * ((centres**2).sum(axis=1) - (centres[0] ** 2).sum()))
    weights /= weights.sum()
    random = np.random.default_rng(7)
    worth = []
    for _ in range(4):
        xi = centres[random.choice(len(centres), 2000, p=weights)] + random.standard_normal((2000, 6))
        logs = centres @ xi.T - 0.5 * (centres**2).sum(axis=1)[:, None]
        ratio = 1.0 / (weights @ np.exp(logs))
        positions = np.einsum("tij,sj->sti", moved, mean + xi * deviations)
        worth.append(ratio * (np.linalg.norm(positions, axis=2) <= radius).any(axis=1))
    path, other = coasts(mean, duration)
    figure = cf.collision_probability(path, other, cf.Sphere(radius), cf.Uncertainty(np.diag(deviations**2)))
    assert 1e-17 < figure.value < 3e-17
    assert_agrees(figure.value, np.concatenate(worth))
    assert figure.high - figure.low < 2e-3 * figure.value


def test_box_by_monte_carlo():
    zone = cf.Box([10, 30, 15])
    path, other = coasts(AHEAD, 2 * PERIOD)
    _, ever, _ = sampled_coasts(AHEAD, SLOW, 2 * PERIOD, zone)
    figure = cf.collision_probability(
        path, other, zone, cf.Uncertainty(SLOW), method="monte-carlo", samples=20_000
    )
    assert abs(figure.value - ever.mean()) < 4 * np.sqrt(ever.mean() / len(ever)) + figure.high - figure.low
    assert figure.mean_entries >= figure.value - figure.at_start


@pytest.mark.parametrize(
    ("zone", "n"),
    [
        (cf.Sphere(15.0), N),
        (cf.Ellipsoid([10.0, 30.0, 20.0]), N),
        (cf.Box([10.0, 30.0, 15.0]), 0.0),
        (cf.Cylinder(12.0, 25.0, [1.0, 2.0, 0.0]), N),
        (cf.HalfSpaces([[1, 0, 0.2], [-1, 0.5, 0], [0, -1, 0], [0, 0.3, 1]], [20.0] * 4), N),
    ],
)
def test_entries_of_each_trajectory(zone, n):
    """Compare with dense samples of each trajectory; refine where these see no entry."""
    mean, covariance = np.array([10.0, 40.0, -5.0, 10.0 * n, -20.0 * n, 10.0 * n]), 4.0 * SLOW
    path, other = coasts(mean, 2.0 * PERIOD, cf.Orbit(n))
    columns, noise = relative_errors(path, other, zone, cf.Uncertainty(covariance), None)
    histories = SampledTrajectories.of(path, other, columns, noise, zone)
    errors = np.random.default_rng(3).normal(size=(300, len(columns)))
    middle, factor = histories.states(np.zeros(1))
    states, times = middle[0] + errors @ factor[0].T, np.linspace(0.0, 2.0 * PERIOD, 2000)
    moved = np.array([expm(hill(n) * t)[:3] for t in times])
    positions = np.einsum("tij,sj->sti", moved, states)
    counts = histories.count(errors)
    began, ever, entries = zone_entries(positions, zone)
    assert 6 < ever.sum() < 294
    assert (counts[:, 0] == began).all()
    assert (counts[ever].max(axis=1) > 0).all()
    assert (counts[:, 1] >= entries).all()  # samples miss some
    missed = np.flatnonzero(~ever & (counts[:, 1] > 0))
    assert len(missed) < 10
    for k in missed:
        near = times[zone.norm(positions[k]).argmin()] + np.linspace(-1.0, 1.0, 4001) * times[1]
        close = np.array([expm(hill(n) * t)[:3] for t in np.clip(near, 0.0, times[-1])]) @ states[k]
        assert zone.norm(close).min() < 1.0 + 1e-6


def test_distant_spacecraft_have_zero_probability():
    path, other = coasts([0, 1e6, 0, 0, 0, 0], 100.0)
    figure = cf.collision_probability(path, other, ZONE, cf.Uncertainty(SLOW))
    assert (figure.value, figure.low, figure.high, figure.mean_entries) == (0.0, 0.0, 0.0, 0.0)
    assert len(figure.rates) == 0


def test_rates_integrate_to_mean_entries():
    path, other = coasts(AHEAD, 2 * PERIOD)
    figure = cf.collision_probability(path, other, ZONE, cf.Uncertainty(SLOW), samples=2000)
    assert (np.diff(figure.rate_times) > 0).all()
    assert np.trapezoid(figure.rates, figure.rate_times) == pytest.approx(figure.mean_entries, rel=0.01)
    assert f"{figure.value:.5g}" in str(figure)
    assert "ever inside" in str(figure)
    assert "entries expected" in str(figure)


def test_passage_of_seconds_within_twelve_hours():
    """One sharp passage in 43 200 s has the probability of the short encounter."""
    path = cf.join([DEEP.coast([0, -20_000.0, 0, 0, 1.0, 0], 43_200.0)])
    other = DEEP.coast(np.zeros(6), 43_200.0)
    covariance = np.diag([1.0, 0.5, 0.8, 1e-9, 1e-9, 1e-9]) ** 2
    figure = cf.collision_probability(path, other, cf.Sphere(0.5), cf.Uncertainty(covariance))
    inner = quad(
        lambda x: (
            norm.pdf(x) * (norm.cdf(np.sqrt(0.25 - x * x) / 0.8) - norm.cdf(-np.sqrt(0.25 - x * x) / 0.8))
        ),
        -0.5,
        0.5,
    )[0]
    assert figure.value == pytest.approx(inner, rel=2e-4)
