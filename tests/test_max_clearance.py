"""Largest zones within a budget, and costs of zones of many sizes."""

import numpy as np
import pytest

import closeform as cf
from closeform.planning.max_clearance import ClearanceStatus
from delta_v_plans import passage
from swaps import OTHER, PATH, TILT, swapping

ORBIT, SPACE = PATH.orbit, cf.Orbit(0.0)
ZONE = cf.Ellipsoid([20.0, 40.0, 25.0], TILT)
FORMATION = ORBIT.transfer(swapping(), -swapping(), 1500.0)


@pytest.mark.parametrize("share", [0.001, 0.3])
def test_largest_zone_uses_the_budget(share):
    budget = (1.0 + share) * PATH.energy
    most = cf.max_clearance(PATH, OTHER, ZONE, budget)
    assert most.ok
    assert most.status == ClearanceStatus.BUDGET
    assert most.budget == budget
    again = cf.avoid(PATH, OTHER, ZONE.enlarged(most.factor))
    assert again.energy == pytest.approx(most.plan.energy, rel=1e-12)
    assert budget - 2e-6 * share * PATH.energy <= again.energy <= budget
    assert cf.find_conflicts(most.plan.path, OTHER, ZONE.enlarged(most.factor)) == ()
    for more in (1.0 + 1e-5, 1.001, 1.05):  # larger zones cost more
        assert cf.avoid(PATH, OTHER, ZONE.enlarged(most.factor * more)).energy > budget
    assert most.tried <= 12


