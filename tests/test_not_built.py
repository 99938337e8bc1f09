"""What is not built yet: `check`, `run`, `study` and the docs say the same."""

import re
from pathlib import Path

import pytest

from closeform.cli import main
from closeform.scenario.craft import Craft
from closeform.scenario.study import BUILT, readers

LOCKING = """\
closeform = 1
title = "Two"

[orbit]
deep_space = true

[craft]
name = ["A", "B"]
group = ["A", "B"]
position = ["0 0 0 m", "100 20 30 m"]
velocity = "0 0 0 m/s"
keep_out = { sphere = "1 m" }
KEY

[sensor]
half_angle = "70 deg"
range = "2 km"

[search]
method = "modified"
slew_rate = "0.25 deg/s"
sun_limit = "25 deg"

[[stage]]
STAGE
"""
STUDIED = '\n[study]\ncases = 2\nseed = 1\n[study.vary]\n"craft.velocity" = { uniform = "1 cm/s" }\n'
NOT_BUILT = {
    "pointing_error": '"0.1 0 0 deg"',
    "slew_rate_error": '"0.1 %"',
    "start_offset": '"2 s"',
    "silent": "[false, true]",
}
assert set(NOT_BUILT) == set(Craft.not_built)


def statuses(text: str, capsys) -> dict[str, tuple[int, list[str]]]:
    """The status of each command, and what it complains of."""
    Path("two.toml").write_text(text)
    found = {}
    for command in ("check", "run", "study"):
        status = main([command, "two.toml", *(["--overwrite"] if command != "check" else [])])
        found[command] = status, capsys.readouterr().err.splitlines()
    return found


@pytest.mark.parametrize("stage", ['do = "lock"', 'do = "coast"\nfor = "1 min"'], ids=["lock", "coast"])
@pytest.mark.parametrize("key", NOT_BUILT)
def test_a_key_that_is_not_built_is_refused_by_all(key, stage, tmp_path, monkeypatch, capsys) -> None:
    """Whatever flies, check, run and study say the same of it; at its default it does no harm."""
    monkeypatch.chdir(tmp_path)
    text = LOCKING.replace("KEY", f"{key} = {NOT_BUILT[key]}").replace("STAGE", stage)
    line = f"two.toml: craft.{key}: is not built yet; remove it"
    found = statuses(text, capsys)
    assert found["check"] == found["run"] == (2, [line])
    found = statuses(text + STUDIED, capsys)
    for command, (status, said) in found.items():
        assert (command, status, said[0]) == (command, 2, line)
    assert found["check"][1] == found["study"][1]
    assert list(tmp_path.iterdir()) == [tmp_path / "two.toml"]
    harmless = {"pointing_error": '"0 0 0 deg"', "slew_rate_error": '"0 %"', "start_offset": '"0 s"'}
    Path("two.toml").write_text(text.replace(NOT_BUILT[key], harmless.get(key, "false")))
    assert main(["check", "two.toml"]) == 0


@pytest.mark.parametrize("key", sorted({key for key in readers() if key not in BUILT}))
def test_a_draw_that_is_not_built_is_refused_by_check_and_study(key, tmp_path, monkeypatch, capsys) -> None:
    """A run without --case flies the nominal values, and check says so."""
    monkeypatch.chdir(tmp_path)
    reader = readers()[key]
    draw = "{ chance = 0.5 }" if reader is None else f"{{ choice = [{reader.example}] }}"
    text = LOCKING.replace("KEY", "").replace("STAGE", 'do = "lock"') + STUDIED + f'"{key}" = {draw}\n'
    Path("two.toml").write_text(text)
    assert main(["check", "two.toml"]) == 2
    checked = capsys.readouterr()
    assert "but study and run --case cannot fly them, run takes it" in " ".join(checked.out.split())
    for arguments in (["study"], ["run", "--case", "0"]):
        assert main([arguments[0], "two.toml", *arguments[1:]]) == 2
        assert capsys.readouterr().err == checked.err
    (line,) = checked.err.splitlines()
    assert line.startswith(f'two.toml: study.vary."{key}": is not built yet; ')


def test_docs_say_what_is_not_built() -> None:
    """Every such key is marked on the page of keys, and nothing that is built is."""
    page = (Path(__file__).parents[1] / "docs" / "scenario.md").read_text(encoding="utf-8")
    marked = set(re.findall(r"^\| `(\w+)` \|.*not built yet", page, re.MULTILINE))
    assert marked - {"chance"} == set(Craft.not_built)  # a chance is for `silent`
