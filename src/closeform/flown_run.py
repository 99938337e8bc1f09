"""A run as it is flown in its field, many times: every stage from where the one before was flown to."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.flight import ALL_PAIRS, WatchedFlight, watch
from closeform.field.commanded import CommandedThrust, thrust
from closeform.field.field import Field
from closeform.field.flight import fly, usual_feedback
from closeform.field.flight_result import Flight
from closeform.field.least_ratios import least_ratios
from closeform.field.tube import Tube, tube
from closeform.mission_result import Stages
from closeform.motion.path import fires_impulses
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
    """All flown stages of a `run`, in one `flight`, as `told` (what `fly` was given); `control` as there."""

    run: Stages
    field: Field
    control: Control
    told: dict[str, Any]
    flight: Flight

    @classmethod
    def of(cls, run: Stages, field: Field, control: Control, told: dict[str, Any], seeds: int) -> "FlownRun":
        """Fly it.  Raises ValueError where it cannot be."""
        zones = run.scenario.zones if run.scenario.zones.pairs <= ALL_PAIRS else None
        fires = fires_impulses(run.paths)
        told = told | {"feedback": told["feedback"] or usual_feedback(control, fires)}
        if fires:
            told["max_acceleration"] = None
        flight = fly(run.paths, field, control, zones=zones, seeds=seeds, **told)
        return cls(run, field, control, told, flight)

    @property
    def names(self) -> tuple[str, ...]:
        """The craft's names."""
        return self.run.scenario.names

    @property
    def zones(self) -> PairZones:
        """Who keeps which zone with whom."""
        return self.run.scenario.zones

    @cached_property
    def stages(self) -> tuple[FlownStage, ...]:
        """Each by itself."""
        return tuple(self.stage(one) for one in self.run.flown)

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
    def commanded(self) -> tuple[CommandedThrust, ...]:
        """What is to be commanded in the field, in each stage."""
        return tuple(thrust(one.after.paths, self.field) for one in self.run.flown)

    @cached_property
    def tube(self) -> Tube | None:
        """How far off feedback leaves each craft, as said beforehand; None without it, and of impulses.

        Those lead back to what they fly when changed for the field, which is off the plan between them.
        """
        if self.control != "track" or self.told["feedback"].impulses:
            return None
        sizes = np.broadcast_to(self.told["thrust_error"], (len(self.names), 2))
        off = np.hypot(sizes[:, 0], sizes[:, 1]) * np.max([one.peak_thrust for one in self.commanded], axis=0)
        return tube(self.run.paths.orbit, self.told["feedback"], self.told["navigation"], thrust_error=off)
