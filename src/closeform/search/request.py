"""Checks of the arguments of a gathering."""

from collections.abc import Iterable, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import LARGEST, Floats, finite, shown
from closeform.search.leg import Group
from closeform.zones.shapes import BALL, CUBE
from closeform.zones.zone import Zone

Burns = Literal["least", "first", "second", "half"]
Groups = Literal["alternating", "balanced"] | Sequence[Group]


def cleared(zone: Any) -> None:
    """Raise ValueError for a zone that a gathering cannot keep clear."""
    if isinstance(zone, Zone) and zone.shape not in (BALL, CUBE):
        raise ValueError(
            f"keep_out: a gathering requires a Sphere, Ellipsoid or Box, got a {type(zone).__name__}; "
            "give one that encloses it"
        )


def sides(groups: Groups, count: int) -> tuple[Group, ...]:
    """Return the group of each craft."""
    if isinstance(groups, str):
        if groups not in ("alternating", "balanced"):
            raise ValueError(
                f'groups: "alternating", "balanced" or one of A, B for each craft, got {shown(groups)}'
            )
        middle = (count + 1) // 2  # H03 figure 3: three and two of five
        second = [k % 2 == 1 if groups == "alternating" else k >= middle for k in range(count)]
        return tuple("B" if there else "A" for there in second)
    if not isinstance(groups, Iterable):
        raise ValueError(f'groups: "alternating", "balanced" or A, B for each craft, got {shown(groups)}')
    given = tuple(groups)
    if len(given) != count:
        raise ValueError(f"groups: expected one for each of {count} craft, got {len(given)}")
    if wrong := [group for group in given if group not in ("A", "B")]:
        raise ValueError(f'groups: each must be "A" or "B", got {shown(wrong[0])}')
    for group in ("A", "B"):
        if group not in given:
            raise ValueError(f"groups: {group} is empty; craft of one group never see each other")
    return given


def states(positions: ArrayLike, velocities: ArrayLike, dimensions: int) -> tuple[Floats, Floats]:
    """Return positions and velocities as arrays (C, N, 3) after a check."""
    shape = ("N, 3", "C, N, 3")[dimensions - 2]
    arrays = {"positions": finite("positions", positions), "velocities": finite("velocities", velocities)}
    for name, array in arrays.items():
        if array.ndim != dimensions or array.shape[-1] != 3:
            raise ValueError(f"{name}: expected shape ({shape}), got {array.shape}")
    where, speeds = (np.where(np.abs(array) < 1.0 / LARGEST, 0.0, array) for array in arrays.values())
    if where.shape != speeds.shape:
        raise ValueError(f"velocities: expected the shape of positions, {where.shape}, got {speeds.shape}")
    if where.shape[-2] < 2:
        raise ValueError(f"positions: a gathering requires two craft or more, got {where.shape[-2]}")
    if not where.size:
        raise ValueError("positions: no cases")
    cases = where.reshape(-1, *where.shape[-2:])
    order = np.lexsort(cases.transpose(2, 0, 1), axis=-1)
    ranked = np.take_along_axis(cases, order[..., None], axis=1)
    same = (ranked[:, 1:] == ranked[:, :-1]).all(axis=2)
    if same.any():
        case, k = np.argwhere(same)[0]
        i, j = sorted(map(int, order[case, k : k + 2]))
        place = f" in case {case}" if dimensions > 2 else ""
        raise ValueError(f"positions: craft {i} and {j} are at the same position{place}")
    return np.ascontiguousarray(cases), np.ascontiguousarray(speeds.reshape(cases.shape))
