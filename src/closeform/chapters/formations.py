"""The chapter of a formation that moved together: who flew where, at what cost, and how near the best."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from closeform.arrays import Floats
from closeform.chapters.moves import encounters, nearest
from closeform.chapters.searches import MOST_ROWS
from closeform.chapters.sheet import Chapter, Sheet, counted
from closeform.conflicts.flight import Flight
from closeform.scenario import Regather, Scatter
from closeform.stage_results import Leg, Reshaping

MOST_TOUCHES = 6  # on one line; more are counted


def reshaped(title: str, leg: Leg, deed: Reshaping, burnt: Floats) -> Chapter:
    """A formation that moved; `burnt` is the propellant (N,) [kg] of every craft, nan where not known."""
    if leg.after is leg.before:
        lines, sheets = summed("Conflicts" if deed.plan.ok else "Conflicts of the direct paths", leg.before)
        approaches = nearest("Closest approaches", leg.before)
        after_lines: tuple[str, ...] = ()
    else:
        lines, sheets = summed("Conflicts of the direct paths", leg.before)
        after_lines, after_sheets = summed("Conflicts of the plan", leg.after)
        sheets += after_sheets
        approaches = nearest("Closest approaches of the direct paths", leg.before)
        approaches += nearest("Closest approaches of the plan", leg.after)
    sheets += (*costs(leg, deed, burnt), *contacts(deed), *approaches)
    return Chapter(title, (*tried(deed), *lines), sheets, (*worth(leg, deed), *after_lines, *reached(leg)))


def summed(title: str, flight: Flight) -> tuple[tuple[str, ...], tuple[Sheet, ...]]:
    """Conflicts; where they are many, a line for the terminal and the sheet for the report."""
    lines, sheets = encounters(title, flight)
    if len(flight.encounters) <= MOST_ROWS:
        return lines, sheets
    pairs = len({(met.first, met.second) for met in flight.encounters})
    worst = min(flight.encounters, key=lambda met: round(met.conflict.ratio, 6))
    often = f"{len(flight.encounters)} in " if len(flight.encounters) > pairs else ""
    line = (
        f"{title}: {often}{pairs} of {len(flight.nearest)} pairs; deepest are {worst.first} and "
        f"{worst.second}, {worst.conflict.ratio:.4f} x zone at {worst.conflict.time:.1f} s"
    )
    return (line,), tuple(replace(sheet, more=True) for sheet in sheets)


def costs(leg: Leg, deed: Reshaping, burnt: Floats) -> Iterator[Sheet]:
    """What every craft flies and what that costs, and how much more its energy is than on the direct path."""
    plan, names = deed.plan, leg.after.names
    who = [names.index(name) for name in deed.movers]
    paths, direct = leg.after.paths[who], plan.direct.energy
    columns = {"craft": [*deed.movers, "all"]}
    if leg.stage.assigns:
        columns["slot"] = [*(str(k + 1) for k in plan.slots), ""]
    for title, times in (("from [s]", plan.starts), ("to [s]", plan.starts + plan.durations)):
        if np.ptp(times) > 0.0:
            columns[title] = [*(f"{time:.1f}" for time in times), ""]
    energy = np.append(paths.energy, paths.energy.sum())
    columns["energy [m²/s³]"] = [f"{value:#.6g}" for value in energy]
    if leg.after is not leg.before:
        pairs = zip(energy, np.append(direct, direct.sum()), strict=True)
        columns["extra [%]"] = [f"{100.0 * (one / free - 1.0):.3f}" if free else "-" for one, free in pairs]
    columns["delta-v [m/s]"] = [f"{value:#.6g}" for value in (*paths.delta_v, paths.delta_v.sum())]
    peaks = 1e3 * paths.peak_thrust
    columns["peak [mm/s²]"] = [f"{value:#.6g}" for value in (*peaks, peaks.max())]
    fuel = burnt[who]
    if np.isfinite(fuel).any():
        grams = 1e3 * np.append(fuel, fuel.sum())
        columns["propellant [g]"] = [f"{mass:.2f}" if np.isfinite(mass) else "-" for mass in grams]
    rows = tuple(zip(*columns.values(), strict=True))
    title = "Paths of the plan" if plan.ok else "Direct paths"
    if len(who) == 1:
        rows = rows[:1]  # that is all
    many = len(who) > MOST_ROWS
    if many:
        yield Sheet(f"{title}, all {len(who)} craft", tuple(columns), rows[-1:])
    yield Sheet(title, tuple(columns), rows, more=many)


def contacts(deed: Reshaping) -> Iterator[Sheet]:
    """Where paths of the plan touch zones."""
    rows = tuple((f"{one} - {other}", f"{time:.3f}") for one, other, time in touched(deed))
    if rows:
        yield Sheet("Where the plan touches zones", ("pair", "at [s]"), rows, more=True)


def touched(deed: Reshaping) -> list[tuple[str, str, float]]:
    """Two craft and the time [s] of every contact."""
    return [(deed.names[at.first], deed.names[at.second], at.time) for at in deed.plan.touches]


def tried(deed: Reshaping) -> Iterator[str]:
    """What was tried beyond what was asked for."""
    for measure in deed.measures:
        yield f"Tried: {measure}"


def worth(leg: Leg, deed: Reshaping) -> Iterator[str]:
    """How good the plan is, and where craft touch each other's zones."""
    plan = deed.plan
    how = "jointly" if deed.method == "joint" else "one craft after another"
    if not plan.ok:
        yield f"Planned {how}, without success: these are the direct paths"
        return
    best = "proven the global optimum" if plan.proven else f"best of {counted(plan.tried, 'way')} tried"
    if leg.after is leg.before:
        yield f"Planned {how}: everybody takes the direct path; {best}"
        return
    yield f"Planned {how}: {best}"
    bound = f"{plan.lower_bound:.6g} m²/s³ of the direct paths"
    yield f"Energy {100 * plan.gap:.3f} % above the lower bound, {bound}"
    where = [f"{one} - {other} at {time:.1f} s" for one, other, time in touched(deed)]
    if len(where) > MOST_TOUCHES:
        yield f"Touches zones {len(where)} times, from {where[0]} to {where[-1]}"
    elif where:
        yield f"Touches zones: {', '.join(where)}"


def reached(leg: Leg) -> Iterator[str]:
    """What a formation that scattered or regathered has come to."""
    stage, flight = leg.stage, leg.after
    if leg.failure is not None:
        return
    if isinstance(stage, Regather):
        yield f'Everybody is back on the relative orbit of the start of "{stage.as_before}"'
    if not isinstance(stage, Scatter):
        return
    start, end = (flight.paths.position(time) for time in (leg.start, leg.end))
    if stage.factor is None:
        point, _ = stage.away
        far = np.linalg.norm(end - np.array(point), axis=-1)
        yield f"Ends at least {far.min():.1f} m from the point ({flight.names[int(far.argmin())]})"
    elif len(flight.names) > 1:
        one, other = np.triu_indices(len(flight.names), 1)
        shares = np.linalg.norm(end[one] - end[other], axis=-1) / np.linalg.norm(
            start[one] - start[other], axis=-1
        )
        k = int(shares.argmin())
        pair = f"{flight.names[one[k]]} and {flight.names[other[k]]}"
        yield f"Every pair ends at least {shares[k]:.4g} times as far apart as it began ({pair})"
