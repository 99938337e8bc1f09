"""Open-loop motion due to one standard deviation of each error of a craft."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from closeform.arrays import Floats
from closeform.dynamics.closed_loop import KINDS
from closeform.dynamics.executed import burn_edges
from closeform.dynamics.timetable import SAME
from closeform.dynamics.validity import deviations_of
from closeform.motion.arc import START
from closeform.motion.path import Path
from closeform.uncertainty.error_columns import burn_ranges, columns_of, impulse_errors
from closeform.uncertainty.errors import Uncertainty

EACH = Uncertainty(magnitude=1.0, pointing=1.0)  # unit errors, four columns for each burn


def error_motions(
    path: Path, errors: Uncertainty, times: Floats, jumps: tuple[Floats, Floats], against: Floats
) -> Floats:
    """Return the deviations (R, T, 6) [m, m/s] of one craft due to its start, its impulses and its burns.

    `jumps` are the times (Q,) and sizes (Q, 3) of its impulses; `against` (T, 3) is compensation thrust,
    which the plan does not contain.  # theory (50)
    """
    orbit, found = path.orbit, [np.empty((0, len(times), 6))]
    if errors.state.any():
        found.append(np.moveaxis(orbit.transition(times - times[0]) @ errors._root, -1, 0))
    for when, size in zip(*jumps, strict=True) if any(errors.impulse) else ():
        moved = orbit.transition(np.maximum(times - when, 0.0))[..., 3:] @ impulse_errors(size, errors).T
        found.append(np.moveaxis(moved * (times > when + SAME)[:, None, None], -1, 0))
    if errors.magnitude or errors.pointing:
        sizes = np.array([errors.magnitude, *[errors.pointing] * 3])[:, None, None]
        found += [sizes * own for own in _burns(path, times, against)]
    return np.concatenate(found)


def _burns(path: Path, times: Floats, against: Floats) -> Iterator[Floats]:
    """Yield deviations (4, T, 6) due to each burn larger by 100 %, and rotated by 1 rad about each axis."""
    edges = burn_edges(path)
    columns = columns_of(path, EACH).state(times).reshape(-1, len(KINDS), len(times), 6)
    own = np.searchsorted(edges, [path.arcs[first, START] for first, _ in burn_ranges(path)], side="right")
    which = np.searchsorted(edges, times, side="right")
    for k in range(len(edges) + 1) if against.any() else own:
        done = np.einsum("kij,tj->kti", KINDS, against * (which == k)[:, None])
        yield deviations_of(path.orbit, times, done) + columns[own == k].sum(axis=0)
