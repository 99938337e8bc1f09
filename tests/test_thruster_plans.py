"""Plans with thrusters against linear programs on fine grids and an integrator."""

from math import pi

import clarabel
import numpy as np
import pytest
from scipy import sparse
from scipy.linalg import expm
from scipy.optimize import nnls

import closeform as cf
import passages
from bridge import hill
from delta_v_plans import flown, passage
from formations import LOW_ORBIT, cases

ORBIT = LOW_ORBIT
GRID = 241  # firing times of the linear program
NEAR = 1.3  # clearance ratio below which the linear program keeps a plane
BY_THRUSTERS = 5e-4  # relative advantage of the linear program, whose planes are those of the plan
SIX = cf.Thrusters.rtn()
TO_STARS = cf.Thrusters.rtn(frame="inertial")
FOUR = cf.Thrusters(np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3.0))
SKEW = cf.Thrusters(FOUR.directions[:, [1, 2, 0]] @ np.diag([1.0, -1.0, 1.0]), "inertial")


def directions_at(thrusters, t):
    """Return directions (m, 3) in orbit axes; inertial ones rotate against the orbit."""
    if thrusters.frame == "orbit":
        return thrusters.directions
    angle = ORBIT.mean_motion * t
    back = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0, 0, 1.0]])
    return thrusters.directions @ back  # rows times the matrix of +angle: each row turned by -angle


def least_by_thrusters(path, obstacle, radius, a, b, duration, thrusters):
    """Return the least cost on a grid with the planes of a path near a sphere (linear program)."""
    motion = hill(ORBIT.mean_motion)
    times = np.union1d(np.linspace(0.0, duration, GRID), [t for t, _ in path.impulses])
    ways = [directions_at(thrusters, t).T for t in times]  # (3, m) each
    equal = np.hstack([expm(motion * (duration - t))[:, 3:] @ d for t, d in zip(times, ways, strict=True)])
    target = b - expm(motion * duration) @ a
    planes, floors = [], []
    for t in times:
        apart = path.position(t) - obstacle.position(t)
        size = np.linalg.norm(apart)
        if size < NEAR * radius:
            normal = apart / size
            row = [
                normal @ expm(motion * (t - s))[:3, 3:] @ d if s < t else np.zeros(d.shape[1])
                for s, d in zip(times, ways, strict=True)
            ]
            planes.append(np.concatenate(row) / duration)
            drift = (expm(motion * t) @ a)[:3] - obstacle.position(t)
            floors.append((min(radius, size) - normal @ drift) / duration)
    scale = np.array([1.0 / duration] * 3 + [1.0] * 3)
    count = equal.shape[1]
    rows = np.vstack([scale[:, None] * equal, -np.array(planes).reshape(-1, count), -np.eye(count)])
    right = np.concatenate([scale * target, -np.array(floors), np.zeros(count)])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    kinds = [clarabel.ZeroConeT(6), clarabel.NonnegativeConeT(len(planes) + count)]
    nothing = sparse.csc_matrix((count, count))
    found = clarabel.DefaultSolver(
        nothing, np.ones(count), sparse.csc_matrix(rows), right, kinds, settings
    ).solve()
    assert str(found.status) == "Solved"
    return found.obj_val


def least_spent_by(thrusters, impulses):
    """Return the least sum of firings that realise impulses; None if there is none."""
    total = 0.0
    for t, v in impulses:
        ways = directions_at(thrusters, t).T
        sizes, left = nnls(ways, v)
        if left > 1e-9 * np.linalg.norm(v):
            return None
        total += sizes.sum()
    return total


