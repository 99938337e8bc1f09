"""Tables of states as starts of scenarios, with or without times, also inertial."""

import csv
import io

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import closeform as cf
from closeform.exchange.formats.states_csv import state_rows
from closeform.motion.elements.elements import inertial_from_elements
from closeform.motion.elements.frames import relative_from_inertial
from closeform.report.run import states as flown_states
from closeform.scenario import parse
from dated import CIRCLE, MEETING, chief, scenario

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
def test_one_row_for_each_spacecraft(tmp_path, change):
    text = scenario('altitude = "550 km"\nepoch = "2026-11-22T12:00:00Z"', 'states = "states.csv"')
    written(tmp_path, change(GOOD))
    found = parse(text, str(tmp_path / "two.toml"))
    np.testing.assert_allclose(found.states(found.orbit.build())[1], STATE, rtol=1e-15)


def test_table_with_times(tmp_path):
    file = written(tmp_path, GOOD)
    assert state_rows(file, timed=False).times is None
    with pytest.raises(ValueError, match="has no column of time; add time_s"):
        state_rows(file)
    with pytest.raises(ValueError, match="has no column of vz; add vz_m_s"):
        state_rows(written(tmp_path, GOOD.replace("vz_m_s", "w")), timed=False)


def test_mission_continues_another_one(tmp_path):
    """The table of paths as CSV, with times shifted so that the end of a stage is 0."""
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


def test_inertial_rows_are_relative_to_the_chief(tmp_path):
    """The same states in the Hill frame and in an inertial frame."""
    orbit = chief(CIRCLE + ', latitude = "10 deg"')
    plain = parse(scenario(orbit, MEETING))
    states = plain.states(plain.orbit.build())
    inertial = plain.chief.inertial_from_relative(0.0, states)
    lines = [f"{name}," + ",".join(map(repr, row)) for name, row in zip("AB", inertial.tolist(), strict=True)]
    written(tmp_path, "\n".join(["# frame = J2000", GOOD.splitlines()[0], *lines]))
    found = parse(scenario(orbit, 'states = "states.csv"'), str(tmp_path / "two.toml"))
    np.testing.assert_allclose(found.states(found.orbit.build())[:, :3], states[:, :3], rtol=0.0, atol=1e-7)
    np.testing.assert_allclose(found.states(found.orbit.build())[:, 3:], states[:, 3:], rtol=0.0, atol=1e-9)


FOLLOWING = """\
closeform = 1
title = "Along ephemerides"

[orbit]
epoch = "2026-11-22T12:10:30Z"
chief = { oem = "A.oem" }

[craft]
name = ["A", "B"]
start = [{ oem = "A.oem" }, { oem = "B.oem" }]
keep_out = { sphere = "30 m" }

[[stage]]
do = "coast"
for = "20 min"
follow = ["A", "B"]

[[stage]]
do = "coast"
for = "40 min"
follow = ["A", "B"]
"""


def oblate(_, state):
    """Two-body motion with J2, in m and s."""
    mu, j2, radius = 398600.4418e9, 1.08263e-3, 6378137.0
    r = np.linalg.norm(state[:3])
    bulge = 1.5 * j2 * (radius / r) ** 2 * (5.0 * (state[2] / r) ** 2 - np.array([1.0, 1.0, 3.0]))
    return np.concatenate([state[3:], -mu / r**3 * state[:3] * (1.0 - bulge)])


