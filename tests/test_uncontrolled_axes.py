"""Thrusters without cross-track thrust: controlled axes, and drift in the others."""

import numpy as np
import pytest

import closeform as cf
from closeform.dynamics.simulation.thruster_pulses import controllable_axes, lacks_axis
from closeform.mission.mission import plan_mission
from closeform.scenario import parse
from field_scenario import swap
from simulated import FIELD, ORBIT, SIGHT, flown_apart

IN_PLANE = cf.Thrusters([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]], acceleration=0.02, period=30.0)
NAVIGATION = '\n[navigation]\nposition = "10 cm"\nvelocity = "0.3 mm/s"\n\n[simulation]\nseeds = 2\n'
CRAFT = """\
thrusters = { directions = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]] }
max_acceleration = "20 mm/s^2"
period = "30 s"
"""


def test_projection_onto_the_span_of_the_thrusters():
    """Compare with least squares, for tilted and inertially fixed thrusters."""
    draws = np.random.default_rng(1)
    sides = draws.normal(size=(2, 3))
    unit = sides / np.linalg.norm(sides, axis=1, keepdims=True)
    own = cf.Thrusters(np.vstack([unit, -unit]), "inertial")
    pushes, angles = draws.normal(size=(5, 3)), np.linspace(0.0, 4.0, 5)
    found = np.einsum("tij,tj->ti", controllable_axes(own, angles), pushes)
    for push, angle, led in zip(pushes, angles, found, strict=True):
        c, s = np.cos(angle), np.sin(angle)
        turned = unit @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]]).T
        amounts = np.linalg.lstsq(turned.T, push)[0]
        assert led == pytest.approx(turned.T @ amounts, abs=1e-12)
    assert lacks_axis(own)
    assert not lacks_axis(cf.Thrusters.rtn())


def test_uncontrolled_axis_drifts_in_the_high_fidelity_model():
    """Cross-track motion agrees with DOP853; in-plane motion is controlled."""
    z = ORBIT.coast([0, 0, 300.0, 0, 0, 0], 3000.0).state(3000.0)[[2, 5]]
    path = ORBIT.transfer([[0, 200.0, 300.0, 0, 0, 0]], [[40, -150, z[0], 0, -0.09, z[1]]], 3000.0)
    found = cf.simulate(path, FIELD, thrusters=IN_PLANE)
    off = found.states[0, 0, :, :3] - path.position(found.times)[0]
    apart = flown_apart(path, FIELD, found.times)[0] - path.position(found.times)[0]
    assert np.abs(apart[:, 2]).max() > 0.1  # m
    # in the plane the two are metres apart, by which J2 pulls across otherwise
    assert off[:, 2] == pytest.approx(apart[:, 2], abs=0.05 * np.abs(apart[:, 2]).max())
    assert np.abs(off[-1, :2]).max() < 0.5 < np.abs(apart[-1, :2]).max()


def test_run_reports_the_uncontrolled_axis():
    """A margin in metres is possible; "auto" ends the mission with a reason."""
    text = swap(craft=CRAFT, more='margin = "auto"\n' + NAVIGATION)
    for sign in ("", "-"):
        text = text.replace(f'"0 0 {sign}120 m"', f'"0 {sign}120 0 m"')
    mission = plan_mission(parse(text))
    assert mission.stopped is not None
    assert mission.stopped.startswith("stage 1 (reconfigure): no margin fits: the plan is not feasible: ")
    assert "thrusters: A: an axis without a thruster" in mission.stopped
    assert mission.verdict.status == 1
    flown = plan_mission(parse(text.replace('"auto"', '"1 m"')))
    assert flown.stopped is None
    off = flown.flights.flight.states[..., 2]
    assert flown.flights.unled == pytest.approx(
        dict(zip("AB", np.abs(off).max(axis=(0, 2)).tolist(), strict=True)), rel=1e-9
    )
    path = ORBIT.transfer([0, 200, 0, 0, 0, 0], [40, -150, 0, 0, -0.09, 0], 3000.0)
    far = ORBIT.coast([0, 0, 500.0, 0, 0, 0], 3000.0)
    none = cf.fit_margin(
        lambda margin: cf.avoid(path, far, cf.Sphere(9.0), margin=margin),
        *(FIELD, cf.Sphere(9.0)),
        navigation=SIGHT,
        obstacles=far,
        thrusters=IN_PLANE,
    )
    assert not none.fits
    assert none.room is None
    assert none.reason.startswith("the plan is not feasible: thrusters: craft 0: an axis")
