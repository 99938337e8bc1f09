"""Shaping around one ellipsoid: the C core's single contact against the package's `avoid`."""

import ctypes
import sys
import time

import numpy as np

import closeform as cf

lib = ctypes.CDLL("../build/libcff_own.so")
P, I64, U32 = ctypes.c_void_p, ctypes.c_int64, ctypes.c_uint32


def ptr(a):
    return a.ctypes.data_as(P)


def main(count=int(sys.argv[1]) if len(sys.argv) > 1 else 300):
    cases = [(0.0, (600.0, 3000.0), "deep space"), (1.1086e-3, (0.05, 0.5), "LEO, 0.05-0.5 orbits"), (1.1086e-3, (0.5, 1.5), "LEO, 0.5-1.5 orbits")]
    for pace, (n, shares, label) in [(pace, case) for pace in ([0.0], [2.0], [0.1, 1.0]) for case in cases]:
        rng = np.random.default_rng(21)
        orbit = cf.Orbit(n)
        zone = cf.Ellipsoid([20.0, 40.0, 20.0])
        duration = rng.uniform(*shares, count) * (2 * np.pi / n if n else 1.0)
        way = rng.normal(size=(count, 3))
        way /= np.linalg.norm(way, axis=1)[:, None]
        begin, end = np.zeros((2, count, 6))
        begin[:, :3], end[:, :3] = 200 * way, -200 * way + rng.normal(size=(count, 3)) * 15.0
        direct = orbit.transfer(begin, end, duration)
        met = rng.uniform(0.25, 0.75, count) * duration
        there = np.stack([direct[k].state(met[k]) for k in range(count)])  # where it is when it meets the obstacle
        there[:, :3] += rng.normal(size=(count, 3)) * 10.0
        there[:, 3:] += rng.normal(size=(count, 3)) * np.abs(there[:, 3:]).max(axis=1)[:, None] * rng.choice(pace, (count, 1)) if pace[0] else 0.0
        if not pace[0]:
            there[:, 3:] = 0.0  # at rest in the frame when they meet, or nearly
        drift = np.stack([np.asarray(orbit.transition(-met[k])) @ there[k] for k in range(count)])
        obstacles = orbit.coast(drift, duration)
        shape, matrix, _ = zone.form
        arcs, out, status = np.zeros((2 * count, 30)), np.zeros((count, 4)), np.zeros(count, dtype=np.int64)
        t0 = time.perf_counter()
        lib.bridge_avoid(ptr(np.ascontiguousarray(direct.arcs)), ptr(np.ascontiguousarray(obstacles.arcs)), I64(count), ptr(np.ascontiguousarray(matrix)), U32(200_000), ptr(arcs), ptr(out), ptr(status))
        mine = (time.perf_counter() - t0) / count
        theirs_time, conflicts, same, worse, lost, unclear, excess, off = 0.0, 0, 0, 0, 0, 0, [], []
        several = ends = 0
        for k in range(count):
            path, other = direct[k], obstacles[k]
            if not cf.find_conflicts(path, other, zone):
                assert out[k, 0] == 1 and status[k] == 0
                continue
            conflicts += 1
            t0 = time.perf_counter()
            shaped = cf.avoid(path, other, zone)
            theirs_time += time.perf_counter() - t0
            if status[k] != 0:
                lost += shaped.ok
                ends += status[k] == 5
                continue
            mine_path = cf.Path(orbit, arcs[2 * k : 2 * k + 2], np.array([0, 2]), ())
            if cf.find_conflicts(mine_path, other, zone) or np.abs(mine_path.state(mine_path.end) - end[k]).max() > 1e-6:
                unclear += 1
            off.append(abs(mine_path.energy - path.energy - out[k, 1]) / mine_path.energy)
            ratio = out[k, 1] / shaped.extra_energy - 1.0
            excess.append(ratio)
            several += len(shaped.contacts) > 1
            same += abs(ratio) < 1e-6
            worse += ratio > 1e-6
        excess = np.array(excess)
        print(f"obstacle moves at {pace} of the craft, {label}: {conflicts} in conflict of {count}; C has no path where the package has {lost} (of {(status != 0).sum()}, {ends} with an end inside); not clear or not there {unclear}; same extra energy to 1e-6 {same}, dearer {worse} "
              f"(median {100 * np.median(excess[excess > 1e-6]) if worse else 0:.2g} %, most {100 * excess.max():.3g} %), cheaper {(excess < -1e-6).sum()} (most {100 * -excess.min():.2g} %); "
              f"package has several contacts {several}; energy told off by {max(off):.1g}; evaluations mean {out[:, 3][out[:, 0] == 2].mean():.0f} most {out[:, 3].max():.0f}; "
              f"ms each: C {1e3 * mine:.2f}, package {1e3 * theirs_time / conflicts:.1f}")


main()
