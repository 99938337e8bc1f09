"""Zone shapes: norms, supports, conflicts and zones of pairs."""

import numba
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import linprog, minimize_scalar

import closeform as cf
from closeform.zones.containment import containing_zone, greatest_norm
from closeform.zones.shapes import norm, part, part_count, rank, rate

N = 1.1e-3
ORBIT, DEEP = cf.Orbit(N), cf.Orbit(0.0)
PERIOD = 2 * np.pi / N
ZERO = np.zeros(6)
AXIS = np.array([0.36, 0.48, -0.8])
TURN = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
WEDGE = cf.HalfSpaces([[1.0, 1.0, 0.0], [1.0, -1.0, 0.3]], [20.0, 35.0])
BODY = cf.HalfSpaces([*np.eye(3), *-np.eye(3), [1, 1, 1]], [2.0, 3.0, 4.0, 2.5, 3.5, 4.5, 4.0])
SHAPES = {
    "sphere": cf.Sphere(3.0),
    "ellipsoid": cf.Ellipsoid([2.0, 4.0, 8.0], TURN),
    "box": cf.Box([2.0, 4.0, 8.0], TURN),
    "cylinder": cf.Cylinder(3.0, 7.0, AXIS),
    "disc": cf.Cylinder(7.0, 0.5, [0.0, 0.0, -2.0]),
    "half-space": cf.HalfSpaces([[0.0, -3.0, 4.0]], [5.0]),
    "wedge": WEDGE,
    "body": BODY,
}
lengths = st.floats(0.1, 100.0)
vectors = st.lists(st.floats(-1e3, 1e3), min_size=3, max_size=3).map(np.array)
directions = vectors.filter(lambda v: np.linalg.norm(v) > 1e-3)


@st.composite
def half_spaces(draw):
    """Draw one to eight faces with their normals and offsets."""
    normals = np.array(draw(st.lists(directions, min_size=1, max_size=8)))
    offsets = np.array(draw(st.lists(lengths, min_size=len(normals), max_size=len(normals))))
    return cf.HalfSpaces(normals, offsets), normals, offsets


# --- norms ------------------------------------------------------------------------------------


@given(lengths, lengths, directions, vectors)
def test_norm_of_a_cylinder(radius, half_length, axis, position):
    along = axis / np.linalg.norm(axis)
    side, end = np.linalg.norm(np.cross(position, along)) / radius, abs(position @ along) / half_length
    rounding = 1e-15 * np.linalg.norm(position) / min(radius, half_length)
    found = cf.Cylinder(radius, half_length, axis).norm(position)
    assert found == pytest.approx(max(side, end), rel=1e-12, abs=100 * rounding)


@given(half_spaces(), vectors)
def test_norm_of_half_spaces(made, position):
    zone, normals, offsets = made
    heights = normals @ position / np.linalg.norm(normals, axis=1)
    rounding = 1e-14 * np.linalg.norm(position) / offsets.min()
    assert zone.norm(position) == pytest.approx((heights / offsets).max(), rel=1e-12, abs=rounding)


@pytest.mark.parametrize("shape", SHAPES)
@settings(deadline=None, max_examples=15)
@given(a=vectors, b=vectors, factor=st.floats(0, 10))
def test_norms_are_convex_and_homogeneous(shape, a, b, factor):
    zone = SHAPES[shape]
    rounding = 1e-12 * (np.linalg.norm(a) + np.linalg.norm(b)) + 1e-300  # denormal numbers have few digits
    assert zone.norm(a + b) <= zone.norm(a) + zone.norm(b) + rounding
    assert zone.norm(factor * a) == pytest.approx(factor * zone.norm(a), rel=1e-12, abs=1e-12)
    assert zone.mirrored.norm(-a) == zone.norm(a)
    assert zone.enlarged(1.5).norm(1.5 * a) == pytest.approx(zone.norm(a), rel=1e-12, abs=1e-12)
    assert zone.symmetric == (zone.mirrored is zone)


