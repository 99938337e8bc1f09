"""The sieve of many craft leaves out no pair that meets, and costs hardly more than craft."""

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
    """States on closed relative orbits, and some that drift."""
    random = np.random.Generator(np.random.Philox(seed))
    states = random.uniform(-size, size, (count, 6)) * np.repeat([1.0, N], 3)
    states[:, 4] = -2 * N * states[:, 0]
    states[::5, 4] += drift * random.normal(size=len(states[::5]))
    return states


def mixed(count, seed, size):
    """Craft of many kinds of path, with different starts and ends."""
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
def test_what_is_found_does_not_depend_on_the_sieve(name, every_pair):
    """To the last bit: craft that coast, thrust, jump, were sampled, and come and go."""
    paths = mixed(250, 1, 400.0)
    expected = every_pair(paths, ZONES[name])
    np.testing.assert_array_equal(table(cf.screen(paths, ZONES[name])), table(expected))
    assert len(expected) > 30


@settings(deadline=None, max_examples=25)
@given(
    st.integers(0, 2**32),
    st.floats(50.0, 5e3),
    st.floats(1.0, 200.0),
    st.floats(0.01, 4.0),
    st.sampled_from([0.0, N]),
)
def test_random_swarms(seed, size, radius, orbits, mean_motion):
    """Dense and thin, short and long, in an orbit and in deep space."""
    paths = cf.Orbit(mean_motion).coast(swarm(60, seed, size, 0.5), orbits * PERIOD)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(batches, "MANY", 2)
        patch.setattr(sieve, "SHARE", 1e-9)
        found = cf.screen(paths, cf.Sphere(radius))
        patch.setattr(batches, "MANY", 10**9)
        np.testing.assert_array_equal(table(found), table(cf.screen(paths, cf.Sphere(radius))))


def test_thousands_of_craft_as_all_pairs(every_pair):
    """3000 craft; the sieve is chosen by itself."""
    paths = ORBIT.coast(swarm(3000, 3, 1.5e3, 1.0), PERIOD)
    assert Sieve.of(paths, cf.Sphere(10.0)) is not None
    found = cf.screen(paths, cf.Sphere(10.0))
    np.testing.assert_array_equal(table(found), table(every_pair(paths, cf.Sphere(10.0))))
    assert len(found) > 100


def test_sampling_finds_no_more():
    """3000 craft at 600 instants: who is within the zone then has a stay at that time."""
    paths = ORBIT.coast(swarm(3000, 4, 3e3, 1.0), 3000.0)
    found = cf.screen(paths, cf.Sphere(40.0))
    pairs = found.pairs[:, 0] * 3000 + found.pairs[:, 1]
    met = 0
    for t in np.linspace(0.0, 3000.0, 600):
        near = cKDTree(paths.position(t)).query_pairs(40.0 - 1e-6, output_type="ndarray")
        there = pairs[(found.start <= t) & (t <= found.end)]
        assert np.isin(near[:, 0] * 3000 + near[:, 1], there).all()
        met += len(near)
    assert met > 1000


def test_zones_of_pairs(every_pair):
    """A station with a large zone, small craft, debris without one, and craft that do not move."""
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
def test_spans_share_the_work(sieved, every_pair):
    """Whatever the spans: each stay is in one of them, that of its start, as the whole tells it."""
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


def test_little_room(every_pair, monkeypatch):
    """Few pairs kept, few found at once: they are searched for as they come, and nothing is found twice."""
    paths = ORBIT.coast(swarm(300, 8, 200.0), PERIOD)
    expected = every_pair(paths, cf.Sphere(30.0))
    monkeypatch.setattr(batches, "KEPT", 500)
    monkeypatch.setattr(sieve, "ROOM", 70)
    monkeypatch.setattr(sieve, "AT_ONCE", 1)
    np.testing.assert_array_equal(table(cf.screen(paths, cf.Sphere(30.0))), table(expected))
    assert len(expected) > 1000


def test_deep_space(every_pair):
    """Everything drifts apart: straight lines over a hundred times the swarm's size."""
    random = np.random.Generator(np.random.Philox(9))
    states = random.normal(size=(2500, 6)) * np.repeat([2000.0, 1.0], 3)
    paths = cf.Orbit(0.0).coast(states, 2e5)
    assert Sieve.of(paths, cf.Sphere(20.0)) is not None
    found = cf.screen(paths, cf.Sphere(20.0))
    np.testing.assert_array_equal(table(found), table(every_pair(paths, cf.Sphere(20.0))))
    assert len(found) > 20


def test_one_instant_and_craft_at_one_place(every_pair):
    """Paths of a microsecond that hardly move, and boxes that no median parts."""
    states = np.zeros((90, 6))
    states[45:, 0] = 1e3
    paths = ORBIT.coast(states, 1e-6)
    found = cf.screen(paths, cf.Sphere(5.0))
    np.testing.assert_array_equal(table(found), table(every_pair(paths, cf.Sphere(5.0))))
    assert len(found) == 2 * 45 * 44 // 2


def test_coordinates_that_round_by_more_than_a_zone(every_pair):
    """1e14 m away, where halving an interval gains nothing: it ends, with the same answer."""
    states = swarm(40, 14, 3.0)
    states[:, 1] += 1e14
    paths = ORBIT.coast(states, 600.0)
    found = cf.screen(paths, cf.Sphere(0.01))
    np.testing.assert_array_equal(table(found), table(every_pair(paths, cf.Sphere(0.01))))


def test_where_all_are_near_all_pairs_are_looked_at():
    """No sieve where it leaves everything, or a zone has no end."""
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
def test_every_pair_keeps_its_zone(adds):
    """What two craft keep together is at least how far their zone reaches; no more where bodies add."""
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


@pytest.mark.parametrize("per_orbit", [3, 7])
def test_intervals_in_which_craft_turn_a_quarter(per_orbit, every_pair, monkeypatch):
    """Chords of a seventh or a third of an orbit, from which craft bend away further than zones reach."""
    monkeypatch.setattr(sieve, "PER_ORBIT", per_orbit)
    monkeypatch.setattr(sieve, "CROWDED", 10**6)
    paths = mixed(250, 13, 400.0)
    expected = every_pair(paths, cf.Sphere(10.0))
    np.testing.assert_array_equal(table(cf.screen(paths, cf.Sphere(10.0))), table(expected))
    assert len(expected) > 4
