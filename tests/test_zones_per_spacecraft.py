"""Zones of individual spacecraft: the zone of a pair from regions, covariances and bodies."""

import json
from itertools import product
from math import sqrt

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.stats import chi2

import closeform as cf
from closeform.cli.app import main
from closeform.scenario import ScenarioError, parse
from closeform.zones.minkowski_sums import outer_sum
from closeform.zones.pair_zones import all_made

pytestmark = pytest.mark.usefixtures("undrawn")

SPACE = cf.Orbit(0.0)
COVARIANCE = np.diag([25.0, 400.0, 25.0])  # sigma 5, 20 and 5 m
PLACE = np.array([18.75, 0.0, 0.0])  # 1.25 times three sigmas of one, 0.884 of both
TURN = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
BODIES = {
    "ball": cf.Sphere(7.0),
    "small ball": cf.Sphere(1e-3),
    "ellipsoid": cf.Ellipsoid([3.0, 30.0, 5.0]),
    "disc": cf.Ellipsoid([40.0, 1e-4, 40.0], axes=TURN),
    "plate": cf.Ellipsoid([40.0, 0.05, 40.0], axes=TURN),
    "box": cf.Box([4.0, 9.0, 2.0]),
    "turned box": cf.Box([1.0, 20.0, 3.0], axes=TURN),
    "cylinder": cf.Cylinder(3.0, 25.0, [0.0, 1.0, 0.0]),
    "tilted cylinder": cf.Cylinder(6.0, 1.0, [1.0, 2.0, 3.0]),
    "wedge": cf.HalfSpaces([[1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]], [8.0, 15.0]),
    "lopsided": cf.HalfSpaces([[1, 0, 0], [-1, 1, 0], [0, -1, 1], [0, 0, -1]], [2.0, 9.0, 3.0, 5.0]),
}
CLOSED = [name for name in BODIES if name != "wedge"]


def surface_points(zone: cf.Zone, rng: np.random.Generator, count: int = 1000) -> np.ndarray:
    """Return points (count, 3) on the surface of a bounded zone, many of them far out."""
    ways = rng.normal(size=(count, 3)) * zone.extents
    shape = np.linalg.inv(zone.matrix)
    if zone.shape == 0:  # uniform over the ball, however thin the ellipsoid
        ways = rng.normal(size=(count, 3)) @ shape.T
    if len(zone.vertices):
        ways[: len(zone.vertices)] = zone.vertices
    norms = zone.norm(ways)
    return ways[norms > 0.0] / norms[norms > 0.0, None]


# --- covariances ---------------------------------------------------------------------------------


def test_covariances_add():
    own = cf.CovarianceZone(COVARIANCE, 3.0)
    kept = cf.PairZones.of([own, own])
    assert own.zone.norm(PLACE) == pytest.approx(1.25)
    assert kept.between(0, 1).norm(PLACE) == pytest.approx(0.884, abs=5e-4)
    assert kept.rule(0, 1) == kept.rule(1, 0) == "covariances added, 3 sigma"


def test_sum_is_the_covariance_of_the_relative_position():
    """The share of samples within 3 sigma is that of the chi-square distribution."""
    rng = np.random.default_rng(7)
    first = TURN @ np.diag([1.0, 90.0, 16.0]) @ TURN.T
    draws = [rng.multivariate_normal(np.zeros(3), matrix, 200_000) for matrix in (first, COVARIANCE)]
    zone = cf.PairZones.of([cf.CovarianceZone(first, 3.0), cf.CovarianceZone(COVARIANCE, 3.0)]).between(0, 1)
    inside = (zone.norm(draws[0] - draws[1]) <= 1.0).mean()
    assert inside == pytest.approx(chi2(3).cdf(9.0), abs=5 * sqrt(0.03 / 2e5))  # five sigma of the estimate


