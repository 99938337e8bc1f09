"""Primer vectors: rows, value of transfers and maxima, against matrix exponentials and dense samples."""

import numpy as np
import pytest
from numba import float64, int64, void
from scipy.linalg import expm

import closeform as cf
from bridge import hill
from closeform._jit import kernel
from closeform.motion.minimum_delta_v.primer import (
    functional,
    peaks,
    position_rows,
    rate_rows,
)

N = 1.1e-3
CAPACITY = 64


@kernel(void(float64, float64, float64[:, ::1], float64[:, ::1]))
def both_rows(n, t, psi, rates):
    position_rows(n, t, psi)
    rate_rows(n, t, rates)


@kernel(void(float64, float64[::1], float64[::1]))
def value_of(n, s, g):
    functional(n, s[0], s[1], s[2], s[3], s[4], s[5], g)


@kernel(float64(float64, float64, float64[::1], float64, float64[::1], float64[::1], int64[::1]))
def found(n, duration, c, level, times, squares, count):
    count[0], highest = peaks(n, duration, c, level, times, squares)
    return highest


def peaks_of(n, duration, c, level=0.0, capacity=CAPACITY):
    """Return times and lengths of the local maxima, and the bound of the maximum length."""
    times, squares, count = np.empty(capacity), np.empty(capacity), np.zeros(1, dtype=np.int64)
    highest = found(n, duration, np.asarray(c, float), level, times, squares, count)
    return times[: count[0]], np.sqrt(squares[: count[0]]), np.sqrt(highest)


def sampled(n, duration, c, count):
    """Return lengths of a primer at equal times, by steps of the matrix exponential."""
    step, state = expm(hill(n) * duration / count), np.asarray(c, float)
    lengths = [np.linalg.norm(state[:3])]
    for _ in range(count):
        state = step @ state
        lengths.append(np.linalg.norm(state[:3]))
    return np.array(lengths)


def scaled(rng, duration):
    """Return a primer whose position and rate have equal size over a duration."""
    return rng.normal(size=6) * np.array([1, 1, 1, 1 / duration, 1 / duration, 1 / duration])


@pytest.mark.parametrize(("n", "t"), [(N, 2000.0), (N, 0.3), (N, 40_000.0), (0.0, 700.0), (1e-9, 700.0)])
def test_rows_agree_with_the_matrix_exponential(n, t):
    psi, rates = np.empty((3, 6)), np.empty((3, 6))
    both_rows(n, t, psi, rates)
    truth = expm(hill(n) * t)
    scale = np.array([1, 1, 1, 1 / t, 1 / t, 1 / t]) * (1 + n * t)
    assert np.abs((psi - truth[:3]) * scale).max() < 1e-10 * (1 + n * t)
    assert np.abs((rates - truth[3:]) * scale).max() * t < 1e-10 * (1 + n * t) ** 2


@pytest.mark.parametrize("n", [0.0, N])
def test_value_of_impulses(n):
    """Theory (27): g . c is the sum of p(t_k) . v_k for any impulses and primer."""
    rng = np.random.default_rng(1)
    duration, times = 9000.0, np.sort(rng.uniform(0, 9000.0, 5))
    impulses, c = rng.normal(size=(5, 3)), scaled(rng, duration)
    gained = sum(expm(-hill(n) * t) @ np.r_[0, 0, 0, v] for t, v in zip(times, impulses, strict=True))
    paid = [(expm(hill(n) * t) @ c)[:3] @ v for t, v in zip(times, impulses, strict=True)]
    g = np.empty(6)
    value_of(n, gained, g)
    assert g @ c == pytest.approx(sum(paid), abs=1e-10 * sum(map(abs, paid)))


