"""Paths of an orbit against 200-digit references, published numbers and an integrator."""

import itertools
import re

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import closeform as cf
from closeform.motion.duration import MOST_ORBITS, SHORTEST
from truth import Flight, Reference

N = 1.1e-3
ANGLES = [
    *np.logspace(-12, -2, 41),
    *np.linspace(0.02, 2.5, 12),
    1.99, 2.0, 2.01, 3.14159, 6.2832, 8.8, 20.0, 63.0, 200 * np.pi,
]  # fmt: skip
CLOSE = 1e-9  # of the scale, as promised

INITIAL = np.array([120.0, -80.0, 45.0, 0.11, -0.27, 0.06])
FINAL = np.array([-60.0, 150.0, -20.0, -0.05, 0.13, 0.09])
PUSH = np.array([3e-5, -2e-5, 1e-5])


def scale(states, duration):
    """Return the larger of |r| and |v| T over the states of a path."""
    states = np.atleast_2d(np.array(states, dtype=float))
    return max(
        np.linalg.norm(states[:, :3], axis=1).max(), np.linalg.norm(states[:, 3:], axis=1).max() * duration
    )


def error_of(got, true, duration):
    """Return the error of position and of velocity times the duration, relative to the scale."""
    true = np.array([[float(c) for c in s] for s in true])
    error = np.abs(got - true) * np.repeat([1.0, duration], 3)
    return error.max() / scale(true, duration)


def states_for(duration, angle):
    """Return end states with speeds suitable for the duration."""
    unit = np.repeat([1.0, 1.0 / duration], 3)
    return (INITIAL * [1, 1, 1, 500, 500, 500]) * unit, (FINAL * [1, 1, 1, 500, 500, 500]) * unit


def test_reference_agrees_with_the_matrix_exponential():
    """Theory (2-9) against exp of the 12 x 12 system of state and costate."""
    duration = 700.0
    reference = Reference(N)
    n = reference.n
    hill = mp.zeros(6)
    for k in range(3):
        hill[k, k + 3] = 1
    hill[3, 0], hill[5, 2], hill[3, 4], hill[4, 3] = 3 * n**2, -(n**2), 2 * n, -2 * n
    system = mp.zeros(12)
    system[:6, :6] = hill
    system[6:, 6:] = -hill.T
    for k in range(3, 6):
        system[k, k + 6] = 1
    with mp.workdps(60):
        flow = mp.expm(system * duration)
        begin = mp.matrix([float(s) for s in INITIAL])
        rest = mp.matrix([float(s) for s in FINAL]) - flow[:6, :6] * begin
        costate = mp.lu_solve(flow[:6, 6:], rest)
        half = mp.expm(system * (duration / 2))
        middle = half[:6, :6] * begin + half[:6, 6:] * costate
        thrust = (half[6:, 6:] * costate)[3:]
    state, push, _ = reference.transfer(INITIAL, FINAL, duration)
    assert max(abs(a - b) for a, b in zip(state(duration / 2), middle, strict=True)) < 1e-40
    assert max(abs(a - b) for a, b in zip(push(duration / 2), thrust, strict=True)) < 1e-40


@pytest.mark.parametrize("kind", ["coast", "burn", "transfer"])
def test_motion_agrees_with_the_reference(kind):
    for angle in ANGLES:
        duration = angle / N
        initial, final = states_for(duration, angle)
        times = duration * np.array([0.0, 0.17, 0.5, 0.83, 1.0])
        reference, orbit = Reference(N), cf.Orbit(N)
        if kind == "coast":
            path = orbit.coast(initial, duration)
            true = [reference.coast(initial, t) for t in times]
        elif kind == "burn":
            push = PUSH / np.abs(PUSH).max() * 100 / duration**2
            path = orbit.burn(initial, push, duration)
            true = [reference.burn(initial, push, t) for t in times]
        else:
            path = orbit.transfer(initial, final, duration)
            state, thrust, energy = reference.transfer(initial, final, duration)
            true = [state(t) for t in times]
            pushes = np.array([[float(u) for u in thrust(t)] for t in times])
            assert path.energy == pytest.approx(float(energy), rel=CLOSE), angle
            np.testing.assert_allclose(path.thrust(times), pushes, rtol=0, atol=CLOSE * np.abs(pushes).max())
            assert error_of(path.state(duration)[None], [final], duration) < CLOSE, angle
        assert error_of(path.state(times), true, duration) < CLOSE, angle


