"""Mission studies: each case equals its run, failures are rows, and chunks do not matter."""

import json
import re
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest
from scipy.special import ndtri

import closeform as cf
from closeform.campaign import case_of, evaluated
from closeform.campaign.mission_cases import MissionCases
from closeform.cli.app import main
from closeform.mission.mission import plan_mission
from closeform.report.mission_study import missions_report
from closeform.scenario import ScenarioError, parse
from closeform.storage.result_folder import Folder
from closeform.viewer import replays
from closeform.viewer.scene import scene_of
from closeform.viewer.shown import Shown
from philox import block
from studies import PASS

# B and C are sampled around the goal of A, which is unreachable in some cases.
BLOCKED = PASS.replace('"0 0 0 m", "10 400 0 m"', '"0 200 0 m", "0 250 0 m"').replace(
    '"craft.position" = { normal = "8 m" }', '"craft.position" = { uniform = "60 m" }'
)


@pytest.fixture(scope="module")
def missions():
    return evaluated(parse(PASS, "pass.toml"))


@pytest.fixture(scope="module")
def blocked():
    return evaluated(parse(BLOCKED, "blocked.toml"), 40)


def test_each_case_equals_its_run(missions, blocked):
    for campaign in (missions, blocked):
        for case in (0, 7, 23, *campaign.failed[:3].tolist()):
            try:
                mission = plan_mission(case_of(campaign.scenario, case))
            except ScenarioError:
                assert campaign.statuses[case] == "refused"
                continue
            verdict = mission.verdict
            stopped = verdict.stopped is not None
            assert campaign.statuses[case] == ("stopped" if stopped else "met" if verdict.ok else "unmet")
            assert campaign.column("reason")[case] == ("" if verdict.ok else str(verdict))
            spent = mission.spent_of_each[0]
            assert campaign.column("delta_v_m_s")[case] == pytest.approx(spent.sum(), rel=1e-14)
            assert [campaign.column(f"{name}_delta_v_m_s")[case] for name in "ABC"] == pytest.approx(
                spent.tolist(), rel=1e-14
            )
            ends = mission.results[-1].end
            np.testing.assert_equal(campaign.column("end_s")[case], np.nan if stopped else ends)


def test_samples_come_from_the_philox_blocks(missions):
    """Spacecraft c of 3 in case K takes block 3 K + c of the stream of each key."""
    scenario, case = missions.scenario, 5
    found = case_of(scenario, case)
    for key, size in (("craft.position", 3), ("craft.mass", 1)):
        random = np.array([block(11, key, 3 * case + c) for c in range(3)])
        for c in range(3):
            one, nominal = found.craft[c], scenario.craft[c]
            if size == 3:
                truth = np.array(nominal.position) + 8.0 * ndtri(random[c, :3])
                np.testing.assert_array_equal(one.position, truth)
            else:
                assert one.mass == 100.0 + 20.0 * (2.0 * random[c, 0] - 1.0)


def test_case_does_not_depend_on_its_chunk(missions):
    kind = MissionCases(missions.scenario, 11)
    parts = [kind.evaluate(0, 3), kind.evaluate(3, 8)]
    for name in kind.names:
        np.testing.assert_array_equal(
            np.concatenate([part[name] for part in parts]), missions.column(name)[:8]
        )


def test_failed_cases_stay_in_the_denominator(blocked):
    assert len(blocked) == 40 == sum(blocked.counts.values()) == len(blocked.statuses)
    assert blocked.counts["met"] >= 1
    assert blocked.counts["stopped"] >= 1
    assert not blocked.ok
    assert len(blocked.failed) == 40 - blocked.counts["met"]
    assert f"{blocked.counts['stopped']} of 40 cases stopped in a stage: " in blocked.reason
    assert sum(many for _, many, _ in blocked.causes) == len(blocked.failed)
    flown_all = ~np.isnan(blocked.column("end_s"))
    assert blocked.spreads["delta-v of all craft [m/s]"].count == flown_all.sum()
    (worst, case), *_ = blocked.spreads["delta-v of all craft [m/s]"].worst
    assert worst == blocked.column("delta_v_m_s")[flown_all].max() == blocked.column("delta_v_m_s")[case]


