"""How many evaluations the worst pairs take: grazing, constant norms, sliding along faces, fast and slow; and in slices."""

import ctypes
import sys

import numpy as np

import closeform as cf
from closeform.conflicts.entries import conflicts_of_pairs
from closeform.conflicts.tracks import NO_TRACKS

lib = ctypes.CDLL(sys.argv[1] if len(sys.argv) > 1 else "../build/libcff_own.so")
P, I64, U32 = ctypes.c_void_p, ctypes.c_int64, ctypes.c_uint32
N = 1.1086e-3
PERIOD = 2 * np.pi / N


def ptr(a):
    return a.ctypes.data_as(P)


def run(one, other, zone, slices=1_000_000):
    a, ao = np.ascontiguousarray(one.arcs), np.ascontiguousarray(one.offsets, dtype=np.int64)
    b, bo = np.ascontiguousarray(other.arcs), np.ascontiguousarray(other.offsets, dtype=np.int64)
    count = len(ao) - 1
    shape, matrix, _ = zone.form
    rows = np.empty((64 * count, 5))
    evaluations, status = np.zeros((count, 2), dtype=np.int64), np.zeros(count, dtype=np.int64)
    lib.bridge_conflicts.restype = I64
    found = lib.bridge_conflicts(ptr(a), ptr(ao), ptr(b), ptr(bo), I64(count), I64(shape), ptr(np.ascontiguousarray(matrix)),
                                 U32(slices), ptr(rows), I64(len(rows)), ptr(evaluations), ptr(status), I64(0))
    near, nl, ns = np.empty((count, 2)), np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
    lib.bridge_approaches(ptr(a), ptr(ao), ptr(b), ptr(bo), I64(count), I64(shape), ptr(np.ascontiguousarray(matrix)), U32(1_000_000), ptr(near), ptr(nl), ptr(ns))
    theirs, done = np.empty((64 * count, 5)), np.zeros(2, dtype=np.int64)
    which = np.arange(count)
    total = conflicts_of_pairs(a, ao, b, bo, which, which, 0, zone.form, *NO_TRACKS, theirs, done)
    return rows[:found], theirs[:total], evaluations[:, 0], nl, status


def tell(name, one, other, zone, windows):
    rows, theirs, evaluations, nl, status = run(one, other, zone)
    same = len(rows) == len(theirs) and (rows[:, 0] == theirs[:, 0]).all()
    dt = np.abs(rows[:, 1:3] - theirs[:, 1:3]).max() if same and len(rows) else 0.0
    print(f"{name:46s} {len(evaluations):6d} pairs, conflicts {len(rows):6d}/{len(theirs):6d} time off {dt:.1g} status {np.unique(status)}; "
          f"evaluations most {evaluations.max():6d} = {evaluations.max() / windows:6.1f} a view; closest {nl.max():6d} = {nl.max() / windows:.1f}")