def test_deep_space_is_the_limit():
    """n = 0: cubic motion and J = (12 dr.dr/T^3 - 12 dr.dv/T^2 + 4 dv.dv/T)/2, and n -> 0 gets there."""
    duration = 300.0
    deep = cf.Orbit(0.0).transfer(INITIAL, FINAL, duration)
    gap = FINAL[:3] - INITIAL[:3] - INITIAL[3:] * duration
    turn = FINAL[3:] - INITIAL[3:]
    energy = 0.5 * (12 * gap @ gap / duration**3 - 12 * gap @ turn / duration**2 + 4 * turn @ turn / duration)
    assert deep.energy == pytest.approx(energy, rel=1e-12)
    s = np.linspace(0, 1, 11)[:, None]
    hermite = (
        (1 + 2 * s) * (1 - s) ** 2 * INITIAL[:3]
        + s * (1 - s) ** 2 * duration * INITIAL[3:]
        + s**2 * (3 - 2 * s) * FINAL[:3]
        + s**2 * (s - 1) * duration * FINAL[3:]
    )
    np.testing.assert_allclose(deep.position(s[:, 0] * duration), hermite, rtol=0, atol=1e-10)  # of 200 m
    for n in (1e-300, 1e-30, 1e-15):
        near = cf.Orbit(n).transfer(INITIAL, FINAL, duration)
        np.testing.assert_allclose(near.state(120.0), deep.state(120.0), rtol=1e-10)
        assert near.energy == pytest.approx(deep.energy, rel=1e-10)
    burn = cf.Orbit(0.0).burn(INITIAL, PUSH, duration)
    np.testing.assert_allclose(
        burn.position(duration), INITIAL[:3] + INITIAL[3:] * duration + PUSH * duration**2 / 2, rtol=1e-14
    )


def test_published_states():
    # Tudat, unitTestClohessyWiltshirePropagator.cpp (after Vallado's hillsr)
    n = np.sqrt(3.986004418e14 / 6.778137e6**3)
    path = cf.Orbit(n).coast([45, 37, 12, 0.08, 0.03, 0.01], 1800.0)
    published = [380.6450080201250, -543.7424675454679, 2.509547637285142]
    published += [0.1541620605755606, -0.729475139049947, -0.01662099488431618]
    np.testing.assert_allclose(path.state(1800.0), published, rtol=1e-13)
    # Vallado, Fundamentals of Astrodynamics, example 6-14; mu and R are the book's
    orbit = cf.Orbit.circular(590e3, mu=3.986004415e14, radius=6378136.3)
    path = orbit.coast([0, 0, 0, -0.1, -0.04, -0.02], 300.0)
    np.testing.assert_allclose(
        path.position(300.0), [-33.345724432, -1.473560307, -5.894530312], rtol=0, atol=1e-9
    )


def legs(orbit):
    return {
        "coast": orbit.coast(INITIAL, 5000.0, start=100.0),
        "burn": orbit.burn(INITIAL, PUSH, 5000.0, start=100.0),
        "transfer": orbit.transfer(INITIAL, FINAL, 5000.0, start=100.0),
        "sampled": orbit.sampled([100.0, 900.0, 2000.0], np.array([INITIAL, FINAL, INITIAL])),
    }


