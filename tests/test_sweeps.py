"""Sweeps: each point equals the study of the file with its values; invalid sweeps are reported."""

import json
import re
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest

from closeform.campaign import evaluated
from closeform.cli.app import main
from closeform.report.mission_study import numbered, sweep_report
from closeform.scenario import ScenarioError, parse
from closeform.scenario.study import points
from studies import PASS, as_words

ROBUST = (Path(__file__).parents[1] / "examples" / "robustness.toml").read_text()
SWEEP = """
[study.sweep]
"study.vary.craft.pointing_error" = [{ ball = "0.1 deg" }, { ball = "20 deg" }]
"sensor.half_angle" = ["70 deg", "75 deg"]
"""
VALUES = [(size, angle) for size in ("0.1 deg", "20 deg") for angle in ("70 deg", "75 deg")]


@pytest.fixture(scope="module")
def swept():
    return evaluated(parse(ROBUST + SWEEP, "swept.toml"), 300)


def alone(size: str, angle: str) -> str:
    """The file of one point, written by hand."""
    text = ROBUST.replace('half_angle = "70 deg"', f'half_angle = "{angle}"')
    return text.replace('{ ball = "0.5 deg" }', f'{{ ball = "{size}" }}')


def test_each_point_is_the_study_of_its_own_file(swept):
    assert len(swept.points) == 4
    assert len(swept) == 300
    for (size, angle), point in zip(VALUES, swept.points, strict=True):
        assert list(point.values.values()) == [f"ball {size}", angle]
        truth = evaluated(parse(alone(size, angle), "alone.toml"), 300)
        np.testing.assert_array_equal(point.campaign.time, truth.time)
        np.testing.assert_array_equal(point.campaign.leg, truth.leg)
        assert point.met_cases == truth.good.sum()
        assert point.spread.worst == truth.spreads["time [s]"].worst
    assert swept.points[0].met_cases > swept.points[2].met_cases  # 20 deg of pointing error


def test_printed_command_of_a_point_is_valid():
    """A shell takes the name of the file as one word."""
    (hint,) = sweep_report(evaluated(parse(ROBUST + SWEEP, "two words.toml"), 1)).hint
    assert as_words(hint)[:7] == ["closeform", "run", "two words.toml", "--case", "K", "--point", "P"]


@pytest.mark.parametrize("count", [5, 40])  # in chunks of one and of two, though 32 missions fit in one
def test_each_point_of_missions_is_the_study_of_its_own_file(count):
    """Times and delta-v of each case at each thrust, row for row, whatever the size of chunks."""
    limits = '"1 N"', '"0.2 N"'
    sweep = f'\n[study.sweep]\n"craft.max_thrust" = [{", ".join(limits)}]\n'
    swept = evaluated(parse(PASS + sweep, "swept.toml"), count)
    for limit, point in zip(limits, swept.points, strict=True):
        truth = evaluated(
            parse(PASS.replace('max_thrust = "1 N"', f"max_thrust = {limit}"), "alone.toml"), count
        )
        for name in truth.kind.names:
            np.testing.assert_array_equal(point.campaign.column(name), truth.column(name))
        assert (point.met_cases, point.campaign.nearest) == (truth.met_cases, truth.nearest)


