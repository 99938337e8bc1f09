"""Report of a mission simulated in the high-fidelity model: deviations, clearance ratios and costs."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import degrees
from typing import Any, Self

import numpy as np

from closeform.dynamics.force_model.field import described
from closeform.mission.simulation import SimulatedRun, SimulatedStage
from closeform.report.description import PAIR, Column, Section, Table, counted, state_columns
from closeform.report.page import Command, CommandReport
from closeform.report.picture import Picture
from closeform.report.sections import conflicts, effort, model_limits
from closeform.scenario.study import UNPLANNED, readers


def error_lines(errors: Sequence[Any]) -> Iterator[str]:
    """Yield the largest errors among the spacecraft: initial state, burns, impulses and process noise."""
    some = [one for one in errors if one is not None]
    axes = np.array([np.sqrt(np.diag(one.state)) for one in some]).reshape(-1, 2, 3)
    place, speed = axes.max(axis=(0, 2), initial=0.0)
    if place or speed:
        yield f"Initial states: {place:.3g} m and {1e3 * speed:.3g} mm/s (1 sigma, largest axis)"
    size, turn = np.array([[one.magnitude, one.pointing] for one in some]).reshape(-1, 2).max(0, initial=0.0)
    if size or turn:
        yield f"Burns: {100.0 * size:.3g} % and {degrees(turn):.3g} deg each (1 sigma)"
    gates = np.array([one.impulse for one in some]).reshape(-1, 4).max(axis=0, initial=0.0)
    if gates.any():
        fixed, share, across, turn = gates
        yield (
            f"Impulses: {1e3 * fixed:.3g} mm/s and {100.0 * share:.3g} % along each, "
            f"{1e3 * across:.3g} mm/s and {degrees(turn):.3g} deg across (1 sigma, Gates' model)"
        )
    if noise := max((one.noise for one in some), default=0.0):
        yield f"Process noise: white, {noise:.3g} m²/s³ along each axis"


def error_figures(errors: Sequence[Any]) -> list[dict[str, Any] | None]:
    """Return the errors of each spacecraft in SI units; None for a spacecraft without errors."""
    return [
        None
        if one is None
        else {
            "covariance": one.state.tolist(),
            "magnitude": one.magnitude,
            "pointing_rad": one.pointing,
            "gates": list(one.impulse),
            "noise_m2_s3": one.noise,
        }
        for one in errors
    ]


WORST = 10  # number of simulations that are listed
# Headings for a single simulation, which has neither median nor maximum; None hides a redundant column.
ALONE = {
    **dict.fromkeys(("end_95_m", "end_most_m", "feedback_most_m_s", "seed", "violated")),
    "delta_v_m_s": "total [m/s]",
}
STAGES = (
    Column("stage", "number"),
    Column("do", "do", words=True),
    Column("to [s]", "end_s", "{:.1f}".format),
    Column("deviation [m]", "end_median_m", "{:.3g}".format),
    Column("95 % [m]", "end_95_m", "{:.3g}".format),
    Column("largest [m]", "end_most_m", "{:.3g}".format),
    conflicts.RATIO,
    PAIR,
    Column("simulation", "seed"),
    Column("violated [%]", "violated", "{:.4g}".format, scale=100.0),
)
SPENT = (
    Column("craft", "craft", words=True),
    Column("plan [m/s]", "plan_m_s", "{:.6g}".format),
    Column("model error [m/s]", "field_m_s", "{:+.3g}".format),
    Column("feedback [m/s]", "feedback_m_s", "{:+.3g}".format),
    Column("largest [m/s]", "feedback_most_m_s", "{:+.3g}".format),
    Column("total, largest [m/s]", "delta_v_m_s", "{:.6g}".format),
    Column("at limit [%]", "limited", "{:.3g}".format, scale=100.0),
)
FLIGHTS = (
    Column("simulation", "seed"),
    conflicts.RATIO,
    PAIR,
    Column("end deviation [m]", "end_m", "{:.3g}".format),
    Column("largest deviation [m]", "deviation_m", "{:.3g}".format),
    Column("delta-v of all [m/s]", "delta_v_m_s", "{:.6g}".format),
)
TUBE = (
    Column("cause of deviation", "cause", words=True),
    Column("at most [m]", "most_m", "{:.3g}".format),
)


def tables(simulated: SimulatedRun) -> tuple[Table, ...]:
    """Return the tables of stages, of costs, and of the worst simulations."""
    worst = [flight_row(simulated, seed) for seed in order(simulated)[:WORST]]
    many = len(worst) > 1
    burnt = "largest [kg]" if many else "propellant [kg]"
    fuel = effort.in_grams(simulated, replace(effort.FUEL, heading=burnt))
    ends = ": median, 95 % and largest deviation at the end" if many else ": deviation at the end"
    spends = "; feedback: median and largest" if many else ""
    if simulated.control == "track" and simulated.arguments["feedback"].impulses:
        spends += "; feedback also cancels the model error during coasts"
    stages, costs = (
        some if many else tuple(replace(one, heading=ALONE.get(one.key or "", one.heading)) for one in some)
        for some in (STAGES, (*SPENT[:-1], fuel, SPENT[-1]))
    )
    flights = FLIGHTS if many else (replace(FLIGHTS[0], heading=None), *FLIGHTS[1:])
    return (
        Table(
            f"Stages, each from the simulated end of the previous one{ends}",
            stages,
            [stage_row(simulated, one) for one in simulated.stages],
        ),
        Table(f"Delta-v of each craft{spends}", costs, [*spent_rows(simulated)], idle=effort.UNUSED),
        Table("Worst simulations" if many else "Simulation", flights, worst),
    )


def stage_row(simulated: SimulatedRun, one: SimulatedStage) -> tuple[Any, ...]:
    """Return a row of STAGES."""
    worst = one.ends.max(axis=1)
    least: tuple[Any, ...] = (None, None, None, None)
    if one.nearest is not None:
        seed, row = one.nearest
        share = float((one.ratios < 1.0).any(axis=1).mean())
        least = float(one.ratios[seed, row]), pair(simulated, row), seed, share
    ends = (float(v) for v in (np.median(worst), np.quantile(worst, 0.95), worst.max()))
    return one.number, one.verb, one.end, *ends, *least


def spent_rows(simulated: SimulatedRun) -> Iterator[tuple[Any, ...]]:
    """Yield the rows of SPENT, one per spacecraft and one for all."""
    flight, back, tanks = simulated.flight, simulated.flight.feedback_delta_v, simulated.propellant
    bounded, engine = simulated.arguments["max_acceleration"] is not None, simulated.arguments["engine"]
    for k, name in enumerate(simulated.names):
        yield (
            name,
            float(flight.planned_delta_v[k]),
            float(flight.field_delta_v[k]),
            float(np.median(back[:, k])),
            float(back[:, k].max()),
            float(flight.delta_v[:, k].max()),
            known(tanks[:, k].max()),
            float(flight.limited[:, k].max())
            if (bounded or name in simulated.thrusters) and engine[k]
            else None,
        )
    planned, field, every = (
        one.sum(axis=-1) for one in (flight.planned_delta_v, flight.field_delta_v, flight.delta_v)
    )
    of_all = back.sum(axis=1)
    costs = map(float, (planned, field, np.median(of_all), of_all.max(), every.max()))
    yield "all", *costs, known(tanks.sum(axis=1).max()), None


def known(value: Any) -> float | None:
    """Return a number, or None in place of nan."""
    return None if np.isnan(value) else float(value)


def order(simulated: SimulatedRun) -> list[int]:
    """Return the indices of the simulations, worst first."""
    flight = simulated.flight
    by = flight.ratios.min(axis=1) if flight.ratios.size else -flight.ends.max(axis=1)
    return [int(k) for k in np.argsort(by, kind="stable")]


def flight_row(simulated: SimulatedRun, seed: int) -> tuple[Any, ...]:
    """Return a row of FLIGHTS."""
    flight, ratio, both = simulated.flight, None, None
    if flight.ratios.size:
        k = int(np.argmin(flight.ratios[seed]))
        ratio, both = float(flight.ratios[seed, k]), pair(simulated, k)
    off, cost = flight.deviations[seed], float(flight.delta_v[seed].sum())
    return seed, ratio, both, float(off[:, -1].max()), float(off.max()), cost


def pair(simulated: SimulatedRun, row: int) -> tuple[str, str]:
    """Return the names of a pair by its row."""
    i, j = simulated.flight.pairs[row]
    return simulated.names[i], simulated.names[j]


def contained(simulated: SimulatedRun) -> float:
    """Return the predicted deviation that nearly all simulations stay within [m]."""
    times, tube = simulated.flight.times, simulated.tube
    assert tube is not None
    return float(np.max(tube.containment(float(times[-1] - times[0]), craft=len(simulated.names))))


def sure(simulated: SimulatedRun) -> Section:
    """Return the section on certified and sampled figures, and on the parts of the tracking-error tube."""
    tube, fading = simulated.tube, simulated.arguments["navigation"].correlation
    noise = f"correlation time {fading:g} s" if fading else "white from one measurement to the next"
    rows = [
        (
            "Minimum clearance ratios",
            "at instants a few seconds apart and on cubics between them; certified for the worst simulation",
        ),
        (
            "High-fidelity model",
            f"{described(simulated.field)}, integrated by a Runge-Kutta method and known to the craft: "
            "only errors of navigation and thrust remain",
        ),
        (
            "Uncertainty",
            f"{noise}; biases and thrust errors are constant in a simulation; each has its random stream",
        ),
    ]
    tables = [model_limits.certain(rows)]
    if tube is not None:
        parts = [("unknown part of the force model", tube.model), ("thrust errors", tube.thrust)]
        parts += [("biases", tube.bias), (f"noise, {tube.sigmas:g} sigmas", tube.sigmas * tube.noise)]
        parts += [("total", tube.radius), ("total, for a pair", tube.of_a_pair)]
        share = f"{100.0 * tube.probability:.3f} % of simulations"
        parts += [(f"bound for all craft at all times, in {share}", contained(simulated))]
        tables.append(
            Table("Predicted tracking-error tube", TUBE, [(one, float(np.max(part))) for one, part in parts])
        )
    return Section("Limits of the simulation", (), tuple(tables))


@dataclass(frozen=True, eq=False)
class SimulationContent:
    """Content of a report on a mission that was `simulated` in its high-fidelity model.

    `opening` describes the simulations; `lines` and `tables` hold their results.
    """

    simulated: SimulatedRun
    opening: tuple[str, ...]
    lines: tuple[str, ...]
    tables: tuple[Table, ...]

    @classmethod
    def of(cls, simulated: SimulatedRun) -> Self:
        """Return the content on simulations."""
        return cls(
            simulated, tuple(described_lines(simulated)), tuple(found_lines(simulated)), tables(simulated)
        )

    @property
    def title(self) -> str:
        """The title of the report."""
        return f"{self.simulated.run.scenario.title}: simulated in the high-fidelity model"

    def section(self, title: str, lines: tuple[str, ...] = ()) -> Section:
        """Return the section on the simulations under a title, after some lines."""
        more: tuple[tuple[str, ...], tuple[Table, ...]] = (), ()
        if self.simulated.worst.conflicts:
            which = "worst " * (len(self.simulated.flight.states) > 1)
            more = conflicts.listed(f"Conflicts of the {which}simulation", self.simulated.worst)
        found = (*lines, *self.lines, *more[0])
        return Section(title, found, (*self.tables, *more[1]), pictures=tuple(pictures(self.simulated)))

    @property
    def sure(self) -> Section:
        """The section on certified and sampled figures."""
        return sure(self.simulated)

    @property
    def figures(self) -> dict[str, Any]:
        """The figures in full precision and SI units."""
        one, verdict, given = self.simulated, self.simulated.entered, self.simulated.arguments
        law, sight, tube = given["feedback"], given["navigation"], one.tube
        found = {
            "status": verdict.status,
            "verdict": str(verdict),
            "field": described(one.field),
            "control": one.control,
            "feedback": {
                "every_s": law.every,
                "horizon_s": law.horizon,
                "impulses": law.impulses,
                "delay_s": law.delay,
            },
            "navigation": {
                "position_m": sight.position,
                "velocity_m_s": sight.velocity,
                "position_bias_m": sight.position_bias,
                "velocity_bias_m_s": sight.velocity_bias,
                "correlation_s": sight.correlation,
            },
            "thrust_error": np.atleast_2d(given["thrust_error"]).tolist(),
            "errors": error_figures(given["errors"] or ()),
            "flights": verdict.flights,
            "violated": verdict.count,
            "worst": one.flight.worst,
            "craft": list(one.names),
            "stages": self.tables[0].records,
            "spent": self.tables[1].records,
            "worst_flights": self.tables[2].records,
            "worst_flight": conflicts.figures(one.worst),
        }
        if tube is not None:
            found["tube"] = {
                "radius_m": np.ravel(tube.radius).tolist(),
                "of_a_pair_m": tube.of_a_pair,
                "containment_m": contained(one),
            }
        return found


def described_lines(simulated: SimulatedRun) -> Iterator[str]:
    """Yield the number of simulations, the force model, the control law, the errors and lost craft."""
    one, given = simulated, simulated.arguments
    law, sight = given["feedback"], given["navigation"]
    count = f"{counted(len(one.flight.states), 'simulation')} of {len(one.names)} craft"
    alike = "" if one.uncertain else "; without uncertainty, all others are the same"
    lines = [f"{count}, {counted(len(one.stages), 'stage')}{alike}"]
    unknown = "" if one.field is one.known else " except for drawn values"
    where = f"High-fidelity model: {described(one.field)}, known{unknown}; thrust compensates for it"
    if one.control == "open":
        lines.append(f"{where}; open loop, no navigation updates")
    else:
        replan = "; the remainder is replanned, around the zones, at each measurement"
        how = f"measured every {law.every:g} s, corrected within {law.horizon:g} s"
        if law.impulses:
            how += f" by {law.impulses} {'burns' if one.thrusters else 'impulses'}"
        if law.delay:
            how += f", delayed by {law.delay:g} s"
        seen = f"Navigation: {1e2 * sight.position:.3g} cm and {1e3 * sight.velocity:.3g} mm/s (1 sigma)"
        if sight.correlation:
            seen += f", correlation time {sight.correlation:g} s"
        if sight.position_bias or sight.velocity_bias:
            biases = f"{1e2 * sight.position_bias:.3g} cm and {1e3 * sight.velocity_bias:.3g} mm/s"
            seen += f", bias {biases}"
        lines += [where + replan * (one.control == "replan"), f"Feedback: {how}", seen]
    yield from lines
    for more in (thrust_errors, drawn, without_control):
        yield from more(simulated)


def without_control(simulated: SimulatedRun) -> Iterator[str]:
    """Yield the spacecraft without an engine, and those that lose their thrust."""
    if names := ", ".join(np.array(simulated.names)[~simulated.arguments["engine"]]):
        yield f"No engine: {names}; they drift in the high-fidelity model without feedback"
    if losses := ", ".join(f"{one.craft} at {one.time:.1f} s" for one in simulated.run.lost):
        yield f"Thrust lost: {losses}; from then on they drift"


def drawn(simulated: SimulatedRun) -> Iterator[str]:
    """Yield the sampled values of a case that are unknown to its plans."""
    scenario = simulated.run.scenario
    if scenario.study is None or scenario.drawn_flight is None:
        return
    found = []
    for key in scenario.study.vary:
        if key.startswith(UNPLANNED) and (reader := readers()[key]) is not None:
            values = ", ".join(f"{value:.4g}" for value in scenario.truth.given(key))
            found.append(f"{key} {values} {reader.kind.units[0]}")
    yield f"Drawn and unknown to plans: {'; '.join(found)}"


def thrust_errors(simulated: SimulatedRun) -> Iterator[str]:
    """Yield the spacecraft that fire pulses, the execution errors of thrust, and those of each craft."""
    if shot := simulated.thrusters:
        names = "all" if len(shot) == len(simulated.names) else ", ".join(shot)
        back = "" if simulated.control == "open" else ", and feedback corrections of at least one bit"
        yield f"Thrusters: {names} fire the compensated plan as pulses{back}"
    size, angle = np.atleast_2d(simulated.arguments["thrust_error"]).max(axis=0)
    found = list(error_lines(simulated.arguments["errors"] or ()))
    if size or angle:
        largest = f"{100.0 * size:.3g} % and {degrees(angle):.3g} deg"
        yield f"Thrust: error up to {largest}, constant in a simulation"
    elif not found:
        yield "Thrust: as commanded; set thrust_error, or execution of [craft], to give it errors"
    yield from found


def found_lines(simulated: SimulatedRun) -> Iterator[str]:
    """Yield the worst simulation, the tracking-error tube, and shortfalls of thrust."""
    flight, tube, near = simulated.flight, simulated.tube, simulated.worst.closest
    if near is not None:
        lead = f"Worst simulation, {flight.worst}" if len(flight.states) > 1 else "Closest approach"
        yield (
            f"{lead}: {near.first} - {near.second}, {near.ratio:.4f} x zone "
            f"({near.distance:.3f} m) at {near.time:.1f} s, certified between its states"
        )
    if tube is not None:
        radius = f"{np.max(tube.radius):.3g} m per craft, {tube.of_a_pair:.3g} m per pair"
        yield (
            f"Tracking-error tube of any plan with this feedback: {radius}, "
            f"{tube.sigmas:g} sigmas per direction"
        )
        bound = contained(simulated)
        within = f"{100.0 * tube.probability:.3f} % of simulations stay within {bound:.3g} m"
        yield f"Largest deviation from the plan: {flight.greatest_deviation:.3g} m; {within}"
    short = dict(zip(simulated.names, flight.limited.max(axis=0).tolist(), strict=True))
    for name in simulated.thrusters:
        if short[name] > 0.0:
            share = f"{100.0 * short[name]:.3g} % of a simulation"
            remedy = "use stronger thrusters, or add one along each axis"
            yield f"{name}: commands exceed its thrust in up to {share}; {remedy}"
    for name, aside in simulated.unled.items():
        yield f"{name}: an axis without a thruster is not controlled; deviation up to {aside:.3g} m"


def pictures(simulated: SimulatedRun) -> Iterator[Picture]:
    """Yield pictures of clearance ratios, deviations and paths."""
    flight, names = simulated.flight, {"names": simulated.names}
    if flight.ratios.size:
        caption = "Clearance ratios in every simulation, and those of the closest pair"
        yield Picture("flights-ratios", caption, "flight_ratios", (flight, simulated.zones), names)
    caption = "Deviation from the plan in every simulation, and the predicted tracking-error tube"
    yield Picture("flights-deviations", caption, "flight_deviations", (flight, simulated.tube), names)
    caption = "The paths as planned and as simulated, with deviations enlarged"
    yield Picture("flights-paths", caption, "flight_paths", (flight,), names)


def stored(simulated: SimulatedRun) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the tables of the result folder, each with its name."""
    flight, names = simulated.flight, np.array(simulated.names)
    columns = flight.columns()
    yield "flights", {**columns, "craft": names[columns["craft"]]}
    if flight.ratios.size:
        seeds, pairs = flight.ratios.shape
        yield (
            "ratios",
            {
                "seed": np.repeat(np.arange(seeds), pairs),
                "first": np.tile(names[flight.pairs[:, 0]], seeds),
                "second": np.tile(names[flight.pairs[:, 1]], seeds),
                "ratio": flight.ratios.ravel(),
            },
        )
    stages = simulated.stages
    yield (
        "ends",
        {
            "stage": np.concatenate([np.full(one.ends.size, one.number) for one in stages]),
            "seed": np.concatenate([np.repeat(np.arange(len(one.ends)), len(names)) for one in stages]),
            "craft": np.concatenate([np.tile(names, len(one.ends)) for one in stages]),
            "end_m": np.concatenate([one.ends.ravel() for one in stages]),
        },
    )
    yield (
        "paths",
        state_columns(
            simulated.names, flight.times, flight.states[flight.worst], simulated.run.scenario.epoch
        ),
    )
    if simulated.thrusters:
        orders = flight.orders[flight.worst]
        firing, when = orders.any(axis=2).nonzero()
        given = dict(
            zip(("radial_m_s", "along_track_m_s", "cross_track_m_s"), orders[firing, when].T, strict=True)
        )
        yield "pulses", simulated.pulses
        yield (
            "corrections",
            {"craft": names[firing], "time_s": flight.ordered[when], **given},
        )
    parts = [one.columns() for one in simulated.commanded]
    numbers = [np.full(len(part["craft"]), one.number) for one, part in zip(stages, parts, strict=True)]
    whole = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
    yield "commanded", {"stage": np.concatenate(numbers), **whole, "craft": names[whole["craft"]]}


def simulation_report(simulated: SimulatedRun, command: Command) -> CommandReport:
    """Return the report on simulations, with the `command` that requested them."""
    content, verdict = SimulationContent.of(simulated), simulated.entered
    warned = (*content.lines, *(use.warning(simulated.grams) for use in verdict.exceeded or ()))
    content = replace(content, lines=warned)
    return CommandReport(
        command,
        simulated,
        content.title,
        (content.title, *content.opening),
        content.opening,
        content.lines,
        content.tables,
        verdict,
        (Section("Request", (), (command.table,)), content.section("Results"), content.sure),
        {"kind": "flight", **content.figures},
        dict(stored(simulated)),
        beside=lambda folder: folder.scenario(simulated.run.scenario),
    )
