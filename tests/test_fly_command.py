"""closeform simulate: all stages of a run in one flight, in its field, against another integrator."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest
from scipy.integrate import solve_ivp

import closeform as cf
from closeform.cli.app import main
from closeform.mission.mission import fly
from closeform.mission.mission_result import Mission
from closeform.mission.simulation_verdict import Entered
from closeform.mission.stage_margin import flown_errors
from closeform.mission.stage_start import BurnRoom, StageStart
from closeform.results.load import LoadedRun
from closeform.scenario import parse
from field_scenario import swap
from pages import Seen
from test_field import axes_of, textbook

pytestmark = pytest.mark.usefixtures("unpainted")

COAST = '\n[[stage]]\ndo = "coast"\nfor = "10 min"\n'
NAVIGATION = '\n[navigation]\nposition = "10 cm"\nvelocity = "0.3 mm/s"\n'


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a run of two stages left: two craft pass at the edge of their zone, then they coast."""
    place = tmp_path_factory.mktemp("flown")
    (place / "swap.toml").write_text(swap(more=COAST + NAVIGATION))
    status = main(["run", str(place / "swap.toml"), "--out", str(place / "swap-results"), "--no-viewer"])
    assert status == 1  # at the edge of their zone as planned, inside it as predicted in the field
    return place / "swap-results"


def flown(run: Path, place: Path, *options: str) -> tuple[int, dict, dict[str, dict[str, np.ndarray]]]:
    """The status, the summary, and the tables of flights."""
    shutil.rmtree(place, ignore_errors=True)
    status = main(["simulate", str(run), "--out", str(place), *options])
    tables = {}
    for file in place.glob("*.parquet"):
        read = pyarrow.parquet.read_table(file)
        tables[file.stem] = {name: read[name].to_numpy() for name in read.column_names}
    return status, json.loads((place / "summary.json").read_text()), tables


def test_the_table_that_is_left_flies_the_plan(run: Path, tmp_path: Path):
    """Its thrust by DOP853 in a textbook's J2, both stages: the plan's end to some millimetres."""
    _, _, tables = flown(run, tmp_path / "out", "--seeds", "2")
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
    assert off.max() < 0.02  # m; as planned it is 2 m, and a table of 10 s is read linearly


def test_a_stage_begins_where_the_one_before_was_flown_to(run: Path, tmp_path: Path):
    options = ("--control", "open", "--thrust-error", "2 %, 1 deg", "--seeds", "3")
    _, summary, tables = flown(run, tmp_path / "out", *options)
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
    drifted = off @ loaded.orbit.transition(600.0).T  # Hill's equations of what is off
    assert later == pytest.approx(np.linalg.norm(drifted[..., :3], axis=-1), rel=0.02)
    assert [one["number"] for one in summary["stages"]] == [1, 2]
    assert tables["flights"]["end_m"] == pytest.approx(later.ravel(), rel=1e-12)


def test_entered_zones_are_counted_and_the_status_is_1(run: Path, tmp_path: Path, capsys):
    status, summary, tables = flown(run, tmp_path / "out", "--seeds", "30")
    ratios = tables["ratios"]
    entered = np.unique(ratios["seed"][ratios["ratio"] < 1.0])
    assert 5 < len(entered) < 30  # they touch as planned: a coin's chance
    assert (status, summary["status"], summary["violated"]) == (1, 1, len(entered))
    assert summary["worst"] == ratios["seed"][np.argmin(ratios["ratio"])]
    worst = cf.closest_approach(*two(tables["paths"], cf.load(run)), cf.Sphere(30.0))
    assert ratios["ratio"].min() == pytest.approx(worst.ratio, abs=1e-6)
    printed = capsys.readouterr().out
    assert f"violated: zones are entered in {len(entered)} of 30 flights" in printed
    assert f"{ratios['ratio'].min():.4f} x zone" in printed


def two(rows: dict[str, np.ndarray], loaded: LoadedRun) -> list[cf.Path]:
    """The paths of both craft through the states of a table."""
    columns = ("x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s")
    found = []
    for name in loaded.names:
        mine = rows["craft"] == name
        states = np.stack([rows[key][mine] for key in columns], axis=1)
        found.append(loaded.orbit.sampled(rows["time_s"][mine], states))
    return found


