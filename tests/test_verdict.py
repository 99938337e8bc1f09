"""Verdicts: conflicts and limits of thrust, delta-v and propellant, in output, summary, page and Python."""

import json
import re
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import closeform as cf
from bridge import hill
from closeform.campaign import case_of
from closeform.cli.app import main
from closeform.mission.mission import plan_mission
from closeform.mission.verdict import Use, Verdict, conflicts_in
from closeform.report.run import RunReport
from closeform.scenario import parse
from runs import outputs
from studies import LIMITED

pytestmark = pytest.mark.usefixtures("undrawn")

G0 = 9.80665
REST = 'velocity = "0 0 0 m/s"'
TWO = """\
closeform = 1
title = "A passes B"

[orbit]
deep_space = true

[craft]
name = ["A", "B"]
position = ["0 -100 3 m", "0 0 0 m"]
velocity = "0 0 0 m/s"
mass = "100 kg"
keep_out = { sphere = "20 m" }
LIMITS

[[stage]]
do = "avoid"
craft = "A"
to = { position = "0 100 3 m", velocity = "0 0 0 m/s" }
within = "1000 s"
"""
CLEAR = TWO.replace(" 3 m", " 25 m")  # by 5 m, on the direct path
# Rest to rest over 200 m in 1000 s: thrust falls from 6 L / T^2 to its opposite, by which 3 L / 2 T are
# gained up to the middle, and lost again.
PEAK, SPENT = 6.0 * 200.0 / 1000.0**2, 3.0 * 200.0 / 1000.0


def passing(limits: str, stage: str = "", text: str = TWO) -> str:
    return text.replace("LIMITS", limits) + stage


@pytest.mark.parametrize(
    ("limits", "words", "what", "unit"),
    [
        ('delta_v_budget = "0.3 m/s"', "delta-v (A)", "delta-v", "m/s"),
        ('specific_impulse = "60 s"\npropellant = "50 g"', "propellant (A)", "propellant", "kg"),
    ],
)
def test_plan_beyond_budget_and_propellant(
    limits: str, words: str, what: str, unit: str, tmp_path, monkeypatch, capsys
) -> None:
    """Clear but beyond a limit: status 1, and spacecraft and limit are named."""
    status, printed, summary, page = outputs(passing(limits, text=CLEAR), tmp_path, monkeypatch, capsys)
    assert status == 1
    last = printed.splitlines()[-1]
    assert last == f"limits are not kept: {words}; results in file-results"
    assert f'<p class="verdict bad">limits are not kept: {words}</p>' in page
    assert summary["verdict"] == f"limits are not kept: {words}"
    assert (summary["status"], summary["clear"], summary["limits_kept"]) == (1, True, False)
    assert (summary["conflicts"], summary["pairs_in_conflict"]) == (0, 0)
    (over,) = summary["exceeded"]
    assert (over["craft"], over["what"], over["unit"]) == ("A", what, unit)
    need = SPENT if unit == "m/s" else 100.0 * -np.expm1(-SPENT / (60.0 * G0))
    assert over["used"] == pytest.approx(need, rel=1e-9)
    mission = plan_mission(parse(passing(limits, text=CLEAR)))
    assert mission.clear
    assert not mission.verdict.ok
    assert mission.verdict.status == 1
    assert [use.craft for use in mission.verdict.exceeded] == ["A"]


def test_kept_limits_are_reported(tmp_path, monkeypatch, capsys) -> None:
    limits = 'max_thrust = "1 N"\ndelta_v_budget = "1 m/s"\nspecific_impulse = "60 s"\npropellant = "1 kg"'
    status, printed, summary, _ = outputs(passing(limits), tmp_path, monkeypatch, capsys)
    assert status == 0
    assert "clear: no conflict remains, limits are kept, closest distance" in printed
    assert summary["limits_kept"] is True
    status, printed, summary, _ = outputs(passing(""), tmp_path, monkeypatch, capsys)
    assert status == 0
    assert "clear: no conflict remains, closest distance" in printed
    assert summary["limits_kept"] is None


FELLOW = """meanwhile = [{ craft = "B", to = { position = "0 0 500 m", velocity = "0 0 0 m/s" } }]\n"""


