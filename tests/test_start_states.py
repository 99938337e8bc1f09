"""Tables of states that scenarios start from: one row each, or that of the epoch; inertial ones, too."""

import csv
import io

import numpy as np
import pytest

import closeform as cf
from closeform.exchange.states_csv import state_rows
from closeform.report.run import states as flown_states
from closeform.scenario import parse
from test_epoch_scenario import CIRCLE, MEETING, chief, scenario

GOOD = "craft,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s\nA,0,0,0,0,0,0\nB,1.5,25,-3,0.25,-1,0\n"
STATE = [1.5, 25.0, -3.0, 0.25, -1.0, 0.0]


def written(folder, text):
    file = folder / "states.csv"
    file.write_bytes(text.encode())
    return file


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text,
        lambda text: text.replace("x_m,", "x_km,").replace("B,1.5", "B,0.0015"),
        lambda text: text.replace("craft", "stage,craft").replace("A,", "1,A,").replace("B,", "1,B,"),
        lambda text: (
            text.replace("craft", "time_min,time_utc,craft").replace("A", "0,x,A").replace("B", "0,x,B")
        ),
        lambda text: "# frame = RSW_ROTATING\n" + text,
        # at an epoch a minute before that of the scenario, with the state before a burn above it
        lambda text: (
            "# epoch = 2026-11-22T11:59:37\n# time_system = TAI\n"
            + text.replace("craft", "time_s,craft")
            .replace("A,", "60,A,")
            .replace("B,", "0,B,9,9,9,9,9,9\n60,B,8,8,8,8,8,8\n60,B,")
        ),
    ],
)
def test_one_row_each_is_enough(tmp_path, change):
    text = scenario('altitude = "550 km"\nepoch = "2026-11-22T12:00:00Z"', 'states = "states.csv"')
    written(tmp_path, change(GOOD))
    found = parse(text, str(tmp_path / "two.toml"))
    np.testing.assert_allclose(found.states(found.orbit.build())[1], STATE, rtol=1e-15)


def test_a_table_with_times_has_them(tmp_path):
    file = written(tmp_path, GOOD)
    assert state_rows(file, timed=False).times is None
    with pytest.raises(ValueError, match="has no column of time; add time_s"):
        state_rows(file)
    with pytest.raises(ValueError, match="has no column of vz; add vz_m_s"):
        state_rows(written(tmp_path, GOOD.replace("vz_m_s", "w")), timed=False)


def test_a_mission_goes_on_from_the_paths_that_another_left(tmp_path):
    """The table of paths as a CSV, its times moved so that the end of a stage is 0."""
    mission = cf.run(written(tmp_path, scenario()))
    table = flown_states(mission)
    text = io.StringIO()
    columns = {key: cells.tolist() for key, cells in table.items()}
    columns["time_s"] = (table["time_s"] - 340.0).tolist()
    kept = [
        k
        for k, (stage, time) in enumerate(zip(columns["stage"], columns["time_s"], strict=True))
        if stage == 2
    ]
    writer = csv.writer(text)
    writer.writerow(columns)
    writer.writerows(zip(*([cells[k] for k in kept] for cells in columns.values()), strict=True))
    (tmp_path / "paths.csv").write_text(text.getvalue())
    found = parse(scenario(start='states = "paths.csv"'), str(tmp_path / "next.toml"))
    np.testing.assert_array_equal(found.states(mission.orbit), mission.results[-1].after.paths.state(340.0))
    assert set(found.digests) == {"next.toml", "paths.csv"}


def test_inertial_rows_are_beside_the_chief(tmp_path):
    """The same states, told in Hill's frame and in that of the chief."""
    orbit = chief(CIRCLE + ', latitude = "10 deg"')
    plain = parse(scenario(orbit, MEETING))
    states = plain.states(plain.orbit.build())
    inertial = plain.chief.inertial_from_relative(0.0, states)
    lines = [f"{name}," + ",".join(map(repr, row)) for name, row in zip("AB", inertial.tolist(), strict=True)]
    written(tmp_path, "\n".join(["# frame = J2000", GOOD.splitlines()[0], *lines]))
    found = parse(scenario(orbit, 'states = "states.csv"'), str(tmp_path / "two.toml"))
    np.testing.assert_allclose(found.states(found.orbit.build())[:, :3], states[:, :3], rtol=0.0, atol=1e-7)
    np.testing.assert_allclose(found.states(found.orbit.build())[:, 3:], states[:, 3:], rtol=0.0, atol=1e-9)
