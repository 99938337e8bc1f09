"""The chief: Kepler motion, real orbits, frames and UTC."""

import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from astropy.time import Time, TimeDelta
from scipy.integrate import solve_ivp

import closeform as cf
from chiefs import to_fifty_digits
from closeform.exchange.ccsds.oem import read_oem
from closeform.exchange.chief import Chief

GRACE = Path(__file__).parents[1] / "examples" / "grace"
EPOCH = "2026-11-22T12:00:00.123456789"
INCLINED = [6.928137e6, 0.3, 2e-3, -1e-3, np.radians(97.6), 1.2]


def attracted(_, state):
    return np.concatenate([state[3:], -cf.elements.EARTH_MU * state[:3] / np.linalg.norm(state[:3]) ** 3])


@pytest.fixture(scope="module")
def grace():
    return read_oem(GRACE / "GRACE-A.oem")


@pytest.mark.parametrize(
    "elements", [INCLINED, [2.5e7, -2.0, 0.5, 0.4, 0.3, -1.0], [7e6, 0.0, 0.0, 0.0, 0.0, 0.0]]
)
def test_kepler_motion_agrees_with_an_integrator(elements):
    chief = Chief.from_elements(EPOCH, elements)
    period = chief.orbit.period
    times = np.linspace(0.0, 2.3 * period, 40)
    flown = solve_ivp(attracted, (0.0, times[-1]), chief.state, "DOP853", times, rtol=1e-13, atol=1e-9).y.T
    # the integrator's own error after two turns
    np.testing.assert_allclose(chief.states(times)[:, :3], flown[:, :3], rtol=0.0, atol=1e-3)
    np.testing.assert_allclose(chief.states(times)[:, 3:], flown[:, 3:], rtol=0.0, atol=1e-6)
    exact = [to_fifty_digits(chief.state, time) for time in times]
    np.testing.assert_allclose(
        chief.states(times)[:, :3], exact, rtol=0.0, atol=1e-14 * 2.3 * 2 * np.pi * elements[0]
    )
    np.testing.assert_allclose(chief.states(period), chief.state, rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(chief.states(0.0), chief.state, rtol=0.0, atol=1e-7)
    assert chief.states(times.reshape(8, 5)).shape == (8, 5, 6)
    back = Chief(EPOCH, flown[0]).states(-times[:3])
    ahead = replace(chief, state=chief.states(-times[2])).states(times[2])
    np.testing.assert_allclose(ahead, chief.state, rtol=0.0, atol=1e-6)
    assert back.shape == (3, 6)


def test_real_orbit_within_the_stated_error(grace):
    """GRACE-A interpolated from every sixth state, also on other time systems."""
    sparse = replace(grace, times=grace.times[::6], states=grace.states[::6])
    chief = Chief.from_ephemeris(sparse, "2010-07-27T00:01:45", "UTC")  # GPS is 15 s ahead then
    times = grace.times - 120.0
    off = np.linalg.norm((chief.states(times) - grace.states)[:, :3], axis=1)
    errors = chief.interpolation_errors(times)
    assert (off <= errors + 8e-3).all()  # m: velocities are good to 0.2 mm/s rms, over 30 s
    assert 0.0 < errors.max() < 0.1
    assert not errors[::6].any()
    np.testing.assert_allclose(chief.state, grace.states[12], rtol=0.0, atol=1e-7)
    assert chief.utc(times[:1]) == ["2010-07-26T23:59:45.000000000Z"]


def test_times_outside_an_ephemeris_are_refused(grace):
    chief = Chief.from_ephemeris(grace)
    assert chief.states(10800.0).tolist() == pytest.approx(grace.states[-1].tolist(), rel=1e-14)
    for time, stamp in ((-1.0, "2010-07-26T23:59:59"), (10801.0, "2010-07-27T03:00:01")):
        with pytest.raises(
            ValueError, match=rf"GRACE-A: has states from .* GPS, and none at {stamp}\.0+; give an"
        ):
            chief.states(time)
    with pytest.raises(ValueError, match="GRACE-A: has states from"):
        Chief.from_ephemeris(grace, "2010-07-28T00:00:00")


@pytest.mark.parametrize("along_track", ["arc", "straight"])
@pytest.mark.parametrize("flown", [False, True])
def test_relative_states_round_trip(along_track, flown, grace):
    chief = Chief.from_ephemeris(grace) if flown else Chief.from_elements(EPOCH, INCLINED)
    times = np.linspace(0.0, 9000.0, 7)
    states = np.random.default_rng(1).normal(size=(3, 7, 6)) * ([500.0] * 3 + [0.5] * 3)
    inertial = chief.inertial_from_relative(times, states, along_track)
    assert inertial.shape == (3, 7, 6)
    back = chief.relative_from_inertial(times, inertial, along_track)
    np.testing.assert_allclose(back[..., :3], states[..., :3], rtol=0.0, atol=1e-7)
    np.testing.assert_allclose(back[..., 3:], states[..., 3:], rtol=0.0, atol=1e-10)
    zero = chief.inertial_from_relative(times, np.zeros(6), along_track)
    np.testing.assert_allclose(zero, chief.states(times), rtol=0.0, atol=1e-8)


def test_frame_agrees_with_common_frame(grace):
    """A single chief and a common frame have the same axes, circle and mean motion."""
    other = read_oem(GRACE / "GRACE-B.oem")
    frame = cf.common_frame([grace, other])
    chief = Chief.from_ephemeris(grace)
    assert chief.orbit.mean_motion == pytest.approx(frame.mean_motion, rel=1e-14)
    assert chief.semi_major_axis == pytest.approx(frame.radius, rel=1e-14)
    found = chief.relative_from_inertial(frame.times, other.states)
    np.testing.assert_allclose(found[:, :3], frame.states[1, :, :3], rtol=0.0, atol=1e-6)


def test_arc_coordinates_of_a_spacecraft_ahead():
    """The arc is the lead in anomaly times the radius, by two-body motion."""
    circle = [7e6, 0.4, 0.0, 0.0, 1.0, 0.2]
    chief = Chief.from_elements(EPOCH, circle)
    ahead = Chief.from_elements(EPOCH, np.array(circle) + [0, 1e-3, 0, 0, 0, 0])
    times = np.linspace(0.0, chief.orbit.period, 9)
    found = chief.relative_from_inertial(times, ahead.states(times))
    np.testing.assert_allclose(found, np.tile([0, 7e3, 0, 0, 0, 0], (9, 1)), rtol=0.0, atol=1e-6)


def test_utc_agrees_with_astropy():
    chief = Chief.from_elements("2016-12-31T23:00:00.123456789", INCLINED, time_system="GPS")
    times = np.linspace(0.0, 7200.0, 50)
    start = Time(chief.epoch, scale="tai") + TimeDelta(19.0, format="sec")
    for stamp, time in zip(chief.utc(times), times, strict=True):
        truth = (start + TimeDelta(time, format="sec")).utc
        assert abs((Time(stamp[:-1], scale="utc") - truth).to_value("s")) < 0.61e-9
    assert any(
        "T23:59:60" in stamp for stamp in Chief.from_elements("2016-12-31T23:59:58", INCLINED).utc([0, 2])
    )


def test_elements_and_warnings():
    chief = Chief.from_elements(EPOCH, INCLINED)
    np.testing.assert_allclose(chief.elements, INCLINED, rtol=1e-12)
    assert chief.semi_major_axis == pytest.approx(INCLINED[0], rel=1e-12)
    assert chief.eccentricity == pytest.approx(np.hypot(2e-3, 1e-3), rel=1e-9)
    assert chief.warnings == (
        "the chief's eccentricity is 0.0022, but Hill's equations assume a circle: "
        "errors of up to 55.9 m for each km of separation and orbit",
    )
    assert Chief.from_elements(EPOCH, [7e6, 0, 5e-4, 0, 1, 0]).warnings == ()


def test_warned_error_agrees_with_two_body_motion():
    """The worst of several orbits deviates by about the stated error."""
    chief = Chief.from_elements(EPOCH, [6.85e6, 0.0, 2e-3, 0.0, 1.0, 0.2])
    said = 1e3 * 25.0 * chief.eccentricity
    times, worst = np.linspace(0.0, chief.orbit.period, 200), 0.0
    for phase in np.linspace(0.0, 2 * np.pi, 8, endpoint=False):
        roe = np.array([0.0, 1e3, 300 * np.cos(phase), 300 * np.sin(phase), 100.0, 300.0]) / 6.85e6
        deputy = replace(
            chief,
            state=cf.elements.inertial_from_elements(cf.elements.elements_from_roe(chief.elements, roe)),
        )
        relative = chief.relative_from_inertial(times, deputy.states(times), "straight")
        hill = chief.orbit.coast(relative[0], times[-1]).state(times)
        worst = max(worst, np.linalg.norm((hill - relative)[:, :3], axis=1).max())
    assert 0.3 * said < worst < said


def test_chief_pickles(grace):
    for chief in (Chief.from_elements(EPOCH, INCLINED), Chief.from_ephemeris(grace)):
        back = pickle.loads(pickle.dumps(chief))
        assert back.utc([1.0]) == chief.utc([1.0])
        np.testing.assert_array_equal(back.states(5.0), chief.states(5.0))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"epoch": "noon"}, "epoch: 'noon' is not a valid epoch; write it in the form"),
        ({"time_system": "UT1"}, "epoch: TIME_SYSTEM UT1 requires tables of the Earth's rotation"),
        ({"frame": "ITRF"}, "frame: 'ITRF' rotates or is unknown; convert to one of EME2000"),
        ({"state": [7e6, 0, 0, 0, 12e3, 0]}, "state: the orbit must be an ellipse"),
    ],
)
def test_invalid_chief(changes, message):
    chief = Chief.from_elements(EPOCH, INCLINED)
    with pytest.raises(ValueError, match=message):
        replace(chief, **changes)
