"""Loss of thrust on paths of every kind, against independent integrators."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import closeform as cf
from pairs import carried

MU, RADIUS = 3.986004418e14, 6.878e6
N = np.sqrt(MU / RADIUS**3)
ORBIT = cf.Orbit(N)
PERIOD = ORBIT.period
STILL = np.zeros(6)
ZONE = cf.Ellipsoid([20.0, 40.0, 20.0])
SAME = 2e-9  # both of two ratios are certain to 1e-9


def some_states(seed, count):
    rng = np.random.Generator(np.random.Philox(seed))
    states = rng.normal(size=(count, 6)) * np.r_[60, 250, 60, 0.05, 0.1, 0.05]
    states[:, 4] = -2 * N * states[:, 0] + rng.normal(size=count) * 2e-3
    return states


def positions_after_loss(path, s, t):
    """Return positions (M, 3) at times t (M,) after loss of thrust at s (M,)."""
    return carried(path.orbit.mean_motion, path.state(s), t - s)[:, :3]


def two_body_flight(path, failed_at, time):
    """Return the relative position under gravity with thrust cut at an instant."""

    def pull(t, q, thrusting):
        x, y, z, vx, vy, vz = q
        cube = ((RADIUS + x) ** 2 + y * y + z * z) ** 1.5
        gravity = np.r_[2 * N * vy + N * N * (RADIUS + x), -2 * N * vx + N * N * y, 0.0]
        gravity = gravity - MU * np.r_[RADIUS + x, y, z] / cube
        return np.r_[vx, vy, vz, gravity + (path.thrust(t) if thrusting else 0.0)]

    exact = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-10}
    cut = solve_ivp(pull, (0, failed_at), path.state(0.0), args=(True,), **exact).y[:, -1]
    return solve_ivp(pull, (failed_at, time), cut, args=(False,), **exact).y[:3, -1]


def test_two_body_motion_agrees_to_second_order():
    """The difference to two-body motion falls with the square of the size."""
    off = []
    for size in (1.0, 0.5):
        start, end = size * some_states(4, 2)
        path = ORBIT.transfer(start, end, 0.8 * PERIOD)
        until = 1.8 * PERIOD
        found = cf.drift_approach(path, ORBIT.coast(STILL, until), cf.Sphere(20.0 * size), until)
        there = two_body_flight(path, found.failed_at, found.time)
        off.append(
            np.linalg.norm(
                there - positions_after_loss(path, *np.array([[found.failed_at], [found.time]]))[0]
            )
        )
        far = np.linalg.norm(path.position(np.linspace(0, path.end, 99)), axis=1).max()
        assert off[-1] <= 30.0 * far**2 / RADIUS  # as coefficients of second order over an orbit
        assert abs(np.linalg.norm(there) - found.distance) <= off[-1]
    assert 3.5 < off[0] / off[1] < 4.5


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6), st.floats(0.3, 2.0), st.floats(0.0, 3.0), st.floats(1.0, 3.0))
def test_longer_drift_and_larger_zone_are_never_safer(seed, duration, more, larger):
    start, end = some_states(seed, 2)
    path = ORBIT.transfer(start, end, duration * PERIOD)
    other = ORBIT.coast(STILL, (duration + more + 0.1) * PERIOD)
    soon, late = path.end + 0.1 * PERIOD, other.end
    first = cf.drift_approach(path, other, ZONE, soon).ratio
    longer = cf.drift_approach(path, other, ZONE, late).ratio
    assert longer <= first + SAME * max(1.0, first)
    grown = cf.drift_approach(path, other, cf.Ellipsoid(larger * np.array([20.0, 40.0, 20.0])), late).ratio
    assert grown == pytest.approx(longer / larger, rel=SAME, abs=SAME)
    swapped = cf.drift_approach(other, path, ZONE, late, failing="other").ratio
    assert swapped == pytest.approx(longer, rel=SAME, abs=SAME)
    assert cf.passively_safe(path, other, ZONE, late) == (longer > 1.0)


@pytest.mark.parametrize("seed", range(6))
def test_grazing_spheres(seed):
    """Spheres 1e-7 smaller and larger than the closest approach."""
    start, end = some_states(seed, 2)
    path, until = ORBIT.transfer(start, end, PERIOD), 3 * PERIOD
    other = ORBIT.coast(STILL, until)
    least = cf.drift_approach(path, other, cf.Sphere(20.0), until).distance
    assert cf.passively_safe(path, other, cf.Sphere(least * (1 - 1e-7)), until)
    assert not cf.passively_safe(path, other, cf.Sphere(least * (1 + 1e-7)), until)


@pytest.mark.parametrize("seed", range(3))
def test_path_that_starts_inside(seed):
    start, end = some_states(seed, 2)
    start[:3] = [5.0, 10.0, -5.0]
    path, until = ORBIT.transfer(start, end, PERIOD), 2 * PERIOD
    other = ORBIT.coast(STILL, until)
    found = cf.drift_approach(path, other, ZONE, until)
    assert found.ratio <= ZONE.norm(start[:3])
    assert not cf.passively_safe(path, other, ZONE, until)
    gap = positions_after_loss(path, np.array([found.failed_at]), np.array([found.time]))
    assert abs(ZONE.norm(gap)[0] - found.ratio) <= SAME


def circle(radius):
    """Return the start of a relative orbit at one distance from its centre."""
    return np.array([0.0, radius, 0.0, 0.5 * N * radius, 0.0, 0.5 * np.sqrt(3.0) * N * radius])


def test_closed_relative_orbits():
    """A transfer onto a circle around the client comes no closer after loss of thrust."""
    other = ORBIT.coast(STILL, 31 * PERIOD)
    for zone in (cf.Sphere(50.0), cf.Box([40.0, 60.0, 50.0]), cf.Cylinder(30.0, 50.0)):
        staying = ORBIT.coast(circle(100.0), PERIOD)
        found = cf.drift_approach(staying, other, zone, 31 * PERIOD)
        alone = cf.closest_approach(ORBIT.coast(circle(100.0), 31 * PERIOD), other, zone)
        assert found.ratio == pytest.approx(alone.ratio, rel=SAME)
    wider = ORBIT.transition(PERIOD) @ circle(101.0)
    spiral = ORBIT.transfer(circle(100.0), wider, PERIOD)
    assert cf.drift_approach(spiral, other, cf.Sphere(50.0), 2 * PERIOD).ratio <= 2.0
    assert cf.passively_safe(spiral, other, cf.Sphere(50.0), 2 * PERIOD)


def path_of(kind):
    start, end = some_states(8, 2)
    if kind == "burn":
        return ORBIT.burn(start, [2e-4, -1e-4, 1e-4], 0.4 * PERIOD)
    path = ORBIT.transfer(start, end, PERIOD)
    peak = np.linalg.norm(path.thrust(np.linspace(0, PERIOD, 500)), axis=1).max()
    if kind == "saturated":
        return ORBIT.transfer(start, end, PERIOD, max_acceleration=0.8 * peak)
    if kind == "pulsed":
        return cf.fire_thrusters(path, cf.Thrusters.rtn(acceleration=4 * peak, period=PERIOD / 12)).path
    times = np.linspace(0.0, PERIOD, 60)
    return ORBIT.sampled(times, path.state(times)) if kind == "sampled" else path


@pytest.mark.parametrize("kind", ["energy", "sampled", "saturated", "pulsed", "burn"])
def test_no_sampled_failure_comes_closer(kind):
    """40 000 instants and times by matrix exponentials."""
    path = path_of(kind)
    rng = np.random.Generator(np.random.Philox(3))
    until = path.end + 1.5 * PERIOD
    other = ORBIT.coast(STILL, until)
    found = cf.drift_approach(path, other, ZONE, until)
    s = rng.uniform(path.start, path.end, 40_000)
    t = rng.uniform(s, until)
    s[-1], t[-1] = found.failed_at, found.time
    norms = ZONE.norm(positions_after_loss(path, s, t))
    assert norms.min() >= found.ratio - SAME
    assert abs(norms[-1] - found.ratio) <= SAME
    assert norms[:-1].min() <= found.ratio + 0.5  # sampling comes about as near
    assert cf.passively_safe(path, other, ZONE, until) == (found.ratio > 1.0)


def test_independent_failures_of_both():
    """The reported instants attain the ratio, and no sampled ones are closer."""
    a, b, c, d = some_states(21, 4)
    path = ORBIT.transfer(a + np.r_[0, 900, 0, 0, 0, 0], b + np.r_[0, 700, 0, 0, 0, 0], 0.6 * PERIOD)
    other, until = ORBIT.transfer(c, d, 0.5 * PERIOD), 0.8 * PERIOD
    found = cf.drift_approach(path, other, cf.Sphere(20.0), until, failing="both")
    rng = np.random.Generator(np.random.Philox(5))
    s = np.stack([rng.uniform(0.0, one.end, 40_000) for one in (path, other)])
    t = rng.uniform(s.max(axis=0), until)
    s[:, -1], t[-1] = found.failed_at, found.time
    norms = (
        np.linalg.norm(positions_after_loss(path, s[0], t) - positions_after_loss(other, s[1], t), axis=1)
        / 20.0
    )
    off = SAME * max(1.0, found.ratio)
    assert norms.min() >= found.ratio - off
    assert abs(norms[-1] - found.ratio) <= off
