"""Paths as the flight core reads them, and its coasts and transfers."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, finite, number
from closeform.flight.library import check, complete, core, doubles, filled, pointing
from closeform.flight.table import chief_of
from closeform.motion.arc import WIDTH
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path


def path_of(path: Path, chief: Any) -> Any:
    """Return the `cff_path_t *` of a path of one spacecraft about a chief."""
    if path.shape:
        raise ValueError(f"path: the flight core takes one spacecraft at a time, got shape {path.shape}")
    arcs = filled("cff_arc_t[]", path.arcs)
    return pointing(core().types.new("cff_path_t *", (arcs, len(path.arcs), chief)), arcs, chief)


def arcs_of(orbit: Orbit, arcs: Any, count: int) -> Path:
    """Return the path of the first arcs of the flight core."""
    rows = doubles(arcs).reshape(-1, WIDTH)[:count]
    return Path(orbit, rows, np.array([0, count]), ())


def coast(orbit: Orbit, state: ArrayLike, duration: float, start: float = 0.0) -> Floats:
    """Return the state after natural motion.

    Parameters
    ----------
    orbit : Orbit
        Orbit of any kind.
    state : array_like of shape (6,) [m, m/s]
        State in the rotating frame.
    duration : float [s]
        Duration of the coast.
    start : float [s], default 0
        Start time, which matters about an eccentric or J2-perturbed chief.

    Returns
    -------
    array of shape (6,) [m, m/s]
        State at the end, in the rotating frame.
    """
    types, functions = core()
    later, given = types.new("cff_state_t *"), filled("cff_state_t *", finite("state", state, 6))
    times = number("start", start), number("duration", duration)
    chief = chief_of(orbit)
    if chief:
        arc = types.new("cff_arc_t *")
        check(functions.cff_drift_beside(chief, *times, given, arc))
        path = types.new("cff_path_t *", (arc, 1, chief))
        check(functions.cff_state_at(path, arc.end_s, later))
    else:
        check(functions.cff_coast(orbit.mean_motion, times[1], given, later))
    return doubles(later)


def task_of(
    orbit: Orbit, initial: ArrayLike, final: ArrayLike, duration: float, start: float
) -> tuple[Any, float, float, Any, Any]:
    """Return chief, start, duration, initial and final state of a transfer as the flight core reads them."""
    first = filled("cff_state_t *", finite("initial", initial, 6))
    last = filled("cff_state_t *", finite("final", final, 6))
    return chief_of(orbit), number("start", start), number("duration", duration), first, last


def transfer(orbit: Orbit, initial: ArrayLike, final: ArrayLike, duration: float, start: float = 0.0) -> Path:
    """Return the transfer of minimum control energy (SP11 section 2).

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
    """
    types, functions = core()
    arc = types.new("cff_arc_t *")
    chief, *given = task_of(orbit, initial, final, duration, start)
    if chief:
        check(functions.cff_transfer_beside(chief, *given, arc))
    else:
        check(functions.cff_transfer(orbit.mean_motion, *given, arc))
    return arcs_of(orbit, arc, 1)


def planned_impulses(
    orbit: Orbit, initial: ArrayLike, final: ArrayLike, duration: float, start: float
) -> Any:
    """Return the finished `cff_impulses_t *` of a transfer."""
    types, functions = core()
    plan = types.new("cff_impulses_t *")
    chief, *given = task_of(orbit, initial, final, duration, start)
    check(functions.cff_impulses_begin(plan, chief, 0.0 if chief else orbit.mean_motion, *given))
    complete(lambda budget: functions.cff_impulses_continue(plan, budget))
    return plan


def impulsive(
    orbit: Orbit, initial: ArrayLike, final: ArrayLike, duration: float, start: float = 0.0
) -> Path:
    """Return the transfer of minimum delta-v by at most six impulses.

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
        Path of one spacecraft, as `Orbit.impulsive` returns it, within 1e-6 of the minimum.
    """
    plan = planned_impulses(orbit, initial, final, duration, start)
    return arcs_of(orbit, plan.arcs, plan.count)
