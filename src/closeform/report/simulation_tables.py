"""Tables of a mission simulated in the high-fidelity model: stages, costs and the worst simulations."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from closeform.dynamics.field import described
from closeform.mission.simulation import FlownRun, FlownStage
from closeform.report import effort
from closeform.report.section import Section
from closeform.report.table import PAIR, Column, Table

WORST = 10  # number of simulations that are listed
# Headings for a single simulation, which has neither median nor maximum; None hides a redundant column.
ALONE = {
    **dict.fromkeys(("end_95_m", "end_most_m", "feedback_most_m_s", "seed", "violated")),
    "delta_v_m_s": "all [m/s]",
}
STAGES = (
    Column("stage", "number"),
    Column("does", "do", words=True),
    Column("to [s]", "end_s", "{:.1f}".format),
    Column("off [m]", "end_median_m", "{:.3g}".format),
    Column("95 % [m]", "end_95_m", "{:.3g}".format),
    Column("most [m]", "end_most_m", "{:.3g}".format),
    Column("least", "ratio", "{:.4f} x zone".format),
    PAIR,
    Column("flight", "seed"),
    Column("entered [%]", "violated", "{:.4g}".format, scale=100.0),
)
SPENT = (
    Column("craft", "craft", words=True),
    Column("plan [m/s]", "plan_m_s", "{:.6g}".format),
    Column("field [m/s]", "field_m_s", "{:+.3g}".format),
    Column("feedback [m/s]", "feedback_m_s", "{:+.3g}".format),
    Column("most [m/s]", "feedback_most_m_s", "{:+.3g}".format),
    Column("all, most [m/s]", "delta_v_m_s", "{:.6g}".format),
    Column("at limit [%]", "limited", "{:.3g}".format, scale=100.0),
)
FLIGHTS = (
    Column("flight", "seed"),
    Column("least", "ratio", "{:.4f} x zone".format),
    PAIR,
    Column("ends off [m]", "end_m", "{:.3g}".format),
    Column("at most off [m]", "deviation_m", "{:.3g}".format),
    Column("delta-v of all [m/s]", "delta_v_m_s", "{:.6g}".format),
)
TUBE = (
    Column("off its path by", "cause", words=True),
    Column("at most [m]", "most_m", "{:.3g}".format),
)


def tables(flown: FlownRun) -> tuple[Table, ...]:
    """Return the tables of stages, of costs, and of the worst simulations."""
    worst = [flight(flown, seed) for seed in order(flown)[:WORST]]
    weighed = not np.isnan(flown.propellant).all()
    many = len(worst) > 1
    burnt = "most [kg]" if many else "propellant [kg]"
    fuel = effort.in_grams(flown, replace(effort.FUEL, heading=burnt if weighed else None))
    ends = "; ends off in the median, in 95 % and at most" if many else ", and how far off it ends"
    spends = "; on feedback in the median flight and at most" if many else ""
    if flown.control == "track" and flown.told["feedback"].impulses:
        spends += "; feedback holds coasts against the field, too"
    stages, costs = (
        some if many else tuple(replace(one, heading=ALONE.get(one.key or "", one.heading)) for one in some)
        for some in (STAGES, (*SPENT[:-1], fuel, SPENT[-1]))
    )
    flights = FLIGHTS if many else (replace(FLIGHTS[0], heading=None), *FLIGHTS[1:])
    return (
        Table(
            f"Stages, each from where the one before was flown to{ends}",
            stages,
            [stage(flown, one) for one in flown.stages],
        ),
        Table(f"What each craft spends{spends}", costs, [*spent(flown)]),
        Table("The worst flights" if many else "The flight", flights, worst),
    )


def stage(flown: FlownRun, one: FlownStage) -> tuple[Any, ...]:
    """Return a row of STAGES."""
    worst = one.ends.max(axis=1)
    least: tuple[Any, ...] = (None, None, None, None)
    if one.nearest is not None:
        seed, row = one.nearest
        share = float((one.ratios < 1.0).any(axis=1).mean())
        least = float(one.ratios[seed, row]), pair(flown, row), seed, share
    ends = (float(v) for v in (np.median(worst), np.quantile(worst, 0.95), worst.max()))
    return one.number, one.verb, one.end, *ends, *least


def spent(flown: FlownRun) -> Iterator[tuple[Any, ...]]:
    """Yield the rows of SPENT, one per spacecraft and one for all."""
    told, back, tanks = flown.flight, flown.flight.feedback_delta_v, flown.propellant
    bounded, engine = flown.told["max_acceleration"] is not None, flown.told["engine"]
    for k, name in enumerate(flown.names):
        yield (
            name,
            float(told.planned_delta_v[k]),
            float(told.field_delta_v[k]),
            float(np.median(back[:, k])),
            float(back[:, k].max()),
            float(told.delta_v[:, k].max()),
            known(tanks[:, k].max()),
            float(told.limited[:, k].max()) if (bounded or name in flown.thrusters) and engine[k] else None,
        )
    planned, field, every = (
        one.sum(axis=-1) for one in (told.planned_delta_v, told.field_delta_v, told.delta_v)
    )
    of_all = back.sum(axis=1)
    costs = map(float, (planned, field, np.median(of_all), of_all.max(), every.max()))
    yield "all", *costs, known(tanks.sum(axis=1).max()), None


def known(value: Any) -> float | None:
    """Return a number, or None in place of nan."""
    return None if np.isnan(value) else float(value)


def order(flown: FlownRun) -> list[int]:
    """Return the indices of the simulations, worst first."""
    told = flown.flight
    by = told.ratios.min(axis=1) if told.ratios.size else -told.ends.max(axis=1)
    return [int(k) for k in np.argsort(by, kind="stable")]


def flight(flown: FlownRun, seed: int) -> tuple[Any, ...]:
    """Return a row of FLIGHTS."""
    told, ratio, both = flown.flight, None, None
    if told.ratios.size:
        k = int(np.argmin(told.ratios[seed]))
        ratio, both = float(told.ratios[seed, k]), pair(flown, k)
    off, cost = told.deviations[seed], float(told.delta_v[seed].sum())
    return seed, ratio, both, float(off[:, -1].max()), float(off.max()), cost


def pair(flown: FlownRun, row: int) -> tuple[str, str]:
    """Return the names of a pair by its row."""
    i, j = flown.flight.pairs[row]
    return flown.names[i], flown.names[j]


def contained(flown: FlownRun) -> float:
    """Return the predicted deviation that nearly all simulations stay within [m]."""
    times, room = flown.flight.times, flown.tube
    assert room is not None
    return float(np.max(room.containment(float(times[-1] - times[0]), craft=len(flown.names))))


def sure(flown: FlownRun) -> Section:
    """Return the section on certified and sampled figures, and on the parts of the tracking-error tube."""
    room, fading = flown.tube, flown.told["navigation"].correlation
    noise = f"fading to 1/e in {fading:g} s" if fading else "white from one measurement to the next"
    rows = [
        (
            "Least ratios of flights",
            "at instants at most some seconds apart, and on the cubics between them; of the worst flight "
            "certified between its states",
        ),
        (
            "Field",
            f"{described(flown.field)}, integrated by Runge and Kutta's method; known to "
            "who thrusts, so that what is left are errors of measurements and thrust",
        ),
        (
            "Uncertainty",
            f"{noise} unless they are biases, which stay through a flight, "
            "as errors of thrust do; each flight has a stream of its own",
        ),
    ]
    tables = [
        Table("How sure it is", (Column("figure", words=True), Column("how sure it is", words=True)), rows)
    ]
    if room is not None:
        parts = [("the field, not known", room.model), ("thrust that is off", room.thrust)]
        parts += [("biases", room.bias), (f"noise, {room.sigmas:g} sigmas", room.sigmas * room.noise)]
        parts += [("all of it", room.radius), ("all of it, of a pair", room.of_a_pair)]
        share = f"{100.0 * room.probability:.3f} % of flights"
        parts += [(f"all craft at all times, in {share}", contained(flown))]
        tables.append(
            Table("The tube, said beforehand", TUBE, [(one, float(np.max(part))) for one, part in parts])
        )
    return Section("Limits of what was flown", (), tuple(tables))
