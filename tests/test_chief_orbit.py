"""Paths beside an eccentric chief, against integrated motion, Hill's equations and a Gramian."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import closeform as cf
from chiefs import MU, flown, linear_matrix
from closeform.motion.elements.elements import inertial_from_elements

START = np.array([100.0, -200.0, 50.0, 0.1, -0.2, 0.05])
END = np.array([10.0, 20.0, -30.0, 0.01, 0.0, 0.02])


def eccentric(e, anomaly=1.0):
    return cf.Orbit.eccentric(e, perigee_altitude=700e3, true_anomaly=anomaly)


@pytest.mark.parametrize("e", [0.0, 0.01, 0.3, 0.8])
@pytest.mark.parametrize("begin", [0.0, -4321.0, 9876.5])
def test_coasts_follow_the_linear_equations(e, begin):
    orbit = eccentric(e)
    times = np.linspace(begin, begin + 1.6 * orbit.period, 40)
    path, truth = orbit.coast(START, times[-1] - begin, start=begin), flown(orbit, START, times)
    scale = np.abs(truth).max(axis=0)
    assert (np.abs(path.state(times) - truth) <= 1e-10 * scale).all()
    assert path.energy == path.delta_v == path.peak_thrust == 0.0


def test_a_circular_chief_moves_as_in_hill_equations():
    orbit, hill = cf.Orbit.eccentric(0.0, semi_major_axis=7e6), cf.Orbit.from_semi_major_axis(7e6)
    times = np.linspace(50.0, 9000.0, 60)
    for mine, known in (
        (orbit.coast(START, 8950.0, 50.0), hill.coast(START, 8950.0, 50.0)),
        (orbit.transfer(START, END, 8950.0, 50.0), hill.transfer(START, END, 8950.0, 50.0)),
        (orbit.two_impulse(START, END, 8950.0, 50.0), hill.two_impulse(START, END, 8950.0, 50.0)),
        (orbit.burn(START, END[:3] * 1e-5, 8950.0, 50.0), hill.burn(START, END[:3] * 1e-5, 8950.0, 50.0)),
    ):
        assert np.allclose(mine.position(times), known.position(times), rtol=0, atol=1e-8)
        assert np.allclose(mine.velocity(times), known.velocity(times), rtol=0, atol=1e-11)
        assert np.allclose(mine.thrust(times), known.thrust(times), rtol=0, atol=1e-15)
        assert mine.delta_v == pytest.approx(known.delta_v, rel=1e-9)
        assert mine.energy == pytest.approx(known.energy, rel=1e-9)
        assert mine.peak_thrust == pytest.approx(known.peak_thrust, rel=1e-9)


@pytest.mark.parametrize("e", [0.1, 0.5, 0.8])
def test_motion_is_that_of_kepler_to_first_order(e):
    """Halving the distances divides the error by four: what is left out is of second order."""
    a = 7.1e6 / (1.0 - e)
    orbit = cf.Orbit.eccentric(e, semi_major_axis=a, true_anomaly=0.0)
    chief = inertial_from_elements([a, 0.0, e, 0.0, 0.5, 0.3])
    times = np.linspace(0.0, 0.9 * orbit.period, 12)
    errors = []
    for part in (1.0, 0.5):
        state = 10.0 * part * START
        truth = relative(chief, state, times)
        errors.append(np.abs(orbit.coast(state, times[-1]).state(times)[:, :3] - truth)[-1].max())
    assert 3.5 < errors[0] / errors[1] < 4.5


def relative(chief, state, times):
    """Return positions in the chief's frame of two spacecraft that are integrated about a point mass."""

    def axes(inertial):
        r, v = inertial[:3], inertial[3:]
        h = np.cross(r, v)
        x, z = r / np.linalg.norm(r), h / np.linalg.norm(h)
        return np.array([x, np.cross(z, x), z]), np.array([0.0, 0.0, np.linalg.norm(h) / (r @ r)])

    def rates(_, y):
        pulls = [-MU * r / np.linalg.norm(r) ** 3 for r in (y[:3], y[6:9])]
        return np.concatenate([y[3:6], pulls[0], y[9:], pulls[1]])

    turn, spin = axes(chief)
    other = chief + np.concatenate([turn.T @ state[:3], turn.T @ (state[3:] + np.cross(spin, state[:3]))])
    both = np.concatenate([chief, other])
    found = solve_ivp(
        rates, (times[0], times[-1]), both, method="DOP853", rtol=1e-13, atol=1e-6, t_eval=times
    )
    return np.array([axes(y[:6])[0] @ (y[6:9] - y[:3]) for y in found.y.T])


