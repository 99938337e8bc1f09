"""Simulations of several stages: coasts are held, and each stage is simulated as it is alone."""

import json
from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import LineCollection

import closeform as cf
from closeform.cli.app import main
from simulated import at, chief, deviations, fired, pushed

pytestmark = pytest.mark.usefixtures("undrawn")

FIELD = cf.Field(chief())
ORBIT = FIELD.orbit
DAY = 86_400.0
HELD = cf.Feedback(ORBIT.period, 2.0 * ORBIT.period, 8)
OFTEN = cf.Feedback(300.0, 1800.0, 6)


def circle(radius: float, turned: float = 0.0) -> np.ndarray:
    """Return states (2, 6) on opposite sides of a projected circle."""
    angle, rate = turned + np.array([0.3, 0.3 + np.pi]), ORBIT.mean_motion
    places = radius * np.array([np.sin(angle) / 2.0, np.cos(angle), np.sin(angle)])
    speeds = rate * radius * np.array([np.cos(angle) / 2.0, -np.sin(angle), np.cos(angle)])
    return np.vstack([places, speeds]).T


def stages(coast: float, verb: str = "impulsive") -> tuple[cf.Path, cf.Path, cf.Path]:
    """Return a coast [s], a move of one orbit from a circle of 300 m to 200 m, and an equal coast."""
    before = ORBIT.coast(circle(300.0), coast)
    end = coast + ORBIT.period
    final = circle(200.0, ORBIT.mean_motion * end)
    move = getattr(ORBIT, verb)(before.state(coast), final, ORBIT.period, start=coast)
    return before, move, ORBIT.coast(final, coast, start=end)


def test_coasts_between_impulses_are_held():
    """The coasts are as close to the plan as a coast alone; an independent integrator agrees."""
    before, move, after = stages(0.5 * DAY)
    flight = cf.simulate(cf.join([before, move, after]), FIELD, feedback=HELD, zones=cf.Sphere(50.0))
    alone = cf.simulate(before, FIELD, feedback=HELD)
    assert flight.violated == 0.0
    assert flight.greatest_deviation < 1.5 * alone.greatest_deviation < 60.0  # m
    states = flight.states[0, 0]
    jumps = (flight.states - flight.arrivals)[0, 0, :, 3:]
    own = jumps.any(axis=1)
    whole = fired(before.state(0.0)[0], flight.times[own], jumps[own], float(flight.times[-1]))
    assert states[-1] == pytest.approx(whole, abs=0.05)  # m, over many orbits


def test_impulses_of_a_stage_are_those_of_the_stage_alone():
    """The impulses of a move are retargeted as they are without the coasts."""
    before, move, after = stages(DAY)
    flight = cf.simulate(cf.join([before, move, after]), FIELD, feedback=HELD, zones=cf.Sphere(50.0))
    alone = cf.compensated_thrust(move, FIELD).impulses
    jumps = (flight.states - flight.arrivals)[0, ..., 3:]
    for k in range(2):
        when, sizes = alone.time[alone.craft == k], alone.impulse[alone.craft == k]
        fires = [int(np.argmin(np.abs(flight.times - time))) for time in when]
        expected = [j for j, size in enumerate(sizes) if np.linalg.norm(size) > 1e-3]
        assert len(expected) >= 2
        for j in expected:
            # m/s; feedback acts at the same instants
            assert jumps[k, fires[j]] == pytest.approx(sizes[j], abs=3e-3)


def test_continuous_thrust_before_impulses():
    """The model error of a stage of continuous thrust is compensated before a stage of impulses."""
    first = ORBIT.transfer(circle(300.0), circle(200.0, 2.0), ORBIT.period)
    final = circle(300.0, 2.0 + 2.0 * np.pi)
    second = ORBIT.impulsive(first.state(first.end[0]), final, ORBIT.period, start=first.end[0])
    both = cf.simulate(cf.join([first, second]), FIELD, feedback=OFTEN)
    alone = cf.simulate(first, FIELD)
    upon = np.searchsorted(both.times, ORBIT.period)
    assert np.abs(deviations(both.planned, both)[0, :, :upon]).max() < 1e-3  # m
    assert alone.greatest_deviation < 1e-3
    kicks = cf.compensated_thrust(second, FIELD)
    shares = alone.field_delta_v + (kicks.delta_v - kicks.planned_delta_v)
    assert both.field_delta_v == pytest.approx(shares, abs=1e-4)  # m/s


def test_coasts_beside_continuous_thrust_are_held_by_impulses():
    """With impulsive feedback, coasts have no continuous thrust against the field."""
    each = stages(0.5 * DAY, "transfer")
    flight = cf.simulate(cf.join(each), FIELD, feedback=HELD, zones=cf.Sphere(50.0))
    move = cf.simulate(each[1], FIELD)
    assert flight.violated == 0.0
    assert flight.greatest_deviation < 60.0
    assert flight.field_delta_v == pytest.approx(move.field_delta_v, abs=1e-4)


@pytest.mark.parametrize("law", [HELD, OFTEN, cf.Feedback()], ids=["orbits", "minutes", "thrust"])
def test_margins_predict_coasts_and_moves(law):
    """The expected deviation agrees with the simulation without errors."""
    path = cf.join(stages(3.0 * ORBIT.period))
    margins = cf.tracking_margins(path, FIELD, law)
    flight = cf.simulate(path, FIELD, feedback=law)
    aside = at(margins, margins.shift, flight.times) - deviations(path, flight)[0]
    assert np.abs(deviations(path, flight)).max() > (0.5 if law.impulses else 1e-6)
    assert np.abs(aside).max() < 0.05 * np.abs(deviations(path, flight)).max() + 0.05


