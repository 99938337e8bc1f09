"""Public functions, classes and results of the package, found by inspection."""

import inspect
from collections.abc import Iterator
from enum import Enum
from functools import cached_property
from typing import Any

import closeform as cf

# Made by functions, never by a user: nothing to raise.
RESULTS = {"Approach", "CommonFrame", "Conflict", "Path", "Screening", "Zone"}
RESULTS |= {"PairZones", "PairZones.which", "PairZones.between", "PairZones.around", "PairZones.rule"}
RESULTS |= {"GatherStatus", "Gathering", "Gatherings", "Locks"}
RESULTS |= {"LockProof", "LongestLock"}
RESULTS |= {
    "TransferCostTable",
    "Bound",
    "Encounter",
    "ThrusterFiring",
    "Probability",
    "SigmaApproach",
}
RESULTS |= {"ClearanceCostCurve", "MaxClearance", "ShadowPrice"}
RESULTS |= {
    "DriftApproach",
    "DriftScreening",
    "CompensatedThrust",
    "Validity",
    "Simulation",
    "Tube",
}
RESULTS |= {
    "TrackingMargins",
}
RESULTS |= {
    "Plan",
    "Search",
    "papers.TheoremCase",
}


def members(owner: type) -> Iterator[tuple[str, Any]]:
    """What a class defines itself, or takes from a base of the package that has no public name."""
    for base in owner.__mro__:
        if base is owner or (base.__module__.startswith("closeform") and base.__name__ not in cf._HOMES):
            yield from vars(base).items()


def methods(owner: type) -> Iterator[tuple[str, Any]]:
    """Its public methods."""
    for name, member in members(owner):
        function = getattr(member, "__func__", member)  # of a class method
        if not name.startswith("_") and inspect.isfunction(function):
            yield name, function


def callables() -> dict[str, Any]:
    """Every public function, class and method by its full name."""
    public = {name: getattr(cf, name) for name in cf._HOMES}
    for module in cf._MODULES:
        public |= {
            f"{module}.{name}": getattr(getattr(cf, module), name) for name in getattr(cf, module).__all__
        }
    found = {name: value for name, value in public.items() if callable(value)}
    for name, value in public.items():
        if inspect.isclass(value):
            found |= {f"{name}.{method}": function for method, function in methods(value)}
    return found


CALLABLES = callables()


def arguments(function: Any) -> list[str]:
    if inspect.isclass(function) and issubclass(function, Enum):
        return []
    return [name for name in inspect.signature(function).parameters if name not in ("self", "cls")]


def properties() -> list[tuple[str, Any]]:
    owners = [name for name in cf._HOMES if inspect.isclass(getattr(cf, name))]
    found = [(owner, name, m) for owner in owners for name, m in members(getattr(cf, owner))]
    public = [one for one in found if not one[1].startswith("_")]
    return [(f"{owner}.{name}", m) for owner, name, m in public if isinstance(m, property | cached_property)]
