"""Costs, burns, limits and the budget of a mission."""

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from math import isfinite
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.mission.mission_result import Mission, StageResult
from closeform.mission.stage_burns import burns_in
from closeform.mission.verdict import Use
from closeform.motion.path import Path
from closeform.report.description import MOST_ROWS, TOTAL, Column, Section, Table, counted, record
from closeform.report.picture import Picture

ENERGY = Column("energy [m²/s³]", "energy_m2_s3", "{:#.6g}".format)
SPEED = Column("delta-v [m/s]", "delta_v_m_s", "{:#.6g}".format)
PUSH = Column("peak thrust [mm/s²]", "peak_thrust_m_s2", "{:#.6g}".format, 1e3)
FORCE = Column("peak thrust [N]", "peak_thrust_N", "{:#.6g}".format)
FUEL = Column("propellant [kg]", "propellant_kg", "{:.5f}".format)
COST = ENERGY, SPEED, PUSH, FORCE, FUEL
OF_PLAN = {SPEED.key, PUSH.key, FORCE.key, FUEL.key}  # quantities that pulses change
UNUSED = "no thrust used"
CRAFT = Column("craft", "craft"), Column("slot", "slot"), *COST

NEGLIGIBLE = 1e-4  # of a cost: a minimum below this share


def above(spent: float, least: float) -> float | None:
    """Return the relative excess of a cost over the minimum; None if the minimum is negligible."""
    return spent / least - 1.0 if least > NEGLIGIBLE * spent else None


def in_grams(mission: Any, column: Column) -> Column:
    """Return a column of propellant in grams if the mission or the simulation uses them."""
    if not mission.grams or column.heading is None:
        return column
    return replace(column, heading=column.heading.replace("[kg]", "[g]"), form="{:.2f}".format, scale=1e3)


