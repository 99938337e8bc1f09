"""Model error of Hill's equations in a force model, and the deviations that it causes.

The model error (residual) is the acceleration along a path that Hill's equations do not contain. `validity`
predicts the deviations of a plan with its planned thrust alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from closeform.arrays import Floats, instance
from closeform.dynamics.clearance import clearance_ratios
from closeform.dynamics.force_model.field import Field, described
from closeform.dynamics.force_model.hill_frame import ChiefFrame, applied
from closeform.dynamics.planned_paths import checked_paths, impulses_of
from closeform.motion.arc import START
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path
from closeform.result import Result
from closeform.zones.pair_zones import PairZones
from closeform.zones.zone import Zone

STEPS = 300  # quadrature steps in each orbit, in pairs for Simpson's rule
FEWEST = 60  # quadrature steps at least
SAME = 1e-6  # s: tolerance of equal times
PASSES, WITHIN = 8, 0.005  # passes along the deviating path, and the change [m] at which they end


@dataclass(frozen=True, eq=False, repr=False)
class Validity(Result):
    """Predicted deviations of N paths in a field with the planned thrust; returned by `validity`.

    Attributes
    ----------
    field : str
        Description of the force model.
    residual : array of shape (N,) [m/s^2]
        Largest model error of Hill's equations along each path.
    times : array of shape (T,) [s]
        Times since the chief's epoch.
    deviations : array of shape (N, T, 6) [m, m/s]
        Predicted deviation of each spacecraft, in the chief's axes.
    pairs : array of int of shape (P, 2)
        Pairs i < j that have a zone.
    planned : array of shape (P,), no unit
        Minimum clearance ratio of each pair as planned, at these times and between them.
    simulated : array of shape (P,), no unit
        Predicted minimum clearance ratio of each pair; below 1 the zone is entered.
    """

    _told: ClassVar = ("field", "ends", "residual", "planned", "simulated")

    field: str
    residual: Floats
    times: Floats
    deviations: Floats
    pairs: Any
    planned: Floats
    simulated: Floats

    @property
    def ends(self) -> Floats:
        """Predicted deviation of each spacecraft at the end (N,) [m]."""
        return np.asarray(np.linalg.norm(self.deviations[:, -1, :3], axis=1))

    @property
    def lines(self) -> tuple[str, ...]:
        """Description in two lines: deviations, then the closest pair and the model error."""
        return in_words(self)


def validity(plan: Any, field: Field, zones: Zone | PairZones | None = None) -> Validity:
    """Predict the deviations of planned paths in a field with the planned thrust alone.

    Parameters
    ----------
    plan : Plan or Path
        Plan of one spacecraft or of N, in the chief's Hill frame with straight axes, times since its epoch.
    field : Field
        Force model in which they move.
    zones : Zone or PairZones, optional
        Zones of all pairs, or of each; without them no clearance ratios are predicted.

    Returns
    -------
    Validity
        Deviations, and minimum clearance ratios of pairs.

    Raises
    ------
    ValueError
        If the plan has no paths, is in deep space, has another mean motion than the chief, or an argument
        has the wrong type.

    Notes
    -----
    The model error is evaluated along the planned path, and again along the deviating path until a further
    pass would change a few millimetres at most. With `compensated_thrust` there are no deviations.

    References
    ----------
    docs/theory.md (83).

    Examples
    --------
    >>> import closeform as cf
    >>> chief = cf.Chief.from_elements("2026-11-22T12:00:00", [6.878e6, 0.0, 1e-3, 0.0, 0.9, 0.0])
    >>> path = chief.orbit.transfer([0, 200, 0, 0, 0, 0], [0, 50, 0, 0, 0, 0], 3000.0)
    >>> bool(0.1 < cf.validity(path, cf.Field(chief)).ends[0] < 10.0)
    True
    """
    paths = checked_paths(plan, field)
    instance("zones", zones, Zone, PairZones, type(None))
    start, end = float(paths.start[0]), float(paths.end[0])
    orbit = paths.orbit
    count = 2 * max(FEWEST // 2, int(np.ceil(0.5 * STEPS * (end - start) / orbit.period)))
    times = np.linspace(start, end, count + 1)
    states = paths.state(times)
    frame = ChiefFrame.of(field, times)
    left_out = residuals(field, frame, states, orbit.mean_motion)
    greatest = np.linalg.norm(left_out, axis=2).max(axis=1)
    off = deviations_of(orbit, times, left_out)
    size = np.abs(off).max()
    for _ in range(PASSES):
        before, kept = size, off
        off = deviations_of(orbit, times, residuals(field, frame, states + off, orbit.mean_motion))
        size = np.abs(off - kept).max()
        if size * size <= WITHIN * before:  # estimate of the next change, for geometric convergence
            break
    deviations = off[:, ::2]
    pairs, planned, simulated = _least(paths, times[::2], deviations, zones)
    return Validity(described(field), greatest, times[::2], deviations, pairs, planned, simulated)


def _least(
    paths: Path, times: Floats, deviations: Floats, zones: Zone | PairZones | None
) -> tuple[Any, Floats, Floats]:
    """Return pairs (P, 2), their minimum clearance ratios (P,) as planned, and with deviations (N, T, 6)."""
    begins = np.unique(paths.arcs[:, START])
    apart = np.abs(times[:, None] - begins).min(axis=1) > SAME
    nodes = np.union1d(begins, times[apart])  # thrust and velocities jump at no other time
    states, jumps = paths.state(nodes), np.zeros((len(paths), len(nodes), 6))
    craft, fired, sizes = impulses_of(paths)
    np.add.at(jumps[..., 3:], (craft, np.searchsorted(nodes, fired)), sizes)  # some at one instant
    off = states + paths.orbit._through(times, deviations).state(nodes)
    pairs, planned = clearance_ratios(states, states - jumps, nodes, zones)
    return pairs, planned, clearance_ratios(off, off - jumps, nodes, zones)[1]


def in_words(found: Validity, names: Sequence[str] | None = None) -> tuple[str, ...]:
    """Return the lines of a Validity, with the names of its spacecraft, or their indices."""
    worst = int(np.argmax(found.ends))
    who = f"craft {worst}" if names is None else names[worst]
    ends = f"In {found.field}, without compensation, {who} ends {found.ends[worst]:.3g} m from the plan"
    left_out = f"The model error of Hill's equations is {found.residual.max():.2g} m/s²"
    if not len(found.pairs):
        return (ends, left_out)
    near = int(np.argmin(found.simulated))
    i, j = found.pairs[near]
    pair = f"craft {i} and {j}" if names is None else f"{names[i]} and {names[j]}"
    entered = " (entered)" if found.simulated[near] < 1.0 else ""
    least = f"{found.simulated[near]:.4f}{entered}, {pair}; as planned {found.planned[near]:.4f}"
    return (ends, f"Minimum clearance ratio predicted: {least}. {left_out}")


def residuals(field: Field, frame: ChiefFrame, states: Floats, n: float) -> Floats:
    """Return the model error (N, T, 3) [m/s^2] of Hill's equations with mean motion `n`.

    States (N, T, 6) [m, m/s] and result are in the chief's axes; spacecraft are in the order of the field's
    ballistic coefficients.  # theory (82)
    """
    place, speed = states[..., :3], states[..., 3:]
    turn, swing = frame.rotation, np.cross(frame.rotation, place)
    own = field._ballistics(len(states))[:, None]
    acceleration = field.accelerations(frame.times, frame.inertial(states), own) - frame.acceleration
    d = applied(frame.axes, acceleration)
    d -= 2.0 * np.cross(turn, speed) + np.cross(frame.rotation_rate, place) + np.cross(turn, swing)
    x, z, vx, vy = place[..., 0], place[..., 2], speed[..., 0], speed[..., 1]
    d[..., 0] -= 3.0 * n * n * x + 2.0 * n * vy  # theory (1)
    d[..., 1] += 2.0 * n * vx
    d[..., 2] += n * n * z
    return d


def deviations_of(orbit: Orbit, times: Floats, left_out: Floats) -> Floats:
    """Return the deviations (N, T, 6) due to accelerations (N, T, 3) at an even number of equal steps.

    Simpson's rule, whose parabola gives both of its steps.  # theory (83)
    """
    since = times - times[0]
    back = applied(orbit.transition(-since)[:, :, 3:], left_out)
    one, two, three = back[:, :-2:2], back[:, 1::2], back[:, 2::2]
    both = [5.0 * one + 8.0 * two - three, -one + 8.0 * two + 5.0 * three]
    steps = np.stack(both, axis=2).reshape(len(back), -1, 6) * (since[1] / 12.0)
    off = np.zeros_like(back)
    off[:, 1:] = applied(orbit.transition(since[1:]), np.cumsum(steps, axis=1))
    return off
