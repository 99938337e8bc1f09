"""Paths of spacecraft in the rotating frame of any chief, built on the motion that its orbit defines."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, finite, shown
from closeform.motion.arc import PUSH, WIDTH
from closeform.motion.construction.ends import arcs_between, arcs_from
from closeform.motion.construction.two_impulse import drifts
from closeform.motion.path import Path, path_of

if TYPE_CHECKING:
    from closeform.fuel.thrusters import Thrusters


class ReferenceOrbit(ABC):
    """Orbit of a chief, in whose rotating frame spacecraft move: `Orbit` and `ChiefOrbit`.

    Motion is of first order in the distance from the chief.  About a chief that is not on a circle times are
    absolute: time 0 is that of its elements, and `start` matters.
    """

    def coast(self, state: ArrayLike, duration: ArrayLike, start: ArrayLike = 0.0) -> Path:
        """Return natural motion from a state.

        Parameters
        ----------
        state : array_like of shape (..., 6) [m, m/s]
            State at the start, in the rotating frame.
        duration : array_like of shape (...) [s]
            Above 0.
        start : array_like of shape (...) [s], default 0
            Time of the state; all arguments broadcast.

        Returns
        -------
        Path
            Path of the broadcast shape.

        Raises
        ------
        ValueError
            If a duration is not positive or too long, a time is outside of the span of the chief, shapes do
            not fit, or a number is not finite.

        References
        ----------
        docs/theory.md section 1.
        """
        return self._path(self._arcs(arcs_from(self._rate, duration, start, state=state)))

    def transfer(
        self,
        initial: ArrayLike,
        final: ArrayLike,
        duration: ArrayLike,
        start: ArrayLike = 0.0,
        max_acceleration: ArrayLike | None = None,
        cost: Literal["energy", "delta-v"] = "energy",
    ) -> Path:
        """Return the optimal path between two states: of minimum control energy, or of minimum delta-v.

        Parameters
        ----------
        initial : array_like of shape (..., 6) [m, m/s]
            State at the start, in the rotating frame.
        final : array_like of shape (..., 6) [m, m/s]
            State at the end, in the rotating frame.
        duration : array_like of shape (...) [s]
            Above 0.
        start : array_like of shape (...) [s], default 0
            Time of the initial state; all arguments broadcast, so that `transfer(a[:, None], b, T).energy` is
            the matrix of costs from every a to every b.
        max_acceleration : array_like of shape (...) [m/s^2], default None
            Limit of the thrust acceleration, about a circular orbit or in deep space; None for no limit.
        cost : {"energy", "delta-v"}, default "energy"
            Quantity to minimise: control energy, or the integral of |thrust|.  Minimum delta-v consists of
            burns at the limit with coasts between them, and of impulses if there is no limit (`impulsive`).

        Returns
        -------
        Path
            Path of the broadcast shape.  It respects a limit to 1e-9, and its cost exceeds a lower bound,
            which is computed with it, by at most a relative 1e-6.

        Raises
        ------
        ValueError
            If it is proven that no thrust within the limit achieves the transfer: the message names the
            spacecraft and a sufficient limit; if a limit or a duration is not positive, a duration is too
            long, or too short to end there, a limit is not supported about the chief, a time is outside of
            its span, shapes do not fit, or a number is not finite.

        Notes
        -----
        In any gravity field the optimal thrust obeys the equation of natural relative motion.  The transition
        matrix therefore gives it, by one system of six equations.

        References
        ----------
        docs/theory.md section 2, from docs/theory.md (7) and docs/theory.md (8); with limits docs/theory.md
        section 6, from docs/theory.md (31) on.

        Examples
        --------
        >>> orbit = cf.Orbit.circular(500e3)
        >>> path = orbit.transfer([0, -200, 0, 0, 0, 0], np.zeros(6), orbit.period / 2)
        >>> bool(np.allclose(path.position(path.end), 0.0))
        True
        """
        if not isinstance(cost, str) or cost not in ("energy", "delta-v"):
            raise ValueError(f'cost: expected "energy" or "delta-v", got {shown(cost)}')
        if cost == "delta-v" and max_acceleration is None:
            return self.impulsive(initial, final, duration, start)
        if max_acceleration is not None:
            return self._within_limit(initial, final, duration, start, max_acceleration, cost == "delta-v")
        arcs, finals = arcs_between(self._rate, initial, final, duration, start)
        self._steer(self._arcs(arcs).reshape(-1, WIDTH), finals)
        return self._path(arcs)

    def two_impulse(
        self, initial: ArrayLike, final: ArrayLike, duration: ArrayLike, start: ArrayLike = 0.0
    ) -> Path:
        """Return the coast between two states, with an impulse at each end.

        Parameters
        ----------
        initial : array_like of shape (..., 6) [m, m/s]
            Before the first impulse, in the rotating frame.
        final : array_like of shape (..., 6) [m, m/s]
            After the last one, in the rotating frame.
        duration : array_like of shape (...) [s]
            Above 0.
        start : array_like of shape (...) [s], default 0
            Time of the first impulse; all arguments broadcast.

        Returns
        -------
        Path
            Path of the broadcast shape.

        Raises
        ------
        ValueError
            If no two impulses reach a final position in the duration (the message gives the miss distance), a
            duration is not positive or too long, shapes do not fit, or a number is not finite.

        Notes
        -----
        At times when an initial velocity has no effect along some direction, such as after half an orbit,
        either many coasts or none reach a position. Of many, the result minimises the sum of both impulses
        squared.

        References
        ----------
        Clohessy and Wiltshire, J. Aerospace Sciences 27(9), 653-658, 1960; docs/motion.md.
        """
        arcs, finals = arcs_between(self._rate, initial, final, duration, start)
        return drifts(self, self._arcs(arcs), finals)

    def impulsive(
        self,
        initial: ArrayLike,
        final: ArrayLike,
        duration: ArrayLike,
        start: ArrayLike = 0.0,
        thrusters: Thrusters | None = None,
    ) -> Path:
        """Return the minimum-delta-v impulses between two states in a given time: at most six.

        Parameters
        ----------
        initial : array_like of shape (..., 6) [m, m/s]
            Before the first impulse, in the rotating frame.
        final : array_like of shape (..., 6) [m, m/s]
            After the last one, in the rotating frame.
        duration : array_like of shape (...) [s]
            Above 0, at most 100 orbits.
        start : array_like of shape (...) [s], default 0
            Departure time; all arguments broadcast, and a batch is computed on all cores.
        thrusters : Thrusters, optional
            Use these thrusters only, about a circular orbit, and sum delta-v over them: several that fire at
            once are as many impulses.

        Returns
        -------
        Path
            Path of the broadcast shape; `impulses` lists times and velocity changes of one spacecraft.

        Raises
        ------
        ValueError
            If a duration is not positive or too long, shapes do not fit, a number is not finite, or the
            thrusters cannot achieve a transfer (the message states why); about a chief that is not on a
            circle if thrusters are given, a time is outside of its span, or no plan is proven to be within a
            relative 1e-6 of the minimum.

        Notes
        -----
        `least_delta_v` reports the certified bound on the cost. If several plans have the same cost, the
        result is one of them. In deep space it equals `two_impulse`; between states of one natural motion
        there is no impulse.

        References
        ----------
        Lawden's primer, by its dual in six unknowns: docs/theory.md (29, 30, 36).

        Examples
        --------
        >>> orbit = cf.Orbit.circular(500e3)
        >>> path = orbit.impulsive([0, -200, 0, 0, 0, 0], np.zeros(6), orbit.period)
        >>> len(path.impulses), round(path.delta_v, 4)
        (4, 0.0235)
        """
        arcs, finals = arcs_between(self._rate, initial, final, duration, start)
        return self._least_impulses(self._arcs(arcs), finals, thrusters)

    def burn(
        self,
        state: ArrayLike,
        acceleration: ArrayLike,
        duration: ArrayLike,
        start: ArrayLike = 0.0,
        frame: Literal["orbit", "inertial"] = "orbit",
    ) -> Path:
        """Return motion under constant thrust from a state.

        Parameters
        ----------
        state : array_like of shape (..., 6) [m, m/s]
            State at the start, in the rotating frame.
        acceleration : array_like of shape (..., 3) [m/s^2]
            Thrust acceleration in `frame`.
        duration : array_like of shape (...) [s]
            Above 0.
        start : array_like of shape (...) [s], default 0
            Time of the state; all arguments broadcast.
        frame : "orbit" or "inertial", default "orbit"
            Frame in which the thrust is constant: the rotating one, or, about a circular orbit, inertial axes
            equal to the orbit's at time 0.

        Returns
        -------
        Path
            Path of the broadcast shape.

        Raises
        ------
        ValueError
            If a duration is not positive or too long, shapes do not fit, a number is not finite, `frame` is
            unknown or not supported about the chief, or a time is outside of the chief's span.

        References
        ----------
        docs/theory.md section 1; docs/motion.md.
        """
        if not isinstance(frame, str) or frame not in ("orbit", "inertial"):
            raise ValueError(f"frame: must be 'orbit' or 'inertial', got {shown(frame)}")
        push = finite("acceleration", acceleration, 3)
        arcs = arcs_from(self._rate, duration, start, state=state, like=push.shape[:-1])
        arcs[..., PUSH : PUSH + 3] = push
        return self._path(self._arcs(arcs) if frame == "orbit" else self._fixed_inertially(arcs))

    def sampled(self, times: ArrayLike, states: ArrayLike) -> Path:
        """Return the path through states: natural motion where spacecraft coast, cubics elsewhere.

        Parameters
        ----------
        times : array_like of shape (T,) [s]
            Increasing, T >= 2.
        states : array_like of shape (..., T, 6) [m, m/s]
            States at these times, in the rotating frame; the path passes through all of them.

        Returns
        -------
        Path
            Path of the states' leading shape; see its `interpolation_error` and `cubic_share`.

        Raises
        ------
        ValueError
            If times do not increase, shapes do not fit, a number is not finite, an interval between times
            is too long, or a time is outside of the span of the chief.

        Notes
        -----
        Between two samples the path is the optimal transfer in this orbit.  About a circular orbit that holds
        if it needs less than a tenth of the energy of a cubic: there the spacecraft nearly coasts.  Otherwise
        it is the cubic (Hermite), which is the transfer at n = 0: for samples h apart its position error is
        at most h^4/384 max|r|, its velocity error h^3/124 max|r|, per axis.

        References
        ----------
        docs/theory.md section 2; docs/ephemerides.md.
        """
        return self._through(times, states)

    # What an orbit knows of motion

    @property
    @abstractmethod
    def _rate(self) -> float:
        """Mean motion of the clock [rad/s]."""

    @abstractmethod
    def _arcs(self, arcs: Floats) -> Floats:
        """Return arcs (..., 30) as those of this orbit."""

    @abstractmethod
    def _steer(self, arcs: Floats, finals: Floats) -> None:
        """Set the thrust of minimum energy of each arc (P, 30), so that it ends in its final state."""

    @abstractmethod
    def _within_limit(
        self,
        initial: ArrayLike,
        final: ArrayLike,
        duration: ArrayLike,
        start: ArrayLike,
        limit: ArrayLike,
        delta_v: bool,
    ) -> Path:
        """Return the path of minimum energy, or delta-v, within a limit of the thrust."""

    @abstractmethod
    def _least_impulses(self, arcs: Floats, finals: Floats, thrusters: Thrusters | None) -> Path:
        """Return the impulses of minimum delta-v over arcs (..., 30), to final states (P, 6)."""

    @abstractmethod
    def _fixed_inertially(self, arcs: Floats) -> Floats:
        """Return arcs with a thrust that is constant in inertial axes instead of the orbit's."""

    @abstractmethod
    def _through(self, times: ArrayLike, states: ArrayLike) -> Path:
        """Return the path through samples."""

    @abstractmethod
    def _spaced(self, begin: Any, end: Any, count: int) -> Floats: ...

    def _spread(self, begin: float, end: float, per_turn: float, fewest: int) -> Floats:
        """Return times from `begin` to `end`, at least so many in a revolution and in all."""
        turns = self._rate * (end - begin) / (2.0 * np.pi) if self._rate else 1.0
        return self._spaced(begin, end, max(fewest, int(np.ceil(per_turn * turns)) + 1))

    def _path(self, arcs: Any) -> Path:
        rows = np.ascontiguousarray(arcs).reshape(-1, WIDTH)
        return path_of(self, rows, np.arange(len(rows) + 1), arcs.shape[:-1])
