"""Base class and shared types of the tables of a scenario file."""

import tomllib
from collections.abc import Iterator
from math import inf
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo, model_validator

from closeform.scenario.quantity import (
    ANGLE,
    DURATION,
    LENGTH,
    SHARE,
    SPEED,
    TIME,
    Duration,
    Parts,
    Proving,
    Reader,
    as_number,
    shown,
)

FLAWED = {"flawed": True}  # validation context that accepts inconsistent tables
FOREVER = "forever"  # duration of a drift without an end
ALL, EACH = "<all>", "<each>"  # the two forms of a key: one table for all craft, or a list with one per craft


class Table(BaseModel):
    """Frozen table that rejects unknown keys."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", strict=True, allow_inf_nan=False, validate_by_alias=True
    )

    @classmethod
    def examples(cls) -> dict[str, str]:
        """Return every key of the table as written in the file, with an example of its value."""
        return {
            cls.key_of(name): str(field.examples[0]) if field.examples else ""
            for name, field in cls.model_fields.items()
        }

    @classmethod
    def key_of(cls, name: str) -> str:
        """Return the key in the file for a field name."""
        return cls.model_fields[name].alias or name

    @classmethod
    def example(cls, key: str) -> Any:
        """Return an example value for a key; it replaces a wrong value while other errors are collected."""
        return tomllib.loads(f"value = {cls.examples()[key]}")["value"]

    @model_validator(mode="after")
    def fits(self, info: ValidationInfo) -> Self:
        """Raise ValueError for inconsistent keys, unless the context is FLAWED."""
        if info.context != FLAWED and (flaws := dict.fromkeys(self.flaws())):
            raise ValueError("\n".join(flaws))
        return self

    def flaws(self) -> Iterator[str]:
        """Yield one line per inconsistency among the keys, as `what is wrong; remedy`."""
        return iter(())

    def one_of(self, *names: str) -> Iterator[str]:
        """Yield a flaw unless exactly one of the keys is given."""
        keys = {name: self.key_of(name) for name in names}
        given = [key for name, key in keys.items() if getattr(self, name) is not None]
        if len(given) > 1:
            yield f"{' and '.join(given)} exclude each other; keep one"
        if not given:
            first = f"{keys[names[0]]} = {self.examples()[keys[names[0]]]}"
            yield f"needs one of {', '.join(keys.values())}; add for example {first}"

    def only_with(self, key: str, *names: str) -> Iterator[str]:
        """Yield a flaw if `key` is given without any of the keys that it requires."""
        if key in self.model_fields_set and all(getattr(self, name) is None for name in names):
            keys = " or ".join(self.key_of(name) for name in names)
            yield f"{key} goes with {keys} only; remove {key}"


def as_name(value: Any) -> str:
    """Return a valid name: printable, without surrounding space, at most 24 characters."""
    if not isinstance(value, str):
        raise ValueError(f'{shown(value)} is not a name; write for example "F1"')
    if not value.isprintable() or value != value.strip() or not 1 <= len(value) <= 24:
        raise ValueError(
            f"{shown(value)} is not a name; use 1 to 24 printable characters without space around them"
        )
    return value


def as_drift(value: Any) -> Duration:
    """Return the duration of a drift, which may be zero or infinite."""
    if value == FOREVER:
        return Duration(seconds=inf)
    if isinstance(value, str) and as_number(value.partition(" ")[0]) is None:
        raise ValueError(f'{shown(value)} is no time; write for example "24 h" or "{FOREVER}"')
    read = Reader(DURATION, least="zero")(value)
    assert isinstance(read, Duration)
    return read


def as_proving(value: Any) -> Proving:
    """Return the end of a proof from a time, a gap in percent, or both."""
    parts = [part.strip() for part in value.split(",")] if isinstance(value, str) else []
    gaps = [part for part in parts if part.endswith(("%", "ppm"))]
    times = [part for part in parts if part not in gaps]
    if not parts or max(len(gaps), len(times)) > 1 or any("orbit" in part for part in times):
        raise ValueError(f'{shown(value)} is no time or gap; write for example "10 s", "1 %" or "10 s, 1 %"')
    given = {"seconds": Reader(TIME, least="positive").numbers(times[0])[0]} if times else {}
    if gaps:
        given["gap"] = Reader(SHARE, least="positive").numbers(gaps[0])[0]
    return Proving(**given)


def as_margin(value: Any) -> float | Literal["auto"]:
    """Return a length [m], or "auto"."""
    if value == "auto":
        return "auto"
    if isinstance(value, str) and as_number(value.partition(" ")[0]) is None:
        raise ValueError(f'{shown(value)} is no length; write for example "0.5 m" or "auto"')
    return Reader(LENGTH, least="zero").numbers(value)[0]


as_inertial = Parts(
    (Reader(LENGTH, 3), Reader(SPEED, 3)),
    "a position, a comma and a velocity",
    '"6928 0 0 km, 0 -1 7.5 km/s"',
)
Name = Annotated[str, BeforeValidator(as_name)]
Names = Annotated[tuple[Name, ...], Field(strict=False, min_length=1)]
FileName = Annotated[str, Field(min_length=1)]
Vector = tuple[float, float, float]
Six = tuple[float, float, float, float, float, float]
Length = Annotated[float, BeforeValidator(Reader(LENGTH, least="positive"))]
Lengths = Annotated[Vector, BeforeValidator(Reader(LENGTH, 3, "positive"))]
Position = Annotated[Vector, BeforeValidator(Reader(LENGTH, 3))]
Velocity = Annotated[Vector, BeforeValidator(Reader(SPEED, 3))]
Inertial = Annotated[Six, BeforeValidator(as_inertial)]
Angle = Annotated[float, BeforeValidator(Reader(ANGLE))]
Span = Annotated[Duration, BeforeValidator(Reader(DURATION, least="positive"))]
Margin = Annotated[float | Literal["auto"], BeforeValidator(as_margin)]
Drift = Annotated[Duration, BeforeValidator(as_drift)]
Proof = Annotated[Proving, BeforeValidator(as_proving)]
Share = Annotated[float, BeforeValidator(Reader(SHARE, least="zero"))]
