"""Figures of paths, zones, conflicts and searches.

All functions except the animations return a matplotlib Figure. They neither use nor change matplotlib's
global state: save a figure with its `savefig` method.
"""

from importlib import import_module
from typing import Any

# Each function is imported at first use, so that only the kernels it needs are compiled.
_HOMES = {
    "animation": "gathering_views",
    "before_after": "space",
    "burns": "burning",
    "clearance": "clearances",
    "closest_pairs": "closest",
    "collision": "collisions",
    "complementary_cones": "cones",
    "distances": "timelines",
    "drift_fan": "fans",
    "drift_ratios": "drifts",
    "flight_costs": "flights",
    "flight_deviations": "flights",
    "flight_paths": "flights",
    "flight_ratios": "flights",
    "formation_animation": "moving_formation",
    "formation_paths": "fleet",
    "formation_thrust": "thrusting",
    "distribution": "distributions",
    "histogram": "lockings",
    "in_plane_search": "attitudes",
    "lemma_2": "hyperbola",
    "manoeuvres": "attitudes",
    "overview": "missions",
    "primer": "primers",
    "pulses": "thruster_pulses",
    "ratio_matrix": "matrix",
    "ratios": "clearance_ratios",
    "sigmas": "sigma_curves",
    "three_views": "gathering_views",
    "sweep": "sweeps",
    "thrust": "thrusting",
    "trade": "primers",
    "tube": "tubes",
    "two_ways": "sides",
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
