"""Exports read by independent readers: states to a micrometre, quaternions to 1e-12."""

import json
import os
import re
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
import spiceypy
from astropy.time import Time
from ccsds_ndm.ndm_io import NdmIo
from oem import OrbitEphemerisMessage
from scipy.interpolate import KroghInterpolator

import closeform as cf
from bodies import Body
from closeform.cli.app import main
from exported import EPOCH, FLYING, SEARCHING, SURE, run, seconds, truth

pytestmark = pytest.mark.usefixtures("undrawn")

MICROMETRE = 1e-6
LEAP_SECONDS = """\
KPL/LSK
\\begindata
DELTET/DELTA_T_A = 32.184
DELTET/K = 1.657D-3
DELTET/EB = 1.671D-2
DELTET/M = ( 6.239996D0 1.99096871D-7 )
DELTET/DELTA_AT = ( 37, @2017-JAN-1 )
\\begintext
"""  # as NAIF's naif0012.tls has them since 2017


@pytest.fixture(scope="module")
def mission(tmp_path_factory):
    """Mission with a coast, a move by thrust and one by impulses, from an epoch on."""
    return run(tmp_path_factory.mktemp("mission"), FLYING)


@pytest.fixture(scope="module")
def exported_to(mission, tmp_path_factory):
    """Folders of exports, made once for each format."""
    made: dict[tuple, Path] = {}

    def export(to: str, **options) -> Path:
        key = (to, *options.items())
        if key not in made:
            made[key] = cf.export(mission, tmp_path_factory.mktemp("export") / to, to, **options)
        return made[key]

    return export


def assert_close(found, mission, name: str, times) -> None:
    """Check states of a segment, which begins after a burn and ends before the next."""
    found, times = np.asarray(found), np.asarray(times)
    known = truth(mission, name, times)
    known[-1] = truth(mission, name, times[-1:], left=True)[0]
    assert np.abs(found[:, :3] - known[:, :3]).max() < MICROMETRE
    assert np.abs(found[:, 3:] - known[:, 3:]).max() < 1e-9  # m/s


