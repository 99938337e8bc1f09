"""Sections of the stages that move spacecraft: coast, transfer, avoidance and reconfiguration."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import degrees, isfinite
from typing import Any

import numpy as np

from closeform.conflicts.two_paths import closest_approach, nearest_first
from closeform.mission.mission_result import (
    AvoidResult,
    Mission,
    ReconfigureResult,
    StageResult,
    TransferResult,
)
from closeform.mission.stage_start import Arrival
from closeform.motion.path import Path
from closeform.planning.plan import UNITS, Plan, Status
from closeform.report.description import (
    AT,
    MOST_ROWS,
    PAIR,
    Column,
    Section,
    Table,
    counted,
    heading,
    some_of,
)
from closeform.report.picture import Picture
from closeform.report.sections import conflicts, effort
from closeform.report.sections.actuator_options import Choices
from closeform.scenario import Avoid, Coast, Regather, Scatter, Transfer

Coasting = StageResult[Coast, None]
Moved = StageResult[Transfer, TransferResult]
Avoiding = StageResult[Avoid, AvoidResult]
Joint = StageResult[Any, ReconfigureResult]

ORDERS = {
    "joint": "jointly",
    "sequential": "one craft after another",
    "distributed": "by each craft on its own",
}
SAME_PHASE = 0.02  # deg: phases that are reported as equal
NOTHING = 1e-9  # m/s: rounding error of a plan without burns
UNIMPROVED = 1e-6  # share of the cost: a bound that does not improve on free paths
WIDE = 1e-3  # a gap that `prove` may reduce
TOUCHING = 1.0 + 2e-5  # a clearance ratio up to this covers rounding only
MOST_CONTACTS = 4  # on one line; more are counted
SLOPES = {  # keys of the slopes of a cost, per metre and per scale factor of a zone
    "energy": ("per_metre_m_s3", "per_factor_m2_s3"),
    "delta-v": ("per_metre_1_s", "per_factor_m_s"),
}


def coast(mission: Mission, result: Coasting) -> Section:
    """Return the section of a coast, some of whose spacecraft may follow their ephemerides."""
    zones, names = mission.scenario.zones, result.stage.follow
    lines, tables = conflicts.summed("Conflicts", result.after)
    followed = []
    if names:
        off = max(float(result.after.path(name).interpolation_error) for name in names)
        followed.append(
            f"On the paths of their files: {some_of(names)}; interpolation error up to {off:.2g} m (estimate)"
        )
    if result.on_ephemerides:
        followed.append("Burns of craft on ephemerides are the velocity jumps in these")
    return Section(
        heading(result),
        (*followed, *lines),
        (
            *tables,
            *conflicts.approaches("Closest approaches", result.after),
            *effort.StageBurns(mission, result).tables,
        ),
        pictures=conflicts.film(result, zones) + conflicts.coasting(result.after, zones),
    )


def completed(
    own: Section, choices: Choices, tables: Iterable[Table] = (), closing: Iterable[str] = ()
) -> Section:
    """Return the section of a move with its actuator options, pulses and animation.

    `own` has the moving spacecraft as its title, and one entry of figures; `tables` and `closing` come last.
    """
    mission, result, ((key, figures),) = choices.mission, choices.result, own.figures.items()
    return Section(
        heading(result, own.title),
        own.lines,
        (*own.tables, *choices.tables, *tables),
        (*choices.lines, *own.closing, *effort.pulse_lines(mission, result), *closing),
        conflicts.film(result, mission.scenario.zones) + (*own.pictures, *choices.pictures),
        {key: figures | choices.figures},
        {**own.files, **choices.fired.files},
    )


def transfer(mission: Mission, result: Moved) -> Section:
    """Return the section of the transfer of a single spacecraft, with the cost of each actuator option."""
    name, goal, executed = result.result.craft, result.result.goal, result.executed
    choices = Choices(mission, result, [name], zones=False)
    lines, met = conflicts.summed("Conflicts", result.after) if result.after.approaches else ((), ())
    path, pulsed = result.planned.path(name), result.pulsed is not None
    title = "Path of the plan" if executed else "Path without a limit"
    optimality = []
    if not executed:
        optimality.append("No transfer within the limit: this is the path without a limit, not executed")
    elif choices.least is not None and choices.lower > 0.0:
        spent, lower = effort.asked(mission, result, name, path), choices.lower
        above = f"{100.0 * (spent / lower - 1.0):z.3f} % above the minimum of free thrust, {lower:.6g} m/s"
        optimality.append(f"Delta-v{' planned' * pulsed} {spent:.6g} m/s, {above}")
    paths = result.after.paths
    pictures = [
        Picture("paths", "The path", "formation_paths", (paths, paths), {"names": result.after.names})
    ]
    if path.peak_thrust > 0.0:
        label = "plan, executed by on-off thrusters" if pulsed else "plan"
        mass = {"mass": mission.scenario.force_mass(name)}
        pictures.append(Picture("thrust", f"Thrust of {name}", "thrust", ([path], [label]), mass))
    figures = {
        "craft": name,
        "cost": result.stage.cost,
        "asked_s": result.result.asked,
        "arrival": arrival_figures(goal),
        "planned": effort.figures(mission, result, name, path if executed else None),
    }
    costs = cost_table(mission, result, title, {"plan" if executed else "free": (name, path)})
    closing = (*arrival_lines(name, goal, result.stage.drift is not None), *optimality)
    own = Section(f"{name} moves", lines, (*met, costs), closing, tuple(pictures), {"transfer": figures})
    return completed(own, choices)


def avoid(mission: Mission, result: Avoiding) -> Section:
    """Return the section of a single spacecraft that avoids the others."""
    moved, stage, plan = result.result, result.stage, result.result.plan
    craft = moved.craft
    choices = Choices(mission, result, [craft])
    lines, before = conflicts.summed("Conflicts before", result.before, avoided=True)
    closing, after = conflicts.summed("Conflicts after", result.after)
    if not plan.ok:
        within = "" if plan.weak is None else " within the thrust limit"
        closing, after = (f"The direct path is shown: no avoidance trajectory was found{within}",), ()
    direct = {"direct": (craft, moved.direct)}
    if moved.plain is not moved.direct:
        direct["direct, longer"] = craft, moved.plain
    changed = {}
    if plan.path is not None and plan.status is Status.AVOIDED:
        changed["avoidance"] = craft, plan.path
    title = (
        "Change made"
        if changed or len(direct) > 1
        else "Path"
        if result.executed
        else "Direct path, not executed"
    )
    tables = [cost_table(mission, result, title, direct | changed, lasts=len(direct) > 1)]
    if stage.meanwhile:
        fellows = {one.craft: (one.craft, result.planned.path(one.craft)) for one in stage.meanwhile}
        tables.append(cost_table(mission, result, "Transfers of other craft", fellows, "craft"))
    if plan.prices:
        tables.append(prices(plan, moved.names, result.after.names))
    goals = [(craft, stage.plans_drift and stage.is_exact), *((one.craft, False) for one in stage.meanwhile)]
    arrivals = [
        line
        for name, safe in goals
        for line in arrival_lines(name, moved.goals.get(name), stage.drift is not None, safe)
    ]
    cost = partial(effort.figures, mission, result)
    figures = {
        "craft": craft,
        "method": stage.method,
        **optimum_figures(plan, moved.names, result.after.names),
        "measures": list(plan.measures),
        "asked_s": moved.asked,
        "arrival": arrival_figures(moved.goals.get(craft)),
        "extra_energy_m2_s3": plan.extra_energy,
        "contacts": [
            {
                "craft": moved.others[at.second - 1],
                "time_s": at.time,
                "position_m": at.position.tolist(),
                "failed_at_s": at.failed_at,
            }
            for at in plan.contacts
        ],
        "direct": cost(craft, moved.direct),
        "direct_longer": cost(craft, moved.plain if moved.plain is not moved.direct else None),
        "around": cost(craft, plan.path),
        "meanwhile": {one.craft: cost(one.craft, result.after.path(one.craft)) for one in stage.meanwhile},
    }
    own = Section(
        f"{craft} moves",
        (*(f"Tried: {measure}" for measure in plan.measures), *lines),
        (*before, *tables),
        (*arrivals, *avoidance_lines(mission, result)),
        tuple(avoid_pictures(mission, result)),
        {"change": figures},
    )
    near = (
        *conflicts.approaches("Closest approaches before", result.before),
        *conflicts.approaches("Closest approaches after", result.after),
    )
    return completed(own, choices, (*after, *near), closing)


def avoidance_lines(mission: Mission, result: Avoiding) -> Iterator[str]:
    """Yield the method, and the optimality of the plan if it differs from the direct path."""
    moved, plan, method = result.result, result.result.plan, f"Method {result.stage.method}"
    longer = moved.plain is not moved.direct
    over = f" over {moved.plain.end - moved.plain.start:.1f} s" if longer else ""
    if not plan.ok:
        yield f"{method}: {plan.status}"  # the verdict has the reason
    elif not result.executed:
        yield f"{method}: thrusters cannot execute the plan"
    elif plan.status is Status.CLEAR:
        yield f"{method}: the direct path{over} is clear"
    else:
        free = plan.energy - plan.extra_energy
        if plan.cost == "delta-v":
            free = effort.asked(mission, result, moved.craft, moved.plain)
        yield f"{method}: {best(mission, result, plan, moved.craft)}"
        extra = f"{plan.spent - free:.6g} {UNITS[plan.cost]}"
        yield f"Extra {plan.cost} {extra} beyond the free optimum{over}"
        where = [f"{moved.others[at.second - 1]} at {at.time:.1f} s" for at in plan.contacts]
        if moved.required:
            yield f"Requirements on the path: {', '.join(moved.required)}"
        yield from optimality(result, plan, free, where, moved.names)


def reconfigure(mission: Mission, result: Joint, reached: str | None = None) -> Section:
    """Return the section of spacecraft on new relative orbits; `reached` is a line about the final state."""
    moved, plan = result.result, result.result.plan
    choices = Choices(mission, result, moved.movers)
    direct = result.planned is result.before  # every spacecraft takes its direct path
    of_direct = " of the direct paths" * (not direct)
    title = "Conflicts" if direct and plan.ok else "Conflicts of the direct paths"
    lines, tables = conflicts.summed(title, result.before, avoided=not direct)
    near = conflicts.approaches(f"Closest approaches{of_direct}", result.before)
    closing: tuple[str, ...] = ()
    if result.after is not result.before:
        what = "plan" if result.pulsed is None else "pulses"
        closing, more = conflicts.summed(f"Conflicts of the {what}", result.after)
        tables += more
        near += conflicts.approaches(f"Closest approaches of the {what}", result.after)
    moving = f"{moved.movers[0]} moves" if len(moved.movers) == 1 else f"{len(moved.movers)} craft move"
    slots = {name: int(k) + 1 for name, k in zip(moved.movers, plan.slots, strict=True)}
    active = [((moved.names[at.first], moved.names[at.second]), at) for at in plan.contacts]
    touched, priced = [], [prices(plan, moved.names, result.after.names)] if plan.prices else []
    if active:
        columns = PAIR, replace(AT, key=None), Column("thrust lost at [s]", form="{:.3f}".format)
        touched = [
            Table(
                f"Active constraints: contacts with {margin(plan)}keep-out zones",
                columns,
                [(pair, at.time, at.failed_at) for pair, at in active],
                folded=True,
            )
        ]
    how = f"Planned {ORDERS[result.stage.plan]}"
    optimal = best(mission, result, plan, *moved.movers)
    if not plan.ok:
        worth = [f"{how}, without success: these are the direct paths"]
    elif direct:
        worth = [f"{how}: every craft takes its direct path; {optimal}"]
    else:
        free = float(np.sum(spent_on(mission, result, plan.direct)))
        where = [f"{one} - {other} at {at.time:.1f} s" for (one, other), at in active]
        further = optimality(result, plan, free, where, moved.names, " of all craft")
        worth = [f"{how}: {optimal}", *further]
    cost = partial(effort.figures, mission, result)
    figures = {
        **optimum_figures(plan, moved.names, result.after.names),
        "method": result.stage.plan,
        "measures": list(moved.measures),
        "blocked": [moved.names[k] for k in plan.blocked or ()] or None,
        "asked_s": moved.asked,
        "energy_m2_s3": plan.energy,
        "delta_v_m_s": plan.delta_v,
        "craft": {
            name: {
                "slot": slot,
                "start_s": float(plan.starts[k]),
                "end_s": float(plan.starts[k] + plan.durations[k]),
                "direct": cost(name, result.before.path(name)),
                "planned": cost(name, plan.paths[k] if plan.paths is not None else None),
            }
            for k, (name, slot) in enumerate(slots.items())
        },
        "touches": [
            {
                "pair": list(pair),
                "time_s": at.time,
                "failed_at_s": at.failed_at,
                "normal": at.normal.tolist(),
                "multiplier_m_s3" if plan.cost == "energy" else "multiplier_1_s": at.multiplier,
            }
            for pair, at in active
        ],
    }
    own = Section(
        moving,
        (*(f"Tried: {measure}" for measure in moved.measures), *lines),
        (*tables, *path_tables(mission, result)),
        tuple(worth),
        tuple(reconfigure_pictures(mission, result)),
        {"plan": figures},
        effort.files(mission, result, slots),
    )
    last = (*closing, reached) if reached and plan.ok else closing
    return completed(own, choices, (*touched, *priced, *near), last)


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
    return reconfigure(mission, result, reached)


def regather(mission: Mission, result: StageResult[Regather, ReconfigureResult]) -> Section:
    """Return the section of a formation that returns to its earlier relative orbit."""
    back = f'Every craft is back on the relative orbit it had at the start of "{result.stage.as_before}"'
    return reconfigure(mission, result, back)


def cost_table(
    mission: Mission,
    result: StageResult[Any, Any],
    title: str,
    paths: Mapping[str, tuple[str, Path]],
    first: str = "path",
    lasts: bool = False,
) -> Table:
    """Return the costs of labelled paths, each with the name of its craft, and the change by the last one.

    The change is the difference between the avoidance trajectory and the path before avoidance.
    """
    rows: list[tuple[Any, ...]] = [
        (label, path.end - path.start, *effort.spent(mission, result, name, path))
        for label, (name, path) in paths.items()
    ]
    if "avoidance" in paths:
        pairs = zip(*(one[2:] for one in rows[-2:]), strict=True)
        rows.append(("change", "", *(f"{100 * (b / a - 1):+z.3f} %" if a else None for a, b in pairs)))
    shown = effort.columns(mission, [path for _, path in paths.values()])
    duration = Column("lasts [s]" if lasts else None, form="{:.1f}".format)
    plan = effort.of_plan(shown, result.pulsed is not None)
    return Table(title, (Column(first, words=True), duration, *plan), rows)


def arrival_lines(craft: str, goal: Arrival | None, drifts: bool, safe: bool = False) -> Iterator[str]:
    """Yield the arrival phase of a spacecraft and the phase of minimum cost, if its orbit has phases.

    `drifts`: a passive-safety horizon is set; `safe`: the phase of minimum cost takes it into account.
    """
    if goal is None or (phase := phase_of(goal)) is None:
        return
    orbit, spent = str(goal.target.called).replace("_", " "), f"{goal.spent:.4g} {UNITS[goal.cost]}"
    arrives = f"{craft} arrives on the {orbit} at {phase:.2f} deg"
    best, shape, asked = goal.cheapest, goal.target.shape, goal.asked.is_open
    lowest = phase_of(best)
    assert shape is not None
    assert lowest is not None
    if asked or abs((lowest - phase + 180.0) % 360.0 - 180.0) < SAME_PHASE:
        yield f"{arrives}, {'' if asked else 'as given, '}lowest cost: {spent} by free thrust"
    else:
        yield f"{arrives}, as given; lowest cost at {lowest:.2f} deg"
        cheapest = f'{best.spent:.4g} {UNITS[goal.cost]} ({shape.phased} = "cheapest")'
        yield f"With free thrust and without obstacles: {spent}; lowest cost {cheapest}"
    if safe:
        yield "The lowest cost among passively safe phases; a passively safe path there may not exist"
    elif drifts:
        yield "The phase of lowest cost disregards free drift from there"


def phase_of(goal: Arrival) -> float | None:
    """Return the phase at which a spacecraft arrives [deg]; None if its orbit has no phases."""
    shape = goal.target.shape
    return None if shape is None or shape.phase_angle is None else degrees(shape.phase_angle)


def arrival_figures(goal: Arrival | None) -> dict[str, Any] | None:
    """Return the arrival phases and their costs for `summary.json`."""
    if goal is None or (phase := phase_of(goal)) is None:
        return None
    unit = {"energy": "m2_s3", "delta-v": "m_s"}[goal.cost]
    return {
        "orbit": goal.target.called,
        "phase_deg": phase,
        "cheapest": goal.asked.is_open,
        f"free_{unit}": goal.spent,
        "cheapest_deg": phase_of(goal.cheapest),
        f"cheapest_free_{unit}": goal.cheapest.spent,
    }


def best(mission: Mission, result: StageResult[Any, Any], plan: Plan, *movers: str) -> str:
    """Return how optimal a plan is; thrusters, and a limit of thrust, raise the minimum of delta-v."""
    if not plan.proven:
        return f"best of {counted(plan.tried, 'candidate')}"
    whose = "for these ends and times"
    if plan.cost == "delta-v" and result.pulsed is not None:
        whose = "of these thrusters"
    elif plan.cost == "delta-v" and mission.scenario.during(result.stage).limits(*movers):
        whose = f"within the limit, {whose}"
    proven = f"proven minimum {plan.cost} {whose}"
    return f"{proven}: natural motion reaches the target" if float(plan.delta_v) < NOTHING else proven


def margin(plan: Plan) -> str:
    """Return "enlarged " if a plan was made for zones with a margin, else an empty text."""
    return "enlarged " if np.max(plan.padding) > 0.0 else ""


def optimality(
    result: StageResult[Any, Any],
    plan: Plan,
    free: float,
    where: Sequence[str],
    names: Sequence[str],
    whose: str = "",
) -> Iterator[str]:
    """Yield the optimality gap, the active constraints and the shadow price of clearance of a plan.

    `free` is the cost without zones, in the unit of the stage's cost, and `whose` names the craft. `where`
    holds the contacts as text, and `names` the craft of the plan.
    """
    stage, fired, unit = result.stage, result.pulsed is not None, UNITS[plan.cost]
    share = f"at most {100 * plan.gap:z.3f} %, " if plan.lower_bound > 0.0 else ""
    gap = f"Optimality gap{whose}: {share}lower bound {plan.lower_bound:.6g} {unit}"
    gap += " for these thrusters" * (fired and plan.cost == "delta-v")
    if not plan.proven:
        unimproved = abs(plan.lower_bound - free) <= UNIMPROVED * plan.spent
        gap += ", without keep-out zones" if unimproved else ", by duality"
    yield gap
    if not plan.proven and plan.gap > WIDE and stage.prove is None:
        yield 'Set prove = "10 s" in the stage to tighten the gap'
    if plan.clearance_ratio > TOUCHING:
        larger = 100.0 * (plan.clearance_ratio - 1.0)
        yield f"Planned for zones {larger:.2g} % larger: no clear plan was found with smaller ones"
    found = [
        f"{text} (thrust lost at {at.failed_at:.1f} s)" if isfinite(at.failed_at) else text
        for text, at in zip(where, plan.contacts, strict=True)
    ]
    if found:
        listed = ", ".join(found)
        if len(found) > MOST_CONTACTS:
            listed = f"{len(found)} contacts, from {found[0]} to {found[-1]}"
        yield f"Active constraints ({margin(plan)}keep-out zones): {listed}"
    else:
        yield "Active constraints: no contact with a zone"
    if plan.prices:
        (one, other), most, _ = prices(plan, names, result.after.names).rows[0]
        share = f" ({100.0 * plan.price / plan.spent:+.3g} %)" if plan.spent > 0.0 else ""
        part = f", {100.0 * most / plan.price:.3g} % of it for {one} - {other}" * (len(plan.prices) > 1)
        yield f"Shadow price: {plan.price:.4g} {unit} per metre of clearance{share}{part}"
        if plan.sigmas:
            more = sum(price.per_sigma for price in plan.prices)
            yield f"Planned clear at {plan.sigmas:g} sigma; shadow price {more:.4g} {unit} per sigma"


def prices(plan: Plan, names: Sequence[str], order: Sequence[str]) -> Table:
    """Return the shadow prices by pair; the plan indexes `names`, and `order` sorts the names of a pair."""
    unit, (metre, factor) = UNITS[plan.cost], SLOPES[plan.cost]
    columns = (
        PAIR,
        Column(f"per metre [{unit}]", metre, "{:#.4g}".format),
        Column(f"per 1 % of the zone [{unit}]", factor, "{:#.4g}".format, 0.01),
    )
    pairs = [sorted((names[one.first], names[one.second]), key=order.index) for one in plan.prices]
    rows = [
        (tuple(pair), one.per_metre, one.per_factor) for pair, one in zip(pairs, plan.prices, strict=True)
    ]
    return Table("Shadow prices of clearance", columns, rows, folded=True)


def optimum_figures(plan: Plan, names: Sequence[str], order: Sequence[str]) -> dict[str, Any]:
    """Return the optimality of a plan for `summary.json`."""
    return {
        "ok": plan.ok,
        "status": str(plan.status),
        "reason": plan.reason,
        "cost": plan.cost,
        "lower_bound_m2_s3": plan.lower_bound if plan.cost == "energy" else None,
        "lower_bound_m_s": plan.lower_bound if plan.cost == "delta-v" else None,
        "gap": plan.gap,
        "proven": plan.proven,
        "clearance_ratio": plan.clearance_ratio,
        "tried": plan.tried,
        "clearance": prices(plan, names, order).records if plan.priced else None,
        f"clearance_{SLOPES[plan.cost][0]}": plan.price if plan.priced else None,
    }


def spent_on(mission: Mission, result: Joint, paths: Path) -> Any:
    """Return the cost of each moving spacecraft on its path (N,), in the unit of the stage's cost."""
    if result.stage.cost != "delta-v":
        return paths.energy
    return [effort.asked(mission, result, name, paths[k]) for k, name in enumerate(result.result.movers)]


