"""Lower bounds on the delta-v of any plan, proven by a primer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats
from closeform.motion.arc import END, START, WIDTH
from closeform.motion.chief_orbit import ChiefOrbit
from closeform.motion.construction.ends import arcs_between
from closeform.motion.minimum_delta_v.constant_primers import constant_bounds
from closeform.motion.minimum_delta_v.impulses import answers
from closeform.motion.minimum_delta_v.reduced import LOWER, PRIMER, UNIQUE, UPPER
from closeform.motion.minimum_delta_v.saturated import BOUND, PROOF, WORST
from closeform.motion.minimum_delta_v.within_limit import limited
from closeform.motion.orbit import Orbit, circular_orbit
from closeform.motion.path import Path, path_of
from closeform.motion.steering import steer
from closeform.result import Rows

PROVEN = 1e-9  # gap between the bounds, relative


@dataclass(frozen=True, eq=False, repr=False)
class Bound(Rows):
    """Bounds on the minimum delta-v of transfers in a given time.

    Attributes
    ----------
    lower : float or array of shape (...) [m/s]
        Lower bound on the cost of any plan, by impulses or thrust.
    upper : float or array of shape (...) [m/s]
        Cost of the impulses of `Orbit.impulsive`.
    primer : Path
        Primer that proves `lower`: `primer.position(t)` is p(t), without unit and at most of length 1
        (more only within a thrust limit), from departure onward.
        An impulse of an optimal plan is along p at a time when |p| is 1.
    proven : bool or array of bool of shape (...)
        True if the bounds agree to a relative 1e-9, or to 1e-6 within a thrust limit.
    unique : bool or array of bool of shape (...)
        True if no other plan has the same cost.  If False, the primer's length is constant, or it is 1 so
        often that the impulses can be distributed differently: infinitely many plans have the same cost.
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
        """Relative excess of the upper bound over the lower one (no unit), of the batch's shape."""
        lower = np.asarray(self.lower)
        return np.where(lower > 0.0, self.upper / np.where(lower > 0.0, lower, 1.0) - 1.0, 0.0)[()]


def least_delta_v(
    orbit: Orbit,
    initial: ArrayLike,
    final: ArrayLike,
    duration: ArrayLike,
    max_acceleration: ArrayLike | None = None,
    start: ArrayLike = 0.0,
) -> Bound:
    """Return the minimum delta-v from `initial` to `final` in `duration`, and its proof.

    Parameters
    ----------
    orbit : Orbit
        Orbit that defines the rotating frame, also one of `Orbit.eccentric` or `Orbit.perturbed`.
    initial : array_like of shape (..., 6) [m, m/s]
        States at the beginning, in the rotating frame.
    final : array_like of shape (..., 6) [m, m/s]
        States at the end, in the rotating frame.
    duration : array_like of shape (...) [s]
        Above 0, at most 100 orbits; all broadcast.
    max_acceleration : array_like of shape (...) [m/s^2], default None
        Limit of the thrust; None for no limit, with impulses.
    start : array_like of shape (...) [s], default 0
        Departure time.  The cost depends on it about a chief that is not on a circle.

    Returns
    -------
    Bound
        Bounds of the broadcast shape.  With a limit, `upper` is the cost of `Orbit.transfer`, at most 1e-6
        above `lower`, and the primer is longer than 1 during burns.

    Raises
    ------
    ValueError
        If no thrust within the limit achieves the transfer; if a limit or a duration is not positive, a
        duration is too long, shapes do not fit, or a number is not finite.

    Notes
    -----
    Without a limit the lower bound holds for any thrust, with any limit.

    References
    ----------
    Lawden's primer, by its dual in six unknowns: docs/theory.md (26, 27, 29); with a limit
    docs/theory.md (32).

    Examples
    --------
    >>> orbit = cf.Orbit.circular(500e3)
    >>> bound = cf.least_delta_v(orbit, [0, -200, 0, 0, 0, 0], np.zeros(6), orbit.period)
    >>> bool(bound.proven), bool(bound.gap < 1e-9)
    (True, True)
    """
    if max_acceleration is not None:
        return _within(orbit, initial, final, duration, max_acceleration, start)
    if isinstance(orbit, ChiefOrbit):
        shape, rows, found = orbit._bounds(initial, final, duration, start)
    else:
        n = circular_orbit("orbit", orbit).mean_motion
        arcs, finals = arcs_between(n, initial, final, duration, start)
        shape, rows = arcs.shape[:-1], arcs.reshape(-1, WIDTH)
        found = answers(n, rows, finals)[:, [LOWER, UPPER, UNIQUE, *range(PRIMER, PRIMER + 6)]]
    lower, upper, unique_plan = found[:, :3].T
    primer = orbit.coast(found[:, 3:], rows[:, END] - rows[:, START], rows[:, START])
    columns = lower, upper, upper - lower <= PROVEN * upper, unique_plan > 0.5
    low, high, proven, unique = (column.reshape(shape) if shape else column[0] for column in columns)
    return Bound(low, high, Path(orbit, primer.arcs, primer.offsets, shape), proven, unique)


def _within(
    orbit: Orbit,
    initial: ArrayLike,
    final: ArrayLike,
    duration: ArrayLike,
    max_acceleration: ArrayLike,
    start: ArrayLike,
) -> Bound:
    """Return the minimum delta-v within a limit; it is unique if thrust is at the limit or zero."""
    n = circular_orbit("orbit", orbit).mean_motion
    arcs, finals = arcs_between(n, initial, final, duration, start)
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
    length = np.asarray(path.end) - path.start
    primer = orbit.coast(facts[:, PROOF:].reshape(*shape, 6), length, path.start)
    return Bound(lower[()], path.delta_v, primer, (spent - lower <= WORST * spent)[()], full[()])


def delta_v_bound(orbit: Orbit, initial: ArrayLike, final: ArrayLike, duration: ArrayLike) -> Any:
    """Return a closed-form lower bound on delta-v [m/s], within a microsecond for each transfer.

    The bound is exact for nearly half of transfers of one to three orbits, where a primer of constant length
    is optimal.  Arguments broadcast: `delta_v_bound(orbit, a[:, None], b, T)` bounds the matrix of costs.

    Parameters
    ----------
    orbit : Orbit
        Orbit that defines the rotating frame.
    initial : array_like of shape (..., 6) [m, m/s]
        States at the beginning, in the rotating frame.
    final : array_like of shape (..., 6) [m, m/s]
        States at the end, in the rotating frame.
    duration : array_like of shape (...) [s]
        Above 0; all broadcast.

    Returns
    -------
    float or array of shape (...) [m/s]
        Lower bound on the cost of any plan.

    Raises
    ------
    ValueError
        If a duration is not positive, shapes do not fit, or a number is not finite.

    Notes
    -----
    The bound is the mean motion times the largest of the changes of drift, of inclination, and of half the
    eccentricity vector combined with sqrt(3) times the inclination vector, with either sign.

    References
    ----------
    Primers of constant length: docs/theory.md (28).
    """
    arcs, finals = arcs_between(circular_orbit("orbit", orbit).mean_motion, initial, final, duration, 0.0)
    shape, rows = arcs.shape[:-1], arcs.reshape(-1, WIDTH)
    out: Floats = np.empty(len(rows))
    constant_bounds(orbit.mean_motion, rows, finals, out)
    return out.reshape(shape) if shape else float(out[0])
