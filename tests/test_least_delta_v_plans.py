"""Plans of minimum delta-v, against convex programs on fine grids and an integrator."""

from math import pi

import clarabel
import numpy as np
import pytest
from scipy import sparse
from scipy.linalg import expm

import closeform as cf
from bridge import hill
from delta_v_plans import NEAR, ORBIT, flown, passage
from formations import cases

GRID = 241  # impulse times of the convex program
BY_IMPULSES = 5e-4  # relative gap to the convex program, whose planes are those of the path


def minimum_on_planes(path, obstacle, radius, a, b, duration):
    """Return the minimum cost (SOCP) of impulses on a grid within the supporting planes of a path."""
    motion = hill(ORBIT.mean_motion)
    fired = [t for t, _ in path.impulses]
    times = np.union1d(np.linspace(0.0, duration, GRID), fired)
    ways = np.array([expm(motion * (duration - t))[:, 3:] for t in times])
    equal, target = np.hstack(list(ways)), b - expm(motion * duration) @ a
    planes, floors = [], []
    for t in times:
        apart = path.position(t) - obstacle.position(t)
        size = np.linalg.norm(apart)
        if size < NEAR * radius:
            normal = apart / size
            row = [normal @ expm(motion * (t - s))[:3, 3:] if s < t else np.zeros(3) for s in times]
            planes.append(np.concatenate(row))
            drift = (expm(motion * t) @ a)[:3] - obstacle.position(t)
            floors.append(min(radius, size) - normal @ drift)
    count = len(times)
    scale = np.array([1.0 / duration] * 3 + [1.0] * 3)
    rows = np.vstack([scale[:, None] * equal, -np.array(planes) / duration])
    right = np.concatenate([scale * target, -np.array(floors) / duration])
    wide = np.zeros((len(rows), 4 * count))
    cones = np.zeros((4 * count, 4 * count))
    for j in range(count):
        wide[:, 4 * j + 1 : 4 * j + 4] = rows[:, 3 * j : 3 * j + 3]
        cones[4 * j : 4 * j + 4, 4 * j : 4 * j + 4] = -np.eye(4)
    cost = np.zeros(4 * count)
    cost[::4] = 1.0
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    kinds = [clarabel.ZeroConeT(6), clarabel.NonnegativeConeT(len(planes))]
    kinds += [clarabel.SecondOrderConeT(4)] * count
    matrix = sparse.csc_matrix(np.vstack([wide, cones]))
    offsets = np.concatenate([right, np.zeros(4 * count)])
    nothing = sparse.csc_matrix((4 * count, 4 * count))
    found = clarabel.DefaultSolver(nothing, cost, matrix, offsets, kinds, settings).solve()
    assert str(found.status) == "Solved"
    return found.obj_val


@pytest.mark.parametrize(
    "seed", [0, 2, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 3, 4, 5, 6, 7))]
)
def test_avoidance_of_a_sphere(seed):
    a, b, duration, obstacle, radius = passage(seed)
    free = cf.least_delta_v(ORBIT, a, b, duration)
    found = cf.avoid(ORBIT.transfer(a, b, duration), obstacle, cf.Sphere(radius), cost="delta-v")
    assert found.status == cf.Status.AVOIDED
    assert found.cost == "delta-v"
    assert found.spent == found.delta_v == pytest.approx(found.path.delta_v, rel=1e-12)
    assert found.lower_bound == pytest.approx(free.lower, rel=1e-8)
    assert found.gap == pytest.approx(found.delta_v / found.lower_bound - 1.0)
    assert found.delta_v < ORBIT.transfer(a, b, duration).delta_v  # even though that violates the sphere
    times = np.linspace(0.0, duration, 4001)
    places, end = flown(found.path, times)
    assert np.abs(end[:3] - b[:3]).max() < 1e-6  # m; accuracy of the integrator
    assert np.abs(end[3:] - b[3:]).max() < 1e-9
    apart = np.linalg.norm(places - obstacle.position(times), axis=1)
    assert apart.min() > radius * (1.0 - 1e-8)
    cheapest = minimum_on_planes(found.path, obstacle, radius, a, b, duration)
    assert found.delta_v <= (1.0 + BY_IMPULSES) * cheapest