@settings(deadline=None, max_examples=15)
@given(half_spaces(), directions)
def test_support_of_half_spaces_agrees_with_a_linear_program(made, direction):
    # the program drops coefficients below 1e-9; round them
    normals, direction, offsets = np.round(made[1], 3), np.round(direction, 3), made[2]
    assume(direction.any() and normals.any(axis=1).all())
    zone, unit = cf.HalfSpaces(normals, offsets), direction / np.linalg.norm(direction)
    rows = normals / np.linalg.norm(normals, axis=1)[:, None]

    def programmed(way):
        # the origin is feasible, so status 2 (infeasible) means unbounded, like 3
        solved = linprog(-way, rows, offsets, bounds=(None, None))
        return np.inf if solved.status in (2, 3) else -solved.fun

    found, wanted = float(zone.support(unit)), programmed(unit)
    far = 1e4 * offsets.max()  # nearly parallel faces may count as unbounded
    assert found == pytest.approx(wanted, rel=1e-6) or min(found, wanted) > far


@pytest.mark.parametrize("shape", ["sphere", "ellipsoid", "box", "cylinder", "disc", "body"])
def test_support_extents_and_vertices_agree_with_samples(shape):
    zone = SHAPES[shape]
    rng = np.random.Generator(np.random.Philox(3))
    points = rng.normal(size=(150_000, 3)) @ np.linalg.inv(zone.matrix).T
    surface = points / zone.norm(points)[:, None]
    ways = rng.normal(size=(6, 3))
    for reached, known in (
        ((surface @ ways.T).max(axis=0), zone.support(ways)),
        (np.abs(surface).max(axis=0), zone.extents),
    ):
        assert (reached <= known * (1 + 1e-12)).all()
        assert (reached >= known * 0.97).all()  # resolution of the samples at a corner
    assert zone.bounded
    np.testing.assert_allclose(zone.norm(zone.vertices), 1.0, rtol=1e-9)
    assert len(zone.vertices) == {"box": 8, "body": 10}.get(shape, 0)


def test_support_almost_along_an_edge():
    """By hand: z = 1 and x = sqrt(2) - 1 from the first faces, then y from the second."""
    normals, offsets = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 17.0], [1.0, 0.0, 1.0]]), [1.0, 59.0, 1.0]
    x, y, z = 2**0.5 - 1.0, 59.0 * 290**0.5 - 17.0, 1.0
    for slope in (1e-2, 6e-8, 1e-10):
        wanted = 2.0 * x + slope * y + 58.0 * z
        assert cf.HalfSpaces(normals, offsets).support([2.0, slope, 58.0]) == pytest.approx(wanted, rel=1e-13)


def test_unbounded_zones():
    half = SHAPES["half-space"]
    np.testing.assert_allclose(
        half.support([[0.0, -0.6, 0.8], [0.0, 0.6, -0.8], [1.0, 0.0, 0.0]]), [5, np.inf, np.inf]
    )
    assert not half.bounded
    assert np.isinf(half.extents).all()
    assert half.norm([0.0, 30.0, -40.0]) == pytest.approx(-10.0)
    slab = cf.HalfSpaces([[0, 1, 0], [0, -1, 0]], [5.0, 3.0])
    assert slab.extents.tolist() == [np.inf, 5.0, np.inf]
    assert slab.support([0, -1, 0]) == 3.0
    assert slab.support([0, 0, 0]) == 0.0


# --- kernels ----------------------------------------------------------------------------------


@numba.njit  # compiled at the first call
def kernels(form, q, v):
    """Return rows of the parts (value, gradient, rank), and one of the norm and its rate."""
    shape, _, faces = form
    count = part_count(shape, faces)
    rows = np.zeros((count + 1, 5))
    for k in range(count):
        rows[k, 0], rows[k, 1], rows[k, 2], rows[k, 3] = part(shape, faces, k, q[0], q[1], q[2])
        rows[k, 4] = rank(shape, k)
    rows[count, 0] = norm(shape, faces, q[0], q[1], q[2])
    rows[count, 1] = rate(shape, faces, q[0], q[1], q[2], v[0], v[1], v[2])
    return rows


