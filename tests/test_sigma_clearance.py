"""Sigma clearance for zones of all shapes against a convex solver on dense grids and sampled errors."""

import clarabel
import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize, minimize_scalar
from scipy.sparse import csc_matrix

import closeform as cf
from closeform.conflicts.two_paths import craft_of
from closeform.uncertainty.error_columns import columns_of
from closeform.zones.shapes import BALL

ORBIT, DEEP = cf.Orbit.circular(500e3), cf.Orbit(0.0)
N, PERIOD = ORBIT.mean_motion, ORBIT.period
AT_REST = np.zeros(6)
ZONES = {
    "sphere": cf.Sphere(15.0),
    "ellipsoid": cf.Ellipsoid([10.0, 25.0, 15.0], axes=[[0.6, 0.8, 0], [-0.8, 0.6, 0], [0, 0, 1]]),
    "box": cf.Box([15.0, 30.0, 15.0]),
    "cylinder": cf.Cylinder(15.0, 30.0, [1.0, 1.0, 0.0]),
    "half-spaces": cf.HalfSpaces([[0, 1, 0], [1, 1, 0], [0, -1, 0.2], [-1, 0, -1]], [15.0, 30.0, 20.0, 25.0]),
}


SHAPES = {name: zone.shape for name, zone in ZONES.items()}


def deviations(places, speeds):
    return np.diag([*places, *speeds]) ** 2


OF_SPEEDS = np.array(  # three errors that make most of their way later, m and m/s
    [
        [0.36, 4.1, -0.65],
        [-0.79, 0.55, 7.3],
        [-2.2, 0.49, -2.7],
        [4.7e-4, -2.3e-3, -1.8e-3],
        [-5.1e-5, -9.8e-4, -6.6e-4],
        [-2.1e-3, -1.2e-3, 1.2e-3],
    ]
)
CASES = {  # mean state, errors, duration
    "V-bar": ([0, 200, 0, 0, 0, 0], deviations([2, 5, 2], [1e-3, 1.5e-3, 2e-3]), 2 * PERIOD),
    "ellipse": ([60, 0, 0, 0, -2 * N * 60, N * 60], deviations([3, 6, 3], [3e-3] * 3), 2 * PERIOD),
    "walking": ([50, 400, 0, 0, -2 * N * 50 - 2 * N, N * 50], deviations([2, 6, 2], [2e-3] * 3), 5 * PERIOD),
    "flat": (
        [40, 90, 0, 0.01, 0, 0.02],
        deviations([1, 3, 0], [1e-3, 1e-3, 0]),
        PERIOD,
    ),  # no cross-track error
    "other minima": (
        [70.7, -240, 17.2, 0.0618, -0.134, 0.0374],
        OF_SPEEDS @ OF_SPEEDS.T,
        6100.0,
    ),  # near a local minimum
    "a line": ([60, 60, 30, -0.02, 0, 0], deviations([0, 2, 0], [0, 0, 0]), PERIOD),  # rank one
}


def sigmas_at(zone, mean, covariance):
    """Return the least sigmas from the mean into the zone, by a cone program."""
    values, vectors = np.linalg.eigh(covariance)
    kept = values > 1e-12 * values[-1]
    return sigmas_of(zone, mean, vectors[:, kept] * np.sqrt(values[kept]))


