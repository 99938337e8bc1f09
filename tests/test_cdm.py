# ruff: noqa: E501 (messages stand as they are printed)
"""Read and write conjunction data messages, with deviations and damage of real ones."""

import re
from dataclasses import replace

import numpy as np
import pytest
from ccsds_ndm.ndm_io import NdmIo
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

import closeform as cf
from cdms import FAST, KEYS, SLOW, SLOW_INERTIAL
from closeform.cli.app import main
from damage import assert_refused, read_or_refused, spoilt


def written(folder, text, name="case.cdm"):
    file = folder / name
    file.write_text(text)
    return file


@pytest.fixture
def slow(tmp_path):
    return cf.read_cdm(written(tmp_path, SLOW))


@pytest.fixture
def fast(tmp_path):
    return cf.read_cdm(written(tmp_path, FAST))


def test_message_is_read_in_si(slow):
    assert (slow.tca, slow.originator, slow.message_id) == ("2000-01-01T00:00:00.000", "TEST", "A09_1")
    assert (slow.miss_distance, slow.hard_body_radius) == (5.049717, 15.0)
    assert (slow.collision_probability, slow.collision_probability_method) == (None, None)
    first, second = slow.objects
    assert (first.name, first.designator, first.frame, second.name) == (
        "PRIMARY",
        "1001",
        "EME2000",
        "SECONDARY",
    )
    np.testing.assert_allclose(
        first.state, [153446.765, 41874155.870, 0.0, 3066.874761, -11.373615, 0.0], rtol=1e-15
    )
    assert first.covariance[1, 0] == first.covariance[0, 1] == -3.524140813027809e02


def test_covariances_agree_with_published_inertial_ones(slow):
    """CARA's local covariances agree with Alfano's inertial ones; states are rounded to 1 mm."""
    spread = np.sqrt(np.diag(SLOW_INERTIAL))
    scaled = (slow.objects[0].inertial_covariance - SLOW_INERTIAL) / np.outer(spread, spread)
    assert np.abs(scaled).max() < 1e-6


def test_earth_fixed_states_agree_with_the_message(fast):
    """Positions agree to 5 cm, velocities to 5 cm/s, as printed."""
    told = np.array([-21.3, -15.2, -49.3, 1.9, -13954.8, 4100.4])
    np.testing.assert_allclose(fast.relative_state, told, rtol=0.0, atol=0.06)
    assert fast.relative_speed == pytest.approx(14544.5, abs=0.5)
    # seen from the Earth they pass each other just as fast, but each flies 400 m/s slower or faster
    assert np.linalg.norm(fast.objects[0].inertial_state[3:]) == pytest.approx(7.6e3, rel=0.01)


def test_common_deviations_from_the_standard(fast):
    assert fast.hard_body_radius is None
    assert fast.exclusion_radii == (5.0, 5.0)
    assert (fast.collision_probability, fast.collision_probability_method) == (0.004450713, "FOSTER-1992")
    assert [each.international_designator for each in fast.objects] == ["2023-001AU", "2020-012AN"]


@pytest.mark.parametrize(
    ("line", "radius"),
    [
        ("COMMENT HBR = 6 [m]\n", 6.0),
        ("COMMENT Combined HBR: 6.0\n", 6.0),
        ("COMMENT HARD BODY RADIUS = 0.6e1\n", 6.0),
        ("HARD_BODY_RADIUS = 6 [m]\n", 6.0),
        ("HBR = 6\n", 6.0),
        ("COMMENT HBR = NaN [m]\n", None),
        ("COMMENT HBR\n", None),
        ("COMMENT the HBR is large\n", None),
        ("", None),
    ],
)
def test_sources_of_the_hard_body_radius(tmp_path, line, radius):
    assert (
        cf.read_cdm(written(tmp_path, SLOW.replace("COMMENT HBR = 15.0\n", line))).hard_body_radius == radius
    )


