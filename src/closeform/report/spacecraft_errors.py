"""Errors of each spacecraft in simulations: initial state, burns, impulses and process noise."""

from collections.abc import Iterator, Sequence
from math import degrees
from typing import Any

import numpy as np


def told(errors: Sequence[Any]) -> Iterator[str]:
    """Yield the largest errors among the spacecraft: initial state, burns, impulses and process noise."""
    some = [one for one in errors if one is not None]
    axes = np.array([np.sqrt(np.diag(one.state)) for one in some]).reshape(-1, 2, 3)
    place, speed = axes.max(axis=(0, 2), initial=0.0)
    if place or speed:
        yield f"Start: off by {place:.3g} m and {1e3 * speed:.3g} mm/s (1 sigma, the worst axis)"
    size, turn = np.array([[one.magnitude, one.pointing] for one in some]).reshape(-1, 2).max(0, initial=0.0)
    if size or turn:
        yield f"Burns: each off by {100.0 * size:.3g} % and {degrees(turn):.3g} deg (1 sigma)"
    gates = np.array([one.impulse for one in some]).reshape(-1, 4).max(axis=0, initial=0.0)
    if gates.any():
        fixed, share, across, turn = gates
        yield (
            f"Impulses: each off by {1e3 * fixed:.3g} mm/s and {100.0 * share:.3g} % along it, "
            f"{1e3 * across:.3g} mm/s and {degrees(turn):.3g} deg across (1 sigma, Gates' model)"
        )
    if noise := max((one.noise for one in some), default=0.0):
        yield f"White noise: of {noise:.3g} m²/s³ along each axis, all the time"


def figures(errors: Sequence[Any]) -> list[dict[str, Any] | None]:
    """Return the errors of each spacecraft in SI units; None for a spacecraft without errors."""
    return [
        None
        if one is None
        else {
            "covariance": one.state.tolist(),
            "magnitude": one.magnitude,
            "pointing_rad": one.pointing,
            "gates": list(one.impulse),
            "noise_m2_s3": one.noise,
        }
        for one in errors
    ]