@pytest.mark.parametrize("kind", ["coast", "burn", "transfer", "sampled"])
@pytest.mark.parametrize("n", [0.0, N])
def test_integrated_thrust_follows_the_path(kind, n):
    path = legs(cf.Orbit(n))[kind]
    breaks = np.unique([*path.arcs[:, 0], path.end])
    state = path.state(path.start)
    for begin, end in itertools.pairwise(breaks):

        def rate(t, s, begin=begin, end=end):
            u = path.thrust(np.clip(t, begin, np.nextafter(end, begin)))  # the arc's own at its end
            pull = [3 * n * n * s[0] + 2 * n * s[4], -2 * n * s[3], -n * n * s[2]]
            return np.concatenate([s[3:], pull + u])

        flown = solve_ivp(rate, (begin, end), state, method="DOP853", rtol=1e-12, atol=1e-12)
        state = flown.y[:, -1]
        # 200 m and 0.3 m/s: agreement to 1e-10 of them
        np.testing.assert_allclose(path.position(end), state[:3], rtol=0, atol=1e-7)
        np.testing.assert_allclose(path.velocity(end), state[3:], rtol=0, atol=1e-10)


def test_two_impulse_meets_both_ends():
    orbit = cf.Orbit(N)
    for duration in (1.0, 600.0, 2000.0, 4000.0, 9000.0):
        path = orbit.two_impulse(INITIAL, FINAL, duration, start=50.0)
        np.testing.assert_allclose(path.position(50.0), INITIAL[:3], rtol=0, atol=1e-9)
        np.testing.assert_allclose(path.state(50.0 + duration), FINAL, rtol=0, atol=1e-8)
        (first, jump), (last, brake) = path.impulses
        assert (first, last) == (50.0, 50.0 + duration)
        np.testing.assert_allclose(path.velocity(50.0), INITIAL[3:] + jump, rtol=0, atol=1e-12)
        drift = orbit.coast(path.state(50.0), duration, start=50.0).state(50.0 + duration)
        np.testing.assert_allclose(drift[3:] + brake, FINAL[3:], rtol=0, atol=1e-9)
        assert path.delta_v == pytest.approx(np.linalg.norm(jump) + np.linalg.norm(brake), rel=1e-12)
        assert path.energy == np.inf


# After half an orbit z has changed its sign, after a whole one x and z are as before: the miss.
@pytest.mark.parametrize(("turns", "missed"), [(0.5, 25.0), (1.0, np.hypot(180.0, 65.0)), (1.5, 25.0)])
def test_two_impulse_reports_its_miss(turns, missed):
    orbit, duration = cf.Orbit(N), turns * 2 * np.pi / N
    with pytest.raises(ValueError, match=r"final: two impulses .* or change the duration") as caught:
        orbit.two_impulse(INITIAL, FINAL, duration)
    words = str(caught.value)
    assert float(re.search(r"by at least (\S+) m", words)[1]) == pytest.approx(missed, rel=1e-5)
    nearest = FINAL.copy()
    nearest[:3] = [float(word) for word in re.search(r"\[(.*)\]", words)[1].split(",")]
    path = orbit.two_impulse(INITIAL, nearest, duration)  # the remedy
    np.testing.assert_allclose(path.position(duration), nearest[:3], rtol=0, atol=1e-7)
    with pytest.raises(ValueError, match="final: craft 1, 0: two impulses"):
        orbit.two_impulse([[INITIAL], [INITIAL]], [[nearest], [FINAL]], duration)


HALF, WHOLE = np.pi / N, 2 * np.pi / N
# Fehse, Automated Rendezvous and Docking of Spacecraft (2003), 3.3: start, end, delta-v of each impulse.
HOPS = {
    "radial hop of half an orbit": ([0, 100, 0, 0, 0, 0], [0, -100, 0, 0, 0, 0], HALF, 200 * N / 4),
    "radial hop out of the plane": ([0, 100, 30, 0, 0, 0], [0, -100, -30, 0, 0, 0], HALF, 200 * N / 4),
    "tangential hop of an orbit": ([0, 100, 0, 0, 0, 0], [0, 0, 0, 0, 0, 0], WHOLE, 100 * N / (6 * np.pi)),
    "tangential hop of two": ([0, 0, 5, 0, 0, 0], [0, 60, 5, 0, 0, 0], 2 * WHOLE, 60 * N / (12 * np.pi)),
    "Hohmann transfer": (
        [-50, 0, 0, 0, 75 * N, 0],
        [0, 37.5 * np.pi, 0, 0, 0, 0],
        HALF,
        50 * N / 4,
    ),
    "back to the start": ([0, 100, 0, 0, 0, 0], [0, 100, 0, 0, 0, 0], WHOLE, 0.0),
}


