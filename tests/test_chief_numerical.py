"""Chiefs by numerical transition matrices: J2 beside DOP853, and matrices that a user supplies."""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import closeform as cf
from chiefs import transition_mp
from closeform.motion.chief.bernstein import basis_at
from closeform.motion.chief.oblate_or_supplied import frames, gradient, gravity

START = np.array([100.0, -200.0, 50.0, 0.1, -0.2, 0.05])
END = np.array([10.0, 20.0, -30.0, 0.01, 0.0, 0.02])
EARTH_J2 = 1.082635854e-3


@cache
def perturbed(e=0.001, span=20_000.0):
    return cf.Orbit.perturbed(
        e, 1.1, perigee_altitude=600e3, argument_of_perigee=0.4, true_anomaly=0.7, span=span
    )


def pull(orbit, place):
    return gravity(place, orbit.chief.mu, orbit.chief.j2 * orbit.chief.radius**2)


def frames_at(orbit, state):
    return frames(state, orbit.chief.mu, orbit.chief.j2 * orbit.chief.radius**2)


def test_gravity_is_the_gradient_of_the_potential():
    """Beside the potential mu/r (1 - J2 (R/r)^2 (3 s^2 - 1)/2), by central differences."""

    def potential(r):
        q = r @ r
        return 1.0 / np.sqrt(q) * (1.0 - 0.3 / q * (1.5 * r[2] ** 2 / q - 0.5))

    random, h = np.random.default_rng(4), 1e-5
    for place in random.normal(size=(20, 3)) + 1.0:
        slope = [(potential(place + h * d) - potential(place - h * d)) / (2 * h) for d in np.eye(3)]
        assert np.allclose(gravity(place, 1.0, 0.3), slope, rtol=1e-7, atol=1e-7 * np.abs(slope).max())
        rows = [
            (gravity(place + h * d, 1.0, 0.3) - gravity(place - h * d, 1.0, 0.3)) / (2 * h) for d in np.eye(3)
        ]
        assert np.allclose(gradient(place, 1.0, 0.3), rows, atol=1e-7 * np.abs(rows).max())


@pytest.mark.parametrize("e", [0.0, 0.001, 0.2, 0.7])
def test_transitions_are_those_of_the_variational_equations(e):
    orbit = perturbed(e)
    chief, bulge = orbit.chief, orbit.chief.j2 * orbit.chief.radius**2

    def rates(_, y):
        flow = y[6:].reshape(6, 6)
        turned = gradient(y[:3], chief.mu, bulge) @ flow[:3]
        return np.concatenate([y[3:6], pull(orbit, y[:3]), flow[3:].ravel(), turned.ravel()])

    times = np.array([0.0, 3000.0, 17_000.0])
    atol = np.concatenate([[1e-7] * 3, [1e-10] * 3, np.full(36, 1e-12)])
    y0 = np.concatenate([chief.state, np.eye(6).ravel()])
    found = solve_ivp(rates, (0.0, times[-1]), y0, method="DOP853", rtol=1e-13, atol=atol, t_eval=times).y.T
    back = frames_at(orbit, np.array(chief.state))[1]
    unit = np.array([1.0] * 3 + [orbit.chief.osculating.mean_motion] * 3)
    for time, y in zip(times[1:], found[1:], strict=True):
        truth = frames_at(orbit, y[:6])[0] @ y[6:].reshape(6, 6) @ back
        off = (orbit.transition(time) - truth) * unit / unit[:, None]
        assert np.abs(off).max() <= 3e-11 * np.abs(truth * unit / unit[:, None]).max()


def test_errors_of_tables_are_small():
    for e in (0.0, 0.2, 0.7):
        table = perturbed(e).chief.table
        size = np.maximum(1.0, np.abs(table.rows[:, :, :3]).max(axis=(2, 3)))
        assert (table.errors / size).max() <= 1e-11