def test_other_spacecraft_beyond_its_thrust_limit(tmp_path, monkeypatch, capsys) -> None:
    """B's own transfer over 500 m needs 6 L / T^2."""
    status, printed, summary, _ = outputs(
        passing('max_thrust = "0.2 N"', FELLOW), tmp_path, monkeypatch, capsys
    )
    assert status == 1
    assert printed.splitlines()[-1] == "limits are not kept: thrust (B); results in file-results"
    (over,) = summary["exceeded"]
    assert over["used"] == pytest.approx(100.0 * 6.0 * 500.0 / 1000.0**2, rel=1e-9)
    told = re.search(
        r"^Transfers of other craft\n.*\nB +(\S+) +(\S+) +(\S+)$", re.sub(" +\n", "\n", printed), re.MULTILINE
    )
    assert float(told[3]) == pytest.approx(over["used"], rel=1e-5)


def test_stopped_mission_reports_an_exceeded_budget() -> None:
    """Stages executed before the stop count."""
    stage = passing('delta_v_budget = "0.3 m/s"') + TWO[TWO.index("\n[[stage]]") :].replace(
        "0 100 3", "0 5 3"
    )
    mission = plan_mission(parse(stage))
    assert mission.stopped is not None
    words = str(mission.verdict)
    assert words.startswith("stopped in stage 2 (avoid): ")
    assert words.endswith("; limits are not kept: delta-v (A)")
    assert mission.verdict.status == 1


def test_many_exceeded_limits_are_counted() -> None:
    uses = [Use("thrust", "N", f"F{k}", 2.0, 1.0) for k in range(40)]
    verdict = Verdict(None, 0, 0, (*uses, Use("delta-v", "m/s", "F1", 2.0, 1.0)), False)
    assert str(verdict) == "limits are not kept: thrust (F0, F1, F2, 37 more), delta-v (F1)"


def test_repeated_conflicts_of_a_pair() -> None:
    """B oscillates cross-track through A's zone twice an orbit."""
    text = """\
closeform = 1
title = "Swings"
[orbit]
period = "6000 s"
[craft]
name = ["A", "B", "C"]
start = [{ palmer = "0 0 0 0 0 0 m" }, { palmer = "0 0 0 0 200 0 m" }, { palmer = "0 0 0 500 0 0 m" }]
keep_out = { sphere = "20 m" }
[[stage]]
do = "coast"
for = "1500 s"
[[stage]]
do = "coast"
for = "12000 s"
"""
    mission = plan_mission(parse(text))
    # z = 200 m cos(n t) is within 20 m of A around 1500, 4500, 7500, 10500 and 13500 s; the stages' edge at
    # 1500 s cuts the first in two, which counts as one conflict
    assert [len(result.after.conflicts) for result in mission.results] == [1, 5]
    assert conflicts_in(result.after for result in mission.results) == (5, 1)
    assert str(mission.verdict) == "5 conflicts of 1 pair remain"
    after = RunReport(mission).summary["stages"][1]["after"]
    assert (len(after["conflicts"]), after["pairs_in_conflict"]) == (5, 1)


def test_conflicts_of_a_coast_are_summed_up() -> None:
    """All 45 pairs of ten spacecraft meet four times: 180 conflicts, a row for each pair."""
    names = ", ".join(f'"C{k}"' for k in range(10))
    swings = ", ".join(f'{{ palmer = "0 0 0 0 {200 + 100 * k} 0 m" }}' for k in range(10))
    text = f"""\
closeform = 1
title = "Swings"
[orbit]
period = "6000 s"
[craft]
name = [{names}]
start = [{swings}]
keep_out = {{ sphere = "20 m" }}
[[stage]]
do = "coast"
for = "12000 s"
"""
    report = RunReport(plan_mission(parse(text)))
    assert str(report.mission.verdict) == "180 conflicts of 45 pairs remain"
    (section,) = report.sections
    assert section.lines[0].startswith("Conflicts: 180 in 45 of 45 pairs; ")
    assert [(len(table.rows), table.folded) for table in section.tables] == [
        (40, False),
        (180, True),
        (45, True),
    ]
    assert section.tables[0].title == "Conflicts, by pair, the 40 closest of 45"


# avoid within a thrust limit

DEEP = cf.Orbit(0.0)
BEFORE, BEHIND = [0, -100, 3, 0, 0, 0], [0, 100, 3, 0, 0, 0]
PATH = DEEP.transfer(BEFORE, BEHIND, 1000.0)
BALL = cf.Sphere(20.0)
LONG = DEEP.coast(np.zeros(6), 1e5)


