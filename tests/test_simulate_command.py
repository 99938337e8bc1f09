"""closeform simulate: all stages of a run in one simulation, against another integrator."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest
from scipy.integrate import solve_ivp

import closeform as cf
from closeform.cli.app import main
from closeform.mission.mission import plan_mission
from closeform.mission.mission_result import Mission
from closeform.mission.simulation_verdict import Entered
from closeform.mission.stage_margin import reference_errors
from closeform.mission.stage_start import BurnRoom, StageStart
from closeform.results.load import LoadedRun
from closeform.scenario import parse
from field_scenario import swap
from pages import Seen
from simulated import axes_of, textbook

pytestmark = pytest.mark.usefixtures("undrawn")

COAST = '\n[[stage]]\ndo = "coast"\nfor = "10 min"\n'
NAVIGATION = '\n[navigation]\nposition = "10 cm"\nvelocity = "0.3 mm/s"\n'


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of a run of two stages: two spacecraft pass at the edge of their zone, then they coast."""
    place = tmp_path_factory.mktemp("simulated")
    (place / "swap.toml").write_text(swap(more=COAST + NAVIGATION))
    status = main(["run", str(place / "swap.toml"), "--out", str(place / "swap-results"), "--no-viewer"])
    assert status == 1  # on the zone's boundary as planned, inside it in the high-fidelity model
    return place / "swap-results"


def simulated(run: Path, place: Path, *options: str) -> tuple[int, dict, dict[str, dict[str, np.ndarray]]]:
    """Return the status, the summary and the tables of a simulated run."""
    shutil.rmtree(place, ignore_errors=True)
    status = main(["simulate", str(run), "--out", str(place), *options])
    tables = {}
    for file in place.glob("*.parquet"):
        read = pyarrow.parquet.read_table(file)
        tables[file.stem] = {name: read[name].to_numpy() for name in read.column_names}
    return status, json.loads((place / "summary.json").read_text()), tables


def swapped(place: Path, text: str) -> tuple[LoadedRun, dict]:
    """Run a scenario; return the loaded run and its summary."""
    place.mkdir(exist_ok=True)
    (place / "swap.toml").write_text(text)
    main(["run", str(place / "swap.toml"), "--out", str(place / "run"), "--no-viewer"])
    return cf.load(place / "run"), json.loads((place / "run" / "summary.json").read_text())


@pytest.fixture(scope="module")
def margin_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, LoadedRun, dict]:
    """Run of one stage that finds its margin; navigation errors only."""
    place = tmp_path_factory.mktemp("margin")
    return place / "run", *swapped(place, swap(more='margin = "auto"\n' + NAVIGATION))


