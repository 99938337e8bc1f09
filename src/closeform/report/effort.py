"""What paths cost: energy, delta-v, peak thrust, propellant."""

from collections.abc import Container, Iterable, Mapping
from dataclasses import replace
from math import isfinite
from typing import Any, Protocol

import numpy as np

from closeform.mission.mission_result import Mission, StageResult
from closeform.motion.path import Path
from closeform.report.table import Column, Table, record

ENERGY = Column("energy [m²/s³]", "energy_m2_s3", "{:#.6g}".format)
SPEED = Column("delta-v [m/s]", "delta_v_m_s", "{:#.6g}".format)
PUSH = Column("peak thrust [mm/s²]", "peak_thrust_m_s2", "{:#.6g}".format, 1e3)
FORCE = Column("peak thrust [N]", "peak_thrust_N", "{:#.6g}".format)
FUEL = Column("propellant [kg]", "propellant_kg", "{:.5f}".format)
COST = ENERGY, SPEED, PUSH, FORCE, FUEL
OF_PLAN = {SPEED.key, PUSH.key, FORCE.key, FUEL.key}  # what pulses do not keep to
CRAFT = Column("craft", "craft"), Column("slot", "slot"), *COST

UNTOLD = 1e4  # times the least: greater shares are of next to nothing


def above(spent: float, least: float) -> float | None:
    """By what share of the least a path costs more; None where next to nothing is the least."""
    return spent / least - 1.0 if spent < UNTOLD * least else None


class Weighed(Protocol):
    """What propellant is told of."""

    @property
    def grams(self) -> bool:
        """Whether in grams."""


def in_grams(told: Weighed, column: Column) -> Column:
    """A column of propellant in the one unit that the whole mission is told in."""
    if not told.grams or column.heading is None:
        return column
    return replace(column, heading=column.heading.replace("[kg]", "[g]"), form="{:.2f}".format, scale=1e3)


def asked(mission: Mission, result: StageResult[Any, Any], name: str, path: Path) -> float:
    """Delta-v [m/s] of a craft's planned path: summed over its thrusters where the plan is made for them."""
    table = next(craft for craft in mission.scenario.craft_in(result.stage) if craft.name == name)
    thrusters = table.fired(1.0) if getattr(result.stage, "cost", None) == "delta-v" else None
    if thrusters is None or not result.flown:
        return float(path.delta_v)
    from closeform.fuel.chunks import cells_of  # whose kernels only thrusters need

    return float(cells_of(path, thrusters).impulse.sum())


def spent(mission: Mission, result: StageResult[Any, Any], name: str, path: Path) -> tuple[Any, ...]:
    """A row of COST: of one craft on a planned path in this stage; None where not known."""
    k = mission.scenario.names.index(name)
    speed = asked(mission, result, name, path)
    mass, burnt = mission.scenario.force_mass(name), mission.burnt(result.number, k, speed)
    force = None if mass is None else mass * mission.mass_left(result.number, k) * path.peak_thrust
    energy, fuel = (one if isfinite(one) else None for one in (path.energy, burnt))
    return energy, speed, path.peak_thrust, force, fuel


def columns(mission: Mission, paths: Iterable[Path]) -> tuple[Column, ...]:
    """COST as it is shown of some paths: thrust in newtons where the file speaks of them.

    Propellant where it is known, and of impulses neither their energy nor their thrust, which have no bounds.
    """
    hide = {PUSH.key if mission.scenario.newtons else FORCE.key}
    if not all(isfinite(path.energy) for path in paths):
        hide |= {ENERGY.key, PUSH.key, FORCE.key}
    return shown(mission, COST, hide)


def shown(
    mission: Mission, columns: Iterable[Column], hide: Container[str | None] = ()
) -> tuple[Column, ...]:
    """Columns as they are shown: without those of some keys, nor propellant that nobody knows."""
    known = bool(np.isfinite(mission.propellant).any())
    kept = (
        replace(one, heading=None) if one.key in hide or (one.key == FUEL.key and not known) else one
        for one in columns
    )
    return tuple(in_grams(mission, one) if one.key == FUEL.key else one for one in kept)


def of_plan(shown: Iterable[Column], pulsed: bool) -> tuple[Column, ...]:
    """Columns of a plan; where it is flown by pulses they say that delta-v and thrust are the plan's.

    Its propellant is not told then: thrusters burn more than the plan asks for.
    """
    if not pulsed:
        return tuple(shown)
    return tuple(
        replace(one, heading=None if one.key == FUEL.key or one.heading is None else f"planned {one.heading}")
        if one.key in OF_PLAN
        else one
        for one in shown
    )


def figures(
    mission: Mission, result: StageResult[Any, Any], name: str, path: Path | None
) -> dict[str, Any] | None:
    """The same for `summary.json`; None where there is no path."""
    return None if path is None else record(COST, spent(mission, result, name, path))


def files(
    mission: Mission, result: StageResult[Any, Any], slots: Mapping[str, int] | None = None
) -> dict[str, Table]:
    """What every craft spends, over its thrusters, and the slot that it took, counted from 1, if any."""
    rows = []
    for k, (name, used) in enumerate(zip(result.after.names, result.delta_v.tolist(), strict=True)):
        energy, _, peak, force, _ = spent(mission, result, name, result.after.paths[k])
        burnt = mission.burnt(result.number, k, used)
        slot, fuel = (slots or {}).get(name), burnt if isfinite(burnt) else None
        rows.append((name, slot, energy, used, peak, force, fuel))
    return {"craft": Table("", CRAFT, rows)}
