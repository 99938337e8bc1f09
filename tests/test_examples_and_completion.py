"""Included examples, `closeform new`, shell completion and the citation file."""

import os
import re
import subprocess
import tomllib
from pathlib import Path

import pytest

import closeform as cf
from closeform.cli.app import installed, main

ROOT = Path(__file__).parents[1]
EXAMPLES = sorted(file.stem for file in (ROOT / "examples").glob("*.toml"))


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_all_examples_are_listed_with_their_titles(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["new"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == EXAMPLES
    for line in lines:
        name, title = line.split(maxsplit=1)
        assert title == tomllib.loads((ROOT / "examples" / f"{name}.toml").read_text())["title"]
    assert os.listdir() == []


def test_example_does_not_replace_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["new", "swap"]) == 0
    assert (tmp_path / "swap.toml").read_bytes() == (ROOT / "examples" / "swap.toml").read_bytes()
    assert capsys.readouterr().out.splitlines()[-1] == "Run it with: closeform run swap.toml"
    (tmp_path / "swap.toml").write_text("mine")
    assert main(["new", "swap"]) == 2
    assert capsys.readouterr().err == "swap.toml: already exists and is not overwritten; move or rename it\n"
    assert (tmp_path / "swap.toml").read_text() == "mine"


@pytest.mark.parametrize("name", EXAMPLES)
def test_written_example_runs_in_its_folder(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The printed command runs in a folder with nothing else."""
    assert main(["new", name]) == 0
    told = capsys.readouterr().out.splitlines()[-1].split()
    assert told[3:] == [
        "closeform",
        "study" if "[study]" in Path(f"{name}.toml").read_text() else "run",
        f"{name}.toml",
    ]
    assert main(["check", f"{name}.toml"]) == 0


def test_unknown_example_names_a_similar_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["new", "swp"]) == 2
    assert main(["new", "../swap"]) == 2
    first, second = capsys.readouterr().err.splitlines()
    assert first == "new: there is no example 'swp'; did you mean swap?"
    assert second.startswith("new: there is no example '../swap'")
    assert os.listdir() == []


def test_unwritable_folder_is_reported(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(*given: object, **more: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("builtins.open", full)
    assert main(["new", "swap"]) == 2
    assert capsys.readouterr().err == "swap.toml: no space left on device; choose another folder\n"


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_shells_complete_every_command(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", shell]) == 0
    script = capsys.readouterr().out
    for command in (
        "run",
        "check",
        "screen",
        "encounter",
        "study",
        "view",
        "new",
        "completion",
        "overwrite",
    ):
        assert command in script


def test_bash_completes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As bash asks for it: after `closeform sc`."""
    main(["completion", "bash"])
    script = (
        capsys.readouterr().out
        + "\nCOMP_WORDS=(closeform sc)\nCOMP_CWORD=1\n_closeform\necho ${COMPREPLY[@]}\n"
    )
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["screen"]


def test_printed_version_is_that_of_the_package(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.split() == [installed()]
    with open(ROOT / "pyproject.toml", "rb") as file:
        assert tomllib.load(file)["project"]["version"] in installed()


def test_citation_file_has_this_version_and_the_papers() -> None:
    cited = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    with open(ROOT / "pyproject.toml", "rb") as file:
        assert f"\nversion: {tomllib.load(file)['project']['version']}\n" in cited
    docs = " ".join(
        " ".join(page.read_text(encoding="utf-8").split()) for page in (ROOT / "docs").glob("*.md")
    )
    titles = re.findall(r"^    title: (.*)$", cited, re.MULTILINE)
    assert len(titles) == 3
    for title in titles:
        assert title in docs


def test_package_includes_its_types() -> None:
    assert (Path(cf.__file__).parent / "py.typed").exists()
