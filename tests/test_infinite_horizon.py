"""Endless drift, against long horizons and slow drifts by matrix exponentials."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import closeform as cf
from pairs import carried

ORBIT = cf.Orbit.circular(500e3)
N, PERIOD = ORBIT.mean_motion, ORBIT.period
OTHER = ORBIT.coast(np.zeros(6), PERIOD)
LONG = ORBIT.coast(np.zeros(6), 10_002 * PERIOD)
ZONES = [cf.Ellipsoid([15, 25, 12]), cf.Sphere(20.0)]
FLAT = [cf.Box([15, 25, 12]), cf.Cylinder(15.0, 25.0, [0, 1, 0]), cf.Cylinder(12.0, 20.0, [1, 0, 0.5])]
TILTED = [
    cf.Box([8, 40, 12], axes=Rotation.from_euler("z", 35, degrees=True).as_matrix()),
    cf.Box([10, 25, 6], axes=Rotation.from_rotvec([0.5, -0.3, 0.7]).as_matrix()),
]


def transfers(seed, count):
    """Return transfers between safety ellipses, and what they pass."""
    rng = np.random.Generator(np.random.Philox(seed))
    ellipse = cf.targets.safety_ellipse
    for k in range(count):
        first, last = rng.uniform(80, 200, 2), rng.uniform(10, 80, 2)
        there = ellipse(ORBIT, 1, *last, along_track=rng.uniform(-50, 50))[0]
        here = ellipse(ORBIT, 1, *first, along_track=rng.uniform(-50, 50), phase=rng.uniform(0, 6))[0]
        yield ORBIT.transfer(here, there, rng.uniform(0.3, 1.2) * PERIOD), ZONES[k % 2]


def slow_drifts(path, zone, s, count=300, places=(0.0,)):
    """Return the minimum ratios of failures close to `s` that drift slowly past the zone."""
    off = np.geomspace(1e-3, 1e2, count)
    instants = np.concatenate([s - off, s + off])
    instants = instants[(instants >= path.start) & (instants <= path.end)]
    states = path.state(instants)
    drift = -6.0 * np.pi * (2.0 * states[:, 0] + states[:, 4] / N)  # [m] per orbit
    phases = np.linspace(0.0, PERIOD, 2000 if len(places) == 1 else 600)
    least = []
    for state, by in zip(states, drift, strict=True):
        if not 1e-9 < abs(by) < 5.0:
            continue
        ahead = carried(N, np.tile(state, (len(phases), 1)), phases)[:, :3]
        turns = [np.maximum(np.round((place - ahead[:, 1]) / by), 0.0) for place in places]
        least.append(min(zone.norm(ahead + np.outer(k * by, [0.0, 1.0, 0.0])).min() for k in turns))
    return np.array(least)


def test_endless_drift_is_the_minimum_of_all_horizons():
    """Equal to the first hundred orbits where those contain the worst failure."""
    late = soon = 0
    for path, zone in transfers(9, 20):
        found = cf.drift_approach(path, OTHER, zone, np.inf)
        assert cf.passively_safe(path, OTHER, zone, np.inf) == (found.lower > 1.0)
        assert found.ratio - found.lower < 2e-9 * max(1.0, found.ratio)
        until = cf.drift_approach(path, LONG, zone, path.end + 150 * PERIOD)
        assert found.ratio <= until.ratio + 1e-9 * max(1.0, until.ratio)
        if found.time < path.end + 100 * PERIOD:
            assert abs(found.ratio - until.ratio) < 2e-9 * max(1.0, until.ratio)
            soon += 1
            continue
        late += 1
        if found.time == np.inf:
            norms = slow_drifts(path, zone, found.failed_at)
            assert found.ratio - 1e-3 < norms.min() < found.ratio + 5e-3
    assert min(late, soon) >= 1


def minimum_of_orbits(path, zone, orbits):
    """Return about the minimum ratio within some orbits after failures, sampled near the zone."""
    phases, least = np.linspace(0.0, PERIOD, 721), np.inf
    for state in path.state(np.linspace(path.start, path.end, 201)):
        by = -6.0 * np.pi * (2.0 * state[0] + state[4] / N)  # [m] per orbit
        there = carried(N, np.tile(state, (len(phases), 1)), phases)[:, :3]
        before = np.clip(np.floor(-there[:, 1] / by), 0, orbits - 1) if by else np.zeros(len(phases))
        for turns in (before, before + 1):
            least = min(least, zone.norm(there + np.outer(turns * by, [0.0, 1.0, 0.0])).min())
    return least


@pytest.mark.slow
def test_endless_drift_bounds_ten_thousand_orbits():
    """Slower drifts tend to the limit in proportion."""
    tending = 0
    for k, (path, zone) in enumerate(transfers(9, 40)):
        found = cf.drift_approach(path, OTHER, zone, np.inf)
        off = 1e-9 * max(1.0, found.ratio)
        assert found.ratio <= minimum_of_orbits(path, zone, 10_000) + off
        if k in (0, 2, 3, 5, 19, 22, 23, 39):
            horizons = [cf.drift_approach(path, LONG, zone, path.end + t * PERIOD) for t in (1_000, 10_000)]
            ratios = [found.ratio, *(one.ratio for one in horizons[::-1])]
            assert ratios == sorted(ratios) or np.diff(ratios).min() > -off
            if np.isfinite(found.time):
                assert np.ptp(ratios) <= 2 * off
                continue
            tending += 1
            near, far = ratios[1] - ratios[0], ratios[2] - ratios[0]
            assert near < 1e-4
            assert near < 0.15 * far + off
    assert tending == 4


@pytest.mark.slow
def test_endless_drift_beside_boxes_and_cylinders():
    """Slow drifts tend to the minimum in the shadow of the zone itself, not of its enclosing ellipsoid."""
    tending = 0
    for k, (path, _) in enumerate(transfers(9, 60)):
        zone = FLAT[k % 3]
        found = cf.drift_approach(path, OTHER, zone, np.inf)
        assert cf.passively_safe(path, OTHER, zone, np.inf) == (found.lower > 1.0)
        assert found.ratio <= minimum_of_orbits(path, zone, 10_000) + 1e-9 * max(1.0, found.ratio)
        if found.time == np.inf:
            tending += 1
            norms = slow_drifts(path, zone, found.failed_at)
            assert found.ratio - 1e-3 < norms.min() < found.ratio + 5e-3
    assert tending >= 5


@pytest.mark.slow
def test_endless_drift_beside_tilted_boxes():
    """The shadows are a rectangle and a hexagon."""
    tending = 0
    for k, (path, _) in enumerate(transfers(9, 60)):
        zone = TILTED[k % 2]
        found = cf.drift_approach(path, OTHER, zone, np.inf)
        assert found.ratio <= minimum_of_orbits(path, zone, 10_000) + 1e-9 * max(1.0, found.ratio)
        if found.time == np.inf:
            tending += 1
            norms = slow_drifts(path, zone, found.failed_at, 30, np.linspace(-60.0, 60.0, 121))
            assert found.ratio - 1e-3 < norms.min() < found.ratio + 2e-2  # places are a metre apart
    assert tending >= 5


def test_bounded_motion_repeats_its_first_orbit():
    """Also beside one drifting motion that passes after hundreds of orbits."""
    rng = np.random.Generator(np.random.Philox(12))
    for k in range(20):
        zone, state = ZONES[k % 2], rng.normal(size=6) * np.r_[80, 60, 80, 0.1, 0, 0.1]
        state[4] = -2 * N * state[0]
        coast = ORBIT.coast(state, PERIOD)
        found = cf.drift_approach(coast, OTHER, zone, np.inf)
        assert abs(found.ratio - cf.closest_approach(coast, OTHER, zone).ratio) <= 1e-9 * max(
            1.0, found.ratio
        )
        by, ahead = rng.uniform(0.5, 5.0), rng.uniform(200.0, 1000.0)  # [m] per orbit, and to go
        slow = state + np.array([by / (3 * np.pi), ahead, 0, 0, -1.5 * N * by / (3 * np.pi), 0])
        passing = cf.drift_approach(ORBIT.coast(slow, PERIOD), OTHER, zone, np.inf)
        whole = cf.closest_approach(ORBIT.coast(slow, 3000 * PERIOD), LONG, zone)
        assert abs(passing.ratio - whole.ratio) <= 1e-8 * max(1.0, whole.ratio)


def test_fast_drift_past_the_zone_does_not_count():
    """Slow drifts stay clear here."""
    safe = 0
    for path, zone in transfers(2, 20):
        found = cf.drift_approach(path, OTHER, zone, np.inf)
        if found.lower > 1.0:
            safe += 1
            for orbits in (300, 1000):
                assert cf.passively_safe(path, LONG, zone, path.end + orbits * PERIOD)
        if found.time == np.inf:
            state = path.state(found.failed_at)
            assert abs(2.0 * state[0] + state[4] / N) < 1e-6  # [m]: it stands still
    assert safe >= 5


def test_endless_drift_into_half_spaces_is_unbounded():
    """A slow drift goes ever deeper below a plane across the track."""
    zone = cf.HalfSpaces([[0, 1, 0]], [50.0])
    by = -0.1  # [m] per orbit
    d = -by / (3 * np.pi)
    drifting = ORBIT.coast([d, 200, 0, 0, -1.5 * N * d, 0], PERIOD)
    found = cf.drift_approach(drifting, OTHER, zone, np.inf)
    assert found.lower == -np.inf
    assert not cf.passively_safe(drifting, OTHER, zone, np.inf)


def test_empty_batches():
    none = ORBIT.coast(np.zeros((0, 6)), PERIOD)
    for until in (2 * PERIOD, np.inf):
        assert cf.passively_safe(none, none, ZONES[1], until, failing="both").shape == (0,)
    assert cf.drift_approach(none, OTHER, ZONES[1], np.inf).ratio.shape == (0,)
    assert len(cf.drift_screen(none, ZONES[1], 2 * PERIOD)) == 0
