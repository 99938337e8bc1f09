"""Scenarios with an epoch and a chief: starts, UTC columns and input files."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from astropy.time import Time, TimeDelta

import closeform as cf
from chiefs import to_fifty_digits
from closeform.cli.app import main
from closeform.cli.console import print_report
from closeform.exchange.ccsds.oem import read_oem, write_oem
from closeform.report.run import RunReport, states
from closeform.scenario import ScenarioError, parse
from dated import CIRCLE, chief, scenario
from scenarios import MODIFIED

pytestmark = pytest.mark.usefixtures("undrawn")

ROOT = Path(__file__).parents[1]
GRACE = ROOT / "examples" / "grace"


def run_output(folder, text, capsys):
    """Return lines, figures and tables of a run without pictures."""
    (folder / "two.toml").write_text(text)
    report = RunReport(cf.run(folder / "two.toml"))
    print_report(report, folder)
    lines = capsys.readouterr().out.splitlines()
    tables = report.files | {"paths": states(report.mission)}
    return (
        lines,
        json.loads(json.dumps(report.summary)),
        {name: plain(table) for name, table in tables.items()},
    )


def plain(table):
    return {key: np.asarray(cells).tolist() for key, cells in table.items()}


def without_utc(figures):
    if isinstance(figures, list):
        return [without_utc(one) for one in figures]
    if not isinstance(figures, dict):
        return figures
    return {
        key: without_utc(one) for key, one in figures.items() if not key.endswith("_utc") and key != "epoch"
    }


LEAPING = "2016-12-31T23:59:45.25"


def test_epoch_adds_utc_only(tmp_path, capsys):
    plain_lines, plain, plain_tables = run_output(tmp_path, scenario(), capsys)
    text = scenario(f'altitude = "550 km"\nepoch = "{LEAPING}Z"')
    lines, dated, tables = run_output(tmp_path, text, capsys)
    assert "utc" not in json.dumps(plain)
    assert not any("UTC" in line for line in plain_lines)
    same = [{key: run[key] for key in run if key not in ("inputs", "versions")} for run in (plain, dated)]
    assert without_utc(same[1]) == same[0]
    start = Time(LEAPING, scale="utc")
    seen = 0
    for name, columns in tables.items():
        assert {key: cells for key, cells in columns.items() if not key.endswith("_utc")} == plain_tables[
            name
        ]
        for key in [key for key in columns if key.endswith("_utc")]:
            for seconds, stamp in zip(columns[key[:-4] + "_s"], columns[key], strict=True):
                assert (seconds is None) == (stamp is None)
                if stamp is not None:
                    truth = start + TimeDelta(seconds, format="sec")
                    assert abs((Time(stamp[:-1], scale="utc") - truth).to_value("s")) < 0.61e-9
                    seen += 1
    assert seen > 400  # conflicts, approaches, burns and paths
    assert {"conflicts", "approaches", "burns", "paths"} <= {
        k for k in tables if any("utc" in c for c in tables[k])
    }
    assert any("T23:59:60." in stamp for stamp in tables["paths"]["time_utc"])
    assert dated["epoch"] == f"{LEAPING} UTC"
    assert dated["stages"][0]["start_utc"] == f"{LEAPING}0000000Z"
    shown = [line for line in lines if line]
    assert "2 craft in an orbit of 95.65 min, 340.0 s from 2016-12-31T23:59:45.25 UTC" in shown
    # B enters 5 s after the start and is out 40 s later; there is a leap second in between
    (row,) = [line for line in shown if line.startswith("A - B ")][:1]
    assert re.search(r" 23:59:50\.\d{3} ", row)
    assert any("UTC 2016-12-31" in line for line in shown)
    assert [line for line in shown if len(line) > 100 and "results in" not in line] == []


def test_wide_tables_omit_utc_on_a_terminal(tmp_path, capsys, monkeypatch):
    """Wide tables of burns fit 100 columns; the files have UTC."""
    text = scenario(f'altitude = "550 km"\nepoch = "{LEAPING}Z"').replace(
        "keep_out",
        'mass = "12 kg"\nmax_thrust = "2 N"\nspecific_impulse = "60 s"\nthrusters = "rtn"\nkeep_out',
    )
    monkeypatch.setattr("closeform.cli.console.UNBROKEN", 100)
    lines, _, tables = run_output(tmp_path, text, capsys)
    head = next(line for line in lines if "thruster" in line and "R [m/s]" in line)
    assert [line for line in lines if len(line) > 100 and "results in" not in line] == []
    assert "UTC" not in head
    assert None not in tables["burns"]["start_utc"]


def test_chief_defines_the_orbit(tmp_path, capsys):
    _, plain, plain_tables = run_output(tmp_path, scenario('semi_major_axis = "7000 km"'), capsys)
    lines, figures, tables = run_output(tmp_path, scenario(chief(CIRCLE + ', latitude = "10 deg"')), capsys)
    np.testing.assert_allclose(tables["paths"]["x_m"], plain_tables["paths"]["x_m"], rtol=0.0, atol=1e-6)
    assert figures["mean_motion_rad_s"] == pytest.approx(plain["mean_motion_rad_s"], rel=1e-14)
    assert figures["chief"]["frame"] == "EME2000"
    assert "Chief at the epoch: a 7000.000 km, e 0.00000, i 97.6000 deg, node 30.0000 deg in EME2000" in lines


@pytest.mark.parametrize("place", ['mean_anomaly = "50 deg"', 'latitude = "140 deg"'])
def test_elements_by_mean_anomaly(place):
    """50 degrees of mean anomaly from perigee, in fifty digits."""
    given = f'{CIRCLE}, eccentricity = 0.09, argument_of_perigee = "90 deg", '
    found = parse(scenario(chief(given + place))).chief
    perigee = parse(scenario(chief(given + 'mean_anomaly = "0 deg"'))).chief
    assert np.linalg.norm(perigee.state[:3]) == pytest.approx(7e6 * 0.91, rel=1e-12)
    truth = to_fifty_digits(perigee.state, np.radians(50.0) * np.sqrt(7e6**3 / cf.elements.EARTH_MU))
    np.testing.assert_allclose(found.state[:3], truth, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("anomaly", [-170.0, 58.11, 130.0])
def test_elements_by_true_anomaly(anomaly):
    """The angle from perigee and the distance follow from the ellipse."""
    given = f'{CIRCLE}, eccentricity = 0.09, argument_of_perigee = "40 deg", true_anomaly = '
    here, perigee = (parse(scenario(chief(f'{given}"{at} deg"'))).chief.state[:3] for at in (anomaly, 0.0))
    distance = np.linalg.norm(here)
    assert distance == pytest.approx(
        7e6 * (1 - 0.09**2) / (1 + 0.09 * np.cos(np.radians(anomaly))), rel=1e-12
    )
    cosine = here @ perigee / distance / np.linalg.norm(perigee)
    assert np.degrees(np.arccos(cosine)) == pytest.approx(abs(anomaly), abs=1e-6)
    normal = parse(scenario(chief(CIRCLE + ', latitude = "0 deg"'))).chief.state
    ahead = np.cross(perigee, here) @ np.cross(normal[:3], normal[3:])
    assert np.sign(ahead) == np.sign(anomaly)


def test_relative_elements_use_the_latitude_of_the_chief():
    roe = 'start = [{ roe = "0 0 0 0 0 0 m" }, { roe = "0 0 0 300 80 250 m" }]'
    plain = parse(scenario('semi_major_axis = "7000 km"\nlatitude = "77 deg"', roe))
    dated = parse(scenario(chief(CIRCLE + ', latitude = "77 deg"'), roe))
    states = [one.states(one.orbit.build()) for one in (plain, dated)]
    np.testing.assert_allclose(states[1], states[0], rtol=0.0, atol=1e-7)


def test_inertial_start_on_the_circle_of_the_chief():
    """A known angle ahead on the same circle is an arc."""
    given = CIRCLE + ', latitude = "10 deg"'
    ahead = cf.elements.inertial_from_elements(
        [7e6, np.radians(10.0) + 1e-4, 0.0, 0.0, np.radians(97.6), np.radians(30.0)]
    )
    place, speed = (" ".join(repr(float(one)) for one in part) for part in (ahead[:3], ahead[3:]))
    start = f'start = [{{ palmer = "0 0 0 0 0 0 m" }}, {{ inertial = "{place} m, {speed} m/s" }}]'
    found = parse(scenario(chief(given), start))
    states = found.states(found.orbit.build())
    np.testing.assert_allclose(states[1], [0, 700.0, 0, 0, 0, 0], rtol=0.0, atol=1e-6)


def test_start_from_ephemerides_agrees_with_screening(tmp_path, capsys, monkeypatch):
    """GRACE-B in GPS time at an epoch in UTC, with files beside the scenario."""
    (tmp_path / "files").mkdir()
    for letter in "AB":
        (tmp_path / "files" / f"{letter}.oem").write_bytes((GRACE / f"GRACE-{letter}.oem").read_bytes())
    orbit = 'epoch = "2010-07-27T00:16:25Z"\nchief = { oem = "files/A.oem" }'  # 1000 s after their first
    text = scenario(orbit, 'start = [{ palmer = "0 0 0 0 0 0 m" }, { oem = "files/B.oem" }]')
    (tmp_path / "grace.toml").write_text(text)
    monkeypatch.chdir("/")
    found = cf.run(tmp_path / "grace.toml")
    frame = cf.common_frame([read_oem(GRACE / f"GRACE-{letter}.oem") for letter in "AB"])
    state = found.results[0].after.path("B").state(0.0)
    np.testing.assert_allclose(state, frame.states[1, 100], rtol=0.0, atol=1e-6)
    assert found.orbit.mean_motion == pytest.approx(frame.mean_motion, rel=1e-14)
    assert set(found.scenario.digests) == {"grace.toml", "files/A.oem", "files/B.oem"}
    assert found.scenario.inputs.notes == []  # nothing was interpolated


def test_interpolated_states_are_reported(tmp_path, capsys):
    flown = read_oem(GRACE / "GRACE-A.oem")
    write_oem(tmp_path / "A.oem", flown)
    orbit = 'epoch = "2010-07-27T00:16:41 GPS"\nchief = { oem = "A.oem" }'
    lines, figures, _ = run_output(tmp_path, scenario(orbit), capsys)
    (told,) = [line for line in lines if line.startswith("A.oem: ")]
    off = re.fullmatch(
        r"A\.oem: state at the epoch is interpolated, with an estimated error of up to (\S+) m", told
    )
    assert off is not None
    assert 1e-9 < float(off[1]) < 0.01  # of the files' own noise, which their velocities have
    assert any("eccentricity" in line for line in figures["warnings"])  # 0.002 at that epoch
    assert figures["inputs"].keys() == {"two.toml", "A.oem"}


def test_results_keep_copies_of_input_files(tmp_path, monkeypatch, capsys):
    """`load` and a run of its scenario.toml read the copies."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "files").mkdir()
    (tmp_path / "files" / "A.oem").write_bytes((GRACE / "GRACE-A.oem").read_bytes())
    orbit = 'epoch = "2010-07-27T00:16:40 GPS"\nchief = { oem = "files/A.oem" }'
    (tmp_path / "two.toml").write_text(scenario(orbit).partition('\n\n[[stage]]\ndo = "transfer')[0] + "\n")
    assert main(["run", "two.toml", "--out", "results"]) == 1
    (tmp_path / "files" / "A.oem").unlink()
    loaded = cf.load("results")
    assert loaded.scenario.chief.utc([0.0]) == ["2010-07-27T00:16:25.000000000Z"]
    assert (
        cf.run("results/scenario.toml").scenario.chief.states(60.0).tolist()
        == loaded.scenario.chief.states(60.0).tolist()
    )
    stamps = pq.read_table("results/conflicts.parquet").to_pydict()["start_utc"]
    assert [stamp[:22] for stamp in stamps] == ["2010-07-27T00:16:30.00"] * 2  # 5 s later, before and after
    (copy,) = (tmp_path / "results" / "inputs").iterdir()
    copy.write_bytes(copy.read_bytes().replace(b"GCRF", b"ICRF"))
    with pytest.raises(ValueError, match=rf"results: inputs/{copy.name} was changed or is damaged"):
        cf.load("results")