@pytest.mark.slow
@pytest.mark.parametrize("shape", SHAPES)
def test_gradients_agree_with_finite_differences(shape):
    zone = SHAPES[shape]
    rng = np.random.Generator(np.random.Philox(4))
    for q in rng.normal(size=(20, 3)):
        *own, total = kernels(zone.form, q, q)
        assert total[0] == pytest.approx(zone.norm(np.linalg.solve(zone.matrix, q)), rel=1e-12)
        assert total[0] == max(row[0] for row in own)
        for k, (_, *gradient, leading) in enumerate(own):
            step = 1e-6
            slopes = [
                (kernels(zone.form, q + e, q)[k, 0] - kernels(zone.form, q - e, q)[k, 0]) / (2 * step)
                for e in step * np.eye(3)
            ]
            np.testing.assert_allclose(gradient, slopes, atol=1e-8)
            assert leading == {"s": 3, "e": 3, "c": 2, "d": 2}.get(shape[0], 1) or k == 1 or shape == "box"
            assert leading == 1 or not np.any(gradient[int(leading) :])


@pytest.mark.slow
@pytest.mark.parametrize("shape", SHAPES)
def test_rates_are_right_derivatives(shape):
    """This includes kinks: the axis, the centre, and edges."""
    zone = SHAPES[shape]
    rng = np.random.Generator(np.random.Philox(5))
    kinks = [np.zeros(3), np.array([0.0, 0.0, 0.7]), np.array([0.6, 0.8, 1.0]), np.array([0.5, -0.5, 0.5])]
    for q in [*rng.normal(size=(10, 3)), *kinks]:
        for v in [*rng.normal(size=(5, 3)), np.array([0.0, 0.0, 1.0])]:
            found = kernels(zone.form, q, v)[-1, 1]
            here, step = kernels(zone.form, q, v)[-1, 0], 1e-7
            later = kernels(zone.form, q + step * v, v)[-1, 0]
            assert found == pytest.approx((later - here) / step, abs=3e-6)


# --- which zone holds another -----------------------------------------------------------------


def reached(outer, inner, rng):
    """Return the greatest norm of a zone over another by samples refined along its boundary."""
    best, at, width = -np.inf, 0.0, 1.0
    for trial in range(60):
        points = rng.normal(size=(1000 if trial else 50_000, 3)) @ np.linalg.inv(inner.matrix).T
        points = at + width * points / inner.norm(points)[:, None]
        surface = points / inner.norm(points)[:, None]
        norms = outer.norm(surface)
        if norms.max() > best:
            best, at = norms.max(), surface[norms.argmax()]
        width *= 0.7 if trial else 0.05
    return best


CLOSED = ["sphere", "ellipsoid", "box", "cylinder", "disc", "body"]


@pytest.mark.parametrize(
    ("outer", "inner"),
    [*zip(CLOSED, CLOSED, strict=True), *zip(CLOSED, CLOSED[1:] + CLOSED[:1], strict=True)],
)
def test_greatest_norm_agrees_with_samples(outer, inner):
    outer, inner = SHAPES[outer], SHAPES[inner]
    known = greatest_norm(outer, inner)
    best = reached(outer, inner, np.random.Generator(np.random.Philox(6)))
    assert best <= known * (1 + 1e-9)
    assert best >= known * (1 - 1e-4)
    if outer is inner:
        assert known == pytest.approx(1.0, rel=1e-12)


def test_bounded_zone_contains_no_unbounded_one():
    for outer in (SHAPES[name] for name in CLOSED):
        assert greatest_norm(outer, WEDGE) == np.inf
    assert greatest_norm(WEDGE, cf.Sphere(20.0)) == pytest.approx(1.0)  # the nearer face touches
    assert containing_zone(cf.Sphere(19.9), WEDGE) is WEDGE
    assert containing_zone(cf.Sphere(20.1), WEDGE) is None
    ball, rod = cf.Sphere(5.0), cf.Cylinder(3.0, 4.0, AXIS)  # its rims touch the ball
    assert containing_zone(rod, ball) is ball
    assert containing_zone(rod, ball.enlarged(1 - 1e-6)) is None


# --- in flight --------------------------------------------------------------------------------


