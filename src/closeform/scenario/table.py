"""What every table of a scenario file has in common."""

from typing import Annotated, Any, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict

from closeform.scenario.quantity import ANGLE, DURATION, LENGTH, SPEED, Duration, Reader, shown


class Table(BaseModel):
    """A frozen table; a key that it does not know is an error."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", strict=True, allow_inf_nan=False, validate_by_alias=True
    )

    @classmethod
    def examples(cls) -> dict[str, str]:
        """Every key of the table as the file writes it, with an example of its value."""
        return {
            field.alias or name: str(field.examples[0]) if field.examples else ""
            for name, field in cls.model_fields.items()
        }

    def one_of(self, *names: str) -> Self:
        """Itself, if exactly one of the keys was given."""
        given = [name for name in names if getattr(self, name) is not None]
        if len(given) > 1:
            raise ValueError(f"{' and '.join(given)} exclude each other; keep one")
        if not given:
            first = f"{names[0]} = {self.examples()[names[0]]}"
            raise ValueError(f"needs one of {', '.join(names)}; add for example {first}")
        return self

    def only_with(self, key: str, *names: str) -> None:
        """Refuse `key` unless one of the keys that give it a meaning was given."""
        if key in self.model_fields_set and all(getattr(self, name) is None for name in names):
            raise ValueError(f"{key} goes with {' or '.join(names)} only; remove {key}")


def as_name(value: Any) -> str:
    """A name that fits a table: printable, without space around it, at most 24 characters."""
    if not isinstance(value, str):
        raise ValueError(f'{shown(value)} is not a name; write for example "F1"')
    if not value.isprintable() or value != value.strip() or not 1 <= len(value) <= 24:
        raise ValueError(
            f"{shown(value)} is not a name; use 1 to 24 printable characters without space around them"
        )
    return value


Name = Annotated[str, BeforeValidator(as_name)]
Vector = tuple[float, float, float]
Length = Annotated[float, BeforeValidator(Reader(LENGTH, least="positive"))]
Lengths = Annotated[Vector, BeforeValidator(Reader(LENGTH, 3, "positive"))]
Position = Annotated[Vector, BeforeValidator(Reader(LENGTH, 3))]
Velocity = Annotated[Vector, BeforeValidator(Reader(SPEED, 3))]
Angle = Annotated[float, BeforeValidator(Reader(ANGLE))]
Span = Annotated[Duration, BeforeValidator(Reader(DURATION, least="positive"))]
