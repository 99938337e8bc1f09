"""Collision probabilities of one or two random numbers, against integrals over them."""

import warnings

import numpy as np
import pytest
from scipy.integrate import dblquad
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.stats import norm

import closeform as cf

ORBIT = cf.Orbit.circular(500e3)
N, PERIOD = ORBIT.mean_motion, ORBIT.period
ZONE = cf.Sphere(15.0)
SIZES = np.array([5.0, 20.0, 5.0, 5 * N, 5 * N, 5 * N])
MEANS = (
    [0, 60, 0, 0, 0, 0],
    [8, 60, -10, 0, -12 * N, 0.01],
    [10, 40, 5, 0.5 * N, -20 * N, 5 * N],
    [0, 14, 0, 0, 0, 0],
)


def hill():
    matrix = np.zeros((6, 6))
    matrix[:3, 3:] = np.eye(3)
    matrix[3, 0], matrix[5, 2], matrix[3, 4], matrix[4, 3] = 3 * N * N, -N * N, 2 * N, -2 * N
    return matrix


def probability(mean, directions, method="entries", zone=ZONE):
    """Return the probability with errors along one direction (6,) or several (6, K)."""
    path, other = ORBIT.coast(mean, 2 * PERIOD), ORBIT.coast(np.zeros(6), 2 * PERIOD)
    root = np.reshape(directions, (6, -1))
    errors = cf.Uncertainty(root @ root.T)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # velocities without positions
        return cf.collision_probability(path, other, zone, errors, method=method)


@pytest.fixture(scope="module")
def transitions():
    """Position rows of the transition matrix over two orbits: (3000, 3, 6)."""
    return np.array([expm(hill() * t)[:3] for t in np.linspace(0.0, 2 * PERIOD, 3000)])


@pytest.mark.parametrize("mean", MEANS[1:2])
@pytest.mark.parametrize("axis", [0, 4, 6])
def test_one_random_number(transitions, mean, axis):
    """Integrate over a fine grid of the number with dense sampling in time."""
    direction = SIZES * np.eye(6)[axis] if axis < 6 else SIZES * [1.0, 0.3, -0.5, 0.2, -0.4, 0.7]
    middle, line = transitions @ mean, transitions @ direction
    edges = np.linspace(-7.0, 7.0, 2801)
    number = 0.5 * (edges[1:] + edges[:-1])
    weight = np.diff(norm.cdf(edges))
    squares = [(one * other).sum(axis=1) for one, other in ((middle, middle), (middle, line), (line, line))]
    inside = np.stack([number**0, 2 * number, number**2], axis=1) @ squares <= 225.0
    entries = (inside[:, 1:] & ~inside[:, :-1]).sum(axis=1)
    for method in ("entries", "bound"):
        figure = probability(mean, direction, method)
        # resolution of the grid, 0.001, and of the times, 0.002
        assert figure.at_start == pytest.approx(weight @ inside[:, 0], abs=2e-3)
        assert figure.value == pytest.approx(weight @ inside.any(axis=1), abs=4e-3)
        assert figure.mean_entries == pytest.approx(weight @ entries, abs=1.2e-2)
        assert figure.low <= figure.value <= figure.high <= figure.low + 3e-6
        assert figure.samples == 0


@pytest.mark.parametrize(("turned", "sigma"), [(0.125, 5e3), (0.625, 20e3), (1.0, 5e3)])
def test_fast_intervals_of_one_number(sigma, turned):
    """Cross-track motion 5 km sin nt + xi sigma cos nt moves the interval of xi by several widths."""
    duration, ratio, half = turned * PERIOD, 5e3 / sigma, 15.0 / sigma
    path, other = ORBIT.coast([0, 0, 0, 0, 0, 5e3 * N], duration), ORBIT.coast(np.zeros(6), duration)
    line = np.array([0, 0, sigma, 0, 0, 0])
    figure = cf.collision_probability(path, other, ZONE, cf.Uncertainty(np.outer(line, line)), method="bound")
    angle = 2 * np.pi * turned
    low = -ratio * np.tan(angle) - half / abs(np.cos(angle))  # lower end of the last interval
    if turned < 0.25:
        ever, entries = norm.cdf(half) - norm.cdf(low), norm.cdf(-half) - norm.cdf(low)
    else:  # the interval passes infinity at pi/2, and again at 3 pi/2
        ever, entries = 1.0, norm.cdf(-half) + norm.sf(low) + (turned > 0.75)
    assert figure.at_start == pytest.approx(2 * norm.cdf(half) - 1, rel=1e-6)
    assert figure.value == pytest.approx(ever, rel=1e-6)
    assert figure.mean_entries == pytest.approx(entries, rel=1e-6)


def test_far_tails_are_accurate():
    """Along-track errors do not move: inside from 9 to 15 sigma."""
    figure = probability([0, 60, 0, 0, 0, 0], [0, 5.0, 0, 0, 0, 0])
    assert figure.value == pytest.approx(norm.sf(9.0) - norm.sf(15.0), rel=1e-6)
    assert figure.mean_entries <= 1e-9 * figure.value  # rounding


