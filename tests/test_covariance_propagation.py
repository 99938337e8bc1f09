"""Propagated uncertainty along a path against integrated equations, simulated errors and Monte Carlo."""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import closeform as cf
from closeform.uncertainty.error_columns import columns_of

N = 1.1e-3
ORBIT, DEEP = cf.Orbit(N), cf.Orbit(0.0)
START = np.array([120.0, -80.0, 45.0, 0.11, -0.27, 0.06])
STATE = np.diag([2.0, 5.0, 3.0, 2e-3, 1e-3, 3e-3]) ** 2
GATES = (1e-3, 0.02, 2e-3, 0.01)
ALL = cf.Uncertainty(STATE, magnitude=0.02, pointing=0.01, impulse=GATES, noise=1e-9)


def hill(n):
    """Return the matrix of Hill's equations."""
    matrix = np.zeros((6, 6))
    matrix[:3, 3:] = np.eye(3)
    matrix[3, 0], matrix[5, 2], matrix[3, 4], matrix[4, 3] = 3 * n * n, -n * n, 2 * n, -2 * n
    return matrix


def flown(orbit=ORBIT):
    """Return a path with burns of all kinds, coasts and impulses."""
    pieces = [orbit.transfer(START, [-60, 150, -20, 0, 0, 0], 1500.0)]
    pieces.append(orbit.coast(pieces[-1].state(1500.0), 500.0, start=1500.0))
    pieces.append(orbit.burn(pieces[-1].state(2000.0), [1e-4, 2e-4, -1e-4], 300.0, start=2000.0))
    pieces.append(
        orbit.burn(pieces[-1].state(2300.0), [-1e-4, 0, 2e-4], 300.0, start=2300.0, frame="inertial")
    )
    kicked = pieces[-1].state(2600.0) + [0, 0, 0, 0.1, -0.2, 0.05]
    pieces.append(orbit.coast(kicked, 400.0, start=2600.0))
    kicked = pieces[-1].state(3000.0) + [0, 0, 0, 0, 0.2, 0]
    pieces.append(orbit.transfer(kicked, START, 2500.0, start=3000.0, max_acceleration=8e-4))
    return cf.join(pieces)


def close(found, expected, tolerance):
    """Compare covariances relative to their standard deviations."""
    sizes = np.sqrt(np.einsum("...ii->...i", expected))
    apart = np.abs(found - expected) / (sizes[..., :, None] * sizes[..., None, :])
    assert apart.max() < tolerance


@pytest.mark.parametrize("orbit", [ORBIT, DEEP], ids=["orbit", "deep space"])
def test_covariance_obeys_its_differential_equation(orbit):
    """P' = A P + P A^T + Q, integrated."""
    path = orbit.coast(START, 12000.0, start=-50.0)
    errors = cf.Uncertainty(STATE, noise=1e-9)
    a, q = hill(orbit.mean_motion), np.diag([0, 0, 0, 1e-9, 1e-9, 1e-9])

    def rate(_, p):
        p = p.reshape(6, 6)
        return (a @ p + p @ a.T + q).ravel()

    times = np.array([-50.0, -49.9, 40.0, 3000.0, 11950.0])
    found = solve_ivp(rate, (-50.0, 11950.0), STATE.ravel(), "DOP853", times, rtol=1e-12, atol=1e-18)
    close(errors.covariance(path, times), found.y.T.reshape(-1, 6, 6), 1e-9)  # of the integrator