@pytest.fixture(scope="module")
def impulse_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run of one stage of impulses without navigation errors."""
    place = tmp_path_factory.mktemp("impulses")
    swapped(place, swap(more='cost = "delta-v"\n'))
    return place / "run"


def test_commanded_thrust_reaches_the_planned_end(run: Path, tmp_path: Path):
    """Integrate the commanded thrust of both stages in an independent J2 model."""
    _, _, tables = simulated(run, tmp_path / "out", "--seeds", "2")
    loaded, rows = cf.load(run), tables["commanded"]
    origin = loaded.scenario.chief.state
    start = cf.elements.inertial_from_relative(
        origin, loaded.paths.state(0.0), acceleration=textbook(origin[:3])
    )
    state = np.vstack([origin, start]).ravel()
    for stage in loaded.results:
        mine = [(rows["craft"] == name) & (rows["stage"] == stage.number) for name in loaded.names]
        times = rows["time_s"][mine[0]]
        table = np.array([[rows[f"u{axis}_m_s2"][some] for axis in "xyz"] for some in mine])

        def rates(t, y, times=times, table=table):
            states = y.reshape(-1, 6)
            felt = textbook(states[:, :3])
            now = np.array([[np.interp(t, times, axis) for axis in craft] for craft in table])
            felt[1:] += now @ axes_of(states[0])
            return np.hstack([states[:, 3:], felt]).ravel()

        span = stage.start, stage.end
        state = solve_ivp(rates, span, state, "DOP853", rtol=1e-11, atol=1e-6, max_step=20.0).y[:, -1]
    states = state.reshape(-1, 6)
    place = (states[1:, :3] - states[0, :3]) @ axes_of(states[0]).T
    off = np.linalg.norm(place - loaded.paths.position(stage.end), axis=1)
    assert off.max() < 0.02  # m; 2 m without compensation; the table of 10 s is interpolated linearly


def test_stages_start_at_the_simulated_end_of_the_previous_stage(run: Path, tmp_path: Path):
    options = ("--control", "open", "--thrust-error", "2 %, 1 deg", "--seeds", "3")
    _, summary, tables = simulated(run, tmp_path / "out", *options)
    loaded = cf.load(run)
    first = cf.simulate(
        loaded.results[0].after.paths,
        loaded.scenario.field,
        "open",
        thrust_error=(0.02, np.radians(1)),
        seeds=3,
    )
    ends = tables["ends"]
    assert ends["end_m"][ends["stage"] == 1] == pytest.approx(first.ends.ravel(), abs=1e-3)
    assert first.ends.max() > 0.5
    later = ends["end_m"][ends["stage"] == 2].reshape(3, 2)
    off = first.states[:, :, -1] - loaded.results[0].after.paths.state(first.times[-1:])[:, -1]
    drifted = off @ loaded.orbit.transition(600.0).T  # deviations in Hill's equations
    assert later == pytest.approx(np.linalg.norm(drifted[..., :3], axis=-1), rel=0.02)
    assert [one["number"] for one in summary["stages"]] == [1, 2]
    assert tables["flights"]["end_m"] == pytest.approx(later.ravel(), rel=1e-12)


def test_violations_are_counted_and_give_status_1(run: Path, tmp_path: Path, capsys):
    status, summary, tables = simulated(run, tmp_path / "out", "--seeds", "30")
    ratios = tables["ratios"]
    entered = np.unique(ratios["seed"][ratios["ratio"] < 1.0])
    assert 5 < len(entered) < 30  # the plan touches the zone: about half of them
    assert (status, summary["status"], summary["violated"]) == (1, 1, len(entered))
    assert summary["worst"] == ratios["seed"][np.argmin(ratios["ratio"])]
    worst = cf.closest_approach(*two(tables["paths"], cf.load(run)), cf.Sphere(30.0))
    assert ratios["ratio"].min() == pytest.approx(worst.ratio, abs=1e-6)
    printed = capsys.readouterr().out
    assert f"violated: zones are entered in {len(entered)} of 30 simulations" in printed
    assert f"{ratios['ratio'].min():.4f} x zone" in printed


def two(rows: dict[str, np.ndarray], loaded: LoadedRun) -> list[cf.Path]:
    """Return the paths of both spacecraft through the states of a table."""
    columns = ("x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s")
    found = []
    for name in loaded.names:
        mine = rows["craft"] == name
        states = np.stack([rows[key][mine] for key in columns], axis=1)
        found.append(loaded.orbit.sampled(rows["time_s"][mine], states))
    return found


def test_zones_enlarged_by_the_tube_are_kept(run: Path, tmp_path: Path, capsys):
    """Plan with the zone plus the tube; judge the simulations by the zone itself."""
    loaded = cf.load(run)
    room = cf.tube(loaded.orbit, cf.Feedback(), loaded.scenario.flight["navigation"]).of_a_pair
    place = tmp_path / "swap.toml"
    place.write_text(swap(more=COAST + NAVIGATION).replace('"30 m"', f'"{30.0 + room} m"'))
    main(["run", str(place), "--out", str(tmp_path / "roomy"), "--no-viewer"])
    capsys.readouterr()
    _, summary, tables = simulated(tmp_path / "roomy", tmp_path / "out", "--seeds", "30")
    assert (tables["ratios"]["ratio"] * (30.0 + room)).min() > 30.0
    assert summary["tube"]["of_a_pair_m"] == pytest.approx(room)
    assert "99.997 % of simulations stay within " in capsys.readouterr().out  # 4 sigma


def test_options_override_the_scenario(run: Path, tmp_path: Path, capsys):
    _, plain, _ = simulated(run, tmp_path / "out", "--seeds", "2")
    options = ("--every", "2 min", "--navigation", "1 m, 1 mm/s", "--thrust-error", "1 %, 1 deg")
    _, changed, _ = simulated(run, tmp_path / "out", "--seeds", "2", *options)
    assert plain["navigation"]["position_m"] == 0.1
    assert plain["feedback"] == {"every_s": 60.0, "horizon_s": 600.0, "impulses": 0, "delay_s": 0.0}
    assert (changed["feedback"]["every_s"], changed["feedback"]["horizon_s"]) == (120.0, 600.0)
    assert (changed["navigation"]["position_m"], changed["navigation"]["velocity_m_s"]) == (1.0, 1e-3)
    assert changed["thrust_error"] == [[0.01, pytest.approx(np.radians(1.0))]]
    assert 'closeform simulate swap-results --every "2 min"' in changed["command"]
    capsys.readouterr()
    assert main(["simulate", str(run), "--horizon", "30 s"]) == 2
    expected = "--horizon: 30 s is shorter than the 60 s between measurements; increase the horizon\n"
    assert capsys.readouterr().err == expected


def test_runs_without_a_field_are_refused(tmp_path: Path, capsys):
    swapped(tmp_path, swap().replace("field = { zonals = 2 }\n", ""))
    capsys.readouterr()
    assert main(["simulate", str(tmp_path / "run"), "--out", str(tmp_path / "flights")]) == 2
    assert re.match(rf"{re.escape(str(tmp_path / 'run'))}: .*field", capsys.readouterr().err)
    assert not (tmp_path / "flights").exists()


def test_given_margin_is_added_to_the_zone(tmp_path: Path):
    loaded, summary = swapped(tmp_path, swap(more='margin = "0.7 m"\n'))
    pair = [loaded.paths[0], loaded.paths[1]]
    assert cf.closest_approach(*pair, cf.Sphere(30.7)).ratio == pytest.approx(1.0, abs=1e-6)
    assert summary["stages"][0]["margin_m"] == 0.7


AMONG = """
[[stage]]
do = "avoid"
craft = "A"
to = { position = "0 0 -120 m", velocity = "0 0 0 m/s" }
within = "0.4 orbits"
margin = "auto"
"""


def among(more: str, craft: str = "") -> str:
    """Return a scenario in which one spacecraft moves past another, which coasts."""
    alone = swap(craft=craft).split("[[stage]]")[0].replace("0 0 -120 m", "0 3 0 m")
    return alone + AMONG + more + NAVIGATION


def test_margin_of_avoid_is_that_of_a_pair(tmp_path: Path):
    """Both spacecraft deviate, and no zone is violated."""
    _, summary = swapped(tmp_path, among(""))
    needed = cf.tube(cf.load(tmp_path / "run").orbit, cf.Feedback(), cf.Navigation(0.1, 3e-4)).of_a_pair
    assert summary["stages"][0]["margin_m"] == pytest.approx(needed, rel=1e-2)
    status, found, _ = simulated(tmp_path / "run", tmp_path / "out", "--seeds", "40")
    assert (status, found["violated"]) == (0, 0)


SETS = """thrusters = "rtn"
mass = "12 kg"
max_thrust = "100 mN"
minimum_bit = "0.02 mm/s"
period = "30 s\""""


