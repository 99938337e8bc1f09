"""Cost of missions by impulses and pulses, against the rocket equation and an integrator."""

import csv
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from bridge import hill
from closeform.fuel.bound import least_delta_v
from closeform.mission.mission import plan_mission
from closeform.motion.path import ends_of
from closeform.report.run import RunReport
from closeform.scenario import ScenarioError, parse
from runs import G0, N, Run, plain

TURN = 2 * np.pi / N
MILLIMETRE = 1e-3

ALONE = """\
closeform = 1
title = "One craft"

[orbit]
altitude = "500 km"

[craft]
name = "I"
position = "0 -2000 30 m"
velocity = "0 0 0 m/s"
mass = "12 kg"
specific_impulse = "60 s"
KEYS

[[stage]]
do = "transfer"
to = { position = "0 -100 0 m", velocity = "0.01 0 0.02 m/s" }
within = "1.3 orbits"
cost = "delta-v"
"""
EXAMPLES = Path(__file__).parents[1] / "examples"
GOAL = np.array([0.0, -100.0, 0.0, 0.01, 0.0, 0.02])
START = np.array([0.0, -2000.0, 30.0, 0.0, 0.0, 0.0])
ON_OFF = 'max_thrust = "0.1 N"\nthrusters = "rtn"\nminimum_bit = "1 mN s"\nperiod = "30 s"'
RTN = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])

PASSAGE = """\
closeform = 1
title = "Q moves past P"

[orbit]
altitude = "500 km"

[craft]
name = ["P", "Q"]
position = ["0 0 0 m", "0 8 -80 m"]
velocity = "0 0 0 m/s"
keep_out = { sphere = "20 m" }
mass = "12 kg"
specific_impulse = "60 s"
KEYS

[[stage]]
do = "avoid"
craft = "Q"
to = { position = "0 8 80 m", velocity = "0 0 0 m/s" }
within = "0.2 orbits"
STAGE
"""


def alone(keys: str = "", **changes: str) -> str:
    text = ALONE.replace("KEYS", keys)
    for key, new in changes.items():
        text, count = re.subn(rf"^{key} = .*$", f"{key} = {new}", text, flags=re.MULTILINE)
        assert count == 1
    return text


def passage(keys: str = "", stage: str = 'cost = "delta-v"') -> str:
    return PASSAGE.replace("KEYS", keys).replace("STAGE", stage)


def propagated(state: np.ndarray, time: float) -> np.ndarray:
    return expm(hill(N) * time) @ state


def after_impulses(burns: list[dict], state: np.ndarray, end: float) -> np.ndarray:
    """Return the state after impulses, by exponentials of Hill's matrix."""
    now = 0.0
    for burn in burns:
        assert burn["duration_s"] == 0.0
        state = propagated(state, burn["start_s"] - now)
        state[3:] += [burn["radial_m_s"], burn["along_track_m_s"], burn["cross_track_m_s"]]
        now = burn["start_s"]
    return propagated(state, end - now)


def pulsed(burns: list[dict], state: np.ndarray, end: float, force: float, mass: float, impulse: float):
    """Return state and mass after pulses of constant force, by an integrator with decreasing mass."""
    begin = np.array([burn["start_s"] for burn in burns])
    over = begin + [burn["duration_s"] for burn in burns]
    push = force * RTN[[burn["thruster"] - 1 for burn in burns]]  # counted from 1
    edges = np.unique(np.concatenate([[0.0, end], begin, over]))
    y = np.append(state, mass)
    for a, b in zip(edges[:-1], edges[1:], strict=True):
        on = (begin <= a) & (over >= b)

        thrust, flow = push[on].sum(axis=0), force * on.sum() / (G0 * impulse)

        def rate(t, y, thrust=thrust, flow=flow):
            slope = np.append(hill(N) @ y[:6], -flow)
            slope[3:6] += thrust / y[6]
            return slope

        y = solve_ivp(rate, (a, b), y, method="DOP853", rtol=1e-9, atol=1e-10).y[:, -1]
    return y[:6], y[6]


