"""Tables of [[stage]]: the keys that all stages share, and one model for each verb in `do`."""

from collections.abc import Iterator
from math import inf
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Union

import numpy as np
from pydantic import Discriminator, Field, Tag

from closeform.arrays import Floats
from closeform.motion.orbit import Orbit
from closeform.safety.failures import DegradedThrust, Failure, MissedBurns, StuckOnThrust, ThrustLost
from closeform.scenario.craft import Engine
from closeform.scenario.formation import Destination, Goal, Target
from closeform.scenario.path_requirements import (
    ApproachSpeed,
    Corridor,
    Exclusion,
    Exhaust,
    Instant,
    QuietTime,
    Waypoint,
)
from closeform.scenario.quantity import SHARE, TIME, Proving, Reader
from closeform.scenario.table import (
    UNKNOWN_VERB,
    Drift,
    Length,
    Margin,
    Name,
    Names,
    Position,
    Proof,
    Span,
    Speed,
    Table,
    Vector,
    Velocity,
    setting,
    tag,
)

Cost = Literal["energy", "delta-v"]
Failed = Literal["thrust lost", "burns missed", "thrust weak", "thrust stuck"]


class StageTable(Table):
    """Keys and properties that all stages share."""

    keeps_out: ClassVar[bool] = True  # whether the stage needs keep_out in [craft]
    searches: ClassVar[bool] = False  # whether the stage needs [sensor], [search] and craft groups

    do: str = setting('"coast"', "kind of stage", ...)
    name: Name | None = setting('"threat"', "name of the stage, different for each")
    sigmas: Annotated[float, Field(gt=0, le=1000)] | None = setting(
        "3.0", "required clearance of all pairs in standard deviations of their errors"
    )
    max_probability: Annotated[float, Field(gt=0, le=1)] | None = setting(
        "1e-4", "maximum probability of collision of two hard bodies, met by the upper end of its interval"
    )

    @property
    def assigns(self) -> bool:
        """True if the plan assigns the slots to the craft."""
        return False

    @property
    def verb(self) -> str:
        """Value of `do`."""
        return type(self).__name__.lower()

    @property
    def durations(self) -> dict[str, Span]:
        """Durations of the stage by key."""
        fields = "length", "within", "drift"
        given = {name: getattr(self, name, None) for name in fields}
        return {self.key_of(name): value for name, value in given.items() if value is not None}

    @property
    def craft_named(self) -> dict[str, tuple[str, ...]]:
        """Craft that the stage names, by key."""
        return {}

    def moving(self, names: Names) -> Names:
        """Return the names of the craft that may thrust in the stage, in planning order."""
        return ()

    @property
    def targets(self) -> dict[str, Target | Goal]:
        """States or formations that craft move to, by key."""
        return {}


class Drifting(StageTable):
    """Stage with a passive-safety horizon: no conflict occurs during free drift for `drift` afterwards."""

    drift: Drift | None = setting('"24 h"', 'passive-safety horizon after the end of the stage, or "forever"')
    animation: bool = setting("true", "true for a GIF of the motion of up to 400 spacecraft", False)

    @property
    def for_ever(self) -> bool:
        """True if the drift has no end."""
        return self.drift is not None and self.drift.seconds == inf

    @property
    def lasting(self) -> str:
        """Duration of the drift as text."""
        return "for ever" if self.for_ever else f"for {self.drift}"

    @property
    def what_fails(self) -> Failure:
        """Failure that precedes the drift."""
        return ThrustLost()


class ArrivalTolerance(Table):
    """Largest arrival error that pulses of thrusters may leave.

    Relative satellite navigation resolves a decimetre and a tenth of a millimetre per second, so that a
    tighter tolerance has little meaning. An along-track error of 1 mm/s drifts 17 m per orbit at 500 km.
    """

    position: Length = setting('"1 m"', "maximum position error at arrival", 1.0)
    velocity: Speed = setting('"1 mm/s"', "maximum velocity error at arrival", 1e-3)


