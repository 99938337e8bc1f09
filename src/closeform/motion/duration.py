"""How long a motion may last. What is shorter or longer is refused, with the reason."""

import numpy as np

from closeform.arrays import Floats

# Half as long: nothing in flight is that short.  Far shorter, and the square of the thrust that
# crosses a formation overflows, and a conflict between two such instants is never seen.
SHORTEST = 1e-12  # [s]
# Ten times as many: work turn by turn (delta-v, conflicts) takes minutes in which no key stops
# it.  Far more, and the phase of an orbit has no digits left.
MOST_ORBITS = 1e6
MOST_TURNS = 100.0  # orbits of least delta-v: maxima of |p| grow with them, and so does the work
LONGER = 1e6  # times a move, for which those that coast are looked at: sixteen doublings end before


def far_beyond(duration: float, mean_motion: float) -> float:
    """A duration [s] that no move of `duration` comes near, however it is lengthened: a million times it.

    But no longer than can be flown, at `mean_motion` [rad/s].
    """
    turn = 2 * np.pi / mean_motion if mean_motion > 0.0 else np.inf
    return float(max(duration, min(LONGER * duration, (1.0 - 1e-9) * MOST_ORBITS * turn)))


def flaw(durations: Floats, mean_motion: float) -> str | None:
    """Why some of the `durations` [s] cannot be flown at `mean_motion` [rad/s]; None if all can."""
    if durations.ndim:
        shortest, greatest = float(durations.min(initial=np.inf)), float(durations.max(initial=0.0))
    else:
        shortest = greatest = float(durations)
    if not shortest > 0.0:
        return f"must be positive, got {shortest:g} s"
    if shortest < SHORTEST:
        return f"must be at least {SHORTEST:g} s, got {shortest:g} s"
    if greatest * mean_motion > MOST_ORBITS * 2 * np.pi:
        return f"must be at most {MOST_ORBITS:g} orbits, got {greatest * mean_motion / (2 * np.pi):g}"
    return None
