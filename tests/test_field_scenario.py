"""Scenarios with a field: predictions of the model error against an independent integrator."""

import json
from pathlib import Path

import numpy as np
import pytest

import closeform as cf
from closeform.cli.app import main
from closeform.dynamics.model_error_estimate import COASTS, MOVES, model_error
from closeform.mission.mission import plan_mission
from closeform.scenario import ScenarioError, parse
from field_scenario import AIR, swap
from simulated import flown_apart, textbook

pytestmark = pytest.mark.usefixtures("undrawn")

BALLISTIC = 'ballistic = ["0.02 m^2/kg", "0.022 m^2/kg"]'
CHIEF_FEELS = 'ballistic = "0.02 m^2/kg"'


def test_predicted_violation_is_in_the_verdict():
    mission = plan_mission(parse(swap()))
    (stage,) = mission.results
    times = np.linspace(0.0, stage.end, 801)
    flown = flown_apart(stage.after.paths, mission.scenario.field, times)
    off = np.linalg.norm(flown[:, -1] - stage.after.paths.position(stage.end), axis=-1)
    assert stage.validity.ends == pytest.approx(off, rel=0.02)  # 2 m
    least = np.linalg.norm(flown[0] - flown[1], axis=-1).min() / 30.0
    assert least < 0.99  # the plan touches the zone
    assert stage.validity.simulated[0] == pytest.approx(least, abs=5e-4)  # 15 mm
    (warning,) = mission.warnings
    assert warning.startswith("stage 1: without compensation, in the high-fidelity model (J2), A and B enter")
    verdict = mission.verdict
    assert verdict.predicted == stage.validity.simulated[0]
    assert str(verdict).startswith("clear as planned, but not as predicted in the high-fidelity model: ")
    assert f"minimum {stage.validity.simulated[0]:.4f} x zone in J2" in str(verdict)
    assert verdict.status == 1
    assert not verdict.clear
    assert not verdict.conflicts


def test_eccentricity_warning_only_without_a_field():
    """The prediction in a field covers eccentricity, so that no warning is needed."""
    text = swap().replace("eccentricity = 0.001", "eccentricity = 0.002")
    assert not any("eccentricity" in line for line in plan_mission(parse(text)).warnings)
    assert any("eccentricity" in line for line in plan_mission(parse(text), predicted=False).warnings)


def test_printed_prediction_and_results(tmp_path: Path, capsys):
    file = tmp_path / "swap.toml"
    file.write_text(swap(f"zonals = 4, {AIR}", CHIEF_FEELS, BALLISTIC))
    assert main(["run", str(file), "--out", str(tmp_path / "out"), "--no-viewer"]) == 1
    lines = capsys.readouterr().out.splitlines()
    at = next(k for k, line in enumerate(lines) if line.startswith("Stage 1"))
    assert lines[at + 1].startswith("In J2 to J4 and drag, without compensation, ")
    assert " (entered), A and B; as planned 1.0000. The model error of Hill's equations is " in lines[at + 2]
    assert any(line.startswith("Warning: stage 1: without compensation") for line in lines)
    given = json.loads((tmp_path / "out" / "summary.json").read_text())["stages"][0]["in_field"]
    assert given["field"] == "J2 to J4 and drag"
    assert given["least_ratio"] < 0.99 < given["planned_ratio"]
    assert f"{max(given['ends_m'].values()):.3g} m from the plan" in lines[at + 1]
    assert "Model error with J2 to J4 and drag</td>" in (tmp_path / "out" / "report.html").read_text()
    loaded = cf.load(tmp_path / "out").scenario
    assert loaded.field.drag.ballistic.tolist() == [0.02, 0.022]
    assert loaded.field.drag.chief == 0.02
    assert cf.simulate(cf.load(tmp_path / "out").paths, loaded.field, **loaded.flight).greatest_end < 1e-3


@pytest.mark.parametrize(
    ("orbit", "expected"),
    [
        ('altitude = "500 km"', "at 500 km, e not known"),
        ('mean_motion = "0.01 deg/s"\nlatitude = "3 deg"', "at 17187 km"),
        ('altitude = "500 km"\nmu = "42828 km^3/s^2"', None),  # of Mars
        ('period = "60 min"', None),  # below the ground
    ],
)
def test_model_error_estimate_without_a_field(orbit: str, expected: str | None, tmp_path: Path, capsys):
    file = tmp_path / "coast.toml"
    text = swap().split("[orbit]")[0] + f"[orbit]\n{orbit}\n\n[craft]" + swap().split("[craft]")[1]
    file.write_text(text.split("[[stage]]")[0] + '[[stage]]\ndo = "coast"\nfor = "90 min"\n')
    main(["run", str(file), "--out", str(tmp_path / "out"), "--no-viewer"])
    printed = capsys.readouterr().out
    assert ("Model error of Hill" in printed) == (expected is not None)
    if expected is not None:
        assert expected in printed


