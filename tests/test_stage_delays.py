"""Stages that take longer than required: verdict, delay and sufficient thrust."""

import re

import numpy as np
import pytest

import closeform as cf
from closeform.mission.mission import plan_mission
from closeform.mission.verdict import Late, Use, Verdict, raised
from closeform.report.run import RunReport
from closeform.scenario import parse
from runs import outputs

INSPECTOR = """\
closeform = 1
title = "An inspector goes around"

[orbit]
altitude = "500 km"

[craft]
name = ["chief", "insp"]
position = ["0 0 0 m", "0 -300 0 m"]
velocity = "0 0 0 m/s"
mass = "12 kg"
max_thrust = "THRUST"
keep_out = { sphere = "20 m" }
"""
AROUND = """
[[stage]]
do = "avoid"
craft = "insp"
to = { position = "0 300 0 m", velocity = "0 0 0 m/s" }
within = "0.4 orbits"
"""
TOGETHER = """
[[stage]]
do = "reconfigure"
craft = ["insp"]
to = { safety_ellipse = { radial = "50 m", cross_track = "50 m" } }
within = "0.4 orbits"
"""
SPREAD = """
[[stage]]
do = "scatter"
factor = 3.0
within = "0.1 orbits"
"""
ASKED = 0.4 * cf.Orbit.circular(500e3).period


def scenario(*stages: str, thrust: str = "1 mN") -> str:
    return INSPECTOR.replace("THRUST", thrust) + "".join(stages)


@pytest.mark.parametrize("stage", [AROUND, TOGETHER, SPREAD], ids=["avoid", "reconfigure", "scatter"])
def test_late_stage_is_not_clear(stage: str, tmp_path, monkeypatch, capsys) -> None:
    """Status 1; the reported thrust keeps the time, and less does not."""
    status, printed, summary, page = outputs(scenario(stage), tmp_path, monkeypatch, capsys)
    assert status == summary["status"] == 1
    assert summary["clear"] is True
    (late,) = summary["late"]
    (flown,) = summary["stages"]
    assert late["took_s"] == pytest.approx(flown["end_s"], rel=1e-12)
    verb = flown["do"]
    by = f"{late['took_s'] - late['asked_s']:.1f} s"
    begin = f"later than requested: stage 1 ({verb}) by {by}, avoidable with "
    verdict = summary["verdict"]
    assert verdict.startswith(begin)
    assert f'<p class="verdict bad">{verdict}</p>' in page
    assert verdict in " ".join(printed.split())
    needed = {name: float(force) for force, name in re.findall(r"([0-9.]+) N \((\w+)\)", verdict)}
    assert needed == pytest.approx(late["keeping_N"], rel=1e-3)
    assert summary["warnings"][0].endswith(' would avoid the delay; see "Tried"')
    for factor, kept in ((1.0, True), (0.998, False)):
        force = [f'"{factor * needed.get(name, 1.0)!r} N"' for name in ("chief", "insp")]
        mission = plan_mission(parse(scenario(stage).replace('"1 mN"', f"[{', '.join(force)}]")))
        assert (mission.results[0].end == pytest.approx(late["asked_s"], rel=1e-9)) is kept
        assert mission.verdict.ok is kept


def test_several_late_stages_and_spacecraft() -> None:
    uses = tuple(Use("thrust", "N", f"F{k}", 0.12341, 0.1) for k in range(5))
    late = Late(1, "avoid", 100.0, 150.0, uses), Late(3, "scatter", 200.0, 250.05)
    assert str(Verdict(None, 1, 1, (), False, late)) == (
        "1 conflict remains; later than requested: stage 1 (avoid) by 50.0 s, avoidable with 0.1235 N (F0), "
        "0.1235 N (F1), 0.1235 N (F2), 2 more, stage 3 (scatter) by 50.1 s"
    )
    assert Verdict(None, 0, 0, (), False, late).status == 1
    assert [raised(number) for number in (0.12340001, 12345.0, 3e-7)] == ["0.1235", "1.235e+04", "3e-07"]