class Thrusting(Engine, Drifting):
    """Stage with thrust: the cost to minimize, the engine and the failure to consider."""

    within: Span = setting('"0.5 orbits"', "duration", ...)
    arrival: ArrivalTolerance = setting(
        '{ position = "1 m", velocity = "1 mm/s" }',
        "maximum arrival error of thruster pulses; a larger one gives status 1",
        lambda: ArrivalTolerance.model_validate({}),
    )
    cost: Cost = setting(
        '"delta-v"', "minimum control energy by smooth thrust, or minimum delta-v by impulses", "energy"
    )
    failure: Failed | None = setting(
        '"thrust lost"',
        'failure that precedes the drift, by default "thrust lost"',
        only_with="drift",
    )
    least: Annotated[float, Reader(SHARE, least="zero", below="100 %")] | None = setting(
        '"90 %"',
        "minimum fraction of the planned thrust that missed burns or weak thrust give; by default 0 %",
        only_if={"failure": ("burns missed", "thrust weak")},
    )
    longest: Span | None = setting(
        '"10 s"',
        "maximum time of stuck-on thrust",
        only_if={"failure": ("thrust stuck",)},
    )

    def flaws(self) -> Iterator[str]:
        yield from super().flaws()
        if self.failure == "thrust stuck" and self.longest is None:
            yield 'failure = "thrust stuck" needs longest; add for example longest = "10 s"'
        if self.longest is not None and self.longest.orbits:
            yield 'longest is a time; write for example longest = "10 s"'

    @property
    def plans_drift(self) -> bool:
        """True if a plan can be made passively safe for the drift: loss of thrust and a finite horizon."""
        lost = self.failure in (None, "thrust lost")
        return self.drift is not None and not self.for_ever and lost

    @property
    def what_fails(self) -> Failure:
        if self.failure == "thrust stuck" and self.longest is not None:
            return StuckOnThrust(self.longest.seconds)
        if self.failure in ("burns missed", "thrust weak"):
            return (MissedBurns if self.failure == "burns missed" else DegradedThrust)(self.least or 0.0)
        return ThrustLost()


Fallback = Literal["more sides", "longer", "stagger"]
Fallbacks = Annotated[tuple[Fallback, ...], Field(strict=False)]
ALL_FALLBACKS: tuple[Fallback, ...] = ("more sides", "longer", "stagger")
FALLBACK_EXAMPLE = '["more sides", "longer", "stagger"]'


class Burn(Table):
    """Given impulse: a velocity change of one craft, `at` a time after the start of the stage."""

    craft: Name = setting('"F1"', "spacecraft that burns", ...)
    at: Instant = setting('"0.5 orbits"', "time after the start of the stage, before its end", ...)
    delta_v: Velocity = setting('"0 0.1 0 m/s"', "velocity change: radial, along-track, cross-track", ...)


class Coast(Drifting):
    """Natural motion of all craft, with given impulses in `burns` and given paths for `follow`."""

    length: Span = setting('"0.5 orbits"', "duration", ..., alias="for")
    burns: Annotated[tuple[Burn, ...], Field(strict=False)] = setting(
        '[{ craft = "F1", at = "10 min", delta_v = "-0.1 0 0 m/s" }]', "given impulses", ()
    )
    follow: Names = setting(
        '["F1"]', "spacecraft that follow the file of their `start` or `states` over the whole stage", ()
    )

    def flaws(self) -> Iterator[str]:
        yield from super().flaws()
        for burn in self.burns:
            if burn.craft in self.follow:
                yield f"burns and follow both move {burn.craft}; keep one"

    def moving(self, names: Names) -> Names:
        return tuple(dict.fromkeys(burn.craft for burn in self.burns))

    @property
    def craft_named(self) -> dict[str, tuple[str, ...]]:
        return {f"burns[{k}].craft": (burn.craft,) for k, burn in enumerate(self.burns, 1)}