def last_state(run: Run, craft: str) -> np.ndarray:
    row = [row for row in run.table("paths") if row["craft"] == craft][-1]
    return np.array([row[key] for key in ("x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s")])


def check_sums(run: Run, craft: str, mass: float = 12.0, impulse: float = 60.0) -> None:
    """Check that burns sum to the spacecraft's delta-v and, by Tsiolkovsky's equation, propellant."""
    burns = [burn for burn in run.table("burns") if burn["craft"] == craft]
    spent = sum(burn["size_m_s"] for burn in burns)
    (row,) = (row for row in run.table("craft") if row["craft"] == craft)
    assert spent == pytest.approx(row["delta_v_m_s"], rel=1e-9)
    kilograms = mass * (1.0 - np.exp(-spent / (G0 * impulse)))
    assert sum(burn["propellant_kg"] for burn in burns) == pytest.approx(kilograms, rel=1e-6)
    assert run.summary["propellant_kg"][craft] == pytest.approx(kilograms, rel=1e-9)
    assert run.summary["delta_v_m_s"][craft] == pytest.approx(spent, rel=1e-9)


def test_listed_impulses_reach_the_goal(ran):
    run = ran(alone())
    assert run.status == 0
    burns = run.table("burns")
    assert 2 <= len(burns) <= 6
    assert np.linalg.norm((after_impulses(burns, START, 1.3 * TURN) - GOAL)[:3]) < MILLIMETRE
    assert np.linalg.norm((after_impulses(burns, START, 1.3 * TURN) - GOAL)[3:]) < MILLIMETRE / TURN
    check_sums(run, "I")
    plain(run)
    rows = list(csv.DictReader((run.folder / "burns.csv").read_text().splitlines()))
    assert [{key: float(row[key]) for key in ("start_s", "size_m_s")} for row in rows] == [
        {key: burn[key] for key in ("start_s", "size_m_s")} for burn in burns
    ]
    assert all(row["thruster"] == "" for row in rows)
    assert "burns.csv" in run.summary["files"]


def test_listed_pulses_reach_the_goal(ran):
    run = ran(alone(ON_OFF))
    assert run.status == 0
    burns, end = run.table("burns"), 1.3 * TURN
    assert min(burn["start_s"] for burn in burns) >= 0.0  # burns stay within the transfer
    assert max(burn["start_s"] + burn["duration_s"] for burn in burns) <= end * (1 + 1e-12)
    state, mass = pulsed(burns, START, end, 0.1, 12.0, 60.0)
    # the path neglects the loss of mass within a pulse
    assert np.linalg.norm((state - last_state(run, "I"))[:3]) < MILLIMETRE
    (shot,) = run.summary["stages"][0]["transfer"]["pulsed"]["craft"]
    assert np.linalg.norm((state - GOAL)[:3]) <= shot["deviation_bound_m"]
    assert shot["deviation_m"] <= shot["deviation_bound_m"]
    assert mass == pytest.approx(12.0 - run.summary["propellant_kg"]["I"], abs=1e-9)
    for burn in burns:
        assert burn["propellant_kg"] == pytest.approx(0.1 * burn["duration_s"] / (G0 * 60.0), rel=1e-5)
        assert burn["size_m_s"] * 12.0 >= 1e-3  # N s, the minimum impulse bit
        push = np.array([burn[key] for key in ("radial_m_s", "along_track_m_s", "cross_track_m_s")])
        assert push == pytest.approx(burn["size_m_s"] * RTN[burn["thruster"] - 1], abs=1e-12)
    check_sums(run, "I")
    plain(run)


