# ruff: noqa: E501 (messages stand as they are printed)
"""Read, write and relate ephemerides; damaged files give one clear message."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oem import OrbitEphemerisMessage

from closeform.exchange.ccsds.oem import read_oem, read_oem_segments, write_oem
from closeform.exchange.common_frame import common_frame
from closeform.motion.elements.elements import elements_from_inertial
from closeform.motion.elements.mean_motion import EARTH_MU
from damage import assert_refused, read_or_refused, spoilt
from orbit_files import GOOD, HEAD, ROWS, circular

GRACE = Path(__file__).parents[1] / "examples" / "grace"


def written(folder, text):
    file = folder / "case.oem"
    file.write_text(text)
    return file


def test_reads_si_units_and_counts_the_leap_second(tmp_path):
    ephemeris = read_oem(written(tmp_path, GOOD))
    assert (ephemeris.name, ephemeris.object_id, ephemeris.center) == ("DEPUTY", "2000-001B", "EARTH")
    assert (ephemeris.frame, ephemeris.time_system) == ("EME2000", "UTC")
    assert ephemeris.epoch == "2016-12-31T23:59:50"
    np.testing.assert_allclose(ephemeris.times, [0.0, 10.5, 21.0], atol=1e-9)
    np.testing.assert_allclose(ephemeris.states[2], [7e6, 150e3, 1.5, 0.0, 7.5e3, -1.25e3])


@pytest.mark.parametrize(("system", "seconds"), [("UTC", 21.0), ("GPS", 20.0), ("TAI", 20.0), ("TDB", 20.0)])
def test_only_utc_has_leap_seconds(tmp_path, system, seconds):
    rows = "".join(ROWS.splitlines(True)[::2])
    ephemeris = read_oem(written(tmp_path, HEAD.replace("UTC", system) + rows))
    assert ephemeris.times.tolist() == [0.0, seconds]


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace("2016-12-31T", "2016-366T").replace("2017-01-01T", "2017-001T"),
        lambda text: text.replace("T23:59:50", "T23:59:50.000Z"),
        lambda text: text.replace(" = ", "="),  # legal, though the oem package refuses it
        lambda text: text.replace("\n", "\r\n"),
        lambda text: text.replace("7.5 0.0\n", "7.5 0.0 0 0 0\n").replace("-1.25\n", "-1.25 0 0 0\n"),
        lambda text: "\ufeff" + text,
    ],
)
def test_valid_spellings_are_equivalent(tmp_path, change):
    plain = read_oem(written(tmp_path, GOOD))
    file = tmp_path / "other.oem"
    file.write_bytes(change(GOOD).encode())
    other = read_oem(file)
    np.testing.assert_array_equal(other.times, plain.times)
    np.testing.assert_array_equal(other.states, plain.states)


def test_xml_reads_like_key_value(tmp_path):
    file = tmp_path / "grace.xml"
    OrbitEphemerisMessage.open(written(tmp_path, GOOD.replace("59:60.5", "59:60"))).save_as(file, "xml")
    ephemeris = read_oem(file)
    np.testing.assert_allclose(ephemeris.times, [0.0, 10.0, 21.0], atol=1e-9)
    assert ephemeris.name == "DEPUTY"


def test_useable_span_limits_the_states(tmp_path):
    limits = "USEABLE_START_TIME = 2016-12-31T23:59:55\nUSEABLE_STOP_TIME = 2017-01-01T00:00:10\nMETA_STOP"
    ephemeris = read_oem(written(tmp_path, GOOD.replace("META_STOP", limits)))
    assert ephemeris.epoch == "2016-12-31T23:59:60.5"
    np.testing.assert_allclose(ephemeris.times, [0.0, 10.5], atol=1e-9)


@pytest.mark.parametrize("system", ["GPS", "TAI", "UTC", "TT"])
def test_written_file_reads_back(tmp_path, system):
    file = tmp_path / "chief.oem"
    ephemeris = circular(times=[0.0, 10.0, 20.123456789], time_system=system)
    write_oem(file, ephemeris, originator="NOBODY", comments=("first", "second"))
    back = read_oem(file)
    np.testing.assert_allclose(back.times, ephemeris.times, atol=1e-9)
    np.testing.assert_allclose(back.states[:, :3], ephemeris.states[:, :3], atol=0.51e-6)
    np.testing.assert_allclose(back.states[:, 3:], ephemeris.states[:, 3:], atol=0.51e-9)
    assert (back.name, back.time_system, back.epoch) == ("CHIEF", system, "2020-01-01T00:00:00")
    assert "COMMENT first\nCOMMENT second\n" in file.read_text()


def test_written_file_is_an_oem_to_the_oem_package(tmp_path):
    file = tmp_path / "chief.oem"
    ephemeris = circular()
    write_oem(file, ephemeris)
    states = OrbitEphemerisMessage.open(file).states
    np.testing.assert_allclose([s.position for s in states], ephemeris.states[:, :3] / 1e3, atol=1e-9)
    assert [round((s.epoch - states[0].epoch).sec, 6) for s in states] == ephemeris.times.tolist()


DAMAGE = {
    "empty": (lambda text: "", "empty file"),
    "not an OEM": (lambda text: "a,b,c\n1,2,3\n", "line 1: not an OEM, which starts with CCSDS_OEM_VERS"),
    "cut in the header": (lambda text: text[:40], "has no segment"),
    "cut in a state": (lambda text: text[:-20], "line 18: expected an epoch and 6 or 9 numbers, got 4 words"),
    "one state": (lambda text: HEAD + ROWS.splitlines()[0], "has 1 states"),
    "NaN": (lambda text: text.replace("75.0", "nan"), "line 17: a value is not finite"),
    "a word": (lambda text: text.replace("75.0", "many"), "line 17: 'many' is not a number"),
    "epochs fall": (
        lambda text: HEAD + "".join(ROWS.splitlines(True)[::-1]),
        "line 17: epochs must increase",
    ),
    "no epoch": (
        lambda text: text.replace("23:59:60.5", "23:59"),
        "line 17: '2016-12-31T23:59' is not a valid epoch",
    ),
    "missing keyword": (
        lambda text: text.replace("REF_FRAME = EME2000\n", ""),
        "keyword REF_FRAME is missing",
    ),
    "keyword twice": (
        lambda text: text.replace("META_STOP", "REF_FRAME = TOD\nMETA_STOP"),
        "line 13: keyword REF_FRAME occurs twice",
    ),
    "unknown time": (lambda text: text.replace("UTC", "MET"), "TIME_SYSTEM MET is not supported"),
    "wrong span": (
        lambda text: text.replace("E = 2016-12-31T23:59:50", "E = 2018-01-01T00:00:00"),
        "has 0 states from",
    ),
    "two segments": (lambda text: text + HEAD[HEAD.index("META_START") :] + ROWS, "has 2 segments"),
    "not closed XML": (lambda text: "<?xml version='1.0'?>\n<oem>", "incomplete OEM"),
}


def test_damaged_file_gives_one_line(tmp_path):
    for change, message in DAMAGE.values():
        assert_refused(read_oem, written(tmp_path, change(GOOD)), message)


SECOND = (
    (HEAD[HEAD.index("META_START") :] + ROWS)
    .replace("2017-01-01", "2017-01-02")
    .replace("2016-12-31", "2017-01-01")
    .replace("59:60.5", "59:59.5")
)


def test_segments_are_read_one_by_one(tmp_path):
    first, second = read_oem_segments(written(tmp_path, GOOD + SECOND))
    assert (first.epoch, second.epoch) == ("2016-12-31T23:59:50", "2017-01-01T23:59:50")
    np.testing.assert_array_equal(first.states, second.states)
    (alone,) = read_oem_segments(written(tmp_path, GOOD))
    np.testing.assert_array_equal(alone.times, first.times)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace("2017-01-01T23:59:50", "2016-12-31T23:59:55"), "segment 2: begins 16 s before the previous one"),
        (lambda text: text.replace("DEPUTY", "OTHER"), "segment 2: is of OTHER, but the previous one is of DEPUTY"),
        (lambda text: text.replace("UTC", "TAI"), "segment 2: is of TAI, but the previous one is of UTC"),
        (lambda text: text.replace("75.0", "many"), "segment 2: line 31: 'many' is not a number"),
    ],
)  # fmt: skip
def test_inconsistent_segments_are_refused(tmp_path, change, message):
    file = written(tmp_path, GOOD + change(SECOND.replace("23:59:60.5", "23:59:59.5")))
    with pytest.raises(ValueError, match=message) as caught:
        read_oem_segments(file)
    assert str(caught.value).startswith(f"{file}: ")


@given(data=st.data())
@settings(max_examples=50)
def test_random_damage_is_read_or_refused(tmp_path_factory, data):
    text = spoilt(GOOD, data, "0123456789.-:=TZe nafMETA_\n<>")
    found = read_or_refused(read_oem, written(tmp_path_factory.getbasetemp(), text))
    if found is not None:
        assert np.isfinite(found.states).all()
        assert (np.diff(found.times) > 0).all()


def test_astropy_is_not_needed(tmp_path):
    code = f"""