@pytest.mark.parametrize(
    ("more", "craft"),
    [
        ('cost = "delta-v"\n', 'thrust_error = "1 %, 1 deg"'),
        pytest.param("", SETS, marks=pytest.mark.slow),
        pytest.param('cost = "delta-v"\n', SETS, marks=pytest.mark.slow),
    ],
    ids=["impulses", "pulses", "burns"],
)
def test_margin_of_avoid_holds_for_impulses_and_pulses(more, craft, tmp_path: Path):
    """The coasting spacecraft is corrected as well."""
    _, summary = swapped(tmp_path, among(more, craft))
    assert 0.9 < summary["stages"][0]["margin_m"] < 6.0  # m; process noise alone needs 0.93
    status, found, _ = simulated(tmp_path / "run", tmp_path / "out", "--seeds", "60")
    assert (status, found["violated"]) == (0, 0)


@pytest.mark.parametrize(
    ("cost", "low", "high"), [("energy", 0.28, 1.0), ("delta-v", 0.9, 2.0)], ids=["thrust", "impulses"]
)
def test_automatic_margin_prevents_violations(cost: str, low: float, high: float, tmp_path: Path):
    """Navigation and thrust errors violate no zone, and the margin is not excessive."""
    errors = 'thrust_error = "1 %, 1 deg"'
    _, summary = swapped(
        tmp_path, swap(craft=errors, more=f'margin = "auto"\ncost = "{cost}"\n' + NAVIGATION)
    )
    margin = summary["stages"][0]["margin_m"]
    assert low < margin < high  # m; the lower value is what process noise alone needs
    status, found, tables = simulated(tmp_path / "run", tmp_path / "out", "--seeds", "60")
    assert (status, found["violated"]) == (0, 0)
    assert tables["ratios"]["ratio"].min() < 1.0 + margin / 30.0