def test_later_stages_start_at_the_simulated_state_and_mass(ran):
    text = alone(ON_OFF.replace("0.1 N", "2 N"), specific_impulse='"0.5 s"')
    stage = text[text.index("[[stage]]") :].replace("0 -100 0 m", "0 0 0 m").replace("1.3", "0.7")
    run = ran(f"{text}\n{stage}")
    assert run.status == 0
    burns = run.table("burns")
    assert {burn["stage"] for burn in burns} == {1, 2}
    state, mass = pulsed(burns, START, 2.0 * TURN, 2.0, 12.0, 0.5)
    assert mass < 11.5
    assert mass == pytest.approx(12.0 - run.summary["propellant_kg"]["I"], rel=1e-7)
    assert np.linalg.norm((state - last_state(run, "I"))[:3]) < 10 * MILLIMETRE  # the mass falls by a tenth


def test_cost_of_each_actuator_option(ran):
    run = ran(alone('max_thrust = "0.05 N"'))
    told = run.summary["stages"][0]["transfer"]
    rows = {row["choice"]: row for row in told["choices"]}
    transition = expm(hill(N) * 1.3 * TURN)
    first = np.linalg.solve(transition[:3, 3:], GOAL[:3] - transition[:3, :3] @ START[:3])
    last = transition[3:] @ np.append(START[:3], first)
    two = np.linalg.norm(first - START[3:]) + np.linalg.norm(GOAL[3:] - last)
    assert rows["impulses at both ends"]["delta_v_m_s"] == pytest.approx(two, rel=1e-9)
    gramian = solve_ivp(
        lambda t, y: (expm(hill(N) * t)[:, 3:] @ expm(hill(N) * t)[:, 3:].T).ravel(),
        (0.0, 1.3 * TURN), np.zeros(36), rtol=1e-8, atol=1e-6,
    ).y[:, -1].reshape(6, 6)  # fmt: skip
    costate = np.linalg.solve(gramian, GOAL - transition @ START)
    times = np.linspace(0.0, 1.3 * TURN, 2001)
    push = [np.linalg.norm(expm(hill(N) * t)[:, 3:].T @ costate) for t in times]
    assert rows["minimum energy"]["delta_v_m_s"] == pytest.approx(np.trapezoid(push, times), rel=1e-5)
    least = rows["minimum delta-v, free impulses"]["delta_v_m_s"]
    within = rows["burns and coasts, within the limit"]["delta_v_m_s"]
    assert told["least_m_s"] * (1 - 1e-9) <= least <= within <= rows["minimum energy"]["delta_v_m_s"]
    assert rows["this plan"]["delta_v_m_s"] == pytest.approx(within, rel=1e-9)
    for row in rows.values():
        assert row["above_least"] == pytest.approx(row["delta_v_m_s"] / told["least_m_s"] - 1.0, abs=1e-12)
        burnt = 12.0 * (1.0 - np.exp(-row["delta_v_m_s"] / (G0 * 60.0)))
        assert row["propellant_kg"] == pytest.approx(burnt, rel=1e-9)
    assert f"{100 * (within / told['least_m_s'] - 1):.3f} % above the" in run.printed
    check_sums(run, "I")
    plain(run)


def test_burns_and_coasts_keep_the_limit(ran):
    run = ran(alone('max_acceleration = "4 mm/s^2"'))
    assert run.status == 0
    burns = run.table("burns")
    assert len(burns) > 1
    assert all(burn["duration_s"] > 0.0 for burn in burns)
    for burn in burns:  # at the limit except while thrust rises and falls
        assert 0.8 < burn["size_m_s"] / (4e-3 * burn["duration_s"]) <= 1.0 + 1e-9
        push = [burn[key] for key in ("radial_m_s", "along_track_m_s", "cross_track_m_s")]
        assert np.linalg.norm(push) <= burn["size_m_s"] * (1 + 1e-9)
    assert "thrust 4 of 4 mm/s²" in run.printed
    assert np.linalg.norm((last_state(run, "I") - GOAL)[:3]) < MILLIMETRE
    check_sums(run, "I")


