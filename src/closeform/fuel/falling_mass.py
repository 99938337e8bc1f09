"""Start and end times of pulses of constant force for a mass that falls as propellant is used.

All thrusters use one tank, so the duration of a pulse depends on the pulses of others.  The mass is
linear in time between all starts and ends, and the integrals of 1/m and t/m have closed forms.
"""

import numpy as np

from closeform.arrays import Floats
from closeform.fuel.chunks import Chunks

STANDARD_GRAVITY = 9.80665
"""Standard acceleration of free fall [m/s^2], which defines specific impulse as a time (CGPM 1901)."""

ROUNDS, FINE = 60, 1e-9
SERIES = 1e-3  # of the share of mass used between two events


def fired_within(chunks: Chunks, force: Floats, mass: float, exhaust: float) -> tuple[Floats, Floats, Floats]:
    """Return starts and ends (K,) [s] of pulses of `force` (K,) [N], and the mass [kg] at both (2, K).

    Each pulse gives its chunk's delta-v about its chunk's centroid, to a spacecraft of `mass` [kg] at the
    start with an `exhaust` speed [m/s], inf if no mass is lost.
    """
    width = chunks.impulse * mass / force
    begin, end = chunks.centroid - 0.5 * width, chunks.centroid + 0.5 * width
    if not (np.isfinite(exhaust) and len(width)):
        return begin, end, np.full((2, len(width)), mass)
    wrong, scale = np.inf, np.abs([begin.min(), end.max()]).max()
    for _ in range(ROUNDS):
        events = np.unique(np.concatenate([begin, end]))
        first, last = np.searchsorted(events, begin), np.searchsorted(events, end)
        flow = np.zeros(len(events))
        np.add.at(flow, first, force / exhaust)
        np.add.at(flow, last, -force / exhaust)
        steps = np.diff(events)
        burned = np.maximum(np.cumsum(flow)[:-1], 0.0) * steps
        masses = mass - np.concatenate([[0.0], np.cumsum(burned)])
        if masses[-1] <= 0.0:  # the first estimate ignores the lower mass
            masses = mass * np.exp(-(mass - masses) / mass)
        share = burned / masses[:-1]
        zeroth, moment = _integrals(share)
        zeroth, moment = zeroth * steps / masses[:-1], moment * steps**2 / masses[:-1]
        middle = 0.5 * (begin + end)
        whole = np.concatenate([[0.0], np.cumsum(zeroth)])
        gained = force * (whole[last] - whole[first])
        about = np.concatenate([[0.0], np.cumsum(moment + zeroth * (events[:-1] - events[0]))])
        centre = events[0] + force * (about[last] - about[first]) / gained
        width = (end - begin) * chunks.impulse / gained
        off = np.clip(chunks.centroid - centre, -0.25 * width, 0.25 * width)  # rounding for short pulses
        begin, end = middle + off - 0.5 * width, middle + off + 0.5 * width
        missed = np.maximum(np.abs(gained - chunks.impulse), chunks.impulse * np.abs(off) / scale).max()
        before, wrong = wrong, missed / chunks.impulse.max()
        if 0.5 * before < wrong < FINE:  # the remainder is rounding
            break
    return begin, end, np.stack([masses[first], masses[last]])


def _integrals(share: Floats) -> tuple[Floats, Floats]:
    """Return the integrals over s in [0, 1] of 1 / (1 - share s) and of s / (1 - share s)."""
    near = share < SERIES
    x = np.where(near, 0.5, share)
    log = -np.log1p(-x)
    zeroth = 1.0 + share / 2.0 + share**2 / 3.0 + share**3 / 4.0 + share**4 / 5.0
    moment = 0.5 + share / 3.0 + share**2 / 4.0 + share**3 / 5.0 + share**4 / 6.0
    return np.where(near, zeroth, log / x), np.where(near, moment, (log - x) / x**2)