def sigmas_of(zone, mean, root):
    """Return the same from a root (3, K) of the covariance, which keeps more digits."""
    if zone.norm(mean) <= 1.0:
        return 0.0
    left, sizes, _ = np.linalg.svd(zone.matrix @ root, full_matrices=False)
    if not sizes.any():
        return np.inf
    kept = sizes > 0.0
    sizes, count = sizes[kept], int(kept.sum())
    q, moved = zone.matrix @ mean, left[:, kept]  # along which sizes x xi
    least = sizes.max()  # t and xi are counted in 1 / least
    rows = [np.diag([*(least / sizes), 1.0])[[count, *range(count)]]]  # (t, xi) in a second-order cone
    ends, cones = [np.zeros(count + 1)], [clarabel.SecondOrderConeT(count + 1)]
    flat = zone.faces if len(zone.faces) else np.concatenate([np.eye(3), -np.eye(3)])
    leading = {SHAPES["sphere"]: 3, SHAPES["cylinder"]: 2}.get(zone.shape, 0)
    if leading:
        rows.append(np.pad(moved[:leading], ((1, 0), (0, 1))))  # (1, q + moved xi) in another
        ends.append(np.concatenate([[1.0], q[:leading]]))
        cones.append(clarabel.SecondOrderConeT(leading + 1))
        flat = np.array([[0, 0, 1.0], [0, 0, -1.0]]) if leading == 2 else np.empty((0, 3))
    if len(flat):
        rows.append(np.pad(-flat @ moved, ((0, 0), (0, 1))))
        ends.append(1.0 - flat @ q)
        cones.append(clarabel.NonnegativeConeT(len(flat)))
    options = clarabel.DefaultSettings()
    options.verbose = False
    options.tol_gap_abs = options.tol_gap_rel = options.tol_feas = 1e-11
    cost = np.zeros(count + 1)
    cost[count] = 1.0
    solver = clarabel.DefaultSolver(
        csc_matrix((count + 1, count + 1)),
        cost,
        csc_matrix(-np.concatenate(rows)),
        np.concatenate(ends),
        cones,
        options,
    )
    solution = solver.solve()
    solved = str(solution.status) in ("Solved", "AlmostSolved")
    return float(solution.x[count]) / least if solved else np.inf


@pytest.mark.parametrize(
    ("case", "shape"),
    [
        pytest.param(case, shape, marks=[pytest.mark.slow] * ((i + k) % 3 > 0))
        for i, case in enumerate(CASES)
        for k, shape in enumerate(ZONES)
    ],
)
def test_clearance_agrees_with_a_dense_grid(case, shape):
    """Solve a cone program at each time and refine around the least one."""
    mean, covariance, duration = CASES[case]
    zone, errors = ZONES[shape], cf.Uncertainty(covariance)
    path, other = ORBIT.coast(mean, duration), ORBIT.coast(AT_REST, duration)
    found = cf.clearance_in_sigmas(path, other, zone, errors)
    if cf.closest_approach(path, other, zone).ratio <= 1.0:
        assert found.sigmas == 0.0
        return

    def at(t):
        return sigmas_at(zone, path.position(t), errors.covariance(path, t)[:3, :3])

    times = np.linspace(0.0, duration, 121)
    grid = np.array([at(t) for t in times])
    if not np.isfinite(grid).any():
        assert found.sigmas > 100.0  # beyond the range of the solver
        return
    k = int(grid.argmin())
    around = times[max(k - 1, 0)], times[min(k + 1, 120)]
    least = min(grid[k], minimize_scalar(at, bounds=around, method="bounded", options={"xatol": 1e-2}).fun)
    assert found.sigmas == pytest.approx(least, rel=1e-6)  # of the solver
    assert at(found.time) == pytest.approx(found.sigmas, rel=1e-6)
    assert cf.find_conflicts(path, other, zone, errors, sigmas=found.sigmas * (1 - 1e-8)) == ()
    (conflict, *_) = cf.find_conflicts(path, other, zone, errors, sigmas=found.sigmas * (1 + 1e-7))
    assert conflict.start <= found.time + 1.0
    assert conflict.ratio == pytest.approx(1.0, abs=1e-6)


def flown(orbit, seed):
    """Return a path with an optimal arc and an impulse, and another with constant thrust."""
    rng = np.random.default_rng(seed)
    ends = rng.normal(size=(2, 6)) * [80, 80, 80, 0.05, 0.05, 0.05]
    path = orbit.transfer(ends[0], ends[1], 1500.0)
    kicked = path.state(1500.0) + [0, 0, 0, *rng.normal(size=3) * 0.1]
    path = cf.join([path, orbit.coast(kicked, 1500.0, start=1500.0)])
    other = orbit.burn(
        rng.normal(size=6) * [30, 30, 30, 0.03, 0.03, 0.03], rng.normal(size=3) * 1e-5, 2800.0, 100
    )
    return path, other


