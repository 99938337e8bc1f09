"""Exports are read back by readers that are not closeform's: states to a micrometre, quaternions to 1e-12."""

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

pytestmark = pytest.mark.usefixtures("unpainted")

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
def flown(tmp_path_factory):
    """A coast, a move by thrust and one by impulses, in orbit from an epoch on."""
    return run(tmp_path_factory.mktemp("flown"), FLYING)


@pytest.fixture(scope="module")
def given(flown, tmp_path_factory):
    """The folder of an export, made once for each format."""
    made: dict[tuple, Path] = {}

    def export(to: str, **options) -> Path:
        key = (to, *options.items())
        if key not in made:
            made[key] = cf.export(flown, tmp_path_factory.mktemp("export") / to, to, **options)
        return made[key]

    return export


def close(found, mission, name: str, times) -> None:
    """States of a smooth piece are those of the plan: at its first epoch after a burn, at its last before."""
    found, times = np.asarray(found), np.asarray(times)
    known = truth(mission, name, times)
    known[-1] = truth(mission, name, times[-1:], left=True)[0]
    assert np.abs(found[:, :3] - known[:, :3]).max() < MICROMETRE
    assert np.abs(found[:, 3:] - known[:, 3:]).max() < 1e-9  # m/s


@pytest.mark.parametrize(("to", "suffix"), [("oem", "oem"), ("oem-xml", "xml")])
def test_an_independent_reader_has_the_states_of_the_plan(flown, given, to, suffix) -> None:
    """oem (by B. Hawkins), in both forms; all epochs have nine decimals."""
    place = given(to)
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
            close(found, flown, name, times)


@pytest.fixture(scope="module")
def unsure(tmp_path_factory):
    """The same craft with errors of their states and of burns, and a fourth stage after the burns."""
    errors = (
        'covariance = { position = "1 2 1 m", velocity = "1 1 1 mm/s" }\nexecution = { magnitude = "2 %" }'
    )
    text = SURE.replace('covariance = { position = "1 2 1 m", velocity = "1 1 1 mm/s" }', errors)
    return run(tmp_path_factory.mktemp("unsure"), text + '\n[[stage]]\ndo = "coast"\nfor = "0.2 orbits"\n')


def drawn(mission, name: str, time: float, count: int):
    """Inertial states (count, 6) of a craft that coasts from the start, of errors drawn there."""
    errors = np.random.default_rng(1).normal(size=(count, 6)) * [1.0, 2.0, 1.0, 1e-3, 1e-3, 1e-3]
    start = mission.results[0].after.path(name).state(0.0)
    states = mission.orbit.coast(start + errors, 2.0 * time).state(time)
    return mission.scenario.chief.inertial_from_relative(np.full(count, time), states)


@pytest.mark.parametrize(("to", "suffix"), [("oem", "oem"), ("oem-xml", "xml")])
def test_covariances_are_those_of_states_that_are_drawn(unsure, tmp_path, to, suffix) -> None:
    """By another reader: of the craft that never burns, at four epochs, of 40000 draws each."""
    place = cf.export(unsure, tmp_path / to, to)
    start = Time(EPOCH, scale="utc")
    (segment,) = OrbitEphemerisMessage.open(place / f"F1.{suffix}").segments
    told = list(segment.covariances)
    assert len(told) >= 12
    for one in told[1::4]:
        states = drawn(unsure, "F1", float((one.epoch - start).to_value("s")), 40_000)
        root = np.linalg.cholesky(1e6 * np.asarray(one.matrix))
        spread = np.cov(np.linalg.solve(root, (states - states.mean(axis=0)).T))
        # of 40000 draws a variance is known to 0.7 %, and five such are never met
        np.testing.assert_allclose(spread, np.eye(6), atol=0.035)


def test_covariances_grow_at_burns_and_are_those_of_a_screening(unsure, tmp_path) -> None:
    """Each segment begins with the covariance after its burn, the first with the scenario's."""
    place = cf.export(unsure, tmp_path / "oem", "oem")
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


def test_exactly_known_craft_have_no_covariances(flown, given) -> None:
    assert "COVARIANCE" not in (given("oem") / "F1.oem").read_text()


def kvn(file: Path) -> list[tuple[dict[str, str], list[list[str]]]]:
    """Blocks of a message: keywords and rows of words, cut where keywords begin again."""
    blocks: list = [({}, [])]
    for line in file.read_text().splitlines():
        if found := re.fullmatch(r"([A-Z_0-9]+) = (.*)", line):
            if blocks[-1][1]:
                blocks.append(({}, []))
            blocks[-1][0][found[1]] = re.sub(r" \[\S+\]$", "", found[2])
        elif re.match(r"[\d-]", line):
            blocks[-1][1].append(line.split())
    return blocks