def test_radii_of_both_objects_are_added(tmp_path):
    """HBR of each object, an additional parameter of CDM 2.0."""
    text = SLOW.replace("COMMENT HBR = 15.0\n", "").replace("X = ", "HBR = 2.5 [m]\nX = ")
    found = cf.read_cdm(written(tmp_path, text))
    assert [each.radius for each in found.objects] == [2.5, 2.5]
    assert found.hard_body_radius == 5.0
    alone = cf.read_cdm(written(tmp_path, text.replace("HBR = 2.5 [m]\n", "", 1)))
    assert alone.hard_body_radius is None


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace(" = ", "="),
        lambda text: text.replace(" = ", "                      ="),
        lambda text: text.replace("\n", "\r\n"),
        lambda text: "\ufeff" + text,
        lambda text: text.replace(" [km]", "").replace(" [m**2]", ""),
        lambda text: text.replace("[m**2/s]", "[ m**2/s ]").replace("[km]", "[KM]"),
        lambda text: text.replace("OBJECT = OBJECT2", "COMMENT Object2 Metadata\n\nOBJECT = OBJECT2"),
        lambda text: text.replace(
            "COMMENT HBR", "COMMENT =CDM_ID:519959713\nTHRUST_ACCELERATION = NaN\nCOMMENT HBR"
        ),
    ],
)
def test_valid_spellings_are_equivalent(tmp_path, slow, change):
    file = tmp_path / "other.cdm"
    file.write_bytes(change(SLOW).encode())
    other = cf.read_cdm(file)
    for mine, plain in zip(other.objects, slow.objects, strict=True):
        np.testing.assert_array_equal(mine.state, plain.state)
        np.testing.assert_array_equal(mine.covariance, plain.covariance)
    assert other.hard_body_radius == 15.0


def xml(text):
    """Return the same message as XML."""
    head, *objects = text.split("OBJECT = OBJECT")

    def element(line):
        key, value = re.split(" *= *", line, maxsplit=1) if line[:7] != "COMMENT" else ("COMMENT", line[8:])
        value, _, unit = value.partition(" [")
        unit = f' units="{unit[:-1]}"' if unit and key != "COMMENT" else ""
        return f"<{key}{unit}>{value}</{key}>"

    lines = head.splitlines()
    parts = ['<?xml version="1.0" encoding="UTF-8"?>', '<cdm id="CCSDS_CDM_VERS" version="1.0">', "<header>"]
    parts += [*map(element, lines[1:4]), "</header><body><relativeMetadataData>", *map(element, lines[4:])]
    parts += ["</relativeMetadataData>"]
    for each in objects:
        number, *rest = each.splitlines()
        at = next(index for index, line in enumerate(rest) if line.startswith("X ="))
        parts += [f"<segment><metadata><OBJECT>OBJECT{number}</OBJECT>", *map(element, rest[:at])]
        parts += ["</metadata><data><stateVector>", *map(element, rest[at : at + 6]), "</stateVector>"]
        parts += ["<covarianceMatrix>", *map(element, rest[at + 6 :]), "</covarianceMatrix></data></segment>"]
    return "\n".join([*parts, "</body></cdm>"])


@pytest.mark.parametrize("text", [SLOW, FAST])
def test_xml_reads_like_key_value(tmp_path, text):
    plain, other = cf.read_cdm(written(tmp_path, text)), cf.read_cdm(written(tmp_path, xml(text), "case.xml"))
    assert other.hard_body_radius == plain.hard_body_radius
    for mine, theirs in zip(other.objects, plain.objects, strict=True):
        np.testing.assert_array_equal(mine.state, theirs.state)
        np.testing.assert_array_equal(mine.covariance, theirs.covariance)