@pytest.mark.parametrize(("e", "j2"), [(0.001, EARTH_J2), (0.0, 0.02), (0.5, EARTH_J2), (0.7, 0.01)])
def test_errors_bound_the_difference_to_much_shorter_windows(e, j2):
    """Of four windows in one, polynomials of the same degree are good to rounding."""
    chief = cf.Orbit.perturbed(e, 1.1, perigee_altitude=600e3, true_anomaly=2.7, span=6000.0, j2=j2).chief
    clock = chief.osculating.table.clock
    whole = np.array(chief.table.joints)
    parts = np.append((whole[:-1, None] + np.diff(whole)[:, None] * np.arange(4) / 4.0).ravel(), whole[-1])
    fine, table = chief._with(clock, parts), chief.table
    for k in range(0, len(whole) - 1, 3):
        state = np.eye(15)
        for part in range(4):
            for u in (0.2, 0.53, 0.9):
                found = np.einsum("b,jib->ij", basis_at(np.array(0.25 * (part + u))), table.rows[k])[:3]
                truth = np.einsum("b,jib->ij", basis_at(np.array(u)), fine.rows[4 * k + part]) @ state
                off = np.abs(found - truth[:3]).max(axis=0)
                assert (off <= table.errors[k] + 2e-15 * np.abs(truth).max()).all()
            state = fine.steps[4 * k + part] @ state


