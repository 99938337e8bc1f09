"""Shadow prices of clearance against differences of plans and duals of convex programs."""

import clarabel
import numpy as np
import pytest
from scipy import sparse
from scipy.linalg import expm

import closeform as cf
from bridge import hill
from closeform.planning.delta_v.impulse_solver import ImpulseSolver
from closeform.planning.plan import Contact
from closeform.planning.planner import once
from closeform.planning.problem.problem import Problem
from closeform.planning.problem.scene import Contacts
from delta_v_plans import ORBIT as LOW
from delta_v_plans import passage
from swaps import CRAFT, ORBIT, OTHER, PATH, RADIUS, SPACE, TILT, N, swapping

# Plans end where conditions hold to 1e-11: over a thousandth of a zone that, and the fifth derivative of
# their cost, leave less than a millionth of the slope.
STEP, EXACT = 1e-3, 1e-6


def slope_of(plan_of, step):
    """Return the slope of the cost by central differences at two steps, extrapolated."""

    def slope(h):
        return (plan_of(h).spent - plan_of(-h).spent) / (2.0 * h)

    return (4.0 * slope(step) - slope(2.0 * step)) / 3.0


def grown(zone, normal, metres):
    """Return a smooth ellipsoid that reaches as far along a normal as the padded one."""
    across = np.linalg.inv(zone.matrix.T @ zone.matrix)
    far = np.sqrt(normal @ across @ normal)
    values, axes = np.linalg.eigh((1.0 + metres / far) * (across + far * metres * np.eye(3)))
    return cf.Ellipsoid(np.sqrt(values), axes.T)


@pytest.mark.parametrize(
    "zone", [cf.Sphere(20.0), cf.Sphere(60.0), cf.Sphere(85.0)], ids=lambda z: f"{z.radius:g}"
)
def test_price_of_a_sphere(zone):
    found = cf.avoid(PATH, OTHER, zone)
    assert found.status == cf.Status.AVOIDED
    slope = slope_of(lambda h: cf.avoid(PATH, OTHER, cf.Sphere(zone.radius + h)), STEP * zone.radius)
    assert found.price == pytest.approx(slope, rel=EXACT)
    (price,) = found.prices
    assert (price.first, price.second) == (0, 1)
    assert price.per_factor == pytest.approx(zone.radius * slope, rel=EXACT)


@pytest.mark.parametrize("axes", [np.eye(3), TILT], ids=["upright", "tilted"])
@pytest.mark.parametrize("orbit", [ORBIT, SPACE], ids=["orbit", "deep space"])
def test_price_of_an_ellipsoid(axes, orbit):
    path = orbit.transfer([0, -200, 10, 0, 0, 0], [40, 200, 60, 0, -0.09, 0], 3000.0)
    met = path.state(1350.0) + [3, 4, -5, 0.02, 0, 0.01]
    other = orbit.coast(orbit.transition(-1350.0) @ met, 3000.0)
    zone = cf.Ellipsoid([9.0, 11.0, 10.0], axes)
    found = cf.avoid(path, other, zone)
    (contact,), (price,) = found.contacts, found.prices
    enlarged = slope_of(lambda h: cf.avoid(path, other, zone.enlarged(1.0 + h)), STEP)
    assert price.per_factor == pytest.approx(enlarged, rel=EXACT)
    by_metres = slope_of(lambda h: cf.avoid(path, other, grown(zone, contact.normal, h)), 20.0 * STEP)
    assert found.price == price.per_metre == pytest.approx(by_metres, rel=EXACT)
    assert contact.reach == pytest.approx(zone.support(contact.normal), rel=1e-8)


def test_price_of_a_pair_with_several_contacts():
    """The path touches three times; the price belongs to the pair."""
    zone = cf.Ellipsoid([30.0, 60.0, 37.5])
    found = cf.avoid(PATH, OTHER, zone)
    slope = slope_of(lambda h: cf.avoid(PATH, OTHER, zone.enlarged(1.0 + h)), STEP)
    (price,) = found.prices
    assert len(found.contacts) > 1
    assert price.per_factor == pytest.approx(slope, rel=EXACT)


