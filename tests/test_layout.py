"""The map in CONTRIBUTING.md is true: one line for every module, in the form "to change X: file"."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "closeform"
LINE = re.compile(r"^- (.+): `([\w/]+\.py)`$", re.MULTILINE)


def modules() -> list[str]:
    """All that have code; the heads of packages that only say what is in them have none."""
    found = []
    for file in PACKAGE.rglob("*.py"):
        body = ast.parse(file.read_text(encoding="utf-8")).body
        if [part for part in body if not isinstance(part, ast.Expr)]:
            found.append(file.relative_to(PACKAGE).as_posix())
    return sorted(found)


def mapped() -> list[tuple[str, str]]:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    chapter = text.split("## Where things are")[1].split("\n## ")[0]
    assert chapter.count("\n- ") == len(LINE.findall(chapter)), "a line is not of the form - what: `file`"
    return LINE.findall(chapter)


def test_every_module_has_one_line_in_the_map() -> None:
    files = [file for _, file in mapped()]
    assert sorted(files) == modules()


def test_no_two_lines_of_the_map_say_the_same() -> None:
    said = [what for what, _ in mapped()]
    assert len(said) == len(set(said))


def test_every_module_can_be_read_in_one_sitting() -> None:
    """Style 1 of CONTRIBUTING: a module that outgrows it is two nouns."""
    lengths = {file: (PACKAGE / file).read_text(encoding="utf-8").count("\n") for file in modules()}
    assert {file: lines for file, lines in lengths.items() if lines >= 350} == {}


def test_no_kernel_assigns_an_array_to_a_slice() -> None:
    """numba would compile the words of its error message, with all that strings need: a second and more."""
    found = []
    for file in PACKAGE.rglob("*.py"):
        for part in ast.parse(file.read_text(encoding="utf-8")).body:
            if isinstance(part, ast.FunctionDef) and any(
                "kernel(" in ast.unparse(d) for d in part.decorator_list
            ):
                found += [f"{file.name}: {ast.unparse(line)}" for line in ast.walk(part) if fills_slice(line)]
    assert not found, "closeform.motion.linear.copy does it"


def fills_slice(line: ast.AST) -> bool:
    """Whether a line assigns to a slice anything but a number that is written there."""
    if not isinstance(line, ast.Assign) or isinstance(line.value, ast.Constant):
        return False
    return any(isinstance(part, ast.Slice) for target in line.targets for part in ast.walk(target))
