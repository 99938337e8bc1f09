"""The sieve of many spacecraft excludes no pair in conflict."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

import closeform as cf
from closeform.conflicts import batches, sieve
from closeform.conflicts.sieve import Sieve

N = 1.1e-3
PERIOD = 2 * np.pi / N
ORBIT = cf.Orbit(N)
NORMALS = [[1.0, 0.0, 0.0], [-2.0, 1.0, 0.0], [-2.0, -3.0, 1.0], [0.0, 0.0, -1.0]]


@pytest.fixture
def every_pair(monkeypatch):
    """`screen` without a sieve, and with one even where it does not pay."""

    def search(paths, zone, **more):
        with monkeypatch.context() as alone:
            alone.setattr(batches, "MANY", 10**9)
            return cf.screen(paths, zone, **more)

    monkeypatch.setattr(batches, "MANY", 2)
    monkeypatch.setattr(sieve, "SHARE", 1e-9)
    return search


def table(found):
    return np.column_stack([found.pairs, found.start, found.end, found.time, found.ratio])


def swarm(count, seed, size, drift=0.0):
    """Return states on closed relative orbits, some of them drifting."""
    random = np.random.Generator(np.random.Philox(seed))
    states = random.uniform(-size, size, (count, 6)) * np.repeat([1.0, N], 3)
    states[:, 4] = -2 * N * states[:, 0]
    states[::5, 4] += drift * random.normal(size=len(states[::5]))
    return states


def mixed(count, seed, size):
    """Return paths of many kinds with different starts and ends."""
    random = np.random.Generator(np.random.Philox(seed))
    some = count // 5
    paths = list(ORBIT.coast(swarm(some, [seed, 1], size, 1.0), PERIOD))
    paths += list(ORBIT.coast(swarm(some, [seed, 2], size), 1500.0, start=random.uniform(0.0, 4000.0, some)))
    ends = swarm(some, [seed, 3], size), swarm(some, [seed, 4], size)
    paths += list(ORBIT.transfer(*ends, 0.7 * PERIOD, start=300.0))
    paths += list(ORBIT.burn(swarm(some, [seed, 5], size), [3e-4, -2e-4, 1e-4], 0.9 * PERIOD))
    for first in ORBIT.coast(swarm(some // 2, [seed, 6], size), 0.4 * PERIOD):
        turned = first.state(0.4 * PERIOD) + np.r_[np.zeros(3), random.normal(size=3)]
        paths.append(cf.join([first, ORBIT.coast(turned, 0.6 * PERIOD, start=0.4 * PERIOD)]))
    times = np.linspace(100.0, 5000.0, 70)
    paths += list(ORBIT.sampled(times, ORBIT.coast(swarm(some // 2, [seed, 7], size), PERIOD).state(times)))
    return cf.stack(paths)


ZONES = {
    "sphere": cf.Sphere(30.0),
    "long ellipsoid": cf.Ellipsoid([20.0, 200.0, 5.0], [[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0], [0.0, 0.0, 1.0]]),
    "box": cf.Box([20.0, 40.0, 20.0]),
    "half-spaces": cf.HalfSpaces(NORMALS, [20.0, 30.0, 25.0, 40.0]),
}


@pytest.mark.parametrize("name", ZONES)
def test_result_does_not_depend_on_the_sieve(name, every_pair):
    """Coasting, thrusting, impulsive, sampled and temporary paths give equal results."""
    paths = mixed(250, 1, 400.0)
    expected = every_pair(paths, ZONES[name])
    np.testing.assert_array_equal(table(cf.screen(paths, ZONES[name])), table(expected))
    assert len(expected) > 30


@settings(deadline=None, max_examples=10)
@given(
    st.integers(0, 2**32),
    st.floats(50.0, 5e3),
    st.floats(1.0, 200.0),
    st.floats(0.01, 4.0),
    st.sampled_from([0.0, N]),
)
def test_random_swarms(seed, size, radius, orbits, mean_motion):
    """Dense and thin swarms, short and long, in orbit and in deep space."""
    paths = cf.Orbit(mean_motion).coast(swarm(60, seed, size, 0.5), orbits * PERIOD)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(batches, "MANY", 2)
        patch.setattr(sieve, "SHARE", 1e-9)
        found = cf.screen(paths, cf.Sphere(radius))
        patch.setattr(batches, "MANY", 10**9)
        np.testing.assert_array_equal(table(found), table(cf.screen(paths, cf.Sphere(radius))))


@pytest.mark.slow
def test_thousands_of_spacecraft_as_all_pairs(every_pair):
    """The sieve is chosen automatically for 3000 spacecraft."""
    paths = ORBIT.coast(swarm(3000, 3, 1.5e3, 1.0), PERIOD)
    assert Sieve.of(paths, cf.Sphere(10.0)) is not None
    found = cf.screen(paths, cf.Sphere(10.0))
    np.testing.assert_array_equal(table(found), table(every_pair(paths, cf.Sphere(10.0))))
    assert len(found) > 100


def test_samples_find_no_further_conflicts():
    """Each pair within the zone at a sample has a conflict at that time."""
    paths = ORBIT.coast(swarm(1000, 4, 1.8e3, 1.0), 3000.0)
    found = cf.screen(paths, cf.Sphere(40.0))
    pairs = found.pairs[:, 0] * 1000 + found.pairs[:, 1]
    met = 0
    for t in np.linspace(0.0, 3000.0, 200):
        near = cKDTree(paths.position(t)).query_pairs(40.0 - 1e-6, output_type="ndarray")
        there = pairs[(found.start <= t) & (t <= found.end)]
        assert np.isin(near[:, 0] * 1000 + near[:, 1], there).all()
        met += len(near)
    assert met > 100


def test_zones_of_pairs(every_pair):
    """A station with a large zone, small spacecraft, debris without one, and passive ones."""
    states = swarm(240, 5, 600.0, 1.0)
    paths = ORBIT.coast(states, PERIOD)
    own = [cf.Sphere(10.0 + 10.0 * (k % 3)) for k in range(200)] + [None] * 39
    own.append(cf.Ellipsoid([300.0, 600.0, 300.0]))
    zones = cf.PairZones.of(own, moves=[k % 7 > 0 for k in range(240)])
    expected = every_pair(paths, zones)
    np.testing.assert_array_equal(table(cf.screen(paths, zones)), table(expected))
    station = expected.pairs[:, 1] == 239
    assert min(station.sum(), (~station).sum()) > 10


def test_as_many_zones_as_pairs(every_pair):
    paths = ORBIT.coast(swarm(200, 6, 600.0), PERIOD)
    own = [cf.Sphere(10.0 + 0.1 * k) for k in range(200)]
    expected = every_pair(paths, own)
    np.testing.assert_array_equal(table(cf.screen(paths, own)), table(expected))
    assert len(expected) > 30


@pytest.mark.parametrize("sieved", [False, True])
def test_time_spans_partition_the_conflicts(sieved, every_pair):
    """Each conflict belongs to the span of its start."""
    paths = mixed(250, 7, 500.0)
    search = cf.screen if sieved else every_pair
    whole = search(paths, cf.Sphere(30.0))
    cuts = [-np.inf, 0.0, *sorted([1000.0, 1000.5, whole.start[3], 4321.0]), np.inf]
    spans = list(pairwise(cuts))
    parts = [search(paths, cf.Sphere(30.0), span=span) for span in spans]
    for (begin, before), part in zip(spans, parts, strict=True):
        np.testing.assert_array_equal(
            table(part), table(whole)[(begin <= whole.start) & (whole.start < before)]
        )
    np.testing.assert_array_equal(table(cf.Screening.joined(parts[::-1])), table(whole))
    assert sum(len(part) > 0 for part in parts) >= 4


def test_small_buffers(every_pair, monkeypatch):
    """Nothing is lost or repeated when buffers are full."""
    paths = ORBIT.coast(swarm(300, 8, 200.0), PERIOD)
    expected = every_pair(paths, cf.Sphere(30.0))
    monkeypatch.setattr(batches, "KEPT", 500)
    monkeypatch.setattr(sieve, "ROOM", 70)
    monkeypatch.setattr(sieve, "AT_ONCE", 1)
    np.testing.assert_array_equal(table(cf.screen(paths, cf.Sphere(30.0))), table(expected))
    assert len(expected) > 1000


def test_deep_space(every_pair):
    """Straight lines over a hundred times the size of the swarm."""
    random = np.random.Generator(np.random.Philox(9))
    states = random.normal(size=(2500, 6)) * np.repeat([2000.0, 1.0], 3)
    paths = cf.Orbit(0.0).coast(states, 2e5)
    assert Sieve.of(paths, cf.Sphere(20.0)) is not None
    found = cf.screen(paths, cf.Sphere(20.0))
    np.testing.assert_array_equal(table(found), table(every_pair(paths, cf.Sphere(20.0))))
    assert len(found) > 20


def test_coincident_spacecraft_and_short_paths(every_pair):
    """Paths of a microsecond, and boxes that no median separates."""
    states = np.zeros((90, 6))
    states[45:, 0] = 1e3
    paths = ORBIT.coast(states, 1e-6)
    found = cf.screen(paths, cf.Sphere(5.0))
    np.testing.assert_array_equal(table(found), table(every_pair(paths, cf.Sphere(5.0))))
    assert len(found) == 2 * 45 * 44 // 2


def test_coordinates_with_rounding_larger_than_the_zone(every_pair):
    """At 1e14 m, halving an interval gains nothing; the search ends with the same result."""
    states = swarm(12, 14, 3.0)
    states[:, 1] += 1e14
    paths = ORBIT.coast(states, 600.0)
    found = cf.screen(paths, cf.Sphere(0.01))
    np.testing.assert_array_equal(table(found), table(every_pair(paths, cf.Sphere(0.01))))


def test_no_sieve_where_it_excludes_nothing():
    """Crowded swarms and unbounded zones are searched without a sieve."""
    paths = ORBIT.coast(swarm(2500, 10, 10.0), 600.0)
    assert Sieve.of(paths, cf.Sphere(100.0)) is None
    assert Sieve.of(paths, cf.Sphere(0.1)) is not None
    assert Sieve.of(paths, cf.HalfSpaces([[1.0, 0.0, 0.0]], [1.0])) is None


BAD_SPANS = {
    "three": (0.0, 1.0, 2.0),
    "backwards": (2.0, 1.0),
    "none": None,
    "empty": (1.0, 1.0),
    "nan": (np.nan, 1.0),
}


@pytest.mark.parametrize("span", BAD_SPANS)
def test_bad_spans(span):
    with pytest.raises(ValueError, match="span: expected"):
        cf.screen(ORBIT.coast(np.zeros((2, 6)), 1.0), cf.Sphere(1.0), span=BAD_SPANS[span])


@pytest.mark.parametrize("adds", [False, True])
def test_margins_cover_the_zone_of_each_pair(adds):
    """Margins of two spacecraft reach at least as far as their zone, exactly for bodies."""
    random = np.random.Generator(np.random.Philox(12))
    balls = [cf.Sphere(radius) for radius in random.choice([2.0, 5.0, 40.0, 300.0], 30)]
    zones = cf.PairZones.of([cf.Body(ball) for ball in balls] if adds else balls)
    matrix, margins = sieve.in_unit_ball(zones, 30)
    kept = (1.0 + margins[:, None] + margins) / matrix[0, 0]
    first, second = np.triu_indices(30, 1)
    reach = [zones.between(i, j).radius for i, j in zip(first, second, strict=True)]
    beyond = kept[first, second] - reach
    assert beyond.min() > -1e-9  # m, of 600
    if adds:
        assert beyond.max() < 1e-9


@pytest.mark.parametrize("per_orbit", [3])
def test_long_intervals(per_orbit, every_pair, monkeypatch):
    """Chords of a third of an orbit deviate further than the zones reach."""
    monkeypatch.setattr(sieve, "PER_ORBIT", per_orbit)
    monkeypatch.setattr(sieve, "CROWDED", 10**6)
    paths = mixed(250, 13, 400.0)
    expected = every_pair(paths, cf.Sphere(10.0))
    np.testing.assert_array_equal(table(cf.screen(paths, cf.Sphere(10.0))), table(expected))
    assert len(expected) > 4
