"""Flight: a plan flown in a field many times, with measurements and thrust as they are."""

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
    """Fly planned paths in a field, as often as asked, with errors drawn anew each time.

    Parameters
    ----------
    plan : Plan, Avoidance or Path
        Of one craft or of N, in the chief's Hill frame with straight axes, times since its epoch.
    field : Field
        In which they fly.
    control : {"track", "replan", "open"}, default "track"
        Measure and come back to the planned path; or make a new plan around the `zones` from where craft are
        measured to be, by `reconfigure`, in pulses with `thrusters`; or play the thrust as commanded.
    feedback : Feedback, optional
        How often, within which horizon, and by what; each minute and within ten of them by thrust that lasts
        unless given, for impulses or thrusters by one each five minutes, of six in half an hour.
    navigation : Navigation, optional
        How well they are measured; exactly unless given.
    zones : Zone or PairZones, optional
        Of all pairs, or of each; without it no ratios are told.
    cancel : bool, default True
        Whether the plan's thrust is corrected by what Hill's equations leave out, and its impulses are
        changed for that, as `thrust` does.  Coasts on which feedback holds craft by impulses are not.
    known : Field, optional
        The field that this is taken from; the one that is flown in unless given.
    thrust_error : array_like of shape (2,) or (N, 2), no unit and [rad], default (0, 0)
        By how much each craft's thrust is off at most, as a share of its size, and in direction; drawn evenly
        for each flight, through which it stays.
    max_acceleration : array_like of shape (N,) or () [m/s^2], optional
        That thrust never exceeds; `limited` tells how long it would have had to.  Not for impulses, nor with
        thrusters.
    minimum_bit : float [m/s], default 0
        The least impulse that is fired.
    thrusters : Thrusters or sequence of Thrusters or None, optional
        Of all craft, or of each that has some, which fire what `thrust` says, and lead back by burns: in
        their directions, a bit or more, when they are not on by plan.
    seeds : int or sequence of int, default 1
        How many flights, or the seed of each: its errors are the same however many others there are.
    errors : Uncertainty or sequence of Errors or None, optional
        Of each craft, beside `thrust_error`, drawn anew for its state at the start, for each burn and each
        impulse, whether planned or to lead back.  What leads back by thrust that lasts is a burn from one
        measurement to the next, and so is what thrusters fire from one order to the next.  `noise` shakes
        a craft all the time, by changes of velocity each 8 s; its states are exact at these times.
    lost : array_like of shape (N,) or () [s], optional
        When each craft loses its thrust, as nobody knows, inf of one that does not: it drifts from then on.
        Of thrusters what they are told last to lead back counts as spent.
    engine : array_like of bool of shape (N,) or (), default True
        Whether each craft has one.  Without it a craft coasts in the field: nobody leads it back, and new
        plans go around where it is measured to be.

    Returns
    -------
    Simulation
        States, what they cost, and how near pairs came.

    Raises
    ------
    ValueError
        If the plan has no paths, is of deep space, its mean motion is not the chief's, or an
        argument is of another kind.

    Notes
    -----
    Steps are of 10 s, of 20 s where only impulses thrust and of 5 s where pulses do; one ends wherever thrust
    jumps.  Feedback leads craft back to the plan, those with thrusters, and others where impulses move them,
    to what these fly without errors in the field that is known.  Coasts that begin without an impulse, and
    last for a horizon or an orbit, are held, in a path of several stages, too.  A field that is a function is
    taken along a flight without errors, and beside it by its zonals' gradient.

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
        raise ValueError(f'control: "track", "replan" or "open", got {shown(control)}')
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
            raise ValueError('lost: new plans would need the thrust that is lost; give control="track"')
        if zones is None or not cancel or law.impulses or law.delay or fires:
            raise ValueError(
                "control: new plans are around zones, of thrust that lasts, less the residual, at once; give "
                "zones, and leave out impulses, cancel and delay"
            )
        if pulsed and limit.min() < np.inf:
            raise ValueError("thrusters: have limits of their own; leave out max_acceleration")
        return asked.flight(asked.replanned(zones, own_sets))
    if control == "open":
        asked = asked._replace(law=None)
    if not pulsed:
        return asked.flight(asked.followed())
    if not cancel or limit.min() < np.inf or least > 0.0:
        raise ValueError(
            "thrusters: have limits and bits of their own, and fly in the field; leave out "
            "max_acceleration, minimum_bit and cancel"
        )
    return asked.flight(asked.pulsed(own_sets))


class _Flown(NamedTuple):
    """Flights at some times, of paths (N,) that cost so much (N,); with what plans anew or pulses add."""

    times: Floats
    done: Flights
    paths: Path
    planned: Floats
    replans: Sequence[int] = ()
    refused: tuple[tuple[int, float, str], ...] = ()
    firing: ThrusterFiring | None = None
    ordered: Floats | None = None


class _Asked(NamedTuple):
    """What is to be flown: arguments of `fly`, checked; of thrust as commanded without a law."""

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
        """By plans that are made anew, and by pulses of those that have thrusters."""
        from closeform.dynamics.replanned import Replanning  # which loads all of planning

        assert self.law is not None
        fields, law, first, planned = (self.field, self.believed), self.law, None, self.paths.delta_v
        if any(own is not None for own in thrusters):
            from closeform.dynamics.pulsed_flight import led_by_pulses, planned_by_pulses
            from closeform.dynamics.pulsed_legs import (  # whose kernels only thrusters need
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
        """By pulses."""
        from closeform.dynamics.pulsed_flight import fly_pulses  # whose kernels only thrusters need

        fields = self.field, self.believed
        found = fly_pulses(self.paths, thrusters, fields, self.law, self.draws, self.lost, self.engines)
        firing, planned, times, ordered, done = found
        paths = until_lost(spanning(self.paths, times), self.lost)
        return _Flown(times, done, paths, planned, firing=firing, ordered=ordered)

    def followed(self) -> _Flown:
        """By thrust that lasts, and by impulses."""
        own, paths = ballistics_of(self.field.drag, len(self.paths)), self.paths
        against = self.believed if self.cancel else None
        commands = commands_of(paths, self.law, against, own, self.engines, lost=self.lost)
        frame = commands.frame_in(self.field)
        if self.cancel and fires_impulses(paths):
            commands = retargeted(commands, self.believed)
        done = flown_by_each(commands, self.field, frame, self.draws, range(len(paths)), self.lost)
        led = until_lost(paths, self.lost)
        return _Flown(commands.table.shown_times, done, led, led.delta_v)

    def flight(self, told: _Flown) -> Simulation:
        """What is answered of it."""
        times, done, planned = told.times, told.done, np.array(told.planned)
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
            told.paths,
            np.array(told.replans or [0] * len(done.states)),
            told.refused,
            told.firing,
            np.zeros(0) if told.ordered is None else told.ordered,
            nothing if told.ordered is None else done.fired,
        )


def _limit(max_acceleration: ArrayLike | None, fires: bool, count: int) -> Floats:
    """What thrust never exceeds (N,) [m/s^2], of plans that have impulses or none."""
    if max_acceleration is None:
        return np.full(count, np.inf)
    limit = of_each("max_acceleration", max_acceleration, count)
    if not (limit > 0.0).all():
        raise ValueError(f"max_acceleration: must be positive, got {shown(max_acceleration)}")
    if fires:
        raise ValueError(
            "max_acceleration: the plan has impulses, which are beyond any limit; leave it out, or plan burns"
        )
    return limit
