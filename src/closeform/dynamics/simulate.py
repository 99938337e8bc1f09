"""Simulation of a plan in the high-fidelity model, with navigation and execution errors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, instance, number, of_each, shown
from closeform.dynamics.drag import ballistics_of
from closeform.dynamics.drawn import Draws, drawable, seeds_of
from closeform.dynamics.engines import Engines, running_engines
from closeform.dynamics.feedback import Feedback, Navigation, nonnegative, thrust_errors, usual_feedback
from closeform.dynamics.field import Field
from closeform.dynamics.flown_plan import paths_to_fly, spanning
from closeform.dynamics.least_ratios import least_ratios
from closeform.dynamics.lost_thrust import flown_by_each, losses, until_lost
from closeform.dynamics.reference_trajectory import Flights, commands_of
from closeform.dynamics.retargeted import retargeted
from closeform.dynamics.simulation_result import Simulation
from closeform.dynamics.timetable import intervals_in
from closeform.fuel.thrusters import Thrusters, each_set
from closeform.motion.path import Path, fires_impulses
from closeform.zones.pair_zones import PairZones
from closeform.zones.zone import Zone

if TYPE_CHECKING:
    from closeform.fuel.firing import ThrusterFiring


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
        Plan of one craft or of N, in the chief's Hill frame with straight axes, times since its epoch.
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
        does. Coasts on which feedback holds craft by impulses are not compensated.
    known : Field, optional
        Force model used for the compensation. Default: `field`.
    thrust_error : array_like of shape (2,) or (N, 2), no unit and [rad], default (0, 0)
        Bounds on each craft's relative thrust error and on its direction error. They are uniformly
        distributed and constant through a simulation.
    max_acceleration : array_like of shape (N,) or () [m/s^2], optional
        Thrust limit; `limited` reports the share of time at the limit. Cannot be combined with impulses or
        thrusters.
    minimum_bit : float [m/s], default 0
        Minimum impulse bit.
    thrusters : Thrusters or sequence of Thrusters or None, optional
        Thrusters of all craft, or of each that has some. They fire the compensated plan, and feedback burns
        of at least one bit while they are not firing by plan.
    seeds : int or sequence of int, default 1
        Number of simulations, or the seed of each, which determines its errors.
    errors : Uncertainty or sequence of Uncertainty or None, optional
        Uncertainty of each craft, in addition to `thrust_error`: errors of the initial state and of each
        planned or feedback burn and impulse. Continuous feedback is one burn per measurement, and thruster
        feedback one per order. Process noise (`noise`) acts by velocity changes every 8 s; states are exact
        at these times.
    lost : array_like of shape (N,) or () [s], optional
        Time at which each craft loses its thrust, unknown to guidance, and drifts; inf for one that does not.
        The last feedback order of thrusters counts as spent.
    engine : array_like of bool of shape (N,) or (), default True
        Whether each craft has an engine. Without it a craft coasts in the field without feedback, and new
        plans avoid its measured path.

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
    Feedback returns craft to the plan. For thrusters, and for impulsive spans, the reference is the motion
    without errors in the known field. Coasts that begin without an impulse and last for a horizon or an orbit
    are held, also in a path of several stages. A field that is a function is evaluated along a simulation
    without errors; nearby, the gradient of its zonals is used.

    References
    ----------
    docs/theory.md (50), (66), (85), (86), (88) and (89).

    Examples
    --------
    >>> import closeform as cf
    >>> chief = cf.Chief.from_elements("2026-11-22T12:00:00", [6.878e6, 0.0, 1e-3, 0.0, 0.9, 0.0])
    >>> path = chief.orbit.transfer([0, 200, 0, 0, 0, 0], [0, 50, 0, 0, 0, 0], 3000.0)
    >>> flown = cf.simulate(path, cf.Field(chief), navigation=cf.Navigation(0.1, 3e-4), seeds=20)
    >>> flown.greatest_end < 0.4
    True
    """
    paths = paths_to_fly(plan, field)
    if not isinstance(control, str) or control not in ("track", "replan", "open"):
        raise ValueError(f'control: must be "track", "replan" or "open", got {shown(control)}')
    instance("cancel", cancel, bool)
    instance("known", known, Field, type(None))
    instance("zones", zones, Zone, PairZones, type(None))
    fires, own_sets = fires_impulses(paths), each_set(thrusters, len(paths))
    pulsed = any(own is not None for own in own_sets)
    usual = usual_feedback(control, fires or pulsed)
    law = instance("feedback", usual if feedback is None else feedback, Feedback)
    sight = instance("navigation", Navigation() if navigation is None else navigation, Navigation)
    sizes = thrust_errors(thrust_error, len(paths))
    limit = _limit(max_acceleration, fires, len(paths))
    least = float(nonnegative("minimum_bit", number("minimum_bit", minimum_bit)))
    draws = Draws(seeds_of(seeds), sight, sizes, drawable(errors, len(paths)), float(paths.start[0]))
    drifts = losses(lost, len(paths))
    believed = known or field
    engines = Engines.of(running_engines(engine, paths, believed, own_sets), limit, least)
    asked = _Asked(paths, field, believed, law, zones, cancel, engines, draws, drifts)
    if control == "replan":
        if np.isfinite(drifts).any():
            raise ValueError('lost: cannot be combined with replanning; give control="track"')
        if zones is None or not cancel or law.impulses or law.delay or fires:
            raise ValueError(
                'control: "replan" requires zones, and continuous thrust with cancel and without delay; '
                "give zones, and remove impulses, cancel=False and delay"
            )
        if pulsed and limit.min() < np.inf:
            raise ValueError("thrusters: cannot be combined with max_acceleration; remove it")
        return asked.flight(asked.replanned(zones, own_sets))
    if control == "open":
        asked = asked._replace(law=None)
    if not pulsed:
        return asked.flight(asked.followed())
    if not cancel or limit.min() < np.inf or least > 0.0:
        raise ValueError(
            "thrusters: cannot be combined with max_acceleration, minimum_bit or cancel=False; remove these"
        )
    return asked.flight(asked.pulsed(own_sets))