def main():
    rng = np.random.default_rng(5)
    orbit = cf.Orbit(N)
    gaps = np.concatenate([[0.0], 10.0 ** np.arange(-16.0, -1.0), -(10.0 ** np.arange(-16.0, -1.0))])
    # circular relative orbit: constant distance 100 m from the chief, sphere of 100 / (1 + gap)
    state = np.array([50.0, 0.0, np.sqrt(3) * 50.0, 0.0, -2 * N * 50.0, 0.0])
    for orbits in (1.0, 10.0):
        t = orbits * PERIOD
        views = np.ceil(t * N / 3.0)
        for gap in gaps:
            pass
        both = [(gap, run(orbit.coast(state * (1 + gap), t), orbit.coast(np.zeros(6), t), cf.Sphere(100.0))) for gap in gaps]
        worst = max(both, key=lambda one: one[1][2].max())
        near = max(both, key=lambda one: one[1][3].max())
        agree = sum(len(r[0]) == len(r[1]) for _, r in both)
        print(f"constant distance, coasting, {orbits:g} orbits: conflicts agree {agree} of {len(both)}; evaluations most {worst[1][2].max()} at gap {worst[0]:g} "
              f"= {worst[1][2].max() / views:.1f} a view; closest {near[1][3].max()} at gap {near[0]:g} = {near[1][3].max() / views:.1f}")
    # the same while both thrust alike (order 8): a constant distance under thrust
    push = np.array([1e-5, 2e-5, -1e-5])
    t = PERIOD
    views = np.ceil(t * N)
    both = [(gap, run(orbit.burn(state * (1 + gap), push, t), orbit.burn(np.zeros(6), push, t), cf.Sphere(100.0))) for gap in gaps]
    worst = max(both, key=lambda one: one[1][2].max())
    near = max(both, key=lambda one: one[1][3].max())
    agree = sum(len(r[0]) == len(r[1]) for _, r in both)
    print(f"constant distance, both burn, 1 orbit: conflicts agree {agree} of {len(both)}; evaluations most {worst[1][2].max()} at gap {worst[0]:g} = {worst[1][2].max() / views:.1f} a view; "
          f"closest {near[1][3].max()} at gap {near[0]:g} = {near[1][3].max() / views:.1f}")
    # nearly constant: perturbed circular orbits
    count = 4000
    states = state * (1 + rng.choice([-1, 1], (count, 1)) * 10.0 ** rng.uniform(-14, -2, (count, 1)))
    states += rng.normal(size=(count, 6)) * np.array([1.0] * 3 + [N] * 3) * 10.0 ** rng.uniform(-12, 0, (count, 1))
    tell("nearly constant distance, coasting, 1 orbit", orbit.coast(states, PERIOD), orbit.coast(np.zeros((count, 6)), PERIOD), cf.Sphere(100.0), 3)
    burns = orbit.burn(states, rng.normal(size=(count, 3)) * 1e-9, PERIOD)
    tell("nearly constant distance, weak burns, 1 orbit", burns, orbit.burn(np.zeros((count, 6)), push * 0 + 1e-9, PERIOD), cf.Sphere(100.0), 7)
    # grazing passes in deep space and in orbit, sphere and box: least norm 1 + gap
    for n in (0.0, N):
        space = cf.Orbit(n)
        gap = rng.choice([-1, 1], count) * 10.0 ** rng.uniform(-15, -1, count)
        for zone, label in ((cf.Sphere(10.0), "sphere"), (cf.Box([10.0] * 3), "box")):
            begin = np.zeros((count, 6))
            begin[:, 0] = 10.0 * (1 + gap)
            begin[:, 1] = -rng.uniform(10, 1000, count)
            begin[:, 4] = -begin[:, 1] / 300.0
            passing = space.transfer(begin, begin * np.array([1, -1, 1, 1, 1, 1]), 600.0)
            tell(f"grazing {label}, n {n:g}, both thrust", passing, space.transfer(np.zeros((count, 6)), np.zeros((count, 6)), 600.0), zone, 1)
    # sliding along a face: x constant at 1 + gap
    begin = np.zeros((count, 6))
    begin[:, 2] = 10.0 * (1 + rng.choice([-1, 1], count) * 10.0 ** rng.uniform(-15, -3, count))
    end = begin.copy()
    end[:, 1] = 5.0
    tell("sliding along a face of a box, transfer", cf.Orbit(0.0).transfer(begin, end, 600.0), cf.Orbit(0.0).coast(np.zeros((count, 6)), 600.0), cf.Box([10.0] * 3), 1)
    # fast and far: large coordinates, small zone
    begin = rng.normal(size=(count, 6)) * np.array([1e4] * 3 + [10.0] * 3)
    end = rng.normal(size=(count, 6)) * np.array([1e4] * 3 + [10.0] * 3)
    tell("far and fast transfers, small sphere", orbit.transfer(begin, end, PERIOD), orbit.transfer(end, begin, PERIOD), cf.Sphere(5.0), 7)
    tell("far and fast transfers, small box", orbit.transfer(begin, end, PERIOD), orbit.transfer(end, begin, PERIOD), cf.Box([5.0] * 3), 7)
    # a hundred orbits of natural motion
    begin = rng.normal(size=(500, 6)) * np.array([50.0] * 3 + [0.05] * 3)
    begin[:, 4] = -2 * N * begin[:, 0] * (1 + 1e-4 * rng.normal(size=500))
    tell("a hundred orbits, coasting", orbit.coast(begin, 100 * PERIOD), orbit.coast(np.zeros((500, 6)), 100 * PERIOD), cf.Ellipsoid([40.0, 60.0, 30.0]), np.ceil(200 * np.pi / 3))
    # in slices
    begin, end = rng.normal(size=(2, 2000, 6)) * np.array([30.0] * 3 + [0.05] * 3)
    one, other = orbit.transfer(begin, end, PERIOD), orbit.transfer(end, begin, PERIOD)
    for zone in (cf.Ellipsoid([10.0, 20.0, 15.0]), cf.Box([10.0, 20.0, 15.0])):
        for slices in (64, 128, 1_000_000):
            rows, theirs, evaluations, _, status = run(one, other, zone, slices)
            same = len(rows) == len(theirs) and (rows[:, 0] == theirs[:, 0]).all()
            print(f"in slices of {slices} evaluations: conflicts {len(rows)}/{len(theirs)}, worst time {np.abs(rows[:, 1:3] - theirs[:, 1:3]).max() if same else np.nan:.2g} s, "
                  f"evaluations mean {evaluations.mean():.1f} most {evaluations.max()}, status {np.unique(status)}")


main()
