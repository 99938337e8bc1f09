"""Tables of [[stage]], one model for each verb in `do`."""

from collections.abc import Iterator
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Discriminator, Field, Tag

from closeform.arrays import Floats
from closeform.motion.orbit import Orbit
from closeform.scenario.formation import Destination, Goal, Target
from closeform.scenario.quantity import DURATION, Duration, Proving, Reader
from closeform.scenario.stage_table import Drifting, StageTable, Thrusting
from closeform.scenario.table import (
    ALL,
    EACH,
    Length,
    Margin,
    Name,
    Names,
    Position,
    Proof,
    Span,
    Table,
    Vector,
    Velocity,
)

Fallback = Literal["more sides", "longer", "stagger"]
Fallbacks = Annotated[tuple[Fallback, ...], Field(strict=False)]
ALL_FALLBACKS: tuple[Fallback, ...] = ("more sides", "longer", "stagger")
FALLBACK_EXAMPLE = '["more sides", "longer", "stagger"]'


Instant = Annotated[Duration, BeforeValidator(Reader(DURATION, least="zero"))]


class Burn(Table):
    """Given impulse: a velocity change of one craft, `at` a time after the start of the stage."""

    craft: Name = Field(examples=['"F1"'])
    at: Instant = Field(examples=['"0.5 orbits"'])
    delta_v: Velocity = Field(examples=['"0 0.1 0 m/s"'])


class Coast(Drifting):
    """Natural motion of all craft, with given impulses in `burns` and given paths for `follow`."""

    do: Literal["coast"] = Field(examples=['"coast"'])
    length: Span = Field(alias="for", examples=['"0.5 orbits"'])
    burns: Annotated[tuple[Burn, ...], Field(strict=False)] = Field(
        (), examples=['[{ craft = "F1", at = "10 min", delta_v = "-0.1 0 0 m/s" }]']
    )
    follow: Names = Field((), examples=['["F1"]'])
    animation: bool = Field(False, examples=["true"])

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

    margin: Margin | None = Field(None, examples=['"0.5 m"'])
    prove: Proof | None = Field(None, examples=['"10 s, 1 %"'])

    @property
    def is_exact(self) -> bool:
        """True if the planning method supports uncertainty, drift and lower bounds."""
        return True

    @property
    def proving(self) -> Proving:
        """End of the proof of a plan; at once without `prove`."""
        return self.prove or Proving(seconds=0.0)

    @property
    def unprovable(self) -> str | None:
        """Setting that `prove` cannot be combined with, or None."""
        also = {
            'cost = "delta-v"': self.cost != "energy",
            "a method without a lower bound": not self.is_exact,
            "drift": self.plans_drift,
            "sigmas": self.sigmas is not None,
        }
        return next((what for what, given in also.items() if given), None)

    def flaws(self) -> Iterator[str]:
        yield from super().flaws()
        if self.prove is not None and self.unprovable is not None:
            yield f"prove cannot be combined with {self.unprovable}; remove one of them"


class Fellow(Table):
    """Craft with its own transfer during another craft's move; it does not avoid others."""

    craft: Name = Field(examples=['"F5"'])
    to: Destination = Field(examples=['{ position = "0 100 0 m", velocity = "0 0 0 m/s" }'])


class Avoid(Clearing):
    """Move of one craft among the others, around their zones, at minimum cost."""

    do: Literal["avoid"] = Field(examples=['"avoid"'])
    craft: Name = Field(examples=['"F3"'])
    to: Destination | None = Field(None, examples=['{ position = "0 100 0 m", velocity = "0 0 0 m/s" }'])
    within: Span = Field(examples=['"0.5 orbits"'])
    method: Literal["exact", "sauter-palmer"] = Field("exact", examples=['"exact"'])
    animation: bool = Field(False, examples=["true"])
    meanwhile: Annotated[tuple[Fellow, ...], Field(strict=False)] = Field(
        (), examples=['[{ craft = "F5", to = { position = "0 100 0 m", velocity = "0 0 0 m/s" } }]']
    )
    longer: bool = Field(True, examples=["false"])

    @property
    def is_exact(self) -> bool:
        return self.method == "exact"

    def flaws(self) -> Iterator[str]:
        yield from super().flaws()
        if self.cost == "delta-v" and self.method != "exact":
            yield f'method = "{self.method}" goes with cost = "energy" only; remove one of them'
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
    do: Literal["transfer"] = Field(examples=['"transfer"'])
    craft: Name | None = Field(None, examples=['"F1"'])
    to: Destination = Field(examples=['{ position = "0 100 0 m", velocity = "0 0 0 m/s" }'])
    within: Span = Field(examples=['"0.5 orbits"'])
    animation: bool = Field(False, examples=["true"])

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

    within: Span = Field(examples=['"0.25 orbits"'])
    plan: Literal["joint", "sequential"] = Field("joint", examples=['"joint"'])
    order: Names | None = Field(None, examples=['["F3", "F1"]'])
    if_blocked: Fallbacks = Field(ALL_FALLBACKS, examples=[FALLBACK_EXAMPLE])
    animation: bool = Field(False, examples=["true"])

    @property
    def is_exact(self) -> bool:
        return self.plan == "joint"

    def flaws(self) -> Iterator[str]:
        yield from super().flaws()
        if self.order is not None and self.plan != "sequential":
            yield 'order goes with plan = "sequential" only; remove order'
        if self.cost == "delta-v" and self.plan != "joint":
            yield f'plan = "{self.plan}" goes with cost = "energy" only; remove one of them'

    def moving(self, names: Names) -> Names:
        return names

    @property
    def craft_named(self) -> dict[str, tuple[str, ...]]:
        return {"order": self.order} if self.order is not None else {}


