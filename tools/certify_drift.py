"""Check the minimum clearance ratio after failures of thrust against dense random sampling.

    python tools/certify_drift.py --cases 100000 [--first 0] [--samples 10000] [--seed 1]

The tool samples failures of all kinds, of one spacecraft or both, and propagates them with an independent
transition matrix (tests/pairs.py). The samples of a case depend only on the seed and its number. The exit
status is 1 if a sampled drift is below the certified minimum by more than 1e-9, if the named failure does not
attain the minimum, or if the verdict is wrong.

For failures with further unknowns (degree, duration) the second check does not apply. For failures with many
unknowns (the instants of both spacecraft, the missed burns) the tool checks only the verdict for round zones,
because the other checks can take many seconds.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

import closeform as cf
from pairs import ZONES, carried, zone

OFF = 1e-9  # tolerance of the minimum ratio, relative above 1
ROUND = [kind for kind in ZONES if kind not in ("box", "tilted box", "cylinder", "faces")]
SCALE = np.array([60, 250, 60, 0.05, 0.1, 0.05])


def pushed(n, thrust, t):
    """Return the states reached from rest under constant thrust (M, 3) in times t (M,), by forced motion."""
    x, y, z = thrust.T / n
    c, s = 1 - np.cos(n * t), np.sin(n * t)
    late = n * t - s
    return np.stack(
        [
            (c * x + 2 * late * y) / n,
            (4 * c * y - 2 * late * x) / n - 1.5 * n * t * t * y,
            c * z / n,
            s * x + 2 * c * y,
            4 * s * y - 3 * n * t * y - 2 * c * x,
            s * z,
        ],
        axis=1,
    )


class Craft:
    """One spacecraft, and its states after failures of thrust at arrays of times."""

    def __init__(self, rng, orbit, size, impulsive):
        self.n, self.orbit = orbit.mean_motion, orbit
        ends = size * rng.normal(size=(3, 6)) * SCALE
        ends[:, 4] = -2 * self.n * ends[:, 0] + rng.normal(size=3) * 2e-3 * size
        duration = rng.uniform(0.3, 2.0) * orbit.period
        fly = orbit.two_impulse if impulsive else orbit.transfer
        legs = [fly(ends[0], ends[1], 0.4 * duration)]
        if rng.random() < 0.5:  # a coast between two burns
            rest = orbit.coast(legs[0].state(legs[0].end), 0.2 * duration, start=legs[0].end)
            legs += [rest, fly(rest.state(rest.end), ends[2], 0.4 * duration, start=rest.end)]
        self.path, self.legs = cf.join(legs), legs[::2]

    def flown_on(self, until):
        """Return the path with a coast after it."""
        end = self.path.end
        return cf.join([self.path, self.orbit.coast(self.path.state(end), until - end, start=end)])

    def states(self, t):
        """Return planned states at times t (M,)."""
        end = self.path.end
        return carried(self.n, self.path.state(np.minimum(t, end)), np.maximum(t - end, 0.0))

    def stuck(self, s, held, hold, t):
        """Return states with thrust `held` (M, 3) stuck on from s for `hold` at most, until t >= s."""
        hold = np.minimum(hold, t - s)
        after = carried(self.n, self.path.state(s), hold) + pushed(self.n, held, hold)
        return carried(self.n, after, t - s - hold)

    def missed(self, rng, least, t):
        """Return states with a given share of each burn: impulses, or the thrust of each leg."""
        states = self.states(t)
        for leg in self.legs:
            lost = (rng.random(len(t)) * (1.0 - least) * rng.integers(0, 2, len(t)))[:, None]
            if leg.impulses:
                burns = [(at, np.r_[np.zeros(3), jump]) for at, jump in leg.impulses]
                for at, kick in burns:
                    given = carried(self.n, np.tile(kick, (len(t), 1)), np.maximum(t - at, 0.0))
                    states -= lost * given * (t >= at)[:, None]
                    lost = (rng.random(len(t)) * (1.0 - least))[:, None]
            else:
                now, end = np.clip(t, leg.start, leg.end), leg.end
                drift = carried(self.n, np.tile(leg.state(leg.start), (len(t), 1)), now - leg.start)
                given = carried(self.n, leg.state(now) - drift, np.maximum(t - end, 0.0))
                states -= lost * given
        return states

    def lost(self, rng, s, t):
        """Return states after loss of thrust at s <= t; an impulse at s gives a share."""
        states = self.path.state(s)
        for at, jump in self.path.impulses:
            states[s == at, 3:] -= rng.random((np.sum(s == at), 1)) * jump
        return carried(self.n, states, t - s)

    def failed(self, rng, failure, s, t):
        """Return positions at times t after failures at s <= t (M,)."""
        if isinstance(failure, cf.MissedBurns):
            return self.missed(rng, failure.least, t)
        if isinstance(failure, cf.StuckOnThrust):
            given = failure.acceleration
            held = self.path.thrust(s) if given is None else np.tile(given, (len(s), 1))
            return self.stuck(s, held, rng.uniform(0.0, failure.longest, len(s)), t)
        drifts = self.lost(rng, s, t)
        if isinstance(failure, cf.DegradedThrust):
            share = rng.uniform(failure.least, 1.0, len(s))[:, None]
            return share * self.states(t) + (1.0 - share) * drifts
        return drifts


def draw_failure(rng):
    """Sample a failure, and whether paths are impulsive."""
    kind, impulsive = rng.integers(5), rng.random() < 0.3
    least = float(rng.choice([0.0, rng.uniform(0.1, 0.9)]))
    if kind == 3:
        return cf.StuckOnThrust(rng.uniform(10.0, 400.0)), False
    if kind == 4:
        return cf.StuckOnThrust(rng.uniform(10.0, 100.0), rng.normal(size=3) * 3e-4), impulsive
    return [cf.ThrustLost(), cf.MissedBurns(least), cf.DegradedThrust(least)][kind], impulsive


def judge(rng, samples):
    """Return the faults of one random case."""
    orbit = cf.Orbit.circular(rng.uniform(300e3, 1500e3))
    failure, impulsive = draw_failure(rng)
    failing = str(rng.choice(["path", "path", "other", "either", "both"]))
    if failing == "both" and not isinstance(failure, cf.ThrustLost):
        failing = "path"
    two = [Craft(rng, orbit, size, impulsive) for size in (1.0, 0.2)]
    last = max(one.path.end for one in two)
    until = last + rng.choice([0.2, 1.0, 2.0, 15.0 if failing != "both" else 3.0]) * orbit.period
    alone = isinstance(failure, cf.ThrustLost) and failing != "both"
    few = not isinstance(failure, cf.MissedBurns) and failing != "both"
    keep_out, _ = zone(rng, rng.choice(ZONES if few else ROUND), 20.0)
    fails = {"path": [True, False], "other": [False, True], "both": [True, True]}
    given = [
        one.path if failing != "either" and fails[failing][k] else one.flown_on(until)
        for k, one in enumerate(two)
    ]
    safe = cf.passively_safe(*given, keep_out, until, failure, failing)
    if not few:
        ratio = 1.0 if safe else -np.inf
        found = cf.DriftApproach(None, None, ratio, None, failing, ratio)
    else:
        found = cf.drift_approach(*given, keep_out, until, failure, failing)
    off, least = OFF * max(1.0, min(abs(found.ratio), 1e6)), np.inf
    for who in ("path", "other") if failing == "either" else (failing,):
        s = [rng.uniform(0.0, until if failing == "either" else one.path.end, samples) for one in two]
        s = [np.minimum(instants, one.path.end) for instants, one in zip(s, two, strict=True)]
        for instants, one in zip(s, two, strict=True):
            for at, _ in one.path.impulses:
                instants[rng.integers(0, samples, samples // 20)] = at
        begin = np.max([at for at, fail in zip(s, fails[who], strict=True) if fail], axis=0)
        t = rng.uniform(begin, until)
        gap = [
            (one.failed(rng, failure, at, t) if fail else one.states(t))[:, :3]
            for one, at, fail in zip(two, s, fails[who], strict=True)
        ]
        least = min(least, keep_out.norm(gap[0] - gap[1]).min())
    wrong = [f"missed: {least!r} below {found.ratio!r}"] if least < found.ratio - off else []
    if not found.lower <= found.ratio:
        wrong.append(f"bound: {found.lower!r} above {found.ratio!r}")
    if alone and not impulsive:
        at, when = np.array([found.failed_at]), np.array([found.time])
        gap = [
            (one.lost(rng, np.minimum(at, one.path.end), when) if fail else one.states(when))[:, :3]
            for one, fail in zip(two, fails[found.failing], strict=True)
        ]
        attained = keep_out.norm(gap[0] - gap[1])[0]
        if abs(attained - found.ratio) > off:
            wrong.append(f"not attained: {attained!r}, said {found.ratio!r}")
    open_still = not alone and not safe  # a verdict that is not certain is False
    if safe != (found.ratio > 1.0) and not open_still and abs(found.ratio - 1) > off:
        wrong.append(f"verdict: {safe} of {found.ratio!r}")
    return [f"{failure} {failing} {type(keep_out).__name__}", *wrong] if wrong else []


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--cases", type=int, default=100_000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--samples", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    complaints, begun, slowest = [], time.process_time(), (0.0, 0)
    for case in range(asked.first, asked.first + asked.cases):
        rng = np.random.Generator(np.random.Philox(key=[asked.seed, case]))
        start = time.process_time()
        if wrong := judge(rng, asked.samples):
            complaints.append((case, *wrong))
        slowest = max(slowest, (time.process_time() - start, case))
    print(f"{asked.cases:,} cases, {len(complaints)} wrong; seed {asked.seed}, from {asked.first:,} on")
    print(f"{time.process_time() - begun:.0f} s, the slowest {slowest[0]:.2f} s (case {slowest[1]})")
    for complaint in complaints[:20]:
        print(*complaint)
    sys.exit(bool(complaints))


if __name__ == "__main__":
    main()
