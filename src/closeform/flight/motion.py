"""Motion by the flight core: coasts and transfers."""

from __future__ import annotations

import ctypes
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, finite, number
from closeform.flight.library import check, core, doubles, filled
from closeform.flight.table import packed
from closeform.motion.chief.kepler import KeplerChief
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path


class Chief(NamedTuple):
    """Pointer to the table of a chief, NULL beside a circular orbit, and what must live as long."""

    pointer: Any
    table: Any


def chief_of(orbit: Any, circular: bool = False) -> Chief:
    """Return the chief of an orbit as the flight core reads it; with `circular` also that of a circle."""
    types = core().types
    chief = getattr(orbit, "chief", None)
    if chief is None and circular and orbit.mean_motion > 0.0:
        chief = KeplerChief(orbit.mean_motion, 0.0, 0.0)
    if chief is None:
        return Chief(types.NULL, None)
    table = packed(chief)
    return Chief(types.cast("cff_table_t *", ctypes.addressof(table)), table)


def coast(orbit: Orbit, state: ArrayLike, duration: float, start: float = 0.0) -> Floats:
    """Return the state after natural motion, computed by the flight core.

    Parameters
    ----------
    orbit : Orbit
        Orbit of any kind.
    state : array_like of shape (6,) [m, m/s]
        State in the rotating frame.
    duration : float [s]
        Duration of the coast.
    start : float [s], default 0
        Start time, which matters beside an eccentric or J2-perturbed chief.

    Returns
    -------
    array of shape (6,) [m, m/s]
        State at the end, in the rotating frame.

    Raises
    ------
    RuntimeError
        If there is no C compiler or no cffi.
    ValueError
        If a number is not finite, or the flight core does not accept it.

    References
    ----------
    docs/on_board.md.
    """
    types, functions = core()
    later = types.new("cff_state_t *")
    given, times = (
        filled("cff_state_t *", finite("state", state, 6)),
        (number("start", start), number("duration", duration)),
    )
    chief = chief_of(orbit)
    if chief.table is None:
        check(functions.cff_coast(orbit.mean_motion, times[1], given, later))
    else:
        arc = types.new("cff_arc_t *")
        check(functions.cff_drift_beside(chief.pointer, *times, given, arc))
        path = types.new("cff_path_t *", (arc, 1, chief.pointer))
        check(functions.cff_state_at(path, arc.end_s, later))
    return doubles(later)


def transfer(orbit: Orbit, initial: ArrayLike, final: ArrayLike, duration: float, start: float = 0.0) -> Path:
    """Return the transfer of minimum control energy, computed by the flight core.

    Parameters
    ----------
    orbit : Orbit
        Orbit of any kind.
    initial, final : array_like of shape (6,) [m, m/s]
        States in the rotating frame.
    duration : float [s]
        Duration of the transfer.
    start : float [s], default 0
        Start time.

    Returns
    -------
    Path
        Path of one spacecraft, as `Orbit.transfer` returns it.

    Raises
    ------
    RuntimeError
        If there is no C compiler or no cffi.
    ValueError
        If a number is not finite, or no unique thrust leads there.

    References
    ----------
    docs/on_board.md; SP11 (Sauter and Palmer 2011) section 2.
    """
    types, functions = core()
    arc = types.new("cff_arc_t *")
    ends = [
        filled("cff_state_t *", finite(name, end, 6))
        for name, end in (("initial", initial), ("final", final))
    ]
    times = number("start", start), number("duration", duration)
    chief = chief_of(orbit)
    if chief.table is None:
        check(functions.cff_transfer(orbit.mean_motion, *times, *ends, arc))
    else:
        check(functions.cff_transfer_beside(chief.pointer, *times, *ends, arc))
    return Path(orbit, doubles(arc)[None], np.array([0, 1]), ())