class Scatter(Joint):
    """Move of all craft away from each other."""

    do: Literal["scatter"] = Field(examples=['"scatter"'])
    factor: Annotated[float, Field(gt=1, le=1e6)] | None = Field(None, examples=["3.0"])
    point: Position | None = Field(None, alias="from", examples=['"0 0 0 m"'])
    distance: Length | None = Field(None, examples=['"1 km"'])

    def flaws(self) -> Iterator[str]:
        yield from super().flaws()
        yield from self.one_of("factor", "point")
        yield from self.only_with("distance", "point")
        if self.point is not None and self.distance is None:
            yield 'from needs distance; add for example distance = "1 km"'

    @property
    def away(self) -> tuple[Vector, float]:
        """Point to scatter from [m] and distance [m], if there is no factor."""
        if self.point is None or self.distance is None:
            raise TypeError("scatters by a factor")
        return self.point, self.distance


class Regather(Joint):
    """Return of all craft to their relative orbits at the start of an earlier stage."""

    do: Literal["regather"] = Field(examples=['"regather"'])
    as_before: Name = Field(examples=['"threat"'])


def one_or_each(value: Any) -> str:
    """Return the form of `to`: one goal for all craft or a list with one target each."""
    return EACH if isinstance(value, list | tuple) else ALL


Goals = Annotated[
    Annotated[Goal, Tag(ALL)] | Annotated[tuple[Target, ...], Field(strict=False, min_length=1), Tag(EACH)],
    Discriminator(one_or_each),
]


class Reconfigure(Joint):
    """Move of all or of named craft to new relative orbits."""

    do: Literal["reconfigure"] = Field(examples=['"reconfigure"'])
    craft: Names | None = Field(None, examples=['["F9"]'])
    to: Goals = Field(examples=['{ projected_circular = { radius = "300 m" } }'])
    assign: bool = Field(False, examples=["true"])
    slots: Annotated[int, Field(ge=1, le=10_000)] | None = Field(None, examples=["10"])

    def flaws(self) -> Iterator[str]:
        yield from super().flaws()
        for name in self.craft or ():
            if (self.craft or ()).count(name) > 1:
                yield f"{name} moves twice in one stage; name each craft once"
        if self.slots is not None and not (self.assign and isinstance(self.to, Goal) and self.to.shape):
            yield "slots goes with assign = true and a named formation only; remove slots"
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
    do: Literal["lock"] = Field(examples=['"lock"'])


class Gather(StageTable):
    """Search for lost craft, which lock and join until one formation holds them all."""

    keeps_out = False
    searches = True
    do: Literal["gather"] = Field(examples=['"gather"'])
    rounds: Annotated[int, Field(ge=1)] = Field(2, examples=["3"])
    burns: Literal["least", "first", "second", "half"] = Field("least", examples=['"least"'])
    animation: bool = Field(True, examples=["false"])


class Unknown(StageTable):
    """Stage with an invalid `do`; it keeps its place while other errors are collected."""

    keeps_out = False


STAGES: dict[str, type[StageTable]] = {
    "coast": Coast,
    "transfer": Transfer,
    "avoid": Avoid,
    "scatter": Scatter,
    "regather": Regather,
    "reconfigure": Reconfigure,
    "lock": Lock,
    "gather": Gather,
}