def test_larger_zones_than_the_tube_are_kept(run: Path, tmp_path: Path, capsys):
    """Planned at the zone plus what the tube says, flown against the zone itself."""
    loaded = cf.load(run)
    room = cf.tube(loaded.orbit, cf.Feedback(), loaded.scenario.flight["navigation"]).of_a_pair
    place = tmp_path / "swap.toml"
    place.write_text(swap(more=COAST + NAVIGATION).replace('"30 m"', f'"{30.0 + room} m"'))
    main(["run", str(place), "--out", str(tmp_path / "roomy"), "--no-viewer"])
    capsys.readouterr()
    _, summary, tables = flown(tmp_path / "roomy", tmp_path / "out", "--seeds", "30")
    assert (tables["ratios"]["ratio"] * (30.0 + room)).min() > 30.0
    assert summary["tube"]["of_a_pair_m"] == pytest.approx(room)
    assert "99.997 % of simulations stay within " in capsys.readouterr().out  # of 4 sigmas one way


def test_options_stand_for_what_the_scenario_says(run: Path, tmp_path: Path, capsys):
    _, plain, _ = flown(run, tmp_path / "out", "--seeds", "2")
    options = ("--every", "2 min", "--navigation", "1 m, 1 mm/s", "--thrust-error", "1 %, 1 deg")
    _, changed, _ = flown(run, tmp_path / "out", "--seeds", "2", *options)
    assert plain["navigation"]["position_m"] == 0.1
    assert plain["feedback"] == {"every_s": 60.0, "horizon_s": 600.0, "impulses": 0, "delay_s": 0.0}
    assert (changed["feedback"]["every_s"], changed["feedback"]["horizon_s"]) == (120.0, 600.0)
    assert (changed["navigation"]["position_m"], changed["navigation"]["velocity_m_s"]) == (1.0, 1e-3)
    assert changed["thrust_error"] == [[0.01, pytest.approx(np.radians(1.0))]]
    assert 'closeform simulate swap-results --every "2 min"' in changed["command"]
    capsys.readouterr()
    assert main(["simulate", str(run), "--horizon", "30 s"]) == 2
    said = "--horizon: 30 s is shorter than the 60 s between measurements; increase the horizon\n"
    assert capsys.readouterr().err == said


def test_the_page_says_how_errors_of_measurements_go_on(run: Path, tmp_path: Path):
    """White ones are new each time, those of a filter fade."""
    place = tmp_path / "filter.toml"
    place.write_text(swap(more=NAVIGATION + 'correlation = "5 min"\n'))
    main(["run", str(place), "--out", str(tmp_path / "filter-results"), "--no-viewer"])
    said = "white from one measurement to the next", "correlation time 300 s"
    for results, words, others in ((run, *said), (tmp_path / "filter-results", *said[::-1])):
        flown(results, tmp_path / "out", "--seeds", "1")
        page = (tmp_path / "out" / "report.html").read_text()
        assert words in page
        assert others not in page


def test_a_run_without_a_field_is_refused(tmp_path: Path, capsys):
    text = swap().replace("field = { zonals = 2 }\n", "")
    (tmp_path / "plain.toml").write_text(text)
    main(["run", str(tmp_path / "plain.toml"), "--out", str(tmp_path / "plain"), "--no-viewer"])
    capsys.readouterr()
    assert main(["simulate", str(tmp_path / "plain"), "--out", str(tmp_path / "flights")]) == 2
    remedy = "add field, with epoch and chief, to [orbit], and run it again"
    assert capsys.readouterr().err == f"{tmp_path / 'plain'}: its scenario has no field; {remedy}\n"
    assert not (tmp_path / "flights").exists()


def swapped(place: Path, text: str) -> tuple[LoadedRun, dict]:
    """A scenario that is run, and its summary."""
    (place / "swap.toml").write_text(text)
    main(["run", str(place / "swap.toml"), "--out", str(place / "run"), "--no-viewer"])
    return cf.load(place / "run"), json.loads((place / "run" / "summary.json").read_text())


def test_a_margin_is_kept_beyond_zones(tmp_path: Path):
    loaded, summary = swapped(tmp_path, swap(more='margin = "0.7 m"\n'))
    pair = [loaded.paths[0], loaded.paths[1]]
    assert cf.closest_approach(*pair, cf.Sphere(30.7)).ratio == pytest.approx(1.0, abs=1e-6)
    assert summary["stages"][0]["margin_m"] == 0.7


