"""Every page of the docs, and README, runs as it stands."""

import ast
import re
import runpy
import shlex
import subprocess
import sys
from operator import attrgetter
from pathlib import Path

import matplotlib
import pytest

import closeform as cf
import closeform.report.gather
from closeform.campaign import case_of
from closeform.cli import main
from closeform.mission import fly
from closeform.mission_result import FirstLocks
from closeform.scenario import parse
from closeform.scenario.stages import STAGES

pytestmark = pytest.mark.usefixtures("unpainted")

ROOT = Path(__file__).parents[1]
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").glob("*.md")])
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def blocks(page: Path, language: str) -> list[tuple[int, str]]:
    """The blocks of one language, each with the number of its first line."""
    text = page.read_text(encoding="utf-8")
    found = [match for match in BLOCK.finditer(text) if match[1] == language]
    return [(text.count("\n", 0, match.start(2)), match[2]) for match in found]


def named(pages: list[Path]) -> dict[str, Path]:
    return {page.relative_to(ROOT).as_posix(): page for page in pages}


SCRIPTS = named([page for page in PAGES if blocks(page, "python")])
# errors.md is run row by row in test_errors.py
SESSIONS = named([page for page in PAGES if blocks(page, "console") and page.name != "errors.md"])


@pytest.fixture(autouse=True)
def clone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A working directory that holds the examples, as a clone does, and takes what is written."""
    (tmp_path / "examples").symlink_to(ROOT / "examples", target_is_directory=True)
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("name", SCRIPTS)
def test_python_blocks_run(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """From top to bottom as one script; `# -> text` after a print says what it prints."""
    script = ""
    for line, block in blocks(SCRIPTS[name], "python"):
        script += "\n" * (line - script.count("\n")) + block  # errors point at the line of the page
    with matplotlib.rc_context():
        exec(compile(script, str(SCRIPTS[name]), "exec"), {"__name__": "__main__"})
    printed = iter(capsys.readouterr().out.splitlines())
    for promised in re.findall(r"# -> (.*)$", script, re.MULTILINE):
        assert promised in printed, f"not printed, or not in this order: {promised}"


@pytest.mark.parametrize("name", SESSIONS)
def test_console_blocks_show_what_is_printed(
    name: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """`$ closeform ...` and what follows; a line of `...` stands for lines left out."""
    monkeypatch.setattr(
        closeform.report.gather, "FILMED", 0
    )  # animations, seconds each, have tests of their own
    for _, block in blocks(SESSIONS[name], "console"):
        command, *lines = block.splitlines()
        program, *arguments = shlex.split(command.removeprefix("$ "))
        assert program == "closeform"
        main(arguments)
        printed = capsys.readouterr()
        heard = [line.rstrip() for line in (printed.out + printed.err).splitlines()]
        place = 0
        for line in lines:
            if line != "...":
                assert line in heard[place:], f"{command} does not print: {line}"
                place = heard.index(line, place) + 1


def test_readme_has_the_figures_of_the_benchmarks() -> None:
    tool = runpy.run_path(str(ROOT / "tools" / "readme_figures.py"))
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert tool["figures"]().count("\n| ") > 5
    assert readme == tool["renewed"](readme), "run tools/readme_figures.py"


def test_the_page_of_benchmarks_is_of_what_was_measured() -> None:
    """Of each section in `benchmarks/measured`, and no word is written by hand."""
    code = "import run, sys; sys.stdout.buffer.write(run.page().encode())"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT / "benchmarks", capture_output=True)
    assert done.stdout.decode() == (ROOT / "docs" / "benchmarks.md").read_text(encoding="utf-8")


def links() -> list[tuple[str, str]]:
    found = []
    for name, page in named(PAGES).items():
        text = BLOCK.sub("", page.read_text(encoding="utf-8"))
        found += [(name, target) for target in re.findall(r"\]\(([^)\s]+)\)", text)]
    return [(name, target) for name, target in found if "://" not in target]


@pytest.mark.parametrize(("name", "target"), links())
def test_link_leads_somewhere(name: str, target: str) -> None:
    file, _, heading = target.partition("#")
    page = (ROOT / name).parent / file if file else ROOT / name
    assert page.exists()
    if heading:
        headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
        assert heading in [re.sub(r"[^\w\- ]", "", text).lower().replace(" ", "-") for text in headings]


def test_the_table_of_tasks_names_every_stage_and_nothing_that_is_not_there() -> None:
    """docs/choose.md: all verbs, and `cf.NAME` and `orbit.NAME` that exist."""
    page = (ROOT / "docs" / "choose.md").read_text(encoding="utf-8")
    assert {verb for verb in STAGES if f"`{verb}" not in page} == set()
    for name in re.findall(r"\bcf\.([\w.]+)", page):
        assert attrgetter(name)(cf) is not None
    for name in re.findall(r"\borbit\.(\w+)", page):
        assert hasattr(cf.Orbit, name)


def test_equations_that_the_code_cites_are_there() -> None:
    """`# theory (13), (14)` in the source; none is defined twice."""
    theory = (ROOT / "docs" / "theory.md").read_text(encoding="utf-8")
    tags = re.findall(r"\\tag\{(\w+)\}", theory)
    assert len(tags) == len(set(tags))
    cited = set()
    for file in (ROOT / "src").rglob("*.py"):
        text = file.read_text(encoding="utf-8")
        for numbers in re.findall(r"theory(?:\.md)? ((?:\(\w+\)(?:, | and )?)+)", text):
            cited |= set(re.findall(r"\((\w+)\)", numbers))
    assert len(cited) > 40
    assert cited - set(tags) == set()


def test_tools_have_the_options_that_pages_give_them() -> None:
    """`python tools/certify.py --pairs 100000 --grazing 10000`; and each of them is there."""
    given = set()
    for page in (*PAGES, ROOT / "CONTRIBUTING.md"):
        for tool, words in re.findall(r"(tools/\w+\.py)([^`#&\n]*)", page.read_text(encoding="utf-8")):
            given |= {(tool, option) for option in ("", *re.findall(r"--[\w-]+", words))}
    assert len(given) > 30
    for tool, option in given:
        text = (ROOT / tool).read_text(encoding="utf-8")
        assert not option or f'"{option}"' in text, (tool, option)  # as an argument, not in words


def test_the_case_that_needs_the_second_mops_is_that_of_the_page() -> None:
    """docs/robustness.md: a case of the example, beyond as many as its own study flies."""
    page = (ROOT / "docs" / "robustness.md").read_text(encoding="utf-8")
    ((file, case),) = re.findall(r"^closeform run (\S+) --case (\d{6,})", page, re.MULTILINE)
    found = fly(case_of(parse((ROOT / file).read_text(encoding="utf-8")), int(case))).results[0].result
    assert isinstance(found, FirstLocks)
    assert found.search.legs[int(found.locks.leg[0])].phase == "mOPS"
    assert found.search.legs[int(found.locks.leg[0])].round == 2


def test_gallery_has_every_example() -> None:
    tool = runpy.run_path(str(ROOT / "tools" / "gallery.py"))
    text = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    assert text == tool["page"](), "run tools/gallery.py"
    shown = {name for names in tool["EXAMPLES"].values() for name in names}
    assert shown == {file.stem for file in (ROOT / "examples").glob("*.toml")}
    assert all((ROOT / "docs" / "images" / "gallery" / f"{name}.png").exists() for name in shown)


def test_every_page_is_in_a_table_of_contents() -> None:
    """conf.py, which gives the site its tables of contents, names each page of the docs once."""
    conf = ast.parse((ROOT / "docs" / "conf.py").read_text(encoding="utf-8"))
    (contents,) = (
        ast.literal_eval(one.value)
        for one in conf.body
        if isinstance(one, ast.Assign) and ast.unparse(one.targets[0]) == "CONTENTS"
    )
    named = [page for below in contents.values() for page in below.split()]
    assert sorted([*named, "index"]) == sorted(page.stem for page in (ROOT / "docs").glob("*.md"))