def flown(state, duration):
    """Natural motion by an integrator that knows nothing but Hill's equations."""

    def hill(_, s):
        x, _, z, vx, vy, vz = s
        return [vx, vy, vz, 3 * N * N * x + 2 * N * vy, -2 * N * vx, -N * N * z]

    return solve_ivp(
        hill, (0.0, duration), state, method="DOP853", rtol=1e-12, atol=1e-12, dense_output=True
    ).sol


@pytest.mark.parametrize("shape", SHAPES)
def test_conflicts_are_those_of_an_integrator(shape):
    """Dense samples of the integrated motion; every crossing bisected, every dip refined."""
    zone = SHAPES[shape].enlarged(12.0)
    rng = np.random.Generator(np.random.Philox(7))
    chief, total = ORBIT.coast(ZERO, PERIOD), 0
    for _ in range(6):
        state = rng.normal(size=6) * np.repeat([40.0, 40.0 * N], 3)
        state[4] = -2 * N * state[0]
        found = cf.find_conflicts(ORBIT.coast(state, PERIOD), chief, zone)
        motion = flown(state, PERIOD)
        times = np.linspace(0.0, PERIOD, 20_001)
        norms = zone.norm(motion(times)[:3].T)
        inside = np.zeros(len(times), dtype=bool)
        for conflict in found:
            within = (times >= conflict.start) & (times <= conflict.end)
            inside |= within
            for edge in (conflict.start, conflict.end):
                if 0.0 < edge < PERIOD:
                    assert zone.norm(motion(edge)[:3]) == pytest.approx(1.0, abs=1e-9)
            least = zone.norm(motion(conflict.time)[:3])
            assert conflict.ratio == pytest.approx(least, abs=1e-9)
            assert conflict.ratio <= norms[within].min(initial=np.inf) + 1e-9
        assert (norms[inside] <= 1 + 1e-9).all()
        assert (norms[~inside] > 1 - 1e-9).all()
        near = cf.closest_approach(ORBIT.coast(state, PERIOD), chief, zone)
        k = int(norms.argmin())
        low, high = times[max(k - 1, 0)], times[min(k + 1, len(times) - 1)]
        dip = minimize_scalar(
            lambda t, z=zone, m=motion: z.norm(m(t)[:3]),
            bounds=(low, high),
            method="bounded",
            options={"xatol": 1e-9},
        )
        assert near.ratio == pytest.approx(min(dip.fun, norms[k]), abs=1e-7)
        total += len(found)
    assert total > 0


@pytest.mark.parametrize("offset", [1e-3, 1e-6, 1e-9])
def test_grazing_the_rim_of_a_cylinder(offset):
    """Deep space, past the edge between side and end along its tangent: just in, just out."""
    zone = cf.Cylinder(3.0, 4.0, [0.0, 0.0, 1.0])
    for sign, count in ((-1, 1), (1, 0)):
        rim = np.array([3.0 * (1 + sign * offset), 0.0, 4.0 * (1 - offset)])
        path = DEEP.coast([*(rim - [0, 50.0, 0]), 0.0, 1.0, 0.0], 100.0)
        found = cf.find_conflicts(path, DEEP.coast(ZERO, 100.0), zone)
        assert len(found) == count
        for conflict in found:  # a chord of the circle, 1e-12 of the norm good to the root of it
            half = 3.0 * np.sqrt(1 - (1 - offset) ** 2)
            assert conflict.end - conflict.start == pytest.approx(2 * half, abs=1e-11 / half)
            assert conflict.time == pytest.approx(50.0, abs=half)
    level = DEEP.coast(
        [-50.0, 0.0, 4.0 * (1 + offset), 1.0, 0.0, 0.0], 100.0
    )  # over the end, and just into it
    assert cf.find_conflicts(level, DEEP.coast(ZERO, 100.0), zone) == ()
    below = DEEP.coast([-50.0, 0.0, 4.0 * (1 - offset), 1.0, 0.0, 0.0], 100.0)
    (conflict,) = cf.find_conflicts(below, DEEP.coast(ZERO, 100.0), zone)
    assert (conflict.start, conflict.end) == pytest.approx((47.0, 53.0), abs=1e-10)


