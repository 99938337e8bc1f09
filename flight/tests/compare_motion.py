"""The C core against the package: energy-optimal transfers and states."""

import ctypes
import sys
import time

import numpy as np

import closeform as cf
from closeform.motion.arc import WIDTH
from closeform.motion.steering import steer

lib = ctypes.CDLL(sys.argv[1] if len(sys.argv) > 1 else "build/libcff_libm.so")
COUNT = 20_000
P, I64, D, U32 = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double, ctypes.c_uint32


def ptr(a):
    return a.ctypes.data_as(P)


def transfers():
    rng = np.random.default_rng(3)
    n = rng.choice([0.0, 1e-9, 1e-6, 7.292e-5, 1.1086e-3], COUNT)
    longest = np.where(n > 1e-5, 3 * 2 * np.pi / np.maximum(n, 1e-9), 2e4)
    duration = rng.uniform(1e-3, 1.0, COUNT) * longest
    start = rng.uniform(0.0, 1e3, COUNT)
    initial, final = rng.normal(size=(2, COUNT, 6)) * np.array([100.0] * 3 + [0.1] * 3)
    arcs, energy, status = np.zeros((COUNT, WIDTH)), np.zeros(COUNT), np.zeros(COUNT, dtype=np.int64)
    t0 = time.perf_counter()
    lib.bridge_transfers(
        None,
        I64(COUNT),
        ptr(n),
        ptr(start),
        ptr(duration),
        ptr(initial),
        ptr(final),
        ptr(arcs),
        ptr(energy),
        ptr(status),
    )
    mine = time.perf_counter() - t0
    assert (status == 0).all()
    worst = worst_energy = worst_end = 0.0
    bitwise = 0
    theirs_time = 0.0
    for value in np.unique(n):
        k = n == value
        theirs = np.zeros((k.sum(), WIDTH))
        theirs[:, 0], theirs[:, 1], theirs[:, 2], theirs[:, 6:12] = (
            start[k],
            start[k] + duration[k],
            value,
            initial[k],
        )
        t0 = time.perf_counter()
        steer(value, theirs, final[k].copy())
        theirs_time += time.perf_counter() - t0
        bitwise += int((theirs == arcs[k]).all(axis=1).sum())
        path = cf.Path(cf.Orbit(float(value)), theirs, np.arange(k.sum() + 1), (int(k.sum()),))
        size = np.abs(theirs[:, 12:15]).max(axis=1) + np.abs(theirs[:, 15:18]).max(axis=1) * duration[k]
        worst = max(worst, (np.abs(theirs - arcs[k])[:, 12:15].max(axis=1) / size).max())
        worst_energy = max(worst_energy, (np.abs(path.energy - energy[k]) / path.energy).max())
        ends = np.ascontiguousarray(theirs[:, 1])
        out = np.zeros((k.sum(), 6))
        lib.bridge_states(None, ptr(np.ascontiguousarray(arcs[k])), I64(k.sum()), ptr(ends), ptr(out))
        scale = np.abs(final[k]).max(axis=1) + np.abs(initial[k]).max(axis=1)
        worst_end = max(worst_end, (np.abs(out - final[k])[:, :3].max(axis=1) / scale).max())
    print(
        f"{COUNT} transfers: bit for bit {bitwise}; worst thrust {worst:.2g} of itself, "
        f"energy {worst_energy:.2g}, end position {worst_end:.2g} of the size; "
        f"us each: C {1e6 * mine / COUNT:.2f}, package {1e6 * theirs_time / COUNT:.2f}"
    )


transfers()
