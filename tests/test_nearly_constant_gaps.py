"""Sigma clearance with an almost constant gap: against roots of quadratics, in bounded time."""

from time import process_time

import numpy as np
import pytest

import closeform as cf

ORBIT, DEEP = cf.Orbit.circular(500e3), cf.Orbit(0.0)
N, PERIOD = ORBIT.mean_motion, ORBIT.period
AT_REST = np.zeros(6)
AROUND = np.array([0, 100.0, 0, N * 50, 0, np.sqrt(3) * N * 50])  # a circle at 100 m
SWING = np.array([10.0, 0, 0, 0, -20 * N, 0])
ALONG = np.array([0, 1.0, 0, 0, 0, 0])


def rank_one(*columns):
    return cf.Uncertainty(sum(np.outer(column, column) for column in columns))


# Mean, error column and zone: a fixed number of sigmas of the column touches the zone all the time.
TUBES = {
    "ball": (AROUND, 0.01 * AROUND, cf.Sphere(50.0), 50.0),
    "face": (100 * ALONG + SWING, 5 * ALONG + 0.1 * SWING, cf.Box([50.0, 50, 50]), 10.0),
    "end": (100 * ALONG + SWING, 5 * ALONG + 0.1 * SWING, cf.Cylinder(60.0, 50.0, [0, 1.0, 0]), 10.0),
    "half-space": (100 * ALONG + SWING, 5 * ALONG + 0.1 * SWING, cf.HalfSpaces([[0, 1.0, 0]], [50.0]), 10.0),
}


@pytest.fixture(scope="module", autouse=True)
def compiled():
    """Compile the kernels before anything is timed."""
    path, other = ORBIT.coast(AROUND, 1.0), ORBIT.coast(AT_REST, 1.0)
    cf.clearance_in_sigmas(path, other, cf.Sphere(50.0), rank_one(AROUND))
    cf.find_conflicts(path, other, cf.Sphere(50.0), rank_one(0.01 * AROUND))


@pytest.mark.parametrize("name", TUBES)
def test_tube_that_touches_all_the_time(name):
    """Five orbits within 1e-11 of touching: no conflict, or one of the whole time."""
    mean, column, zone, k = TUBES[name]
    errors = rank_one(column)
    path, other = ORBIT.coast(mean, 5 * PERIOD), ORBIT.coast(AT_REST, 5 * PERIOD)
    found = cf.clearance_in_sigmas(path, other, zone, errors)
    begin = process_time()
    assert cf.clearance_in_sigmas(path, other, zone, errors).sigmas == pytest.approx(k, rel=1e-12)
    for less in (1e-9, 1e-11):
        assert cf.find_conflicts(path, other, zone, errors, sigmas=k * (1 - less)) == ()
        (conflict,) = cf.find_conflicts(path, other, zone, errors, sigmas=k * (1 + less))
        assert (conflict.start, conflict.end) == (0.0, 5 * PERIOD)
    (conflict,) = cf.find_conflicts(path, other, zone, errors, sigmas=found.sigmas)
    assert (conflict.start, conflict.end) == (0.0, 5 * PERIOD)
    assert process_time() - begin < 10.0


@pytest.mark.parametrize("size", [1e-3, 1e-5, 1e-7])
@pytest.mark.parametrize("seed", range(1))
def test_conflicts_of_a_nearly_touching_tube(seed, size):
    """r + xi c meets the sphere where |r + xi c|^2 = R^2."""
    rng = np.random.default_rng(seed)
    mean = AROUND + size * rng.normal(size=6) * [1, 1, 1, N, N, N]
    mean[4] = -2 * N * mean[0]
    column = 0.01 * AROUND + 1e-2 * size * rng.normal(size=6) * [1, 1, 1, N, N, N]
    path, other = ORBIT.coast(mean, PERIOD), ORBIT.coast(AT_REST, PERIOD)
    moved, zone = ORBIT.coast(column, PERIOD), cf.Sphere(50.0)

    def needed(t):
        r, c = path.position(t), moved.position(t)
        a, b = np.sum(c * c, axis=-1), np.sum(r * c, axis=-1)
        return (b - np.sqrt(b * b - a * (np.sum(r * r, axis=-1) - 2500.0))) / a

    times = np.linspace(0.0, PERIOD, 20_001)
    grid = needed(times)
    least = cf.clearance_in_sigmas(path, other, zone, rank_one(column))
    assert least.sigmas == pytest.approx(grid.min(), rel=1e-9)
    for share in (0.02, 0.5):
        k = grid.min() + share * np.ptp(grid)
        below = grid < k
        conflicts = cf.find_conflicts(path, other, zone, rank_one(column), sigmas=k)
        assert 2 * len(conflicts) == np.count_nonzero(np.diff(below)) + below[0] + below[-1]
        inside = np.zeros(len(times), dtype=bool)
        for conflict in conflicts:
            inside |= (times >= conflict.start) & (times <= conflict.end)
            for edge in (conflict.start, conflict.end):
                if 0.0 < edge < PERIOD:
                    assert needed(edge) == pytest.approx(k, abs=3e-10)  # 5e-12 of the ball, 0.02 a sigma
        assert inside[grid < k - 3e-10].all()
        assert not inside[grid > k + 3e-10].any()


