"""Result folders with two writers, foreign files, and an interruption at every file operation."""

import json
import os
import resource
import subprocess
import sys
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from closeform.storage.publishing import folder, settle
from closeform.storage.result_folder import PRIVATE, SUMMARY, Folder, FolderError, finished, page_of
from scenarios import GOOD, LOST

pytestmark = pytest.mark.fault
BUILDERS = {"run": folder, "study": partial(folder, study=True)}


def fill(under_way: Folder, age: str) -> None:
    """Write three files with their age as content; one is in a folder that only new results have."""
    under_way.text("figures.txt", age)
    if age == "new":
        (under_way.path / "cases").mkdir()
        under_way.text("cases/000.txt", age)
    under_way.summary({"age": age})


def made(builder, place: Path, age: str, overwrite: bool = False, meanwhile=lambda: None) -> None:
    with builder(place, overwrite) as under_way:
        fill(under_way, age)
        meanwhile()


def age_of(place: Path) -> str | None:
    """The age of finished results, which must be whole and of one age; None where there are none."""
    if not finished(place):
        return None
    summary = json.loads((place / SUMMARY).read_text())
    for name in set(summary["files"]) - {SUMMARY}:
        assert (place / name).read_text() == summary["age"], name
    return summary["age"]


def names(place: Path) -> list[str]:
    return sorted(file.relative_to(place).as_posix() for file in place.rglob("*") if not file.is_dir())


NEW = ["cases/000.txt", "figures.txt", "summary.json"]
OLD = ["figures.txt", "summary.json"]


@pytest.mark.parametrize("builder", BUILDERS.values(), ids=BUILDERS)
def test_results_are_published_atomically(builder, tmp_path) -> None:
    place = tmp_path / "deep" / "results"
    with builder(place) as under_way:
        fill(under_way, "old")
        assert not finished(place)
    assert (age_of(place), names(tmp_path / "deep" / "results")) == ("old", OLD)
    made(builder, place, "new", overwrite=True)
    assert (age_of(place), names(tmp_path), os.listdir(tmp_path / "deep")) == (
        "new",
        [f"deep/results/{name}" for name in NEW],
        ["results"],
    )
    made(builder, place, "old", overwrite=True)
    assert sorted(os.listdir(place)) == OLD  # no empty folder either


@pytest.mark.parametrize("builder", BUILDERS.values(), ids=BUILDERS)
def test_failed_command_keeps_earlier_results(builder, tmp_path) -> None:
    place = tmp_path / "deep" / "results"

    def stopped(overwrite: bool) -> None:
        with builder(place, overwrite) as under_way:
            fill(under_way, "new")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stopped(False)
    assert os.listdir(tmp_path) == []
    made(builder, place, "old")
    with pytest.raises(KeyboardInterrupt):
        stopped(True)
    assert (age_of(place), names(place)) == ("old", OLD)


def test_second_writer_is_refused(tmp_path) -> None:
    place = tmp_path / "results"
    for overwrite in (False, True):
        with BUILDERS["run"](place, overwrite) as under_way:
            for builder in BUILDERS.values():
                with pytest.raises(FolderError, match="is under way in it; wait for its end"):
                    made(builder, place, "old", overwrite=True)
            fill(under_way, "new")
        assert (age_of(place), names(place)) == ("new", NEW)


@pytest.mark.parametrize("builder", BUILDERS.values(), ids=BUILDERS)
def test_foreign_files_added_meanwhile_are_kept(builder, tmp_path) -> None:
    place, other = tmp_path / "results", tmp_path / "other"
    made(builder, place, "new", meanwhile=lambda: (place / "notes.txt").write_text("mine"))
    assert (age_of(place), names(place)) == ("new", sorted([*NEW, "notes.txt"]))
    with pytest.raises(FolderError, match=r"other: figures\.txt appeared during the run; move it away"):
        made(builder, other, "new", meanwhile=lambda: (other / "figures.txt").write_text("mine"))
    assert ((other / "figures.txt").read_text(), names(other)) == ("mine", ["figures.txt"])


STRANGERS = {
    "a file": lambda place: (place / "notes.txt").write_text("mine"),
    "a file deep down": lambda place: ((place / "a" / "b").mkdir(parents=True), (place / "a/b/c").touch()),
    "an empty folder": lambda place: (place / "plots").mkdir(),
    "a hidden file": lambda place: (place / ".git").mkdir(),
    "a link": lambda place: (place / "link").symlink_to(place.parent),
    "a dead link": lambda place: (place / "link").symlink_to("nowhere"),
}