def test_price_at_an_edge_of_a_box():
    """Two faces are active; a padded box is chamfered there."""
    box = cf.Box([20.0, 20.0, 20.0])
    path = ORBIT.transfer([0, -200, 10, 0, 0, 0], [80, 220, -40, 0, -160 * N, 0.01], 3000.0)
    met = path.state(1350.0) + [9, 4, 12, 0.04, 0.03, -0.04]
    other = ORBIT.coast(ORBIT.transition(-1350.0) @ met, 3000.0)
    found = cf.avoid(path, other, box)
    (contact,) = found.contacts
    assert (np.abs(contact.normal) > 1e-3).sum() > 1  # an edge
    faces = np.concatenate([np.eye(3), -np.eye(3), contact.normal[None]])

    def chamfered(metres):
        reach = [20.0 + metres] * 6 + [box.support(contact.normal) + metres]
        return cf.avoid(path, other, cf.HalfSpaces(faces, reach))

    h = 20.0 * STEP  # a shrunken zone has its edge: there is a slope for more clearance only
    spent = [chamfered(k * h).spent for k in range(4)]
    onward = (-11.0 * spent[0] + 18.0 * spent[1] - 9.0 * spent[2] + 2.0 * spent[3]) / (6.0 * h)
    assert found.price == pytest.approx(onward, rel=1e-5)
    sharp = slope_of(lambda h: cf.avoid(path, other, cf.Box([20.0 + h] * 3)), 20.0 * STEP)
    assert sharp > 1.001 * found.price
    by_factor = slope_of(lambda h: cf.avoid(path, other, box.enlarged(1.0 + h)), STEP)
    assert found.prices[0].per_factor == pytest.approx(by_factor, rel=EXACT)


def pairwise(sizes):
    """Return zones of pairs with individual spheres."""
    table = np.full((CRAFT + 1, CRAFT + 1), -1)
    table[np.triu_indices(CRAFT, 1)] = np.arange(len(sizes))
    return cf.PairZones(tuple(map(cf.Sphere, sizes)), np.arange(CRAFT), table, np.ones(CRAFT, dtype=bool))


def test_prices_of_a_formation():
    initial = swapping()
    pairs = list(zip(*np.triu_indices(CRAFT, 1), strict=True))
    sizes = np.full(len(pairs), RADIUS)

    def plan(sizes):
        return cf.reconfigure(ORBIT, initial, -initial, 1500.0, pairwise(sizes))

    found = plan(sizes)
    assert len(found.prices) >= 5
    assert list(found.prices) == sorted(found.prices, key=lambda price: -price.per_metre)
    for price in found.prices[:4]:
        unit = np.eye(len(pairs))[pairs.index((price.first, price.second))]
        slope = slope_of(lambda h, unit=unit: plan(sizes + h * unit), RADIUS * STEP)
        assert price.per_metre == pytest.approx(slope, rel=EXACT)
        assert price.per_factor == pytest.approx(RADIUS * price.per_metre, rel=1e-8)
    together = slope_of(lambda h: plan(sizes + h), RADIUS * STEP)
    assert found.price == pytest.approx(together, rel=EXACT)


