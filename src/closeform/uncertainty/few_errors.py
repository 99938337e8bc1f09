"""Exact collision probability for one or two independent errors, by lines through the space of errors.

One error is a line. For two, the result is integrated over the angle of lines through the centre of their
plane; the integral is split at the angles where the zone, seen in the space of errors, is widest.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from closeform.arrays import Floats
from closeform.uncertainty.ball_share import inside
from closeform.uncertainty.error_lines import ENTRIES, EVER, NOTHING, follow_lines
from closeform.uncertainty.quadrature import integral
from closeform.uncertainty.sampled_trajectories import SampledTrajectories

SAMPLES = 512  # sampled times in an orbit (or a piece, in deep space)
THIN = 1e-7, 1e-6  # of the largest effect, and of the zone: rounding of a singular covariance
LINE = 1e-6  # relative half-interval of the probability for one error
PLANE = 1e-5  # the same for two errors
EVEN = np.linspace(0.0, np.pi, 13)


@dataclass(frozen=True, eq=False)
class FewErrors:
    """Probabilities to be inside at the start and ever inside, and the expected number of entries.

    `off` is their relative error.
    """

    at_start: float
    ever: float
    entries: float
    off: float

    @classmethod
    def of(cls, histories: SampledTrajectories, ways: Floats) -> FewErrors:
        """Return the result for one or two orthonormal directions of errors (1 or 2, M), or zeros."""
        if len(ways) == 1:
            at_start, ever, entries = map(float, _followed(histories, ways, plane=False)[0])
            return cls(at_start, ever, entries, LINE)
        edges = _angles(histories, ways)
        who, many = (
            integral(partial(_round, histories, ways, what), edges, PLANE) for what in (EVER, ENTRIES)
        )
        at_start, _ = inside(histories, float(histories.edges[0]))
        off = PLANE + (who.error / who.value if who.value > 0.0 else 0.0)
        return cls(at_start, min(who.value / np.pi, 1.0), many.value / np.pi, off)


def _round(histories: SampledTrajectories, ways: Floats, what: int, angles: Floats) -> Floats:
    """Return one result of lines through the centre of a plane, at the given angles (K,)."""
    along = np.cos(angles)[:, None] * ways[0] + np.sin(angles)[:, None] * ways[1]
    return np.asarray(_followed(histories, along, plane=True)[:, what])


def _followed(histories: SampledTrajectories, ways: Floats, plane: bool) -> Floats:
    """Return the results of lines along some directions (K, M): (K, 3)."""
    out = np.empty((len(ways), 3))
    held = histories.times, histories.orders, histories.mean_motion, histories.windows
    follow_lines(*held, np.ascontiguousarray(ways), plane, out)
    return out


def few_ways(histories: SampledTrajectories) -> Floats | None:
    """Return the directions (1 or 2, M) of all errors, zeros if no craft moves; None for more than two."""
    moved = _moved(histories)[1].reshape(-1, len(histories.columns))
    _, sizes, directions = np.linalg.svd(moved / np.sqrt(len(moved) / 3), full_matrices=False)
    if sizes[0] <= NOTHING:
        return np.zeros((1, moved.shape[1]))
    many = 1 + int((sizes[1:] > max(NOTHING, min(THIN[0] * sizes[0], THIN[1]))).sum())
    return np.ascontiguousarray(directions[:many]) if many <= 2 else None


def _moved(histories: SampledTrajectories) -> tuple[Floats, Floats]:
    """Return positions (T, 3) and the effect of each error (T, 3, M) over time, in zone coordinates."""
    n, grid = histories.mean_motion, []
    for begin, end in zip(histories.edges[:-1], histories.edges[1:], strict=True):
        turns = n * (end - begin) / (2.0 * np.pi) if n else 1.0
        grid.append(np.linspace(begin, end, int(np.ceil(SAMPLES * turns)) + 9))
    mean, factor = histories.states(np.unique(np.concatenate(grid)))
    matrix = histories.zone.matrix
    return mean[:, :3] @ matrix.T, np.einsum("ij,tjm->tim", matrix, factor[:, :3])


def _angles(histories: SampledTrajectories, ways: Floats) -> Floats:
    """Return angles from 0 to pi, including the extremes of those between which lines meet the zone."""
    middle, moved = _moved(histories)
    both = moved @ ways.T  # (T, 3, 2)
    along = np.einsum("ti,tij->tj", middle, both)
    # a line along e meets the ball where e K e >= 0
    square = (middle**2).sum(axis=1)[:, None, None] - 1.0
    form = along[:, :, None] * along[:, None, :] - square * np.einsum("tij,tik->tjk", both, both)
    mid, swing = (
        0.5 * (form[:, 0, 0] + form[:, 1, 1]),
        np.stack([0.5 * (form[:, 0, 0] - form[:, 1, 1]), form[:, 0, 1]]),
    )
    size = np.hypot(*swing)
    some = np.abs(mid) < size
    axis = np.unwrap(np.arctan2(swing[1], swing[0]))
    half = np.arccos(np.divide(-mid, size, out=np.zeros_like(mid), where=some))
    found = [EVEN]
    change = np.flatnonzero(np.diff(some.astype(int), prepend=0, append=0))
    for first, last in change.reshape(-1, 2):
        for track in ((axis - half)[first:last], (axis + half)[first:last]):
            rate = np.sign(np.diff(track))
            turns = 1 + np.flatnonzero(rate[1:] != rate[:-1])
            found.append(0.5 * track[[0, *turns, len(track) - 1]] % np.pi)
    edges = np.unique(np.concatenate(found))
    return np.asarray(edges[np.concatenate([[True], np.diff(edges) > 1e-9])])
