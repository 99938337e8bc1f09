"""What paths cost: energy, delta-v, peak thrust, propellant."""

from collections.abc import Mapping
from math import isfinite
from typing import Any

from closeform.mission_result import Mission, StageResult
from closeform.motion.path import Path
from closeform.report.table import Column, Table, record

EFFORT = (
    Column("energy [m²/s³]", "energy_m2_s3", "{:#.6g}".format),
    Column("delta-v [m/s]", "delta_v_m_s", "{:#.6g}".format),
    Column("peak thrust [mm/s²]", "peak_thrust_m_s2", "{:#.6g}".format, 1e3),
)
CRAFT = (Column("craft", "craft"), Column("slot", "slot"), *EFFORT, Column("propellant", "propellant_kg"))


def row(path: Path) -> tuple[float, float, float]:
    """A row of EFFORT: energy [m^2/s^3], delta-v [m/s] and peak thrust [m/s^2]."""
    return path.energy, path.delta_v, path.peak_thrust


def figures(path: Path | None) -> dict[str, Any] | None:
    """The same for `summary.json`; None where there is no path."""
    return None if path is None else record(EFFORT, row(path))


def files(
    mission: Mission, result: StageResult[Any, Any], slots: Mapping[str, int] | None = None
) -> dict[str, Table]:
    """What every craft spends, and the slot that it took, counted from 1, if any."""
    burnt = mission.propellant[result.number - 1].tolist()
    rows = [
        (name, (slots or {}).get(name), *row(result.after.paths[k]), mass if isfinite(mass) else None)
        for k, (name, mass) in enumerate(zip(result.after.names, burnt, strict=True))
    ]
    return {"craft": Table("", CRAFT, rows)}
