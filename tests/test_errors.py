"""Every bad input: its line, its status, and that nothing was written or overwritten."""

import re
import runpy
import shlex
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bad_input import (
    CALLS,
    GOOD,
    LOST,
    MISUSES,
    PYTHON,
    SCENARIOS,
    SEARCHES,
    STUDY,
    WARNED,
    Bad,
    Call,
    Misuse,
)
from closeform import manifest
from closeform.cli import main
from closeform.result_folder import PRIVATE, Folder
from closeform.scenario import Scenario, ScenarioError, parse
from closeform.scenario.table import Table
from field_scenario import IN_AIR, swap
from messages import SLOW

ROOT = Path(__file__).parents[1]

OEM = """\
CCSDS_OEM_VERS = 2.0
CREATION_DATE = 2026-01-01T00:00:00
ORIGINATOR = TEST
META_START
OBJECT_NAME = {name}
OBJECT_ID = 2026-001{name}
CENTER_NAME = EARTH
REF_FRAME = EME2000
TIME_SYSTEM = UTC
START_TIME = 2026-01-01T{hour}:00:00
STOP_TIME = 2026-01-01T{hour}:10:00
META_STOP
"""


def oem(name: str, ahead: float, hour: str = "00") -> str:
    """Ten minutes of a circular orbit at 7000 km, `ahead` [rad] in its plane, a state each minute."""
    rate, radius = np.sqrt(398600.4418 / 7000.0**3), 7000.0
    lines = []
    for minute in range(11):
        c, s = np.cos(60 * minute * rate + ahead), np.sin(60 * minute * rate + ahead)
        state = [radius * c, radius * s, 0.0, -radius * rate * s, radius * rate * c, 0.0]
        lines.append(f"2026-01-01T{hour}:{minute:02d}:00 " + " ".join(f"{value:.9f}" for value in state))
    return OEM.format(name=name, hour=hour) + "\n".join(lines) + "\n"


STATES = """\
craft,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s
F1,0,0,0,0,0,0
F2,0,100,0,0,0,0
F3,0,200,0,0,0,0
"""
COVARIANCE = """\
COVARIANCE_START
EPOCH = 2026-01-01T00:00:00
COV_REF_FRAME = RTN
1e-4
9e-5 1e-4
0 0 1e-4
0 0 0 1e-10
0 0 0 0 1e-10
0 0 0 0 0 1e-10
COVARIANCE_STOP
"""


def between(text: str) -> str:
    """The same motion seventeen seconds later."""
    return text.replace(":00 ", ":17 ").replace(
        "STOP_TIME = 2026-01-01T00:10:00", "STOP_TIME = 2026-01-01T00:10:17"
    )


def contents(folder: Path) -> dict[str, bytes]:
    """Every file below a folder."""
    return {str(p.relative_to(folder)): p.read_bytes() if p.is_file() else b"" for p in folder.rglob("*")}