def least_on_a_grid(path, zone, errors, duration, count):
    """Return the least sigmas by the solver at many times, refined."""

    def at(t):
        return sigmas_at(zone, path.position(t), errors.covariance(path, t)[:3, :3])

    times = np.linspace(0.0, duration, count)
    grid = np.array([at(t) for t in times])
    k = int(grid.argmin())
    around = times[max(k - 1, 0)], times[min(k + 1, count - 1)]
    return min(grid[k], minimize_scalar(at, bounds=around, method="bounded", options={"xatol": 1e-3}).fun)


@pytest.mark.parametrize("small", [1e-3, 0.1])
def test_errors_that_shrink_and_grow_again(small):
    """An error of 1 m and -1 cm/s vanishes after 100 s and enters the zone later."""
    line = np.array([1.0, 0, 0, -0.01, 0, 0])
    errors = cf.Uncertainty(np.outer(line, line) + small**2 * np.diag([1.0, 1, 1, 0, 0, 0]))
    mean, zone = [10.0, 0, 0, 0, 1 / 290.0, 0], cf.Sphere(1.0)
    path, other = DEEP.coast(mean, 800.0), DEEP.coast(AT_REST, 800.0)
    found = cf.clearance_in_sigmas(path, other, zone, errors)
    assert found.sigmas == pytest.approx(least_on_a_grid(path, zone, errors, 800.0, 161), rel=1e-6)
    assert found.sigmas < 5.3
    assert cf.find_conflicts(path, other, zone, errors, sigmas=found.sigmas * (1 - 1e-8)) == ()
    (conflict,) = cf.find_conflicts(path, other, zone, errors, sigmas=1.01 * found.sigmas)
    assert conflict.start < found.time < conflict.end


@pytest.mark.parametrize("small", [1e-6, *(pytest.param(s, marks=pytest.mark.slow) for s in (0.0, 1e-3))])
def test_rotating_plane_of_errors_beside_a_cylinder(small):
    """The errors miss for most of two orbits; the minimum is at 0.92 of them."""
    mean = [-81.0719002, 19.1795746, 8.02081799, -0.0582327099, 0.179458074, 0.0987088286]
    across = np.array([0, 0, 0.161844858, 0, 0, 0])
    drifts = np.array([1.12422894e-2, 1.99177631e-3, 3.78774006e-3, 5.29472696e-6, -1.39886915e-5, 1.8766e-7])
    covariance = np.outer(across, across) + np.outer(drifts, drifts)
    errors = cf.Uncertainty(covariance + small**2 * np.diag([1, 1, 1, N * N, N * N, N * N]))
    zone = cf.Cylinder(5.0, 4.0, [0.59409685, 0.78443622, -0.17806952])
    path, other = ORBIT.coast(mean, 2 * PERIOD), ORBIT.coast(AT_REST, 2 * PERIOD)
    found = cf.clearance_in_sigmas(path, other, zone, errors)
    least = least_on_a_grid(path, zone, errors, 2 * PERIOD, 801)
    assert least < 740.0
    assert found.sigmas == pytest.approx(least, rel=1e-5)  # of the solver, in a plane


THIN = {  # mean state, columns, orbits, and of a cylinder the radius and axis
    "a plane": (
        [-52.41554366, 76.97935431, 116.0082418, 0.04259973753, 0.1160253121, -0.1832197947],
        [
            [
                -0.02023273665,
                -0.01175150192,
                -0.001959423566,
                -1.100032661e-6,
                2.213063429e-5,
                -1.73995717e-5,
            ],
            [0.2006449055, 0.006086257312, 0.1328947681, 2.665863901e-5, -4.441409200e-4, -1.405155479e-4],
        ],
        0.5,
        (20.0, [-1.579089937, -0.954749322, -0.240218704]),
    ),
    "along and across the track": (
        [129.3820966, -29.25952855, 81.8877243, -0.01619198092, -0.2863959255, -0.08825631684],
        [[0, 0, 0.027671926, 0, 0, 0], [0, 0.653740742, 0, 0, 0, 0]],
        20.0,
        (20.0, [0.158720294, 1.252317538, -0.416926098]),
    ),
    "a line": (
        [-48.81907840, 252.3868558, -174.2011137, -1.783839236e-4, 0.1080642957, 0.03425048937],
        [
            [9.598846937e-4, -9.919009870e-3, 6.882593577e-3, 3.692496570e-6, 8.074302185e-6, 1.385881540e-5],
        ],
        20.0,
        (5.0, [-0.191265139, -1.352659806, 2.524199653]),
    ),
}


