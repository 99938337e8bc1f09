"""Validated inputs of the planner: spacecraft, slots, times, zones, obstacles, limits and options."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import (
    LARGEST,
    Floats,
    finite,
    instance,
    number,
    numbers,
    of_each,
    sequence,
    shown,
    size,
    whole,
)
from closeform.fuel.bound import least_delta_v
from closeform.fuel.thrusters import Thrusters, each_set
from closeform.motion.chief_orbit import ChiefOrbit
from closeform.motion.joining import stack
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path, ends_of
from closeform.planning.bounds.branch_and_bound import GAP
from closeform.planning.delta_v.unconstrained import costs_alone
from closeform.planning.obstacles import obstacle_batch, obstacle_names, zones_around
from closeform.planning.plan import Cost
from closeform.planning.problem.problem import Problem, transfer_of
from closeform.planning.requirements.requirement import Requirement, StateRequirement
from closeform.uncertainty.errors import one_for_each
from closeform.zones.combined_zones import CovarianceZone, OwnZone
from closeform.zones.padding import Padding
from closeform.zones.pair_zones import TWICE, PairZones, counts_covariances, pair_zones
from closeform.zones.zone import Zone

if TYPE_CHECKING:
    from closeform.planning.sigmas.sigma_problem import Margin

Method = Literal["joint", "sequential", "distributed", "exact", "sauter-palmer"]
Fallback = Literal["more sides", "longer", "stagger"]
FALLBACKS: tuple[Fallback, ...] = ("more sides", "longer", "stagger")
ROUNDING = 1e-9  # of a duration
SAMPLED = 32  # states at which requirements are compared with their planes


@dataclass(frozen=True, eq=False, kw_only=True)
class Request:
    """Validated inputs of a plan of N spacecraft.

    `initial` (N, 6) are the states at `starts` (N,).  Each spacecraft reaches its slot after its entry of
    `durations` (N,).  `places` (S, 6) are the states of all slots, and `slots` (N,) are the indices of the
    assigned ones.  A spacecraft arrives `early` (N,) [s] before the slot's epoch and coasts into the slot.
    `zones` are the groups of `PairZones.groups`.  With `assign`, the slots are those of minimum `cost`.
    `thrusters` holds one set for each spacecraft, or None where thrust can point in any direction.

    The request of one spacecraft may hold a `given` path, which is kept if it is clear; `path_over` returns
    the path over a multiple of its duration.
    """

    orbit: Orbit
    initial: Floats
    places: Floats
    slots: Any
    early: Floats
    starts: Floats
    durations: Floats
    zones: tuple[tuple[Zone, Any], ...]
    obstacles: Path | None
    names: tuple[str, ...]
    cost: Cost = "energy"
    thrusters: tuple[Thrusters | None, ...]
    assign: bool = False
    method: Method = "joint"
    order: tuple[int, ...] | None = None
    given: Path | None = None
    path_over: Callable[[float], Path] | None = None
    limits: Floats | None = None  # (N,) [m/s^2] of the thrust acceleration
    stretches: bool = True  # durations, where a limit is exceeded
    if_blocked: tuple[Fallback, ...] = ()
    budget: int | None = None
    proof_time: float = 0.0  # [s] of branch and bound
    gap: float = GAP
    drift: float | None = None  # [s] of free drift that stays clear after a loss of thrust
    errors: Margin | None = None
    padding: Padding | None = None
    requirements: tuple[tuple[Requirement, ...], ...] = ()  # of each spacecraft

    @classmethod
    def of_formation(
        cls,
        orbit: Orbit,
        initial: ArrayLike,
        final: ArrayLike,
        duration: ArrayLike,
        zone: OwnZone | Sequence[OwnZone | None] | PairZones,
        *,
        assign: bool = False,
        start: ArrayLike = 0.0,
        obstacles: Path | Sequence[Path] = (),
        if_blocked: Sequence[Fallback] = FALLBACKS,
        method: Method = "joint",
        order: Sequence[int] | None = None,
        names: Sequence[str] | None = None,
        thrusters: Thrusters | Sequence[Thrusters | None] | None = None,
        **options: Any,
    ) -> Request:
        """Return the request for the arguments of `reconfigure`; raise ValueError naming a bad argument."""
        instance("assign", assign, bool, np.bool_)
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
        batch = obstacle_batch(check_orbit(orbit, method, thrusters), obstacles)
        extra = 0 if batch is None else len(batch)
        called = _names(names, count, batch)
        if unknown := [word for word in sequence("if_blocked", if_blocked, str) if word not in FALLBACKS]:
            raise ValueError(f"if_blocked: must be {', '.join(map(repr, FALLBACKS))}, got {unknown[0]!r}")
        if order is not None:
            order = sequence("order", order, int, np.integer)
            if method == "joint" or sorted(order) != list(range(count)):
                raise ValueError(
                    "order: requires method 'sequential' or 'distributed' and each of "
                    f"0 to {count - 1} once, got {order}"
                )
        return cls._of(
            method,
            ("joint", "sequential", "distributed"),
            zone,
            thrusters,
            **options,
            orbit=orbit,
            initial=begins,
            places=places,
            slots=np.arange(count),
            early=np.zeros(count),
            starts=_each("start", start, count, least=-LARGEST),
            durations=_each("duration", duration, count),
            zones=tuple(pair_zones("zone", zone, count, extra, called).groups()),
            obstacles=batch,
            names=called,
            assign=assign,
            order=None if order is None else tuple(order),
            stretches="longer" in if_blocked,
            if_blocked=tuple(if_blocked),
        )

    @classmethod
    def of_path(
        cls,
        path: Path,
        obstacles: Path | Sequence[Path],
        zone: OwnZone | Sequence[OwnZone] | PairZones,
        method: Method = "exact",
        *,
        path_over: Callable[[float], Path] | None = None,
        longer: bool = True,
        name: str = "path",
        names: Sequence[str] | None = None,
        thrusters: Thrusters | None = None,
        errors: Any = None,
        other_errors: Any = None,
        **options: Any,
    ) -> Request:
        """Return the request for the arguments of `avoid`; raise ValueError naming a bad argument.

        `name` is that of the spacecraft, and `path_over` returns its path over a multiple of its duration.
        """
        instance("longer", longer, bool, np.bool_)
        batch = obstacle_batch(check_orbit(path.orbit, method, thrusters), obstacles)
        if batch is None:
            raise ValueError("obstacles: give at least one path")
        if errors is not None or other_errors is not None:
            errors = [errors, *one_for_each("other_errors", other_errors, len(batch))]
        return cls._of(
            method,
            ("exact", "sauter-palmer"),
            zone,
            thrusters,
            **options,
            errors=errors,
            orbit=path.orbit,
            slots=np.zeros(1, dtype=np.int64),
            early=np.zeros(1),
            starts=np.array([float(path.start)]),
            zones=zones_around(zone, len(batch)),
            obstacles=batch,
            names=(name, *obstacle_names(names, batch)),
            stretches=longer,
            path_over=path_over or (lambda factor: transfer_of(path, factor)),
            **_ends(path),
        )

    @classmethod
    def _of(
        cls,
        method: Method,
        known: tuple[Method, ...],
        zone: Any,
        thrusters: Any,
        *,
        max_acceleration: ArrayLike | None = None,
        cost: Cost = "energy",
        drift: float | None = None,
        errors: Any = None,
        sigmas: float = 3.0,
        margin: Any = 0.0,
        requirements: Any = (),
        budget: int | None = None,
        prove: float = 0.0,
        gap: float = GAP,
        **fields: Any,
    ) -> Request:
        """Return the request of `fields` and of the options that `avoid` and `reconfigure` share.

        `known` are the methods: first the usual one, which supports all other options.
        """
        options = _options(method, known, cost, thrusters, drift, errors, zone, budget, prove, gap)
        count, many = len(fields["initial"]), size("sigmas", sigmas)
        extra = 0 if fields["obstacles"] is None else len(fields["obstacles"])
        limits, own = None, each_set(thrusters, count)
        if max_acceleration is not None:
            limits = _each("max_acceleration", max_acceleration, count, greatest=np.inf)
            for k in np.flatnonzero(limits < np.inf):
                if own[k] is not None:
                    raise ValueError(
                        f"max_acceleration: {fields['names'][k]} has thrusters, whose limits are their own; "
                        "omit it, or give inf for craft with thrusters"
                    )
        if errors is not None:
            from closeform.planning.sigmas.sigma_problem import Margin

            options["errors"] = Margin.among(count, extra, errors, many)
        request = cls(
            thrusters=own,
            limits=None if limits is None or (limits == np.inf).all() else limits,
            padding=Padding.of(margin, count, extra),
            requirements=_requirements(requirements, count),
            **options,
            **fields,
        )
        return request.cheapest()._checked()

    def _checked(self) -> Request:
        """Return the request; raise ValueError for requirements that are not convex or not supported.

        The same applies to an obstacle that ends before the drift.
        """
        if self.requirements and self.cost == "energy":
            if isinstance(self.orbit, ChiefOrbit):
                raise ValueError(
                    "requirements: at minimum energy they are planned about a circular orbit only, not about "
                    f"{self.orbit.chief}; set cost 'delta-v'"
                )
            for one in (one for own in self.requirements for one in own):
                if not isinstance(one, StateRequirement):
                    kind = type(one).__name__
                    raise ValueError(
                        f"requirements: at minimum energy a spacecraft always thrusts, which {kind} may not "
                        "allow; set cost 'delta-v', or omit this requirement"
                    )
            if self.method not in ("joint", "exact"):
                raise ValueError("method: cannot be combined with requirements; omit it")
        for i, own in enumerate(self.requirements):
            for one in own:
                if isinstance(one, StateRequirement):
                    one._refuse_unless_concave(self._states_near(i))
        if self.drift is None or self.obstacles is None:
            return self
        until = self.arrival + self.drift
        if len(short := np.flatnonzero(self.obstacles.end < until)):
            name, end = self.names[len(self.initial) + short[0]], self.obstacles.end[short[0]]
            raise ValueError(
                f"obstacles: {name} ends at {end:.6g} s, the drift at {until:.6g} s; extend the obstacle's "
                "path, or reduce drift"
            )
        return self

    def _states_near(self, i: int) -> Floats:
        """Return random states (SAMPLED, 6) about the ends of craft i, and between them."""
        rng, begin, end = np.random.default_rng(i), self.initial[i], self.places[min(i, len(self.places) - 1)]
        size = max(float(np.linalg.norm(end[:3] - begin[:3])), 1.0)
        spread = np.repeat([size, size / self.durations[i]], 3)
        shares = rng.uniform(size=(SAMPLED, 1))
        states: Floats = begin + shares * (end - begin) + spread * rng.normal(size=(SAMPLED, 6))
        return states

    @property
    def arrival(self) -> float:
        """Time of the last arrival [s]."""
        return float((self.starts + self.durations).max())

    @property
    def direct(self) -> Path:
        """The unconstrained optima, each over the spacecraft's own time."""
        if self.given is not None:
            return stack([transfer_of(self.given)])
        finals = (self._before_slots @ self.places[self.slots][:, :, None])[..., 0]
        return self.orbit.transfer(self.initial, finals, self.durations, self.starts)

    @property
    def costs(self) -> Floats:
        """Minimum costs (N, S) of every spacecraft to every slot, without any keep-out zone."""
        finals = self.places @ self._before_slots.transpose(0, 2, 1)
        if any(own is not None for own in self.thrusters):
            given = self.orbit, self.initial, finals, self.durations, self.starts
            return costs_alone(*given, self.thrusters, self.names)
        begins, durations = self.initial[:, None], self.durations[:, None]
        costs: Floats = (
            least_delta_v(self.orbit, begins, finals, durations, start=self.starts[:, None]).lower
            if self.cost == "delta-v"
            else self.orbit.transfer(begins, finals, durations, self.starts[:, None]).energy
        )
        return costs

    @property
    def _before_slots(self) -> Floats:
        """Matrices (N, 6, 6) from the states at the slots' epoch to those on arrival."""
        return self.orbit.transition(-self.early, self.starts + self.durations + self.early)

    @property
    def longest(self) -> float:
        """Largest factor of all durations for which obstacles and orbit remain known until the horizon ends.

        An obstacle of a formation is absent after its path ends, unless there is a passive-safety horizon.
        """
        known = self.orbit.chief.span[1] if isinstance(self.orbit, ChiefOrbit) else np.inf
        if self.obstacles is not None and (self.drift is not None or self.given is not None):
            last = self.arrival - ROUNDING * float(self.durations.max())
            known = self.obstacles.end[self.obstacles.end >= last].min(initial=known)
        return float(((known - (self.drift or 0.0) - self.starts) / self.durations).min())

    def problem(self) -> Problem:
        """Return the planning problem of this request: a new one each time with `drift` or errors."""
        return self._plain if self.drift is None and self.errors is None else self._new_problem()

    @cached_property
    def _plain(self) -> Problem:
        return self._new_problem()

    def _new_problem(self) -> Problem:
        zones = self.zones if self.padding is None else self.padding.groups(self.zones)
        plain = Problem.of(self.direct, self.obstacles, zones, self.drift)
        plain = replace(plain, requirements=self.requirements) if self.requirements else plain
        return plain if self.errors is None else self.errors.problem(plain)

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
                "thrusters: cannot bring every craft to its own slot; give other slots or thrusters"
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
        if self.path_over is not None:
            return replace(self, **_ends(self.path_over(factor)))
        later = replace(self, durations=factor * self.durations)
        return later.cheapest() if later.longest >= 1.0 else later

    def staggered(self, share: float) -> Request:
        """Return the request with staggered starts: the last waits for `share` of the longest duration.

        The spacecraft coast until they start.  The final states hold when the last has arrived, and the
        spacecraft that arrive before coast into them.
        """
        longest = share * self.durations.max()
        waits = np.linspace(0.0, longest, len(self.initial))
        later = replace(self, early=longest - waits, starts=self.starts + waits)
        if later.longest < 1.0:
            return later
        ahead = self.orbit.transition(waits, self.starts)
        return replace(later, initial=(ahead @ self.initial[:, :, None])[..., 0]).cheapest()


