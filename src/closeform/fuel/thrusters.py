"""Thrusters: their directions, accelerations and minimum impulse bits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, of_each, positive, sequence, shown
from closeform.motion.elements.mean_motion import checked
from closeform.motion.orbit import Orbit, circular_orbit

UNIT = 1e-6  # accepted deviation of a direction's length from 1: six digits may be typed
MOST = 64  # thrusters: the facets of their hull are found among all triples
ALIGNED = 1e-9  # of a sine: a smaller push in a direction is none


@dataclass(frozen=True, eq=False)
class Thrusters:
    """Thrusters of a spacecraft, each of which pushes in one direction only, and is on or off.

    Without an acceleration and a period they define only the directions in which a plan may push.

    Parameters
    ----------
    directions : array_like of shape (m, 3), no unit
        Unit vectors of the thrust (not of the plume) in the `frame`, at most 64, all different.
    frame : "orbit" or "inertial", optional
        Frame in which they are fixed: the orbit's rotating frame, for a spacecraft with a fixed attitude to
        the orbit, or inertial axes, equal to the orbit's at time 0, for one with an inertial attitude.
    acceleration : array_like of shape () or (m,) [m/s^2], optional
        Acceleration of each while it is on, for the mass at the start; `with_force` accepts newtons.
    minimum_bit : array_like of shape () or (m,) [m/s], optional
        Minimum impulse bit of each.
    period : float [s], optional
        Period in which each fires once, or less often where its bit requires it.

    Raises
    ------
    ValueError
        If directions are not of unit length to 1e-6, are equal, or are more than 64; an acceleration or
        the period is not positive; a bit is negative; or the frame is unknown.

    References
    ----------
    docs/fuel.md, thrusters.
    """

    directions: Any
    frame: Literal["orbit", "inertial"] = "orbit"
    acceleration: Any = None
    minimum_bit: Any = 0.0
    period: float | None = None

    def __post_init__(self) -> None:
        given = checked("directions", self.directions)
        if np.ndim(given) != 2 or given.shape[1] != 3 or not 1 <= len(given) <= MOST:
            raise ValueError(
                f"directions: expected shape (m, 3) for 1 to {MOST} thrusters, got {np.shape(given)}"
            )
        lengths = np.linalg.norm(given, axis=1)
        if (wrong := np.flatnonzero(np.abs(lengths - 1.0) > UNIT)).size:
            k = wrong[0]
            raise ValueError(
                f"directions[{k}]: must be of length 1, got {lengths[k]:g}; give unit vectors, and the "
                "thrust as acceleration"
            )
        units = given / lengths[:, None] + 0.0  # without -0
        apart = np.linalg.norm(units[:, None] - units, axis=-1) + 3.0 * np.tri(len(units))
        if (apart <= UNIT).any():
            one, other = np.argwhere(apart <= UNIT)[0]
            raise ValueError(
                f"directions[{other}]: the same as directions[{one}]; give one with the sum of both "
                "accelerations"
            )
        if not isinstance(self.frame, str) or self.frame not in ("orbit", "inertial"):
            raise ValueError(f"frame: must be 'orbit' or 'inertial', got {shown(self.frame)}")
        object.__setattr__(self, "directions", units)
        object.__setattr__(self, "minimum_bit", self._each("minimum_bit", self.minimum_bit, 0.0))
        if self.acceleration is not None:
            object.__setattr__(self, "acceleration", self._each("acceleration", self.acceleration))
        if self.period is not None:
            object.__setattr__(self, "period", positive("period", self.period, " s"))

    def _each(self, name: str, value: ArrayLike, least: float | None = None) -> Floats:
        """Return one number for each thruster: positive, or at least `least`."""
        values = of_each(name, value, len(self.directions), "thrusters")
        fits = values > 0.0 if least is None else values >= least
        if not (fits & np.isfinite(values)).all():
            wanted = "positive" if least is None else f"at least {least:g}"
            raise ValueError(f"{name}: must be {wanted} and finite, got {values.min():g}")
        return values

    @classmethod
    def rtn(
        cls,
        frame: Literal["orbit", "inertial"] = "orbit",
        acceleration: ArrayLike | None = None,
        minimum_bit: ArrayLike = 0.0,
        period: float | None = None,
    ) -> Self:
        """Return six thrusters along both senses of the axes: +R, -R, +T, -T, +N, -N.

        Parameters
        ----------
        frame : "orbit" or "inertial", optional
            Frame in which they are fixed; inertial axes are those of the orbit at time 0.
        acceleration : array_like of shape () or (6,) [m/s^2], optional
            Acceleration of each while it is on.
        minimum_bit : array_like of shape () or (6,) [m/s], optional
            Minimum impulse bit of each.
        period : float [s], optional
            Period in which each fires once.

        Returns
        -------
        Thrusters
            Thrusters in this order.

        Raises
        ------
        ValueError
            If an argument is invalid for the class.

        References
        ----------
        docs/fuel.md, thrusters.
        """
        both = np.stack([np.eye(3), -np.eye(3)], axis=1).reshape(6, 3)
        return cls(both, frame, acceleration, minimum_bit, period)

    def with_force(self, force: ArrayLike, mass: float, minimum_impulse: ArrayLike = 0.0) -> Self:
        """Return the same thrusters with given forces.

        Parameters
        ----------
        force : array_like of shape () or (m,) [N]
            Force of each while it is on.
        mass : float [kg]
            Mass of the spacecraft at the start; `fire_thrusters` accounts for the propellant used since.
        minimum_impulse : array_like of shape () or (m,) [N s], optional
            Minimum impulse of each.

        Returns
        -------
        Thrusters
            Thrusters with acceleration and bit for a spacecraft of this mass.

        Raises
        ------
        ValueError
            If a force or the mass is not positive, or an impulse is negative.

        References
        ----------
        docs/fuel.md, thrusters.
        """
        kilograms = positive("mass", mass, " kg")
        newtons, bits = self._each("force", force), self._each("minimum_impulse", minimum_impulse, 0.0)
        return replace(self, acceleration=newtons / kilograms, minimum_bit=bits / kilograms)

    def __len__(self) -> int:
        return len(self.directions)

    @property
    def unreachable(self) -> Floats | None:
        """Direction (3,), no unit, in which no thruster can contribute; None if there is none.

        No combination of thrusters has a positive component along it.
        """
        if np.linalg.matrix_rank(self.directions, tol=ALIGNED) < 3:  # there is a normal to all
            return np.asarray(np.linalg.svd(self.directions)[2][2])
        first, second = np.triu_indices(len(self), 1)
        edges = np.cross(self.directions[first], self.directions[second])
        edges = edges[np.linalg.norm(edges, axis=1) > ALIGNED]
        edges /= np.linalg.norm(edges, axis=1)[:, None]
        edges = np.concatenate([edges, -edges])  # of the cone in which no thruster pushes, if there is one
        inside = edges[(edges @ self.directions.T <= ALIGNED).all(axis=1)]
        if not len(inside):
            return None
        middle = inside.sum(axis=0)
        return np.asarray(middle / np.linalg.norm(middle))

    def directions_at(self, orbit: Orbit, time: ArrayLike) -> Floats:
        """Return the directions of the thrusters at given times, in the orbit's rotating frame.

        Parameters
        ----------
        orbit : Orbit
            Orbit of the spacecraft.
        time : array_like of shape (...) [s]
            Time since inertial axes were those of the orbit.

        Returns
        -------
        array of shape (..., m, 3), no unit
            Unit vectors in the rotating frame: radial, along-track, cross-track.

        Raises
        ------
        ValueError
            If a time is not finite, or `orbit` is not an Orbit.

        References
        ----------
        docs/fuel.md, thrusters.
        """
        angles = circular_orbit("orbit", orbit).mean_motion * np.asarray(checked("time", time))
        if self.frame == "orbit":
            return np.broadcast_to(self.directions, (*angles.shape, *self.directions.shape))
        turned: Floats = np.einsum("...ij,mj->...mi", turn(angles), self.directions)
        return turned


def each_set(
    thrusters: Thrusters | Sequence[Thrusters | None] | None, count: int, *kinds: type
) -> tuple[Any, ...]:
    """Return the thrusters of each spacecraft; None for free thrust, unless `kinds` exclude it."""
    if isinstance(thrusters, Thrusters) or (thrusters is None and not kinds):
        return (thrusters,) * count
    own = sequence("thrusters", thrusters, *(kinds or (Thrusters, type(None))))
    if len(own) != count:
        raise ValueError(f"thrusters: {len(own)} sets for {count} spacecraft; give one, or one for each")
    return tuple(own)


def turn(angle: ArrayLike) -> Floats:
    """Return matrices (..., 3, 3) from inertial axes to those of an orbit turned by `angle` (...) [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    zero, one = np.zeros_like(c), np.ones_like(c)
    rows = [[c, s, zero], [-s, c, zero], [zero, zero, one]]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))
