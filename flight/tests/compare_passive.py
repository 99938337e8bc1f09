"""Passive safety of random approaches: the library against `cf.passively_safe`, and against samples.

Usage: compare_passive.py COUNT [e]
"""

import ctypes
import sys
import time

import numpy as np
from random_pairs import chief

import closeform as cf
from bridge import I64, U32, flat, library, packed_of, ptr

COUNT = int(sys.argv[1]) if len(sys.argv) > 1 else 20
CHIEF = sys.argv[2] if len(sys.argv) > 2 else "0.3"


def losses(lib, path, other, zone, until, budget=10_000_000):
    """Return rows (verdict, failure, time, certified, evaluations) and statuses."""
    (a, ao), (b, bo), count = flat(path), flat(other), len(path.offsets) - 1
    out, status, table = np.empty((count, 5)), np.zeros(count, np.int64), packed_of(path.orbit)
    matrix = np.ascontiguousarray(zone.form[1])
    lib.bridge_loss(
        ctypes.byref(table),
        ptr(a),
        ptr(ao),
        ptr(b),
        ptr(bo),
        I64(count),
        I64(zone.form[0]),
        ptr(matrix),
        ctypes.c_double(until),
        U32(budget),
        ptr(out),
        ptr(status),
    )
    return out, status


def sampled(orbit, path, other, zone, until, count=60):
    """Return the least norm of drifts after `count` failures."""
    least = np.inf
    for fails in np.linspace(path.start, path.end, count):
        state = path.state(fails)
        times = np.linspace(fails, until, 400)
        drifts = orbit.coast(state, until - fails, fails)
        gap = np.stack([drifts.state(t) - other.state(t) for t in times])[:, :3]
        least = min(least, float(np.min(zone.norm(gap))))
    return least


def main():
    lib, orbit, rng = library(), chief(CHIEF), np.random.default_rng(8)
    period = orbit.period
    tally, used, spent = np.zeros((2, 3), int), [], [0.0, 0.0]
    for k in range(COUNT):
        until = 1.5 * period
        length = rng.uniform(0.1, 0.6) * period
        begin = np.array([*rng.normal(size=3) * 150.0, 0.0, 0.0, 0.0])
        begin[4] = -2.0 * 1.1086e-3 * begin[0]
        end = np.array([*rng.normal(size=3) * 60.0, 0.0, 0.0, 0.0])
        if k % 2:
            path = orbit.transfer(begin, end, length)
        else:
            path = (
                cf.join([orbit.impulsive(begin, end, length)])
                if hasattr(orbit, "impulsive")
                else orbit.transfer(begin, end, length)
            )
        other = orbit.coast(np.zeros(6), until)
        kind = rng.choice(3)
        size = rng.uniform(5.0, 30.0)
        zone = (cf.Sphere(size), cf.Box([size, 1.5 * size, size]), cf.Cylinder(size, 2 * size))[kind]
        since = time.perf_counter()
        (row,), (status,) = losses(lib, path, other, zone, until)
        spent[0] += time.perf_counter() - since
        since = time.perf_counter()
        safe = bool(cf.passively_safe(path, other, zone, until))
        spent[1] += time.perf_counter() - since
        assert status == 0, status
        used.append(row[4])
        tally[int(safe), int(row[0])] += 1
        if row[0] == 0 and k < 12:
            assert sampled(orbit, path, other, zone, until) > 1.0 - 1e-9, (k, "false safe")
        if (safe != (row[0] == 0) or row[0] == 2) and "-v" in sys.argv:
            at = min(max(row[2], 0), until)
            print(
                zone.norm(
                    (
                        orbit.coast(path.state(row[1]), max(at - row[1], 1e-9), row[1]).state(at)
                        - other.state(at)
                    )[None, :3]
                ),
                path.end,
                len(path.arcs),
            )
            print(k, kind, safe, row)
    print(
        f"e={CHIEF}: package unsafe: library {tally[0]}, package safe: library {tally[1]} "
        f"(safe, unsafe, undecided); evaluations mean {np.mean(used):.0f}, most {np.max(used):.0f}; "
        f"ms {1e3 * spent[0] / COUNT:.1f}, package {1e3 * spent[1] / COUNT:.1f}"
    )


if __name__ == "__main__":
    main()