@pytest.mark.parametrize(("n", "method"), [(0.0, "exact"), (1.1e-3, "exact"), (1.1e-3, "sauter-palmer")])
def test_avoid_extends_the_duration_to_keep_a_thrust_limit(n: float, method) -> None:
    """By an integrator, the final state is reached, and zone and thrust limit are kept."""
    orbit = cf.Orbit(n)
    path, rock = orbit.transfer(BEFORE, BEHIND, 1000.0), orbit.coast(np.zeros(6), 1e5)
    free = cf.avoid(path, rock, BALL, method)
    limit = 0.8 * free.path.peak_thrust
    kept = cf.avoid(path, rock, BALL, method, max_acceleration=limit)
    assert kept.ok
    times = np.linspace(0.0, kept.path.end, 4001)
    assert np.linalg.norm(kept.path.thrust(times), axis=1).max() <= limit * (1.0 + 1e-9)
    assert kept.path.end > 1000.0
    assert kept.measures == (
        f"longer, {kept.path.end / 1000.0:.6g} times the duration: the thrust limit is kept",
    )

    def motion(t: float, s: np.ndarray) -> np.ndarray:
        return hill(n) @ s + np.concatenate([np.zeros(3), kept.path.thrust(min(t, kept.path.end))])

    flown = solve_ivp(
        motion, times[[0, -1]], BEFORE, t_eval=times, rtol=1e-10, atol=1e-9, method="DOP853"
    ).y.T
    np.testing.assert_allclose(flown[-1], BEHIND, atol=1e-5)  # m, of the integration of 200 m
    assert np.linalg.norm(flown[:, :3], axis=1).min() > 20.0 * (1.0 - 1e-6)
    # 1.12 times as long is enough for 0.8 of the thrust, as it falls as 1 / T^2; sides may differ
    assert kept.path.end < 1.25 * 1000.0


def test_inactive_limit_changes_nothing() -> None:
    free = cf.avoid(PATH, LONG, BALL)
    kept = cf.avoid(PATH, LONG, BALL, max_acceleration=free.path.peak_thrust)
    assert kept.path.end == PATH.end
    assert kept.energy == free.energy
    assert kept.measures == ()


def test_clear_path_beyond_the_limit() -> None:
    """Rest to rest in deep space keeps the limit from a duration of sqrt(6 L / limit) on."""
    far = DEEP.coast([500.0, 0, 0, 0, 0, 0], 1e5)
    limit = 0.5 * PEAK
    kept = cf.avoid(PATH, far, BALL, max_acceleration=limit)
    least = np.sqrt(6.0 * 200.0 / limit)
    assert kept.ok
    assert least * (1.0 - 1e-9) <= kept.path.end <= 1.02 * least  # found to one halving of the last stretch
    impulses = DEEP.two_impulse(BEFORE, BEHIND, 1000.0)  # clear and no energy, but of infinite thrust
    assert np.array_equal(cf.avoid(impulses, far, BALL).path.arcs, impulses.arcs)
    smooth = cf.avoid(impulses, far, BALL, max_acceleration=1.01 * PEAK)
    assert smooth.path.impulses == ()
    assert smooth.path.end == 1000.0


@pytest.mark.parametrize(
    ("obstacle", "arguments", "remedy"),
    [
        (
            DEEP.coast(np.zeros(6), 1000.0),
            {},
            "give more time, with obstacles and an orbit that are known beyond 1000 s",
        ),
        (DEEP.coast(np.zeros(6), 1050.0), {}, "raise the limit"),  # within the known path of the obstacle
        (LONG, {"longer": False}, "allow longer, or give more time"),
    ],
)
def test_avoid_reports_an_infeasible_limit(obstacle: cf.Path, arguments: dict, remedy: str) -> None:
    limit = 0.8 * PEAK
    weak = cf.avoid(PATH, obstacle, BALL, max_acceleration=limit, **arguments)
    assert weak.status == cf.Status.TOO_WEAK
    assert not weak.ok
    assert weak.path is None
    assert np.isnan([weak.energy, weak.extra_energy, weak.delta_v]).all()
    assert weak.weak.limit == limit
    assert weak.weak.needed > limit
    first = cf.avoid(PATH, LONG, BALL).path.peak_thrust
    longest = (
        f"no longer duration is tried, and 1000 s require {first:.4g} m/s²: "
        if remedy == "raise the limit"
        else ""
    )
    assert weak.reason == (
        f"path needs {weak.weak.needed:.4g} m/s² in {weak.weak.duration:.6g} s, "
        f"its limit is {limit:.4g} m/s²; {longest}{remedy}"
    )
    assert weak.weak.duration == pytest.approx(1050.0 if remedy == "raise the limit" else 1000.0)


