"""Quick rejection of pairs without a search: correct and effective."""

import numpy as np
import pytest

import closeform as cf
from closeform.conflicts.pair_rows import conflicts_of
from closeform.conflicts.tracks import follow
from closeform.zones.zone import enclosing
from pairs import KINDS, draw, graze
from truth import faults

N = 1.1e-3
ORBIT = cf.Orbit(N)
PERIOD = 2 * np.pi / N
MANY = 1_000_000  # pairs, enough to build tracks
NORMALS = [[1.0, 0.0, 0.0], [-2.0, 1.0, 0.0], [-2.0, -3.0, 1.0], [0.0, 0.0, -1.0]]
ZONES = {
    "sphere": cf.Sphere(30.0),
    "ellipsoid": cf.Ellipsoid([20.0, 40.0, 20.0], [[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0], [0.0, 0.0, 1.0]]),
    "box": cf.Box([20.0, 40.0, 20.0], [[0.6, 0.0, 0.8], [0.0, 1.0, 0.0], [-0.8, 0.0, 0.6]]),
    "cylinder": cf.Cylinder(20.0, 50.0, [1.0, 2.0, 2.0]),
    "half-spaces": cf.HalfSpaces(NORMALS, [20.0, 30.0, 25.0, 40.0]),
}


def followed(path, other, zone):
    bodies = path.arcs, path.offsets, other.arcs, other.offsets
    return follow(*bodies, (zone,), MANY)[zone]


def conflicts_of_one(path, other, zone, tracks, pair):
    one = np.array([pair])
    return conflicts_of(path, other, zone, one, one, tracks)[1]


def formation(seed, spread=60.0):
    """Return paths of every kind with different starts and ends."""
    rng = np.random.Generator(np.random.Philox(seed))

    def somewhere(count):
        states = rng.normal(size=(count, 6)) * np.repeat([spread, spread * N], 3)
        states[:, 4] = -2 * N * states[:, 0]
        return states

    paths = list(ORBIT.coast(somewhere(6), PERIOD))
    paths += list(ORBIT.coast(somewhere(3), 2000.0, start=1234.5))
    paths += list(ORBIT.transfer(somewhere(4), somewhere(4), 0.8 * PERIOD, start=300.0))
    paths += list(ORBIT.two_impulse(somewhere(3), somewhere(3), 0.3 * PERIOD, start=700.0))
    paths += list(ORBIT.burn(somewhere(2), [3e-5, -2e-5, 1e-5], PERIOD))
    for coasting in ORBIT.coast(somewhere(3), 0.5 * PERIOD):
        final = somewhere(1)[0]
        turned = ORBIT.transfer(coasting.state(0.5 * PERIOD), final, 0.3 * PERIOD, start=0.5 * PERIOD)
        final[3:] += rng.normal(size=3) * 0.05
        paths.append(cf.join([coasting, turned, ORBIT.coast(final, 0.2 * PERIOD, start=0.8 * PERIOD)]))
    times = np.linspace(100.0, 5000.0, 70)
    paths += list(ORBIT.sampled(times, ORBIT.coast(somewhere(3), PERIOD).state(times)))
    return cf.stack(paths)


# --- theory (23) ------------------------------------------------------------------------------


@pytest.mark.parametrize("deep", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_tracks_bound_the_distance_from_chords(kind, deep):
    """The bound holds at 60 times of every interval, and paths use half of it."""
    rng = np.random.Generator(np.random.Philox([KINDS.index(kind), deep]))
    for _ in range(3):
        batch, zone = draw(rng, 4, (kind, "coast"), deep), ZONES["ellipsoid"]
        times, own, _ = followed(batch.path, batch.other, zone)
        share = np.linspace(0.0, 1.0, 60)
        for craft in range(4):
            path, track = batch.path[craft], own[craft]
            place = track[:3].T
            used = []
            for k in range(len(times) - 1):
                t = times[k] + share * (times[k + 1] - times[k])
                there = (t >= path.start) & (t <= path.end)
                chord = place[k] + share[:, None] * (place[k + 1] - place[k])
                off = np.linalg.norm(path.position(t[there]) @ enclosing(zone).T - chord[there], axis=1)
                assert (off <= track[3, k]).all(), (batch.label, craft, k)
                used.append(off.max(initial=0.0) / track[3, k])
            if not deep or kind in ("transfer", "burn", "sampled"):  # others hardly bend
                assert max(used) > 0.5, batch.label


@pytest.mark.parametrize("name", ZONES)
def test_enclosing_ellipsoid_contains_the_zone(name):
    zone = ZONES[name]
    rng = np.random.Generator(np.random.Philox(3))
    ways = rng.normal(size=(20_000, 3))
    surface = ways / zone.norm(ways)[:, None]
    surface = surface[zone.norm(ways) > 0]  # half-spaces of this test are bounded
    lengths = np.linalg.norm(surface @ enclosing(zone).T, axis=1)
    assert lengths.max() <= 1 + 1e-12
    assert lengths.max() > 0.8


# --- conflicts --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kinds", "deep"),
    [((kind, KINDS[(k + 2) % len(KINDS)]), k % 2 == 1) for k, kind in enumerate(KINDS)],
    ids=str,
)
def test_dense_sampling_finds_the_same_conflicts(kinds, deep):
    """Compare with an independent integrator, sampled densely and refined; half of the pairs graze."""
    rng = np.random.Generator(np.random.Philox([sum(map(KINDS.index, kinds)), 7, deep]))
    drawn = draw(rng, 5, kinds, deep)
    for batch in (drawn, graze(rng, drawn, 1e-9)):
        found = [
            conflicts_of_one(
                batch.path, batch.other, zone, followed(batch.path, batch.other, zone), pair
            ).tolist()
            for pair, zone in enumerate(batch.zones)
        ]
        for pair, words in enumerate(faults(batch.relative, batch.relative.extrema(), found)):
            assert not words, (batch.label, pair)


@pytest.mark.parametrize("name", ZONES)
def test_conflicts_do_not_depend_on_tracks(name):
    """Conflicts are identical with and without tracks."""
    paths, zone = formation(11), ZONES[name]
    first, second = map(np.ascontiguousarray, np.nonzero(~np.eye(len(paths), dtype=bool)))
    pairs, rows = conflicts_of(paths, paths, zone, first, second, followed(paths, paths, zone))
    every, expected = conflicts_of(paths, paths, zone, first, second)
    np.testing.assert_array_equal(pairs, every)
    np.testing.assert_array_equal(rows, expected)
    assert 20 < len(np.unique(pairs, axis=0)) < len(first) / 2


def test_many_orbits():
    """Both rejections over many orbits agree with the search of single pairs."""
    rng = np.random.Generator(np.random.Philox(5))
    states = rng.normal(size=(12, 6)) * np.repeat([60.0, 60.0 * N], 3)
    states[:, 4] = -2 * N * states[:, 0]
    for paths in (
        ORBIT.coast(states, 5 * PERIOD),
        ORBIT.transfer(states, states[::-1], 5 * PERIOD),
    ):
        found = cf.screen(paths, ZONES["ellipsoid"])
        expected = [
            (i, j, c.start, c.end, c.time, c.ratio)
            for i in range(12)
            for j in range(i + 1, 12)
            for c in cf.find_conflicts(paths[i], paths[j], ZONES["ellipsoid"])
        ]
        table = np.column_stack([found.pairs, found.start, found.end, found.time, found.ratio])
        np.testing.assert_array_equal(table, expected)
        assert len(found) > 20
