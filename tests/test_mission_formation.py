"""Formation stages in missions against an integrator, Kepler motion and brute force."""

import re
from itertools import combinations, permutations
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import closeform as cf
from bridge import hill
from closeform.mission.mission import plan_mission
from closeform.report.run import RunReport
from closeform.scenario import ScenarioError, load, parse
from resimulated import faults
from runs import Run, run_text

pytestmark = pytest.mark.usefixtures("unpainted")

EXAMPLES = Path(__file__).parents[1] / "examples"
MILLIMETRE = 1e-3
N = np.sqrt(398600.4418e9 / 6878137.0**3)  # rad/s at 500 km, Kepler
TURN = 2 * np.pi / N

FLEET = """\
closeform = 1
title = "A fleet"

[orbit]
altitude = "500 km"

[craft]
name = ["F1", "F2", "F3", "F4"]
start = { string_of_pearls = { spacing = "100 m" } }
mass = "100 kg"
keep_out = { sphere = "20 m" }
"""


def fleet(*stages: str, text: str = FLEET, **changes: str) -> str:
    for key, new in changes.items():
        assert len(re.findall(rf"^{key} = .*$", text, re.MULTILINE)) == 1
        text = re.sub(rf"^{key} = .*$", f"{key} = {new}", text, flags=re.MULTILINE)
    return text + "".join(f"\n[[stage]]\n{stage}\n" for stage in stages)


def coasted(states: np.ndarray, time: float, n: float = N) -> np.ndarray:
    """Return states after natural motion, by a matrix exponential."""
    return states @ expm(hill(n) * time).T


def begin(flown) -> np.ndarray:
    return flown.after.paths.state(flown.start)


def end(flown) -> np.ndarray:
    return flown.after.paths.state(flown.end)


def check_plan(mission, flown, finals: np.ndarray, **asked) -> None:
    """Integrate the plan of a stage in which all spacecraft move, and check its ends."""
    assert flown.result.plan.ok
    zones = list(mission.scenario.keep_out)
    limits = np.array([craft.max_acceleration for craft in mission.scenario.craft])
    if np.isfinite(limits).any():
        asked["max_acceleration"] = limits
    found = faults(
        flown.result.plan,
        mission.orbit,
        begin(flown),
        finals,
        flown.result.asked,
        zones,
        start=flown.start,
        **asked,
    )
    assert found == []


@pytest.fixture(scope="module")
def f6():
    return plan_mission(load(EXAMPLES / "f6_scatter.toml"))


def test_f6_scatters_and_regathers(f6) -> None:
    """Eight spacecraft on a projected circle of 150 m return to the same relative orbits."""
    assert f6.clear
    assert f6.warnings == ()
    start = begin(f6.results[0])
    np.testing.assert_allclose(np.hypot(start[:, 1], start[:, 2]), 150.0, rtol=1e-12)
    np.testing.assert_allclose(start[:, 0], start[:, 2] / 2, atol=1e-9)
    angles = np.unwrap(np.arctan2(start[:, 2], start[:, 1]))
    np.testing.assert_allclose(np.abs(np.diff(angles)), np.pi / 4, rtol=1e-12)
    first, threat, wait, back = f6.results
    np.testing.assert_allclose(
        [flown.end - flown.start for flown in f6.results], np.array([0.5, 0.25, 2, 1]) * TURN
    )
    for one, other in ((first, threat), (threat, wait), (wait, back)):
        assert one.end == other.start
        np.testing.assert_allclose(end(one), begin(other), atol=1e-9)  # m, rounding of some 100 m
    spread = [
        [np.linalg.norm(states[i, :3] - states[j, :3]) for i, j in combinations(range(8), 2)]
        for states in (begin(threat), end(threat))
    ]
    shares = np.divide(*spread[::-1])
    assert shares.min() == pytest.approx(3.0, abs=1e-9)  # the minimum over all pairs
    home = coasted(begin(threat), back.end - threat.start)
    np.testing.assert_allclose(end(back)[:, :3], home[:, :3], atol=MILLIMETRE)
    np.testing.assert_allclose(end(back)[:, 3:], home[:, 3:], atol=MILLIMETRE * N)
    check_plan(f6, threat, end(threat))
    check_plan(f6, back, home)
    peak = max(flown.after.paths.peak_thrust.max() for flown in f6.results)
    assert 150.0 * peak <= 1.5  # N


