"""Simulation of a run in its high-fidelity model, with many samples of the errors.

Each stage starts from the simulated end of the previous stage.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, Literal, Self

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.flight import ALL_PAIRS, WatchedFlight, watch
from closeform.dynamics.clearance import clearance_ratios
from closeform.dynamics.compensated_thrust import CompensatedThrust, compensated_thrust
from closeform.dynamics.control.feedback import Feedback, default_feedback
from closeform.dynamics.control.tracking_tube import Tube, tube
from closeform.dynamics.force_model.field import Field
from closeform.dynamics.infeasible import Infeasible
from closeform.dynamics.planned_paths import extended_paths
from closeform.dynamics.simulation.commands import ThrusterStages
from closeform.dynamics.simulation.random_errors import has_random_errors, seeds_of
from closeform.dynamics.simulation.simulate import simulate
from closeform.dynamics.simulation.simulation_result import Simulation
from closeform.dynamics.simulation.thruster_pulses import controllable_in_stages, lacks_axis, pulse_feedback
from closeform.mission.mission_result import Stages
from closeform.mission.simulation_verdict import Entered
from closeform.mission.stage_start import followed, thrusters_by_stage
from closeform.mission.verdict import LostThrust, Use
from closeform.motion.arc import END, START
from closeform.motion.path import Path, fires_impulses, path_of
from closeform.named_craft import as_listed
from closeform.zones.pair_zones import PairZones

Control = Literal["track", "replan", "open"]
PARTIAL = 1e-9  # [s] tolerance for a stage end that coincides with an output time


@dataclass(frozen=True, eq=False)
class SimulatedStage:
    """One stage of S simulated flights of N spacecraft.

    `ends` (S, N) [m] are the distances from the plan at the end of the stage.  `ratios` (S, P) are the
    minimum clearance ratios of the P pairs, at the output times and between them.
    """

    number: int
    verb: str
    start: float
    end: float
    ends: Floats
    ratios: Floats

    @property
    def nearest(self) -> tuple[int, int] | None:
        """Indices of the simulation and the pair with the minimum clearance ratio; None without zones."""
        if not self.ratios.size:
            return None
        seed, pair = np.unravel_index(int(np.argmin(self.ratios)), self.ratios.shape)
        return int(seed), int(pair)


@dataclass(frozen=True, eq=False)
class SimulatedRun:
    """All stages of a `run`, simulated as one `flight`.

    `arguments` are the keyword arguments of `simulate`, and `control` is its control mode.  `known` is the
    high-fidelity model that plans and commands use.  It differs from the simulated `field` if a case of a
    study has sampled the latter.
    """

    run: Stages
    field: Field
    known: Field
    control: Control
    arguments: dict[str, Any]
    flight: Simulation

    @classmethod
    def of(cls, run: Stages, control: Control, arguments: dict[str, Any], seeds: int | Sequence[int]) -> Self:
        """Simulate a run, once if nothing is uncertain.

        Raises Infeasible, with the names of the spacecraft, if the run cannot be simulated.
        """
        try:
            return cls.flying(run, control, arguments, seeds)
        except Infeasible as error:
            raise Infeasible(as_listed(str(error), run.scenario.names)) from None

    @classmethod
    def flying(
        cls, run: Stages, control: Control, arguments: dict[str, Any], seeds: int | Sequence[int]
    ) -> Self:
        """Simulate a run; the message of Infeasible refers to spacecraft by index."""
        known, field = run.scenario.field, run.scenario.truth.field
        assert known is not None
        assert field is not None
        zones = run.scenario.zones if run.scenario.zones.pairs <= ALL_PAIRS else None
        pulsed = fires_pulses(run)
        plan = followed(run.executed) if pulsed else planned(run)
        arguments = arguments | {"feedback": arguments["feedback"] or usually_led(run, control)}
        if run.lost:
            times = {one.craft: one.time for one in run.lost}
            arguments["lost"] = [times.get(name, np.inf) for name in run.scenario.names]
        arguments["max_acceleration"] = free_limits(run)
        if pulsed:
            own = thrusters_by_stage(run.scenario, [(one.start, one.stage) for one in run.executed])
            arguments["thrusters"] = own
            if control != "replan":  # replanning chooses its own feedback for pulses
                arguments["feedback"] = pulse_feedback(
                    arguments["feedback"], ThrusterStages.of_each(own, plan)
                )
        some = seeds if differs(control, arguments) else seeds_of(seeds)[:1]
        flight = simulate(plan, field, control, zones=zones, known=known, seeds=some, **arguments)
        if pulsed:  # deviations are relative to the certified paths, which are pulsed as well
            flight = replace(flight, planned=extended_paths(run.paths, flight.times))
        return cls(run, field, known, control, arguments, flight)

    @classmethod
    def asked(cls, run: Stages) -> Self:
        """Simulate a run by the [simulation] table of its scenario, or raise Infeasible."""
        scenario = run.scenario
        assert scenario.flights is not None
        return cls.of(run, scenario.flights.control, scenario.truth.flight, scenario.flight_seeds)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the spacecraft."""
        return self.run.scenario.names

    @property
    def uncertain(self) -> bool:
        """True if flights with different seeds differ."""
        return differs(self.control, self.arguments)

    @property
    def zones(self) -> PairZones:
        """Keep-out zone of each pair."""
        return self.run.scenario.zones

    @property
    def entered(self) -> Entered:
        """Number of flights with a conflict, and the limits that a flight exceeds."""
        flight = self.flight
        count = round(flight.violated * len(flight.states)) if flight.ratios.size else 0
        least = flight.least_ratio if flight.ratios.size else None
        used = tuple(self.spent)
        exceeded = tuple(use for use in used if use.exceeded) if used else None
        return Entered(count, len(flight.states), least, self.uncertain, exceeded)

    def drifted(self, lost: LostThrust) -> LostThrust:
        """Return the loss of thrust with the minimum clearance ratio after it over all flights, if lower."""
        flight, k = self.flight, self.names.index(lost.craft)
        some = slice(max(int(np.searchsorted(flight.times, lost.time)), 0), None)
        near = lost
        for states, arrivals in zip(flight.states, flight.arrivals, strict=True):
            found = clearance_ratios(states[:, some], arrivals[:, some], flight.times[some], self.zones)
            for pair, ratio in zip(*(one.tolist() for one in found), strict=True):
                if k in pair and ratio < near.ratio:
                    other = self.names[pair[0] if pair[1] == k else pair[1]]
                    near = replace(lost, ratio=ratio, other=other)
        return near

    @cached_property
    def stages(self) -> tuple[SimulatedStage, ...]:
        """Results of each stage by itself."""
        return tuple(self.stage(one) for one in self.run.executed)

    @property
    def thrusters(self) -> tuple[str, ...]:
        """Names of the spacecraft that fire pulses."""
        own = self.arguments.get("thrusters", [None] * len(self.names))
        return tuple(name for name, one in zip(self.names, own, strict=True) if one is not None)

    @cached_property
    def unled(self) -> dict[str, float]:
        """Maximum uncontrolled deviation [m] of each spacecraft with a direction that has no thruster."""
        flight, found = self.flight, dict[str, float]()
        if not self.thrusters:
            return found
        off = flight.states[..., :3] - flight.planned.position(flight.times)
        each = ThrusterStages.of_each(self.arguments.get("thrusters"), followed(self.run.executed))
        for k, own in enumerate(each):
            if own is not None and any(map(lacks_axis, own.thrusters)):
                led = controllable_in_stages(own, flight.times, flight.orbit.mean_motion)
                aside = off[:, k] - np.einsum("tij,stj->sti", led, off[:, k])
                found[self.names[k]] = float(np.linalg.norm(aside, axis=-1).max())
        return found

    @cached_property
    def propellant(self) -> Floats:
        """Propellant use (S, N) [kg]; nan for a spacecraft without mass or specific impulse."""
        return self.burnt(slice(None), self.flight.delta_v)

    @cached_property
    def pulses(self) -> dict[str, Any]:
        """Planned thruster pulses of the worst flight in columns, with propellant for the falling mass."""
        assert self.flight.firing is not None
        fired = self.flight.pulses[self.flight.worst]
        firing = np.array([self.names.index(name) for name in self.thrusters])[fired.craft]
        so_far = np.cumsum(
            np.where(firing[:, None] == np.arange(len(self.names)), fired.impulse[:, None], 0.0), 0
        )
        spent = so_far[np.arange(len(firing)), firing]
        burnt = self.burnt(firing, spent) - self.burnt(firing, spent - fired.impulse)
        named = {
            "craft": np.array(self.names)[firing],
            "thruster": fired.thruster + 1,
            "propellant_kg": burnt,
        }
        return replace(self.flight.firing, pulses=fired).burns | named

    def burnt(self, which: Any, delta_v: Floats) -> Floats:
        """Return the propellant [kg] of spacecraft, by index, for a delta-v [m/s].

        It is nan for a spacecraft without mass or specific impulse.
        """
        craft = self.run.scenario.craft
        mass = [one.mass if one.specific_impulse is not None else None for one in craft]
        return np.asarray(np.array(mass, dtype=float)[which] * -np.expm1(-delta_v / self.exhaust[which]))

    @cached_property
    def exhaust(self) -> Floats:
        """Exhaust speed of each spacecraft (N,) [m/s], averaged by planned delta-v where stages differ."""
        own = np.array([one.exhaust for one in self.run.scenario.craft])
        spent = np.array([one.planned.paths.delta_v for one in self.run.executed])
        each = np.array([self.run.scenario.exhaust(one.stage) for one in self.run.executed])
        differ = (each != each[0]).any(axis=0) & spent.any(axis=0)
        own[differ] = spent[:, differ].sum(axis=0) / (spent / each)[:, differ].sum(axis=0)
        return own

    @property
    def spent(self) -> Iterator[Use]:
        """Maximum delta-v and propellant over all flights, of each spacecraft that has such a limit."""
        most = self.flight.delta_v.max(axis=0), self.propellant.max(axis=0)
        return Use.of_spent(self.run.scenario.craft, *most)

    @property
    def grams(self) -> bool:
        """True if propellant is printed in grams: no spacecraft uses more than a kilogram."""
        return bool(np.nanmax(self.propellant, initial=0.0) <= 1.0)

    def stage(self, result: Any) -> SimulatedStage:
        """Return the part of the simulation that belongs to one stage."""
        flight = self.flight
        first = np.searchsorted(flight.times, result.start, "right") - 1
        last = min(int(np.searchsorted(flight.times, result.end - PARTIAL)), len(flight.times) - 1)
        some = slice(int(first), last + 1)
        ratios = flight.ratios
        if len(self.run.executed) > 1 and ratios.size:
            ratios = np.array(
                [
                    clearance_ratios(one[:, some], before[:, some], flight.times[some], self.zones)[1]
                    for one, before in zip(flight.states, flight.arrivals, strict=True)
                ]
            )
        now = float(flight.times[last])
        ahead = flight.states[:, :, last] - flight.planned.state([now])[:, -1]
        off = np.linalg.norm(ahead[..., :3] + (result.end - now) * ahead[..., 3:], axis=-1)
        return SimulatedStage(result.number, result.stage.verb, result.start, result.end, off, ratios)

    @cached_property
    def worst(self) -> WatchedFlight:
        """Worst flight, with its conflicts and closest approaches certified."""
        return watch(self.flight.path(self.flight.worst), self.names, self.zones)

    @cached_property
    def worst_by_stage(self) -> tuple[WatchedFlight, ...]:
        """Worst flight, divided into stages."""
        cuts = [self.flight.times[0], *(one.end for one in self.run.executed)]
        parts = (during(self.worst.paths, start, end) for start, end in pairwise(cuts))
        return tuple(watch(part, self.names, self.zones) for part in parts)

    @property
    def which(self) -> str:
        """The worst simulation and its criterion as text; empty for a single simulation."""
        if len(self.flight.states) == 1:
            return ""
        why = "with the closest approach" if self.flight.ratios.size else "with the largest end error"
        return f"simulation {self.flight.worst} of {len(self.flight.states)}, {why}"

    @cached_property
    def commanded(self) -> tuple[CompensatedThrust, ...]:
        """Thrust commands for the high-fidelity model, one item per stage."""
        return tuple(
            compensated_thrust(one.planned.paths, self.known, engine=self.arguments["engine"])
            for one in self.run.executed
        )

    @cached_property
    def tube(self) -> Tube | None:
        """Predicted tracking-error tube of each spacecraft; None where no bound is available.

        It is None without uncertainty, without tracking feedback, and if a spacecraft drifts.  It is None for
        feedback by impulses as well: such feedback tracks impulses adapted to the high-fidelity model, and
        their paths deviate from the plan in between.  For planned impulses, and for errors of single burns,
        the deviation depends on the plan.
        """
        arguments, impulses = self.arguments, fires_impulses(self.run.paths)
        drifts = bool(self.run.lost) or not self.arguments["engine"].all()
        if not self.uncertain or self.control != "track" or drifts:
            return None
        if arguments["feedback"].impulses or impulses or arguments["errors"] is not None:
            return None
        sizes = np.broadcast_to(arguments["thrust_error"], (len(self.names), 2))
        off = np.hypot(sizes[:, 0], sizes[:, 1]) * np.max([one.peak_thrust for one in self.commanded], axis=0)
        return tube(self.run.paths.orbit, arguments["feedback"], arguments["navigation"], thrust_error=off)