@pytest.mark.parametrize("beside", [0.0, 1e-12, -1e-9, 1e-6])
@pytest.mark.parametrize("hop", HOPS)
def test_two_impulse_textbook_hops(hop, beside):
    """Compare with the integrator at and near multiples of half an orbit."""
    start, end, duration, impulse = HOPS[hop]
    duration *= 1.0 + beside
    path = cf.Orbit(N).two_impulse(start, end, duration)
    # the change of duration counts for some times as much in the impulses
    assert [np.linalg.norm(jump) for _, jump in path.impulses] == pytest.approx(
        [impulse] * len(path.impulses), rel=1e-9 + 20 * abs(beside), abs=1e-12
    )

    def rate(t, s):
        return [*s[3:], 3 * N * N * s[0] + 2 * N * s[4], -2 * N * s[3], -N * N * s[2]]

    flown = solve_ivp(rate, (0.0, duration), path.state(0.0), method="DOP853", rtol=1e-12, atol=1e-12).y[
        :, -1
    ]
    np.testing.assert_allclose(flown[:3], end[:3], rtol=0, atol=1e-6)  # m, of 100 m: both to 1e-9
    brake = path.impulses[-1][1] if impulse else 0.0
    np.testing.assert_allclose(flown[3:] + brake, end[3:], rtol=0, atol=1e-9)


@pytest.mark.parametrize("turns", [0.5, 1.0, 1.5, 1.4067296143649153, 2.445298131384212])
def test_two_impulse_chooses_the_least_squares_of_impulses(turns):
    """Any other drift that reaches the position has larger impulses."""
    orbit, duration = cf.Orbit(N), turns * 2 * np.pi / N
    flow = orbit.transition(duration)
    end = flow @ (INITIAL + [0, 0, 0, 0.02, -0.01, 0.03])  # some drift meets it
    end[3:] = FINAL[3:]
    path = orbit.two_impulse(INITIAL, end, duration)
    np.testing.assert_allclose(path.state(duration), end, rtol=0, atol=1e-7)
    speed = path.velocity(0.0)

    def squares(v):
        return sum((v - INITIAL[3:]) ** 2) + sum((end[3:] - flow[3:] @ [*INITIAL[:3], *v]) ** 2)

    jumps = [jump for _, jump in path.impulses]
    assert squares(speed) == pytest.approx(sum(jump @ jump for jump in jumps), rel=1e-9)
    _, sizes, directions = np.linalg.svd(flow[:3, 3:])
    free = directions[sizes < 1e-9 * duration]
    assert len(free) == (2 if turns == 1.0 else 1)
    for direction in free:
        assert np.linalg.norm(flow[:3, 3:] @ direction) < 1e-9 * duration
        for step in (-0.01, -1e-4, 1e-4, 0.01):
            assert squares(speed + step * direction) > squares(speed)


def test_cross_track_cost_near_half_an_orbit():
    """A change of 30 m costs 30 m n / sin(n t)."""
    orbit = cf.Orbit(N)
    for beside in (1e-2, 1e-4, 1e-6, 1e-8):
        duration = HALF * (1 + beside)
        jump = orbit.two_impulse([0, 100, 0, 0, 0, 0], [0, -100, 30, 0, 0, 0], duration).impulses[0][1]
        assert abs(jump[2]) == pytest.approx(30 * N / np.sin(np.pi * beside), rel=1e-6)
    with pytest.raises(ValueError, match="by at least 30 m"):
        orbit.two_impulse([0, 100, 0, 0, 0, 0], [0, -100, 30, 0, 0, 0], HALF * (1 + 1e-12))