def path_tables(mission: Mission, result: Joint) -> Iterator[Table]:
    """Yield the tables of each spacecraft's path and cost."""
    from closeform.fuel.burns import burns_of

    moved, plan = result.result, result.result.plan
    movers = [result.after.names.index(name) for name in moved.movers]
    paths, by_delta_v = result.planned.paths[movers], result.stage.cost == "delta-v"
    values = spent_on(mission, result, paths), spent_on(mission, result, plan.direct)
    cost, direct = (np.append(one, np.sum(one)) for one in values)
    columns: dict[Column, Iterable[Any]] = {Column("craft", words=True): [*moved.movers, "all"]}
    if result.stage.assigns:
        columns[Column("slot", absent="")] = [*(k + 1 for k in plan.slots.tolist()), None]
    for title, times in (("from [s]", plan.starts), ("to [s]", plan.starts + plan.durations)):
        if np.ptp(times) > 0.0:
            columns[Column(title, form="{:.1f}".format, absent="", since="mission")] = [*times, None]
    columns[effort.SPEED if by_delta_v else effort.ENERGY] = cost
    if result.planned is not result.before:
        shares = [effort.above(one, free) for one, free in zip(cost, direct, strict=True)]
        columns[Column("extra [%]", form="{:.3f}".format, scale=100.0)] = shares
    spent = [effort.spent(mission, result, name, result.planned.path(name)) for name in moved.movers]
    _, speed, push, force, fuel = zip(*spent, strict=True)
    if by_delta_v:
        burns = [len(burns_of(paths[k]).significant.size) for k in range(len(movers))]
        title = "impulses" if any(paths[k].impulses for k in range(len(movers))) else "burns"
        columns[Column(title)] = [*burns, sum(burns)]
    else:
        columns[effort.SPEED] = [*speed, sum(speed)]
        if mission.scenario.newtons:
            columns[replace(effort.FORCE, heading="peak [N]")] = [*force, max(force)]
        else:
            columns[replace(effort.PUSH, heading="peak [mm/s²]")] = [*push, max(push)]
    if None not in fuel and result.pulsed is None:
        columns[effort.in_grams(mission, effort.FUEL)] = [*fuel, sum(fuel)]
    rows = list(zip(*columns.values(), strict=True))
    shown = effort.of_plan(columns, result.pulsed is not None)
    title = "Paths of the plan" if plan.ok else "Direct paths"
    if len(movers) > MOST_ROWS:
        yield Table(f"{title}, all {len(movers)} craft", shown, rows[-1:])
    # for a single craft, the total repeats its row
    yield Table(title, shown, rows if len(movers) > 1 else rows[:1], folded=len(movers) > MOST_ROWS)


