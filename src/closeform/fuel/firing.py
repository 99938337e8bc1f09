"""A plan realised by on-off thrusters: pulses, deviation from the plan, and conflicts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import of_each, sequence, shown
from closeform.conflicts.all_pairs import screen
from closeform.conflicts.two_paths import PairConflict
from closeform.fuel.falling_mass import STANDARD_GRAVITY
from closeform.fuel.order import order_of
from closeform.fuel.pulses import Pulses, extended, one_table
from closeform.fuel.thrusters import Thrusters, each_set
from closeform.motion.arc import START
from closeform.motion.elements.mean_motion import checked
from closeform.motion.joining import stack
from closeform.motion.path import Path
from closeform.result import Result
from closeform.zones.combined_zones import OwnZone
from closeform.zones.pair_zones import PairZones, pair_zones

LOOKS = 8  # instants of each arc at which the pulsed path is compared with the plan


@dataclass(frozen=True, eq=False, repr=False)
class ThrusterFiring(Result):
    """A plan as the thrusters of its spacecraft realise it.

    Values per spacecraft are floats for the path of one spacecraft, else arrays of shape (N,).

    Attributes
    ----------
    path : Path
        Path under the pulses, of the plan's shape.
    planned : Path
        The plan over the same time, with coasts where `path` begins before it or ends after it.
    thrusters : tuple of Thrusters
        Thrusters of each spacecraft.
    pulses : Pulses
        Pulses that are fired.
    dropped : Pulses
        Parts of the plan below the minimum impulse bit, which are not fired, with their times in the plan.
    deviation : float or array of shape (N,) [m]
        Largest distance of `path` from `planned`, at 8 instants of each of its arcs.
    deviation_bound : float or array of shape (N,) [m]
        Bound on the deviation without a simulation, which includes the falling mass and dropped parts.
    dropped_deviation : float or array of shape (N,) [m]
        Bound on the deviation due to dropped parts alone.
    delta_v : float or array of shape (N,) [m/s]
        Sum of the thrusters' delta-v.
    propellant : float or array of shape (N,) [kg]
        Propellant used; nan without a mass.
    conflicts : tuple of PairConflict or None
        Conflicts of `path` in the given zones, by index, N + k for obstacle k; None without zones.
    """

    path: Path
    planned: Path
    thrusters: tuple[Thrusters, ...]
    pulses: Pulses
    dropped: Pulses
    deviation: Any
    deviation_bound: Any
    dropped_deviation: Any
    delta_v: Any
    propellant: Any
    conflicts: tuple[PairConflict, ...] | None

    @property
    def clear(self) -> bool:
        """True if zones were given, and the pulsed path is certified clear of them."""
        return self.conflicts == ()

    @property
    def burns(self) -> dict[str, Any]:
        """Burn list as columns (K,): craft, thruster, start and duration [s], R, T and N [m/s], kg."""
        given = self.pulses.direction * self.pulses.impulse[:, None]
        return {
            "craft": self.pulses.craft,
            "thruster": self.pulses.thruster,
            "start_s": self.pulses.start,
            "duration_s": self.pulses.duration,
            "radial_m_s": given[:, 0],
            "along_track_m_s": given[:, 1],
            "cross_track_m_s": given[:, 2],
            "propellant_kg": self.pulses.propellant,
        }


def fire_thrusters(
    plan: Any,
    thrusters: Thrusters | Sequence[Thrusters],
    mass: ArrayLike | None = None,
    specific_impulse: ArrayLike | None = None,
    zone: OwnZone | Sequence[OwnZone | None] | PairZones | None = None,
    obstacles: Path | Sequence[Path] = (),
) -> ThrusterFiring:
    """Return the pulses that realise a plan with thrusters, and the resulting path.

    Continuous thrust is cut into chunks, for each thruster one in each of its periods, or in as many as its
    minimum impulse bit requires; each chunk is fired as one pulse about its centroid.  An impulse becomes a
    burn about its time: one at an end of the plan begins before it, or ends after it.

    Parameters
    ----------
    plan : Path or Plan
        The plan to realise: the path of one spacecraft, a batch of shape (N,), or a plan with paths.  A plan
        of one spacecraft is treated as its path.
    thrusters : Thrusters or sequence of Thrusters
        Thrusters with acceleration, and with a period for continuous thrust; one set for all spacecraft, or
        one for each.
    mass : array_like of shape () or (N,) [kg], optional
        Mass of the spacecraft at the start, for which the acceleration holds; it falls as propellant is used.
    specific_impulse : array_like of shape () or (N,) [s], optional
        Exhaust speed divided by 9.80665 m/s^2; required with `mass`.
    zone : Zone, CovarianceZone, Body, sequence of those or None, or PairZones, optional
        Zones that the pulsed path must avoid: as in `reconfigure`, or for the path of one spacecraft as in
        `avoid`, with one for each obstacle.
    obstacles : Path or sequence of Path, optional
        Paths that are fixed.

    Returns
    -------
    ThrusterFiring
        Pulses, the resulting path, and a bound on its deviation from the plan.

    Raises
    ------
    ValueError
        If the plan has no path, requires more than the thrusters give, a direction in which none
        pushes, or less than their minimum impulse bit in all; a period is longer than the plan;
        acceleration, period, mass or specific impulse are missing or not positive; or zones do not
        fit.

    References
    ----------
    docs/theory.md section 7.
    """
    path = planned_path(plan)
    count = len(path.offsets) - 1
    crafts = [path[k] for k in range(count)] if path.shape else [path]
    orders = []
    for k, (one, own, tank) in enumerate(
        zip(crafts, each_set(thrusters, count, Thrusters), _tanks(mass, specific_impulse, count), strict=True)
    ):
        try:
            orders.append(order_of(k, one, own, *tank))
        except ValueError as error:
            name, _, words = str(error).partition(": ")
            raise type(error)(f"{name}: craft {k}: {words}" if path.shape else str(error)) from None
    begun, over = min(order.span[0] for order in orders), max(order.span[1] for order in orders)
    planned = [extended(one, begun, over) for one in crafts]
    real = [order.path(one) for order, one in zip(orders, planned, strict=True)]
    values = [
        (
            largest_distance(one, plan_path),
            *order.bounds(plan_path),
            order.pulses.impulse.sum(),
            order.pulses.propellant.sum() if len(order.pulses) else 0.0 if mass is not None else np.nan,
        )
        for order, one, plan_path in zip(orders, real, planned, strict=True)
    ]
    columns: Any = np.array(values).T
    deviation, limit, lost, spent, burned = columns if path.shape else columns[:, 0].tolist()
    fired = stack(real) if path.shape else real[0]
    return ThrusterFiring(
        fired,
        stack(planned) if path.shape else planned[0],
        tuple(order.thrusters for order in orders),
        one_table([order.pulses for order in orders]),
        one_table([order.dropped for order in orders]),
        deviation,
        limit,
        lost,
        spent,
        burned,
        _conflicts(fired, zone, obstacles),
    )


def planned_path(plan: Any) -> Path:
    """Return the path of a plan, single or of shape (N,); raise ValueError if there is none."""
    path = plan if isinstance(plan, Path) else getattr(plan, "paths", plan)
    if path is None and plan is not None:
        raise ValueError(f"plan: has no path: {plan.reason}")
    if not isinstance(path, Path):
        raise ValueError(f"plan: expected a Path or a Plan, got {shown(plan)}")
    if path is not plan and len(path) == 1:
        return path[0]
    if len(path.shape) > 1 or path.shape == (0,):
        raise ValueError(f"plan: expected one spacecraft or a batch of shape (N,), got shape {path.shape}")
    return path


def _tanks(
    mass: ArrayLike | None, specific_impulse: ArrayLike | None, count: int
) -> list[tuple[float, float]]:
    """Return mass [kg] and exhaust speed [m/s] of each spacecraft; nan where none are given."""
    given = {"mass": mass, "specific_impulse": specific_impulse}
    have = {name: value for name, value in given.items() if value is not None}
    if not have:
        return [(np.nan, np.nan)] * count
    if missing := given.keys() - have.keys():
        raise ValueError(f"{missing.pop()}: required with {next(iter(have))}; give both or neither")
    columns = []
    for name, value in have.items():
        columns.append(of_each(name, checked(name, value, positive=True), count).tolist())
    return [(kilograms, STANDARD_GRAVITY * seconds) for kilograms, seconds in zip(*columns, strict=True)]


def largest_distance(path: Path, other: Path) -> float:
    """Return the largest distance [m] of two paths of one time span, at some instants of each arc."""
    edges = np.unique(np.concatenate([path.arcs[:, START], other.arcs[:, START], [path.end]]))
    times = (edges[:-1, None] + np.diff(edges)[:, None] * np.linspace(0.0, 1.0, LOOKS)).ravel()
    times = np.clip(times, edges[0], edges[-1])
    return float(np.linalg.norm(path.position(times) - other.position(times), axis=1).max())


def _conflicts(
    path: Path, zone: OwnZone | Sequence[OwnZone | None] | PairZones | None, obstacles: Path | Sequence[Path]
) -> tuple[PairConflict, ...] | None:
    """Return the conflicts of the spacecraft with each other and with obstacles; None without a zone."""
    given = [obstacles] if isinstance(obstacles, Path) else sequence("obstacles", obstacles, Path)
    own, others = crafts_of([path]), crafts_of(given)
    if zone is None:
        if others:
            raise ValueError("zone: required with obstacles; give the zone to keep clear")
        return None
    if not path.shape and isinstance(zone, Sequence) and len(zone) == len(others):
        zone = [None, *zone]
    zones = pair_zones("zone", zone, len(own), len(others))
    return screen(stack([*own, *others]), zones).conflicts


def crafts_of(paths: Sequence[Path]) -> list[Path]:
    """Return single spacecraft from paths and batches."""
    every = [[path[k] for k in np.ndindex(path.shape)] if path.shape else [path] for path in paths]
    return [craft for batch in every for craft in batch]