def test_along_the_axis_of_a_cylinder():
    """Straight through both ends; beside it, on the side, never in; slower than the last digit."""
    zone = cf.Cylinder(5.0, 20.0, AXIS)
    chief = DEEP.coast(ZERO, 100.0)
    for depth, count in ((0.0, 1), (0.999999, 1), (1.000001, 0)):
        across = 5.0 * depth * np.array([0.8, -0.6, 0.0])
        path = DEEP.coast([*(across - 50.0 * AXIS), *AXIS], 100.0)
        found = cf.find_conflicts(path, chief, zone)
        assert len(found) == count
        for conflict in found:
            assert (conflict.start, conflict.end) == pytest.approx((30.0, 70.0), abs=1e-10)
            assert conflict.ratio == pytest.approx(depth, abs=1e-9)
    still = DEEP.coast([*(4.0 * AXIS), 0.0, 0.0, 0.0], 100.0)
    (conflict,) = cf.find_conflicts(still, chief, zone)
    assert (conflict.start, conflict.end, conflict.ratio) == (0.0, 100.0, pytest.approx(0.2))


@pytest.mark.parametrize("turns", [1, 10, 100])
@pytest.mark.parametrize("offset", [1e-6, 1e-9, 3e-12])
def test_circle_along_the_side_of_a_cylinder(turns, offset):
    """The general circular orbit keeps at 200 m from the line through its middle, forever."""
    e = 100.0
    path = ORBIT.coast([-e, 0, np.sqrt(3) * e, 0, 2 * e * N, 0], turns * PERIOD)
    chief = ORBIT.coast(ZERO, turns * PERIOD)
    normal = np.array([np.sqrt(3) / 2, 0.0, 0.5])
    assert np.abs(path.position(np.linspace(0, PERIOD, 9)) @ normal).max() < 1e-9
    assert cf.find_conflicts(path, chief, cf.Cylinder(200 * (1 - offset), 50.0, normal)) == ()
    (conflict,) = cf.find_conflicts(path, chief, cf.Cylinder(200 * (1 + offset), 50.0, normal))
    assert (conflict.start, conflict.end) == (0.0, turns * PERIOD)


def test_half_space_is_entered_and_never_left():
    """The leader drifts along track from ahead to behind a plane 50 m ahead."""
    zone = cf.HalfSpaces([[0.0, 1.0, 0.0]], [50.0])
    chief, leader = DEEP.coast(ZERO, 1000.0), DEEP.coast([0, 150.0, 0, 0, -1.0, 0], 1000.0)
    (conflict,) = cf.find_conflicts(leader, chief, zone)
    assert (conflict.start, conflict.end) == (pytest.approx(100.0, abs=1e-10), 1000.0)
    assert (conflict.time, conflict.ratio) == (
        1000.0,
        pytest.approx(-17.0),
    )  # 850 m behind the chief, 50 m ahead
    assert cf.find_conflicts(chief, leader, zone)[0].start == 0.0  # the chief is behind the leader at first
    near = cf.closest_approach(leader, chief, zone)
    assert (near.time, near.ratio) == (conflict.time, conflict.ratio)


def test_closest_approach_in_an_unbounded_zone():
    """Inside a half-space the norm falls below 0 to a minimum between samples."""
    zone = cf.HalfSpaces([[1.0, 0.0, 0.0]], [10.0])
    path = ORBIT.coast([5.0, 0.0, 0.0, 0.0, -10.0 * N * 1.7, 0.0], PERIOD)
    motion = flown(path.state(0.0), PERIOD)
    dip = minimize_scalar(
        lambda t: motion(t)[0], bounds=(0.2 * PERIOD, 0.8 * PERIOD), method="bounded", options={"xatol": 1e-9}
    )
    near = cf.closest_approach(path, ORBIT.coast(ZERO, PERIOD), zone)
    assert dip.fun < 0.0
    assert near.ratio == pytest.approx(dip.fun / 10.0, rel=1e-9)
    assert near.time == pytest.approx(dip.x, abs=1e-2)