class Clearing(Thrusting):
    """Stage whose paths avoid zones: the keep-out margin, and the end of a proof of the lower bound."""

    margin: Margin | None = setting(
        '"0.5 m"',
        'distance added to every zone, or "auto" for the tracking error that feedback and navigation leave',
    )
    prove: Proof | None = setting(
        '"10 s, 1 %"',
        "time (60 s by default) and optimality gap (0.1 %) at which the proof of a "
        "lower bound ends; no proof by default",
    )

    @property
    def is_exact(self) -> bool:
        """True if the planning method supports uncertainty and drift."""
        return True

    @property
    def proving(self) -> Proving:
        """End of the proof of a plan; at once without `prove`."""
        return self.prove or Proving(seconds=0.0)


class Fellow(Table):
    """Craft with its own transfer during another craft's move; it does not avoid others."""

    craft: Name = setting('"F5"', "spacecraft that moves", ...)
    to: Destination = setting('{ position = "0 100 0 m", velocity = "0 0 0 m/s" }', "destination", ...)


class Avoid(Clearing):
    """Move of one craft among the others, around their zones, at minimum cost."""

    craft: Name = setting('"F3"', "spacecraft that moves", ...)
    to: Destination | None = setting(
        '{ position = "0 100 0 m", velocity = "0 0 0 m/s" }',
        "destination; by default the end of its coast",
    )
    method: Literal["exact", "sauter-palmer"] = setting(
        '"exact"', 'planning method; "sauter-palmer" in an orbit and for minimum energy', "exact"
    )
    meanwhile: Annotated[tuple[Fellow, ...], Field(strict=False)] = setting(
        '[{ craft = "F5", to = { position = "0 100 0 m", velocity = "0 0 0 m/s" } }]',
        "other spacecraft that make their own transfer and do not avoid",
        (),
    )
    longer: bool = setting("false", "false if the stage may not take longer than `within`", True)
    corridor: Corridor | None = setting(
        '{ axis = [0, -1, 0], half_angle = "10 deg", radius = "0.5 m" }', "approach corridor"
    )
    speed_limit: ApproachSpeed | None = setting('{ limit = "0.2 m/s" }', "maximum speed")
    waypoints: Annotated[tuple[Waypoint, ...], Field(strict=False)] = setting(
        '[{ at = "15 min", position = "10 -100 0 m", tolerance = "5 m" }]', "places to pass", ()
    )
    no_thrust: Annotated[tuple[QuietTime, ...], Field(strict=False)] = setting(
        '[{ after = "10 min", until = "25 min" }]', "times without thrust", ()
    )
    plume: Exhaust | None = setting(
        '{ half_angle = "20 deg", range = "50 m" }', "exhaust that must not hit the other spacecraft"
    )
    thrust_exclusion: Annotated[tuple[Exclusion, ...], Field(strict=False)] = setting(
        '[{ direction = [-1, 0, 0], half_angle = "30 deg" }]', "directions without thrust", ()
    )

    @property
    def path_requirements(self) -> tuple[str, ...]:
        """Keys of the requirements on the path, beyond zones."""
        keys = "corridor", "speed_limit", "waypoints", "no_thrust", "plume", "thrust_exclusion"
        return tuple(key for key in keys if getattr(self, key))

    @property
    def is_exact(self) -> bool:
        return self.method == "exact"

    def flaws(self) -> Iterator[str]:
        yield from super().flaws()
        if self.cost == "delta-v" and self.method != "exact":
            yield f'method = "{self.method}" cannot be combined with cost = "{self.cost}"; remove one of them'
        if self.cost == "energy" and self.path_requirements:
            # at minimum energy a craft thrusts all the time, and only its states can be restricted
            on_states = "corridor", "speed_limit", "waypoints"
            needing = [key for key in self.path_requirements if key not in on_states]
            if needing:
                yield f'{needing[0]} needs cost = "delta-v"; add it'
            if not self.is_exact:
                first = self.path_requirements[0]
                yield f'method = "{self.method}" cannot be combined with {first}; remove one of them'
        names = self.moving(())
        for name in names:
            if names.count(name) > 1:
                yield f"{name} moves twice in one stage; name each craft once"

    def moving(self, names: Names) -> Names:
        return self.craft, *(fellow.craft for fellow in self.meanwhile)

    @property
    def craft_named(self) -> dict[str, tuple[str, ...]]:
        fellows = {f"meanwhile[{k}].craft": (fellow.craft,) for k, fellow in enumerate(self.meanwhile, 1)}
        return {"craft": (self.craft,), **fellows}

    @property
    def targets(self) -> dict[str, Target | Goal]:
        own: dict[str, Target | Goal] = {"to": self.to} if self.to is not None else {}
        return own | {f"meanwhile[{k}].to": fellow.to for k, fellow in enumerate(self.meanwhile, 1)}


