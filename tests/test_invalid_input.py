"""Invalid input: one line that names key and remedy, status 2, and no results."""

import re
import shlex
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

import closeform as cf
from closeform.cli.app import main
from closeform.scenario import Scenario, ScenarioError, parse
from closeform.scenario.load import File
from closeform.scenario.table import Table, complaints, tables_in
from damage import assert_refused
from orbit_files import contents, oem
from scenarios import GOOD, LOST

ROOT = Path(__file__).parents[1]


# mistake: valid text, replacement, key, a word of the remedy
MISTAKES = {
    "no TOML": ('title = "Three craft"', "title = Three craft", "title", "line 2"),
    "a key that occurs twice": ('mass = "150 kg"', 'mass = "150 kg"\nmass = "1 kg"', "mass", "keep one"),
    "no format": ("closeform = 1", "", "closeform", "closeform = 1"),
    "an unknown table": ("[craft]", "[camera]\n[craft]", "camera", "use one of"),
    "an unknown key": ("keep_out =", "keepout =", "keepout", "keep_out"),
    "a missing key": ('for = "5 min"', "", "stage[1].for", "for ="),
    "no unit": ('"500 km"', "500", "orbit.altitude", "km"),
    "an unknown unit": ('"500 km"', '"500 miles"', "orbit.altitude", "km"),
    "a wrong unit": ('"150 kg"', '"150 m"', "craft.mass", "kg"),
    "a short vector": ('"0 100 0 m"', '"0 100 m"', "craft.position[2]", "3 numbers"),
    "not a number": ('"0 100 0 m"', '"0 nan 0 m"', "craft.position[2]", "finite"),
    "a negative size": ('"20 m"', '"-20 m"', "sphere", "above zero"),
    "an unknown verb": ('"avoid"', '"aviod"', "stage[2].do", "avoid"),
    "a craft that does not exist": ('craft = "F3"', 'craft = "F33"', "stage[2].craft", "F3"),
    "a name given twice": ('"F1", "F2", "F3"', '"F1", "F3", "F3"', "craft.name", "F3"),
    "a list of the wrong length": (', "0 200 0 m"]', "]", "craft.position", "3 craft"),
    "a zone of two shapes": ('sphere = "20 m"', 'sphere = "20 m", box = "1 1 1 m"', "keep_out", "box"),
    "a start inside a zone": ('"0 100 0 m"', '"0 15 0 m"', "craft.position", "F1 and F2"),
    "thrust without a mass": ('mass = "150 kg"', "", "craft", "mass"),
    "two orbits": ('altitude = "500 km"', 'altitude = "500 km"\nperiod = "90 min"', "orbit", "period"),
}
# arguments, a word of the mistake, a word of the remedy
MISUSES = {
    "an unknown command": ("hover good.toml", "hover", "run"),
    "an unknown option": ("run good.toml --speed 3", "--speed", "--help"),
    "a file that does not exist": ("run nowhere.toml", "nowhere.toml", "path"),
    "a case without a study": ("run good.toml --case 3", "--case", "study"),
    "a folder of something else": ("run good.toml --out folder", "folder", "another --out"),
    "a zone in a wrong unit": ('screen a.oem b.oem --sphere "20 s"', "--sphere", "km"),
}