@pytest.mark.parametrize(("to", "suffix"), [("oem", "oem"), ("oem-xml", "xml")])
def test_oem_states_by_an_independent_reader(mission, exported_to, to, suffix) -> None:
    """The package oem reads both forms; epochs have nine decimals."""
    place = exported_to(to)
    assert sorted(os.listdir(place)) == [*(f"F{k}.{suffix}" for k in (1, 2, 3)), "summary.json"]
    start = Time(EPOCH, scale="utc")
    for name in ("F1", "F3"):
        file = place / f"{name}.{suffix}"
        assert re.findall(r"T\d\d:\d\d:\d\d(?:\.\d*)?", file.read_text())[1:]
        stamps = re.findall(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.(\d+)", file.read_text())
        assert {len(part) for part in stamps} == {9}
        segments = OrbitEphemerisMessage.open(file).segments
        assert len(segments) == (1 if name == "F1" else 3)
        for segment in segments:
            assert segment.metadata["REF_FRAME"] == "EME2000"
            assert int(segment.metadata["INTERPOLATION_DEGREE"]) == 7
            found = [np.concatenate([one.position, one.velocity]) * 1e3 for one in segment.states]
            times = [(one.epoch - start).to_value("s") for one in segment.states]
            assert_close(found, mission, name, times)


@pytest.fixture(scope="module")
def uncertain_mission(tmp_path_factory):
    """The same mission with uncertainty of states and burns and a fourth stage."""
    errors = (
        'covariance = { position = "1 2 1 m", velocity = "1 1 1 mm/s" }\nexecution = { magnitude = "2 %" }'
    )
    text = SURE.replace('covariance = { position = "1 2 1 m", velocity = "1 1 1 mm/s" }', errors)
    return run(
        tmp_path_factory.mktemp("uncertain_mission"), text + '\n[[stage]]\ndo = "coast"\nfor = "0.2 orbits"\n'
    )


def sampled_states(mission, name: str, time: float, count: int):
    """Return sampled inertial states (count, 6) of a coasting spacecraft."""
    errors = np.random.default_rng(1).normal(size=(count, 6)) * [1.0, 2.0, 1.0, 1e-3, 1e-3, 1e-3]
    start = mission.results[0].after.path(name).state(0.0)
    states = mission.orbit.coast(start + errors, 2.0 * time).state(time)
    return mission.scenario.chief.inertial_from_relative(np.full(count, time), states)


@pytest.mark.parametrize(
    ("to", "suffix"), [("oem", "oem"), pytest.param("oem-xml", "xml", marks=pytest.mark.slow)]
)
def test_covariances_agree_with_sampled_states(uncertain_mission, tmp_path, to, suffix) -> None:
    """Covariances of a coasting spacecraft agree with 40 000 sampled states."""
    place = cf.export(uncertain_mission, tmp_path / to, to)
    start = Time(EPOCH, scale="utc")
    (segment,) = OrbitEphemerisMessage.open(place / f"F1.{suffix}").segments
    reported = list(segment.covariances)
    assert len(reported) >= 12
    for one in reported[1::8]:
        states = sampled_states(uncertain_mission, "F1", float((one.epoch - start).to_value("s")), 40_000)
        root = np.linalg.cholesky(1e6 * np.asarray(one.matrix))
        spread = np.cov(np.linalg.solve(root, (states - states.mean(axis=0)).T))
        # the standard error of a variance is 0.7 %, so that five of them are allowed
        np.testing.assert_allclose(spread, np.eye(6), atol=0.035)


def test_covariances_grow_at_burns(uncertain_mission, tmp_path) -> None:
    """Each segment begins with the covariance after its burn."""
    place = cf.export(uncertain_mission, tmp_path / "oem", "oem")
    files = [str(place / f"F{k}.oem") for k in (1, 2, 3)]
    segments = cf.read_oem_segments(files[2])
    assert len(segments) == 4
    for one in segments:
        assert one.covariances.times[0] == 0.0
        assert one.covariances.times[-1] < one.times[-1]
    speeds = [np.sqrt(np.trace(one.covariances.matrices[0][3:, 3:])) for one in segments]
    assert speeds[0] < speeds[1] < speeds[2]
    frame = cf.common_frame([cf.read_oem_segments(file) for file in files])
    for held in frame.covariances:
        np.testing.assert_allclose(np.sqrt(np.diag(held))[:3], [1.0, 2.0, 1.0], rtol=1e-4)
    assert len(cf.screen(frame.paths, cf.Sphere(5.0), frame.errors)) == 0


def test_exact_states_have_no_covariances(mission, exported_to) -> None:
    assert "COVARIANCE" not in (exported_to("oem") / "F1.oem").read_text()


def kvn(file: Path) -> list[tuple[dict[str, str], list[list[str]]]]:
    """Return blocks of a message: keywords and rows of words."""
    blocks: list = [({}, [])]
    for line in file.read_text().splitlines():
        if found := re.fullmatch(r"([A-Z_0-9]+) = (.*)", line):
            if blocks[-1][1]:
                blocks.append(({}, []))
            blocks[-1][0][found[1]] = re.sub(r" \[\S+\]$", "", found[2])
        elif re.match(r"[\d-]", line):
            blocks[-1][1].append(line.split())
    return blocks


def test_stated_interpolation_error_holds(mission, exported_to) -> None:
    """SciPy's interpolation through four nodes has the stated error."""
    place = exported_to("oem")
    stated = json.loads((place / "summary.json").read_text())["interpolation_error_m"]
    blocks = [
        (meta, np.array([[seconds(row[0]), *map(float, row[1:])] for row in rows]))
        for meta, rows in kvn(place / "F3.oem")
    ]
    for (_, rows), (_, after) in zip(blocks[:-1], blocks[1:], strict=True):
        assert rows[-1, 0] == after[0, 0]
        np.testing.assert_allclose(rows[-1, 1:4], after[0, 1:4], atol=1e-9)  # km
    worst, rng = 0.0, np.random.default_rng(1)
    for meta, rows in blocks:
        assert meta["START_TIME"] == meta["USEABLE_START_TIME"]
        for time in rng.uniform(rows[0, 0], rows[-1, 0], 60):
            first = int(np.clip(np.searchsorted(rows[:, 0], time) - 2, 0, len(rows) - 4))
            some = rows[first : first + 4]
            times, values = np.repeat(some[:, 0], 2), some[:, 1:].reshape(4, 2, 3).reshape(8, 3)
            off = (
                KroghInterpolator(times - time, values)(0.0) * 1e3
                - truth(mission, "F3", np.array([time]))[0, :3]
            )
            worst = max(worst, float(np.linalg.norm(off)))
    assert 0.1 * stated < worst < 2.0 * stated + 1e-8  # midpoints are nearly the worst


def test_messages_follow_the_schema(exported_to) -> None:
    """The package ccsds-ndm follows the CCSDS schemas."""
    for to, file in (("oem", "F3.oem"), ("oem-xml", "F3.xml"), ("opm", "F3.opm")):
        read = NdmIo().from_path(exported_to(to) / file)
        assert type(read).__name__ == to[:3].capitalize()
    segments = NdmIo().from_path(exported_to("oem") / "F3.oem").body.segment
    assert [one.metadata.interpolation_degree for one in segments] == [7] * 3


def test_manoeuvres_are_velocity_jumps(mission, exported_to) -> None:
    """Impulses are jumps of the inertial velocity, and a long burn adds up to the plan's."""
    opm = NdmIo().from_path(exported_to("opm") / "F3.opm").body.segment.data
    burns = opm.maneuver_parameters
    spent = sum(result.delta_v[2] for result in mission.results)
    pushes = (
        np.array([[getattr(one, f"man_dv_{k}").value for k in (1, 2, 3)] for one in burns], dtype=float) * 1e3
    )
    lasts = np.array([float(one.man_duration.value) for one in burns])
    starts = np.array([seconds(one.man_epoch_ignition) for one in burns])
    kicks = lasts == 0.0
    assert kicks.sum() >= 2
    assert (~kicks).sum() == 1
    step = 1e-6  # s
    for start, push in zip(starts[kicks], pushes[kicks], strict=True):
        jump = (
            truth(mission, "F3", np.array([start]))[0] - truth(mission, "F3", np.array([start]), left=True)[0]
        )
        if start < mission.results[-1].end - step:
            np.testing.assert_allclose(push, jump[3:], atol=1e-9)
    assert np.linalg.norm(pushes[kicks], axis=1).sum() == pytest.approx(
        mission.results[2].delta_v[2], rel=1e-9
    )
    # the vector sum of rotating thrust is at most the sum of norms
    assert mission.results[2].delta_v[2] < np.linalg.norm(pushes, axis=1).sum() <= spent * (1.0 + 1e-9)
    assert float(opm.spacecraft_parameters.mass.value) == 150.0
    burnt = sum(-float(one.man_delta_mass.value) for one in burns)
    assert burnt == pytest.approx(float(mission.propellant[:, 2].sum()), rel=1e-9)


def test_ocm_has_the_planned_thrust(mission, exported_to) -> None:
    """States, accelerations and impulses have their times in the standard's columns."""
    text = (exported_to("ocm") / "F3.ocm").read_text()
    meta = dict(re.findall(r"^(\w+) = (.*)$", text, re.MULTILINE))
    assert seconds(meta["EPOCH_TZERO"]) == 0.0
    parts = re.findall(r"(TRAJ|MAN)_START\n(.*?)\1_STOP", text, re.DOTALL)
    states = [body for kind, body in parts if kind == "TRAJ"]
    assert len(states) == 3
    for body in states:
        rows = np.array([line.split() for line in body.splitlines() if re.match(r"\d", line)], dtype=float)
        assert_close(rows[:, 1:] * 1e3, mission, "F3", rows[:, 0])
    impulses, thrust = (body for kind, body in parts if kind == "MAN")
    assert "MAN_COMPOSITION = TIME_RELATIVE, MAN_DURA, DELTA_MASS, DV_X, DV_Y, DV_Z\n" in impulses
    assert "MAN_COMPOSITION = TIME_RELATIVE, MAN_DURA, ACC_X, ACC_Y, ACC_Z, ACC_INTERP\n" in thrust
    rows = [line.split() for line in thrust.splitlines() if re.match(r"\d", line)]
    assert [row[-1] for row in rows].count("OFF") == 1
    times = np.array([row[0] for row in rows], dtype=float)
    found = np.linalg.norm(np.array([row[2:5] for row in rows], dtype=float), axis=1) * 1e3
    move = mission.results[1].after.path("F3")
    planned = np.linalg.norm(move.thrust(times[:-1]), axis=1)
    np.testing.assert_allclose(found[:-1], planned, rtol=1e-4)  # interpolation
    np.testing.assert_allclose(times[:-1] + [float(row[1]) for row in rows[:-1]], times[1:], atol=1e-8)


def test_stk_csv_and_czml_by_plain_parsing(mission, exported_to) -> None:
    text = (exported_to("stk") / "F3.e").read_text()
    assert text.startswith("stk.v.")
    assert "ScenarioEpoch 22 Nov 2026 12:00:00.000000000\n" in text
    assert "CoordinateSystem J2000\nBEGIN SegmentBoundaryTimes\n" in text
    rows = np.array([line.split() for line in text.splitlines() if len(line.split()) == 7], dtype=float)
    assert int(re.search(r"NumberOfEphemerisPoints (\d+)", text)[1]) == len(rows)
    inner = re.search(r"BEGIN SegmentBoundaryTimes\n(.*)END SegmentBoundaryTimes", text, re.DOTALL)[1].split()
    pieces = np.split(rows, np.flatnonzero(np.diff(rows[:, 0]) == 0.0) + 1)
    assert [piece[0, 0] for piece in pieces[1:]] == [float(edge) for edge in inner]
    for piece in pieces:
        assert_close(piece[:, 1:], mission, "F3", piece[:, 0])

    lines = [line for line in (exported_to("csv") / "states.csv").read_text().splitlines() if line[0] != "#"]
    assert lines[0] == "craft,epoch,time_s,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s"
    cells = [line.split(",") for line in lines[1:]]
    own = [(seconds(row[1]), *map(float, row[2:])) for row in cells if row[0] == "F3"]
    values = np.array(own)
    np.testing.assert_allclose(values[:, 0], values[:, 1], atol=1e-9)
    for piece in np.split(values, np.flatnonzero(np.diff(values[:, 1]) == 0.0) + 1):
        assert_close(piece[:, 2:], mission, "F3", piece[:, 1])

    packets = json.loads((exported_to("czml") / "formation.czml").read_text())
    assert packets[0]["id"] == "document"
    assert [one["name"] for one in packets[1:]] == ["F1", "F2", "F3"]
    for interval in packets[3]["position"]:
        assert (interval["referenceFrame"], interval["interpolationAlgorithm"]) == ("INERTIAL", "HERMITE")
        rows = np.array(interval["cartesianVelocity"]).reshape(-1, 7)
        begin, end = interval["interval"].split("/")
        assert seconds(end) - seconds(begin) == pytest.approx(rows[-1, 0], abs=2e-9)
        assert_close(rows[:, 1:], mission, "F3", rows[:, 0] + seconds(interval["epoch"]))


@pytest.fixture
def kernels(exported_to, tmp_path):
    """Load the export into SPICE."""
    (tmp_path / "leap.tls").write_text(LEAP_SECONDS)
    names = [exported_to("spk") / name for name in ("formation.bsp", "formation.tf")]
    for kernel in (*names, tmp_path / "leap.tls"):
        spiceypy.furnsh(str(kernel))
    yield names[0]
    spiceypy.kclear()


def elapsed(epoch: float) -> float:
    """Return the seconds of UTC from the export's epoch to SPICE's [s TDB], finer than a double's steps."""
    whole = (datetime.fromisoformat(EPOCH) - datetime(2000, 1, 1, 12)).total_seconds()
    return (epoch - whole) - spiceypy.deltet(epoch, "ET")


def test_spk_read_by_spice(mission, kernels) -> None:
    """SPICE finds spacecraft by name and interpolates between nodes."""
    code, start = spiceypy.bodn2c("F3"), spiceypy.str2et(EPOCH)
    first, last = spiceypy.wnfetd(spiceypy.spkcov(str(kernels), code), 0)
    assert (elapsed(first), elapsed(last)) == pytest.approx((0.0, mission.results[-1].end), abs=2e-7)
    for time in (20.0, 133.3, 140.0, 260.0, 400.0, 700.0, 1500.0):
        epoch = start + time  # a double has a resolution of 1.2e-7 s
        state = spiceypy.spkgeo(code, epoch, "J2000", 399)[0] * 1e3
        known = truth(mission, "F3", np.array([elapsed(epoch)]))[0]
        assert np.abs(state[:3] - known[:3]).max() < 2.0 * MICROMETRE
        assert np.abs(state[3:] - known[3:]).max() < 1e-5  # m/s


@pytest.mark.parametrize("system", ["UTC", "GPS", "TDB"])
def test_spk_time_systems(system, kernels, tmp_path) -> None:
    """TDB differs from TAI by up to 29 us within a day, 0.2 m along the orbit."""
    orbit = cf.Orbit.circular(500e3)
    elements = [cf.elements.semi_major_axis_from_mean_motion(orbit.mean_motion), 0, 0, 0, 1.7, 0.5]
    chief = cf.Chief.from_elements("2027-01-03T00:00:00", elements, time_system=system)
    path = orbit.coast([0, 100.0, 0, 0, 0, 0], 86400.0)
    place = cf.export(path, tmp_path / "spk", "spk", chief=chief, names=["A"])
    spiceypy.kclear()
    for kernel in (place / "formation.bsp", tmp_path / "leap.tls"):
        spiceypy.furnsh(str(kernel))
    behind = {"UTC": 0, "GPS": -18, "TDB": 0}[system]  # s of UTC
    for time in (0.5, 43200.25, 86399.0):
        stamp = datetime(2027, 1, 3) + timedelta(seconds=time + behind)
        epoch = spiceypy.str2et(f"{stamp:%Y-%m-%d %H:%M:%S.%f}{' TDB' * (system == 'TDB')}")
        state = spiceypy.spkgeo(-999001, epoch, "J2000", 399)[0] * 1e3
        known = chief.inertial_from_relative([time], path.state([time]))[0]
        assert np.abs(state - known).max() < 2e-3  # m; resolution of epochs


def test_spk_segments_have_type_13(mission, kernels) -> None:
    """Nodes of the file agree with the closed form to a micrometre."""
    handle = spiceypy.dafopr(str(kernels))
    try:
        spiceypy.dafbfs(handle)
        held = []
        while spiceypy.daffna():
            held.append(spiceypy.dafus(spiceypy.dafgs(), 2, 6))
        assert [int(integers[3]) for _, integers in held] == [13] * 5
        for _, integers in [one for one in held if one[1][0] == -999003]:
            data = np.array(spiceypy.dafgda(handle, int(integers[4]), int(integers[5])))
            count = int(data[-1])
            times = np.array([elapsed(epoch) for epoch in data[6 * count : 7 * count]])
            known = truth(mission, "F3", times)
            known[-1] = truth(mission, "F3", times[-1:], left=True)[0]
            assert np.abs(data[: 6 * count].reshape(count, 6)[:, :3] * 1e3 - known[:, :3]).max() < MICROMETRE
    finally:
        spiceypy.dafcls(handle)


def test_rotating_frame_has_its_registered_name(mission, exported_to) -> None:
    """The frame is RSW_ROTATING about the formation, not LVLH."""
    file = exported_to("oem", frame="hill") / "F3.oem"
    assert "LVLH" not in file.read_text()
    for meta, rows in kvn(file):
        assert (meta["REF_FRAME"], meta["CENTER_NAME"]) == ("RSW_ROTATING", "FORMATION")
        times = np.array([seconds(row[0]) for row in rows])
        found = np.array([row[1:] for row in rows], dtype=float) * 1e3
        chief = mission.scenario.chief
        known = truth(mission, "F3", times)
        known[-1] = truth(mission, "F3", times[-1:], left=True)[0]
        np.testing.assert_allclose(chief.inertial_from_relative(times, found)[:, :3], known[:, :3], atol=2e-6)


def matrix(q: np.ndarray) -> np.ndarray:
    """Return the rotation from frame A to B after CCSDS 504.0-B-2 annex F2."""
    a, b, c, d = q
    return np.array(
        [
            [a * a - b * b - c * c + d * d, 2 * (a * b + c * d), 2 * (a * c - b * d)],
            [2 * (a * b - c * d), -a * a + b * b - c * c + d * d, 2 * (b * c + a * d)],
            [2 * (a * c + b * d), 2 * (b * c - a * d), -a * a - b * b + c * c + d * d],
        ]
    )


def test_aem_attitudes_of_a_search(tmp_path) -> None:
    mission = run(tmp_path, SEARCHING.replace('do = "gather"\nrounds = 2', 'do = "lock"'))
    place = cf.export(mission, tmp_path / "aem", "aem", frame="ICRF")
    search = mission.results[0].result.search
    for name, group in (("L1", "A"), ("L2", "B")):
        read = NdmIo().from_path(place / f"{name}.aem")
        assert len(read.body.segment) == len(search.legs)
        rows = 0
        for meta, lines in kvn(place / f"{name}.aem"):
            assert (meta["REF_FRAME_A"], meta["REF_FRAME_B"]) == ("ICRF", "SC_BODY_1")
            assert (meta["ATTITUDE_DIR"], meta["QUATERNION_TYPE"]) == ("A2B", "LAST")
            times = np.array([seconds(line[0]) for line in lines])
            known = search.attitude(np.clip(times[1:-1], 0.0, search.duration), group)
            found = np.array([line[1:] for line in lines], dtype=float)
            assert np.abs((found**2).sum(axis=1) - 1.0).max() < 1e-12
            assert ((found[1:] * found[:-1]).sum(axis=1) > 0.9).all()  # no sign changes
            for quaternion, attitude in zip(found[1:-1], known, strict=True):
                assert np.abs(matrix(quaternion) - attitude.T).max() < 1e-12  # body z is the third row
            rows += len(lines)
        assert rows > 300


def test_aem_attitudes_with_errors(tmp_path) -> None:
    """Compare with independently turning bodies."""
    errors = {"pointing_error": "1 -2 3 deg", "start_offset": "20 s", "slew_rate_error": "2 %"}
    exported_to = "".join(f'{key} = "{value}"\n' for key, value in errors.items())
    text = SEARCHING.replace('do = "gather"\nrounds = 2', 'do = "lock"').replace(
        "[sensor]", f"{exported_to}[sensor]"
    )
    mission = run(tmp_path, text)
    place = cf.export(mission, tmp_path / "aem", "aem", frame="ICRF")
    search = mission.results[0].result.search
    turned = [(leg.phase, "sun" if leg.about == "sun line" else "y", leg.angle) for leg in search.legs]
    off = {"pointing": np.radians([1.0, -2.0, 3.0]), "start": 20.0, "slew_rate": 0.02}
    for name, group in (("L2", "B"),):
        body, rows = Body(turned, group, **off), 0
        for _, lines in kvn(place / f"{name}.aem"):
            times = np.array([seconds(line[0]) for line in lines])
            known = body.bodies(times[1:-1:20])
            for line, attitude in zip(lines[1:-1:20], known, strict=True):
                found = matrix(np.array(line[1:], dtype=float))
                assert np.abs(found - attitude.T).max() < 1e-8  # times have a resolution of 1e-9 s
            rows += len(lines)
        assert rows > 300


def test_cdm_has_covariances_and_probabilities(tmp_path) -> None:
    mission = run(tmp_path, SURE)
    place = cf.export(mission, tmp_path / "cdm", "cdm")
    met = mission.results[1].before.conflicts
    files = sorted(place.glob("*.cdm"))
    assert len(files) == len(met) >= 1
    for file in files:
        reported = cf.read_cdm(file)
        one = next(one for one in met if f"-{one.first}-{one.second}-" in file.name)
        flight, chief = mission.results[1].before, mission.scenario.chief
        times = np.linspace(one.start, one.end, 100_001)
        apart = np.linalg.norm(
            flight.path(one.first).position(times) - flight.path(one.second).position(times), axis=1
        )
        assert reported.miss_distance == pytest.approx(apart.min(), abs=1e-3)  # arcs and chords of 21 m
        assert seconds(reported.tca) == pytest.approx(times[apart.argmin()], abs=2.0 * (times[1] - times[0]))
        known = chief.inertial_from_relative(
            seconds(reported.tca), flight.path(one.first).state(seconds(reported.tca))
        )
        assert np.abs(reported.objects[0].inertial_state[:3] - known[:3]).max() < MICROMETRE
        assert reported.hard_body_radius == 4.0
        assert 0.0 <= reported.collision_probability < 1e-3
        assert "short encounter" in file.read_text()
        # variances are propagated along the path
        errors = mission.scenario.craft[0].errors
        path = cf.join([mission.results[0].after.path(one.first), flight.path(one.first)])
        carried = errors.covariance(path, seconds(reported.tca))
        np.testing.assert_allclose(
            reported.objects[0].covariance.diagonal()[:3], carried.diagonal()[:3], rtol=1e-3
        )


def test_loaded_results_export_like_the_mission(mission, exported_to, tmp_path, monkeypatch) -> None:
    (tmp_path / "case.toml").write_text(FLYING)
    main(["run", str(tmp_path / "case.toml"), "--no-viewer", "--out", str(tmp_path / "results")])
    monkeypatch.chdir(tmp_path)
    for to in ("oem", "csv"):
        assert main(["export", "results", "--to", to]) == 0
        for file in exported_to(to).iterdir():
            if file.name != "summary.json":
                mine = (tmp_path / f"results-{to}" / file.name).read_text()
                theirs, own = (re.sub("CREATION_DATE = .*", "", text) for text in (file.read_text(), mine))
                assert own == theirs


def test_loaded_results_without_burns(tmp_path) -> None:
    (tmp_path / "case.toml").write_text(SEARCHING.replace('do = "gather"\nrounds = 2', 'do = "lock"'))
    main(["run", str(tmp_path / "case.toml"), "--no-viewer", "--out", str(tmp_path / "results")])
    loaded = cf.load(tmp_path / "results")
    assert {len(column) for column in loaded.burns.values()} == {0}
    assert set(loaded.burns) == set(cf.run(tmp_path / "case.toml").burns)
    place = cf.export(loaded, tmp_path / "opm", "opm", frame="ICRF")
    assert "COMMENT 0 manoeuvres" in (place / "L1.opm").read_text()


def test_export_does_not_overwrite(mission, tmp_path) -> None:
    place = cf.export(mission, tmp_path / "out", "csv")
    before = (place / "states.csv").read_bytes()
    with pytest.raises(ValueError, match=r"out: holds finished results; add --overwrite or choose another"):
        cf.export(mission, place, "oem")
    assert (place / "states.csv").read_bytes() == before
    cf.export(mission, place, "oem", overwrite=True)
    assert not (place / "states.csv").exists()
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("years of work")
    with pytest.raises(ValueError, match="not empty; choose another"):
        cf.export(mission, tmp_path / "mine", "oem", overwrite=True)
    with pytest.raises(ValueError, match="no craft searches"):
        cf.export(mission, tmp_path / "none", "aem")
    assert not (tmp_path / "none").exists()


def test_names_that_are_invalid_file_names(tmp_path) -> None:
    orbit = cf.Orbit.circular(500e3)
    chief = cf.Chief.from_elements(
        EPOCH, [cf.elements.semi_major_axis_from_mean_motion(orbit.mean_motion), 0, 0, 0, 1.7, 0.5]
    )
    paths = orbit.coast(np.eye(6)[:4] * 100.0, 600.0)
    names = ["A/B", "a b", "../x", "A_B"]
    place = cf.export(paths, tmp_path / "out", "oem", chief=chief, names=names)
    files = sorted(file.name for file in place.iterdir())
    assert files == ["A_B-3.oem", "A_B.oem", "a_b-2.oem", "summary.json", "x.oem"]
    assert cf.read_oem(place / "A_B.oem").name == "A/B"
    names = ["A, B", "A,B", 'say "C"', "D E"]
    table = cf.export(paths, tmp_path / "csv", "csv", chief=chief, names=names) / "states.csv"
    assert [one.name for one in cf.read_csv(table)] == names


def test_formats_in_utc(tmp_path) -> None:
    """STK and CZML count in UTC, messages in the chief's time system."""
    orbit = cf.Orbit.circular(500e3)
    elements = [cf.elements.semi_major_axis_from_mean_motion(orbit.mean_motion), 0, 0, 0, 1.7, 0.5]
    chief = cf.Chief.from_elements("2026-11-22T12:00:37", elements, frame="TEME", time_system="TAI")
    path = orbit.coast([0, 100.0, 0, 0, 0, 0], 600.0)
    (file,) = cf.export(path, tmp_path / "stk", "stk", chief=chief, names=["A"]).glob("*.e")
    assert "ScenarioEpoch 22 Nov 2026 12:00:00.000000000\n" in file.read_text()
    assert "CoordinateSystem TEMEOfDate\n" in file.read_text()
    (file,) = cf.export(path, tmp_path / "oem", "oem", chief=chief, names=["A"]).glob("*.oem")
    assert "TIME_SYSTEM = TAI\nSTART_TIME = 2026-11-22T12:00:37.000000000\n" in file.read_text()
    with pytest.raises(
        ValueError, match="czml: cannot represent frame TEME; give a chief in EME2000, J2000,"
    ):
        cf.export(path, tmp_path / "czml", "czml", chief=chief)
    fixed = cf.Chief(chief.epoch, chief.state, time_system="TAI")
    place = cf.export(path, tmp_path / "czml", "czml", chief=fixed)
    clock = json.loads((place / "formation.czml").read_text())[0]["clock"]
    assert clock["interval"] == "2026-11-22T12:00:00.000000000Z/2026-11-22T12:10:00.000000000Z"
    moon = cf.Chief(chief.epoch, chief.state, center="VENUS")
    with pytest.raises(
        ValueError, match="spk: cannot represent center VENUS; use one of EARTH, MOON, SUN, MARS"
    ):
        cf.export(path, tmp_path / "spk", "spk", chief=moon)


def test_close_burn_times_leave_few_nodes(tmp_path) -> None:
    """Burn times of two spacecraft that differ by milliseconds need no tiny steps."""
    orbit = cf.Orbit.circular(500e3)
    elements = [cf.elements.semi_major_axis_from_mean_motion(orbit.mean_motion), 0, 0, 0, 1.7, 0.5]
    chief = cf.Chief.from_elements(EPOCH, elements)
    paths = []
    for late in (0.0, 2e-3):
        parts = [orbit.coast([0, 100.0 + late, 0, 0, 0, 0], 100.0 + late)]
        for _ in range(10):
            end = parts[-1].end
            parts.append(orbit.burn(parts[-1].state(end), [0, 1e-3, 0], 0.5, end))
            end = parts[-1].end
            parts.append(orbit.coast(parts[-1].state(end), 30.0, end))
        paths.append(cf.join(parts))
    end = min(path.end for path in paths)
    place = cf.export(cf.stack(paths), tmp_path / "oem", "oem", chief=chief, names=["A", "B"])
    reported = json.loads((place / "summary.json").read_text())
    assert end > 400.0
    assert reported["interpolation_error_m"] < 1e-6
    assert {one["segments"] for one in reported["craft"].values()} == {21}
    assert max(one["states"] for one in reported["craft"].values()) < 200
