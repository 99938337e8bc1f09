"""Section of a joint reconfiguration: paths, costs, contacts and optimality of the plan."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from closeform.mission.mission_result import Mission, ReconfigureResult, StageResult
from closeform.motion.path import Path
from closeform.report import burns, conflicts, effort, optimum
from closeform.report.actuator_options import Choices, lines_of_fuel, pictures_of_fuel, tables_of_fuel
from closeform.report.picture import Picture
from closeform.report.section import Section, heading
from closeform.report.table import MOST_ROWS, PAIR, Column, Table
from closeform.scenario import Regather, Scatter

Moved = StageResult[Any, ReconfigureResult]  # of a Joint stage

MOST_CONTACTS = 6  # on one line; more are counted


def section(mission: Mission, result: Moved, reached: str | None = None) -> Section:
    """Return the section of spacecraft on new relative orbits; `reached` is a line about the final state."""
    moved, plan = result.result, result.result.plan
    choices, fired = Choices(mission, result, moved.movers), burns.StageBurns(mission, result)
    direct = result.planned is result.before  # every spacecraft takes its direct path
    title = "Conflicts" if direct and plan.ok else "Conflicts of the direct paths"
    lines, tables = conflicts.summed(title, result.before, avoided=not direct)
    near = conflicts.approaches("Closest approaches" + " of the direct paths" * (not direct), result.before)
    closing: tuple[str, ...] = ()
    if result.after is not result.before:
        what = "plan" if result.pulsed is None else "pulses"
        closing, more = conflicts.summed(f"Conflicts of the {what}", result.after)
        tables += more
        near += conflicts.approaches(f"Closest approaches of the {what}", result.after)
    who = f"{moved.movers[0]} moves" if len(moved.movers) == 1 else f"{len(moved.movers)} craft move"
    slots = {name: int(k) + 1 for name, k in zip(moved.movers, plan.slots, strict=True)}
    return Section(
        heading(result, who),
        (*(f"Tried: {measure}" for measure in moved.measures), *lines),
        (*tables, *costs(mission, result), *tables_of_fuel(choices, fired), *contacts(result), *near),
        (
            *lines_of_fuel(choices),
            *worth(mission, result),
            *burns.lines(mission, result),
            *closing,
            *([reached] if reached and moved.plan.ok else []),
        ),
        conflicts.film(result, mission.scenario.zones)
        + pictures(mission, result)
        + pictures_of_fuel(choices),
        {"plan": figures(mission, result, slots, choices, fired)},
        {**effort.files(mission, result, slots), **fired.files},
    )


def scatter(mission: Mission, result: StageResult[Scatter, ReconfigureResult]) -> Section:
    """Return the section of a formation that spreads out, with the separation that it reaches."""
    stage, names = result.stage, result.after.names
    start, end = (result.after.paths.position(time) for time in (result.start, result.end))
    reached = None
    if stage.factor is None:
        point, _ = stage.away
        far = np.linalg.norm(end - np.array(point), axis=-1)
        reached = f"Ends at least {far.min():.1f} m from the point ({names[int(far.argmin())]})"
    elif len(names) > 1:
        one, other = np.triu_indices(len(names), 1)
        apart, were = (np.linalg.norm(place[one] - place[other], axis=-1) for place in (end, start))
        k = int((apart / were).argmin())
        pair = f"{names[one[k]]} and {names[other[k]]}"
        reached = f"Every pair ends at least {apart[k] / were[k]:.4g} times as far apart as it began ({pair})"
    return section(mission, result, reached)


def regather(mission: Mission, result: StageResult[Regather, ReconfigureResult]) -> Section:
    """Return the section of a formation that returns to its earlier relative orbit."""
    reached = f'Everybody is back on the relative orbit of the start of "{result.stage.as_before}"'
    return section(mission, result, reached)


def spent_on(mission: Mission, result: Moved, flown: Path) -> Any:
    """Return the cost of each moving spacecraft on its path (N,), in the unit of the stage's cost."""
    if result.stage.cost != "delta-v":
        return flown.energy
    return [effort.asked(mission, result, name, flown[k]) for k, name in enumerate(result.result.movers)]


def free_cost(mission: Mission, result: Moved) -> float:
    """Return the total cost of the direct paths, without keep-out zones."""
    return float(np.sum(spent_on(mission, result, result.result.plan.direct)))