@pytest.mark.parametrize("builder", BUILDERS.values(), ids=BUILDERS)
@pytest.mark.parametrize("add", STRANGERS.values(), ids=STRANGERS)
def test_overwrite_keeps_foreign_files(builder, add, tmp_path) -> None:
    place = tmp_path / "results"
    made(builder, place, "old")
    add(place)
    strange = sorted(set(os.listdir(place)) - set(OLD))[0]
    with pytest.raises(FolderError, match=f"holds files that are not results: {strange}") as refused:
        made(builder, place, "new", overwrite=True)
    assert str(refused.value).startswith(f"{place}: ")
    assert age_of(place) == "old"
    assert strange in os.listdir(place)


@pytest.mark.parametrize("builder", BUILDERS.values(), ids=BUILDERS)
def test_folder_replaced_by_a_link_is_not_followed(builder, tmp_path) -> None:
    place, elsewhere = tmp_path / "results", tmp_path / "elsewhere"
    made(builder, place, "new")
    (place / "cases").rename(elsewhere)
    (place / "cases").symlink_to(elsewhere)
    with pytest.raises(FolderError, match="not results: cases"):
        made(builder, place, "old", overwrite=True)
    assert names(elsewhere) == ["000.txt"]


def summary_with(**changes: object) -> str:
    """Our own summary, but for some keys."""
    versions = dict.fromkeys(
        ("python", "closeform", "numpy", "numba", "scipy", "pydantic", "matplotlib", "pyarrow"), "1.0"
    )
    return json.dumps({"closeform": 1, "versions": versions, "files": ["a.txt", SUMMARY]} | changes)


FOREIGN = {
    "the word alone": '{"closeform": "a tool that I like"}',
    "no versions": '{"closeform": 1, "files": ["a.txt", "summary.json"]}',
    "a list": '["closeform"]',
    "another format": summary_with(closeform=2),
    "other versions": summary_with(versions={"python": "3.11"}),
    "no files": summary_with(files=None),
    "files outside": summary_with(files=["../a.txt", SUMMARY]),
    "an absolute file": summary_with(files=["/etc/passwd", SUMMARY]),
    "no JSON": "{",
    "a deep list": "[" * 100_000,
    "no text": "\udcff",
}


@pytest.mark.parametrize("builder", BUILDERS.values(), ids=BUILDERS)
@pytest.mark.parametrize("text", FOREIGN.values(), ids=FOREIGN)
def test_only_summaries_of_this_package_are_recognised(builder, text, tmp_path) -> None:
    place = tmp_path / "results"
    place.mkdir()
    (place / "a.txt").write_text("mine")
    (place / SUMMARY).write_bytes(summary_with().encode())
    assert finished(place)  # with the right one
    (place / SUMMARY).write_bytes(text.encode(errors="surrogateescape"))
    with pytest.raises(FolderError, match="is not a result folder and not empty; choose another --out"):
        made(builder, place, "new", overwrite=True)
    assert (place / "a.txt").read_text() == "mine"


# A process that ends, or whose disk fills, at step K on the disk; a fork for each K, until there is none.
AT_EVERY_STEP = """
import os, signal, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from test_result_folder import BUILDERS, fill, made
from closeform.storage.result_folder import FolderError
builder, fault, before = BUILDERS[sys.argv[2]], sys.argv[3], sys.argv[4] == "over"
NEEDS_SPACE = ("os.mkdir", "os.rename")
STEPS = (*NEEDS_SPACE, "os.remove", "os.rmdir", "os.listdir", "open", "shutil.rmtree")
def attack(place, last):
    left = [last]
    def hook(event, arguments):
        if event in STEPS:
            left[0] -= 1
            if left[0] == -1:
                if fault == "kill":
                    os.kill(os.getpid(), signal.SIGKILL)
                if fault == "ctrl-c":
                    raise KeyboardInterrupt
                if event in NEEDS_SPACE or event == "open" and arguments[2] & os.O_CREAT:
                    raise OSError(28, "No space left on device")
    with builder(place, before) as under_way:
        sys.addaudithook(hook)
        fill(under_way, "new")
    os._exit(0 if left[0] >= 0 else 3)
for k in range(1000):
    place = Path(f"{k:03d}") / "results"
    place.parent.mkdir()
    if before:
        made(builder, place, "old")
    child = os.fork()
    if not child:
        try:
            attack(place, k)
        except (KeyboardInterrupt, FolderError):
            os._exit(4)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    print(k, status)
    if status == 0:
        break
"""


