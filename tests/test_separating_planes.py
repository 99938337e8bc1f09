"""Supporting planes at edges of zones, against linear programs and dense sampling."""

import numpy as np
import pytest
from numba import float64, int64, types
from scipy.optimize import linprog

import closeform as cf
from closeform._jit import kernel
from closeform.kernel_loans import borrowed, lent
from closeform.safety.failure_cells import side_of
from closeform.safety.failure_motions import ROOM_TYPE, room_for
from closeform.safety.separating_planes import mixed_normal
from closeform.safety.shadow import floor_of, shadow_of_faces
from closeform.zones.shapes import FORM
from closeform.zones.zone import scaled_norm

ORBIT = cf.Orbit.circular(500e3)
CORRIDOR = cf.HalfSpaces(
    [[1, 0.1, 0], [-1, 0.1, 0], [0, 0.1, 1], [0, 0.1, -1], [0, -1, 0]], [30, 30, 30, 30, 40]
)
ZONES = [
    cf.Box([20.0, 40.0, 30.0]),
    CORRIDOR,
    cf.HalfSpaces(np.random.Generator(np.random.Philox(5)).normal(size=(14, 3)), np.full(14, 20.0)),
    cf.HalfSpaces([[1, 0.5, 0.2], [0.3, -1, 0.4]], [10.0, 20.0]),
]


@kernel(types.UniTuple(float64, 4)(ROOM_TYPE, int64, FORM, float64, float64, float64, float64))
def mixed(room, count, form, x, y, z, way):
    """Make a part of a kernel callable."""
    room, form = lent(room), (form[0], borrowed(form[1]), borrowed(form[2]))
    return mixed_normal(room, count, form, x, y, z, way)


def random_room(rng, count, size):
    """Return arrays with a random parallelotope, its corner and its edges, in zone coordinates."""
    path = ORBIT.coast(np.zeros(6), 1.0)
    room = room_for(side_of(path, cf.DegradedThrust(0.1), 1.0), side_of(path, cf.DegradedThrust(0.1), 1.0))
    room.places[:] = 0.0
    room.places[0, :3] = 2.0 * rng.normal(size=3)
    room.edges[:count, :3] = size * rng.normal(size=(count, 3))
    room.shares[:] = 0.5
    return room, room.places[0, :3], room.edges[:count, :3]


def minimum_norm(zone, corner, edges, drift=None):
    """Return the minimum norm of a parallelotope by a linear program.

    With the `drift` of its edges and corner, only where the drift is not negative.
    """
    faces = zone.faces if len(zone.faces) else np.vstack([np.eye(3), -np.eye(3)])
    rows, most = np.column_stack([faces @ edges.T, -np.ones(len(faces))]), -faces @ corner
    if drift is not None:
        unit = np.abs(drift[0]).sum()
        rows, most = np.vstack([rows, np.r_[-drift[0] / unit, 0.0]]), np.r_[most, drift[1] / unit]
    cost = np.r_[np.zeros(len(edges)), 1.0]
    bounds = [(0.0, 1.0)] * len(edges) + [(None, None)]
    return linprog(cost, A_ub=rows, b_ub=most, bounds=bounds).fun


