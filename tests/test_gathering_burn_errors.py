"""Gatherings with loss of thrust and execution errors, against an independent model."""

import numpy as np
import pytest
from scipy.special import ndtri

import closeform as cf
from bodies import Body
from closeform.campaign import case_of, evaluated
from closeform.campaign.mission_cases import MissionCampaign
from closeform.campaign.search_cases import GatherCampaign
from closeform.mission.mission import plan_mission
from closeform.report.sections import searches
from closeform.scenario import parse
from closeform.search.gathering.burn_errors import BurnErrors
from closeform.search.gathering.gather import gather, gather_with_burn_errors
from closeform.search.gathering.problem import gathering_problem
from closeform.search.gathering.result import EventKind, GatherStatus
from lost import BASIC, Sky, gathered, with_kernel
from philox import block
from studies import LOST
from turns import turns

RATE, TIP = np.radians(0.25), np.radians(25.0)
NAMES = ("P", "Q", "R", "S", "T", "U")
GROUPS = ("A", "B", "A", "B", "A", "B")
NARROW = LOST.replace("70 deg", "25 deg").replace("180 m", "2 km").replace('max_speed = "30 cm/s"', "")
FAILING = LOST + '"craft.fails" = { chance = 0.4 }\n'
WIDE = NARROW + '"craft.fails" = { chance = 0.5 }\n'
DRAWN = """\
"craft.pointing_error" = { normal = "2 deg" }
"craft.slew_rate_error" = { normal = "1 %" }
"craft.start_offset" = { normal = "60 s" }
"craft.slew_acceleration" = { choice = ["0.001 deg/s^2", "0.02 deg/s^2"] }
"craft.silent" = { chance = 0.03 }
"sensor.half_angle" = { uniform = "2 deg" }
"sensor.range" = { uniform = "20 m" }
"""
ARRAY = """
[[stage]]
do = "reconfigure"
to = { line = { spacing = "75 m", direction = [1, 0, 0] } }
within = "1 h"
"""


def off_by(execution):
    """Return a study whose burns have execution errors."""
    text = LOST.replace("[sensor]", f"execution = {execution}\n[sensor]")
    return text.replace("seed = 5", 'seed = 5\ndraws = "replanned"')


OFF = off_by('{ impulse = { speed = "0.2 mm/s", magnitude = "2 %", pointing = "1 deg" } }')
SOMETIMES = '"craft.fails" = { chance = 0.4 }\n'


def burn_errors_of(case):
    """Return the burn errors of a case of OFF by Gates' model."""

    def off(k, b, dv):
        along, *aside = ndtri(block(5, f"stage 1 of {NAMES[k]}", case, b))[:3]
        size = np.linalg.norm(dv)
        ahead = dv / size
        least = np.flatnonzero(np.abs(ahead) < np.abs(ahead).min() + 1e-9)[0]
        one = np.cross(ahead, np.eye(3)[least])
        one /= np.linalg.norm(one)
        turned = np.radians(1.0) * size * (aside[0] * one + aside[1] * np.cross(ahead, one))
        return np.hypot(2e-4, 0.02 * size) * along * ahead + turned

    return off


def sky_of(scenario):
    speed = scenario.search.max_speed
    return Sky(BASIC, TIP, RATE, 2, scenario.plan.near_field / speed if speed else 0.0)


def modelled(sky, sensor, states, push):
    """Return the model's results for each way of the first pair."""
    return {
        way: gathered(sky, sensor, states[:, :3], states[:, 3:], GROUPS, way, push)
        for way in ("second", "first", "half")
    }


def chosen(model):
    """Return the cheapest way of those that leave the fewest spacecraft."""
    left = {way: 6 - len(one.sets[0]) if one.sets else 6 for way, one in model.items()}
    few = [way for way in model if left[way] == min(left.values())]
    spent = {way: model[way].delta_v.sum() for way in few}
    return next(way for way in few if spent[way] <= min(spent.values()) * (1.0 + 1e-12))