def test_transition_is_a_flow_in_both_directions():
    orbit = cf.Orbit(N)
    times = np.array([[0.0, 1e-6, 300.0], [5000.0, 30000.0, 1e5]])
    forward, back = orbit.transition(times), orbit.transition(-times)
    assert forward.shape == (2, 3, 6, 6)
    scaled = np.repeat([1.0, 1 / N], 3)
    # y drifts by 6 n t |x|: 660 times after 1e5 s, and rounding with it
    np.testing.assert_allclose(
        (forward @ back) * scaled[:, None] / scaled, np.broadcast_to(np.eye(6), (2, 3, 6, 6)), atol=1e-9
    )
    np.testing.assert_allclose(
        orbit.transition(700.0) @ INITIAL, orbit.coast(INITIAL, 700.0).state(700.0), rtol=1e-13
    )


def amplitude_motion(n, t):
    """Natural motion (5) without drift, amplitude 1 m, and its velocity."""
    s, c = np.sin(n * t), np.cos(n * t)
    return np.stack([-c, 2 * s, s, n * s, 2 * n * c, n * c], axis=-1)


def test_sampled_path_meets_its_nodes_and_error_bound():
    """Position to h^4/384 and velocity to h^3/(72 sqrt 3) of the fourth derivative, orders 4 and 3."""
    orbit = cf.Orbit(N / 3)  # in which this motion is no coast: cubics
    errors = []
    for count in (11, 21, 41, 81):
        times = np.linspace(0.0, 2000.0, count)
        nodes = amplitude_motion(N, times)
        path = orbit.sampled(times, nodes)
        assert path.cubic_share == 1.0
        np.testing.assert_allclose(path.state(times), nodes, rtol=0, atol=1e-13)
        t = np.linspace(0.0, 2000.0, 4001)
        gap = np.abs(path.state(t) - amplitude_motion(N, t))
        h = times[1]
        # along the track the amplitude is 2 m, so is the fourth derivative in n^4
        bound = 2 * N**4 * np.array([h**4 / 384, h**3 / (72 * np.sqrt(3))])
        found = np.array([gap[:, :3].max(), gap[:, 3:].max()])
        assert (found <= bound * (1 + 1e-9) + [1e-14, 1e-17]).all()
        assert (found >= 0.5 * bound).all()  # the bound is sharp
        errors.append(found)
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    np.testing.assert_allclose(orders, [[4, 3]] * 3, atol=0.1)


HOUR = 3600.0


@pytest.mark.parametrize("n", [0.0, N])
@pytest.mark.parametrize("spacing", [10.0, 600.0, HOUR, 3 * HOUR])
def test_samples_of_a_coast_are_interpolated_by_hill_motion(n, spacing):
    orbit = cf.Orbit(n)
    times = 500.0 + spacing * np.arange(11)
    craft = orbit.coast([INITIAL, FINAL, [0, 100, 0, 0, 0, 0], np.zeros(6)], 10 * spacing, start=500.0)
    path = orbit.sampled(times, craft.state(times))
    t = np.linspace(times[0], times[-1], 3001)
    size = np.abs(craft.position(t)).max()
    np.testing.assert_allclose(path.position(t), craft.position(t), rtol=0, atol=1e-9 * size)
    assert (path.interpolation_error <= 1e-9 * size).all()
    if spacing >= HOUR:
        assert (path.cubic_share[:2] == 0.0).all()


def test_samples_of_a_burn_are_interpolated_by_cubics():
    orbit = cf.Orbit(N)
    burn = orbit.burn(INITIAL, [1e-3, 0, 0], 2 * HOUR)
    flown = cf.join([burn, orbit.coast(burn.state(2 * HOUR), 6 * HOUR, start=2 * HOUR)])
    path = orbit.sampled(HOUR * np.arange(9), flown.state(HOUR * np.arange(9)))
    assert path.cubic_share == 0.25
    t = np.linspace(2 * HOUR, 8 * HOUR, 2001)
    size = np.abs(flown.position(t)).max()
    np.testing.assert_allclose(path.position(t), flown.position(t), rtol=0, atol=1e-9 * size)


