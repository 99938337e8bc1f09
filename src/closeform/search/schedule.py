"""Search: the synchronized turns by which lost craft look for each other.

The sun is along -z.  Group A starts with its boresight along +x, its body x at the sun and its
body y along +y; group B looks the opposite way.  Both make the same turns in space, so that the
boresights stay opposite.  Columns of an attitude are the body axes x, y, z; z is the boresight.
"""

from dataclasses import dataclass
from functools import cached_property
from math import acos, atan2, ceil, cos, degrees, inf, pi, sin, sqrt, tan
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, instance, numbers, shown
from closeform.search.coverage import covered, greatest
from closeform.search.sensor import Sensor, positive

Group = Literal["A", "B"]

SUN = np.array([0.0, 0.0, -1.0])  # direction to it
START_ATTITUDE = {  # columns: body x at the sun, body y, boresight
    "A": np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]),
    "B": np.array([[0.0, 0.0, -1.0], [0.0, -1.0, 0.0], [-1.0, 0.0, 0.0]]),
}
YEAR = 365.25636 * 86400.0  # sidereal, in seconds: how fast the sun's direction turns at 1 AU
COLUMNS = 12  # of a row of a table of legs: START, END, RATE, STEADY (3), COSINE (3), SINE (3)


def rotation(axis: Floats, angle: ArrayLike) -> Floats:
    """Right-handed rotation by `angle` (...) [rad] about a unit axis (3,): matrices (..., 3, 3)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn = np.asarray(angle, dtype=float)[..., None, None]
    along = np.outer(axis, axis)
    return np.asarray(along + np.cos(turn) * (np.eye(3) - along) + np.sin(turn) * cross)


@dataclass(frozen=True, eq=False)
class Leg:
    """One turn of all craft by `angle` [rad] about an inertial `axis` (3,), from `start` to `end` [s].

    `phase` is "IPS", "OPS", "mOPS" or "NFS", `round` counts how often the search has come to such
    phases, `about` is "sun line" or "body y", or "none" where everybody waits; `attitude` (3, 3)
    is group A's at the start.
    """

    start: float
    end: float
    phase: str
    round: int
    about: str
    axis: Floats
    angle: float
    attitude: Floats

    @property
    def row(self) -> Floats:
        """The boresight of A as steady + cosine cos(rate t) + sine sin(rate t), t from the start."""
        boresight = self.attitude[:, 2]
        steady = self.axis * (self.axis @ boresight)
        rate = self.angle / (self.end - self.start)
        sine = np.cross(self.axis, boresight)
        return np.concatenate([[self.start, self.end, rate], steady, boresight - steady, sine])

    def attitude_at(self, time: ArrayLike) -> Floats:
        """A's attitude (..., 3, 3) at `time` (...) [s]."""
        share = (numbers("time", time) - self.start) / (self.end - self.start)
        return rotation(self.axis, self.angle * share) @ self.attitude

    @property
    def sun_angle(self) -> float:
        """Greatest angle [rad] between body x and the sun line; the same for both groups."""
        shade = self.attitude[:, 0]
        steady = self.axis * (self.axis @ shade)
        parts = np.array([steady, shade - steady, np.cross(self.axis, shade)]) @ -SUN
        least = -float(greatest(parts[0], parts[1], parts[2], self.angle))
        return acos(max(-1.0, min(1.0, least)))