def test_qualified_xml_is_read(tmp_path):
    text = (
        xml(SLOW)
        .replace("</", "</ndm:")
        .replace("<", "<ndm:")
        .replace("<ndm:/ndm:", "</ndm:")
        .replace("<ndm:?", "<?")
    )
    assert cf.read_cdm(written(tmp_path, text, "case.xml")).hard_body_radius == 15.0


@pytest.mark.parametrize("text", [SLOW, FAST])
def test_written_message_reads_back(tmp_path, text):
    told = cf.read_cdm(written(tmp_path, text))
    told = replace(told, message_for="US", objects=tuple(replace(each, radius=2.0) for each in told.objects))
    cf.write_cdm(tmp_path / "copy.cdm", told)
    back = cf.read_cdm(tmp_path / "copy.cdm")
    for field in (
        "tca",
        "miss_distance",
        "hard_body_radius",
        "collision_probability",
        "message_id",
        "message_for",
    ):
        assert getattr(back, field) == getattr(told, field)
    for mine, other in zip(back.objects, told.objects, strict=True):
        np.testing.assert_allclose(mine.state, other.state, rtol=0.0, atol=1e-6)
        np.testing.assert_array_equal(mine.covariance, other.covariance)
        assert (mine.name, mine.frame, mine.radius, mine.manoeuvrable) == (
            other.name,
            other.frame,
            2.0,
            other.manoeuvrable,
        )


def test_written_keywords_follow_the_standard(tmp_path, fast):
    """Obligatory keywords of CCSDS 508.0-B-1, tables 3-1 to 3-4, are in order."""
    cf.write_cdm(tmp_path / "copy.cdm", fast)
    lines = (tmp_path / "copy.cdm").read_text().splitlines()
    keys = [line.split(" =")[0] for line in lines]
    head = [
        "CCSDS_CDM_VERS",
        "CREATION_DATE",
        "ORIGINATOR",
        "MESSAGE_ID",
        "TCA",
        "MISS_DISTANCE",
        "RELATIVE_SPEED",
    ]
    each = [
        *[
            "OBJECT",
            "OBJECT_DESIGNATOR",
            "CATALOG_NAME",
            "OBJECT_NAME",
            "INTERNATIONAL_DESIGNATOR",
            "EPHEMERIS_NAME",
        ],
        *["COVARIANCE_METHOD", "MANEUVERABLE", "REF_FRAME", "X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT", *KEYS],
    ]
    assert keys[:7] == head
    assert keys[keys.index("OBJECT") :] == each * 2
    told = dict(line.split(" = ") for line in lines if line.startswith("RELATIVE"))
    assert float(told["RELATIVE_VELOCITY_T"].split()[0]) == pytest.approx(-13954.8, abs=0.06)


def test_encounter_of_a_message(slow):
    """Indefinite covariances are refused with the name of the object and the smallest eigenvalue."""
    met = slow.encounter(half_window=100.0)
    assert (met.path.start, met.path.end) == (-100.0, 100.0)
    np.testing.assert_allclose(met.path.position(0.0), slow.relative_state[:3], atol=1e-6)
    assert met.speed == pytest.approx(slow.relative_speed, rel=1e-12)
    first, second = slow.objects
    spoilt = replace(slow, objects=(first, replace(second, covariance=second.covariance - 2.0 * np.eye(6))))
    with pytest.raises(ValueError, match=r"SECONDARY: covariance: .*smallest eigenvalue"):
        spoilt.encounter()


def number_of(start, text=SLOW, after=0):
    lines = text.splitlines()
    return next(k for k, line in enumerate(lines, 1) if k > after and line.startswith(start))


