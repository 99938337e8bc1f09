"""What happens, in order: the tables of [[stage]], one model for each verb in `do`."""

from collections.abc import Iterator
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Discriminator, Field, Tag

from closeform.arrays import Floats
from closeform.motion.orbit import Orbit
from closeform.scenario.formation import Destination, Goal, Target
from closeform.scenario.quantity import DURATION, Duration, Reader
from closeform.scenario.stage_table import Drifting, StageTable, Thrusting
from closeform.scenario.table import (
    ALL,
    EACH,
    Length,
    Margin,
    Name,
    Names,
    Position,
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
    """An impulse that is given: a velocity jump of one craft, `at` a time after the start of the stage."""

    craft: Name = Field(examples=['"F1"'])
    at: Instant = Field(examples=['"0.5 orbits"'])
    delta_v: Velocity = Field(examples=['"0 0.1 0 m/s"'])


class Coast(Drifting):
    """Natural motion of all craft, with given impulses in `burns` and given paths of those that `follow`."""

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
    """What the stages share whose paths go around zones: room beyond these, how long a bound is raised."""

    margin: Margin | None = Field(None, examples=['"0.5 m"'])
    prove: Span | None = Field(None, examples=['"10 s"'])

    @property
    def is_exact(self) -> bool:
        """Whether its plan is of the method that knows errors, drift and bounds."""
        raise NotImplementedError

    @property
    def proving(self) -> float:
        """For how long the lower bound of a plan is raised [s]."""
        return 0.0 if self.prove is None else self.prove.seconds

    @property
    def unprovable(self) -> str | None:
        """What `prove` does not go with; None where it may be asked for."""
        also = {
            'cost = "delta-v"': self.cost != "energy",
            "a method that knows no bound": not self.is_exact,
            "drift": self.plans_drift,
            "sigmas": self.sigmas is not None,
        }
        return next((what for what, given in also.items() if given), None)

    def flaws(self) -> Iterator[str]:
        yield from super().flaws()
        if self.prove is not None and self.prove.orbits:
            yield 'prove is a time; write for example prove = "10 s"'
        if self.prove is not None and self.unprovable is not None:
            yield f"prove goes without {self.unprovable}; remove one of them"


class Fellow(Table):
    """A craft that flies its own transfer during somebody's move and does not give way."""

    craft: Name = Field(examples=['"F5"'])
    to: Destination = Field(examples=['{ position = "0 100 0 m", velocity = "0 0 0 m/s" }'])


class Avoid(Clearing):
    """One craft moves among the others, around their zones, at the least cost."""

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
    """One craft moves without regard to others, at the least cost, within its thrust in the given time."""

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
    """What the stages share in which the whole formation moves."""

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
    """All craft spread out."""

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
        """The point to scatter from and how far, where there is no factor."""
        if self.point is None or self.distance is None:
            raise TypeError("scatters by a factor")
        return self.point, self.distance


class Regather(Joint):
    """All craft return to the relative orbits that they had at the start of an earlier stage."""

    do: Literal["regather"] = Field(examples=['"regather"'])
    as_before: Name = Field(examples=['"threat"'])


def one_or_each(value: Any) -> str:
    """Whether `to` is for all or has one for each."""
    return EACH if isinstance(value, list | tuple) else ALL


Goals = Annotated[
    Annotated[Goal, Tag(ALL)] | Annotated[tuple[Target, ...], Field(strict=False, min_length=1), Tag(EACH)],
    Discriminator(one_or_each),
]


class Reconfigure(Joint):
    """Craft move to new relative orbits: all, or those that are named."""

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
        """The slots (S, 6) as far as they do not depend on the flight so far; else None.

        What relative elements are as a state does, by the `latitude` [rad] of the origin at arrival.  A
        line is centred on the origin here.
        """
        if isinstance(self.to, tuple):
            if latitude is None and any(target.roe is not None for target in self.to):
                return None
            return np.array([target.state(orbit, latitude or 0.0) for target in self.to])
        return self.to.shape.states(orbit, self.slots or count) if self.to.shape is not None else None

    def centred(self, slots: Floats, coasted: Floats) -> Floats:
        """Known slots (S, 6) where they are: a line goes with the craft that form it and `coasted` (N, 6)."""
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
    """The first lock of each A-B pair; nothing burns."""

    keeps_out = False
    searches = True
    do: Literal["lock"] = Field(examples=['"lock"'])


class Gather(StageTable):
    """Lost craft search, lock and join until one formation holds them all."""

    keeps_out = False
    searches = True
    do: Literal["gather"] = Field(examples=['"gather"'])
    rounds: Annotated[int, Field(ge=1)] = Field(2, examples=["3"])
    burns: Literal["least", "first", "second", "half"] = Field("least", examples=['"least"'])
    animation: bool = Field(True, examples=["false"])


class Unknown(StageTable):
    """A stage whose `do` is wrong, which keeps its place while other errors are looked for."""

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