def test_the_margin_that_is_found_is_kept_in_flight(tmp_path: Path):
    """With errors of navigation and thrust nobody enters a zone, which without it a coin decides."""
    errors = 'thrust_error = "1 %, 1 deg"'
    _, summary = swapped(tmp_path, swap(craft=errors, more='margin = "auto"\n' + NAVIGATION))
    margin = summary["stages"][0]["margin_m"]
    assert 0.28 < margin < 1.0  # m: noise alone needs 0.28
    status, found, tables = flown(tmp_path / "run", tmp_path / "out", "--seeds", "60")
    assert (status, found["violated"]) == (0, 0)
    assert tables["ratios"]["ratio"].min() < 1.0 + margin / 30.0


AMONG = """
[[stage]]
do = "avoid"
craft = "A"
to = { position = "0 0 -120 m", velocity = "0 0 0 m/s" }
within = "0.4 orbits"
margin = "auto"
"""


def among(more: str, craft: str = "") -> str:
    """One craft that moves past another, which coasts."""
    alone = swap(craft=craft).split("[[stage]]")[0].replace("0 0 -120 m", "0 3 0 m")
    return alone + AMONG + more + NAVIGATION


def test_the_margin_of_one_craft_among_others(tmp_path: Path):
    """Both are off, and neither is in the other's zone."""
    _, summary = swapped(tmp_path, among(""))
    needed = cf.tube(cf.load(tmp_path / "run").orbit, cf.Feedback(), cf.Navigation(0.1, 3e-4)).of_a_pair
    assert summary["stages"][0]["margin_m"] == pytest.approx(needed, rel=1e-2)
    status, found, _ = flown(tmp_path / "run", tmp_path / "out", "--seeds", "40")
    assert (status, found["violated"]) == (0, 0)


SETS = """thrusters = "rtn"
mass = "12 kg"
max_thrust = "100 mN"
minimum_bit = "0.02 mm/s"
period = "30 s\""""


@pytest.mark.parametrize(
    ("more", "craft"),
    [('cost = "delta-v"\n', 'thrust_error = "1 %, 1 deg"'), ("", SETS), ('cost = "delta-v"\n', SETS)],
    ids=["impulses", "pulses", "burns"],
)
def test_the_margin_among_others_is_kept_by_impulses_and_pulses(more, craft, tmp_path: Path):
    """Both are led back by these, the one that coasts, too."""
    _, summary = swapped(tmp_path, among(more, craft))
    assert 0.9 < summary["stages"][0]["margin_m"] < 6.0  # m: noise alone needs 0.93
    status, found, _ = flown(tmp_path / "run", tmp_path / "out", "--seeds", "60")
    assert (status, found["violated"]) == (0, 0)


def test_the_margin_of_impulses_is_kept_in_flight(tmp_path: Path):
    """It is what is left of them by errors of their size and direction, measured each five minutes."""
    errors = 'thrust_error = "1 %, 1 deg"'
    _, summary = swapped(
        tmp_path, swap(craft=errors, more='margin = "auto"\ncost = "delta-v"\n' + NAVIGATION)
    )
    margin = summary["stages"][0]["margin_m"]
    assert 0.9 < margin < 2.0  # m: noise alone needs 0.93
    status, found, tables = flown(tmp_path / "run", tmp_path / "out", "--seeds", "60")
    assert (status, found["violated"]) == (0, 0)
    assert tables["ratios"]["ratio"].min() < 1.0 + margin / 30.0


EXECUTION = """execution = { magnitude = "1 %", pointing = "1 deg", impulse = GATES }
covariance = { position = "0.5 0.5 0.5 m" }""".replace("GATES", '{ speed = "1 mm/s", pointing = "1 deg" }')


