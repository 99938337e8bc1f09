"""Changes: the keys in which two scenario files differ, with what each says."""

from collections.abc import Iterator, Mapping
from typing import Any

from closeform.scenario.errors import Place, dotted
from closeform.scenario.load import toml
from closeform.scenario.quantity import shown


def changes(before: str, after: str) -> list[str]:
    """What a file says now of each key, and said before; none where only its layout or comments differ."""
    old, new = (dict(values(toml(text, "scenario"))) for text in (before, after))
    return [
        f"{dotted(place)} {told(old, place)}, not {told(new, place)}"
        for place in {**old, **new}
        if place not in old or place not in new or old[place] != new[place]
    ]


def values(raw: Any, place: Place = ()) -> Iterator[tuple[Place, Any]]:
    """Every value of a file by its place; tables and lists by what is in them."""
    inner = raw.items() if isinstance(raw, Mapping) else enumerate(raw)
    for key, value in inner:
        if isinstance(value, Mapping | list) and value:
            yield from values(value, (*place, key))
        else:
            yield (*place, key), value


def told(found: Mapping[Place, Any], place: Place) -> str:
    """A value as it is shown; of a key that is not there that it is absent."""
    return shown(found[place]) if place in found else "absent"
