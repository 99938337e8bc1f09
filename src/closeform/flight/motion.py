"""Motion by the flight core: coasts and transfers."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, finite, number
from closeform.flight.library import check, core, doubles, filled
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path


def coast(orbit: Orbit, state: ArrayLike, duration: float) -> Floats:
    """Return the state after natural motion, computed by the flight core.

    Parameters
    ----------
    orbit : Orbit
        Circular orbit, or deep space.
    state : array_like of shape (6,) [m, m/s]
        State in the rotating frame.
    duration : float [s]
        Duration, negative for an earlier state.

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
    later = core().types.new("cff_state_t *")
    given = filled("cff_state_t *", finite("state", state, 6))
    span = number("duration", duration)
    check(core().functions.cff_coast(orbit.mean_motion, span, given, later))
    return doubles(later)


def transfer(orbit: Orbit, initial: ArrayLike, final: ArrayLike, duration: float, start: float = 0.0) -> Path:
    """Return the transfer of minimum control energy, computed by the flight core.

    Parameters
    ----------
    orbit : Orbit
        Circular orbit, or deep space.
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
    arc = core().types.new("cff_arc_t *")
    ends = [
        filled("cff_state_t *", finite(name, end, 6))
        for name, end in (("initial", initial), ("final", final))
    ]
    times = number("start", start), number("duration", duration)
    check(core().functions.cff_transfer(orbit.mean_motion, *times, *ends, arc))
    return Path(orbit, doubles(arc)[None], np.array([0, 1]), ())