def test_segments_meet_at_burns_and_between_nodes_the_stated_error_holds(flown, given) -> None:
    """By scipy's polynomials through the four nodes around, at a thousand instants."""
    place = given("oem")
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
        for time in rng.uniform(rows[0, 0], rows[-1, 0], 200):
            first = int(np.clip(np.searchsorted(rows[:, 0], time) - 2, 0, len(rows) - 4))
            some = rows[first : first + 4]
            times, values = np.repeat(some[:, 0], 2), some[:, 1:].reshape(4, 2, 3).reshape(8, 3)
            off = (
                KroghInterpolator(times - time, values)(0.0) * 1e3
                - truth(flown, "F3", np.array([time]))[0, :3]
            )
            worst = max(worst, float(np.linalg.norm(off)))
    assert 0.1 * stated < worst < 2.0 * stated + 1e-8  # the middle between nodes is nearly the worst


def test_a_schema_of_the_standard_takes_ephemerides_and_parameters(given) -> None:
    """ccsds-ndm, which follows CCSDS's own schemas."""
    for to, file in (("oem", "F3.oem"), ("oem-xml", "F3.xml"), ("opm", "F3.opm")):
        read = NdmIo().from_path(given(to) / file)
        assert type(read).__name__ == to[:3].capitalize()
    segments = NdmIo().from_path(given("oem") / "F3.oem").body.segment
    assert [one.metadata.interpolation_degree for one in segments] == [7] * 3


def test_manoeuvres_are_the_velocity_jumps_of_the_ephemeris(flown, given) -> None:
    """Impulses of OPM and OCM are what the inertial velocity jumps by; a long burn adds up to the plan's."""
    opm = NdmIo().from_path(given("opm") / "F3.opm").body.segment.data
    burns = opm.maneuver_parameters
    spent = sum(result.delta_v[2] for result in flown.results)
    pushes = (
        np.array([[getattr(one, f"man_dv_{k}").value for k in (1, 2, 3)] for one in burns], dtype=float) * 1e3
    )
    lasts = np.array([float(one.man_duration.value) for one in burns])
    starts = np.array([seconds(one.man_epoch_ignition) for one in burns])
    kicks = lasts == 0.0
    assert kicks.sum() >= 2
    assert (~kicks).sum() == 1
    step = 1e-6  # s: an orbit bends the velocity by 1e-5 m/s in it
    for start, push in zip(starts[kicks], pushes[kicks], strict=True):
        jump = truth(flown, "F3", np.array([start]))[0] - truth(flown, "F3", np.array([start]), left=True)[0]
        if start < flown.results[-1].end - step:
            np.testing.assert_allclose(push, jump[3:], atol=1e-9)
    assert np.linalg.norm(pushes[kicks], axis=1).sum() == pytest.approx(flown.results[2].delta_v[2], rel=1e-9)
    # a thrust that turns adds up to no more than its size
    assert flown.results[2].delta_v[2] < np.linalg.norm(pushes, axis=1).sum() <= spent * (1.0 + 1e-9)
    assert float(opm.spacecraft_parameters.mass.value) == 150.0
    burnt = sum(-float(one.man_delta_mass.value) for one in burns)
    assert burnt == pytest.approx(float(flown.propellant[:, 2].sum()), rel=1e-9)


def test_thrust_in_a_comprehensive_message_is_that_of_the_plan(flown, given) -> None:
    """States, accelerations and impulses at their time tags, by the standard's own order of columns."""
    text = (given("ocm") / "F3.ocm").read_text()
    meta = dict(re.findall(r"^(\w+) = (.*)$", text, re.MULTILINE))
    assert seconds(meta["EPOCH_TZERO"]) == 0.0
    parts = re.findall(r"(TRAJ|MAN)_START\n(.*?)\1_STOP", text, re.DOTALL)
    states = [body for kind, body in parts if kind == "TRAJ"]
    assert len(states) == 3
    for body in states:
        rows = np.array([line.split() for line in body.splitlines() if re.match(r"\d", line)], dtype=float)
        close(rows[:, 1:] * 1e3, flown, "F3", rows[:, 0])
    impulses, thrust = (body for kind, body in parts if kind == "MAN")
    assert "MAN_COMPOSITION = TIME_RELATIVE, MAN_DURA, DELTA_MASS, DV_X, DV_Y, DV_Z\n" in impulses
    assert "MAN_COMPOSITION = TIME_RELATIVE, MAN_DURA, ACC_X, ACC_Y, ACC_Z, ACC_INTERP\n" in thrust
    rows = [line.split() for line in thrust.splitlines() if re.match(r"\d", line)]
    assert [row[-1] for row in rows].count("OFF") == 1
    times = np.array([row[0] for row in rows], dtype=float)
    found = np.linalg.norm(np.array([row[2:5] for row in rows], dtype=float), axis=1) * 1e3
    move = flown.results[1].after.path("F3")
    planned = np.linalg.norm(move.thrust(times[:-1]), axis=1)
    np.testing.assert_allclose(found[:-1], planned, rtol=1e-4)  # arcs are longer than their chords
    np.testing.assert_allclose(times[:-1] + [float(row[1]) for row in rows[:-1]], times[1:], atol=1e-8)


