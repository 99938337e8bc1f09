"""Minimum time within a thrust limit, against exact cases and infeasibility."""

import numpy as np
import pytest

import closeform as cf

ORBIT, DEEP = cf.Orbit.circular(500e3), cf.Orbit(0.0)
REST = np.zeros(6)


def bounded(draws: np.random.Generator) -> np.ndarray:
    n = ORBIT.mean_motion
    state = draws.normal(size=6) * np.array([200.0, 400.0, 200.0, 0.2, 0.4, 0.2])
    state[4] = -2 * n * state[0]
    return state


def tasks(seed: int, count: int):
    draws = np.random.default_rng(seed)
    begins, ends = (np.array([bounded(draws) for _ in range(count)]) for _ in range(2))
    peaks = ORBIT.transfer(begins, ends, ORBIT.period * draws.uniform(0.1, 1.0, count)).peak_thrust
    return begins, ends, np.asarray(peaks)


@pytest.mark.parametrize(("length", "limit"), [(130.0, 5.2e-4), (1.0, 3.0), (1e5, 1e-6)])
def test_rest_to_rest_in_deep_space(length, limit):
    """2 sqrt(L/U), accelerating for half of it."""
    final = np.r_[np.array([3.0, 4.0, 12.0]) / 13.0 * length, 0, 0, 0]
    path = cf.least_time(DEEP, REST, final, limit, start=7.0)
    assert path.end - path.start == pytest.approx(2 * np.sqrt(length / limit), rel=2e-8)
    assert path.peak_thrust <= limit * (1 + 1e-9)
    np.testing.assert_allclose(path.state(path.end), final, atol=1e-9 * length)


def test_speeding_up_along_the_line():
    """1 m/s at both ends of 0.3 m, 1 m/s^2: in 2 (sqrt(1.3) - 1) s, but not from 0.35 to 3.65 s."""
    begin, end = [0, 0, 0, 1.0, 0, 0], [0.3, 0, 0, 1.0, 0, 0]
    assert cf.least_time(DEEP, begin, end, 1.0).end == pytest.approx(2 * (np.sqrt(1.3) - 1), rel=2e-8)
    slow, late = 2 * (1 - np.sqrt(0.7)), 2 * (1 + np.sqrt(0.7))  # brake and speed up again; come back
    for duration in (0.3, slow * 0.999, late * 1.001, 10.0):
        assert DEEP.transfer(begin, end, duration, 0.0, 1.0).peak_thrust <= 1 + 1e-9
    for duration in (slow * 1.001, 1.0, 3.0, late * 0.999):
        with pytest.raises(ValueError, match="a thrust of 1 m/s\\^2 is too low"):
            DEEP.transfer(begin, end, duration, 0.0, 1.0)


def test_return_behind_at_the_same_speed():
    """Brake, turn and speed up: T - T^2/4 = -0.05."""
    path = cf.least_time(DEEP, [0, 0, 0, 1.0, 0, 0], [-0.05, 0, 0, 1.0, 0, 0], 1.0)
    assert path.end == pytest.approx(2 + np.sqrt(4.2), rel=2e-8)


def test_minimum_time_and_longer_energy_profiles():
    begins, ends, limits = tasks(4, 12)
    paths = cf.least_time(ORBIT, begins, ends, limits)
    assert (paths.peak_thrust <= limits * (1 + 1e-9)).all()
    for k in range(12):
        np.testing.assert_allclose(paths[k].state(paths[k].end)[:3], ends[k][:3], atol=1e-6)
        for shorter in (0.99999, 0.99, 0.9, 0.7, 0.4):
            with pytest.raises(ValueError, match="is too low to arrive"):
                ORBIT.transfer(begins[k], ends[k], paths[k].end * shorter, 0.0, limits[k])
    energy = cf.least_time(ORBIT, begins, ends, limits, profile="energy")
    np.testing.assert_array_equal(energy.end, cf.shortest_transfer(ORBIT, begins, ends, limits).end)
    assert (paths.end < energy.end).all()
    assert 1.1 < np.median(energy.end / paths.end) < 1.5


def test_more_thrust_is_faster():
    begins, ends, limits = tasks(9, 3)
    for k in range(3):
        times = cf.least_time(
            ORBIT, begins[k], ends[k], limits[k] * np.array([1.0, 1.5, 3.0, 10.0, 100.0])
        ).end
        assert (np.diff(times) < 0).all()


def test_small_mean_motion_agrees_with_deep_space():
    final = [30.0, 40.0, 120.0, 0, 0, 0]
    slow = cf.least_time(cf.Orbit(1e-9), REST, final, 1e-3).end
    assert slow == pytest.approx(cf.least_time(DEEP, REST, final, 1e-3).end, rel=1e-5)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ((ORBIT, REST, [1e5, 0, 0, 0, 0, 0], 1e-9), "max_acceleration: no thrust within 1e-09 m/s"),
        ((ORBIT, REST, REST, 1e-3), "final: equals initial"),
        ((ORBIT, REST, [1.0, 0, 0, 0, 0, 0], 1e-3, "soon"), 'profile: expected "least time" or "energy"'),
        (
            (DEEP, REST, [1e-20, 0, 0, 0, 0, 0], 1e10),
            "max_acceleration: 1e\\+10 m/s\\^2 allows a duration below",
        ),
    ],
)
def test_invalid_input_is_named(arguments, named):
    with pytest.raises(ValueError, match="^" + named):
        cf.least_time(*arguments)