@pytest.mark.parametrize("cost", ["energy", "delta-v"])
def test_the_margin_knows_errors_of_burns_and_of_the_start(cost, tmp_path: Path, capsys):
    """Those of the scenario are drawn in each flight; the page says which, and no zone is entered."""
    text = swap(craft=EXECUTION, more=f'margin = "auto"\ncost = "{cost}"\n' + NAVIGATION)
    loaded, summary = swapped(tmp_path, text)
    (tmp_path / "exact").mkdir()
    _, exact = swapped(tmp_path / "exact", text.replace(EXECUTION, ""))
    assert summary["stages"][0]["margin_m"] > 1.1 * exact["stages"][0]["margin_m"]
    capsys.readouterr()
    status, found, tables = flown(tmp_path / "run", tmp_path / "out", "--seeds", "60")
    assert (status, found["violated"]) == (0, 0)
    said = capsys.readouterr().out
    assert "Initial states: 0.5 m and 0 mm/s (1 sigma" in said
    assert "Burns: 1 % and 1 deg each (1 sigma)\n" in said
    assert "1 mm/s and 0 % along each, 0 mm/s and 1 deg across (1 sigma, Gates' model)\n" in said
    scenario = loaded.scenario
    own = cf.simulate(loaded.paths, scenario.field, zones=scenario.zones, seeds=60, **scenario.flight)
    assert tables["flights"]["delta_v_m_s"] == pytest.approx(own.delta_v.ravel())
    gates = found["errors"][0]
    assert gates["gates"] == [1e-3, 0.0, 0.0, pytest.approx(np.radians(1.0))]
    assert (gates["magnitude"], gates["covariance"][1][1]) == (0.01, 0.25)


def test_a_margin_begins_with_errors_as_they_are_when_its_plan_does():
    """Of a first stage, after the coast that burns at its start need; of a later one of the mission's."""
    scenario = parse(swap(craft=EXECUTION), "swap.toml")
    orbit, own = scenario.orbit.build(), tuple(craft.errors for craft in scenario.craft)
    first = StageStart(scenario, orbit, 1, scenario.states(orbit), 0.0, {}, np.ones(2), errors=own)
    coasted = orbit.transition(120.0) @ own[0].state @ orbit.transition(120.0).T
    (late,) = flown_errors(first.leaving(BurnRoom(before=120.0)), [0])
    assert late.state == pytest.approx(coasted, rel=1e-9, abs=1e-12)
    coast = fly(parse(swap(craft=EXECUTION, more=COAST), "swap.toml")).results[:1]
    (later,) = flown_errors(replace(first, number=2, flown=coast, errors=()), [1])
    assert later.state == pytest.approx(own[1].state)
    assert (later.magnitude, late.magnitude) == (0.01, 0.01)


def test_a_later_margin_begins_with_what_the_stage_before_leaves():
    """Off by metres at the start, which ten minutes of slow feedback do not mend: of 200 flights none enters.

    With the margin of craft that are where they should be when the stage begins every fourth does.
    """
    slow = NAVIGATION + '\n[feedback]\nevery = "5 min"\nhorizon = "1 h"\n\n[simulation]\nseeds = 200\n'
    off = 'covariance = { position = "2 2 2 m" }'

    def mission(margin: str, craft: str) -> Mission:
        text = swap(craft=craft, more=f'margin = "{margin}"\n' + slow)
        return fly(parse(text.replace("[[stage]]\nname", f"{COAST}\n[[stage]]\nname"), "late.toml"))

    sure, found = (mission("auto", craft) for craft in ("", off))
    known, needed = (one.results[1].result.plan.padding for one in (sure, found))
    assert needed > 3.0 * known
    assert found.flights.flight.violated == 0.0
    assert found.flights.flight.least_ratio < 1.0 + needed / 30.0
    assert mission(f"{known} m", off).flights.flight.violated > 0.15


def test_a_later_margin_of_pulses_is_kept_after_a_coast():
    """Pulses hold the coast, too, but for what bits leave; the field would move craft by some 10 m."""
    text = swap(craft=SETS, more='margin = "MARGIN"\n' + NAVIGATION + "\n[simulation]\nseeds = 40\n")
    text = text.replace("[[stage]]\nname", f"{COAST.replace('10 min', '72 min')}\n[[stage]]\nname")
    text = text.replace('"0 0 120 m", "0 0 -120 m"]', '"0 50 120 m", "0 0 -120 m"]', 1)
    found = fly(parse(text.replace("MARGIN", "auto"), "pulses.toml"))
    assert found.flights.flight.violated == 0.0
    assert 1.0 < found.results[1].result.plan.padding < 3.0  # m
    assert fly(parse(text.replace("MARGIN", "0 m"), "pulses.toml")).flights.flight.violated > 0.5


