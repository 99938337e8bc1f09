"""Closed-form guidance for close formation flight. The public names are in `__init__.pyi`."""

from importlib import import_module
from typing import Any

_HOMES = {
    "Orbit": "orbit",
    "Path": "path",
    "join": "path",
    "stack": "path",
    "Zone": "zones",
    "Box": "zones",
    "Ellipsoid": "zones",
    "Sphere": "zones",
    "Conflict": "conflicts",
    "Approach": "conflicts",
    "find_conflicts": "conflicts",
    "closest_approach": "conflicts",
    "last_possible_conflict": "conflicts",
    "Screening": "screening",
    "screen": "screening",
    "Avoidance": "avoidance",
    "Contact": "avoidance",
    "avoid": "avoidance",
    "end_gradients": "avoidance",
}
__all__ = sorted(_HOMES)  # noqa: PLE0605


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        value = getattr(import_module(f"closeform.{_HOMES[name]}"), name)
        globals()[name] = value
        return value
    if name == "plots":
        return import_module("closeform.plots")
    raise AttributeError(f"module 'closeform' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOMES])
