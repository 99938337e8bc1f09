"""Scenario: what a file says, read and checked."""

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
from closeform.motion.circular import low
from closeform.motion.orbit import Orbit
from closeform.scenario.craft import Craft, SearchTable, SensorTable
from closeform.scenario.field import FeedbackTable, FlightTable, NavigationTable, VerdictTable
from closeform.scenario.inputs import Inputs
from closeform.scenario.orbit import OrbitTable
from closeform.scenario.quantity import shown
from closeform.scenario.stage_table import StageTable, Thrusting
from closeform.scenario.stages import Gather
from closeform.scenario.study import FAILS, SEARCHED, STATES, UNPLANNED, Study
from closeform.zones.combined_zones import Body, OwnZone
from closeform.zones.pair_zones import PairZones
from closeform.zones.solids import Sphere
from closeform.zones.zone import Zone

if TYPE_CHECKING:
    from closeform.campaign.executed_mission import History
    from closeform.dynamics.field import Field
    from closeform.exchange.chief import Chief
    from closeform.search.schedule import Search
    from closeform.search.search_errors import SearchErrors

TANKS = ("delta_v_budget", "propellant")  # fields of a Craft
FAST = 100.0  # m/s: in low orbit a speed that takes craft 180 km apart within half a turn


@dataclass(frozen=True)
class Scenario:
    """A scenario file; every number in SI units and radians.

    `file` names it in messages, `text` is what stands in it.
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
    case: int | None = None  # of the study, if this is one
    astray: "SearchErrors | None" = None  # (N,), how the craft search, where a case has drawn it
    history: "History | None" = None  # of a case whose errors are drawn
    drawn_flight: "Scenario | None" = None  # of a case: with what is drawn that its plans do not know
    flight_seed: int | None = None  # of a case
    points: "tuple[Scenario, ...]" = ()  # of its sweep
    point: Mapping[str, Any] = field(default_factory=dict)  # of a sweep: the values by key
    place: int | None = None  # of that point among all
    chief: "Chief | None" = None
    inputs: Inputs | None = None  # the files that it names

    @property
    def digest(self) -> str:
        """SHA-256 of the file."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    @property
    def digests(self) -> dict[str, str]:
        """SHA-256 of the file and of those that it names, by their names."""
        return {Path(self.file).name: self.digest} | (self.inputs.digests if self.inputs is not None else {})

    @property
    def epoch(self) -> Epoch | None:
        """The instant of its time 0, where the file tells one."""
        return self.orbit.epoch

    @property
    def names(self) -> tuple[str, ...]:
        """The craft's names."""
        return tuple(craft.name for craft in self.craft)

    @cached_property
    def field(self) -> "Field | None":
        """What pulls on everybody, as [orbit] tells it; None where it does not.

        Raises ValueError, beginning with the key, for a chief that cannot fly there (a checked scenario has
        none such).
        """
        table, chief = self.orbit.field, self.chief
        if table is None or chief is None:
            return None
        from closeform.dynamics.drag import Drag
        from closeform.dynamics.field import Field

        drag = None
        if table.air is not None:
            each = [craft.ballistic or 0.0 for craft in self.craft]
            own = self.orbit.chief.ballistic if self.orbit.chief is not None else None
            drag = Drag(*table.air, ballistic=np.array(each), chief=own or 0.0)
        return Field(chief, table.zonals, drag)

    @property
    def flight(self) -> dict[str, Any]:
        """What `fly` is to be told beside the paths and the field."""
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
        """Whether what the model error leaves open is a failure."""
        return self.verdict is not None and self.verdict.model_error == "refuse"

    @property
    def truth(self) -> "Scenario":
        """With what is flown, which plans need not know: of a case with all that it has drawn."""
        return self.drawn_flight or self

    @property
    def flight_seeds(self) -> tuple[int, ...]:
        """With which its flights draw their errors: of a case one of its own."""
        if self.flight_seed is not None:
            return (self.flight_seed,)
        return tuple(range(self.flights.seeds if self.flights is not None else 0))

    @property
    def limited(self) -> bool:
        """Whether any craft has a limit of thrust, in a stage at least, of delta-v or propellant."""
        tanks = any(getattr(craft, key) is not None for craft in self.craft for key in TANKS)
        return tanks or any(craft.limited for craft in self.craft_of_all)

    def limits(self, *names: str) -> bool:
        """Whether the thrust of any of these craft has a limit."""
        return any(craft.limited for craft in self.craft if craft.name in names)

    def craft_in(self, stage: StageTable) -> tuple[Craft, ...]:
        """The craft as they thrust in a stage: with what it says of the engines of those who move in it."""
        if not isinstance(stage, Thrusting) or not stage.told:
            return self.craft
        moving = stage.moving(self.names)
        return tuple(craft.using(stage) if craft.name in moving else craft for craft in self.craft)

    def during(self, stage: StageTable) -> "Scenario":
        """The scenario with craft as they thrust in a stage."""
        return self if (craft := self.craft_in(stage)) is self.craft else replace(self, craft=craft)

    def exhaust(self, stage: StageTable) -> Floats:
        """The speed of each craft's exhaust (N,) in a stage [m/s]; inf where what it burns is not known."""
        return np.array([craft.exhaust for craft in self.craft_in(stage)])

    @property
    def crews(self) -> list[tuple[Craft, ...]]:
        """The craft as [craft] has them, and as they thrust in each stage that says otherwise."""
        own = (each for stage in self.stages if (each := self.craft_in(stage)) is not self.craft)
        return [self.craft, *own]

    @property
    def craft_of_all(self) -> tuple[Craft, ...]:
        """All of these."""
        return sum(self.crews, ())

    def plans_impulses(self, stage: StageTable) -> bool:
        """Whether anybody is to plan impulses in a stage."""
        jumps = (craft.unlimited or craft.fired(1.0) is not None for craft in self.craft_in(stage))
        return getattr(stage, "cost", None) == "delta-v" and any(jumps)

    @property
    def newtons(self) -> bool:
        """Whether the file speaks of thrust in newtons."""
        return any(craft.max_thrust is not None for craft in self.craft_of_all)  # and then all have a mass

    def force_mass(self, name: str) -> float | None:
        """The mass [kg] by which a craft's thrust is told in newtons; None where it is an acceleration."""
        return self.craft[self.names.index(name)].mass if self.newtons else None

    @cached_property
    def keep_out(self) -> tuple[OwnZone | None, ...]:
        """Each craft's own zone, its hard body where it keeps no other; None for a craft without one."""
        own = self.hard_bodies
        return tuple(
            own[k] if craft.keep_out is None else craft.keep_out.own() for k, craft in enumerate(self.craft)
        )

    @cached_property
    def hard_bodies(self) -> tuple[Body | None, ...]:
        """The sphere that holds each craft; None where none is given."""
        radii = [craft.hard_body for craft in self.craft]
        return tuple(None if one is None else Body(Sphere(one)) for one in radii)

    def states(self, orbit: Orbit) -> Floats:
        """The craft's states (N, 6) at the start, in the scenario's `orbit`; nan where one is wrong."""
        return np.array([one.state(orbit, self.orbit.latitude) for one in self.craft])

    @cached_property
    def zones(self) -> PairZones:
        """Who keeps which zone with whom.

        Raises ValueError naming two craft of which no zone can be made (a checked scenario has none such).
        """
        return PairZones.of(self.keep_out, self.names)

    @cached_property
    def bodies(self) -> PairZones:
        """The spheres that hold both hard bodies of each pair; none of a pair without any."""
        return PairZones.of(self.hard_bodies, self.names)

    @property
    def uncertain(self) -> bool:
        """Whether any craft has errors."""
        return any(
            (craft.covariance is not None and not craft.covariance.exact) or craft.execution is not None
            for craft in self.craft
        )

    @property
    def noisy(self) -> bool:
        """Whether any craft is shaken by white noise."""
        return any(craft.execution is not None and craft.execution.noise > 0.0 for craft in self.craft)

    @property
    def plan(self) -> "Search":
        """The search of the core that [sensor] and [search] describe.

        Raises ValueError, beginning with the key, where the papers refuse.
        """
        if self.sensor is None or self.search is None:
            raise ValueError("search: needs [sensor] and [search]; add both")
        return self.search.build(self.sensor.build())

    def given(self, key: str) -> tuple[Any, ...]:
        """What stands in the file for a key of [craft], of each; of other tables, once."""
        section, _, name = key.rpartition(".")
        tables = self.craft if section == "craft" else (attrgetter(section)(self),)
        fields = {type(tables[0]).key_of(field): field for field in type(tables[0]).model_fields}
        return tuple(getattr(table, fields[name]) for table in tables)

    @property
    def search_errors(self) -> "SearchErrors | None":
        """How far the craft (N,) are off what a search asks of them; None where nobody is."""
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
            outages=self.outages,
        )

    @property
    def silent(self) -> list[bool]:
        """Whether each craft is silent all along in a search."""
        return [craft.silent is True for craft in self.craft]

    @property
    def outages(self) -> Floats | None:
        """Begin and end [s] of the intervals in which craft are silent (N, K, 2); None without any."""
        each = [() if isinstance(craft.silent, bool) else craft.silent for craft in self.craft]
        most = max(map(len, each))
        return np.array([[*own, *[(inf, inf)] * (most - len(own))] for own in each]) if most else None

    @property
    def ramps(self) -> tuple[float, ...]:
        """With which acceleration each craft's turns begin and end [rad/s^2]; inf for at once."""
        given: tuple[float | None, ...] = self.given("craft.slew_acceleration")
        return tuple(inf if one is None else one for one in given)

    @property
    def groups(self) -> tuple[Literal["A", "B"], ...]:
        """The craft's groups in a search; A where none is given."""
        return tuple(craft.group or "A" for craft in self.craft)

    def zones_around(self, name: str) -> tuple[Zone, ...]:
        """The zones of one craft about the others that it keeps one with, in their order."""
        return tuple(zone for zone in self.zones.around(self.names.index(name)) if zone is not None)

    @property
    def opposite(self) -> Any:
        """The pairs (P, 2) of a craft in group A and one in B."""
        groups = np.array(self.groups)
        return np.argwhere((groups[:, None] == "A") & (groups == "B"))

    def gathering(self, stage: Gather) -> dict[str, Any]:
        """What `gather` is to be told beside the search and the states."""
        return {
            "groups": self.groups,
            "keep_out": self.zones,
            "rounds": stage.rounds,
            "burns": stage.burns,
            "max_speed": self.search.max_speed if self.search is not None else None,
            "errors": self.search_errors,
        }

    @property
    def doubts(self) -> tuple[str, ...]:
        """What is legal and probably not meant, one line each: low orbits, speeds of no formation."""
        lines, table = [], self.orbit
        if table.altitude is not None and table.radius is None and (line := low(table.altitude)):
            lines.append(f"orbit.altitude: {line}")
        speeds = np.linalg.norm(self.states(table.build())[:, 3:], axis=1)
        if (fastest := float(np.nanmax(speeds, initial=0.0))) > FAST:
            name = self.names[int(np.nanargmax(speeds))]
            what = f"{name} begins at {fastest:.6g} m/s relative to the formation's origin"
            lines.append(f"craft: {what}, which no close formation has; check units and the chief")
        return tuple(lines)

    def refused(self, command: str) -> tuple[str, ...]:
        """Why "run", "run --case" or "study" would not begin to fly this scenario, one line each."""
        if command != "run":
            return self.unbuilt_study()
        together = self.coincident() if any(stage.searches for stage in self.stages) else ()
        return together and (self.unbuilt_study() or together)  # the cases of a study keep them apart

    def unbuilt_study(self) -> tuple[str, ...]:
        """What a study, or one case of it, would need and this version does not have, one line each."""
        if self.study is None or self.study.draws == "errors":
            return ()
        lines = []
        for key in self.study.vary:
            place = f"study.vary.{shown(key)}"
            if key in SEARCHED and not any(stage.searches for stage in self.stages):
                lines.append(f"{place}: nobody searches here; remove it")
            elif key.startswith(UNPLANNED) and self.flights is None:
                lines.append(f"{place}: is of flights, and cases fly none; add [simulation], or remove it")
            elif key not in SEARCHED and not key.startswith(("craft.", *UNPLANNED)):
                lines.append(f"{place}: is one for all cases; run the study for each value")
        return tuple(lines)

    @property
    def searches_alone(self) -> bool:
        """Whether it is one search, of which only states, errors of the search and lost thrust vary."""
        if self.study is not None and self.study.draws == "replanned":
            return False
        vary = self.study.vary if self.study is not None else {}
        known = {*STATES, *SEARCHED, *((FAILS,) if isinstance(self.stages[0], Gather) else ())}
        return len(self.stages) == 1 and self.stages[0].searches and {*vary} <= known

    @property
    def scattered(self) -> bool:
        """Whether a study draws the craft's positions, so that their nominal ones need not fit."""
        return self.study is not None and "craft.position" in self.study.vary

    def coincident(self) -> tuple[str, ...]:
        """Craft at the place of one before them, one line each; a search refuses them."""
        remedy = "add --case K, or use closeform study" if self.scattered else "move one of them"
        first: dict[tuple[float, ...], str] = {}
        lines = []
        places = self.states(self.orbit.build())[:, :3].tolist()
        for name, place in zip(self.names, places, strict=True):
            if isnan(place[0]):
                continue  # unknown yet
            there = first.setdefault(tuple(place), name)
            if there != name:
                lines.append(f"craft.position: {there} and {name} are at one place; {remedy}")
        return tuple(lines)
