"""Tracking errors of spacecraft under feedback along a plan, and the margins that pairs require."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice, product
from typing import Any, ClassVar, Self

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike

from closeform.arrays import Floats, instance, number, of_each
from closeform.dynamics.control.closed_loop import KINDS, ClosedLoop, process_noise_covariances
from closeform.dynamics.control.feedback import Feedback, Navigation, default_feedback, nonnegative
from closeform.dynamics.force_model.field import Field
from closeform.dynamics.infeasible import Infeasible
from closeform.dynamics.model_error import deviations_of, path_residuals
from closeform.dynamics.planned_paths import checked_paths, running_engines
from closeform.dynamics.simulation.commands import SAME, ThrusterStages, ThrustSpans, burn_edges, intervals_in
from closeform.dynamics.simulation.guidance import Guidance
from closeform.dynamics.simulation.random_errors import errors_of_each, thrust_errors
from closeform.dynamics.simulation.thruster_pulses import lacks_axis, pulse_feedback
from closeform.fuel.allocation import Allocation
from closeform.fuel.thrusters import Thrusters
from closeform.motion.arc import START
from closeform.motion.path import Path, fires_impulses
from closeform.result import Result
from closeform.uncertainty.error_columns import burn_ranges, columns_of, impulse_errors
from closeform.uncertainty.errors import Uncertainty
from closeform.zones.padding import gap
from closeform.zones.pair_zones import PairZones
from closeform.zones.zone import Zone

STEPS, MOST = 6, 60  # steps between measurements: even, and a delay is a whole number
OFTEN = 15.0  # s, step, unless there are more than the maximum number
NEAR = 0.02  # of a step, tolerance on the delay
RIPPLE = 6  # instants of a step at which the ripple of pulses is sampled
UNIT = Uncertainty(magnitude=1.0, pointing=1.0)  # four columns for each burn
CLOSER, FINER = 4, 16  # refinements around a minimum, and parts in each


@dataclass(frozen=True, eq=False, repr=False)
class TrackingMargins(Result):
    """Tracking errors of N spacecraft at T times under feedback; returned by `tracking_margins`.

    Attributes
    ----------
    times : array of shape (T,) [s]
        Times since the chief's epoch.
    shift : array of shape (N, T, 3) [m]
        Expected deviation, in the chief's axes: by known model errors without compensation, by impulses
        changed for the field, or by the drift of spacecraft without an engine.
    stretch : array of shape (N, T, 3) [m]
        Further deviation for thrust larger by 100 %, in the chief's axes.
    turn : array of shape (N, T, 3, 3) [m/rad]
        Further deviation for thrust rotated about each of the chief's axes, in columns.
    thrust_error : array of shape (N, 2), no unit and [rad]
        Bounds on the relative thrust error and on the direction error.
    rest : array of shape (N,) [m]
        Bound on the remaining deviation, by unknown accelerations and constant measurement errors.
    spread : array of shape (N, T, 3, 3) [m^2]
        Covariances due to the errors of burns, impulses and initial states, in the chief's axes.
    noise : array of shape (N,) [m]
        Standard deviation in the worst direction due to random measurement errors.
    sigmas : float, no unit
        Number of standard deviations that count.
    command : array of shape (N, T) [m/s^2]
        Thrust required with feedback, without impulses.
    """

    _told: ClassVar = ("greatest", "thrust_error", "rest", "noise", "sigmas", "thrust")

    times: Floats
    shift: Floats
    stretch: Floats
    turn: Floats
    thrust_error: Floats
    rest: Floats
    spread: Floats
    noise: Floats
    sigmas: float
    command: Floats

    @property
    def thrust(self) -> Floats:
        """Largest thrust required at any time (N,) [m/s^2], without impulses.

        The margins do not hold for a craft whose thrust limit is lower than that.
        """
        return np.asarray(self.command.max(axis=1))

    @property
    def radius(self) -> Floats:
        """Radius of the tracking-error tube of each spacecraft at each time (N, T) [m]."""
        share, angle = self.thrust_error.T[..., None, None]
        larger, turned = share * self.stretch, ((1.0 + share) * angle)[..., None] * self.turn
        aligned = np.linalg.norm(np.einsum("ntij,nti->ntj", turned, larger), axis=-1)
        square = (larger**2).sum(axis=-1) + np.linalg.norm(turned, 2, axis=(-2, -1)) ** 2 + 2.0 * aligned
        off = np.linalg.norm(self.shift, axis=-1) + np.sqrt(square)
        random = np.sqrt(self.noise[:, None] ** 2 + np.linalg.eigvalsh(self.spread)[..., -1])
        return np.asarray(off + self.rest[:, None] + self.sigmas * random)

    @property
    def greatest(self) -> Floats:
        """Largest radius at any time (N,) [m]."""
        return np.asarray(self.radius.max(axis=1))

    def _since(self, begin: float) -> TrackingMargins:
        """Return the margins from a time on [s]."""
        after = self.times > begin
        times, command = np.concatenate([[begin], self.times[after]]), self.command[:, after]
        later: Any = {
            name: np.array([_between(self.times, one, times) for one in getattr(self, name)])
            for name in ("shift", "stretch", "turn", "spread")
        }
        # thrust may jump at that time
        return replace(self, times=times, command=np.hstack([command[:, :1], command]), **later)


def tracking_margins(
    plan: Any,
    field: Field,
    feedback: Feedback | None = None,
    navigation: Navigation | None = None,
    *,
    cancel: bool = True,
    residual: ArrayLike = 0.0,
    thrust_error: ArrayLike = (0.0, 0.0),
    errors: Any = None,
    minimum_bit: float = 0.0,
    thrusters: Thrusters | Sequence[Thrusters | dict[float, Thrusters | None] | None] | None = None,
    sigmas: float = 4.0,
    engine: ArrayLike = True,
) -> TrackingMargins:
    """Compute the tracking errors of spacecraft along a plan, under feedback with the errors of `simulate`.

    Parameters
    ----------
    plan : Plan or Path
        Plan of one spacecraft or of N, as in `simulate`.
    field : Field
        Known force model.
    feedback : Feedback, optional
        Feedback law. Default: as in `simulate`.
    navigation : Navigation, optional
        Navigation accuracy. Default: exact.
    cancel : bool, default True
        Compensate the model error, as `compensated_thrust` does.
    residual : array_like of shape (N,) or () [m/s^2], default 0
        Bound on accelerations not in this field.
    thrust_error : array_like of shape (2,) or (N, 2), no unit and [rad], default (0, 0)
        Bounds on each spacecraft's relative thrust error and on its direction error, constant through a
        simulation.
    errors : Uncertainty or sequence of Uncertainty or None, optional
        Uncertainty of each spacecraft, as in `simulate`.
    minimum_bit : float [m/s], default 0
        Minimum impulse bit of feedback.
    thrusters : Thrusters or sequence of Thrusters, dict of float [s] and Thrusters, or None, optional
        Thrusters of all spacecraft, or of each that has some, as in `simulate`. The deviation of pulses from
        the plan is known, and the effect of the minimum bit is bounded.
    sigmas : float, no unit, default 4
        Number of standard deviations of noise and `errors` that count.
    engine : array_like of bool of shape (N,) or (), default True
        Whether each spacecraft has an engine; without it the spacecraft drifts in the field, as in
        `simulate`.

    Returns
    -------
    TrackingMargins
        Tracking errors by cause, spacecraft and time.

    Raises
    ------
    ValueError
        If the plan has no paths, is in deep space, has another mean motion than the chief, a number is
        negative or not finite, or an argument has the wrong type.

    Notes
    -----
    Errors of the planned thrust are propagated along the plan. Errors of the feedback thrust are bounded, and
    increase the effect of noise. No thrust limit is applied; `TrackingMargins.thrust` reports the largest
    thrust.

    References
    ----------
    docs/theory.md (86), (93) and (96).

    Examples
    --------
    >>> import closeform as cf
    >>> chief = cf.Chief.from_elements("2026-11-22T12:00:00", [6.878e6, 0.0, 1e-3, 0.0, 0.9, 0.0])
    >>> path = chief.orbit.transfer([0, 200, 0, 0, 0, 0], [0, 50, 0, 0, 0, 0], 3000.0)
    >>> sight = cf.Navigation(0.1, 3e-4)
    >>> found = cf.tracking_margins(path, cf.Field(chief), navigation=sight, thrust_error=(0.01, 0.0175))
    >>> bool(0.2 < found.greatest[0] < 0.4)
    True
    """
    paths = checked_paths(plan, field)
    own, count = ThrusterStages.of_each(thrusters, paths), len(paths)
    running = running_engines(engine, paths, field, own)
    shooters = np.array([one is not None for one in own])
    usual = default_feedback("track", fires_impulses(paths) or bool(shooters.any()))
    law = instance("feedback", usual if feedback is None else feedback, Feedback)
    sight = instance("navigation", Navigation() if navigation is None else navigation, Navigation)
    instance("cancel", cancel, bool)
    sizes = thrust_errors(thrust_error, count)
    least = nonnegative("minimum_bit", number("minimum_bit", minimum_bit))
    many = float(nonnegative("sigmas", number("sigmas", sigmas)))
    unknown = nonnegative("residual", of_each("residual", residual, count))
    if shooters.any():
        for k, stages in enumerate(own):
            if stages is not None and any(map(lacks_axis, stages.thrusters)):
                raise Infeasible(
                    f"thrusters: craft {k}: an axis without a thruster is not controlled, so that its drift "
                    "is not bounded; add a thruster, or give a margin in metres"
                )
            if stages is not None and None in stages.sets:
                raise Infeasible(
                    f"thrusters: craft {k}: margins of pulses before or after free thrust are not "
                    "supported; give thrusters in all stages, or a margin in metres"
                )
        if not cancel or least > 0.0:
            raise ValueError("thrusters: cannot be combined with minimum_bit or cancel=False; remove these")
        law = pulse_feedback(law, own)
    elif least > 0.0 and not law.impulses:
        raise ValueError("minimum_bit: requires feedback by impulses; give such a Feedback, or remove it")
    own_errors = errors_of_each(errors, count)
    groups = [np.flatnonzero(which) for which in (running & ~shooters, shooters, ~running) if which.any()]
    found = []
    for some in groups:
        of_group = sizes[some], unknown[some], own_errors and [own_errors[k] for k in some.tolist()]
        if not running[some[0]]:
            times = instants(paths, law)[0]
            found.append(_of_drifting(paths[some], field._of(some), times, of_group, many))
            continue
        sets = [own[k] for k in some] if shooters[some[0]] else []
        tracked = TrackedPlan.of(paths[some], field._of(some), law, cancel, sets)
        found.append(_of_tracked(tracked, sight, of_group, least, many))
    return found[0] if len(found) == 1 else _together(found, np.argsort(np.concatenate(groups)))


def _of_tracked(
    tracked: TrackedPlan, sight: Navigation, of_craft: Sequence[Any], bit: Any, many: float
) -> TrackingMargins:
    """Return the margins of spacecraft that all have thrusters, or all have none.

    `of_craft`: bounds on thrust errors, unknown accelerations, and uncertainties of the spacecraft.
    """
    sizes, unknown, errors = of_craft
    loop, (shift, stretch, *turned) = tracked.loop, tracked.deviations[0]
    steady, more, *turning = tracked.feedback
    rest, answer = loop.remainder(sizes, unknown, sight, (more, np.stack(turning, axis=-1)))
    if len(loop.impulse_times):
        rest = rest + loop.missed_gain * np.maximum(tracked.bits, bit) + tracked.ripple
    noise, feedback_noise = loop.noise(sight, sizes)
    spread, random = np.zeros((*shift.shape, 3)), np.full(len(sizes), feedback_noise**2)
    for k, own in enumerate(errors or ()):
        spread[k], variance = tracked.covariances(k, sight, sizes[k], own)
        random[k] += variance
    command = np.linalg.norm(tracked.thrust, axis=-1)
    if not len(loop.impulse_times):
        command = command + np.linalg.norm(steady, axis=-1) + (answer + many * np.sqrt(random))[:, None]
    off = shift + tracked.offset, stretch, np.stack(turned, axis=-1)
    each = sizes, rest, spread, np.full(len(sizes), noise)
    return TrackingMargins(tracked.times, *off, *each, many, command)


def _of_drifting(
    paths: Path, field: Field, times: Floats, of_craft: Sequence[Any], many: float
) -> TrackingMargins:
    """Return the margins of spacecraft without engines, about their drift; see `_of_tracked`."""
    sizes, unknown, errors = of_craft
    moved = paths.orbit.transition(times - times[0])
    rest = unknown * float(np.trapezoid(np.linalg.norm(moved[:, :3, 3:], 2, axis=(1, 2)), times))
    spread, none = np.zeros((len(paths), len(times), 3, 3)), np.zeros((len(paths), len(times)))
    for k, own in enumerate(errors or ()):
        spread[k] = moved[:, :3] @ own.state @ moved[:, :3].swapaxes(1, 2)
        spread[k] += own.noise * process_noise_covariances(paths.orbit, times)[:, :3, :3]
    shift = field._drift(paths).position(times) - paths.position(times)
    off = shift, np.zeros_like(shift), np.zeros_like(spread)
    return TrackingMargins(times, *off, sizes, rest, spread, none[:, 0], many, none)


def _together(parts: Sequence[TrackingMargins], order: Any) -> TrackingMargins:
    """Return the margins of all spacecraft from those of parts, in this order."""
    joined: Any = {
        name: np.concatenate([getattr(one, name) for one in parts])[order]
        for name in ("shift", "stretch", "turn", "thrust_error", "rest", "spread", "noise", "command")
    }
    return replace(parts[0], **joined)


@dataclass(frozen=True, eq=False)
class TrackedPlan:
    """Planned paths (N,) at T `times`, under feedback by a `loop`.

    The impulses or pulses of the `guidance` cause a known `offset` (N, T, 3) [m] from the plan, and a
    `ripple` (N,) [m] between times. Continuous thrust is that of the plan plus the `compensation` (N, T, 3)
    [m/s^2] of the model error, of which the `uncompensated` part (N, T, 3) remains.
    """

    paths: Path
    guidance: Guidance
    loop: ClosedLoop
    times: Floats
    offset: Floats
    ripple: Floats
    compensation: Floats
    uncompensated: Floats

    @classmethod
    def of(
        cls,
        paths: Path,
        field: Field,
        law: Feedback,
        cancel: bool,
        thrusters: Sequence[ThrusterStages | None],
    ) -> Self:
        """Return the paths as `simulate` tracks them in a known field.

        `cancel`: compensate the model error.
        """
        times, every, steps = instants(paths, law)
        loop = ClosedLoop.of(paths.orbit, law, every, steps, bool(thrusters))
        left_out = path_residuals(field, paths, times)
        guidance = Guidance.of(paths, field, law, thrusters, cancel)
        spans = ThrustSpans.of(paths, law)
        moved, compensated = spans.impulsive_at(times), cancel & spans.compensated(times)
        fine = np.linspace(times[0], times[-1], RIPPLE * (len(times) - 1) + 1)
        off = np.zeros((len(paths), len(fine), 3))
        if guidance.reference is not paths:
            off = guidance.reference.position(fine) - paths.position(fine)
        straight = np.linspace(off[:, :-1:RIPPLE], off[:, RIPPLE::RIPPLE], RIPPLE, endpoint=False, axis=2)
        ripple = np.linalg.norm(off[:, :-1] - straight.reshape(off[:, :-1].shape), axis=-1).max(axis=1)
        compensation = -left_out * compensated[..., None]
        uncompensated = left_out * ~(compensated | moved & cancel)[..., None]
        return cls(paths, guidance, loop, times, off[:, ::RIPPLE], ripple, compensation, uncompensated)

    @property
    def bits(self) -> Floats:
        """Largest impulse (N,) [m/s] that thrusters do not fire: one bit of each of three."""
        own = [max(map(_least_push, one.thrusters)) for one in self.guidance.thrusters if one is not None]
        return np.array(own or np.zeros(len(self.paths)))

    @cached_property
    def thrust(self) -> Floats:
        """Continuous thrust (N, T, 3) [m/s^2], as commanded without errors."""
        return np.asarray(self.paths.thrust(self.times) + self.compensation)

    @cached_property
    def deviations(self) -> tuple[Floats, Floats]:
        """True deviations (5, N, T, 3) [m] and believed ones (5, N, I, 6) for each of five causes.

        The uncompensated acceleration, thrust larger by 100 %, and thrust rotated by 1 rad about each axis.
        """
        orbit, times, thrust = self.paths.orbit, self.times, self.thrust
        pushes = [self.uncompensated, *np.einsum("kij,ntj->knti", KINDS, thrust)]
        coasting = deviations_of(orbit, times, np.concatenate(pushes)).reshape(5, *thrust.shape[:2], 6)
        jumps = np.einsum("kij,mj->mki", KINDS, self.guidance.impulses.impulse)
        for k, when, sizes in zip(
            self.guidance.impulses.craft, self.guidance.impulses.time, jumps, strict=True
        ):
            after = times > when + SAME  # a measurement at that instant precedes the impulse
            moved = orbit.transition(times[after] - when)[:, :, 3:]
            coasting[1:, k, after] += np.einsum("tij,rj->rti", moved, sizes)
        for k, when, state in self.guidance.missed:
            after = times > when + SAME
            coasting[0, k, after] += orbit.transition(times[after] - when) @ state
        off, believed = self.loop.propagate(coasting.reshape(-1, len(times), 6))
        return off.reshape(5, *thrust.shape), believed.reshape(5, len(thrust), *believed.shape[1:])

    @cached_property
    def feedback(self) -> Floats:
        """Feedback thrust (5, N, T, 3) [m/s^2], or impulses (5, N, Q, 3) [m/s], for each cause."""
        believed = self.deviations[1]
        found = self.loop.commands(np.concatenate(believed), len(self.times))
        return found.reshape(*believed.shape[:2], -1, 3)

    def covariances(
        self, craft: int, sight: Navigation, size: Floats, errors: Uncertainty
    ) -> tuple[Floats, float]:
        """Return the covariances (T, 3, 3) [m^2] due to the `errors` of a spacecraft.

        Also return a bound on the variance of the feedback in any direction, in m^2/s^4, or in m^2/s^2 for
        impulses. `size` (2,) bounds the constant thrust errors.
        """
        loop, count, own = self.loop, len(self.times), self.guidance.impulses.craft == craft
        path, compensation = self.paths[craft], self.compensation[craft]
        if (firing := self.guidance.firing) is not None:  # pulses are the only burns
            own, path, compensation = np.zeros_like(own), firing.path[craft], np.zeros_like(compensation)
        jumps = self.guidance.impulses.time[own], self.guidance.impulses.impulse[own]
        off, believed = loop.propagate(open_loop_errors(path, errors, self.times, jumps, compensation))
        feedback = [_squares(loop.commands(believed, count))]
        share, angle = size
        known, biased = self.deviations[1][:, craft], islice(loop.biased_states(), believed.shape[1])
        seen = np.reshape([state + loop.prediction for state in biased], (-1, 6, 6)).transpose(2, 0, 1)
        causes = [known[:1], share * known[1:2], (1.0 + share) * angle * known[2:]]
        causes += [sight.position_bias * seen[:3], sight.velocity_bias * seen[3:]]
        causes = [one for one in causes if one.any()]  # correlated causes: bound on the square of their sum
        moments = _squares(believed) + len(causes) * sum(map(_squares, causes), np.zeros((6, 6)))
        found = _squares(off)
        if errors.noise:
            noise, known_noise = loop.noise_covariances(errors.noise, count)
            found, moments = found + noise, moments + known_noise
            feedback.append(loop.law @ known_noise[:, None] @ loop.law.swapaxes(-1, -2))
        executed = errors if firing is None else errors._of_orders
        found += loop.execution_covariances(sight, executed, moments, count)
        return found, sum(float(np.linalg.eigvalsh(one)[..., -1].max(initial=0.0)) for one in feedback)


def instants(paths: Path, law: Feedback) -> tuple[Floats, float, int]:
    """Return times (T,) along paths (N,), the time between measurements [s], and the steps in it."""
    start, end = float(paths.start[0]), float(paths.end[0])
    intervals = intervals_in(end - start, law.every)
    every = (end - start) / intervals
    steps = _steps(min(law.delay / every, 1.0), every)
    return np.linspace(start, end, steps * intervals + 1), every, steps


def open_loop_errors(
    path: Path, errors: Uncertainty, times: Floats, jumps: tuple[Floats, Floats], compensation: Floats
) -> Floats:
    """Return the deviations (R, T, 6) [m, m/s] of one spacecraft, for one standard deviation of each error.

    The errors are those of its initial state, its impulses and its burns.

    `jumps` are the times (Q,) and sizes (Q, 3) of its impulses; `compensation` (T, 3) is thrust that the plan
    does not contain.  # theory (50)
    """
    orbit, found = path.orbit, [np.empty((0, len(times), 6))]
    if errors.state.any():
        found.append(np.moveaxis(orbit.transition(times - times[0]) @ errors._root, -1, 0))
    for when, size in zip(*jumps, strict=True) if any(errors.impulse) else ():
        moved = orbit.transition(np.maximum(times - when, 0.0))[..., 3:] @ impulse_errors(size, errors).T
        found.append(np.moveaxis(moved * (times > when + SAME)[:, None, None], -1, 0))
    if errors.magnitude or errors.pointing:
        sizes = np.array([errors.magnitude, *[errors.pointing] * 3])[:, None, None]
        found += [sizes * own for own in _burns(path, times, compensation)]
    return np.concatenate(found)


def _burns(path: Path, times: Floats, compensation: Floats) -> Iterator[Floats]:
    """Yield deviations (4, T, 6) due to each burn larger by 100 %, and rotated by 1 rad about each axis."""
    edges = burn_edges(path)
    columns = columns_of(path, UNIT).state(times).reshape(-1, len(KINDS), len(times), 6)
    own = np.searchsorted(edges, [path.arcs[first, START] for first, _ in burn_ranges(path)], side="right")
    which = np.searchsorted(edges, times, side="right")
    for k in range(len(edges) + 1) if compensation.any() else own:
        done = np.einsum("kij,tj->kti", KINDS, compensation * (which == k)[:, None])
        yield deviations_of(path.orbit, times, done) + columns[own == k].sum(axis=0)


def _least_push(thrusters: Thrusters) -> float:
    """Return the largest sum [m/s] of partial bits of the thrusters of any facet."""
    allocation = Allocation.of(thrusters.directions)
    bits = np.vstack([thrusters.directions * np.reshape(thrusters.minimum_bit, (-1, 1)), np.zeros((6, 3))])
    some = np.array(list(product((0.0, 1.0), repeat=3)))
    return float(np.linalg.norm(some @ bits[allocation.corners], axis=-1).max())


def _squares(rows: Floats) -> Floats:
    """Return second moments (K, D, D) of independent rows (R, K, D)."""
    return np.asarray(np.einsum("rki,rkj->kij", rows, rows))


def _steps(delay: float, every: float) -> int:
    """Return the number of steps in an interval [s] for which a relative `delay` is a whole number."""
    least = min(max(STEPS, 2 * intervals_in(0.5 * every, OFTEN)), MOST)
    some = range(least, MOST, 2)
    return next((n for n in some if abs(n * delay - round(n * delay)) < NEAR), MOST)


def required_margins(
    found: TrackingMargins, paths: Path, zones: PairZones, planned: int
) -> tuple[Any, Floats]:
    """Return pairs (P, 2) with a zone, and the margin (P,) [m] that each requires where violated, or 0.

    `paths` and `zones` are of the N spacecraft and, after them, bodies with exact paths; each pair includes
    one of the first `planned` bodies. The margin counts along the zone's normal at the pair's relative
    position, also at minima between two times.  # theory (93)
    """
    places, pairs, most = paths.position(found.times), [], []
    for zone, some in zones.groups():
        for pair in some[some[:, 0] < planned].tolist():
            i, j = pair
            off, needed = _distance_and_margin(found, zone, pair, found.times, places[i] - places[j])
            greatest = needed[off < needed].max(initial=0.0)
            times, left = _dips(found.times, off - needed)
            for _ in range(CLOSER):
                times = _about_least(times, left)
                one, other = paths[pair].position(times.ravel())
                off, needed = _distance_and_margin(found, zone, pair, times.ravel(), one - other)
                left = (off - needed).reshape(times.shape)
                greatest = max(greatest, needed[off < needed].max(initial=0.0))
            pairs.append(pair)
            most.append(greatest)
    return np.array(pairs, dtype=np.int64).reshape(-1, 2), np.array(most)


def _dips(times: Floats, left: Floats) -> tuple[Floats, Floats]:
    """Return times (C, 3) of local minima of the remaining distance with their neighbours, and its values."""
    beside = np.pad(times, 1, mode="edge"), np.pad(left, 1, constant_values=np.inf)
    times, left = (sliding_window_view(one, 3) for one in beside)
    least = left.argmin(axis=1) == 1
    return times[least], left[least]


def _about_least(times: Floats, left: Floats) -> Floats:
    """Return times (C, FINER + 1) between the neighbours of the minimum."""
    rows, k = np.arange(len(times)), left.argmin(axis=1)
    begin = times[rows, np.maximum(k - 1, 0)]
    end = times[rows, np.minimum(k + 1, times.shape[1] - 1)]
    return np.asarray(begin[:, None] + (end - begin)[:, None] * np.linspace(0.0, 1.0, FINER + 1))


def _distance_and_margin(
    found: TrackingMargins, zone: Zone, pair: Sequence[int], times: Floats, apart: Floats
) -> tuple[Floats, Floats]:
    """Return the distance of a pair from its zone (T,) [m] at `apart` (T, 3), and the required margin."""
    off, normals = gap(zone, apart)
    shift, most, square = _along(found, pair[0], times, normals)
    if pair[1] < len(found.shift):
        other = _along(found, pair[1], times, normals)
        shift, most, square = shift - other[0], most + other[1], square + other[2]
    return off, most - shift + found.sigmas * np.sqrt(square)


def _along(
    found: TrackingMargins, craft: int, times: Floats, normals: Floats
) -> tuple[Floats, Floats, Floats]:
    """Return a craft's expected deviation along normals (T, 3) [m], the bound on the rest, and variance."""
    shift, stretch, turn, spread = (
        _between(found.times, one[craft], times)
        for one in (found.shift, found.stretch, found.turn, found.spread)
    )
    larger, angle = found.thrust_error[craft]
    off = larger * np.abs((stretch * normals).sum(axis=-1))
    turned = np.einsum("tij,ti->tj", turn, normals)
    off += (1.0 + larger) * angle * np.linalg.norm(turned, axis=-1)
    square = np.einsum("ti,tij,tj->t", normals, spread, normals) + found.noise[craft] ** 2
    return (shift * normals).sum(axis=-1), off + found.rest[craft], square


def _between(known: Floats, values: Floats, times: Floats) -> Floats:
    """Return values at times (K, ...), interpolated linearly between those (T, ...) at known times."""
    k = np.clip(np.searchsorted(known, times, "right") - 1, 0, len(known) - 2)
    share = (times - known[k]) / (known[k + 1] - known[k])
    return np.asarray(((1.0 - share) * values[k].T + share * values[k + 1].T).T)