def avoid_pictures(mission: Mission, result: Avoiding) -> Iterator[Picture]:
    """Yield pictures of the avoiding spacecraft and of those that share the zone of the closest approach."""
    moved, before = result.result, result.before
    craft, path, around = moved.craft, moved.direct, moved.plan.path
    corridor, limit = (moved.required.get(name) for name in ("approach corridor", "speed limit"))
    planned = path if around is None else around
    if limit is not None:
        yield Picture("speed", f"Speed of {craft} and its limit", "speed", (planned, limit))
    if not moved.others:
        return
    approaches = [
        closest_approach(path, before.path(name), zone)
        for name, zone in zip(moved.others, moved.zones, strict=True)
    ]
    ranked = [nearest_first(one.ratio, one.time) for one in approaches]
    closest = ranked.index(min(ranked))
    other, zone = moved.others[closest], moved.zones[closest]
    pair = path, before.path(other), zone
    by_energy = result.stage.cost == "energy"  # impulses are drawn as burns
    if around is not None and np.array_equal(around.arcs, path.arcs):
        around = None  # the plan keeps the direct path
    shows = "before: the direct path" if around is not None else ""
    caption = f"{craft} relative to {other}, before"
    yield Picture("distances", caption, "distances", pair, {"names": (craft, other)}, shows=shows)
    if before.conflicts and by_energy:
        caption = (
            f"Paths of {craft} past {other} alone: the lowest cost on each passing side, where one exists"
        )
        yield Picture("two-ways", caption, "two_ways", pair, {"name": other})
    paths, labels = [path], [craft]
    if around is not None or corridor is not None:
        names = [name for name, one in zip(moved.others, moved.zones, strict=True) if one is zone]
        both, options = (path, planned, [before.path(name) for name in names], zone), {"names": names}
        when = "as planned, not as executed" if result.pulsed is not None else ""
        caption = f"The path of {craft} before and after"
        with_corridor = options | {"corridor": corridor}
        yield Picture("before-after", caption, "before_after", both, with_corridor, shows=when)
        caption = f"Clearance ratio of {craft} to the zones of the others, before and after"
        yield Picture("nearness", caption, "ratios", both, options, shows=when)
        if around is not None:
            paths, labels = [path, around], ["before", "after"]
    else:
        formation = {"names": before.names, "zone": mission.scenario.zones}
        caption = "The direct paths of all"
        yield Picture("paths", caption, "formation_paths", (before.paths, before.paths), formation)
    if by_energy:
        mass = {"mass": mission.scenario.force_mass(craft)}
        yield Picture("thrust", f"Thrust of {craft}", "thrust", (paths, labels), mass)