def test_last_possible_conflict_with_an_unbounded_zone():
    behind = ORBIT.coast([2.0, -1000.0, 0, 0, -3.3e-3, 0], 100.0)
    assert cf.last_possible_conflict(behind, ORBIT.coast(ZERO, 100.0), WEDGE) == np.inf
    cylinder = cf.Cylinder(20.0, 40.0, [0.0, 1.0, 0.0])
    box = cf.Box([20.0, 40.0, 20.0])
    assert cf.last_possible_conflict(behind, ORBIT.coast(ZERO, 100.0), cylinder) == pytest.approx(
        cf.last_possible_conflict(behind, ORBIT.coast(ZERO, 100.0), box)
    )


# --- zones of pairs ---------------------------------------------------------------------------


def test_screen_searches_an_asymmetric_zone_both_ways():
    rng = np.random.Generator(np.random.Philox(8))
    states = rng.normal(size=(12, 6)) * np.repeat([60.0, 60.0 * N], 3)
    states[:, 4] = -2 * N * states[:, 0]
    paths = ORBIT.coast(states, PERIOD)
    zone = cf.HalfSpaces([*BODY.faces], 1.0 / np.linalg.norm(BODY.faces, axis=1)).enlarged(15.0)
    found = cf.screen(paths, zone)
    rows = [
        (i, j, conflict.start, conflict.end)
        for i in range(12)
        for j in range(12)
        if i != j
        for conflict in cf.find_conflicts(paths[i], paths[j], zone)
    ]
    np.testing.assert_array_equal(np.column_stack([found.pairs, found.start, found.end]), rows)
    assert {i < j for i, j in found.pairs.tolist()} == {True, False}


KINDS = [cf.Sphere(20.0), cf.Box([30.0, 45.0, 30.0]), None, cf.Sphere(70.0), WEDGE.enlarged(3.0)]


@settings(deadline=None, max_examples=15)
@given(st.lists(st.sampled_from([0, 1, 2, 3]), max_size=9), st.data())
def test_zone_of_each_pair(chosen, data):
    moves = data.draw(st.lists(st.booleans(), min_size=len(chosen), max_size=len(chosen)))
    zones = [KINDS[k] for k in chosen]
    kept = cf.PairZones.of(zones, moves=moves)
    assert len(kept) == len(zones)
    grouped = {tuple(pair): zone for zone, pairs in kept.groups() for pair in pairs.tolist()}
    for i in range(len(zones)):
        for j in range(i + 1, len(zones)):
            rivals = [zone for zone in (zones[i], zones[j]) if zone is not None]
            wanted = max(
                rivals, key=lambda zone: zone.extents[0], default=None
            )  # these contain each other by size
            if not (moves[i] or moves[j]):
                wanted = None
            assert kept.between(i, j) is wanted
            assert kept.between(j, i) is wanted
            assert grouped.pop((i, j), None) is wanted
    assert not grouped
    for i in range(len(zones)):
        assert kept.around(i) == tuple(kept.between(i, j) for j in range(len(zones)) if j != i)


def test_asymmetric_zone_follows_the_order_of_its_pair():
    """The visitor may not come ahead of the plane, whatever the numbering."""
    station, small = cf.HalfSpaces([[0.0, 1.0, 0.0]], [50.0]), cf.Sphere(5.0)
    behind = np.array([0.0, -80.0, 0.0])  # of the visitor from the station
    assert station.norm(behind) < 1 < station.norm(-behind)
    for zones, visitor, host in (([station, small], 1, 0), ([small, station], 0, 1)):
        kept = cf.PairZones.of(zones)
        assert kept.between(visitor, host).norm(behind) == station.norm(behind)
        assert kept.between(host, visitor).norm(-behind) == station.norm(behind)
        ((zone, pairs),) = kept.groups()
        assert pairs.tolist() == [[0, 1]]
        places = np.zeros((2, 3))
        places[visitor] = behind
        assert zone.norm(places[0] - places[1]) == station.norm(behind)


def test_two_asymmetric_zones_are_rejected():
    with pytest.raises(ValueError, match="A and B: neither zone contains the other"):
        cf.PairZones.of([WEDGE, WEDGE], ["A", "B"])
    assert cf.PairZones.of([WEDGE, WEDGE], moves=[False, False]).between(0, 1) is None


