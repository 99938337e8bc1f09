"""Exports for tests, and plain readers of their formats."""

from datetime import datetime
from pathlib import Path

import numpy as np

import closeform as cf
from closeform.mission.mission_result import Mission
from scenarios import GOOD, LOST

EPOCH = "2026-11-22T12:00:00"
ORBIT = f"""[orbit]
epoch = "{EPOCH}Z"
chief.elements = {{ altitude = "550 km", inclination = "97.6 deg", latitude = "1 rad" }}
"""
FLYING = (
    GOOD.replace('[orbit]\naltitude = "500 km"\n', ORBIT)
    .replace('sphere = "20 m"', 'sphere = "25 m"')
    .replace('max_thrust = "1.5 N"\n', "")
    .replace('mass = "150 kg"', 'mass = "150 kg"\nspecific_impulse = "220 s"')
    + '\n[[stage]]\nname = "back"\ndo = "reconfigure"\n'
    + "to = ["
    + ", ".join(f'{{ position = "0 {y} 0 m", velocity = "0 0 0 m/s" }}' for y in (0, 100, 200))
    + ']\ncost = "delta-v"\nwithin = "0.2 orbits"\n'
)
SEARCHING = LOST.partition("\n[study]")[0].replace(
    "deep_space = true", f'deep_space = true\nepoch = "{EPOCH}Z"'
)
SURE = FLYING.replace(
    'keep_out = { sphere = "25 m" }',
    'keep_out = { sphere = "25 m" }\nhard_body = "2 m"\n'
    'covariance = { position = "1 2 1 m", velocity = "1 1 1 mm/s" }',
)


def run(folder: Path, text: str) -> Mission:
    """Fly a scenario."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "case.toml").write_text(text)
    return cf.run(folder / "case.toml")


def seconds(stamp: str) -> float:
    """An epoch as seconds after EPOCH, by Python's own calendar; to a nanosecond."""
    whole, _, part = stamp.rstrip("Z").partition(".")
    after = (datetime.fromisoformat(whole) - datetime.fromisoformat(EPOCH)).total_seconds()
    return after + float(f"0.{part or 0}")


def truth(mission: Mission, name: str, times: np.ndarray, left: bool = False) -> np.ndarray:
    """Inertial states of a craft by the closed form; at a burn those before it where `left`."""
    chief, found = mission.scenario.chief, []
    for time in times:
        stages = [result for result in mission.results if result.start <= time + 1e-9]
        if left:
            stages = [result for result in stages if result.start < time - 1e-9] or stages[:1]
        path = stages[-1].after.path(name)
        arcs = path.arcs
        at = np.searchsorted(arcs[:, 0], time + (-1e-9 if left else 1e-9), side="right") - 1
        one = cf.Path(path.orbit, arcs[max(at, 0) : max(at, 0) + 1], np.array([0, 1]), ())
        found.append(one.state(np.clip(time, one.start, one.end)))
    return chief.inertial_from_relative(times, np.array(found))
