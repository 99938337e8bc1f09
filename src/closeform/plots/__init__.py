"""Figures of paths, zones, conflicts and searches.

All functions except the animations return a matplotlib Figure. They neither use nor change matplotlib's
global state: save a figure with its `savefig` method.
"""

from importlib import import_module
from typing import Any

# Each function is imported at first use, so that only the kernels it needs are compiled.
_HOMES = {
    "animation": "gatherings",
    "before_after": "paths",
    "burns": "thrusts",
    "clearance": "costs",
    "closest_pairs": "clearances",
    "collision": "studies",
    "complementary_cones": "searches",
    "distances": "clearances",
    "distribution": "studies",
    "drift_fan": "paths",
    "drift_ratios": "clearances",
    "flight_costs": "simulations",
    "flight_deviations": "simulations",
    "flight_paths": "paths",
    "flight_ratios": "simulations",
    "formation_animation": "animations",
    "formation_paths": "paths",
    "formation_thrust": "thrusts",
    "histogram": "studies",
    "in_plane_search": "searches",
    "join_table": "papers",
    "lemma_2": "searches",
    "lock_map": "papers",
    "manoeuvres": "searches",
    "near_field": "papers",
    "overview": "missions",
    "primer": "costs",
    "pulses": "thrusts",
    "ratio_matrix": "matrix",
    "ratios": "clearances",
    "sets": "papers",
    "sigmas": "clearances",
    "simultaneity": "papers",
    "spacecraft": "papers",
    "sweep": "studies",
    "three_views": "gatherings",
    "thrust": "thrusts",
    "trade": "costs",
    "tube": "paths",
    "two_ways": "paths",
}
__all__ = sorted(_HOMES)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'closeform.plots' has no attribute {name!r}")
    value = getattr(import_module(f"closeform.plots.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOMES])
