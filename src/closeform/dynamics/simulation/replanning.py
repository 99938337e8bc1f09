"""Replanning during a simulation: new plans around the zones, from the measured states."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from closeform.arrays import Floats
from closeform.dynamics.control.feedback import Feedback, Navigation
from closeform.dynamics.force_model.field import Field
from closeform.dynamics.force_model.hill_frame import ChiefFrame
from closeform.dynamics.infeasible import Infeasible
from closeform.dynamics.model_error import residuals
from closeform.dynamics.simulation.commands import Engines
from closeform.dynamics.simulation.guidance import Guidance
from closeform.dynamics.simulation.random_errors import ErrorSampler
from closeform.dynamics.simulation.thruster_pulses import divide_interval
from closeform.dynamics.simulation.time_grid import intervals_in
from closeform.fuel.thrusters import Thrusters
from closeform.motion.joining import stack
from closeform.motion.path import Path
from closeform.planning.reconfigure import reconfigure
from closeform.zones.made_table import NONE
from closeform.zones.pair_zones import PairZones, pairs_of
from closeform.zones.zone import Zone

SIGMAS = 4.0
SAMPLES = 201  # instants at which the model error along a plan is sampled
# factors on the margin, tried in this order: a spacecraft measured inside a margin has no plan
PADDED = (2.0, 1.0, 0.5)


@dataclass(frozen=True, eq=False)
class Replanner:
    """Planner of S simulations, which makes new plans with a `margin` [m] around the zones.

    `first` is the guidance of the plan. A feedback `law` keeps spacecraft on the last plan, and `instants`
    (M + 1,) [s] are the times of measurements, and the end.
    """

    first: Guidance
    zones: Zone | PairZones
    margin: float
    law: Feedback
    engines: Engines
    instants: Floats

    @classmethod
    def of(
        cls,
        paths: Path,
        believed: Field,
        thrusters: Sequence[Thrusters | None],
        zones: Zone | PairZones,
        law: Feedback,
        engines: Engines,
        sampler: ErrorSampler,
    ) -> Self:
        """Return the planner with the margin for the errors."""
        start, end = float(paths.start[0]), float(paths.end[0])
        instants = np.linspace(start, end, intervals_in(end - start, law.every) + 1)
        in_step = divide_interval(thrusters, float(instants[1] - instants[0]))
        first = Guidance.of(paths, believed, None, in_step)
        off = np.hypot(*sampler.sizes.T)
        if sampler.errors is not None:
            off += SIGMAS * np.array([np.hypot(one.magnitude, one.pointing) for one in sampler.errors])
        pushes = np.where(engines.running, off * paths.peak_thrust, _largest_model_error(paths, believed))
        margin = replanning_margin(sampler.navigation, law.every, pushes)
        if first.firing is not None:
            margin += float(np.sort(first.deviation)[-2:].sum())
        law = replace(law, every=float(instants[1] - instants[0]))
        return cls(first, zones, margin, law, engines, instants)

    def replan(self, states: Floats, begin: float) -> tuple[Guidance | None, list[str]]:
        """Return the guidance of a plan from measured states (N, 6), and why plans were refused."""
        first, why = self.first, list[str]()
        end, orbit = float(self.instants[-1]), first.paths.orbit
        moving, rest = (np.flatnonzero(some) for some in (self.engines.running, ~self.engines.running))
        limits = self.engines.limits[moving]
        coasting = orbit.coast(states[rest], end - begin, begin)
        order = np.concatenate([moving, rest])
        zones = self.zones
        if isinstance(zones, PairZones) and len(rest):
            zones = _reordered(zones, order, len(moving))
        for share in PADDED:
            plan = reconfigure(
                orbit,
                states[moving],
                first.paths.state(end)[moving],
                end - begin,
                zones,
                start=begin,
                obstacles=coasting,
                max_acceleration=limits if np.isfinite(limits).all() else None,
                if_blocked=("more sides",),
                margin=share * self.margin,
            )
            try:
                if plan.ok and plan.paths is not None:
                    each = [part[k] for part in (plan.paths, coasting) for k in range(len(part))]
                    paths = stack([each[k] for k in np.argsort(order)])
                    return Guidance.of(paths, first.believed, None, first.thrusters), why
                why.append(f"{share:g} of the margin: {plan.reason}")
            except Infeasible as error:
                why.append(f"{share:g} of the margin: {error}")
        return None, why


def _largest_model_error(paths: Path, field: Field) -> Floats:
    """Return the largest model error along paths (N,) [m/s^2], for spacecraft that do not compensate it."""
    times = np.linspace(float(paths.start[0]), float(paths.end[0]), SAMPLES)
    left_out = residuals(field, ChiefFrame.of(field, times), paths.state(times), paths.orbit.mean_motion)
    return np.asarray(np.linalg.norm(left_out, axis=-1).max(axis=1))


def _reordered(zones: PairZones, order: Any, moving: int) -> PairZones:
    """Return the zones of the same bodies in another order, the first `moving` of which move."""
    count, found = len(zones), list[Zone]()
    table = np.full((count + 1, count + 1), NONE)
    for one, other in zip(*(k.tolist() for k in next(pairs_of(count))), strict=True):
        if (zone := zones.between(order[one], order[other])) is not None:
            table[one, other] = len(found)
            found.append(zone)
    return PairZones(tuple(found), np.arange(count), table, np.arange(count) < moving)


def replanning_margin(sight: Navigation, every: float, pushes: Floats) -> float:
    """Return the margin [m] for two spacecraft between measurements `every` [s] apart.

    It covers 4 sigmas of noise, all constant errors, and unplanned accelerations `pushes` (N,) [m/s^2].
    """
    noise = SIGMAS * np.sqrt(2.0) * np.hypot(sight.position, every * sight.velocity)
    constant = 2.0 * (sight.position_bias + every * sight.velocity_bias)
    return float(noise + constant + np.sort(pushes)[-2:].sum() * every**2 / 2.0)
