"""Search schedule: synchronised turns by which lost craft search for each other.

The sun is along -z. Group A starts with its boresight along +x, body x towards the sun and body y along
+y; group B looks in the opposite direction. Both make the same turns in space, so that the boresights stay
opposite. The columns of an attitude are the body axes x, y, z; z is the boresight.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import acos, atan2, ceil, cos, degrees, inf, pi, sin, sqrt, tan
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, instance, numbers, positive, shown, whole
from closeform.result import Result
from closeform.search.leg import AXES_OF_GROUP, START_ATTITUDE, SUN, Group, Leg, rotation
from closeform.search.sensor import Sensor
from closeform.search.sky_coverage import covered_share

START, END, ANGLE, MATRICES = range(4)  # columns of `Search.table`
LEVEL = 1e-12  # rad: a cone that reaches the sun line only in rounding does not
YEAR = 365.25636 * 86400.0  # s, sidereal: period of the sun's direction at 1 AU


@dataclass(frozen=True, eq=False, repr=False)
class Search(Result):
    """Synchronized search of the sky, created by `Search.modified` or `Search.basic`.

    The sun is along -z of the inertial frame. All craft carry the same sensor. Group B always looks in the
    direction opposite to group A.

    Attributes
    ----------
    sensor : Sensor
        Sensor of each craft.
    slew_rate : float [rad/s]
        Rate of all turns.
    sun_limit : float [rad]
        Largest angle allowed between body x, the normal of the sun shade, and the sun.
    tip_angle : float [rad]
        Angle of the out-of-plane turns.
    legs : tuple of Leg
        All turns in order, without the near-field search.
    """

    sensor: Sensor
    slew_rate: float
    sun_limit: float
    tip_angle: float
    legs: tuple[Leg, ...]

    @classmethod
    def modified(cls, sensor: Sensor, slew_rate: float, sun_limit: float) -> Self:
        """Create S04's search: IPS, mOPS, IPS, mOPS with tips for which S04 proves that every pair locks.

        Parameters
        ----------
        sensor : Sensor
            Sensor with a half-angle of at least 45 deg.
        slew_rate : float [rad/s]
            Rate of all turns.
        sun_limit : float [rad]
            Largest angle allowed between body x and the sun, below pi/2.

        Returns
        -------
        Search
            The search with the smallest tip that covers a complementary cone.

        Raises
        ------
        ValueError
            If the half-angle is below 45 deg, the tip exceeds the sun limit (the message names a sufficient
            half-angle), or a number is not positive and finite.

        References
        ----------
        S04 (Scharf, Ploen, Hadaegh and Sohl 2004) eq. 1; docs/theory.md (15).
        """
        rate, limit = _limits(slew_rate, sun_limit)
        instance("sensor", sensor, Sensor)
        tip = full_tip(sensor.half_angle)
        if tip > limit:
            enough = ceil(1e4 * degrees(least_half_angle(limit))) / 1e4
            raise ValueError(
                f"sun_limit: a half-angle of {degrees(sensor.half_angle):g} deg requires tips of "
                f"{degrees(tip):.3f} deg, above the limit of {degrees(limit):g} deg; "
                f"a half-angle of {enough:.4f} deg is sufficient"
            )
        tips = [1, -2, "sun", 2, "sun", -2, 1]
        return cls(sensor, rate, limit, tip, _legs(rate, 3.0 * pi, tip, "mOPS", tips, 2))

    @classmethod
    def basic(
        cls,
        sensor: Sensor,
        slew_rate: float,
        sun_limit: float,
        in_plane_turn: float = 3.0 * pi,
        tip_angle: float | None = None,
        *,
        passes: int = 2,
        relaxed: bool = False,
    ) -> Self:
        """Create H03's search: IPS and OPS, twice.

        Parameters
        ----------
        sensor : Sensor
            Sensor of any half-angle.
        slew_rate : float [rad/s]
            Rate of all turns.
        sun_limit : float [rad]
            Largest angle allowed between body x and the sun, below pi/2.
        in_plane_turn : float [rad], default 3 pi
            Angle of each IPS: one and a half turns (H03's simulation: one turn).
        tip_angle : float [rad], optional
            Angle of the out-of-plane turns. Default: the sun limit, or with `relaxed` the angle that covers
            the complementary cones.
        passes : int, default 2
            Number of times that IPS and OPS are made (H03's simulation: 1).
        relaxed : bool, default False
            True if the out-of-plane turns may exceed the sun limit. A single larger tip each way then
            replaces the turn of 180 deg and the second tips (H03, footnote 5).

        Returns
        -------
        Search
            The search, which need not find every pair.

        Raises
        ------
        ValueError
            If the tip is above the sun limit without `relaxed`, a number is not positive and finite, or
            `passes` is below 1.

        References
        ----------
        H03 (Hadaegh, Scharf and Ploen 2003) section III; docs/lost_craft.md.
        """
        rate, limit = _limits(slew_rate, sun_limit)
        turn = positive("in_plane_turn", in_plane_turn)
        instance("sensor", sensor, Sensor)
        whole("passes", passes, 1)
        instance("relaxed", relaxed, bool, np.bool_)
        # tips of twice the half-angle of a complementary cone reach its far side
        usual = max(pi - 2.0 * sensor.half_angle, 0.0) if relaxed else limit
        tip = usual if tip_angle is None else positive("tip_angle", tip_angle)
        if tip > limit and not relaxed:
            raise ValueError(
                f"tip_angle: {degrees(tip):g} deg is above the sun limit of {degrees(limit):g} deg; "
                f"reduce the tip angle, or set relaxed"
            )
        tips = [1, -2, 1] if relaxed else [1, -2, "sun", 2, -1]
        return cls(sensor, rate, limit, tip, _legs(rate, turn, tip, "OPS", tips, passes))

    @property
    def duration(self) -> float:
        """Total duration of all legs [s]; of a search as created, without the near-field search."""
        return self.legs[-1].end

    @cached_property
    def table(self) -> Floats:
        """Legs as rows (L, 30) for kernels: start and end [s], angle [rad], and `Leg.attitude_parts`."""
        return np.array([[leg.start, leg.end, leg.angle, *leg.attitude_parts.ravel()] for leg in self.legs])

    @property
    def phases(self) -> tuple[tuple[str, int, float, float], ...]:
        """Phases: name, round, start and end [s] of each."""
        spans: dict[tuple[str, int], tuple[float, float]] = {}
        for leg in self.legs:
            key = (leg.phase, leg.round)
            spans[key] = (spans.get(key, (leg.start, 0.0))[0], leg.end)
        return tuple((phase, number, *span) for (phase, number), span in spans.items())

    def attitude(self, t: ArrayLike, group: Group = "A") -> Floats:
        """Return the attitude of the craft of one group.

        Parameters
        ----------
        t : array_like of shape (...) [s]
            Time from the start of the search, up to its end.
        group : "A" or "B", default "A"
            Group of the craft.

        Returns
        -------
        array of shape (..., 3, 3), no unit
            Columns are body x, y and the boresight in the inertial frame.

        Raises
        ------
        ValueError
            If a time is outside the search, or `group` is neither "A" nor "B".

        References
        ----------
        H03 (Hadaegh, Scharf and Ploen 2003); docs/lost_craft.md.
        """
        _known(group)
        times = numbers("t", t)
        if times.size and not (times.min() >= 0.0 and times.max() <= self.duration):
            raise ValueError(f"t: must be within the search, from 0 to {self.duration:g} s")
        starts = np.array([leg.start for leg in self.legs])
        leg_of = np.searchsorted(starts, times, side="right") - 1
        out = np.empty((*times.shape, 3, 3))
        for k, leg in enumerate(self.legs):
            out[leg_of == k] = leg.attitude_at(times[leg_of == k])
        return np.asarray(out * AXES_OF_GROUP[group])

    def boresight(self, t: ArrayLike, group: Group = "A") -> Floats:
        """Return the boresight of the craft of one group.

        Parameters
        ----------
        t : array_like of shape (...) [s]
            Time from the start of the search, up to its end.
        group : "A" or "B", default "A"
            Group of the craft.

        Returns
        -------
        array of shape (..., 3), no unit
            Unit vectors in the inertial frame.

        Raises
        ------
        ValueError
            If a time is outside the search, or `group` is neither "A" nor "B".

        References
        ----------
        H03 (Hadaegh, Scharf and Ploen 2003); docs/lost_craft.md.
        """
        return self.attitude(t, group)[..., 2]

    @property
    def sun_angle(self) -> float:
        """Largest angle [rad] of body x from the sun line in any leg, of either group."""
        return max(leg.sun_angle for leg in self.legs)

    @property
    def sun_drift(self) -> float:
        """Motion of the sun [rad] during the search at 1 AU, which the search neglects."""
        return 2.0 * pi * self.duration / YEAR

    @property
    def near_field(self) -> float:
        """Length [m] along the sun line of the region that one craft's own cone never covers (H03 fig. 6).

        It is 0 for a sensor at the centre of mass, and inf if the tip is too small to reach the sun line. Two
        facing craft require twice that length: their sensors are two offsets apart.
        """
        reach = self.sensor.offset * sin(self.sensor.half_angle)
        if reach == 0.0:
            return 0.0
        return reach / sin(self._rise) if self._rise > 0.0 else inf  # theory (16)

    def near_field_radius(self, height: ArrayLike) -> Floats:
        """Return the distance from the sun line within which one craft's own cone never looks (H03 fig. 6).

        Parameters
        ----------
        height : array_like of shape (...) [m]
            Height along the sun line, on either side of the craft.

        Returns
        -------
        array of shape (...) [m]
            Radius of the region, 0 beyond `near_field`.

        Raises
        ------
        ValueError
            If `height` is not numeric.

        References
        ----------
        H03 (Hadaegh, Scharf and Ploen 2003) figure 6; docs/theory.md (16).
        """
        h = np.abs(numbers("height", height))
        # the rims of all tips touch a ball; above the highest of these points the last rim bounds the region
        ball = self.sensor.offset * sin(max(self.sensor.half_angle, pi / 2.0))
        last = min(self.tip_angle + max(self.sensor.half_angle - pi / 2.0, 0.0), pi / 2.0)
        top, rim = ball * sin(last), ball * cos(last)
        above = rim - (h - top) * tan(self._rise) if self._rise < pi / 2.0 else np.zeros_like(h)
        return np.asarray(np.where(h < top, np.sqrt(np.maximum(ball**2 - h**2, 0.0)), np.maximum(above, 0.0)))

    @property
    def _rise(self) -> float:
        """Angle [rad] by which the rim of the highest tip leans over the sun line."""
        over = self.tip_angle + self.sensor.half_angle - pi / 2.0
        return 0.0 if abs(over) < LEVEL else min(over, pi / 2.0)

    def alignment(self, attitude: ArrayLike, group: Group = "A") -> tuple[Floats, float, float]:
        """Return the turn from any attitude to the start attitude of the search.

        Parameters
        ----------
        attitude : array_like of shape (3, 3), no unit
            Columns are body x, y and the boresight in the inertial frame.
        group : "A" or "B", default "A"
            Group of the start attitude.

        Returns
        -------
        axis : array of shape (3,), no unit
            Unit axis of the turn in the inertial frame; the sun line for a zero angle.
        angle : float [rad]
            Right-handed angle from 0 to pi.
        time : float [s]
            Duration at the slew rate.

        Raises
        ------
        ValueError
            If `attitude` is not a rotation, or `group` is neither "A" nor "B".

        References
        ----------
        H03 (Hadaegh, Scharf and Ploen 2003); docs/lost_craft.md.
        """
        from scipy.spatial.transform import Rotation

        given = numbers("attitude", attitude)
        if given.shape != (3, 3) or not np.allclose(given.T @ given, np.eye(3), atol=1e-9):
            raise ValueError(
                "attitude: expected three orthonormal columns, the body axes in the inertial frame"
            )
        if np.linalg.det(given) < 0.0:
            raise ValueError("attitude: left-handed columns; body y must be z cross x")
        _known(group)
        vector = Rotation.from_matrix(START_ATTITUDE[group] @ given.T).as_rotvec()
        angle = float(np.linalg.norm(vector))
        axis = vector / angle if angle > 0.0 else SUN.copy()
        return axis, angle, angle / self.slew_rate

    def coverage(self, phase: str | None = None) -> float:
        """Return the fraction of the sky that one craft's cone sweeps, for distant fixed directions.

        Parameters
        ----------
        phase : str, optional
            Name of a phase, such as "IPS", whose first occurrence counts. Default: the whole search.

        Returns
        -------
        float, no unit
            Share from 0 to 1, accurate to about 1e-5.

        Raises
        ------
        ValueError
            If the search has no such phase.

        References
        ----------
        S04 (Scharf, Ploen, Hadaegh and Sohl 2004); docs/lost_craft.md.
        """
        if phase is not None:
            instance("phase", phase, str)
        first = next((leg.round for leg in self.legs if leg.phase == phase), None)
        if phase is not None and first is None:
            names = ", ".join(dict.fromkeys(leg.phase for leg in self.legs))
            raise ValueError(f"phase: the phases of this search are {names}, got {phase!r}")
        legs = [leg for leg in self.legs if phase is None or (leg.phase, leg.round) == (phase, first)]
        return covered_share(legs, self.sensor.cosine)


def full_tip(half_angle: float) -> float:
    """Return the tip [rad] that covers a complementary cone, for a half-angle of at least 45 deg.

    S04 eq. 1. Raises ValueError for a smaller half-angle.
    """
    c = cos(half_angle)
    if half_angle >= pi / 2.0:
        return 0.0  # no complementary cone
    if 1.0 - 2.0 * c * c < 0.0 and half_angle < pi / 4.0:
        raise ValueError(
            f"half_angle: {degrees(half_angle):g} deg is below 45 deg; no tip covers the complementary "
            "cones; use a wider sensor, or the basic search"
        )
    return atan2(c, sqrt(max(0.0, 1.0 - 2.0 * c * c)))


def least_half_angle(tip: float) -> float:
    """Return the half-angle [rad] for which a tip covers a complementary cone: S04 eq. 1 inverted."""
    return acos(tan(tip) / sqrt(1.0 + 2.0 * tan(tip) ** 2))


def _known(group: Any) -> None:
    """Raise ValueError unless `group` is "A" or "B"."""
    if not isinstance(group, str) or group not in START_ATTITUDE:
        raise ValueError(f'group: must be "A" or "B", got {shown(group)}')


def _limits(slew_rate: float, sun_limit: float) -> tuple[float, float]:
    """Return the slew rate and the sun limit after a check."""
    rate, limit = positive("slew_rate", slew_rate), positive("sun_limit", sun_limit)
    if limit >= pi / 2.0:
        raise ValueError(f"sun_limit: must be below pi/2 (90 deg), got {limit:g} rad")
    return rate, limit


def _legs(
    rate: float, in_plane: float, tip: float, name: str, tips: list[Any], passes: int
) -> tuple[Leg, ...]:
    """Return the turns of each pass: in plane about the sun line, then out of plane by `tips`."""
    turns: list[tuple[str, str, float]] = [("IPS", "sun line", in_plane)]
    turns += [(name, "sun line", pi) if k == "sun" else (name, "body y", k * tip) for k in tips]
    legs: list[Leg] = []
    start, attitude = 0.0, START_ATTITUDE["A"]
    for number in range(1, passes + 1):
        for phase, about, angle in turns:
            if angle == 0.0:
                continue  # a sensor that sees half of the sky requires no tips
            axis = SUN if about == "sun line" else attitude[:, 1].copy()
            end = start + abs(angle) / rate
            legs.append(Leg(start, end, phase, number, about, axis, angle, attitude))
            start, attitude = end, rotation(axis, angle) @ attitude
    return tuple(legs)