def test_mission_starts_from_an_exported_ephemeris(tmp_path):
    """A start can be after a burn or within a segment."""
    orbit = CIRCLE + ', latitude = "10 deg"'
    (tmp_path / "two.toml").write_text(scenario(chief(orbit)))
    mission = cf.run(tmp_path / "two.toml")
    cf.export(mission, tmp_path / "oem", to="oem")
    path, at = mission.results[1].after.path("B"), np.radians(10.0)
    for time, clock in ((40.0, "12:00:40"), (90.0, "12:01:30")):
        turned = float(np.degrees(at + mission.orbit.mean_motion * time))
        later = chief(CIRCLE + f', latitude = "{turned!r} deg"', f"2026-11-22T{clock}Z")
        start = 'start = [{ palmer = "0 900 0 0 0 0 m" }, { oem = "oem/B.oem" }]'
        found = parse(scenario(later, start), str(tmp_path / "next.toml"))
        # the OEM states the same orbit to a micrometre; this is the resulting difference
        np.testing.assert_allclose(found.states(found.orbit.build())[1, :3], path.state(time)[:3], 0.0, 1e-5)
        np.testing.assert_allclose(found.states(found.orbit.build())[1, 3:], path.state(time)[3:], 0.0, 1e-7)
    gone = chief(orbit, "2026-11-22T13:00:00Z")
    with pytest.raises(
        ScenarioError, match=r"start\[2\]: oem/B.oem: none of its \d segments has states at 2026-11-22T13"
    ):
        parse(scenario(gone, start), str(tmp_path / "next.toml"))