class _Flown(NamedTuple):
    """Simulations at given times of paths (N,) with planned costs (N,), with data on replans or pulses."""

    times: Floats
    done: Flights
    paths: Path
    planned: Floats
    replans: Sequence[int] = ()
    refused: tuple[tuple[int, float, str], ...] = ()
    firing: ThrusterFiring | None = None
    ordered: Floats | None = None


class _Asked(NamedTuple):
    """Checked arguments of `simulate`; `law` is None for open-loop control."""

    paths: Path
    field: Field
    believed: Field
    law: Feedback | None
    zones: Zone | PairZones | None
    cancel: bool
    engines: Engines
    draws: Draws
    lost: Floats

    def replanned(self, zones: Zone | PairZones, thrusters: Sequence[Thrusters | None]) -> _Flown:
        """Return simulations with replanning, and with pulses for craft that have thrusters."""
        from closeform.dynamics.replanned import Replanning  # imported late: loads the planner

        assert self.law is not None
        fields, law, first, planned = (self.field, self.believed), self.law, None, self.paths.delta_v
        if any(own is not None for own in thrusters):
            from closeform.dynamics.pulsed_flight import led_by_pulses, planned_by_pulses
            from closeform.dynamics.pulsed_legs import (  # imported late: compiles kernels
                PulsedPlan,
                in_step,
            )

            lasts = float(self.paths.end[0] - self.paths.start[0])
            law = led_by_pulses(law, thrusters)
            steady = in_step(thrusters, lasts / intervals_in(lasts, law.every))
            first = PulsedPlan.of(self.paths, steady, self.believed, self.engines)
            planned = planned_by_pulses(self.paths, thrusters, self.lost)
        anew = Replanning.of(self.paths, zones, fields, law, self.engines, self.draws, first)
        (times, ordered), done, made, why = anew.flights(self.draws)
        each = zip(self.draws.seeds, why, strict=True)
        refused = tuple((seed, *one) for seed, some in each for one in some)
        orders = None if first is None else ordered
        firing = None if first is None else first.firing
        return _Flown(times, done, self.paths, planned, made, refused, firing, orders)

    def pulsed(self, thrusters: Sequence[Thrusters | None]) -> _Flown:
        """Return simulations with thruster pulses."""
        from closeform.dynamics.pulsed_flight import fly_pulses  # imported late: compiles kernels

        fields = self.field, self.believed
        found = fly_pulses(self.paths, thrusters, fields, self.law, self.draws, self.lost, self.engines)
        firing, planned, times, ordered, done = found
        paths = until_lost(spanning(self.paths, times), self.lost)
        return _Flown(times, done, paths, planned, firing=firing, ordered=ordered)

    def followed(self) -> _Flown:
        """Return simulations with continuous thrust and impulses."""
        own, paths = ballistics_of(self.field.drag, len(self.paths)), self.paths
        against = self.believed if self.cancel else None
        commands = commands_of(paths, self.law, against, own, self.engines, lost=self.lost)
        frame = commands.frame_in(self.field)
        if self.cancel and fires_impulses(paths):
            commands = retargeted(commands, self.believed)
        done = flown_by_each(commands, self.field, frame, self.draws, range(len(paths)), self.lost)
        led = until_lost(paths, self.lost)
        return _Flown(commands.table.shown_times, done, led, led.delta_v)

    def flight(self, flown: _Flown) -> Simulation:
        """Return the result of the simulations."""
        times, done, planned = flown.times, flown.done, np.array(flown.planned)
        each = zip(done.states, done.arrivals, strict=True)
        found = [least_ratios(one, before, times, self.zones) for one, before in each]
        nothing = np.zeros((len(done.states), len(planned), 0, 3))
        return Simulation(
            times,
            done.states,
            done.arrivals,
            done.spent if self.cancel else done.spent - done.asked + planned,
            planned,
            (done.asked - planned) * self.cancel,
            done.limited * self.engines.running / (times[-1] - times[0]),
            found[0][0],
            np.array([ratio for _, ratio in found]),
            flown.paths,
            np.array(flown.replans or [0] * len(done.states)),
            flown.refused,
            flown.firing,
            np.zeros(0) if flown.ordered is None else flown.ordered,
            nothing if flown.ordered is None else done.fired,
        )


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
