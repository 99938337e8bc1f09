"""Validated inputs of a reconfiguration: spacecraft, slots, times, zones, obstacles and limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import LARGEST, Floats, finite, numbers, of_each, sequence
from closeform.fuel.bound import least_delta_v
from closeform.fuel.thrusters import Thrusters, each_set
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path
from closeform.planning.impulse_alone import costs_alone
from closeform.planning.obstacles import obstacle_batch, obstacle_names
from closeform.planning.plan import Cost
from closeform.planning.problem import Problem
from closeform.zones.combined_zones import OwnZone
from closeform.zones.padding import Padding
from closeform.zones.pair_zones import PairZones, pair_zones
from closeform.zones.zone import Zone

if TYPE_CHECKING:
    from closeform.planning.sigma_problem import Margin


@dataclass(frozen=True, eq=False)
class Request:
    """Validated inputs of `reconfigure` for N spacecraft.

    `initial` (N, 6) are the states at `starts` (N,).  Each spacecraft reaches its slot after its entry of
    `durations` (N,).  `places` (S, 6) are the states of all slots, and `slots` (N,) are the indices of the
    assigned ones.  A spacecraft arrives `early` (N,) [s] before the slot's epoch and coasts into the slot.
    `zones` are the groups of `PairZones.groups`.  With `assign`, the slots are those of minimum `cost`.
    `thrusters` holds one set for each spacecraft, or None where thrust can point in any direction.
    """

    orbit: Orbit
    initial: Floats
    places: Floats
    slots: Any
    early: Floats
    starts: Floats
    durations: Floats
    zones: tuple[tuple[Zone, Any], ...]
    others: Path | None
    limits: Floats | None
    names: tuple[str, ...]
    assign: bool
    cost: Cost
    thrusters: tuple[Thrusters | None, ...]
    drift: float | None = None
    kept: Margin | None = None
    padding: Padding | None = None

    @classmethod
    def of(
        cls,
        orbit: Orbit,
        initial: ArrayLike,
        final: ArrayLike,
        duration: ArrayLike,
        zone: OwnZone | Sequence[OwnZone | None] | PairZones,
        assign: bool,
        start: ArrayLike,
        obstacles: Path | Sequence[Path],
        max_acceleration: ArrayLike | None,
        names: Sequence[str] | None,
        cost: Cost = "energy",
        thrusters: Thrusters | Sequence[Thrusters | None] | None = None,
        drift: float | None = None,
    ) -> Request:
        """Return the request for the arguments of `reconfigure`; raise ValueError naming a bad argument."""
        begins, places = _states("initial", initial), _states("final", final)
        count = len(begins)
        if assign and len(places) < count:
            raise ValueError(
                f"final: {len(places)} slots are fewer than {count} craft; give at least one slot for each"
            )
        if not assign and len(places) != count:
            raise ValueError(
                f"final: {len(places)} states for {count} craft; give one for each, or pass assign=True if "
                "there are more states than craft"
            )
        others = obstacle_batch(orbit, obstacles)
        extra = len(others) if others is not None else 0
        called = (
            tuple(sequence("names", names, str))
            if names is not None
            else tuple(f"craft {k}" for k in range(count))
        )
        if len(called) not in (count, count + extra):
            raise ValueError(f"names: {len(called)} for {count} craft; give one for each")
        if len(called) == count:
            called += obstacle_names(None, extra)
        limits = (
            None
            if max_acceleration is None
            else _each("max_acceleration", max_acceleration, count, greatest=np.inf)
        )
        if limits is not None and (limits == np.inf).all():
            limits = None
        own = each_set(thrusters, count)
        for k, called_so in enumerate(called[:count]):
            if own[k] is not None and limits is not None and limits[k] < np.inf:
                raise ValueError(
                    f"max_acceleration: {called_so}: cannot be combined with thrusters, which have limits "
                    "of their own; omit it, or give inf for craft with thrusters"
                )
        return cls(
            orbit,
            begins,
            places,
            np.arange(count),
            np.zeros(count),
            _each("start", start, count, least=-LARGEST),
            _each("duration", duration, count),
            tuple(pair_zones("zone", zone, count, extra, called).groups()),
            others,
            limits,
            called,
            assign,
            cost,
            own,
            drift,
        ).cheapest()

    @property
    def direct(self) -> Path:
        """The unconstrained optima, each over the spacecraft's own time."""
        before = self.orbit.transition(-self.early)
        finals = (before @ self.places[self.slots][:, :, None])[..., 0]
        return self.orbit.transfer(self.initial, finals, self.durations, self.starts)

    @property
    def costs(self) -> Floats:
        """Minimum costs (N, S) of every spacecraft to every slot, without any keep-out zone."""
        finals = self.places @ self.orbit.transition(-self.early).transpose(0, 2, 1)
        if any(own is not None for own in self.thrusters):
            given = self.orbit, self.initial, finals, self.durations, self.starts
            return costs_alone(*given, self.thrusters, self.names)
        begins, durations = self.initial[:, None], self.durations[:, None]
        costs: Floats = (
            least_delta_v(self.orbit, begins, finals, durations).lower
            if self.cost == "delta-v"
            else self.orbit.transfer(begins, finals, durations).energy
        )
        return costs

    @property
    def longest(self) -> float:
        """Largest factor of all durations for which the obstacles remain known until the horizon ends."""
        if self.drift is None or self.others is None:
            return np.inf
        last = float(np.min(self.others.end)) - self.drift
        return float(((last - self.starts) / self.durations).min())

    def problem(self) -> Problem:
        """Return the planning problem of this request."""
        zones = self.zones if self.padding is None else self.padding.groups(self.zones)
        plain = Problem.of(self.direct, self.others, zones, self.drift)
        return plain if self.kept is None else self.kept.problem(plain)

    def least_slots(self) -> tuple[Any, float]:
        """Return the slots (N,) of minimum unconstrained cost, and that cost.

        Raises ValueError if the thrusters cannot bring every spacecraft to a slot of its own.
        """
        from scipy.optimize import linear_sum_assignment

        costs = self.costs
        try:
            craft, slots = linear_sum_assignment(costs)
        except ValueError:
            raise ValueError(
                "thrusters: they cannot bring every craft to a slot of its own; give other slots or thrusters"
            ) from None
        return slots, float(costs[craft, slots].sum())

    def cheapest(self) -> Request:
        """Return the request with the slots of minimum unconstrained cost, if they are to be assigned."""
        return replace(self, slots=self.least_slots()[0]) if self.assign else self

    def assigned(self, slots: Any) -> Request:
        """Return the request with other slots (N,)."""
        return replace(self, slots=slots)

    def longer(self, factor: float) -> Request:
        """Return the request with `factor` times the durations; the final states hold at the later ends."""
        return replace(self, durations=factor * self.durations).cheapest()

    def staggered(self, share: float) -> Request:
        """Return the request with staggered starts: the last waits for `share` of the longest duration.

        The spacecraft coast until they start.  The final states hold when the last has arrived, and the
        spacecraft that arrive before coast into them.
        """
        longest = share * self.durations.max()
        waits = np.linspace(0.0, longest, len(self.initial))
        initial = (self.orbit.transition(waits) @ self.initial[:, :, None])[..., 0]
        later = replace(self, initial=initial, early=longest - waits, starts=self.starts + waits)
        return later.cheapest()


def _states(name: str, value: ArrayLike) -> Floats:
    states = numbers(name, value)
    if states.ndim != 2 or states.shape[1] != 6 or not len(states):
        raise ValueError(f"{name}: expected shape (N, 6), one state for each craft, got {states.shape}")
    return finite(name, states)


def _each(name: str, value: ArrayLike, count: int, least: float = 0.0, greatest: float = LARGEST) -> Floats:
    """Return one number for each spacecraft, above `least` and at most `greatest`."""
    values = of_each(name, value, count)
    if not ((values > least) & (values <= greatest)).all():
        raise ValueError(f"{name}: must be finite{' and positive' * (least == 0.0)}, got {values.tolist()}")
    return values
