"""The flight core against the package: motion, conflicts, avoidance and passive safety, about each chief."""

import numpy as np
import pytest

import closeform as cf
from closeform.flight.library import compiler

pytestmark = pytest.mark.skipif(compiler() is None, reason="no C compiler")

ORBITS = [
    cf.Orbit(0.0),
    cf.Orbit.circular(500e3),
    cf.Orbit.eccentric(0.3, perigee_altitude=500e3),
    cf.Orbit.perturbed(0.001, 1.7, semi_major_axis=7000e3, span=10_000.0),
]
TILT = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
ZONES = [
    cf.Ellipsoid([20.0, 40.0, 30.0], TILT),
    cf.Sphere(35.0),
    cf.Box([25.0, 40.0, 30.0], TILT),
    cf.Cylinder(30.0, 40.0),
]


def pairs(seed, count):
    """Yield an orbit, a transfer across the zone, a coast, and a zone."""
    rng = np.random.default_rng(seed)
    for k in range(count):
        orbit = ORBITS[k % 4]
        start, duration = rng.uniform(0.0, 3000.0), rng.uniform(300.0, 2000.0)
        ends = rng.normal(size=(2, 6)) * ([30.0] * 3 + [0.05] * 3)
        ends[:, :3] += np.outer([1.0, -1.0], rng.normal(size=3) * 80.0)
        other = orbit.coast(rng.normal(size=6) * ([10.0] * 3 + [0.005] * 3), duration, start=start)
        yield orbit, (ends, duration, start), other, ZONES[k // 4 % 4]


def test_motion_is_that_of_the_package():
    for orbit, (ends, duration, start), _, _ in pairs(2, 40):
        mine = cf.flight.transfer(orbit, *ends, duration, start)
        theirs = orbit.transfer(*ends, duration, start)
        size = np.abs(ends[:, :3]).max()
        for time in np.linspace(start, start + duration, 5):
            assert np.abs(mine.state(time)[:3] - theirs.state(time)[:3]).max() < 1e-9 * size
        assert mine.energy == pytest.approx(theirs.energy, rel=1e-8)
        later = cf.flight.coast(orbit, ends[0], duration, start)
        assert later == pytest.approx(
            orbit.coast(ends[0], duration, start=start).state(start + duration), rel=1e-9, abs=1e-9
        )


def test_impulses_cost_what_those_of_the_package_cost():
    for orbit, (ends, duration, start), _, _ in pairs(4, 16):
        path = cf.flight.impulsive(orbit, *ends, duration, start)
        least = orbit.impulsive(*ends, duration, start=start).delta_v
        assert path.delta_v == pytest.approx(least, rel=1e-5)
        assert path.state(path.end) == pytest.approx(ends[1], abs=1e-6)


def test_conflicts_are_those_of_the_package():
    met = 0
    for _, (ends, duration, start), other, zone in pairs(3, 240):
        path = other.orbit.transfer(*ends, duration, start)
        mine, theirs = cf.flight.find_conflicts(path, other, zone), cf.find_conflicts(path, other, zone)
        assert len(mine) == len(theirs)
        for one, same in zip(mine, theirs, strict=True):
            assert (one.start, one.end) == pytest.approx((same.start, same.end), abs=1e-8, rel=0.0)
            assert one.ratio == pytest.approx(same.ratio, abs=1e-9)
        nearest, expected = (
            cf.flight.closest_approach(path, other, zone),
            cf.closest_approach(path, other, zone),
        )
        assert nearest.ratio == pytest.approx(expected.ratio, abs=1e-9)
        met += len(theirs)
    assert met > 80


def test_paths_that_the_flight_core_does_not_take_are_refused():
    orbit = ORBITS[1]
    path = orbit.transfer([0, 200, 0, 0, 0, 0], [0, -200, 0, 0, 0, 0], 300.0)
    client = orbit.coast(np.zeros(6), 300.0)
    with pytest.raises(ValueError, match="one spacecraft"):
        cf.flight.find_conflicts(path, orbit.coast(np.zeros((2, 6)), 300.0), ZONES[0])
    with pytest.raises(ValueError, match="BAD_INPUT"):
        cf.flight.find_conflicts(path, client, cf.HalfSpaces([[1.0, 0.0, 0.0]], [10.0]))
    with pytest.raises(ValueError, match="initial"):
        cf.flight.transfer(orbit, [np.nan] * 6, np.zeros(6), 300.0)
    with pytest.raises(ValueError, match="BAD_INPUT"):
        cf.flight.transfer(orbit, np.zeros(6), np.ones(6), -1.0)
    later = orbit.coast(np.zeros(6), 300.0, start=1000.0)
    assert cf.flight.find_conflicts(path, later, ZONES[0]) == ()
    assert cf.flight.closest_approach(path, later, ZONES[0]).ratio == np.inf


def test_paths_around_obstacles_cost_what_those_of_the_package_cost():
    rng, planned, equal = np.random.default_rng(5), 0, 0
    for k in range(24):
        orbit, zone = ORBITS[k % 4], cf.Ellipsoid([20.0, 40.0, 20.0])
        way, duration = rng.normal(size=3), rng.uniform(600.0, 2500.0)
        ends = np.zeros((2, 6))
        ends[:, :3] = np.outer([200.0, -200.0], way / np.linalg.norm(way))
        direct = orbit.transfer(*ends, duration)
        others = []
        for met in rng.uniform(0.3, 0.7, 1 + k // 4 % 2) * duration:  # each blocks the direct path
            there = direct.state(met) * ([1.0] * 3 + [0.0] * 3) + rng.normal(size=6) * (
                [8.0] * 3 + [0.005] * 3
            )
            others.append(orbit.coast(np.linalg.solve(orbit.transition(met), there), duration))
        shaped, status = cf.flight.avoid(direct, others, zone)
        theirs = cf.avoid(direct, others, zone)
        if theirs.ok and shaped is not None:
            planned += 1
            assert all(not cf.find_conflicts(shaped, other, zone) for other in others)
            for end, time in zip(ends, (direct.start, direct.end), strict=True):
                assert shaped.state(time) == pytest.approx(end, abs=1e-6)
            assert shaped.energy >= theirs.lower_bound * (1.0 - 1e-6)
            equal += shaped.energy <= theirs.path.energy * (1.0 + 1e-6)
        else:
            assert status in ("NO_PLAN", "END_INSIDE", "CROWDED")
    assert planned >= 20
    assert equal >= 0.9 * planned


def test_verdicts_on_loss_of_thrust_are_those_of_the_package():
    rng, verdicts = np.random.default_rng(6), []
    for k in range(40):
        orbit = ORBITS[k % 4]
        start, goal = rng.normal(size=(2, 6)) * ([60.0, 120.0, 60.0] + [0.02] * 3)
        path = orbit.transfer(start, goal, 1500.0)
        other, zone = orbit.coast(np.zeros(6), 5500.0), ZONES[k // 4 % 4]
        expected = cf.passively_safe(path, other, zone, 5500.0)
        assert cf.flight.passively_safe(path, other, zone, 5500.0) == expected
        verdicts.append(expected)
    assert 8 <= sum(verdicts) <= 32


def test_a_missing_or_failing_compiler_is_named(monkeypatch, tmp_path):
    for command, message in (("no-such-compiler", "requires a C compiler"), ("false", "false failed")):
        monkeypatch.setenv("CC", command)
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
        with pytest.raises(RuntimeError, match=message):
            cf.flight.build()
    assert not list(tmp_path.rglob("*.so"))