def test_covariance_beside_an_exactly_known_spacecraft():
    own = cf.CovarianceZone(COVARIANCE, 3.0)
    kept = cf.PairZones.of([own, None, None])
    assert kept.between(0, 1).norm(PLACE) == pytest.approx(1.25)
    assert kept.rule(0, 1) == "covariance of one, 3 sigma"
    assert kept.between(1, 2) is None
    assert kept.rule(1, 2) is None


def test_different_sigmas_are_rejected():
    with pytest.raises(
        ValueError, match=r"^A and B: covariances of 3 and 2 sigmas; give both the same number"
    ):
        cf.PairZones.of([cf.CovarianceZone(COVARIANCE, 3.0), cf.CovarianceZone(COVARIANCE, 2.0)], ["A", "B"])
    with pytest.raises(ValueError, match=r"^covariance: must be positive definite"):
        cf.CovarianceZone(np.diag([1.0, -1.0, 1.0]), 3.0)
    with pytest.raises(ValueError, match=r"^zone: expected a zone"):
        cf.Body(2.0)


# --- sums ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("one", "other"), list(zip(CLOSED, [*CLOSED[3:], *CLOSED[:3]], strict=True)))
def test_zone_contains_all_touching_positions(one, other):
    """Bodies that share a surface point have centres inside the zone."""
    rng = np.random.default_rng(11)
    first, second = surface_points(BODIES[one], rng), surface_points(BODIES[other], rng)
    kept = cf.PairZones.of([cf.Body(BODIES[one]), cf.Body(BODIES[other])])
    count = min(len(first), len(second))
    apart = np.concatenate([second[:count] - first[:count], (second[:40, None] - first[:40]).reshape(-1, 3)])
    # rounding is amplified by 4e5 for a disc of 1e-4 m by 40 m
    assert kept.between(0, 1).norm(apart).max() <= 1.0 + 1e-9
    assert kept.between(1, 0).norm(-apart).max() <= 1.0 + 1e-9
    assert kept.rule(0, 1) == "bodies added"


@pytest.mark.parametrize(("one", "other"), list(product(["ball", "plate"], repeat=2)))
def test_sum_of_ellipsoids_has_minimum_volume(one, other):
    """Compare with a search over the family, and with the support of the sum."""
    a, b = (np.linalg.inv(BODIES[name].matrix.T @ BODIES[name].matrix) for name in (one, other))

    def volume(logarithm: float) -> float:
        p = np.exp(logarithm)
        return float(np.linalg.slogdet((1.0 + 1.0 / p) * a + (1.0 + p) * b)[1])

    best = minimize_scalar(volume, bounds=(-16.0, 16.0), method="bounded", options={"xatol": 1e-10})
    zone = outer_sum(BODIES[one], BODIES[other])
    assert -2.0 * np.linalg.slogdet(zone.matrix)[1] == pytest.approx(best.fun, abs=1e-6)
    ways = np.random.default_rng(2).normal(size=(20_000, 3))
    reach = np.sqrt(np.einsum("ki,ij,kj->k", ways, a, ways)) + np.sqrt(
        np.einsum("ki,ij,kj->k", ways, b, ways)
    )
    slack = zone.support(ways) / reach
    assert slack.min() == pytest.approx(1.0, abs=2e-3)  # resolution of 20 000 directions
    assert slack.min() >= 1.0 - 1e-9


EXACT = {
    "spheres": (cf.Sphere(5.0), cf.Sphere(10.0), cf.Sphere(15.0)),
    "one form": (cf.Ellipsoid([1, 2, 3], TURN), cf.Ellipsoid([2, 4, 6], TURN), cf.Ellipsoid([3, 6, 9], TURN)),
    "boxes": (cf.Box([1, 2, 3], TURN), cf.Box([9, 5, 2], TURN), cf.Box([10, 7, 5], TURN)),
    "cylinders": (cf.Cylinder(2, 9, [1, 1, 0]), cf.Cylinder(3, 1, [1, 1, 0]), cf.Cylinder(5, 10, [1, 1, 0])),
    "box in planes": (
        cf.Box([1.0, 2.0, 3.0]),
        cf.HalfSpaces(np.concatenate([np.eye(3), -np.eye(3)]), [1.0, 1.0, 1.0, 2.0, 2.0, 2.0]),
        cf.HalfSpaces(np.concatenate([np.eye(3), -np.eye(3)]), [2.0, 3.0, 4.0, 3.0, 4.0, 5.0]),
    ),
}