def test_price_agrees_with_the_dual_of_a_quadratic_program():
    """Thrust is constant on 300 pieces, with the planes of the plan."""
    zone, nodes = cf.Ellipsoid([30.0, 60.0, 37.5]), 300
    found = cf.avoid(PATH, OTHER, zone)
    ends = np.unique([*np.linspace(0.0, 3000.0, nodes + 1), *(one.time for one in found.contacts)])
    motion, steps = hill(N), np.diff(ends)

    def pushed(time):  # state at a time from each piece of thrust, rows of position and velocity
        rows = np.zeros((6, 3 * len(steps)))
        for k, (start, step) in enumerate(zip(ends, steps, strict=False)):
            if start < time:
                block = expm(np.block([[motion, np.eye(6)[:, 3:]], [np.zeros((3, 9))]]) * step)[:6, 6:]
                rows[:, 3 * k : 3 * k + 3] = expm(motion * (time - start - step)) @ block
        return rows

    start, last = PATH.state(0.0), PATH.state(3000.0)
    equal, target = pushed(3000.0), last - expm(motion * 3000.0) @ start
    planes, floors = [], []
    for one in found.contacts:
        planes.append(one.normal @ pushed(one.time)[:3])
        drift = (expm(motion * one.time) @ start)[:3] - OTHER.position(one.time)
        floors.append(one.reach - one.normal @ drift)
    scale = np.array([1e-3] * 3 + [1.0] * 3)
    size = 1e4  # thrust in 0.1 mm/s^2
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    solved = clarabel.DefaultSolver(
        sparse.csc_matrix(np.diag(np.repeat(steps, 3))),
        np.zeros(3 * len(steps)),
        sparse.csc_matrix(np.vstack([scale[:, None] * equal, -np.array(planes) * 1e-2])),
        size * np.concatenate([scale * target, -np.array(floors) * 1e-2]),
        [clarabel.ZeroConeT(6), clarabel.NonnegativeConeT(len(planes))],
        settings,
    ).solve()
    multipliers = np.array(solved.z)[6:] * 1e-2 / size
    # held thrust costs a few parts in 300^2 more than thrust that bends freely
    assert multipliers == pytest.approx([one.multiplier for one in found.contacts], rel=2e-3)


def test_delta_v_price_agrees_with_the_dual_of_a_cone_program():
    """Impulses on a grid of 400 keep the planes of the plan."""
    a, b, duration, obstacle, radius = passage(3)
    orbit = obstacle.orbit
    found = cf.avoid(orbit.transfer(a, b, duration), obstacle, cf.Sphere(radius), cost="delta-v")
    assert found.status == cf.Status.AVOIDED
    motion = hill(orbit.mean_motion)
    times = np.union1d(np.linspace(0.0, duration, 401), [t for t, _ in found.path.impulses])
    count, planes, floors = len(times), [], []
    for one in found.contacts:
        rows = [
            one.normal @ expm(motion * (one.time - t))[:3, 3:] if t < one.time else np.zeros(3) for t in times
        ]
        planes.append(np.concatenate(rows))
        drift = (expm(motion * one.time) @ a)[:3] - obstacle.position(one.time)
        floors.append(one.reach - one.normal @ drift)
    equal = np.hstack([expm(motion * (duration - t))[:, 3:] for t in times])
    scale = np.array([1.0 / duration] * 3 + [1.0] * 3)
    rows = np.vstack([scale[:, None] * equal, -np.array(planes) / duration])
    right = np.concatenate([scale * (b - expm(motion * duration) @ a), -np.array(floors) / duration])
    wide = np.zeros((len(rows), 4 * count))
    for axis in range(3):
        wide[:, axis + 1 :: 4] = rows[:, axis::3]
    cost = np.zeros(4 * count)
    cost[::4] = 1.0
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    kinds = [clarabel.ZeroConeT(6), clarabel.NonnegativeConeT(len(planes))]
    solved = clarabel.DefaultSolver(
        sparse.csc_matrix((4 * count, 4 * count)),
        cost,
        sparse.csc_matrix(np.vstack([wide, -np.eye(4 * count)])),
        np.concatenate([right, np.zeros(4 * count)]),
        kinds + [clarabel.SecondOrderConeT(4)] * count,
        settings,
    ).solve()
    multipliers = np.array(solved.z)[6 : 6 + len(planes)] / duration
    # a primer that may be 1e-6 above 1 leaves multipliers open to about a hundredth
    assert found.price == pytest.approx(multipliers.sum(), rel=1e-2)


