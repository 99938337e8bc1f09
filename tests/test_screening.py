"""Screens against searches of single pairs."""

import io
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import closeform as cf
from closeform.conflicts import batches

N = 1.1e-3
ORBIT = cf.Orbit(N)
ZONE = cf.Ellipsoid([20.0, 40.0, 20.0])


def cluster(count, seed, spread=60.0, duration=5700.0):
    """Return bounded natural motion within a few hundred metres; every fifth spacecraft drifts."""
    rng = np.random.Generator(np.random.Philox(seed))
    states = rng.normal(size=(count, 6)) * np.repeat([spread, spread * N], 3)
    states[:, 4] = -2 * N * states[:, 0]
    states[::5, 4] *= 1.3
    return ORBIT.coast(states, duration)


def one_by_one(paths, zone):
    rows = []
    for i in range(len(paths)):
        for j in range(i + 1, len(paths)):
            found = cf.find_conflicts(paths[i], paths[j], zone)
            rows += [(i, j, c.start, c.end, c.time, c.ratio) for c in found]
    return np.array(rows).reshape(-1, 6)


def table(found):
    return np.column_stack([found.pairs, found.start, found.end, found.time, found.ratio])


@pytest.mark.parametrize("zone", [ZONE, cf.Box([20.0, 40.0, 20.0]), cf.Sphere(30.0)])
def test_screen_equals_the_search_of_each_pair(zone):
    paths = cluster(30, 1)
    found = cf.screen(paths, zone)
    expected = one_by_one(paths, zone)
    assert len(found) == len(expected) > 20
    np.testing.assert_array_equal(table(found), expected)
    assert (found.pairs[:, 0] < found.pairs[:, 1]).all()
    assert found.pairs.shape == (len(found), 2)


def test_screen_of_a_sequence_of_mixed_paths():
    rng = np.random.Generator(np.random.Philox(2))
    paths = list(cluster(6, 3, spread=30.0))
    for _ in range(3):
        ends = rng.normal(size=(2, 6)) * np.repeat([30.0, 0.03], 3)
        paths.append(ORBIT.transfer(*ends, 3000.0, start=500.0))
        paths.append(ORBIT.two_impulse(*ends, 2000.0))
    times = np.linspace(0, 5000, 60)
    paths.append(ORBIT.sampled(times, paths[0].state(times)))
    found = cf.screen(paths, ZONE)
    np.testing.assert_array_equal(table(found), one_by_one(cf.stack(paths), ZONE))
    assert len(found) > 10


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 2**32), st.permutations(range(8)))
def test_order_of_spacecraft_does_not_matter(seed, order):
    paths = cluster(8, seed, spread=40.0)
    found, turned = cf.screen(paths, ZONE), cf.screen(paths[list(order)], ZONE)
    there = {tuple(sorted((order[i], order[j]))) for i, j in turned.pairs}
    assert there == {tuple(pair) for pair in found.pairs.tolist()}
    assert len(found) == len(turned)


def test_several_chunks_of_pairs():
    """400 spacecraft have 79 800 pairs in three chunks; compare with closest approaches."""
    paths = cluster(400, 4, spread=400.0)
    found = cf.screen(paths, ZONE)
    order = np.lexsort((found.start, found.pairs[:, 1], found.pairs[:, 0]))
    np.testing.assert_array_equal(order, np.arange(len(found)))
    nearest = cf.closest_approach(paths[:, None], paths, ZONE)
    i, j = np.nonzero(np.triu(nearest.ratio <= 1, k=1))
    assert {tuple(p) for p in found.pairs.tolist()} == set(zip(i.tolist(), j.tolist(), strict=True))
    assert len(i) > 100


def test_more_conflicts_than_rows_of_a_table():
    """Thirty orbits of cross-track motion exceed one table; none is lost."""
    duration = 30 * 2 * np.pi / N
    swings = 50.0 + 10.0 * np.arange(20)
    states = np.zeros((20, 6))
    states[:, 2] = swings * (-1.0) ** np.arange(20)
    found = cf.screen(ORBIT.coast(states, duration), cf.Sphere(5.0))
    # z_i - z_j swings about zero with another amplitude for every pair: two stays an orbit
    gap = np.abs(states[:, None, 2] - states[:, 2])
    crossing = np.triu(gap > 5.0, k=1).sum()
    assert crossing == 190
    assert len(found) == crossing * 60


def test_more_conflicts_of_one_pair_than_rows():
    turns = 2500
    states = np.array([[0, 0, 50.0, 0, 0, 0], [0, 0, -50.0, 0, 0, 0]])
    paths = ORBIT.coast(states, turns * 2 * np.pi / N)
    assert len(cf.screen(paths, cf.Sphere(5.0))) == 2 * turns
    assert len(cf.find_conflicts(paths[0], paths[1], cf.Sphere(5.0))) == 2 * turns


def test_empty_screen():
    for count in (0, 1):
        found = cf.screen(ORBIT.coast(np.zeros((count, 6)), 10.0), ZONE)
        assert len(found) == 0
        assert found.pairs.shape == (0, 2)
    apart = ORBIT.coast(np.zeros((2, 6)), 10.0, start=[0.0, 20.0])
    assert len(cf.screen(apart, ZONE)) == 0


def test_progress_bar_on_a_terminal_only(monkeypatch, capsys):
    """Many pairs show a bar on a terminal only; the answer is the same."""
    paths = cluster(40, 5)
    quiet = cf.screen(paths, ZONE)
    monkeypatch.setattr(batches, "LONG", 1)
    np.testing.assert_array_equal(table(cf.screen(paths, ZONE)), table(quiet))
    shown = capsys.readouterr()
    assert shown.out == shown.err == ""

    class Terminal(io.StringIO):
        def isatty(self):
            return True

    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("TERM", "xterm")
    np.testing.assert_array_equal(table(cf.screen(paths, ZONE)), table(quiet))
    assert "screening pairs" in terminal.getvalue()


BAD = {
    "grid": (
        lambda: cf.screen(ORBIT.coast(np.zeros((2, 2, 6)), 1.0), ZONE),
        r"paths: expected a Path of shape",
    ),
    "one": (lambda: cf.screen(ORBIT.coast(np.zeros(6), 1.0), ZONE), r"paths: expected a Path of shape"),
    "none": (lambda: cf.screen([], ZONE), "paths: nothing to stack"),
    "orbits": (
        lambda: cf.screen([ORBIT.coast(np.zeros(6), 1.0), cf.Orbit(0.0).coast(np.zeros(6), 1.0)], ZONE),
        "paths: all must be in one orbit",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_invalid_input(case):
    call, message = BAD[case]
    with pytest.raises(ValueError, match=message):
        call()
