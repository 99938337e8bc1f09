"""The GRACE extract: its contents, and predictions of the next orbit."""

import runpy
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from astropy import units
from astropy.coordinates import GCRS, ITRS, CartesianRepresentation
from astropy.time import Time, TimeDelta
from astropy.utils import iers

from closeform import Orbit
from closeform.exchange.ccsds.oem import read_oem
from closeform.exchange.common_frame import common_frame
from closeform.motion.elements.elements import elements_from_inertial
from closeform.motion.elements.frames import relative_from_inertial

ROOT = Path(__file__).parents[1]

# K-band range [m] every 10 minutes from 00:00:00 GPS time on 27 July 2010: LEOGPS reference/grc_kb_rng.csv
K_BAND = """227379.1269 227204.9209 226528.0062 225488.5977 224478.5887 224061.7616 224534.0157 225622.8124
226711.3815 227330.4094 227366.8745 226875.5218 225946.2436 224859.3583 224151.2622 224279.2089 225193.6102
226355.9259"""


@pytest.fixture(scope="module")
def craft():
    return tuple(read_oem(ROOT / "examples" / "grace" / f"GRACE-{letter}.oem") for letter in "AB")


@pytest.fixture(scope="module")
def tool():
    return SimpleNamespace(**runpy.run_path(str(ROOT / "tools" / "grace_oem.py")))


def test_files_cover_three_hours(craft):
    for ephemeris in craft:
        assert (ephemeris.frame, ephemeris.time_system, ephemeris.center) == ("GCRF", "GPS", "EARTH")
        assert ephemeris.epoch == "2010-07-27T00:00:00"
        np.testing.assert_array_equal(ephemeris.times, np.arange(1081) * 10.0)


def test_distance_agrees_with_k_band_range(craft):
    distance = np.linalg.norm(craft[0].states[:, :3] - craft[1].states[:, :3], axis=1)[:-1:60]
    bias = distance - np.array(K_BAND.split(), dtype=float)
    # The range is known up to a constant; the orbits are good to 1 cm: three of it each way.
    assert np.abs(bias - bias.mean()).max() < 0.03
    assert np.abs(bias.mean()) < 0.05


def test_velocities_are_inertial_metres_per_second(craft, tool):
    for ephemeris in craft:
        # 0.2 mm/s rms in the source; an Earth-fixed velocity would be off by 500 m/s
        assert np.abs(tool.residual(ephemeris.states, 10.0)).max() < 1e-3


def test_orbit_keeps_its_plane_and_size(craft):
    for ephemeris in craft:
        a, _, ex, ey, inclination, node = elements_from_inertial(ephemeris.states).T
        assert np.ptp(a) < 25e3  # flattening swings it by 10 km each way
        assert np.hypot(ex, ey).max() < 0.004
        np.testing.assert_allclose(np.degrees(inclination), 89.0, atol=0.05)  # GRACE flew at 89.0 degrees
        assert np.degrees(np.ptp(node)) < 0.05  # drifts by 0.13 degrees a day


def earth_fixed(ephemeris, rows):
    """Return source rows (km, dm/s) by astropy and 8th-order differences."""
    epochs = Time(ephemeris.epoch, scale="tai") + TimeDelta(ephemeris.times[:rows] + 19.0, format="sec")
    with iers.earth_orientation_table.set(iers.IERS_B.open()):
        inertial = CartesianRepresentation(ephemeris.states[:rows, :3].T * units.m)
        geocentric = GCRS(inertial, obstime=epochs).transform_to(ITRS(obstime=epochs))
    return geocentric.cartesian.xyz.to_value("m").T


def test_tool_agrees_with_astropy(craft, tool, tmp_path):
    rows = 40
    fixed = earth_fixed(craft[0], rows)
    velocity = np.zeros_like(fixed)
    velocity[4:-4] = -tool.residual(np.hstack([fixed, fixed * 0]), 10.0)
    lines = [
        f"27/7/2010,00:{k // 6:02d}:{k % 6 * 10:02d},"
        + ",".join(f"{x:.6f}" for x in [*fixed[k] / 1e3, *velocity[k] * 10])
        for k in range(4, rows - 4)
    ]
    file = tmp_path / "truth.csv"
    file.write_text("\n".join(lines))
    with iers.conf.set_temp("auto_download", False):
        made = tool.convert(file, "GRACE-A", "2002-012A", 1.0)
        np.testing.assert_allclose(
            made.states[:, :3], craft[0].states[4 : rows - 4, :3], atol=2e-3
        )  # written in mm
        np.testing.assert_allclose(
            made.states[:, 3:], craft[0].states[4 : rows - 4, 3:], atol=1e-3
        )  # its own noise
        file.write_text("\n".join(lines).replace(",-", ",-1"))
        with pytest.raises(SystemExit, match="the velocities are not Earth-fixed dm/s"):
            tool.convert(file, "GRACE-A", "2002-012A", 1.0)