def test_spacecraft_follow_their_ephemerides(tmp_path):
    """The closest approach on eccentric orbits with J2 is that of the ephemerides."""
    first = inertial_from_elements([6.93e6, 0.3, 2e-3, 1e-3, 1.7, 0.5])
    second = inertial_from_elements([6.93e6 + 20.0, 0.3 + 4e-5, 2.02e-3, 1.02e-3, 1.70002, 0.5 + 1e-5])
    span = {"t_eval": np.arange(0.0, 4501.0, 60.0), "dense_output": True, "rtol": 1e-12, "atol": 1e-7}
    paths = [solve_ivp(oblate, (0.0, 4500.0), one, method="DOP853", **span) for one in (first, second)]
    for name, path in zip("AB", paths, strict=True):
        words = name, f"2026-001{name}", "EARTH", "EME2000", "UTC", "2026-11-22T12:00:00"
        cf.write_oem(tmp_path / f"{name}.oem", cf.Ephemeris(*words, path.t, path.y.T))
    times = np.linspace(0.0, 3600.0, 36001)
    apart = np.linalg.norm(paths[0].sol(times + 630.0)[:3] - paths[1].sol(times + 630.0)[:3], axis=0)

    def closest(text):
        (tmp_path / "follow.toml").write_text(text)
        mission = cf.run(tmp_path / "follow.toml")
        near = min((one.after.closest for one in mission.results), key=lambda one: one.distance)
        return mission, near

    mission, near = closest(FOLLOWING)
    # along-track lengths are arcs on the chief's circle, off by its eccentricity of 2.2e-3
    assert near.distance == pytest.approx(apart.min(), rel=2.5e-3)
    assert near.time == pytest.approx(times[apart.argmin()], abs=2.0)
    frame = cf.common_frame([cf.read_oem(tmp_path / f"{name}.oem") for name in "AB"])
    screened = np.linalg.norm(frame.paths[1].position(times + 630.0), axis=1).min()
    assert near.distance == pytest.approx(screened, abs=1e-3)
    assert 0.0 < near.time < 3600.0
    assert mission.delta_v.max() == 0.0  # no velocity jumps in the ephemerides
    end = relative_from_inertial(*(path.sol(4230.0) for path in paths))
    found = mission.results[1].after.path("B").state(3600.0)
    np.testing.assert_allclose(found[:3], end[:3], atol=2.5e-3 * np.linalg.norm(end[:3]))
    hill, _ = closest(FOLLOWING.replace('follow = ["A", "B"]', ""))
    off = hill.results[1].after.path("B").position(3600.0) - end[:3]
    assert np.linalg.norm(off) > 5e-3 * np.linalg.norm(end[:3])  # what Hill's equations omit


def test_table_of_states_as_a_path(tmp_path):
    """Rows of a coast, an impulse and a coast give the path and its delta-v."""
    orbit = cf.Orbit.circular(550e3)
    before = orbit.coast([0.0, -300.0, 0.0, 0.0, 0.0, 0.0], 600.0)
    jump = np.array([0.0, 0.0, 0.0, 0.05, -0.02, 0.01])
    after = orbit.coast(before.state(600.0) + jump, 600.0, 600.0)
    rows = [("F1", time, *before.state(time).tolist()) for time in (0.0, 250.0, 600.0)]
    rows += [("F1", time, *after.state(time).tolist()) for time in (600.0, 900.0, 1200.0)]
    rows += [("F2", time, *np.zeros(6).tolist()) for time in (0.0, 1200.0)]
    head = "craft,time_s,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s"
    written(tmp_path, "\n".join([head, *(",".join(map(str, row)) for row in rows)]))
    text = FOLLOWING.replace('"A", "B"', '"F1", "F2"').rpartition("[[stage]]")[0]
    text = text.replace('epoch = "2026-11-22T12:10:30Z"\nchief = { oem = "A.oem" }', 'altitude = "550 km"')
    text = text.replace('start = [{ oem = "A.oem" }, { oem = "B.oem" }]', 'states = "states.csv"')
    file = tmp_path / "judge.toml"
    file.write_text(text)
    mission = cf.run(file)
    path = mission.results[0].after.path("F1")
    for piece, times in ((before, [100.0, 599.0]), (after, [700.0, 1100.0])):
        np.testing.assert_allclose(path.position(times), piece.position(times), atol=1e-6)
    np.testing.assert_allclose(path.delta_v, np.linalg.norm(jump), rtol=1e-6)
    assert list(mission.burns["craft"]) == ["F1"]
    # a stage that lasts longer than its file, and one that begins elsewhere
    file.write_text(text.replace("20 min", "30 min"))
    with pytest.raises(ValueError, match="give a longer file"):
        cf.run(file)
    stages = (
        '[[stage]]\ndo = "coast"\nfor = "700 s"\n\n[[stage]]\ndo = "coast"\nfor = "1 s"\nfollow = ["F1"]\n'
    )
    file.write_text(text.partition("[[stage]]")[0] + stages)
    with pytest.raises(ValueError, match="from its position"):
        cf.run(file)
