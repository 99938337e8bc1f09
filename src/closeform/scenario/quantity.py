"""Reader of quantities with units, such as "500 km", as numbers in SI units and radians.

Units combine with `/` and powers: "7.5 km/s", "398600.4415 km^3/s^2", "0.25 deg/s". A vector is several
numbers and one unit: "20 40 20 m". Two words are a product: "5 mN s". Every error message is one line: the
mistake; the remedy.
"""

import json
import math
import re
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

from pydantic import GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

Dimension = tuple[int, int, int, int]  # powers of metre, second, kilogram, radian

NONE: Dimension = (0, 0, 0, 0)
UNITS: dict[str, tuple[float, Dimension]] = {
    **{unit: (scale, (1, 0, 0, 0)) for unit, scale in (("mm", 1e-3), ("cm", 1e-2), ("m", 1.0), ("km", 1e3))},
    **{
        unit: (scale, (0, 1, 0, 0))
        for unit, scale in (("ms", 1e-3), ("s", 1.0), ("min", 60.0), ("h", 3600.0), ("d", 86400.0))
    },
    **{unit: (scale, (0, 0, 1, 0)) for unit, scale in (("g", 1e-3), ("kg", 1.0), ("t", 1e3))},
    **{unit: (scale, (1, -2, 1, 0)) for unit, scale in (("uN", 1e-6), ("mN", 1e-3), ("N", 1.0), ("kN", 1e3))},
    **dict.fromkeys(("\u00b5N", "\u03bcN"), (1e-6, (1, -2, 1, 0))),  # the micro sign and the Greek letter
    **{
        unit: (scale, (0, 0, 0, 1))
        for unit, scale in (
            ("rad", 1.0),
            ("mrad", 1e-3),
            ("deg", math.pi / 180),
            ("arcmin", math.pi / 10_800),
            ("arcsec", math.pi / 648_000),
            ("turn", 2 * math.pi),
            ("turns", 2 * math.pi),
        )
    },
    "%": (0.01, NONE),
    "ppm": (1e-6, NONE),
}
ORBITS = ("orbit", "orbits")
SMALLEST, LARGEST = 1e-30, 1e30  # so that no square or cube leaves the range of a double


@dataclass(frozen=True)
class Kind:
    """Physical quantity: its name in messages, its dimension, the units to offer and a typical number."""

    name: str
    dimension: Dimension
    units: tuple[str, ...]
    common: str = "10"


LENGTH = Kind("length", (1, 0, 0, 0), ("m", "km", "cm", "mm"))
AREA = Kind("squared length", (2, 0, 0, 0), ("m^2", "km^2"))
SPEED = Kind("speed", (1, -1, 0, 0), ("m/s", "cm/s", "mm/s", "km/s"))
TIME = Kind("time", (0, 1, 0, 0), ("s", "min", "h", "d", "ms"))
DURATION = Kind("time", (0, 1, 0, 0), ("s", "min", "h", "d", "ms", "orbits"))
ANGLE = Kind("angle", (0, 0, 0, 1), ("deg", "rad", "turn", "arcmin", "arcsec", "mrad"))
RATE = Kind("angular rate", (0, -1, 0, 1), ("deg/s", "rad/s"), "0.25")
TURNING = Kind("angular acceleration", (0, -2, 0, 1), ("deg/s^2", "rad/s^2"), "0.01")
MASS = Kind("mass", (0, 0, 1, 0), ("kg", "g", "t"))
FORCE = Kind("force", (1, -2, 1, 0), ("N", "mN", "uN", "kN"))
ACCELERATION = Kind("acceleration", (1, -2, 0, 0), ("mm/s^2", "m/s^2", "cm/s^2"))
IMPULSE = Kind("impulse", (1, -1, 1, 0), ("mN s", "N s", "uN s"))
GRAVITY = Kind("gravitational parameter", (3, -2, 0, 0), ("km^3/s^2", "m^3/s^2"))
NOISE = Kind("acceleration noise", (2, -3, 0, 0), ("m^2/s^3", "mm^2/s^3"), "1e-9")
SHARE = Kind("share", NONE, ("%", "ppm"))
DENSITY = Kind("density", (-3, 0, 1, 0), ("kg/m^3", "kg/km^3"), "5.2e-13")
BALLISTIC = Kind("ballistic coefficient", (2, 0, -1, 0), ("m^2/kg",), "0.02")
KINDS = (
    LENGTH,
    AREA,
    SPEED,
    TIME,
    ANGLE,
    RATE,
    TURNING,
    MASS,
    FORCE,
    ACCELERATION,
    IMPULSE,
    GRAVITY,
    NOISE,
    SHARE,
    DENSITY,
    BALLISTIC,
)


