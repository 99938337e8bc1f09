"""Screens of exported plans reproduce their conflicts."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import closeform as cf
from closeform.cli.app import main
from exported import FLYING, run

pytestmark = pytest.mark.usefixtures("undrawn")

ZONE = cf.Sphere(25.0)
KICKED = 5e-3  # s after an impulse: not compared


@pytest.fixture(scope="module")
def mission(tmp_path_factory):
    return run(tmp_path_factory.mktemp("mission"), FLYING)


@pytest.fixture(scope="module")
def direct(mission, tmp_path_factory):
    """The plan before avoidance, with conflicts, and its exported files; the first is at rest."""
    move = mission.results[1]
    place = tmp_path_factory.mktemp("direct") / "oem"
    chief = mission.scenario.chief
    cf.export(move.before.paths, place, "oem", chief=chief, names=move.before.names)
    return move.before, sorted(place.glob("*.oem"))


def screened(files: list[Path], folder: Path, *more: str, sphere: str = "25 m") -> tuple[int, dict]:
    """Return the status of a screen and its summary."""
    out = folder / "screened"
    status = main(["screen", *map(str, files), "--sphere", sphere, "--out", str(out), "--overwrite", *more])
    return status, json.loads((out / "summary.json").read_text())


@pytest.mark.parametrize("more", [(), pytest.param(("--interpolate", "1 mm"), marks=pytest.mark.slow)])
def test_conflicts_of_a_plan_and_of_its_files_agree(direct, tmp_path, capsys, more) -> None:
    """To 1 ms and 1 mm; the first file is F1, at rest in the origin."""
    flight, files = direct
    status, _ = screened(files, tmp_path, *more)
    assert status == 1
    frame = cf.common_frame([cf.read_oem_segments(file) for file in files])
    found = cf.screen(frame.paths, ZONE).conflicts
    assert len(found) == len(flight.conflicts) >= 1
    for mine, theirs in zip(found, flight.conflicts, strict=True):
        assert (frame.names[mine.first], frame.names[mine.second]) == (theirs.first, theirs.second)
        start = float(flight.paths.start[0])
        assert mine.start + start == pytest.approx(theirs.start, abs=1e-3)
        assert mine.end + start == pytest.approx(theirs.end, abs=1e-3)
        assert mine.ratio * 25.0 == pytest.approx(theirs.ratio * 25.0, abs=1e-3)


def test_plan_with_burns_is_reproduced(mission, tmp_path, capsys) -> None:
    """F3 has three segments: coast, thrust, impulses; to 10 um on coasts and 1 mm else."""
    place = cf.export(mission, tmp_path / "oem", "oem")
    files = sorted(place.glob("*.oem"))
    segments = [cf.read_oem_segments(file) for file in files]
    assert [len(each) for each in segments] == [1, 1, 3]
    frame = cf.common_frame(segments)
    assert [len(some) for some in frame.manoeuvres] == [0, 0, 1]  # the last impulse is at the end
    (when, size), (time, jump) = frame.manoeuvres[2][0], mission.results[2].after.paths[2].impulses[0]
    assert (when, size) == pytest.approx((time, np.linalg.norm(jump)), rel=1e-6)
    for result in mission.results:
        times = np.linspace(result.start, result.end, 400)
        times = times[np.abs(times[:, None] - [one.end for one in mission.results]).min(axis=1) > KICKED]
        times = times[(times > KICKED) & (times < frame.times[-1])]
        for k, path in enumerate(frame.paths):
            off = path.position(times) - result.after.paths[k].position(times)
            off -= frame.paths[0].position(times) - result.after.paths[0].position(times)
            assert np.linalg.norm(off, axis=1).max() < (1e-5 if result.stage.verb == "coast" else 1e-3)
    status, _ = screened(files, tmp_path, sphere="24.99 m")  # the plan touches its zones
    assert status == 0
    printed = capsys.readouterr().out
    assert re.search(r"Manoeuvres between segments: F3 1 \(0\.\d+ m/s\)", printed)
    nearest = min((r.after.closest for r in mission.results), key=lambda one: one.ratio)
    told = re.search(r"closest approach (F\d) - (F\d), (\S+) x zone \((\S+) m\) at (\S+) s", printed)
    assert {told[1], told[2]} == {nearest.first, nearest.second}
    assert float(told[4]) == pytest.approx(nearest.distance, abs=2e-3)


def test_gaps_and_jumps_between_segments_are_rejected(mission, tmp_path) -> None:
    place = cf.export(mission, tmp_path / "oem", "oem")
    first = cf.read_oem_segments(place / "F1.oem")
    parts = cf.read_oem_segments(place / "F3.oem")
    with pytest.raises(
        ValueError, match=r"^F3: has no states for the [\d.]+ s before segment 2; give a file"
    ):
        cf.common_frame([first, [parts[0], parts[2]]])
    moved = parts[1].states + [3.0, 4.0, 0.0, 0.0, 0.0, 0.0]
    fields = {
        name: getattr(parts[1], name) for name in ("name", "object_id", "center", "frame", "time_system")
    }
    other = cf.Ephemeris(**fields, epoch=parts[1].epoch, times=parts[1].times, states=moved)
    with pytest.raises(
        ValueError, match=r"^F3: segment 2 begins 5 m from the end of the previous one; a man"
    ):
        cf.common_frame([first, [parts[0], other, parts[2]]])
    with pytest.raises(ValueError, match=r"^ephemerides: an object has no segments; leave it out$"):
        cf.common_frame([first, []])


def test_manoeuvre_between_common_epochs_is_detected(mission, tmp_path) -> None:
    """Interpolation must be allowed, and then finds it."""
    place = cf.export(mission, tmp_path / "oem", "oem")
    (still,) = cf.read_oem_segments(place / "F1.oem")
    fires = cf.read_oem_segments(place / "F3.oem")
    kept = np.isclose(still.times % 20.0, 0.0) | np.isclose(still.times % 20.0, 20.0)
    fields = {name: getattr(still, name) for name in ("name", "object_id", "center", "frame", "time_system")}
    grid = cf.Ephemeris(**fields, epoch=still.epoch, times=still.times[kept], states=still.states[kept])
    with pytest.raises(
        ValueError, match=r"^F3: has a manoeuvre [\d.]+ s from the nearest common epoch; allow"
    ):
        cf.common_frame([grid, fires])
    frame = cf.common_frame([grid, fires], interpolate=1e-3)
    whole = cf.common_frame([[still], fires])
    times = np.linspace(310.0, frame.times[-1] - 30.0, 200)
    off = frame.paths[1].position(times) - whole.paths[1].position(times)
    assert np.linalg.norm(off, axis=1).max() < 1e-3