def test_errors_of_burns_that_an_option_gives(run: Path, tmp_path: Path):
    _, _, tables = flown(run, tmp_path / "out", "--seeds", "3", "--execution", "2 %, 1 deg")
    loaded, turn = cf.load(run), np.radians(1.0)
    told = loaded.scenario.flight | {"errors": cf.Uncertainty(None, 0.02, turn, (0.0, 0.02, 0.0, turn))}
    own = cf.simulate(loaded.paths, loaded.scenario.field, seeds=3, **told)
    assert tables["flights"]["delta_v_m_s"] == pytest.approx(own.delta_v.ravel())
    exact = cf.simulate(loaded.paths, loaded.scenario.field, seeds=3, **loaded.scenario.flight)
    assert np.abs(own.delta_v - exact.delta_v).max() > 1e-6


def test_the_rest_of_one_stage_is_planned_anew(run: Path, tmp_path: Path, capsys):
    swapped(tmp_path, swap(more='margin = "3 m"\n' + NAVIGATION))
    capsys.readouterr()
    status, found, _ = flown(tmp_path / "run", tmp_path / "out", "--seeds", "3", "--control", "replan")
    assert (status, found["control"], found["feedback"]["every_s"]) == (0, "replan", 300.0)
    assert "planned anew" in capsys.readouterr().out
    (tmp_path / "pulsed").mkdir()
    swapped(tmp_path / "pulsed", swap(craft=SETS, more='margin = "3 m"\n' + NAVIGATION))
    _, pulsed, _ = flown(tmp_path / "pulsed" / "run", tmp_path / "out", "--seeds", "3", "--control", "replan")
    assert "Thrusters: all fire the compensated plan" in capsys.readouterr().out
    assert pulsed["feedback"] == found["feedback"]
    assert (
        1.2 < pulsed["spent"][2]["delta_v_m_s"] / found["spent"][2]["delta_v_m_s"] < 2.0
    )  # each thruster counts
    assert main(["simulate", str(run), "--control", "replan", "--out", str(tmp_path / "two")]) == 2
    why = "replan supports one stage, and there are 2"
    said = f"--control: {why} in {run}; simulate it by track, or a run with one stage"
    assert capsys.readouterr().err == f"{said}\n"
    (tmp_path / "pushed").mkdir()
    swapped(tmp_path / "pushed", swap(more='cost = "delta-v"\n'))
    capsys.readouterr()
    pushed = tmp_path / "pushed" / "run"
    assert main(["simulate", str(pushed), "--control", "replan", "--out", str(tmp_path / "two")]) == 2
    said = (
        f"--control: replan supports continuous thrust only, and impulses are planned in {pushed}; "
        'simulate it by track, or a run with cost = "energy" in the stage'
    )
    assert capsys.readouterr().err == f"{said}\n"


def test_one_option_leaves_the_rest_of_what_leads_impulses_back(tmp_path: Path, capsys):
    swapped(tmp_path, swap(more='cost = "delta-v"\n'))
    _, found, _ = flown(tmp_path / "run", tmp_path / "out", "--seeds", "1", "--horizon", "20 min")
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


def test_no_tube_is_told_of_planned_impulses(tmp_path: Path, capsys):
    """They are off with what they give at once, which no tube of thrust that lasts holds."""
    feedback = '[feedback]\nevery = "60 s"\n'
    swapped(tmp_path, swap(more='cost = "delta-v"\n' + NAVIGATION + feedback))
    capsys.readouterr()
    _, summary, _ = flown(tmp_path / "run", tmp_path / "out", "--seeds", "4")
    assert summary["feedback"]["impulses"] == 0
    assert "tube" not in summary
    assert "% of flights stay within" not in capsys.readouterr().out


def test_thrusters_fire_what_leads_back(tmp_path: Path):
    """Two stages, led back to the certified path of the pulses; each thruster counts, and grams."""
    text = swap(craft=SHOOTERS, more='margin = "3 m"\n' + COAST + NAVIGATION)
    loaded, _ = swapped(tmp_path, text)
    _, found, tables = flown(tmp_path / "run", tmp_path / "led", "--seeds", "10")
    _, blind, _ = flown(tmp_path / "run", tmp_path / "blind", "--seeds", "10", "--control", "open")
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
        own, left = pulses["craft"] == name, 12.0  # kg, which falls as pulses burn
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
    assert 1e-3 < np.abs(ended - planned).max() < 1.0  # m: what is followed, and what is flown
    _, seldom, _ = flown(tmp_path / "run", tmp_path / "seldom", "--seeds", "1", "--every", "4 min")
    assert seldom["feedback"] == found["feedback"] | {"every_s": 240.0}  # the rest as without it