@pytest.mark.parametrize("name", EXACT)
def test_exact_sums(name):
    one, other, whole = EXACT[name]
    ways = np.random.default_rng(5).normal(size=(1000, 3))
    for found in (outer_sum(one, other), outer_sum(other, one)):
        np.testing.assert_allclose(found.norm(ways), whole.norm(ways), rtol=1e-13)


def test_sum_of_box_and_ball():
    assert outer_sum(cf.Sphere(2.0), cf.Box([4.0, 9.0, 2.0])).extents == pytest.approx([6.0, 11.0, 4.0])


def test_sum_of_half_space_and_ball():
    """The plane moves out by the radius; two different half-spaces have no bounded sum."""
    wall, ball = cf.HalfSpaces([[0.0, 1.0, 0.0]], [50.0]), cf.Sphere(2.0)
    kept = cf.PairZones.of([cf.Body(ball), cf.Body(wall)])
    assert kept.between(0, 1).norm([0.0, 52.0, 7.0]) == pytest.approx(1.0)
    assert kept.between(0, 1).norm([0.0, -500.0, 0.0]) < 0.0
    with pytest.raises(ValueError, match=r"^A and B: the sum of their zones is unbounded"):
        cf.PairZones.of([cf.Body(wall), cf.Body(cf.HalfSpaces([[1.0, 0.0, 0.0]], [5.0]))], ["A", "B"])


# --- different kinds ----------------------------------------------------------------------------------


def test_different_kinds_add_as_sets():
    """A covariance or body as a set is kept out of a region entirely."""
    region, body, unsure = cf.Sphere(50.0), cf.Body(cf.Sphere(2.0)), cf.CovarianceZone(np.eye(3), 3.0)
    kept = cf.PairZones.of([region, body, unsure])
    assert kept.between(0, 1).extents == pytest.approx([52.0] * 3)
    assert kept.between(0, 2).extents == pytest.approx([53.0] * 3)
    assert kept.between(1, 2).extents == pytest.approx([5.0] * 3)
    assert [kept.rule(0, 1), kept.rule(0, 2), kept.rule(1, 2)] == [
        "body and keep-out region added",
        "covariance and keep-out region added, 3 sigma",
        "body and covariance added, 3 sigma",
    ]
    assert kept.rule(0, 1) != cf.PairZones.of([region, region]).rule(0, 1) == "keep-out region"


# --- use in searches and plans  ---


def passing_spacecraft() -> cf.Path:
    """Return two spacecraft that pass at 18.75 m and a distant one, in deep space."""
    states = np.array([[0, 0, 0, 0, 0, 0], [18.75, -50.0, 0, 0, 0.1, 0], [900.0, 0, 0, 0, 0, 0]])
    return SPACE.coast(states, 1000.0)


def test_screening_adds_covariances():
    paths, own = passing_spacecraft(), cf.CovarianceZone(COVARIANCE, 3.0)
    for given in (own, [own] * 3, cf.PairZones.of([own] * 3)):
        found = cf.screen(paths, given)
        assert found.pairs.tolist() == [[0, 1]]
        assert found.ratio == pytest.approx(1.25 / sqrt(2.0))
    assert len(cf.screen(paths, own.zone)) == len(cf.screen(paths, [own, None, own])) == 0
    with pytest.raises(
        ValueError, match=r"^zone: expected a zone, one for each spacecraft, or PairZones, got 5"
    ):
        cf.screen(paths, 5.0)


def mahalanobis(path: cf.Path, other: cf.Path, covariance: np.ndarray) -> float:
    """Return the least distance of two paths in sigmas, by dense sampling."""
    times = np.linspace(path.start, path.end, 10_001)
    apart = path.position(times) - other.position(times)
    return float(np.sqrt(np.einsum("ti,ij,tj->t", apart, np.linalg.inv(covariance), apart)).min())