@pytest.mark.parametrize("case", THIN)
def test_thin_errors_beside_a_cylinder(case):
    """Newton iterations do not find these minima; compare with the solver."""
    mean, columns, orbits, (radius, axis) = THIN[case]
    zone, columns = cf.Cylinder(radius, 0.8 * radius, axis), np.array(columns)
    errors = cf.Uncertainty(columns.T @ columns)
    path, other = ORBIT.coast(mean, orbits * PERIOD), ORBIT.coast(AT_REST, orbits * PERIOD)
    moved = ORBIT.coast(errors._root.T, orbits * PERIOD)

    def at(t):
        return sigmas_of(zone, path.position(t), moved.position(t).T)

    found = cf.clearance_in_sigmas(path, other, zone, errors)
    assert at(found.time) == pytest.approx(found.sigmas, rel=1e-7)  # of the solver
    assert found.sigmas <= min(map(at, np.linspace(0.0, orbits * PERIOD, 101))) * (1 + 1e-7)


def test_minimum_before_a_local_maximum():
    """The minimum is 10 s before the first candidate of the search."""
    mean = [106.09, 342.831, 68.1382, 0.18972, -0.234837, 0.0214256]
    columns = np.array(
        [
            [0, 0, 0.601492, 0, 0, 0],
            [1.8675, 0.0658836, -1.19602, 7.48588e-4, -1.19477e-4, 8.54015e-4],
            [0.83339, -1.52684, -1.18605, -8.44943e-4, -1.84476e-3, -1.93981e-3],
        ]
    )
    errors, zone, duration = cf.Uncertainty(columns.T @ columns), cf.Box([20.0, 14.0, 10.0]), 0.5 * PERIOD
    path, other = ORBIT.coast(mean, duration), ORBIT.coast(AT_REST, duration)
    found = cf.clearance_in_sigmas(path, other, zone, errors)
    moved = ORBIT.coast(errors._root.T, duration)
    least = minimize_scalar(
        lambda t: sigmas_of(zone, path.position(t), moved.position(t).T),
        bounds=(1345.0, 1365.0),
        method="bounded",
    )
    assert found.time == pytest.approx(least.x, abs=0.1)
    assert found.sigmas == pytest.approx(least.fun, rel=1e-8)  # of the solver


def exact_sigmas_of(zone, mean, root):
    """Return the sigmas for a sphere or ellipsoid with 60 digits.

    The least |x| with |q + A x| = 1 has q + A x = m (A A^T + m)^-1 q, and m is bisected.
    """
    with mpmath.workdps(60):
        q, a = mpmath.matrix((zone.matrix @ mean).tolist()), mpmath.matrix((zone.matrix @ root).tolist())
        sizes, axes = mpmath.eigsy(a * a.T)
        sizes, parts = [max(size, 0) for size in sizes], axes.T * q

        def beyond(m):
            return sum((m * part / (size + m)) ** 2 for part, size in zip(parts, sizes, strict=True)) - 1

        if beyond(mpmath.exp(-200)) > 0 or zone.norm(mean) <= 1.0:
            return 0.0 if zone.norm(mean) <= 1.0 else np.inf
        low, high = mpmath.mpf(-200), mpmath.mpf(200)
        for _ in range(120):
            middle = (low + high) / 2
            low, high = (low, middle) if beyond(mpmath.exp(middle)) > 0 else (middle, high)
        m = mpmath.exp(low)
        squares = (size * (part / (size + m)) ** 2 for part, size in zip(parts, sizes, strict=True))
        return float(mpmath.sqrt(sum(squares)))


