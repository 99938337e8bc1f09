"""Costs of paths: energy, delta-v, peak thrust and propellant."""

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
OF_PLAN = {SPEED.key, PUSH.key, FORCE.key, FUEL.key}  # quantities that pulses change
CRAFT = Column("craft", "craft"), Column("slot", "slot"), *COST

UNTOLD = 1e4  # times the minimum: above this the minimum is negligible


def above(spent: float, least: float) -> float | None:
    """Return the relative excess of a cost over the minimum; None if the minimum is negligible."""
    return spent / least - 1.0 if spent < UNTOLD * least else None


class Weighed(Protocol):
    """Object that knows the unit of propellant."""

    @property
    def grams(self) -> bool:
        """True if propellant is given in grams."""


def in_grams(told: Weighed, column: Column) -> Column:
    """Return a column of propellant in the unit that the whole mission uses."""
    if not told.grams or column.heading is None:
        return column
    return replace(column, heading=column.heading.replace("[kg]", "[g]"), form="{:.2f}".format, scale=1e3)


def asked(mission: Mission, result: StageResult[Any, Any], name: str, path: Path) -> float:
    """Return the delta-v [m/s] of a planned path, summed over thrusters if it is planned for them."""
    table = next(craft for craft in mission.scenario.craft_in(result.stage) if craft.name == name)
    thrusters = table.fired(1.0) if getattr(result.stage, "cost", None) == "delta-v" else None
    if thrusters is None or not result.flown:
        return float(path.delta_v)
    from closeform.fuel.chunks import cells_of  # only thrusters need these kernels

    return float(cells_of(path, thrusters).impulse.sum())


def spent(mission: Mission, result: StageResult[Any, Any], name: str, path: Path) -> tuple[Any, ...]:
    """Return a row of COST for a planned path of this stage; None for unknown values."""
    k = mission.scenario.names.index(name)
    speed = asked(mission, result, name, path)
    mass, burnt = mission.scenario.force_mass(name), mission.burnt(result.number, k, speed)
    force = None if mass is None else mass * mission.mass_left(result.number, k) * path.peak_thrust
    energy, fuel = (one if isfinite(one) else None for one in (path.energy, burnt))
    return energy, speed, path.peak_thrust, force, fuel


def columns(mission: Mission, paths: Iterable[Path]) -> tuple[Column, ...]:
    """Return the columns of COST that are shown for some paths, with thrust in newtons if the file uses it.

    Propellant is shown if it is known.  Paths with impulses show neither energy nor thrust, as both are
    unbounded.
    """
    hide = {PUSH.key if mission.scenario.newtons else FORCE.key}
    if not all(isfinite(path.energy) for path in paths):
        hide |= {ENERGY.key, PUSH.key, FORCE.key}
    return shown(mission, COST, hide)


def shown(
    mission: Mission, columns: Iterable[Column], hide: Container[str | None] = ()
) -> tuple[Column, ...]:
    """Return the columns without some keys, and without propellant if it is unknown."""
    known = bool(np.isfinite(mission.propellant).any())
    kept = (
        replace(one, heading=None) if one.key in hide or (one.key == FUEL.key and not known) else one
        for one in columns
    )
    return tuple(in_grams(mission, one) if one.key == FUEL.key else one for one in kept)


def of_plan(shown: Iterable[Column], pulsed: bool) -> tuple[Column, ...]:
    """Return columns of a plan; if pulses execute it, headings of delta-v and thrust begin with "planned".

    Its propellant is then hidden, because thrusters burn more than the plan requires.
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
    """Return the costs of a path for `summary.json`; None if there is no path."""
    return None if path is None else record(COST, spent(mission, result, name, path))


def files(
    mission: Mission, result: StageResult[Any, Any], slots: Mapping[str, int] | None = None
) -> dict[str, Table]:
    """Return each spacecraft's costs over its thrusters, and the slot that it took, counted from 1."""
    rows = []
    for k, (name, used) in enumerate(zip(result.after.names, result.delta_v.tolist(), strict=True)):
        energy, _, peak, force, _ = spent(mission, result, name, result.after.paths[k])
        burnt = mission.burnt(result.number, k, used)
        slot, fuel = (slots or {}).get(name), burnt if isfinite(burnt) else None
        rows.append((name, slot, energy, used, peak, force, fuel))
    return {"craft": Table("", CRAFT, rows)}
