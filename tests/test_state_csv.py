"""Files of states: units in the header, damage refused in one line, and scenarios that start from them."""

import csv
import io

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import closeform as cf
from closeform.exchange.state_csv import read_states_csv
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
        lambda text: "\ufeff" + text.replace("\n", "\r\n"),
        lambda text: text.replace("x_m,", "x_km,").replace("B,1.5", "B,0.0015"),
        lambda text: text.replace("vx_m_s", "vx [mm/s]").replace("0.25", "250").replace("z_m,", "z [m],"),
        lambda text: text.replace("craft", "stage,craft").replace("A,", "1,A,").replace("B,", "1,B,"),
        lambda text: text.replace(",", " , ") + "\n\n",
        lambda text: (
            text.replace("craft", "time_min,time_utc,craft").replace("A", "0,x,A").replace("B", "0,x,B")
        ),
    ],
)
def test_lawful_spellings_read_the_same(tmp_path, change):
    rows = read_states_csv(written(tmp_path, change(GOOD)))
    assert rows.craft == ("A", "B")
    np.testing.assert_allclose(rows.states[1], STATE, rtol=1e-15)
    assert rows.times.tolist() == [0.0, 0.0]
    assert rows.frames == ("", "")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: "", "line 1: no column craft; a header is"),
        (lambda text: text.replace("vz_m_s", "w"), "line 1: no column vz_m_s; a header is"),
        (
            lambda text: text.replace("y_m", "y_ft"),
            "line 1: column y_ft has the unknown unit ft; name it one of y_m",
        ),
        (
            lambda text: text.replace("vx_m_s", "vx_m"),
            "column vx_m has the unknown unit m; name it one of vx_m_s",
        ),
        (lambda text: text.replace("y_m", "x_km"), "line 1: column x_km: x stands twice; keep one"),
        (lambda text: text.splitlines()[0], "has no states; add a line for each craft"),
        (lambda text: text.replace(",25,", ",nan,"), "line 3: a value is not finite"),
    ],
)
def test_damaged_file_gives_one_line(tmp_path, change, message):
    file = written(tmp_path, change(GOOD))
    with pytest.raises(ValueError, match=message) as caught:
        read_states_csv(file)
    assert str(caught.value).startswith(f"{file}: ")
    assert "\n" not in str(caught.value)


@given(st.integers(0, len(GOOD)), st.integers(0, 12), st.text(alphabet='01,.-"\n\rABx_[]ms\0', max_size=8))
@settings(max_examples=200, deadline=None)
def test_any_damage_is_read_or_refused_in_one_line(tmp_path_factory, place, length, new):
    file = written(tmp_path_factory.getbasetemp(), GOOD[:place] + new + GOOD[place + length :])
    try:
        rows = read_states_csv(file)
    except ValueError as error:
        assert str(error).startswith(f"{file}: ")  # noqa: PT017
        assert "\n" not in str(error)  # noqa: PT017
    else:
        assert np.isfinite(rows.states).all()
        assert len(rows.craft) == len(rows.states) == len(rows.times)


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
    lines = [
        f"J2000,{name}," + ",".join(map(repr, row)) for name, row in zip("AB", inertial.tolist(), strict=True)
    ]
    written(tmp_path, "\n".join(["frame," + GOOD.splitlines()[0], *lines]))
    found = parse(scenario(orbit, 'states = "states.csv"'), str(tmp_path / "two.toml"))
    np.testing.assert_allclose(found.states(found.orbit.build())[:, :3], states[:, :3], rtol=0.0, atol=1e-7)
    np.testing.assert_allclose(found.states(found.orbit.build())[:, 3:], states[:, 3:], rtol=0.0, atol=1e-9)