def test_stk_csv_and_czml_by_plain_parsing(flown, given) -> None:
    text = (given("stk") / "F3.e").read_text()
    assert text.startswith("stk.v.")
    assert "ScenarioEpoch 22 Nov 2026 12:00:00.000000000\n" in text
    assert "CoordinateSystem J2000\nBEGIN SegmentBoundaryTimes\n" in text
    rows = np.array([line.split() for line in text.splitlines() if len(line.split()) == 7], dtype=float)
    assert int(re.search(r"NumberOfEphemerisPoints (\d+)", text)[1]) == len(rows)
    inner = re.search(r"BEGIN SegmentBoundaryTimes\n(.*)END SegmentBoundaryTimes", text, re.DOTALL)[1].split()
    pieces = np.split(rows, np.flatnonzero(np.diff(rows[:, 0]) == 0.0) + 1)
    assert [piece[0, 0] for piece in pieces[1:]] == [float(edge) for edge in inner]
    for piece in pieces:
        close(piece[:, 1:], flown, "F3", piece[:, 0])

    lines = [line for line in (given("csv") / "states.csv").read_text().splitlines() if line[0] != "#"]
    assert lines[0] == "craft,epoch,time_s,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s"
    cells = [line.split(",") for line in lines[1:]]
    own = [(seconds(row[1]), *map(float, row[2:])) for row in cells if row[0] == "F3"]
    values = np.array(own)
    np.testing.assert_allclose(values[:, 0], values[:, 1], atol=1e-9)
    for piece in np.split(values, np.flatnonzero(np.diff(values[:, 1]) == 0.0) + 1):
        close(piece[:, 2:], flown, "F3", piece[:, 1])

    packets = json.loads((given("czml") / "formation.czml").read_text())
    assert packets[0]["id"] == "document"
    assert [one["name"] for one in packets[1:]] == ["F1", "F2", "F3"]
    for interval in packets[3]["position"]:
        assert (interval["referenceFrame"], interval["interpolationAlgorithm"]) == ("INERTIAL", "HERMITE")
        rows = np.array(interval["cartesianVelocity"]).reshape(-1, 7)
        begin, end = interval["interval"].split("/")
        assert seconds(end) - seconds(begin) == pytest.approx(rows[-1, 0], abs=2e-9)
        close(rows[:, 1:], flown, "F3", rows[:, 0] + seconds(interval["epoch"]))


@pytest.fixture
def kernels(given, tmp_path):
    """The export in SPICE's pool."""
    (tmp_path / "leap.tls").write_text(LEAP_SECONDS)
    names = [given("spk") / name for name in ("formation.bsp", "formation.tf")]
    for kernel in (*names, tmp_path / "leap.tls"):
        spiceypy.furnsh(str(kernel))
    yield names[0]
    spiceypy.kclear()


def elapsed(epoch: float) -> float:
    """Return the seconds of UTC from the export's epoch to SPICE's [s TDB], finer than a double's steps."""
    whole = (datetime.fromisoformat(EPOCH) - datetime(2000, 1, 1, 12)).total_seconds()
    return (epoch - whole) - spiceypy.deltet(epoch, "ET")


def test_a_kernel_read_by_spice(flown, kernels) -> None:
    """By name, at its own nodes and between them, where Hermite's polynomials of degree 7 lead."""
    code, start = spiceypy.bodn2c("F3"), spiceypy.str2et(EPOCH)
    first, last = spiceypy.wnfetd(spiceypy.spkcov(str(kernels), code), 0)
    assert (elapsed(first), elapsed(last)) == pytest.approx((0.0, flown.results[-1].end), abs=2e-7)
    for time in (20.0, 133.3, 140.0, 260.0, 400.0, 700.0, 1500.0):
        epoch = start + time  # a double: what was meant to 1.2e-7 s
        state = spiceypy.spkgeo(code, epoch, "J2000", 399)[0] * 1e3
        known = truth(flown, "F3", np.array([elapsed(epoch)]))[0]
        assert np.abs(state[:3] - known[:3]).max() < 2.0 * MICROMETRE
        assert np.abs(state[3:] - known[3:]).max() < 1e-5  # m/s, of which 3e-6 are per second of TDB


