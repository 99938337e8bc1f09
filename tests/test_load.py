"""`load`: what a run or a study left evaluates bit for bit as it did, and says no more than it knows."""

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

pytestmark = pytest.mark.usefixtures("unpainted")

EXAMPLES = Path(__file__).parents[1] / "examples"
SHORT = LOST.replace("cases = 100", "cases = 20")


def left(folder: Path, text: str, *arguments: str) -> Path:
    """What a run of a scenario leaves."""
    folder.mkdir(exist_ok=True)
    (folder / "case.toml").write_text(text)
    main(["run", str(folder / "case.toml"), "--out", str(folder / "results"), *arguments])
    return folder / "results"


@pytest.fixture(scope="module")
def moved(tmp_path_factory) -> tuple[Mission, Path]:
    """A coast and a move, in orbit."""
    folder = tmp_path_factory.mktemp("moved")
    place = left(folder, GOOD.replace('sphere = "20 m"', 'sphere = "25 m"'))
    return cf.run(folder / "case.toml"), place


@pytest.fixture(scope="module")
def gathered(tmp_path_factory) -> tuple[Mission, Path]:
    """Lost craft that gather, then coast on: the second search begins later."""
    folder = tmp_path_factory.mktemp("gathered")
    text = LOST.partition("\n[study]")[0]
    text = text.replace("[[stage]]", '[[stage]]\ndo = "coast"\nfor = "100 s"\n\n[[stage]]')
    text = text.replace("group =", 'keep_out = { sphere = "5 m" }\ngroup =')
    text = text.replace('velocity = "0 0 0 cm/s"', 'velocity = ["0 0 0 cm/s", "1 0 -2 cm/s", "0 3 1 cm/s"]')
    place = left(folder, text.replace("rounds = 2", "rounds = 2\nanimation = false"))
    return cf.run(folder / "case.toml"), place


def same_flight(mine: object, theirs: object) -> None:
    """Arcs, conflicts and approaches are those of the run, to the last bit."""
    for name in ("arcs", "offsets"):
        np.testing.assert_array_equal(getattr(mine.paths, name), getattr(theirs.paths, name))
    assert (mine.names, mine.pairs) == (theirs.names, theirs.pairs)
    assert mine.conflicts == theirs.conflicts
    assert len(mine.approaches) == len(theirs.approaches)
    for one, other in zip(mine.approaches, theirs.approaches, strict=True):
        for key in ("first", "second", "time", "ratio", "distance", "rule"):
            assert getattr(one, key) == getattr(other, key)
        np.testing.assert_array_equal(one.zone.matrix, other.zone.matrix)


def test_paths_are_those_of_the_run_to_the_last_bit(moved) -> None:
    mission, place = moved
    run = cf.load(place)
    assert isinstance(run, LoadedRun)
    assert (run.names, run.orbit, run.stopped) == (mission.scenario.names, mission.orbit, mission.stopped)
    assert run.clear == mission.clear
    assert [stage.stage for stage in run.results] == [result.stage for result in mission.results]
    assert mission.results[1].before.conflicts  # there is something to compare
    for mine, theirs in zip(run.results, mission.results, strict=True):
        assert (mine.number, mine.start, mine.end) == (theirs.number, theirs.start, theirs.end)
        assert (mine.flown, mine.failure) == (theirs.flown, theirs.failure)
        same_flight(mine.before, theirs.before)
        same_flight(mine.after, theirs.after)
        times = np.linspace(mine.start, mine.end, 101)
        np.testing.assert_array_equal(mine.after.paths.state(times), theirs.after.paths.state(times))
        np.testing.assert_array_equal(mine.after.paths.thrust(times), theirs.after.paths.thrust(times))


def test_burns_are_those_of_the_table(moved) -> None:
    mission, place = moved
    move = cf.load(place).results[1]
    spent = dict(zip(mission.scenario.names, mission.results[1].delta_v, strict=True))
    for name in mission.scenario.names:
        own = move.burns["craft"] == name
        assert move.burns["size_m_s"][own].sum() == pytest.approx(spent[name], rel=1e-9, abs=1e-15)
    assert len(move.burns["craft"]) > 0


@pytest.mark.parametrize("flown", ["moved", "gathered"])
def test_burns_of_all_stages_are_those_of_the_run(flown, request) -> None:
    """Impulses on joining a set too: the same columns, to the last bit."""
    mission, place = request.getfixturevalue(flown)
    burns = cf.load(place).burns
    assert list(burns) == list(mission.burns)
    for name, column in mission.burns.items():
        assert burns[name].tolist() == column, name
    assert len(burns["stage"]) > 0


