"""Simulation of a plan in the high-fidelity model, with navigation and execution errors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, instance, number, of_each, shown
from closeform.dynamics.clearance import clearance_ratios
from closeform.dynamics.control.feedback import Feedback, Navigation, default_feedback, nonnegative
from closeform.dynamics.force_model.field import Field
from closeform.dynamics.planned_paths import checked_paths, running_engines, until_lost
from closeform.dynamics.simulation.commands import Engines
from closeform.dynamics.simulation.control_loop import ControlLoop, joined
from closeform.dynamics.simulation.guidance import Guidance
from closeform.dynamics.simulation.random_errors import ErrorSampler, errors_of_each, seeds_of, thrust_errors
from closeform.dynamics.simulation.replanning import Replanner
from closeform.dynamics.simulation.simulation_result import Simulation
from closeform.dynamics.simulation.thruster_pulses import planned_delta_v, pulse_feedback
from closeform.fuel.thrusters import Thrusters, each_set
from closeform.motion.path import fires_impulses
from closeform.zones.pair_zones import PairZones
from closeform.zones.zone import Zone


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
    max_acceleration: ArrayLike | None = None,
    minimum_bit: float = 0.0,
    thrusters: Thrusters | Sequence[Thrusters | None] | None = None,
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
    max_acceleration : array_like of shape (N,) or () [m/s^2], optional
        Thrust limit; `limited` reports the share of time at the limit. Cannot be combined with impulses or
        thrusters.
    minimum_bit : float [m/s], default 0
        Minimum impulse bit.
    thrusters : Thrusters or sequence of Thrusters or None, optional
        Thrusters of all spacecraft, or of each that has some. They fire the compensated plan, and feedback
        burns of at least one bit while they are not firing by plan.
    seeds : int or sequence of int, default 1
        Number of simulations, or the seed of each, which determines its errors.
    errors : Uncertainty or sequence of Uncertainty or None, optional
        Uncertainty of each spacecraft, in addition to `thrust_error`: errors of the initial state and of each
        planned or feedback burn and impulse. Continuous feedback is one burn per measurement, and thruster
        feedback one per order. Process noise (`noise`) acts by velocity changes every 8 s; states are exact
        at these times.
    lost : array_like of shape (N,) or () [s], optional
        Time at which each spacecraft loses its thrust, unknown to guidance, and drifts; inf for one that does
        not. The last feedback order of thrusters counts as spent.
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

    Notes ----- Steps are 10 s, 20 s for impulses alone and 5 s for pulses; a step ends at each discontinuity
    of thrust. Feedback returns spacecraft to the plan. For thrusters, and for impulsive spans, the reference
    is the motion without errors in the known field. Coasts that begin without an impulse and last for a
    horizon or an orbit are held, also in a path of several stages. A field that is a function is evaluated
    along a simulation without errors; nearby, the gradient of its zonals is used.

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
    count, fires, own_sets = len(paths), fires_impulses(paths), each_set(thrusters, len(paths))
    pulsed = any(own is not None for own in own_sets)
    usual = default_feedback(control, fires or pulsed)
    asked_law = instance("feedback", usual if feedback is None else feedback, Feedback)
    sight = instance("navigation", Navigation() if navigation is None else navigation, Navigation)
    sizes = thrust_errors(thrust_error, count)
    limit, lost_at = _limit(max_acceleration, fires, count), _loss_times(lost, count)
    least = float(nonnegative("minimum_bit", number("minimum_bit", minimum_bit)))
    sampler = ErrorSampler(
        seeds_of(seeds), sight, sizes, errors_of_each(errors, count), float(paths.start[0])
    )
    believed = known or field
    engines = Engines.of(running_engines(engine, paths, believed, own_sets), limit, least, lost_at)
    thrusters_alone = cancel and limit.min() == np.inf and least == 0.0
    if control == "replan":
        _check_replanning(zones, asked_law, fires, cancel, lost_at)
        if pulsed and limit.min() < np.inf:
            raise ValueError("thrusters: cannot be combined with max_acceleration; remove it")
    elif pulsed and not thrusters_alone:
        raise ValueError(
            "thrusters: cannot be combined with max_acceleration, minimum_bit or cancel=False; remove these"
        )
    law, planner = None if control == "open" else asked_law, None
    if pulsed and law is not None:
        law = pulse_feedback(law, own_sets)
    if control == "replan" and zones is not None and law is not None:
        planner = Replanner.of(paths, believed, own_sets, zones, law, engines, sampler)
        law, first = planner.law, planner.first
    else:
        first = Guidance.of(paths, believed, law, own_sets, cancel)
    runs = ControlLoop(law, field, engines, planner).runs(first, sampler)
    done = joined([run.done for run in runs])
    nominal = done.nominal if planner is None else first.simulate(None, field, engines).nominal
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
        planned=paths if planner is not None else until_lost(first.paths, lost_at),
        replans=np.array([run.replans for run in runs] if planner is not None else [0] * flights),
        refused=refused,
        firing=first.firing,
        pulses=tuple(run.pulses for run in runs if run.pulses is not None) * (flights // len(runs)),
        ordered=done.fired_times if orders else np.zeros(0),
        orders=done.fired if orders else np.zeros((flights, count, 0, 3)),
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


def _limit(max_acceleration: ArrayLike | None, fires: bool, count: int) -> Floats:
    """Return the thrust limit (N,) [m/s^2] after a check."""
    if max_acceleration is None:
        return np.full(count, np.inf)
    limit = of_each("max_acceleration", max_acceleration, count)
    if not (limit > 0.0).all():
        raise ValueError(f"max_acceleration: must be positive, got {shown(max_acceleration)}")
    if fires:
        raise ValueError(
            "max_acceleration: cannot be combined with impulses; remove it, or plan continuous thrust"
        )
    return limit
