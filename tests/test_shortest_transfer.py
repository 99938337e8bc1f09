"""Shortest transfers against closed forms, roots of quartics, mpmath and dense scanning."""

import warnings
from itertools import product

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq, linprog

import closeform as cf
from closeform.fuel import shortest as limits
from closeform.fuel.shortest import shortest_transfer
from closeform.planning.limits import propellant
from truth import Reference

N = 1.1e-3
ORBIT = cf.Orbit(N)
DEEP = cf.Orbit(0.0)
REST = np.zeros(6)
KEPT = 1.0 + 1e-9  # as promised

seeds = st.integers(0, 2**32 - 1)


def bounded_states(seed, count=2, spread=100.0):
    """Return states (count, 6) on bounded relative orbits of N."""
    states = np.random.default_rng(seed).normal(size=(count, 6)) * spread * np.array([1, 1, 1, N, 0, N])
    states[:, 4] = -2.0 * N * states[:, 0]
    return states


def horner(coefficients, x):
    """Return a polynomial's value, highest power first."""
    value = mp.mpf(0)
    for coefficient in coefficients:
        value = value * x + coefficient
    return value


def quartic_root(initial, final, limit):
    """Return the shortest T in deep space for which thrust, linear in time, keeps the limit at both ends.

    |6 L / T^2 - p / T| <= limit with p = 4 v0 + 2 v1 at the start, 2 v0 + 4 v1 at the end.
    """
    mp.mp.dps = 40
    v0, v1 = initial[3:], final[3:]
    distance = [mp.mpf(float(b)) - mp.mpf(float(a)) for a, b in zip(initial[:3], final[:3], strict=True)]
    quartics, roots = [], []
    for swing in (4.0 * v0 + 2.0 * v1, 2.0 * v0 + 4.0 * v1):
        p = [mp.mpf(float(c)) for c in swing]
        squares = [sum(a * b for a, b in zip(*two, strict=True)) for two in ((p, p), (distance, p))]
        length = sum(c * c for c in distance)
        quartics.append([mp.mpf(limit) ** 2, 0, -squares[0], 12 * squares[1], -36 * length])
        with warnings.catch_warnings():  # newer versions reverse the coefficients
            warnings.simplefilter("ignore", DeprecationWarning)
            roots += mp.polyroots(quartics[-1], maxsteps=500, extraprec=200)
    for root in sorted(r.real for r in roots if abs(r.imag) < mp.mpf(10) ** -20 * abs(r) and r.real > 0):
        later = root * (1 + mp.mpf(10) ** -25)
        if all(horner(q, later) >= 0 for q in quartics):
            return float(root)
    raise AssertionError("no root")


def test_rest_to_rest_in_deep_space():
    path = shortest_transfer(DEEP, REST, [60, 0, 80, 0, 0, 0], 1e-3, start=50.0)
    assert path.shape == ()
    assert path.start == 50.0
    assert path.end - 50.0 == pytest.approx(np.sqrt(6.0 * 100.0 / 1e-3), rel=1e-9)
    assert path.peak_thrust == pytest.approx(1e-3, rel=1e-9)
    np.testing.assert_allclose(path.state(path.end), [60, 0, 80, 0, 0, 0], atol=1e-9)


@given(seeds, st.floats(-5.0, 1.0), st.floats(-4.0, 0.0))
@settings(max_examples=10, deadline=None)
def test_deep_space_is_the_root_of_a_quartic(seed, speed, limit):
    initial, final = np.random.default_rng(seed).normal(size=(2, 6)) * np.repeat([100.0, 10.0**speed], 3)
    path = shortest_transfer(DEEP, initial, final, 10.0**limit)
    assert path.end == pytest.approx(quartic_root(initial, final, 10.0**limit), rel=1e-9)
    assert path.peak_thrust <= 10.0**limit * KEPT


@given(seeds, st.floats(-5.0, -3.0))
@settings(max_examples=4, deadline=None)
def test_dense_scan_finds_no_shorter_transfer(seed, exponent):
    limit = 10.0**exponent
    initial, final = bounded_states(seed)
    times = np.geomspace(1.0, 10.0 * ORBIT.period, 4000)
    peaks = ORBIT.transfer(initial, final, times).peak_thrust
    if not (peaks <= limit).any():
        with pytest.raises(ValueError, match=r"too low for any transfer of up to .* \(10 orbits\)"):
            shortest_transfer(ORBIT, initial, final, limit)
        return
    path = shortest_transfer(ORBIT, initial, final, limit)
    assert path.peak_thrust <= limit * KEPT
    assert path.end <= times[np.argmax(peaks <= limit)]
    assert (peaks[times < path.end * (1.0 - 1e-12)] > limit).all()
    below = path.end * (1.0 - np.geomspace(1e-9, 0.5, 200))
    assert (ORBIT.transfer(initial, final, below).peak_thrust > limit * (1.0 - 1e-12)).all()


