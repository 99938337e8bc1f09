"""Thousands of spacecraft: memory does not grow with the pairs, and the closest pairs are found."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest

import closeform as cf
from closeform.cli.app import main
from closeform.conflicts import flight
from closeform.plots.drawing.pairs import Pairs
from closeform.zones.pair_zones import AT_ONCE, PairZones, portions, portions_near
from scenarios import LOST

pytestmark = pytest.mark.fault
ORBIT = cf.Orbit.circular(500e3)


def scenario(craft: int, half_width: float, ending: str = '[[stage]]\ndo = "coast"\nfor = "10 min"\n') -> str:
    """Craft anywhere in a cube, at rest, as a file."""
    places = np.random.default_rng(craft).uniform(-half_width, half_width, (craft, 3))
    names = ", ".join(f'"C{k}"' for k in range(craft))
    position = ", ".join('"{:.3f} {:.3f} {:.3f} m"'.format(*place) for place in places)
    return (
        'closeform = 1\ntitle = "Many"\n\n[orbit]\naltitude = "500 km"\n\n[craft]\n'
        f'name = [{names}]\nposition = [{position}]\nvelocity = "0 0 0 m/s"\n'
        f'keep_out = {{ sphere = "5 m" }}\n\n{ending}'
    )


# What one process needs at most, measured with Python, NumPy and all kernels: check 180 MB, run 460 MB,
# screen 190 MB. One array of all pairs of numbers is 144 MB, one of three coordinates 432 MB; a list of
# them was 7 GB.
MOST = {"check": 280, "run": 700, "screen": 320}  # MB
MEASURED = """
import re, sys
from pathlib import Path
from closeform.cli.app import main
if sys.argv[1] == "screen":
    import numpy as np, closeform as cf
    states = np.zeros((6000, 6))
    states[:, :3] = np.random.default_rng(1).uniform(-2e4, 2e4, (6000, 3))
    print(len(cf.screen(cf.Orbit.circular(500e3).coast(states, 600.0), cf.Sphere(5.0))))
else:
    assert main(sys.argv[1:]) == 0