def test_command_writes_a_table_and_a_picture(tmp_path, monkeypatch, capsys, swept):
    monkeypatch.chdir(tmp_path)
    Path("swept.toml").write_text(ROBUST + SWEEP)
    assert main(["study", "swept.toml", "--cases", "300"]) == 1
    printed = capsys.readouterr().out
    assert "not met in every case at 4 of 4 points" in printed
    rows = pyarrow.parquet.read_table("swept-study/cases").to_pydict()
    assert rows["point"] == np.repeat(range(4), 300).tolist()
    assert rows["case"] == [*range(300)] * 4
    times = np.concatenate([point.campaign.time for point in swept.points])
    np.testing.assert_array_equal(np.array(rows["time_s"], dtype=float), times)
    summary = json.loads(Path("swept-study/summary.json").read_text())
    assert [point["met"]["cases"] for point in summary["points"]] == [one.met_cases for one in swept.points]
    assert Path("swept-study/sweep.png").stat().st_size > 10_000
    (case, *_) = np.flatnonzero(~np.isfinite(swept.points[3].campaign.time))  # it never locks
    assert main(["run", "swept.toml", "--point", "3", "--case", str(case), "--no-viewer"]) == 1
    told = json.loads(Path(f"swept-point-3-case-{case}-results/summary.json").read_text())
    assert told["status"] == 1
    assert told["stopped"] is not None
    locks = pyarrow.parquet.read_table(f"swept-point-3-case-{case}-results/locks.parquet").to_pydict()
    assert not np.isfinite(np.array(locks["time_s"], dtype=float)).any()
    assert main(["run", "swept.toml", "--point", "4", "--case", "0"]) == 2
    assert (
        capsys.readouterr().err == "--point: swept.toml has points 0 to 3, got 4; give one of them, or none\n"
    )


@pytest.mark.parametrize(
    ("key", "values", "told"),
    [
        (
            "sensor.half_angle",
            '["70 deg", "60 deg"]',
            "half_angle = 60 deg: search.sun_limit: a half-angle of 60",
        ),
        (
            "camera.range",
            '["1 km"]',
            "study.sweep: camera.range: there is no camera in the file; add it, or name",
        ),
        (
            "stage[2].rounds",
            "[1]",
            "study.sweep: stage[2].rounds: there is no stage[2] in the file; add it, or",
        ),
        ("sensor.range", "[]", "study: sweep has no values of sensor.range; give some, or remove it"),
        ("stage[1].do", '["gather"]', "study.sweep: changes the craft or the stages; remove that key"),
        (
            "search.sun_limit",
            str([f"{20 + k / 100} deg" for k in range(1001)]),
            "more than 1000 points; give fewer",
        ),
    ],
)
def test_invalid_sweeps_are_reported(key, values, told):
    with pytest.raises(ScenarioError, match=re.escape(told)) as refused:
        parse(f'{ROBUST}\n[study.sweep]\n"{key}" = {values}\n', "swept.toml")
    assert len(refused.value.lines) == 1


def test_stages_craft_and_draws_can_be_swept():
    raw = {
        "craft": {"keep_out": {"sphere": "1 m"}},
        "stage": [{"within": "1 h"}, {"within": "2 h"}],
        "study": {
            "vary": {"craft.mass": {"normal": "1 kg"}},
            "sweep": {
                "stage[2].within": ["3 h"],
                "craft.keep_out.sphere": ["2 m", "3 m"],
                "study.vary.craft.mass": [{"normal": "2 kg"}],
            },
        },
    }
    (_, one), (chosen, other) = points(raw)
    assert one["stage"] == other["stage"] == [{"within": "1 h"}, {"within": "3 h"}]
    assert (one["craft"], other["craft"]) == (
        {"keep_out": {"sphere": "2 m"}},
        {"keep_out": {"sphere": "3 m"}},
    )
    assert other["study"] == {"vary": {"craft.mass": {"normal": "2 kg"}}}
    assert chosen["craft.keep_out.sphere"] == "3 m"
    assert raw["craft"] == {"keep_out": {"sphere": "1 m"}}


def test_axes_of_pictures():
    assert numbered(["1 deg", "2.5 deg"]) == ([1.0, 2.5], "", "deg")
    assert numbered(["ball 1e-3 deg", "ball 2 deg"]) == ([0.001, 2.0], "ball", "deg")
    assert numbered(["1 deg", "2 m"]) == ([0.0, 1.0], "", "number of the value")
    assert numbered(["least", "half"]) == ([0.0, 1.0], "", "number of the value")
    assert numbered(["1", "2"]) == ([1.0, 2.0], "", "1")
