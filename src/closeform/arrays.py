"""What an array argument may be."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
LARGEST = 1e60  # of a number: beyond, squares and cubes overflow


def numbers(name: str, value: ArrayLike) -> Floats:
    """An argument as an array of floats; ValueError naming it where that cannot be."""
    try:
        return np.asarray(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name}: expected numbers, got {value!r:.60}") from error