@dataclass(frozen=True, eq=False)
class Search:
    """A synchronized search of the sky, made by `Search.modified` or `Search.basic`.

    All craft carry the same `sensor`.  `legs` in order, without the near-field search;
    `tip_angle` [rad] of the out-of-plane turns, `slew_rate` [rad/s] of all of them, `sun_limit`
    [rad] of body x, the shade's normal.
    """

    sensor: Sensor
    slew_rate: float
    sun_limit: float
    tip_angle: float
    legs: tuple[Leg, ...]

    @classmethod
    def modified(cls, sensor: Sensor, slew_rate: float, sun_limit: float) -> Self:
        """S04's search: IPS, mOPS, IPS, mOPS with the tip of S04 eq. 1, for which it proves every lock.

        `sensor` with a half-angle of at least 45 deg; `slew_rate` [rad/s]; `sun_limit` [rad].
        Raises ValueError for a half-angle below 45 deg, a tip above the sun limit (the message
        says which half-angle would do), or numbers that are not positive and finite.
        """
        rate, limit = _limits(slew_rate, sun_limit)
        instance("sensor", sensor, Sensor)
        tip = full_tip(sensor.half_angle)
        if tip > limit:
            enough = ceil(1e4 * degrees(least_half_angle(limit))) / 1e4
            raise ValueError(
                f"sun_limit: a half-angle of {degrees(sensor.half_angle):g} deg needs tips of "
                f"{degrees(tip):.3f} deg, the limit is {degrees(limit):g} deg; "
                f"a half-angle of {enough:.4f} deg would do"
            )
        tips = [1, -2, "sun", 2, "sun", -2, 1]
        return cls(sensor, rate, limit, tip, _legs(rate, 3.0 * pi, tip, "mOPS", tips))

    @classmethod
    def basic(
        cls,
        sensor: Sensor,
        slew_rate: float,
        sun_limit: float,
        in_plane_turn: float = 3.0 * pi,
        tip_angle: float | None = None,
    ) -> Self:
        """H03's search: IPS, OPS, IPS, OPS.

        `sensor` of any half-angle; `slew_rate` [rad/s]; `sun_limit` [rad]; `in_plane_turn` [rad] of
        each IPS (H03: one and a half turns, one in its simulation); `tip_angle` [rad], None for the
        sun limit.  Raises ValueError for a tip above the sun limit or numbers that are not positive
        and finite.
        """
        rate, limit = _limits(slew_rate, sun_limit)
        turn = positive("in_plane_turn", in_plane_turn)
        instance("sensor", sensor, Sensor)
        tip = limit if tip_angle is None else positive("tip_angle", tip_angle)
        if tip > limit:
            raise ValueError(
                f"tip_angle: {degrees(tip):g} deg is above the sun limit of {degrees(limit):g} deg; "
                f"tip by at most that"
            )
        return cls(sensor, rate, limit, tip, _legs(rate, turn, tip, "OPS", [1, -2, "sun", 2, -1]))

    @property
    def duration(self) -> float:
        """Length of all legs [s]: of a search as made, that is without the near-field search."""
        return self.legs[-1].end

    @cached_property
    def table(self) -> Floats:
        """The legs as rows (L, 12) for the march: start, end, rate and the boresight's three vectors."""
        return np.array([leg.row for leg in self.legs])

    @property
    def phases(self) -> tuple[tuple[str, int, float, float], ...]:
        """Each phase: its name, round, start and end [s]."""
        spans: dict[tuple[str, int], tuple[float, float]] = {}
        for leg in self.legs:
            key = (leg.phase, leg.round)
            spans[key] = (spans.get(key, (leg.start, 0.0))[0], leg.end)
        return tuple((phase, number, *span) for (phase, number), span in spans.items())

    def attitude(self, t: ArrayLike, group: Group = "A") -> Floats:
        """Attitude (..., 3, 3) of a `group` at times `t` (...) [s]: columns are body x, y, z in the frame.

        Raises ValueError for a time outside of the search or a group that is neither "A" nor "B".
        """
        _known(group)
        times = numbers("t", t)
        if times.size and not (times.min() >= 0.0 and times.max() <= self.duration):
            raise ValueError(f"t: must lie in the search, from 0 to {self.duration:g} s")
        starts = np.array([leg.start for leg in self.legs])
        leg_of = np.searchsorted(starts, times, side="right") - 1
        out = np.empty((*times.shape, 3, 3))
        for k, leg in enumerate(self.legs):
            out[leg_of == k] = leg.attitude_at(times[leg_of == k])
        return out if group == "A" else out * [1.0, -1.0, -1.0]

    def boresight(self, t: ArrayLike, group: Group = "A") -> Floats:
        """Boresight (..., 3) of a `group` at times `t` (...) [s], a unit vector.  Raises as `attitude`."""
        return self.attitude(t, group)[..., 2]

    @property
    def sun_angle(self) -> float:
        """Greatest angle [rad] of body x from the sun line in any leg, of either group."""
        return max(leg.sun_angle for leg in self.legs)

    @property
    def sun_drift(self) -> float:
        """How far [rad] the sun itself moves during the search at 1 AU, which the search neglects."""
        return 2.0 * pi * self.duration / YEAR

    @property
    def near_field(self) -> float:
        """Length [m] along the sun line of the region that one craft's own cone never covers (H03 fig. 6).

        0 for a sensor at the centre of mass; inf where the tip is too small to reach the sun line.
        Two craft facing each other need twice as much: their sensors are two offsets apart.
        """
        if self.sensor.offset == 0.0:
            return 0.0
        # a point h up the sun line, seen from the sensor at its highest tip, lies on the cone:
        # h sin(tip) - rho = c sqrt(rho^2 + h^2 - 2 rho h sin(tip))                     # theory (16)
        reach, c = sin(self.tip_angle), self.sensor.cosine
        if reach <= c:
            return inf
        a, b, ss = reach * reach - c * c, reach * (1.0 - c * c), 1.0 - c * c
        root = sqrt(max(0.0, b * b - a * ss))
        return self.sensor.offset * ((b + root) / a if c > 0.0 else ss / (b + root))

    def alignment(self, attitude: ArrayLike, group: Group = "A") -> tuple[Floats, float, float]:
        """The turn from an `attitude` (3, 3) to the start attitude of a `group`: (axis, angle, time).

        Columns of the attitude are the body axes in the frame; axis (3,), angle [rad] at most pi,
        time [s] at the slew rate.  Raises ValueError for a matrix that is no rotation or for a
        group that is neither "A" nor "B".
        """
        from scipy.spatial.transform import Rotation

        given = numbers("attitude", attitude)
        if given.shape != (3, 3) or not np.allclose(given.T @ given, np.eye(3), atol=1e-9):
            raise ValueError("attitude: expected three orthonormal columns, the body axes in the frame")
        if np.linalg.det(given) < 0.0:
            raise ValueError("attitude: its columns are left-handed; body y is z cross x")
        _known(group)
        vector = Rotation.from_matrix(START_ATTITUDE[group] @ given.T).as_rotvec()
        angle = float(np.linalg.norm(vector))
        axis = vector / angle if angle > 0.0 else SUN.copy()
        return axis, angle, angle / self.slew_rate

    def coverage(self, phase: str | None = None) -> float:
        """Share of the sky that one craft's cone sweeps in one `phase`, or in the whole search for None.

        Of far, fixed directions: a number from 0 to 1, to about 1e-5.  Raises ValueError for a
        phase that the search does not have.
        """
        if phase is not None:
            instance("phase", phase, str)
        first = next((leg.round for leg in self.legs if leg.phase == phase), None)
        if phase is not None and first is None:
            names = ", ".join(dict.fromkeys(leg.phase for leg in self.legs))
            raise ValueError(f"phase: this search has {names}, got {phase!r}")
        table = self.table[[phase is None or (leg.phase, leg.round) == (phase, first) for leg in self.legs]]
        return covered(table, self.sensor.cosine)


