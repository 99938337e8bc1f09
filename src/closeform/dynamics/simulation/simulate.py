"""Simulation of a plan in the high-fidelity model, with navigation and execution errors.

Open loop, tracking and replanning are one loop over legs. A plan is followed open loop or tracked in one leg.
Replanning has a leg from each measurement to the next, and a new plan around the zones between legs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, instance, number, of_each, shown
from closeform.dynamics.clearance import clearance_ratios
from closeform.dynamics.control.feedback import Feedback, Navigation, default_feedback, nonnegative
from closeform.dynamics.force_model.field import Field
from closeform.dynamics.infeasible import Infeasible
from closeform.dynamics.model_error import greatest_residual
from closeform.dynamics.planned_paths import checked_paths, impulses_of, running_engines, until_lost
from closeform.dynamics.simulation.commands import SAME, Engines, ThrusterStages, intervals_in, stages_at
from closeform.dynamics.simulation.guidance import Guidance
from closeform.dynamics.simulation.propagate import Trajectories
from closeform.dynamics.simulation.random_errors import ErrorSampler, errors_of_each, seeds_of, thrust_errors
from closeform.dynamics.simulation.simulation_result import Simulation
from closeform.dynamics.simulation.thruster_pulses import divide_interval, planned_delta_v, pulse_feedback
from closeform.fuel.pulses import Pulses, one_table
from closeform.fuel.thrusters import Thrusters
from closeform.motion.joining import stack
from closeform.motion.path import Path, fires_impulses
from closeform.planning.reconfigure import reconfigure
from closeform.zones.made_table import NONE
from closeform.zones.pair_zones import PairZones, pairs_of
from closeform.zones.zone import Zone

SIGMAS = 4.0
# factors on the margin, tried in this order: a spacecraft measured inside a margin has no plan
PADDED = (2.0, 1.0, 0.5)


def simulate(
    plan: Any,
    field: Field,
    control: Literal["track", "replan", "open"] = "track",
    feedback: Feedback | None = None,
    navigation: Navigation | None = None,
    zones: Zone | PairZones | None = None,
    cancel: bool = True,
    known: Field | None = None,
    thrust_error: ArrayLike = (0.0, 0.0),
    max_acceleration: ArrayLike | dict[float, ArrayLike] | None = None,
    minimum_bit: float = 0.0,
    thrusters: Thrusters | Sequence[Thrusters | dict[float, Thrusters | None] | None] | None = None,
    seeds: int | Sequence[int] = 1,
    errors: Any = None,
    lost: ArrayLike | None = None,
    engine: ArrayLike = True,
) -> Simulation:
    """Simulate planned paths in a field, once for each seed, with random errors.

    Parameters
    ----------
    plan : Plan or Path
        Plan of one spacecraft or of N, in the chief's Hill frame with straight axes, times since its epoch.
    field : Field
        Force model in which they move.
    control : {"track", "replan", "open"}, default "track"
        "track": feedback to the planned path; "replan": new plans around the `zones` from the measured
        states, by `reconfigure`, in pulses with `thrusters`; "open": the commanded thrust without feedback.
    feedback : Feedback, optional
        Interval, horizon and kind of feedback. Default: every 60 s with a horizon of 600 s and continuous
        thrust; for impulses or thrusters every 300 s with six impulses in 1800 s; for "replan" every 300 s
        with a horizon of 900 s.
    navigation : Navigation, optional
        Navigation accuracy. Default: exact.
    zones : Zone or PairZones, optional
        Zones of all pairs, or of each; without them no clearance ratios are computed.
    cancel : bool, default True
        Compensate the model error of Hill's equations and change impulses for it, as `compensated_thrust`
        does. Coasts on which feedback holds spacecraft by impulses are not compensated.
    known : Field, optional
        Force model used for the compensation. Default: `field`.
    thrust_error : array_like of shape (2,) or (N, 2), no unit and [rad], default (0, 0)
        Bounds on each spacecraft's relative thrust error and on its direction error. They are uniformly
        distributed and constant through a simulation.
    max_acceleration : array_like of shape (N,) or (), or dict of these by start time [s] [m/s^2], optional
        Limit of thrust without thrusters, or the limits of successive stages; inf for none. `limited` reports
        the fraction of time at the limit. A stage with a limit cannot have impulses.
    minimum_bit : float [m/s], default 0
        Minimum impulse bit.
    thrusters : Thrusters or sequence of Thrusters, dict of float [s] and Thrusters, or None, optional
        Thrusters of all spacecraft, or of each that has some. They fire the compensated plan, and feedback
        burns of at least one bit while they are not firing by plan. A dict has the sets that a spacecraft
        uses one after the other, by start time [s]; None for thrust without thrusters. They change while the
        plan coasts.
    seeds : int or sequence of int, default 1
        Number of simulations, or the seed of each, which determines its errors.
    errors : Uncertainty or sequence of Uncertainty or None, optional
        Uncertainty of each spacecraft, in addition to `thrust_error`: errors of the initial state and of each
        planned or feedback burn and impulse. Continuous feedback is one burn per measurement, and thruster
        feedback one per order. Process noise (`noise`) acts by velocity changes every 8 s; states are exact
        at these times.
    lost : array_like of shape (N,) or () [s], optional
        Time at which each spacecraft loses its thrust, unknown to guidance, and drifts; inf for one that does
        not. The delta-v of the last feedback order of thrusters is counted as spent.
    engine : array_like of bool of shape (N,) or (), default True
        Whether each spacecraft has an engine. Without it a spacecraft coasts in the field without feedback,
        and new plans avoid its measured path.

    Returns
    -------
    Simulation
        States, cost, and clearance ratios of pairs.

    Raises
    ------
    ValueError
        If the plan has no paths, is in deep space, has another mean motion than the chief, or an argument
        has the wrong type.

    Notes
    -----
    Steps are 10 s, 20 s for impulses alone and 5 s for pulses; a step ends at each discontinuity of thrust.
    Feedback returns spacecraft to the plan. For thrusters, and for impulsive spans, the reference is the
    motion without errors in the known field. Coasts that begin without an impulse and last for a horizon or
    an orbit are held, also in a path of several stages. A field that is a function is evaluated along a
    simulation without errors; nearby, the gradient of its zonals is used.

    References
    ----------
    docs/theory.md (50), (66), (85), (86), (88) and (89).

    Examples
    --------
    >>> import closeform as cf
    >>> chief = cf.Chief.from_elements("2026-11-22T12:00:00", [6.878e6, 0.0, 1e-3, 0.0, 0.9, 0.0])
    >>> path = chief.orbit.transfer([0, 200, 0, 0, 0, 0], [0, 50, 0, 0, 0, 0], 3000.0)
    >>> simulated = cf.simulate(path, cf.Field(chief), navigation=cf.Navigation(0.1, 3e-4), seeds=20)
    >>> simulated.greatest_end < 0.4
    True
    """
    paths = checked_paths(plan, field)
    if not isinstance(control, str) or control not in ("track", "replan", "open"):
        raise ValueError(f'control: must be "track", "replan" or "open", got {shown(control)}')
    instance("cancel", cancel, bool)
    instance("known", known, Field, type(None))
    instance("zones", zones, Zone, PairZones, type(None))
    count, fires, own_sets = len(paths), fires_impulses(paths), ThrusterStages.of_each(thrusters, paths)
    pulsed = any(own is not None for own in own_sets)
    usual = default_feedback(control, fires or pulsed)
    asked_law = instance("feedback", usual if feedback is None else feedback, Feedback)
    sight = instance("navigation", Navigation() if navigation is None else navigation, Navigation)
    sizes = thrust_errors(thrust_error, count)
    (starts, limits), lost_at = _stage_limits(max_acceleration, paths), _loss_times(lost, count)
    least = float(nonnegative("minimum_bit", number("minimum_bit", minimum_bit)))
    sampler = ErrorSampler(
        seeds_of(seeds), sight, sizes, errors_of_each(errors, count), float(paths.start[0])
    )
    believed = known or field
    running = running_engines(engine, paths, believed, own_sets)
    engines = Engines(starts, np.where(running[:, None], limits, 0.0), lost_at, least)
    if control == "replan":
        _check_replanning(zones, asked_law, fires, cancel, lost_at)
    elif pulsed and not (cancel and least == 0.0):
        raise ValueError("thrusters: cannot be combined with minimum_bit or cancel=False; remove these")
    law = None if control == "open" else asked_law
    if pulsed and law is not None:
        law = pulse_feedback(law, own_sets)
    if control == "replan" and zones is not None and law is not None:
        loop = ControlLoop.replanning(paths, believed, own_sets, zones, law, field, engines, sampler)
    else:
        guidance = Guidance.of(paths, believed, law, own_sets, cancel)
        loop = ControlLoop(guidance, law, field, engines, np.array(guidance.span))
    first, runs = loop.first, loop.runs(sampler)
    done = Trajectories.joined([run.done for run in runs], 0)
    nominal = first.simulate(None, field, engines).nominal if loop.replans else done.nominal
    planned = planned_delta_v(paths, own_sets, lost_at)
    each = zip(done.states, done.arrivals, strict=True)
    ratios = [clearance_ratios(*one, done.times, zones) for one in each]
    flights, orders = len(done.states), first.firing is not None
    seeded = zip(sampler.seeds, runs, strict=False)
    refused = tuple((seed, *why) for seed, run in seeded for why in run.refused)
    return Simulation(
        times=done.times,
        states=done.states,
        arrivals=done.arrivals,
        delta_v=done.spent if cancel else done.spent - nominal + planned,
        planned_delta_v=planned,
        field_delta_v=(nominal - planned) * cancel,
        limited=done.limited / (done.times[-1] - done.times[0]),
        pairs=ratios[0][0],
        ratios=np.array([ratio for _, ratio in ratios]),
        planned=paths if loop.replans else until_lost(first.paths, lost_at),
        replans=np.array([run.replans for run in runs] if loop.replans else [0] * flights),
        refused=refused,
        firing=first.firing,
        pulses=tuple(run.pulses for run in runs if run.pulses is not None) * (flights // len(runs)),
        ordered=done.ordered if orders else np.zeros(0),
        orders=done.orders if orders else np.zeros((flights, count, 0, 3)),
    )


def _check_replanning(
    zones: Zone | PairZones | None, law: Feedback, fires: bool, cancel: bool, lost: Floats
) -> None:
    """Raise ValueError for arguments with which replanning cannot be combined."""
    if np.isfinite(lost).any():
        raise ValueError('lost: cannot be combined with replanning; give control="track"')
    if zones is None or not cancel or law.impulses or law.delay or fires:
        raise ValueError(
            'control: "replan" requires zones, and continuous thrust with cancel and without delay; '
            "give zones, and remove impulses, cancel=False and delay"
        )


def _loss_times(lost: ArrayLike | None, count: int) -> Floats:
    """Return the time at which each spacecraft loses its thrust (N,) [s]; inf for those that keep it."""
    times = np.full(count, np.inf) if lost is None else of_each("lost", lost, count)
    if np.isnan(times).any():
        raise ValueError(
            f"lost: expected a time, or inf for a craft that keeps its thrust, got {shown(lost)}"
        )
    return times


def _stage_limits(given: Any, paths: Path) -> tuple[Floats, Floats]:
    """Return start times (M,) [s] of stages, the first -inf, and thrust limits (N, M) [m/s^2]."""
    stages = given if isinstance(given, dict) else {0.0: np.inf if given is None else given}
    times = [number("max_acceleration", time) for time in stages]
    if not times or times != sorted(times):
        raise ValueError("max_acceleration: expected limits by start time, in order")
    starts = np.array([-np.inf, *times[1:]])
    limits = np.stack([of_each("max_acceleration", one, len(paths)) for one in stages.values()], axis=1)
    if not (limits > 0.0).all():
        raise ValueError(f"max_acceleration: must be positive, got {shown(given)}")
    craft, fired, _ = impulses_of(paths)
    # an impulse between two stages belongs to either
    if np.isfinite([limits[craft, stages_at(starts, fired - dt)] for dt in (0.0, 2.0 * SAME)]).all(0).any():
        raise ValueError(
            "max_acceleration: cannot be combined with impulses; remove it, or plan continuous thrust"
        )
    return starts, limits


class Run(NamedTuple):
    """Simulations, their planned pulses, the number of new plans, and times and reasons of refused plans."""

    done: Trajectories
    pulses: Pulses | None
    replans: int
    refused: list[tuple[float, str]]


@dataclass(frozen=True, eq=False)
class ControlLoop:
    """Loop in a field from the `first` guidance, with a feedback `law`, or None for open-loop control.

    A leg is from each of the `instants` (L + 1,) [s] to the next. If there are `zones`, each leg begins with
    a measurement, and with a new plan that keeps a `margin` [m] around them; feedback keeps spacecraft on it.
    """

    first: Guidance
    law: Feedback | None
    field: Field
    engines: Engines
    instants: Floats
    zones: Zone | PairZones | None = None
    margin: float = 0.0

    @classmethod
    def replanning(
        cls,
        paths: Path,
        believed: Field,
        thrusters: Sequence[ThrusterStages | None],
        zones: Zone | PairZones,
        law: Feedback,
        field: Field,
        engines: Engines,
        sampler: ErrorSampler,
    ) -> Self:
        """Return the loop with new plans, and with the margin for the errors."""
        start, end = float(paths.start[0]), float(paths.end[0])
        instants = np.linspace(start, end, intervals_in(end - start, law.every) + 1)
        in_step = divide_interval(thrusters, float(instants[1] - instants[0]))
        first = Guidance.of(paths, believed, None, in_step)
        off, density = np.hypot(*sampler.sizes.T), np.zeros(len(paths))
        if sampler.errors is not None:
            off += SIGMAS * np.array([np.hypot(one.magnitude, one.pointing) for one in sampler.errors])
            density += [one.noise for one in sampler.errors]
        pushes = np.where(engines.running, off * paths.peak_thrust, greatest_residual(believed, paths))
        margin = replanning_margin(sampler.navigation, law.every, pushes, density)
        if first.firing is not None:
            margin += float(np.sort(first.deviation)[-2:].sum())
        law = replace(law, every=float(instants[1] - instants[0]))
        return cls(first, law, field, engines, instants, zones, margin)

    @property
    def replans(self) -> bool:
        """True if new plans are made."""
        return self.zones is not None

    def runs(self, sampler: ErrorSampler) -> list[Run]:
        """Return the simulations of all seeds in one run, or with new plans in a run of each seed."""
        over = float(self.instants[-1] - self.instants[0])
        looks = 0 if self.law is None else intervals_in(over, self.law.every)
        seen, thrust = sampler.measured(looks + 1, over / max(looks, 1))
        if not self.replans:
            return [self.run(sampler, seen, thrust)]
        return [
            self.run(replace(sampler, seeds=[seed]), one[None], off[None])
            for seed, one, off in zip(sampler.seeds, seen, thrust, strict=True)
        ]

    def run(self, sampler: ErrorSampler, seen: Floats, thrust: Floats) -> Run:
        """Return simulations leg by leg, with errors of measurements (S, N, M, 6) and of thrust (S, N, 4).

        Each leg has its own burns.
        """
        parts, pulses, refused, replans = list[Trajectories](), list[Pulses](), list[tuple[float, str]](), 0
        guidance, measured = self.first, seen
        now: Any = guidance.paths.state(self.instants[0]) if self.replans else None
        for leg, span in enumerate(pairwise(self.instants.tolist())):
            if self.replans and self.law is not None:
                measured = seen[:, :, leg : leg + 1]
                if leg > 0 and self.instants[-1] - span[0] >= self.law.horizon:
                    anew, why = self.replan(now + measured[0, :, 0], span[0])
                    refused += [(span[0], one) for one in why]
                    if anew is not None:
                        guidance, replans = anew, replans + 1
            errors, of_leg = (sampler, (measured, thrust)), span if self.replans else None
            parts.append(guidance.simulate(self.law, self.field, self.engines, *errors, of_leg, now, leg))
            pulses += guidance.pulses(span)
            now = parts[-1].states[0, :, -1].copy()
        fired = one_table(pulses) if pulses else None
        if fired is not None:
            fired = fired[np.lexsort((fired.start, fired.craft))]
        return Run(_of_all_legs(parts), fired, replans, refused)

    def replan(self, states: Floats, begin: float) -> tuple[Guidance | None, list[str]]:
        """Return the guidance of a plan from measured states (N, 6), and why plans were refused."""
        first, why = self.first, list[str]()
        end, orbit = float(self.instants[-1]), first.paths.orbit
        moving, rest = (np.flatnonzero(some) for some in (self.engines.running, ~self.engines.running))
        ahead = np.append(begin, self.engines.starts[self.engines.starts > begin])
        limits = self.engines.limits_at(ahead)[moving].min(axis=1)
        coasting = orbit.coast(states[rest], end - begin, begin)
        order = np.concatenate([moving, rest])
        zones = self.zones
        assert zones is not None
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
                max_acceleration=limits if np.isfinite(limits).any() else None,
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


def _of_all_legs(parts: Sequence[Trajectories]) -> Trajectories:
    """Return the trajectories of successive legs as one; each leg begins where the previous one ends."""
    if len(parts) == 1:
        return parts[0]
    states = np.concatenate([*(one.states[:, :, :-1] for one in parts[:-1]), parts[-1].states], axis=2)
    return replace(
        parts[0],
        times=np.concatenate([*(one.times[:-1] for one in parts[:-1]), parts[-1].times]),
        states=states,
        arrivals=states,
        ordered=np.concatenate([one.ordered for one in parts]),
        orders=np.concatenate([one.orders for one in parts], axis=2),
        spent=np.sum([one.spent for one in parts], axis=0),
        limited=np.sum([one.limited for one in parts], axis=0),
    )


def _reordered(zones: PairZones, order: Any, moving: int) -> PairZones:
    """Return the zones of the same bodies in another order, the first `moving` of which move."""
    count, found = len(zones), list[Zone]()
    table = np.full((count + 1, count + 1), NONE)
    for one, other in zip(*(k.tolist() for k in next(pairs_of(count))), strict=True):
        if (zone := zones.between(order[one], order[other])) is not None:
            table[one, other] = len(found)
            found.append(zone)
    return PairZones(tuple(found), np.arange(count), table, np.arange(count) < moving)


def replanning_margin(sight: Navigation, every: float, pushes: Floats, density: Floats) -> float:
    """Return the margin [m] for any two of N spacecraft between measurements `every` [s] apart.

    It covers 4 sigmas of measurement errors and of process noise of a `density` (N,) [m^2/s^3], all constant
    errors, and unplanned accelerations `pushes` (N,) [m/s^2].
    """
    square = 2.0 * (sight.position**2 + (every * sight.velocity) ** 2)
    square += np.sort(density)[-2:].sum() * every**3 / 3.0
    constant = 2.0 * (sight.position_bias + every * sight.velocity_bias)
    return float(SIGMAS * np.sqrt(square) + constant + np.sort(pushes)[-2:].sum() * every**2 / 2.0)