def reconfigure_pictures(mission: Mission, result: Joint) -> Iterator[Picture]:
    """Yield pictures of the paths, of the clearance of pairs, and of the thrust."""
    paths, scenario = result.after.paths, mission.scenario
    changed = result.planned is not result.before  # at this scale pulses do not differ from their plan
    direct = result.before.paths if changed else paths
    names = {"names": result.after.names}
    caption = "All paths: direct and planned" if changed else "The direct paths"
    yield Picture("paths", caption, "formation_paths", (direct, paths), names | {"zone": scenario.zones})
    if result.after.approaches:
        matrix = len(result.after.approaches) > 1
        if matrix and result.before.conflicts and changed:
            caption = "Minimum clearance ratio of each pair on direct paths"
            pairs = direct, scenario.zones
            shows = "before: the direct paths"
            yield Picture("ratios-before", caption, "ratio_matrix", pairs, names, shows=shows)
        if matrix:
            caption = "Minimum clearance ratio of each pair"
            yield Picture("ratios", caption, "ratio_matrix", (paths, scenario.zones), names)
        yield conflicts.nearest(result.after, scenario.zones)
    if result.stage.cost != "energy":
        return
    options: dict[str, Any] = {**names}
    craft, masses = scenario.craft_in(result.stage), [scenario.force_mass(name) for name in scenario.names]
    if any(one.limited for one in craft):
        options["limits"] = [one.max_acceleration for one in craft]
    if result.pulsed is not None:
        options["on_off"] = [name in result.pulsed.names for name in scenario.names]
    if None not in masses:
        options["masses"] = masses
    caption = "Thrust of each craft" + ", as planned" * (result.pulsed is not None)
    yield Picture("thrust", caption, "formation_thrust", (result.planned.paths,), options)