def assert_agree(found, model):
    """Compare a gathering with the model's, with locks to a microsecond."""
    assert [(e.kind, e.first, e.second, e.case) for e in found.events] == [row[1:5] for row in model.events]
    times = [row[0] for row in model.events]
    np.testing.assert_allclose([e.time for e in found.events], times, rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(found.delta_v, model.delta_v, atol=1e-10)
    assert set(found.adrift) == model.adrift
    assert (found.status is not GatherStatus.INCOMPLETE) == model.ok
    assert found.ok == (model.ok and not model.adrift)
    np.testing.assert_allclose(found.paths.position(found.duration), model.positions, atol=1e-5)
    np.testing.assert_allclose(found.paths.velocity(found.duration), model.velocities, atol=1e-10)


@pytest.mark.parametrize("text", [FAILING, pytest.param(WIDE, marks=pytest.mark.slow)], ids=["near", "wide"])
def test_failed_spacecraft_keep_coasting(text):
    """Each case agrees with the model, whose failures come from NumPy's Philox generator."""
    scenario, chance = parse(text), 0.4 if text is FAILING else 0.5
    campaign, sky, push = evaluated(scenario), sky_of(scenario), 0.6 if text is FAILING else 0.0
    assert isinstance(campaign, GatherCampaign)
    sensor, seen = scenario.plan.sensor, set()
    some = {0, 1, 2, int(np.argmax(campaign.column("adrift")))}
    for case in range(24) if text is WIDE else sorted(some):
        mission = plan_mission(case_of(scenario, case))
        states = mission.scenario.states(mission.orbit)
        exact = modelled(sky, sensor, states, push)
        way = chosen(exact)
        drawn = np.array([block(5, "craft.fails", 6 * case + k) for k in range(6)])
        times = np.where(drawn[:, 0] < chance, drawn[:, 1] * exact[way].duration, np.inf)
        model = gathered(sky, sensor, states[:, :3], states[:, 3:], GROUPS, way, push, fails=times)
        found = mission.results[0].result
        assert found.burns == way
        assert_agree(found, model)
        # the row of the study agrees with the run
        rows = {one.craft: one.time for one in mission.lost}
        for k, name in enumerate(NAMES):
            expected = times[k] if times[k] <= model.duration else np.nan
            assert campaign.column(f"{name}_fails_s")[case] == pytest.approx(expected, abs=1e-5, nan_ok=True)
            assert rows.get(name, np.nan) == pytest.approx(
                campaign.column(f"{name}_fails_s")[case], rel=0.0, abs=0.0, nan_ok=True
            )
        assert campaign.column("adrift")[case] == len(found.adrift)
        assert campaign.delta_v[case] == pytest.approx(found.delta_v.sum(), rel=1e-15)
        if model.ok:
            assert campaign.time[case] == found.duration
        else:
            assert np.isnan(campaign.time[case])
        assert campaign.good[case] == found.ok == mission.verdict.ok
        assert {one.craft for one in mission.lost if one.needed} == {NAMES[k] for k in found.adrift}
        seen |= {("adrift", bool(model.adrift)), ("ok", model.ok)}
        if (first := next((e for e in found.events if e.kind == "lock"), None)) is not None:
            seen.add(("first pair", tuple(bool(times[k] <= first.time) for k in (first.first, first.second))))
    assert {("adrift", True), ("adrift", False), ("ok", text is WIDE)} <= seen
    if text is WIDE:
        assert {("first pair", (True, False)), ("first pair", (False, True))} <= seen


def test_study_of_failures_is_independent_of_chunks():
    scenario = parse(FAILING)
    kind = evaluated(scenario).kind
    whole = kind.evaluate(0, 24)
    for parts in ((0, 24), (0, 7, 8, 24)):
        some = [kind.evaluate(first, last) for first, last in zip(parts, parts[1:], strict=False)]
        for name, column in whole.items():
            np.testing.assert_array_equal(np.concatenate([part[name] for part in some]), column)
    assert "without craft adrift" in evaluated(scenario).reason


def bodies_of(scenario):
    """Return independently turning bodies with the errors of a case."""
    speed, plan = scenario.search.max_speed, scenario.plan
    wait = plan.near_field / speed if speed else 0.0
    turned = (turns("basic", plan.sensor.half_angle, TIP) + 2 * [("NFS", "wait", 0.0, wait)] * bool(wait)) * 2
    errors = {
        name: np.array(getattr(scenario.astray, name))
        for name in ("pointing", "slew_rate", "start", "half_angle", "range", "slew_acceleration", "silent")
    }
    return [
        Body(turned, group, **{name: one[k] for name, one in errors.items()})
        for k, group in enumerate(GROUPS)
    ]


@pytest.mark.parametrize(
    ("text", "erring"),
    [
        pytest.param(FAILING, False, marks=pytest.mark.slow),
        pytest.param(WIDE, False, marks=pytest.mark.slow),
        (OFF + SOMETIMES, True),
    ],
    ids=["near", "wide", "off"],
)
def test_failures_with_search_errors(text, erring):
    """Search errors, loss of thrust and, in one case, burn errors agree with the model."""
    text = text.replace("180 m", "500 m").replace("rounds = 2", 'rounds = 2\nburns = "half"')
    text = text.replace(
        'sun_limit = "25 deg"', 'tip_angle = "25 deg"\nsun_limit = "60 deg"'
    )  # respected with all pointing errors
    scenario = parse(text + DRAWN)
    cases = 8
    campaign, sky, seen = evaluated(scenario, cases), sky_of(scenario), set()
    assert isinstance(campaign, MissionCampaign if erring else GatherCampaign)
    for case in range(cases):
        mission = plan_mission(case_of(scenario, case))
        states, bodies = mission.scenario.states(mission.orbit), bodies_of(mission.scenario)
        push, off = 2.0 * (scenario.search.max_speed or 0.0), burn_errors_of(case) if erring else None
        given = sky, scenario.plan.sensor, states[:, :3], states[:, 3:], GROUPS
        without = gathered(*given, "half", push, bodies, off=off)
        drawn = np.array([block(5, "craft.fails", 6 * case + k) for k in range(6)])
        chance = scenario.study.vary["craft.fails"].chance
        times = np.where(drawn[:, 0] < chance, drawn[:, 1] * without.duration, np.inf)
        model = gathered(*given, "half", push, bodies, times, off)
        found = mission.results[0].result
        assert_agree(found, model)
        rows = {one.craft: one.time for one in mission.lost}
        for k, name in enumerate(NAMES):
            at = campaign.column(f"{name}_fails_s")[case]
            expected = times[k] if times[k] <= model.duration else np.nan
            assert at == pytest.approx(expected, abs=1e-5, nan_ok=True)
            np.testing.assert_array_equal(rows.get(name, np.nan), at)
        end = campaign.column("end_s")[case] if erring else campaign.time[case]
        np.testing.assert_array_equal(end, found.duration if model.ok else np.nan)
        spent = campaign.column("delta_v_m_s")[case] if erring else campaign.delta_v[case]
        assert spent == pytest.approx(found.delta_v.sum(), rel=1e-15)
        assert campaign.good[case] == mission.verdict.ok == found.ok
        seen |= {("adrift", bool(model.adrift)), ("ok", model.ok)}
    assert {("adrift", True), ("adrift", False), ("ok", True)} <= seen


def test_burn_errors_follow_gates_model():
    """Burn errors and their consequences agree with the model."""
    scenario = parse(OFF)
    campaign = evaluated(scenario, 10)
    assert isinstance(campaign, MissionCampaign)
    burns, sky = 0, sky_of(scenario)
    for case in range(10):
        mission = plan_mission(case_of(scenario, case))
        result = mission.results[0]

        off = burn_errors_of(case)
        states = mission.scenario.states(mission.orbit)
        way = chosen(modelled(sky, scenario.plan.sensor, states, 0.6))
        model = gathered(sky, scenario.plan.sensor, states[:, :3], states[:, 3:], GROUPS, way, 0.6, off=off)
        assert_agree(result.result, model)
        burns += sum(event.kind != "lock" for event in result.result.events)
        inside = sorted(model.sets[0])
        left = np.linalg.norm(model.velocities[inside] - model.velocities[inside].mean(axis=0), axis=1)
        np.testing.assert_allclose(result.result.residual_speeds[inside], left, atol=1e-12)
        assert left.max() > 1e-4
        planned = result.commanded.paths
        end = min(result.end, result.commanded.end)
        coasted = planned.position(end) + (result.end - end) * planned.velocity(end)
        apart = np.linalg.norm(result.after.paths.position(result.end) - coasted, axis=-1).max()
        assert campaign.column("stage_1_off_m")[case] == pytest.approx(apart, rel=1e-9)
        assert apart > 0.01
        assert campaign.column("delta_v_m_s")[case] == mission.delta_v.sum()
        assert (
            campaign.column("end_s")[case] == result.end
            if model.ok
            else np.isnan(campaign.column("end_s")[case])
        )
    assert burns > 50


def test_failures_with_burn_errors():
    """A case with failures is that without until the first; failed spacecraft do not burn."""
    text = off_by('{ magnitude = "2 %", pointing = "1 deg" }')
    both = parse(text + '"craft.fails" = { chance = 0.5 }\n')
    checked = 0
    for case in range(6):
        one, other = plan_mission(case_of(both, case)), plan_mission(case_of(parse(text), case))
        events = one.results[0].result.events
        if one.lost:
            before = min(lost.time for lost in one.lost)
            some = [(e.time, e.kind, e.first, tuple(e.delta_v)) for e in events if e.time < before]
            rest = other.results[0].result.events
            assert some == [(e.time, e.kind, e.first, tuple(e.delta_v)) for e in rest if e.time < before]
        for lost in one.lost:
            k = NAMES.index(lost.craft)
            assert not [e for e in events if e.kind != "lock" and e.first == k and e.time >= lost.time]
            checked += 1
    assert checked > 6


def test_number_of_random_numbers_does_not_matter():
    """Burns do not depend on how many random numbers are sampled at a time."""
    scenario = parse(LOST)
    case = case_of(scenario, 1)
    states = case.states(case.orbit.build())
    problem = gathering_problem(case.plan, shape=(1, 6), **case.gathering(case.stages[0]))
    normals = np.random.default_rng(1).normal(size=(1, 6, 64, 3))
    asked = []

    def numbers(burns):
        asked.append(burns)
        return normals[:, :, :burns]

    errors = BurnErrors(np.full((1, 6), np.inf), np.tile([0.0, 0.05, 0.0, 0.05], (6, 1)), numbers)
    where, speeds = states[None, :, :3].copy(), states[None, :, 3:].copy()
    few, many = (
        problem.simulate(where, speeds, ["first"], burn_errors=errors, room=48, sampled=count)
        for count in (1, 64)
    )
    for one, other in zip(few, many, strict=True):
        np.testing.assert_array_equal(one, other)
    assert asked[0] == 1 < asked[1] < 64 == asked[-1]


def corrected_pair(errors):
    """Return a gathering in which two of a set, 60 m apart, approach a sphere of 30 m."""
    search = cf.Search.basic(cf.Sensor(np.radians(70.0), 0.0, 1e4), RATE, TIP)
    states = with_kernel([[0, 0, 0], [60.0, 0, 0]], [[0, 0, 0], [-0.1, 0, 0]])
    model = {"groups": ("A", "B", "A", "B"), "keep_out": cf.Sphere(30.0), "rounds": 1, "max_speed": None}
    model |= {"burns": "second", "errors": None}
    return gather_with_burn_errors(gather(search, *states, **model), search, *states, errors, **model)


def test_another_spacecraft_corrects_after_a_failure():
    """The other spacecraft corrects if one has failed; both collide if both have."""
    for failing, corrects in (((), (3,)), ((3,), (2,)), ((2,), (3,)), ((2, 3), ())):
        fails = np.full((1, 4), np.inf)
        fails[0, failing] = 0.0
        found = corrected_pair(BurnErrors.of_losses(fails))
        burns = [event for event in found.events if event.kind is EventKind.CORRECTION]
        assert tuple(event.first for event in burns) == corrects
        assert [np.linalg.norm(event.delta_v) for event in burns] == pytest.approx(
            [0.05] * len(burns), rel=1e-8
        )
        assert len(found.conflicts) == (not burns)


def test_corrections_have_burn_errors():
    """A correction that is too long passes outside of the zone, one that is too short enters it."""
    for size in (1.0, -1.0):
        normals = np.zeros((1, 4, 64, 3))
        normals[..., 0] = size
        gates, never = np.tile([0.0, 0.02, 0.0, 0.0], (4, 1)), np.full((1, 4), np.inf)
        errors = BurnErrors(never, gates, lambda burns, normals=normals: normals[:, :, :burns])
        found = corrected_pair(errors)
        (burn,) = [event for event in found.events if event.kind is EventKind.CORRECTION]
        assert np.linalg.norm(burn.delta_v) == pytest.approx(0.05 * (1.0 + 0.02 * size), rel=1e-8)
        assert len(found.conflicts) == (size < 0.0)


def test_mission_continues_after_failures():
    """Failed spacecraft drift in straight lines through later stages."""
    text = FAILING.replace("\n[study]", f"{ARRAY}\n[study]").replace("chance = 0.4", "chance = 0.3")
    text = text.replace("180 m", "2 km")
    text = text.replace("[sensor]", 'keep_out = { sphere = "5 m" }\n\n[sensor]')
    scenario = parse(text)
    campaign = evaluated(scenario, 10)
    assert isinstance(campaign, MissionCampaign)
    drifted = 0
    for case in range(10):
        mission = plan_mission(case_of(scenario, case))
        assert campaign.statuses[case] == (
            "stopped" if mission.stopped else "met" if mission.verdict.ok else "unmet"
        )
        for name in NAMES:
            times = [one.time for one in mission.lost if one.craft == name]
            assert campaign.column(f"{name}_fails_s")[case] == pytest.approx(
                times[0] if times else np.nan, rel=0.0, abs=0.0, nan_ok=True
            )
        if mission.stopped is not None:
            continue
        for before, after in zip(mission.results, mission.results[1:], strict=False):
            ends = before.after.paths.state(before.end)
            np.testing.assert_allclose(after.after.paths.position(after.start), ends[:, :3], atol=1e-9)
        instants = np.linspace(0.0, mission.results[-1].end, 2001)
        for one in mission.lost:
            k = NAMES.index(one.craft)
            begin = mission.paths[k].state(one.time)
            later = instants[instants >= one.time]
            line = begin[:3] + (later - one.time)[:, None] * begin[3:]
            np.testing.assert_allclose(mission.paths[k].position(later), line, atol=1e-7)
            drifted += one.needed
            assert (
                one.needed
                or one.time > mission.results[1].start - 1e-9
                or k not in mission.results[0].result.adrift
            )
    assert drifted > 0


def test_zero_chance_of_failure_changes_nothing():
    """A chance of zero changes nothing."""
    none, some = parse(LOST + '"craft.fails" = { chance = 0 }\n'), parse(LOST)
    one, other = evaluated(none, 20), evaluated(some, 20)
    np.testing.assert_array_equal(one.time, other.time)
    np.testing.assert_array_equal(one.delta_v, other.delta_v)
    assert (one.column("adrift") == 0).all()
    assert one.good.tolist() == other.good.tolist()


def test_report_of_burns_of_the_first_pair():
    """Both burn half of their relative velocity, or one burns all of it."""
    scenario = parse(WIDE.replace("rounds = 2", 'rounds = 2\nburns = "half"'))
    seen = set()
    for case in range(12):
        mission = plan_mission(case_of(scenario, case))
        (result,) = mission.results
        first = next((e for e in result.result.events if e.kind is EventKind.LOCK), None)
        if first is None:
            continue
        states = mission.scenario.states(mission.orbit)
        apart = np.linalg.norm(states[first.first, 3:] - states[first.second, 3:])
        table = searches.timeline(result.result, NAMES)
        for _, _, kind, pair, _, _, _, _, what, size, _ in table.rows:
            if kind == "burn" and pair[0] in (NAMES[first.first], NAMES[first.second]):
                assert size == pytest.approx(
                    apart if what == "burn, nulls its relative velocity" else 0.5 * apart
                )
                seen.add(what)
            elif kind == "burn":
                assert what == "burn, nulls its relative velocity"
        ((*_, model),) = [row for row in searches.ways(result)[0].rows if row[2]]
        assert model == "planned"  # costs are those of exact burns
    assert seen == {"burn, nulls its relative velocity", "burn, nulls half of the relative velocity"}