def check_cost_table(run: Run, number: int, name: str) -> None:
    """Compare each printed cost with the summary and the table of spacecraft."""
    plan = run.summary["stages"][number - 1]["plan"]
    chapter = run.printed.split(f"Stage {number}")[1].split("Stage ")[0]
    assert name in chapter
    head, *rows = chapter.split("Paths of the plan")[1].strip().splitlines()
    rows = [row.split() for row in rows[: len(plan["craft"]) + 1]]
    assert [row[0] for row in rows] == [*plan["craft"], "all"]
    flown = {row["craft"]: row for row in run.table("craft") if row["stage"] == number}
    last = {"energy [m²/s³]": "energy_m2_s3", "delta-v [m/s]": "delta_v_m_s"}
    assert [title for title in last if title not in head] == []
    columns = [title for title in re.split(r"\s{2,}", head.strip()) if title != "craft"]
    assert ("extra [%]" in columns) == (plan["gap"] > 0.0)
    for craft, *figures in rows[:-1]:
        for title, figure in zip(columns, figures, strict=True):
            kind, key, unit = {
                "slot": ("slot", None, 1),
                "from [s]": ("start_s", None, 1),
                "to [s]": ("end_s", None, 1),
                "extra [%]": ("extra", None, 1),
                "energy [m²/s³]": ("planned", "energy_m2_s3", 1),
                "delta-v [m/s]": ("planned", "delta_v_m_s", 1),
                "peak [mm/s²]": ("planned", "peak_thrust_m_s2", 1e3),
                "peak [N]": ("planned", "peak_thrust_N", 1),
                "propellant [g]": ("propellant_kg", None, 1e3),
            }[title]
            if kind == "propellant_kg":
                truth = flown[craft][kind]
            elif kind == "extra":
                one, free = (plan["craft"][craft][way]["energy_m2_s3"] for way in ("planned", "direct"))
                assert float(figure) == pytest.approx(100.0 * (one / free - 1.0), abs=6e-4)
                continue
            else:
                truth = plan["craft"][craft][kind]
                truth = truth if key is None else truth[key]
                if kind == "planned":
                    assert flown[craft][key] == pytest.approx(truth, rel=1e-12)
            # six digits, tenths of a second, hundredths of a gram
            assert float(figure) == pytest.approx(
                unit * truth, rel=6e-6, abs=0.051 if "[s]" in title else 6e-3
            )
            if "²" in title or "m/s" in title:
                assert float(figure) == pytest.approx(unit * truth, rel=6e-6)
    for title, figure in zip(columns, rows[-1][1:], strict=False):
        if title in last:
            assert float(figure) == pytest.approx(plan[last[title]], rel=6e-6)


def test_gather_then_reconfigure() -> None:
    """Five spacecraft of TPF gather and then form a row with 75 m spacing across the sun line."""
    mission = plan_mission(load(EXAMPLES / "find_then_fly.toml"))
    assert mission.clear
    assert mission.warnings == ()
    found, array, coast = mission.results
    alone = plan_mission(load(EXAMPLES / "tpf.toml")).results[0]
    np.testing.assert_array_equal(end(found), end(alone))
    assert array.start == found.end
    assert array.end == coast.start == pytest.approx(found.end + 3600.0, abs=1e-9)
    for flown, when in ((array, array.end), (coast, coast.end)):
        states = flown.after.paths.state(when)
        row = states[np.argsort(states[:, 0])]
        steps = np.tile([75.0, 0, 0, 0, 0, 0], (4, 1))
        np.testing.assert_allclose(np.diff(row, axis=0)[:, :3], steps[:, :3], atol=MILLIMETRE)
        np.testing.assert_allclose(np.diff(row, axis=0)[:, 3:], 0.0, atol=1e-9)  # m/s, rounding
    # It is centred where the centre of the five would coast to, and moves with it.
    middle = coasted(begin(array), 3600.0, 0.0).mean(axis=0)
    np.testing.assert_allclose(end(array).mean(axis=0), middle, atol=1e-6)
    # No paths conflict, so the slots have the least sum over all 120 permutations.
    slots = end(array)[np.argsort(array.result.plan.slots)]
    costs = [[straight(one, slot, 3600.0) for slot in slots] for one in begin(array)]
    totals = {way: sum(costs[k][slot] for k, slot in enumerate(way)) for way in permutations(range(5))}
    best = min(totals, key=totals.__getitem__)
    assert tuple(array.result.plan.slots) == best
    assert array.result.plan.energy == pytest.approx(totals[best], rel=1e-9)
    check_plan(mission, array, slots, assign=True)