def test_plan_keeps_three_sigma_of_both():
    """In a swap along track, a single covariance would allow 2.1 sigma of the sum."""
    first, second = np.diag([25.0, 100.0, 25.0]), np.diag([9.0, 25.0, 64.0])
    own = [cf.CovarianceZone(first, 3.0), cf.CovarianceZone(second, 3.0)]
    states = np.array([[0, 300.0, 0, 0, 0, 0], [0, -300.0, 4.0, 0, 0, 0]])
    plan = cf.reconfigure(SPACE, states, states[::-1], 2500.0, own)
    assert plan.ok
    assert plan.contacts
    # within the plan's margin of 1e-9 and samples of 1/4 s
    assert mahalanobis(plan.paths[0], plan.paths[1], first + second) == pytest.approx(3.0, abs=1e-5)


def test_avoid_with_zones_of_spacecraft_and_obstacles():
    first, second = np.diag([25.0, 100.0, 25.0]), np.diag([9.0, 25.0, 64.0])
    path = SPACE.transfer([0, 300.0, 0, 0, 0, 0], [0, -300.0, 0, 0, 0, 0], 2500.0)
    other = SPACE.coast([0, 0, 2.0, 0, 0, 0], 2500.0)
    own = [cf.CovarianceZone(first, 3.0), cf.CovarianceZone(second, 3.0)]
    for zones, total in ((cf.PairZones.of(own), first + second), (own[1], second), (own[1:], second)):
        found = cf.avoid(path, other, zones)
        assert found.ok
        assert mahalanobis(found.path, other, total) == pytest.approx(3.0, abs=1e-5)


def test_plan_keeps_bodies_apart():
    """A ball of 3 m passes a box-shaped station."""
    states = np.array([[0, 300.0, 2.0, 0, 0, 0]])
    station = SPACE.coast(np.zeros(6), 2500.0)
    half = np.array([10.0, 40.0, 6.0])
    own = [cf.Body(cf.Sphere(3.0)), cf.Body(cf.Box(half))]
    plan = cf.reconfigure(SPACE, states, -states, 2500.0, own, obstacles=station)
    assert plan.ok
    times = np.linspace(0.0, 2500.0, 10_001)
    beyond = np.maximum(np.abs(plan.paths[0].position(times)) - half, 0.0)  # from the faces
    # the zone is a box larger by 3 m: exact at faces, off an surface_points by up to the square root of 2
    assert 3.0 - 1e-6 <= np.linalg.norm(beyond, axis=1).min() <= 3.0 * sqrt(2.0)


def test_reasons_name_obstacles():
    path = SPACE.transfer([0, 300.0, 0, 0, 0, 0], [0, -300.0, 0, 0, 0, 0], 2500.0)
    there = SPACE.coast([[0, 900.0, 0, 0, 0, 0], [0, -310.0, 0, 0, 0, 0]], 2500.0)
    zone = cf.Sphere(20.0)
    assert "path and F7 are at 0.50 x zone" in cf.avoid(path, there, zone, names=["F3", "F7"]).reason
    assert "path and obstacle 2 of 2 at (" in cf.avoid(path, there, zone).reason
    with pytest.raises(ValueError, match=r"^names: give one for each of 2 obstacles"):
        cf.avoid(path, there, zone, names=["F3"])


# --- from a file -----------------------------------------------------------------------------------

FILE = """
closeform = 1
title = "Two that are uncertain"
[orbit]
deep_space = true
[craft]
name = ["A", "B"]
position = ["0 0 0 m", "18.75 -50 0 m"]
velocity = ["0 0 0 m/s", "0 0.1 0 m/s"]
keep_out = KEEP_OUT
[[stage]]
do = "coast"
for = "1000 s"
"""
UNSURE = '{ covariance = "25 0 400 0 0 25 m^2", sigmas = 3.0 }'


