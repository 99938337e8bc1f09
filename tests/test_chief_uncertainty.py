"""Errors beside chiefs that are not on a circle, against integrated covariances and dense samples."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar

import closeform as cf
from chiefs import linear_matrix
from closeform.uncertainty.covariance_propagation import uncertainty_at_end

KNOWN = np.diag([2.0, 5.0, 2.0, 1e-3, 1e-3, 1e-3]) ** 2
OTHER = np.diag([1.0, 3.0, 1.0, 2e-3, 1e-3, 1e-3]) ** 2
START, END = np.array([150.0, -200.0, 60.0, 0.1, -0.2, 0.05]), np.array([20.0, 90.0, -40.0, 0.01, 0.0, 0.02])


def eccentric(e):
    return cf.Orbit.eccentric(e, perigee_altitude=700e3, true_anomaly=1.0)


@pytest.fixture(scope="module")
def oblate():
    return cf.Orbit.perturbed(0.05, 1.0, perigee_altitude=600e3, span=9000.0)


@pytest.mark.parametrize("e", [0.0, 0.3, 0.8])
def test_covariance_follows_its_equation(e):
    """dP/dt = A P + P A' + q B B', with a jump at each impulse."""
    orbit, q = eccentric(e), 3e-9
    end = 0.7 * orbit.period
    path = orbit.two_impulse(START, END, end, 500.0)
    errors = cf.Uncertainty(KNOWN, impulse=[0.0, 0.02, 0.0, 0.01], noise=q)
    added = np.zeros((6, 6))
    added[3:, 3:] = q * np.eye(3)

    def jump(v):
        ahead = np.outer(v, v) / (v @ v)
        return 0.02**2 * np.outer(v, v) + 0.01**2 * (v @ v) * (np.eye(3) - ahead)

    def rates(time, p):
        moved = linear_matrix(orbit, time) @ p.reshape(6, 6)
        return (moved + moved.T + added).ravel()

    begin = KNOWN.copy()
    (_, first), (_, last) = path.impulses
    begin[3:, 3:] += jump(first)
    truth = (
        solve_ivp(rates, (path.start, path.end), begin.ravel(), method="DOP853", rtol=1e-12, atol=1e-12)
        .y[:, -1]
        .reshape(6, 6)
    )
    truth[3:, 3:] += jump(last)
    sizes = np.sqrt(np.diag(truth))
    found = errors.covariance(path, [path.start, path.end])
    assert (np.abs(found[1] - truth) <= 1e-8 * np.outer(sizes, sizes)).all()
    assert np.allclose(found[0], begin, rtol=1e-12, atol=1e-15)


def test_errors_at_the_end_are_those_of_the_covariance(oblate):
    """With errors of thrust, impulses and noise; carried on, they are those of one longer path."""
    path = cf.join([oblate.transfer(START, END, 4000.0), oblate.impulsive(END, START, 4000.0, 4000.0)])
    errors = cf.Uncertainty(KNOWN, magnitude=0.03, impulse=[0.0, 0.02, 0.0, 0.02], noise=1e-9)
    first = cf.join([oblate.transfer(START, END, 4000.0)])
    then = oblate.impulsive(END, START, 4000.0, 4000.0)
    whole = errors.covariance(path, path.end)
    parts = uncertainty_at_end(errors, first).covariance(then, then.end)
    sizes = np.sqrt(np.diag(whole))
    assert (np.abs(whole - parts) <= 1e-9 * np.outer(sizes, sizes)).all()


def test_noise_about_an_oblate_body(oblate):
    """Of two spans in a row the first is carried by the transition matrix, and the second adds its own."""
    times = [1000.0, 4000.0, 8000.0]
    path, errors = oblate.coast(START, 8500.0), cf.Uncertainty(noise=1e-8)
    late = errors.covariance(oblate.coast(START, 7500.0, 1000.0), times[1:])
    early, *whole = errors.covariance(path, times)
    for total, one, time in zip(whole, late, times[1:], strict=True):
        flow = oblate.transition(time - 1000.0, 1000.0)
        sizes = np.sqrt(np.diag(total))
        assert (np.abs(flow @ early @ flow.T + one - total) <= 1e-9 * np.outer(sizes, sizes)).all()


def sigmas_at(mean, covariance, radius):
    """Return the sigmas at which an ellipsoid touches a ball about the origin, by Lagrange's multiplier."""
    values, vectors = np.linalg.eigh(covariance)
    place = vectors.T @ mean

    def point(force):
        return place / (1.0 + force * values)

    force = brentq(lambda one: np.linalg.norm(point(one)) - radius, 0.0, 1e9, xtol=1e-14, rtol=1e-14)
    return np.sqrt(((place - point(force)) ** 2 / values).sum())


def pairs(oblate):
    for e in (0.1, 0.6, 0.8):
        orbit = eccentric(e)
        end = 0.6 * orbit.period
        yield orbit.transfer(START, END, end, 400.0), orbit.coast(0.3 * END, end, 400.0)
        yield orbit.impulsive(START, END, end, 400.0), orbit.coast(0.2 * START, end, 400.0)
    yield oblate.transfer(START, END, 8000.0, 400.0), oblate.coast(0.3 * END, 8000.0, 400.0)


