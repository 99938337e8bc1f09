"""Flight: a plan flown in a field many times, with measurements and thrust as they are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from closeform.arrays import Floats, instance, number, shown, whole
from closeform.field.chief_frame import ChiefFrame
from closeform.field.drag import ballistics_of
from closeform.field.feedback import Feedback, Navigation, way_back
from closeform.field.field import Field
from closeform.field.flown_plan import paths_to_fly
from closeform.field.flying import Course, fly_all
from closeform.field.least_ratios import least_ratios
from closeform.field.residual import residuals
from closeform.motion.arc import IMPULSE
from closeform.motion.mean_motion import checked
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path
from closeform.result import Rows
from closeform.zones.pair_zones import PairZones
from closeform.zones.zone import Zone

LONGEST = 5.0  # s: a step, in which thrust may begin to turn


@dataclass(frozen=True, eq=False, repr=False)
class Flight(Rows):
    """S flights of N craft in a field; made by `fly`.

    Attributes
    ----------
    times : array of shape (T,) [s]
        Since the chief's epoch.
    states : array of shape (S, N, T, 6) [m, m/s]
        Flown, in the chief's axes.
    ends : array of shape (S, N) [m]
        How far off the plan each craft ends.
    delta_v : array of shape (S, N) [m/s]
        Spent: the sum of the three that follow.
    planned_delta_v : array of shape (N,) [m/s]
        Of the plan.
    field_delta_v : array of shape (N,) [m/s]
        What it takes beyond that to command against what Hill's equations leave out; negative where that
        helps, 0 without `cancel`.
    pairs : array of int of shape (P, 2)
        Pairs i < j that have a zone.
    ratios : array of shape (S, P), no unit
        The least of each pair and flight, at these times and between them.
    orbit : Orbit
        In which the plan was made.
    """

    _columns: ClassVar = {
        "seed": "seed",
        "craft": "craft",
        "ends": "end_m",
        "delta_v": "delta_v_m_s",
        "feedback_delta_v": "feedback_delta_v_m_s",
    }
    _told: ClassVar = ("greatest_end", "greatest_delta_v", "least_ratio", "violated", "worst")

    times: Floats
    states: Floats
    ends: Floats
    delta_v: Floats
    planned_delta_v: Floats
    field_delta_v: Floats
    pairs: Any
    ratios: Floats
    orbit: Orbit

    @property
    def seed(self) -> Any:
        """Which flight each row of `columns` is of (S, N), no unit."""
        return np.broadcast_to(np.arange(len(self.ends))[:, None], self.ends.shape)

    @property
    def craft(self) -> Any:
        """Which craft each row of `columns` is of (S, N), no unit."""
        return np.broadcast_to(np.arange(self.ends.shape[1]), self.ends.shape)

    @property
    def feedback_delta_v(self) -> Any:
        """What each craft spends beyond what is commanded (S, N) [m/s]: on errors of all kinds, less what
        errors and limits of thrust keep back.
        """
        return self.delta_v - self.planned_delta_v - self.field_delta_v

    @property
    def greatest_end(self) -> float:
        """How far off the plan a craft ends at most [m]."""
        return float(self.ends.max())

    @property
    def greatest_delta_v(self) -> float:
        """What a craft spends at most [m/s]."""
        return float(self.delta_v.max())

    @property
    def least_ratio(self) -> float:
        """The least of all pairs and flights, no unit; inf without zones."""
        return float(self.ratios.min(initial=np.inf))

    @property
    def violated(self) -> float:
        """The share of flights in which a zone is entered, no unit."""
        return float((self.ratios < 1.0).any(axis=1).mean())

    @property
    def worst(self) -> int:
        """The flight in which a pair comes nearest, or without zones a craft ends farthest off."""
        by_end = int(np.argmax(self.ends.max(axis=1)))
        return int(np.argmin(self.ratios.min(axis=1))) if self.ratios.size else by_end

    def path(self, seed: int) -> Path:
        """What was flown, as paths: `screen` certifies what they say.

        Parameters
        ----------
        seed : int
            Which flight.

        Returns
        -------
        Path
            Of shape (N,), through its states.

        Raises
        ------
        ValueError
            If there is no such flight.

        References
        ----------
        docs/field.md.
        """
        if whole("seed", seed) >= len(self.states):
            raise ValueError(f"seed: there are {len(self.states)} flights, got {seed}")
        return self.orbit.sampled(self.times, self.states[seed])


def fly(
    plan: Any,
    field: Field,
    control: Literal["track", "open"] = "track",
    feedback: Feedback | None = None,
    navigation: Navigation | None = None,
    zones: Zone | PairZones | None = None,
    cancel: bool = True,
    known: Field | None = None,
    thrust_error: tuple[float, float] = (0.0, 0.0),
    max_acceleration: float | None = None,
    seeds: int = 1,
) -> Flight:
    """Fly planned paths in a field, as often as asked, with errors drawn anew each time.

    Parameters
    ----------
    plan : Plan, Avoidance or Path
        Of one craft or of N without impulses, in the chief's Hill frame with straight axes, times since its
        epoch.
    field : Field
        In which they fly.
    control : {"track", "open"}, default "track"
        Measure and come back to the planned path, or play the thrust as commanded.
    feedback : Feedback, optional
        How often, and within which horizon; each minute and ten of them unless given.
    navigation : Navigation, optional
        How well they are measured; exactly unless given.
    zones : Zone or PairZones, optional
        Of all pairs, or of each; without it no ratios are told.
    cancel : bool, default True
        Whether the plan's thrust is corrected by what Hill's equations leave out, as `thrust` does.
    known : Field, optional
        The field that this is taken from; the one that is flown in unless given.
    thrust_error : tuple of two floats, no unit and [rad], default (0, 0)
        By how much each craft's thrust is off at most, as a share of its size, and in direction; drawn evenly
        for each flight, through which it stays.
    max_acceleration : float [m/s^2], optional
        That thrust never exceeds.
    seeds : int, default 1
        How many flights; a flight's errors are the same however many others there are.

    Returns
    -------
    Flight
        States, what they cost, and how near pairs came.

    Raises
    ------
    ValueError
        If the plan has no paths or has impulses, is of deep space, its mean motion is not the chief's, or an
        argument is of another kind.

    References
    ----------
    docs/theory.md (85) and (86).

    Examples
    --------
    >>> import closeform as cf
    >>> chief = cf.Chief.from_elements("2026-11-22T12:00:00", [6.878e6, 0.0, 1e-3, 0.0, 0.9, 0.0])
    >>> path = chief.orbit.transfer([0, 200, 0, 0, 0, 0], [0, 50, 0, 0, 0, 0], 3000.0)
    >>> flown = cf.fly(path, cf.Field(chief), navigation=cf.Navigation(0.1, 3e-4), seeds=20)
    >>> flown.greatest_end < 0.4
    True
    """
    paths = paths_to_fly(plan, field)
    if not isinstance(control, str) or control not in ("track", "open"):
        raise ValueError(f'control: "track" or "open", got {shown(control)}')
    if paths.arcs[:, IMPULSE : IMPULSE + 3].any():
        raise ValueError(
            "plan: has impulses; plan burns, by max_acceleration, which can be flown with feedback"
        )
    instance("cancel", cancel, bool)
    instance("known", known, Field, type(None))
    instance("zones", zones, Zone, PairZones, type(None))
    law = instance("feedback", Feedback() if feedback is None else feedback, Feedback)
    sight = instance("navigation", Navigation() if navigation is None else navigation, Navigation)
    sizes = np.asarray(checked("thrust_error", thrust_error))
    if sizes.shape != (2,) or not (sizes >= 0.0).all():
        raise ValueError(f"thrust_error: two numbers, 0 or more, got {shown(thrust_error)}")
    limit = np.inf if max_acceleration is None else number("max_acceleration", max_acceleration)
    if not limit > 0.0:
        raise ValueError(f"max_acceleration: must be positive, got {limit:g}")
    flights, track = whole("seeds", seeds, 1), control == "track"
    times, measured = _steps(paths, law.every if track else None)
    course = _course(
        paths, times, field, (known or field) if cancel else None, law if track else None, measured, limit
    )
    steps, count = len(times) // 2, len(paths.start)
    draws = [
        _drawn(seed, count, steps // measured + 1 if track else 1, sight, sizes) for seed in range(flights)
    ]
    wrong, errors = (np.stack([one[k] for one in draws]) for k in (0, 1))
    states, spent = np.empty((flights, count, steps + 1, 6)), np.empty((flights, count))
    h = float(times[2] - times[0])
    fly_all(field._constants, course, h, measured if track else 0, wrong, errors, states, spent)
    ends = np.linalg.norm(states[:, :, -1, :3] - course.planned[:, -1, :3], axis=2)
    planned = np.array(paths.delta_v)
    coarse, asked = (_spent(one, h) for one in (paths.thrust(times), course.commanded))
    spent += planned - coarse  # what Simpson's rule leaves out at kinks of the plan
    found = [least_ratios(one, h, zones) for one in states]
    ratios = np.array([ratio for _, ratio in found])
    told = times[::2], states, ends, spent, planned, asked - coarse
    return Flight(*told, found[0][0], ratios, paths.orbit)


def _spent(thrust: Floats, h: float) -> Floats:
    """The delta-v (N,) [m/s] of thrust (N, 2 K + 1, 3) at half steps, by Simpson's rule as in flights."""
    size = np.linalg.norm(thrust, axis=2)
    return np.asarray(h / 6.0 * (size[:, :-1:2] + 4.0 * size[:, 1::2] + size[:, 2::2]).sum(axis=1))