DAMAGE = {
    "empty": (lambda text: "", "empty file; give a CDM in key-value or XML form"),
    "an OEM": (lambda text: text.replace("CDM_VERS", "OEM_VERS"), "line 1: not a CDM"),
    "half of it": (lambda text: text[: text.index("OBJECT = OBJECT2")], "has 1 of 2 objects"),
    "no such time": (
        lambda text: text.replace("TCA = 2000-01-01", "TCA = 2000-13-01"),
        f"line {number_of('TCA')}: TCA: '2000-13-01T00:00:00.000' is not a valid epoch",
    ),
    "no frame": (lambda text: text.replace("REF_FRAME = EME2000\n", "", 1), "keyword REF_FRAME is missing in OBJECT1"),
    "a keyword twice": (
        lambda text: text.replace("CATALOG_NAME = SATCAT", "X = 1 [km]", 1),
        f"line {number_of('X = ')}: keyword X occurs twice in OBJECT1",
    ),
    "states in m": (
        lambda text: text.replace("[km]", "[m]"),
        rf"line {number_of('X = ')}: X in \[m\], where the standard has \[km\]; convert it",
    ),
    "covariances in km": (lambda text: text.replace("[m**2]", "[km**2]"), r"CR_R in \[km\*\*2\], where the standard has \[m\*\*2\]"),
    "a word": (lambda text: text.replace("41874.15587", "far"), f"line {number_of('Y = ')}: 'far' is not a number"),
    "not finite": (lambda text: text.replace("41874.15587", "nan"), f"line {number_of('Y = ')}: Y is not finite"),
    "a state without keyword": (lambda text: text.replace("X = 153.446765", "153.446765"), "is not a keyword with a value"),
    "a radius of nothing": (lambda text: text.replace("HBR = 15.0", "HBR = 0 [m]"), "hard_body_radius: must be positive and finite, got 0 m"),
    "no time": (lambda text: text.replace("TCA = ", "COMMENT "), "keyword TCA is missing before OBJECT1"),
    "objects exchanged": (
        lambda text: text.replace("OBJECT = OBJECT1", "OBJECT = OBJECT2"),
        f"line {number_of('OBJECT = ')}: OBJECT is 'OBJECT2', expected OBJECT1",
    ),
    "a third object": (lambda text: text + "OBJECT = OBJECT3\n", "has 3 of 2 objects"),
    "states in m without unit": (
        lambda text: "".join(
            f"{line.split('=')[0]}= {1e3 * float(line.split()[2])}\n" if "[km]" in line else line
            for line in text.splitlines(True)
        ),
        "miss_distance: 5.04972 m, but the states are 50.*check their units",
    ),
    "a negative variance": (
        lambda text: text.replace("CN_N = 1.2050395223076", "CN_N = -1.2"),
        f"line {number_of('CN_N')}: CN_N: a variance is negative",
    ),
    "frames that differ": (lambda text: text.replace("EME2000", "GCRF", 1), "objects: are in different frames, GCRF and EME2000"),
    "an unknown frame": (lambda text: text.replace("EME2000", "MARS"), "OBJECT1: frame: MARS is unknown; convert the states"),
    "a probability above 1": (
        lambda text: text.replace("COMMENT HBR", "COLLISION_PROBABILITY = 1.5\nCOMMENT HBR"),
        "collision_probability: must be from 0 to 1, got 1.5",
    ),
    "XML that explodes": (
        lambda text: "<?xml version='1.0'?><!DOCTYPE cdm [<!ENTITY a 'aaaa'>]><cdm>&a;</cdm>",
        "declares entities, which no message has",
    ),
}  # fmt: skip


def test_damaged_message_is_reported_in_one_line(tmp_path):
    for change, expected in DAMAGE.values():
        assert change(SLOW) != SLOW
        assert_refused(cf.read_cdm, written(tmp_path, change(SLOW)), expected)


@given(data=st.data())
@settings(max_examples=50)
def test_random_damage_is_read_or_refused(tmp_path_factory, data):
    text = spoilt(
        data.draw(st.sampled_from([SLOW, xml(SLOW)])), data, "0123456789.-:=TZe nafOBJECT_XR\n<>[]/*"
    )
    found = read_or_refused(cf.read_cdm, written(tmp_path_factory.getbasetemp(), text))
    if found is not None:
        assert all(
            np.isfinite(each.state).all() and np.isfinite(each.covariance).all() for each in found.objects
        )
        assert found.miss_distance >= 0.0