class Transfer(Thrusting):
    """Move of one craft without regard to others, at minimum cost, within its thrust limit."""

    keeps_out = False
    craft: Name | None = setting('"F1"', "spacecraft that moves; by default the only one")
    to: Destination = setting('{ position = "0 100 0 m", velocity = "0 0 0 m/s" }', "destination", ...)

    def moving(self, names: Names) -> Names:
        return (self.craft or names[0],)

    @property
    def craft_named(self) -> dict[str, tuple[str, ...]]:
        return {"craft": (self.craft,)} if self.craft is not None else {}

    @property
    def targets(self) -> dict[str, Target | Goal]:
        return {"to": self.to}


class Joint(Clearing):
    """Stage in which the whole formation moves."""

    plan: Literal["joint", "sequential", "distributed"] = setting(
        '"joint"',
        "planning of all spacecraft together, or for minimum energy one after another, or by each on its own",
        "joint",
    )
    order: Names | None = setting(
        '["F3", "F1"]',
        "planning order or right of way, by default that of `name`",
        only_if={"plan": ("sequential", "distributed")},
    )
    if_blocked: Fallbacks = setting(
        FALLBACK_EXAMPLE,
        "what to try, in this order, if no clear plan is found; [] for nothing",
        ALL_FALLBACKS,
    )

    @property
    def is_exact(self) -> bool:
        return self.plan == "joint"

    def flaws(self) -> Iterator[str]:
        yield from super().flaws()
        if self.cost == "delta-v" and self.plan != "joint":
            yield f'plan = "{self.plan}" cannot be combined with cost = "{self.cost}"; remove one of them'

    def moving(self, names: Names) -> Names:
        return names

    @property
    def craft_named(self) -> dict[str, tuple[str, ...]]:
        return {"order": self.order} if self.order is not None else {}


class Scatter(Joint):
    """Move of all craft away from each other."""

    alternatives = (("factor", "point"),)
    factor: Annotated[float, Field(gt=1, le=1e6)] | None = setting(
        "3.0", "smallest growth of every distance, above 1"
    )
    point: Position | None = setting(
        '"0 0 0 m"',
        "point to move away from, instead of `factor`",
        alias="from",
        needs="distance",
    )
    distance: Length | None = setting('"1 km"', "distance from that point", only_with="point")

    @property
    def away(self) -> tuple[Vector, float]:
        """Point to scatter from [m] and distance [m], if there is no factor."""
        if self.point is None or self.distance is None:
            raise TypeError("scatters by a factor")
        return self.point, self.distance


class Regather(Joint):
    """Return of all craft to their relative orbits at the start of an earlier stage."""

    as_before: Name = setting('"threat"', "earlier stage whose initial relative orbits are the target", ...)


def one_or_each(value: Any) -> str:
    """Return how `to` is given: as one goal for all craft, or as a list with one target for each."""
    return tag("Target" if isinstance(value, list | tuple) else "Goal")


Goals = Annotated[
    Annotated[Goal, Tag(tag("Goal"))]
    | Annotated[tuple[Target, ...], Field(strict=False, min_length=1), Tag(tag("Target"))],
    Discriminator(one_or_each),
]


