"""Comparison of two scenario files, key by key."""

from collections.abc import Iterator, Mapping
from typing import Any

from closeform.scenario.errors import Place, dotted
from closeform.scenario.load import toml
from closeform.scenario.quantity import shown


def changes(before: str, after: str) -> list[str]:
    """Return one line for each key that differs between two texts, with its new and its old value.

    The list is empty if the files differ only in layout or comments.
    """
    old, new = (dict(values(toml(text, "scenario"))) for text in (before, after))
    return [
        f"{dotted(place)} {told(old, place)}, not {told(new, place)}"
        for place in {**old, **new}
        if place not in old or place not in new or old[place] != new[place]
    ]


def values(raw: Any, place: Place = ()) -> Iterator[tuple[Place, Any]]:
    """Yield each value of a file with its place; nested tables and lists are expanded."""
    inner = raw.items() if isinstance(raw, Mapping) else enumerate(raw)
    for key, value in inner:
        if isinstance(value, Mapping | list) and value:
            yield from values(value, (*place, key))
        else:
            yield (*place, key), value


def told(found: Mapping[Place, Any], place: Place) -> str:
    """Return the value at a place as text, or "absent" if the key is missing."""
    return shown(found[place]) if place in found else "absent"