@pytest.mark.parametrize("seed", range(4))
def test_delta_v_price_agrees_with_differences(seed):
    """Plans of impulses are within 1e-6 of the optimum, which limits the differences."""
    a, b, duration, obstacle, radius = passage(seed)
    path, step = LOW.transfer(a, b, duration), 0.01 * radius

    def plan(h):
        return cf.avoid(path, obstacle, cf.Sphere(radius + h), cost="delta-v")

    found = plan(0.0)
    slope = (plan(step).spent - plan(-step).spent) / (2.0 * step)
    assert found.price == pytest.approx(slope, rel=0.02, abs=5e-6 * found.spent / step)


def test_degenerate_optimum_has_no_price():
    """One of several optimal plans is clear, also of a larger sphere."""
    rng = np.random.default_rng(5)
    for _ in range(60):
        a, b, duration, obstacle, radius = passage(int(rng.integers(1 << 30)))
        free = cf.least_delta_v(LOW, a, b, duration)
        found = cf.avoid(LOW.transfer(a, b, duration), obstacle, cf.Sphere(radius), cost="delta-v")
        if found.ok and found.delta_v < free.upper * (1.0 + 1e-7):
            break
    assert found.contacts or found.status == cf.Status.CLEAR
    assert found.price * radius < 1e-4 * found.delta_v


def test_plans_that_are_not_optimal_have_no_price():
    """Sauter and Palmer deviations, and sequential planning."""
    paper = cf.avoid(PATH, OTHER, cf.Sphere(30.0), method="sauter-palmer")
    assert paper.ok
    assert paper.contacts
    assert paper.prices == ()
    assert np.isnan(paper.price)
    initial = swapping()
    task = ORBIT, initial, -initial, 1500.0, cf.Sphere(RADIUS)
    apart = cf.reconfigure(*task, method="sequential", if_blocked=())
    assert apart.ok
    assert apart.contacts
    assert np.isnan(apart.price)


def test_price_without_contacts_is_zero():
    clear = cf.avoid(PATH, OTHER, cf.Sphere(3.0))
    assert clear.status == cf.Status.CLEAR
    assert clear.price == 0.0
    assert clear.prices == ()
    assert np.isnan(cf.avoid(PATH, OTHER, cf.Sphere(1000.0)).price)


def test_equal_contacts_are_merged():
    """A plane that is held twice has the sum of both multipliers."""

    def touch(second, time, normal, multiplier, failed_at=np.nan):
        return Contact(time, 0, second, np.zeros(3), np.array(normal), multiplier, 10.0, failed_at, 0.0)

    across = [0.0, 1.0, 0.0]
    contacts = touch(1, 10.0, [1.0, 0.0, 0.0], 5.0), touch(2, 20.0, across, 2.0), touch(2, 20.0, across, 3.0)
    assert [(one.second, one.time, one.multiplier) for one in once(contacts)] == [
        (1, 10.0, 5.0),
        (2, 20.0, 5.0),
    ]
    lost = touch(2, 20.0, across, 3.0, 4.0)  # after thrust was lost
    assert len(once((*contacts, lost))) == 3


@pytest.mark.parametrize("orbit", [LOW, cf.Orbit(0.0)], ids=["orbit", "deep space"])
def test_planes_met_without_thrust_have_no_price(orbit):
    stays = orbit.coast([0.0, 100.0, 0.0, 0.0, 0.0, 0.0], 1000.0)
    obstacle = orbit.coast(np.zeros(6), 1000.0)
    problem = Problem.of(cf.stack([stays]), cf.stack([obstacle]), [(cf.Sphere(10.0), np.array([[0, 1]]))])
    solver = ImpulseSolver(problem, (None,), ("stays",))
    contacts = Contacts.at(np.zeros(2, dtype=np.int64), np.array([300.0, 600.0]), np.zeros((2, 2)))
    contacts = contacts._replace(normals=np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]))
    planes = solver.planes(contacts, 1.0)._replace(misses=np.zeros(2))
    found = solver.dual(solver.fleet(solver.grid), planes, 1e-5, np.inf)
    assert found.cost == 0.0
    assert found.multipliers.tolist() == [0.0, 0.0]
    assert not found.impulses.any()
