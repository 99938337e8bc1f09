"""Ephemerides at different epochs: interpolation within a stated error, or a refusal with a remedy."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from closeform.cli.app import main
from closeform.exchange.ccsds.oem import read_oem, write_oem
from closeform.exchange.common_frame import common_frame
from closeform.exchange.ephemerides.ephemeris import Ephemeris
from closeform.exchange.ephemerides.interpolation import interpolated
from closeform.motion.elements.elements import elements_from_inertial, inertial_from_elements
from closeform.motion.elements.mean_motion import EARTH_MU
from orbit_files import circular as turning

GRACE = Path(__file__).parents[1] / "examples" / "grace"
J2 = 1.08262668e-3 * 1.5 * EARTH_MU * 6378137.0**2


def flattened(_, state):
    x, y, z = state[:3]
    r = np.sqrt(x * x + y * y + z * z)
    up = 5.0 * z * z / (r * r)
    pull = -EARTH_MU * state[:3] / r**3 - J2 / r**5 * state[:3] * [1.0 - up, 1.0 - up, 3.0 - up]
    return np.concatenate([state[3:], pull])


def circular(name="CHIEF", ahead=0.0, times=None, **changes):
    """Return a circular orbit with exact velocities."""
    craft = turning(name, times=times, **changes)
    elements = elements_from_inertial(craft.states)
    elements[:, 1] = ahead + np.sqrt(EARTH_MU / 7e6**3) * craft.times
    return replace(craft, states=inertial_from_elements(elements))


@pytest.mark.parametrize("step", [20.0, 60.0, 180.0, 300.0])
def test_stated_interpolation_error_holds(step):
    """DOP853 on an inclined ellipse with J2, also near the ends."""
    start = [6.9e6, 0.0, 0.0, 0.0, 3.0e3, 7.2e3]
    dense = solve_ivp(
        flattened,
        (0.0, 6000.0),
        start,
        method="DOP853",
        rtol=1e-13,
        atol=1e-9,
        max_step=10.0,
        dense_output=True,
    ).sol
    nodes = np.arange(0.0, 6000.1, step)
    craft = replace(circular(), times=nodes, states=dense(nodes).T)
    times = np.linspace(0.0, nodes[-1], 1777)
    states, errors = interpolated(craft, times)
    off = states - dense(times).T
    distance = np.linalg.norm(off[:, :3], axis=1)
    rounding = 1e-6  # m: of the integrator, and of differences of 7e6 m
    assert (distance <= errors + rounding).all()
    assert errors.max() < 100.0 * max(distance.max(), 1e-3)  # the estimate is no idle one
    assert np.linalg.norm(off[:, 3:], axis=1).max() < 20.0 * errors.max() / step + 1e-6


@pytest.mark.parametrize("count", [2, 3, 5])
def test_few_states_lower_the_degree(count):
    craft = circular(times=np.arange(count) * 30.0)
    between = np.array([15.0, 30.0 * (count - 1) - 7.0])
    states, errors = interpolated(craft, between)
    truth = circular(times=between).states
    distance = np.linalg.norm((states - truth)[:, :3], axis=1)
    assert (distance <= errors + 1e-6).all()
    assert distance.max() < 30.0**4 * 7e6 * 1.08e-3**4 / 384.0 * 1.01  # a cubic between two nodes


def test_nodes_are_exact():
    craft = circular()
    states, errors = interpolated(craft, craft.times)
    np.testing.assert_allclose(states[:, :3], craft.states[:, :3], rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(states[:, 3:], craft.states[:, 3:], rtol=0.0, atol=1e-11)
    assert errors.max() < 1e-8


def test_real_orbit_between_epochs():
    """GRACE-B from every minute agrees with every ten seconds."""
    flown = read_oem(GRACE / "GRACE-B.oem")
    sparse = replace(flown, times=flown.times[::6], states=flown.states[::6])
    states, errors = interpolated(sparse, flown.times)
    distance = np.linalg.norm((states - flown.states)[:, :3], axis=1)
    noise = 8e-3  # m: the files' velocities are good to 0.2 mm/s rms, over 30 s
    assert distance.max() < noise
    assert (distance <= errors + noise).all()
    assert errors.max() < 0.1


def test_common_epochs_are_the_densest():
    chief = circular(times=np.arange(0.0, 600.0, 60.0))
    other = circular("OTHER", ahead=1e-3, times=np.arange(5.0, 500.0, 7.0))
    frame = common_frame([chief, other], interpolate=0.01)
    np.testing.assert_allclose(frame.times, other.times)
    np.testing.assert_allclose(
        frame.states[1, :, :3], np.tile([0.0, 7e3, 0.0], (len(other.times), 1)), atol=1e-3
    )
    assert frame.interpolation_errors[1] == 0.0
    assert 0.0 < frame.interpolation_errors[0] < 1e-3
    late = replace(other, epoch="2020-01-01T00:00:55")  # 55 s later, and in the frame of the first's time
    assert common_frame([chief, late], interpolate=0.01).times[0] == 60.0


def test_impossible_interpolation_is_refused():
    chief = circular(times=np.arange(0.0, 6000.0, 60.0))
    coarse = circular("COARSE", times=np.arange(7.0, 6000.0, 1800.0))
    with pytest.raises(
        ValueError, match=r"COARSE: interpolated states may be off by .* more than 1 m; give states closer"
    ):
        common_frame([chief, coarse], interpolate=1.0)
    with pytest.raises(ValueError, match=r"fewer than two common epochs; .*interpolate"):
        common_frame([chief, coarse])
    with pytest.raises(ValueError, match=r"CHIEF, GONE: .*give files that overlap"):
        common_frame([chief, circular("GONE", epoch="2021-01-01T00:00:00")], interpolate=1.0)
    with pytest.raises(ValueError, match="interpolate: must be 0 m or more"):
        common_frame([chief, coarse], interpolate=-1.0)


def test_remedy_of_the_message_works(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_oem("A.oem", circular("A", times=np.arange(0.0, 600.0, 60.0)))
    write_oem("B.oem", circular("B", ahead=1e-4, times=np.arange(17.0, 600.0, 60.0)))
    monkeypatch.setattr("closeform.report.page.drawn", lambda *_: ())
    asked = ["screen", "A.oem", "B.oem", "--sphere", "20 m"]
    assert main(asked) == 2
    refused = capsys.readouterr().err
    assert '--interpolate "1 m"' in refused
    assert main([*asked, "--interpolate", "1 m"]) == 0
    told = capsys.readouterr().out
    assert "States of B interpolated, error up to " in told
    assert isinstance(read_oem("A.oem"), Ephemeris)
