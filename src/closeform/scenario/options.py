"""The zone that every craft keeps, as options of a command describe it."""

from contextlib import suppress
from math import isfinite
from typing import Any

from pydantic import ValidationError

from closeform.scenario.errors import complaints
from closeform.scenario.keep_out import KeepOut
from closeform.zones.own_zone import OwnZone


def own_zone(shapes: dict[str, str | None], axis: str | None, sigmas: float | None, body: bool) -> OwnZone:
    """What every craft keeps; `shapes` have the texts of options by name, of which one is given.

    Raises ValueError, one line that names the option, for what does not fit.
    """
    given: dict[str, Any] = {shape: text for shape, text in shapes.items() if text is not None}
    if len(given) != 1:
        names = ", ".join(f"--{shape}" for shape in shapes)
        raise ValueError(f'screen: give one of {names}; for example --sphere "20 m"')
    (shape,) = given
    if (shape == "cylinder") != (axis is not None):
        raise ValueError('screen: --cylinder and --axis go together; for example --axis "0 1 0"')
    if (shape == "covariance") != (sigmas is not None):
        raise ValueError("screen: --covariance and --sigmas go together; for example --sigmas 3")
    if body and shape == "covariance":
        raise ValueError("screen: --covariance is of where a craft is, not of its body; leave --body out")
    given |= {"axis": direction(axis)} if axis is not None else {}
    given |= {"sigmas": sigmas} if sigmas is not None else {}
    given |= {"kind": "body"} if body else {}
    try:
        return KeepOut.model_validate(given).own()
    except ValidationError as error:
        place, text = next(complaints(error, KeepOut))
    raise ValueError(f"--{place[0] if place else shape}: {text}")


def direction(axis: str) -> list[float]:
    """Three numbers that point somewhere."""
    with suppress(ValueError):
        way = [float(number) for number in axis.split()]
        if len(way) == 3 and all(map(isfinite, way)) and any(way):
            return way
    raise ValueError(f'--axis: "{axis}" is not a direction; write for example "0 1 0"')