def test_conjunction_is_checked_when_made(slow):
    first, second = slow.objects
    assert cf.Conjunction(slow.tca, (first, second)).miss_distance == pytest.approx(5.0497, abs=1e-3)
    with pytest.raises(ValueError, match="objects: expected two, got 1"):
        replace(slow, objects=(first,))
    with pytest.raises(ValueError, match="state: expected"):
        replace(first, state=first.state[:5])
    with pytest.raises(ValueError, match="covariance: not symmetric"):
        replace(first, covariance=np.triu(first.covariance))
    with pytest.raises(ValueError, match="radius: must be positive"):
        replace(first, radius=-1.0)
    with pytest.raises(ValueError, match="miss_distance: must not be negative"):
        replace(slow, miss_distance=-5.0)
    plain = cf.ConjunctionObject("A", "1", "GCRF", first.state, first.covariance)
    assert (plain.radius, plain.catalog, plain.manoeuvrable) == (None, "SATCAT", "N/A")


MU = 398600.4418e9


def circling(radius, tilt, phase, times):
    """Return states (T, 6) on a circle, in closed form."""
    rate = np.sqrt(MU / radius**3)
    angle = phase + rate * np.asarray(times, dtype=float)
    cos, sin = np.cos(angle), np.sin(angle)
    turn = np.array([[1.0, 0.0, 0.0], [0.0, np.cos(tilt), -np.sin(tilt)], [0.0, np.sin(tilt), np.cos(tilt)]])
    place = radius * np.stack([cos, sin, 0.0 * cos], axis=-1) @ turn.T
    return np.concatenate(
        [place, radius * rate * np.stack([-sin, cos, 0.0 * cos], axis=-1) @ turn.T], axis=-1
    )


def rtn(state):
    """Return the radial, transverse and normal axes as rows."""
    normal = np.cross(state[:3], state[3:])
    rows = np.array([state[:3], np.cross(normal, state[:3]), normal])
    return rows / np.linalg.norm(rows, axis=1)[:, None]


