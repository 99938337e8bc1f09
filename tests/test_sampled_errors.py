"""Cases with sampled errors: burns by integration, starts by their covariance."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ndtri

from bridge import hill
from closeform.campaign import case_of, evaluated
from closeform.campaign.mission_cases import MissionCases
from closeform.mission.executed_mission import History
from closeform.mission.mission import plan_mission
from closeform.report.sections import uncertain
from closeform.scenario import parse
from philox import block
from studies import NEAR, TWICE

IMPULSES = TWICE.replace('max_thrust = "1 N"\n', "")


@pytest.fixture(scope="module")
def scenario():
    return parse(TWICE, "twice.toml")


def random_numbers(seed, key, case, count):
    """Return numbers of NumPy's generator: block `case` of an event's stream."""
    found = [block(seed, key, case, event) for event in range((count + 3) // 4)]
    return ndtri(np.concatenate(found))[:count]


def test_burn_errors_agree_with_integration(scenario):
    """Burns with sampled errors agree with an integration of Hill's equations."""
    case = 2
    mission = plan_mission(case_of(scenario, case))
    for result, burns in ((mission.results[0], 2), (mission.results[2], 1)):
        plan, path = result.commanded.path("A"), result.after.path("A")
        sizes = random_numbers(3, f"stage {result.number} of A", case, 4 * burns).reshape(burns, 4)
        thrusting = np.abs(plan.arcs[:, 12:]).any(axis=1)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], thrusting, [False]]))).reshape(-1, 2)
        assert len(edges) == burns
        state = plan.state(result.start)
        for arc in range(len(plan.arcs)):
            begin, end = plan.arcs[arc, :2]
            on = [k for k, (first, last) in enumerate(edges) if first <= arc < last]
            grown, turn = np.eye(3), np.zeros(3)
            if on:
                grown = (1.0 + 0.01 * sizes[on[0], 0]) * np.eye(3)
                turn = np.radians(0.5) * sizes[on[0], 1:]

            def slope(t, y, on=on, grown=grown, turn=turn, begin=begin, end=end, plan=plan):
                rate = hill(plan.orbit.mean_motion) @ y
                if on:
                    inside = begin + (end - begin) * (1e-12 + (1.0 - 2e-12) * (t - begin) / (end - begin))
                    thrust = plan.thrust(inside)
                    rate[3:] += grown @ thrust + np.cross(turn, thrust)
                return rate

            state = solve_ivp(slope, (begin, end), state, rtol=1e-10, atol=1e-10, method="DOP853").y[:, -1]
        found = path.state(result.end)
        assert np.linalg.norm(found - plan.state(result.end)) > 1.0  # metres, of which 10 um count:
        assert np.abs(found - state)[:3].max() < 1e-5
        np.testing.assert_array_equal(result.after.path("B").arcs, result.commanded.path("B").arcs)


def test_stages_are_planned_from_the_deviated_state(scenario):
    mission = plan_mission(case_of(scenario, 4))
    for before, after in zip(mission.results, mission.results[1:], strict=False):
        np.testing.assert_array_equal(
            after.commanded.paths.state(after.start), before.after.paths.state(before.end)
        )
    ends = [mission.results[k].commanded.path("A").position(mission.results[k].end) for k in (0, 2)]
    assert np.abs(ends - np.array([[0.0, 200.0, 0.0], [0.0, -200.0, 0.0]])).max() < 1e-6
    assert "with the errors of this case" in str(mission.verdict)


def test_impulse_errors_follow_gates_model(scenario):
    """The error along an impulse is relative, and those across are angles."""
    mission = plan_mission(case_of(parse(IMPULSES, "impulses.toml"), 1))
    result = mission.results[0]
    plan, path = result.commanded.path("A"), result.after.path("A")
    sizes = random_numbers(3, "stage 1 of A", 1, 3 * len(plan.impulses)).reshape(-1, 3)
    for (time, jump), (same, real), size in zip(plan.impulses, path.impulses, sizes, strict=True):
        assert time == same
        ahead = jump / np.linalg.norm(jump)
        off = (real - jump) / np.linalg.norm(jump)
        assert off @ ahead == pytest.approx(0.01 * size[0], abs=1e-12)
        across = np.linalg.norm(off - (off @ ahead) * ahead)
        assert across == pytest.approx(np.radians(0.5) * np.hypot(*size[1:]), abs=1e-12)