def test_tubes_as_thin_as_the_gap():
    """Gaps of 1e-3 to 1e-11 of the sphere, all ten sigmas wide."""
    path, other = ORBIT.coast(AROUND, 3 * PERIOD), ORBIT.coast(AT_REST, 3 * PERIOD)
    begin = process_time()
    for gap in (1e-3, 1e-6, 1e-9, 1e-11):
        zone, errors = cf.Sphere(100.0 * (1.0 - gap)), rank_one(0.1 * gap * AROUND)
        found = cf.clearance_in_sigmas(path, other, zone, errors)
        assert found.sigmas == pytest.approx(10.0, rel=1e-9 + 1e-15 / gap)
    assert process_time() - begin < 10.0


def test_rest_in_deep_space():
    """Nothing moves for thirty years."""
    errors = cf.Uncertainty(np.diag([1.0, 1, 1, 0, 0, 0]))
    path, other = DEEP.coast([100.0, 0, 0, 0, 0, 0], 1e9), DEEP.coast(AT_REST, 1e9)
    assert cf.clearance_in_sigmas(path, other, cf.Sphere(50.0), errors).sigmas == pytest.approx(50.0)
    assert cf.find_conflicts(path, other, cf.Sphere(50.0), errors, sigmas=50.0 * (1 - 1e-11)) == ()
    noisy = cf.Uncertainty(np.diag([1.0, 1, 1, 0, 0, 0]), noise=1e-14)
    path, other = DEEP.coast([100.0, 0, 0, 0, 0, 0], 1e4), DEEP.coast(AT_REST, 1e4)
    most = cf.clearance_in_sigmas(path, other, cf.Sphere(50.0), noisy)
    assert most.sigmas == pytest.approx(50.0 / np.sqrt(1.0 + 1e-14 * 1e12 / 3.0), rel=1e-9)


def test_burn_beside_a_touching_tube():
    """Negligible execution errors change the result by less than 1e-5."""
    path, other = ORBIT.coast(AROUND, PERIOD), ORBIT.burn(AT_REST, [0, 0, 1e-11], PERIOD, 50)
    errors = rank_one(0.01 * AROUND)
    begin = process_time()
    found = cf.clearance_in_sigmas(path, other, cf.Sphere(50.0), errors, cf.Uncertainty(magnitude=0.1))
    assert found.sigmas == pytest.approx(50.0, rel=1e-5)
    assert found.sigmas < 50.0
    conflicts = cf.find_conflicts(
        path, other, cf.Sphere(50.0), errors, cf.Uncertainty(magnitude=0.1), sigmas=found.sigmas * (1 - 1e-9)
    )
    assert conflicts == ()
    assert process_time() - begin < 5.0


def test_line_of_errors_that_misses_a_cylinder():
    """Along-track errors pass the cylinder at a distance: the clearance is infinite."""
    mean = np.array([56.282, 114.489, 70.562, 0.0633574, -0.1245843, -0.1148241])
    path, other = ORBIT.coast(mean, PERIOD), ORBIT.coast(AT_REST, PERIOD)
    zone = cf.Cylinder(50.0, 40.0, [0.1257302, -0.1321049, 0.6404227])
    begin = process_time()
    found = cf.clearance_in_sigmas(path, other, zone, rank_one(1.1525 * ALONG))
    assert found.sigmas == np.inf
    assert process_time() - begin < 15.0