def one_line(printed: str, *words: str) -> None:
    (line,) = printed.splitlines()
    for word in words:
        assert word in line, line


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Working folder with valid files and a folder of the user."""
    (tmp_path / "good.toml").write_text(GOOD)
    (tmp_path / "a.oem").write_text(oem("A", 0.0))
    (tmp_path / "b.oem").write_text(oem("B", 1e-4))
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "thesis.txt").write_text("years of work")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes_in_files(mistake: str, desk: Path, capsys: pytest.CaptureFixture[str]) -> None:
    old, new, key, remedy = MISTAKES[mistake]
    assert GOOD.count(old) == 1
    (desk / "cluster.toml").write_text(GOOD.replace(old, new))
    before = contents(desk)
    assert main(["run", "cluster.toml"]) == 2
    printed = capsys.readouterr()
    one_line(printed.err, "cluster.toml: ", key, remedy)
    assert printed.out == ""
    assert contents(desk) == before


@pytest.mark.parametrize("misuse", MISUSES)
def test_mistakes_on_the_command_line(misuse: str, desk: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments, named, remedy = MISUSES[misuse]
    before = contents(desk)
    assert main(shlex.split(arguments)) == 2
    printed = capsys.readouterr()
    one_line(printed.err, named, remedy)
    assert printed.out == ""
    assert contents(desk) == before


def test_mistakes_in_calls_name_the_argument() -> None:
    orbit = cf.Orbit.circular(500e3)
    path = orbit.transfer([0, 200, 0, 0, 0, 0], [0, -200, 0, 0, 0, 0], 900.0)
    with pytest.raises(ValueError, match=r"radius.*positive"):
        cf.Sphere(-20.0)
    with pytest.raises(ValueError, match="duration"):
        orbit.coast(np.zeros(6), np.nan)
    with pytest.raises(ValueError, match=r"state.*\(\.\.\., 6\)"):
        orbit.coast([0.0, 200.0, 0.0], 900.0)
    with pytest.raises(ValueError, match="thrusters"):
        cf.avoid(path, path, cf.Sphere(20.0), thrusters=cf.Thrusters.rtn())


@pytest.mark.parametrize("read", [cf.read_oem, cf.read_cdm, cf.read_csv])
def test_absent_and_binary_files_are_refused_in_one_line(
    read: Callable[[Path], object], tmp_path: Path
) -> None:
    file = tmp_path / "picture"
    assert_refused(read, file, "cannot be read: No such file")
    assert_refused(read, tmp_path, "cannot be read")
    file.write_bytes(b"\x89PNG\r\n\xff\xfe")
    assert_refused(read, file, "not a text file; give ")


def test_check_reports_every_error_at_once(desk: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = (
        GOOD.replace('"500 km"', '"500 kg"').replace('"20 m"', '"-20 m"').replace('craft = "F3"', "craft = 3")
    )
    (desk / "cluster.toml").write_text(text)
    assert main(["check", "cluster.toml"]) == 2
    keys = [line.split(": ")[1] for line in capsys.readouterr().err.splitlines()]
    assert keys == ["orbit.altitude", "craft.keep_out.sphere", "stage[2].craft"]


def tables(table: type[Table]) -> Iterator[type[Table]]:
    """Yield a table and all tables inside it."""
    yield table
    for field in table.model_fields.values():
        for inner in tables_in(field.annotation):
            yield from tables(inner)


def test_every_key_refuses_a_wrong_value_with_a_remedy() -> None:
    for table in set(tables(File)):
        for key in table.examples():
            with pytest.raises(ValidationError) as refused:
                table.model_validate({key: object()})
            said = [text for place, text in complaints(refused.value, table) if place[0] == key]
            assert said, (table, key)
            assert all("; " in text and "\n" not in text for text in said), (table, key)


def test_valid_file_is_accepted() -> None:
    for text in (GOOD, LOST):
        scenario = parse(text)
        assert isinstance(scenario, Scenario)
        assert [scenario.refused(command) for command in ("run", "run --case", "study")] == [(), (), ()]


def read(text: str) -> None:
    """Read a text: it gives a scenario or one line per error."""
    try:
        parse(text, "file.toml")
    except ScenarioError as error:
        lines = error.lines
    else:
        return
    assert lines
    assert all(line.startswith("file.toml: ") and line.isprintable() for line in lines)


@given(st.text(max_size=200))
def test_any_text(text: str) -> None:
    read(text)


SAMPLES = [GOOD, LOST, *(file.read_text() for file in sorted((ROOT / "examples").glob("*.toml")))]
KEY = re.compile(r'^"?([\w.]+)"? = ')
VALUES = st.one_of(
    st.sampled_from(
        [
            *(
                '""',
                '"1 m"',
                '"-1 s"',
                '"nan m"',
                '"1e999 m"',
                '"1 m/s"',
                '"0 orbits"',
                '"1 2 3 m"',
                "[]",
                "{}",
            ),
            *(
                "[[]]",
                "[{}]",
                "nan",
                "inf",
                "-1",
                "0",
                "1e400",
                "true",
                "false",
                "1979-05-27",
                '"\\n"',
                '"\\u0000"',
            ),
            *(
                "9" * 400,
                '["F1"]',
                '"F1"',
                "[1, 2, 3]",
                '{ sphere = "1 mm" }',
                '{ palmer = "1 2 3 4 5 6 km" }',
            ),
        ]
    ),
    st.floats().map(lambda x: f'"{x!r} m"'),
    st.floats().map(repr),
    st.integers().map(str),
    st.text(
        st.characters(codec="ascii", exclude_characters='"\\', exclude_categories=["Cc"]), max_size=20
    ).map(lambda text: f'"{text}"'),
)
KEYS = sorted({found[1] for text in SAMPLES for line in text.splitlines() if (found := KEY.match(line))})
KEYS += ["axes", "meanwhile", "mu", "order", "period", "pointing_error", "shade", "tip_angle", "x"]
KEYS += ["craft", "direction", "distance", "from", "join", "remove", "ring", "slots", "to"]


@given(st.sampled_from(SAMPLES), st.integers(0), st.sampled_from(KEYS), VALUES, st.booleans())
def test_any_value_of_any_key(text: str, number: int, key: str, value: str, replace: bool) -> None:
    lines = text.splitlines()
    number %= len(lines)
    if replace and KEY.match(lines[number]):
        lines[number] = f"{lines[number].split(' = ')[0]} = {value}"
    else:
        lines.insert(number, f"{key} = {value}")
    read("\n".join(lines))


@given(st.sampled_from(SAMPLES), st.integers(0), st.integers(0, 40), st.text(max_size=8))
def test_damaged_file(text: str, place: int, length: int, new: str) -> None:
    place %= len(text)
    read(text[:place] + new + text[place + length :])