def check_orbit(orbit: Any, method: str, thrusters: Any) -> Any:
    """Return an orbit in which a plan is supported; raise ValueError with the alternative otherwise."""
    if not isinstance(instance("orbit", orbit, Orbit, ChiefOrbit), ChiefOrbit):
        return orbit
    inertial = any(getattr(own, "frame", "") == "inertial" for own in _as_tuple(thrusters))
    refused = {
        "method: 'sauter-palmer'": (method == "sauter-palmer", "omit it"),
        "thrusters: frame 'inertial'": (inertial, "fix them in the orbit's axes"),
    }
    for name, (asked, remedy) in refused.items():
        if asked:
            raise ValueError(
                f"{name}: planned about a circular orbit only, not about {orbit.chief}; {remedy}"
            )
    return orbit


def _ends(path: Path) -> dict[str, Any]:
    """Return the fields of the request of one spacecraft that its path determines."""
    initial, final = ends_of(path)
    lasts = np.array([float(path.end - path.start)])
    return {"given": path, "initial": initial[None], "places": final[None], "durations": lasts}


def _options(
    method: str,
    known: tuple[str, ...],
    cost: str,
    thrusters: Any,
    drift: float | None,
    errors: Any,
    zone: Any,
    budget: int | None,
    prove: float,
    gap: float,
) -> dict[str, Any]:
    """Return the options as fields; raise ValueError for an unknown one, or ones that cannot be combined."""
    if budget is not None:
        whole("budget", budget, least=1)
    if not number("prove", prove) >= 0.0:
        raise ValueError(f"prove: must be 0 s or more, got {prove}")
    if not number("gap", gap) > 0.0:
        raise ValueError(f"gap: must be positive, such as 0.01 for 1 %, got {gap}")
    if not isinstance(method, str) or method not in known:
        raise ValueError(f"method: must be {' or '.join(map(repr, known))}, got {shown(method)}")
    if not isinstance(cost, str) or cost not in ("energy", "delta-v"):
        raise ValueError(f"cost: must be 'energy' or 'delta-v', got {shown(cost)}")
    if cost == "energy" and thrusters is not None:
        raise ValueError("thrusters: require cost 'delta-v'; set it, or omit thrusters")
    unusual = method != known[0]
    if cost == "delta-v" and unusual:
        raise ValueError("method: cannot be combined with cost 'delta-v'; omit it, or set cost 'energy'")
    if drift is not None:
        drift = number("drift", drift)
        if drift == inf:
            raise ValueError(
                "drift: must be finite; plan with a finite one, and check inf with passively_safe"
            )
        if not drift >= 0.0:
            raise ValueError(f"drift: must be 0 s or more, got {shown(drift)}")
        if unusual:
            raise ValueError(f"drift: requires method {known[0]!r}, got {shown(method)}")
    if errors is not None:
        own = zone if isinstance(zone, list | tuple) else [zone]
        if any(
            isinstance(one, CovarianceZone) or (isinstance(one, PairZones) and counts_covariances(one))
            for one in own
        ):
            raise ValueError(TWICE)
        if unusual:
            raise ValueError("method: cannot be combined with errors; remove one of them")
    return {
        "method": method,
        "cost": cost,
        "drift": drift,
        "budget": budget,
        "proof_time": prove,
        "gap": gap,
    }


