"""Section of the transfer of a single spacecraft: its cost, and the cost of each actuator option."""

from collections.abc import Iterator

from closeform.mission.mission_result import Mission, StageResult, TransferResult
from closeform.report import arrival, burns, conflicts, effort
from closeform.report.actuator_options import Choices
from closeform.report.picture import Picture
from closeform.report.section import Section, heading
from closeform.report.table import Column, Table
from closeform.scenario import Transfer

Flown = StageResult[Transfer, TransferResult]


def section(mission: Mission, result: Flown) -> Section:
    """Return the section of a transfer."""
    name = result.result.craft
    choices, fired = Choices(mission, result, [name]), burns.StageBurns(mission, result)
    lines, met = conflicts.summed("Conflicts", result.after) if result.after.approaches else ((), ())
    path = result.planned.path(name)
    shown = effort.of_plan(effort.columns(mission, [path]), result.pulsed is not None)
    columns = (Column("path", words=True), *shown)
    arrived = arrival.lines(name, result.result.goal, result.stage.drift is not None)
    title = "Path of the plan" if result.flown else "Path without a limit"
    row = "plan" if result.flown else "free", *effort.spent(mission, result, name, path)
    return Section(
        heading(result, f"{name} moves"),
        lines,
        (*met, Table(title, columns, [row]), *choices.table(zones=False), *fired.tables),
        (*choices.lines, *arrived, *worth(mission, result, choices), *burns.lines(mission, result)),
        conflicts.film(result, mission.scenario.zones) + pictures(mission, result, choices),
        {
            "transfer": {
                "craft": name,
                "cost": result.stage.cost,
                "asked_s": result.result.asked,
                "arrival": arrival.figures(result.result.goal),
                "planned": effort.figures(mission, result, name, path if result.flown else None),
                **choices.figures,
                **fired.figures,
            }
        },
        fired.files,
    )


def worth(mission: Mission, result: Flown, choices: Choices) -> Iterator[str]:
    """Yield the delta-v of the plan, compared with the minimum for free thrust."""
    if not result.flown:
        yield "No such transfer: this is the path without a limit, which is not flown"
        return
    if choices.least is None:
        return
    path = result.planned.path(result.result.craft)
    spent, lower = effort.asked(mission, result, result.result.craft, path), choices.lower
    if lower > 0.0:
        planned = " planned" if result.pulsed is not None else ""
        above = f"{100.0 * (spent / lower - 1.0):.3f} % above the least of free thrust, {lower:.6g} m/s"
        yield f"Delta-v{planned} {spent:.6g} m/s, {above}"


def pictures(mission: Mission, result: Flown, choices: Choices) -> tuple[Picture, ...]:
    """Return pictures of the path, its thrust and burns, and the actuator options."""
    flown, names = result.after.paths, {"names": result.after.names}
    found = [Picture("paths", "The path", "formation_paths", (flown, flown), names)]
    craft, path = result.result.craft, result.planned.path(result.result.craft)
    if path.peak_thrust > 0.0:
        label = "plan" if result.pulsed is None else "plan, which thrusters fire on and off"
        mass = {"mass": mission.scenario.force_mass(craft)}
        found.append(Picture("thrust", f"Thrust of {craft}", "thrust", ([path], [label]), mass))
    return (*found, *burns.pictures(result), *choices.pictures)