EXECUTION = """execution = { magnitude = "1 %", pointing = "1 deg", impulse = GATES }
covariance = { position = "0.5 0.5 0.5 m" }""".replace("GATES", '{ speed = "1 mm/s", pointing = "1 deg" }')


def test_margin_covers_execution_errors_and_start_covariances(margin_run, tmp_path: Path, capsys):
    """The errors of the scenario are sampled in each simulation and printed; no zone is entered."""
    text = swap(craft=EXECUTION, more='margin = "auto"\n' + NAVIGATION)
    loaded, summary = swapped(tmp_path, text)
    assert summary["stages"][0]["margin_m"] > 1.1 * margin_run[2]["stages"][0]["margin_m"]
    capsys.readouterr()
    status, found, tables = simulated(tmp_path / "run", tmp_path / "out", "--seeds", "60")
    assert (status, found["violated"]) == (0, 0)
    expected = capsys.readouterr().out
    assert "Initial states: 0.5 m and 0 mm/s (1 sigma" in expected
    assert "Burns: 1 % and 1 deg each (1 sigma)\n" in expected
    assert "1 mm/s and 0 % along each, 0 mm/s and 1 deg across (1 sigma, Gates' model)\n" in expected
    scenario = loaded.scenario
    own = cf.simulate(loaded.paths, scenario.field, zones=scenario.zones, seeds=60, **scenario.flight)
    assert tables["flights"]["delta_v_m_s"] == pytest.approx(own.delta_v.ravel())
    gates = found["errors"][0]
    assert gates["gates"] == [1e-3, 0.0, 0.0, pytest.approx(np.radians(1.0))]
    assert (gates["magnitude"], gates["covariance"][1][1]) == (0.01, 0.25)


def test_margin_uses_the_errors_at_the_start_of_its_plan():
    """A first stage starts with the propagated covariance, a later one with the mission's errors."""
    scenario = parse(swap(craft=EXECUTION), "swap.toml")
    orbit, own = scenario.orbit.build(), tuple(craft.errors for craft in scenario.craft)
    first = StageStart(scenario, orbit, 1, scenario.states(orbit), 0.0, {}, np.ones(2), errors=own)
    coasted = orbit.transition(120.0) @ own[0].state @ orbit.transition(120.0).T
    (late,) = reference_errors(first.leaving(BurnRoom(before=120.0)), [0])
    assert late.state == pytest.approx(coasted, rel=1e-9, abs=1e-12)
    coast = plan_mission(parse(swap(craft=EXECUTION, more=COAST), "swap.toml")).results[:1]
    (later,) = reference_errors(replace(first, number=2, executed=coast, errors=()), [1])
    assert later.state == pytest.approx(own[1].state)
    assert (later.magnitude, late.magnitude) == (0.01, 0.01)


def test_margin_of_a_later_stage_covers_remaining_deviations():
    """Start deviations of metres remain after ten minutes of slow feedback; the margin covers them."""
    slow = NAVIGATION + '\n[feedback]\nevery = "5 min"\nhorizon = "1 h"\n\n[simulation]\nseeds = 200\n'
    off = 'covariance = { position = "2 2 2 m" }'

    def mission(margin: str, craft: str) -> Mission:
        text = swap(craft=craft, more=f'margin = "{margin}"\n' + slow)
        return plan_mission(parse(text.replace("[[stage]]\nname", f"{COAST}\n[[stage]]\nname"), "late.toml"))

    sure, found = (mission("auto", craft) for craft in ("", off))
    known, needed = (one.results[1].result.plan.padding for one in (sure, found))
    assert needed > 3.0 * known
    assert found.flights.flight.violated == 0.0
    assert found.flights.flight.least_ratio < 1.0 + needed / 30.0
    assert mission(f"{known} m", off).flights.flight.violated > 0.15


def test_margin_of_pulses_holds_after_a_coast():
    """Pulses also correct the coast, which the model error would move by about 10 m."""
    text = swap(craft=SETS, more='margin = "MARGIN"\n' + NAVIGATION + "\n[simulation]\nseeds = 40\n")
    text = text.replace("[[stage]]\nname", f"{COAST.replace('10 min', '72 min')}\n[[stage]]\nname")
    text = text.replace('"0 0 120 m", "0 0 -120 m"]', '"0 50 120 m", "0 0 -120 m"]', 1)
    found = plan_mission(parse(text.replace("MARGIN", "auto"), "pulses.toml"))
    assert found.flights.flight.violated == 0.0
    assert 1.0 < found.results[1].result.plan.padding < 3.0  # m
    assert plan_mission(parse(text.replace("MARGIN", "0 m"), "pulses.toml")).flights.flight.violated > 0.5


