"""End of a drift, and validation of paths that can fail before it."""

from typing import Any

import numpy as np

from closeform.arrays import Floats, instance, number
from closeform.motion.arc import END, IMPULSE
from closeform.motion.orbit import Orbit
from closeform.motion.path import FORGIVEN, Path
from closeform.safety.failures import DegradedThrust, MissedBurns, StuckOnThrust, ThrustLost

SOON = 100.0  # orbits of a drift without end that are searched directly
FAILURES = (ThrustLost, MissedBurns, DegradedThrust, StuckOnThrust)


def drift_end(until: float, orbit: Orbit) -> float:
    """Return the validated end of a drift in an orbit."""
    end = number("until", until)
    if np.isnan(end) or end == -np.inf:
        raise ValueError(f"until: expected a time in s, or inf, got {end:g}")
    if end == np.inf and orbit.mean_motion == 0.0:
        raise ValueError("until: inf requires an orbit; in deep space give a time")
    return end


def last_times(path: Path) -> Floats:
    """Return the end times of the spacecraft of a path (N,) [s]."""
    found: Floats = path.arcs[path.offsets[1:] - 1, END]
    return found


def forgiven(path: Path) -> Any:
    """Return the accepted rounding of the end of a drift, of the path's shape [s]."""
    return FORGIVEN * np.asarray(path.end - path.start)


def checked_end(name: str, path: Path, until: float, failure: Any) -> float:
    """Return the validated end of the drift of a path that can fail and ends before it."""
    end = drift_end(until, path.orbit)
    if last_times(path).max(initial=-np.inf) > end and (path.end > end + forgiven(path)).any():
        raise ValueError(
            f"until: {end:g} s is before the end of {name}, {last_times(path).max():g} s; give that or later"
        )
    known = (
        not isinstance(instance("failure", failure, *FAILURES), StuckOnThrust)
        or failure.acceleration is not None
    )
    if not known and path.arcs[:, IMPULSE : IMPULSE + 3].any():
        raise ValueError(f"failure: {name} has impulses, whose thrust is unknown; give an acceleration")
    return end


def soon_after(path: Path, other: Path) -> float:
    """Return the time up to which a drift without end is searched directly."""
    last = max(last_times(path).max(initial=0.0), np.max(other.start, initial=0.0))
    return float(last + SOON * path.orbit.period)
