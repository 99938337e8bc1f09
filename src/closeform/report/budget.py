"""Budget of a mission: delta-v, propellant and thrust time of each spacecraft, by stage and in total."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.mission.mission_result import Mission
from closeform.report import effort, limits
from closeform.report.section import Section
from closeform.report.table import MOST_ROWS, Column, Table

SECONDS = Column("under thrust [s]", "under_thrust_s", "{:.1f}".format)


def section(mission: Mission, thrusting: Floats) -> Section:
    """Return the budget; `thrusting` is the thrust time of each spacecraft in each stage (S, N) [s]."""
    flown = np.array([result.flown for result in mission.results])
    spent, burnt = np.where(flown[:, None], [mission.delta_v, mission.propellant], 0.0)
    end = max((result.end for result in mission.results), default=0.0)
    if not spent.any():
        return Section("Budget", (f"Nobody burns, in {end:.1f} s",))
    in_all = limits.used(mission)
    columns, rows = in_all.columns, in_all.rows
    each = replace(
        in_all,
        columns=(*columns[:2], SECONDS, *columns[2:]),
        rows=[(*row[:2], long, *row[2:]) for row, long in zip(rows, thrusting.sum(axis=0), strict=True)],
    )
    every = limits.with_total(mission, each)
    lines = [f"{total(mission, spent)}, in {end:.1f} s"]
    if not thrusting.any():
        lines.append("All burns are impulses, which take no time")
    fuel = effort.in_grams(mission, effort.FUEL)
    parts = (
        (replace(effort.SPEED, form="{:.6f}".format), spent),
        (fuel, burnt),
        (SECONDS, thrusting),
    )
    busy = (spent > 0.0).any(axis=1)
    stages = [
        by_stage(mission, column, values[busy], busy)
        for column, values in parts
        if busy.sum() > 1 and np.nansum(values) > 0.0
    ]
    return Section("Budget", tuple(lines), (every, *stages))


def total(mission: Mission, spent: Floats) -> str:
    """Return the total delta-v and the largest share in words."""
    each, names = spent.sum(axis=0), mission.scenario.names
    most = int(np.argmax(each))
    share = f", most {each[most]:.4g} m/s ({names[most]})" if len(names) > 1 else ""
    return f"Delta-v of all {each.sum():.4g} m/s{share}"


def by_stage(mission: Mission, column: Column, values: Floats, busy: Any) -> Table:
    """Return the table of values (S, N) of each spacecraft in the stages with burns."""
    numbers = [result.number for result, one in zip(mission.results, busy, strict=True) if one]
    words, _, unit = (column.heading or "").partition(" [")
    columns = [Column("craft", words=True)]
    columns += [replace(column, heading=f"stage {number}", key=None) for number in numbers]
    columns.append(replace(column, heading="in all", key=None))
    rows = [
        (name, *each.tolist(), float(each.sum()))
        for name, each in zip(mission.scenario.names, values.T, strict=True)
    ]
    rows.append(("all", *np.nansum(values, axis=1).tolist(), float(np.nansum(values))))
    title = f"{words.capitalize()} by stage [{unit}"
    return Table(title, tuple(columns), rows, folded=len(rows) > MOST_ROWS + 1)


def thrusting(mission: Mission, burns: Sequence[Mapping[str, Table]]) -> Floats:
    """Return the thrust time of each spacecraft in each stage (S, N) [s], from the tables of burns."""
    found = np.zeros((len(burns), len(mission.scenario.names)))
    place = {name: k for k, name in enumerate(mission.scenario.names)}
    for stage, tables in enumerate(burns):
        if "burns" not in tables:
            continue
        stored, reached = tables["burns"].stored, dict[str, float]()
        columns = stored["craft"], stored["start_s"], stored["duration_s"]
        for name, start, duration in zip(*columns, strict=True):  # in order of time; burns may overlap
            end = start + duration
            found[stage, place[name]] += max(0.0, end - max(start, reached.get(name, start)))
            reached[name] = max(end, reached.get(name, end))
    return found


def figures(mission: Mission, thrusting: Floats) -> list[dict[str, Any]]:
    """Return the budget of each stage for `summary.json`."""
    names = mission.scenario.names

    def each(values: Floats) -> dict[str, float]:
        return dict(zip(names, values.tolist(), strict=True))

    return [
        {
            "stage": result.number,
            "duration_s": result.end - result.start,
            "delta_v_m_s": each(mission.delta_v[k]),
            "propellant_kg": each(mission.propellant[k]),
            "under_thrust_s": each(thrusting[k]),
        }
        for k, result in enumerate(mission.results)
        if result.flown
    ]
