"""Kernels compiled by `closeform compile`, beside those compiled at their first call."""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from tables import Report, Table, seconds
from timing import say

AHEAD = """
from closeform._jit import compile_ahead, kernel_modules
needed = [name for name in kernel_modules() if name.startswith(("conflicts", "search.lock_march"))]
compile_ahead(needed, print)
"""
CALLS = """
import json, sys
sys.path += sys.argv[2:]
import numpy as np
import closeform as cf
from cases import MEAN_MOTION, PERIOD, cluster
from timing import timed
from time import process_time

repeats, orbit, rng = int(sys.argv[1]), cf.Orbit(MEAN_MOTION), np.random.default_rng(1)
degree = np.pi / 180
search = cf.Search.modified(cf.Sensor(70 * degree), slew_rate=0.25 * degree, sun_limit=25 * degree)
places, speeds = rng.uniform(-500, 500, (60_000, 3)), rng.uniform(-0.2, 0.2, (60_000, 3))
coasts = orbit.coast(cluster(1_500, 300.0, 1), PERIOD)
starts = cluster(500, 300.0, 2)
transfers = orbit.transfer(starts, starts[::-1], PERIOD)
tasks = {
    "lock_times, 60,000 pairs": lambda: cf.lock_times(search, places, speeds),
    "screen, natural, 1,500 spacecraft, box": lambda: cf.screen(coasts, cf.Box([20.0, 40.0, 20.0])),
    "screen, natural, 1,500 spacecraft, cylinder": lambda: cf.screen(coasts, cf.Cylinder(20.0, 40.0)),
    "screen, thrusting, 500 spacecraft, ellipsoid": lambda: cf.screen(transfers, cf.Ellipsoid([20, 40, 20])),
}
print(json.dumps({name: timed(task, repeats, process_time)[0] for name, task in tasks.items()}))
"""


def measure(quick: bool) -> Report:
    """Time the same calls in processes that load kernels of both kinds, in turn."""
    here, rounds = str(Path(__file__).parents[1]), 1 if quick else 5
    found: dict[str, list[dict[str, float]]] = {"ahead": [], "at its call": []}
    with tempfile.TemporaryDirectory() as folder:
        caches = {how: {**os.environ, "XDG_CACHE_HOME": f"{folder}/{how}"} for how in found}
        say("  compiling ahead")
        subprocess.run([sys.executable, "-c", AHEAD], env=caches["ahead"], check=True, stdout=sys.stderr)
        for round_ in range(rounds + 1):  # the first compiles
            for how, environment in caches.items():
                say(f"  round {round_} of {rounds}: compiled {how}")
                command = [sys.executable, "-c", CALLS, "3" if quick else "7", here]
                told = subprocess.run(command, env=environment, check=True, stdout=subprocess.PIPE)
                found[how].append(json.loads(told.stdout))
    rows = []
    for name in found["ahead"][0]:
        ahead, called = (min(one[name] for one in found[how][1:]) for how in ("ahead", "at its call"))
        rows.append([name, seconds(ahead), seconds(called), f"{ahead / called:.2f}"])
    title = "Kernels compiled ahead by closeform compile, and by a Python process at its call, CPU time"
    return Report([Table(title, ["function", "ahead", "at its call", "ratio"], rows)])