@pytest.mark.parametrize(("share", "kept"), [(0.5, False), (1.001, True)])
def test_limits_are_held_against_the_dearest_flight(share: float, kept: bool, tmp_path: Path, capsys):
    """A budget that the plan keeps and a flight does not is not kept, as in a run with its flights."""
    more = 'margin = "auto"\n' + NAVIGATION
    loaded, _ = swapped(tmp_path, swap(more=more))
    spent = loaded.paths.delta_v
    _, free, _ = flown(tmp_path / "run", tmp_path / "out", "--seeds", "8")
    assert "limits" not in free["verdict"]
    most = np.array([row["delta_v_m_s"] for row in free["spent"][:2]])
    k = int(np.argmax(most - spent))
    assert most[k] > 1.001 * spent[k]
    budgets = [spent[j] + (share if j == k else 2.0) * abs(most[j] - spent[j]) for j in range(2)]
    craft = f"delta_v_budget = {json.dumps([f'{budget} m/s' for budget in budgets])}"
    (tmp_path / "limited").mkdir()
    _, summary = swapped(tmp_path / "limited", swap(craft=craft, more=more))
    assert summary["limits_kept"]
    capsys.readouterr()
    status, found, _ = flown(tmp_path / "limited" / "run", tmp_path / "out", "--seeds", "8")
    assert (status, found["violated"]) == (0 if kept else 1, 0)
    name = loaded.names[k]
    said = "limits are kept" if kept else f"limits are not kept: delta-v ({name})"
    assert found["verdict"] == f"{free['verdict']}; {said}"
    warned = f"{name} needs {most[k]:.4g} m/s, its delta_v_budget is {budgets[k]:g} m/s"
    assert (warned in capsys.readouterr().out) != kept


def test_where_nothing_is_uncertain_one_flight_is_all(tmp_path: Path, capsys):
    """No share of flights, no tube of nothing; feedback costs something or nothing, not rounding."""
    (tmp_path / "sure.toml").write_text(swap())
    main(["run", str(tmp_path / "sure.toml"), "--out", str(tmp_path / "run"), "--no-viewer"])
    capsys.readouterr()
    _, found, tables = flown(tmp_path / "run", tmp_path / "out", "--seeds", "3")
    told = capsys.readouterr().out
    assert found["flights"] == len(found["worst_flights"]) == 1
    assert "1 simulation of 2 craft, 1 stage; without uncertainty, all others are the same" in told
    assert "1 flight (nothing is uncertain), least" in told
    assert not any(word in told for word in ("95 %", "Worst", "tube", "stay within"))
    spent = np.abs(tables["flights"]["feedback_delta_v_m_s"])
    assert ((spent == 0.0) | (spent > 1e-12)).all()
    _, found, _ = flown(tmp_path / "run", tmp_path / "out", "--seeds", "3", "--thrust-error", "1 %, 1 deg")
    assert found["flights"] == 3


def test_intervals_are_percents_that_read():
    """Two of two flights: 34 to 100 by Wilson, not 1e+02."""
    assert str(Entered(2, 2, 0.9, True)).endswith("(95 % between 34 and 100 %), least 0.9000 x zone")


def test_the_page_names_the_flight_that_moves_and_its_stages(run: Path, tmp_path: Path):
    """Each stage with its name and times; its closest approach as the worst flight's own states have it."""
    _, summary, tables = flown(run, tmp_path / "out", "--seeds", "12")
    scene, loaded, worst = Seen.of((tmp_path / "out" / "viewer.html").read_text()).record, cf.load(run), []
    assert scene["title"].startswith(f"Flight {summary['worst']} of 12, in which two come nearest: ")
    told = [('Stage 1 "swap": reconfigure', 0.0), ("Stage 2: coast", loaded.results[0].end)]
    assert [(one["title"], one["start"]) for one in scene["stages"]] == [
        (title, pytest.approx(start, abs=1e-3)) for title, start in told
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
