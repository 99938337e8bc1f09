"""Paths through samples of a known motion, sampled as densely as a tolerance requires."""

from collections.abc import Callable

import numpy as np

from closeform.arrays import Floats, number
from closeform.motion.duration import flaw
from closeform.motion.elements.mean_motion import checked
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path

LEAST = 1e-6  # m: below, the rounding of integrated motion dominates
FIRST, MOST = 24, 200_000  # samples in an orbit, and of a path
# Between samples h apart arcs deviate by a polynomial that is largest in the middle and falls with h^4: the
# deviation seen at every other sample is 16 times that with all samples; a factor of 2 is for safety.
LEFT = 1.0 / 8.0


def followed(
    orbit: Orbit,
    states_at: Callable[[Floats], Floats],
    duration: float,
    start: float,
    within: float,
) -> Path:
    """Return the path through `states_at(times)`, (..., T, 6) [m, m/s], with an error up to `within` [m]."""
    length, begin = checked("duration", number("duration", duration)), number("start", start)
    if wrong := flaw(np.array([length]), orbit.mean_motion):
        raise ValueError(f"duration: {wrong}")
    allowed = checked("within", number("within", within))
    if not allowed >= LEAST:
        raise ValueError(f"within: must be at least {LEAST:g} m, got {allowed:g}")
    checked("start", begin)
    samples = max(4, int(np.ceil(FIRST * length / orbit.period)))
    while True:
        times = np.linspace(begin, begin + length, 2 * samples + 1)
        states = states_at(times)
        coarse = orbit.sampled(times[::2], states[..., ::2, :])
        off = np.linalg.norm(coarse.position(times[1::2]) - states[..., 1::2, :3], axis=-1).max(initial=0.0)
        if LEFT * off <= allowed:
            return orbit.sampled(times, states)
        samples *= 2
        if samples > MOST:
            raise ValueError(
                f"within: the error is {LEFT * off:.2g} m with {2 * MOST} samples, above {allowed:g} m; "
                "increase it, or shorten the duration"
            )
