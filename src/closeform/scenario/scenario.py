"""Scenario: the contents of a scenario file, read and checked."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf, isnan
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from closeform.arrays import Floats
from closeform.exchange.epochs import Epoch
from closeform.motion.elements.mean_motion import EARTH_RADIUS, low
from closeform.motion.orbit import Orbit
from closeform.scenario.craft import Craft, SearchTable, SensorTable
from closeform.scenario.inputs import Inputs
from closeform.scenario.orbit import FeedbackTable, FlightTable, NavigationTable, OrbitTable, VerdictTable
from closeform.scenario.quantity import shown
from closeform.scenario.stages import Gather, StageTable, Thrusting
from closeform.scenario.study import FAILS, SEARCHED, STATES, UNPLANNED, Study
from closeform.zones.combined_zones import Body, OwnZone
from closeform.zones.pair_zones import PairZones
from closeform.zones.solids import Sphere
from closeform.zones.zone import Zone

if TYPE_CHECKING:
    from closeform.dynamics.force_model.field import Field
    from closeform.exchange.chief import Chief
    from closeform.mission.executed_mission import History
    from closeform.search.schedule import Search
    from closeform.search.search_errors import SearchErrors

TANKS = ("delta_v_budget", "propellant")  # fields of a Craft
FAST = 100.0  # m/s: in low orbit this speed separates craft by 180 km within half an orbit


@dataclass(frozen=True)
class Scenario:
    """Scenario file with every number in SI units and radians.

    `file` is its name in messages and `text` its contents.
    """

    file: str
    text: str
    title: str
    orbit: OrbitTable
    craft: tuple[Craft, ...]
    stages: tuple[StageTable, ...]
    sensor: SensorTable | None = None
    search: SearchTable | None = None
    study: Study | None = None
    feedback: FeedbackTable | None = None
    navigation: NavigationTable | None = None
    flights: FlightTable | None = None
    verdict: VerdictTable | None = None
    case: int | None = None  # number of the case in its study
    astray: "SearchErrors | None" = None  # (N,), search errors that a case has drawn
    history: "History | None" = None  # executed mission of a case with drawn errors
    drawn_flight: "Scenario | None" = None  # of a case: with drawn values unknown to its plans
    flight_seed: int | None = None  # of a case
    points: "tuple[Scenario, ...]" = ()  # of its sweep, each a scenario
    point: Mapping[str, Any] = field(default_factory=dict)  # swept values by key
    place: int | None = None  # index of that point in the sweep
    chief: "Chief | None" = None
    inputs: Inputs | None = None  # input files

    @property
    def digest(self) -> str:
        """SHA-256 of the file."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    @property
    def digests(self) -> dict[str, str]:
        """SHA-256 of the file and of its input files, by their names."""
        return {Path(self.file).name: self.digest} | (self.inputs.digests if self.inputs is not None else {})

    @property
    def epoch(self) -> Epoch | None:
        """Epoch of time 0, or None if the file has none."""
        return self.orbit.epoch

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the craft."""
        return tuple(craft.name for craft in self.craft)

    @cached_property
    def field(self) -> "Field | None":
        """High-fidelity model that `field` of [orbit] describes, or None.

        Raises ValueError, beginning with the key, for an invalid chief; a checked scenario has none.
        """
        table, chief = self.orbit.field, self.chief
        if table is None or chief is None:
            return None
        from closeform.dynamics.force_model.field import Drag, Field

        drag = None
        if table.air is not None:
            each = [craft.ballistic or 0.0 for craft in self.craft]
            own = self.orbit.chief.ballistic if self.orbit.chief is not None else None
            drag = Drag(*table.air, ballistic=np.array(each), chief=own or 0.0)
        return Field(chief, table.zonals, drag)

    @property
    def flight(self) -> dict[str, Any]:
        """Keyword arguments of a simulation other than the paths and the field."""
        most = np.max([[craft.max_acceleration for craft in each] for each in self.crews], axis=0)
        return {
            "feedback": None if self.feedback is None else self.feedback.build(),
            "navigation": (self.navigation or NavigationTable.model_validate({})).build(),
            "thrust_error": np.array([craft.thrust_error for craft in self.craft]),
            "errors": [craft.errors for craft in self.craft] if self.uncertain else None,
            "engine": np.array([craft.engine for craft in self.craft]),
            "max_acceleration": most if np.isfinite(most).any() else None,
        }

    @property
    def strict(self) -> bool:
        """True if a check that the model error leaves undecided is a failure."""
        return self.verdict is not None and self.verdict.model_error == "refuse"

    @property
    def truth(self) -> "Scenario":
        """Scenario to simulate: for a case, with the sampled values that are unknown to its plans."""
        return self.drawn_flight or self

    @property
    def flight_seeds(self) -> tuple[int, ...]:
        """Seeds of the simulations; for a case its own seed."""
        if self.flight_seed is not None:
            return (self.flight_seed,)
        return tuple(range(self.flights.seeds if self.flights is not None else 0))

    @property
    def limited(self) -> bool:
        """True if any craft has a limit of delta-v, propellant or, in at least one stage, thrust."""
        tanks = any(getattr(craft, key) is not None for craft in self.craft for key in TANKS)
        return tanks or any(craft.limited for craft in self.craft_of_all)

    def limits(self, *names: str) -> bool:
        """Return True if the thrust of any of these craft has a limit."""
        return any(craft.limited for craft in self.craft if craft.name in names)

    def craft_in(self, stage: StageTable) -> tuple[Craft, ...]:
        """Return the craft as they thrust in a stage: its engine keys apply to the craft that it moves."""
        if not isinstance(stage, Thrusting) or not stage.given_keys:
            return self.craft
        moving = stage.moving(self.names)
        return tuple(craft.using(stage) if craft.name in moving else craft for craft in self.craft)

    def during(self, stage: StageTable) -> "Scenario":
        """Return the scenario with the craft as they thrust in a stage."""
        return self if (craft := self.craft_in(stage)) is self.craft else replace(self, craft=craft)

    def exhaust(self, stage: StageTable) -> Floats:
        """Return the exhaust speed of each craft (N,) in a stage [m/s]; inf if unknown."""
        return np.array([craft.exhaust for craft in self.craft_in(stage)])

    @property
    def crews(self) -> list[tuple[Craft, ...]]:
        """The craft of [craft], and the craft of each stage that overrides their engines."""
        own = (each for stage in self.stages if (each := self.craft_in(stage)) is not self.craft)
        return [self.craft, *own]

    @property
    def craft_of_all(self) -> tuple[Craft, ...]:
        """All craft of `crews` in one tuple."""
        return sum(self.crews, ())

    def plans_impulses(self, stage: StageTable) -> bool:
        """Return True if any craft can have planned impulses in a stage."""
        jumps = (craft.unlimited or craft.fired(1.0) is not None for craft in self.craft_in(stage))
        return getattr(stage, "cost", None) == "delta-v" and any(jumps)

    @property
    def newtons(self) -> bool:
        """True if the file gives thrust in newtons."""
        return any(craft.max_thrust is not None for craft in self.craft_of_all)  # all craft then have a mass

    def force_mass(self, name: str) -> float | None:
        """Return the mass [kg] that converts a craft's acceleration to newtons; None to keep acceleration."""
        return self.craft[self.names.index(name)].mass if self.newtons else None

    @cached_property
    def keep_out(self) -> tuple[OwnZone | None, ...]:
        """Own zone of each craft, or else its hard body; None for a craft without either."""
        own = self.hard_bodies
        return tuple(
            own[k] if craft.keep_out is None else craft.keep_out.own() for k, craft in enumerate(self.craft)
        )

    @cached_property
    def hard_bodies(self) -> tuple[Body | None, ...]:
        """Hard-body sphere of each craft, or None."""
        radii = [craft.body_radius for craft in self.craft]
        return tuple(None if one is None else Body(Sphere(one)) for one in radii)

    def states(self, orbit: Orbit) -> Floats:
        """Return the initial states (N, 6) of the craft in the scenario's `orbit`; nan for an invalid one."""
        return np.array([one.state(orbit, self.orbit.latitude) for one in self.craft])

    @cached_property
    def zones(self) -> PairZones:
        """Keep-out zone of each pair.

        Raises ValueError, naming two craft, for a pair without a common zone; a checked scenario has none.
        """
        return PairZones.of(self.keep_out, self.names)

    @cached_property
    def bodies(self) -> PairZones:
        """Sphere around both hard bodies of each pair; none for a pair without hard bodies."""
        return PairZones.of(self.hard_bodies, self.names)

    @property
    def uncertain(self) -> bool:
        """True if any craft has uncertainty."""
        return any(
            (craft.covariance is not None and not craft.covariance.exact) or craft.execution is not None
            for craft in self.craft
        )

    @property
    def noisy(self) -> bool:
        """True if any craft has process noise."""
        return any(craft.execution is not None and craft.execution.noise > 0.0 for craft in self.craft)

    @property
    def plan(self) -> "Search":
        """Search that [sensor] and [search] describe.

        Raises ValueError, beginning with the key, outside the published limits.
        """
        if self.sensor is None or self.search is None:
            raise ValueError("search: needs [sensor] and [search]; add both")
        return self.search.build(self.sensor.build())

    def tables_of(self, key: str) -> tuple[tuple[Any, ...], str]:
        """Return the tables with a key, one for each craft for [craft], and the name of its field."""
        section, _, name = key.rpartition(".")
        tables = self.craft if section == "craft" else (attrgetter(section)(self),)
        fields = {type(tables[0]).key_of(field): field for field in type(tables[0]).model_fields}
        return tables, fields[name]

    def given(self, key: str) -> tuple[Any, ...]:
        """Return the values of a key: one for each craft for [craft], a single one for other tables."""
        tables, field = self.tables_of(key)
        return tuple(getattr(table, field) for table in tables)

    @property
    def search_errors(self) -> "SearchErrors | None":
        """Deviations of the craft (N,) from the commanded search; None without any."""
        if self.astray is not None or not any(craft.astray for craft in self.craft):
            return self.astray
        from closeform.search.search_errors import SearchErrors

        keys = ("pointing_error", "slew_rate_error", "start_offset")
        pointing, slew_rate, start = (self.given(f"craft.{key}") for key in keys)
        return SearchErrors(
            pointing,
            slew_rate,
            start,
            slew_acceleration=self.ramps,
            silent=self.silent,
            solar_acceleration=self.given("craft.solar_acceleration"),
            outages=self.outages,
        )

    @property
    def silent(self) -> list[bool]:
        """True if each craft is silent throughout a search."""
        return [craft.silent is True for craft in self.craft]

    @property
    def outages(self) -> Floats | None:
        """Start and end [s] of the silent intervals (N, K, 2), padded with inf; None without any."""
        each = [() if isinstance(craft.silent, bool) else craft.silent for craft in self.craft]
        most = max(map(len, each))
        return np.array([[*own, *[(inf, inf)] * (most - len(own))] for own in each]) if most else None

    @property
    def ramps(self) -> tuple[float, ...]:
        """Slew acceleration of each craft [rad/s^2]; inf for instant rate changes."""
        given: tuple[float | None, ...] = self.given("craft.slew_acceleration")
        return tuple(inf if one is None else one for one in given)

    @property
    def groups(self) -> tuple[Literal["A", "B"], ...]:
        """Group of each craft in a search: by bearings at the start, or as given; A by default."""
        if self.search is not None and self.search.bearing:
            from closeform.search.gathering.problem import groups_by_bearing

            return groups_by_bearing(self.states(self.orbit.build())[:, :3])
        return tuple(craft.group or "A" for craft in self.craft)

    def zones_around(self, name: str) -> tuple[Zone, ...]:
        """Return the zones between one craft and each other, in order, without missing ones."""
        return tuple(zone for zone in self.zones.around(self.names.index(name)) if zone is not None)

    @property
    def opposite(self) -> Any:
        """Pairs (P, 2) of a craft in group A and one in group B."""
        groups = np.array(self.groups)
        return np.argwhere((groups[:, None] == "A") & (groups == "B"))

    def gathering(self, stage: Gather) -> dict[str, Any]:
        """Return the keyword arguments of `gather` other than the search and the states."""
        return {
            "groups": self.groups,
            "keep_out": self.zones,
            "rounds": stage.rounds,
            "burns": stage.burns,
            "max_speed": self.search.max_speed if self.search is not None else None,
            "errors": self.search_errors,
            "step": stage.step,
            "seed": self.study.seed if self.study is not None else 0,
            "case": self.case or 0,
        }

    @property
    def doubts(self) -> tuple[str, ...]:
        """Warnings about valid but improbable input, one line each: low orbits, high relative speeds."""
        lines, table, chief = [], self.orbit, self.chief
        if table.altitude is not None and table.radius is None and (line := low(table.altitude)):
            lines.append(f"orbit.altitude: {line}")
        if chief is not None and chief.center.upper() == "EARTH":
            perigee = chief.semi_major_axis * (1.0 - chief.eccentricity) - EARTH_RADIUS
            lines += [f"orbit.chief: its perigee at {line}"] if (line := low(perigee)) else []
        speeds = np.linalg.norm(self.states(table.build())[:, 3:], axis=1)
        if (fastest := float(np.nanmax(speeds, initial=0.0))) > FAST:
            name = self.names[int(np.nanargmax(speeds))]
            what = f"{name} begins at {fastest:.6g} m/s relative to the formation's origin"
            lines.append(f"craft: {what}, too fast for a close formation; check units and the chief")
        return tuple(lines)

    def refused(self, command: str) -> tuple[str, ...]:
        """Return the reasons that prevent "run", "run --case" or "study" from starting, one line each."""
        if command != "run":
            return self.unbuilt_study()
        together = self.coincident() if any(stage.searches for stage in self.stages) else ()
        return together and (self.unbuilt_study() or together)  # the cases of a study draw other positions

    def unbuilt_study(self) -> tuple[str, ...]:
        """Return one line for each unsupported feature that a study, or one case of it, needs."""
        if self.study is None or self.study.draws == "errors":
            return ()
        lines = []
        for key in self.study.vary:
            place = f"study.vary.{shown(key)}"
            if key in SEARCHED and not any(stage.searches for stage in self.stages):
                lines.append(f"{place}: no stage is a search; remove it")
            elif key.startswith(UNPLANNED) and self.flights is None:
                lines.append(f"{place}: requires a simulation; add [simulation], or remove it")
            elif key not in SEARCHED and not key.startswith(("craft.", *UNPLANNED)):
                lines.append(f"{place}: cannot vary between cases; use [study.sweep]")
        return tuple(lines)

    @property
    def searches_alone(self) -> bool:
        """True if a search is the only stage, and only states, search errors and thrust loss vary."""
        if self.study is not None and self.study.draws == "replanned":
            return False
        vary = self.study.vary if self.study is not None else {}
        known = {*STATES, *SEARCHED, *((FAILS,) if isinstance(self.stages[0], Gather) else ())}
        return len(self.stages) == 1 and self.stages[0].searches and {*vary} <= known

    @property
    def scattered(self) -> bool:
        """True if a study draws the positions, so that the nominal ones may conflict."""
        return self.study is not None and "craft.position" in self.study.vary

    def coincident(self) -> tuple[str, ...]:
        """Return one line for each craft at the position of an earlier one; a search rejects them."""
        remedy = "add --case K, or use closeform study" if self.scattered else "move one of them"
        first: dict[tuple[float, ...], str] = {}
        lines = []
        places = self.states(self.orbit.build())[:, :3].tolist()
        for name, place in zip(self.names, places, strict=True):
            if isnan(place[0]):
                continue  # not yet known
            there = first.setdefault(tuple(place), name)
            if there != name:
                lines.append(f"craft.position: {there} and {name} are at the same position; {remedy}")
        return tuple(lines)