@pytest.mark.parametrize("orbit", [ORBIT, DEEP], ids=["orbit", "deep space"])
def test_execution_errors_have_the_covariance(orbit):
    """Integrate each error alone: thrust scaled or rotated, impulses changed."""
    path = flown(orbit)
    burns = [(0.0, 1500.0), (2000.0, 2600.0), (3000.0, 5500.0)]
    pauses = [a[0] for a in path.arcs if not a[12:].any()]
    assert len(pauses) >= 2  # the saturated one may coast in between
    a = hill(orbit.mean_motion)
    on = np.abs(path.arcs[:, 12:]).sum(axis=1) > 0
    edges = np.flatnonzero(np.diff([False, *on, False])).reshape(-1, 2)
    burns = [(path.arcs[i, 0], path.arcs[j - 1, 1]) for i, j in edges]
    times = np.array([700.0, 1500.0, 2450.0, 2600.0, 3100.0, 4400.0, 5500.0])
    total = np.zeros((len(times), 6, 6))

    def added(begin, end, change, jump=(0.0, 0.0, 0.0)):
        """Outer products of what a change of thrust over a burn adds, or a jump at its begin."""
        state, last = np.array([0, 0, 0, *jump], dtype=float), begin
        out = np.zeros((len(times), 6))
        cuts = np.unique([begin, end, *path.arcs[:, 0], *times, path.end])
        for cut in cuts[cuts >= begin]:
            if cut > last:
                inner = np.nextafter(cut, last)

                def rate(t, y, last=last, inner=inner, cut=cut):
                    u = path.thrust(min(max(t, last), inner)) if cut <= end else np.zeros(3)
                    return a @ y + np.concatenate([np.zeros(3), change(u)])

                state = solve_ivp(rate, (last, cut), state, "DOP853", rtol=1e-11, atol=1e-14).y[:, -1]
            out[times == cut] = state
            last = cut
        return np.einsum("ti,tj->tij", out, out)

    for begin, end in burns:
        total += added(begin, end, lambda u: 0.02 * u)
        for axis in np.eye(3):
            total += added(begin, end, lambda u, axis=axis: 0.01 * np.cross(axis, u))
    assert len(path.impulses) == 2
    for time, jump in path.impulses:
        size = np.linalg.norm(jump)
        ahead = jump / size
        s1, s2, s3, s4 = GATES
        along, across = s1**2 + (s2 * size) ** 2, s3**2 + (s4 * size) ** 2
        root = np.linalg.cholesky(across * np.eye(3) + (along - across) * np.outer(ahead, ahead))
        for column in root.T:
            total += added(time, time, lambda u: np.zeros(3), column)
    errors = cf.Uncertainty(magnitude=0.02, pointing=0.01, impulse=GATES)
    close(
        errors.covariance(path, times)[1:], total[1:], 1e-7
    )  # of the integrator at joints of saturated arcs


def test_columns_make_up_the_covariance():
    path = flown()
    quiet = cf.Uncertainty(STATE, magnitude=0.02, pointing=0.01, impulse=GATES)
    columns = columns_of(path, quiet)
    assert columns.orbit == path.orbit
    assert (columns.start == path.start).all()
    assert (columns.end == path.end).all()
    times = np.linspace(path.start, path.end, 57)
    states = columns.state(times)
    close(np.einsum("cti,ctj->tij", states, states), quiet.covariance(path, times), 1e-12)
    # each is one motion, which jumps only at its impulses
    for column in columns:
        for arc, after in zip(column.arcs, column.arcs[1:], strict=False):
            reached = cf.Path(column.orbit, arc[None], np.array([0, 1]), ()).state(arc[1])
            jump = after[6:12] - reached
            np.testing.assert_allclose(jump[:3], 0.0, atol=1e-9)
            np.testing.assert_allclose(jump[3:], after[3:6], atol=1e-12)


def test_zero_errors_have_no_column():
    path = flown()
    assert columns_of(path, cf.Uncertainty(noise=1e-9)).shape == (0,)
    assert columns_of(path, cf.Uncertainty(np.diag([0, 1.0, 0, 0, 0, 0]))).shape == (1,)
    assert columns_of(path, cf.Uncertainty(impulse=(1e-3, 0, 0, 0))).shape == (2,)
    assert columns_of(ORBIT.coast(START, 9.0), cf.Uncertainty(magnitude=0.1, impulse=GATES)).shape == (0,)


def test_pointing_errors_rotate_the_thrust():
    """Monte Carlo with the whole burn rotated and scaled."""
    burn = ORBIT.burn(START, [1e-3, -5e-4, 2e-4], 600.0)
    rng = np.random.default_rng(5)
    angles, factors = 1e-3 * rng.normal(size=(20000, 3)), 1.0 + 2e-3 * rng.normal(size=20000)
    turned = factors[:, None] * (
        np.array([1e-3, -5e-4, 2e-4]) + np.cross(angles, np.array([1e-3, -5e-4, 2e-4]))
    )
    ends = ORBIT.burn(START, turned, 600.0).state(600.0)
    expected = cf.Uncertainty(magnitude=2e-3, pointing=1e-3).covariance(burn, 600.0)
    close(np.cov(ends.T), expected, 0.05)  # of 20000 samples, and 5 sigmas


