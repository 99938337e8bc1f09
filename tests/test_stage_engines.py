"""Engines of stages act as engines of the spacecraft, with one tank for all."""

import json

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import closeform as cf
from bridge import hill
from closeform.cli.app import main
from closeform.mission.mission import plan_mission
from closeform.mission.simulation import SimulatedRun
from closeform.scenario import parse
from field_scenario import swap
from runs import G0, N, plain

TWO_ENGINES = """\
closeform = 1
title = "A main engine, and cold gas near the client"

[orbit]
altitude = "500 km"

[craft]
name = ["C", "I"]
position = ["0 0 0 m", "0 -2000 30 m"]
velocity = "0 0 0 m/s"
keep_out = { sphere = "20 m" }
mass = "12 kg"
max_thrust = "1 N"
specific_impulse = "220 s"
propellant = "9.9 g"

[[stage]]
do = "transfer"
craft = "I"
to = { position = "0 -200 0 m", velocity = "0 0 0 m/s" }
within = "1 orbit"
cost = "delta-v"

[[stage]]
do = "avoid"
craft = "I"
to = { position = "0 60 30 m", velocity = "0 0 0 m/s" }
within = "1 orbit"
cost = "delta-v"
max_thrust = "50 mN"
thrusters = "rtn"
minimum_bit = "1 mN s"
specific_impulse = "60 s"
"""
FORMATION = """\
closeform = 1
title = "Three craft"

[orbit]
altitude = "500 km"

[craft]
name = ["P", "Q", "R"]
position = ["0 -60 0 m", "0 0 0 m", "0 60 0 m"]
velocity = "0 0 0 m/s"
keep_out = { sphere = "15 m" }
mass = "12 kg"
specific_impulse = "60 s"
CRAFT

[[stage]]
name = "first"
VERB
within = "0.3 orbits"
STAGE
"""
LIMIT, COLD_GAS = 'max_thrust = "40 mN"', 'max_thrust = "0.3 N"\nthrusters = "rtn"\nperiod = "30 s"'
BACK = '"0 60 0 m", velocity = "0 0 0 m/s" }'
VERBS = {
    "transfer": f'do = "transfer"\ncraft = "P"\nto = {{ position = {BACK}',
    "avoid": f'do = "avoid"\ncraft = "P"\nto = {{ position = {BACK.replace("60", "120")}',
    "reconfigure": f'do = "reconfigure"\ncraft = ["P", "R"]\nto = [{{ position = {BACK}, '
    f"{{ position = {BACK.replace('60', '-60')}]",
    "scatter": 'do = "scatter"\nfactor = 1.5',
}


