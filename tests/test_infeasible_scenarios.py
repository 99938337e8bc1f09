"""Consistent verdicts of `check`, `run` and `study` on scenarios that cannot be executed."""

import json
from pathlib import Path

import pytest

from closeform.cli.app import main
from closeform.mission.mission import plan_mission, stops
from closeform.scenario import parse
from closeform.scenario.study import SEARCHED as SEARCHED_KEYS
from closeform.scenario.study import readers

pytestmark = pytest.mark.usefixtures("undrawn")

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
SEARCHED = {
    "pointing_error": '"0.1 0 0 deg"',
    "slew_rate_error": '"0.1 %"',
    "start_offset": '"2 s"',
    "slew_acceleration": '"0.01 deg/s^2"',
    "silent": "[false, true]",
}


def statuses(text: str, capsys) -> dict[str, tuple[int, list[str]]]:
    """Return the status and the error messages of each command."""
    Path("two.toml").write_text(text)
    found = {}
    for command in ("check", "run", "study"):
        status = main([command, "two.toml", *(["--overwrite"] if command != "check" else [])])
        found[command] = status, capsys.readouterr().err.splitlines()
    return found


@pytest.mark.parametrize(("key", "stage"), [("pointing_error", "lock"), ("silent", "gather")])
def test_imperfect_searches_are_accepted(key, stage, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    text = LOCKING.replace("KEY", f"{key} = {SEARCHED[key]}").replace("STAGE", f'do = "{stage}"')
    text = text.replace('do = "gather"', 'do = "gather"\nanimation = false') + STUDIED
    found = statuses(text, capsys)
    lost = int(key == "silent")
    assert {command: status for command, (status, _) in found.items()} == {
        "check": 0,
        "run": lost,
        "study": lost,
    }


@pytest.mark.parametrize(
    "key", [key for key in readers() if key.startswith("se") and key not in SEARCHED_KEYS]
)
def test_search_key_that_cannot_vary_is_rejected(key, tmp_path, monkeypatch, capsys) -> None:
    """`check` reports that a run without --case uses nominal values."""
    monkeypatch.chdir(tmp_path)
    draw = f"{{ choice = [{readers()[key].example}] }}"
    text = LOCKING.replace("KEY", "").replace("STAGE", 'do = "lock"') + STUDIED + f'"{key}" = {draw}\n'
    Path("two.toml").write_text(text)
    assert main(["check", "two.toml"]) == 2
    checked = capsys.readouterr()
    assert "but not for study and run --case; use run" in " ".join(checked.out.split())
    for arguments in (["study"], ["run", "--case", "0"]):
        assert main([arguments[0], "two.toml", *arguments[1:]]) == 2
        assert capsys.readouterr().err == checked.err
    (line,) = checked.err.splitlines()
    assert line.startswith(f'two.toml: study.vary."{key}": cannot vary between cases; ')


HELD = """
closeform = 1
title = "Held"
[orbit]
altitude = "500 km"
[craft]
name = ["A", "B", "C"]
position = ["0 0 0 m", "0 31 0 m", "0 200 0 m"]
velocity = "0 0 0 m/s"
keep_out = { sphere = "30 m" }
[[stage]]
do = "avoid"
craft = "C"
to = { position = "0 -100 0 m", velocity = "0 0 0 m/s" }
within = "0.3 orbits"
[[stage]]
do = "coast"
for = "0.1 orbits"
[[stage]]
do = "avoid"
craft = "B"
to = { position = "0 0 100 m", velocity = "0 0 0 m/s" }
within = "0.3 orbits"
margin = "2 m"
"""


CORRIDOR = """cost = "delta-v"
corridor = { axis = [0, -1, 0], half_angle = "10 deg", radius = "1 m" }
within ="""


@pytest.mark.parametrize(
    ("was", "now", "stage"),
    [
        ("", "", 3),  # A and B start within the margin
        ("0 -100 0 m", "0 -20 0 m", 1),  # A and C end inside their zone
        ("within =", CORRIDOR, 1),  # C starts on the other side
        ("0 31 0 m", "0 33 0 m", None),
    ],
)
def test_check_predicts_where_a_run_stops(was, now, stage, tmp_path, monkeypatch, capsys) -> None:
    """`check` gives the reason for which the run stops."""
    monkeypatch.chdir(tmp_path)
    found = statuses(HELD.replace(was, now, 1), capsys)
    (told,) = found["check"][1] or [None]
    assert (found["check"][0], found["run"][0]) == ((2, 1) if stage else (0, 0))
    verdict = json.loads(Path("two-results/summary.json").read_text())["verdict"]
    stopped = f"stopped in stage {stage} (avoid): "
    assert verdict.startswith(stopped) == (stage is not None)
    assert told == (f"two.toml: stage[{stage}]: {verdict.removeprefix(stopped)}" if stage else None)


THREE = """
closeform = 1
title = "Trajectories"
[orbit]
ORBIT
[craft]
name = ["A", "B", "C"]
position = ["1000 0 0 m", "1000 100 0 m", "0 0 0 m"]
velocity = "0 0 0 m/s"
keep_out = { sphere = "30 m" }
max_acceleration = "20 mm/s^2"
[[stage]]
within = "600 s"
"""
FREE, ORBIT = "deep_space = true", 'altitude = "500 km"'
ABREAST = """do = "reconfigure"
craft = ["A", "B"]
to = { line = { spacing = "50 m", direction = [1, 0, 0] } }
"""  # centred where they coast to, 1 km from C
BOTH = """do = "avoid"
craft = "A"
to = { position = "1000 200 0 m", velocity = "0 0 0 m/s" }
meanwhile = [{ craft = "B", to = { position = "0 20 0 m", velocity = "0 0 0 m/s" } }]
"""  # neither B nor C avoids the other: a conflict that no plan has to solve
LATE = """do = "reconfigure"
to = [
    { position = "0 2000 0 m", velocity = "0 0 0 m/s" },
    { position = "-393.7 616.3 0 m", velocity = "0.341 0.872 0 m/s" },
    { position = "0 -2000 0 m", velocity = "0 0 0 m/s" },
]
[[stage]]
do = "avoid"
craft = "A"
to = { roe = "0 0 500 0 0 0 m" }
within = "3000 s"
"""  # the first stage takes longer than requested, so A does not end at B


@pytest.mark.parametrize(
    ("orbit", "stage", "conflicts"), [(FREE, ABREAST, 0), (ORBIT, BOTH, 1), (ORBIT, LATE, 0)]
)
def test_check_predicts_no_false_stop(orbit, stage, conflicts) -> None:
    scenario = parse(THREE.replace("ORBIT", orbit) + stage)
    assert stops(scenario) == ()
    mission = plan_mission(scenario)
    assert mission.stopped is None
    assert sum(len(result.after.conflicts) for result in mission.results) == conflicts