def full_tip(half_angle: float) -> float:
    """Tip [rad] that searches a whole complementary cone, for a half-angle from 45 deg on.  # S04 eq. 1

    Raises ValueError for a smaller half-angle.
    """
    c = cos(half_angle)
    if half_angle >= pi / 2.0:
        return 0.0  # no complementary cone
    if 1.0 - 2.0 * c * c < 0.0 and half_angle < pi / 4.0:
        raise ValueError(
            f"half_angle: {degrees(half_angle):g} deg is below 45 deg, no tip covers the complementary "
            "cones; use a wider sensor, or the basic search"
        )
    return atan2(c, sqrt(max(0.0, 1.0 - 2.0 * c * c)))


def least_half_angle(tip: float) -> float:
    """The half-angle [rad] for which a tip searches a whole complementary cone: S04 eq. 1 inverted."""
    return acos(tan(tip) / sqrt(1.0 + 2.0 * tan(tip) ** 2))


def _known(group: Any) -> None:
    if not isinstance(group, str) or group not in START_ATTITUDE:
        raise ValueError(f'group: must be "A" or "B", got {shown(group)}')


def _limits(slew_rate: float, sun_limit: float) -> tuple[float, float]:
    rate, limit = positive("slew_rate", slew_rate), positive("sun_limit", sun_limit)
    if limit >= pi / 2.0:
        raise ValueError(f"sun_limit: must be below pi/2 (90 deg), got {limit:g} rad")
    return rate, limit


def _legs(rate: float, in_plane: float, tip: float, name: str, tips: list[Any]) -> tuple[Leg, ...]:
    """The turns of two rounds: in plane about the sun line, then out of plane by multiples of the tip."""
    turns: list[tuple[str, str, float]] = [("IPS", "sun line", in_plane)]
    turns += [(name, "sun line", pi) if k == "sun" else (name, "body y", k * tip) for k in tips]
    legs: list[Leg] = []
    start, attitude = 0.0, START_ATTITUDE["A"]
    for number in (1, 2):
        for phase, about, angle in turns:
            if angle == 0.0:
                continue  # a sensor that sees half of the sky needs no tips
            axis = SUN if about == "sun line" else attitude[:, 1].copy()
            end = start + abs(angle) / rate
            legs.append(Leg(start, end, phase, number, about, axis, angle, attitude))
            start, attitude = end, rotation(axis, angle) @ attitude
    return tuple(legs)