@pytest.mark.parametrize(
    ("seed", "thrusters"),
    [
        pytest.param(0, SIX, id="six"),
        pytest.param(0, SKEW, id="skew"),
        *(
            pytest.param(seed, own, marks=pytest.mark.slow, id=f"{name}-{seed}")
            for seed, name, own in (
                (0, "stars", TO_STARS),
                (0, "four", FOUR),
                (1, "six", SIX),
                (1, "skew", SKEW),
            )
        ),
    ],
)
def test_cost_reaches_that_of_a_linear_program(seed, thrusters):
    a, b, duration, obstacle, radius = passage(seed, thrusters)
    alone = ORBIT.impulsive(a, b, duration, thrusters=thrusters)
    task = ORBIT.transfer(a, b, duration), obstacle, cf.Sphere(radius)
    assert cf.find_conflicts(alone, obstacle, cf.Sphere(radius))
    found = cf.avoid(*task, cost="delta-v", thrusters=thrusters)
    assert found.status == cf.Status.AVOIDED
    spent = least_spent_by(thrusters, found.path.impulses)
    # four thrusters realise an impulse in one way; of six, no two opposed ones fire
    assert spent == pytest.approx(found.delta_v, rel=1e-9)
    assert found.spent == found.delta_v >= found.path.delta_v * (1.0 - 1e-12)
    assert found.lower_bound == pytest.approx(least_spent_by(thrusters, alone.impulses), rel=1e-8)
    assert len(found.path.impulses) <= 6 + len(found.contacts)
    times = np.linspace(0.0, duration, 4001)
    places, end = flown(found.path, times)
    assert np.abs(end - b)[:3].max() < 1e-6  # [m]: the integrator's
    assert np.abs(end - b)[3:].max() < 1e-9
    assert np.linalg.norm(places - obstacle.position(times), axis=1).min() > radius * (1.0 - 1e-8)
    cheapest = least_by_thrusters(found.path, obstacle, radius, a, b, duration, thrusters)
    assert found.delta_v <= (1.0 + BY_THRUSTERS) * cheapest


def test_planning_with_thrusters_costs_less_than_splitting_impulses():
    ratios, increases = [], []
    for seed in range(3):
        a, b, duration, obstacle, radius = passage(seed)
        task = ORBIT.transfer(a, b, duration), obstacle, cf.Sphere(radius)
        free = cf.avoid(*task, cost="delta-v")
        own = cf.avoid(*task, cost="delta-v", thrusters=SIX)
        ratios.append(least_spent_by(SIX, free.path.impulses) / own.delta_v)
        increases.append(own.delta_v / free.delta_v)
    assert min(ratios) > 1.0
    assert np.median(ratios) > 1.1
    assert 1.1 < np.median(increases) < np.sqrt(3.0)


def test_formation_with_individual_thrusters():
    """Eight spacecraft on a ring cross its centre, each with its own thrusters, one without."""
    angles = 2.0 * pi * np.arange(8) / 8
    ring = np.zeros((8, 6))
    ring[:, 1], ring[:, 2] = 120.0 * np.cos(angles), 120.0 * np.sin(angles)
    quarter, own = ORBIT.period / 4.0, [SIX, TO_STARS, FOUR, SKEW, SIX, TO_STARS, FOUR, None]
    plan = cf.reconfigure(ORBIT, ring, -ring, quarter, cf.Sphere(15.0), cost="delta-v", thrusters=own)
    assert plan.ok
    assert plan.contacts
    assert len(cf.screen(plan.paths, cf.Sphere(15.0))) == 0
    spent = [
        path.delta_v if set_ is None else least_spent_by(set_, path.impulses)
        for set_, path in zip(own, plan.paths, strict=True)
    ]
    assert sum(spent) == pytest.approx(plan.delta_v, rel=1e-9)
    alone = [ORBIT.impulsive(s, -s, quarter, thrusters=set_) for s, set_ in zip(ring, own, strict=True)]
    least = [
        p.delta_v if t is None else least_spent_by(t, p.impulses) for t, p in zip(own, alone, strict=True)
    ]
    assert plan.lower_bound == pytest.approx(sum(least), rel=1e-8)
    assert plan.lower_bound <= plan.delta_v < 1.1 * plan.lower_bound
    for place, path in zip(-ring, plan.paths, strict=True):
        _, end = flown(path, np.linspace(0.0, quarter, 5))
        assert np.abs(end - place)[:3].max() < 1e-6
        assert np.abs(end - place)[3:].max() < 1e-9