def costs(mission: Mission, result: Moved) -> Iterator[Table]:
    """Yield the tables of each spacecraft's path and cost."""
    from closeform.fuel.burns import burns_of

    moved, plan = result.result, result.result.plan
    who = [result.after.names.index(name) for name in moved.movers]
    paths, by_delta_v = result.planned.paths[who], result.stage.cost == "delta-v"
    values = spent_on(mission, result, paths), spent_on(mission, result, plan.direct)
    cost, direct = (np.append(one, np.sum(one)) for one in values)
    columns: dict[Column, list[Any]] = {Column("craft", words=True): [*moved.movers, "all"]}
    if result.stage.assigns:
        columns[Column("slot", absent="")] = [*(k + 1 for k in plan.slots.tolist()), None]
    for title, times in (("from [s]", plan.starts), ("to [s]", plan.starts + plan.durations)):
        if np.ptp(times) > 0.0:
            columns[Column(title, form="{:.1f}".format, absent="", since="mission")] = [*times, None]
    columns[effort.SPEED if by_delta_v else effort.ENERGY] = [*cost]
    if result.planned is not result.before:
        shares = [effort.above(one, free) for one, free in zip(cost, direct, strict=True)]
        columns[Column("extra [%]", form="{:.3f}".format, scale=100.0)] = shares
    spent = [effort.spent(mission, result, name, result.planned.path(name)) for name in moved.movers]
    _, speed, push, force, fuel = zip(*spent, strict=True)
    if by_delta_v:
        pushes = [len(burns_of(paths[k]).told.size) for k in range(len(who))]
        title = "impulses" if any(paths[k].impulses for k in range(len(who))) else "burns"
        columns[Column(title)] = [*pushes, sum(pushes)]
    else:
        columns[effort.SPEED] = [*speed, sum(speed)]
        if mission.scenario.newtons:
            columns[replace(effort.FORCE, heading="peak [N]")] = [*force, max(force)]
        else:
            columns[replace(effort.PUSH, heading="peak [mm/s²]")] = [*push, max(push)]
    if None not in fuel and result.pulsed is None:
        columns[effort.in_grams(mission, effort.FUEL)] = [*fuel, sum(fuel)]
    rows, shown = (
        list(zip(*columns.values(), strict=True)),
        effort.of_plan(columns, result.pulsed is not None),
    )
    title = "Paths of the plan" if plan.ok else "Direct paths"
    if len(who) == 1:
        rows = rows[:1]  # the total repeats it
    many = len(who) > MOST_ROWS
    if many:
        yield Table(f"{title}, all {len(who)} craft", shown, rows[-1:])
    yield Table(title, shown, rows, folded=many)


def touching(moved: ReconfigureResult) -> list[tuple[tuple[str, str], float, float]]:
    """Return the pair, the time [s] and the time of thrust loss (nan if none) of each contact of the plan."""
    names = moved.names
    return [((names[at.first], names[at.second]), at.time, at.failed_at) for at in moved.plan.contacts]


def contacts(result: Moved) -> Iterator[Table]:
    """Yield the tables of contacts with zones and of shadow prices."""
    moved = result.result
    if rows := touching(moved):
        lost = None if moved.plan.drift is None else "thrust lost at [s]"
        columns = (
            PAIR,
            Column("at [s]", form="{:.3f}".format, since="mission"),
            Column(lost, form="{:.3f}".format),
        )
        title = f"Where the plan touches {optimum.padded(moved.plan)}zones"
        yield Table(title, columns, rows, folded=True)
    if moved.plan.prices:
        yield optimum.prices(moved.plan, moved.names, result.after.names)