@pytest.mark.parametrize("n", [0.0, N])
def test_bound_is_the_maximum_length(n):
    """Never below dense samples, and above them by the sampling error at most."""
    rng = np.random.default_rng(2)
    for _ in range(25):
        duration = 10.0 ** rng.uniform(-1, 4.7)
        c = scaled(rng, duration)
        if n and rng.random() < 0.7:  # without along-track drift
            c = np.r_[rng.normal(size=3), n * rng.normal(size=3)]
            c[4] = -2 * n * c[0]
        lengths = sampled(n, duration, c, 2000)
        times, tops, highest = peaks_of(n, duration, c)
        assert highest >= lengths.max() * (1 - 1e-11)
        assert highest <= lengths.max() * (1 + 1e-11 + 4 * (1 + n * duration) ** 2 / 2000**2)
        assert tops.max() == pytest.approx(highest, rel=1e-12)
        inner = np.flatnonzero((lengths[1:-1] > lengths[:-2]) & (lengths[1:-1] >= lengths[2:])) + 1
        for k in inner:  # each maximum of the samples is listed
            assert np.abs(times - k * duration / 2000).min() <= 1.01 * duration / 2000
        assert (np.diff(times) > 0).all()


def test_maximum_agrees_with_peak_thrust():
    """`Path.peak_thrust` of the transfer of that primer gives the same maximum."""
    orbit, rng = cf.Orbit(N), np.random.default_rng(3)
    durations = rng.uniform(0.01, 6.0, 100) * orbit.period
    path = orbit.transfer(rng.normal(size=(100, 6)) * [100, 100, 100, 0.1, 0.1, 0.1], np.zeros(6), durations)
    for arc, duration, peak in zip(path.arcs, durations, path.peak_thrust, strict=True):
        assert peaks_of(N, duration, arc[12:18] / peak)[2] == pytest.approx(1.0, abs=2e-9)


def circle(sign, phase):
    """Return a primer of constant length 1: relative motion on a circle."""
    c, s, high = np.cos(phase), np.sin(phase), sign * np.sqrt(0.75)
    return np.array([0.5 * c, -s, high * c, -0.5 * N * s, -N * c, -high * N * s])


@pytest.mark.parametrize("tilt", [0.0, 1e-12, 1e-6, 1e-3])
def test_nearly_constant_length(tilt):
    """The bound holds to 1e-12 however flat |p| is."""
    rng = np.random.default_rng(4)
    duration = 3.3 * 2 * np.pi / N
    for sign in (-1.0, 1.0):
        c = circle(sign, rng.uniform(0, 6)) + tilt * rng.normal(size=6) * [1, 1, 1, N, N, N / 20]
        times, _, highest = peaks_of(N, duration, c, capacity=512)
        lengths = sampled(N, duration, c, 2000)
        assert 1 - 1e-11 <= highest / lengths.max() <= 1 + 1e-11 + 1e-3 * tilt
        assert len(times) < 512


def test_flat_maximum():
    """A constant primer has length 1 everywhere."""
    c = np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0])  # constant: flat everywhere
    assert peaks_of(N, 6000.0, c)[2] == pytest.approx(1.0, abs=1e-13)
    assert peaks_of(0.0, 6000.0, c)[2] == pytest.approx(1.0, abs=1e-13)


def test_level_excludes_lower_maxima():
    rng = np.random.default_rng(5)
    duration = 5 * 2 * np.pi / N
    c = np.r_[rng.normal(size=3), N * rng.normal(size=3)]
    times, tops, highest = peaks_of(N, duration, c)
    level = np.median(tops)
    some, high, same = peaks_of(N, duration, c, level)
    assert same == pytest.approx(highest, rel=1e-14)
    assert (high >= level).all()
    assert set(np.round(times[tops > level], 3)) <= set(np.round(some, 3))
    assert peaks_of(N, duration, c, 2 * highest)[2] == 2 * highest  # above all maxima, the level is the bound


def test_small_capacity_keeps_the_highest_maxima():
    duration = 9 * 2 * np.pi / N
    c = np.array([0.1, 0.0, 0.5, 0.0, -0.2 * N, 0.0]) + np.array([0, 1e-3, 0, 0, 1e-5 * N, 0])
    _, tops, highest = peaks_of(N, duration, c)
    times, few, same = peaks_of(N, duration, c, capacity=3)
    assert same == highest
    assert sorted(few) == pytest.approx(sorted(tops)[-3:], rel=1e-12)
    assert (np.diff(times) > 0).all()
