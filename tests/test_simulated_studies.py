"""Runs and studies simulated in the high-fidelity model, against `cf.simulate` and another integrator."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ndtri

import closeform as cf
from closeform.campaign import case_of, evaluated
from closeform.cli.app import main
from closeform.dynamics.force_model.field import EARTH_SPIN
from closeform.mission.mission import plan_mission
from closeform.report.mission_study import missions_report
from closeform.scenario import parse
from field_scenario import AIR, IN_AIR, swap
from philox import block, words
from simulated import axes_of, textbook
from studies import COAST, ERRORS, FLIGHT, MANY, STUDY

pytestmark = pytest.mark.usefixtures("unpainted")


@pytest.fixture(scope="module")
def missions():
    return evaluated(parse(MANY, "many.toml"))


def row(campaign, case: int) -> dict:
    return {name: campaign.column(name)[case] for name in campaign.kind.names}


@pytest.mark.slow
def test_run_simulates_like_the_command(tmp_path: Path, capsys):
    """Both simulate bit by bit the same, and count the same violations."""
    text = swap(more=COAST + ERRORS)
    (tmp_path / "plain.toml").write_text(text)
    (tmp_path / "flown.toml").write_text(text + FLIGHT.format(seeds=20))
    main(["run", str(tmp_path / "plain.toml"), "--out", str(tmp_path / "plain"), "--no-viewer"])
    command = ["simulate", str(tmp_path / "plain"), "--seeds", "20", "--out", str(tmp_path / "alone")]
    assert main(command) == 1
    capsys.readouterr()
    assert main(["run", str(tmp_path / "flown.toml"), "--out", str(tmp_path / "run")]) == 1
    printed = capsys.readouterr().out
    own, whole = (json.loads((tmp_path / name / "summary.json").read_text()) for name in ("alone", "run"))
    flights = whole["flights"]
    assert flights == {key: own[key] for key in flights}
    assert 5 < flights["violated"] < 20  # planned to touch: a chance of about one half
    words = f"zones are entered in {flights['violated']} of 20 simulations, minimum "
    assert whole["verdict"].startswith(words)
    assert words in printed
    assert [line.split()[:2] for line in printed.splitlines() if line.startswith("    ")][:2] == [
        ["1", "reconfigure"],
        ["2", "coast"],
    ]
    for name, other in (("flights", "flights"), ("ratios", "ratios"), ("ends", "ends"), ("paths", "worst")):
        one, two = (
            pyarrow.parquet.read_table(tmp_path / place / f"{file}.parquet")
            for place, file in (("alone", name), ("run", other))
        )
        assert one.equals(two)
    page = (tmp_path / "run" / "report.html").read_text()
    assert "worst.html" in page
    assert "No craft enters a keep-out zone in the simulation" in page
    assert (tmp_path / "run" / "flights-ratios.png").is_file()
    assert (tmp_path / "run" / "worst.html").stat().st_size > 10_000
    plans = [cf.load(tmp_path / name).paths.arcs for name in ("run", "plain")]
    assert np.array_equal(*plans)  # loaded paths are those of the plan


def test_limits_apply_to_the_costliest_simulation():
    """A budget between the plan and the costliest simulation is exceeded; one above both is kept."""
    more = 'margin = "auto"\n' + ERRORS + FLIGHT.format(seeds=8)
    tank = 'mass = "10 kg"\nspecific_impulse = "60 s"\n'
    mission = plan_mission(parse(swap(craft=tank, more=more)))
    planned, most = mission.delta_v.sum(axis=0), mission.flights.flight.delta_v.max(axis=0)
    burnt = 10.0 * -np.expm1(-most / (60.0 * 9.80665))
    k = int(np.argmax(most - planned))
    assert most[k] > 1.001 * planned[k]
    names = mission.scenario.names
    for share, kept in ((0.5, False), (1.001, True)):  # of the delta-v of the simulation beyond the plan
        for key, low, high, unit in (
            ("delta_v_budget", planned, most, "m/s"),
            ("propellant", mission.propellant.sum(axis=0), burnt, "kg"),
        ):
            limits = [
                f'"{low[j] + (share if j == k else 2.0) * abs(high[j] - low[j])} {unit}"' for j in range(2)
            ]
            text = swap(craft=f"{tank}{key} = [{', '.join(limits)}]", more=more)
            verdict = plan_mission(parse(text)).verdict
            assert verdict.ok == kept
            what = {"delta_v_budget": "delta-v"}.get(key, key)
            assert kept or str(verdict) == f"limits are not kept: {what} ({names[k]})"


def test_run_with_clear_simulations_is_clear(tmp_path: Path):
    (tmp_path / "roomy.toml").write_text(swap(more='margin = "auto"\n' + ERRORS + FLIGHT.format(seeds=30)))
    mission = cf.run(tmp_path / "roomy.toml")
    assert mission.verdict.ok
    assert mission.flights.flight.violated == 0.0
    assert len(mission.flights.flight.states) == 30
    assert "no zone is entered in 30 simulations, minimum " in str(mission.verdict)


def test_open_loop_simulation(tmp_path: Path):
    text = swap(craft='thrust_error = "2 %, 1 deg"', more='\n[simulation]\ncontrol = "open"\nseeds = 5\n')
    (tmp_path / "open.toml").write_text(text)
    mission = cf.run(tmp_path / "open.toml")
    own = cf.simulate(
        mission.paths, mission.scenario.field, "open", thrust_error=(0.02, np.radians(1.0)), seeds=5
    )
    assert np.array_equal(mission.flights.flight.states, own.states)


@pytest.mark.parametrize("case", [0, 11])
def test_row_equals_its_simulation(missions, case: int):
    """Sampled values apply to the simulation; the plan uses the values of the file."""
    found, scenario = row(missions, case), missions.scenario
    truth, mission = case_of(scenario, case).truth, plan_mission(case_of(scenario, case))
    density, seen = truth.orbit.field.density, truth.navigation.position
    assert density != scenario.orbit.field.density
    air, known = (
        cf.Drag(value, 500e3, 60e3, ballistic=[one.ballistic for one in craft], chief=0.02)
        for value, craft in ((density, truth.craft), (5.2e-13, scenario.craft))
    )
    chief = scenario.chief
    own = cf.simulate(
        mission.paths,
        cf.Field(chief, drag=air),
        feedback=cf.Feedback(60.0, 600.0, delay=truth.feedback.delay),
        navigation=cf.Navigation(seen, 3e-4),
        zones=cf.Sphere(30.0),
        known=cf.Field(chief, drag=known),
        thrust_error=(0.01, np.radians(1.0)),
        seeds=[int(found["flight_seed"])],
    )
    assert found["simulated_ratio"] == own.least_ratio
    assert found["simulated_end_m"] == own.greatest_end == found["stage_2_end_m"]
    assert found["simulated_off_m"] == own.greatest_deviation
    assert found["simulated_delta_v_m_s"] == own.delta_v.sum()
    assert found["field_delta_v_m_s"] == own.field_delta_v.sum()
    assert found["feedback_delta_v_m_s"] == own.feedback_delta_v.sum()
    assert [found[f"{name}_simulated_delta_v_m_s"] for name in "AB"] == own.delta_v[0].tolist()
    assert found["delta_v_m_s"] == pytest.approx(own.planned_delta_v.sum(), rel=1e-12)
    assert (found["status"] == "met") == (own.least_ratio >= 1.0)
    assert missions.scenario.flights.seeds == 100  # of a run; a case has one of its own


def test_samples_come_from_the_philox_blocks(missions):
    """Compare with NumPy's generator: block K of the key's stream if all spacecraft share one value."""
    case = 5
    found = case_of(missions.scenario, case)

    def uniform(key: str, counter: int) -> float:
        return float(block(7, key, counter)[0])

    truth = found.truth
    drawn = 5.2e-13 + 4e-13 * (2.0 * uniform("orbit.field.density", case) - 1.0)
    assert truth.orbit.field.density == drawn
    assert truth.navigation.position == 0.1 + 0.05 * (2.0 * uniform("navigation.position", case) - 1.0)
    assert truth.feedback.delay == (0.0 if uniform("feedback.delay", case) < 0.5 else 20.0)
    for c in range(2):
        nominal = missions.scenario.craft[c].ballistic
        own = nominal + 0.005 * (2.0 * uniform("craft.ballistic", 2 * case + c) - 1.0)
        assert truth.craft[c].ballistic == own
        assert found.craft[c].ballistic == nominal  # used by plans
    assert found.flight_seed == int(words(7, "flight", case)[0])
    random = block(7, "craft.position", 2 * case)[:3]
    assert truth.craft[0].position == tuple(np.array([0.0, 0.0, 120.0]) + ndtri(random))


def test_violations_and_delta_v_are_counted(missions):
    """Violations, minimum ratios and delta-v by cause follow from the rows."""
    ratios, spent = missions.column("simulated_ratio"), missions.column("simulated_delta_v_m_s")
    flights = missions.flights
    assert 0 < flights.entered == (ratios < 1.0).sum() < len(missions) == flights.count
    assert missions.counts["unmet"] == flights.entered  # all else is met
    assert flights.nearest == (ratios.min(), int(ratios.argmin()))
    assert sum(flights.mean.values()) == pytest.approx(spent.mean(), rel=1e-12)
    assert flights.mean["plan"] == pytest.approx(missions.column("delta_v_m_s").mean(), rel=1e-12)
    (headline,) = cf.plots.distribution(
        ratios, "least distance [x zone]", 0.05
    ).texts  # has the same quantiles
    for share, said in ((0.5, "median"), (0.05, "5 %")):
        middle = flights.nearness.quantiles[share].value
        assert middle == pytest.approx(np.quantile(ratios, share), rel=1e-12)
        assert f"{said} {middle:.4g}" in headline.get_text()
    assert missions.spreads["simulated: delta-v of all craft [m/s]"].worst[0][0] == spent.max()
    captions = [one.caption for one in missions_report(missions).pictures]
    assert captions[:2] == ["Delta-v of all craft, as planned", "Simulated delta-v of all craft"]
    reason = missions.column("reason")[flights.nearest[1]]
    assert reason == f"a zone is entered in simulation, minimum {ratios.min():.4f} x zone"


def test_simulation_without_errors_agrees_with_an_integrator():
    """DOP853 with the commanded thrust, J2 and the density of a case agrees to 2 cm.

    The sampled density moves the spacecraft by metres.
    """
    study = STUDY[: STUDY.index('"navigation')].replace("4e-13", "5e-12")
    text = swap(
        field=f"zonals = 2, {AIR.replace('5.2e-13', '6e-12')}",
        chief='ballistic = "0.02 m^2/kg"',
        craft='ballistic = ["0.02 m^2/kg", "0.022 m^2/kg"]',
        more='\n[simulation]\ncontrol = "open"\n' + study,
    )
    scenario = parse(text, "air.toml")
    mission = plan_mission(case_of(scenario, 3))
    truth, plan = mission.scenario.truth, mission.paths
    density, chief = truth.orbit.field.density, scenario.chief
    coefficients = np.array([0.02, *(one.ballistic for one in truth.craft)])[:, None]
    table = cf.compensated_thrust(plan, scenario.field)

    def felt(states: np.ndarray) -> np.ndarray:
        places = states[:, :3]
        wind = states[:, 3:] - np.cross([0.0, 0.0, EARTH_SPIN], places)
        height = np.linalg.norm(places, axis=1, keepdims=True) - 6378137.0
        air = density * np.exp(-(height - 500e3) / 60e3)
        return (
            textbook(places) - 0.5 * air * coefficients * np.linalg.norm(wind, axis=1, keepdims=True) * wind
        )

    first = np.array(chief.state)
    start = cf.elements.inertial_from_relative(
        first, plan.state(0.0), acceleration=felt(np.tile(first, (3, 1)))[0]
    )
    commanded = table.commanded

    def rates(t, y):
        states = y.reshape(-1, 6)
        pull = felt(states)
        now = np.array([[np.interp(t, table.times, axis) for axis in craft.T] for craft in commanded])
        pull[1:] += now @ axes_of(states[0])
        return np.hstack([states[:, 3:], pull]).ravel()

    state = np.vstack([first, start]).ravel()
    span = 0.0, float(plan.end.max())
    states = solve_ivp(rates, span, state, "DOP853", rtol=1e-11, atol=1e-6, max_step=20.0).y[:, -1]
    states = states.reshape(-1, 6)
    place = (states[1:, :3] - states[0, :3]) @ axes_of(states[0]).T
    flight = mission.flights.flight
    assert flight.states[0, :, -1, :3] == pytest.approx(place, abs=0.02)  # m: a table of 10 s, read linearly
    assert flight.greatest_end > 1.0
    known = replace(mission.scenario, drawn_flight=None)
    assert cf.simulate(plan, known.field, "open").greatest_end < 1e-3


def test_command_writes_rows_and_pages(missions, tmp_path: Path, capsys):
    (tmp_path / "many.toml").write_text(MANY)
    assert main(["study", str(tmp_path / "many.toml"), "--out", str(tmp_path / "out")]) == 1
    printed = capsys.readouterr().out
    (entered,) = [
        line.split() for line in printed.splitlines() if line.startswith("keep-out zone violated  ")
    ]
    assert int(entered[3]) == missions.flights.entered
    rows = pyarrow.parquet.read_table(tmp_path / "out" / "cases").to_pydict()
    for name in missions.kind.names:
        np.testing.assert_array_equal(rows[name], missions.column(name))
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    share = missions.flights.entered / 20
    assert summary["flights"]["entered"]["share"] == share
    assert summary["flights"]["entered"]["low"] < share < summary["flights"]["entered"]["high"]
    nearest = missions.flights.nearest[1]
    assert (tmp_path / "out" / f"case-{nearest}.html").stat().st_size > 10_000
    for name in ("delta-v", "simulated-delta-v", "simulated-ends", "simulated-ratios"):
        assert (tmp_path / "out" / f"{name}.png").is_file()
    command = ["run", str(tmp_path / "many.toml"), "--case", str(nearest), "--out", str(tmp_path / "case")]
    assert main([*command, "--no-viewer"]) == 1
    replayed = json.loads((tmp_path / "case" / "summary.json").read_text())
    assert replayed["flights"]["flights"] == 1
    assert min(one["ratio"] for one in replayed["flights"]["stages"]) == missions.flights.nearest[0]
    assert replayed["verdict"] == missions.column("reason")[nearest]
    page = (tmp_path / "case" / "report.html").read_text()
    assert f"closeform run many.toml --case {nearest} --out {tmp_path / 'case'}" in page
    assert "planned and simulated" in page
    assert "median flight" not in page  # of one there is none
    drawn = "orbit.field.density " + f"{case_of(missions.scenario, nearest).truth.orbit.field.density:.4g}"
    assert drawn in capsys.readouterr().out


THICK = 'density = "1e-10 kg/m^3", at_altitude = "500 km", scale_height = "60 km"'
WEAK = """\
mass = "12 kg"
max_thrust = ["20 mN", "2 mN"]
thrusters = "rtn"
period = "30 s"
ballistic = ["0.02 m^2/kg", "{} m^2/kg"]
"""


def dragged(ballistic: float, more: str) -> str:
    """Return a scenario in which the drag of B exceeds its thrust for a large ballistic coefficient."""
    air = {"field": f"zonals = 2, {THICK}", "chief": IN_AIR["chief"]}
    return swap(**air, craft=WEAK.format(ballistic), more=ERRORS + FLIGHT.format(seeds=3) + more)


def test_plan_beyond_the_thrusters_is_reported(tmp_path: Path, capsys):
    """Thruster 3, along the track, must compensate the differential drag of B."""
    (tmp_path / "weak.toml").write_text(dragged(0.2, ""))
    assert main(["run", str(tmp_path / "weak.toml"), "--out", str(tmp_path / "run"), "--no-viewer"]) == 1
    printed = " ".join(capsys.readouterr().out.split())
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    why = summary["grounded"]
    drag = 0.5 * 1e-10 * 7620.0**2 * 0.18  # m/s^2, at the speed of the orbit
    begin, _, rest = why.partition(" s thruster 3 must provide ")
    assert begin.startswith("acceleration: B: at about ")
    assert float(rest.split()[0]) == pytest.approx(drag, rel=0.1)  # the air turns with the Earth, thrust adds
    assert rest.endswith("above its 0.0001667 m/s²; plan with a max_acceleration or more time")
    assert summary["verdict"] == f"cannot be simulated: {why}"
    assert f"Not simulated: {why}" in printed
    assert f"cannot be simulated: {why}" in (tmp_path / "run" / "report.html").read_text()
    loaded, mission = cf.load(tmp_path / "run"), cf.run(tmp_path / "weak.toml")
    assert np.array_equal(loaded.paths.arcs, mission.paths.arcs)
    assert (mission.grounded, mission.flights, mission.verdict.status) == (why, None, 1)
    assert main(["simulate", str(tmp_path / "run"), "--out", str(tmp_path / "flights")]) == 2
    assert capsys.readouterr().err == f"{tmp_path / 'run'}: cannot be simulated: {why}\n"


def test_infeasible_cases_are_not_counted_as_simulations():
    """Their rows have the plan and a reason; the same thrust is sufficient in other cases."""
    study = STUDY[: STUDY.index("[study.vary]")].replace("cases = 20", "cases = 6")
    draws = '[study.vary]\n"craft.max_thrust" = { uniform = "1 mN" }\n'
    missions = evaluated(parse(dragged(0.0612, study + draws), "weak.toml"))
    status, reasons = missions.column("status"), missions.column("reason")
    grounded = status == "refused"
    assert 0 < grounded.sum() < 6
    for why, off in zip(reasons, grounded, strict=True):
        assert ("cannot be simulated: acceleration: B: at about " in why) == off
    assert (missions.column("delta_v_m_s") > 0.1).all()  # m/s, of the plan
    for name in ("end_s", "simulated_end_m", "simulated_delta_v_m_s", "simulated_ratio"):
        assert np.array_equal(np.isnan(missions.column(name)), grounded)
    assert missions.flights.count == 6 - grounded.sum()
    assert missions.counts["refused"] == grounded.sum()
    assert f"{grounded.sum()} of 6 cases not feasible: " in missions.reason