def straight(one: np.ndarray, other: np.ndarray, time: float) -> float:
    """Return the energy of the optimal transfer in deep space, theory (2)."""
    gap, change = other[:3] - one[:3] - one[3:] * time, other[3:] - one[3:]
    return 0.5 * (12 * gap @ gap / time**3 - 12 * gap @ change / time**2 + 4 * change @ change / time)


def test_swap(tmp_path, monkeypatch, capsys) -> None:
    """Opposite spacecraft swap places; 52 of 66 direct pairs conflict, and none of the plan."""
    text = (EXAMPLES / "swap.toml").read_text()
    mission = plan_mission(parse(text))
    (flown,) = mission.results
    assert mission.clear
    assert mission.warnings == ()
    assert len({(met.first, met.second) for met in flown.before.conflicts}) == 52
    times = np.linspace(flown.start, flown.end, 1001)
    # Check the comment in the file; a spacecraft moves 0.4 m between two of these times.
    assert np.linalg.norm(flown.before.paths.position(times), axis=-1).min(axis=1).max() < 11.0
    # The final position is that to which the opposite spacecraft would coast.
    check_plan(mission, flown, np.roll(coasted(begin(flown), flown.end), 6, axis=0))
    plan = flown.result.plan
    assert plan.gap <= 0.03
    run = run_text(text, tmp_path, monkeypatch, capsys, pictures=True)
    assert run.status == 0
    assert "Conflicts of the direct paths: 52 of 66 pairs; " in run.printed
    check_cost_table(run, 1, "swap")
    told = run.summary["stages"][0]["plan"]
    assert len(told["touches"]) == len(plan.contacts) > 6
    assert f"{len(plan.contacts)} contacts, from " in run.printed
    assert f"Optimality gap of all craft: at most {100 * plan.gap:.3f} %" in run.printed
    pictures = {path.name for path in run.folder.glob("*.png")}
    names = "paths", "ratios-before", "ratios", "closest-pairs", "thrust"
    assert pictures == {f"stage-1-{name}.png" for name in names}
    page = (run.folder / "report.html").read_text()
    assert page.count("data:image/png;base64,") == len(pictures)
    assert page.split("Active constraints: contacts with keep-out zones</summary>")[1].split("</table>")[
        0
    ].count("<td class") == len(plan.contacts)


def test_use_of_limits(undrawn, tmp_path, monkeypatch, capsys) -> None:
    """Report the greatest share of each limit, of delta-v and propellant over all stages so far."""
    text = fleet(SPREAD, BACK).replace(
        'mass = "100 kg"',
        'mass = "100 kg"\nmax_thrust = "1 N"\nspecific_impulse = "70 s"\npropellant = "1 kg"\n'
        'delta_v_budget = ["9 m/s", "0.9 m/s", "9 m/s", "9 m/s"]',
    )
    mission = plan_mission(parse(text))
    run = run_text(text, tmp_path, monkeypatch, capsys)
    thrust = r"^Peak: thrust (\S+) of 1 N \((\S+)\)$"
    spent = r"^Highest use so far: delta-v (\S+) of 0.9 m/s \(F2\), propellant (\S+) of 1000 g \((\S+)\)$"
    peaks, totals = (re.findall(line, run.printed, re.MULTILINE) for line in (thrust, spent))
    delta_v, burnt = mission.delta_v.cumsum(axis=0), mission.propellant.cumsum(axis=0)
    for row, (flown, (peak, who), total) in enumerate(zip(mission.results, peaks, totals, strict=True)):
        left = 100.0 - (burnt[row - 1] if row else 0.0)
        force = dict(zip(mission.scenario.names, left * flown.after.paths.peak_thrust, strict=True))
        assert force[who] == pytest.approx(max(force.values()), rel=1e-9)  # two are equal
        assert float(peak) == pytest.approx(force[who], rel=5e-4)  # four digits
        assert delta_v[row].argmax() != 1  # F2 has the tightest budget, and spends less than others
        assert float(total[0]) == pytest.approx(delta_v[row, 1], rel=5e-4)
        assert float(total[1]) == pytest.approx(1e3 * burnt[row].max(), rel=5e-4)
        told = run.summary["stages"][row]["limits"]
        assert told["thrust_N"] == {"craft": who, "used": pytest.approx(force[who]), "limit": 1.0}
        assert told["delta_v_m_s"] == {"craft": "F2", "used": pytest.approx(delta_v[row, 1]), "limit": 0.9}
        assert told["propellant_kg"]["used"] == pytest.approx(burnt[row].max())