@pytest.mark.parametrize("e", [0.0, 0.3, 0.7])
def test_a_body_without_j2_stays_within_the_bounds_of_kepler_motion(e):
    """In 60 digits, as for the closed form."""
    orbit = cf.Orbit.perturbed(e, 0.0, perigee_altitude=600e3, span=6000.0, j2=0.0)
    table = orbit.chief.table
    joints = table.joints
    for k in (0, len(joints) // 2):
        for u in (0.03, 0.4, 0.97):
            truth = transition_mp(e, joints[k], joints[k] + u * (joints[k + 1] - joints[k]))
            found = np.einsum("b,jib->ij", basis_at(np.array(u)), table.rows[k, :6])
            assert (np.abs(found - truth)[:3].max(axis=0) <= table.errors[k, :6]).all()


def test_transfers_fly_in_nonlinear_j2_to_first_order():
    """Two spacecraft integrated about the oblate body, one of them with the thrust of the path."""
    orbit, errors = perturbed(), []
    for part in (1.0, 0.5):
        path = orbit.transfer(part * START, part * END, 9000.0, start=0.0)
        state = np.array(orbit.chief.state)
        there, back = frames_at(orbit, state)

        def rates(time, y, path=path):
            turn = frames_at(orbit, y[:6])[1][:3, :3]
            return np.concatenate(
                [y[3:6], pull(orbit, y[:3]), y[9:], pull(orbit, y[6:9]) + turn @ path.thrust(time)]
            )

        y0 = np.concatenate([state, state + back @ (part * START)])
        y = solve_ivp(rates, (0.0, 9000.0), y0, method="DOP853", rtol=1e-12, atol=1e-6).y[:, -1]
        errors.append(np.abs(frames_at(orbit, y[:6])[0] @ (y[6:] - y[:6]) - part * END)[:3].max())
    assert errors[0] < 0.5
    assert 3.0 < errors[0] / errors[1] < 5.0


def test_a_round_body_is_that_of_kepler():
    given = {"eccentricity": 0.3, "perigee_altitude": 600e3, "true_anomaly": 0.7}
    orbit = cf.Orbit.perturbed(inclination=0.5, j2=0.0, span=20_000.0, **given)
    known = cf.Orbit.eccentric(**given)
    times = np.linspace(500.0, 19_000.0, 20)
    mine, theirs = (o.transfer(START, END, 18_500.0, 500.0) for o in (orbit, known))
    assert np.allclose(mine.state(times), theirs.state(times), rtol=0, atol=1e-6)
    assert mine.energy == pytest.approx(theirs.energy, rel=1e-8)


def test_conflicts_beside_an_oblate_body_are_those_of_dense_samples():
    orbit, zone = perturbed(), cf.Ellipsoid([40.0, 80.0, 40.0])
    random = np.random.default_rng(2)
    states = random.normal(size=(20, 6)) * 100.0 * np.array([1, 1, 1, 0.001, 0.001, 0.001])
    states[:, 4] = -2.0 * orbit.chief.osculating.mean_motion * states[:, 0]
    paths = orbit.coast(states, 19_000.0, start=500.0)
    found = cf.screen(paths, zone)
    times = np.linspace(500.0, 19_500.0, 4001)
    places = paths.position(times)
    inside = np.zeros((20, 20, len(times)), dtype=bool)
    around = inside.copy()
    for (i, j), start, end in zip(found.pairs, found.start, found.end, strict=True):
        inside[i, j] |= (times > start + 1e-6) & (times < end - 1e-6)
        around[i, j] |= (times > start - 1e-6) & (times < end + 1e-6)
    assert len(found) > 10
    for i in range(20):
        for j in range(i + 1, 20):
            norms = zone.norm(places[i] - places[j])
            assert (norms[inside[i, j]] <= 1.0 + 1e-9).all()
            assert (norms[~around[i, j]] >= 1.0 - 1e-9).all()


def test_a_supplied_matrix_gives_the_paths_of_its_motion():
    known = cf.Orbit.circular(500e3)
    orbit = cf.Orbit.from_transition(
        lambda start, times: known.transition(times - start), known.period, [-1000.0, 12_000.0]
    )
    for mine, theirs in (
        (orbit.coast(START, 9000.0, -900.0), known.coast(START, 9000.0, -900.0)),
        (orbit.transfer(START, END, 9000.0, -900.0), known.transfer(START, END, 9000.0, -900.0)),
    ):
        times = np.linspace(-900.0, 8100.0, 30)
        assert np.allclose(mine.position(times), theirs.position(times), rtol=0, atol=1e-7)
    assert mine.energy == pytest.approx(theirs.energy, rel=1e-9)


def test_deep_space_is_a_supplied_matrix():
    def straight(start, times):
        out = np.tile(np.eye(6), (len(times), 1, 1))
        out[:, :3, 3:] = (times - start)[:, None, None] * np.eye(3)
        return out

    orbit, known = cf.Orbit.from_transition(straight, 1000.0, [0.0, 3000.0]), cf.Orbit(0.0)
    times = np.linspace(100.0, 2900.0, 9)
    mine, theirs = (o.transfer(START, END, 2800.0, 100.0) for o in (orbit, known))
    assert np.allclose(mine.state(times), theirs.state(times), atol=1e-8)


def test_matrices_that_do_not_fit_are_refused():
    known = cf.Orbit.circular(500e3)

    def decaying(start, times):
        return known.transition(times - start) * np.exp(-1e-5 * (times - start))[:, None, None]

    def noisy(start, times):
        return known.transition(times - start) * (1.0 + 1e-5 * np.sin(1e5 * times))[:, None, None]

    for matrices, words in (
        (decaying, "transition: is not symplectic"),
        (noisy, "transition: is not smooth to its stated error"),
        (lambda start, times: np.eye(6), "transition: must return finite matrices of shape"),
        (lambda start, times: np.full((len(times), 6, 6), np.nan), "transition: must return finite"),
        (7, "transition: expected a function"),
    ):
        with pytest.raises(ValueError, match=words):
            cf.Orbit.from_transition(matrices, known.period, [0.0, 6000.0])
    with pytest.raises(ValueError, match="span: expected two times"):
        cf.Orbit.from_transition(decaying, known.period, [6000.0, 0.0])


def test_times_beyond_the_span_are_refused():
    orbit = perturbed()
    for call in (
        lambda: orbit.coast(START, 100.0, start=-1.0),
        lambda: orbit.coast(START, 20_001.0),
        lambda: orbit.transfer(START, END, 1000.0, start=19_500.0),
        lambda: orbit.transition(20_001.0),
    ):
        with pytest.raises(ValueError, match=r"beyond those of a J2-perturbed chief.* longer span"):
            call()
    assert orbit.coast(START, 20_000.0).end == 20_000.0
    with pytest.raises(ValueError, match="span: must be at most 1000 revolutions"):
        cf.Orbit.perturbed(0.0, 1.0, semi_major_axis=7e6, span=1e8)