@pytest.mark.parametrize("name", ["no.oem", "a" * 5000 + ".oem", "\\u0000", "/", "..", "a\\nb"])
def test_invalid_file_names(name, tmp_path):
    text = scenario(f'epoch = "2026-11-22T12:00:00Z"\nchief = {{ oem = "{name}" }}')
    with pytest.raises(ScenarioError) as refused:
        parse(text, str(tmp_path / "two.toml"))
    (line,) = refused.value.lines
    assert line.isprintable()
    assert line.endswith("; check the path")


def test_endless_drift_has_no_end_time(tmp_path, capsys):
    text = scenario('altitude = "550 km"\nepoch = "2026-11-22T12:00:00Z"').partition(
        '\n\n[[stage]]\ndo = "tr'
    )[0]
    text = text.replace('"0 25 0 m"', '"0 900 0 m"').replace("-1 0 m/s", "0 0 m/s")
    _, figures, tables = run_output(tmp_path, text + '\ndrift = "forever"\n', capsys)
    found = figures["stages"][0]["passive_safety"]
    assert found["until_utc"] is None
    assert all(stamp is None or stamp.endswith("Z") for stamp in tables["drifts"]["time_utc"])


LOST = (
    """\
closeform = 1
title = "Lost, at an epoch"

[orbit]
deep_space = true
epoch = "2026-11-22T12:00:00Z"

[craft]
name = ["L1", "L2"]
group = ["A", "B"]
position = ["0 0 0 m", "100 20 30 m"]
velocity = "0 0 0 cm/s"
keep_out = { sphere = "1 m" }

[[stage]]
do = "coast"
for = "100 s"

[[stage]]
do = "lock"
"""
    + MODIFIED
)


def test_times_of_a_search_start_at_its_stage(tmp_path, capsys):
    """Seconds count from the search, UTC from the mission."""
    lines, figures, tables = run_output(tmp_path, LOST, capsys)
    start = Time("2026-11-22T12:01:40", scale="utc")
    locks, (_, search) = tables["locks"], figures["stages"]
    (seconds,), (stamp,) = locks["time_s"], locks["time_utc"]
    assert abs((Time(stamp[:-1]) - start).to_value("s") - seconds) < 1e-8
    first = search["search"]["phases"][0]
    assert abs((Time(first["end_utc"][:-1]) - start).to_value("s") - first["end_s"]) < 1e-8
    assert search["start_utc"] == "2026-11-22T12:01:40.000000000Z"
    (row,) = [line for line in lines if line.startswith("L1 - L2 ")]
    assert f" {seconds:.2f} " in row
    assert stamp[11:22] in row


def test_scenarios_without_a_chief_import_nothing_for_it():
    names = "sorted(name for name in sys.modules if 'exchange.' in name or name == 'erfa')"
    code = f"import sys, closeform.scenario; print({names})"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout == "['closeform.exchange.epochs']\n"