@pytest.mark.parametrize("stage", [AROUND, TOGETHER], ids=["avoid", "reconfigure"])
@pytest.mark.parametrize("place", ["orbit", "deep space"])
def test_search_for_longer_times_is_bounded(place: str, stage: str) -> None:
    """The search ends at ten orbits, or a hundred times as long in deep space."""
    text = scenario(stage, thrust="0.00005 mN")
    if place == "deep space":
        text = text.replace('altitude = "500 km"', "deep_space = true").replace("0.4 orbits", "2000 s")
        text = re.sub(r"to = \{ safety.*", 'to = [{ position = "0 300 0 m", velocity = "0 0 0 m/s" }]', text)
    mission = plan_mission(parse(text))
    assert mission.verdict.status == 1
    asked = 2000.0 if place == "deep space" else ASKED
    most = 100.0 * asked if place == "deep space" else ASKED / 0.04
    found = re.search(
        r"insp needs (\S+) N in (\S+) s, its max_thrust is 5e-08 N; "
        r"no longer duration is tried, and (\S+) s require (\S+) N: raise the limit$",
        mission.stopped,
    )
    last, longest, shortest, first = map(float, found.groups())
    assert (longest, shortest) == pytest.approx((most, asked), rel=1e-4)
    direct = mission.results[0].before.paths[1]
    assert first >= 12.0 * direct.peak_thrust * (1 - 1e-3)
    again = cf.Orbit(mission.orbit.mean_motion).transfer(direct.state(0.0), direct.state(direct.end), most)
    assert last == pytest.approx(12.0 * again.peak_thrust, rel=1e-3)


def test_plan_reports_a_sufficient_thrust() -> None:
    deep, ball = cf.Orbit(0.0), cf.Sphere(20.0)
    path = deep.transfer([0, -100, 3, 0, 0, 0], [0, 100, 3, 0, 0, 0], 1000.0)
    rock = deep.coast(np.zeros(6), 1e5)
    free = cf.avoid(path, rock, ball)
    assert free.punctual is None
    kept = cf.avoid(path, rock, ball, max_acceleration=0.7 * free.path.peak_thrust)
    assert kept.path.end > 1000.0
    assert kept.punctual == pytest.approx(free.path.peak_thrust)
    starts, ends = np.zeros((2, 6)), np.zeros((2, 6))
    starts[:, 0], ends[:, 0], ends[:, 1] = [0, 100], [0, 100], [60, 90]
    free = cf.reconfigure(deep, starts, ends, 100.0, ball)
    assert free.punctual is None
    kept = cf.reconfigure(deep, starts, ends, 100.0, ball, max_acceleration=0.03)
    assert kept.durations.max() > 100.0
    np.testing.assert_allclose(kept.punctual, free.paths.peak_thrust)
    lacks = int(np.argmax(kept.punctual))
    one = cf.reconfigure(
        deep, starts, ends, 100.0, ball, max_acceleration=np.where(np.arange(2) == lacks, 0.03, np.inf)
    )
    np.testing.assert_allclose(one.punctual, free.paths.peak_thrust)  # also of who has no limit
    weak = cf.reconfigure(deep, starts, ends, 100.0, ball, max_acceleration=0.03, if_blocked=()).weak
    assert (weak.shortest, weak.first) == (weak.duration, weak.needed)


# comparisons of plans that a thrust limit made longer


def test_cost_comparison_uses_equal_times() -> None:
    """Once the direct path is clear, and once it is blocked."""
    straight = scenario(AROUND, thrust="5 mN").replace('altitude = "500 km"', "deep_space = true")
    straight = straight.replace("0.4 orbits", f"{ASKED!r} s").replace("-300 0 m", "-300 3 m")
    for text, contacts in ((scenario(AROUND), False), (straight, True)):
        mission = plan_mission(parse(text))
        (flown,), (section,) = mission.results, RunReport(mission).sections
        moved = flown.result
        assert bool(moved.plan.contacts) is contacts
        took = flown.end - flown.start
        table = next(table for table in section.tables if table.title == "Change made")
        names = [row[0] for row in table.texts]
        assert names == ["direct", "direct, longer"] + ["avoidance", "change"] * contacts
        assert [row[1] for row in table.texts[:2]] == [f"{ASKED:.1f}", f"{took:.1f}"]
        assert table.shown[1].heading == "lasts [s]"
        again = mission.orbit.transfer(moved.direct.state(0.0), moved.direct.state(moved.direct.end), took)
        if contacts:
            change = moved.plan.path.delta_v / again.delta_v - 1.0
            assert table.texts[-1][3] == f"{100.0 * change:+.3f} %"
            assert section.closing[1].endswith(f" beyond the free optimum over {took:.1f} s")
        else:
            assert section.closing[0] == f"Method exact: the direct path over {took:.1f} s is clear"
        longer = section.figures["change"]["direct_longer"]
        assert longer["energy_m2_s3"] == pytest.approx(again.energy, rel=1e-9)
    punctual = RunReport(plan_mission(parse(scenario(AROUND, thrust="1 N")))).sections[0]
    assert "lasts [s]" not in [column.heading for column in punctual.tables[0].shown]
    assert punctual.figures["change"]["direct_longer"] is None