@pytest.mark.parametrize("shape", ZONES)
def test_thin_errors_at_rest(shape):
    """Errors on a line or plane, larger or smaller than the zone; a miss has infinite clearance."""
    zone, random = ZONES[shape], np.random.default_rng(11)
    other, reached, missed = DEEP.coast(AT_REST, 1.0), 0, 0
    for _ in range(30):
        rank, tiny = int(random.integers(1, 4)), float(random.choice([0.0, 1e-7, 1e-3]))
        mean = random.normal(size=3) * 40.0
        root = random.normal(size=(3, rank)) * 10.0 ** random.uniform(-2.0, 3.0, rank)
        if random.random() < 0.5:  # a line that barely misses the boundary or enters
            goal = random.normal(size=3)
            goal *= (1.0 + random.choice([-1e-3, 1e-3, 0.1])) / zone.norm(goal)
            root[:, 0] = (goal - mean) * 10.0 ** random.uniform(-3.0, 1.0)
        root = np.concatenate([root, tiny * np.eye(3)], axis=1)
        covariance = np.zeros((6, 6))
        covariance[:3, :3] = root @ root.T
        errors = cf.Uncertainty(covariance)
        found = cf.clearance_in_sigmas(DEEP.coast([*mean, 0, 0, 0], 1.0), other, zone, errors).sigmas
        least = (exact_sigmas_of if zone.shape == BALL else sigmas_of)(zone, mean, errors._root[:3])
        if least < 9e3:
            assert found == pytest.approx(least, rel=1e-8)
            reached += found > 0.0
        elif least > 1.1e4:
            assert found == np.inf
            missed += 1
    assert reached > 7
    assert missed > 1


@pytest.mark.parametrize(
    ("orbit", "noise", "shape"),
    [(ORBIT, 1e-7, "cylinder"), (DEEP, 0.0, "box"), (ORBIT, 1e-7, "half-spaces"), (ORBIT, 1e-7, "sphere")],
)
def test_thrusting_spacecraft_with_all_errors(shape, orbit, noise):
    """Execution errors of both and noise, against covariances on a grid of times."""
    zone = ZONES[shape].enlarged(0.3)
    errors = cf.Uncertainty(
        deviations([2, 3, 1], [2e-3, 1e-3, 1e-3]), 0.05, 0.03, (1e-3, 0.03, 2e-3, 0.02), noise
    )
    others = cf.Uncertainty(deviations([1, 1, 1], [1e-3] * 3), magnitude=0.1, noise=0.5 * noise)
    for seed in range(2):
        path, other = flown(orbit, seed)
        found = cf.clearance_in_sigmas(path, other, zone, errors, others)
        if found.sigmas == 0.0:
            assert cf.closest_approach(path, other, zone).ratio <= 1.0
            continue

        def at(t, path=path, other=other):
            spread = errors.covariance(path, t) + others.covariance(other, t)
            return sigmas_at(zone, path.position(t) - other.position(t), spread[:3, :3])

        times = np.sort([*np.linspace(100.0, 2900.0, 29), 1500.0 - 1e-6])
        grid = [at(t) for t in times]
        assert found.sigmas <= min(grid) * (1 + 1e-6)
        assert at(found.time) == pytest.approx(found.sigmas, rel=1e-6)


def test_no_sampled_error_within_the_clearance_enters():
    """Errors on the sphere |xi| = k, searched one by one."""
    rng = np.random.default_rng(2)
    mean, covariance, duration = CASES["ellipse"]
    path, other = ORBIT.coast(mean, duration), ORBIT.coast(AT_REST, duration)
    errors = cf.Uncertainty(covariance)
    columns = columns_of(path, errors)
    for zone in ZONES.values():
        k = cf.clearance_in_sigmas(path, other, zone, errors)
        if k.sigmas == 0.0:
            continue
        states = columns.state(0.0)
        xi = rng.normal(size=(500, len(states)))
        xi *= (k.sigmas * (1 - 1e-6) / np.linalg.norm(xi, axis=1))[:, None]
        drawn = ORBIT.coast(np.array(mean) + xi @ states, duration)
        assert (cf.closest_approach(drawn, other, zone).ratio > 1.0).all()


