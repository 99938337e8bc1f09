# ruff: noqa: E501 (messages stand as they are printed)
"""Covariances of ephemerides: reading, writing, rotation and propagation; damaged blocks give one clear line."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oem import OrbitEphemerisMessage
from scipy.integrate import solve_ivp

from closeform.exchange.ccsds.oem import read_oem, write_oem
from closeform.exchange.common_frame import common_frame
from closeform.exchange.ephemerides.covariance import Covariances, axes, inertial
from closeform.exchange.ephemerides.propagated_covariance import covariance_at
from closeform.motion.elements.frames import relative_from_inertial
from closeform.motion.elements.mean_motion import EARTH_MU
from damage import assert_refused, read_or_refused, spoilt
from orbit_files import GOOD, circular

# Made with random numbers: a square root times its transpose, eight digits as in the standard's example.
ROWS = """\
4.1024000e-04
1.2288000e-04 9.2233600e-04
-2.0480000e-05 3.3792000e-05 2.5702400e-04
1.0240000e-08 -8.6016000e-07 2.0480000e-08 1.0485760e-09
-3.9936000e-07 -1.0240000e-07 1.5360000e-08 2.0480000e-11 5.2428800e-10
1.5360000e-08 2.5600000e-08 -1.0240000e-07 1.0240000e-11 -2.0480000e-11 4.1943040e-10
"""
MATRIX = np.zeros((6, 6))
MATRIX[np.tril_indices(6)] = [float(value) for value in ROWS.split()]
MATRIX = 1e6 * (MATRIX + np.tril(MATRIX, -1).T)  # m^2, m^2/s, m^2/s^2
FIRST = "EPOCH = 2016-12-31T23:59:50\nCOV_REF_FRAME = RTN\n"
SECOND = "EPOCH = 2017-01-01T00:00:10\n"
BLOCK = f"COVARIANCE_START\n{FIRST}{ROWS}\n{SECOND}{ROWS}COVARIANCE_STOP\n"
FILE = GOOD + BLOCK


def written(folder, text):
    file = folder / "case.oem"
    file.write_text(text)
    return file


def test_blocks_are_read_with_epochs_and_frames(tmp_path):
    held = read_oem(written(tmp_path, FILE)).covariances
    np.testing.assert_allclose(held.times, [0.0, 21.0], atol=1e-9)  # a leap second lies between
    assert held.frames == ("RTN", "EME2000")
    np.testing.assert_allclose(held.matrices, [MATRIX, MATRIX], rtol=1e-14)


def test_the_oem_package_reads_the_same(tmp_path):
    file = written(tmp_path, FILE.replace("59:60.5", "59:60"))
    for name, kind in ((file, "kvn"), (tmp_path / "case.xml", "xml")):
        if kind == "xml":
            OrbitEphemerisMessage.open(file).save_as(name, "xml")
        held = read_oem(name).covariances
        others = OrbitEphemerisMessage.open(name).covariances
        np.testing.assert_allclose(held.matrices / 1e6, [other.matrix for other in others], rtol=1e-12)
        assert held.frames == ("RTN", "EME2000")
        if kind == "kvn":  # of XML the package (0.4.5) takes the frame of the states for all
            assert held.frames == tuple(other.frame for other in others)


def test_the_oem_package_reads_what_is_written(tmp_path):
    craft = circular()
    held = Covariances([0.0, 300.5], [MATRIX, 2.0 * MATRIX], ["TNW", craft.frame])
    file = tmp_path / "chief.oem"
    write_oem(file, replace(craft, covariances=held))
    back = read_oem(file).covariances
    np.testing.assert_array_equal(back.times, held.times)
    np.testing.assert_allclose(back.matrices, held.matrices, rtol=1e-14)
    assert back.frames == held.frames
    others = OrbitEphemerisMessage.open(file).covariances
    np.testing.assert_allclose([other.matrix for other in others], held.matrices / 1e6, rtol=1e-14)


def test_useable_span_shifts_the_times(tmp_path):
    limits = "USEABLE_START_TIME = 2016-12-31T23:59:55\nUSEABLE_STOP_TIME = 2017-01-01T00:00:10\nMETA_STOP"
    held = read_oem(written(tmp_path, FILE.replace("META_STOP", limits))).covariances
    np.testing.assert_allclose(held.times, [-10.5, 10.5], atol=1e-9)


LINES = FILE.splitlines()
AT = LINES.index("COVARIANCE_START") + 1  # number of that line
DAMAGE = {
    "no epoch": (lambda text: text.replace(FIRST, "COV_REF_FRAME = RTN\n"), f"line {AT + 1}: a covariance without EPOCH"),
    "unknown frame": (
        lambda text: text.replace("RTN", "LVLH"),
        f"line {AT + 2}: COV_REF_FRAME LVLH is not supported; give covariances in one of RTN, RSW, TNW, EME2000",
    ),
    "a row lost": (
        lambda text: text.replace(ROWS.splitlines()[2] + "\n", "", 1),
        f"line {AT + 5}: 4 values in place of row 3 of a lower triangle",
    ),
    "the last row lost": (
        lambda text: text.replace(ROWS.splitlines()[5] + "\n", "", 1),
        f"line {AT + 1}: covariance of 2016-12-31T23:59:50 has fewer than six rows",
    ),
    "not finite": (
        lambda text: text.replace("4.1024000e-04", "nan"),
        f"line {AT + 1}: covariance of 2016-12-31T23:59:50: a value is not finite",
    ),
    "indefinite": (
        lambda text: text.replace("1.2288000e-04", "1.2288000e-03", 1),
        f"line {AT + 1}: covariance of 2016-12-31T23:59:50: .*smallest eigenvalue",
    ),
    "epochs that fall": (
        lambda text: text.replace("2017-01-01T00:00:10\n4", "2016-12-31T23:59:40\n4"),
        f"line {AT + 10}: epochs of covariances must increase",
    ),
    "never closed": (lambda text: text.replace("COVARIANCE_STOP\n", ""), "COVARIANCE_STOP is missing"),
    "before metadata": (lambda text: text.replace("ORIGINATOR", BLOCK + "ORIGINATOR"), "COVARIANCE_START is out of place"),
}  # fmt: skip


def test_damaged_covariances_give_one_line(tmp_path):
    for change, message in DAMAGE.values():
        assert change(FILE) != FILE
        assert_refused(read_oem, written(tmp_path, change(FILE)), message)


@given(data=st.data())
@settings(max_examples=50)
def test_random_damage_gives_one_line(tmp_path_factory, data):
    text = spoilt(FILE, data, "0123456789.-:=TZe nafCOV_EPH\n<>[]", len(GOOD))
    found = read_or_refused(read_oem, written(tmp_path_factory.getbasetemp(), text))
    held = None if found is None else found.covariances
    assert held is None or np.isfinite(held.matrices).all()


def test_invalid_covariance_is_rejected():
    with pytest.raises(ValueError, match=r"matrices\[1\]: .*symmetric"):
        Covariances([0.0, 1.0], [MATRIX, MATRIX + np.triu(MATRIX, 1)], ["RTN"] * 2)
    with pytest.raises(ValueError, match=r"matrices\[0\]: .*smallest eigenvalue"):
        Covariances([0.0], [MATRIX - 500.0 * np.eye(6)], ["RTN"])
    with pytest.raises(ValueError, match="times, matrices, frames: expected"):
        Covariances([0.0, 1.0], [MATRIX], ["RTN"])
    with pytest.raises(ValueError, match="times: must be finite and increase"):
        Covariances([1.0, 1.0], [MATRIX, MATRIX], ["RTN"] * 2)
    with pytest.raises(ValueError, match="covariances: frame ITRF is not supported"):
        replace(circular(), covariances=Covariances([0.0], [MATRIX], ["ITRF"]))


def test_local_axes_on_an_elliptic_orbit():
    """Right-handed orthogonal axes, along the radius or the velocity as named."""
    state = np.array([7e6, 1e5, -3e5, 500.0, 5.4e3, 5.4e3])
    for frame, first in (("RTN", state[:3]), ("RSW", state[:3]), ("TNW", state[3:])):
        found = axes(frame, state)
        np.testing.assert_allclose(found @ found.T, np.eye(3), atol=1e-14)
        assert np.linalg.det(found) == pytest.approx(1.0)
        np.testing.assert_allclose(found[0], first / np.linalg.norm(first), rtol=1e-14)
    normal = np.cross(state[:3], state[3:])
    np.testing.assert_allclose(axes("RTN", state)[2], normal / np.linalg.norm(normal), rtol=1e-12, atol=1e-15)
    assert axes("RTN", state)[1] @ state[3:] > 0.0  # transverse: the way it goes
    # on a circle N of TNW points to the Earth
    np.testing.assert_allclose(
        axes("TNW", np.array([7e6, 0, 0, 0, 7.5e3, 0])), [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], atol=1e-15
    )


def test_rotated_covariance_agrees_with_samples():
    """Errors along local axes, placed in space one by one."""
    state, rng = circular().states[7], np.random.default_rng(1)
    for frame in ("RTN", "TNW"):
        rows = axes(frame, state)
        drawn = rng.multivariate_normal(np.zeros(6), MATRIX, 200_000)
        placed = np.concatenate([drawn[:, :3] @ rows, drawn[:, 3:] @ rows], axis=1)
        scale = np.sqrt(np.diag(MATRIX)).max()
        np.testing.assert_allclose(
            np.cov(placed.T)[:3, :3], inertial(MATRIX, frame, state)[:3, :3], atol=0.01 * scale**2
        )


def two_body(state, duration):
    """Integrate two-body motion with DOP853 to a nanometre."""

    def rate(_, s):
        return np.concatenate([s[3:], -EARTH_MU * s[:3] / np.linalg.norm(s[:3]) ** 3])

    return solve_ivp(rate, (0.0, duration), state, method="DOP853", rtol=1e-13, atol=1e-9).y[:, -1]


@pytest.mark.parametrize("duration", [700.0, -700.0])
def test_propagated_covariance_agrees_with_an_integrator(duration):
    """Each column of the root in two-body motion against Hill motion on a circular orbit."""
    times = np.arange(0.0, 1401.0, 10.0)
    craft = circular(times=times)
    held = Covariances([700.0], [MATRIX], [craft.frame])
    found, age = covariance_at(replace(craft, covariances=held), 700.0 + duration, EARTH_MU)
    assert age == duration
    root = np.linalg.cholesky(MATRIX)
    nominal = two_body(craft.states[70], duration)
    flown = np.array([two_body(craft.states[70] + column, duration) - nominal for column in root.T])
    # circular to 1e-6, linear to some 10 m of 7000 km
    np.testing.assert_allclose(found, flown.T @ flown, rtol=0.0, atol=2e-5 * np.abs(flown.T @ flown).max())


def test_latest_covariance_before_the_start_is_used(tmp_path):
    craft = circular()
    held = Covariances([-50.0, 100.0, 400.0], [MATRIX, 2 * MATRIX, 3 * MATRIX], ["RTN"] * 3)
    later = circular("LATER", times=np.arange(200.0, 600.0, 10.0))
    frame = common_frame([replace(craft, covariances=held), later])
    assert frame.ages == (100.0, None)
    assert frame.covariances[1] is None
    first = common_frame([later, replace(craft, covariances=Covariances([300.0], [MATRIX], ["RTN"]))])
    assert first.ages == (None, -100.0)


@pytest.mark.parametrize("along_track", ["straight", "arc"])
def test_covariance_in_the_frame_of_the_chief(along_track):
    """Compare with samples transformed one by one, 300 km ahead, where the axes differ."""
    chief, deputy = circular(), circular("DEPUTY", ahead=0.04)
    frame = common_frame(
        [chief, replace(deputy, covariances=Covariances([0.0], [MATRIX], ["GCRF"]))], along_track
    )
    radius = frame.radius if along_track == "arc" else None
    rng = np.random.default_rng(3)
    drawn = rng.multivariate_normal(np.zeros(6), MATRIX, 200_000) + deputy.states[0]
    seen = np.cov(relative_from_inertial(chief.states[0], drawn, along_track, radius).T)
    spread = np.sqrt(np.outer(np.diag(seen), np.diag(seen)))
    np.testing.assert_allclose(frame.covariances[1] / spread, seen / spread, atol=0.01)  # 4 / sqrt(200 000)
