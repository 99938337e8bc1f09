"""Missions with loss of thrust: times, drifts and closest approaches."""

import re

import numpy as np
import pytest
from scipy.linalg import expm

from bridge import hill
from closeform.campaign import case_of, evaluated
from closeform.campaign.draws import failing
from closeform.mission.mission import plan_mission
from closeform.report.run import requirements
from closeform.scenario import ScenarioError, parse
from studies import FAILS, STATION, TWICE


@pytest.fixture(scope="module")
def campaign():
    return evaluated(parse(FAILS, "fails.toml"), 24)


def test_failed_spacecraft_drift_and_others_follow_the_plan(campaign):
    """Compare with Hill's matrix exponential after the failure and with the mission without it."""
    scenario = campaign.scenario
    sound = parse(re.sub(r'"craft.fails".*\n', "", FAILS), "fails.toml")
    n = scenario.orbit.build().mean_motion
    seen = set()
    for case in range(12):
        mission, plan = plan_mission(case_of(scenario, case)), plan_mission(case_of(sound, case))
        seen.add(tuple(one.craft for one in mission.lost))
        instants = np.linspace(0.0, plan.results[-1].end, 4001)
        truth = plan.paths.position(instants)
        for one in mission.lost:
            k, after = scenario.names.index(one.craft), instants >= one.time
            begin = plan.paths[k].state(one.time)
            drift = [(expm(hill(n) * (t - one.time)) @ begin)[:3] for t in instants[after]]
            truth[k, after] = np.array(drift).reshape(-1, 3)
        np.testing.assert_allclose(mission.paths.position(instants), truth, atol=1e-6)  # a micrometre
        apart = np.linalg.norm(truth[0] - truth[1], axis=-1) / 25.0
        for one in mission.lost:
            least = apart[instants >= one.time].min()
            assert one.ratio <= least + 1e-9
            assert least - one.ratio < 0.02  # between samples a second apart they move by half a metre
            arcs = np.concatenate([result.after.path(one.craft).arcs for result in plan.results])
            assert one.needed == bool(np.abs(arcs[arcs[:, 1] > one.time, 12:]).any())
            assert campaign.column(f"{one.craft}_fails_s")[case] == pytest.approx(one.time, rel=1e-15)
        ratios = [one.ratio for one in mission.lost]
        np.testing.assert_equal(campaign.column("drift_ratio")[case], min(ratios, default=np.nan))
        unmet = any(one.needed for one in mission.lost) or mission.verdict.conflicts
        assert campaign.statuses[case] == ("unmet" if unmet else "met")
    assert {(), ("A",), ("B",), ("A", "B")} <= seen


def test_coasting_spacecraft_do_not_fail():
    """A coasting station never fails."""
    campaign = evaluated(parse(STATION.replace("chance = 0.5", "chance = 1.0"), "fails.toml"), 3)
    assert np.isnan(campaign.column("B_fails_s")).all()
    assert not np.isnan(campaign.column("A_fails_s")).any()
    for case in range(3):
        (lost,) = plan_mission(case_of(campaign.scenario, case)).lost
        assert lost.craft == "A"
        assert campaign.column("drift_ratio")[case] == lost.ratio


def test_failures_have_the_given_chance_at_any_time():
    """The shares of 4000 samples agree within five standard errors."""
    scenario = parse(FAILS.replace("0.5 }", "0.2 }"), "fails.toml")
    shares = np.array([failing(scenario, 3, case) for case in range(2000)]).ravel()
    failed = shares[~np.isnan(shares)]
    assert abs(len(failed) / 4000 - 0.2) < 5.0 * np.sqrt(0.2 * 0.8 / 4000)
    quarters = np.histogram(failed, 4, (0.0, 1.0))[0] / len(failed)
    assert np.abs(quarters - 0.25).max() < 5.0 * np.sqrt(0.25 * 0.75 / len(failed))


def test_reasons_name_the_drifting_spacecraft(campaign):
    reasons = campaign.column("reason").tolist()
    needed = [k for k in range(24) if re.match(r"A loses its thrust at [0-9.]+ s and drifts", reasons[k])]
    spent = campaign.column("A_delta_v_m_s")
    assert needed
    assert spent[needed].max() < spent.max()
    for k in range(24):
        if "drifts into the zone of B" in reasons[k]:
            assert campaign.column("conflicts")[k] >= 1
            assert campaign.column("drift_ratio")[k] < 1.0
    assert sum(many for _, many, _ in campaign.causes) == len(campaign.failed)


def test_pages_of_cases_name_unmet_goals(campaign):
    """Unmet goals of the table are those of the verdict."""
    for case in range(24):
        mission = plan_mission(case_of(parse(FAILS, "fails.toml"), case))
        unmet = [what for what, _, met in requirements(mission) if not met]
        assert (not unmet) == mission.verdict.ok
        drifts = [one.craft for one in mission.lost if one.needed]
        assert [f"{name} reaches its target" for name in drifts] == [one for one in unmet if "reaches" in one]


def test_errors_with_failures():
    """A case with failures is that of errors alone until the failure."""
    both = TWICE.replace("[study.vary]\n", '[study.vary]\n"craft.fails" = { chance = 1 }\n')
    one = plan_mission(case_of(parse(both, "both.toml"), 1))
    other = plan_mission(case_of(parse(TWICE, "both.toml"), 1))
    before = np.linspace(0.0, min(lost.time for lost in one.lost), 50)
    np.testing.assert_allclose(one.paths.state(before), other.paths.state(before), atol=1e-9)
    assert [lost.craft for lost in one.lost] == ["A"]  # B coasts all along
    assert "A loses its thrust" in str(one.verdict)


def test_chance_of_failure_is_validated():
    with pytest.raises(ScenarioError, match=re.escape("is true or false; write { chance = 0.01 }")):
        parse(FAILS.replace("{ chance = 0.5 }", '{ normal = "1 m" }'), "fails.toml")