import sys
sys.modules["astropy"] = None
import closeform.exchange.ccsds.oem
print(closeform.exchange.ccsds.oem.read_oem({str(written(tmp_path, GOOD))!r}).times)
"""
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout == "[ 0.  10.5 21. ]\n"


def test_ephemeris_is_checked_when_made():
    chief = circular()
    with pytest.raises(ValueError, match=r"expected shapes \(T,\) and \(T, 6\)"):
        replace(chief, times=chief.times[:5])
    with pytest.raises(ValueError, match="row 1: epochs must increase"):
        replace(chief, times=chief.times * 0)
    with pytest.raises(ValueError, match="row 0: a value is not finite"):
        replace(chief, states=chief.states * np.nan)


@pytest.mark.parametrize("along_track", ["straight", "arc"])
def test_common_frame_of_a_spacecraft_ahead(along_track):
    chief, deputy = circular(), circular("DEPUTY", ahead=0.01)
    frame = common_frame([chief, deputy], along_track)
    # 70 km on a circle of 7000 km, or its chord seen along the axes
    place = [0, 70e3, 0] if along_track == "arc" else [7e6 * (np.cos(0.01) - 1), 7e6 * np.sin(0.01), 0]
    np.testing.assert_allclose(frame.states[1, :, :3], np.tile(place, (60, 1)), atol=1e-7)
    np.testing.assert_allclose(frame.states[1, :, 3:], 0.0, atol=1e-10)
    assert not frame.states[0].any()
    assert frame.names == ("CHIEF", "DEPUTY")
    assert frame.radius == pytest.approx(7e6, rel=1e-12)
    assert frame.mean_motion == pytest.approx(np.sqrt(EARTH_MU / 7e6**3), rel=1e-12)
    assert frame.epoch == chief.epoch
    assert frame.time_system == chief.time_system


def test_common_frame_takes_the_shared_epochs_only():
    chief = circular(times=np.arange(0.0, 100.0, 10.0))
    # starts 20 s later, at twice the spacing, one epoch a microsecond off
    later = circular("LATER", times=[0.0, 20.0, 40.0 + 1e-6, 60.0, 80.0], epoch="2020-01-01T00:00:20")
    frame = common_frame([chief, later, circular("THIRD")])
    np.testing.assert_array_equal(frame.times, [20.0, 40.0, 80.0])
    assert frame.states.shape == (3, 3, 6)
    at_20 = elements_from_inertial(chief.states[2])[1]
    np.testing.assert_allclose(frame.states[1, 0, 1], -7e6 * at_20, rtol=1e-9)


@pytest.mark.parametrize(
    ("others", "message"),
    [
        ([], "at least two are needed, got 1"),
        ([circular("CHIEF")], "CHIEF: two ephemerides have this OBJECT_NAME"),
        ([circular("D", frame="EME2000")], "D: REF_FRAME EME2000 differs from GCRF of CHIEF"),
        ([circular("D", time_system="UTC")], "D: TIME_SYSTEM UTC differs from TAI"),
        ([circular("D", center="MARS")], "D: CENTER_NAME MARS differs"),
        ([circular("D", epoch="2020-01-02T00:00:00")], "CHIEF, D: fewer than two common epochs"),
    ],
)
def test_incompatible_ephemerides_are_refused(others, message):
    with pytest.raises(ValueError, match=message):
        common_frame([circular(), *others])


def test_earth_fixed_frame_is_refused():
    fixed = [circular(name, frame="ITRF2000") for name in ("A", "B")]
    with pytest.raises(ValueError, match="A: REF_FRAME ITRF2000 rotates with the Earth or is unknown"):
        common_frame(fixed)


def test_wrong_gravity_is_reported():
    with pytest.raises(ValueError, match="CHIEF: not on a closed orbit"):
        common_frame([circular(), circular("D", 0.1)], mu=4e13)