def test_edges_of_the_entering_interval():
    """Radial errors 60 m ahead: roots give the numbers whose motion touches the zone."""
    line = np.array([expm(hill() * t)[:3, 0] for t in np.linspace(0.0, 2 * PERIOD, 8001)])

    def depth(x):
        return np.linalg.norm([0, 60, 0] + 5.0 * x * line, axis=1).min() - 15.0

    grid = np.linspace(-9.0, 9.0, 361)
    depths = np.array([depth(x) for x in grid])
    (change,) = np.nonzero(depths[1:] * depths[:-1] < 0.0)
    roots = [brentq(depth, grid[k], grid[k + 1], xtol=1e-9) for k in change]
    edges = np.array([-np.inf, *roots, np.inf])
    met = [depth(x) <= 0.0 for x in 0.5 * (np.clip(edges[1:], -9, 9) + np.clip(edges[:-1], -9, 9))]
    expected = np.diff(norm.cdf(edges))[met].sum()
    assert len(roots) >= 2
    assert probability([0, 60, 0, 0, 0, 0], [5.0, 0, 0, 0, 0, 0]).value == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize(("ahead", "met"), [(60.0, 0.0), (14.0, 1.0)])
def test_negligible_errors(ahead, met):
    figure = probability([0, ahead, 0, 0, 0, 0], 1e-10 * SIZES)
    assert (figure.value, figure.at_start, figure.mean_entries) == (met, met, 0.0)


PLANES = {
    "positions": np.array([[7.7, -0.2], [20.0, -34.0], [-5.2, 8.7], [0, 0], [0, 0], [0, 0]]),
    "velocities": np.array([[0, 0], [0, 0], [0, 0], [6 * N, 2 * N], [-3 * N, 5 * N], [2 * N, 9 * N]]),
    "all": SIZES[:, None] * [[1, 0.3], [0.2, -1], [-0.5, 0.4], [0.2, 0.6], [-0.4, 0.1], [0.7, -0.8]],
    "axes": np.diag([0, 30.0, 0, 0, 0, 12 * N])[:, [1, 5]],
}


@pytest.mark.parametrize("mean", MEANS[1:2])
@pytest.mark.parametrize(
    "plane", ["axes", *(pytest.param(k, marks=pytest.mark.slow) for k in PLANES if k != "axes")]
)
def test_two_random_numbers(mean, plane):
    """Integrate over a grid of both numbers with 600 times an orbit."""
    edges = np.linspace(-5.0, 5.0, 501)
    number, weight = 0.5 * (edges[1:] + edges[:-1]), np.diff(norm.cdf(edges))
    transitions = np.array([expm(hill() * t)[:3] for t in np.linspace(0.0, 2 * PERIOD, 1200)])
    middle, first, second = transitions @ mean, *np.moveaxis(transitions @ PLANES[plane], -1, 0)
    up = np.stack([number**0, number, number**2])
    before, ever, entries = None, np.zeros((500, 500), dtype=bool), np.zeros((500, 500), dtype=np.int8)
    for m, one, other in zip(middle, first, second, strict=True):
        # |m + x one + y other|^2, in powers of y
        constant = ((m + number[:, None] * one) ** 2).sum(axis=1)
        linear = 2.0 * (m + number[:, None] * one) @ other
        square = np.full(len(number), other @ other)
        inside = np.stack([constant, linear, square], axis=1) @ up <= 225.0
        if before is None:
            began = inside
        else:
            entries += (inside > before).view(np.int8)
        before = inside
        ever |= inside
    began, ever, entries = began.ravel(), ever.ravel(), entries.ravel()
    weights = np.outer(weight, weight).ravel()
    figure = probability(mean, PLANES[plane])
    # resolution of cells of 0.02
    assert figure.at_start == pytest.approx(weights @ began, abs=3e-3)
    assert figure.value == pytest.approx(weights @ ever, abs=4e-3)
    assert figure.mean_entries == pytest.approx(weights @ entries, abs=1.2e-2)
    assert figure.low <= figure.value <= figure.high <= figure.low + 1e-4


@pytest.mark.parametrize(("miss", "along", "scale"), [(0.0, 0.0, 1.0), (60.0, 3.0, 1.0), (25.0, 3.0, 400.0)])
def test_fast_encounter_is_fosters_integral(miss, along, scale):
    """In deep space each trajectory through the zone enters once."""
    orbit, radius, speed = cf.Orbit(0.0), 15.0, 0.5
    miss, across = miss * scale, scale * np.array([[8.0, 3.0], [-2.0, 12.0]])
    root = np.zeros((6, 2))
    root[[0, 2]], root[1] = across, along
    path = orbit.coast([miss, -300 * speed, 0.3 * miss, 0, speed, 0], 600.0)
    inverse, size = np.linalg.inv(across @ across.T), 2 * np.pi * abs(np.linalg.det(across))

    def density(z, x):
        gap = np.array([x - miss, z - 0.3 * miss])
        return np.exp(-0.5 * gap @ inverse @ gap) / size

    expected, _ = dblquad(
        density,
        -radius,
        radius,
        lambda x: -np.sqrt(radius**2 - x**2),
        lambda x: np.sqrt(radius**2 - x**2),
        epsabs=0.0,
    )
    figure = cf.collision_probability(
        path, orbit.coast(np.zeros(6), 600.0), cf.Sphere(radius), cf.Uncertainty(root @ root.T)
    )
    assert figure.value == pytest.approx(expected, rel=2e-5)
    assert figure.low <= expected <= figure.high
    assert figure.mean_entries == pytest.approx(expected, rel=2e-5)