def test_screen_uses_the_zone_of_each_pair():
    rng = np.random.Generator(np.random.Philox(9))
    states = rng.normal(size=(15, 6)) * np.repeat([60.0, 60.0 * N], 3)
    states[:, 4] = -2 * N * states[:, 0]
    paths = ORBIT.coast(states, PERIOD)
    kept = cf.PairZones.of([KINDS[k % 4] for k in range(15)], moves=[k % 3 > 0 for k in range(15)])
    found = cf.screen(paths, kept)
    rows = [
        (i, j, conflict.start, conflict.end, conflict.ratio)
        for i in range(15)
        for j in range(i + 1, 15)
        if kept.between(i, j) is not None
        for conflict in cf.find_conflicts(paths[i], paths[j], kept.between(i, j))
    ]
    assert len(rows) > 30
    np.testing.assert_array_equal(np.column_stack([found.pairs, found.start, found.end, found.ratio]), rows)
    with pytest.raises(ValueError, match="zone: zones of 15 spacecraft for 3 paths"):
        cf.screen(paths[:3], kept)


def test_zones_of_two_obstacles_need_not_nest():
    """Two coasting obstacles do not avoid each other."""
    states = np.array([[0, 300.0, 0, 0, 0, 0], [0, 600.0, 0, 0, 0, 0]])
    cigar, disc, ball = cf.Ellipsoid([5.0, 50.0, 5.0]), cf.Ellipsoid([50.0, 5.0, 50.0]), cf.Sphere(60.0)
    plan = cf.reconfigure(
        ORBIT, [[0, 0, 0, 0, 0, 0]], [[0, 10.0, 0, 0, 0, 0]], 1000.0, [ball, cigar, disc],
        obstacles=ORBIT.coast(states, 1000.0),
    )  # fmt: skip
    assert plan.ok


BAD = {
    "no axis": (lambda: cf.Cylinder(1.0, 2.0, [0, 0, 0]), "axis: must not be zero"),
    "zero": (
        lambda: cf.HalfSpaces([[1, 0, 0], [0, 0, 0]], [1.0, 1.0]),
        "normals: must not be zero",
    ),
    "touching": (lambda: cf.HalfSpaces([[1, 0, 0]], [0.0]), "offsets: must be positive and finite, got"),
    "gather": (
        lambda: cf.gather(cf.Search.basic(cf.Sensor(1.2), 0.004, 0.4), np.eye(3), np.eye(3), keep_out=WEDGE),
        "keep_out: a gathering requires a Sphere, Ellipsoid or Box, got a HalfSpaces",
    ),
}


def test_invalid_input():
    for case in BAD:
        call, message = BAD[case]
        with pytest.raises(ValueError, match=message):
            call()


SCENARIO = """
closeform = 1
title = "A station with a plane ahead of it"
[orbit]
deep_space = true
[craft]
name = ["visitor", "station"]
position = ["0 150 0 m", "0 0 0 m"]
velocity = ["0 -1 0 m/s", "0 0 0 m/s"]
keep_out = [{ sphere = "5 m" }, { half_spaces = "50 m", normals = [[0, 1, 0]] }]
[[stage]]
do = "coast"
for = "1000 s"
"""


def test_asymmetric_zone_in_a_scenario():
    """The visitor crosses the plane of the station after 100 s and stays behind it."""
    from closeform.mission.mission import plan_mission
    from closeform.scenario import parse

    (met,) = plan_mission(parse(SCENARIO)).results[0].after.conflicts
    assert (met.first, met.second) == ("visitor", "station")
    assert (met.start, met.end) == (pytest.approx(100.0, abs=1e-10), 1000.0)
    assert met.ratio == pytest.approx(-17.0)


@pytest.mark.parametrize(
    ("make", "name"),
    [
        (lambda: cf.Cylinder(1e-155, 1e-155), "radius"),
        (lambda: cf.Ellipsoid([1.0, 1.0, 1e20]), "semi_axes"),
        (lambda: cf.HalfSpaces([[1.0, 0.0, 0.0]], [1e-200]), "offsets"),
    ],
)
def test_extreme_sizes_are_rejected(make, name):
    with pytest.raises(ValueError, match=f"^{name}: .* from 1e-09 to 1e\\+15 m"):
        make()