def test_infeasible_transfer_reports_a_sufficient_limit(ran):
    run = ran(alone('max_acceleration = "0.01 mm/s^2"'))
    assert run.status == 1
    needed = re.search(
        r"a thrust of 1e-05 m/s\^2 is too low to arrive in .*; (\S+) m/s\^2 is enough",
        " ".join(run.printed.split()),
    )
    assert needed is not None
    assert not run.table("burns")
    plain(run)
    enough = 1e3 * float(needed[1])
    for factor, possible in ((1.0001, True), (0.999, False)):
        mission = plan_mission(parse(alone(f'max_acceleration = "{factor * enough:.9g} mm/s^2"')))
        assert (mission.stopped is None) == possible


def test_limits_as_force_and_acceleration_agree():
    force = plan_mission(parse(alone('max_thrust = "0.06 N"'))).results[0]
    acceleration = plan_mission(parse(alone('max_acceleration = "5 mm/s^2"'))).results[0]
    assert force.delta_v == pytest.approx(acceleration.delta_v, rel=1e-12)


def test_impossible_option_has_a_reason():
    """Two impulses one orbit apart reach only positions along the track."""
    (section,) = RunReport(plan_mission(parse(alone(within='"1 orbit"')))).sections
    (told,) = (line for line in section.closing if line.startswith("No "))
    assert re.fullmatch(r"No impulses at both ends: .* miss the position by at least \S+ m", told)


def test_avoidance_by_impulses(ran):
    run = ran(passage())
    assert run.status == 0
    change = run.summary["stages"][0]["change"]
    assert change["cost"] == "delta-v"
    assert change["lower_bound_m2_s3"] is None
    assert change["lower_bound_m_s"] <= change["around"]["delta_v_m_s"]
    assert f"lower bound {change['lower_bound_m_s']:.6g} m/s" in run.printed
    burns = run.table("burns")
    start, end = np.array([0.0, 8, -80, 0, 0, 0]), np.array([0.0, 8, 80, 0, 0, 0])
    assert np.linalg.norm((after_impulses(burns, start, 0.2 * TURN) - end)[:3]) < MILLIMETRE
    times = np.linspace(0.0, 0.2 * TURN, 1001)  # 1 s
    where = [after_impulses([b for b in burns if b["start_s"] <= t], start.copy(), t)[:3] for t in times]
    assert np.linalg.norm(where, axis=1).min() >= 20.0 - MILLIMETRE
    check_sums(run, "Q")
    plain(run)


@pytest.mark.parametrize("cost", ["energy", "delta-v"])
def test_pulses_keep_zones(ran, cost):
    text = (EXAMPLES / "cubesats.toml").read_text()
    run = ran(text[: text.rindex("[[stage]]")] + f'cost = "{cost}"\n')
    assert run.status == 0
    room = run.summary["stages"][0]["plan"]["pulsed"]
    if cost == "energy":  # the plan touches the zone, and pulses deviate into it
        assert room["zones_larger_by"] > 1.0
        assert re.search(r"Planned for zones \S+ % larger", run.printed)
    else:
        assert room["before_s"] > 0.0
        assert room["after_s"] > 0.0
    keys, places = ("x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s"), []
    for name in ("Q1", "Q2", "Q3", "Q4"):
        rows = [row for row in run.table("paths") if row["craft"] == name]
        burns = [burn for burn in run.table("burns") if burn["craft"] == name]
        start = np.array([rows[0][key] for key in keys])
        state, _ = pulsed(burns, start, 0.25 * TURN, 0.01, 12.0, 60.0)
        # the path neglects the loss of mass within a pulse, at most 1e-4
        assert np.linalg.norm((state - last_state(run, name))[:3]) < 5 * MILLIMETRE
        places.append([[row[key] for key in keys[:3]] for row in rows])
        check_sums(run, name)
    where = np.array(places)
    apart = np.linalg.norm(where[:, None] - where, axis=-1) + 1e9 * np.eye(4)[:, :, None]
    assert 20.0 - MILLIMETRE <= apart.min() < (21.0 if cost == "energy" else 40.0)
    plain(run)