@pytest.fixture
def desk(tmp_path, monkeypatch):
    """A working folder with the files that the table speaks of."""
    (tmp_path / "good.toml").write_text(GOOD)
    (tmp_path / "lost.toml").write_text(LOST)
    (tmp_path / "cases.toml").write_text(
        LOST.replace('"100 0 0 m"', '"0 0 0 m"')
        .replace("craft.velocity", "craft.position")
        .replace('cm/s" } }', 'm" } }')
    )
    (tmp_path / "lost.json").write_text("{}")
    (tmp_path / "ramps.toml").write_text(
        LOST.replace(
            '"craft.velocity" = { ball = "6 cm/s" }',
            '"craft.slew_acceleration" = { normal = "0.001 deg/s^2" }',
        )
    )
    planned = swap(**IN_AIR, craft='ballistic = "0.02 m^2/kg"')
    drawn = 'vary = { "craft.ballistic" = { uniform = "0.002 m^2/kg" } }'
    (tmp_path / "planned.toml").write_text(f"{planned}{STUDY}{drawn}\n")
    (tmp_path / "picture.toml").write_bytes(b"\x89PNG\xff\xfe")
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "thesis.txt").write_text("years of work")
    (tmp_path / "done").mkdir()
    Folder(tmp_path / "done").summary({"status": 0})
    shutil.copytree(tmp_path / "done", tmp_path / "used")
    (tmp_path / "used" / "notes.txt").write_text("read before the review")
    (tmp_path / "begun.toml").write_text(LOST)
    (tmp_path / "begun-results" / PRIVATE).mkdir(parents=True)
    manifest.rewrite(
        tmp_path / "begun-results" / PRIVATE / manifest.NAME, [{"cases": 300, "chunk": 100}, {"first": 0}]
    )
    (tmp_path / "a.oem").write_text(oem("A", 0.0))
    (tmp_path / "b.oem").write_text(oem("B", 1e-4))
    (tmp_path / "later.oem").write_text(oem("B", 1e-4, hour="05"))
    (tmp_path / "between.oem").write_text(between(oem("B", 1e-4)))
    (tmp_path / "coarse.oem").write_text(re.sub(r"(?m)^.*:\d[1-46-9]:17 .*\n", "", between(oem("B", 1e-4))))
    (tmp_path / "indefinite.oem").write_text(oem("B", 1e-4) + COVARIANCE.replace("9e-5", "2e-4"))
    (tmp_path / "lvlh.oem").write_text(oem("B", 1e-4) + COVARIANCE.replace("RTN", "LVLH"))
    (tmp_path / "gcrf.oem").write_text(oem("B", 1e-4).replace("EME2000", "GCRF"))
    (tmp_path / "states.csv").write_text(STATES)
    (tmp_path / "no_units.csv").write_text(STATES.replace("_m_s", "").replace("_m", ""))
    (tmp_path / "gcrf.csv").write_text("# frame = GCRF\n" + STATES)
    (tmp_path / "later.csv").write_text(STATES.replace("craft", "time_s,craft").replace("F", "60,F"))
    (tmp_path / "damaged.csv").write_text(STATES.replace("100", "1OO"))
    (tmp_path / "cut.csv").write_text(STATES[:-7])
    (tmp_path / "twice.csv").write_text(STATES + STATES.splitlines(True)[1])
    (tmp_path / "empty.oem").write_text("")
    (tmp_path / "slow.cdm").write_text(SLOW)
    (tmp_path / "no_radius.cdm").write_text(SLOW.replace("HBR", "size"))
    (tmp_path / "metres.cdm").write_text(SLOW.replace("[km]", "[m]"))
    (tmp_path / "no_state.cdm").write_text(SLOW.replace("Y_DOT = ", "COMMENT ", 1))
    (tmp_path / "indefinite.cdm").write_text(SLOW.replace("CT_R = -352.4140813027809", "CT_R = -400"))
    (tmp_path / "ellipse.cdm").write_text(SLOW.replace("= 3.0668", "= 2.5668"))
    (tmp_path / "fixed.cdm").write_text(SLOW.replace("EME2000", "ITRF", 1))
    (tmp_path / "damaged.oem").write_text(oem("B", 1e-4).replace("-0.", "-o."))
    (tmp_path / "short.oem").write_text("\n".join(oem("B", 1e-4).splitlines()[:13]) + "\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("bad", [*SCENARIOS, *SEARCHES], ids=lambda bad: bad.what)
def test_bad_scenario(bad: Bad, desk: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (desk / bad.file).write_text(bad.text())
    before = contents(desk)
    assert main(["run", bad.file]) == bad.status
    expected = [f"{bad.file}: {line}" for line in bad.message.split("\n")]
    printed = capsys.readouterr()
    assert printed.err.splitlines() == expected
    assert printed.out == ""
    assert contents(desk) == before


@pytest.mark.parametrize("misuse", MISUSES, ids=lambda misuse: misuse.what)
def test_bad_command(misuse: Misuse, desk: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = contents(desk)
    assert main(shlex.split(misuse.arguments)) == misuse.status
    printed = capsys.readouterr()
    assert printed.err.splitlines() == [misuse.message]
    assert printed.out == ""
    assert contents(desk) == before


@pytest.fixture(scope="module")
def names() -> dict[str, Any]:
    """What the good lines of Python define."""
    found: dict[str, Any] = {}
    exec(PYTHON, found)
    return found


@pytest.mark.parametrize("call", CALLS, ids=lambda call: call.what)
def test_bad_call(call: Call, names: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r": ") as error:
        eval(call.code, names)
    assert str(error.value) == call.message


@pytest.mark.parametrize("call", WARNED, ids=lambda call: call.what)
def test_call_with_a_warning(call: Call, names: dict[str, Any]) -> None:
    with pytest.warns(UserWarning, match=re.escape(call.message)):
        eval(call.code, names)


def test_messages_name_a_remedy() -> None:
    for bad in (*SCENARIOS, *SEARCHES):
        for line in bad.message.split("\n"):
            key, wrong, *_ = line.split(": ", 1)
            assert key, bad.what
            assert len(wrong.split("; ")) >= 2, f"{bad.what}: no remedy in {line!r}"
    for misuse in MISUSES:
        assert "; " in misuse.message, misuse.what


def test_check_reports_every_error_at_once(desk: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = (
        GOOD.replace('"500 km"', '"500 kg"').replace('"20 m"', '"-20 m"').replace('craft = "F3"', "craft = 3")
    )
    (desk / "cluster.toml").write_text(text)
    assert main(["check", "cluster.toml"]) == 2
    keys = [line.split(": ")[1] for line in capsys.readouterr().err.splitlines()]
    assert keys == ["orbit.altitude", "craft.keep_out.sphere", "stage[2].craft"]


def test_what_is_not_built_is_said_with_the_rest(desk: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Also of a study, which `run` does not need."""
    text = LOST.replace('"100 0 0 m"', '"100 0 0"')
    text = text.replace('"craft.velocity" = { ball = "6 cm/s" }', '"sensor.offset" = { normal = "1 cm" }')
    (desk / "cluster.toml").write_text(text)
    keys = ["craft.position[2]"]
    for command, more in (("check", ['study.vary."sensor.offset"']), ("run", [])):
        assert main([command, "cluster.toml"]) == 2
        assert [line.split(": ")[1] for line in capsys.readouterr().err.splitlines()] == keys + more


def test_a_key_that_cannot_vary_is_told_those_that_can() -> None:
    with pytest.raises(ScenarioError, match=r"use one of craft\.silent.*, craft\.position, craft\.velocity"):
        parse(LOST.replace("craft.velocity", "launch day"))


def test_an_example_stands_in_for_every_key() -> None:
    """So that what is wrong with one hides nothing of another."""
    tables = [Table]
    for table in tables:
        tables += table.__subclasses__()
        for key in table.examples():
            table.example(key)
    assert len(tables) > 20


def test_the_good_file_is_good() -> None:
    for text in (GOOD, LOST):
        scenario = parse(text)
        assert isinstance(scenario, Scenario)
        assert [scenario.refused(command) for command in ("run", "run --case", "study")] == [(), (), ()]


def test_page_is_up_to_date() -> None:
    page = runpy.run_path(str(ROOT / "tools" / "errors_page.py"))["page"]
    assert (ROOT / "docs" / "errors.md").read_text() == page(), "run: python tools/errors_page.py"


def read(text: str) -> None:
    """Reading ends in a scenario or in one line for each error, never otherwise."""
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
def test_any_value_anywhere(text: str, number: int, key: str, value: str, replace: bool) -> None:
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
