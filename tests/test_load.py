"""`load`: results of runs and studies are identical to the original ones."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

import closeform as cf
from closeform.cli.app import main
from closeform.mission.mission_result import Mission
from closeform.results.load import LoadedRun, LoadedStudy
from closeform.storage.result_folder import SUMMARY, FolderError
from scenarios import GOOD, LOST

pytestmark = pytest.mark.usefixtures("undrawn")

SHORT = LOST.replace("cases = 100", "cases = 5")


def run_folder(folder: Path, text: str, *arguments: str) -> Path:
    """Run a scenario; return its result folder."""
    folder.mkdir(exist_ok=True)
    (folder / "case.toml").write_text(text)
    main(["run", str(folder / "case.toml"), "--out", str(folder / "results"), "--no-viewer", *arguments])
    return folder / "results"


@pytest.fixture(scope="module")
def moved(tmp_path_factory) -> tuple[Mission, Path]:
    """Mission with a coast and a move."""
    folder = tmp_path_factory.mktemp("moved")
    place = run_folder(folder, GOOD.replace('sphere = "20 m"', 'sphere = "25 m"'))
    return cf.run(folder / "case.toml"), place


@pytest.fixture(scope="module")
def gathered(tmp_path_factory) -> tuple[Mission, Path]:
    """Mission of lost spacecraft that coast and gather."""
    folder = tmp_path_factory.mktemp("gathered")
    text = LOST.partition("\n[study]")[0]
    text = text.replace("[[stage]]", '[[stage]]\ndo = "coast"\nfor = "100 s"\n\n[[stage]]')
    text = text.replace("group =", 'keep_out = { sphere = "5 m" }\ngroup =')
    text = text.replace('velocity = "0 0 0 cm/s"', 'velocity = ["0 0 0 cm/s", "1 0 -2 cm/s", "0 3 1 cm/s"]')
    place = run_folder(folder, text.replace("rounds = 2", "rounds = 2\nanimation = false"))
    return cf.run(folder / "case.toml"), place


def assert_same_paths(mine: object, theirs: object) -> None:
    """Check that arcs, conflicts and approaches are identical."""
    for name in ("arcs", "offsets"):
        np.testing.assert_array_equal(getattr(mine.paths, name), getattr(theirs.paths, name))
    assert (mine.names, mine.pairs) == (theirs.names, theirs.pairs)
    assert mine.conflicts == theirs.conflicts
    assert len(mine.approaches) == len(theirs.approaches)
    for one, other in zip(mine.approaches, theirs.approaches, strict=True):
        for key in ("first", "second", "time", "ratio", "distance", "rule"):
            assert getattr(one, key) == getattr(other, key)
        np.testing.assert_array_equal(one.zone.matrix, other.zone.matrix)


def test_loaded_paths_are_identical(moved) -> None:
    mission, place = moved
    run = cf.load(place)
    assert isinstance(run, LoadedRun)
    assert (run.names, run.orbit, run.stopped) == (mission.scenario.names, mission.orbit, mission.stopped)
    assert run.clear == mission.clear
    assert [stage.stage for stage in run.results] == [result.stage for result in mission.results]
    assert mission.results[1].before.conflicts
    for mine, theirs in zip(run.results, mission.results, strict=True):
        assert (mine.number, mine.start, mine.end) == (theirs.number, theirs.start, theirs.end)
        assert (mine.executed, mine.failure) == (theirs.executed, theirs.failure)
        assert_same_paths(mine.before, theirs.before)
        assert_same_paths(mine.after, theirs.after)
        times = np.linspace(mine.start, mine.end, 101)
        np.testing.assert_array_equal(mine.after.paths.state(times), theirs.after.paths.state(times))
        np.testing.assert_array_equal(mine.after.paths.thrust(times), theirs.after.paths.thrust(times))


def test_loaded_burns_of_a_stage(moved) -> None:
    mission, place = moved
    move = cf.load(place).results[1]
    spent = dict(zip(mission.scenario.names, mission.results[1].delta_v, strict=True))
    for name in mission.scenario.names:
        own = move.burns["craft"] == name
        assert move.burns["size_m_s"][own].sum() == pytest.approx(spent[name], rel=1e-9, abs=1e-15)
    assert len(move.burns["craft"]) > 0


@pytest.mark.parametrize("flown", ["moved", "gathered"])
def test_loaded_burns_are_identical(flown, request) -> None:
    """The columns are identical, also for impulses of a gathering."""
    mission, place = request.getfixturevalue(flown)
    burns = cf.load(place).burns
    assert list(burns) == list(mission.burns)
    for name, column in mission.burns.items():
        assert burns[name].tolist() == column, name
    assert len(burns["stage"]) > 0


def test_loaded_gathering_is_identical(gathered) -> None:
    mission, place = gathered
    run = cf.load(place)
    mine, theirs = run.results[1].result, mission.results[1].result
    assert isinstance(mine, cf.Gathering)
    assert len(theirs.events) >= 3
    for key in ("groups", "totals", "burns", "sets", "lost", "duration", "rounds", "status", "reason"):
        assert getattr(mine, key) == getattr(theirs, key), key
    np.testing.assert_array_equal(mine.delta_v, theirs.delta_v)
    np.testing.assert_array_equal(mine.history, theirs.history)
    np.testing.assert_array_equal(mine.join_table, theirs.join_table)
    for one, other in zip(mine.events, theirs.events, strict=True):
        told, own = ({k: v for k, v in vars(event).items() if k != "delta_v"} for event in (one, other))
        assert told == own
        np.testing.assert_array_equal(one.delta_v, other.delta_v)
    times = np.linspace(0.0, theirs.search.duration, 500)
    for group in ("A", "B"):
        np.testing.assert_array_equal(
            mine.search.attitude(times, group), theirs.search.attitude(times, group)
        )
    # time within the stage is rounded, because 100 s are added and subtracted
    inner = np.linspace(0.0, theirs.duration, 50)[1:-1]
    np.testing.assert_allclose(mine.paths.position(inner), theirs.paths.position(inner), atol=1e-9)


def test_loaded_locks_are_identical(tmp_path) -> None:
    text = LOST.partition("\n[study]")[0].replace('do = "gather"\nrounds = 2', 'do = "lock"')
    place = run_folder(tmp_path, text)
    mine, theirs = cf.load(place).results[0].result, cf.run(tmp_path / "case.toml").results[0].result
    np.testing.assert_array_equal(mine.pairs, theirs.pairs)
    np.testing.assert_array_equal(mine.locks.time, theirs.locks.time)
    np.testing.assert_array_equal(mine.locks.leg, theirs.locks.leg)
    np.testing.assert_array_equal(mine.search.table, theirs.search.table)


def test_loaded_study_and_case(tmp_path) -> None:
    place = run_folder(tmp_path, SHORT, "--case", "3")
    run = cf.load(place)
    assert (run.scenario.case, run.summary["case"]) == (3, 3)
    first = run.results[0].after.paths.position(0.0)
    np.testing.assert_array_equal(run.scenario.states(run.orbit)[:, :3], first)
    main(["study", str(tmp_path / "case.toml"), "--out", str(tmp_path / "study")])
    study = cf.load(tmp_path / "study")
    assert isinstance(study, LoadedStudy)
    assert study.scenario.title == run.scenario.title.partition(": case")[0]
    assert study.summary["cases"] == 5
    assert study.cases["case"].tolist() == list(range(5))


def test_loaded_failed_plan(tmp_path) -> None:
    """A failed stage is kept with its reason."""
    blocked = GOOD.replace('position = "0 -100 0 m"', 'position = "0 100 0 m"')
    place = run_folder(tmp_path, blocked)
    mission, run = cf.run(tmp_path / "case.toml"), cf.load(place)
    assert mission.stopped is not None
    assert (run.stopped, run.clear) == (mission.stopped, False)
    assert [stage.executed for stage in run.results] == [one.executed for one in mission.results]
    assert run.results[-1].failure == mission.results[-1].failure


def damaged_copy(place: Path, copy: Path, name: str, damage: str) -> Path:
    """Return a copy of a folder in which one file is missing, truncated or changed."""
    shutil.copytree(place, copy)
    data = bytearray((copy / name).read_bytes())
    if damage == "gone":
        (copy / name).unlink()
    else:
        data[len(data) // 3] ^= 0x10
        (copy / name).write_bytes(data if damage == "a bit" else data[: len(data) // 2])
    return copy


@pytest.mark.parametrize(
    ("name", "damage"),
    [("arcs.parquet", "a bit"), ("conflicts.parquet", "gone"), ("scenario.toml", "cut off")],
)
def test_damage_is_reported_in_one_line(moved, tmp_path, name, damage) -> None:
    place = damaged_copy(moved[1], tmp_path / "copy", name, damage)
    with pytest.raises(
        FolderError, match=rf"copy: {name} (is missing|was changed or is damaged); run it again"
    ) as error:
        cf.load(place)
    assert "\n" not in str(error.value)


def test_other_folders_and_versions_are_refused(moved, tmp_path) -> None:
    (tmp_path / "theirs").mkdir()
    (tmp_path / "file").write_text("x")
    for name, words in (
        ("none", "no such folder; give the result folder of a run"),
        ("file", "is a file; give the result folder of a run"),
        ("theirs", "holds no finished results; run the scenario first"),
    ):
        with pytest.raises(FolderError, match=f"{name}: {words}$"):
            cf.load(tmp_path / name)
    place = shutil.copytree(moved[1], tmp_path / "copy")
    summary = json.loads((place / SUMMARY).read_text())
    for changes, words in (
        ({"closeform": 2}, "has format 2, this version reads 1; run it again"),
        ({"kind": None}, "was written by an earlier version or another command; run it again"),
        ({"versions": {}}, r"summary\.json was not written by closeform; give the result folder"),
        ({"stages": [{}]}, "a table is damaged; run it again"),
    ):
        (place / SUMMARY).write_text(json.dumps(summary | changes))
        with pytest.raises(FolderError, match=words):
            cf.load(place)
    (place / SUMMARY).write_text("{")
    with pytest.raises(FolderError, match=r"summary\.json is damaged; run it again"):
        cf.load(place)
    (place / SUMMARY).write_text(json.dumps(summary))
    with (place / "scenario.toml").open("a") as file:
        file.write("\n# one more line\n")
    with pytest.raises(FolderError, match=r"scenario\.toml was changed or is damaged; run it again"):
        cf.load(place)
