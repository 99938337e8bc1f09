"""Table of a chief for the flight library: `cff_table_t` in C and as bytes.

The library reads the rows of position and velocity, the steps of states (those of costates are the same), the
returns of passive safety, and the bounds of errors of `motion.chief.table.Table`.
"""

import ctypes
from typing import Any

import numpy as np

from closeform.motion.chief.table import COSTATE


class FlightTable(ctypes.Structure):
    """A `cff_table_t` of closeform_flight.h; `kept` holds its arrays."""

    _fields_ = [
        ("rate_rad_s", ctypes.c_double),
        ("eccentricity", ctypes.c_double),
        ("phase_rad", ctypes.c_double),
        ("turn_rad", ctypes.c_double),
        ("windows", ctypes.c_uint32),
        ("joints_rad", ctypes.c_void_p),
        ("rows", ctypes.c_void_p),
        ("steps", ctypes.c_void_p),
        ("errors", ctypes.c_void_p),
        ("returns", ctypes.c_void_p),
        ("return_errors", ctypes.c_void_p),
    ]
    kept: list[Any]


def arrays_of(chief: Any) -> tuple[Any, float, int, list[Any]]:
    """Return the clock (3,), turn, number of windows and arrays of a chief, in the order of `cff_table_t`."""
    table = chief.table
    steps = table.steps[:, :COSTATE]
    arrays = (table.joints, table.rows, steps, table.errors, table.returns, table.return_errors)
    contiguous = [np.ascontiguousarray(array, dtype="<f8") for array in arrays]
    return table.clock, float(table.turn), len(table.rows), contiguous


def packed(chief: Any) -> FlightTable:
    """Return the table of a chief (`orbit.chief`) for calls of the library."""
    clock, turn, windows, arrays = arrays_of(chief)
    table = FlightTable(*map(float, clock), turn, windows, *(array.ctypes.data for array in arrays))
    table.kept = arrays
    return table


def table_bytes(chief: Any) -> bytes:
    """Return the table of a chief for upload: little-endian doubles, in the order of `cff_table_t`.

    Rate, eccentricity, phase, turn and the number of windows come first, then the arrays.
    """
    clock, turn, windows, arrays = arrays_of(chief)
    head = np.array([*clock, turn, windows], dtype="<f8")
    return b"".join([head.tobytes(), *(array.tobytes() for array in arrays)])
