"""Tracking errors of spacecraft under feedback along a plan, and the margins that pairs require."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike

from closeform.arrays import Floats, instance, number, of_each
from closeform.dynamics.control.closed_loop import process_noise_covariances
from closeform.dynamics.control.feedback import Feedback, Navigation, default_feedback, nonnegative
from closeform.dynamics.force_model.field import Field
from closeform.dynamics.infeasible import Infeasible
from closeform.dynamics.margins.error_propagation import TrackedPlan, instants
from closeform.dynamics.planned_paths import checked_paths, running_engines
from closeform.dynamics.simulation.random_errors import errors_of_each, thrust_errors
from closeform.dynamics.simulation.thruster_pulses import lacks_axis, pulse_feedback
from closeform.fuel.thrusters import Thrusters, each_set
from closeform.motion.path import Path, fires_impulses
from closeform.result import Result
from closeform.zones.padding import gap
from closeform.zones.pair_zones import PairZones
from closeform.zones.zone import Zone

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
    thrust : array of shape (N,) [m/s^2]
        Largest thrust required with feedback, without impulses. The margins do not hold for a craft whose
        thrust limit is lower than that.
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
    thrust: Floats

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
        times = np.concatenate([[begin], self.times[self.times > begin]])
        later: Any = {
            name: np.array([_between(self.times, one, times) for one in getattr(self, name)])
            for name in ("shift", "stretch", "turn", "spread")
        }
        return replace(self, times=times, **later)


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
    thrusters: Thrusters | Sequence[Thrusters | None] | None = None,
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
    thrusters : Thrusters or sequence of Thrusters or None, optional
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
    own, count = each_set(thrusters, len(paths)), len(paths)
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
        for k in np.flatnonzero(shooters).tolist():
            if lacks_axis(own[k]):
                raise Infeasible(
                    f"thrusters: craft {k}: an axis without a thruster is not controlled, so that its drift "
                    "is not bounded; add a thruster, or give a margin in metres"
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
        sets = [own[k] for k in some] if shooters[some[0]] else None
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
    thrust = np.linalg.norm(tracked.thrust, axis=-1).max(axis=1)
    if not len(loop.impulse_times):
        thrust = thrust + np.linalg.norm(steady, axis=-1).max(axis=1) + answer + many * np.sqrt(random)
    off = shift + tracked.offset, stretch, np.stack(turned, axis=-1)
    each = sizes, rest, spread, np.full(len(sizes), noise)
    return TrackingMargins(tracked.times, *off, *each, many, thrust)


def _of_drifting(
    paths: Path, field: Field, times: Floats, of_craft: Sequence[Any], many: float
) -> TrackingMargins:
    """Return the margins of spacecraft without engines, about their drift; see `_of_tracked`."""
    sizes, unknown, errors = of_craft
    moved = paths.orbit.transition(times - times[0])
    rest = unknown * float(np.trapezoid(np.linalg.norm(moved[:, :3, 3:], 2, axis=(1, 2)), times))
    spread, none = np.zeros((len(paths), len(times), 3, 3)), np.zeros(len(paths))
    for k, own in enumerate(errors or ()):
        spread[k] = moved[:, :3] @ own.state @ moved[:, :3].swapaxes(1, 2)
        spread[k] += own.noise * process_noise_covariances(paths.orbit, times)[:, :3, :3]
    shift = field._drift(paths).position(times) - paths.position(times)
    off = shift, np.zeros_like(shift), np.zeros_like(spread)
    return TrackingMargins(times, *off, sizes, rest, spread, none, many, none)


def _together(parts: Sequence[TrackingMargins], order: Any) -> TrackingMargins:
    """Return the margins of all spacecraft from those of parts, in this order."""
    joined: Any = {
        name: np.concatenate([getattr(one, name) for one in parts])[order]
        for name in ("shift", "stretch", "turn", "thrust_error", "rest", "spread", "noise", "thrust")
    }
    return replace(parts[0], **joined)


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
