"""Report of a mission simulated in the high-fidelity model: deviations, clearance ratios and costs."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from math import degrees
from typing import Any

import numpy as np

from closeform.conflicts.flight import WatchedFlight
from closeform.dynamics.field import described
from closeform.exchange.epochs import Epoch
from closeform.mission.simulation import FlownRun
from closeform.mission.simulation_verdict import Entered
from closeform.report import conflicts, results, simulation_tables, spacecraft_errors
from closeform.report.page import Head
from closeform.report.picture import Picture, Progress
from closeform.report.reproduction import Command
from closeform.report.section import Section
from closeform.report.table import STATE_COLUMNS, Table, counted
from closeform.report.utc_columns import Stamps
from closeform.scenario.study import UNPLANNED, readers
from closeform.storage.result_folder import Folder
from closeform.zones.pair_zones import PairZones


@dataclass(frozen=True, eq=False)
class FlightTold:
    """Content of a report on a mission that was `flown` in its high-fidelity model."""

    flown: FlownRun

    @property
    def title(self) -> str:
        """The title of the report."""
        return f"{self.flown.run.scenario.title}: flown in the field"

    @property
    def flight(self) -> WatchedFlight:
        """The worst simulation, for the animated page."""
        return self.flown.worst

    @property
    def zones(self) -> PairZones:
        """The keep-out zones of all pairs."""
        return self.flown.zones

    @property
    def epoch(self) -> Epoch | None:
        """The epoch of time 0; None if it is unknown."""
        return self.flown.run.scenario.epoch

    @property
    def opening(self) -> tuple[str, ...]:
        """The number of simulations, the force model, the control law and the errors."""
        one, told = self.flown, self.flown.told
        count = counted(len(one.flight.states), "flight")
        stages = counted(len(one.stages), "stage")
        alike = "" if one.uncertain else "; nothing is uncertain, all others would be the same"
        what = self.title, f"{count} of {len(one.names)} craft, {stages}{alike}"
        where = f"Field: {described(one.field)}, known{self.unknown}; thrust corrected for it"
        drawn = *self.drawn, *self.coasting, *self.lost
        if one.control == "open":
            return *what, f"{where}; nobody measures", *self.thrust_errors, *drawn
        if one.control == "replan":
            where += "; the rest is planned anew, around the zones, at each measurement"
        law, sight = told["feedback"], told["navigation"]
        how = f"measured every {law.every:g} s, brought back within {law.horizon:g} s"
        if law.impulses:
            how += f" by {law.impulses} {'burns' if one.thrusters else 'impulses'}"
        if law.delay:
            how += f", {law.delay:g} s late"
        seen = f"Navigation: {1e2 * sight.position:.3g} cm and {1e3 * sight.velocity:.3g} mm/s (1 sigma)"
        if sight.correlation:
            seen += f", fading in {sight.correlation:g} s"
        if sight.position_bias or sight.velocity_bias:
            seen += f", off by {1e2 * sight.position_bias:.3g} cm and {1e3 * sight.velocity_bias:.3g} mm/s"
        return *what, where, f"Feedback: {how}", seen, *self.thrust_errors, *drawn

    @property
    def lost(self) -> tuple[str, ...]:
        """The spacecraft that lose their thrust, and when; empty without any."""
        told = ", ".join(f"{one.craft} at {one.time:.1f} s" for one in self.flown.run.lost)
        return (f"Thrust lost: {told}; from then on craft drift",) * bool(told)

    @property
    def coasting(self) -> tuple[str, ...]:
        """The spacecraft without an engine; empty without any."""
        told = ", ".join(np.array(self.flown.names)[~self.flown.told["engine"]])
        return (f"No engine: {told}; nobody leads back who has none, they drift in the field",) * bool(told)

    @property
    def unknown(self) -> str:
        """The remark that a case has sampled part of the force model, else an empty text."""
        return "" if self.flown.field is self.flown.known else " but for what is drawn"

    @property
    def drawn(self) -> tuple[str, ...]:
        """The sampled values of a case that its plans do not know."""
        scenario = self.flown.run.scenario
        if scenario.study is None or scenario.drawn_flight is None:
            return ()
        told = []
        for key in scenario.study.vary:
            if key.startswith(UNPLANNED) and (reader := readers()[key]) is not None:
                values = ", ".join(f"{value:.4g}" for value in scenario.truth.given(key))
                told.append(f"{key} {values} {reader.kind.units[0]}")
        return (f"Drawn, and not known to plans: {'; '.join(told)}",)

    @property
    def thrust_errors(self) -> tuple[str, ...]:
        """The execution errors of thrust, and the errors of each spacecraft."""
        size, angle = np.atleast_2d(self.flown.told["thrust_error"]).max(axis=0)
        told = [*self.pulses]
        if size or angle:
            most = f"{100.0 * size:.3g} % and {degrees(angle):.3g} deg"
            told.append(f"Thrust: off by up to {most}, constant in a flight")
        told += spacecraft_errors.told(self.flown.told["errors"] or ())
        if len(told) == len(self.pulses):
            told.append(
                "Thrust: as commanded; thrust_error and execution of [craft] say by how much it is off"
            )
        return tuple(told)

    @property
    def pulses(self) -> tuple[str, ...]:
        """The spacecraft that fire pulses; empty without any."""
        shot = self.flown.thrusters
        if not shot:
            return ()
        who = "all" if len(shot) == len(self.flown.names) else ", ".join(shot)
        back = "" if self.flown.control == "open" else ", and what leads back, a bit or more at a time"
        return (f"Thrusters: {who} fire the plan, less what the field does, as pulses{back}",)

    @property
    def verdict(self) -> Entered:
        """The keep-out violations and the limits that are exceeded."""
        return self.flown.entered

    @property
    def lines(self) -> tuple[str, ...]:
        """The worst simulation, the tracking-error tube, and shortfalls of thrust."""
        flight, room, near = self.flown.flight, self.flown.tube, self.flight.closest
        told = []
        if near is not None:
            lead = f"Worst flight, {flight.worst}" if len(flight.states) > 1 else "Closest in flight"
            told.append(
                f"{lead}: {near.first} and {near.second} at {near.ratio:.4f} x zone "
                f"({near.distance:.3f} m) at {near.time:.1f} s, certified between its states"
            )
        if room is not None:
            sure = f"{np.max(room.radius):.3g} m a craft, {room.of_a_pair:.3g} m a pair"
            told.append(
                f"Tube of any plan of such thrust: {sure}, {room.sigmas:g} sigmas along any one direction"
            )
            farthest, within = flight.greatest_deviation, simulation_tables.contained(self.flown)
            told.append(
                f"Farthest off its plan of all craft at all times: {farthest:.3g} m in space; "
                f"{100.0 * room.probability:.3f} % of flights stay within {within:.3g} m"
            )
        short = dict(zip(self.flown.names, flight.limited.max(axis=0).tolist(), strict=True))
        told += [
            f"{name}: feedback asks for more than its thrusters give in up to {100.0 * short[name]:.3g} % "
            "of a flight: they are too weak, or none pushes that way"
            for name in self.flown.thrusters
            if short[name] > 0.0
        ]
        told += [
            f"{name}: to some side none of its thrusters pushes; there nobody leads it back, it drifts up to "
            f"{aside:.3g} m off"
            for name, aside in self.flown.unled.items()
        ]
        return tuple(told)

    @cached_property
    def tables(self) -> tuple[Table, ...]:
        """Stages, costs, and the worst simulations."""
        return simulation_tables.tables(self.flown)

    def section(self, title: str, lines: tuple[str, ...] = ()) -> Section:
        """Return the section on the simulations under a title, after some lines."""
        found = (*lines, *self.lines, *self.worst[0])
        return Section(title, found, (*self.tables, *self.worst[1]), pictures=tuple(self.pictures))

    @property
    def sure(self) -> Section:
        """The section on certified and sampled figures."""
        return simulation_tables.sure(self.flown)

    @property
    def worst(self) -> tuple[tuple[str, ...], tuple[Table, ...]]:
        """The conflicts of the worst simulation, as lines and tables."""
        if not self.flight.conflicts:
            return (), ()
        which = "worst " * (len(self.flown.flight.states) > 1)
        return conflicts.listed(f"Conflicts of the {which}flight", self.flight)

    @property
    def pictures(self) -> Iterator[Picture]:
        """Pictures of clearance ratios, deviations, paths and delta-v."""
        flight, names = self.flown.flight, {"names": self.flown.names}
        if flight.ratios.size:
            caption = "How near pairs come in every flight, and a close look at the nearest"
            yield Picture("flights-ratios", caption, "flight_ratios", (flight, self.zones), names)
        caption = "How far off the plan craft are in every flight, and the tube that was said beforehand"
        yield Picture("flights-deviations", caption, "flight_deviations", (flight, self.flown.tube), names)
        caption = "The paths as planned, and as flown about them, with deviations enlarged"
        yield Picture("flights-paths", caption, "flight_paths", (flight,), names)
        caption = "What each craft spends on the plan, on the field and on feedback"
        yield Picture("flights-costs", caption, "flight_costs", (flight,), names)

    @property
    def figures(self) -> dict[str, Any]:
        """The figures in full precision and SI units."""
        one, verdict, told = self.flown, self.verdict, self.flown.told
        law, sight, room = told["feedback"], told["navigation"], one.tube
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
            "thrust_error": np.atleast_2d(told["thrust_error"]).tolist(),
            "errors": spacecraft_errors.figures(told["errors"] or ()),
            "flights": verdict.flights,
            "violated": verdict.count,
            "worst": one.flight.worst,
            "craft": list(one.names),
            "stages": self.tables[0].records,
            "spent": self.tables[1].records,
            "worst_flights": self.tables[2].records,
            "worst_flight": conflicts.figures(self.flight),
        }
        if room is not None:
            found["tube"] = {
                "radius_m": np.ravel(room.radius).tolist(),
                "of_a_pair_m": room.of_a_pair,
                "containment_m": simulation_tables.contained(one),
            }
        return found

    @property
    def stored(self) -> Iterator[tuple[str, dict[str, Any]]]:
        """The tables of the result folder, each with its name."""
        flight, names = self.flown.flight, np.array(self.flown.names)
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
        stages = self.flown.stages
        yield (
            "ends",
            {
                "stage": np.concatenate([np.full(one.ends.size, one.number) for one in stages]),
                "seed": np.concatenate([np.repeat(np.arange(len(one.ends)), len(names)) for one in stages]),
                "craft": np.concatenate([np.tile(names, len(one.ends)) for one in stages]),
                "end_m": np.concatenate([one.ends.ravel() for one in stages]),
            },
        )
        count, worst = len(flight.times), flight.states[flight.worst]
        yield (
            "paths",
            {
                "craft": np.repeat(names, count),
                "time_s": np.tile(flight.times, len(names)),
                **(
                    {}
                    if self.epoch is None
                    else {"time_utc": Stamps(self.epoch).column(flight.times, len(names))}
                ),
                **dict(zip(STATE_COLUMNS, worst.reshape(-1, 6).T, strict=True)),
            },
        )
        if self.flown.thrusters:
            orders = flight.orders[flight.worst]
            who, when = orders.any(axis=2).nonzero()
            given = dict(
                zip(("radial_m_s", "along_track_m_s", "cross_track_m_s"), orders[who, when].T, strict=True)
            )
            yield "pulses", self.flown.pulses
            yield (
                "corrections",
                {"craft": names[who], "time_s": flight.ordered[when], **given},
            )
        parts = [one.columns() for one in self.flown.commanded]
        numbers = [np.full(len(part["craft"]), one.number) for one, part in zip(stages, parts, strict=True)]
        told = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
        yield "commanded", {"stage": np.concatenate(numbers), **told, "craft": names[told["craft"]]}


@dataclass(frozen=True, eq=False)
class FlightReport(FlightTold):
    """Report on simulations, with the `command` that requested them."""

    command: Command

    @cached_property
    def chapters(self) -> tuple[Section, ...]:
        """The sections of the page except the one on reproduction."""
        asked = Section("What was asked", (), (self.command.table,))
        return asked, self.section("What was found"), self.sure

    @property
    def figures(self) -> dict[str, Any]:
        """The printed figures in full precision and SI units, for `summary.json`."""
        return {"kind": "flight", "title": self.title, **self.command.figures, **super().figures}

    @property
    def lines(self) -> tuple[str, ...]:
        """The lines of the simulations, followed by warnings about exceeded limits."""
        exceeded = self.verdict.exceeded or ()
        return (*super().lines, *(use.warning(self.flown.grams) for use in exceeded))

    def leave(
        self, folder: Folder, progress: Progress = lambda text: None, viewer: results.Viewer | None = None
    ) -> None:
        """Fill a result folder with the files of the simulations; `viewer` writes the animated page."""
        progress("writing tables")
        folder.scenario(self.flown.run.scenario)
        for name, columns in self.stored:
            folder.table(name, columns)
        head = Head(self.title, self.opening[1:], str(self.verdict), self.verdict.ok)
        results.leave(folder, head, self.chapters, self.command.repeated, self.figures, progress, viewer)