def test_error_just_beyond_the_clearance_enters():
    """Scale the most likely error into a sphere by 1 +- 1e-6."""
    mean, covariance, duration = CASES["walking"]
    path, other = ORBIT.coast(mean, duration), ORBIT.coast(AT_REST, duration)
    errors, zone = cf.Uncertainty(covariance), ZONES["sphere"]
    found = cf.clearance_in_sigmas(path, other, zone, errors)
    columns = columns_of(path, errors)
    places, r = columns.position(found.time), path.position(found.time)
    inverse = np.linalg.inv(places.T @ places)

    def length(direction):  # xi of a point of the sphere
        point = 15.0 * direction / np.linalg.norm(direction)
        return float(np.sqrt((point - r) @ inverse @ (point - r)))

    direction = minimize(length, r, method="Nelder-Mead", options={"xatol": 1e-12, "fatol": 1e-14}).x
    xi = places @ inverse @ (15.0 * direction / np.linalg.norm(direction) - r)
    assert np.linalg.norm(xi) == pytest.approx(found.sigmas, rel=1e-8)
    for factor, enters in ((1 - 1e-6, False), (1 + 1e-6, True)):
        flown = ORBIT.coast(np.array(mean) + factor * xi @ columns.state(0.0), duration)
        assert (cf.closest_approach(flown, other, zone).ratio <= 1.0) == enters


@pytest.mark.parametrize("shape", ZONES)
def test_conflicts_start_and_end_at_the_requested_sigmas(shape):
    """Compare with the solver at the ends, within and between conflicts."""
    mean, covariance, duration = CASES["walking"]
    zone, errors = ZONES[shape], cf.Uncertainty(covariance)
    path, other = ORBIT.coast(mean, duration), ORBIT.coast(AT_REST, duration)
    k = 1.3 * cf.clearance_in_sigmas(path, other, zone, errors).sigmas
    conflicts = cf.find_conflicts(path, other, zone, errors=errors, sigmas=k)
    assert conflicts

    def at(t):
        return sigmas_at(zone, path.position(t), errors.covariance(path, t)[:3, :3])

    for conflict in conflicts:
        for edge in (conflict.start, conflict.end):
            if 0.0 < edge < duration:
                assert at(edge) == pytest.approx(k, rel=1e-5)  # of planes at rims beside long ellipsoids
        assert 0.0 <= conflict.ratio < 1.0
        assert at(conflict.time) < k
    for t in np.linspace(1.0, duration - 1.0, 41):
        inside = any(conflict.start < t < conflict.end for conflict in conflicts)
        assert (at(t) < k) == inside


def test_clearance_ratio_of_two_spheres():
    """The ratio is |r| / (R + k sigma)."""
    errors = cf.Uncertainty(np.diag([4.0, 4.0, 4.0, 0, 0, 0]))
    path, other = DEEP.coast([-100, 12.0, 0, 1.0, 0, 0], 200.0), DEEP.coast(AT_REST, 200.0)
    (conflict,) = cf.find_conflicts(path, other, cf.Sphere(9.0), errors, sigmas=3.0)
    assert conflict.ratio == pytest.approx(12.0 / 15.0, rel=1e-9)
    assert conflict.time == pytest.approx(100.0, abs=1e-4)
    assert conflict.end - conflict.start == pytest.approx(2 * 9.0, rel=1e-9)
    assert cf.clearance_in_sigmas(path, other, cf.Sphere(9.0), errors).sigmas == pytest.approx(1.5, rel=1e-9)


def test_zero_sigmas_or_errors_give_the_plain_search():
    path, other = flown(ORBIT, 5)
    zone = cf.Box([150.0, 120.0, 100.0])
    plain = cf.find_conflicts(path, other, zone)
    assert plain
    for errors in (cf.Uncertainty(), cf.Uncertainty(deviations([1, 1, 1], [1e-3] * 3))):
        k = 3.0 if not errors.state.any() else 0.0
        same = cf.find_conflicts(path, other, zone, errors, sigmas=k)
        assert len(same) == len(plain)
        for one, two in zip(same, plain, strict=True):
            np.testing.assert_allclose([one.start, one.end], [two.start, two.end], atol=1e-6)
            assert one.ratio == pytest.approx(two.ratio, rel=1e-8)