def test_study_command_writes_a_row_for_each_case(tmp_path, capsys, blocked):
    file, place = tmp_path / "blocked.toml", tmp_path / "out"
    file.write_text(BLOCKED)
    assert main(["study", str(file), "--cases", "40", "--out", str(place)]) == 1
    printed = capsys.readouterr().out
    assert "cases stopped in a stage: " in printed
    assert f"--case {blocked.failed[0]} shows the first of them" in printed
    rows = pyarrow.parquet.read_table(place / "cases").to_pydict()
    assert rows["case"] == list(range(40))
    assert rows["status"] == blocked.statuses.tolist()
    assert [k for k, end in enumerate(rows["end_s"]) if end is None] == np.flatnonzero(
        np.isnan(blocked.column("end_s"))
    ).tolist()
    summary = json.loads((place / "summary.json").read_text())
    assert summary["status"] == 1
    assert {one: row["cases"] for one, row in summary["ended"].items()} == blocked.counts
    for name in ("report.html", "delta-v.png"):
        assert (place / name).stat().st_size > 10_000
    loaded = cf.load(place)
    np.testing.assert_array_equal(loaded.cases["status"], blocked.statuses)
    assert cf.plot(loaded) is not None


def test_study_of_a_mission_with_a_search(tmp_path, monkeypatch):
    """Lost spacecraft are found and then reconfigured."""
    monkeypatch.chdir(tmp_path)
    examples = Path(__file__).parents[1] / "examples"
    text = (examples / "find_then_fly.toml").read_text()
    study = '\n[study]\ncases = 4\nseed = 2\n[study.vary]\n"craft.velocity" = { ball = "1 mm/s" }\n'
    campaign = evaluated(parse(text + study, "find.toml"))
    assert set(campaign.statuses) <= {"met", "unmet", "stopped"}
    assert (campaign.column("stage_1_delta_v_m_s") > 0.0).any()
    assert {"stage 1, gather [m/s]", "stage 2, reconfigure [m/s]"} <= set(campaign.spreads)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (
            '{ uniform = "20 kg" }',
            '{ normal = "13 kg" }',
            "a case can have -7.9 in SI units, out of range",
        ),
        ('"craft.mass" = { uniform = "20 kg" }', '"craft.silent" = { chance = 0.1 }', "no stage is a search"),
        (
            '"craft.mass"',
            '"craft.propellant"',
            "craft.propellant has no nominal value to add to; give it",
        ),
    ],
)
def test_invalid_distributions_are_rejected(old, new, told):
    with pytest.raises(ScenarioError, match=re.escape(told)):
        evaluated(parse(PASS.replace(old, new), "pass.toml"))


def test_optimality_gap_column(missions):
    """The gap of each case equals that of its run; 0 where proven."""
    gaps = missions.column("gap")
    for case in (0, 7, 23):
        plan = plan_mission(case_of(missions.scenario, case)).results[1].result.plan
        assert gaps[case] == pytest.approx(
            max(plan.energy / plan.lower_bound - 1.0, 0.0), rel=1e-9, abs=1e-12
        )
    assert missions.spreads["above the lower bound [%]"].worst[0][0] == gaps.max()


def test_tables_omit_empty_rows_and_columns(missions):
    """No 99.9 % of 24 cases, and no rows that are 0 in every case."""
    (spent,) = (one for one in missions_report(missions).tables if one.title == "Cost of cases")
    assert [column.heading for column in spent.shown][1:] == ["mean", "median", "95 %", "greatest", "in case"]
    told = [row[0] for row in spent.rows]
    assert "delta-v of A [m/s]" in told
    assert "delta-v of B [m/s]" not in told  # B coasts
    assert "stage 1, coast [m/s]" not in told
    assert missions.spreads["delta-v of B [m/s]"].worst[0][0] == 0.0


def test_pages_show_the_missions_of_the_study(tmp_path, blocked):
    """Each page equals that of a run."""
    fresh = evaluated(blocked.scenario, 12)

    under_way: list[str] = []
    pages, write = replays.begin(fresh, Folder(tmp_path))
    write(under_way.append)
    assert len(pages) >= 2
    assert under_way[0] == f"page 1 of {len(pages)}: {pages[0].title}"
    for page in pages:
        run = plan_mission(case_of(fresh.scenario, int(page.title.removeprefix("case "))))
        assert scene_of(Shown.of_mission(run), report="report.html").numbers in (
            tmp_path / page.file
        ).read_text(encoding="utf-8")


def test_pages_can_be_omitted(tmp_path, capsys):
    for name, text, options in (
        ("option", PASS, ["--no-pages"]),
        ("key", PASS.replace("seed = 11", "seed = 11\npages = false"), []),
    ):
        (tmp_path / f"{name}.toml").write_text(text)
        main(
            ["study", str(tmp_path / f"{name}.toml"), "--cases", "3", "--out", str(tmp_path / name), *options]
        )
        assert not [*(tmp_path / name).glob("*-*.html")]
        assert (tmp_path / name / "report.html").exists()
    capsys.readouterr()
