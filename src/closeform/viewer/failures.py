"""Failures of thrust with the closest approaches, and the drifts that follow them."""

from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np

from closeform.arrays import Floats
from closeform.mission.mission_result import StageResult
from closeform.motion.arc import IMPULSE, START
from closeform.motion.path import Path
from closeform.safety.failures import ThrustLost
from closeform.viewer.numbers import Numbers
from closeform.viewer.shown import Shown
from closeform.viewer.tracks import track

if TYPE_CHECKING:
    from closeform.mission.passive_safety import PairDrift

Record = dict[str, Any]
DRAWN, LISTED = 12, 100  # the closest failures of a stage: with a track, and listed
BEYOND = 0.5  # orbits of drift shown after the closest approach
SHARES = np.linspace(0.0, 1.0, 1025)  # shares of an impulse given before loss of thrust


def failures(shown: Shown, numbers: Numbers, drawn: list[Record], error: float) -> list[Record]:
    """Return every `Failure` of web/scene.d.ts; add their drifts to the tracks `drawn`."""
    found = []
    for result in shown.results:
        if result.passive is None:
            continue
        coasts: dict[int, int] = {}  # track after the stage of each craft that is approached
        lost = isinstance(result.passive.failure, ThrustLost)
        for row, pair in enumerate(result.passive.pairs[:LISTED]):
            names = result.after.names
            fails, meets = names.index(pair.fails), names.index(pair.meets)
            record = {
                "fails": fails,
                "meets": meets,
                "stage": result.number,
                "failed_at": known(pair.failed_at),
                "time": known(pair.time),
                "ratio": pair.ratio,
                "distance": pair.distance if isfinite(pair.distance) else None,
                "safe": pair.safe,
                "track": -1,
                "met_track": -1,
            }
            if lost and row < DRAWN and isfinite(pair.failed_at):
                path = drift(result, pair)
                record["track"] = len(drawn)
                drawn.append(track(numbers, path, fails, result.number, "drift", error))
                if path.end > result.end:
                    if meets not in coasts:
                        coasts[meets] = len(drawn)
                        coast = onward(result, meets, last_shown(result))
                        drawn.append(track(numbers, coast, meets, result.number, "drift", error))
                    record["met_track"] = coasts[meets]
            found.append(record)
    return found


def known(value: float) -> float | None:
    """Return a finite value, or None."""
    return value if isfinite(value) else None


def drift(result: StageResult[Any, Any], pair: "PairDrift") -> Path:
    """Return the worst drift of a pair until half an orbit after its closest approach.

    It ends no later than the passive-safety horizon.
    """
    state = lost_state(result, pair)
    orbit = result.after.paths.orbit
    end = shown_until(result, pair)
    return orbit.coast(state, end - pair.failed_at, pair.failed_at)


def shown_until(result: StageResult[Any, Any], pair: "PairDrift") -> float:
    """Return the end [s] of the shown drift of a pair."""
    assert result.passive is not None
    period = result.after.paths.orbit.period
    nearest = pair.time if isfinite(pair.time) else result.end
    beyond = BEYOND * period if isfinite(period) else 0.5 * (result.end - result.start)
    return float(min(result.passive.until, max(nearest, pair.failed_at) + beyond))


def last_shown(result: StageResult[Any, Any]) -> float:
    """Return the end [s] of the last shown drift of a stage."""
    assert result.passive is not None
    some = [pair for pair in result.passive.pairs[:DRAWN] if isfinite(pair.failed_at)]
    return max(shown_until(result, pair) for pair in some)


def onward(result: StageResult[Any, Any], craft: int, until: float) -> Path:
    """Return the path on which a craft coasts after the stage."""
    path = result.after.paths[craft]
    return path.orbit.coast(path.state(path.end), until - path.end, path.end)


def lost_state(result: StageResult[Any, Any], pair: "PairDrift") -> Floats:
    """Return the state (6,) at loss of thrust; during an impulse, after the worst fraction of it."""
    path = result.after.path(pair.fails)
    state = path.state(min(pair.failed_at, path.end))
    at: Any = np.flatnonzero(path.arcs[:, START] == pair.failed_at)
    kick = path.arcs[at, IMPULSE : IMPULSE + 3].sum(axis=0) if len(at) else np.zeros(3)
    if not kick.any() or not isfinite(pair.time):
        return state
    given = np.concatenate([np.zeros((len(SHARES), 3)), (SHARES - 1.0)[:, None] * kick], axis=1)
    later = path.orbit.transition(pair.time - pair.failed_at, pair.failed_at)
    met = result.after.path(pair.meets)
    other = met.state(min(pair.time, met.end))
    if pair.time > met.end:
        other = path.orbit.transition(pair.time - met.end, met.end) @ other
    gaps = ((state + given) @ later.T - other)[:, :3]
    return np.asarray(state + given[np.argmin(np.abs(pair.zone.norm(gaps) - pair.ratio))])
