"""Code blocks of the docs and README run as printed."""

import re
import shlex
from pathlib import Path
from typing import Any

import matplotlib
import pytest

import closeform.report.sections.searches
from closeform.cli.app import main
from closeform.flight.library import compiler

pytestmark = pytest.mark.usefixtures("unpainted")

ROOT = Path(__file__).parents[1]
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").glob("*.md"), *(ROOT / "docs/notebooks").glob("*.md")])
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def blocks(page: Path, language: str) -> list[tuple[int, str]]:
    """Return the blocks of one language with the number of their first line."""
    text = page.read_text(encoding="utf-8")
    found = [match for match in BLOCK.finditer(text) if match[1] == language]
    return [(text.count("\n", 0, match.start(2)), match[2]) for match in found]


def named(pages: list[Path]) -> dict[str, Path]:
    return {page.relative_to(ROOT).as_posix(): page for page in pages}


def with_the_site(pages: dict[str, Path]) -> list[Any]:
    """Run README with all tests, and the pages with `-m site`."""
    return [name if name == "README.md" else pytest.param(name, marks=pytest.mark.site) for name in pages]


SCRIPTS = named([page for page in PAGES if blocks(page, "python")])
SESSIONS = named([page for page in PAGES if blocks(page, "console")])


@pytest.fixture(autouse=True)
def clone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Working directory with the examples."""
    (tmp_path / "examples").symlink_to(ROOT / "examples", target_is_directory=True)
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("name", with_the_site(SCRIPTS))
def test_python_blocks_run(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Blocks run as one script; `# -> text` after a print is its output."""
    if name == "docs/on_board.md" and compiler() is None:
        pytest.skip("no C compiler")
    script = ""
    for line, block in blocks(SCRIPTS[name], "python"):
        script += "\n" * (line - script.count("\n")) + block  # errors point at the line of the page
    with matplotlib.rc_context():
        exec(compile(script, str(SCRIPTS[name]), "exec"), {"__name__": "__main__"})
    printed = iter(capsys.readouterr().out.splitlines())
    for promised in re.findall(r"# -> (.*)$", script, re.MULTILINE):
        assert promised in printed, f"not printed, or not in this order: {promised}"


@pytest.mark.parametrize("name", with_the_site(SESSIONS))
def test_console_blocks_show_what_is_printed(
    name: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A line of `...` stands for omitted lines."""
    monkeypatch.setattr(closeform.report.sections.searches, "FILMED", 0)  # animations have tests of their own
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


def links() -> list[tuple[str, str]]:
    found = []
    for name, page in named(PAGES).items():
        text = BLOCK.sub("", page.read_text(encoding="utf-8"))
        found += [(name, target) for target in re.findall(r"\]\(([^)\s]+)\)", text)]
    return [(name, target) for name, target in found if "://" not in target]


def test_links_are_valid() -> None:
    dead = []
    for name, target in links():
        file, _, heading = target.partition("#")
        page = (ROOT / name).parent / file if file else ROOT / name
        if not page.exists():
            dead.append((name, target))
        elif heading:
            headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
            if heading not in [re.sub(r"[^\w\- ]", "", text).lower().replace(" ", "-") for text in headings]:
                dead.append((name, target))
    assert dead == []


def test_cited_equations_exist() -> None:
    """`# theory (13), (14)` in the source exist once."""
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
