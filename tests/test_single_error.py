"""Probabilities of errors along one line, against integrals over that one number and plain Monte Carlo."""

import warnings

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.stats import norm

import closeform as cf
from closeform.uncertainty.mean_entries import Unresolved

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


def asked(mean, direction, method="entries", zone=ZONE):
    path, other = ORBIT.coast(mean, 2 * PERIOD), ORBIT.coast(np.zeros(6), 2 * PERIOD)
    errors = cf.Errors(np.outer(direction, direction))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # velocities without positions
        return cf.collision_probability(path, other, zone, errors, method=method)


@pytest.fixture(scope="module")
def moved():
    """Where each of six numbers of a state leads in two orbits: (3000, 3, 6)."""
    return np.array([expm(hill() * t)[:3] for t in np.linspace(0.0, 2 * PERIOD, 3000)])


@pytest.mark.parametrize("mean", MEANS)
@pytest.mark.parametrize("axis", range(7))
def test_one_number_is_integrated(moved, mean, axis):
    """States on a fine grid of the number, weighed: entries between 12000 samples are as good as none."""
    direction = SIZES * np.eye(6)[axis] if axis < 6 else SIZES * [1.0, 0.3, -0.5, 0.2, -0.4, 0.7]
    middle, line = moved @ mean, moved @ direction
    edges = np.linspace(-7.0, 7.0, 2801)
    number = 0.5 * (edges[1:] + edges[:-1])
    weight = np.diff(norm.cdf(edges))
    squares = [(one * other).sum(axis=1) for one, other in ((middle, middle), (middle, line), (line, line))]
    inside = np.stack([number**0, 2 * number, number**2], axis=1) @ squares <= 225.0
    entries = (inside[:, 1:] & ~inside[:, :-1]).sum(axis=1)
    for method in ("entries", "bound"):
        figure = asked(mean, direction, method)
        # an interval's end is off by half a step of the grid, 0.0025 x 0.4; an instant by 4 s: 0.002 of xi
        assert figure.at_start == pytest.approx(weight @ inside[:, 0], abs=2e-3)
        assert figure.value == pytest.approx(weight @ inside.any(axis=1), abs=4e-3)
        assert figure.mean_entries == pytest.approx(weight @ entries, abs=1.2e-2)
        assert figure.low <= figure.value <= figure.high <= figure.low + 3e-6
        assert figure.samples == 0


@pytest.mark.parametrize("turned", [0.125, 0.5, 0.625, 1.0])
@pytest.mark.parametrize("sigma", [5e3, 20e3])
def test_intervals_that_move_fast(sigma, turned):
    """Across the track, 5 km sin nt + xi sigma cos nt: at nt xi about -5 km / sigma tan nt is inside.

    They move by several widths between two samples, and turn over from -infinity to infinity at pi/2.
    """
    duration, ratio, half = turned * PERIOD, 5e3 / sigma, 15.0 / sigma
    path, other = ORBIT.coast([0, 0, 0, 0, 0, 5e3 * N], duration), ORBIT.coast(np.zeros(6), duration)
    line = np.array([0, 0, sigma, 0, 0, 0])
    figure = cf.collision_probability(path, other, ZONE, cf.Errors(np.outer(line, line)), method="bound")
    angle = 2 * np.pi * turned
    low = -ratio * np.tan(angle) - half / abs(np.cos(angle))  # where the interval begins at the end
    if turned < 0.25:
        ever, entries = norm.cdf(half) - norm.cdf(low), norm.cdf(-half) - norm.cdf(low)
    else:  # once from the start to -infinity, then from infinity on, and once more beyond 3/4
        ever, entries = 1.0, norm.cdf(-half) + norm.sf(low) + (turned > 0.75)
    assert figure.at_start == pytest.approx(2 * norm.cdf(half) - 1, rel=1e-6)
    assert figure.value == pytest.approx(ever, rel=1e-6)
    assert figure.mean_entries == pytest.approx(entries, rel=1e-6)


def test_far_tails_keep_their_digits():
    """Along the track alone nothing moves: inside from the start, or never, by 45 m to 75 m of 5 m."""
    figure = asked([0, 60, 0, 0, 0, 0], [0, 5.0, 0, 0, 0, 0])
    assert figure.value == pytest.approx(norm.sf(9.0) - norm.sf(15.0), rel=1e-6)
    assert figure.mean_entries == 0.0


def test_edges_of_who_ever_comes_in():
    """Radially, 60 m ahead: which histories just touch is found by roots; 8001 times are 1e-5 m too far."""
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
    assert asked([0, 60, 0, 0, 0, 0], [5.0, 0, 0, 0, 0, 0]).value == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize(("ahead", "met"), [(60.0, 0.0), (14.0, 1.0)])
def test_errors_that_move_nothing(ahead, met):
    figure = asked([0, ahead, 0, 0, 0, 0], 1e-10 * SIZES)
    assert (figure.value, figure.at_start, figure.mean_entries) == (met, met, 0.0)


def test_who_is_refused_is_told_the_remedy():
    assert 'method="monte-carlo"' in str(Unresolved())
    assert issubclass(Unresolved, ValueError)
