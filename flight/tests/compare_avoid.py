"""Paths around obstacles: the library against `cf.avoid`.

Usage: compare_avoid.py COUNT [OBSTACLES] [e] [-l: lingering obstacles only] [-v: failures]
"""

import sys
from collections import Counter
from time import perf_counter

import numpy as np
from random_pairs import chief

import closeform as cf
from closeform.flight.motion import arcs_of
from closeform.flight.pairs import avoidance

OPTIONS = [a for a in sys.argv[1:] if not a.startswith("-")]
COUNT, EACH = (int(a) for a in (*OPTIONS[:2], *("100", "1")[len(OPTIONS[:2]) :]))
CHIEF = OPTIONS[2] if len(OPTIONS) > 2 else None
BUDGET = 100_000


def cases(rng, orbit, n, shares, pace, count):
    """Return direct transfers of 400 m and obstacles (count x EACH) on them, moving at `pace` of them."""
    duration = rng.uniform(*shares, count) * (2 * np.pi / n if n else 1.0)
    way = rng.normal(size=(count, 3))
    way /= np.linalg.norm(way, axis=1)[:, None]
    begin, end = np.zeros((2, count, 6))
    begin[:, :3], end[:, :3] = 200 * way, -200 * way + rng.normal(size=(count, 3)) * 15.0
    direct = orbit.transfer(begin, end, duration)
    obstacles = []
    for k in range(count):
        for share in np.linspace(0.25, 0.75, EACH + 2)[1:-1] if EACH > 1 else [rng.uniform(0.25, 0.75)]:
            met = share * duration[k]
            there = direct[k].state(met)
            there[:3] += rng.normal(size=3) * 10.0
            there[3:] += (
                rng.normal(size=3) * np.abs(there[3:]).max() * rng.choice(pace) if pace[0] else -there[3:]
            )
            start = np.linalg.inv(orbit.transition(met)) @ there
            obstacles.append(orbit.coast(start, duration[k]))
    return direct, obstacles


def verdict_of(direct, met, zone, status, found, spent):
    """Return how a plan compares with that of the package, and its excess; it must be clear."""
    if not any(cf.find_conflicts(direct, o, zone) for o in met):
        assert (status, found.count) == ("OK", 1)
        return "clear", None
    since = perf_counter()
    shaped = cf.avoid(direct, met, zone)
    spent["package"] += perf_counter() - since
    if status != "OK":
        return ("refused" if shaped.ok else "neither"), None
    path = arcs_of(direct.orbit, found.arcs, found.count)
    assert not any(cf.find_conflicts(path, o, zone) for o in met)
    assert np.abs(path.state(path.end) - direct.state(direct.end)).max() < 1e-6
    assert abs(path.energy - direct.energy - found.extra_energy_m2_s3) < 1e-8 * path.energy
    excess = found.extra_energy_m2_s3 / shaped.extra_energy - 1.0
    return ("same" if abs(excess) < 1e-6 else "dearer" if excess > 0.0 else "cheaper"), excess


def main():
    zone = cf.Ellipsoid([20.0, 40.0, 20.0])
    kinds = [(0.0, (600.0, 3000.0)), (1.1086e-3, (0.05, 0.5)), (1.1086e-3, (0.5, 1.5))]
    totals = Counter()
    for pace in [[0.1, 1.0]] if "-l" in sys.argv else [[0.0], [2.0], [0.1, 1.0]]:
        for n, shares in kinds[1:] if CHIEF else kinds:
            orbit = chief(CHIEF) if CHIEF else cf.Orbit(n)
            direct, obstacles = cases(np.random.default_rng(21), orbit, n, shares, pace, COUNT)
            verdicts, contacts, used = Counter(), Counter(), []
            spent = {"library": 0.0, "package": 0.0}
            for k in range(COUNT):
                met = obstacles[k * EACH : (k + 1) * EACH]
                since = perf_counter()
                status, found = avoidance(direct[k], met, [zone] * EACH, BUDGET)
                spent["library"] += perf_counter() - since
                verdict, excess = verdict_of(direct[k], met, zone, status, found, spent)
                verdicts[verdict] += 1
                if verdict != "clear":
                    used.append(found.evaluations_used)
                if excess is not None:
                    contacts[found.count - 1] += 1
                if verdict in ("refused", "dearer") and "-v" in sys.argv:
                    print("   ", verdict, k, status, excess, found.count - 1)
            print(
                f"n={n:g} {shares} pace {pace}: {dict(verdicts)}; contacts {dict(sorted(contacts.items()))}; "
                f"evaluations mean {np.mean(used):.0f}, most {max(used)}; "
                f"ms { ({k: round(1e3 * v / COUNT, 2) for k, v in spent.items()}) }",
                flush=True,
            )
            totals += verdicts
    planned = sum(totals[key] for key in ("same", "dearer", "cheaper", "refused"))
    print(
        f"{dict(totals)}; same or cheaper {(totals['same'] + totals['cheaper']) / planned:.4f} of {planned}"
    )


if __name__ == "__main__":
    main()
