"""Estimate of the model error of Hill's equations around the Earth, where no field is given.

The error of an uncorrected mission grows with the reach of the spacecraft and the strength of the neglected
effects: oblateness, eccentricity and curvature.  Its growth with time depends on the kind of mission. The
numbers are quantiles of missions that tools/rule_of_thumb.py draws; see docs/theory.md (84).
"""

from math import log2
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.motion.elements.mean_motion import EARTH_J2, EARTH_RADIUS

MOVES, COASTS = "moves", "coasts"
TURNS = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
ECCENTRIC = 0.8  # of an eccentricity beside J2 (R / a)^2
# The error as a multiple of strength and reach, after these turns: of half, and of 95 %, of missions at most.
ONE = {
    MOVES: (
        (0.832, 3.17, 12.4, 8.93, 4.41, 5.61, 5.64, 5.64),
        (1.89, 9.02, 44.2, 29.7, 12.6, 19.1, 27.1, 27.1),
    ),
    COASTS: (
        (0.611, 1.81, 5.53, 10.7, 19.1, 43.9, 77.2, 176.0),
        (1.19, 5.2, 16.1, 33.3, 54.4, 120.0, 211.0, 539.0),
    ),
}
EIGHT = {
    MOVES: (
        (0.944, 5.08, 21.8, 8.64, 4.09, 5.74, 4.68, 4.68),
        (1.92, 9.86, 49.7, 19.6, 9.64, 12.6, 13.8, 13.8),
    ),
    COASTS: (
        (0.608, 1.82, 6.06, 12.2, 22.9, 44.6, 91.9, 197.0),
        (1.18, 3.53, 12.7, 24.6, 46.2, 89.1, 184.0, 403.0),
    ),
}
# Eccentricities that stand for an unknown one of 0 to 0.02: of half and 95 %, for one craft and eight.
UNKNOWN = (0.0017, 0.0066), (0.0015, 0.0083)


def model_error(
    reach: Any, turns: Any, semi_major_axis: float, eccentricity: float | None, craft: int, kind: str
) -> tuple[Floats, Floats]:
    """Return the largest deviation [m] of any spacecraft that half, and 95 %, of missions do not exceed.

    `reach`: the largest distance of a spacecraft from the chief [m], after some turns of an orbit.  `kind`:
    MOVES of a single transfer (checked for 0.1 to 8 turns), COASTS of anything else (checked for coasts of
    0.1 to 16 turns).  Checked for 1 to 16 spacecraft, 30 m to 2 km from the chief, 300 to 1000 km up, without
    drag.
    """
    many, turns = min(log2(craft) / 3.0, 1.0), np.maximum(turns, TURNS[0])
    longer = np.maximum(turns / TURNS[-1], 1.0)
    found = []
    for k in range(2):
        one, eight = (np.log(table[kind][k]) for table in (ONE, EIGHT))
        e = (1.0 - many) * UNKNOWN[0][k] + many * UNKNOWN[1][k] if eccentricity is None else eccentricity
        grown = np.exp(np.interp(np.log(turns), np.log(TURNS), (1.0 - many) * one + many * eight))
        found.append(longer * grown * reach * strength(reach, semi_major_axis, e))
    return found[0], found[1]


def strength(reach: Any, semi_major_axis: Any, eccentricity: Any) -> Any:
    """Return the size of the effects that Hill's equations neglect, relative to those that they contain."""
    oblateness = EARTH_J2 * (EARTH_RADIUS / semi_major_axis) ** 2
    return np.sqrt(oblateness**2 + (ECCENTRIC * eccentricity) ** 2 + (reach / semi_major_axis) ** 2)