def _steps(paths: Path, every: float | None) -> tuple[Floats, int]:
    """Half steps (2 K + 1,) [s], and how many whole ones there are from one measurement to the next."""
    start, end = float(paths.start[0]), float(paths.end[0])
    if every is None:
        steps = max(1, int(np.ceil((end - start) / LONGEST)))
        return np.linspace(start, end, 2 * steps + 1), steps
    intervals = int(np.ceil((end - start) / every))  # of equal length
    each = int(np.ceil((end - start) / intervals / LONGEST))
    return np.linspace(start, end, 2 * each * intervals + 1), each


def _course(
    paths: Path,
    times: Floats,
    field: Field,
    known: Field | None,
    law: Feedback | None,
    measured: int,
    limit: float,
) -> Course:
    """What all flights share."""
    frame, states = ChiefFrame.of(field, times), paths.state(times)
    commanded = paths.thrust(times)
    if known is not None:
        believed = frame if known is field else ChiefFrame.of(known, times)
        commanded = commanded - residuals(known, believed, states, paths.orbit.mean_motion)
    since = times[: 2 * measured + 1] - times[0]
    back = np.zeros((len(since), 3, 6)) if law is None else way_back(paths.orbit, law.horizon, since)[2]
    count = len(states)
    chief = frame.states[:, :3], frame.states[:, 3:], frame.felt, frame.axes, frame.turn
    craft = commanded, states[:, ::2], back, ballistics_of(field.drag, count), np.full(count, limit)
    return Course(*(np.ascontiguousarray(one, dtype=float) for one in (*chief, *craft)))


def _drawn(
    seed: int, count: int, measurements: int, sight: Navigation, sizes: Floats
) -> tuple[Floats, Floats]:
    """Errors of measurements (N, M, 6) and of thrust (N, 4) of one flight: its own stream of Philox."""
    draws = np.random.Generator(np.random.Philox(key=seed))
    ways = draws.normal(size=(count, 3, 3))
    ways /= np.linalg.norm(ways, axis=2, keepdims=True)
    shares = draws.uniform([-1.0, 0.0], 1.0, (count, 2)) * sizes
    errors = np.hstack([shares[:, :1], shares[:, 1:] * ways[:, 2]])
    stays = ways[:, :2] * np.array([sight.position_bias, sight.velocity_bias])[:, None]
    white = draws.normal(size=(measurements, count, 6)).swapaxes(0, 1)
    white = white * np.repeat([sight.position, sight.velocity], 3)
    return np.ascontiguousarray(white + stays.reshape(count, 1, 6)), errors