def test_swap_in_deep_space() -> None:
    """All 66 pairs meet in the centre on their direct paths, and none on the plan."""
    mission = plan_mission(load(EXAMPLES / "swap_deep_space.toml"))
    (flown,) = mission.results
    assert mission.clear
    assert len({(met.first, met.second) for met in flown.before.conflicts}) == 66
    start = begin(flown)
    np.testing.assert_allclose(np.linalg.norm(start[:, :3], axis=1), 120.0, rtol=1e-5)  # of the file's digits
    check_plan(mission, flown, -start)
    assert mission.propellant.sum(axis=0).max() < 0.2  # kg, what each has
    # Twelve points 15 m apart have a sum of squares about their centre of at least 10.704 x 15^2 m^2;
    # an impulse response at half time of T^3 / 192 gives 96 / T^3 of that over 12 x 6 x 240^2 / T^3.
    plan = flown.result.plan
    assert (
        96.0 * 10.704 * 15.0**2 / (12 * 6 * 240.0**2) - 1e-3
        < plan.extra_energy / plan.direct.energy.sum()
        < 0.08
    )


SPREAD = 'name = "spread"\ndo = "scatter"\nfactor = 2.0\nwithin = "0.5 orbits"'
BACK = 'do = "regather"\nas_before = "spread"\nwithin = "0.5 orbits"'


@pytest.mark.parametrize(
    ("text", "goal"),
    [
        ('to = { remove = "eccentricity" }', [0, 0, 5, 100, 0, 60]),
        ('to = { remove = "altitude difference" }', [50, -10, 0, 100, 0, 60]),
    ],
)
def test_removal_of_a_relative_element(text: str, goal: list[float]) -> None:
    """One relative element vanishes and the others stay: theory (5) at the end."""
    start = '[{ palmer = "50 -10 5 100 0 60 m" }, { palmer = "0 0 0 -400 0 0 m" }]'
    stage = f'do = "reconfigure"\ncraft = ["F1"]\n{text}\nwithin = "0.3 orbits"'
    mission = plan_mission(parse(fleet(stage, name='["F1", "F2"]', start=start)))
    (flown,) = mission.results
    e1, e2, d, along, h1, h2 = goal
    t = N * flown.end
    swing, phase = np.hypot(e1, e2), np.arctan2(e2, e1)
    height, tilt = np.hypot(h1, h2), np.arctan2(h2, h1)
    expected = [
        2 * d - swing * np.cos(t + phase),
        along - 3 * (5 * t) + 2 * swing * np.sin(t + phase),  # it drifts until the end
        height * np.cos(t - tilt),
    ]
    np.testing.assert_allclose(end(flown)[0, :3], expected, atol=MILLIMETRE)
    np.testing.assert_allclose(end(flown)[1], coasted(begin(flown)[1], flown.end), atol=1e-9)
    assert flown.result.movers == ("F1",)
    assert flown.result.others == ("F2",)


def test_join_a_coasting_ring() -> None:
    """F4 takes the free slot of a ring and keeps clear of F1, F2 and F3."""
    ring = '{ projected_circular = { radius = "120 m" } }'
    start = f'[{ring}, {ring}, {ring}, {{ palmer = "0 0 0 -300 0 0 m" }}]'
    stage = 'do = "reconfigure"\ncraft = ["F4"]\nto = { join = ["F1", "F2", "F3"] }\nwithin = "0.5 orbits"'
    mission = plan_mission(parse(fleet(stage, start=start)))
    (flown,) = mission.results
    assert mission.clear
    states = end(flown)
    np.testing.assert_allclose(states[:3], coasted(begin(flown)[:3], flown.end), atol=1e-9)
    assert np.hypot(states[3, 1], states[3, 2]) == pytest.approx(120.0, abs=MILLIMETRE)
    angles = np.degrees(np.arctan2(states[:, 2], states[:, 1]))
    # slots 1, 2 and 3 of four are a right angle apart; the fourth is free
    assert sorted((angles - angles[0]) % 360.0) == pytest.approx([0.0, 90.0, 180.0, 270.0], abs=0.01)
    assert [name for name in flown.after.names if flown.after.path(name).energy] == ["F4"]