def test_single_start_reaches_the_minimum_of_its_side():
    """A single start reaches the minimum of its side, by a cone program."""
    stays = np.array([0.0, 100.0, 0.0, 0.0, 0.0, 0.0])
    passes = ORBIT.coast(ORBIT.transition(-1500.0) @ [3.0, 95.0, 2.0, 0.05, 0.1, 0.02], 3000.0)
    path = ORBIT.transfer(stays, stays, 3000.0)
    found = cf.avoid(path, passes, cf.Sphere(20.0), cost="delta-v", budget=1)
    cheapest = minimum_on_planes(found.path, passes, 20.0, stays, stays, 3000.0)
    assert found.delta_v <= (1.0 + BY_IMPULSES) * cheapest
    many = cf.avoid(path, passes, cf.Sphere(20.0), cost="delta-v", budget=24)
    assert found.delta_v <= (1.0 + BY_IMPULSES) * many.delta_v


def test_swap_of_twelve():
    """Twelve spacecraft cross a ring with few impulses and 25 % less delta-v than by energy."""
    angles = 2.0 * pi * np.arange(12) / 12
    ring = np.zeros((12, 6))
    ring[:, 1], ring[:, 2] = 120.0 * np.cos(angles), 120.0 * np.sin(angles)
    task = ORBIT, ring, -ring, ORBIT.period / 4.0, cf.Sphere(15.0)
    by_energy, plan = cf.reconfigure(*task), cf.reconfigure(*task, cost="delta-v")
    assert plan.ok
    assert plan.delta_v < 0.75 * by_energy.delta_v
    assert plan.lower_bound <= plan.delta_v
    assert len(cf.screen(plan.paths, cf.Sphere(15.0))) == 0
    assert np.abs(plan.paths.state(ORBIT.period / 4.0) + ring)[:, :3].max() < 1e-6
    assert plan.direct.delta_v.sum() == pytest.approx(plan.lower_bound, rel=1e-8)
    for path in plan.paths[:3]:
        places, end = flown(path, np.linspace(0.0, float(path.end), 50))
        assert np.abs(places - path.position(np.linspace(0.0, float(path.end), 50))).max() < 1e-6
        assert np.isfinite(end).all()
    # few impulses: 88, some of 1e-5 m/s, would hardly cost less
    sizes = [[np.linalg.norm(push) for _, push in path.impulses] for path in plan.paths]
    assert max(map(len, sizes)) <= 4
    assert sum(map(len, sizes)) <= 40
    assert min(map(min, sizes)) > 1e-4 * plan.delta_v
    assert sum(map(sum, sizes)) == pytest.approx(plan.delta_v, rel=1e-12)
    assert plan.delta_v < (1.0 + 1e-4) * 3.98691  # m/s, of 88 impulses
    duration, steps = float(plan.paths.end[0]), np.linspace(0.0, 1.0, 3001)  # half a second
    places = np.array([path.position(duration * steps) for path in plan.paths])
    apart = np.linalg.norm(places[:, None] - places, axis=-1)[np.triu_indices(12, 1)]
    assert apart.min() > 15.0 - 1e-3


@pytest.mark.parametrize(
    "number", [pytest.param(k, marks=pytest.mark.slow) for k in (7, 12, 33, 45)]
)  # boxes, spheres, time windows and deep space
def test_random_formations(number):
    task = list(cases())[number]
    by_energy = cf.reconfigure(**task.arguments)
    plan = cf.reconfigure(**task.arguments, cost="delta-v")
    assert plan.ok
    assert plan.lower_bound * (1.0 - 1e-12) <= plan.delta_v < by_energy.delta_v
    assert len(cf.screen(plan.paths, task.zone)) == 0
    for k, path in enumerate(plan.paths):
        end = path.state(task.ends[k])
        scale = np.abs(task.final[k, :3]).max()
        assert np.abs(end - task.final[k])[:3].max() < 1e-9 * scale + 1e-7


@pytest.mark.parametrize(
    "zone",
    [cf.Box([30.0, 20.0, 40.0]), cf.Ellipsoid([30.0, 60.0, 20.0]), cf.Cylinder(25.0, 40.0, [0.0, 1.0, 0.0])],
    ids=["box", "ellipsoid", "cylinder"],
)
@pytest.mark.parametrize("orbit", [ORBIT, cf.Orbit(0.0)], ids=["orbit", "deep space"])
def test_zone_shapes(zone, orbit):
    a, b = np.array([0.0, -300.0, 5.0, 0.0, 0.0, 0.0]), np.array([10.0, 300.0, -4.0, 0.0, 0.0, 0.0])
    obstacle = orbit.coast(np.zeros(6), 2000.0)
    found = cf.avoid(orbit.impulsive(a, b, 2000.0), obstacle, zone, cost="delta-v")
    assert found.ok
    assert not cf.find_conflicts(found.path, obstacle, zone)
    assert found.delta_v >= found.lower_bound == pytest.approx(cf.least_delta_v(orbit, a, b, 2000.0).lower)
    by_energy = cf.avoid(orbit.transfer(a, b, 2000.0), obstacle, zone)
    assert found.delta_v < by_energy.delta_v