def simulated_missions(craft: int, kind: str, count: int) -> np.ndarray:
    """Return whether the furthest spacecraft stays within both estimates in simulation."""
    draws, within = np.random.default_rng(craft), []
    for k in range(count):
        e, around, latitude = 10.0 ** draws.uniform(-4.0, -1.7), *draws.uniform(0.0, 2.0 * np.pi, 2)
        elements = [draws.uniform(6.778e6, 7.178e6), latitude, e * np.cos(around), e * np.sin(around)]
        inclination = np.arccos(draws.uniform(-1.0, 1.0))
        chief = cf.Chief.from_elements("2026-11-22T12:00:00", [*elements, inclination, 0.0])
        orbit, size = chief.orbit, 10.0 ** draws.uniform(2.0, 3.3)
        states = draws.normal(size=(2, craft, 6)) * size * np.repeat([0.5, 0.5 * orbit.mean_motion], 3)
        turns = 2.0 ** draws.uniform(-2.0, 1.0)
        if kind == MOVES:
            states[..., 3:] *= k % 2
            path = orbit.transfer(*states, turns * orbit.period)
        else:
            states[0, :, 4] = -2.0 * orbit.mean_motion * states[0, :, 0]
            path = orbit.coast(states[0], turns * orbit.period)
        flight = cf.simulate(path, cf.Field(chief), "open", cancel=False)
        planned = path.state(flight.times)[..., :3]
        off = np.linalg.norm(flight.states[0, ..., :3] - planned, axis=-1).max()
        reach = np.linalg.norm(planned, axis=-1).max()
        a, eccentricity = chief.semi_major_axis, chief.eccentricity
        within.append(off <= np.array(model_error(reach, turns, a, eccentricity, craft, kind)))
    return np.array(within)


@pytest.mark.parametrize(
    ("craft", "kind"),
    [
        (1, MOVES),
        (8, COASTS),
        pytest.param(8, MOVES, marks=pytest.mark.slow),
        pytest.param(1, COASTS, marks=pytest.mark.slow),
    ],
)
def test_coverage_of_the_model_error_estimate(craft: int, kind: str):
    """Half and 95 % of 60 missions are within; the limits hold for 99.7 % of samples."""
    half, most = simulated_missions(craft, kind, 60).sum(axis=0)
    assert 18 <= half <= 42
    assert most >= 50


def test_inertial_starts_in_a_field():
    """An inertial start is the initial state of the simulation."""
    own = np.array([6878e3 + 300.0, 500.0, 900.0, -3.0, 4726.0, 5966.0])
    place = ", ".join(
        " ".join(f"{one:.9f}" for one in part) + unit for part, unit in ((own[:3], " m"), (own[3:], " m/s"))
    )
    text = swap().replace('latitude = "40 deg"', 'latitude = "0 deg"').split("[[stage]]")[0]
    text = text.replace(
        'position = ["0 0 120 m", "0 0 -120 m"]\nvelocity = "0 0 0 m/s"',
        "start = [\n" + f'  {{ inertial = "{place}" }},\n' + '  { palmer = "0 900 0 0 0 0 m" },\n]',
    )
    scenario = parse(text + '[[stage]]\ndo = "coast"\nfor = "90 min"\n')
    start = scenario.states(scenario.orbit.build())[0]
    origin = scenario.chief.state
    back = cf.elements.inertial_from_relative(origin, start, acceleration=textbook(origin[:3]))
    assert back == pytest.approx(own, rel=1e-10)


def test_errors_and_limits_of_each_spacecraft():
    own = 'thrust_error = ["0 %, 0 deg", "5 %, 0 deg"]\nmax_acceleration = ["5 mm/s^2", "8 mm/s^2"]'
    mission = plan_mission(parse(swap(craft=own)))
    given, (stage,) = mission.scenario.flight, mission.results
    assert given["max_acceleration"].tolist() == [5e-3, 8e-3]
    one = cf.simulate(stage.after.paths, mission.scenario.field, "open", **given, seeds=5)
    assert one.ends[:, 0].max() < 1e-3 < 0.1 < one.ends[:, 1].max()
    limited = cf.simulate(stage.after.paths, mission.scenario.field, max_acceleration=[1e-9, 1.0])
    assert limited.limited[0].tolist() == pytest.approx([1.0, 0.0], abs=0.02)


def test_delayed_feedback_and_correlated_navigation():
    text = swap().replace(
        "[craft]",
        '[feedback]\nevery = "2 min"\ndelay = "20 s"\n\n'
        '[navigation]\nposition = "10 cm"\ncorrelation = "5 min"\n\n[craft]',
        1,
    )
    given = parse(text).flight
    assert given["feedback"] == cf.Feedback(every=120.0, delay=20.0)
    assert given["navigation"] == cf.Navigation(position=0.1, correlation=300.0)


MISTAKES = {  # independent mistakes within tables
    "zonals = 2,": "zonal = 2,",
    '"5.2e-13 kg/m^3"': '"5.2e-13 kg"',
    "eccentricity = 0.001": "excentricity = 0.001",
    'velocity = "0.3 mm/s"': 'velocity = "0.3 mm"',
    'every = "60 s"': 'evry = "60 s"',
    '"1 %, 1 deg"': '"1 %"',
    "max_acceleration": "max_accelerate",
    "seeds = 100": "seeds = 0",
}


def messages_of(text):
    with pytest.raises(ScenarioError) as found:
        parse(text, "flown.toml")
    return set(found.value.lines)


def test_all_mistakes_within_tables_are_reported_at_once():
    """Messages of all mistakes are those of each alone."""
    text = good = (Path(__file__).parents[1] / "examples" / "simulated_cases.toml").read_text()
    alone = set[str]()
    for old, new in MISTAKES.items():
        assert good.count(old) == 1
        text, alone = text.replace(old, new), alone | messages_of(good.replace(old, new))
    assert len(alone) >= len(MISTAKES)
    assert messages_of(text) == alone