def test_starts_have_the_covariance(scenario):
    """The sample covariance of 4000 starts agrees within five standard errors."""
    starts = np.array([History(3, case, "replanned").starts(scenario.craft[0]) for case in range(4000)])
    scaled = starts / np.array([1.0, 2.0, 1.0, 1e-3, 1e-3, 1e-3])
    assert np.abs(scaled.T @ scaled / 4000 - np.eye(6)).max() < 5.0 * np.sqrt(2.0 / 4000)
    mission = plan_mission(case_of(scenario, 5))
    nominal = np.array([0.0, -200.0, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(
        mission.results[0].after.path("A").state(0.0) - nominal,
        History(3, 5, "replanned").starts(scenario.craft[0]),
        atol=1e-12,
    )
    alone = parse(TWICE.replace('"A", "B"', '"A", "Z"'), "twice.toml")
    np.testing.assert_array_equal(
        plan_mission(case_of(alone, 5)).results[0].after.path("A").state(0.0),
        mission.results[0].after.path("A").state(0.0),
    )


def test_rows_have_the_final_deviations(scenario):
    campaign = evaluated(scenario)
    assert "stage 3, avoid, deviation [m]" in campaign.spreads
    for case in (0, 5):
        mission = plan_mission(case_of(scenario, case))
        for result in mission.results:
            apart = result.after.paths.position(result.end) - result.commanded.paths.position(result.end)
            told = campaign.column(f"stage_{result.number}_off_m")[case]
            assert told == pytest.approx(np.linalg.norm(apart, axis=1).max(), rel=1e-12)
        assert campaign.column("delta_v_m_s")[case] == pytest.approx(mission.delta_v.sum(), rel=1e-14)
    assert (campaign.column("stage_1_off_m") > 0.1).all()
    assert (campaign.column("stage_2_off_m") == 0.0).all()
    parts = [MissionCases(scenario, 3).evaluate(first, first + 2) for first in (0, 2, 4)]
    for name in ("delta_v_m_s", "stage_3_off_m", "reason"):
        np.testing.assert_array_equal(np.concatenate([part[name] for part in parts]), campaign.column(name))


def test_study_agrees_with_runs_of_cases():
    """Entries of 40 cases agree with runs of each case."""
    text = NEAR.replace('sphere = "25 m"', 'sphere = "31 m"').replace('"1 2 1 m"', '"6 9 6 m"')
    scenario = parse(text, "near.toml")
    campaign = evaluated(scenario, 3000)
    inside = campaign.counts["zone"]
    assert inside.any >= 20
    entered = campaign.zones[0]
    some = [*np.flatnonzero(entered.inside)[:20].tolist(), *range(20)]
    for case in some:
        mission = plan_mission(case_of(scenario, case))
        conflicts = mission.verdict.conflicts
        assert conflicts == entered.entries[case] + entered.began[case]
        assert mission.paths.state(0.0).shape == (2, 6)  # stages follow each other without a jump


def test_exact_stages_have_no_probabilities():
    """A coast of exact states has no sigmas and no probabilities."""
    bodies = 'hard_body = "2 m"\nkeep_out = { sphere = "20 m" }\n'
    text = TWICE.replace('keep_out = { sphere = "25 m" }\n', bodies)
    text = text.replace('for = "1 min"', 'for = "1 min"\nsigmas = 3.0')
    mission = plan_mission(case_of(parse(text, "bodies.toml"), 1))
    burns, coast, again = (result.uncertain for result in mission.results)
    assert burns.bodies.pairs
    assert again.zones.pairs
    assert coast.bodies.pairs == coast.zones.pairs == ()
    assert [one.met for one in coast.asked] == [True]
    assert "clear at 3 sigma (nothing is uncertain)" in str(mission.verdict)
    assert uncertain.lines(coast) == (
        "No pair of craft with a keep-out zone has an uncertain relative state",
    )
    assert uncertain.tables(coast) == ()