def asked(mission: Mission, result: StageResult[Any, Any], name: str, path: Path) -> float:
    """Return the delta-v [m/s] of a planned path, summed over the thrusters that it is planned for."""
    table = next(craft for craft in mission.scenario.craft_in(result.stage) if craft.name == name)
    thrusters = table.fired(1.0) if getattr(result.stage, "cost", None) == "delta-v" else None
    if thrusters is None or not result.executed:
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
    """Return the columns of COST shown for these paths, with thrust in newtons if the file uses it.

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
    """Return the columns without those in `hide`, and propellant in the unit of the mission."""
    kept = (replace(one, heading=None) if one.key in hide else one for one in columns)
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
    """Return the costs of each spacecraft, summed over thrusters, and its assigned slot, counted from 1."""
    rows = []
    for k, (name, used) in enumerate(zip(result.after.names, result.delta_v.tolist(), strict=True)):
        energy, _, peak, force, _ = spent(mission, result, name, result.after.paths[k])
        burnt = mission.burnt(result.number, k, used)
        slot, fuel = (slots or {}).get(name), burnt if isfinite(burnt) else None
        rows.append((name, slot, energy, used, peak, force, fuel))
    return {"craft": Table("", CRAFT, rows)}


ROUNDING = 5e-7  # m/s: half of the last printed digit
SMALLEST = 1e-5  # m/s: the smallest burn that is listed


def component(part: float) -> str:
    """Return a component of velocity [m/s] as text, "0" if it rounds to zero."""
    return f"{part:+.6f}" if abs(part) >= ROUNDING else "0"


BURN = (
    Column("craft", "craft", words=True),
    Column("at [s]", "start_s", "{:.1f}".format, since="mission"),
    Column("lasts [s]", "duration_s", "{:.1f}".format),
    Column("R [m/s]", "radial_m_s", component),
    Column("T [m/s]", "along_track_m_s", component),
    Column("N [m/s]", "cross_track_m_s", component),
    Column("size [m/s]", "size_m_s", "{:.6f}".format),
    Column("thruster", "thruster", absent=""),
    FUEL,
)
SIZE = [column.key for column in BURN].index("size_m_s")
PULSED = (
    Column("craft", "craft", words=True),
    Column("pulses", "pulses"),
    Column("planned [m/s]", "planned_m_s", "{:#.6g}".format),
    Column("fired [m/s]", "delta_v_m_s", "{:#.6g}".format),
    Column("deviation [m]", "deviation_m", "{:#.4g}".format),
    Column("bound [m]", "deviation_bound_m", "{:#.4g}".format),
    Column("dropped [m/s]", "dropped_m_s", "{:#.4g}".format),
    FUEL,
)


@dataclass(frozen=True, eq=False)
class StageBurns:
    """Burns that are executed in a stage."""

    mission: Mission
    result: StageResult[Any, Any]

    @cached_property
    def rows(self) -> list[tuple[Any, ...]]:
        """Rows of BURN in order of time: pulses of thrusters, or else the thrust of the paths."""
        return burns_in(self.result, partial(self.mission.burnt, self.result.number))

    @cached_property
    def shots(self) -> list[tuple[Any, ...]]:
        """Rows of PULSED, one per spacecraft that fires pulses."""
        if self.result.pulsed is None:
            return []
        rows, firing, mission = [], self.result.pulsed.firing, self.mission
        for k, name in enumerate(self.result.pulsed.names):
            spent = float(firing.delta_v[k])
            burnt = mission.burnt(self.result.number, mission.scenario.names.index(name), spent)
            rows.append(
                (
                    name,
                    int((firing.pulses.craft == k).sum()),
                    asked(mission, self.result, name, firing.planned[k]),
                    spent,
                    float(firing.deviation[k]),
                    float(firing.deviation_bound[k]),
                    float(firing.dropped.impulse[firing.dropped.craft == k].sum()),
                    burnt if isfinite(burnt) else None,
                )
            )
        return rows

    @property
    def tables(self) -> Iterator[Table]:
        """The tables of pulses and of burns; long ones are folded."""
        pulsed = self.result.pulsed
        if pulsed is not None:
            drops = set() if len(pulsed.firing.dropped) else {"dropped_m_s"}
            yield Table("Pulses of thrusters", shown(self.mission, PULSED, drops), self.shots)
        if self.result.executed and self.rows:
            title = "Burns" if pulsed is None else f"Burns, {counted(len(self.rows), 'pulse')}"
            columns = shown(self.mission, BURN)
            some = [row for row in self.rows if row[SIZE] >= SMALLEST]
            if left := len(self.rows) - len(some):
                title += f", without {left} below {1e3 * SMALLEST:g} mm/s (all are in burns.parquet)"
            yield Table(title, columns, some, folded=len(some) > MOST_ROWS)

    @property
    def figures(self) -> dict[str, Any]:
        """The results of pulses, for `summary.json`."""
        if self.result.pulsed is None:
            return {}
        margins = self.result.pulsed.room
        return {
            "pulsed": {
                "before_s": margins.before,
                "after_s": margins.after,
                "zones_larger_by": margins.larger,
                "short": self.result.pulsed.short,
                "craft": Table("", PULSED, self.shots).records,
            }
        }

    @property
    def files(self) -> dict[str, Table]:
        """All burns of an executed stage, for Parquet."""
        return {"burns": Table("", BURN, self.rows if self.result.executed else [])}


def pulse_lines(mission: Mission, result: StageResult[Any, Any]) -> Iterator[str]:
    """Yield the delta-v and the deviation of pulses, and the margins of the plan for them."""
    if result.pulsed is None:
        return
    margins, firing, names = result.pulsed.room, result.pulsed.firing, result.pulsed.names
    k = int(np.argmax(firing.deviation))
    clear = ", into zones" if result.after.conflicts else ", certified clear"
    planned = sum(asked(mission, result, name, firing.planned[k]) for k, name in enumerate(names))
    yield f"Delta-v fired {float(np.sum(firing.delta_v)):.6g} m/s, for {planned:.6g} m/s planned"
    yield (
        f"Pulses deviate by up to {firing.deviation[k]:.4g} m from the plan ({names[k]})"
        f"{clear if result.after.approaches else ''}"
    )
    if margins.time:
        coasts = f"{margins.before:.1f} s before it and {margins.after:.1f} s after it"
        yield f"The plan leaves {coasts} for burns at its ends"
    if margins.larger > 1.0:
        more = 100.0 * (margins.larger - 1.0)
        yield f"Planned for zones {more:.3g} % larger, to allow for the deviation of pulses"
    if result.pulsed.short is not None:
        yield f"Pulses require larger margins, which no plan provides: {result.pulsed.short}"


def burn_pictures(result: StageResult[Any, Any]) -> tuple[Picture, ...]:
    """Return pictures of the burns of all spacecraft, and of the pulses of the one that fires most."""
    if not result.executed:
        return ()
    burning = [k for k, spent in enumerate(result.delta_v.tolist()) if spent > 0.0]
    if not burning:
        return ()
    if result.pulsed is None:
        names = {"names": [result.after.names[k] for k in burning]}
        return (Picture("burns", "Burns of each craft", "burns", (result.after.paths[burning],), names),)
    firing, names = result.pulsed.firing, {"names": [*result.pulsed.names]}
    k = int(np.argmax(firing.delta_v))
    most = result.pulsed.names[k]
    return (
        Picture("burns", "Pulses of each craft", "burns", (firing,), names),
        Picture("pulses", f"Pulses of {most}", "pulses", (firing, k, most)),
    )


def greatest(mission: Mission, result: StageResult[Any, Any]) -> dict[str, tuple[Use, ...]]:
    """Return the largest use of each kind of limit in this stage and, if it is executed, up to its end."""
    if not result.executed:
        return {"Required by the direct paths": first_of_each(mission.thrusts(result))}
    return {
        "Peak": first_of_each(mission.thrusts(result)),
        "Highest use so far": first_of_each(mission.spent(slice(result.number))),
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


def limit_lines(mission: Mission, result: StageResult[Any, Any]) -> Iterator[str]:
    """Yield the largest use of each kind of limit as text."""
    for title, uses in greatest(mission, result).items():
        found = []
        for use in uses:
            used, limit, unit = use.shown(mission.grams)
            found.append(f"{use.what} {used:.4g} of {limit:g} {unit} ({use.craft})")
        if found:
            yield f"{title}: {', '.join(found)}"


def used_up(mission: Mission) -> tuple[Table, ...]:
    """Return the table of use in the whole mission, if it adds to those of the stages."""
    burns = np.any(mission.delta_v > 0.0, axis=1).sum()
    known = bool(np.isfinite(mission.spent_of_each[1]).any())
    useful = burns > 1 or known or mission.scenario.limited
    return (with_total(mission, used(mission)),) if burns and useful else ()


def used(mission: Mission) -> Table:
    """Return the use of each spacecraft in the whole mission, and in its simulations if there are any."""
    scenario, (delta_v, propellant) = mission.scenario, mission.spent_of_each
    uses, flights = {(use.what, use.craft): use for use in mission.uses}, mission.flights
    simulated = None if flights is None else flights.flight.delta_v
    how, left = ("", "left [kg]") if simulated is None else ("planned ", "left in simulation [kg]")
    most = "simulated" + ", most" * (simulated is not None and len(simulated) > 1)
    speeds_up = any(one.acceleration for one in scenario.craft_of_all)
    key, rows = "max_acceleration" if speeds_up else "max_thrust", []
    for k, craft in enumerate(scenario.craft):
        speed, tank, force = (uses.get((what, craft.name)) for what in ("delta-v", "propellant", "thrust"))
        rows.append(
            (
                craft.name,
                float(delta_v[k]),
                None if simulated is None else float(simulated[:, k].max()),
                speed and speed.share,
                float(propellant[k]) if isfinite(propellant[k]) else None,
                tank and tank.limit - tank.used,
                force and force.share,
            )
        )
    columns = [
        Column("craft", "craft", words=True),
        Column(f"{how}delta-v [m/s]", "delta_v_m_s", "{:.6f}".format),
        Column(f"{most} [m/s]", "simulated_delta_v_m_s", "{:.6f}".format),
        Column("of its budget [%]", "share_of_delta_v_budget", "{:.1f}".format, 100.0),
        in_grams(mission, replace(FUEL, heading=f"{how}propellant [kg]")),
        in_grams(mission, replace(FUEL, heading=left, key="propellant_left_kg")),
        Column(f"of {key} [%]", f"share_of_{key}", "{:.1f}".format, 100.0),
    ]
    title = "Use of each spacecraft" + ", planned and simulated" * bool(how)
    return Table(title, tuple(columns), rows, folded=len(rows) > MOST_ROWS, idle=UNUSED)


def with_total(mission: Mission, used: Table) -> Table:
    """Return the table with a last row for all spacecraft, if several burn; simulated values are maxima."""
    columns = dict(zip((column.key for column in used.columns), zip(*used.rows, strict=True), strict=True))
    if sum(spent > 0.0 for spent in columns["delta_v_m_s"]) < 2:
        return used
    fuel, flights = columns["propellant_kg"], mission.flights
    totals = {
        "craft": TOTAL,
        "delta_v_m_s": sum(columns["delta_v_m_s"]),
        "simulated_delta_v_m_s": flights and float(flights.flight.delta_v.sum(axis=1).max()),
        "propellant_kg": None if None in fuel else sum(fuel),
    }
    return replace(used, rows=[*used.rows, tuple(totals.get(column.key or "") for column in used.columns)])


def limit_figures(mission: Mission, result: StageResult[Any, Any]) -> dict[str, Any]:
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


SECONDS = Column("under thrust [s]", "under_thrust_s", "{:.1f}".format)


def budget(mission: Mission, thrusting: Floats) -> Section:
    """Return the budget; `thrusting` is the thrust time of each spacecraft in each stage (S, N) [s]."""
    executed, names = np.array([result.executed for result in mission.results]), mission.scenario.names
    spent, burnt = np.where(executed[:, None], [mission.delta_v, mission.propellant], 0.0)
    end = max((result.end for result in mission.results), default=0.0)
    if not spent.any():
        return Section("Budget", (f"No thrust used in {end:.1f} s",))
    each, total = spent.sum(axis=0), used(mission)
    every = replace(
        total,
        columns=(*total.columns[:2], SECONDS, *total.columns[2:]),
        rows=[
            (*row[:2], long, *row[2:]) for row, long in zip(total.rows, thrusting.sum(axis=0), strict=True)
        ],
    )
    most = int(np.argmax(each))
    share = f", most {each[most]:.4g} m/s ({names[most]})" if len(names) > 1 else ""
    lines = [f"Delta-v used by all craft {each.sum():.4g} m/s{share}, in {end:.1f} s"]
    if not thrusting.any():
        lines.append("All burns are impulses, which take no time")
    parts = (
        (replace(SPEED, form="{:.6f}".format), spent),
        (in_grams(mission, FUEL), burnt),
        (SECONDS, thrusting),
    )
    busy = (spent > 0.0).any(axis=1)
    stages = [
        by_stage(mission, column, values[busy], busy)
        for column, values in parts
        if busy.sum() > 1 and np.nansum(values) > 0.0
    ]
    return Section("Budget", tuple(lines), (with_total(mission, every), *stages))


def by_stage(mission: Mission, column: Column, values: Floats, busy: Any) -> Table:
    """Return the table of values (S, N) of each spacecraft in the stages with burns."""
    numbers = [result.number for result, one in zip(mission.results, busy, strict=True) if one]
    title, _, unit = (column.heading or "").partition(" [")
    headings = [*(f"stage {number}" for number in numbers), "in all"]
    columns = [Column("craft", words=True), *(replace(column, heading=one, key=None) for one in headings)]
    names, totals = mission.scenario.names, values.sum(axis=0)
    rows = [(name, *values[:, k].tolist(), float(totals[k])) for k, name in enumerate(names)]
    rows.append((TOTAL, *np.nansum(values, axis=1).tolist(), float(np.nansum(values))))
    many = len(rows) > MOST_ROWS + 1
    return Table(f"{title.capitalize()} by stage [{unit}", tuple(columns), rows, folded=many, idle=UNUSED)


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


def budget_figures(mission: Mission, thrusting: Floats) -> list[dict[str, Any]]:
    """Return the budget of each stage for `summary.json`."""
    names = mission.scenario.names
    of_craft = {
        "delta_v_m_s": mission.delta_v,
        "propellant_kg": mission.propellant,
        "under_thrust_s": thrusting,
    }
    return [
        {"stage": result.number, "duration_s": result.end - result.start}
        | {key: dict(zip(names, values[k].tolist(), strict=True)) for key, values in of_craft.items()}
        for k, result in enumerate(mission.results)
        if result.executed
    ]