def _requirements(given: Any, count: int) -> tuple[tuple[Requirement, ...], ...]:
    """Return the requirements of each spacecraft: the same for all, or one sequence for each."""
    one_by_one = isinstance(given, list | tuple) and any(isinstance(own, list | tuple) for own in given)
    each = [tuple(own) for own in given] if one_by_one else [_as_tuple(given)] * count
    if len(each) != count:
        raise ValueError(f"requirements: {len(each)} sequences for {count} craft; give one for each")
    if not any(each):
        return ()
    for one in (one for own in each for one in own):
        instance("requirements", one, Requirement)
    return tuple(each)


def _as_tuple(given: Any) -> tuple[Any, ...]:
    """Return a sequence as a tuple, and a single object as one."""
    return tuple(given) if isinstance(given, list | tuple) else (given,)


def _names(names: Sequence[str] | None, count: int, obstacles: Path | None) -> tuple[str, ...]:
    """Return the names of spacecraft and obstacles; raise ValueError for another number of them."""
    given = (
        tuple(f"craft {k}" for k in range(count)) if names is None else tuple(sequence("names", names, str))
    )
    if len(given) not in (count, count + (0 if obstacles is None else len(obstacles))):
        raise ValueError(f"names: {len(given)} for {count} craft; give one for each")
    return given + obstacle_names(None, obstacles) if len(given) == count else given


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
