"""Relative orbital elements in scenarios, by the equations of D'Amico."""

from pathlib import Path

import numpy as np
import pytest

from closeform.mission.mission import plan_mission
from closeform.scenario import ScenarioError, load, parse

EXAMPLES = Path(__file__).parents[1] / "examples"
FILE = """
closeform = 1
title = "Relative elements"
[orbit]
altitude = "500 km"
latitude = "30 deg"
[craft]
name = ["A", "B"]
start = [{ roe = "0 0 0 0 0 0 m" }, { roe = "4 50 -30 300 80 250 m" }]
keep_out = { sphere = "10 m" }
[[stage]]
do = "coast"
for = "0.3 orbits"
"""
ELEMENTS = np.array([4.0, 50.0, -30.0, 300.0, 80.0, 250.0])
GOAL = np.array([0.0, 20.0, 60.0, -100.0, 0.0, 150.0])
TO = '{ roe = "0 20 60 -100 0 150 m" }'


def place(elements: np.ndarray, latitude: float, passed: float) -> np.ndarray:
    """Position [m] at a latitude, `passed` radians after that at which dl holds."""
    da, dl, dex, dey, dix, diy = elements
    cos, sin = np.cos(latitude), np.sin(latitude)
    along = dl - 1.5 * passed * da + 2.0 * (dex * sin - dey * cos)
    return np.array([da - dex * cos - dey * sin, along, dix * sin - diy * cos])


def test_start_by_relative_elements() -> None:
    """Compare at the start and a third of an orbit later, at the latitude of the file."""
    mission = plan_mission(parse(FILE))
    (flown,) = mission.results
    path = flown.after.path("B")
    for time in np.linspace(0.0, flown.end, 7):
        passed = mission.orbit.mean_motion * time
        expected = place(ELEMENTS, np.radians(30.0) + passed, passed)
        np.testing.assert_allclose(path.position(time), expected, rtol=0, atol=1e-9)


def arrived(mission, craft: str) -> None:
    """A craft is on the elements of GOAL at the end of its stage, and stays on them."""
    flown = mission.results[-1]
    n = mission.orbit.mean_motion
    path = mission.orbit.coast(flown.after.path(craft).state(flown.end), 3000.0, flown.end)
    for time in np.linspace(0.0, 3000.0, 5):
        expected = place(GOAL, np.radians(30.0) + n * (flown.end + time), n * time)
        np.testing.assert_allclose(path.position(flown.end + time), expected, rtol=0, atol=1e-6)


def stage(text: str) -> str:
    return f"{FILE}\n[[stage]]\n{text}\n"


@pytest.mark.parametrize(
    "text",
    [
        f'do = "avoid"\ncraft = "B"\nto = {TO}\nwithin = "0.4 orbits"',
        f'do = "reconfigure"\ncraft = ["B"]\nto = [{TO}]\nwithin = "0.4 orbits"',
    ],
)
def test_transfer_to_relative_elements(text: str) -> None:
    mission = plan_mission(parse(stage(text)))
    assert mission.stopped is None
    arrived(mission, "B")


def test_late_arrival_has_its_elements() -> None:
    """With too little thrust, the elements hold at the actual arrival."""
    text = stage(f'do = "avoid"\ncraft = "B"\nto = {TO}\nwithin = "0.1 orbits"')
    text = text.replace("[[stage]]", 'mass = "100 kg"\nmax_thrust = "0.05 N"\n[[stage]]', 1)
    mission = plan_mission(parse(text))
    late = mission.results[-1]
    assert mission.stopped is None
    assert late.end - late.start > 1.05 * 0.1 * mission.orbit.period
    arrived(mission, "B")


def test_spiral_example() -> None:
    mission = plan_mission(load(EXAMPLES / "inspector.toml"))
    assert mission.clear
    last = mission.results[-1]
    times = np.linspace(last.start, last.end, 20_001)
    apart = last.after.path("Inspector").position(times) - last.after.path("Target").position(times)
    # a 50 m safety ellipse: across the track it never comes closer than 50 m; samples are half a second apart
    assert np.hypot(apart[:, 0], apart[:, 2]).min() == pytest.approx(50.0, abs=1e-3)


INVALID = {
    "deep space": (
        FILE.replace('altitude = "500 km"\nlatitude = "30 deg"', "deep_space = true").replace(
            "0.3 orbits", "30 min"
        ),
        "craft.start: a relative orbit, but deep space has no orbits; give position and velocity, or line",
    ),
    "latitude in deep space": (
        FILE.replace('altitude = "500 km"', "deep_space = true"),
        "orbit: latitude requires altitude or period or semi_major_axis or mean_motion",
    ),
    "no lengths": (
        FILE.replace("4 50 -30 300 80 250 m", "1e-6 0 0 4e-5 0 4e-5 rad"),
        'craft.start[2].roe: "1e-6 0 0 4e-5 0 4e-5 rad" is ',
    ),
}


@pytest.mark.parametrize("name", INVALID)
def test_invalid_elements_are_rejected(name: str) -> None:
    text, line = INVALID[name]
    with pytest.raises(ScenarioError) as refused:
        plan_mission(parse(text, "two.toml"))
    assert [one for one in refused.value.lines if one.startswith(f"two.toml: {line}")]