def worth(mission: Mission, result: Moved) -> Iterator[str]:
    """Yield the optimality of the plan, its contacts with zones, and the cost of clearance."""
    moved, plan = result.result, result.result.plan
    how = "jointly" if result.stage.plan == "joint" else "one craft after another"
    limited = mission.scenario.during(result.stage).limits(*moved.movers)
    best = optimum.best(plan, result.pulsed is not None, limited)
    if not plan.ok:
        yield f"Planned {how}, without success: these are the direct paths"
        return
    if result.planned is result.before:
        yield f"Planned {how}: everybody takes the direct path; {best}"
        return
    yield f"Planned {how}: {best}"
    yield from optimum.bounds(
        plan, " of all craft", free_cost(mission, result), result.stage, result.pulsed is not None
    )
    where = [
        f"{one} - {other} at {at.time:.1f} s{optimum.adrift(at)}"
        for ((one, other), *_), at in zip(touching(moved), plan.contacts, strict=True)
    ]
    padded, meets = optimum.padded(plan), optimum.meets(plan).removeprefix("is ").capitalize()
    if len(where) > MOST_CONTACTS:
        yield f"{meets} {padded}zones {len(where)} times, from {where[0]} to {where[-1]}"
    elif where:
        yield f"{meets} {padded}zones: {', '.join(where)}"
    yield from optimum.clearance(plan, moved.names, result.after.names)


def figures(
    mission: Mission, result: Moved, slots: dict[str, int], choices: Choices, fired: burns.StageBurns
) -> dict[str, Any]:
    """Return the figures of a joint reconfiguration for `summary.json`."""
    moved, plan = result.result, result.result.plan
    cost = partial(effort.figures, mission, result)
    efforts = zip(slots.items(), plan.starts.tolist(), plan.durations.tolist(), strict=True)
    return {
        **optimum.figures(plan, moved.names, result.after.names),
        "method": result.stage.plan,
        "measures": list(moved.measures),
        "blocked": [moved.names[k] for k in plan.blocked or ()] or None,
        "asked_s": moved.asked,
        **(choices.figures if choices.told else {}),
        **fired.figures,
        "energy_m2_s3": plan.energy,
        "delta_v_m_s": plan.delta_v,
        "craft": {
            name: {
                "slot": slot,
                "start_s": start,
                "end_s": start + duration,
                "direct": cost(name, result.before.path(name)),
                "flown": cost(name, plan.paths[k] if plan.paths is not None else None),
            }
            for k, ((name, slot), start, duration) in enumerate(efforts)
        },
        "touches": [
            {
                "pair": [moved.names[at.first], moved.names[at.second]],
                "time_s": at.time,
                "failed_at_s": at.failed_at,
                "normal": at.normal.tolist(),
                "multiplier_m_s3" if plan.cost == "energy" else "multiplier_1_s": at.multiplier,
            }
            for at in plan.contacts
        ],
    }


def pictures(mission: Mission, result: Moved) -> tuple[Picture, ...]:
    """Return pictures of the paths, of the clearance of pairs, and of the thrust."""
    flown, zones = result.after.paths, mission.scenario.zones
    changed = result.planned is not result.before  # at this scale pulses cannot be told from their plan
    direct = result.before.paths if changed else flown
    names = {"names": result.after.names}
    caption = "All paths, direct and of the plan" if changed else "The direct paths"
    found = [Picture("paths", caption, "formation_paths", (direct, flown), names | {"zone": zones})]
    if result.after.approaches:
        matrix = len(result.after.approaches) > 1
        if matrix and result.before.conflicts and changed:
            caption = "How near each two craft would come on their direct paths"
            shows = "before: the direct paths"
            found.append(
                Picture("ratios-before", caption, "ratio_matrix", (direct, zones), names, shows=shows)
            )
        if matrix:
            found.append(
                Picture("ratios", "How near each two craft come", "ratio_matrix", (flown, zones), names)
            )
        found.append(conflicts.nearest(result.after, zones))
    return (*found, thrust(mission, result)) if result.stage.cost == "energy" else tuple(found)


def thrust(mission: Mission, result: Moved) -> Picture:
    """Return the picture of each spacecraft's thrust, in newtons if all masses are known."""
    scenario, options = mission.scenario, dict[str, Any](names=result.after.names)
    craft = scenario.craft_in(result.stage)
    if any(one.limited for one in craft):
        options["limits"] = [one.max_acceleration for one in craft]
    if result.pulsed is not None:
        options["on_off"] = [name in result.pulsed.names for name in scenario.names]
    masses = [scenario.force_mass(name) for name in scenario.names]
    if None not in masses:
        options["masses"] = masses
    caption = "Thrust of each craft" + (", as planned" if result.pulsed is not None else "")
    return Picture("thrust", caption, "formation_thrust", (result.planned.paths,), options)