def test_screening_writes_messages(tmp_path, monkeypatch, capsys):
    """Three circular orbits: identifiers, closest approach, velocity and covariance against closed form."""
    orbits = {
        "CHIEF": (7e6, 0.0, -0.3),
        "ALPHA 1/2": (7e6 + 150.0, 1e-3, -0.2998),
        "BETA": (7e6 + 140.0, -1e-3, -0.29981),
    }
    times = np.arange(0.0, 1201.0, 60.0)
    sigmas = np.diag([4.0, 400.0, 9.0, 1e-4, 1e-6, 1e-5])
    for k, (name, orbit) in enumerate(orbits.items(), 1):
        held = cf.Covariances([0.0, 300.0], [0.5 * sigmas, sigmas], ["RTN", "RTN"])
        words = name, f"2026-00{k}A", "EARTH", "EME2000", "UTC", "2026-01-01T00:00:00"
        cf.write_oem(tmp_path / f"{k}.oem", cf.Ephemeris(*words, times, circling(*orbit, times), held))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("closeform.report.page.drawn", lambda *_: ())
    screen = ["screen", "1.oem", "2.oem", "3.oem", "--cdm", "--out", "found"]
    assert main([*screen, "--hard-body", "50 m"]) == 1
    assert "1 conjunction data message in cdm/" in capsys.readouterr().out
    (file,) = (tmp_path / "found" / "cdm").iterdir()
    told, text = cf.read_cdm(file), file.read_text()
    read = NdmIo().from_path(file)
    assert [one.metadata.object_name for one in read.body.segment] == ["ALPHA 1/2", "BETA"]
    assert [one.designator for one in told.objects] == ["2026-002A", "2026-003A"]
    assert [one.international_designator for one in told.objects] == ["2026-002A", "2026-003A"]
    assert [one.ephemeris_name for one in told.objects] == ["2.oem", "3.oem"]

    def pair(time):
        return [circling(*orbits[name], time) for name in ("ALPHA 1/2", "BETA")]

    def apart(time):
        return np.linalg.norm(np.subtract(*pair(time))[:3])

    tca = minimize_scalar(apart, bounds=(100.0, 500.0), method="bounded", options={"xatol": 1e-7}).x
    assert told.tca.startswith("2026-01-01T00:0")
    stated = (np.datetime64(told.tca) - np.datetime64("2026-01-01T00:00:00")) / np.timedelta64(1, "ns") * 1e-9
    assert stated == pytest.approx(tca, abs=1e-4)
    first, second = pair(tca)
    assert told.miss_distance == pytest.approx(apart(tca), abs=1e-4)
    assert float(read.body.relative_metadata_data.miss_distance.value) == pytest.approx(apart(tca), abs=1e-4)
    assert told.relative_speed == pytest.approx(np.linalg.norm((second - first)[3:]), rel=1e-6)
    assert told.hard_body_radius == 100.0
    assert re.search("COLLISION_PROBABILITY_METHOD", text)
    # the screening's own closest approach, in arcs of the chief's circle
    found = cf.common_frame([cf.read_oem(f"{k}.oem") for k in (1, 2, 3)])
    near = cf.closest_approach(found.paths[1], found.paths[2], cf.Sphere(100.0))
    assert near.distance == pytest.approx(told.miss_distance, abs=1e-2)
    assert near.time == pytest.approx(tca, abs=1e-2)

    # the covariance of the latest block, propagated through two-body motion
    def later(state):
        def gravity(_, one):
            return [*one[3:], *(-MU * one[:3] / np.linalg.norm(one[:3]) ** 3)]

        return solve_ivp(gravity, (0.0, tca), state, method="DOP853", rtol=1e-12, atol=1e-6).y[:, -1]

    assert tca < 300.0  # of the second block
    start = circling(*orbits["ALPHA 1/2"], 0.0)
    turns = [np.kron(np.eye(2), rtn(state)) for state in (start, first)]
    steps = np.repeat([10.0, 0.01], 3)
    moved = [(later(start + step) - later(start - step)) / 2.0 / step.max() for step in np.diag(steps)]
    whole = turns[1] @ np.transpose(moved) @ turns[0].T
    np.testing.assert_allclose(
        told.objects[0].covariance.diagonal(), (whole @ (0.5 * sigmas) @ whole.T).diagonal(), rtol=5e-3
    )


def test_messages_need_covariances(tmp_path, monkeypatch, capsys):
    times = np.arange(0.0, 601.0, 60.0)
    for k in (1, 2):
        words = f"C{k}", f"{k}", "EARTH", "EME2000", "UTC", "2026-01-01T00:00:00"
        cf.write_oem(tmp_path / f"{k}.oem", cf.Ephemeris(*words, times, circling(7e6, 0.0, 1e-6 * k, times)))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("closeform.report.page.drawn", lambda *_: ())
    assert main(["screen", "1.oem", "2.oem", "--cdm", "--sphere", "50 m"]) == 2
    assert "C1 has no covariance" in capsys.readouterr().err
    given = ["--covariance", "25 0 400 0 0 25 m^2", "--sigmas", "3", "--out", "found"]
    assert main(["screen", "1.oem", "2.oem", "--cdm", *given]) == 1
    (file,) = (tmp_path / "found" / "cdm").iterdir()
    told = cf.read_cdm(file).objects[1]
    assert (told.designator, told.catalog, told.covariance_method) == ("2", "SATCAT", "DEFAULT")
    np.testing.assert_allclose(told.covariance.diagonal(), [25.0, 400.0, 25.0, 0.0, 0.0, 0.0])
