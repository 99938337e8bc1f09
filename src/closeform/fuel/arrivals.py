"""Cost table of transfers: the arrival slot of lowest cost for each of many durations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, finite
from closeform.fuel.bound import delta_v_bound, least_delta_v
from closeform.motion.orbit import Orbit, circular_orbit
from closeform.result import Rows


@dataclass(frozen=True, eq=False, repr=False)
class TransferCostTable(Rows):
    """Lowest-cost slot for each of D durations.

    Attributes
    ----------
    final : array of shape (D, 6) [m, m/s]
        State on arrival in the chosen slot, in the rotating frame.
    duration : array of shape (D,) [s]
        Durations as given.
    slot : array of int of shape (D,)
        Index of the chosen slot.
    delta_v : array of shape (D,) [m/s]
        Delta-v of the transfer to it.
    lower : array of shape (D,) [m/s]
        Lower bound on the delta-v of any plan to any of the slots.
    examined : int
        Number of optimised transfers; bounds excluded the others.
    """

    _columns: ClassVar = {
        "duration": "duration_s",
        "slot": "slot",
        "delta_v": "delta_v_m_s",
        "lower": "lower_m_s",
        "final": "x_m y_m z_m vx_m_s vy_m_s vz_m_s",
    }

    final: Floats
    duration: Floats
    slot: Any
    delta_v: Floats
    lower: Floats
    examined: int


def transfer_cost_table(
    orbit: Orbit, initial: ArrayLike, slots: ArrayLike, duration: ArrayLike
) -> TransferCostTable:
    """Return the slot of minimum delta-v for each of many durations.

    Parameters
    ----------
    orbit : Orbit
        Orbit that defines the rotating frame.
    initial : array_like of shape (6,) [m, m/s]
        State at time 0, in the rotating frame.
    slots : array_like of shape (S, 6) [m, m/s]
        Natural motions on which the spacecraft may arrive, by their states at time 0 in the rotating
        frame, such as the phases of a relative orbit.
    duration : array_like of shape (D,) [s]
        Latest arrival times, at most 100 orbits.

    Returns
    -------
    TransferCostTable
        One slot for each duration.

    Raises
    ------
    ValueError
        If there is no slot, a duration is not positive or too long, shapes do not fit, or a number is not
        finite.

    Notes
    -----
    The slot with the lowest bound is optimised, and the primer that proves its cost bounds the cost of every
    other slot (theory 27: the required change is the slot less the initial state, in any duration), until no
    bound is below the lowest cost.  The first bounds are those of `delta_v_bound`.  The first impulse may be
    preceded by a coast, so that the cost never increases with the duration.

    References
    ----------
    docs/theory.md (27, 28).
    """
    motion, begin = circular_orbit("orbit", orbit), finite("initial", initial, 6)
    places, times = finite("slots", slots, 6), finite("duration", duration)
    if places.ndim != 2 or not len(places):
        raise ValueError(f"slots: expected shape (S, 6) for at least one slot, got {places.shape}")
    if begin.ndim != 1 or times.ndim != 1:
        raise ValueError(
            f"initial, duration: expected shapes (6,) and (D,), got {begin.shape} and {times.shape}"
        )
    finals = np.einsum("dij,sj->dsi", motion.transition(times), places)
    x, y, z, vx, vy, vz = (places - begin).T
    twice = 2.0 * motion.mean_motion
    gains = np.stack([vx - twice * y, vy + twice * x, vz, -x, -y, -z])  # theory (27)
    bounds = np.asarray(delta_v_bound(motion, begin, finals, times[:, None]))
    costs, lowers, examined = np.full(bounds.shape, np.inf), bounds.copy(), 0
    each = np.arange(len(times))
    while True:
        slot = bounds.argmin(axis=1)
        rows = np.flatnonzero(np.isinf(costs[each, slot]))
        if not len(rows):
            break
        columns = slot[rows]
        found = least_delta_v(motion, begin, finals[rows, columns], times[rows])
        proofs = found.primer.state(0.0) @ gains  # the primer bounds the cost of every slot
        lowers[rows] = np.maximum(lowers[rows], proofs)
        lowers[rows, columns] = found.lower
        costs[rows, columns] = found.upper
        bounds[rows] = np.where(np.isinf(costs[rows]), lowers[rows], costs[rows])
        examined += len(rows)
    return TransferCostTable(finals[each, slot], times, slot, costs[each, slot], lowers.min(axis=1), examined)