@pytest.mark.parametrize("e", [0.0, 0.1, 0.6, 0.8])
@pytest.mark.parametrize("share", [0.05, 0.7, 2.3])
def test_transfers_fly_to_their_ends(e, share):
    """The thrust of the path, in the linear equations integrated by DOP853, moves along the path."""
    orbit = eccentric(e)
    path = orbit.transfer(START, END, share * orbit.period, start=777.0)
    times = np.linspace(path.start, path.end, 30)
    truth = flown(orbit, START, times, path.thrust)
    size = np.abs(truth[:, :3]).max()
    assert np.abs(path.position(times) - truth[:, :3]).max() <= 1e-10 * size + 1e-8
    assert np.abs(path.state(path.end) - END).max() <= 1e-11 * size


@pytest.mark.parametrize("e", [0.1, 0.7])
def test_transfers_cost_the_least_energy(e):
    """Half of gap' W^-1 gap, with the controllability Gramian W by quadrature of the integrated flow."""
    orbit, length, begin = eccentric(e), 4000.0, 100.0

    def rates(time, y):
        flow, a = y[:36].reshape(6, 6), linear_matrix(orbit, time)
        gram = y[36:].reshape(6, 6)
        push = np.zeros((6, 6))
        push[3:, 3:] = np.eye(3)
        return np.concatenate([(a @ flow).ravel(), (a @ gram + gram @ a.T + push).ravel()])

    y = solve_ivp(
        rates, (begin, begin + length), np.concatenate([np.eye(6).ravel(), np.zeros(36)]), method="DOP853",
        rtol=1e-13, atol=1e-13,
    ).y[:, -1]  # fmt: skip
    gap = END - y[:36].reshape(6, 6) @ START
    energy = 0.5 * gap @ np.linalg.solve(y[36:].reshape(6, 6), gap)
    assert orbit.transfer(START, END, length, begin).energy == pytest.approx(energy, rel=1e-8)


def test_costs_are_integrals_of_the_thrust():
    orbit = eccentric(0.5)
    path = orbit.transfer(START, END, 1.3 * orbit.period, start=300.0)
    times = np.linspace(path.start, path.end, 40_001)
    size = np.linalg.norm(path.thrust(times), axis=1)
    assert path.delta_v == pytest.approx(np.trapezoid(size, times), rel=1e-6)
    assert path.energy == pytest.approx(0.5 * np.trapezoid(size**2, times), rel=1e-6)
    assert path.peak_thrust == pytest.approx(size.max(), rel=1e-6)
    assert path.peak_thrust >= size.max() * (1.0 - 1e-12)


def test_burns_follow_the_linear_equations():
    orbit, push = eccentric(0.6), np.array([1e-4, -2e-4, 3e-4])
    path = orbit.burn(START, push, 5000.0, start=-700.0)
    times = np.linspace(path.start, path.end, 20)
    truth = flown(orbit, START, times, lambda time: push)
    assert np.abs(path.position(times) - truth[:, :3]).max() <= 1e-7
    assert path.delta_v == pytest.approx(np.linalg.norm(push) * 5000.0, rel=1e-10)


def test_two_impulses_meet_both_ends():
    orbit = eccentric(0.4)
    path = orbit.two_impulse(START, END, 3000.0, start=500.0)
    (first, jump), (last, arrest) = path.impulses
    assert (first, last) == (500.0, 3500.0)
    assert np.allclose(path.state(500.0)[3:] - jump, START[3:], atol=1e-12)
    truth = flown(orbit, np.append(START[:3], START[3:] + jump), np.array([500.0, 3500.0]))[-1]
    assert np.allclose(truth[:3], END[:3], atol=1e-7)
    assert np.allclose(truth[3:] + arrest, END[3:], atol=1e-10)


def test_transitions_compose_and_run_backwards():
    orbit = eccentric(0.6)
    there, back = orbit.transition(5000.0, start=100.0), orbit.transition(-5000.0, start=5100.0)
    assert np.allclose(there @ back, np.eye(6), atol=1e-9)
    halves = orbit.transition([2000.0, 3000.0], start=[100.0, 2100.0])
    assert np.allclose(halves[1] @ halves[0], there, rtol=1e-11, atol=1e-11 * np.abs(there).max())


def test_sampled_paths_pass_through_their_samples():
    orbit = eccentric(0.3)
    times = np.linspace(0.0, 6000.0, 13)
    coast = orbit.coast(np.stack([START, END]), 6000.0)
    path = orbit.sampled(times, coast.state(times))
    assert np.allclose(path.state(times), coast.state(times), atol=1e-9)
    between = np.linspace(0.0, 6000.0, 101)
    assert np.allclose(path.position(between), coast.position(between), atol=1e-7)
    assert path.interpolation_error.max() < 1e-6
    assert np.array_equal(path.cubic_share, [0.0, 0.0])