@pytest.mark.parametrize("verb", ["impulsive", "transfer"])
def test_coasts_beside_pulses_are_held(verb):
    """Pulsed feedback is as close and costs as little as impulses, except for the sum over thrusters."""
    path = cf.join(stages(0.5 * DAY, verb))
    thrusters = cf.Thrusters.rtn(acceleration=0.02, minimum_bit=1e-5, period=60.0)
    pulsed = cf.simulate(path, FIELD, feedback=HELD, zones=cf.Sphere(50.0), thrusters=[thrusters, thrusters])
    plain = cf.simulate(path, FIELD, feedback=HELD)
    assert pulsed.violated == 0.0
    assert pulsed.greatest_deviation < plain.greatest_deviation + 5.0  # m
    assert pulsed.greatest_end < plain.greatest_end + 1.0
    assert np.abs(pulsed.field_delta_v).max() < 2e-3  # m/s; continuous thrust against J2 needs 0.7 a day
    # the sum over three axes is at most sqrt(3) times the norm
    assert (pulsed.delta_v < np.sqrt(3.0) * plain.delta_v).all()


@pytest.mark.slow
def test_short_pulses_of_long_simulations():
    """Pulses of hundredths of a second over four days agree with DOP853."""
    path = cf.join(stages(2.0 * DAY))
    thrusters = cf.Thrusters.rtn(acceleration=0.5, minimum_bit=1e-5)
    flight = cf.simulate(path, FIELD, "open", thrusters=thrusters)
    assert flight.firing.pulses.duration.min() < 0.2  # s
    own = flight.firing.pulses[flight.firing.pulses.craft == 1]
    expected = zip(own.start, own.start + own.duration, own.direction * 0.5, strict=True)
    begin = FIELD.chief_states(flight.times[:1])[0]
    span = flight.times[0], flight.times[-1]
    end = pushed(begin, flight.states[0, 1, 0], list(expected), span)
    assert flight.states[0, 1, -1, :3] == pytest.approx(end, abs=0.1)  # m, after 61 orbits


@pytest.mark.parametrize("verb", ["impulsive", "transfer"])
def test_margins_predict_coasts_beside_pulses(verb):
    """The expected deviation with pulses agrees with the simulation."""
    path = cf.join(stages(3.0 * ORBIT.period, verb))
    thrusters = cf.Thrusters.rtn(acceleration=0.02, minimum_bit=1e-5, period=60.0)
    margins = cf.tracking_margins(path, FIELD, HELD, thrusters=thrusters)
    flight = cf.simulate(path, FIELD, feedback=HELD, thrusters=thrusters)
    off = deviations(path, flight)[0]
    assert np.abs(at(margins, margins.shift, flight.times) - off).max() < 0.05 * np.abs(off).max() + 0.05


def test_run_holds_its_coasts(tmp_path: Path):
    """`closeform run` of coast, move and coast with drag and navigation errors keeps its zones."""
    file = tmp_path / "long.toml"
    file.write_text(LONG)
    assert main(["run", str(file), "--out", str(tmp_path / "out"), "--no-viewer"]) == 0
    expected = json.loads((tmp_path / "out" / "summary.json").read_text())["flights"]
    assert expected["violated"] == 0


def test_single_spacecraft_coasts_without_a_zone(tmp_path: Path):
    """A single spacecraft needs no keep_out."""
    file = tmp_path / "alone.toml"
    file.write_text(ALONE)
    assert main(["run", str(file), "--out", str(tmp_path / "out"), "--no-viewer"]) == 0


ALONE = """\
closeform = 1
title = "One craft coasts"
[orbit]
altitude = "500 km"
[craft]
name = ["A"]
position = "0 -1000 0 m"
velocity = "0 0 0 m/s"
[[stage]]
do = "coast"
for = "1 orbit"
"""


LONG = """\
closeform = 1
title = "Hold, move and hold"
[orbit]
epoch = "2026-11-22T12:00:00Z"
chief.elements = { altitude = "500 km", inclination = "51.6 deg", latitude = "0 deg" }
chief.ballistic = "0.02 m^2/kg"
field = { density = "5.2e-13 kg/m^3", at_altitude = "500 km", scale_height = "60 km" }
[feedback]
every = "95 min"
horizon = "190 min"
impulses = 8
[navigation]
position = "10 cm"
velocity = "0.3 mm/s"
[simulation]
seeds = 3
[craft]
name = ["A", "B", "C", "D"]
start = { projected_circular = { radius = "300 m" } }
keep_out = { sphere = "50 m" }
ballistic = ["0.02 m^2/kg", "0.022 m^2/kg", "0.02 m^2/kg", "0.022 m^2/kg"]
[[stage]]
do = "coast"
for = "12 h"
[[stage]]
do = "reconfigure"
to = { projected_circular = { radius = "200 m" } }
within = "1 orbits"
cost = "delta-v"
[[stage]]
do = "coast"
for = "12 h"
"""


def test_long_simulations_are_drawn_as_curves():
    """Lines of the picture follow an ellipse of 150 by 300 m over three days."""
    flight = cf.simulate(ORBIT.coast(circle(300.0), 3.0 * DAY), FIELD, feedback=HELD)
    collections = cf.plots.flight_paths(flight).axes[0].collections
    curves = [line for one in collections if isinstance(one, LineCollection) for line in one.get_segments()]
    along, radial = max(curves, key=len).T
    middles = [0.5 * (line[:-1] + line[1:]) for line in (along / 300.0, radial / 150.0)]
    assert np.hypot(*middles).min() > 0.99