def test_scatter_from_a_point_and_regather() -> None:
    stage = SPREAD.replace("factor = 2.0", 'from = "0 30 0 m"\ndistance = "300 m"')
    mission = plan_mission(parse(fleet(stage, BACK)))
    out, back = mission.results
    assert mission.clear
    away = np.linalg.norm(end(out)[:, :3] - [0.0, 30.0, 0.0], axis=1)
    assert away.min() == pytest.approx(300.0, abs=1e-6)
    home = coasted(begin(out), back.end)
    check_plan(mission, out, end(out))
    check_plan(mission, back, home)


def test_more_slots_than_craft() -> None:
    """Four spacecraft at rest take the four of seven slots where they already are."""
    stage = 'do = "reconfigure"\nto = { string_of_pearls = { spacing = "50 m" } }\nwithin = "1 orbit"'
    mission = plan_mission(parse(fleet(f"{stage}\nassign = true\nslots = 7")))
    (plan,) = [flown.result.plan for flown in mission.results]
    assert plan.slots.tolist() == [0, 2, 4, 6]
    assert plan.energy == pytest.approx(0.0, abs=1e-20)
    (costs,) = [
        table for table in RunReport(mission).sections[0].tables if table.title == "Paths of the plan"
    ]
    assert [row[1] for row in costs.texts] == ["1", "3", "5", "7", ""]


REVERSED = """\
do = "reconfigure"
within = "0.5 orbits"
to = [
  { position = "0 150 0 m", velocity = "0 0 0 m/s" },
  { position = "0 50 0 m", velocity = "0 0 0 m/s" },
  { position = "0 -50 0 m", velocity = "0 0 0 m/s" },
  { position = "0 -150 0 m", velocity = "0 0 0 m/s" },
]
"""


@pytest.mark.parametrize(
    ("plan", "how"), [("sequential", "one craft after another"), ("distributed", "by each craft on its own")]
)
def test_separate_planning_in_order(plan: str, how: str) -> None:
    """The first spacecraft takes its own optimum; joint planning costs no more."""
    joint = plan_mission(parse(fleet(REVERSED))).results[0].result.plan
    mission = plan_mission(parse(fleet(f'{REVERSED}plan = "{plan}"\norder = ["F3"]')))
    (flown,) = mission.results
    made = flown.result.plan
    assert mission.clear
    assert made.paths[2].energy == pytest.approx(made.direct[2].energy, rel=1e-9)
    assert made.energy >= joint.energy * (1 - 1e-9)
    assert how in "\n".join(RunReport(mission).sections[0].closing)


def weak(*stages: str, thrust: str = '"0.2 N"') -> str:
    return fleet(*stages).replace('mass = "100 kg"', f'mass = "100 kg"\nmax_thrust = {thrust}')


def test_low_thrust_extends_the_duration() -> None:
    """The four return late to the relative orbits that they had."""
    quick = SPREAD.replace("0.5 orbits", "0.05 orbits"), BACK.replace("0.5 orbits", "0.05 orbits")
    mission = plan_mission(parse(weak(*quick)))
    out, back = mission.results
    assert mission.clear
    late = [flown.end - flown.start for flown in mission.results]
    assert [
        f"takes {took:.1f} s, not 283.8 s" in line for took, line in zip(late, mission.warnings, strict=True)
    ] == [True, True]
    for flown in (out, back):
        assert flown.end - flown.start > 1.05 * flown.result.asked == pytest.approx(1.05 * 0.05 * TURN)
        assert flown.result.measures
        assert 100.0 * flown.after.paths.peak_thrust.max() <= 0.2 * (1 + 1e-9)
        # the duration is nearly minimal
        assert 100.0 * flown.after.paths.peak_thrust.max() >= 0.2 * 0.93
    np.testing.assert_allclose(end(back), coasted(begin(out), back.end), atol=MILLIMETRE)
    told = "\n".join(RunReport(mission).sections[0].lines)
    assert "Tried: " in told