@pytest.mark.parametrize("system", ["UTC", "GPS", "TDB"])
def test_a_kernel_keeps_to_the_clock(system, kernels, tmp_path) -> None:
    """Over a day near the perihelion, where TDB gains 29 microseconds on TAI: 0.2 m along the orbit."""
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
        assert np.abs(state - known).max() < 2e-3  # m: a double of such an epoch is off by a millimetre


def test_a_kernel_holds_segments_of_type_13(flown, kernels) -> None:
    """Its own nodes and states, as the file has them, are on the closed form: to a micrometre."""
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
            known = truth(flown, "F3", times)
            known[-1] = truth(flown, "F3", times[-1:], left=True)[0]
            assert np.abs(data[: 6 * count].reshape(count, 6)[:, :3] * 1e3 - known[:, :3]).max() < MICROMETRE
    finally:
        spiceypy.dafcls(handle)


def test_the_rotating_frame_has_its_registered_name(flown, given) -> None:
    """States as planned, about the formation; nothing is called LVLH."""
    file = given("oem", frame="hill") / "F3.oem"
    assert "LVLH" not in file.read_text()
    for meta, rows in kvn(file):
        assert (meta["REF_FRAME"], meta["CENTER_NAME"]) == ("RSW_ROTATING", "FORMATION")
        times = np.array([seconds(row[0]) for row in rows])
        found = np.array([row[1:] for row in rows], dtype=float) * 1e3
        chief = flown.scenario.chief
        known = truth(flown, "F3", times)
        known[-1] = truth(flown, "F3", times[-1:], left=True)[0]
        np.testing.assert_allclose(chief.inertial_from_relative(times, found)[:, :3], known[:, :3], atol=2e-6)


def matrix(q: np.ndarray) -> np.ndarray:
    """Of coordinates in frame A to those in B, as CCSDS 504.0-B-2 annex F2 writes it out."""
    a, b, c, d = q
    return np.array(
        [
            [a * a - b * b - c * c + d * d, 2 * (a * b + c * d), 2 * (a * c - b * d)],
            [2 * (a * b - c * d), -a * a + b * b - c * c + d * d, 2 * (b * c + a * d)],
            [2 * (a * c + b * d), 2 * (b * c - a * d), -a * a - b * b + c * c + d * d],
        ]
    )


def test_attitudes_of_a_search_by_the_standards_formula(tmp_path) -> None:
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
            assert ((found[1:] * found[:-1]).sum(axis=1) > 0.9).all()  # no jumps of sign
            for quaternion, attitude in zip(found[1:-1], known, strict=True):
                assert np.abs(matrix(quaternion) - attitude.T).max() < 1e-12  # body z is its third row
            rows += len(lines)
        assert rows > 300


def test_attitudes_of_craft_that_are_off_their_search(tmp_path) -> None:
    """By bodies that turn for themselves."""
    errors = {"pointing_error": "1 -2 3 deg", "start_offset": "20 s", "slew_rate_error": "2 %"}
    given = "".join(f'{key} = "{value}"\n' for key, value in errors.items())
    text = SEARCHING.replace('do = "gather"\nrounds = 2', 'do = "lock"').replace(
        "[sensor]", f"{given}[sensor]"
    )
    mission = run(tmp_path, text)
    place = cf.export(mission, tmp_path / "aem", "aem", frame="ICRF")
    search = mission.results[0].result.search
    turned = [(leg.phase, "sun" if leg.about == "sun line" else "y", leg.angle) for leg in search.legs]
    off = {"pointing": np.radians([1.0, -2.0, 3.0]), "start": 20.0, "slew_rate": 0.02}
    for name, group in (("L1", "A"), ("L2", "B")):
        body, rows = Body(turned, group, **off), 0
        for _, lines in kvn(place / f"{name}.aem"):
            times = np.array([seconds(line[0]) for line in lines])
            known = body.bodies(times[1:-1])
            for line, attitude in zip(lines[1:-1], known, strict=True):
                found = matrix(np.array(line[1:], dtype=float))
                assert np.abs(found - attitude.T).max() < 1e-8  # times are told to 1e-9 s at 0.004 rad/s
            rows += len(lines)
        assert rows > 300


