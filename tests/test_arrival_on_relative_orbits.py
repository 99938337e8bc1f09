"""Arrival on a named relative orbit, at a given phase or the cheapest one."""

import re
from functools import cache

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import expm

import closeform as cf
from bridge import hill
from closeform.mission.mission import plan_mission
from closeform.report.run import RunReport
from closeform.report.sections import moves
from closeform.scenario import ScenarioError, parse

FILE = """\
closeform = 1
title = "Onto an ellipse"

[orbit]
altitude = "500 km"

[craft]
name = ["Target", "Inspector"]
position = ["0 0 0 m", "10 -900 30 m"]
velocity = ["0 0 0 m/s", "0 0.02 0 m/s"]
keep_out = { sphere = "20 m" }

[[stage]]
name = "approach"
do = "DO"
craft = "Inspector"
to = TO
within = "0.8 orbits"
cost = "COST"
"""
ELLIPSE = '{ safety_ellipse = { radial = "80 m", cross_track = "60 m", along_track = "5 m"PHASE } }'
ORBIT = cf.Orbit.circular(500e3)
DURATION = 0.8 * ORBIT.period
START = np.array([10.0, -900.0, 30.0, 0.0, 0.02, 0.0])


def mission(do, cost, phase="", to=ELLIPSE):
    return plan_mission(
        parse(FILE.replace("DO", do).replace("COST", cost).replace("TO", to.replace("PHASE", phase)))
    )


def lines(flown):
    return [line for section in RunReport(flown).sections for line in (*section.lines, *section.closing)]


def state_at(phase):
    return cf.targets.safety_ellipse(ORBIT, 1, 80.0, 60.0, 5.0, phase)[0]


@cache
def gramian():
    """Return the Gramian of the whole duration by quadrature."""
    motion, push = hill(ORBIT.mean_motion), np.eye(6)[:, 3:]

    def reached(t):
        return expm(motion * t) @ push

    def entry(i, j):
        return quad(lambda t: reached(t)[i] @ reached(t)[j], 0.0, DURATION)[0]

    return np.array([[entry(i, j) for j in range(6)] for i in range(6)])


def minimum_energy(final):
    """Return half of d W^-1 d, where d is the miss of a coast."""
    missed = final - expm(hill(ORBIT.mean_motion) * DURATION) @ START
    return 0.5 * missed @ np.linalg.solve(gramian(), missed)


@pytest.mark.parametrize("do", ["avoid", "transfer"])
def test_given_phase(do):
    flown = mission(do, "energy", ', phase = "70 deg"')
    assert flown.clear
    end = flown.results[0].after.path("Inspector").state(DURATION)
    np.testing.assert_allclose(end, state_at(np.radians(70.0)), atol=1e-6)
    costs = [minimum_energy(state_at(np.radians(phase))) for phase in (70.0, *np.arange(0.0, 360.0, 0.5))]
    own, beside = (line for line in lines(flown) if "lowest cost" in line)
    arrives = "Inspector arrives on the safety ellipse at 70.00 deg, as given; lowest cost at"
    phase = float(re.fullmatch(rf"{arrives} ([\d.]+) deg", own).group(1))
    told = re.fullmatch(
        r"With free thrust and without obstacles: ([-\de.]+) m²/s³; "
        r'lowest cost ([-\de.]+) m²/s³ \(phase = "cheapest"\)',
        beside,
    )
    here, spent = map(float, told.groups())
    assert here == pytest.approx(costs[0], rel=1e-3)
    assert min(costs) * (1.0 - 1e-3) < spent <= min(costs) * (1.0 + 1e-3)  # of half degrees; four digits
    assert spent == pytest.approx(minimum_energy(state_at(np.radians(phase))), rel=1e-3)
    (figures,) = (one.get("change", one.get("transfer")) for one in (RunReport(flown).sections[0].figures,))
    assert figures["arrival"]["cheapest_deg"] == pytest.approx(phase, abs=0.005)
    first = mission(do, "energy")
    np.testing.assert_allclose(
        first.results[0].after.path("Inspector").state(DURATION), state_at(0.0), atol=1e-6
    )


@pytest.mark.parametrize("phase", ["cheapest", "20 deg"])
def test_cheapest_phase_ignores_passive_safety_in_the_report(phase):
    goal = mission("transfer", "delta-v", f', phase = "{phase}"').results[0].result.goal
    plain, told = ([*moves.arrival_lines("F1", goal, drifts)] for drifts in (False, True))
    assert told == [*plain, "The phase of lowest cost disregards free drift from there"]
    *_, last = moves.arrival_lines("F1", goal, True, True)
    assert "among passively safe phases" in last


def test_given_and_cheapest_phase_exclude_each_other():
    best = moves.phase_of(mission("transfer", "energy", ', phase = "cheapest"').results[0].result.goal)
    flown = mission("transfer", "energy", f', phase = "{best:.2f} deg"')
    (told,) = (line for line in lines(flown) if "phase" in line or "arrives" in line)
    assert f"{best:.2f} deg, as given, lowest cost: " in told


