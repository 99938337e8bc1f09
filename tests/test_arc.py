"""Arcs with thrust of the full span: motion, totals and conflicts."""

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

import closeform as cf
from closeform.motion.arc import END, MEAN_MOTION, PUSH, STATE, THRUST, WIDTH
from closeform.planning.problem.approaches import sample_bodies

N = 1.1e-3
STATE_0 = [40.0, -90.0, 25.0, 0.05, -0.12, 0.08]


def pushed(n: float, seed: int, duration: float = 700.0) -> cf.Path:
    """Return an arc with optimal thrust and one with four derivatives of similar size."""
    draws = np.random.default_rng(seed)
    row = np.zeros((1, WIDTH))
    row[0, [END, MEAN_MOTION]] = duration, n
    row[0, STATE : STATE + 6] = STATE_0
    row[0, THRUST : THRUST + 6] = 3e-4 * draws.normal(size=6) / np.repeat([1.0, duration], 3)
    row[0, PUSH:] = 6e-4 * draws.normal(size=12) / np.repeat(duration ** np.arange(4.0), 3)
    return cf.Path(cf.Orbit(n), row, np.array([0, 1]), ())


def thrust(path: cf.Path, t: float) -> np.ndarray:
    """Return the thrust by its definition: a solution of u'' = N u + S u'."""
    row, n = path.arcs[0], path.orbit.mean_motion
    angle = n * t
    if n:
        shapes = [1.0, t, (1 - np.cos(angle)) / n**2, (angle - np.sin(angle)) / n**3]
    else:
        shapes = [1.0, t, t**2 / 2, t**3 / 6]
    natural = path.orbit.transition(t)[:3] @ row[THRUST : THRUST + 6]
    return natural + shapes @ row[PUSH:].reshape(4, 3)


@pytest.mark.parametrize("n", [0.0, 1e-5, N, 5 * N])
def test_motion_agrees_with_an_integrator(n):
    path = pushed(n, 1)

    def rates(t, s):
        x, _, z, vx, vy, vz = s
        natural = [3 * n * n * x + 2 * n * vy, -2 * n * vx, -n * n * z]
        return np.concatenate([[vx, vy, vz], natural + thrust(path, t)])

    times = np.linspace(0.0, 700.0, 8)
    flown = solve_ivp(rates, (0.0, 700.0), STATE_0, "DOP853", times, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(path.state(times), flown.y.T, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(path.thrust(times), [thrust(path, t) for t in times], rtol=1e-10, atol=1e-15)


@pytest.mark.parametrize("n", [0.0, N])
def test_totals_agree_with_quadrature_and_sampling(n):
    path = pushed(n, 2)
    sizes = np.linalg.norm(path.thrust(np.linspace(0.0, 700.0, 20_001)), axis=1)
    squares = quad(lambda t: np.sum(thrust(path, t) ** 2), 0.0, 700.0, epsrel=1e-12)[0]
    lengths = quad(lambda t: np.linalg.norm(thrust(path, t)), 0.0, 700.0, epsrel=1e-12, limit=200)[0]
    assert path.energy == pytest.approx(0.5 * squares, rel=1e-9)
    assert path.delta_v == pytest.approx(lengths, rel=1e-9)
    assert sizes.max() * (1 - 1e-12) <= path.peak_thrust <= sizes.max() * (1 + 1e-6)  # sampled: 35 ms


@pytest.mark.parametrize("n", [0.0, N])
@pytest.mark.parametrize("seed", range(8))
def test_conflicts_agree_with_dense_sampling(n, seed):
    """Beside a coast, beside an arc of the other kind, and in a batch."""
    path, orbit = pushed(n, seed), cf.Orbit(n)
    others = cf.stack(
        [orbit.coast(np.r_[path.position(400.0) + 3.0, 0, 0, 0.01], 700.0), pushed(n, seed + 50)]
    )
    zone = cf.Sphere(25.0)
    times = np.linspace(0.0, 700.0, 70_001)
    for other in (others[0], others[1]):
        ratio = zone.norm(path.position(times) - other.position(times))
        found = cf.closest_approach(path, other, zone)
        assert found.ratio == pytest.approx(ratio.min(), abs=1e-6)  # 10 ms at a zone in a minute
        assert found.ratio <= ratio.min() + 1e-12
        inside = ratio < 1.0
        edges = times[1:][inside[1:] != inside[:-1]]
        conflicts = cf.find_conflicts(path, other, zone)
        got = [t for c in conflicts for t in (c.start, c.end) if 0.0 < t < 700.0]
        np.testing.assert_allclose(got, edges, atol=0.011)  # a sample further at most
    many = cf.stack([path] * 40 + [others[0], others[1]])
    met = {tuple(pair) for pair in cf.screen(many, zone).pairs if pair[0] == 0 and pair[1] >= 40}
    assert met == {(0, 40 + k) for k in range(2) if len(cf.find_conflicts(path, others[k], zone))}


def test_inertially_constant_thrust_is_representable():
    """Its norm is constant, so that delta-v is norm times duration."""
    path = pushed(N, 3)
    row = path.arcs.copy()
    row[0, THRUST:] = 0.0
    size, turn = 2e-4, np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    rate = -N * turn
    course = [np.array([0.6, 0.8, 0.0]) * size]
    for _ in range(3):
        course.append(rate @ course[-1])
    row[0, PUSH:] = np.concatenate(course)
    inertial = cf.Path(path.orbit, row, path.offsets, ())
    t = 612.0
    cosine, sine = np.cos(N * t), np.sin(N * t)
    want = size * np.array([0.6 * cosine + 0.8 * sine, 0.8 * cosine - 0.6 * sine, 0.0])
    np.testing.assert_allclose(inertial.thrust(t), want, atol=1e-13 * size)
    assert inertial.delta_v == pytest.approx(size * 700.0, rel=1e-9)
    assert inertial.energy == pytest.approx(0.5 * size**2 * 700.0, rel=1e-9)
    assert inertial.peak_thrust == pytest.approx(size, rel=2e-9)


def test_samples_at_any_times():
    """Even, uneven and repeated times, also across arcs."""
    orbit = cf.Orbit(N)
    coast = orbit.coast(STATE_0, 700.0)
    burn = orbit.transfer(coast.state(700.0), [0.0, 50.0, 0.0, 0.0, 0.0, 0.0], 900.0, start=700.0)
    path = cf.join([coast, burn, orbit.coast(burn.state(1600.0), 400.0, start=1600.0)])
    ends = [0.0, 0.0, 700.0, 700.0, 700.0, 1600.0, 1600.0, 2000.0]
    uneven = [33.0, 33.0, 851.0, 912.0, 912.0]
    times = np.sort(np.concatenate([np.linspace(-100.0, 2100.0, 23), uneven, ends]))
    states = np.empty((1, len(times), 6))
    hill = np.empty(0), path.arcs, path.offsets, times, np.empty((0, 25))  # no clock of a chief
    sample_bodies(*hill, states)
    there = (times >= 0.0) & (times <= 2000.0)
    assert np.isinf(states[0, ~there, 0]).all()
    np.testing.assert_allclose(states[0, there], path.state(times[there]), rtol=0.0, atol=1e-10)  # m, m/s
