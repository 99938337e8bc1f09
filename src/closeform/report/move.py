"""Section of an avoidance manoeuvre: conflicts before it, the avoidance trajectory, conflicts after it."""

from collections.abc import Iterator
from functools import partial
from typing import Any

from closeform.conflicts.two_paths import closest_approach, nearest_first
from closeform.mission.mission_result import AvoidResult, Mission, StageResult
from closeform.motion.path import Path
from closeform.planning.plan import UNITS, Status
from closeform.report import arrival, burns, conflicts, effort, optimum
from closeform.report.actuator_options import Choices, lines_of_fuel, pictures_of_fuel, tables_of_fuel
from closeform.report.picture import Picture
from closeform.report.section import Section, heading
from closeform.report.table import Column, Table
from closeform.scenario import Avoid

Move = StageResult[Avoid, AvoidResult]

MOST_CONTACTS = 4  # on one line; more are counted


def section(mission: Mission, result: Move) -> Section:
    """Return the section of a single spacecraft that avoids the others."""
    moved = result.result
    choices, fired = Choices(mission, result, [moved.craft]), burns.StageBurns(mission, result)
    lines, before = conflicts.summed("Conflicts before", result.before, avoided=True)
    closing, after = conflicts.summed("Conflicts after", result.after)
    if not moved.avoidance.ok:
        within = "" if moved.avoidance.weak is None else " within the thrust limit"
        closing, after = (f"The direct path is shown: no way around was found{within}",), ()
    tables = (
        *before,
        efforts(mission, result),
        *meanwhile(mission, result),
        *clearance(result),
        *tables_of_fuel(choices, fired),
        *after,
        *conflicts.approaches("Closest approaches before", result.before),
        *conflicts.approaches("Closest approaches after", result.after),
    )
    return Section(
        heading(result, f"{moved.craft} moves"),
        (*(f"Tried: {measure}" for measure in moved.avoidance.measures), *lines),
        tables,
        (
            *lines_of_fuel(choices),
            *arrivals(result),
            *how(mission, result),
            *burns.lines(mission, result),
            *closing,
        ),
        conflicts.film(result, mission.scenario.zones)
        + pictures(mission, result)
        + pictures_of_fuel(choices),
        {"change": figures(mission, result, choices, fired)},
        fired.files,
    )


def efforts(mission: Mission, result: Move) -> Table:
    """Return the costs of the direct path and of the avoidance trajectory, side by side."""
    moved, path = result.result, result.result.avoidance.path

    def row(name: str, one: Path) -> tuple[Any, ...]:
        return name, one.end - one.start, *effort.spent(mission, result, moved.craft, one)

    rows = [row("direct", moved.direct)]
    if moved.plain is not moved.direct:
        rows.append(row("direct, longer", moved.plain))
    if path is not None and moved.avoidance.status is Status.AVOIDED:
        rows.append(row("around", path))
        pairs = zip(*(one[2:] for one in rows[-2:]), strict=True)
        rows.append(("change", "", *(f"{100 * (b / a - 1):+.3f} %" if a else None for a, b in pairs)))
    shown = effort.columns(mission, [moved.direct] if path is None else [moved.direct, path])
    shown = effort.of_plan(shown, result.pulsed is not None)
    lasts = Column("lasts [s]" if moved.plain is not moved.direct else None, form="{:.1f}".format)
    title = "Change made" if len(rows) > 1 else "Path" if result.flown else "Direct path, not flown"
    return Table(title, (Column("path", words=True), lasts, *shown), rows)


def meanwhile(mission: Mission, result: Move) -> tuple[Table, ...]:
    """Return the costs of the spacecraft that execute their own transfers, as a table if there are any."""
    paths = {fellow.craft: result.planned.path(fellow.craft) for fellow in result.stage.meanwhile}
    rows = [(name, *effort.spent(mission, result, name, path)) for name, path in paths.items()]
    shown = effort.of_plan(effort.columns(mission, paths.values()), result.pulsed is not None)
    columns = Column("craft", words=True), *shown
    return (Table("Meanwhile", columns, rows),) if rows else ()


def clearance(result: Move) -> tuple[Table, ...]:
    """Return the table of shadow prices of clearance, if the plan touches zones."""
    found = result.result.avoidance
    return (optimum.prices(found, result.result.names, result.after.names),) if found.prices else ()


def arrivals(result: Move) -> Iterator[str]:
    """Yield the arrival phases of the avoiding spacecraft and of those with their own transfers."""
    stage, goals = result.stage, result.result.goals
    drifts = stage.drift is not None
    safe = stage.plans_drift and stage.is_exact
    yield from arrival.lines(stage.craft, goals.get(stage.craft), drifts, safe)
    for fellow in stage.meanwhile:
        yield from arrival.lines(fellow.craft, goals[fellow.craft], drifts)