@pytest.mark.parametrize("do", ["avoid", "transfer"])
def test_arrival_phase_of_minimum_energy(do):
    flown = mission(do, "energy", ', phase = "cheapest"')
    end = flown.results[0].after.path("Inspector").state(DURATION)
    phases = np.linspace(0.0, 2 * np.pi, 3601)
    costs = [minimum_energy(state_at(phase)) for phase in phases]
    best = phases[int(np.argmin(costs))]
    np.testing.assert_allclose(end, state_at(best), atol=80 * np.radians(0.1))  # the grid of this test
    assert minimum_energy(end) <= min(costs) * (1.0 + 1e-9)
    assert minimum_energy(end) < 0.9 * minimum_energy(state_at(0.0))
    figures = RunReport(flown).sections[0].figures["change" if do == "avoid" else "transfer"]["arrival"]
    assert figures["cheapest"]
    assert figures["orbit"] == "safety_ellipse"
    assert np.radians(figures["phase_deg"]) == pytest.approx(best, abs=np.radians(0.1))
    assert f"{figures['phase_deg']:.2f} deg, lowest cost" in "\n".join(lines(flown))


def test_arrival_phase_of_minimum_delta_v():
    flown = mission("transfer", "delta-v", ', phase = "cheapest"')
    spent = flown.results[0].after.path("Inspector").delta_v
    finals = np.array([state_at(phase) for phase in np.linspace(0.0, 2 * np.pi, 721)])
    every = cf.least_delta_v(ORBIT, START, finals, DURATION)
    assert spent <= every.lower.min() * (1.0 + 1e-7)
    assert spent >= every.lower.min() * (1.0 - 1e-4)  # resolution of half a degree


def test_cheapest_phase_avoids_an_occupied_place():
    """A third spacecraft at the cheapest phase moves the arrival outside of its zone."""
    alone = mission("avoid", "energy", ', phase = "cheapest"')
    end = alone.results[0].after.path("Inspector").state(DURATION)
    x, y, z, vx, vy, vz = ORBIT.transition(-DURATION) @ end
    third = (
        FILE.replace('["Target", "Inspector"]', '["Target", "Inspector", "Third"]')
        .replace('"10 -900 30 m"]', f'"10 -900 30 m", "{x} {y} {z} m"]')
        .replace('"0 0.02 0 m/s"]', f'"0 0.02 0 m/s", "{vx} {vy} {vz} m/s"]')
        .replace("TO", ELLIPSE.replace("PHASE", ', phase = "cheapest"'))
        .replace("COST", "energy")
        .replace("DO", "avoid")
    )
    flown = plan_mission(parse(third))
    assert flown.clear, flown.stopped
    apart = flown.results[0].after.path("Inspector").state(DURATION)[:3] - end[:3]
    assert 20.0 < np.linalg.norm(apart) < 25.0  # no farther than necessary


def test_cheapest_phase_avoids_an_unsafe_drift():
    """A third spacecraft comes back to the cheapest phase a quarter of an orbit later."""
    alone = mission("avoid", "energy", ', phase = "cheapest"')
    end = alone.results[0].after.path("Inspector").state(DURATION)
    x, y, z, vx, vy, vz = ORBIT.transition(-DURATION) @ (end + [0, 0, 35.0, 0, 0, 0])
    third = (
        FILE.replace('["Target", "Inspector"]', '["Target", "Inspector", "Third"]')
        .replace('"10 -900 30 m"]', f'"10 -900 30 m", "{x} {y} {z} m"]')
        .replace('"0 0.02 0 m/s"]', f'"0 0.02 0 m/s", "{vx} {vy} {vz} m/s"]')
        .replace("TO", ELLIPSE.replace("PHASE", ', phase = "cheapest"'))
        .replace("COST", "energy")
        .replace("DO", "avoid")
    )
    without = plan_mission(parse(third)).results[0].after.path("Inspector").state(DURATION)
    assert np.linalg.norm(without - end) < 1e-6  # clear within this stage
    flown = plan_mission(parse(third + 'drift = "0.5 orbits"\n'))
    assert flown.clear, flown.stopped
    (result,) = flown.results
    own, other = (result.after.path(name).state(DURATION) for name in ("Inspector", "Third"))
    times = np.linspace(0.0, 0.5 * ORBIT.period, 2001)
    apart = [np.linalg.norm((ORBIT.transition(t) @ (own - other))[:3]) for t in times]
    assert 20.0 < min(apart) < 21.0  # no farther than it must


def test_relative_orbit_as_goal_of_meanwhile():
    text = FILE.replace("DO", "avoid").replace("COST", "energy")
    text = text.replace("TO", '{ position = "0 -300 0 m", velocity = "0 0 0 m/s" }')
    to = ELLIPSE.replace("PHASE", ', phase = "cheapest"').replace("5 m", "600 m")
    flown = plan_mission(parse(f'{text}meanwhile = [{{ craft = "Target", to = {to} }}]\n'))
    assert flown.clear, flown.stopped
    assert "Target arrives on the safety ellipse" in "\n".join(lines(flown))


@pytest.mark.parametrize(
    ("to", "message"),
    [
        (ELLIPSE.replace("PHASE", ', phase = "dearest"'), 'or "cheapest"'),
        ('{ line = { spacing = "9 m", direction = [1, 0, 0] } }', "a line is at rest in deep space only"),
        ('{ pendulum = { spacing = "9 m" } }', "cross_track"),
    ],
)
def test_invalid_goals(to, message):
    with pytest.raises(ScenarioError, match=message):
        parse(FILE.replace("DO", "avoid").replace("COST", "energy").replace("TO", to))