def test_clearance_in_sigmas_is_the_least_of_dense_samples(oblate):
    errors = cf.Uncertainty(KNOWN, magnitude=0.02, impulse=[0.0, 0.02, 0.0, 0.02]), cf.Uncertainty(OTHER)
    for path, other in pairs(oblate):
        found = cf.clearance_in_sigmas(path, other, cf.Sphere(15.0), *errors)

        def sigmas(time, path=path, other=other):
            spread = errors[0].covariance(path, time) + errors[1].covariance(other, time)
            gap = (path.state(time) - other.state(time))[:3]
            return sigmas_at(gap, spread[:3, :3], 15.0) if np.linalg.norm(gap) > 15.0 else 0.0

        times = np.linspace(path.start, path.end, 250)
        dense = [sigmas(time) for time in times]
        k = int(np.argmin(dense))
        ends = times[max(k - 1, 0)], times[min(k + 1, 249)]
        best = min(dense[k], minimize_scalar(sigmas, bounds=ends, options={"xatol": 1e-4}).fun)
        assert found.sigmas == pytest.approx(best, rel=1e-6, abs=1e-12)
        if best > 0.0:
            assert sigmas(found.time) == pytest.approx(best, rel=1e-6)
            assert cf.find_conflicts(path, other, cf.Sphere(15.0), *errors, 0.9999 * found.sigmas) == ()
        for conflict in cf.find_conflicts(path, other, cf.Sphere(15.0), *errors, 1.3 * found.sigmas + 0.1):
            for edge in {conflict.start, conflict.end} - {path.start, path.end}:
                assert sigmas(edge) == pytest.approx(1.3 * found.sigmas + 0.1, rel=1e-6)
            inside = np.linspace(conflict.start, conflict.end, 7)[1:-1]
            assert all(sigmas(time) < 1.3 * found.sigmas + 0.1 for time in inside)


@pytest.mark.parametrize(
    "zone", [cf.Ellipsoid([20, 40, 15.0]), cf.Box([20, 30, 10.0]), cf.Cylinder(20.0, 25.0)]
)
def test_a_circular_chief_has_the_conflicts_of_hill_equations(zone):
    found = []
    for orbit in (cf.Orbit.circular(500e3), cf.Orbit.eccentric(0.0, perigee_altitude=500e3)):
        path, other = orbit.transfer(START, END, 5000.0), orbit.coast(0.3 * END, 5000.0)
        errors = cf.Uncertainty(KNOWN, magnitude=0.02), cf.Uncertainty(OTHER)
        near = cf.clearance_in_sigmas(path, other, zone, *errors)
        conflicts = cf.find_conflicts(path, other, zone, *errors, 1.5 * near.sigmas + 1.0)
        found.append([near.sigmas, *((c.start, c.end, c.ratio) for c in conflicts)])
        screened = cf.screen(cf.stack([path, other]), zone, errors=errors, sigmas=1.5 * near.sigmas + 1.0)
        assert len(screened) >= len(conflicts)
    assert found[1][0] == pytest.approx(found[0][0], rel=1e-8)
    assert np.allclose(found[1][1:], found[0][1:], rtol=1e-8, atol=1e-5)


def test_probability_agrees_with_random_trajectories():
    """With errors of states, impulses and thrust about e = 0.6, by three methods and by samples on a grid."""
    orbit = eccentric(0.6)
    end = 0.5 * orbit.period
    path = cf.join([orbit.impulsive(START, END, end), orbit.transfer(END, 0.4 * END, end, end)])
    other = orbit.coast(np.zeros(6), 2.0 * end)
    errors = cf.Uncertainty(KNOWN, magnitude=0.03, impulse=[0.0, 0.02, 0.0, 0.02])
    zone = cf.Sphere(25.0)
    exact = cf.collision_probability(path, other, zone, errors)
    drawn = cf.collision_probability(path, other, zone, errors, method="monte-carlo", samples=20_000)
    bound = cf.collision_probability(path, other, zone, errors, method="bound")
    assert 0.01 < exact.value < 0.99
    assert drawn.low < exact.high
    assert drawn.high > exact.low
    assert bound.low <= exact.value <= bound.high


@pytest.mark.parametrize("columns", [1, 2])
def test_one_or_two_errors_are_integrated_exactly(columns):
    """About a circle, the lines through polynomial windows agree with those of Hill's equations."""
    root = np.zeros((6, 6))
    root[:, :columns] = np.array([[3.0, 8.0, 1.0, 2e-3, 1e-3, 0.0], [1.0, -4.0, 3.0, 0.0, 2e-3, 1e-3]]).T[
        :, :columns
    ]
    found = []
    for orbit in (cf.Orbit.circular(500e3), cf.Orbit.eccentric(0.0, perigee_altitude=500e3)):
        path, other = orbit.transfer(START, 0.3 * END, 5000.0), orbit.coast(np.zeros(6), 5000.0)
        one = cf.collision_probability(path, other, cf.Sphere(30.0), cf.Uncertainty(root @ root.T))
        found.append((one.value, one.at_start, one.mean_entries))
    assert found[0][0] > 1e-6
    assert np.allclose(found[1], found[0], rtol=3e-5, atol=1e-15)