def test_conjunction_messages_have_covariances_and_probabilities(tmp_path) -> None:
    mission = run(tmp_path, SURE)
    place = cf.export(mission, tmp_path / "cdm", "cdm")
    met = mission.results[1].before.conflicts
    files = sorted(place.glob("*.cdm"))
    assert len(files) == len(met) >= 1
    for file in files:
        told = cf.read_cdm(file)
        one = next(one for one in met if f"-{one.first}-{one.second}-" in file.name)
        flight, chief = mission.results[1].before, mission.scenario.chief
        times = np.linspace(one.start, one.end, 100_001)
        apart = np.linalg.norm(
            flight.path(one.first).position(times) - flight.path(one.second).position(times), axis=1
        )
        assert told.miss_distance == pytest.approx(apart.min(), abs=1e-3)  # arcs and chords of 21 m
        assert seconds(told.tca) == pytest.approx(times[apart.argmin()], abs=2.0 * (times[1] - times[0]))
        known = chief.inertial_from_relative(
            seconds(told.tca), flight.path(one.first).state(seconds(told.tca))
        )
        assert np.abs(told.objects[0].inertial_state[:3] - known[:3]).max() < MICROMETRE
        assert told.hard_body_radius == 4.0
        # the covariance's own probability, by the two-body frame of the first
        assert 0.0 <= told.collision_probability < 1e-3
        assert "short encounter" in file.read_text()
        # along its own axes variances are those that were carried there
        errors = mission.scenario.craft[0].errors
        path = cf.join([mission.results[0].after.path(one.first), flight.path(one.first)])
        carried = errors.covariance(path, seconds(told.tca))
        np.testing.assert_allclose(
            told.objects[0].covariance.diagonal()[:3], carried.diagonal()[:3], rtol=1e-3
        )


def test_a_loaded_folder_exports_what_the_mission_does(flown, given, tmp_path, monkeypatch) -> None:
    (tmp_path / "case.toml").write_text(FLYING)
    main(["run", str(tmp_path / "case.toml"), "--no-viewer", "--out", str(tmp_path / "results")])
    monkeypatch.chdir(tmp_path)
    for to in ("oem", "opm", "ocm", "csv"):
        assert main(["export", "results", "--to", to]) == 0
        for file in given(to).iterdir():
            if file.name != "summary.json":
                mine = (tmp_path / f"results-{to}" / file.name).read_text()
                theirs, own = (re.sub("CREATION_DATE = .*", "", text) for text in (file.read_text(), mine))
                assert own == theirs


def test_a_loaded_folder_without_burns_is_exported(tmp_path) -> None:
    (tmp_path / "case.toml").write_text(SEARCHING.replace('do = "gather"\nrounds = 2', 'do = "lock"'))
    main(["run", str(tmp_path / "case.toml"), "--no-viewer", "--out", str(tmp_path / "results")])
    loaded = cf.load(tmp_path / "results")
    assert {len(column) for column in loaded.burns.values()} == {0}
    assert set(loaded.burns) == set(cf.run(tmp_path / "case.toml").burns)
    place = cf.export(loaded, tmp_path / "opm", "opm", frame="ICRF")
    assert "COMMENT 0 manoeuvres" in (place / "L1.opm").read_text()


def test_nothing_is_overwritten(flown, tmp_path) -> None:
    place = cf.export(flown, tmp_path / "out", "csv")
    before = (place / "states.csv").read_bytes()
    with pytest.raises(ValueError, match=r"out: holds finished results; add --overwrite or choose another"):
        cf.export(flown, place, "oem")
    assert (place / "states.csv").read_bytes() == before
    cf.export(flown, place, "oem", overwrite=True)
    assert not (place / "states.csv").exists()
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("years of work")
    with pytest.raises(ValueError, match="not empty; choose another"):
        cf.export(flown, tmp_path / "mine", "oem", overwrite=True)
    with pytest.raises(ValueError, match="no craft searches"):
        cf.export(flown, tmp_path / "none", "aem")
    assert not (tmp_path / "none").exists()


def test_names_that_are_no_names_of_files(tmp_path) -> None:
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


def test_formats_in_utc_are_so_from_every_time_system(tmp_path) -> None:
    """37 s behind TAI: STK, CZML and conjunctions count in UTC; messages in the chief's own system say so."""
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


def test_pulses_of_two_craft_close_to_each_other_leave_nodes_sound(tmp_path) -> None:
    """Edges of others a millisecond away make polynomials of rounding: steps would shrink to nothing."""
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
    told = json.loads((place / "summary.json").read_text())
    assert end > 400.0
    assert told["interpolation_error_m"] < 1e-6
    assert {one["segments"] for one in told["craft"].values()} == {21}
    assert max(one["states"] for one in told["craft"].values()) < 200