def test_low_thrust_without_extension_stops_the_mission(undrawn, tmp_path, monkeypatch, capsys) -> None:
    quick = SPREAD.replace("0.5 orbits", "0.05 orbits")
    run = run_text(
        weak(f"{quick}\nif_blocked = []", 'do = "coast"\nfor = "1 min"'), tmp_path, monkeypatch, capsys
    )
    assert run.status == 1
    assert len(run.summary["stages"]) == 1
    assert run.summary["stages"][0]["plan"]["status"] == "thrust limit exceeded"
    verdict = run.summary["verdict"]
    assert verdict.startswith("stopped in stage 1 (scatter): thrust limit exceeded: ")
    assert re.search(r"\bF[1-4]\b", verdict)
    assert not re.search(r"craft \d", verdict)
    assert re.search(r"^Required by the direct paths: thrust [0-9.]+ of 0.2 N \(F[14]\)$", run.printed, re.M)
    assert run.summary["warnings"] == []  # they are not used


def test_end_inside_a_zone_is_rejected_by_name(undrawn, tmp_path, monkeypatch, capsys) -> None:
    """F4 coasts at 150 m; F1 requests 140 m, at half the keep-out radius."""
    stage = 'do = "reconfigure"\ncraft = ["F1"]\nwithin = "1 h"\n'
    stage += 'to = [{ position = "0 140 0 m", velocity = "0 0 0 m/s" }]'
    run = run_text(fleet(stage), tmp_path, monkeypatch, capsys)
    assert run.status == 1
    plan = run.summary["stages"][0]["plan"]
    assert plan["status"] == "start or end inside a zone"
    assert sorted(plan["blocked"]) == ["F1", "F4"]
    for part in ("F1", "F4", "0.50"):
        assert part in run.summary["verdict"]
    assert "Planned jointly, without success: these are the direct paths" in run.printed
    assert run.printed.count("0.50 x zone") == 1  # in the verdict only


def test_propellant_and_its_warnings(undrawn, tmp_path, monkeypatch, capsys) -> None:
    """Integrate the mass flow -F/(g Isp) of every stage; F2 has too little propellant."""
    text = fleet(SPREAD, BACK).replace(
        'mass = "100 kg"',
        'mass = "100 kg"\nspecific_impulse = "70 s"\npropellant = ["1 kg", "1 g", "1 kg", "1 kg"]\n'
        'delta_v_budget = ["1 cm/s", "10 m/s", "10 m/s", "10 m/s"]',
    )
    mission = plan_mission(parse(text))
    spent = np.zeros(2)
    for k in range(2):
        mass = 100.0
        for flown in mission.results:
            path = flown.after.paths[k]

            def flow(t, m, path=path):
                return -m * np.linalg.norm(path.thrust(t[None] if np.ndim(t) else t)) / (9.80665 * 70.0)

            mass = solve_ivp(flow, (flown.start, flown.end), [mass], rtol=1e-8, max_step=50.0).y[0, -1]
        spent[k] = 100.0 - mass
    np.testing.assert_allclose(mission.propellant.sum(axis=0)[:2], spent, rtol=1e-4)
    run = run_text(text, tmp_path, monkeypatch, capsys)
    assert run.status == 1
    assert run.summary["verdict"] == "limits are not kept: delta-v (F1), propellant (F2)"
    assert list(run.summary["propellant_kg"].values())[:2] == pytest.approx(spent, rel=1e-4)
    assert run.summary["warnings"] == list(mission.warnings)
    over, empty = mission.warnings
    assert re.fullmatch(r"F1 needs [0-9.]+ m/s, its delta_v_budget is 0.01 m/s", over)
    assert re.fullmatch(r"F2 needs [0-9.]+ g of propellant, it has 1 g", empty)
    assert over in run.printed
    check_cost_table(run, 1, "spread")
    assert "propellant [g]" in run.printed


