"""Lambert's problem of relative motion: which start velocity drifts from place to place in a given time.

With Phi the transition matrix, r1 = Phi_rr r0 + Phi_rv v.  Phi_rv is singular where a start velocity
changes nothing at the end: across the track after every half orbit, radially after every orbit, and
at 1.407, 2.445 ... orbits, where tan(n t / 2) = 3 n t / 8.  There some places cannot be reached, and those
that can be are by many velocities.
"""

import numpy as np

from closeform.arrays import Floats

# Of duration times speed: the velocity along a direction that moves the end by less than this is
# taken as free.  Larger: transfers close to such a time no longer end where they should, as paths
# promise to 1e-9.  Smaller: the rounding of positions, divided by it, shows in the velocities.
SINGULAR = 1e-9


def start_velocities(flow: Floats, durations: Floats, initial: Floats, final: Floats) -> Floats:
    """Start velocities (P, 3) from whose `initial` places (P, 6) craft drift to `final` places (P, 6).

    Of those that come nearest the one for which the velocity jumps at both ends have the least sum
    of squares.  `flow` (P, 6, 6) are the transition matrices over `durations` (P,).
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