@pytest.mark.parametrize("before", ["fresh", "over"])
@pytest.mark.parametrize("fault", ["kill", "ctrl-c", "full"])
@pytest.mark.parametrize("kind", BUILDERS)
def test_interruption_at_every_step(kind, fault, before, tmp_path) -> None:
    """Results are those before, the new ones or none; never half of them, and the next run needs no help."""
    step = [AT_EVERY_STEP, str(Path(__file__).parent), kind, fault, before]
    done = subprocess.run(
        [sys.executable, "-B", "-c", *step],  # no half of a compiled module is left either
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    ends = [int(line.split()[1]) for line in done.stdout.splitlines()]
    assert len(ends) > 15  # steps
    assert {"kill": -9, "ctrl-c": 4, "full": 4}[fault] in ends
    seen = set()
    for k, end in enumerate(ends):
        around = tmp_path / f"{k:03d}"
        place = around / "results"
        if fault == "kill":
            settle(place)  # as every command that opens the place
        else:
            assert not [name for name in names(around) if PRIVATE in name], (k, end)
        seen.add(age_of(place))
        if not finished(place):
            assert before == "fresh", k  # results are never lost, also not to a kill
            assert fault == "kill" or names(around) == [], k
            with pytest.raises(FolderError, match=r"holds no finished results|no such folder"):
                page_of(place)
        made(BUILDERS[kind], place, "new", overwrite=finished(place))  # no other remedy is needed
        assert (age_of(place), names(place), os.listdir(around)) == ("new", NEW, ["results"]), k
    assert "new" in seen
    assert seen <= {"old", "new", None}


@pytest.mark.parametrize("builder", BUILDERS.values(), ids=BUILDERS)
def test_results_folders_of_every_kind(builder, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to("real")
    (tmp_path / "hanging").symlink_to("target")
    kinds = ["plain", "with spaces and $ é 編隊", "./b", "link", "hanging", "x" * 255, str(tmp_path / "all")]
    for kind in kinds:
        made(builder, Path(kind), "old")
        made(builder, Path(kind), "new", overwrite=True)
        assert age_of(Path(kind)) == "new"
    assert (tmp_path / "link").is_symlink()
    assert age_of(tmp_path / "real") == age_of(tmp_path / "target") == "new"
    for kind in ("x" * 256, "a/" + "y" * 300):
        with pytest.raises(FolderError, match="file name too long; choose another --out"):
            made(builder, Path(kind), "new")
    (tmp_path / "loop").symlink_to("loop")
    with pytest.raises(FolderError, match="too many levels of symbolic links; choose another --out"):
        made(builder, Path("loop"), "new")


@pytest.mark.parametrize("builder", BUILDERS.values(), ids=BUILDERS)
def test_another_file_system(builder, tmp_path) -> None:
    other = Path("/dev/shm")
    if not other.is_dir() or other.stat().st_dev == tmp_path.stat().st_dev:
        pytest.skip("needs a second file system")
    with TemporaryDirectory(dir=other) as there:
        (tmp_path / "results").symlink_to(Path(there) / "results")
        made(builder, tmp_path / "results", "old")
        made(builder, tmp_path / "results", "new", overwrite=True)
        assert (age_of(Path(there) / "results"), os.listdir(there)) == ("new", ["results"])


def command(*arguments: str, **options) -> subprocess.Popen:
    return subprocess.Popen(
        [sys.executable, "-m", "closeform", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **options,
    )


def test_two_commands_at_once(tmp_path) -> None:
    """Two scenarios write to one folder five times: the results are those of one of them."""
    for name in ("one", "two"):
        (tmp_path / f"{name}.toml").write_text(GOOD.replace("Three craft", f"Scenario {name}"))
    for attempt in range(3):
        place = tmp_path / f"results {attempt}"
        both = [command("run", f"{name}.toml", "--out", str(place), cwd=tmp_path) for name in ("one", "two")]
        told = [process.communicate() for process in both]
        ends = [process.returncode for process in both]
        assert sorted(ends) == [0, 2], told
        winner = ("one", "two")[ends.index(0)]
        assert told[1 - ends.index(0)][1].startswith(f"{place}: ")
        summary = json.loads((place / SUMMARY).read_text())
        assert summary["title"] == f"Scenario {winner}"
        assert f"Scenario {winner}" in (place / "scenario.toml").read_text()
        assert f"Scenario {winner}" in (place / "report.html").read_text()
        assert sorted(summary["files"]) == names(place)
    assert [name for name in os.listdir(tmp_path) if name.startswith(".")] == []


def test_full_disk(tmp_path) -> None:
    """No file may be longer than 8 kB: tables and pictures are."""
    (tmp_path / "good.toml").write_text(GOOD)
    (tmp_path / "lost.toml").write_text(LOST)
    limits = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (8_000, 8_000))  # noqa: E731
    for verb, file in (("run", "good.toml"), ("study", "lost.toml")):
        process = command(verb, file, "--out", "results", cwd=tmp_path, preexec_fn=limits)
        out, err = process.communicate()
        assert (process.returncode, out) == (2, ""), err
        assert err.splitlines()[-1] == "results: file too large; choose another --out"
        assert sorted(os.listdir(tmp_path)) == ["good.toml", "lost.toml"]
