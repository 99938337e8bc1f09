"""What happens, in order: the tables of [[stage]], one model for each verb in `do`."""

from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, model_validator

from closeform.scenario.craft import Target
from closeform.scenario.table import Name, Span, Table

Fallback = Literal["more sides", "longer", "stagger"]
Fallbacks = Annotated[tuple[Fallback, ...], Field(strict=False)]
Names = Annotated[tuple[Name, ...], Field(strict=False)]
ALL_FALLBACKS: tuple[Fallback, ...] = ("more sides", "longer", "stagger")
FALLBACK_EXAMPLE = '["more sides", "longer", "stagger"]'


class StageTable(Table):
    """What every stage has."""

    built: ClassVar[bool] = False  # whether this version can run it
    keeps_out: ClassVar[bool] = True  # whether it needs [craft] keep_out
    searches: ClassVar[bool] = False  # whether it needs [sensor], [search] and craft groups

    name: Name | None = Field(None, examples=['"threat"'])

    @property
    def verb(self) -> str:
        """What stands in `do`."""
        return type(self).__name__.lower()

    @property
    def durations(self) -> dict[str, Span]:
        """The stage's durations by key."""
        return {key: value for key in ("length", "within") if (value := getattr(self, key, None)) is not None}

    @property
    def craft_named(self) -> dict[str, tuple[str, ...]]:
        """The craft that the stage names, by key."""
        return {}

    @property
    def targets(self) -> dict[str, Target]:
        """The states that craft move to, by key."""
        return {}


class Coast(StageTable):
    """Nobody burns."""

    built = True
    do: Literal["coast"] = Field(examples=['"coast"'])
    length: Span = Field(alias="for", examples=['"0.5 orbits"'])


class Fellow(Table):
    """A craft that flies its own transfer during somebody's move and does not give way."""

    craft: Name = Field(examples=['"F5"'])
    to: Target = Field(examples=['{ position = "0 100 0 m", velocity = "0 0 0 m/s" }'])


class Avoid(StageTable):
    """One craft moves among the others, around their zones, at least energy."""

    built = True
    do: Literal["avoid"] = Field(examples=['"avoid"'])
    craft: Name = Field(examples=['"F3"'])
    to: Target | None = Field(None, examples=['{ position = "0 100 0 m", velocity = "0 0 0 m/s" }'])
    within: Span = Field(examples=['"0.5 orbits"'])
    method: Literal["exact", "sauter-palmer"] = Field("exact", examples=['"exact"'])
    meanwhile: Annotated[tuple[Fellow, ...], Field(strict=False)] = Field(
        (), examples=['[{ craft = "F5", to = { position = "0 100 0 m", velocity = "0 0 0 m/s" } }]']
    )

    @model_validator(mode="after")
    def different(self) -> Self:
        names = [self.craft, *(fellow.craft for fellow in self.meanwhile)]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"{name} moves twice in one stage; name each craft once")
        return self

    @property
    def craft_named(self) -> dict[str, tuple[str, ...]]:
        fellows = {f"meanwhile[{k}].craft": (fellow.craft,) for k, fellow in enumerate(self.meanwhile, 1)}
        return {"craft": (self.craft,), **fellows}

    @property
    def targets(self) -> dict[str, Target]:
        own = {"to": self.to} if self.to is not None else {}
        return own | {f"meanwhile[{k}].to": fellow.to for k, fellow in enumerate(self.meanwhile, 1)}


class Joint(StageTable):
    """What the stages share in which the whole formation moves."""

    within: Span = Field(examples=['"0.25 orbits"'])
    plan: Literal["joint", "sequential"] = Field("joint", examples=['"joint"'])
    order: Names | None = Field(None, examples=['["F3", "F1"]'])
    if_blocked: Fallbacks = Field(ALL_FALLBACKS, examples=[FALLBACK_EXAMPLE])

    @model_validator(mode="after")
    def ordered(self) -> Self:
        if self.order is not None and self.plan != "sequential":
            raise ValueError('order goes with plan = "sequential" only; remove order')
        return self

    @property
    def craft_named(self) -> dict[str, tuple[str, ...]]:
        return {"order": self.order} if self.order is not None else {}


class Scatter(Joint):
    """All craft spread out."""

    do: Literal["scatter"] = Field(examples=['"scatter"'])
    factor: Annotated[float, Field(gt=1)] = Field(examples=["3.0"])


class Regather(Joint):
    """All craft return to the relative orbits that they had at the start of an earlier stage."""

    do: Literal["regather"] = Field(examples=['"regather"'])
    as_before: Name = Field(examples=['"threat"'])


class Reconfigure(Joint):
    """All craft move to new relative orbits."""

    do: Literal["reconfigure"] = Field(examples=['"reconfigure"'])
    to: Target = Field(examples=['{ projected_circular = { radius = "300 m" } }'])
    assign: bool = Field(False, examples=["true"])

    @property
    def targets(self) -> dict[str, Target]:
        return {"to": self.to}


class Lock(StageTable):
    """The first lock of each A-B pair; nothing burns."""

    built = True
    keeps_out = False
    searches = True
    do: Literal["lock"] = Field(examples=['"lock"'])


class Gather(StageTable):
    """Lost craft search, lock and join until one formation holds them all."""

    built = True
    keeps_out = False
    searches = True
    do: Literal["gather"] = Field(examples=['"gather"'])
    rounds: Annotated[int, Field(ge=1)] = Field(2, examples=["3"])
    burns: Literal["least", "first", "second", "half"] = Field("least", examples=['"least"'])


STAGES: dict[str, type[StageTable]] = {
    "coast": Coast,
    "avoid": Avoid,
    "scatter": Scatter,
    "regather": Regather,
    "reconfigure": Reconfigure,
    "lock": Lock,
    "gather": Gather,
}
