"""The C core against the package: conflicts and closest approaches of random pairs."""

import ctypes
import sys
import time

import numpy as np
from random_pairs import groups

from closeform.conflicts.entries import approaches_of_pairs, conflicts_of_pairs
from closeform.conflicts.tracks import NO_TRACKS

lib = ctypes.CDLL(sys.argv[1] if len(sys.argv) > 1 else "build/libcff_libm.so")
NUMBER, SIZE = int(sys.argv[2]) if len(sys.argv) > 2 else 80, int(sys.argv[3]) if len(sys.argv) > 3 else 250
SEED = int(sys.argv[4]) if len(sys.argv) > 4 else 1
P = ctypes.c_void_p
I64 = ctypes.c_int64


def ptr(a):
    return a.ctypes.data_as(P)


def main():
    pairs = conflicts = in_conflict = 0
    worst = dict(start=0.0, end=0.0, least_time=0.0, ratio=0.0, near_time=0.0, near_ratio=0.0)
    bitwise = bitwise_near = 0
    count_differs = []
    evaluations_all, evaluations_least, evaluations_near, statuses = [], [], [], []
    spent = dict(py=0.0, c=0.0, py_near=0.0, c_near=0.0, c_only=0.0)
    times_of = []
    for orbit, one, other, zone, label in groups(SEED, NUMBER, SIZE):
        a, ao = np.ascontiguousarray(one.arcs), np.ascontiguousarray(one.offsets, dtype=np.int64)
        b, bo = np.ascontiguousarray(other.arcs), np.ascontiguousarray(other.offsets, dtype=np.int64)
        count = len(ao) - 1
        which = np.arange(count)
        rows, done = np.empty((64 * count, 5)), np.zeros(2, dtype=np.int64)
        conflicts_of_pairs(a, ao, b, bo, which[:1], which[:1], 0, zone.form, *NO_TRACKS, rows, done)
        t0 = time.perf_counter()
        total = conflicts_of_pairs(a, ao, b, bo, which, which, 0, zone.form, *NO_TRACKS, rows, done)
        spent["py"] += time.perf_counter() - t0
        assert done[0] == count
        rows = rows[:total].copy()
        shape, matrix, _ = zone.form
        matrix = np.ascontiguousarray(matrix)
        mine, evaluations, status = np.empty((64 * count, 5)), np.zeros((count, 2), dtype=np.int64), np.zeros(count, dtype=np.int64)

        def search(nearest):
            lib.bridge_conflicts.restype = I64
            return lib.bridge_conflicts(ptr(a), ptr(ao), ptr(b), ptr(bo), I64(count), I64(shape), ptr(matrix),
                                        ctypes.c_uint32(1_000_000), ptr(mine), I64(len(mine)), ptr(evaluations), ptr(status),
                                        I64(nearest))

        t0 = time.perf_counter()
        search(0)
        spent["c_only"] += time.perf_counter() - t0
        t0 = time.perf_counter()
        found = search(1)
        t1 = time.perf_counter() - t0
        spent["c"] += t1
        got = mine[:found]
        assert (status == 0).all(), (label, np.unique(status))
        pairs += count
        conflicts += total
        in_conflict += len(np.unique(rows[:, 0]))
        theirs_count, mine_count = np.bincount(rows[:, 0].astype(int), minlength=count), np.bincount(got[:, 0].astype(int), minlength=count)
        different = np.nonzero(theirs_count != mine_count)[0]
        count_differs += [(label, int(p), int(theirs_count[p]), int(mine_count[p])) for p in different]
        same = ~np.isin(rows[:, 0], different), ~np.isin(got[:, 0], different)
        x, y = rows[same[0]], got[same[1]]
        if len(x):
            d = np.abs(x - y)
            for k, name in ((1, "start"), (2, "end"), (3, "least_time"), (4, "ratio")):
                worst[name] = max(worst[name], d[:, k].max())
            bitwise += int((d[:, 1:] == 0.0).all(axis=1).sum())
        evaluations_all.append(evaluations[:, 0].copy())
        evaluations_least.append(evaluations[:, 1].copy())
        # closest approach
        out, near, nl, ns = np.empty((count, 2)), np.empty((count, 2)), np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
        t0 = time.perf_counter()
        approaches_of_pairs(a, ao, b, bo, which, which, zone.form, out)
        spent["py_near"] += time.perf_counter() - t0
        t0 = time.perf_counter()
        lib.bridge_approaches(ptr(a), ptr(ao), ptr(b), ptr(bo), I64(count), I64(shape), ptr(matrix), ctypes.c_uint32(1_000_000), ptr(near), ptr(nl), ptr(ns))
        spent["c_near"] += time.perf_counter() - t0
        assert (ns == 0).all()
        worst["near_ratio"] = max(worst["near_ratio"], (np.abs(out[:, 1] - near[:, 1]) / np.maximum(out[:, 1], 1e-3)).max())
        dt = np.abs(out[:, 0] - near[:, 0])
        worst["near_time"] = max(worst["near_time"], dt.max())
        times_of.append(dt)
        bitwise_near += int(((out == near).all(axis=1)).sum())
        evaluations_near.append(nl)
    evaluations = np.concatenate(evaluations_all)
    near = np.concatenate(evaluations_near)
    dt = np.concatenate(times_of)
    print(f"{pairs} pairs, {in_conflict} in conflict, {conflicts} conflicts; counts differ in {len(count_differs)}: {count_differs[:5]}")
    print("worst differences:", {k: float(f"{v:.3g}") for k, v in worst.items()})
    print(f"conflicts equal bit for bit: {bitwise} of {conflicts}; closest approaches: {bitwise_near} of {pairs}; "
          f"times beyond 1e-6 s: {(dt > 1e-6).sum()}")
    for name, v in (("evaluations for all conflicts", evaluations), ("evaluations for a closest approach", near), ("for least norms of conflicts", np.concatenate(evaluations_least))):
        print(f"{name}: mean {v.mean():.1f}, median {np.median(v):.0f}, 99 % {np.percentile(v, 99):.0f}, 99.9 % {np.percentile(v, 99.9):.0f}, most {v.max()}")
    print("us per pair:", {k: round(1e6 * v / pairs, 2) for k, v in spent.items()})


main()