print(int(re.search(r"VmHWM:\\s+(\\d+) kB", Path("/proc/self/status").read_text())[1]) // 1024)
"""  # getrusage counts what the process had before it became this one: that of the tests


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="asks Linux for the memory")
@pytest.mark.parametrize("command", MOST)
def test_memory_does_not_grow_with_pairs(command, tmp_path) -> None:
    """6000 craft, 18 million pairs."""
    (tmp_path / "many.toml").write_text(scenario(6000, 2e4))
    done = subprocess.run(
        [sys.executable, "-c", MEASURED, command, "many.toml"], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert int(done.stdout.split()[-1]) < MOST[command]


@pytest.mark.parametrize("spread", [(1.0, 1.0, 1.0), (0.0, 1.0, 0.02)], ids=["a cloud", "a string"])
def test_closest_pairs_agree_with_all_pairs(spread, monkeypatch) -> None:
    """All pairs of 400 craft one by one, and those that are looked for among them."""
    states = np.zeros((400, 6))
    states[:, :3] = np.random.default_rng(4).uniform(-3e3, 3e3, (400, 3)) * spread
    states[:, 3:] = np.random.default_rng(5).normal(0.0, 0.5, (400, 3))
    paths = ORBIT.coast(states, 2000.0)
    own = [cf.Sphere(5.0 + k % 3) for k in range(398)] + [None, None]
    zones = PairZones.of(own)
    names = [f"C{k}" for k in range(400)]
    every = flight.watch(paths, names, zones)
    assert every.pairs == len(every.approaches) == 400 * 399 // 2 - 1
    monkeypatch.setattr(flight, "ALL_PAIRS", 1000)
    monkeypatch.setattr(flight, "CLOSEST", 300)
    some = flight.watch(paths, names, zones)
    assert 300 <= len(some.approaches) <= 3000
    assert some.pairs == every.pairs
    assert some.conflicts == every.conflicts
    ratios = sorted(near.ratio for near in every.approaches)[: len(some.approaches)]
    # certain to 1e-9 of a ratio, twice
    assert sorted(near.ratio for near in some.approaches) == pytest.approx(ratios, rel=1e-8)
    assert (some.closest.first, some.closest.second) == (every.closest.first, every.closest.second)


def test_all_pairs_in_conflict_are_among_the_closest(monkeypatch) -> None:
    """In a crowd more pairs are in conflict than the closest that are looked for."""
    states = np.zeros((100, 6))
    states[:, :3] = np.random.default_rng(6).uniform(-60.0, 60.0, (100, 3))
    paths, zone = ORBIT.coast(states, 500.0), cf.Sphere(20.0)
    monkeypatch.setattr(flight, "CLOSEST", 50)
    every, some = Pairs.of(paths, zone), Pairs.of(paths, zone, most=0)
    assert len(some) < len(every) == some.total
    assert 50 < some.hit.sum() == every.hit.sum()


def test_pairs_of_a_zone_by_portions() -> None:
    """Against a double loop."""
    own = [cf.Sphere(3.0), None, cf.Sphere(4.0), None, cf.Sphere(3.0), None]
    zones = PairZones.of(own, moves=[True, True, False, False, True, False])
    expected = {(i, j): zones.between(i, j) for i in range(6) for j in range(i + 1, 6)}
    expected = {pair: zone for pair, zone in expected.items() if zone is not None}
    assert zones.pairs == len(expected)
    for at_once in (1, 4, 100):
        rows = [
            (pair, zone)
            for zone, first, second in portions(zones, at_once)
            for pair in zip(first.tolist(), second.tolist(), strict=True)
        ]
        assert len(rows) == len(expected)
        assert dict(rows) == expected


def test_long_lists_of_names_are_shortened(tmp_path, capsys) -> None:
    """Of 2000 craft in a cube of 2 m all two million pairs are wrong."""
    (tmp_path / "many.toml").write_text(scenario(2000, 1.0))
    assert main(["check", str(tmp_path / "many.toml")]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 101
    assert "1999000 pairs in all start inside each other's zone; move one of them" in lines[-1]


def test_lost_spacecraft_at_one_position_are_named_once(tmp_path, capsys) -> None:
    """1000 at one place are half a million pairs."""
    count = 1000
    names = ", ".join(f'"L{k}"' for k in range(count))
    groups = ", ".join(['"A"', '"B"'] * (count // 2))
    head, tail = LOST.split("[craft]")
    still = 'position = "0 0 0 m"\nvelocity = "0 0 0 m/s"'
    text = f"{head}[craft]\nname = [{names}]\ngroup = [{groups}]\n{still}\n\n{tail[tail.index('[sensor]') :]}"
    (tmp_path / "lost.toml").write_text(text.replace('"craft.position"', '"craft.velocity"'))
    assert main(["check", str(tmp_path / "lost.toml")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == count - 1


def test_table_of_many_approaches(tmp_path) -> None:
    (tmp_path / "many.toml").write_text(scenario(600, 5e3))
    assert main(["run", str(tmp_path / "many.toml"), "--out", str(tmp_path / "results")]) == 0
    rows = pyarrow.parquet.read_table(tmp_path / "results" / "approaches.parquet").num_rows
    assert 2 * flight.CLOSEST <= rows < 20 * flight.CLOSEST  # before and after
    assert f"closest of {600 * 599 // 2}" in Path(tmp_path / "results" / "report.html").read_text()


def test_near_pairs_are_all_that_can_be_inside() -> None:
    """Of 1500 craft: the pairs inside each other's zone, by the distances of all."""
    places = np.random.default_rng(4).uniform(-300.0, 300.0, (1500, 3))
    own = [cf.Sphere(5.0), cf.Box([6.0, 30.0, 8.0]), None]
    zones = PairZones.of([own[k % 3] for k in range(1500)])
    assert zones.pairs > AT_ONCE  # so many that distances are asked first
    found = set()
    for zone, first, second in portions_near(zones, places):
        inside = zone.norm(places[first] - places[second]) <= 1.0
        found |= set(zip(first[inside].tolist(), second[inside].tolist(), strict=True))
    apart = np.linalg.norm(places[:, None] - places, axis=2)
    truth = set()
    for one, other in np.argwhere(np.triu(apart <= 60.0, 1)).tolist():  # beyond the corners of two boxes
        zone = zones.between(one, other)
        if zone is not None and zone.norm(places[one] - places[other]) <= 1.0:
            truth.add((one, other))
    assert found == truth
    assert len(truth) > 10
