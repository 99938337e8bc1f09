"""Expansion of `[study.sweep]`: the scenario file at each combination of the swept values."""

import re
from collections.abc import Iterator, Mapping
from copy import deepcopy
from itertools import product
from math import prod
from typing import Any

MOST_POINTS = 1000
PART = re.compile(r"(\w+)(?:\[(\d+)\])?")  # of a key, with an optional index that counts from 1
DRAWN = "study.vary."


def points(raw: Mapping[str, Any]) -> Iterator[tuple[dict[str, Any], dict[str, Any]]]:
    """Yield each combination of the swept values, by key, with the file contents that result from it.

    The contents no longer include the sweep. The last key changes fastest. Raises ValueError, beginning with
    the key, if the file has no such place.
    """
    sweep = raw["study"]["sweep"]
    if prod(map(len, sweep.values())) > MOST_POINTS:
        raise ValueError(f"more than {MOST_POINTS} points; give fewer values")
    for values in product(*sweep.values()):
        changed = deepcopy(dict(raw))
        del changed["study"]["sweep"]
        chosen = dict(zip(sweep, values, strict=True))
        for key, value in chosen.items():
            put(changed, key, value)
        yield chosen, changed


def put(raw: dict[str, Any], key: str, value: Any) -> None:
    """Write one value into the contents of a file."""
    path = ["study", "vary", key.removeprefix(DRAWN)] if key.startswith(DRAWN) else key.split(".")
    place: Any = raw
    for part in path[:-1]:
        found = PART.fullmatch(part)
        place = place.get(found[1]) if found is not None and isinstance(place, dict) else None
        if found is not None and found[2] and isinstance(place, list):
            place = place[int(found[2]) - 1] if 0 < int(found[2]) <= len(place) else None
        if not isinstance(place, dict):
            raise ValueError(f"{key}: there is no {part} in the file; add it, or name a key that is there")
    place[path[-1]] = value


def words(chosen: Mapping[str, Any]) -> str:
    """Return the values of a point as text."""
    return ", ".join(f"{key} = {text(value)}" for key, value in chosen.items())


def text(value: Any) -> str:
    """Return a value as text; a draw as its kind and size."""
    if isinstance(value, dict):
        return " ".join(f"{name} {text(one)}" for name, one in value.items())
    if isinstance(value, list):
        return ", ".join(map(text, value))
    return str(value)