def test_execution_errors_given_by_an_option(run: Path, tmp_path: Path):
    _, _, tables = simulated(run, tmp_path / "out", "--seeds", "3", "--execution", "2 %, 1 deg")
    loaded, turn = cf.load(run), np.radians(1.0)
    given = loaded.scenario.flight | {"errors": cf.Uncertainty(None, 0.02, turn, (0.0, 0.02, 0.0, turn))}
    own = cf.simulate(loaded.paths, loaded.scenario.field, seeds=3, **given)
    assert tables["flights"]["delta_v_m_s"] == pytest.approx(own.delta_v.ravel())
    exact = cf.simulate(loaded.paths, loaded.scenario.field, seeds=3, **loaded.scenario.flight)
    assert np.abs(own.delta_v - exact.delta_v).max() > 1e-6


def test_replanning_needs_one_stage_of_continuous_thrust(
    run: Path, margin_run, impulse_run: Path, tmp_path: Path, capsys
):
    status, found, _ = simulated(margin_run[0], tmp_path / "out", "--seeds", "3", "--control", "replan")
    assert (status, found["control"], found["feedback"]["every_s"]) == (0, "replan", 300.0)
    for refused in (run, impulse_run):
        capsys.readouterr()
        assert main(["simulate", str(refused), "--control", "replan", "--out", str(tmp_path / "two")]) == 2
        assert re.match(f"--control: .*{re.escape(str(refused))}", capsys.readouterr().err)


def test_an_option_keeps_the_other_defaults_of_impulsive_feedback(impulse_run: Path, tmp_path: Path):
    _, found, _ = simulated(impulse_run, tmp_path / "out", "--seeds", "1", "--horizon", "20 min")
    assert found["feedback"] == {"every_s": 300.0, "horizon_s": 1200.0, "impulses": 6, "delay_s": 0.0}


SHOOTERS = """\
mass = "12 kg"
max_thrust = ["20 mN", "25 mN"]
thrusters = "rtn"
minimum_bit = "1 mN s"
period = "60 s"
specific_impulse = "60 s"
thrust_error = "2 %, 1 deg"
"""


def test_planned_impulses_have_no_tube(tmp_path: Path, capsys):
    """The tube of continuous thrust does not bound errors of single impulses."""
    feedback = '[feedback]\nevery = "60 s"\n'
    swapped(tmp_path, swap(more='cost = "delta-v"\n' + NAVIGATION + feedback))
    capsys.readouterr()
    _, summary, _ = simulated(tmp_path / "run", tmp_path / "out", "--seeds", "4")
    assert summary["feedback"]["impulses"] == 0
    assert "tube" not in summary
    assert "% of flights stay within" not in capsys.readouterr().out


def test_thrusters_apply_plan_and_corrections(tmp_path: Path):
    """Two stages follow the certified path of the pulses; each thruster and its propellant count."""
    text = swap(craft=SHOOTERS, more='margin = "3 m"\n' + COAST + NAVIGATION)
    loaded, _ = swapped(tmp_path, text)
    _, found, tables = simulated(tmp_path / "run", tmp_path / "led", "--seeds", "5")
    _, blind, _ = simulated(tmp_path / "run", tmp_path / "blind", "--seeds", "5", "--control", "open")
    assert found["feedback"] == {"every_s": 300.0, "horizon_s": 1800.0, "impulses": 6, "delay_s": 0.0}
    off, lost = (one["stages"][1]["end_median_m"] for one in (found, blind))
    assert off < 0.5 * lost
    pulses, more = tables["pulses"], tables["corrections"]
    worst = tables["flights"]["seed"] == found["worst"]
    for name, spent in zip(loaded.names, tables["flights"]["delta_v_m_s"][worst], strict=True):
        axes = ("radial_m_s", "along_track_m_s", "cross_track_m_s")
        fired = sum(
            np.abs(table[key][table["craft"] == name]).sum() for table in (pulses, more) for key in axes
        )
        assert spent == pytest.approx(fired, rel=1e-9)
        own, left = pulses["craft"] == name, 12.0  # kg; decreases with each pulse
        for given, burnt in zip(
            sum(np.abs(pulses[key][own]) for key in axes), pulses["propellant_kg"][own], strict=True
        ):
            assert burnt == pytest.approx(left * -np.expm1(-given / (60.0 * 9.80665)), rel=1e-9)
            left -= burnt
        assert left < 12.0
    row = max(found["spent"][:2], key=lambda one: one["delta_v_m_s"])
    assert row["propellant_kg"] == pytest.approx(12.0 * -np.expm1(-row["delta_v_m_s"] / (60.0 * 9.80665)))
    ended = loaded.results[0].after.paths.position(loaded.results[0].end)
    planned = loaded.results[0].planned.paths.position(loaded.results[0].end)
    assert 1e-3 < np.abs(ended - planned).max() < 1.0  # m; the plan differs from its pulses