@pytest.mark.parametrize("zone", ZONES, ids=lambda zone: f"{type(zone).__name__} {len(zone.faces)}")
@pytest.mark.parametrize("count", [2, 4])
def test_mixed_normals_give_the_minimum_norm(zone, count):
    """The plane bounds the minimum norm exactly, and `shares` attain it."""
    rng = np.random.Generator(np.random.Philox(count))
    for _ in range(15):
        room, corner, edges = random_room(rng, count, 10.0 ** rng.uniform(-4, 0.5))
        x = corner + 0.5 * edges.sum(axis=0)
        normal = np.array(mixed(room, count, zone.form, *x, 0.0))[:3]
        value = normal @ corner + np.minimum(0.0, edges @ normal).sum()
        least = minimum_norm(zone, corner, edges)
        assert abs(value - least) <= 1e-9 * max(1.0, abs(least))  # tolerance of the linear program
        there = corner + room.shares[:count] @ edges
        assert abs(scaled_norm(zone, there) - least) <= 1e-9 * max(1.0, abs(least))


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize("zone", ZONES[:2], ids=lambda zone: f"{type(zone).__name__} {len(zone.faces)}")
def test_mixed_normals_and_drift_give_the_minimum_norm(zone, way):
    """The bound is the minimum norm of the part of a parallelotope with one sign of drift."""
    rng, cut = np.random.Generator(np.random.Philox(11)), 0
    for k in range(40):
        count = 2 + k % 3
        room, corner, edges = random_room(rng, count, 10.0 ** rng.uniform(-4, 0.5))
        room.edges[:count, 3] = 1e-4 * rng.normal(size=count)
        room.drifts[0] = -rng.random(count) @ room.edges[:count, 3]  # 0 at some point
        x = corner + 0.5 * edges.sum(axis=0)
        *normal, lean = mixed(room, count, zone.form, *x, way)
        drifts = room.edges[:count, 3]
        value = corner @ normal + lean * room.drifts[0]
        value += np.minimum(0.0, edges @ normal + lean * drifts).sum()
        least = minimum_norm(zone, corner, edges, (way * drifts, way * room.drifts[0]))
        assert lean * way <= 0.0
        assert abs(value - least) <= 1e-9 * max(1.0, abs(least))
        cut += least > minimum_norm(zone, corner, edges) + 1e-9
    assert cut >= 8


@pytest.mark.parametrize("count", [1, 4])
def test_mixed_normals_are_lower_bounds(count):
    """At the rim of a cylinder the bound is below all sampled points and close to them."""
    zone = cf.Cylinder(20.0, 40.0, axis=[0.3, 1.0, 0.2])
    rng = np.random.Generator(np.random.Philox(count))
    for _ in range(60):
        room, corner, edges = random_room(rng, count, 10.0 ** rng.uniform(-3, 0.0))
        x = corner + 0.5 * edges.sum(axis=0)
        normal = np.array(mixed(room, count, zone.form, *x, 0.0))[:3]
        value = normal @ corner + np.minimum(0.0, edges @ normal).sum()
        inside = corner + rng.random((500, count)) @ edges
        nearest = corner + room.shares[:count] @ edges
        points = np.vstack([inside, nearest])
        norms = scaled_norm(zone, points)
        assert value <= norms.min() + 1e-12
        assert norms[-1] - value <= 0.02 * np.linalg.norm(edges, axis=1).max() ** 2 + 1e-9


def test_shadow_of_half_spaces_is_the_minimum_along_the_track():
    tested = 0
    for zone in ZONES[1:]:
        shadow = shadow_of_faces(zone)
        if shadow is None:
            assert zone is ZONES[-1]
            continue
        faces = shadow[2]
        assert not (faces @ zone.matrix[:, 1]).round(12).any()
        for r in np.random.Generator(np.random.Philox(8)).normal(size=(60, 3)) * 60.0:
            q = zone.matrix @ r
            rows = np.column_stack([zone.faces @ zone.matrix[:, 1], -np.ones(len(zone.faces))])
            ahead = linprog([0.0, 1.0], A_ub=rows, b_ub=-zone.faces @ q, bounds=(None, None))
            assert abs((faces @ q).max() - ahead.fun) <= 1e-8 * max(1.0, abs(ahead.fun))
            tested += 1
    assert tested >= 120
    assert shadow_of_faces(cf.Box([1.0, 2.0, 3.0])) is None


def test_minimum_norm_of_half_spaces():
    assert [floor_of(zone) for zone in ZONES] == [0.0, 0.0, 0.0, -np.inf]
    assert floor_of(cf.HalfSpaces([[0, 0, 1], [0, 0, -1]], [10.0, 5.0])) == 0.0