def flown(tmp_path, keep_out, capsys):
    file = tmp_path / "two.toml"
    file.write_text(FILE.replace("KEEP_OUT", keep_out))
    status = main(["run", str(file), "--out", str(tmp_path / "out"), "--overwrite"])
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    return status, capsys.readouterr().out, summary["stages"][0]["after"]


def test_run_reports_added_covariances(tmp_path, capsys):
    status, told, after = flown(tmp_path, UNSURE, capsys)
    assert status == 1
    assert "Zones of pairs: covariances added, 3 sigma" in told
    assert after["closest"]["zone"] == "covariances added, 3 sigma"
    assert after["closest"]["ratio"] == pytest.approx(0.884, abs=5e-4)


def test_covariance_as_a_region(tmp_path, capsys):
    """The covariance of the relative position is not added to itself."""
    status, told, after = flown(tmp_path, UNSURE.replace("{", '{ kind = "region",'), capsys)
    assert status == 0
    assert "Zones of pairs" not in told
    assert after["closest"]["zone"] == "keep-out region"
    assert after["closest"]["ratio"] == pytest.approx(1.25)


def test_bodies_in_a_scenario(tmp_path, capsys):
    bodies = '{ kind = "body", sphere = "7 m" }', '{ kind = "body", ellipsoid = "13 4 4 m" }'
    status, told, after = flown(tmp_path, f"[{', '.join(bodies)}]", capsys)
    assert status == 1
    assert "Zones of pairs: bodies added" in told
    # the sum reaches 20 m; the ellipsoid of least volume is wider along its longest axis, by 7 % here
    assert 18.75 / 21.5 <= after["closest"]["ratio"] <= 18.75 / 20.0


INVALID = {
    "sigmas": (
        f"[{UNSURE}, {UNSURE.replace('3.0', '2.0')}]",
        "craft.keep_out: A and B: covariances of 3 and 2 sigmas; give both the same number",
    ),
    "body": (
        UNSURE.replace("{", '{ kind = "body",'),
        'craft.keep_out: covariance cannot be combined with kind = "body"; remove kind',
    ),
    "kind": (
        '{ kind = "covariance", sphere = "20 m" }',
        'craft.keep_out: kind = "covariance" requires covariance; write "region" or "body"',
    ),
    "inside": (
        '{ kind = "body", sphere = "30 m" }',
        "craft.position: A and B start inside each other's zone, at 0.89 x zone (bodies added); move one",
    ),
}


@pytest.mark.parametrize("name", INVALID)
def test_invalid_zones_are_rejected(name):
    keep_out, line = INVALID[name]
    with pytest.raises(ScenarioError) as refused:
        parse(FILE.replace("KEEP_OUT", keep_out), "two.toml")
    assert [one for one in refused.value.lines if one.startswith(f"two.toml: {line}")]


def test_region_and_covariance_in_a_scenario():
    scenario = parse(FILE.replace("KEEP_OUT", f'[{{ sphere = "3 m" }}, {UNSURE}]'))
    assert scenario.zones.rule(0, 1) == "covariance and keep-out region added, 3 sigma"
    assert scenario.zones.between(0, 1).norm([18.0, 0.0, 0.0]) <= 1.0  # 3 m and 3 x 5 m


def test_stage_names_the_blocking_spacecraft(tmp_path, capsys):
    """An end inside a zone is reported by the name in the file."""
    text = FILE.replace("KEEP_OUT", '{ sphere = "15 m" }')
    text = text.replace('do = "coast"\nfor = "1000 s"', GOES)
    file = tmp_path / "two.toml"
    file.write_text(text)
    assert main(["run", str(file), "--out", str(tmp_path / "out")]) == 1
    told = capsys.readouterr().out
    assert "are at 0.33 x zone at their end; move one of them" in told
    assert "obstacle" not in told
    assert "obstacle" not in (tmp_path / "out" / "summary.json").read_text()


GOES = """do = "avoid"
craft = "A"
to = { position = "18.75 55 0 m", velocity = "0 0 0 m/s" }
within = "1000 s"
"""