def differs(control: Control, arguments: dict[str, Any]) -> bool:
    """Return True if flights with this control mode and these arguments of `simulate` differ."""
    return has_random_errors(
        control != "open", arguments["navigation"], arguments["thrust_error"], arguments["errors"]
    )


def fires_pulses(run: Stages) -> bool:
    """Return True if a craft has thrusters in any stage."""
    return any(craft.fired(1.0) is not None for craft in run.scenario.craft_of_all)


def free_limits(run: Stages) -> dict[float, Floats] | None:
    """Return the limits (N,) [m/s^2] of each craft's thrust without thrusters, by start time of stages.

    A craft that a stage does not move keeps the limit of the stage before.  None without limits.
    """
    scenario, found = run.scenario.truth, dict[float, Floats]()
    limits = np.array([craft.max_acceleration for craft in scenario.craft])
    for one in run.executed:
        moving = one.stage.moving(scenario.names)
        for k, craft in enumerate(scenario.craft_in(one.stage)):
            if craft.name in moving:
                free = craft.fired(1.0) is None and not fires_impulses(one.planned.paths[[k]])
                limits[k] = craft.max_acceleration if free else np.inf
        found[one.start] = limits.copy()
    return found if np.isfinite(list(found.values())).any() else None


def usually_led(run: Stages, control: Control) -> Feedback:
    """Return the default feedback of a run without a specified one."""
    return default_feedback(control, fires_pulses(run) or fires_impulses(planned(run)))


def planned(run: Stages) -> Path:
    """Return the planned paths (N,) from the first stage to the last, without any loss of thrust."""
    return followed(run.executed) if run.lost else run.paths


def during(paths: Path, start: float, end: float) -> Path:
    """Return the part of paths (N,) between two times [s], at which all of them change arcs."""
    middle = 0.5 * (paths.arcs[:, START] + paths.arcs[:, END])
    some = (start < middle) & (middle < end)
    counts = np.add.reduceat(some.astype(int), paths.offsets[:-1])
    return path_of(paths.orbit, paths.arcs[some], np.concatenate([[0], np.cumsum(counts)]), paths.shape)