def test_precise_direction_keeps_its_digits():
    """1 km along track with its drift, 1 cm else: compare with exact products after 20 orbits."""
    import mpmath as mp

    path = ORBIT.coast(START, 20 * ORBIT.period)
    errors = cf.Uncertainty(np.diag([1e-2, 1e3, 1e-2, 1e-6, 1e-5, 1e-6]) ** 2)
    found = errors.covariance(path, path.end)
    with mp.workdps(40):
        flow = mp.expm(mp.matrix(hill(N).tolist()) * mp.mpf(path.end))
        exact = flow * mp.matrix(errors.state.tolist()) * flow.T
        exact = np.array(exact.tolist(), dtype=float)
    close(found, exact, 1e-11)


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(0, 6), st.floats(-3.0, 3.0))
def test_covariances_of_any_rank_and_units_are_kept(seed, rank, scale):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(6, rank)) * 10.0 ** np.array([scale] * 3 + [scale - 3.0] * 3)[:, None]
    state = root @ root.T
    path = ORBIT.coast(START, 100.0)
    found = cf.Uncertainty(state).covariance(path, 0.0)
    np.testing.assert_allclose(found, state, atol=1e-12 * max(state.max(), 1e-300), rtol=1e-9)


def test_covariance_of_a_message_agrees_with_samples():
    """Inertial states are sampled in RTN of the second object and transformed exactly."""
    r = 7000e3
    v = np.sqrt(cf.elements.EARTH_MU / r)
    orbit = cf.Orbit.from_semi_major_axis(r)
    chief = np.array([r * 0.6, r * 0.8, 0, -0.8 * v, 0.6 * v, 0])
    deputy = np.array(
        [-0.2 * r, r * 0.97, 0.1 * r, 0.3 * v, 0.1 * v, 0.94 * v]
    )  # its axes are not the chief's
    axes = np.stack([deputy[:3] / np.linalg.norm(deputy[:3]), np.zeros(3), np.cross(deputy[:3], deputy[3:])])
    axes[2] /= np.linalg.norm(axes[2])
    axes[1] = np.cross(axes[2], axes[0])
    message = np.diag([20.0, 300.0, 10.0, 0.3, 0.02, 0.01]) ** 2
    message[0, 4] = message[4, 0] = -0.9 * 20.0 * 0.02
    rng = np.random.default_rng(3)
    drawn = rng.multivariate_normal(np.zeros(6), message, 100_000)
    inertial = np.concatenate([drawn[:, :3] @ axes, drawn[:, 3:] @ axes], axis=1)
    states = cf.elements.relative_from_inertial(chief, chief + inertial)
    path = orbit.coast(np.array([50.0, 0, 0, 0, 0, 0]), 900.0, start=100.0)
    errors = cf.Uncertainty.from_rtn(message, path, 700.0, chief, craft=deputy)
    close(errors.covariance(path, 700.0), np.cov(states.T), 0.02)  # of 100 000 samples
    same = cf.Uncertainty.from_inertial(
        np.kron(np.eye(2), axes).T @ message @ np.kron(np.eye(2), axes), path, 700.0, chief
    )
    close(same.covariance(path, 123.0), errors.covariance(path, 123.0), 1e-9)
    early = cf.Uncertainty.from_rtn(message, path, -5000.0, chief, magnitude=0.1)  # an epoch before the path
    back = orbit.transition(5100.0)
    frame = cf.Uncertainty.from_rtn(
        message, orbit.coast(np.zeros(6), 9.0, start=-5000.0), -5000.0, chief
    ).state
    close(early.state, back @ frame @ back.T, 1e-9)
    assert early.magnitude == 0.1


def test_mixed_units_are_warned_of():
    path = ORBIT.coast(START, 100.0)
    mixed = cf.Uncertainty(np.diag([0.01, 0.01, 0.01, 0.1, 0.1, 0.1]) ** 2)  # km and m/s
    with pytest.warns(UserWarning, match="are units mixed, km with m/s"):
        mixed.covariance(path, 50.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        cf.Uncertainty(np.diag([0, 0, 0, 0.1, 0.1, 0.1]) ** 2).covariance(
            path, 50.0
        )  # known places, lost velocities
        ALL.covariance(path, 50.0)


def test_nearly_singular_covariance_is_accepted(recwarn):
    """A ratio of any size is accepted, but not one of a thousand."""
    path, other = (ORBIT.coast([0.0, y, 0.0, 0.0, 0.0, 0.0], 1000.0) for y in (-200.0, 200.0))
    n = path.orbit.mean_motion
    thin = np.array([1e-3, 1e-7, 1e-3, 3e3 * n * 1e-3, 3e3 * n * 1e-3, 1e-9])
    exact = np.array([1e-9, 1e-9, 1e-9, 1e-3, 1e-3, 1e-3])
    for sigmas in (thin, exact):
        cf.find_conflicts(path, other, cf.Sphere(10.0), errors=cf.Uncertainty(np.diag(sigmas**2)), sigmas=3.0)
    assert not recwarn.list
