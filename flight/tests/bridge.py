"""The library through ctypes, for the comparisons with the Python package: batches of bridge.c."""

import ctypes
import os
from pathlib import Path

import numpy as np

from closeform.flight.table import packed

FOLDER = Path(__file__).parent.parent
P, I64, U32 = ctypes.c_void_p, ctypes.c_int64, ctypes.c_uint32
BUDGET = 1_000_000


def library(name="own"):
    return ctypes.CDLL(os.environ.get("CFF_LIBRARY", FOLDER / f"build/libcff_{name}.so"))


def ptr(a):
    return a.ctypes.data_as(P)


def flat(path):
    return np.ascontiguousarray(path.arcs), np.ascontiguousarray(path.offsets, dtype=np.int64)


def packed_of(orbit):
    chief = getattr(orbit, "chief", None)
    return None if chief is None else packed(chief)


def conflicts(lib, one, other, zone, budget=BUDGET, nearest=False):
    """Return rows (pair, start, end, time, ratio), evaluations (P, 2) and statuses (P,)."""
    (a, ao), (b, bo), count = flat(one), flat(other), len(one.offsets) - 1
    rows, used, status = np.empty((64 * count, 5)), np.zeros((count, 2), np.int64), np.zeros(count, np.int64)
    chief = packed_of(one.orbit)
    matrix = np.ascontiguousarray(zone.form[1])
    lib.bridge_conflicts.restype = I64
    found = lib.bridge_conflicts(
        ptr(a),
        ptr(ao),
        ptr(b),
        ptr(bo),
        I64(count),
        I64(zone.form[0]),
        ptr(matrix),
        U32(budget),
        ptr(rows),
        I64(len(rows)),
        ptr(used),
        ptr(status),
        I64(nearest),
        chief and ctypes.byref(chief),
    )
    return rows[:found], used, status


def approaches(lib, one, other, zone, budget=BUDGET):
    """Return (time, ratio) of each pair, evaluations and statuses."""
    (a, ao), (b, bo), count = flat(one), flat(other), len(one.offsets) - 1
    out, used, status = np.empty((count, 2)), np.zeros(count, np.int64), np.zeros(count, np.int64)
    chief = packed_of(one.orbit)
    matrix = np.ascontiguousarray(zone.form[1])
    lib.bridge_approaches(
        ptr(a),
        ptr(ao),
        ptr(b),
        ptr(bo),
        I64(count),
        I64(zone.form[0]),
        ptr(matrix),
        U32(budget),
        ptr(out),
        ptr(used),
        ptr(status),
        chief and ctypes.byref(chief),
    )
    return out, used, status