@pytest.mark.parametrize("n", [0.0, N])
def test_interpolation_error_estimate(n):
    """Alternating thrust reaches the estimated error a h^2 / 16."""
    orbit, h, push = cf.Orbit(n), 60.0, np.array([0.0, 0.0, 1e-2])
    legs, state, start = [], np.zeros(6), 0.0
    for share, times in ((0.25, 2.0), (0.5, 0.0), (0.25, 2.0)):
        legs.append(orbit.burn(state, times * push, share * h, start=start))
        start += share * h
        state = legs[-1].state(start)
    flown = cf.join(legs)
    path = orbit.sampled([0.0, h], flown.state([0.0, h]))
    t = np.linspace(0.0, h, 2001)
    error_of = np.linalg.norm(path.position(t) - flown.position(t), axis=1).max()
    assert path.interpolation_error == pytest.approx(1e-2 * h**2 / 16, rel=5e-3)  # n h is 0.07
    assert error_of == pytest.approx(path.interpolation_error, rel=5e-3)


def test_conflicts_of_hourly_samples():
    """400 random relative orbits over ten hours have no missed and no false conflicts."""
    rng = np.random.Generator(np.random.Philox(10))
    orbit, zone = cf.Orbit(N), cf.Ellipsoid([20.0, 40.0, 20.0])
    states = rng.normal(size=(400, 6)) * np.repeat([150.0, 0.15], 3)
    states[:, 4] = -2 * N * states[:, 0]
    states[::4, 4] += rng.normal(size=100) * 1e-3  # a quarter drift along the track
    times = HOUR * np.arange(11)
    flown = orbit.coast(states, times[-1])
    chief = orbit.coast(np.zeros(6), times[-1])
    path = orbit.sampled(times, flown.state(times))
    true = [[(c.start, c.end) for c in cf.find_conflicts(one, chief, zone)] for one in flown]
    found = [[(c.start, c.end) for c in cf.find_conflicts(one, chief, zone)] for one in path]
    assert sum(map(len, true)) > 40
    for one, other in zip(true, found, strict=True):
        assert len(one) == len(other)
        np.testing.assert_allclose(other, one, rtol=0, atol=1e-4)  # s


def test_arguments_broadcast():
    orbit = cf.Orbit(N)
    begins, finals = np.stack([INITIAL, FINAL, 2 * FINAL]), np.stack([FINAL, INITIAL])
    costs = orbit.transfer(begins[:, None], finals, 800.0)
    assert costs.shape == (3, 2)
    assert costs.energy.shape == costs.delta_v.shape == costs.peak_thrust.shape == (3, 2)
    assert costs.energy[2, 1] == orbit.transfer(begins[2], finals[1], 800.0).energy
    assert costs.state([1.0, 2.0, 3.0, 4.0]).shape == (3, 2, 4, 6)
    assert orbit.coast(INITIAL, [10.0, 20.0], start=[[1.0], [2.0], [3.0]]).end.shape == (3, 2)
    assert orbit.burn(INITIAL, np.zeros((4, 3)), 10.0).shape == (4,)
    assert orbit.two_impulse(begins, FINAL, 10.0).shape == (3,)
    assert orbit.sampled([0.0, 1.0], np.zeros((5, 2, 6))).shape == (5,)
    assert orbit.coast(np.zeros((0, 6)), 10.0).shape == (0,)


states = st.lists(st.floats(-1, 1), min_size=6, max_size=6).map(
    lambda s: np.array(s) * np.repeat([100.0, 0.1], 3)
)
durations = st.floats(10.0, 15000.0)


@settings(deadline=None, max_examples=60)
@given(states, states, durations, st.floats(-1e6, 1e6), st.sampled_from([0.0, N]))
def test_time_shift_changes_nothing(initial, final, duration, shift, n):
    orbit = cf.Orbit(n)
    here = orbit.transfer(initial, final, duration)
    there = orbit.transfer(initial, final, duration, start=shift)
    t = np.linspace(0, duration, 5)
    # the shifted time is rounded to 1e-10 s, and speeds stay below a few m/s here
    size = np.abs(here.state(t)).max(axis=0)
    np.testing.assert_allclose(
        there.state(np.clip(t + shift, there.start, there.end)),
        here.state(t),
        rtol=0,
        atol=1e-9 * size.max() + 1e-9,
    )