def test_avoidance_from_a_coast_has_no_relative_cost(ran):
    """The minimum without zones is zero, so that no share of it is printed."""
    text = re.sub(r"^to = .*$", "", passage(), flags=re.MULTILINE).replace("0.2 orbits", "0.5 orbits")
    run = ran(text.replace("0 8 -80 m", "0 5 60 m"))
    assert run.status == 0
    assert "Optimality gap: lower bound 0 m/s" in run.printed
    assert "energy" not in run.printed
    check_sums(run, "Q")
    plain(run)


def test_pulses_that_violate_a_zone_give_status_1(ran):
    """The end is a centimetre outside the zone, and pulses deviate into it."""
    text = passage('max_thrust = "20 mN"\nthrusters = "rtn"\nperiod = "120 s"', 'cost = "energy"')
    run = ran(text.replace("0 8 80 m", "20.01 0 0 m"))
    assert run.status == 1
    assert "conflict" in run.summary["verdict"]
    assert "into zones" in run.printed
    assert "Conflicts after" in run.printed


def test_cost_of_plan_and_pulses_are_both_reported(ran):
    pearls = passage(ON_OFF, "").replace('do = "avoid"\ncraft = "Q"', 'do = "reconfigure"')
    rest = 'velocity = "0 0 0 m/s" }'
    to = f'[{{ position = "0 -80 0 m", {rest}, {{ position = "0 8 80 m", {rest}]'
    run = ran(re.sub(r"^to = .*$", f"to = {to}", pearls, flags=re.MULTILINE))
    assert run.status == 0
    plan = run.summary["stages"][0]["plan"]
    assert {shot["craft"] for shot in plan["pulsed"]["craft"]} == {"P", "Q"}
    flown = sum(run.summary["delta_v_m_s"].values())
    rows = {row["choice"]: row["delta_v_m_s"] for row in plan["choices"]}
    assert rows["this plan, as fired"] == pytest.approx(flown, rel=1e-9)
    assert rows["this plan"] == pytest.approx(plan["delta_v_m_s"], rel=1e-9)
    assert rows["this plan"] < flown < np.sqrt(3.0) * rows["this plan"] * (1 + 1e-6)
    for name in "PQ":
        check_sums(run, name)
    plain(run)


def test_named_thrusters_are_the_table_of_six():
    table = f"{{ directions = {RTN.tolist()} }}"
    one, other = (
        plan_mission(parse(alone(ON_OFF.replace('"rtn"', thrusters)))).results[0]
        for thrusters in ('"rtn"', table)
    )
    assert (one.pulsed.firing.pulses.start == other.pulsed.firing.pulses.start).all()
    speed = plan_mission(parse(alone(ON_OFF.replace("1 mN s", "0.0833333333333 mm/s")))).results[0]
    assert speed.pulsed.firing.delta_v == pytest.approx(one.pulsed.firing.delta_v, rel=1e-9)


def test_energy_needs_a_period():
    with pytest.raises(ScenarioError, match=r"craft\.period: missing"):
        parse(alone(ON_OFF.replace('period = "30 s"', ""), cost='"energy"'))


def test_avoidance_by_burns_within_a_limit(ran):
    """Listed burns pass the zone, and none exceeds the limit."""
    run = ran(passage('max_acceleration = "2 mm/s^2"'))
    assert run.status == 0
    burns = [burn for burn in run.table("burns") if burn["craft"] == "Q"]
    assert all(burn["size_m_s"] <= 2e-3 * burn["duration_s"] * (1 + 1e-9) for burn in burns)
    change = run.summary["stages"][0]["change"]
    assert change["around"]["peak_thrust_m_s2"] <= 2e-3
    assert change["lower_bound_m_s"] <= change["around"]["delta_v_m_s"]
    rows = [row for row in run.table("paths") if row["craft"] == "Q"]
    places = np.array([[row[key] for key in ("x_m", "y_m", "z_m")] for row in rows])
    assert np.linalg.norm(places, axis=1).min() >= 20.0 - MILLIMETRE
    assert np.linalg.norm(last_state(run, "Q")[:3] - [0.0, 8.0, 80.0]) < MILLIMETRE
    impulses = ran(passage()).summary["stages"][0]["change"]["around"]["delta_v_m_s"]
    assert impulses < change["around"]["delta_v_m_s"] < 2.0 * impulses
    check_sums(run, "Q")
    plain(run)