# in scenarios, with limits in newtons

MOVE = """
[[stage]]
do = "reconfigure"
craft = ["A"]
to = [{{ position = "{}", velocity = "0 0 0 m/s" }}]
within = "1000 s"
"""
FORCE = 0.1  # N, of the 0.12 that the direct path needs


def test_stage_reports_its_extended_duration(tmp_path, monkeypatch, capsys) -> None:
    text = passing(f'max_thrust = "{FORCE} N"', FELLOW.replace("500 m", "-20 m"))
    status, printed, summary, page = outputs(text, tmp_path, monkeypatch, capsys)
    assert status == 1  # as it is later than asked
    change = summary["stages"][0]["change"]
    assert change["around"]["peak_thrust_N"] <= FORCE * (1.0 + 1e-9)
    took = summary["stages"][0]["end_s"]
    assert took > 1000.0
    assert change["asked_s"] == 1000.0
    assert f"Tried: {change['measures'][0]}" in printed
    assert f"Warning: stage 1 (avoid) takes {took:.1f} s, not 1000.0 s; max_thrust of " in printed
    # B, which arrived before, is kept clear of where it then is
    assert summary["stages"][0]["after"]["closest"]["ratio"] >= 1.0
    assert "mm/s²" not in printed
    assert "mm/s²" not in page
    assert re.search(r"peak thrust \[N\]", printed)


def test_coasting_spacecraft_reaches_its_natural_end() -> None:
    """Without `to`: the way around ends where the craft would be by then, had it not burned."""
    text = passing('max_thrust = "0.03 N"').replace(
        'to = { position = "0 100 3 m", velocity = "0 0 0 m/s" }\n', ""
    )
    text = text.replace(REST, 'velocity = ["0 20 0 cm/s", "0 0 0 m/s"]')
    mission = plan_mission(parse(text))
    assert mission.verdict.clear
    (stage,) = mission.results
    assert stage.end > 1000.0
    end = stage.after.paths[0].state(stage.end)
    np.testing.assert_allclose(end, [0, -100 + 0.2 * stage.end, 3, 0, 0.2, 0], atol=1e-6)
    assert 100.0 * stage.after.paths[0].peak_thrust <= 0.03 * (1.0 + 1e-9)


@pytest.mark.parametrize(
    "stage",
    [
        TWO[TWO.index("[[stage]]") :] + "longer = false\n",
        MOVE.format("0 100 3 m") + "if_blocked = []\n",
    ],
    ids=["avoid", "reconfigure"],
)
def test_weak_engine_is_reported_in_newtons(stage: str, tmp_path, monkeypatch, capsys) -> None:
    text = passing(f'max_thrust = "{FORCE} N"', stage, TWO[: TWO.index("[[stage]]")])
    status, printed, summary, page = outputs(text, tmp_path, monkeypatch, capsys)
    assert status == 1
    for words in (" ".join(printed.split()), page, summary["verdict"]):
        need, limit = re.search(r"A needs (\S+) N in 1000 s, its max_thrust is (\S+) N; ", words).groups()
        assert 100.0 * PEAK < float(need) < 110.0 * PEAK
        assert float(limit) == FORCE
        assert "m/s² in" not in words
    key = "change" if "avoid" in stage else "plan"
    assert "m/s²" not in summary["stages"][0][key]["reason"]


# propellant of specific impulse alone

ENGINE = 'specific_impulse = "60 s"'


def test_propellant_of_every_stage_that_thrusts(tmp_path, monkeypatch, capsys) -> None:
    """By the rocket equation from the delta-v that is printed beside it, with the mass that is left."""
    text = passing(ENGINE, FELLOW.replace("500 m", "-50 m") + MOVE.format("0 -100 3 m"))
    status, printed, summary, _ = outputs(text, tmp_path, monkeypatch, capsys)
    assert status == 0
    assert printed.count("propellant [g]") == 4  # change made, meanwhile, paths of the plan, in all
    mass = 100.0
    for cost in (
        summary["stages"][0]["change"]["around"],
        summary["stages"][1]["plan"]["craft"]["A"]["planned"],
    ):
        burnt = -mass * np.expm1(-cost["delta_v_m_s"] / (60.0 * G0))
        assert cost["propellant_kg"] == pytest.approx(burnt, rel=1e-12)
        assert f" {1e3 * burnt:.2f}" in printed
        mass -= burnt
    assert summary["propellant_kg"]["A"] == pytest.approx(100.0 - mass, rel=1e-12)


