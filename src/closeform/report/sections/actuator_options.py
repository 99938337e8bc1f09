"""Delta-v by actuator option: two impulses, minimum energy or delta-v, thrust limits, given thrusters."""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import isfinite
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.mission.mission_result import AvoidResult, Mission, ReconfigureResult, StageResult
from closeform.motion.chief_orbit import ChiefOrbit
from closeform.motion.duration import MOST_TURNS
from closeform.motion.path import Path, ends_of
from closeform.report.description import Column, Table
from closeform.report.picture import Picture
from closeform.report.sections import effort
from closeform.scenario import Craft

MOST = 24  # maximum number of spacecraft for which options are evaluated
DURATIONS = np.geomspace(0.1, 3.0, 40)  # multiples of the plan's duration at which the trade is evaluated
NOTHING = 1e-9  # m/s: lower bound of a plan below which shares are meaningless
CHOICE = (
    Column("option", "choice", words=True),
    Column("delta-v [m/s]", "delta_v_m_s", "{:#.6g}".format, absent="impossible"),
    Column("above free minimum [%]", "above_least", "{:+z.3f}".format, 100.0),
    effort.FUEL,
)


@dataclass(frozen=True, eq=False)
class Choices:
    """Actuator options of the spacecraft `movers`, each alone between the ends of its direct path."""

    mission: Mission
    result: StageResult[Any, Any]
    movers: Sequence[str]
    zones: bool = True  # whether the stage keeps zones

    @property
    def shown(self) -> bool:
        """True if options and burns are reported: with `zones`, only for minimum delta-v or pulses."""
        return not self.zones or self.result.stage.cost == "delta-v" or self.result.pulsed is not None

    @cached_property
    def fired(self) -> effort.StageBurns:
        """The burns of the stage."""
        return effort.StageBurns(self.mission, self.result)

    @property
    def craft(self) -> Sequence[Craft]:
        """All spacecraft with the thrust settings of the stage."""
        return self.mission.scenario.craft_in(self.result.stage)

    @cached_property
    def ends(self) -> tuple[Floats, Floats, float, float]:
        """Initial and final states (N, 6), duration and start [s]."""
        paths = [self.result.before.path(name) for name in self.movers]
        initial, final = (np.array(states) for states in zip(*map(ends_of, paths), strict=True))
        return initial, final, paths[0].end - paths[0].start, paths[0].start

    @cached_property
    def least(self) -> Any:
        """The delta-v bounds of the movers; None with too many movers or too long a duration."""
        from closeform.fuel.bound import least_delta_v

        initial, final, duration, start = self.ends
        if len(self.movers) > MOST or duration > MOST_TURNS * self.mission.orbit.period:
            return None
        return least_delta_v(self.mission.orbit, initial, final, duration, start=start)

    @property
    def lower(self) -> float:
        """The lower bound on the total delta-v of any plan [m/s]."""
        return float(np.sum(self.least.lower))

    @cached_property
    def tried(self) -> dict[str, Any]:
        """The delta-v per mover of each option except the plan [m/s], or the reason why it is impossible."""
        orbit, (initial, final, duration, start) = self.mission.orbit, self.ends
        task = initial, final, duration, start
        craft = [self.craft[k] for k in self.places]
        limits = [one.max_acceleration for one in craft]
        options: dict[str, Callable[[], Any]] = {"minimum energy": lambda: orbit.transfer(*task).delta_v}
        if orbit.period < np.inf:
            options["impulses at both ends"] = lambda: orbit.two_impulse(*task).delta_v
        if np.isfinite(limits).all():
            options["minimum energy, within the limit"] = lambda: orbit.transfer(*task, limits).delta_v
            options["burns and coasts, within the limit"] = lambda: (
                orbit.transfer(*task, limits, "delta-v").delta_v
            )
        if all(one.thrusters is not None for one in craft):
            options["impulses of these thrusters"] = self.by_thrusters
        impulses = "free impulses" if orbit.period < np.inf else "two impulses"  # in deep space: at both ends
        options[f"minimum delta-v, {impulses}"] = lambda: self.least.upper
        return {name: self.spent_or_why(spent) for name, spent in options.items()}

    def spent_or_why(self, spent: Callable[[], Any]) -> Any:
        """Return the cost of an option, or the reason why it is impossible, as text."""
        try:
            return spent()
        except ValueError as error:
            why = str(error).partition(": ")[2].split(";")[0].split(", at [")[0]
            found = re.match(r"craft (\d+): ", why)
            if found is None:
                return why
            craft = f"{self.movers[int(found[1])]}, " * (len(self.movers) > 1)
            return f"{craft}{why[found.end() :]}"

    @cached_property
    def rows(self) -> list[tuple[Any, ...]]:
        """Rows of CHOICE, highest cost first; the plan comes last."""
        found = [self.row(name, spent) for name, spent in self.tried.items()]
        found = sorted(found, key=lambda row: -float(f"{row[1] or np.inf:.6g}"))  # as printed
        if self.result.executed:
            planned = [effort.asked(self.mission, self.result, name, self.plan(name)) for name in self.movers]
            found.append(self.row("this plan", planned))
            if self.result.pulsed is not None:
                found.append(self.row("this plan, as fired", self.result.delta_v[self.places]))
        return found

    @property
    def places(self) -> list[int]:
        """The indices of the movers among all spacecraft."""
        return [self.mission.scenario.names.index(name) for name in self.movers]

    def row(self, name: str, spent: Any) -> tuple[Any, ...]:
        """Return a row of CHOICE from the delta-v of each mover [m/s] or the reason for its absence."""
        if isinstance(spent, str) or not np.isfinite(spent).all():
            return name, None, None, None
        total = float(np.sum(spent))
        burnt = sum(
            self.mission.burnt(self.result.number, k, float(one))
            for k, one in zip(self.places, spent, strict=True)
        )
        above = effort.above(total, self.lower) if self.lower > NOTHING else None
        return name, total, above, burnt if isfinite(burnt) else None

    def by_thrusters(self) -> Floats:
        """Return the delta-v of each mover with impulses of its thrusters [m/s], summed over these."""
        initial, final, duration, start = self.ends
        return np.array(
            [
                self.mission.orbit.impulsive(
                    initial[k], final[k], duration, start, self.craft[place].fired(1.0)
                ).delta_v
                for k, place in enumerate(self.places)
            ]
        )

    @property
    def compared(self) -> bool:
        """True if options are reported and have a positive lower bound."""
        return self.shown and self.least is not None and self.lower > 0.0

    @property
    def tables(self) -> Iterator[Table]:
        """The tables of options and of burns."""
        if self.compared:
            alone = ", each craft by itself, without zones" * self.zones
            yield Table(f"Delta-v by actuator option{alone}", effort.shown(self.mission, CHOICE), self.rows)
        if self.shown:
            yield from self.fired.tables

    @property
    def lines(self) -> Iterator[str]:
        """The reasons why options are impossible, one line per option."""
        if self.compared:
            yield from (f"No {name}: {why}" for name, why in self.tried.items() if isinstance(why, str))

    @property
    def figures(self) -> dict[str, Any]:
        """The options and the pulses as figures for `summary.json`."""
        if not self.shown or self.least is None:
            return self.fired.figures
        options = {"least_m_s": self.lower, "choices": Table("", CHOICE, self.rows).records}
        return options | self.fired.figures

    @property
    def pictures(self) -> Iterator[Picture]:
        """The burns, the primer vector of the plan with the highest cost, and delta-v against duration."""
        if self.shown:
            yield from effort.burn_pictures(self.result)
        if not self.compared:
            return
        required = getattr(self.result.result, "required", None)  # which the primer does not show
        if self.result.stage.cost == "delta-v" and self.result.executed and not required:
            most = max(self.movers, key=lambda name: float(self.plan(name).delta_v))
            shows = f"{most}, which spends most" if len(self.movers) > 1 else ""
            caption = f"Primer vector of {most}: impulses are optimal where its length is one"
            yield Picture("primer", caption, "primer", *self.primer(most), shows=shows)
        if isinstance(self.mission.orbit, ChiefOrbit):  # delta-v depends on the departure there
            return
        plans = [self.plan(name) for name in self.movers] if self.result.executed else None
        caption = "Minimum delta-v against duration" + ", all craft together, without zones" * (
            len(self.movers) > 1
        )
        yield Picture("trade", caption, "trade", (self.trade, plans))

    def primer(self, name: str) -> tuple[tuple[Any, ...], dict[str, Any]]:
        """Return arguments and options of a spacecraft's primer plot: its plan around zones, or its path."""
        scenario, done = self.mission.scenario, self.result.result
        own = {"thrusters": self.craft[scenario.names.index(name)].fired(1.0)}
        if isinstance(done, ReconfigureResult):
            return (done.plan, done.movers.index(name)), own
        return (done.plan if isinstance(done, AvoidResult) else self.plan(name),), own

    def plan(self, name: str) -> Path:
        """Return the planned path of a spacecraft."""
        return self.result.planned.path(name)

    @cached_property
    def trade(self) -> Any:
        """The minimum delta-v to the same natural motions by duration, summed over the movers."""
        from closeform.fuel.arrivals import transfer_cost_table

        orbit, (initial, final, duration, start) = self.mission.orbit, self.ends
        times = duration * DURATIONS
        times = times[times <= MOST_TURNS * orbit.period]
        slots = final @ orbit.transition(-duration, start + duration).T
        each = [
            transfer_cost_table(orbit, one, slot[None], times)
            for one, slot in zip(initial, slots, strict=True)
        ]
        spent, least = (np.sum([getattr(one, what) for one in each], axis=0) for what in ("delta_v", "lower"))
        return replace(each[0], delta_v=spent, lower=least)
