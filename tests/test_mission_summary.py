"""Summary of a mission: delta-v, propellant and thrust of each spacecraft, and conflicts by pair."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from closeform.campaign import case_of, evaluated
from closeform.cli.app import main
from closeform.mission.mission import plan_mission
from closeform.report.run import RunReport
from closeform.scenario import parse
from studies import LIMITED

EXAMPLES = Path(__file__).parents[1] / "examples"
G0 = 9.80665
TWO_STAGES = """\
closeform = 1
title = "There and back"

[orbit]
deep_space = true

[craft]
name = ["A", "B"]
position = ["0 -100 0 m", "0 0 500 m"]
velocity = "0 0 0 m/s"
mass = "12 kg"
max_thrust = ["20 mN", "50 mN"]
delta_v_budget = ["2 m/s", "1 m/s"]
specific_impulse = "60 s"
propellant = "300 g"
keep_out = { sphere = "20 m" }

[[stage]]
do = "avoid"
craft = "A"
to = { position = "0 100 0 m", velocity = "0 0 0 m/s" }
within = "1000 s"

[[stage]]
do = "reconfigure"
to = [{ position = "0 -100 0 m", velocity = "0 0 0 m/s" }, { position = "0 0 400 m", velocity = "0 0 0 m/s" }]
within = "2000 s"
"""
# m/s, from rest to rest over L: thrust falls from 6 L / T^2 to its opposite, by which 3 L / T is spent
SPENT = np.array([3 * 200 / 1000 + 3 * 200 / 2000, 3 * 100 / 2000])


def test_delta_v_propellant_and_thrust_used_by_each_spacecraft(
    undrawn, tmp_path, monkeypatch, capsys
) -> None:
    """By hand: 3 L / T of delta-v from rest to rest, the rocket equation, 6 L / T^2 of thrust."""
    monkeypatch.chdir(tmp_path)
    Path("file.toml").write_text(TWO_STAGES)
    assert main(["run", "file.toml"]) == 0
    printed = capsys.readouterr().out
    summary = json.loads(Path("file-results/summary.json").read_text())
    burnt = 12.0 * -np.expm1(-SPENT / (60.0 * G0))
    thrust = 12.0 * 6.0 * np.array([200.0 / 1000.0**2, 100.0 / 2000.0**2])
    assert [row["craft"] for row in summary["used"]] == ["A", "B"]
    for key, truth in {
        "delta_v_m_s": SPENT,
        "share_of_delta_v_budget": SPENT / [2.0, 1.0],
        "propellant_kg": burnt,
        "propellant_left_kg": 0.3 - burnt,
        "share_of_max_thrust": thrust / [0.02, 0.05],
    }.items():
        np.testing.assert_allclose([row[key] for row in summary["used"]], truth, rtol=1e-9)
    table = printed.split("Use of each spacecraft\n")[1].split("\n\n")[0].splitlines()
    assert re.split(r"\s{2,}", table[0]) == [
        *("craft", "delta-v [m/s]", "of its budget [%]"),
        *("propellant [g]", "left [g]", "of max_thrust [%]"),
    ]
    *each, last = table[1:]
    assert last.split() == ["all", f"{SPENT.sum():.6f}", "-", f"{1e3 * burnt.sum():.2f}", "-", "-"]
    assert len(each) == 2
    for k, line in enumerate(each):
        name, *cells = line.split()
        assert name == "AB"[k]
        budget, limit, fuel = (2.0, 1.0)[k], (0.02, 0.05)[k], 1e3 * burnt[k]
        truth = SPENT[k], 100 * SPENT[k] / budget, fuel, 300 - fuel, 100 * thrust[k] / limit
        for cell, figure, digits in zip(cells, truth, (6, 1, 2, 2, 1), strict=True):
            assert float(cell) == pytest.approx(figure, abs=0.51 * 10.0**-digits)
    page = Path("file-results/report.html").read_text()
    assert "Use of each spacecraft" in page


def test_plans_that_are_not_executed_use_no_delta_v() -> None:
    """The last stage, which ends in B's zone, is not executed."""
    text = TWO_STAGES + TWO_STAGES[TWO_STAGES.index("\n[[stage]]") : TWO_STAGES.index('within = "1000 s"')]
    before, after = text.rsplit("0 100 0 m", 1)
    mission = plan_mission(parse(f'{before}0 5 395 m{after}within = "1 h"\n'))
    assert mission.stopped is not None
    assert len(mission.results) == 3
    np.testing.assert_allclose(list(RunReport(mission).summary["delta_v_m_s"].values()), SPENT, rtol=1e-9)