@settings(deadline=None, max_examples=60)
@given(states, states, durations, st.sampled_from([0.0, N]))
def test_time_reversal(initial, final, duration, n):
    """(x, y, z, t) -> (x, -y, z, -t) leaves theory (1), the energy and the path unchanged."""
    mirror = np.array([1, -1, 1, -1, 1, -1.0])
    orbit = cf.Orbit(n)
    path = orbit.transfer(initial, final, duration)
    back = orbit.transfer(final * mirror, initial * mirror, duration)
    assert back.energy == pytest.approx(path.energy, rel=1e-8, abs=1e-18)
    t = np.linspace(0, duration, 7)
    size = max(np.abs(path.position(t)).max(), 1.0)
    np.testing.assert_allclose(
        back.position(duration - t) * mirror[:3], path.position(t), rtol=0, atol=1e-8 * size
    )


@settings(deadline=None, max_examples=60)
@given(states, states, states, st.floats(0.1, 0.9), durations, st.sampled_from([0.0, N]))
def test_energy_is_never_below_the_optimum(initial, final, middle, part, duration, n):
    """Optimal legs through another point cost more."""
    orbit = cf.Orbit(n)
    best = orbit.transfer(initial, final, duration)
    first = orbit.transfer(initial, middle, part * duration)
    second = orbit.transfer(middle, final, duration - part * duration, start=part * duration)
    assert cf.join([first, second]).energy >= best.energy * (1 - 1e-9)
    through = best.state(part * duration)  # and through its own point it costs the same
    first = orbit.transfer(initial, through, part * duration)
    second = orbit.transfer(through, final, duration - part * duration, start=part * duration)
    assert first.energy + second.energy == pytest.approx(best.energy, rel=1e-6, abs=1e-12)


def test_integrator_of_the_tests_agrees_with_the_reference():
    """Compare over ten orbits."""
    duration = 20 * np.pi / N
    flight = Flight(N, INITIAL[None]).transfer(FINAL[None], duration)
    state, _, _ = Reference(N).transfer(INITIAL, FINAL, duration)
    grid = np.array(flight.grid)
    places = flight.on(grid)[0, :, 0]
    for k in (20, 60, 100):
        np.testing.assert_allclose(
            places[k], [float(c) for c in state(grid[k])[:3]], rtol=0, atol=1e-9
        )  # of 1e3 m


BAD = {
    "duration zero": (lambda o: o.coast(INITIAL, 0.0), "duration: must be positive"),
    "duration tiny": (
        lambda o: o.transfer(INITIAL, FINAL, 1e-80),
        "duration: must be at least 1e-12 s, got 1e-80",
    ),
    "duration without end": (
        lambda o: o.transfer(INITIAL, FINAL, 1e14),
        r"duration: must be at most 1e\+06 orbits",
    ),
    "times tiny": (
        lambda o: o.sampled([0.0, 1e-80], [INITIAL] * 2),
        "times: each interval must be at least",
    ),
    "duration lost": (lambda o: o.coast(INITIAL, 1e-3, start=1e15), r"duration: 0\.001 s "),
    "times back": (lambda o: o.sampled([1.0, 0.0], [INITIAL] * 2), "times: must increase"),
    "mean motion": (lambda o: cf.Orbit(-1e-3), "mean_motion: must be"),
    "altitude": (lambda o: cf.Orbit.circular(-7e6), "altitude"),
}


@pytest.mark.parametrize("n", [0.0, N])
def test_shortest_duration(n):
    """Nothing overflows."""
    shortest = cf.Orbit(n).transfer(INITIAL, FINAL, SHORTEST)
    # from 6 L / T^2 steadily to its opposite: 3 L / T in all, beside which speeds and n are nothing
    gap = np.linalg.norm(FINAL[:3] - INITIAL[:3])
    assert shortest.delta_v == pytest.approx(3 * gap / SHORTEST, rel=1e-9)
    assert shortest.peak_thrust == pytest.approx(6 * gap / SHORTEST**2, rel=1e-9)
    hit = cf.find_conflicts(shortest, cf.Orbit(n).coast(np.zeros(6), 1.0), cf.Sphere(60.0))
    assert len(hit) == 1


