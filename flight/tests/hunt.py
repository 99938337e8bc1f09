"""Hunts for pairs that take the most evaluations: many at random, then the worst of them perturbed again and again."""

import ctypes

import numpy as np

import closeform as cf

lib = ctypes.CDLL("../build/libcff_own.so")
P, I64, U32 = ctypes.c_void_p, ctypes.c_int64, ctypes.c_uint32
N = 1.1086e-3
PERIOD = 2 * np.pi / N
CIRCLE = np.array([0.5, 0.0, np.sqrt(3) / 2, 0.0, -N, 0.0])  # constant distance 1


def ptr(a):
    return a.ctypes.data_as(P)


def evaluations_of(one, other, zone, closest):
    a, ao = np.ascontiguousarray(one.arcs), np.ascontiguousarray(one.offsets, dtype=np.int64)
    b, bo = np.ascontiguousarray(other.arcs), np.ascontiguousarray(other.offsets, dtype=np.int64)
    count = len(ao) - 1
    shape, matrix, _ = zone.form
    matrix = np.ascontiguousarray(matrix)
    evaluations, status = np.zeros((count, 2), dtype=np.int64), np.zeros(count, dtype=np.int64)
    if closest:
        near, flat = np.empty((count, 2)), np.zeros(count, dtype=np.int64)
        lib.bridge_approaches(ptr(a), ptr(ao), ptr(b), ptr(bo), I64(count), I64(shape), ptr(matrix), U32(4_000_000), ptr(near), ptr(flat), ptr(status))
        return flat
    rows = np.empty((64 * count, 5))
    lib.bridge_conflicts.restype = I64
    lib.bridge_conflicts(ptr(a), ptr(ao), ptr(b), ptr(bo), I64(count), I64(shape), ptr(matrix), U32(4_000_000), ptr(rows), I64(len(rows)), ptr(evaluations), ptr(status), I64(0))
    return evaluations[:, 0]


def make(kind, genes):
    """Paths of one orbit from genes (C, 12)."""
    orbit = cf.Orbit(N)
    begin = genes[:, :6] * np.array([1.0] * 3 + [N] * 3) * 10.0
    zero = np.zeros((len(genes), 6))
    if kind == "coast":
        return orbit.coast(begin, PERIOD), orbit.coast(zero, PERIOD), 3
    end = genes[:, 6:] * np.array([1.0] * 3 + [N] * 3) * 10.0
    return orbit.transfer(begin, end, PERIOD), orbit.coast(zero, PERIOD), 7


def main():
    rng = np.random.default_rng(9)
    for kind in ("coast", "transfer"):
        for zone, label in ((cf.Sphere(10.0), "sphere"), (cf.Ellipsoid([8.0, 10.0, 15.0]), "ellipsoid"), (cf.Box([8.0, 10.0, 12.0]), "box")):
            for closest in (False, True):
                size = 3000
                genes = rng.normal(size=(size, 12)) * 10.0 ** rng.uniform(-1, 1, (size, 1))
                genes[: size // 2, 4] = -2 * genes[: size // 2, 0]
                genes[: size // 3, :6] = CIRCLE / np.array([1, 1, 1, N, N, N]) * (1 + 10.0 ** rng.uniform(-14, -1, (size // 3, 1)))
                genes[: size // 3, 6:] = genes[: size // 3, :6]
                best = None
                for turn in range(40):
                    one, other, views = make(kind, genes)
                    evaluations = evaluations_of(one, other, zone, closest)
                    top = np.argsort(-evaluations)[:30]
                    if turn == 0:
                        first = evaluations.max(), np.percentile(evaluations, 99)
                    if best is None or evaluations[top[0]] > best:
                        best = evaluations[top[0]]
                    elite = genes[top].copy()
                    parents = genes[rng.choice(top, size)]
                    genes = parents * (1 + rng.choice([0.0, 1.0], (size, 12), p=[0.6, 0.4]) * rng.normal(size=(size, 12)) * 10.0 ** rng.uniform(-14, -0.5, (size, 1)))
                    genes[:30] = elite
                print(f"{kind:9s} {label:9s} {'closest' if closest else 'conflicts  '}: 99 % {first[1]:.0f}, most at random {first[0]}, most after the hunt {best} evaluations in one orbit = {best / views:.0f} a view")


main()