def test_peak_agrees_with_the_200_digit_reference():
    initial, final = bounded_states(3)
    path = shortest_transfer(ORBIT, initial, final, 3e-5)
    _, thrust, _ = Reference(N).transfer(initial, final, path.end)
    sizes = [float(mp.norm(mp.matrix(thrust(t)))) for t in np.linspace(0.0, path.end, 201)]
    assert max(sizes) == pytest.approx(3e-5, rel=1e-3)  # sampled
    assert max(sizes) <= 3e-5 * KEPT


def test_first_crossing_of_the_limit_is_found():
    """The peak rises again with the duration: the first crossing is the answer."""
    initial = np.array([0.0, 0, 0, 0, 0, 0])
    final = cf.Orbit(N).coast([0, 0, 0, 0.05, 0, 0], 2000.0).state(2000.0)
    times = np.linspace(1500.0, 9000.0, 4001)
    peaks = ORBIT.transfer(initial, final, times).peak_thrust
    rises = np.flatnonzero((peaks[1:-1] < peaks[:-2]) & (peaks[1:-1] < peaks[2:])) + 1
    assert rises.size  # there is a local minimum
    dip = rises[0]
    assert peaks[dip:].max() > peaks[dip] * 1.05
    limit = peaks[dip] * 1.01
    path = shortest_transfer(ORBIT, initial, final, limit)
    assert path.end < times[dip]
    first = times[np.argmax(peaks <= limit)]
    assert path.end == pytest.approx(first, abs=times[1] - times[0])


@pytest.mark.parametrize("limit", [1e-3, 1e-5, 1e-7, 1e-9, 1e-12])
def test_transfer_close_to_a_natural_motion(limit):
    """Where a natural motion takes 3000 s, smaller limits give durations closer to that."""
    initial = np.array([100, 0, 50, 0, -0.22, 0.01])
    final = ORBIT.coast(initial, 3000.0).state(3000.0)
    path = shortest_transfer(ORBIT, initial, final, limit)
    assert path.end < 3000.0

    def excess(time):
        return ORBIT.transfer(initial, final, time).peak_thrust - limit

    assert excess(path.end * (1.0 - 1e-6)) > 0.0
    if limit < 1e-4:  # thrust is proportional to the remaining time
        near = brentq(excess, 2500.0, 3000.0, xtol=1e-12, rtol=1e-15)
        assert path.end == pytest.approx(near, abs=1e-9)


@given(st.integers(1, 8), st.floats(1e-3, 1e3), st.floats(-3.0, 3.0))
@settings(max_examples=8, deadline=None)
def test_inclination_over_half_orbits(halves, length, phase):
    """The cross-track peak at k half orbits is 2 n |dh| / T, theory (9)."""
    final = length * np.array([0, 0, np.cos(phase), 0, 0, N * np.sin(phase)])
    duration = halves * np.pi / N
    limit = 2.0 * N * length / duration
    path = shortest_transfer(ORBIT, REST, final, limit * 1.000001)
    assert path.end <= duration
    assert ORBIT.transfer(REST, final, duration).peak_thrust == pytest.approx(limit, rel=1e-9)


@given(seeds, st.floats(-5.0, -2.0), st.sampled_from([ORBIT, DEEP]))
@settings(max_examples=6, deadline=None)
def test_scan_starts_where_no_thrust_suffices(seed, exponent, orbit):
    """A linear program with forty steps of thrust is infeasible where the scan starts."""
    limit, steps = 10.0**exponent, 40
    initial, final = bounded_states(seed)
    first = limits.surely_too_short(orbit.mean_motion, initial, final, limit, 1e4)
    h = first / steps
    ways = np.array([way for way in product((-1.0, 0.0, 1.0), repeat=3) if any(way)])
    ways *= limit / np.linalg.norm(ways, axis=1, keepdims=True)
    pushed = orbit.burn(REST, ways, h).state(h)
    response = np.concatenate([orbit.transition(k * h) @ pushed.T for k in range(steps)], axis=1)
    lengths = np.repeat([1.0, first], 3)
    gap = (final - orbit.transition(first) @ initial) * lengths
    shares = np.kron(np.eye(steps), np.ones(len(ways)))
    none = np.zeros(shares.shape[1])
    hull = linprog(none, A_ub=shares, b_ub=np.ones(steps), A_eq=response * lengths[:, None], b_eq=gap)
    assert hull.status == 2  # infeasible
    # and the scan is short
    assert first > 0.02 * min(shortest_transfer(DEEP, initial, final, limit).end, 0.2 / N)


