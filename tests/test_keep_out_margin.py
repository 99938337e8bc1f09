"""Keep-out margins in metres: padded zones against sampled sums, plans against sampled gaps."""

import numpy as np
import pytest
from scipy.optimize import minimize

import closeform as cf

ORBIT = cf.Orbit.circular(500e3)
TURNED = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
ZONES = {
    "sphere": cf.Sphere(30.0),
    "ellipsoid": cf.Ellipsoid([20.0, 40.0, 15.0], TURNED),
    "box": cf.Box([20.0, 40.0, 15.0], TURNED),
    "cylinder": cf.Cylinder(12.0, 40.0, [1.0, 2.0, 0.5]),
    "half-spaces": cf.HalfSpaces([[1, 0, 0], [0, 1, 0.2], [-1, -1, 0]], [20.0, 15.0, 30.0]),
}


def surface(zone: cf.Zone, count: int) -> np.ndarray:
    """Return points (M, 3) on the surface of a zone where it is bounded."""
    ways = np.random.default_rng(1).normal(size=(count, 3))
    sizes = zone.norm(ways)
    return ways[sizes > 1e-3] / sizes[sizes > 1e-3, None]


def distance(zone: cf.Zone, place: np.ndarray) -> float:
    """Return the distance of a position from a zone, by a solver that knows only its norm."""
    found = minimize(
        lambda r: ((r - place) ** 2).sum(),
        place / max(1.0, zone.norm(place)),
        constraints={"type": "ineq", "fun": lambda r: 1.0 - zone.norm(r)},
        method="SLSQP",
        options={"ftol": 1e-12, "maxiter": 300},
    )
    return float(np.linalg.norm(found.x - place))


@pytest.mark.parametrize("name", ZONES)
def test_padded_zone_contains_the_sum(name):
    zone, margin = ZONES[name], 2.5
    grown = zone.padded(margin)
    ball = np.random.default_rng(2).normal(size=(200, 3))
    ball *= margin / np.linalg.norm(ball, axis=1, keepdims=True)
    reached = surface(zone, 400)[:, None] + ball
    assert grown.shape == zone.shape
    assert (grown.norm(reached) <= 1.0 + 1e-12).all()


@pytest.mark.parametrize(("name", "beyond"), [("sphere", 1e-9), ("ellipsoid", 0.4), ("box", 0.74)])
def test_padded_zone_is_tight(name, beyond):
    """At a corner the padding may exceed the margin by `beyond`, sqrt(3) - 1 of it."""
    zone, margin = ZONES[name], 2.5
    off = [distance(zone, place) for place in surface(zone.padded(margin), 20)]
    assert max(off) <= (1.0 + beyond) * margin
    assert min(off) >= margin - 1e-4


def test_faces_move_out_by_the_margin():
    """Along face normals the padding is exact."""
    for name in ("box", "cylinder", "half-spaces"):
        zone = ZONES[name]
        normals = zone.faces @ zone.matrix if name == "half-spaces" else zone.matrix[-1:]
        normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        grown = zone.padded(2.5).support(normals)
        assert grown == pytest.approx(zone.support(normals) + 2.5, rel=1e-12)


def test_zero_margin_is_the_zone():
    zone = cf.Sphere(30.0)
    assert zone.padded(0.0) is zone
    assert zone.padded(1.5).radius == pytest.approx(31.5)


# --- plans --------------------------------------------------------------------------------------


def ring(count: int, size: float = 120.0) -> np.ndarray:
    angle = 2.0 * np.pi / count * np.arange(count)
    states = np.zeros((count, 6))
    states[:, 1], states[:, 2] = size * np.cos(angle), size * np.sin(angle)
    return states


def sampled_gap(one: cf.Path, other: cf.Path, zone: cf.Zone) -> float:
    """Return the distance of two paths from their zone at samples, by the solver near the closest ones."""
    times = np.linspace(max(one.start, other.start), min(one.end, other.end), 4001)
    places = one.position(times) - other.position(times)
    return min(distance(zone, places[k]) for k in np.argsort(zone.norm(places))[:80:20])


@pytest.mark.parametrize("name", ["ellipsoid", "box"])
def test_avoid_keeps_the_margin(name):
    zone = ZONES[name]
    path = ORBIT.transfer([0, 200, 0, 0, 0, 0], [0, -200, 0, 0, 0, 0], 300.0)
    client = ORBIT.coast(np.zeros(6), 300.0)
    found = cf.avoid(path, client, zone, margin=1.5)
    assert found.ok
    assert found.padding == 1.5
    off = sampled_gap(found.path, client, zone)
    assert off >= 1.5 - 1e-3
    assert off <= 1.5 * 1.8  # an active constraint of the padded zone
    assert not cf.find_conflicts(found.path, client, zone.padded(1.5 * (1 - 1e-6)))
    dearer = cf.avoid(path, client, zone, margin=3.0)
    assert cf.avoid(path, client, zone).energy < found.energy < dearer.energy


