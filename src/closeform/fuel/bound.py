"""What any plan costs at least in delta-v, by a proof that a primer carries."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, instance
from closeform.motion.arc import END, WIDTH
from closeform.motion.constant_primers import constant_bounds
from closeform.motion.ends import arcs_between
from closeform.motion.impulses import answers
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path, path_of
from closeform.motion.reduced import LOWER, PRIMER, UNIQUE, UPPER
from closeform.motion.saturated import BOUND, PROOF, WORST
from closeform.motion.steering import steer
from closeform.motion.within_limit import limited
from closeform.result import Rows

PROVEN = 1e-9  # gap between the bounds, relative


@dataclass(frozen=True, eq=False, repr=False)
class Bound(Rows):
    """The least delta-v of transfers in a given time, between two bounds.

    Attributes
    ----------
    lower : float or array of shape (...) [m/s]
        No plan of any kind, impulses or thrust, costs less.
    upper : float or array of shape (...) [m/s]
        What the impulses of `Orbit.impulsive` cost.
    primer : Path
        The primer that proves `lower`: `primer.position(t)` is p(t), without unit and nowhere longer
        than 1 (but within a limit of thrust), from time 0 on.
        An impulse of a least plan is along p where |p| is 1.
    proven : bool or array of bool of shape (...)
        Whether the bounds agree to 1e-9 of themselves, within a limit of thrust to 1e-6.
    unique : bool or array of bool of shape (...)
        Whether no other plan costs as little.  Where it is False, the primer's length is constant, or it
        is 1 so often that impulses can be shared otherwise: infinitely many plans cost the same.
    """

    _columns: ClassVar = {
        "lower": "lower_m_s",
        "upper": "upper_m_s",
        "proven": "proven",
        "unique": "unique",
    }

    lower: Any
    upper: Any
    primer: Path
    proven: Any
    unique: Any

    @property
    def gap(self) -> Any:
        """How far the upper bound is above the lower one, a share of it (no unit), of the batch's shape."""
        lower = np.asarray(self.lower)
        return np.where(lower > 0.0, self.upper / np.where(lower > 0.0, lower, 1.0) - 1.0, 0.0)[()]


def least_delta_v(
    orbit: Orbit,
    initial: ArrayLike,
    final: ArrayLike,
    duration: ArrayLike,
    max_acceleration: ArrayLike | None = None,
) -> Bound:
    """The least delta-v from `initial` to `final` in `duration`, and its proof.

    Parameters
    ----------
    orbit : Orbit
        The frame.
    initial : array_like of shape (..., 6) [m, m/s]
        States at the beginning, in the rotating frame.
    final : array_like of shape (..., 6) [m, m/s]
        States at the end, in the rotating frame.
    duration : array_like of shape (...) [s]
        Above 0, at most 100 orbits; all broadcast.
    max_acceleration : array_like of shape (...) [m/s^2], default None
        Of the thrust; None is no limit, for impulses.

    Returns
    -------
    Bound
        Of the broadcast shape.  Within a limit `upper` is what `Orbit.transfer` with it costs, at most 1e-6
        above `lower`, and the primer is longer than 1 where the limit holds.

    Raises
    ------
    ValueError
        If no thrust within the limit makes the transfer; if a limit or a duration is not positive, a duration
        is too long, shapes do not fit, or a number is not finite.

    Notes
    -----
    Without a limit the lower bound holds for thrust of any kind, with any limit.

    References
    ----------
    Lawden's primer, by its dual in six unknowns: docs/theory.md (26, 27, 29), with a limit
    docs/theory.md (32).

    Examples
    --------
    >>> orbit = cf.Orbit.circular(500e3)
    >>> bound = cf.least_delta_v(orbit, [0, -200, 0, 0, 0, 0], np.zeros(6), orbit.period)
    >>> bool(bound.proven), bool(bound.gap < 1e-9)
    (True, True)
    """
    if max_acceleration is not None:
        return _within(orbit, initial, final, duration, max_acceleration)
    arcs, finals = arcs_between(instance("orbit", orbit, Orbit).mean_motion, initial, final, duration, 0.0)
    shape, rows = arcs.shape[:-1], arcs.reshape(-1, WIDTH)
    found = answers(orbit.mean_motion, rows, finals)
    lower, upper = found[:, LOWER], found[:, UPPER]
    primer = orbit.coast(found[:, PRIMER : PRIMER + 6], rows[:, END])
    columns = lower, upper, upper - lower <= PROVEN * upper, found[:, UNIQUE] > 0.5
    low, high, proven, unique = (column.reshape(shape) if shape else column[0] for column in columns)
    return Bound(low, high, Path(orbit, primer.arcs, primer.offsets, shape), proven, unique)


def _within(
    orbit: Orbit, initial: ArrayLike, final: ArrayLike, duration: ArrayLike, max_acceleration: ArrayLike
) -> Bound:
    """The least delta-v within a limit: all of it or none, unless any share of it does as well."""
    n = instance("orbit", orbit, Orbit).mean_motion
    arcs, finals = arcs_between(n, initial, final, duration, 0.0)
    steer(n, arcs.reshape(-1, WIDTH), finals)
    ends = finals.reshape(*arcs.shape[:-1], 6)
    rows, offsets, shape, facts = limited(n, arcs, ends, max_acceleration, True)
    path = path_of(orbit, rows, offsets, shape)
    spent, limits = (
        np.asarray(path.delta_v),
        np.broadcast_to(np.asarray(max_acceleration, dtype=float), shape),
    )
    full = 2.0 * np.asarray(path.energy) >= limits * spent * (1.0 - 1e-6)
    lower = facts[:, BOUND].reshape(shape)
    primer = orbit.coast(facts[:, PROOF:].reshape(*shape, 6), np.asarray(path.end))
    return Bound(lower[()], path.delta_v, primer, (spent - lower <= WORST * spent)[()], full[()])


def delta_v_bound(orbit: Orbit, initial: ArrayLike, final: ArrayLike, duration: ArrayLike) -> Any:
    """A lower bound of delta-v in closed form [m/s], within a microsecond for each transfer.

    Exact for nearly half of transfers of one to three orbits, where a primer of constant length is the
    best.  Arguments broadcast: `delta_v_bound(orbit, a[:, None], b, T)` bounds the matrix of costs.

    Parameters
    ----------
    orbit : Orbit
        The frame.
    initial : array_like of shape (..., 6) [m, m/s]
        States at the beginning, in the rotating frame.
    final : array_like of shape (..., 6) [m, m/s]
        States at the end, in the rotating frame.
    duration : array_like of shape (...) [s]
        Above 0; all broadcast.

    Returns
    -------
    float or array of shape (...) [m/s]
        No plan of any kind costs less.

    Raises
    ------
    ValueError
        If a duration is not positive, shapes do not fit, or a number is not finite.

    Notes
    -----
    It is the mean motion times the greatest of the changes of drift, of inclination, and of half the
    eccentricity vector with sqrt(3) times the inclination vector beside it, in either sense.

    References
    ----------
    Primers of constant length: docs/theory.md (28).
    """
    arcs, finals = arcs_between(instance("orbit", orbit, Orbit).mean_motion, initial, final, duration, 0.0)
    shape, rows = arcs.shape[:-1], arcs.reshape(-1, WIDTH)
    out: Floats = np.empty(len(rows))
    constant_bounds(orbit.mean_motion, rows, finals, out)
    return out.reshape(shape) if shape else float(out[0])
