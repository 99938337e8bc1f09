"""Corrections inside knowledge sets, against a plain search for the smallest burn, and conflicts."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.linalg import norm
from scipy.spatial.transform import Rotation

import closeform as cf
from closeform.zones.shapes import CUBE
from lost import with_kernel

SEARCH = cf.Search.basic(cf.Sensor(np.radians(70.0), 0.0, 1e4), np.radians(0.25), np.radians(25.0))
TILTED = Rotation.from_euler("zyx", [40.0, 25.0, -60.0], degrees=True).as_matrix()
ZONES = {
    "sphere": cf.Sphere(20.0),
    "ellipsoid": cf.Ellipsoid((30.0, 20.0, 10.0), TILTED),
    "box": cf.Box((20.0, 15.0, 12.0), TILTED),
}


def hits(zone, r, v):
    """Return whether r + v t enters the zone for t > 0; v (K, 3)."""
    r, v = zone.matrix @ r, v @ zone.matrix.T
    with np.errstate(divide="ignore", invalid="ignore"):
        if zone.shape == CUBE:
            faces = np.stack([(-1.0 - r) / v, (1.0 - r) / v])
            begin, end = faces.min(axis=0).max(axis=1), faces.max(axis=0).min(axis=1)
            return (begin < end) & (end > 0.0)
        t = np.maximum(0.0, -(v @ r) / np.sum(v * v, axis=1))
    return norm(r + t[:, None] * v, axis=1) < 1.0


def smallest_burn(zone, r, v, rng):
    """Return the smallest burn by which r + v t passes the zone, by bisection along directions.

    Velocities that enter form a convex cone, which a ray from v leaves once.
    """

    def sizes(directions):
        low, high = np.zeros(len(directions)), np.full(len(directions), 3.0 * norm(v))
        never = hits(zone, r, v + high[:, None] * directions)
        for _ in range(45):
            middle = 0.5 * (low + high)
            inside = hits(zone, r, v + middle[:, None] * directions)
            low, high = np.where(inside, middle, low), np.where(inside, high, middle)
        return np.where(never, np.inf, high)

    best, spread = np.zeros(3), 1.0
    least = np.inf
    for _ in range(18):
        directions = best + spread * rng.normal(size=(250, 3))
        directions /= norm(directions, axis=1)[:, None]
        found = sizes(directions)
        if found.min() < least:
            least, best = found.min(), directions[found.argmin()]
        spread *= 0.6
    return least


@pytest.mark.parametrize("name", ZONES)
def test_correction_is_the_smallest_burn(name):
    zone, rng = ZONES[name], np.random.default_rng(5)
    corrected = 0
    for _ in range(4):
        r = rng.normal(size=3)
        r *= rng.uniform(60.0, 300.0) / norm(r)
        v = -r / rng.uniform(1000.0, 3000.0) + rng.normal(size=3) * 0.003
        drift = rng.uniform(-0.1, 0.1, 3)
        g = cf.gather(SEARCH, *with_kernel([[0, 0, 0], r], [drift, v + drift]), keep_out=zone, rounds=1)
        locks = [e for e in g.events if e.kind == "lock"]
        burns = [e for e in g.events if e.kind != "lock"]
        assert [e.label for e in locks] == [0, 1]
        time = locks[1].time
        apart = r + v * time
        if not hits(zone, apart, v[None])[0] or zone.norm(apart) <= 1.0:
            assert not burns or zone.norm(apart) <= 1.0
            continue
        (burn,) = burns  # of the higher index, at once
        assert (burn.kind, burn.first, burn.time, burn.label) == ("correction", 3, time, 1)
        # 2e-4: resolution of the plain search; 1e-8 v: passed at 1 + 1e-9 of the zone
        least = smallest_burn(zone, apart, v, rng)
        assert least * (1.0 - 2e-4) <= norm(burn.delta_v) <= least + 1e-8 * norm(v)
        assert norm(burn.delta_v) == pytest.approx(g.delta_v.sum(), rel=1e-12)
        # clear during the search and after it
        assert cf.find_conflicts(g.paths[3], g.paths[2], zone) == ()
        assert not hits(zone, apart, (v + burn.delta_v)[None])[0]
        assert g.conflicts == ()
        corrected += 1
    assert corrected >= 2


def test_correction_is_tangent_to_a_sphere():
    """60 m from a sphere of 30 m the tangent is at 30 deg, and the smallest burn is v sin(30 deg)."""
    g = cf.gather(
        SEARCH,
        *with_kernel([[0, 0, 0], [60.0, 0, 0]], [[0, 0, 0], [-0.1, 0, 0]]),
        keep_out=cf.Sphere(30.0),
        rounds=1,
    )
    (burn,) = [e for e in g.events if e.kind == "correction"]
    assert burn.time == 0.0
    assert norm(burn.delta_v) == pytest.approx(0.05, rel=1e-8)
    assert g.paths[3].velocity(0.0) @ [-1.0, 0.0, 0.0] == pytest.approx(
        0.1 * np.cos(np.radians(30.0)) ** 2, rel=1e-8
    )


def test_no_correction_without_a_conflict_in_the_search():
    zone = cf.Sphere(20.0)
    slow = 60.0 / SEARCH.duration  # 80 m away, it reaches the zone as the search ends
    for speed, burns in ((0.99 * slow, 0), (1.01 * slow, 1)):
        positions, velocities = [[0, 0, 0], [80.0, 0, 0]], [[0, 0, 0], [-speed, 0, 0]]
        g = cf.gather(SEARCH, *with_kernel(positions, velocities), keep_out=zone, rounds=1)
        assert sum(e.kind == "correction" for e in g.events) == burns
    for miss, burns in ((20.001, 0), (19.999, 1)):
        positions, velocities = [[0, 0, 0], [80.0, miss, 0]], [[0, 0, 0], [-0.1, 0, 0]]
        g = cf.gather(SEARCH, *with_kernel(positions, velocities), keep_out=zone, rounds=1)
        assert sum(e.kind == "correction" for e in g.events) == burns
    without = cf.gather(SEARCH, *with_kernel(positions, velocities), rounds=1)
    assert [e.kind for e in without.events] == ["lock", "lock"]
    assert without.conflicts == ()  # no zone


@pytest.mark.parametrize("name", ZONES)
def test_spacecraft_inside_a_zone_do_not_approach(name):
    zone, rng = ZONES[name], np.random.default_rng(8)
    kinds = []
    for _ in range(12):
        r = rng.normal(size=3)
        r *= rng.uniform(0.3, 0.95) / zone.norm(r)
        v = rng.normal(size=3) * 0.001
        g = cf.gather(SEARCH, *with_kernel([[0, 0, 0], r], [[0, 0, 0], v]), keep_out=zone, rounds=1)
        time = next(e.time for e in g.events if e.label == 1)
        apart = r + v * time
        if zone.norm(apart) >= 1.0:
            continue
        nearing = zone.norm(apart + 1e-3 * v) < zone.norm(apart)
        burns = [e for e in g.events if e.kind == "correction"]
        assert len(burns) == nearing
        if burns:
            times = np.linspace(time, g.duration, 400)
            path = zone.norm(g.paths[3].position(times) - g.paths[2].position(times))
            assert path.min() >= path[0] * (1.0 - 1e-8)
            assert norm(burns[0].delta_v) <= norm(v) * (1.0 + 1e-12)  # stopping suffices
            again = np.diff(path) < -1e-9  # it does not return
            assert not (again & (path[:-1] >= 1.0)).any()
        (stay,) = [s for s in g.conflicts if s.first == 2]
        assert not g.known(stay.first, stay.second, stay.start)  # it began before the lock
        assert stay.start == 0.0 or zone.norm(r) > 1.0
        kinds.append(nearing)
    assert {True, False} <= set(kinds)


def cloud(seed, n):
    rng = np.random.default_rng(seed)
    positions = rng.uniform(-150.0, 150.0, (n, 3))
    return positions, rng.uniform(-0.05, 0.05, (n, 3)) - positions / rng.uniform(600.0, 4000.0)


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 6), st.sampled_from(sorted(ZONES)))
def test_known_spacecraft_do_not_collide(seed, n, name):
    """Also in larger sets, after mergers, and for pairs of one group."""
    zone = ZONES[name]
    positions, velocities = cloud(seed, n)
    g = cf.gather(SEARCH, *with_kernel(positions, velocities), keep_out=zone, rounds=1)
    assert not [s for s in g.conflicts if g.known(s.first, s.second, s.start)]
    for e in g.events:
        if e.kind == "correction":
            assert e.label >= 1
            assert any(k.kind == "lock" and k.time == e.time and k.label == e.label for k in g.events)


def test_older_members_correct_after_a_merger():
    """After a merger, older members burn if newer ones cannot avoid all."""
    positions = [
        [46.374652028729315, -19.430520419383043, 88.34738999591633],
        [-11.207315421179828, -59.34838054365241, -88.43269464483978],
        [54.60022909819398, -26.084260798368902, -24.45394463915254],
        [75.83783385401497, 37.82166578795173, -22.489483745937804],
        [65.30407523433283, 0.39475429678859086, -9.503458777977599],
        [56.24612758207189, 7.675826266111656, 66.59321053867043],
        [10.620249459725954, -77.97791221375132, -29.420254782244214],
    ]
    velocities = [
        [-0.04069220083170871, 0.039382759138522724, -0.0432511102072769],
        [-0.021230684042919494, 0.050955883442109086, 0.0223802978664032],
        [-0.05641414810584755, -0.012239591166915684, 0.044043027061219535],
        [-0.06240883593473959, -0.04072324213375115, 0.04783255302460271],
        [-0.05448028954739688, -0.0007063097718419363, 0.05177462058237253],
        [0.015778358783797578, 0.024466024716764356, 0.0011852819935167375],
        [0.017999367170646804, 0.0465885716291219, 0.04208539391293156],
    ]
    g = cf.gather(SEARCH, *with_kernel(positions, velocities), keep_out=cf.Sphere(20.0), rounds=1)
    assert sum(e.kind == "correction" for e in g.events) >= 2
    assert not [s for s in g.conflicts if g.known(s.first, s.second, s.start)]


# ---- conflicts


def sampled_conflicts(g, zone, i, j, times):
    """Return (first, last, minimum ratio) of each run of samples inside the zone."""
    ratio = zone.norm(g.paths[j].position(times) - g.paths[i].position(times))
    inside = np.concatenate([[False], ratio < 1.0, [False]])
    edges = np.flatnonzero(inside[1:] != inside[:-1]).reshape(-1, 2)
    return [(times[a], times[b - 1], ratio[a:b].min()) for a, b in edges]


@settings(max_examples=5, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(sorted(ZONES)), st.sampled_from([20.0, 70.0]))
def test_conflicts_agree_with_dense_sampling(seed, name, half_angle):
    zone = ZONES[name]
    search = cf.Search.basic(cf.Sensor(np.radians(half_angle), 7.5), np.radians(0.25), np.radians(25.0))
    g = cf.gather(search, *cloud(seed, 7), keep_out=zone, rounds=1)
    found = list(g.conflicts)
    assert [(s.first, s.second) for s in found] == sorted((s.first, s.second) for s in found)
    if not g.duration:
        return
    times = np.linspace(0.0, g.duration, 6000)
    step = times[1]
    sets = [frozenset([k]) for k in range(7)]
    met: dict[frozenset[int], float] = {}
    for e in g.events:
        if e.kind == "lock":
            mine = [s for s in sets if e.first in s or e.second in s]
            sets = [s for s in sets if s not in mine] + [frozenset().union(*mine)]
            for pair in [frozenset((i, j)) for i in sets[-1] for j in sets[-1] if i < j]:
                met.setdefault(pair, e.time)
    for i in range(7):
        for j in range(i + 1, 7):
            pair = frozenset((i, j))
            assert g.acquainted(i, j) == g.acquainted(j, i) == met.get(pair, np.inf)
            mine = [s for s in found if (s.first, s.second) == (i, j)]
            sampled = sampled_conflicts(g, zone, i, j, times)
            for s in mine:
                assert g.known(i, j, s.start) == (met.get(pair, np.inf) < s.start)
                near = [k for k in sampled if abs(k[0] - s.start) <= step]
                # conflicts shorter than two steps may fall between samples
                assert near or s.end - s.start < 2.0 * step
                for begin, end, ratio in near:
                    assert s.start <= begin
                    assert end - 1e-9 <= s.end <= end + step
                    assert s.ratio <= ratio + 1e-9
            assert all(any(s.start <= k[0] <= s.end for s in mine) for k in sampled)


def test_conflicts_of_unknown_pairs():
    """Two of one group collide before a third spacecraft locks with both."""
    search = cf.Search.basic(cf.Sensor(np.radians(20.0)), np.radians(0.25), np.radians(25.0))
    positions = [[0, 0, 0], [0, 400.0, 0], [60.0, 0, 0]]
    velocities = [[0, 0, 0], [0, 0, 0], [-0.5, 0, 0]]
    g = cf.gather(search, positions, velocities, ["A", "B", "A"], keep_out=cf.Sphere(20.0))
    (stay,) = g.conflicts
    assert (stay.first, stay.second) == (0, 2)
    assert not g.known(0, 2, stay.start)
    assert stay.start == pytest.approx(80.0, abs=1e-6)  # 60 m to 20 m at 0.5 m/s
    assert stay.end == pytest.approx(160.0, abs=1e-6)
    assert g.acquainted(0, 2) > 160.0
    with pytest.raises(IndexError, match="7"):
        g.acquainted(0, 7)
    at_once = cf.gather(SEARCH, [[0, 0, 0], [10.0, 0, 0]], np.zeros((2, 3)), keep_out=cf.Sphere(20.0))
    assert at_once.duration == 0.0
    (stay,) = at_once.conflicts
    assert (stay.first, stay.second) == (0, 1)
    assert not at_once.known(0, 1, stay.start)


def test_zone_of_each_pair():
    """Two of a knowledge set pass at 15 m: only their own zones matter."""
    exact, unsure = cf.Sphere(20.0), cf.CovarianceZone(np.diag([16.0, 16.0, 16.0]), 3.0)  # 12 m, 17 m of both
    passing = with_kernel([[0, 0, 0], [80.0, 15.0, 0]], [[0, 0, 0], [-0.1, 0, 0]])
    for own, burns in (
        ([exact] * 4, 1),
        ([exact, exact, cf.Sphere(10.0), None], 0),
        ([exact, exact, unsure, None], 0),
        ([exact, exact, unsure, unsure], 1),
        ([exact, exact, cf.Body(cf.Sphere(7.0)), cf.Body(cf.Sphere(9.0))], 1),
        ([exact, exact, None, None], 0),
    ):
        g = cf.gather(SEARCH, *passing, keep_out=own, rounds=1)
        assert sum(e.kind == "correction" for e in g.events) == burns
        assert g.conflicts == ()
        cases = cf.gather_cases(SEARCH, *(array[None] for array in passing), keep_out=own, rounds=1)
        assert cases.met_known.tolist() == cases.met_unknown.tolist() == [0]
        if burns:
            zone = cf.PairZones.of(own).between(3, 2)
            apart, v = np.array([80.0, 15.0, 0.0]), np.array([-0.1, 0.0, 0.0])
            least = smallest_burn(zone, apart, v, np.random.default_rng(1))
            assert norm(g.delta_v) == pytest.approx(least, rel=2e-4)