def how(mission: Mission, result: Move) -> tuple[str, ...]:
    """Return the method, the contacts with zones, the extra cost and the optimality of the plan."""
    method, moved, avoidance = result.stage.method, result.result, result.result.avoidance
    if not avoidance.ok:
        return (f"Method {method}: {avoidance.status}",)  # the verdict has the reason
    if not result.flown:
        return (f"Method {method}: its plan cannot be fired",)
    if avoidance.path is moved.direct or avoidance.status is Status.CLEAR:
        if moved.plain is not moved.direct:
            longer = f"direct path of {moved.plain.end - moved.plain.start:.1f} s"
            return (f"Method {method}: takes the {longer}, which is in nobody's way",)
        return (f"Method {method}: the direct path is clear",)
    over = f" over {moved.plain.end - moved.plain.start:.1f} s" if moved.plain is not moved.direct else ""
    where = [
        f"{moved.others[at.second - 1]} at {at.time:.1f} s{optimum.adrift(at)}" for at in avoidance.contacts
    ]
    padded = optimum.padded(avoidance)
    many = f"{padded}zones {len(where)} times, from that of {where[0]} to {where[-1]}"
    limited = mission.scenario.during(result.stage).limits(moved.craft)
    best = optimum.best(avoidance, result.pulsed is not None, limited)
    touched = many if len(where) > MOST_CONTACTS else f"the {padded}zone of {', '.join(where)}"
    touched = touched if where else "no zone"
    free, unit = free_cost(mission, result), UNITS[avoidance.cost]
    return (
        f"Method {method}: {optimum.meets(avoidance)} {touched}",
        f"Extra {avoidance.cost} {avoidance.spent - free:.6g} {unit} beyond the free optimum{over}; {best}",
        *optimum.bounds(avoidance, "", free, result.stage, result.pulsed is not None),
        *optimum.clearance(avoidance, moved.names, result.after.names),
    )


def free_cost(mission: Mission, result: Move) -> float:
    """Return the cost without keep-out zones, in the unit of the stage's cost."""
    moved = result.result
    if moved.avoidance.cost == "delta-v":
        return float(effort.asked(mission, result, moved.craft, moved.plain))
    return moved.avoidance.energy - moved.avoidance.extra_energy


def figures(mission: Mission, result: Move, choices: Choices, fired: burns.StageBurns) -> dict[str, Any]:
    """Return the figures of an avoidance manoeuvre for `summary.json`."""
    moved, avoidance = result.result, result.result.avoidance
    cost = partial(effort.figures, mission, result)
    return {
        "craft": moved.craft,
        "method": result.stage.method,
        **optimum.figures(avoidance, moved.names, result.after.names),
        "measures": list(avoidance.measures),
        "asked_s": moved.asked,
        "arrival": arrival.figures(moved.goals.get(moved.craft)),
        "extra_energy_m2_s3": avoidance.extra_energy,
        "contacts": [
            {
                "craft": moved.others[at.second - 1],
                "time_s": at.time,
                "position_m": at.position.tolist(),
                "failed_at_s": at.failed_at,
            }
            for at in avoidance.contacts
        ],
        "direct": cost(moved.craft, moved.direct),
        "direct_longer": cost(moved.craft, moved.plain if moved.plain is not moved.direct else None),
        "around": cost(moved.craft, avoidance.path),
        **(choices.figures if choices.told else {}),
        **fired.figures,
        "meanwhile": {
            fellow.craft: cost(fellow.craft, result.after.path(fellow.craft))
            for fellow in result.stage.meanwhile
        },
    }


def pictures(mission: Mission, result: Move) -> tuple[Picture, ...]:
    """Return pictures of the avoiding spacecraft and of those that share the zone of the closest approach."""
    moved, before = result.result, result.before
    craft, path, around = moved.craft, moved.direct, moved.avoidance.path
    if not moved.others:
        return ()
    approaches = [
        closest_approach(path, before.path(name), zone)
        for name, zone in zip(moved.others, moved.zones, strict=True)
    ]
    ranked = [nearest_first(one.ratio, one.time) for one in approaches]
    closest = ranked.index(min(ranked))
    other, zone = moved.others[closest], moved.zones[closest]
    obstacle = before.path(other)
    changed = around is not None and around is not path
    caption, pair = f"{craft} relative to {other}, before", {"names": (craft, other)}
    shows = "before: the direct path" if changed else ""
    planned = "as planned, not as fired" if result.pulsed is not None else ""
    found = [Picture("distances", caption, "distances", (path, obstacle, zone), pair, shows=shows)]
    if before.conflicts and result.stage.cost == "energy":
        caption = f"Ways of {craft} around {other} alone: the cheapest found on each side, where there is one"
        found.append(Picture("two-ways", caption, "two_ways", (path, obstacle, zone), {"name": other}))
    if changed:
        names = [name for name, one in zip(moved.others, moved.zones, strict=True) if one is zone]
        ways = path, around, [before.path(name) for name in names], zone
        near = f"How near {craft} comes to the zones of the others, before and after"
        both = f"The path of {craft} before and after"
        found += [
            Picture("before-after", both, "before_after", ways, {"names": names}, shows=planned),
            Picture("nearness", near, "ratios", ways, {"names": names}, shows=planned),
        ]
        paths, labels = [path, around], ["before", "after"]
    else:
        every, options = (before.paths, before.paths), {"names": before.names, "zone": mission.scenario.zones}
        found.append(Picture("paths", "The direct paths of all", "formation_paths", every, options))
        paths, labels = [path], [craft]
    if result.stage.cost == "energy":  # impulses are drawn as burns
        mass = {"mass": mission.scenario.force_mass(craft)}
        found.append(Picture("thrust", f"Thrust of {craft}", "thrust", (paths, labels), mass))
    return tuple(found)