@pytest.mark.parametrize("what", [cf.CovarianceZone(COVARIANCE, 3.0), cf.Body(cf.Sphere(2.0))])
def test_pair_search_explains_pair_zones(what):
    path = cf.Orbit(0.0).coast(np.zeros(6), 10.0)
    with pytest.raises(ValueError, match=r"^zone: .*use PairZones\.of\(\[one, other\]\)\.between\(0, 1\)$"):
        cf.find_conflicts(path, path, what)


# As many different zones as spacecraft


def different_zones(count: int, kind: str, seed: int = 5) -> list:
    rng = np.random.default_rng(seed)
    if kind == "spheres":
        return [cf.Sphere(radius) for radius in rng.uniform(5.0, 20.0, count)]
    own = [cf.CovarianceZone(np.diag(rng.uniform(2.0, 8.0, 3) ** 2), 3.0) for _ in range(count)]
    return (
        own if kind == "covariances" else [*own[:-30], *[cf.Sphere(9.0 + k) for k in range(25)], *[None] * 5]
    )


def crowd(count: int) -> cf.Path:
    rng = np.random.default_rng(7)
    states = np.zeros((count, 6))
    states[:, 1], states[:, 2] = rng.uniform(-20.0 * count, 20.0 * count, count), rng.normal(0.0, 60.0, count)
    states[:, 5] = rng.normal(0.0, 0.1, count)
    orbit = cf.Orbit.circular(500e3)
    return orbit.coast(states, orbit.period)


@pytest.mark.parametrize("kind", ["both"])
def test_zones_made_on_demand(kind: str) -> None:
    """Compare with the zone of each pair by itself."""
    count, paths = 70, crowd(70)
    own = different_zones(count, kind)
    pairs = cf.PairZones.of(own)
    assert len(pairs.zones) == 0  # none was requested
    found = cf.screen(paths, pairs)
    assert len(found) > 5
    assert len(pairs.zones) < count * (count - 1) // 8
    told = {
        (met.first, met.second): met.start for met in found.conflicts[::-1] if met.second < met.first + 12
    }
    truth = {}
    for i in range(count):
        for j in range(i + 1, min(i + 12, count)):
            two = cf.PairZones.of([own[i], own[j]])
            zone = two.between(0, 1)
            met = cf.find_conflicts(paths[i], paths[j], zone) if zone is not None else ()
            if met:
                truth[i, j] = met[0].start
            assert two.rule(0, 1) == pairs.rule(i, j)
    assert told == pytest.approx(truth, abs=1e-6)
    assert pairs.pairs == sum(
        one is not None or other is not None for k, one in enumerate(own) for other in own[k + 1 :]
    )


@pytest.mark.slow
def test_few_zones_are_made_for_distant_pairs() -> None:
    """Half a million pairs, few of which come near."""
    pairs = cf.PairZones.of(different_zones(1000, "covariances"))
    assert len(cf.screen(crowd(1000), pairs)) > 20
    assert len(pairs.zones) < 50_000


@pytest.mark.slow
def test_table_of_all_zones() -> None:
    """A gathering uses a table of the zones of all pairs."""
    kept = all_made(cf.PairZones.of(different_zones(70, "both")))
    for i, j in ((0, 1), (3, 69), (40, 68), (68, 69), (41, 44)):
        two = cf.PairZones.of([different_zones(70, "both")[k] for k in (i, j)])
        zone, alone = kept.between(i, j), two.between(0, 1)
        assert (zone is None) == (alone is None)
        assert zone is None or zone.matrix == pytest.approx(alone.matrix)
    assert kept.table.shape == (len(set(kept.kinds.tolist()) - {-1}) + 1,) * 2


def test_invalid_combination_among_many_zones() -> None:
    own = [*different_zones(80, "covariances"), cf.CovarianceZone(np.eye(3), 2.0)]
    with pytest.raises(ValueError, match="covariances of 3 and 2 sigmas"):
        cf.PairZones.of(own)
