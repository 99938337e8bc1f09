"""Write examples/swarm.toml: a hundred lost spacecraft with random states, or a crowd of any number.

python tools/swarm.py
python tools/swarm.py --crowd 10000 crowd.toml   # closed relative orbits at the same density for any number
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

FILE = Path(__file__).parents[1] / "examples" / "swarm.toml"
CRAFT, SEED = 100, 100
WIDE, FAST = 1000, 50  # m and mm/s: each component within plus and minus this
CROWD, EDGE = 10_000, 50e3  # number of spacecraft in a cube of this edge [m] at the start
MEAN_MOTION = 0.001106784447  # rad/s: 500 km above the Earth

FRAME = """\
# A hundred lost spacecraft have narrow sensors of short range. Pairs form knowledge sets, and sets grow and
# join. After four rounds of the search some spacecraft are still alone. This is a valid result: the run
# names them and ends with status 1.
# Written by tools/swarm.py with NumPy's Philox generator and seed {seed}: first all positions, then all
# velocities. Each component is uniform within +-{wide} m and +-{fast} mm/s, in whole metres and mm/s.
closeform = 1
title = "Swarm: gather a hundred lost spacecraft"

[orbit]
deep_space = true

[craft]
name = [
{names}
]
group = [
{groups}
]
position = [
{positions}
]
velocity = [
{velocities}
]
keep_out = {{ sphere = "10 m" }}

[sensor]
half_angle = "20 deg"
range = "600 m"

[search]
method = "basic"
slew_rate = "0.25 deg/s"
sun_limit = "25 deg"

[[stage]]
do = "gather"
rounds = 4
"""

CROWD_FRAME = """\
# Written by tools/swarm.py --crowd {count}: closed relative orbits, NumPy's Philox generator, seed {seed}.
closeform = 1
title = "Crowd of {count} spacecraft"

[orbit]
mean_motion = "{mean_motion} rad/s"

[craft]
name = [
{names}
]
position = [
{positions}
]
velocity = [
{velocities}
]
keep_out = {{ sphere = "20 m" }}

[[stage]]
do = "coast"
for = "5677 s"
"""


def text() -> str:
    """Return the text of examples/swarm.toml."""
    random = np.random.Generator(np.random.Philox(SEED))
    places, speeds = (np.round(random.uniform(-most, most, (CRAFT, 3))).astype(int) for most in (WIDE, FAST))
    return FRAME.format(
        seed=SEED,
        wide=WIDE,
        fast=FAST,
        names=lines([f"S{k:03d}" for k in range(1, CRAFT + 1)], 10),
        groups=lines(["AB"[k % 2] for k in range(CRAFT)], 20),
        positions=lines([" ".join(map(str, place)) + " m" for place in places], 5),
        velocities=lines([" ".join(map(str, speed)) + " mm/s" for speed in speeds], 5),
    )


def crowd(count: int, mean_motion: float = MEAN_MOTION, seed: int = SEED) -> Any:
    """Return states (count, 6) [m, m/s] on closed relative orbits, at the same density for any number.

    The initial positions are uniform in a cube. Radial and cross-track speeds are at most those of a
    relative orbit of the size of the cube.
    """
    random = np.random.Generator(np.random.Philox(seed))
    half = EDGE / 2 * np.cbrt(count / CROWD)
    states = random.uniform(-half, half, (count, 6)) * np.repeat([1.0, mean_motion], 3)
    states[:, 4] = -2.0 * mean_motion * states[:, 0]
    return states


def crowd_text(count: int) -> str:
    """Return the scenario of a crowd that coasts for one orbit."""
    states = crowd(count)
    return CROWD_FRAME.format(
        count=count,
        seed=SEED,
        mean_motion=MEAN_MOTION,
        names=lines([f"C{k}" for k in range(count)], 10),
        positions=lines(["{:.3f} {:.3f} {:.3f} m".format(*state[:3]) for state in states], 5),
        velocities=lines(["{:.6f} {:.6f} {:.6f} m/s".format(*state[3:]) for state in states], 5),
    )


def lines(words: Sequence[str], each: int) -> str:
    """Return the rows of a TOML list with a given number of texts per row."""
    rows = [words[k : k + each] for k in range(0, len(words), each)]
    return "\n".join("  " + " ".join(f'"{word}",' for word in row) for row in rows)


def main() -> None:
    parser = argparse.ArgumentParser(description="Write a scenario of many spacecraft with random states.")
    parser.add_argument("--crowd", type=int, metavar="CRAFT", help="number of spacecraft of a crowd")
    parser.add_argument("file", type=Path, nargs="?", default=FILE)
    asked = parser.parse_args()
    if asked.crowd is not None and (asked.crowd < 1 or asked.file == FILE):
        parser.error("--crowd requires at least one spacecraft and a file to write")
    asked.file.write_text(text() if asked.crowd is None else crowd_text(asked.crowd), encoding="utf-8")


if __name__ == "__main__":
    main()