@pytest.mark.parametrize(
    ("formation", "function", "sizes"),
    [
        (
            'projected_circular = { radius = "1 km", first_phase = "90 deg" }',
            "projected_circular",
            (1e3, np.pi / 2),
        ),
        (
            'safety_ellipse = { radial = "9 km", cross_track = "7 km", along_track = "1 m", phase = "1 rad"}',
            "safety_ellipse",
            (9e3, 7e3, 1.0, 1.0),
        ),
        ('string_of_pearls = { spacing = "70 m" }', "string_of_pearls", (70.0,)),
        ('pendulum = { spacing = "70 m", cross_track = "30 m" }', "pendulum", (70.0, 30.0)),
        (
            'ring = { eccentricity = "100 m", inclination = "-90 m", first_phase = "180 deg" }',
            "separated_ring",
            (100.0, -90.0, np.pi),
        ),
    ],
)
def test_formation_keywords(formation: str, function: str, sizes: tuple[float, ...]) -> None:
    """Starts and targets equal the functions of `targets`."""
    from closeform.planning import targets

    stage = f'do = "reconfigure"\nto = {{ {formation} }}\nwithin = "1 orbit"'
    scenario = parse(fleet(stage, start=f"{{ {formation} }}"))
    orbit = scenario.orbit.build()
    expected = getattr(targets, function)(orbit, 4, *sizes)
    np.testing.assert_array_equal([craft.state(orbit) for craft in scenario.craft], expected)
    np.testing.assert_array_equal(scenario.stages[0].known(orbit, 4), expected)


def test_line_moves_with_the_centre_of_its_spacecraft() -> None:
    """A line in deep space moves to where the centre would coast."""
    text = FLEET.replace('altitude = "500 km"', "deep_space = true")
    text = text.replace(
        'start = { string_of_pearls = { spacing = "100 m" } }',
        'position = ["0 0 0 m", "0 100 0 m", "100 0 0 m", "0 0 100 m"]\nvelocity = "1 2 3 cm/s"',
    )
    stage = (
        'do = "reconfigure"\nto = { line = { spacing = "60 m", direction = [0, 3, 4] } }\nwithin = "1000 s"'
    )
    (flown,) = plan_mission(parse(fleet(stage, text=text))).results
    middle = np.array([25.0, 25.0, 25.0]) + 1000.0 * np.array([0.01, 0.02, 0.03])
    offsets = 60.0 * np.outer([-1.5, -0.5, 0.5, 1.5], [0.0, 0.6, 0.8])
    np.testing.assert_allclose(end(flown)[:, :3], middle + offsets, atol=1e-9)
    np.testing.assert_allclose(end(flown)[:, 3:], [[0.01, 0.02, 0.03]] * 4, atol=1e-12)


def test_stage_equals_reconfigure() -> None:
    (flown,) = plan_mission(parse(fleet(REVERSED))).results
    orbit = cf.Orbit.circular(500e3)
    initial = np.zeros((4, 6))
    initial[:, 1] = [-150.0, -50.0, 50.0, 150.0]
    plan = cf.reconfigure(orbit, initial, -initial, 0.5 * orbit.period, cf.Sphere(20.0))
    assert flown.result.plan.energy == pytest.approx(plan.energy, rel=1e-9)


CAGED = """\
closeform = 1
title = "One craft in a cage"

[orbit]
deep_space = true

[craft]
name = ["A", "W1", "W2", "W3", "W4"]
position = ["0 0 0 m", "35 35 35 m", "35 -35 -35 m", "-35 35 -35 m", "-35 -35 35 m"]
velocity = "0 0 0 m/s"
keep_out = { sphere = "59 m" }

[[stage]]
do = "reconfigure"
craft = ["A"]
to = [{ position = "300 0 0 m", velocity = "0 0 0 m/s" }]
within = "1000 s"
if_blocked = ["stagger", "more sides"]
"""


@pytest.mark.slow
def test_missing_plan_names_the_obstacle_and_the_measures(undrawn, tmp_path, monkeypatch, capsys) -> None:
    """Four obstacles 60.6 m away with 59 m zones leave no gap."""
    run = run_text(CAGED, tmp_path, monkeypatch, capsys)
    assert run.status == 1
    plan = run.summary["stages"][0]["plan"]
    assert not plan["ok"]
    assert plan["status"] == "no clear path found"
    assert plan["blocked"][0] == "A"
    assert re.fullmatch("W[1-4]", plan["blocked"][1])
    assert plan["energy_m2_s3"] is None
    words = [re.match("[a-z ]+", measure)[0] for measure in plan["measures"]]
    assert list(dict.fromkeys(words)) == ["stagger", "more sides"]  # in the order of the file
    said = " ".join([run.summary["verdict"], *plan["measures"]])
    assert plan["blocked"][1] in run.summary["verdict"]
    assert "obstacle" not in said
    assert run.printed.count("Tried: ") == len(plan["measures"])