def test_clear_paths():
    """A clear path of minimum delta-v is kept, and a costlier one is replaced."""
    a, b = np.array([0.0, -300.0, 0.0, 0.0, 0.0, 0.0]), np.array([0.0, -100.0, 50.0, 0.0, 0.0, 0.0])
    far = ORBIT.coast([0.0, 5000.0, 0.0, 0.0, 0.0, 0.0], 3000.0)
    least = ORBIT.impulsive(a, b, 3000.0)
    kept = cf.avoid(least, far, cf.Sphere(50.0), cost="delta-v")
    assert np.array_equal(kept.path.arcs, least.arcs)
    assert kept.proven
    assert kept.gap < 1e-8
    changed = cf.avoid(ORBIT.transfer(a, b, 3000.0), far, cf.Sphere(50.0), cost="delta-v")
    assert changed.status == cf.Status.CLEAR
    assert changed.delta_v == pytest.approx(least.delta_v, rel=1e-9)


def test_assignment_by_delta_v():
    """The assignment has the minimum delta-v of all permutations."""
    from itertools import permutations

    rng = np.random.default_rng(2)
    initial, final = rng.normal(size=(2, 4, 6)) * np.array([400.0] * 3 + [0.05] * 3)
    plan = cf.reconfigure(ORBIT, initial, final, 4000.0, cf.Sphere(1.0), assign=True, cost="delta-v")
    costs = cf.least_delta_v(ORBIT, initial[:, None], final, 4000.0).upper
    least = min(sum(costs[i, j] for i, j in enumerate(slots)) for slots in permutations(range(4)))
    assert plan.ok
    assert plan.delta_v == pytest.approx(least, rel=1e-3)  # contacts cost little
    assert plan.lower_bound <= least * (1.0 + 1e-9)


def test_avoidance_from_a_coast():
    """Avoidance from a coast has no relative gap."""
    stays, passes = (
        ORBIT.transfer([0, 100, 0, 0, 0, 0], [0, 100, 0, 0, 0, 0], 3000.0),
        [3, 95, 2, 0.05, 0.1, 0.02],
    )
    obstacle = ORBIT.coast(ORBIT.transition(-1500.0) @ passes, 3000.0)
    found = cf.avoid(stays, obstacle, cf.Sphere(20.0), cost="delta-v")
    assert found.status == cf.Status.AVOIDED
    assert found.lower_bound == 0.0
    assert "nan" not in found.reason


@pytest.mark.parametrize("orbits", [0.5, 0.8, 1.25])
def test_impulses_half_an_orbit_apart(orbits):
    """The plan matches the minimum of each spacecraft alone on a projected circle."""
    n, lasts = ORBIT.mean_motion, orbits * ORBIT.period
    begins = 0.5 * pi * np.arange(4)
    initial, final = (
        50.0
        * np.stack(
            [0.5 * np.sin(p), np.cos(p), np.sin(p), 0.5 * n * np.cos(p), -n * np.sin(p), n * np.cos(p)], 1
        )
        for p in (begins, begins + pi + n * lasts)
    )
    alone = ORBIT.impulsive(initial, final, lasts).delta_v
    plan = cf.reconfigure(ORBIT, initial, final, lasts, cf.Sphere(1e-3), cost="delta-v", assign=False)
    assert plan.direct.delta_v == pytest.approx(alone, rel=1e-9, abs=1e-12)
    assert np.sum(plan.paths.delta_v) == pytest.approx(plan.delta_v, rel=1e-9, abs=1e-12)
    assert plan.delta_v <= 1.0011 * alone.sum() + 1e-12  # 0.1 % for impulses that are too small to be fired
    assert np.abs(plan.direct.position(lasts) - final[:, :3]).max() < 1e-6  # m


def test_end_inside_a_zone():
    stays = ORBIT.coast(np.zeros(6), 1000.0)
    a, b = [0.0, 10.0, 0.0, 0.0, 0.0, 0.0], [0.0, 500.0, 0.0, 0.0, 0.0, 0.0]
    found = cf.avoid(ORBIT.transfer(a, b, 1000.0), stays, cf.Sphere(50.0), cost="delta-v")
    assert found.status == cf.Status.END_INSIDE
    assert found.path is None