def test_budgets_are_checked_against_the_costliest_simulation(
    margin_run: tuple[Path, LoadedRun, dict], tmp_path: Path, capsys
):
    """A budget that the plan keeps and one simulation exceeds is violated."""
    results, loaded, _ = margin_run
    spent = loaded.paths.delta_v
    _, free, _ = simulated(results, tmp_path / "out", "--seeds", "8")
    assert "limits" not in free["verdict"]
    most = np.array([row["delta_v_m_s"] for row in free["spent"][:2]])
    k = int(np.argmax(most - spent))
    name = loaded.names[k]
    assert most[k] > 1.001 * spent[k]
    for share, kept in ((0.5, False), (1.001, True)):
        budgets = [spent[j] + (share if j == k else 2.0) * abs(most[j] - spent[j]) for j in range(2)]
        craft = f"delta_v_budget = {json.dumps([f'{budget} m/s' for budget in budgets])}"
        place = tmp_path / f"{share}"
        _, summary = swapped(place, swap(craft=craft, more='margin = "auto"\n' + NAVIGATION))
        assert summary["limits_kept"]
        capsys.readouterr()
        status, found, _ = simulated(place / "run", tmp_path / "out", "--seeds", "8")
        assert (status, found["violated"]) == (0 if kept else 1, 0)
        expected = "limits are kept" if kept else f"limits are not kept: delta-v ({name})"
        assert found["verdict"] == f"{free['verdict']}; {expected}"
        warned = f"{name} needs {most[k]:.4g} m/s, its delta_v_budget is {budgets[k]:g} m/s"
        assert (warned in capsys.readouterr().out) != kept


def test_one_simulation_suffices_without_uncertainty(impulse_run: Path, tmp_path: Path, capsys):
    """No share of simulations and no tube is printed; feedback costs nothing, not rounding."""
    _, found, tables = simulated(impulse_run, tmp_path / "out", "--seeds", "3")
    printed = capsys.readouterr().out
    assert found["flights"] == len(found["worst_flights"]) == 1
    assert not any(word in printed for word in ("95 %", "Worst", "tube", "stay within"))
    spent = np.abs(tables["flights"]["feedback_delta_v_m_s"])
    assert ((spent == 0.0) | (spent > 1e-12)).all()


def test_intervals_are_printed_in_percent():
    """Wilson's interval of two in two is 34 to 100 %, not 1e+02."""
    assert str(Entered(2, 2, 0.9, True)).endswith("(95 % between 34 and 100 %), minimum 0.9000 x zone")


def test_viewer_shows_the_worst_simulation_stage_by_stage(run: Path, tmp_path: Path):
    """Closest approaches agree with a dense sampling of the worst simulation."""
    _, summary, tables = simulated(run, tmp_path / "out", "--seeds", "12")
    scene, loaded, worst = Seen.of((tmp_path / "out" / "viewer.html").read_text()).record, cf.load(run), []
    assert scene["title"].startswith(f"Simulation {summary['worst']} of 12, with the closest approach: ")
    given = [('Stage 1 "swap": reconfigure', 0.0), ("Stage 2: coast", loaded.results[0].end)]
    assert [(one["title"], one["start"]) for one in scene["stages"]] == [
        (title, pytest.approx(start, abs=1e-3)) for title, start in given
    ]
    paths = two(tables["paths"], loaded)
    for stage in loaded.results:
        times = np.linspace(stage.start, stage.end, 20_001)
        apart = np.linalg.norm(paths[0].position(times) - paths[1].position(times), axis=1)
        worst.append((times[np.argmin(apart)], apart.min()))
    passes = [one for one in scene["events"] if one["kind"] == "approach"]
    assert [one["stage"] for one in passes] == [1, 2]
    assert [one["time"] for one in passes] == [pytest.approx(time, abs=0.2) for time, _ in worst]
    near = {one["stage"]: one["distance"] for one in scene["approaches"]}
    assert near == {1: pytest.approx(worst[0][1], abs=1e-3), 2: pytest.approx(worst[1][1], abs=1e-3)}