def test_engine_too_weak_for_any_duration(undrawn, tmp_path, monkeypatch, capsys) -> None:
    """1e-9 uN for 100 kg: the message gives the need at the longest duration tried."""
    run = run_text(weak(SPREAD, thrust='"1e-9 uN"'), tmp_path, monkeypatch, capsys)
    assert run.status == 1
    assert run.summary["stages"][0]["plan"]["status"] == "thrust limit exceeded"
    who, need, long = re.search(r"\bF([1-4]) needs (\S+) N in (\S+) s", run.summary["verdict"]).groups()
    assert float(long) == pytest.approx(10.0 * TURN, rel=1e-5)
    orbit, states = cf.Orbit(N), np.zeros((4, 6))
    states[:, 1] = [-150.0, -50.0, 50.0, 150.0]
    goals = cf.targets.scattered(orbit, states, 0.5 * TURN, 2.0)
    peaks = orbit.transfer(states, goals, float(long)).peak_thrust
    assert float(need) == pytest.approx(100.0 * peaks[int(who) - 1], rel=1e-3)
    assert "its max_thrust is 1e-15 N" in run.summary["verdict"]
    assert run.summary["warnings"] == []  # it is not used


@pytest.mark.parametrize("how", ["factor = 2.0", 'from = "-100 0 0 m"\ndistance = "50 m"'])
def test_scatter_without_a_solution_is_rejected(how: str) -> None:
    """F2 coasts to F1, and to the point, at the end of the stage."""
    text = FLEET.replace('altitude = "500 km"', "deep_space = true")
    places = '["-100 0 0 m", "0 0 0 m", "0 300 0 m", "0 0 300 m"]'
    speeds = '["0 0 0 m/s", "-1 0 0 m/s", "0 0 0 m/s", "0 0 0 m/s"]'
    text = text.replace(
        'start = { string_of_pearls = { spacing = "100 m" } }', f"position = {places}\nvelocity = {speeds}"
    )
    with pytest.raises(ScenarioError, match=r"stage\[1\]: .*\bF[12]\b.*; change within") as raised:
        plan_mission(parse(fleet(f'do = "scatter"\n{how}\nwithin = "100 s"', text=text)))
    assert "craft" not in str(raised.value)


MOVES = (
    'do = "reconfigure"\ncraft = ["Inspector"]\n'
    'to = { safety_ellipse = { radial = "50 m", cross_track = "50 m" } }',
    'do = "avoid"\ncraft = "Inspector"\nto = { position = "0 -100 0 m", velocity = "0 0 0 m/s" }',
)


@pytest.mark.parametrize("within", ["1 orbit", "400 min"])
@pytest.mark.parametrize("move", MOVES, ids=["reconfigure", "avoid"])
def test_long_transfer_beside_a_coasting_spacecraft(move: str, within: str) -> None:
    """The coasting spacecraft is propagated far beyond the transfer."""
    flown = plan_mission(
        parse(f"""closeform = 1
title = "Inspector"

[orbit]
altitude = "500 km"

[craft]
name = ["Target", "Inspector"]
position = ["0 0 0 m", "0 -300 0 m"]
velocity = "0 0 0 m/s"
keep_out = {{ sphere = "20 m" }}

[[stage]]
{move}
within = "{within}"
""")
    )
    assert flown.verdict.ok


def test_run_from_python(tmp_path, capsys):
    """`run` gives the mission of `closeform run`, without output."""
    mission = cf.run(EXAMPLES / "cluster.toml")
    assert str(mission.verdict).startswith("clear in Hill's equations: no conflict remains")
    move, zone = mission.results[1], cf.Ellipsoid([20.0, 40.0, 20.0])
    paths = {name: move.before.path(name) for name in move.before.names}
    found = {
        (one, other): stays[0].start
        for one, other in combinations(paths, 2)
        if (stays := cf.find_conflicts(paths[one], paths[other], zone))
    }
    assert {(met.first, met.second): met.start for met in move.before.conflicts} == pytest.approx(found)
    assert move.after.conflicts == ()
    assert cf.screen(move.after.paths, zone).conflicts == ()
    assert capsys.readouterr() == ("", "")
    with pytest.raises(ValueError, match=r"[Nn]o such file"):
        cf.run(tmp_path / "none.toml")
    with pytest.raises(ValueError, match=r"^file: expected"):
        cf.run(None)