@pytest.mark.parametrize("cost", ["energy", "delta-v"])
def test_reconfigure_keeps_the_margin_of_each_pair(cost):
    """Three cross beside an obstacle: 4 m for one pair, 2 m for the obstacle, 0 m for others."""
    start, zone = ring(3), cf.Sphere(30.0)
    still = ORBIT.coast(np.zeros(6), 0.3 * ORBIT.period)
    margin = np.zeros((4, 4))
    margin[0, 1] = margin[1, 0] = 4.0
    margin[3, :3] = margin[:3, 3] = 2.0
    options = (ORBIT, start, -start, 0.3 * ORBIT.period, zone)
    found = cf.reconfigure(*options, obstacles=still, margin=margin, cost=cost)
    assert found.ok
    assert (found.padding == margin).all()
    for i in range(3):
        for j in range(i + 1, 4):
            other = found.paths[j] if j < 3 else still
            nearest = cf.closest_approach(found.paths[i], other, zone)
            assert nearest.ratio * 30.0 >= 30.0 + margin[i, j] - 1e-6
    assert cf.reconfigure(*options, obstacles=still, cost=cost).spent < found.spent


@pytest.mark.parametrize(
    "options",
    [
        {"cost": "delta-v"},
        {"cost": "delta-v", "thrusters": cf.Thrusters.rtn(acceleration=1.0, period=90.0)},
        {"cost": "delta-v", "max_acceleration": 0.02},
        {"max_acceleration": 0.02},
        {"method": "sauter-palmer"},
        {"drift": 300.0},
        {"prove": 0.2},
        {"errors": cf.Uncertainty(np.diag([0.25, 0.25, 0.25, 0.0, 0.0, 0.0]))},
    ],
    ids=lambda options: "-".join(options),
)
def test_avoid_keeps_the_margin_with_other_options(options):
    path = ORBIT.transfer([0, 200, 0, 0, 0, 0], [0, -200, 0, 0, 0, 0], 300.0)
    client, zone = ORBIT.coast(np.zeros(6), 3000.0), cf.Sphere(30.0)
    found = cf.avoid(path, client, zone, margin=1.5, **options)
    assert found.ok, found.reason
    assert found.padding == 1.5
    beyond = 3.0 * 0.5 if "errors" in options else 0.0
    assert cf.closest_approach(found.path, client, zone).ratio * 30.0 >= 31.5 + beyond - 1e-6
    if "drift" in options:
        safe = cf.drift_approach(found.path, client, cf.Sphere(31.5), float(found.path.end) + 300.0)
        assert safe.ratio >= 1.0 - 1e-9


def test_sequential_planning_keeps_the_margin():
    start = ring(4)
    options = (ORBIT, start, -start, 0.3 * ORBIT.period, cf.Sphere(20.0))
    found = cf.reconfigure(*options, margin=2.0, method="sequential")
    assert found.ok
    assert not len(cf.screen(found.paths, cf.Sphere(22.0 - 1e-6)).pairs)


def test_tracking_tube_as_a_margin():
    start, zone = ring(4)[1::2], cf.Sphere(30.0)  # across the orbit
    room = cf.tube(ORBIT, cf.Feedback(), cf.Navigation(0.1, 3e-4), [1e-6, 5e-6])
    found = cf.reconfigure(ORBIT, start, -start, 0.3 * ORBIT.period, zone, margin=room)
    assert found.padding == pytest.approx(room.of_a_pair)
    nearest = cf.closest_approach(found.paths[0], found.paths[1], zone)
    assert nearest.ratio * 30.0 == pytest.approx(30.0 + room.of_a_pair, abs=1e-6)
    among = room.of_pairs(2, 1)  # beside an exactly known obstacle
    assert among[0, 2] == pytest.approx(room.radius[0])
    common = cf.tube(ORBIT, cf.Feedback(), cf.Navigation(0.1, 3e-4))
    client = ORBIT.coast(np.zeros(6), 300.0)
    path = ORBIT.transfer([0, 200, 0, 0, 0, 0], [0, -200, 0, 0, 0, 0], 300.0)
    assert cf.avoid(path, client, zone, margin=common).padding == pytest.approx(common.of_a_pair)
    with pytest.raises(ValueError, match="margin: a tube of 2 craft for 3"):
        cf.reconfigure(ORBIT, ring(3), -ring(3), 0.3 * ORBIT.period, zone, margin=room)


def test_margin_wider_than_the_gap_between_ends():
    """The reason names the pair and both distances."""
    start = ring(4)
    start[:2] *= 0.99  # 168.009 m apart
    found = cf.reconfigure(ORBIT, start, -start, 0.3 * ORBIT.period, cf.Sphere(167.3), margin=1.0)
    assert found.status == cf.Status.END_INSIDE
    assert "craft 0 and craft 1 are at 0.709 m from their zone, less than the margin of 1 m" in found.reason
    assert found.blocked == (0, 1)
    path = ORBIT.transfer([0, 200, 0, 0, 0, 0], [0, -200, 0, 0, 0, 0], 300.0)
    client = ORBIT.coast(np.zeros(6), 300.0)
    short = cf.avoid(path, client, cf.Box([50.0, 199.5, 50.0]), margin=1.0)
    assert short.status == cf.Status.END_INSIDE
    assert "path and the obstacle are at 0.5 m from their zone, less than" in short.reason