def test_reconfiguration_within_a_limit(ran):
    """Twelve spacecraft swap within their thrust; if time is too short, the run names a sufficient one."""
    text = (EXAMPLES / "swap_impulses.toml").read_text()
    run = ran(text.replace('mass = "150 kg"', 'mass = "150 kg"\nmax_thrust = "0.2 N"'))
    assert run.status == 0
    plan = run.summary["stages"][0]["plan"]
    assert plan["lower_bound_m_s"] < plan["delta_v_m_s"] < 4.6
    for row in run.table("craft"):
        assert row["peak_thrust_N"] <= 0.2
    assert "burns" in run.printed
    plain(run)
    weak = ran(text.replace('mass = "150 kg"', 'mass = "150 kg"\nmax_thrust = "0.05 N"'))
    assert weak.status == 1
    assert "longer, " in weak.printed
    assert max(row["peak_thrust_N"] for row in weak.table("craft")) <= 0.05


@pytest.mark.parametrize("do", ["avoid", "reconfigure", "transfer"])
def test_plans_use_the_given_thrusters(ran, do):
    """Firing costs the planned delta-v, which is less than that of free impulses split among thrusters."""
    keys = 'max_thrust = "0.5 N"\nthrusters = "rtn"'
    text = passage(keys).replace('"0 8 80 m"', '"5 30 80 m"')
    if do == "reconfigure":
        goal = 'to = { position = "5 30 80 m", velocity = "0 0 0 m/s" }'
        text = text.replace('do = "avoid"\ncraft = "Q"', 'do = "reconfigure"\ncraft = ["Q"]')
        text = text.replace(goal, goal.replace("{", "[{").replace("}", "}]"))
    run = ran(text.replace('do = "avoid"', f'do = "{do}"'))
    assert run.status == 0
    told = run.summary["stages"][0][SUBJECT[do]]
    rows = {row["choice"]: row["delta_v_m_s"] for row in told["choices"]}
    assert rows["this plan, as fired"] == pytest.approx(rows["this plan"], rel=1e-3)
    assert rows["impulses of these thrusters"] <= rows["this plan"] * (1 + 1e-9)
    check_sums(run, "Q")
    plain(run)


SUBJECT = {"avoid": "change", "reconfigure": "plan", "transfer": "transfer"}


@pytest.mark.parametrize("do", ["avoid", "reconfigure"])
def test_missing_thrust_direction_names_the_spacecraft(do):
    keys = 'max_thrust = "0.5 N"\nthrusters = { directions = [[0, 1, 0], [0, -1, 0]] }'
    text = passage(keys)
    if do == "reconfigure":
        goal = 'to = { position = "0 8 80 m", velocity = "0 0 0 m/s" }'
        text = text.replace('do = "avoid"\ncraft = "Q"', 'do = "reconfigure"\ncraft = ["Q"]')
        text = text.replace(goal, goal.replace("{", "[{").replace("}", "}]"))
    with pytest.raises(ScenarioError, match=r"stage\[1\]: thrusters: Q: .*no thruster acts cross-track"):
        plan_mission(parse(text))


def test_verdict_without_zones():
    report = RunReport(plan_mission(parse(alone())))
    assert "no conflict remains" in str(report.mission.verdict)  # a single spacecraft
    two = alone(name='["I", "J"]', position='["0 500 0 m", "0 9 0 m"]', do='"transfer"\ncraft = "J"')
    assert "no search for conflicts" in str(plan_mission(parse(two)).verdict)