@pytest.mark.parametrize(
    "number", [pytest.param(k, marks=pytest.mark.slow) for k in (7, 12, 33, 45)]
)  # boxes, spheres, time windows and deep space
def test_random_formations(number):
    task = list(cases())[number]
    plan = cf.reconfigure(**task.arguments, cost="delta-v", thrusters=TO_STARS)
    assert plan.ok
    assert plan.lower_bound * (1.0 - 1e-12) <= plan.delta_v
    assert len(cf.screen(plan.paths, task.zone)) == 0
    orbit = task.arguments["orbit"]
    total = 0.0
    for k, path in enumerate(plan.paths):
        scale = np.abs(task.final[k, :3]).max()
        assert np.abs(path.state(task.ends[k]) - task.final[k])[:3].max() < 1e-9 * scale + 1e-7
        for t, v in path.impulses:
            total += nnls(TO_STARS.directions_at(orbit, t).T, v)[0].sum()
    assert total == pytest.approx(plan.delta_v, rel=1e-9)


@pytest.mark.slow
def test_along_track_thrusters_alone():
    """They control four of six states; a slab cannot be avoided with them."""
    along = cf.Thrusters([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])
    a, b = np.array([0.0, -300.0, 0.0, 0.0, 0.0, 0.0]), np.array([0.0, 300.0, 0.0, 0.0, 0.0, 0.0])
    obstacle, duration = ORBIT.coast(np.zeros(6), 7000.0), 7000.0
    task = ORBIT.impulsive(a, b, duration), obstacle, cf.Sphere(150.0)
    found = cf.avoid(*task, cost="delta-v", thrusters=along)
    assert found.status == cf.Status.AVOIDED
    assert all(v[0] == v[2] == 0.0 for _, v in found.path.impulses)
    assert not cf.find_conflicts(found.path, *task[1:])
    _, end = flown(found.path, np.linspace(0.0, duration, 5))
    assert np.abs(end - b)[:3].max() < 1e-6
    assert cf.avoid(*task, cost="delta-v").delta_v < found.delta_v
    falls = ORBIT.coast([0.0, 0.0, 100.0, 0.0, 0.0, 0.0], 4000.0)  # a slab sweeps the whole region
    slab = cf.HalfSpaces([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]], [10.0, 10.0])
    none = cf.avoid(ORBIT.impulsive(a, b, 4000.0), falls, slab, cost="delta-v", thrusters=SIX)
    assert none.status == cf.Status.NOT_FOUND
    assert none.path is None


def test_frames_are_equal_in_deep_space():
    orbit = cf.Orbit(0.0)
    a, b = np.array([0.0, -300.0, 5.0, 0.0, 0.0, 0.0]), np.array([10.0, 300.0, -4.0, 0.0, 0.0, 0.0])
    task = orbit.impulsive(a, b, 2000.0), orbit.coast(np.zeros(6), 2000.0), cf.Sphere(30.0)
    here, there = (cf.avoid(*task, cost="delta-v", thrusters=own) for own in (SIX, TO_STARS))
    assert here.status == cf.Status.AVOIDED
    assert here.delta_v == pytest.approx(there.delta_v, rel=1e-12)


def test_clear_path_is_replanned_for_thrusters():
    a, b = np.array([0.0, -300.0, 0.0, 0.0, 0.0, 0.0]), np.array([0.0, -100.0, 50.0, 0.0, 0.0, 0.0])
    far = ORBIT.coast([0.0, 5000.0, 0.0, 0.0, 0.0, 0.0], 3000.0)
    free = ORBIT.impulsive(a, b, 3000.0)
    found = cf.avoid(free, far, cf.Sphere(50.0), cost="delta-v", thrusters=SIX)
    assert found.status == cf.Status.CLEAR
    assert found.proven
    least = ORBIT.impulsive(a, b, 3000.0, thrusters=SIX)
    assert found.delta_v == pytest.approx(least_spent_by(SIX, least.impulses), rel=1e-9)
    assert least_spent_by(SIX, free.impulses) > found.delta_v


