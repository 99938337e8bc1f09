"""Room: how far craft under feedback are off one plan at each of its times, and what pairs need of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike

from closeform.arrays import Floats, instance, number, of_each
from closeform.dynamics.drawn import drawable
from closeform.dynamics.engines import running_engines
from closeform.dynamics.feedback import Feedback, Navigation, nonnegative, thrust_errors, usual_feedback
from closeform.dynamics.field import Field
from closeform.dynamics.flown_plan import paths_to_fly
from closeform.dynamics.followed import Followed, instants
from closeform.dynamics.infeasible import Grounded
from closeform.dynamics.natural import drifting
from closeform.dynamics.reachable import lacks
from closeform.fuel.thrusters import Thrusters, each_set
from closeform.motion.path import Path, fires_impulses
from closeform.result import Result
from closeform.zones.padding import gap
from closeform.zones.pair_zones import PairZones
from closeform.zones.zone import Zone

CLOSER, FINER = 4, 16  # times that the two steps about a least are looked at anew, in so many parts


@dataclass(frozen=True, eq=False, repr=False)
class TrackingMargins(Result):
    """How far N craft are off their planned paths at T times, under feedback; made by `room`.

    Attributes
    ----------
    times : array of shape (T,) [s]
        Since the chief's epoch.
    shift : array of shape (N, T, 3) [m]
        Where they are expected to be off: by what is known of the field and not commanded against, and
        where impulses lead that are changed for it, or craft drift that have no engine; in the chief's axes.
    stretch : array of shape (N, T, 3) [m]
        How much further for thrust that is larger by the whole of itself, in the chief's axes.
    turn : array of shape (N, T, 3, 3) [m/rad]
        The same of thrust that is turned about each of the chief's axes, in columns.
    thrust_error : array of shape (N, 2), no unit and [rad]
        By how much thrust is off at most: a share of its size, and in direction.
    rest : array of shape (N,) [m]
        What else they are off at most: by accelerations that nobody knows, and measurements that are off by
        something constant.
    spread : array of shape (N, T, 3, 3) [m^2]
        Covariances of what errors of each burn and impulse, and of states at the start, leave; in the chief's
        axes.
    noise : array of shape (N,) [m]
        The standard deviation, in the worst direction, from measurements that are off at random.
    sigmas : float, no unit
        As many of which count.
    thrust : array of shape (N,) [m/s^2]
        The most that each is asked for, with what feedback adds, but for impulses; with a lower limit no room
        is known.
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
        """How far off each craft is at each time, in any direction (N, T) [m]."""
        share, angle = self.thrust_error.T[..., None, None]
        larger, turned = share * self.stretch, ((1.0 + share) * angle)[..., None] * self.turn
        aligned = np.linalg.norm(np.einsum("ntij,nti->ntj", turned, larger), axis=-1)
        square = (larger**2).sum(axis=-1) + np.linalg.norm(turned, 2, axis=(-2, -1)) ** 2 + 2.0 * aligned
        off = np.linalg.norm(self.shift, axis=-1) + np.sqrt(square)
        random = np.sqrt(self.noise[:, None] ** 2 + np.linalg.eigvalsh(self.spread)[..., -1])
        return np.asarray(off + self.rest[:, None] + self.sigmas * random)

    @property
    def greatest(self) -> Floats:
        """The same at any time (N,) [m]."""
        return np.asarray(self.radius.max(axis=1))

    def _since(self, begin: float) -> TrackingMargins:
        """From some time on [s]."""
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
    """How far craft are off a plan at each of its times, under feedback with errors as `fly` draws them.

    Parameters
    ----------
    plan : Plan, Avoidance or Path
        Of one craft or of N, as of `fly`.
    field : Field
        What is known of the field.
    feedback : Feedback, optional
        How often they are measured, and within which horizon brought back; as of `fly`, for impulses by one
        each five minutes, of six in half an hour, unless given.
    navigation : Navigation, optional
        How well; exactly unless given.
    cancel : bool, default True
        Whether what Hill's equations leave out is commanded against, as by `thrust`.
    residual : array_like of shape (N,) or () [m/s^2], default 0
        Accelerations beyond this field, at most.
    thrust_error : array_like of shape (2,) or (N, 2), no unit and [rad], default (0, 0)
        By how much each craft's thrust is off at most, as a share of its size, and in direction; constant
        through a flight.
    errors : Uncertainty or sequence of Errors or None, optional
        Of each craft, which `fly` draws; without white noise.
    minimum_bit : float [m/s], default 0
        The least impulse of feedback that is fired.
    thrusters : Thrusters or sequence of Thrusters or None, optional
        Of all craft, or of each that has some, as of `fly`: pulses lead off the plan, which is known, and
        what a bit leaves undone is bounded.
    sigmas : float, no unit, default 4
        Of the noise and of `errors`, which count.
    engine : array_like of bool of shape (N,) or (), default True
        Whether each craft has one; without it drifts in the field, as of `fly`.

    Returns
    -------
    TrackingMargins
        By cause, craft and time.

    Raises
    ------
    ValueError
        If the plan has no paths, is of deep space, its mean motion is not the chief's, a number is negative
        or not finite, or an argument is of another kind.

    Notes
    -----
    Errors of thrust that is planned are followed along it, as the plan knows how large it is when; those
    of thrust that feedback adds are bounded, and change what noise makes.  Thrust keeps no limit here:
    `TrackingMargins.thrust` says which it keeps.

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
    paths = paths_to_fly(plan, field)
    own, count = each_set(thrusters, len(paths)), len(paths)
    running = running_engines(engine, paths, field, own)
    shooters = np.array([one is not None for one in own])
    usual = usual_feedback("track", fires_impulses(paths) or bool(shooters.any()))
    law = instance("feedback", usual if feedback is None else feedback, Feedback)
    sight = instance("navigation", Navigation() if navigation is None else navigation, Navigation)
    instance("cancel", cancel, bool)
    sizes = thrust_errors(thrust_error, count)
    least = nonnegative("minimum_bit", number("minimum_bit", minimum_bit))
    many = float(nonnegative("sigmas", number("sigmas", sigmas)))
    unknown = nonnegative("residual", of_each("residual", residual, count))
    if shooters.any():
        for k in np.flatnonzero(shooters).tolist():
            if lacks(own[k]):
                raise Grounded(
                    f"thrusters: craft {k}: to some side none pushes, and how far it drifts there is not "
                    "bounded; add one, or give a margin in metres"
                )
        from closeform.dynamics.pulsed_flight import led_by_pulses  # whose kernels only thrusters need

        if not cancel or least > 0.0:
            raise ValueError(
                "thrusters: have bits of their own, and fly in the field; leave out minimum_bit and cancel"
            )
        law = led_by_pulses(law, own)
    elif least > 0.0 and not law.impulses:
        raise ValueError("minimum_bit: of impulses; give a Feedback by some, or leave it out")
    own_errors = drawable(errors, count)
    if any(one.noise for one in own_errors or ()):
        raise ValueError("errors: a room counts no white noise, which flights draw; leave out `noise`")
    told: Any = sizes, unknown, own_errors
    groups = [np.flatnonzero(who) for who in (running & ~shooters, shooters, ~running) if who.any()]
    found = []
    for some in groups:
        own_told = [None if one is None else [one[k] for k in some] for one in told]
        if not running[some[0]]:
            times = instants(paths, law)[0]
            found.append(_of_drifting(paths[some], field._of(some), times, own_told, many))
            continue
        sets = [own[k] for k in some] if shooters[some[0]] else None
        flight = Followed.of(paths[some], field._of(some), law, cancel, sets)
        found.append(_of_alike(flight, sight, own_told, least, many))
    return found[0] if len(found) == 1 else _together(found, np.argsort(np.concatenate(groups)))


def _of_alike(
    flight: Followed, sight: Navigation, told: Sequence[Any], bit: Any, many: float
) -> TrackingMargins:
    """Of craft that all have thrusters or none; with bounds, unknown accelerations, errors as told."""
    sizes, unknown, errors = np.array(told[0]), np.array(told[1]), told[2]
    loop, (shift, stretch, *turned) = flight.loop, flight.caused[0]
    steady, more, *turning = flight.brought
    rest, answer = loop.beyond(sizes, unknown, sight, (more, np.stack(turning, axis=-1)))
    if len(loop.fired):
        rest = rest + loop.missed * np.maximum(flight.bits, bit) + flight.ripple
    noise, shaking = loop.spread(sight, sizes)
    spread, random = np.zeros((*shift.shape, 3)), np.full(len(sizes), shaking**2)
    for k, own in enumerate(errors or ()):
        spread[k], answers = flight.scattered(k, sight, sizes[k], own)
        random[k] += np.linalg.eigvalsh(answers)[..., -1].max(initial=0.0)
    asked = np.linalg.norm(flight.flown, axis=-1).max(axis=1)
    if not len(loop.fired):
        asked = asked + np.linalg.norm(steady, axis=-1).max(axis=1) + answer + many * np.sqrt(random)
    off = shift + flight.aside, stretch, np.stack(turned, axis=-1)
    return TrackingMargins(flight.times, *off, sizes, rest, spread, np.full(len(sizes), noise), many, asked)


def _of_drifting(
    paths: Path, field: Field, times: Floats, told: Sequence[Any], many: float
) -> TrackingMargins:
    """Of craft without engines: where they drift, with bounds, unknown accelerations, errors as told."""
    sizes, unknown, errors = np.array(told[0]), np.array(told[1]), told[2]
    moved = paths.orbit.transition(times - times[0])
    pushed = np.linalg.norm(moved[:, :3, 3:], 2, axis=(1, 2))
    rest = unknown * float(np.trapezoid(pushed, times))
    spread = np.zeros((len(paths), len(times), 3, 3))
    for k, own in enumerate(errors or ()):
        spread[k] = moved[:, :3] @ own.state @ moved[:, :3].swapaxes(1, 2)
    shift = drifting(paths, field).position(times) - paths.position(times)
    none = np.zeros(len(paths))
    turn = np.zeros_like(spread)
    return TrackingMargins(times, shift, np.zeros_like(shift), turn, sizes, rest, spread, none, many, none)


def _together(parts: Sequence[TrackingMargins], order: Any) -> TrackingMargins:
    """Of craft one part after another, in this order."""
    joined: Any = {
        name: np.concatenate([getattr(one, name) for one in parts])[order]
        for name in ("shift", "stretch", "turn", "thrust_error", "rest", "spread", "noise", "thrust")
    }
    return replace(parts[0], **joined)


def needed_room(found: TrackingMargins, paths: Path, zones: PairZones, planned: int) -> tuple[Any, Floats]:
    """Pairs (P, 2) with a zone, and the most (P,) [m] that each needs where it is nearer than that, or 0.

    `paths` and `zones` are of the N craft and, after them, bodies that are where they are said to be; pairs
    have one of the first that are `planned`.  What is needed counts along the zone's normal where the pair
    is; where it comes nearest between two times of the room, too.                             # theory (93)
    """
    places, pairs, most = paths.position(found.times), [], []
    for zone, some in zones.groups():
        for pair in some[some[:, 0] < planned].tolist():
            i, j = pair
            off, needed = _room_left(found, zone, pair, found.times, places[i] - places[j])
            greatest = needed[off < needed].max(initial=0.0)
            times, left = _dips(found.times, off - needed)
            for _ in range(CLOSER):
                times = _about_least(times, left)
                one, other = paths[pair].position(times.ravel())
                off, needed = _room_left(found, zone, pair, times.ravel(), one - other)
                left = (off - needed).reshape(times.shape)
                greatest = max(greatest, needed[off < needed].max(initial=0.0))
            pairs.append(pair)
            most.append(greatest)
    return np.array(pairs, dtype=np.int64).reshape(-1, 2), np.array(most)


def _dips(times: Floats, left: Floats) -> tuple[Floats, Floats]:
    """Times (C, 3) with the next ones about each (C,) at which less is left than at these, and what is."""
    beside = np.pad(times, 1, mode="edge"), np.pad(left, 1, constant_values=np.inf)
    times, left = (sliding_window_view(one, 3) for one in beside)
    least = left.argmin(axis=1) == 1
    return times[least], left[least]


def _about_least(times: Floats, left: Floats) -> Floats:
    """Times (C, FINER + 1) from the one before that at which the least is left to the one after it."""
    rows, k = np.arange(len(times)), left.argmin(axis=1)
    begin = times[rows, np.maximum(k - 1, 0)]
    end = times[rows, np.minimum(k + 1, times.shape[1] - 1)]
    return np.asarray(begin[:, None] + (end - begin)[:, None] * np.linspace(0.0, 1.0, FINER + 1))


def _room_left(
    found: TrackingMargins, zone: Zone, pair: Sequence[int], times: Floats, apart: Floats
) -> tuple[Floats, Floats]:
    """How far a pair is off its zone (T,) [m] where it is `apart` (T, 3), and how far it needs to be."""
    off, normals = gap(zone, apart)
    shift, most, square = _along(found, pair[0], times, normals)
    if pair[1] < len(found.shift):
        other = _along(found, pair[1], times, normals)
        shift, most, square = shift - other[0], most + other[1], square + other[2]
    return off, most - shift + found.sigmas * np.sqrt(square)


def _along(
    found: TrackingMargins, craft: int, times: Floats, normals: Floats
) -> tuple[Floats, Floats, Floats]:
    """Where one craft is expected along normals (T, 3) [m], how much further at most, and its variance."""
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
    """Values (T, ...) at known times, linear between them, at others (K, ...)."""
    k = np.clip(np.searchsorted(known, times, "right") - 1, 0, len(known) - 2)
    share = (times - known[k]) / (known[k + 1] - known[k])
    return np.asarray(((1.0 - share) * values[k].T + share * values[k + 1].T).T)
