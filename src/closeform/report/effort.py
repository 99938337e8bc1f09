"""What paths cost: energy, delta-v, peak thrust, propellant."""

from collections.abc import Mapping
from dataclasses import replace
from math import isfinite
from typing import Any

import numpy as np

from closeform.mission_result import Mission, StageResult
from closeform.motion.path import Path
from closeform.report.table import Column, Table, record

ENERGY = Column("energy [m²/s³]", "energy_m2_s3", "{:#.6g}".format)
SPEED = Column("delta-v [m/s]", "delta_v_m_s", "{:#.6g}".format)
PUSH = Column("peak thrust [mm/s²]", "peak_thrust_m_s2", "{:#.6g}".format, 1e3)
FORCE = Column("peak thrust [N]", "peak_thrust_N", "{:#.6g}".format)
FUEL = Column("propellant [kg]", "propellant_kg", "{:.5f}".format)
COST = ENERGY, SPEED, PUSH, FORCE, FUEL
CRAFT = Column("craft", "craft"), Column("slot", "slot"), *COST


def in_grams(mission: Mission, column: Column) -> Column:
    """A column of propellant in the one unit that the whole mission is told in."""
    if not mission.grams or column.heading is None:
        return column
    return replace(column, heading=column.heading.replace("[kg]", "[g]"), form="{:.2f}".format, scale=1e3)


def spent(mission: Mission, result: StageResult[Any, Any], name: str, path: Path) -> tuple[Any, ...]:
    """A row of COST: of one craft on a path in this stage; None where not known."""
    k = mission.scenario.names.index(name)
    mass, burnt = mission.scenario.force_mass(name), mission.burnt(result.number, k, path.delta_v)
    force = None if mass is None else mass * path.peak_thrust
    return path.energy, path.delta_v, path.peak_thrust, force, burnt if isfinite(burnt) else None


def shown(mission: Mission) -> tuple[Column, ...]:
    """COST as it is shown: thrust in newtons where the file speaks of them, propellant where it is known."""
    hide = {PUSH if mission.scenario.newtons else FORCE}
    hide |= set() if np.isfinite(mission.propellant).any() else {FUEL}
    columns = (replace(column, heading=None) if column in hide else column for column in COST)
    return tuple(in_grams(mission, column) if column.key == FUEL.key else column for column in columns)


def figures(
    mission: Mission, result: StageResult[Any, Any], name: str, path: Path | None
) -> dict[str, Any] | None:
    """The same for `summary.json`; None where there is no path."""
    return None if path is None else record(COST, spent(mission, result, name, path))


def files(
    mission: Mission, result: StageResult[Any, Any], slots: Mapping[str, int] | None = None
) -> dict[str, Table]:
    """What every craft spends, and the slot that it took, counted from 1, if any."""
    rows = [
        (name, (slots or {}).get(name), *spent(mission, result, name, result.after.paths[k]))
        for k, name in enumerate(result.after.names)
    ]
    return {"craft": Table("", CRAFT, rows)}