@pytest.mark.slow
def test_longest_duration():
    """Delta-v is finite."""
    longest = cf.Orbit(N).transfer(INITIAL, FINAL, MOST_ORBITS * 2 * np.pi / N)
    assert 0.0 < longest.delta_v <= np.sqrt(2 * longest.energy * longest.end)  # Cauchy and Schwarz


def test_invalid_input():
    for case in BAD:
        call, message = BAD[case]
        with pytest.raises(ValueError, match=message):
            call(cf.Orbit(N))


@pytest.mark.parametrize("n", [0.0, N])
def test_sp11_gradients_are_aligned_at_any_time(n):
    """SP11 states that the gradients of the two legs are aligned at T/2: they are at every time.

    On an optimal path, dJ/d(final) of the leg before and dJ/d(initial) of the leg after are equal
    and opposite wherever it is cut; so which leg's direction is taken changes nothing.
    """
    orbit, duration = cf.Orbit(n), 4000.0
    path = orbit.transfer(INITIAL, FINAL, duration)
    for part in (0.1, 0.3, 0.5, 0.8):
        middle = path.state(part * duration)
        before = orbit.transfer(INITIAL, middle, part * duration)
        after = orbit.transfer(middle, FINAL, (1 - part) * duration)
        arriving, leaving = cf.papers.end_gradients(before)[1], cf.papers.end_gradients(after)[0]
        np.testing.assert_allclose(arriving, -leaving, rtol=0, atol=1e-8 * np.abs(arriving).max())
        # moving the point along them changes the sum of both in second order only
        side = np.array([1.0, -2.0, 0.5, 1e-3, 2e-3, -1e-3])
        costs = [
            orbit.transfer(INITIAL, middle + e * side, part * duration).energy
            + orbit.transfer(middle + e * side, FINAL, (1 - part) * duration).energy
            for e in (-1.0, 0.0, 1.0)
        ]
        bend = costs[0] - 2 * costs[1] + costs[2]
        assert bend > 0
        assert abs(costs[2] - costs[0]) < 1e-6 * bend + 1e-9 * path.energy


@pytest.mark.parametrize("n", [0.0, N])
def test_end_gradients_are_slopes_of_the_energy(n):
    """Energy is quadratic in the end states, so central differences are exact but for rounding."""
    orbit, duration = cf.Orbit(n), 4000.0
    slopes = cf.papers.end_gradients(orbit.transfer(INITIAL, FINAL, duration))
    for k, step in enumerate([1.0, 1.0, 1.0, 1e-3, 1e-3, 1e-3]):
        move = np.zeros(6)
        move[k] = step
        first = [orbit.transfer(INITIAL + s * move, FINAL, duration).energy for s in (1, -1)]
        last = [orbit.transfer(INITIAL, FINAL + s * move, duration).energy for s in (1, -1)]
        assert (first[0] - first[1]) / (2 * step) == pytest.approx(slopes[0][k], rel=1e-6, abs=1e-15)
        assert (last[0] - last[1]) / (2 * step) == pytest.approx(slopes[1][k], rel=1e-6, abs=1e-15)


def test_altitude_in_km_is_warned_of(recwarn):
    with pytest.warns(UserWarning, match="altitude") as found:
        assert cf.Orbit.circular(600).mean_motion > cf.Orbit.circular(600e3).mean_motion
    assert found[0].filename == __file__
    with pytest.warns(UserWarning, match="perigee_altitude") as found:
        cf.Orbit.eccentric(0.1, perigee_altitude=600)
    assert found[0].filename == __file__
    recwarn.clear()
    cf.Orbit.circular(50e3, 4.9028e12, 1737.4e3)  # about the Moon that is an orbit
    assert not recwarn.list