def greatest_errors(craft, along_track):
    frame = common_frame(craft, along_track)
    orbit = Orbit(frame.mean_motion)
    times = np.arange(0.0, orbit.period, 10.0)
    errors = []
    for first in range(0, len(frame.times) - len(times), 47):
        flown = frame.states[1, first : first + len(times), :3]
        predicted = orbit.coast(frame.states[1, first], times[-1]).position(times)
        errors.append(np.linalg.norm(predicted - flown, axis=1).max())
    return np.array(errors)


def test_prediction_of_the_next_orbit(craft):
    straight, arc = greatest_errors(craft, "straight"), greatest_errors(craft, "arc")
    assert len(arc) == 12
    # Straight axes take the 3.7 km that the deputy stands below the tangent for a radial offset,
    # which drifts by 12 pi times as much: 139 km.
    curvature = 12 * np.pi * 225e3**2 / (2 * 6.84e6)
    np.testing.assert_allclose(straight, curvature, rtol=0.1)
    # Flattening makes the two semi-major axes, 33 s apart, differ by up to 600 m, which drifts
    # by 3 pi times as much: 6 km.
    assert 2.5e3 < arc.min() < arc.max() < 6.5e3


def test_prediction_holds_for_the_first_minutes(craft):
    frame = common_frame(craft)
    times = np.arange(0.0, 301.0, 10.0)
    orbit = Orbit(frame.mean_motion)
    for first in range(0, 1000, 100):
        flown = frame.states[1, first : first + len(times), :3]
        predicted = orbit.coast(frame.states[1, first], times[-1]).position(times)
        assert np.linalg.norm(predicted - flown, axis=1).max() < 150.0


@pytest.mark.parametrize("step", [2, 6, 30, 180, 360])  # of 10 s
def test_interpolation_is_within_the_estimate(craft, step):
    """The estimate holds for motion with J2."""
    frame = common_frame(craft)
    path = Orbit(frame.mean_motion).sampled(frame.times[::step], frame.states[1, ::step])
    off = np.linalg.norm(path.position(frame.times) - frame.states[1, :, :3], axis=1).max()
    assert 0.01 * path.interpolation_error < off < path.interpolation_error
    assert path.cubic_share == (1.0 if step < 360 else 0.0)  # an hour of flight is more Hill's than a cubic's


def test_cross_track_velocity_lacks_the_rotation_of_the_plane(craft):
    """J2 rotates the frame about x by 5e-8 rad/s, which frames.py neglects."""
    states = relative_from_inertial(craft[0].states, craft[1].states, "arc")
    missed = states[4:-4, 3:] - np.gradient(states[:, :3], 10.0, axis=0)[4:-4]
    assert 0.010 < np.abs(missed[:, 2]).max() < 0.025  # 225 km times 5e-8 rad/s is 11 mm/s


@pytest.fixture(scope="module")
def example():
    return SimpleNamespace(**runpy.run_path(str(ROOT / "examples" / "grace" / "field.py")))


@pytest.mark.slow
def test_field_predicts_the_next_orbit(example):
    """Errors are metres after an orbit at 225 km, and kilometres in Hill's equations."""
    first = example.Start(940.0)
    fields = first.fields()
    ends = {
        name: first.errors(fields[name]) for name in ("a point mass", "J2", "J2 to J6", "EGM96 to degree 12")
    }
    from_both, fitted = np.array(list(ends.values())).T
    assert from_both[0] > 3e3
    assert (from_both[1:] < 60.0).all()
    # three times a velocity along the motion is what drifts: known to 0.5 mm/s each at worst
    assert from_both[-1] < 3.0 * 5.6e3 * 1e-3
    assert fitted[-1] < 0.5 * fitted[1]
    assert fitted[-1] < 0.7
    assert fitted[0] > 100.0


def test_tesserals_are_the_gradient_of_their_potential(example):
    """Difference the sum of spherical harmonics."""
    from scipy.special import lpmv

    pull, place = example.Tesserals(0.7, 12), np.array([4.1e6, -3.2e6, 4.4e6])

    def potential(at):
        r, longitude = np.linalg.norm(at), np.arctan2(at[1], at[0]) - 0.7 - example.SPIN * 100.0
        total = 0.0
        for (n, m), k in pull.terms.items():
            legendre = (-1) ** m * lpmv(m, n, at[2] / r)  # without the phase of Condon and Shortley
            wave = k.real * np.cos(m * longitude) - k.imag * np.sin(m * longitude)
            total += (example.GRAVITY_RADIUS / r) ** n * legendre * wave
        return (
            example.cf.elements.EARTH_MU / r * (total - 1.0)
        )  # without the point mass, which leaves more digits

    felt = pull(np.array([100.0]), np.concatenate([place, np.zeros(3)])[None])[0]
    steps = 10.0 * np.eye(3)
    slopes = np.array([(potential(place + one) - potential(place - one)) / 20.0 for one in steps])
    central = -example.cf.elements.EARTH_MU * place / np.linalg.norm(place) ** 3
    assert felt - central == pytest.approx(slopes, abs=1e-9)  # m/s^2, of 1e-2
