"""The thrust that flies a planned path in a real field: the plan's, less what Hill's equations leave out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, number
from closeform.dynamics.chief_frame import ChiefFrame
from closeform.dynamics.engines import running_engines
from closeform.dynamics.field import Field, described
from closeform.dynamics.flown_plan import paths_to_fly, spanning
from closeform.dynamics.natural import drifting
from closeform.dynamics.residual import residuals
from closeform.dynamics.retargeted import Retargeted, changed_impulses
from closeform.fuel.thrusters import Thrusters, each_set
from closeform.motion.joining import stack
from closeform.motion.mean_motion import checked
from closeform.motion.path import Path
from closeform.result import Rows

if TYPE_CHECKING:
    from closeform.fuel.firing import ThrusterFiring


@dataclass(frozen=True, eq=False, repr=False)
class CompensatedThrust(Rows):
    """What N craft thrust at T times to fly their paths in a field; made by `thrust`.

    Attributes
    ----------
    field : str
        In which the paths, and all that is certified of them, are flown: its words.
    times : array of shape (T,) [s]
        Since the chief's epoch.
    commanded : array of shape (N, T, 3) [m/s^2]
        Radial, along-track and cross-track, in the chief's axes: planned less residual; as planned of craft
        that have impulses.
    planned : array of shape (N, T, 3) [m/s^2]
        The thrust of the plan, in the same axes.
    residual : array of shape (N, T, 3) [m/s^2]
        What Hill's equations leave out along its paths, in the same axes.
    delta_v : array of shape (N,) [m/s]
        Of what is commanded, impulses included.
    planned_delta_v : array of shape (N,) [m/s]
        Of the plan.
    exceeded : array of bool of shape (N,)
        Who is commanded more than it can give; False where no limit was given.
    impulses : Retargeted
        Those of craft that have some.
    path : Path
        What is flown (N,): the plan, and of craft with impulses, or without engines, what these fly in the
        field, through samples; `screen` certifies it.
    deviation : array of shape (N,) [m]
        How far that is from the plan at most, at these samples.
    firing : ThrusterFiring or None
        The pulses of thrusters; then `path` is what these fly, and its `deviation_bound` holds in Hill's
        equations: in a field it grows by as small a share as the path's other acceleration is of thrust,
        and of impulses by what the field does between them.
    """

    _columns: ClassVar = {
        "craft": "craft",
        "time": "time_s",
        "commanded": "ux_m_s2 uy_m_s2 uz_m_s2",
        "residual": "dx_m_s2 dy_m_s2 dz_m_s2",
    }
    _told: ClassVar = ("field", "delta_v", "planned_delta_v", "peak_thrust", "deviation")

    field: str
    times: Floats
    commanded: Floats
    planned: Floats
    residual: Floats
    delta_v: Floats
    planned_delta_v: Floats
    exceeded: Any
    impulses: Retargeted
    path: Path
    deviation: Floats
    firing: ThrusterFiring | None

    @property
    def craft(self) -> Any:
        """Which craft each row of `columns` is of (N, T), by index, no unit."""
        return np.broadcast_to(np.arange(len(self.commanded))[:, None], self.commanded.shape[:2])

    @property
    def time(self) -> Any:
        """When each row of `columns` is (N, T) [s]."""
        return np.broadcast_to(self.times, self.commanded.shape[:2])

    @property
    def peak_thrust(self) -> Floats:
        """The most that each craft (N,) is commanded at these times [m/s^2]."""
        return np.asarray(np.linalg.norm(self.commanded, axis=2).max(axis=1))


def compensated_thrust(
    plan: Any,
    field: Field,
    every: float = 10.0,
    max_acceleration: float | None = None,
    thrusters: Thrusters | Sequence[Thrusters] | None = None,
    mass: ArrayLike | None = None,
    specific_impulse: ArrayLike | None = None,
    engine: ArrayLike = True,
) -> CompensatedThrust:
    """The thrust that flies planned paths in a field as they are, and with them all that is certified.

    Impulses are changed, for between them nothing is fired: they meet the plan's end, where small changes
    lead there, and keep its path as nearly as they can.

    Parameters
    ----------
    plan : Plan, Avoidance or Path
        Of one craft or of N, in the chief's Hill frame with straight axes, times since its epoch.
    field : Field
        In which they fly.
    every : float [s], default 10
        Between rows of the table, at most; each arc of thrust begins one.
    max_acceleration : float [m/s^2], optional
        What each craft can give.
    thrusters : Thrusters or sequence of Thrusters, optional
        Of all craft, or of each, which fire it as pulses: `fire` says how.
    mass : array_like of shape () or (N,) [kg], optional
        Of the craft at the start, as for `fire`.
    specific_impulse : array_like of shape () or (N,) [s], optional
        With `mass`.
    engine : array_like of bool of shape (N,) or (), default True
        Whether each craft has one; without it nothing is commanded, and it drifts.  Not with thrusters.

    Returns
    -------
    CompensatedThrust
        A table of what to command, and what it costs.

    Raises
    ------
    ValueError
        If the plan has no paths, is of deep space, its mean motion is not the chief's, or an argument is of
        another kind.

    Notes
    -----
    Flown exactly, and in exactly this field, the planned paths are met to rounding: d is what is left of the
    exact equations of relative motion, not an approximation of it.  Held over some seconds instead, or in
    a field that is known less well, a deviation remains (`validity` says how large without any of this).

    References
    ----------
    docs/theory.md (82).

    Examples
    --------
    >>> import closeform as cf
    >>> chief = cf.Chief.from_elements("2026-11-22T12:00:00", [6.878e6, 0.0, 1e-3, 0.0, 0.9, 0.0])
    >>> path = chief.orbit.transfer([0, 200, 0, 0, 0, 0], [0, 50, 0, 0, 0, 0], 3000.0)
    >>> table = cf.compensated_thrust(path, cf.Field(chief))
    >>> bool(table.delta_v[0] < 1.1 * table.planned_delta_v[0])
    True
    """
    paths = paths_to_fly(plan, field)
    step = checked("every", number("every", every), positive=True)
    limit = np.inf
    if max_acceleration is not None:
        limit = checked("max_acceleration", number("max_acceleration", max_acceleration), positive=True)
    start, end = float(paths.start[0]), float(paths.end[0])
    times = np.linspace(start, end, int(np.ceil((end - start) / step)) + 1)
    planned = paths.thrust(times)
    frame = ChiefFrame.of(field, times)
    left_out = residuals(field, frame, paths.state(times), paths.orbit.mean_motion)
    impulses, path, deviation = changed_impulses(paths, field)
    fires = np.isin(np.arange(len(paths)), impulses.craft)
    own = () if thrusters is None else each_set(thrusters, len(paths), Thrusters)
    running = running_engines(engine, paths, field, own)
    commanded = planned - left_out * (running & ~fires)[:, None, None]
    if len(adrift := np.flatnonzero(~running)):
        drift = drifting(paths[adrift], field._of(adrift))
        off = drift.position(times) - paths[adrift].position(times)
        deviation[adrift] = np.linalg.norm(off, axis=2).max(axis=1)
        each = dict(zip(adrift.tolist(), (drift[j] for j in range(len(adrift))), strict=True))
        path = stack([each.get(k, path[k]) for k in range(len(paths))])
    size = np.linalg.norm(commanded, axis=2)
    more = np.trapezoid(size - np.linalg.norm(planned, axis=2), times, axis=1)  # errors cancel
    kicks = np.linalg.norm(impulses.impulse, axis=1) - np.linalg.norm(impulses.planned, axis=1)
    before = np.array(paths.delta_v)
    spent = before + more + np.bincount(impulses.craft, kicks, len(paths))
    told = described(field), times, commanded, planned, left_out, spent, before, size.max(axis=1) > limit
    if thrusters is None:
        if mass is not None or specific_impulse is not None:
            raise ValueError("mass: is of thrusters that burn; give them, too")
        return CompensatedThrust(*told, impulses, path, deviation, None)
    from closeform.dynamics.pulsed_flight import fired_in, flown_exactly  # whose kernels only thrusters need

    firing = fired_in(paths, impulses, field, own, mass, specific_impulse)
    when, states = flown_exactly(paths, firing, own, field)
    path = paths.orbit._through(when, states)
    off = states[..., :3] - spanning(paths, when).position(when)
    told = *told[:-3], np.asarray(firing.delta_v), *told[-2:]
    return CompensatedThrust(*told, impulses, path, np.linalg.norm(off, axis=2).max(axis=1), firing)