def state_and_mass(burns: list[dict], state: np.ndarray, end: float, exhausts: dict[int, float]):
    """Return the integrated state after burns at mean acceleration, and the mass left of 12 kg."""
    edges = np.unique([0.0, end, *(b["start_s"] + f * b["duration_s"] for b in burns for f in (0.0, 1.0))])
    y = np.append(state, 12.0)
    for a, b in zip(edges[:-1], edges[1:], strict=True):
        push, flow = np.zeros(3), 0.0
        for burn in burns:
            if burn["start_s"] <= a and burn["start_s"] + burn["duration_s"] >= b:
                toward = np.array([burn[f"{key}_m_s"] for key in ("radial", "along_track", "cross_track")])
                push += toward / burn["duration_s"]
                flow += burn["size_m_s"] / burn["duration_s"] / exhausts[burn["stage"]]

        def rate(t, y, push=push, flow=flow):
            slope = np.append(hill(N) @ y[:6], -y[6] * flow)
            slope[3:6] += push
            return slope

        y = solve_ivp(rate, (a, b), y, method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    return y[:6], y[6]


def test_engine_of_each_stage_and_common_tank(ran):
    run = ran(TWO_ENGINES)
    assert run.status == 0
    plain(run)
    burns, end = run.table("burns"), 4.0 * np.pi / N
    state, left = state_and_mass(
        burns, np.array([0.0, -2000, 30, 0, 0, 0]), end, {1: G0 * 220.0, 2: G0 * 60.0}
    )
    used = run.summary["propellant_kg"]["I"]
    assert left == pytest.approx(12.0 - used, abs=1e-9)
    last = [row for row in run.table("paths") if row["craft"] == "I"][-1]
    assert np.linalg.norm(state[:3] - [last[key] for key in ("x_m", "y_m", "z_m")]) < 1e-3
    first, second = ([burn for burn in burns if burn["stage"] == number] for number in (1, 2))
    for burn in first:  # at full thrust or less; the mass falls by a gram
        assert burn["size_m_s"] * 12.0 <= 1.0 * burn["duration_s"] * (1.0 + 1e-6)
        assert burn["thruster"] is None
    for burn in second:
        assert burn["size_m_s"] * 12.0 == pytest.approx(0.05 * burn["duration_s"], rel=3e-4)
        assert burn["thruster"] is not None
    by_hand = 12.0
    for some, impulse in ((first, 220.0), (second, 60.0)):
        by_hand *= np.exp(-sum(burn["size_m_s"] for burn in some) / (G0 * impulse))
    assert used == pytest.approx(12.0 - by_hand, rel=1e-9)
    assert sum(burn["propellant_kg"] for burn in burns) == pytest.approx(used, rel=1e-9)
    for missing in (0.01, -0.01):  # g
        mission = plan_mission(parse(TWO_ENGINES.replace("9.9 g", f"{1e3 * used - missing:.3f} g")))
        assert mission.verdict.status == (missing > 0)
        assert any("of propellant, it has" in line for line in mission.warnings) == (missing > 0)


@pytest.mark.parametrize(("cost", "engine"), [("energy", LIMIT), ("delta-v", COLD_GAS)])
@pytest.mark.parametrize("verb", VERBS)
def test_engine_of_a_stage_equals_that_of_the_spacecraft(verb, cost, engine):
    """Paths, burns and verdicts are identical."""
    text = FORMATION.replace("VERB", VERBS[verb])
    other = 'max_acceleration = "1 m/s^2"' if engine == LIMIT else ""
    craft = parse(text.replace("CRAFT", engine).replace("STAGE", f'cost = "{cost}"'))
    stage = parse(text.replace("CRAFT", other).replace("STAGE", f'cost = "{cost}"\n{engine}'))
    one, two = plan_mission(craft), plan_mission(stage)
    assert one.stopped == two.stopped
    assert one.verdict.status == two.verdict.status
    assert np.array_equal(one.paths.arcs, two.paths.arcs)
    assert one.burns == two.burns
    assert np.array_equal(one.propellant, two.propellant)
    moving = stage.stages[0].moving(stage.names)
    assert [use for use in one.uses if use.craft in moving] == [u for u in two.uses if u.craft in moving]
    assert one.results[0].delta_v.sum() > 0.0


def test_thrust_limit_of_a_stage_extends_it():
    text = FORMATION.replace("VERB", VERBS["avoid"]).replace("CRAFT", 'max_thrust = "1 N"')
    free, short = (
        plan_mission(parse(text.replace("STAGE", ""))),
        plan_mission(parse(text.replace("STAGE", 'max_thrust = "1.5 mN"'))),
    )
    assert (free.verdict.status, short.verdict.status) == (0, 1)
    (late,) = short.verdict.late
    assert late.punctual[0].limit == 1.5e-3
    assert max(short.results[0].after.paths.peak_thrust) * 12.0 <= 1.5e-3 * (1 + 1e-9)


ENGINE = 'max_thrust = "50 mN"\nthrusters = "rtn"\nperiod = "30 s"\nminimum_bit = "1 mN s"'


def test_simulations_use_the_thrusters_of_the_stage():
    stage = plan_mission(parse(swap(craft='mass = "12 kg"', more=f"{ENGINE}\n")))
    craft = plan_mission(parse(swap(craft=f'mass = "12 kg"\n{ENGINE}')))
    flown = [SimulatedRun.of(run, "track", run.scenario.flight, 2) for run in (stage, craft)]
    assert flown[0].thrusters == ("A", "B")
    assert np.array_equal(flown[0].flight.states, flown[1].flight.states)
    assert np.array_equal(flown[0].flight.delta_v, flown[1].flight.delta_v)


def test_simulations_use_the_specific_impulse_of_each_stage():
    """The propellant is exact where a simulation spends the planned delta-v."""
    more = '\n[[stage]]\ndo = "reconfigure"\nwithin = "0.4 orbits"\nspecific_impulse = "60 s"\nto = '
    ends = (f'{{ position = "0 0 {z} m", velocity = "0 0 0 m/s" }}' for z in (120, -120))
    more += f"[{', '.join(ends)}]"
    run = plan_mission(parse(swap(craft='mass = "12 kg"\nspecific_impulse = "220 s"', more=more)))
    flown = SimulatedRun.of(run, "open", run.scenario.flight, 1)
    planned = flown.burnt(slice(None), run.delta_v.sum(axis=0))
    assert planned == pytest.approx(run.propellant.sum(axis=0), rel=1e-12)
    by_hand = 12.0 * -np.expm1(-run.delta_v[0] / (G0 * 220.0) - run.delta_v[1] / (G0 * 60.0))
    assert planned == pytest.approx(by_hand, rel=1e-12)


def test_simulations_change_thrusters_with_the_stage(tmp_path):
    again = swap()[swap().index("[[stage]]") :].replace('"swap"', '"back"').replace("50 mN", "20 mN")
    text = swap(craft='mass = "12 kg"', more=f"{ENGINE}\n\n{again}{ENGINE.replace('50', '20')}\n")
    run = plan_mission(parse(f"{text}\n[simulation]\n"))
    pulses, change = run.flights.flight.firing.pulses, run.executed[1].start
    strengths = np.where(pulses.start < change, 50e-3, 20e-3) / 12.0
    assert pulses.impulse / pulses.duration == pytest.approx(strengths, rel=1e-9)
    assert (pulses.start < change).any()
    assert (pulses.start > change).any()
    assert run.flights.flight.greatest_end < 1.0  # m
    assert run.flights.flight.delta_v[0] == pytest.approx(run.delta_v.sum(axis=0), rel=0.1)


def test_simulations_change_from_free_thrust_to_thrusters():
    again = swap()[swap().index("[[stage]]") :].replace('"swap"', '"back"').replace("50 mN", "20 mN")
    text = swap(craft='mass = "12 kg"', more=f'max_thrust = "40 mN"\n\n{again}{ENGINE}\n')
    seen = '\n[simulation]\n\n[navigation]\nposition = "10 cm"\nvelocity = "0.3 mm/s"\n'
    run = plan_mission(parse(f"{text}{seen}"))
    assert (run.flights.flight.pulses[0].start > run.executed[1].start).all()
    assert run.flights.flight.greatest_end < 2.0  # m
    assert run.flights.flight.delta_v[0] == pytest.approx(run.delta_v.sum(axis=0), rel=0.1)


def test_simulations_use_the_thrust_limit_of_each_stage():
    """Feedback adds more than a tenth to the thrust of the plan."""
    again = swap()[swap().index("[[stage]]") :].replace('"swap"', '"back"')
    text = swap(craft='mass = "12 kg"', more=f'max_thrust = "1.5 mN"\n\n{again}max_thrust = "2.3 mN"\n')
    run = plan_mission(parse(text.replace("[craft]", '[navigation]\nposition_bias = "5 m"\n\n[craft]', 1)))
    change, field = run.executed[1].start, run.scenario.field
    limits = {0.0: 1.5e-3 / 12.0, change: 2.3e-3 / 12.0}
    options = {name: value for name, value in run.scenario.flight.items() if name != "max_acceleration"}
    by_hand = cf.simulate(run.paths, field, "track", max_acceleration=limits, seeds=2, **options)
    found = SimulatedRun.of(run, "track", run.scenario.flight, 2).flight
    assert found.states == pytest.approx(by_hand.states, abs=1e-6)
    assert found.limited.min() > 0.0
    for limit in limits.values():
        other = cf.simulate(run.paths, field, "track", max_acceleration=limit, seeds=2, **options)
        assert np.abs(other.states - found.states)[..., :3].max() > 0.1  # m


def test_sweep_of_a_stage_key(tmp_path, capsys):
    """Each point of the sweep equals a file with that limit."""
    text = FORMATION.replace("VERB", VERBS["avoid"]).replace("CRAFT", "").replace("STAGE", LIMIT)
    study = '\n[study]\ncases = 1\nseed = 1\n\n[study.sweep]\n"stage[1].max_thrust" = ["1.5 mN", "40 mN"]\n'
    (tmp_path / "study.toml").write_text(text + study)
    main(["study", str(tmp_path / "study.toml"), "--out", str(tmp_path / "out")])
    capsys.readouterr()
    points = json.loads((tmp_path / "out" / "summary.json").read_text())
    told = json.dumps(points)
    for thrust, status in (("1.5 mN", 1), ("40 mN", 0)):
        mission = plan_mission(parse(text.replace("40 mN", thrust)))
        assert mission.verdict.status == status
        assert f"{mission.delta_v.sum():.6g}"[:6] in told