@dataclass(frozen=True)
class Duration:
    """A time of `seconds` plus `orbits` periods of the scenario's orbit."""

    seconds: float = 0.0
    orbits: float = 0.0

    def on(self, period: float) -> float:
        """Return the time [s] on an orbit of a `period` [s], finite if orbits are counted."""
        return self.seconds + (self.orbits * period if self.orbits else 0.0)

    def __str__(self) -> str:
        return f"{self.orbits:g} orbit{'s' * (self.orbits != 1.0)}" if self.orbits else span(self.seconds)


@dataclass(frozen=True)
class Proving:
    """End of the proof of a plan: a time [s], or an optimality gap at most, whichever is first."""

    seconds: float = 60.0
    gap: float = 1e-3


class KeyReader(ABC):
    """Reader of the value of a key whose annotation names it."""

    @abstractmethod
    def __call__(self, value: Any) -> Any:
        """Return the value in SI units; raise ValueError for an invalid one."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Return the schema of a key whose annotation names this reader."""
        return core_schema.no_info_before_validator_function(self, handler(source))


@dataclass(frozen=True)
class Reader(KeyReader):
    """Reader of `size` numbers of one `kind` with one unit; `size` 0 accepts any number of them.

    `least` is "positive", "zero" (not negative), "any", or a smallest quantity such as "0.01 s"; all numbers
    are `below` a quantity, unless it is empty. The reader returns a float for size 1, a Duration for the
    kind DURATION and otherwise a tuple of floats. `of_none`, if not empty, is the remedy for a zero.
    """

    kind: Kind
    size: int = 1
    least: str = "any"
    of_none: str = ""
    below: str = ""

    def __call__(self, value: Any) -> float | tuple[float, ...] | Duration:
        if self.kind is DURATION:
            return self.duration(value)
        found = self.numbers(value)
        return found[0] if self.size == 1 else found

    def numbers(self, value: Any) -> tuple[float, ...]:
        """Return all numbers in SI units as a tuple, also for size 1."""
        numbers, unit = self.split(value)
        return tuple(self.checked(value, [number * self.scale(value, unit) for number in numbers]))

    def duration(self, value: Any) -> Duration:
        """Return a time given in units of time or in orbits."""
        numbers, unit = self.split(value)
        if unit in ORBITS:
            return Duration(orbits=self.checked(value, numbers)[0])
        return Duration(seconds=self.numbers(value)[0])

    @property
    def example(self) -> str:
        """Example of a quantity of this kind, in quotes."""
        numbers = [self.kind.common, "20", "30", "40", "50", "60"][: self.size or 2]
        return f'"{" ".join([*numbers, self.kind.units[0]])}"'

    @property
    def offered(self) -> str:
        """Units to offer in messages."""
        return ", ".join(self.kind.units)

    def split(self, value: Any) -> tuple[list[float], str]:
        """Return the numbers and the unit of a text."""
        if not isinstance(value, str):
            raise ValueError(f"{shown(value)} has no unit; use {self.offered}, for example {self.example}")
        words = value.split()
        numbers = []
        while words and (number := as_number(words[0])) is not None:
            numbers.append(number)
            words.pop(0)
        if len(words) > 1 and all(unit_of(word)[0] for word in words):
            words = [" ".join(words)]
        wanted = "one number" if self.size == 1 else f"{self.size} numbers" if self.size else "some numbers"
        if len(numbers) != (self.size or max(1, len(numbers))) or len(words) > 1:
            raise ValueError(f"{shown(value)} is not {wanted} and one unit; write for example {self.example}")
        if not words:
            raise ValueError(f"{shown(value)} has no unit; use {self.offered}, for example {self.example}")
        return numbers, words[0]

    def scale(self, value: Any, unit: str) -> float:
        """Return the size of one `unit` in SI; raise ValueError for a unit of another kind."""
        scale, dimension = unit_of(unit)
        if scale == 0.0:
            raise ValueError(
                f"{shown(value)} has the unknown unit {shown(unit)}; {named(self.kind)} takes {self.offered}"
            )
        if dimension != self.kind.dimension:
            other = next((named(kind) for kind in KINDS if kind.dimension == dimension), "something else")
            raise ValueError(f"{shown(value)} is {other}, not {named(self.kind)}; use {self.offered}")
        return scale

    def checked(self, value: Any, numbers: list[float]) -> list[float]:
        """Return the numbers if all are finite, in range and of the required sign; else raise ValueError."""
        if not all(math.isfinite(number) for number in numbers):
            raise ValueError(f"{shown(value)} is not finite; give finite numbers, for example {self.example}")
        if any(number and not SMALLEST <= abs(number) <= LARGEST for number in numbers):
            raise ValueError(
                f"{shown(value)} is out of range; give {SMALLEST:g} to {LARGEST:g} in SI units, or 0"
            )
        if self.least == "positive" and min(numbers) <= 0.0:
            remedy = (
                self.of_none if self.of_none and not any(numbers) else f"write for example {self.example}"
            )
            raise ValueError(f"{shown(value)} must be above zero; {remedy}")
        if self.least == "zero" and min(numbers) < 0.0:
            raise ValueError(f"{shown(value)} is negative; give zero or more, for example {self.example}")
        if self.least not in ("any", "positive", "zero") and min(numbers) < self.limit(self.least):
            raise ValueError(f"{shown(value)} is below {self.least}; write for example {self.example}")
        if self.below and max(numbers) >= self.limit(self.below):
            raise ValueError(f"{shown(value)} must be below {self.below}; write for example {self.example}")
        return numbers

    def limit(self, text: str) -> float:
        """Return one quantity of this kind in SI units."""
        return Reader(self.kind).numbers(text)[0]


