"""Keep-out zones of a screening, from command-line options or from a file."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any, Self

from pydantic import ValidationError

from closeform.scenario.craft import KeepOut
from closeform.scenario.load import read, text_of, toml
from closeform.scenario.table import Name, ScenarioError, Table, complaints, did_you_mean, setting
from closeform.zones.combined_zones import OwnZone
from closeform.zones.pair_zones import PairZones

HARD_BODY = "hard-body"


def own_zone(shapes: dict[str, str | None], axis: str | None, sigmas: float | None, body: bool) -> OwnZone:
    """Return the zone of every craft from the texts of options by name (`shapes`), of which one is given.

    Raises ValueError, one line that names the option, for invalid options.
    """
    given: dict[str, Any] = {shape: text for shape, text in shapes.items() if text is not None}
    if len(given) != 1:
        names = ", ".join(f"--{shape}" for shape in (*shapes, "zones"))
        raise ValueError(f'screen: give one of {names}; for example --sphere "20 m"')
    (shape,) = given
    if (shape == "cylinder") != (axis is not None):
        raise ValueError('screen: --cylinder and --axis require each other; for example --axis "0 1 0"')
    if shape == "covariance" and sigmas is None:
        raise ValueError("screen: --covariance needs --sigmas; for example --sigmas 3")
    if body and shape in ("covariance", HARD_BODY):
        what = "the uncertainty of a position, not a body" if shape == "covariance" else "a body already"
        raise ValueError(f"screen: --{shape} is {what}; leave --body out")
    if shape == HARD_BODY:
        given, body = {"sphere": given[shape]}, True
    given |= {"axis": direction(axis)} if axis is not None else {}
    given |= {"sigmas": sigmas} if shape == "covariance" else {}
    given |= {"kind": "body"} if body else {}
    try:
        return KeepOut.model_validate(given).own()
    except ValidationError as error:
        place, text = next(complaints(error, KeepOut))
    raise ValueError(f"--{place[0] if place and shape != HARD_BODY else shape}: {text}")


@dataclass(frozen=True, eq=False)
class AskedZones:
    """Keep-out zones of a screening: one zone for all craft, or those of a file.

    `sigmas`: size of the ephemeris uncertainty to keep clear of; None if it is not requested.
    """

    zone: OwnZone | None
    file: Path | None
    sigmas: float | None

    @classmethod
    def of(
        cls,
        shapes: dict[str, str | None],
        axis: str | None,
        sigmas: float | None,
        body: bool,
        file: Path | None,
    ) -> Self:
        """Return the zones of the options; raise ValueError, one line that names the option."""
        if sigmas is not None and not (isfinite(sigmas) and sigmas > 0.0):
            raise ValueError(f"--sigmas: must be above zero, got {sigmas:g}; write for example --sigmas 3")
        if file is None:
            zone = own_zone(shapes, axis, sigmas, body)
            return cls(zone, None, sigmas if shapes["covariance"] is None else None)
        if body or axis is not None or any(text is not None for text in shapes.values()):
            raise ValueError("screen: --zones gives the zone of each craft; remove the other zone options")
        return cls(None, file, sigmas)

    def of_each(self, names: Sequence[str]) -> list[OwnZone]:
        """Return the own zone of each craft; raise ScenarioError for an invalid file."""
        if self.file is not None:
            return own_zones(self.file, names)
        assert self.zone is not None  # one of the two is given
        return [self.zone] * len(names)

    def of_pairs(self, own: Sequence[OwnZone], names: Sequence[str]) -> PairZones:
        """Return the zone of each pair from the own zones of the craft.

        Raises ValueError, or ScenarioError for a file, with one line for each error.
        """
        if self.file is None:
            return PairZones.of(own)
        try:
            return PairZones.of(own, names)
        except ValueError as error:
            raise ScenarioError(str(self.file), [f"craft.keep_out: {error}"]) from None


class Kept(Table):
    """One craft of a file of zones."""

    name: Name = setting('["F1", "F2"]', "names of the craft", ...)
    keep_out: KeepOut = setting('{ sphere = "20 m" }', "keep-out zone", ...)


class ZonesFile(Table):
    """File of zones."""

    craft: tuple[Kept, ...] = setting('{ name = ["F1", "F2"] }', "spacecraft", ...)


def own_zones(file: Path, names: Sequence[str]) -> list[OwnZone]:
    """Return the own zones of the craft `names` from the [craft] table of a file.

    Raises ScenarioError, with one line for each error.
    """
    kept = read(ZonesFile, toml(text_of(file), str(file)), str(file)).craft
    given, lines = [craft.name for craft in kept], []
    for name in dict.fromkeys(given):
        if given.count(name) > 1:
            lines.append(f"{name} is given {given.count(name)} times; keep one")
        if name not in names:
            lines.append(f"no ephemeris of {name}; {did_you_mean(name, names)}")
    lines += [
        f"{name} is missing, which has an ephemeris; add it"
        for name in dict.fromkeys(names)
        if name not in given
    ]
    if lines:
        raise ScenarioError(str(file), [f"craft.name: {line}" for line in lines])
    found = {craft.name: craft.keep_out.own() for craft in kept}
    return [found[name] for name in names]


def direction(axis: str) -> list[float]:
    """Return three finite numbers, not all zero; raise ValueError for other text."""
    with suppress(ValueError):
        numbers = [float(number) for number in axis.split()]
        if len(numbers) == 3 and all(map(isfinite, numbers)) and any(numbers):
            return numbers
    raise ValueError(f'--axis: "{axis}" is not a direction; write for example "0 1 0"')
