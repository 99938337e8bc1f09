"""The chapter of a formation that moved together: who flew where, at what cost, and how near the best."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from closeform.chapters.moves import encounters, nearest
from closeform.chapters.searches import MOST_ROWS
from closeform.chapters.sheet import Chapter, Sheet, counted
from closeform.flight import Flight
from closeform.legs import Leg, Reshaping
from closeform.zones import Floats

MOST_TOUCHES = 12  # on one line; more are counted


def reshaped(title: str, leg: Leg, deed: Reshaping, burnt: Floats) -> Chapter:
    """A formation that moved; `burnt` is the propellant (N,) [kg] of every craft, nan where not known."""
    lines, sheets = summed("Conflicts of the direct paths", leg.before)
    after_lines, after_sheets = summed("Conflicts of the plan", leg.after)
    if not deed.plan.ok:
        after_lines, after_sheets = ("The direct paths are kept: there is no plan",), ()
    sheets += (
        *costs(leg, deed, burnt),
        *after_sheets,
        *nearest("Closest approaches of the direct paths", leg.before),
        *nearest("Closest approaches of the plan", leg.after),
    )
    return Chapter(title, (*tried(deed), *lines), sheets, (*worth(deed), *after_lines))


def summed(title: str, flight: Flight) -> tuple[tuple[str, ...], tuple[Sheet, ...]]:
    """Conflicts; where they are many, a line for the terminal and the sheet for the report."""
    lines, sheets = encounters(title, flight)
    if len(flight.encounters) <= MOST_ROWS:
        return lines, sheets
    pairs = len({(met.first, met.second) for met in flight.encounters})
    worst = min(flight.encounters, key=lambda met: round(met.conflict.ratio, 6))
    line = (
        f"{title}: {len(flight.encounters)}, of {counted(pairs, 'pair')}; deepest are {worst.first} and "
        f"{worst.second}, {worst.conflict.ratio:.4f} x zone at {worst.conflict.time:.1f} s"
    )
    return (line,), tuple(replace(sheet, more=True) for sheet in sheets)


def costs(leg: Leg, deed: Reshaping, burnt: Floats) -> Iterator[Sheet]:
    """What every craft flies and what that costs."""
    plan, names = deed.plan, leg.after.names
    who = [names.index(name) for name in deed.movers]
    paths = leg.after.paths[who]
    columns = {"craft": [*deed.movers, "all"]}
    if leg.stage.assigns:
        columns["slot"] = [*(str(k + 1) for k in plan.slots), ""]
    if len(set(plan.starts)) > 1 or len(set(plan.durations)) > 1:
        columns["from [s]"] = [*(f"{start:.1f}" for start in plan.starts), ""]
        columns["to [s]"] = [*(f"{end:.1f}" for end in plan.starts + plan.durations), ""]
    for title, values, total in (
        ("direct [m²/s³]", plan.direct.energy, np.sum),
        ("energy [m²/s³]", paths.energy, np.sum),
        ("delta-v [m/s]", paths.delta_v, np.sum),
        ("peak [mm/s²]", 1e3 * paths.peak_thrust, np.max),
    ):
        columns[title] = [f"{value:#.6g}" for value in (*values, total(values))]
    fuel = burnt[who]
    if np.isfinite(fuel).any():
        grams = 1e3 * np.append(fuel, fuel.sum())
        columns["propellant [g]"] = [f"{mass:.2f}" if np.isfinite(mass) else "-" for mass in grams]
    rows = tuple(zip(*columns.values(), strict=True))
    title = "Paths of the plan" if plan.ok else "Direct paths"
    many = len(who) > MOST_ROWS
    if many:
        yield Sheet(f"{title}, all {len(who)} craft", tuple(columns), rows[-1:])
    yield Sheet(title, tuple(columns), rows, more=many)


def tried(deed: Reshaping) -> Iterator[str]:
    """What was tried beyond what was asked for."""
    for measure in deed.measures:
        yield f"Tried: {measure}"


def worth(deed: Reshaping) -> Iterator[str]:
    """How good the plan is, and where craft touch each other's zones."""
    plan = deed.plan
    if not plan.ok:
        yield f"Planned {how(deed)}: {plan.status}: {plan.reason}"
        return
    best = "proven the global optimum" if plan.proven else f"best of {counted(plan.tried, 'way')} tried"
    yield f"Planned {how(deed)}: energy {plan.energy:.6g} m²/s³, delta-v {plan.delta_v:.6g} m/s in all"
    yield (
        f"Lower bound {plan.lower_bound:.6g} m²/s³, the free optima together; "
        f"{100 * plan.gap:.3f} % above it; {best}"
    )
    if plan.touches:
        touched = [
            f"{deed.names[at.first]} - {deed.names[at.second]} at {at.time:.1f} s" for at in plan.touches
        ]
        shown = ", ".join(touched[:MOST_TOUCHES])
        more = f" and {len(touched) - MOST_TOUCHES} more" if len(touched) > MOST_TOUCHES else ""
        yield f"Touching zones: {shown}{more}"


def how(deed: Reshaping) -> str:
    """In which way the plan was made."""
    return "jointly" if deed.method == "joint" else "one craft after another"