# studies: the share of cases whose run has status 0


def test_propellant_of_a_gathering(tmp_path, monkeypatch, capsys) -> None:
    """Of each craft that burns and of all, by the rocket equation from its delta-v."""
    monkeypatch.chdir(tmp_path)
    Path("lost.toml").write_text(LIMITED)
    main(["run", "lost.toml", "--case", "0", "--out", "out"])
    printed = capsys.readouterr().out
    (gathering,) = json.loads(Path("out/summary.json").read_text())["stages"]
    rows = dict.fromkeys(("L1", "L2", "L3", "all"), 0.0)
    for name, delta_v in gathering["gathering"]["delta_v_m_s"].items():
        rows[name] = -1e5 * np.expm1(-delta_v / (60.0 * G0))  # g
        rows["all"] += rows[name]
    table = printed.split("Delta-v of each craft")[1].split("\n\n")[0]
    assert "propellant [g]" in table
    assert rows["all"] > 1.0
    for name, burnt in rows.items():
        (line,) = [one for one in table.splitlines() if one.startswith(f"{name} ")]
        assert float(line.split()[-1]) == pytest.approx(burnt, abs=6e-3)  # printed to a hundredth


@pytest.mark.parametrize("stage", ["gather", "lock"])
def test_case_and_run_have_the_same_verdict(stage: str, tmp_path, monkeypatch, capsys) -> None:
    """Each case is as clear and within its limits as its run."""
    monkeypatch.chdir(tmp_path)
    text = LIMITED.replace('do = "gather"', f'do = "{stage}"')
    Path("lost.toml").write_text(text)
    campaign = cf.study("lost.toml")
    scenario = parse(text, "lost.toml")
    alone = [plan_mission(case_of(scenario, case)).verdict for case in range(len(campaign))]
    np.testing.assert_array_equal(campaign.good, [one.ok for one in alone])
    np.testing.assert_array_equal(campaign.kept["clear"], [not one.conflicts for one in alone])
    limits = {"delta-v", "propellant"} if stage == "gather" else set()  # nothing burns in a lock
    assert campaign.kept.keys() == {"clear"} | limits
    for what in limits:
        over = [any(use.what == what for use in one.exceeded) for one in alone]
        np.testing.assert_array_equal(campaign.kept[what], ~np.array(over))
    for kept in campaign.kept.values():
        assert 0.1 < kept.mean() < 0.95  # each of them matters
    assert not campaign.ok
    assert main(["study", "lost.toml"]) == 1
    printed = capsys.readouterr().out
    share = 100.0 * np.mean([one.ok for one in alone])
    assert re.search(rf"^all requirements +{campaign.good.sum()} +{share:.3f} ", printed, re.MULTILINE)
    summary = json.loads(Path("lost-study/summary.json").read_text())
    assert summary["status"] == 1
    assert summary["asked"]["all requirements"]["cases"] == campaign.good.sum()
    assert summary["verdict"] == campaign.reason
    for what in ("clear", *(["within delta_v_budget", "within propellant"] if limits else [])):
        assert f"of 120 cases not {what}: " in campaign.reason
    assert f"run lost.toml --case {np.argmin(campaign.good)} shows the first" in printed
    page = unescape(Path("lost-study/report.html").read_text())
    assert ">Requirements</h3>" in page
    assert '<p class="verdict bad">' in page


# plots of thrust


def test_search_for_longer_times_ends_at_ten_orbits() -> None:
    """However weak the engine: what it would need in the ten orbits that were tried last."""
    orbit = cf.Orbit(1.1e-3)
    path, rock = orbit.transfer(BEFORE, BEHIND, 1000.0), orbit.coast(np.zeros(6), 1e9)
    weak = cf.avoid(path, rock, BALL, max_acceleration=1e-12)
    assert weak.status == cf.Status.TOO_WEAK
    assert weak.weak.duration == pytest.approx(10.0 * orbit.period)
    direct = orbit.transfer(BEFORE, BEHIND, weak.weak.duration)
    assert weak.weak.needed == pytest.approx(direct.peak_thrust)
