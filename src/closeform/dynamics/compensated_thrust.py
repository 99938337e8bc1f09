"""Thrust that follows a planned path in the high-fidelity model: the plan's thrust minus the residual."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, number
from closeform.dynamics.force_model.field import Field, described
from closeform.dynamics.model_error import path_residuals
from closeform.dynamics.planned_paths import checked_paths, running_engines
from closeform.dynamics.simulation.commands import ThrusterStages
from closeform.dynamics.simulation.guidance import Guidance
from closeform.dynamics.simulation.impulse_retargeting import Retargeted
from closeform.fuel.thrusters import Thrusters, each_set
from closeform.motion.elements.mean_motion import checked
from closeform.motion.joining import stack
from closeform.motion.path import Path
from closeform.result import Rows

if TYPE_CHECKING:
    from closeform.fuel.firing import ThrusterFiring


@dataclass(frozen=True, eq=False, repr=False)
class CompensatedThrust(Rows):
    """Thrust that follows the paths of N spacecraft in a field; returned by `compensated_thrust`.

    Attributes
    ----------
    field : str
        Description of the force model in which the paths are followed.
    times : array of shape (T,) [s]
        Times since the chief's epoch.
    commanded : array of shape (N, T, 3) [m/s^2]
        Radial, along-track and cross-track thrust, in the chief's axes: planned minus residual; as planned
        for spacecraft with impulses.
    planned : array of shape (N, T, 3) [m/s^2]
        The thrust of the plan, in the same axes.
    residual : array of shape (N, T, 3) [m/s^2]
        Model error of Hill's equations along the paths, in the same axes.
    delta_v : array of shape (N,) [m/s]
        Delta-v of the commanded thrust, impulses included.
    planned_delta_v : array of shape (N,) [m/s]
        Delta-v of the plan.
    exceeded : array of bool of shape (N,)
        True for spacecraft whose command exceeds the thrust limit; False without a limit.
    impulses : Retargeted
        Impulses of spacecraft that have any, changed for the field.
    path : Path
        Followed paths (N,): the plan, and for spacecraft with impulses or without engines the path in the
        field, interpolated between samples; `screen` certifies it.
    deviation : array of shape (N,) [m]
        Largest distance from the plan, at these samples.
    firing : ThrusterFiring or None
        Pulses of thrusters; then `path` is the path that they produce, and `deviation_bound` holds in Hill's
        equations. In a field it grows by the ratio of the residual to the thrust, and for impulses by the
        effect of the residual between them.
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
        """Index of the spacecraft of each row of `columns` (N, T), no unit."""
        return np.broadcast_to(np.arange(len(self.commanded))[:, None], self.commanded.shape[:2])

    @property
    def time(self) -> Any:
        """Time of each row of `columns` (N, T) [s]."""
        return np.broadcast_to(self.times, self.commanded.shape[:2])

    @property
    def peak_thrust(self) -> Floats:
        """Largest command of each spacecraft (N,) at these times [m/s^2]."""
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
    """Compute the thrust that follows planned paths in a field, so that their certification holds there.

    Impulses are changed instead, because no thrust acts between them. They meet the plan's end, if small
    changes can, and keep its path as closely as possible.

    Parameters
    ----------
    plan : Plan or Path
        Plan of one spacecraft or of N, in the chief's Hill frame with straight axes, times since its epoch.
    field : Field
        Force model in which they move.
    every : float [s], default 10
        Largest time between rows of the table.
    max_acceleration : float [m/s^2], optional
        Thrust limit of each spacecraft.
    thrusters : Thrusters or sequence of Thrusters, optional
        Thrusters of all spacecraft, or of each, which fire it as pulses; see `fire_thrusters`.
    mass : array_like of shape () or (N,) [kg], optional
        Mass of the spacecraft at the start, as for `fire_thrusters`.
    specific_impulse : array_like of shape () or (N,) [s], optional
        Specific impulse, required with `mass`.
    engine : array_like of bool of shape (N,) or (), default True
        Whether each spacecraft has an engine; without it the spacecraft drifts. Cannot be combined with
        thrusters.

    Returns
    -------
    CompensatedThrust
        Table of commands and their cost.

    Raises
    ------
    ValueError
        If the plan has no paths, is in deep space, has another mean motion than the chief, or an argument
        has the wrong type.

    Notes
    -----
    If it is executed exactly and in exactly this field, the command follows the planned paths up to rounding,
    because the residual is that of the exact equations of relative motion. A command held for a few seconds,
    or an inexact field, leaves a deviation (`validity` predicts it for the plan's thrust alone).

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
    paths = checked_paths(plan, field)
    step = checked("every", number("every", every), positive=True)
    limit = np.inf
    if max_acceleration is not None:
        limit = checked("max_acceleration", number("max_acceleration", max_acceleration), positive=True)
    start, end = float(paths.start[0]), float(paths.end[0])
    times = np.linspace(start, end, int(np.ceil((end - start) / step)) + 1)
    planned = paths.thrust(times)
    left_out = path_residuals(field, paths, times)
    own = list[ThrusterStages | None]()
    if thrusters is not None:
        own = ThrusterStages.of_each(each_set(thrusters, len(paths), Thrusters), paths)
    running = running_engines(engine, paths, field, own)
    if thrusters is None and (mass is not None or specific_impulse is not None):
        raise ValueError("mass: requires thrusters; give them, or omit mass")
    guidance = Guidance.of(paths, field, None, own, mass=mass, specific_impulse=specific_impulse)
    impulses, before = guidance.impulses, np.array(paths.delta_v)
    fires = np.isin(np.arange(len(paths)), impulses.craft)
    commanded = planned - left_out * (running & ~fires)[:, None, None]
    path, deviation = guidance.reference, guidance.deviation
    if len(adrift := np.flatnonzero(~running)):
        drift = field._of(adrift)._drift(paths[adrift])
        off = drift.position(times) - paths[adrift].position(times)
        deviation[adrift] = np.linalg.norm(off, axis=2).max(axis=1)
        each = dict(zip(adrift.tolist(), (drift[j] for j in range(len(adrift))), strict=True))
        path = stack([each.get(k, path[k]) for k in range(len(paths))])
    size = np.linalg.norm(commanded, axis=2)
    if guidance.firing is not None:
        spent = np.asarray(guidance.firing.delta_v)
    else:
        more = np.trapezoid(size - np.linalg.norm(planned, axis=2), times, axis=1)  # errors cancel
        kicks = np.linalg.norm(impulses.impulse, axis=1) - np.linalg.norm(impulses.planned, axis=1)
        spent = before + more + np.bincount(impulses.craft, kicks, len(paths))
    table = described(field), times, commanded, planned, left_out, spent, before, size.max(axis=1) > limit
    return CompensatedThrust(*table, impulses, path, deviation, guidance.firing)