def test_thrust_limit_does_not_apply_to_impulses() -> None:
    """The report of a gathering states this if the file has max_thrust."""
    text = (EXAMPLES / "tpf.toml").read_text()
    limited = text.replace('mass = "700 kg"', 'mass = "700 kg"\nmax_thrust = "1 mN"')
    said = "Burns are impulses, which take no time: max_thrust does not apply to this stage"
    for scenario, lines in ((text, ()), (limited, (said,))):
        assert RunReport(plan_mission(parse(scenario))).sections[0].closing == lines


@pytest.mark.parametrize("stage", ["gather", "lock"])
@pytest.mark.parametrize(
    "zones",
    [
        '[{ sphere = "5 m" }, { sphere = "40 m" }, { sphere = "12 m" }]',
        '[{ covariance = "25 0 100 0 0 25 m^2", sigmas = 3 }, { sphere = "3 m", kind = "body" },'
        ' { sphere = "9 m" }]',
    ],
    ids=["regions", "unlike"],
)
def test_study_and_run_use_the_same_zones(zones: str, stage: str) -> None:
    """Each pair has its own zone."""
    text = LIMITED.replace('do = "gather"', f'do = "{stage}"').replace('{ sphere = "20 m" }', zones)
    scenario = parse(text)
    clear = evaluated(scenario, 60, 3, lambda done: None).kept["clear"]
    alone = [not plan_mission(case_of(scenario, case)).verdict.conflicts for case in range(60)]
    np.testing.assert_array_equal(clear, alone)
    assert 0.1 < clear.mean() < 0.95


CROWD = """
closeform = 1
title = "Crowd"
[orbit]
altitude = "500 km"
[craft]
name = ["A", "B", "C", "D"]
start = [
  { roe = "0 0 0 100 0 60 m" }, { roe = "0 0 0 -100 0 60 m" },
  { roe = "0 0 0 100 0 -60 m" }, { roe = "0 300 0 100 0 60 m" },
]
keep_out = { sphere = "30 m" }
[[stage]]
do = "coast"
for = "FOR"
"""


def test_conflicts_of_a_coast_are_summed_up_by_pair() -> None:
    """Each pair has its number of conflicts, first and last time, total duration and minimum ratio."""
    mission = plan_mission(parse(CROWD.replace("FOR", "30 orbits")))
    met = mission.results[0].after.conflicts
    assert len(met) > 40
    (told,) = RunReport(mission).sections
    by_pair, every = told.tables[:2]
    assert not by_pair.folded
    assert every.folded
    assert len(every.rows) == len(met)
    pairs = {(one.first, one.second) for one in met}
    assert {row[0] for row in by_pair.rows} == pairs
    for pair, number, first, last, inside, when, least in by_pair.rows:
        own = [one for one in met if (one.first, one.second) == pair]
        assert number == len(own)
        assert first == min(one.start for one in own)
        assert last == max(one.end for one in own)
        assert inside == pytest.approx(sum(one.end - one.start for one in own))
        assert least == pytest.approx(min(one.ratio for one in own), abs=1e-6)
        assert any(one.time == when and one.ratio == least for one in own)
    ratios = [round(row[-1], 6) for row in by_pair.rows]
    assert ratios == sorted(ratios)
    assert by_pair.title == "Conflicts, by pair"
    stage = RunReport(mission).summary["stages"][0]
    assert [tuple(row["pair"]) for row in stage["after"]["conflicts_by_pair"]] == [
        row[0] for row in by_pair.rows
    ]
