"""Lambert's problem of relative motion: the initial velocity that coasts from one position to another.

With Phi the transition matrix, r1 = Phi_rr r0 + Phi_rv v.  Phi_rv is singular where an initial velocity does
not change the final position: cross-track after every half orbit, radially after every orbit, and
at 1.407, 2.445 ... orbits, where tan(n t / 2) = 3 n t / 8.  At these times some positions cannot be reached,
and the others can be reached with many velocities.
"""

from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.motion.arc import END, IMPULSE, MEAN_MOTION, START, STATE, WIDTH
from closeform.motion.path import FORGIVEN, Path, path_of

# Fraction of duration times speed: a velocity direction that moves the end by less than this is taken as
# free. Larger: transfers close to such a time miss their end by more than the 1e-9 that paths promise.
# Smaller: the rounding of positions, divided by it, appears in the velocities.
SINGULAR = 1e-9


def start_velocities(flow: Floats, durations: Floats, initial: Floats, final: Floats) -> Floats:
    """Return velocities (P, 3) that coast from `initial` to `final` states (P, 6), by position.

    Of the velocities that end closest, the result minimises the sum of squares of the velocity jumps at both
    ends. `flow` (P, 6, 6) are the transition matrices over `durations` (P,).
    """
    left, sizes, right = np.linalg.svd(flow[:, :3, 3:])
    sure = sizes > SINGULAR * durations[:, None]
    gap = final[:, :3] - (flow[:, :3, :3] @ initial[:, :3, None])[..., 0]
    along = (left.transpose(0, 2, 1) @ gap[..., None])[..., 0]
    parts = np.divide(along, sizes, out=np.zeros_like(along), where=sure)
    speeds = (right.transpose(0, 2, 1) @ parts[..., None])[..., 0]
    for p in np.flatnonzero(~sure.all(axis=1)):
        free = right[p, ~sure[p]].T
        turn = flow[p, 3:, 3:]
        jumps = np.concatenate([free, turn @ free])
        first = initial[p, 3:] - speeds[p]
        last = final[p, 3:] - flow[p, 3:, :3] @ initial[p, :3] - turn @ speeds[p]
        speeds[p] += free @ np.linalg.lstsq(jumps, np.concatenate([first, last]), rcond=None)[0]
    return np.asarray(speeds)


def drifts(orbit: Any, arcs: Floats, finals: Floats) -> Path:
    """Return natural motion over `arcs` (..., 30) to final states (P, 6), with an impulse at either end."""
    rows = arcs.reshape(-1, WIDTH)
    begins, lengths = rows[:, STATE : STATE + 6].copy(), rows[:, END] - rows[:, START]
    speeds = start_velocities(orbit._flow(rows), lengths, begins, finals)
    rows[:, STATE + 3 : STATE + 6] = speeds
    rows[:, IMPULSE : IMPULSE + 3] = speeds - begins[:, 3:]
    drift = path_of(orbit, rows, np.arange(len(rows) + 1), (len(rows),))
    arrived = drift._evaluate_rows(rows[:, END : END + 1])[:, 0]
    _reached(orbit, arcs.shape[:-1], rows, arrived, finals)
    last = np.zeros_like(rows)
    last[:, [START, END]] = rows[:, [END]]
    last[:, MEAN_MOTION] = rows[:, MEAN_MOTION]
    last[:, STATE : STATE + 6] = finals
    last[:, IMPULSE : IMPULSE + 3] = finals[:, 3:] - arrived[:, 3:]
    both = np.stack([rows, last], axis=1).reshape(-1, WIDTH)
    return Path(orbit, both, 2 * np.arange(len(rows) + 1), arcs.shape[:-1])


def _reached(orbit: Any, shape: tuple[int, ...], rows: Floats, arrived: Floats, finals: Floats) -> None:
    """Raise ValueError if a spacecraft of a batch misses its final position."""
    if not len(rows):
        return
    lengths = rows[:, END] - rows[:, START]
    missed = np.linalg.norm(arrived[:, :3] - finals[:, :3], axis=1)
    places = np.abs(np.concatenate([rows[:, STATE : STATE + 3], finals[:, :3]], axis=1)).max(axis=1)
    drift = np.abs(rows[:, STATE + 3 : STATE + 6]).max(axis=1) * lengths
    k = int(np.argmax(missed - FORGIVEN * np.maximum(places, drift)))
    if missed[k] <= FORGIVEN * max(places[k], drift[k]):
        return
    craft = f"craft {', '.join(map(str, np.unravel_index(k, shape)))}: " if shape else ""
    apart = f"{lengths[k]:g} s ({lengths[k] / orbit.period:.6g} orbits) apart"
    within = np.where(np.abs(arrived[k, :3]) > FORGIVEN * places[k], arrived[k, :3], 0.0)
    place = ", ".join(f"{coordinate:.9g}" for coordinate in within)
    raise ValueError(
        f"final: {craft}two impulses {apart} miss the position by at least {missed[k]:.6g} m, at [{place}]; "
        "end there, or change the duration"
    )
