"""Limits of the duration of a motion, and the reason why a duration is refused."""

import numpy as np

from closeform.arrays import Floats

# No manoeuvre is that short. If far shorter, the square of the thrust that crosses a formation overflows, and
# a conflict between two such instants is never found.
SHORTEST = 1e-12  # [s]
# With ten times as many, work orbit by orbit (delta-v, conflicts) takes minutes and cannot be interrupted.
# With far more, the phase of an orbit has no significant digits.
MOST_ORBITS = 1e6
MOST_TURNS = 100.0  # orbits of minimum delta-v: the number of maxima of |p|, and so the work, grows with them
LONGER = 1e6  # limit of `far_beyond` as a multiple of a move; a search that doubles the duration ends before


def far_beyond(duration: float, mean_motion: float) -> float:
    """Return the longest duration [s] to search when a move of `duration` is lengthened: a million times it.

    The result stays below the longest duration that is supported at `mean_motion` [rad/s].
    """
    turn = 2 * np.pi / mean_motion if mean_motion > 0.0 else np.inf
    return float(max(duration, min(LONGER * duration, (1.0 - 1e-9) * MOST_ORBITS * turn)))


def flaw(durations: Floats, mean_motion: float) -> str | None:
    """Return why some of the `durations` [s] are not supported at `mean_motion` [rad/s], or None."""
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