def test_infinite_and_zero_clearance():
    path, other = ORBIT.coast([0, 200, 0, 0, 0, 0], PERIOD), ORBIT.coast(AT_REST, PERIOD)
    zone = cf.Sphere(15.0)
    nothing = cf.clearance_in_sigmas(path, other, zone, cf.Uncertainty())
    assert nothing.sigmas == np.inf
    assert np.isnan(nothing.time)
    across = cf.Uncertainty(np.diag([0, 0, 1.0, 0, 0, 1e-6]))  # has no along-track effect
    assert cf.clearance_in_sigmas(path, other, zone, across).sigmas == np.inf
    later = ORBIT.coast([0, 200, 0, 0, 0, 0], PERIOD, start=2 * PERIOD)
    apart = cf.clearance_in_sigmas(later, other, zone, cf.Uncertainty(np.eye(6)))
    assert apart.sigmas == np.inf
    inside = cf.clearance_in_sigmas(
        ORBIT.coast([0, 9, 0, 0, 0, 0], PERIOD), other, zone, cf.Uncertainty(np.eye(6) * 1e-6)
    )
    assert inside.sigmas == 0.0


def test_broadcasting_with_individual_errors():
    others = ORBIT.coast([[0, 0, 0, 0, 0, 0], [0, 500, 0, 0, 0, 0]], PERIOD)
    paths = ORBIT.coast([[0, 200, 0, 0, 0, 0], [0, -90, 0, 0, 0, 0], [30, 5, 0, 0, 0, 0]], PERIOD)
    errors = [cf.Uncertainty(deviations([1, s, 1], [1e-3] * 3)) for s in (1.0, 4.0, 9.0)]
    zone = cf.Sphere(15.0)
    both = cf.clearance_in_sigmas(paths[:, None], others, zone, errors, [errors[0], None])
    assert both.sigmas.shape == both.time.shape == (3, 2)
    for i, j in np.ndindex(3, 2):
        one = cf.clearance_in_sigmas(paths[i], others[j], zone, errors[i], errors[0] if j == 0 else None)
        assert one.sigmas == both.sigmas[i, j]
    assert craft_of(others, (3, 2)).tolist() == [0, 1] * 3


turns = st.floats(0.05, 3.0)


@settings(max_examples=12)
@given(st.integers(0, 10**6), turns, st.sampled_from(sorted(ZONES)), st.floats(0.1, 10.0))
def test_monotonicity_and_units(seed, share, shape, scale):
    rng = np.random.default_rng(seed)
    mean = rng.normal(size=6) * [60, 200, 60, 0.05, 0.05, 0.05]
    root = rng.normal(size=(6, 6)) * np.array([2, 4, 2, 2e-3, 2e-3, 2e-3])[:, None]
    path, other = ORBIT.coast(mean, share * PERIOD), ORBIT.coast(AT_REST, share * PERIOD)
    zone = ZONES[shape]
    k = cf.clearance_in_sigmas(path, other, zone, cf.Uncertainty(root @ root.T)).sigmas
    assert cf.clearance_in_sigmas(
        path, other, zone, cf.Uncertainty(1.21 * root @ root.T)
    ).sigmas == pytest.approx(k / 1.1, rel=2e-9)
    more = root.copy()
    more[:, 0] *= 1.5
    assert cf.clearance_in_sigmas(path, other, zone, cf.Uncertainty(more @ more.T)).sigmas <= k * (1 + 2e-9)
    assert cf.clearance_in_sigmas(
        path, other, zone.enlarged(1.1), cf.Uncertainty(root @ root.T)
    ).sigmas <= k * (1 + 2e-9)
    if shape in ("sphere", "ellipsoid", "box"):  # other units of length
        wide = ORBIT.coast(scale * mean, share * PERIOD)
        same = cf.clearance_in_sigmas(
            wide, other, zone.enlarged(scale), cf.Uncertainty(scale**2 * root @ root.T)
        )
        assert same.sigmas == pytest.approx(k, rel=1e-8)
    if shape != "half-spaces":  # spacecraft exchanged
        there = cf.clearance_in_sigmas(other, path, zone, None, cf.Uncertainty(root @ root.T))
        assert there.sigmas == pytest.approx(k, rel=1e-9)


