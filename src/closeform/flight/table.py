"""Table of a chief for the flight core: `cff_table_t` in C, and as bytes for upload.

The core reads the rows of position and velocity, the steps of states (those of costates are the same), the
returns of passive safety, and the bounds of errors of `motion.chief.table.Table`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from closeform.arrays import instance
from closeform.flight.library import check, core, pointing
from closeform.motion.chief.table import COSTATE
from closeform.motion.chief_orbit import ChiefOrbit


def arrays_of(chief: Any) -> tuple[list[Any], list[Any]]:
    """Return rate, eccentricity, phase, turn and number of windows of a chief's table, and its arrays.

    Both are in the order of `cff_table_t`.
    """
    table = chief.table
    numbers = [*map(float, table.clock), float(table.turn), len(table.rows)]
    states = table.steps[:, :COSTATE]
    return numbers, [table.joints, table.rows, states, table.errors, table.returns, table.return_errors]


def chief_of(orbit: Any, span: float = 0.0) -> Any:
    """Return the `cff_table_t *` of an orbit.

    For a circular orbit and deep space it is NULL, which selects Hill's equations. With a span [s] of
    motion above 0 it is the table that the flight core makes for that motion.
    """
    types, functions = core()
    chief = getattr(orbit, "chief", None)
    if chief is None and span > 0.0:
        window = min(span, 0.78 / orbit.mean_motion) if orbit.mean_motion > 0.0 else span
        room, table = types.new("cff_circle_t *"), types.new("cff_table_t *")
        check(functions.cff_circular_table(orbit.mean_motion, window, room, table))
        return pointing(table, room)
    if chief is None:
        return types.NULL
    block, table = types.from_buffer("double[]", table_bytes(orbit)), types.new("cff_table_t *")
    check(functions.cff_uploaded_table(block, len(block), table))
    return pointing(table, block)


def table_bytes(orbit: ChiefOrbit) -> bytes:
    """Return the table of an eccentric or J2-perturbed orbit, for upload.

    Parameters
    ----------
    orbit : ChiefOrbit
        Orbit that is not circular.

    Returns
    -------
    bytes
        Little-endian doubles: rate, eccentricity, phase, turn and the number of windows, then the arrays of
        `cff_table_t` in order.

    Raises
    ------
    ValueError
        If the orbit is circular or deep space, which need no table.

    References
    ----------
    docs/on_board.md, upload.
    """
    numbers, arrays = arrays_of(instance("orbit", orbit, ChiefOrbit).chief)
    return b"".join(np.asarray(part, dtype="<f8").tobytes() for part in (numbers, *arrays))