def test_batches_broadcast():
    craft, slots = bounded_states(1, 3), bounded_states(2, 2)
    allowed = np.array([[3e-5], [1e-4], [3e-4]])
    paths = shortest_transfer(ORBIT, craft[:, None], slots, allowed, start=100.0)
    assert paths.shape == (3, 2)
    for i in range(3):
        for j in range(2):
            alone = shortest_transfer(ORBIT, craft[i], slots[j], allowed[i, 0])
            assert paths.end[i, j] - 100.0 == pytest.approx(alone.end, rel=1e-9)
    assert (paths.peak_thrust <= allowed * KEPT).all()
    np.testing.assert_allclose(paths[1, 0].state(paths.end[1, 0]), slots[0], atol=1e-9)


@given(seeds)
@settings(max_examples=15, deadline=None)
def test_more_thrust_takes_no_longer(seed):
    initial, final = bounded_states(seed)
    ends = shortest_transfer(ORBIT, initial, final, np.array([1e-4, 2e-4, 1e-3, 1e-1])).end
    assert (np.diff(ends) < 0.0).all()


def test_slow_orbit_agrees_with_deep_space():
    final = np.array([100.0, 20, 30, 0.01, 0, 0])
    slow = shortest_transfer(cf.Orbit(1e-9), REST, final, 1e-3).end
    assert slow == pytest.approx(shortest_transfer(DEEP, REST, final, 1e-3).end, rel=1e-5)


STILL = bounded_states(5, 3)


@pytest.mark.parametrize(
    ("words", "arguments"),
    [
        ("final: equals initial", (STILL[0], STILL[0], 1e-4)),
        ("final: craft 1: equals initial", (STILL, [REST, STILL[1], REST], 1e-4)),
        (r"max_acceleration: craft 2: 1e-12 m/s\^2 is too", (STILL, REST, [1e-1, 1e-1, 1e-12])),
    ],
)
def test_invalid_input_is_refused(words, arguments):
    with pytest.raises(ValueError, match=words):
        shortest_transfer(ORBIT, *arguments)


def test_reported_thrust_is_sufficient():
    with pytest.raises(ValueError, match=r"about (\S+) m/s\^2 is enough in (\S+) s") as refusal:
        shortest_transfer(ORBIT, STILL[0], STILL[1], 1e-9)
    words = str(refusal.value).split("about ")[1].split()
    peak, time = float(words[0]), float(words[5])
    assert ORBIT.transfer(STILL[0], STILL[1], time).peak_thrust == pytest.approx(peak, rel=0.01)
    scan = np.linspace(0.01, 10.0, 5000) * ORBIT.period
    assert ORBIT.transfer(STILL[0], STILL[1], scan).peak_thrust.min() == pytest.approx(peak, rel=0.02)


@given(st.floats(1.0, 1e5), st.floats(1e-9, 1e4), st.floats(10.0, 5000.0))
@settings(max_examples=15)
def test_propellant_is_the_rocket_equation(mass, delta_v, impulse):
    mp.mp.dps = 40
    true = mp.mpf(mass) * (1 - mp.exp(-mp.mpf(delta_v) / (mp.mpf(impulse) * mp.mpf("9.80665"))))
    assert propellant(mass, delta_v, impulse) == pytest.approx(float(true), rel=1e-13, abs=0.0)


def test_propellant_adds_up_over_burns():
    burnt = propellant(150.0, np.array([3.0, 5.0, 8.0]), 220.0)
    assert burnt[2] == pytest.approx(burnt[0] + propellant(150.0 - burnt[0], 5.0, 220.0), rel=1e-12)
    assert burnt[0] < burnt[1] < burnt[2]
    for wrong in ((0.0, 1.0, 220.0), (150.0, -1.0, 220.0), (150.0, 1.0, 0.0), (150.0, np.inf, 220.0)):
        with pytest.raises(ValueError, match=r"^(mass|delta_v|specific_impulse): "):
            propellant(*wrong)