class Reconfigure(Joint):
    """Move of all or of named craft to new relative orbits."""

    craft: Names | None = setting('["F9"]', "spacecraft that move, by default all; the others coast")
    to: Goals = setting(
        '{ projected_circular = { radius = "300 m" } }',
        "formation, or a list with one state for each spacecraft",
        ...,
    )
    assign: bool = setting(
        "true", "true to assign the places at minimum total energy; the list may then be longer", False
    )
    slots: Annotated[int, Field(ge=1, le=10_000)] | None = setting(
        "10", "number of places of a formation, by default one each; with `assign`"
    )

    def flaws(self) -> Iterator[str]:
        yield from super().flaws()
        for name in self.craft or ():
            if (self.craft or ()).count(name) > 1:
                yield f"{name} moves twice in one stage; name each craft once"
        if self.slots is not None and not (self.assign and isinstance(self.to, Goal) and self.to.shape):
            yield "slots requires assign = true and a named formation; remove slots"
        if isinstance(self.to, Goal) and self.to.join is not None and len(self.craft or ()) != 1:
            yield 'join is for one craft; name it, for example craft = ["F9"]'

    def moving(self, names: Names) -> Names:
        return self.craft or names

    @property
    def assigns(self) -> bool:
        return self.assign

    def known(self, orbit: Orbit, count: int, latitude: float | None = None) -> Floats | None:
        """Return the slots (S, 6), or None if they depend on earlier stages.

        Relative elements require the argument of `latitude` [rad] of the origin at arrival. A line is centred
        on the origin.
        """
        if isinstance(self.to, tuple):
            if latitude is None and any(target.roe is not None for target in self.to):
                return None
            return np.array([target.state(orbit, latitude or 0.0) for target in self.to])
        return self.to.shape.states(orbit, self.slots or count) if self.to.shape is not None else None

    def centred(self, slots: Floats, coasted: Floats) -> Floats:
        """Return known slots (S, 6) in place: a line is centred on the mean of `coasted` states (N, 6)."""
        line = isinstance(self.to, Goal) and self.to.line is not None
        return np.asarray(slots + coasted.mean(axis=0)) if line else slots

    @property
    def craft_named(self) -> dict[str, tuple[str, ...]]:
        named = super().craft_named
        if self.craft is not None:
            named["craft"] = self.craft
        if isinstance(self.to, Goal) and self.to.join is not None:
            named["to.join"] = self.to.join
        return named

    @property
    def targets(self) -> dict[str, Target | Goal]:
        if isinstance(self.to, Goal):
            return {"to": self.to}
        return {f"to[{k}]": target for k, target in enumerate(self.to, 1)}


class Lock(StageTable):
    """First lock of each A-B pair, without burns."""

    keeps_out = False
    searches = True


class Gather(StageTable):
    """Search for lost craft, which lock and join until one formation holds them all."""

    keeps_out = False
    searches = True
    rounds: Annotated[int, Field(ge=1)] = setting("3", "maximum number of searches, at most 1000", 2)
    burns: Literal["least", "first", "second", "half"] = setting(
        '"least"',
        'spacecraft of the first pair that burns; "least" leaves the fewest lost, '
        "then takes the minimum delta-v",
        "least",
    )
    again: bool = setting("false", "true after a fault by which known spacecraft were lost", False)
    step: Annotated[float, Reader(TIME, least="0.01 s")] | None = setting(
        '"1 s"', "detect locks only at multiples of this time, at least 0.01 s; by default at any time"
    )
    animation: bool = setting("false", "true for a GIF of the motion of up to 200 spacecraft", True)


STAGES: dict[str, type[StageTable]] = {
    kind.__name__.lower(): kind
    for kind in (Coast, Transfer, Avoid, Scatter, Regather, Reconfigure, Lock, Gather)
}


def kind_of(value: Any) -> str | None:
    """Return the tag of the kind of stage that `do` names; None for another value."""
    verb = value.get("do") if isinstance(value, dict) else getattr(value, "verb", None)
    return tag(STAGES[verb].__name__) if isinstance(verb, str) and verb in STAGES else None


if TYPE_CHECKING:
    Stage = StageTable
else:
    Stage = Annotated[
        Union[tuple(Annotated[kind, Tag(tag(kind.__name__))] for kind in STAGES.values())],  # noqa: UP007
        Discriminator(
            kind_of,
            custom_error_type=UNKNOWN_VERB,
            custom_error_message="unknown",
            custom_error_context={"verbs": list(STAGES)},
        ),
    ]
