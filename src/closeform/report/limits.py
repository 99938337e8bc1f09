"""Use of thrust, delta-v and propellant limits, per stage and in the whole mission."""

from collections.abc import Iterable
from dataclasses import replace
from math import isfinite
from typing import Any

import numpy as np

from closeform.mission.mission_result import Mission, StageResult
from closeform.mission.verdict import Use
from closeform.report import effort
from closeform.report.table import MOST_ROWS, Column, Table


def greatest(mission: Mission, result: StageResult[Any, Any]) -> dict[str, tuple[Use, ...]]:
    """Return the largest use of each kind of limit in this stage and, if it is executed, up to its end."""
    if not result.flown:
        return {"The direct paths would need": first_of_each(mission.thrusts(result))}
    return {
        "Peak": first_of_each(mission.thrusts(result)),
        "Used so far, at most": first_of_each(mission.spent(slice(result.number))),
    }


def first_of_each(uses: Iterable[Use], idle: bool = False) -> tuple[Use, ...]:
    """Return the largest use of each kind of limit; if none is used, the first one with `idle`, else none."""
    found: dict[str, Use] = {}
    for use in uses:
        if idle:
            found.setdefault(use.what, use)
        if use.used > 0.0 and use.share > (found[use.what].share if use.what in found else 0.0):
            found[use.what] = use
    return tuple(found.values())


def lines(mission: Mission, result: StageResult[Any, Any]) -> tuple[str, ...]:
    """Return the largest use of each kind of limit in words."""

    def told(use: Use) -> str:
        used, limit, unit = use.shown(mission.grams)
        return f"{use.what} {used:.4g} of {limit:g} {unit} ({use.craft})"

    most = greatest(mission, result).items()
    return tuple(f"{title}: {', '.join(map(told, uses))}" for title, uses in most if uses)


def used_up(mission: Mission) -> tuple[Table, ...]:
    """Return the table of use in the whole mission, if it adds to those of the stages."""
    burns = np.any(mission.delta_v > 0.0, axis=1).sum()
    known = bool(np.isfinite(mission.spent_of_each[1]).any())
    told = mission.scenario.limited or burns > 1 or known
    return (with_total(mission, used(mission)),) if burns and told else ()


def used(mission: Mission) -> Table:
    """Return the use of each spacecraft in the whole mission, and in its simulations if there are any."""
    scenario, (delta_v, propellant) = mission.scenario, mission.spent_of_each
    uses = {(use.what, use.craft): use for use in mission.uses}
    flown, how, heading = flown_delta_v(mission)
    speeds_up = any(one.acceleration for one in scenario.craft_of_all)
    key, rows = "max_acceleration" if speeds_up else "max_thrust", []
    rest = f"left{' in flight' * bool(how)} [kg]"
    each = scenario.craft, delta_v.tolist(), propellant.tolist(), flown
    for craft, spent, burnt, most in zip(*each, strict=True):
        speed, tank, force = (uses.get((what, craft.name)) for what in ("delta-v", "propellant", "thrust"))
        budget, thrust = (use and use.share for use in (speed, force))
        left, burns = tank and tank.limit - tank.used, burnt if isfinite(burnt) else None
        rows.append((craft.name, spent, most, budget, burns, left, thrust))
    columns = [
        Column("craft", "craft", words=True),
        Column(f"{how}delta-v [m/s]", "delta_v_m_s", "{:.6f}".format),
        Column(heading, "flown_delta_v_m_s", "{:.6f}".format),
        Column("of its budget [%]", "share_of_delta_v_budget", "{:.1f}".format, 100.0),
        effort.in_grams(mission, replace(effort.FUEL, heading=f"{how}propellant [kg]")),
        effort.in_grams(mission, replace(effort.FUEL, heading=rest, key="propellant_left_kg")),
        Column(f"of {key} [%]", f"share_of_{key}", "{:.1f}".format, 100.0),
    ]
    known = [any(row[k] is not None for row in rows) for k in range(len(columns))]
    shown = tuple(
        one if there else replace(one, heading=None) for one, there in zip(columns, known, strict=True)
    )
    title = "Use of each spacecraft" + ", planned and simulated" * bool(how)
    return Table(title, shown, rows, folded=len(rows) > MOST_ROWS)


def with_total(mission: Mission, used: Table) -> Table:
    """Return the table with a last row for all spacecraft, if several burn; simulated values are maxima."""
    columns = dict(zip((column.key for column in used.columns), zip(*used.rows, strict=True), strict=True))
    if sum(spent > 0.0 for spent in columns["delta_v_m_s"]) < 2:
        return used
    fuel, flights = columns["propellant_kg"], mission.flights
    totals = {
        "craft": "all",
        "delta_v_m_s": sum(columns["delta_v_m_s"]),
        "flown_delta_v_m_s": flights and float(flights.flight.delta_v.sum(axis=1).max()),
        "propellant_kg": None if None in fuel else sum(fuel),
    }
    return replace(used, rows=[*used.rows, tuple(totals.get(column.key or "") for column in used.columns)])


def flown_delta_v(mission: Mission) -> tuple[list[float | None], str, str | None]:
    """Return each spacecraft's largest simulated delta-v [m/s], a prefix of planned values, and a heading."""
    if mission.flights is None:
        return [None] * len(mission.scenario.craft), "", None
    spent = mission.flights.flight.delta_v
    return spent.max(axis=0).tolist(), "planned ", f"flown{', most' * (len(spent) > 1)} [m/s]"


def figures(mission: Mission, result: StageResult[Any, Any]) -> dict[str, Any]:
    """Return the largest use of each kind of limit for `summary.json`."""
    found = {
        f"{use.what}_{use.unit}".replace("-", "_").replace("/", "_"): {
            "craft": use.craft,
            "used": use.used,
            "limit": use.limit,
        }
        for uses in greatest(mission, result).values()
        for use in uses
    }
    return {"limits": found} if found else {}