def test_six_impulses_of_the_inspector_are_optimal(ran):
    """The primer vector through all six is at most 1, which proves the minimum by weak duality."""
    run = ran((EXAMPLES / "safety_ellipse.toml").read_text())
    assert "Delta-v by actuator option" in run.printed
    plain(run)
    burns = [burn for burn in run.table("burns") if burn["size_m_s"] > 0.0]
    assert len(burns) == 6
    assert min(burn["size_m_s"] for burn in burns) > 0.04 * sum(burn["size_m_s"] for burn in burns)
    end = run.summary["stages"][0]["end_s"]
    given = np.array(
        [[burn[f"{key}_m_s"] for key in ("radial", "along_track", "cross_track")] for burn in burns]
    )
    reached = [
        expm(hill(N) * (end - burn["start_s"]))[:, 3:].T for burn in burns
    ]  # change of the end by an impulse
    along = given / np.linalg.norm(given, axis=1)[:, None]
    price, *_ = np.linalg.lstsq(np.vstack(reached), along.ravel())
    step = expm(hill(N) * end / 4000)
    primers = [np.linalg.matrix_power(step, k)[:, 3:].T @ price for k in range(4001)]
    assert np.linalg.norm(primers, axis=1).max() < 1.0 + 1e-6
    needed = sum(to.T @ push for to, push in zip(reached, given, strict=True))
    spent = sum(burn["size_m_s"] for burn in burns)
    assert price @ needed == pytest.approx(spent, rel=1e-7)
    there = after_impulses(burns, START, end)
    turned = np.array([expm(hill(N) * time)[:3] @ there for time in np.linspace(0.0, TURN, 400)])
    assert np.ptp(turned, axis=0) == pytest.approx(
        [100.0, 200.0, 100.0], rel=1e-4
    )  # size of the final ellipse


TIGHT = """\
closeform = 1
title = "Burns closer than they are long"

[orbit]
altitude = "500 km"

[craft]
name = ["Q1", "Q2", "Q3", "Q4"]
start = { string_of_pearls = { spacing = "50 m" } }
keep_out = { sphere = "45 m" }
mass = "12 kg"
max_thrust = "0.1 mN"
thrusters = "rtn"
minimum_bit = "1 mN s"
period = "120 s"

[[stage]]
do = "reconfigure"
within = "1 orbit"
cost = "delta-v"
to = { projected_circular = { radius = "60 m" } }
"""


def test_overlapping_burns_stop_the_mission_with_a_reason():
    """Burns that overlap or exceed the stage are reported, not raised."""
    mission = plan_mission(parse(TIGHT.replace("0.1 mN", "0.12 mN")))
    assert mission.stopped is not None
    assert "must begin again at" in mission.stopped
    assert 1 <= int(re.search(r"thruster (\d+) fires", mission.stopped)[1]) <= 6
    assert not mission.results[0].executed
    ends = plan_mission(parse(TIGHT))
    assert ends.stopped is not None
    assert "burns at its ends take" in ends.stopped
    assert RunReport(ends).sections[0].lines[0].startswith("Not executed: burns at its ends take")
    assert "give it more thrust or time" in ends.stopped
    assert plan_mission(parse(TIGHT.replace("0.1 mN", "1 mN"))).clear  # neighbouring impulses are one burn


def test_arrival_tolerance_is_checked():
    """The reported arrival error is that of the path."""
    keys = ON_OFF.replace('"30 s"', '"900 s"')
    text = alone(keys, cost='"energy"').replace('cost = "energy"', 'cost = "energy"\nTOLERANCE')
    fine = 'arrival = { position = "1 mm", velocity = "0.001 mm/s" }'
    strict, loose = (
        plan_mission(parse(text.replace("TOLERANCE", one)))
        for one in (fine, 'arrival = { position = "1 km", velocity = "1 m/s" }')
    )
    assert not strict.verdict.ok
    assert strict.verdict.status == 1
    assert "arrival off by" in str(strict.verdict)
    assert loose.verdict.ok
    (result,) = strict.results
    off = result.after.paths[0].state(result.end) - GOAL
    assert np.allclose(result.pulsed.off[0], [np.linalg.norm(off[:3]), np.linalg.norm(off[3:])], rtol=1e-6)


