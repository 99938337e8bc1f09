"""Paths around obstacles: the library against `cf.avoid`.

Usage: compare_avoid.py COUNT [OBSTACLES] [e] [-l: lingering obstacles only] [-v: failures]
"""

import ctypes
import sys
import time

import numpy as np
from random_pairs import chief

import closeform as cf
from bridge import I64, U32, library, packed_of, ptr

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


def main():
    lib = library()
    zone = cf.Ellipsoid([20.0, 40.0, 20.0])
    kinds = [(0.0, (600.0, 3000.0)), (1.1086e-3, (0.05, 0.5)), (1.1086e-3, (0.5, 1.5))]
    if CHIEF:
        kinds = kinds[1:]
    totals = np.zeros(5)
    for pace in [[0.1, 1.0]] if "-l" in sys.argv else [[0.0], [2.0], [0.1, 1.0]]:
        for n, shares in kinds:
            orbit = chief(CHIEF) if CHIEF else cf.Orbit(n)
            direct, obstacles = cases(np.random.default_rng(21), orbit, n, shares, pace, COUNT)
            table = packed_of(orbit)
            rows = np.ascontiguousarray(np.concatenate([o.arcs for o in obstacles]))
            arcs, out, status = np.zeros((9 * COUNT, 30)), np.zeros((COUNT, 4)), np.zeros(COUNT, np.int64)
            since = time.perf_counter()
            lib.bridge_avoid(
                table and ctypes.byref(table),
                ptr(np.ascontiguousarray(direct.arcs)),
                ptr(rows),
                I64(EACH),
                I64(COUNT),
                ptr(np.tile(zone.form[1].ravel(), EACH)),
                U32(BUDGET),
                ptr(arcs),
                ptr(out),
                ptr(status),
            )
            mine, theirs, verdicts = (
                time.perf_counter() - since,
                0.0,
                {"same": 0, "dearer": 0, "cheaper": 0, "refused": 0, "neither": 0, "clear": 0},
            )
            contacts, excess = [], []
            for k in range(COUNT):
                met = obstacles[k * EACH : (k + 1) * EACH]
                if not any(cf.find_conflicts(direct[k], o, zone) for o in met):
                    assert (out[k, 0], status[k]) == (1, 0), (k, out[k])
                    verdicts["clear"] += 1
                    continue
                since = time.perf_counter()
                shaped = cf.avoid(direct[k], met, zone)
                theirs += time.perf_counter() - since
                if status[k] != 0:
                    verdicts["refused" if shaped.ok else "neither"] += 1
                    if shaped.ok and "-v" in sys.argv:
                        print("   refused", k, status[k], len(shaped.contacts), out[k])
                    continue
                number = int(out[k, 0])
                path = cf.Path(orbit, arcs[9 * k : 9 * k + number], np.array([0, number]), ())
                assert not any(cf.find_conflicts(path, o, zone) for o in met), k
                assert np.abs(path.state(path.end) - direct[k].state(direct[k].end)).max() < 1e-6
                assert abs(path.energy - direct[k].energy - out[k, 1]) < 1e-8 * path.energy
                ratio = out[k, 1] / shaped.extra_energy - 1.0
                verdicts["same" if abs(ratio) < 1e-6 else ("dearer" if ratio > 0 else "cheaper")] += 1
                contacts.append(number - 1)
                excess.append(ratio)
                if ratio > 1e-6 and "-v" in sys.argv:
                    print("   dearer", k, ratio, number - 1, len(shaped.contacts))
            used = out[out[:, 0] != 1, 3]
            print(
                f"n={n:g} {shares} pace {pace}: {verdicts}; contacts {np.bincount(contacts)}; "
                f"evaluations mean {used.mean():.0f}, most {used.max():.0f}; "
                f"ms {1e3 * mine / COUNT:.2f}, package {1e3 * theirs / COUNT:.1f}",
                flush=True,
            )
            totals += [verdicts[key] for key in ("same", "dearer", "cheaper", "refused", "neither")]
    print(
        f"same to 1e-6 {totals[0]:.0f}, dearer {totals[1]:.0f}, cheaper {totals[2]:.0f}, "
        f"refused {totals[3]:.0f}, no plan in either {totals[4]:.0f}; "
        f"same or cheaper {(totals[0] + totals[2]) / totals[:4].sum():.4f}"
    )


if __name__ == "__main__":
    main()