def test_a_gathering_comes_back_with_its_search_and_sets(gathered) -> None:
    mission, place = gathered
    run = cf.load(place)
    mine, theirs = run.results[1].result, mission.results[1].result
    assert isinstance(mine, cf.Gathering)
    assert len(theirs.events) >= 3
    for key in ("groups", "totals", "burns", "sets", "lost", "duration", "rounds", "status", "reason"):
        assert getattr(mine, key) == getattr(theirs, key), key
    np.testing.assert_array_equal(mine.delta_v, theirs.delta_v)
    np.testing.assert_array_equal(mine.history, theirs.history)
    for one, other in zip(mine.events, theirs.events, strict=True):
        told, own = ({k: v for k, v in vars(event).items() if k != "delta_v"} for event in (one, other))
        assert told == own
        np.testing.assert_array_equal(one.delta_v, other.delta_v)
    times = np.linspace(0.0, theirs.search.duration, 500)
    for group in ("A", "B"):
        np.testing.assert_array_equal(
            mine.search.attitude(times, group), theirs.search.attitude(times, group)
        )
    # its own time counts from the start of the stage: 100 s are added and taken away again
    inner = np.linspace(0.0, theirs.duration, 50)[1:-1]
    np.testing.assert_allclose(mine.paths.position(inner), theirs.paths.position(inner), atol=1e-9)


def test_first_locks_come_back(tmp_path) -> None:
    text = LOST.partition("\n[study]")[0].replace('do = "gather"\nrounds = 2', 'do = "lock"')
    place = left(tmp_path, text)
    mine, theirs = cf.load(place).results[0].result, cf.run(tmp_path / "case.toml").results[0].result
    np.testing.assert_array_equal(mine.pairs, theirs.pairs)
    np.testing.assert_array_equal(mine.locks.time, theirs.locks.time)
    np.testing.assert_array_equal(mine.locks.leg, theirs.locks.leg)
    np.testing.assert_array_equal(mine.search.table, theirs.search.table)


def test_a_case_of_a_study_and_the_study(tmp_path) -> None:
    place = left(tmp_path, SHORT, "--case", "3")
    run = cf.load(place)
    assert (run.scenario.case, run.summary["case"]) == (3, 3)
    first = run.results[0].after.paths.position(0.0)
    np.testing.assert_array_equal(run.scenario.states(run.orbit)[:, :3], first)
    main(["study", str(tmp_path / "case.toml"), "--out", str(tmp_path / "study")])
    study = cf.load(tmp_path / "study")
    assert isinstance(study, LoadedStudy)
    assert study.scenario.title == run.scenario.title.partition(": case")[0]
    assert study.summary["cases"] == 20
    assert study.cases["case"].tolist() == list(range(20))


def test_a_plan_that_failed_comes_back_as_it_was(tmp_path) -> None:
    """Two that end on each other: the stage is kept, with why nothing is flown after it."""
    blocked = GOOD.replace('position = "0 -100 0 m"', 'position = "0 100 0 m"')
    place = left(tmp_path, blocked)
    mission, run = cf.run(tmp_path / "case.toml"), cf.load(place)
    assert mission.stopped is not None
    assert (run.stopped, run.clear) == (mission.stopped, False)
    assert [stage.flown for stage in run.results] == [one.flown for one in mission.results]
    assert run.results[-1].failure == mission.results[-1].failure


def broken(place: Path, copy: Path, name: str, damage: str) -> Path:
    """A copy of a folder in which one file is gone, cut off or has one other byte."""
    shutil.copytree(place, copy)
    data = bytearray((copy / name).read_bytes())
    if damage == "gone":
        (copy / name).unlink()
    else:
        data[len(data) // 3] ^= 0x10
        (copy / name).write_bytes(data if damage == "a bit" else data[: len(data) // 2])
    return copy


@pytest.mark.parametrize("damage", ["gone", "cut off", "a bit"])
@pytest.mark.parametrize("name", ["arcs.parquet", "conflicts.parquet", "scenario.toml"])
def test_damage_is_said_in_one_line(moved, tmp_path, name, damage) -> None:
    place = broken(moved[1], tmp_path / "copy", name, damage)
    with pytest.raises(
        FolderError, match=rf"copy: {name} (is missing|was changed or is damaged); run it again"
    ) as error:
        cf.load(place)
    assert "\n" not in str(error.value)


def test_folders_of_others_and_other_versions(moved, tmp_path) -> None:
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