def test_assignment_respects_the_thrusters():
    """A spacecraft without cross-track thrust stays in its plane."""
    flat = cf.Thrusters(SIX.directions[:4])
    initial = np.zeros((2, 6))
    initial[:, 1] = [0.0, 200.0]
    places = np.array([[0.0, 0.0, 60.0, 0.0, 0.0, 0.0], [0.0, 260.0, 0.0, 0.0, 0.0, 0.0]])
    task = ORBIT, initial, places, 4000.0, cf.Sphere(5.0)
    plan = cf.reconfigure(*task, assign=True, cost="delta-v", thrusters=[flat, SIX])
    assert plan.ok
    assert plan.slots.tolist() == [1, 0]
    freely = cf.reconfigure(*task, assign=True, cost="delta-v")
    assert freely.slots.tolist() == [0, 1]


def test_box_in_deep_space_is_passed_at_minimum_cost():
    """The free optimum is a bound that a clear plan reaches."""
    orbit, duration = cf.Orbit(0.0), 4715.0
    a, b = [369.8, -142.0, -279.7, 0.046, -0.023, 0.03], [56.1, 43.3, -66.6, 0.006, 0.084, 0.014]
    other = orbit.coast([531.1, -158.4, -515.8, -0.1309, 0.0214, 0.1331], duration)
    box, path = cf.Box([29.0, 47.0, 42.0]), orbit.impulsive(a, b, duration)
    plan = cf.avoid(path, other, box, cost="delta-v", thrusters=SIX)
    assert plan.ok
    assert plan.delta_v <= 1.001 * plan.lower_bound
    assert not cf.find_conflicts(plan.path, other, box)


def test_impulses_respect_the_minimum_bit():
    """Four spacecraft widen their circle; dropping impulses below 20 mm/s would miss by 248 m."""
    duration = 0.6 * ORBIT.period
    given = {"cost": "delta-v"}
    ends = [cf.targets.projected_circular(ORBIT, 4, radius) for radius in (60.0, 150.0)]
    six = cf.Thrusters.rtn(acceleration=0.5 / 12.0, minimum_bit=0.02)
    free = cf.reconfigure(ORBIT, *ends, duration, cf.Sphere(20.0), thrusters=SIX, **given)
    plan = cf.reconfigure(ORBIT, *ends, duration, cf.Sphere(20.0), thrusters=six, **given)
    for k in range(4):
        x = ends[0][k]
        before = 0.0
        for t, push in plan.paths[k].impulses:
            assert np.abs(push[push != 0.0]).min() >= 0.02
            x = expm(hill(ORBIT.mean_motion) * (t - before)) @ x + np.concatenate([np.zeros(3), push])
            before = t
        off = expm(hill(ORBIT.mean_motion) * (duration - before)) @ x - ends[1][k]
        assert np.abs(off[:3]).max() < 1e-5
    assert cf.screen(plan.paths, cf.Sphere(20.0)).conflicts == ()
    assert free.lower_bound * (1.0 - 1e-6) <= plan.delta_v < 1.1 * free.delta_v
    assert not len(cf.fire_thrusters(plan, six).dropped)


def test_excessive_minimum_bit_is_reported():
    """A move of 1 m needs mm/s; a bit of 50 m/s is impossible."""
    coarse = cf.Thrusters.rtn(minimum_bit=50.0)
    given = {"cost": "delta-v", "thrusters": coarse}
    ends = np.zeros((1, 6)), [[0, 0, 1.0, 0, 0, 0]]
    move = cf.reconfigure(ORBIT, *ends, 0.4 * ORBIT.period, (None,), **given)
    assert move.ok
    assert "minimum_bit" in move.reason


def test_plan_at_the_cost_without_zones_is_clear():
    """Of equally cheap optima one is in conflict, and BLAS kernels decide which one a solver finds."""
    task = passages.passage("one box", 16)
    path = task.orbit.impulsive(task.initial, task.final, task.duration)
    plan = cf.avoid(path, task.obstacles, task.zones, cost="delta-v", thrusters=SIX)
    assert plan.proven
    assert (plan.status, plan.contacts) == (cf.Status.CLEAR, ())
    assert not task.conflicts(plan.path)
