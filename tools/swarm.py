"""Writes examples/swarm.toml: a hundred lost craft at random, by a seed.

python tools/swarm.py
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

FILE = Path(__file__).parents[1] / "examples" / "swarm.toml"
CRAFT, SEED = 100, 100
WIDE, FAST = 1000, 50  # m and mm/s: each component within plus and minus this

FRAME = """\
# A hundred lost craft with narrow sensors of short range: pairs become knowledge sets, sets grow and
# join, and after four rounds of the search some craft have still met nobody.  That is a result: the run
# says who is left and ends with status 1.
# Written by tools/swarm.py: NumPy's Philox generator with seed {seed}, first all positions, then all
# velocities, each component uniform within +-{wide} m and +-{fast} mm/s, in whole metres and mm/s.
closeform = 1
title = "Swarm: gather a hundred lost craft"

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


def text() -> str:
    """The file."""
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


def lines(words: Sequence[str], each: int) -> str:
    """Texts as rows of a TOML list, some on each line."""
    rows = [words[k : k + each] for k in range(0, len(words), each)]
    return "\n".join("  " + " ".join(f'"{word}",' for word in row) for row in rows)


if __name__ == "__main__":
    FILE.write_text(text(), encoding="utf-8")