def turned_zone(name, q):
    """Return the named zone, rotated by q."""
    if name == "sphere":
        return ZONES[name]
    if name == "cylinder":
        return cf.Cylinder(15.0, 30.0, q @ [1.0, 1.0, 0.0])
    if name == "half-spaces":
        zone = ZONES[name]
        normals = zone.faces @ zone.matrix
        sizes = np.linalg.norm(normals, axis=1)
        return cf.HalfSpaces(normals / sizes[:, None] @ q.T, 1.0 / sizes)
    sizes, axes = {
        "ellipsoid": ([10.0, 25.0, 15.0], np.array([[0.6, 0.8, 0], [-0.8, 0.6, 0], [0, 0, 1]])),
        "box": ([15.0, 30.0, 15.0], np.eye(3)),
    }[name]
    return {"ellipsoid": cf.Ellipsoid, "box": cf.Box}[name](sizes, axes=axes @ q.T)


@pytest.mark.parametrize("shape", ZONES)
def test_invariance_under_rotation_and_time_shift(shape):
    """Rotation in deep space, mirrored cross-track axis and later start in orbit."""
    rng = np.random.default_rng(6)
    met = 0
    for _ in range(3):
        q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        q *= np.linalg.det(q)
        states = rng.normal(size=(2, 6)) * [70, 70, 70, 0.03, 0.03, 0.03]
        thrust = rng.normal(size=3) * 1e-5
        root = rng.normal(size=(6, 6)) * np.array([2, 4, 2, 2e-3, 2e-3, 2e-3])[:, None]
        below = np.diag([1.0, 1.0, -1.0])

        def sigmas(orbit, by, zone, start=0.0, states=states, thrust=thrust, root=root):
            both = np.kron(np.eye(2), by)
            moved = states @ both.T
            path = orbit.burn(moved[0], by @ thrust, 1000.0, start)
            path = cf.join([path, orbit.coast(path.state(start + 1000.0), 1500.0, start=start + 1000.0)])
            other = orbit.coast(moved[1], 2500.0, start=start)
            known = cf.Uncertainty(both @ root @ root.T @ both.T, magnitude=0.1, pointing=0.05, noise=1e-9)
            found = cf.clearance_in_sigmas(path, other, zone, known)
            return found.sigmas, found.time - start

        zone = ZONES[shape]
        for one, two in (
            (sigmas(DEEP, np.eye(3), zone), sigmas(DEEP, q, turned_zone(shape, q))),
            (sigmas(ORBIT, np.eye(3), zone), sigmas(ORBIT, below, turned_zone(shape, below))),
            (sigmas(ORBIT, np.eye(3), zone), sigmas(ORBIT, np.eye(3), zone, start=1e5)),
        ):
            assert two[0] == pytest.approx(one[0], rel=2e-9)
            met += 0.0 < one[0] < np.inf
    assert met >= 4


def test_screen_agrees_with_single_pairs():
    """Bodies with growing errors, one of them known exactly."""
    rng = np.random.default_rng(8)
    states = rng.normal(size=(8, 6)) * [40, 150, 40, 0.03, 0.03, 0.03]
    states[:, 4] = -2 * N * states[:, 0]
    paths = ORBIT.coast(states, PERIOD)
    errors = [cf.Uncertainty(deviations([1, s, 1], [1e-3] * 3), noise=1e-10) for s in range(1, 8)] + [None]
    found = cf.screen(paths, cf.Body(cf.Sphere(2.0)), errors=errors, sigmas=3.0)
    expected = []
    for i, j in zip(*np.triu_indices(8, 1), strict=True):
        for conflict in cf.find_conflicts(
            paths[i], paths[j], cf.Sphere(4.0), errors[i], errors[j], sigmas=3.0
        ):
            expected.append([i, j, conflict.start, conflict.end, conflict.ratio])
    assert len(expected) > 3
    rows = np.column_stack([found.pairs, found.start, found.end, found.ratio])
    np.testing.assert_allclose(rows, expected, rtol=1e-7, atol=1e-6)
    assert len(cf.screen(paths, cf.Sphere(4.0))) < len(found)