def test_paths_join_stack_and_index():
    orbit = eccentric(0.3)
    first = orbit.transfer(START, END, 2000.0, start=50.0)
    then = orbit.two_impulse(END, START, 3000.0, start=2050.0)
    whole = cf.join([first, then])
    assert np.allclose(whole.position([100.0, 2500.0]), [first.position(100.0), then.position(2500.0)])
    assert whole.delta_v == pytest.approx(first.delta_v + then.delta_v)
    both = cf.stack([whole, orbit.coast(START, 700.0)])
    assert both.shape == (2,)
    assert np.allclose(both[0].position(2500.0), then.position(2500.0))
    with pytest.raises(ValueError, match="one orbit"):
        cf.stack([whole, eccentric(0.3, anomaly=2.0).coast(START, 100.0)])


def test_batches_broadcast():
    orbit = eccentric(0.2)
    costs = orbit.transfer(np.tile(START, (3, 1, 1)), np.tile(END, (2, 1)), [1000.0, 2000.0]).energy
    assert costs.shape == (3, 2)
    assert np.allclose(costs[:, 1], orbit.transfer(START, END, 2000.0).energy, rtol=1e-12)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"eccentricity": 1.0, "semi_major_axis": 1e7}, "eccentricity: must be from 0 to 0.9, got 1"),
        ({"eccentricity": -0.1, "semi_major_axis": 1e7}, "eccentricity: must be from 0 to 0.9"),
        (
            {"eccentricity": 0.5, "semi_major_axis": 1e7},
            "semi_major_axis: perigee is 1.37814e.06 m below the surface",
        ),
        (
            {"eccentricity": 0.5, "perigee_altitude": -5.0},
            "perigee_altitude: must be finite and above the surface",
        ),
        ({"eccentricity": 0.5}, "semi_major_axis, perigee_altitude: give exactly one"),
        ({"eccentricity": 0.5, "perigee_altitude": 5e5, "mu": 0.0}, "mu: must be positive"),
        ({"eccentricity": np.nan, "perigee_altitude": 5e5}, "eccentricity: "),
        ({"eccentricity": 0.1, "perigee_altitude": 5e5, "true_anomaly": np.inf}, "true_anomaly: "),
    ],
)
def test_impossible_chiefs_are_refused(arguments, words):
    with pytest.raises(ValueError, match=words):
        cf.Orbit.eccentric(**arguments)


def test_what_is_not_supported_is_refused_in_words():
    orbit = eccentric(0.3)
    path, zone = orbit.coast(np.stack([START, END]), 5000.0), cf.Sphere(10.0)
    one, other = path[0], path[1]
    for call in (
        lambda: orbit.impulsive(START, END, 1000.0, thrusters=7),
        lambda: orbit.impulsive(START, END, 101.0 * orbit.period),
        lambda: orbit.transfer(START, END, 1000.0, max_acceleration=1e-3),
        lambda: orbit.burn(START, END[:3], 1000.0, frame="inertial"),
        lambda: orbit.transfer(START, END, 1e-3),
        lambda: orbit.mean_motion,
        lambda: cf.passively_safe(one, other, zone, 5000.0, cf.MissedBurns()),
        lambda: cf.passively_safe(one, other, zone, 5000.0, failing="both"),
        lambda: cf.passively_safe(one, other, zone, np.inf),
        lambda: cf.drift_approach(one, other, zone, np.inf),
        lambda: cf.drift_screen(path, zone, 5000.0),
        lambda: cf.last_possible_conflict(one, other, zone),
        lambda: cf.find_conflicts(one, other, zone, cf.Uncertainty(noise=1e-9)),
        lambda: cf.screen(path, zone, cf.Uncertainty(noise=1e-9)),
        lambda: cf.clearance_in_sigmas(one, other, zone, cf.Uncertainty(noise=1e-9)),
        lambda: cf.clearance_in_sigmas(
            orbit.transfer(START, END, 5000.0), other, zone, cf.Uncertainty(pointing=0.1)
        ),
        lambda: cf.collision_probability(one, other, zone, cf.Uncertainty(noise=1e-9), method="monte-carlo"),
        lambda: cf.least_delta_v(orbit, START, END, 1000.0, 1e-3),
        lambda: cf.delta_v_bound(orbit, START, END, 1000.0),
        lambda: cf.least_time(orbit, START, END, 1e-3),
        lambda: cf.shortest_transfer(orbit, START, END, 1e-3),
        lambda: cf.avoid(one, other, zone, method="sauter-palmer"),
    ):
        with pytest.raises(ValueError, match=r"[Oo]rbit|circular|too short|revolutions"):
            call()


def test_paths_are_drawn_in_the_planes_of_the_orbit():
    path = eccentric(0.3).two_impulse(START, END, 3000.0)
    hill = cf.Orbit.circular(700e3).two_impulse(START, END, 3000.0)
    assert len(cf.plot(path).axes) == len(cf.plot(hill).axes)