def test_metres_hold_in_every_direction():
    most = cf.max_clearance(PATH, OTHER, ZONE, 1.05 * PATH.energy)
    ways = np.random.default_rng(3).normal(size=(20_000, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    more = ZONE.enlarged(most.factor).support(ways) - ZONE.support(ways)
    assert more.min() >= most.metres
    assert more.min() == pytest.approx(most.metres, rel=1e-3)  # resolution of 20 000 directions


def test_small_budget_gives_a_smaller_zone():
    """The remaining zone is the closest approach of the direct path."""
    most = cf.max_clearance(PATH, OTHER, ZONE, PATH.energy)
    # the cost rises with the square of the excess, and 1e-12 of it counts as rounding
    assert most.factor == pytest.approx(cf.closest_approach(PATH, OTHER, ZONE).ratio, rel=1e-4)
    assert most.metres < 0.0
    none = cf.max_clearance(PATH, OTHER, ZONE, 0.99 * PATH.energy)
    assert not none.ok
    assert none.plan is None
    assert np.isnan(none.factor)
    assert none.status == ClearanceStatus.TOO_LITTLE
    assert f"{PATH.energy:.6g}" in none.reason


def test_end_of_the_path_limits_the_zone():
    """A departing spacecraft is closest at its start."""
    path = SPACE.transfer([0, 100, 0, 0, 0, 0], [0, 300, 0, 0, 0, 0], 1000.0)
    other = SPACE.coast(np.zeros(6), 1000.0)
    most = cf.max_clearance(path, other, cf.Sphere(30.0), 2.0 * path.energy, names=["Target"])
    assert most.status == ClearanceStatus.END_INSIDE
    assert most.factor == pytest.approx(100.0 / 30.0, rel=1e-6)
    assert most.factor < 100.0 / 30.0
    assert most.plan.status == cf.Status.CLEAR
    assert "start" in most.reason
    assert "Target" in most.reason


def test_jump_of_the_cost_limits_the_zone():
    """The gap between two walls closes as they grow; the way around both costs far more."""
    path = SPACE.transfer([-500, 0, 0, 1, 0, 0], [500, 0, 0, 1, 0, 0], 1000.0)
    walls = SPACE.coast(np.array([[0, y, 0, 0, 0, 0] for y in (-60.0, 61.0)]), 1000.0)
    zone = cf.Cylinder(40.0, 1000.0, [0.0, 0.0, 1.0])
    most = cf.max_clearance(path, walls, zone, 1e-4)
    assert most.status == ClearanceStatus.NO_WAY
    assert most.factor == pytest.approx(60.5 / 40.0, rel=1e-6)  # half of the gap between their axes
    assert most.plan.energy < 1e-6
    assert cf.find_conflicts(most.plan.path, walls[0], zone.enlarged(most.factor)) == ()
    assert cf.find_conflicts(most.plan.path, walls[1], zone.enlarged(most.factor)) == ()
    beyond = cf.avoid(path, walls, zone.enlarged(most.factor * (1.0 + 1e-6)))
    assert beyond.energy > 1e-3


def test_zone_is_unlimited_without_an_encounter():
    """A spacecraft that comes later is not met, however large its zone."""
    later = ORBIT.coast(OTHER.state(0.0), 1000.0, start=5000.0)
    most = cf.max_clearance(PATH, later, ZONE, 2.0 * PATH.energy)
    assert most.ok
    assert most.status == ClearanceStatus.NEVER_NEAR
    assert most.factor > 1e5


def test_largest_zone_for_delta_v():
    a, b, duration, obstacle, radius = passage(2)
    path, zone = obstacle.orbit.transfer(a, b, duration), cf.Sphere(radius)
    budget = 1.05 * cf.least_delta_v(obstacle.orbit, a, b, duration).upper
    most = cf.max_clearance(path, obstacle, zone, budget, cost="delta-v")
    assert most.ok
    assert most.plan.cost == "delta-v"
    assert most.plan.delta_v <= budget
    places = most.plan.path.position(np.linspace(0.0, duration, 5001))
    apart = np.linalg.norm(places - obstacle.position(np.linspace(0.0, duration, 5001)), axis=1)
    assert apart.min() >= most.factor * radius * (1.0 - 1e-8)
    assert most.metres == pytest.approx((most.factor - 1.0) * radius)
    larger = cf.avoid(path, obstacle, zone.enlarged(1.02 * most.factor), cost="delta-v")
    assert not larger.ok or larger.delta_v > budget


def test_largest_zone_of_a_formation():
    zone = cf.Sphere(18.0)
    budget = 1.03 * FORMATION.energy.sum()
    most = cf.max_clearance(FORMATION, (), zone, budget)
    assert most.status == ClearanceStatus.BUDGET
    assert most.plan.energy == pytest.approx(budget, rel=1e-6)
    assert len(cf.screen(most.plan.paths, zone.enlarged(most.factor))) == 0
    assert most.metres == pytest.approx(18.0 * (most.factor - 1.0))
    larger = cf.reconfigure(ORBIT, swapping(), -swapping(), 1500.0, zone.enlarged(1.001 * most.factor))
    assert larger.energy > budget


KNOWN = cf.Uncertainty(np.diag([1.0, 2.0, 1.0, 2e-3, 2e-3, 2e-3]) ** 2)


@pytest.mark.parametrize("share", [0.02])
def test_sigmas_within_a_budget(share):
    """The sigmas of the plan agree with its clearance; 0.1 % more exceeds the budget."""
    budget = (1.0 + share) * PATH.energy
    zone = cf.Sphere(20.0)
    most = cf.max_clearance(PATH, OTHER, zone, budget, errors=KNOWN, other_errors=KNOWN)
    assert most.status == ClearanceStatus.BUDGET
    assert (most.factor, most.metres) == (1.0, 0.0)
    assert budget - 2e-6 * share * PATH.energy <= most.plan.energy <= budget
    clear = cf.clearance_in_sigmas(most.plan.path, OTHER, zone, KNOWN, KNOWN).sigmas
    assert most.sigmas <= clear <= most.sigmas * (1 + 1e-3)
    kept = {"errors": KNOWN, "other_errors": KNOWN, "sigmas": 1.001 * most.sigmas}
    assert cf.avoid(PATH, OTHER, zone, **kept).energy > budget
    assert most.tried <= 12


@pytest.mark.slow
def test_sigmas_of_a_formation_within_a_budget():
    budget = 1.05 * FORMATION.energy.sum()
    most = cf.max_clearance(FORMATION, (), cf.Sphere(12.0), budget, errors=[KNOWN] * 7 + [None])
    assert most.ok
    assert most.plan.energy == pytest.approx(budget, rel=1e-6)
    found = [
        cf.clearance_in_sigmas(
            most.plan.paths[i], most.plan.paths[j], cf.Sphere(12.0), KNOWN, KNOWN if j < 7 else None
        )
        for i, j in zip(*np.triu_indices(8, 1), strict=True)
    ]
    assert min(one.sigmas for one in found) == pytest.approx(most.sigmas, rel=1e-3)


@pytest.mark.slow
def test_sigmas_within_a_budget_of_delta_v():
    free = cf.avoid(PATH, OTHER, cf.Sphere(20.0), cost="delta-v").lower_bound
    spent = cf.max_clearance(PATH, OTHER, cf.Sphere(20.0), 1.2 * free, cost="delta-v", errors=KNOWN)
    assert spent.ok
    assert spent.plan.delta_v <= 1.2 * free
    least = cf.clearance_in_sigmas(spent.plan.path, OTHER, cf.Sphere(20.0), KNOWN).sigmas
    assert spent.sigmas <= least * (1 + 1e-9)
    assert spent.sigmas > 0.0


def test_limits_of_sigmas():
    none = cf.max_clearance(
        PATH, OTHER, ZONE, PATH.energy, errors=KNOWN
    )  # the zone itself exceeds the budget
    assert (none.status, none.plan) == (ClearanceStatus.NO_WAY, None)
    assert none.reason.startswith("at no sigma they cost ")
    assert np.isnan(none.sigmas)
    across = cf.Uncertainty(np.diag([0, 0, 1.0, 0, 0, 1e-6]))  # has no effect along the track
    hold, client = ORBIT.coast([0, 200, 0, 0, 0, 0], 3000.0), ORBIT.coast(np.zeros(6), 3000.0)
    free = cf.max_clearance(hold, client, cf.Sphere(20.0), 1e-6, errors=across)
    assert free.status == ClearanceStatus.NEVER_NEAR
    assert (free.reason, free.sigmas) == ("no conflict at 10 000 sigmas", 10_000.0)
    exact = cf.max_clearance(PATH, OTHER, cf.Sphere(1.0), 2.0 * PATH.energy, errors=cf.Uncertainty())
    assert (exact.status, exact.sigmas) == (ClearanceStatus.NEVER_NEAR, 10_000.0)
    with pytest.raises(
        ValueError, match=r"^other_errors: is for one spacecraft; for a formation append them to errors"
    ):
        cf.max_clearance(FORMATION, (), ZONE, 1.0, other_errors=KNOWN)


def test_clearance_cost_curve():
    factors = [0.01, 0.5, 1.0, 2.0, 1e3]
    found = cf.clearance_cost_curve(PATH, OTHER, ZONE, factors)
    assert found.free == pytest.approx(PATH.energy, rel=1e-12)
    assert found.spent[0] == pytest.approx(found.free, rel=1e-12)
    assert found.slope[0] == 0.0
    assert (np.diff(found.spent[:4]) > 0.0).all()
    assert np.isnan(found.spent[4])
    assert not found.plans[4].ok
    h = 1e-3
    sides = cf.clearance_cost_curve(PATH, OTHER, ZONE, [2.0 - h, 2.0 + h])
    assert found.slope[3] == pytest.approx(np.diff(sides.spent)[0] / (2.0 * h), rel=1e-5)
    assert found.metres == pytest.approx((np.array(factors) - 1.0) * 20.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((PATH, OTHER, ZONE, 0.0), "^budget: must be positive and finite, got 0.0"),
        ((PATH, OTHER, ZONE, np.inf), "^budget: must be positive and finite, got inf"),
        ((PATH, (), ZONE, 1.0), "^obstacles: give at least one path"),
        ((FORMATION, (), [None] * 8, 1.0), "^zone: no pair has a zone; give at least one"),
        ((FORMATION[None], OTHER, ZONE, 1.0), "^path: requires one craft or shape"),
    ],
)
def test_invalid_input_is_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        cf.max_clearance(*arguments)


def test_factors_are_positive():
    for bad in ([], 1.0, [0.0], [np.inf], [[1.0]]):
        with pytest.raises(ValueError, match=r"^factors: expected shape"):
            cf.clearance_cost_curve(PATH, OTHER, ZONE, bad)


WEDGE = cf.HalfSpaces([[0.0, 1.0, 0.2], [0.3, -1.0, 0.1]], [30.0, 11.0])


@pytest.mark.parametrize(
    "zone",
    [cf.Sphere(7.0), ZONE, cf.Box([5.0, 9.0, 4.0], TILT), cf.Cylinder(9.0, 20.0, [1.0, 2.0, 0.5]), WEDGE],
    ids=["sphere", "ellipsoid", "box", "cylinder", "half-spaces"],
)
def test_inner_radius_of_a_zone(zone):
    ways = np.random.default_rng(8).normal(size=(50_000, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    nearest = 1.0 / zone.norm(ways).max()  # the nearest direction is within 0.02 rad
    assert zone.inner_radius <= nearest * (1.0 + 1e-12)
    assert zone.inner_radius == pytest.approx(nearest, rel=2e-4)
