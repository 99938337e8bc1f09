"""Burns of a stage: impulses, intervals of continuous thrust between coasts, and thruster pulses."""

from collections.abc import Callable, Iterator
from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from closeform.mission.mission_result import StageResult

COLUMNS = (
    *("craft", "start_s", "duration_s", "radial_m_s", "along_track_m_s", "cross_track_m_s", "size_m_s"),
    *("thruster", "propellant_kg"),
)
# (index of the craft, delta-v [m/s]) -> propellant [kg] in the stage.
Burnt = Callable[[int, float], float]


def burns_in(result: "StageResult[Any, Any]", burnt: Burnt) -> list[tuple[Any, ...]]:
    """Return rows of COLUMNS by start time, without negligible burns.

    Thrusters are numbered from 1.  The thruster of an impulse or of continuous thrust, and an unknown
    propellant mass, are None.
    """
    found = [row for k in range(len(result.after.names)) for row in _of_craft(result, k, burnt)]
    return sorted(found, key=lambda row: row[1])


def _of_craft(result: "StageResult[Any, Any]", k: int, burnt: Burnt) -> Iterator[tuple[Any, ...]]:
    """Yield the rows of the burns of craft k."""
    from closeform.fuel.burns import burns_of, burns_of_pulses

    pulsed, name, thruster = result.pulsed, result.after.names[k], None
    if pulsed is not None and name in pulsed.names:
        pulses, index = pulsed.firing.pulses, pulsed.names.index(name)
        burns = burns_of_pulses(pulses, index)
        thruster = (pulses.thruster[pulses.craft == index] + 1).tolist()
    else:
        burns = burns_of(result.burning[k])
    so_far = [burnt(k, spent) for spent in np.cumsum(burns.size).tolist()]
    is_listed = burns.telling | (thruster is not None)  # every thruster pulse is listed
    columns = burns.start, burns.duration, *burns.push.T, burns.size
    for row, values in enumerate(zip(*(column.tolist() for column in columns), strict=True)):
        if not is_listed[row]:
            continue
        fuel = so_far[row] - (so_far[row - 1] if row else 0.0)
        yield name, *values, thruster and thruster[row], fuel if isfinite(fuel) else None
