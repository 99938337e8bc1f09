"""Table of a chief for the flight core: `cff_table_t` in C, and as bytes for upload.

The core reads the rows of position and velocity, the steps of states (those of costates are the same), the
returns of passive safety, and the bounds of errors of `motion.chief.table.Table`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from closeform.flight.library import core, pointing
from closeform.motion.chief.kepler import KeplerChief
from closeform.motion.chief.table import COSTATE


def arrays_of(chief: Any) -> tuple[list[Any], list[Any]]:
    """Return rate, eccentricity, phase, turn and number of windows of a chief's table, and its arrays.

    Both are in the order of `cff_table_t`.
    """
    table = chief.table
    arrays = (
        table.joints,
        table.rows,
        table.steps[:, :COSTATE],
        table.errors,
        table.returns,
        table.return_errors,
    )
    numbers = [*map(float, table.clock), float(table.turn), len(table.rows)]
    return numbers, [np.ascontiguousarray(array, dtype="<f8") for array in arrays]


def chief_of(orbit: Any, circular: bool = False) -> Any:
    """Return the `cff_table_t *` of an orbit: NULL for a circle, unless `circular`, and in deep space."""
    types = core().types
    chief = getattr(orbit, "chief", None)
    if chief is None and circular and orbit.mean_motion > 0.0:
        chief = KeplerChief(orbit.mean_motion, 0.0, 0.0)
    if chief is None:
        return types.NULL
    numbers, arrays = arrays_of(chief)
    memory = [types.from_buffer("double[]", array) for array in arrays]
    return pointing(types.new("cff_table_t *", [*numbers, *memory]), memory)


def table_bytes(orbit: Any) -> bytes:
    """Return the table of an eccentric or J2-perturbed orbit for upload: little-endian doubles.

    Rate, eccentricity, phase, turn and the number of windows come first, then the arrays of `cff_table_t` in
    order; docs/on_board.md.
    """
    numbers, arrays = arrays_of(orbit.chief)
    return b"".join(np.asarray(part, dtype="<f8").tobytes() for part in (numbers, *arrays))
