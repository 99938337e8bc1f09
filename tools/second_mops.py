"""Compute how often lost pairs of S04 need the second mOPS, from 10^8 cases of its study.

    python tools/second_mops.py --cases 100000000

Case K is that of `closeform run FILE --case K` for a copy of examples/s04.toml with as many cases. Memory is
constant; 10^8 cases take a minute on two idle cores.
"""

import argparse
import time
from pathlib import Path

import numpy as np

from closeform.campaign.draws import drawn
from closeform.campaign.search_cases import shares
from closeform.scenario import load
from closeform.search.lock_statistics import count_by_phase, phase_labels
from closeform.search.lock_times import lock_times

FILE = Path(__file__).parents[1] / "examples" / "s04.toml"
AT_ONCE = 131_072


def main() -> None:
    parser = argparse.ArgumentParser(description="Shares of the phases in which S04's pairs lock.")
    parser.add_argument("--cases", type=int, default=100_000_000)
    cases = parser.parse_args().cases
    scenario, begun = load(FILE), time.perf_counter()
    search = scenario.plan
    last = max(k for k, leg in enumerate(search.legs) if leg.round == 2 and leg.phase == "IPS")
    counts = np.zeros(len(phase_labels(search)), dtype=int)
    for first in range(0, cases, AT_ONCE):
        until = min(first + AT_ONCE, cases)
        craft = drawn(scenario, scenario.study.seed, first, until)
        states = craft[:, 1] - craft[:, 0]
        found = lock_times(search, states[:, :3], states[:, 3:])
        counts += count_by_phase(search, found.time, found.leg)
        for late in np.flatnonzero((found.leg < 0) | (found.leg > last)):
            print(f"case {first + late}: {found.time[late]:.2f} s, {states[late].tolist()}", flush=True)
    for share in shares(search, counts.tolist()):
        inside = share.inside
        text = f"{share.cases:12d}  {inside.share:.3e} ({inside.low:.3e} to {inside.high:.3e})"
        print(f"{share.label:8} {text}")
    print(f"{cases} cases in {time.perf_counter() - begun:.0f} s")


if __name__ == "__main__":
    main()
