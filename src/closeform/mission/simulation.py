"""A run as it is flown in its field, many times: every stage from where the one before was flown to."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, Literal, Self

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.flight import ALL_PAIRS, WatchedFlight, watch
from closeform.dynamics.compensated_thrust import CompensatedThrust, compensated_thrust
from closeform.dynamics.drawn import seeds_of, uncertain
from closeform.dynamics.feedback import Feedback, usual_feedback
from closeform.dynamics.field import Field
from closeform.dynamics.flown_plan import spanning
from closeform.dynamics.infeasible import Grounded
from closeform.dynamics.least_ratios import least_ratios
from closeform.dynamics.simulate import simulate
from closeform.dynamics.simulation_result import Simulation
from closeform.dynamics.tube import Tube, tube
from closeform.mission.mission_result import Stages
from closeform.mission.simulation_verdict import Entered
from closeform.mission.stage_start import followed
from closeform.mission.verdict import LostThrust, Use
from closeform.motion.arc import END, START
from closeform.motion.path import Path, fires_impulses, path_of
from closeform.named_craft import as_listed
from closeform.scenario.flown import flown_thrusters
from closeform.zones.pair_zones import PairZones

Control = Literal["track", "replan", "open"]
PARTIAL = 1e-9  # of a time: stages that end at one that is shown


@dataclass(frozen=True, eq=False)
class FlownStage:
    """One stage of S flights of N craft: how far off they `ends` (S, N) [m], the least `ratios` (S, P).

    Of the P pairs of the flight; those at the instants that are shown, and between them.
    """

    number: int
    verb: str
    start: float
    end: float
    ends: Floats
    ratios: Floats

    @property
    def nearest(self) -> tuple[int, int] | None:
        """The flight and the pair, by its row, of the least ratio; None without zones."""
        if not self.ratios.size:
            return None
        seed, pair = np.unravel_index(int(np.argmin(self.ratios)), self.ratios.shape)
        return int(seed), int(pair)


@dataclass(frozen=True, eq=False)
class FlownRun:
    """All flown stages of a `run`, in one `flight`, as `told` (what `fly` was given); `control` as there.

    `known`: the field that plans and commands are made for; another one than the `field` that is flown in
    where a case of a study has drawn that.
    """

    run: Stages
    field: Field
    known: Field
    control: Control
    told: dict[str, Any]
    flight: Simulation

    @classmethod
    def of(cls, run: Stages, control: Control, told: dict[str, Any], seeds: int | Sequence[int]) -> Self:
        """Fly it, once where nothing is uncertain.  Raises Grounded, in its names, where it cannot be."""
        try:
            return cls.flying(run, control, told, seeds)
        except Grounded as error:
            raise Grounded(as_listed(str(error), run.scenario.names)) from None

    @classmethod
    def flying(cls, run: Stages, control: Control, told: dict[str, Any], seeds: int | Sequence[int]) -> Self:
        """The same, which counts craft where it cannot be."""
        known, field = run.scenario.field, run.scenario.truth.field
        assert known is not None
        assert field is not None
        zones = run.scenario.zones if run.scenario.zones.pairs <= ALL_PAIRS else None
        own, pulsed = flown_thrusters(run.scenario), fires_pulses(run)
        plan = followed(run.flown) if pulsed else planned(run)
        told = told | {"feedback": told["feedback"] or usually_led(run, control)}
        if run.lost:
            times = {one.craft: one.time for one in run.lost}
            told["lost"] = [times.get(name, np.inf) for name in run.scenario.names]
        if pulsed or fires_impulses(plan):
            told["max_acceleration"] = None
        if pulsed:
            from closeform.dynamics.pulsed_flight import led_by_pulses  # whose kernels only thrusters need

            told["thrusters"] = own
            if control != "replan":  # which knows by itself what holds craft on a plan
                told["feedback"] = led_by_pulses(told["feedback"], own)
        some = seeds if differs(control, told) else seeds_of(seeds)[:1]
        flight = simulate(plan, field, control, zones=zones, known=known, seeds=some, **told)
        if pulsed:  # off what was certified, which is flown by pulses, too
            flight = replace(flight, planned=spanning(run.paths, flight.times))
        return cls(run, field, known, control, told, flight)

    @classmethod
    def asked(cls, run: Stages) -> Self:
        """Fly it as the [simulation] of its scenario asks for.  Raises Grounded where it cannot be."""
        scenario = run.scenario
        assert scenario.flights is not None
        return cls.of(run, scenario.flights.control, scenario.truth.flight, scenario.flight_seeds)

    @property
    def names(self) -> tuple[str, ...]:
        """The craft's names."""
        return self.run.scenario.names

    @property
    def uncertain(self) -> bool:
        """Whether another flight would be another one."""
        return differs(self.control, self.told)

    @property
    def zones(self) -> PairZones:
        """Who keeps which zone with whom."""
        return self.run.scenario.zones

    @property
    def entered(self) -> Entered:
        """In how many flights a zone is entered, and whose limits are not kept in one."""
        flight = self.flight
        count = round(flight.violated * len(flight.states)) if flight.ratios.size else 0
        least = flight.least_ratio if flight.ratios.size else None
        used = tuple(self.spent)
        exceeded = tuple(use for use in used if use.exceeded) if used else None
        return Entered(count, len(flight.states), least, self.uncertain, exceeded)

    def drifted(self, lost: LostThrust) -> LostThrust:
        """A loss of thrust with the nearest approach after it in any flight, where that is less."""
        flight, k = self.flight, self.names.index(lost.craft)
        some = slice(max(int(np.searchsorted(flight.times, lost.time)), 0), None)
        near = lost
        for states, arrivals in zip(flight.states, flight.arrivals, strict=True):
            found = least_ratios(states[:, some], arrivals[:, some], flight.times[some], self.zones)
            for pair, ratio in zip(*(one.tolist() for one in found), strict=True):
                if k in pair and ratio < near.ratio:
                    other = self.names[pair[0] if pair[1] == k else pair[1]]
                    near = replace(lost, ratio=ratio, other=other)
        return near

    @cached_property
    def stages(self) -> tuple[FlownStage, ...]:
        """Each by itself."""
        return tuple(self.stage(one) for one in self.run.flown)

    @property
    def thrusters(self) -> tuple[str, ...]:
        """Who fires pulses."""
        own = self.told.get("thrusters", [None] * len(self.names))
        return tuple(name for name, one in zip(self.names, own, strict=True) if one is not None)

    @cached_property
    def unled(self) -> dict[str, float]:
        """Who drifts to sides to which none of its thrusters pushes, and how far off its plan at most [m]."""
        from closeform.dynamics.reachable import lacks, reachable

        flight, found = self.flight, dict[str, float]()
        off = flight.states[..., :3] - flight.planned.position(flight.times)
        for k, own in enumerate(self.told.get("thrusters", ())):
            if own is not None and lacks(own):
                led = reachable(own, flight.orbit.mean_motion * flight.times)
                aside = off[:, k] - np.einsum("tij,stj->sti", led, off[:, k])
                found[self.names[k]] = float(np.linalg.norm(aside, axis=-1).max())
        return found

    @cached_property
    def propellant(self) -> Floats:
        """What each craft burns (S, N) [kg]; nan for one without mass and specific impulse."""
        return self.burnt(slice(None), self.flight.delta_v)

    @cached_property
    def pulses(self) -> dict[str, Any]:
        """What thrusters fire by plan, in columns, and what they burn as the mass falls by it."""
        assert self.flight.firing is not None
        fired = self.flight.firing.pulses
        who = np.array([self.names.index(name) for name in self.thrusters])[fired.craft]
        so_far = np.cumsum(
            np.where(who[:, None] == np.arange(len(self.names)), fired.impulse[:, None], 0.0), 0
        )
        spent = so_far[np.arange(len(who)), who]
        burnt = self.burnt(who, spent) - self.burnt(who, spent - fired.impulse)
        named = {"craft": np.array(self.names)[who], "thruster": fired.thruster + 1, "propellant_kg": burnt}
        return self.flight.firing.burns | named

    def burnt(self, which: Any, delta_v: Floats) -> Floats:
        """What craft, by index, burn for a delta-v [kg]; nan for one without mass and specific impulse."""
        craft = self.run.scenario.craft
        mass = [one.mass if one.specific_impulse is not None else None for one in craft]
        return np.asarray(np.array(mass, dtype=float)[which] * -np.expm1(-delta_v / self.exhaust[which]))

    @cached_property
    def exhaust(self) -> Floats:
        """The speed of each craft's exhaust (N,) [m/s]: of stages that differ, by what is planned in each."""
        own = np.array([one.exhaust for one in self.run.scenario.craft])
        spent = np.array([one.planned.paths.delta_v for one in self.run.flown])
        each = np.array([self.run.scenario.exhaust(one.stage) for one in self.run.flown])
        differ = (each != each[0]).any(axis=0) & spent.any(axis=0)
        own[differ] = spent[:, differ].sum(axis=0) / (spent / each)[:, differ].sum(axis=0)
        return own

    @property
    def spent(self) -> Iterator[Use]:
        """What each craft that has a limit spends in the flight in which it spends most."""
        most = self.flight.delta_v.max(axis=0), self.propellant.max(axis=0)
        return Use.of_spent(self.run.scenario.craft, *most)

    @property
    def grams(self) -> bool:
        """Whether propellant is printed in grams: nobody burns more than a kilogram."""
        return bool(np.nanmax(self.propellant, initial=0.0) <= 1.0)

    def stage(self, result: Any) -> FlownStage:
        """One of them."""
        flight = self.flight
        first = np.searchsorted(flight.times, result.start, "right") - 1
        last = min(int(np.searchsorted(flight.times, result.end - PARTIAL)), len(flight.times) - 1)
        some = slice(int(first), last + 1)
        ratios = flight.ratios
        if len(self.run.flown) > 1 and ratios.size:
            ratios = np.array(
                [
                    least_ratios(one[:, some], before[:, some], flight.times[some], self.zones)[1]
                    for one, before in zip(flight.states, flight.arrivals, strict=True)
                ]
            )
        now = float(flight.times[last])
        ahead = flight.states[:, :, last] - flight.planned.state([now])[:, -1]
        off = np.linalg.norm(ahead[..., :3] + (result.end - now) * ahead[..., 3:], axis=-1)
        return FlownStage(result.number, result.stage.verb, result.start, result.end, off, ratios)

    @cached_property
    def worst(self) -> WatchedFlight:
        """The worst flight, with its conflicts and closest approaches certified."""
        return watch(self.flight.path(self.flight.worst), self.names, self.zones)

    @cached_property
    def worst_by_stage(self) -> tuple[WatchedFlight, ...]:
        """The same from the start of each stage to its end."""
        cuts = [self.flight.times[0], *(one.end for one in self.run.flown)]
        parts = (during(self.worst.paths, start, end) for start, end in pairwise(cuts))
        return tuple(watch(part, self.names, self.zones) for part in parts)

    @property
    def which(self) -> str:
        """Which of many flights is the worst, and why; of a single one nothing."""
        if len(self.flight.states) == 1:
            return ""
        why = "in which two come nearest" if self.flight.ratios.size else "which ends farthest off"
        return f"flight {self.flight.worst} of {len(self.flight.states)}, {why}"

    @cached_property
    def commanded(self) -> tuple[CompensatedThrust, ...]:
        """What is to be commanded in the field, in each stage."""
        return tuple(
            compensated_thrust(one.planned.paths, self.known, engine=self.told["engine"])
            for one in self.run.flown
        )

    @cached_property
    def tube(self) -> Tube | None:
        """How far off feedback leaves each craft, as said beforehand; None without it, and of impulses.

        None, too, where nothing is uncertain, or someone drifts.
        Those lead back to what they fly when changed for the field, which is off the plan between them.  How
        far planned ones are off depends on the plan, and so it does where each burn errs by itself.
        """
        told, impulses = self.told, fires_impulses(self.run.paths)
        drifts = bool(self.run.lost) or not self.told["engine"].all()
        if not self.uncertain or self.control != "track" or drifts:
            return None
        if told["feedback"].impulses or impulses or told["errors"] is not None:
            return None
        sizes = np.broadcast_to(told["thrust_error"], (len(self.names), 2))
        off = np.hypot(sizes[:, 0], sizes[:, 1]) * np.max([one.peak_thrust for one in self.commanded], axis=0)
        return tube(self.run.paths.orbit, told["feedback"], told["navigation"], thrust_error=off)


def differs(control: Control, told: dict[str, Any]) -> bool:
    """Whether flights that are told so are not all the same one."""
    return uncertain(control != "open", told["navigation"], told["thrust_error"], told["errors"])


def fires_pulses(run: Stages) -> bool:
    """Whether anybody flies a run by pulses."""
    return any(craft.fired(1.0) is not None for craft in run.scenario.craft_of_all)


def usually_led(run: Stages, control: Control) -> Feedback:
    """What leads a run back of which nobody said that."""
    return usual_feedback(control, fires_pulses(run) or fires_impulses(planned(run)))


def planned(run: Stages) -> Path:
    """What guidance knows of (N,), from the first stage to the last: not of lost thrust."""
    return followed(run.flown) if run.lost else run.paths


def during(paths: Path, start: float, end: float) -> Path:
    """The arcs of paths (N,) that lie between two times at which arcs of all of them meet, about."""
    middle = 0.5 * (paths.arcs[:, START] + paths.arcs[:, END])
    some = (start < middle) & (middle < end)
    counts = np.add.reduceat(some.astype(int), paths.offsets[:-1])
    return path_of(paths.orbit, paths.arcs[some], np.concatenate([[0], np.cumsum(counts)]), paths.shape)