@dataclass(frozen=True)
class Parts(KeyReader):
    """Reader of quantities separated by commas, each with its unit; `what` describes them in messages."""

    readers: tuple[Reader, ...]
    what: str
    example: str

    def __call__(self, value: Any) -> tuple[float, ...]:
        parts = value.split(",") if isinstance(value, str) else []
        if len(parts) != len(self.readers):
            raise ValueError(f"{shown(value)} is not {self.what}; write for example {self.example}")
        return tuple(
            one for read, part in zip(self.readers, parts, strict=True) for one in read.numbers(part.strip())
        )


@dataclass(frozen=True)
class Either(KeyReader):
    """Reader of a `word` that represents a value, or else of a quantity."""

    word: str
    value: Any
    reader: Reader

    def __call__(self, value: Any) -> Any:
        if value == self.word:
            return self.value
        try:
            return self.reader(value)
        except ValueError as error:
            raise ValueError(f"{error}, or {shown(self.word)}") from None


def span(seconds: float) -> str:
    """Return a time [s] as text, in hours or minutes if it is at least two of these."""
    for unit, name in ((3600.0, "h"), (60.0, "min")):
        if seconds >= 2.0 * unit:
            return f"{seconds / unit:.4g} {name}"
    return f"{seconds:.4g} s"


def named(kind: Kind) -> str:
    """Return the name of a kind with its article."""
    return f"{'an' if kind.name[0] in 'aeio' else 'a'} {kind.name}"


def as_number(word: str) -> float | None:
    """Return the number that a word represents, or None."""
    try:
        return float(word)
    except ValueError:
        return None


def unit_of(text: str) -> tuple[float, Dimension]:
    """Return the scale and the dimension of a unit like "km^3/s^2"; scale 0 for an unknown unit."""
    scale, powers = 1.0, [0, 0, 0, 0]
    first, *words = text.split(" ")
    if words:  # a product
        (one, of_one), (other, of_other) = unit_of(first), unit_of(" ".join(words))
        a, b, c, d = (x + y for x, y in zip(of_one, of_other, strict=True))
        return one * other, (a, b, c, d)
    for place, factor in enumerate(text.split("/")):
        match = re.fullmatch(r"([^\W\d_]+|%)(?:\^([1-9]))?", factor)
        if match is None or match[1] not in UNITS:
            return 0.0, NONE
        power = int(match[2] or 1) * (1 if place == 0 else -1)
        unit, dimension = UNITS[match[1]]
        scale *= unit**power
        powers = [total + power * one for total, one in zip(powers, dimension, strict=True)]
    return scale, (powers[0], powers[1], powers[2], powers[3])


def shown(value: Any) -> str:
    """Return a value of the file as text on one line, short enough for a message."""
    text = json.dumps(value, default=str, ensure_ascii=True)
    return text if len(text) <= 48 else text[:44] + '..."'