def test_zones_grow_only_as_pulses_need():
    """50 m apart with zones of 45 m: pulses need 10 cm at most, and 5 m more would have no plan."""
    mission = plan_mission(parse(TIGHT.replace("0.1 mN", "2 mN")))
    assert mission.clear
    pulsed = mission.results[0].pulsed
    assert 45.0 <= 45.0 * pulsed.room.larger < 45.1

    def least(paths):
        times = np.linspace(max(one.start for one in paths), min(one.end for one in paths), 6001)  # 0.1 m
        places = np.stack([path.position(times) for path in paths])
        return (np.linalg.norm(places[:, None] - places, axis=-1) + 1e9 * np.eye(4)[:, :, None]).min()

    assert least([pulsed.firing.path[k] for k in range(4)]) > 45.0 - MILLIMETRE
    assert least(pulsed.planned.paths) > 45.0 * pulsed.room.larger - MILLIMETRE


def test_planned_and_fired_delta_v_are_both_reported(ran):
    """Table of the plan, table of the pulses, text and summary agree."""
    run = ran(alone(ON_OFF, cost='"energy"'))  # planned thrust has any direction
    (shot,) = run.summary["stages"][0]["transfer"]["pulsed"]["craft"]
    planned = run.summary["stages"][0]["transfer"]["planned"]["delta_v_m_s"]
    fired = run.summary["delta_v_m_s"]["I"]
    assert fired > planned
    assert (shot["planned_m_s"], shot["delta_v_m_s"]) == pytest.approx((planned, fired), rel=1e-9)
    assert f"Delta-v fired {fired:.6g} m/s, for {planned:.6g} m/s planned" in run.printed
    heads = [line for line in run.printed.splitlines() if "delta-v [m/s]" in line]
    assert "planned delta-v [m/s]" in heads[0]
    assert "fired [m/s]" in run.printed
    assert f"Delta-v planned {planned:.6g} m/s" in run.printed


RING = """\
closeform = 1
title = "A ring that turns"

[orbit]
altitude = "600 km"

[craft]
name = ["Q1", "Q2"]
start = { projected_circular = { radius = "50 m" } }
keep_out = { sphere = "10 m" }
mass = "12 kg"

[[stage]]
do = "reconfigure"
cost = "delta-v"
within = "0.5 orbits"
to = { projected_circular = { radius = "50 m", first_phase = "180 deg" } }
"""


@pytest.mark.parametrize(
    ("text", "told", "above"),
    [
        (RING, "proven minimum delta-v for these ends and times: natural motion reaches the target", None),
        (
            RING.replace("180 deg", "36 deg").replace("mass", 'thrusters = "rtn"\nmax_thrust = "10 N"\nmass'),
            "proven minimum delta-v of these thrusters",
            True,
        ),
        (
            RING.replace("180 deg", "36 deg").replace("mass", 'max_thrust = "5 mN"\nmass'),
            "proven minimum delta-v within the limit, for these ends and times",
            True,
        ),
    ],
    ids=["natural motion", "thrusters", "limit"],
)
def test_proven_minimum_is_reported(text, told, above):
    """Natural motion needs no delta-v; thrusters along axes and limits need more than free impulses."""
    mission = plan_mission(parse(text))
    (result,) = mission.results
    assert any(line.endswith(told) for line in RunReport(mission).sections[0].closing)
    spent = float(result.delta_v.sum())
    if above is None:
        assert spent < 1e-9  # m/s
        return
    least = least_delta_v(mission.orbit, *(np.array(one) for one in ends(result)), result.end)
    assert spent > 1.001 * float(np.sum(least.upper))


def ends(result):
    """Return initial and final states (N, 6)."""
    return zip(*(ends_of(result.before.path(name)) for name in result.after.names), strict=True)
