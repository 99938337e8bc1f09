"""A reference orbit that is not circular, and the paths that spacecraft can take beside its chief."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, broadcast, finite, shown
from closeform.motion import effort
from closeform.motion.arc import END, IMPULSE, MEAN_MOTION, PUSH, START, STATE, THRUST, WIDTH
from closeform.motion.chief import segments as kernels
from closeform.motion.chief.bernstein import TERMS, basis_at
from closeform.motion.chief.clock import angles_at
from closeform.motion.chief.impulses import COUNT, FIRST, LOWER, PRIMER, UNIQUE, UPPER, primer_rows, solve
from closeform.motion.chief.kepler import KeplerChief
from closeform.motion.chief.oblate_or_supplied import GivenChief, OblateChief
from closeform.motion.chief.table import COLUMNS, COSTATE
from closeform.motion.chief.table import PUSH as PUSHED
from closeform.motion.duration import MOST_TURNS
from closeform.motion.ends import arcs_between, arcs_from
from closeform.motion.path import FORGIVEN, Path, path_of
from closeform.motion.two_impulse import drifts

if TYPE_CHECKING:
    from closeform.fuel.thrusters import Thrusters

SUPPORTED = "transfer, impulsive, avoid, reconfigure, screen and passively_safe, which hold about any chief"


PROVEN = 1e-6  # relative gap between the cost of impulses and its lower bound
UNMOVED = 1e-14  # of the states: a smaller change is rounding, and takes no impulse


@dataclass(frozen=True, repr=False)
class ChiefOrbit:
    """A reference orbit that is not circular, in whose turning frame spacecraft move.

    `Orbit.eccentric`, `Orbit.perturbed` and `Orbit.from_transition` make it.  The motion is of first order in
    the distance from the chief, as in Hill's equations; the frame turns with the chief, x radial outward, z
    along its orbit's normal, y completing.  The equations change along the orbit, so times are absolute: time
    0 is that of the chief's elements, and `start` matters.

    Attributes
    ----------
    chief : KeplerChief, OblateChief or GivenChief
        Motion of the chief, with the table of its transition matrix.
    """

    chief: KeplerChief | OblateChief | GivenChief

    def __repr__(self) -> str:
        return f"<ChiefOrbit: {self.chief}>"

    @property
    def mean_motion(self) -> float:
        """Not defined: the features that ask for it hold for Hill's equations only."""
        self._refuse("this feature")

    def _refuse(self, feature: str) -> NoReturn:
        raise ValueError(
            f"orbit: {feature} holds about a circular orbit only, not about an {self.chief}; take "
            f"Orbit.circular, or {SUPPORTED}"
        )

    @property
    def period(self) -> float:
        """Duration of one revolution of the chief [s]."""
        return self.chief.period

    def transition(self, duration: ArrayLike, start: ArrayLike = 0.0) -> Floats:
        """Return state transition matrices of natural motion.

        Parameters
        ----------
        duration : array_like of shape (...) [s]
            May be negative.
        start : array_like of shape (...) [s], default 0
            Start time; both broadcast.

        Returns
        -------
        array of shape (..., 6, 6) [no unit, s, 1/s]
            Matrices from states in the chief's frame at `start` to the states `duration` later.

        Raises
        ------
        ValueError
            If a time is outside of the span of the chief, a number is not finite, or shapes do not fit.

        References
        ----------
        docs/theory.md (90).
        """
        lengths, begins = finite("duration", duration), finite("start", start)
        shape = broadcast(duration=lengths.shape, start=begins.shape)
        spans = np.empty((*shape, 2))
        spans[..., 0], spans[..., 1] = begins, begins + lengths
        ahead = np.sort(spans.reshape(-1, 2), axis=1)
        flow, _ = self._flows(ahead)
        backward = np.ravel(np.broadcast_to(lengths < 0.0, shape))
        flow[backward] = np.linalg.inv(flow[backward])
        scale = np.array([1.0] * 3 + [self.chief.table.clock[0]] * 3)
        return np.asarray((scale[:, None] * flow / scale).reshape(*shape, 6, 6))

    def coast(self, state: ArrayLike, duration: ArrayLike, start: ArrayLike = 0.0) -> Path:
        """Return natural motion from a state.

        Parameters
        ----------
        state : array_like of shape (..., 6) [m, m/s]
            State at the start, in the chief's frame.
        duration : array_like of shape (...) [s]
            Above 0.
        start : array_like of shape (...) [s], default 0
            Time of the state, from that of the chief's elements; all arguments broadcast.

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
        docs/motion.md.
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
        """Return the path of minimum control energy between two states.

        Parameters
        ----------
        initial : array_like of shape (..., 6) [m, m/s]
            State at the start, in the chief's frame.
        final : array_like of shape (..., 6) [m, m/s]
            State at the end, in the chief's frame.
        duration : array_like of shape (...) [s]
            Above 0.
        start : array_like of shape (...) [s], default 0
            Time of the initial state, from that of the chief's elements; all arguments broadcast.
        max_acceleration : None
            A limit of the thrust holds for circular orbits only.
        cost : {"energy", "delta-v"}, default "energy"
            Quantity to minimise: control energy, or the sum of the sizes of impulses (`impulsive`).

        Returns
        -------
        Path
            Path of the broadcast shape.

        Raises
        ------
        ValueError
            If there is a limit of the thrust; if a duration is not positive, too long or too short, a time
            is outside of the span of the chief, shapes do not fit, or a number is not finite.

        Notes
        -----
        In any gravity field the optimal thrust obeys the equation of natural relative motion.  The transition
        matrix therefore gives it, by one system of six equations.

        References
        ----------
        docs/theory.md (7) and docs/theory.md (8); docs/motion.md.

        Examples
        --------
        >>> orbit = cf.Orbit.eccentric(0.3, perigee_altitude=500e3)
        >>> path = orbit.transfer([0, -200, 0, 0, 0, 0], np.zeros(6), orbit.period / 2, start=600.0)
        >>> bool(np.allclose(path.position(path.end), 0.0, atol=1e-8))
        True
        """
        if not isinstance(cost, str) or cost not in ("energy", "delta-v"):
            raise ValueError(f'cost: expected "energy" or "delta-v", got {shown(cost)}')
        if max_acceleration is not None:
            raise ValueError(
                f"max_acceleration: a thrust limit holds for circular orbits only, not for an {self.chief}; "
                "leave it out and compare peak_thrust of the path, or lengthen the transfer"
            )
        if cost == "delta-v":
            return self.impulsive(initial, final, duration, start)
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
            Before the first impulse, in the chief's frame.
        final : array_like of shape (..., 6) [m, m/s]
            After the last one, in the chief's frame.
        duration : array_like of shape (...) [s]
            Above 0.
        start : array_like of shape (...) [s], default 0
            Time of the first impulse, from that of the chief's elements; all arguments broadcast.

        Returns
        -------
        Path
            Path of the broadcast shape.

        Raises
        ------
        ValueError
            If no two impulses reach a final position in the duration (the message gives the miss distance), a
            duration is not positive or too long, a time is outside of the span of the chief, shapes do not
            fit, or a number is not finite.

        References
        ----------
        docs/motion.md.
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
            Before the first impulse, in the chief's frame.
        final : array_like of shape (..., 6) [m, m/s]
            After the last one, in the chief's frame.
        duration : array_like of shape (...) [s]
            Above 0, at most 100 revolutions.
        start : array_like of shape (...) [s], default 0
            Departure time, from that of the chief's elements; all arguments broadcast.
        thrusters : None
            Fixed thrusters hold for circular orbits only.

        Returns
        -------
        Path
            Path of the broadcast shape; `impulses` lists times and velocity changes of one spacecraft.

        Raises
        ------
        ValueError
            If thrusters are given; if no plan is proven to be within a relative 1e-6 of the minimum; if a
            duration is not positive or too long, a time is outside of the span of the chief, shapes do not
            fit, or a number is not finite.

        References
        ----------
        Lawden's primer, by its dual in six unknowns: docs/theory.md (29).

        Examples
        --------
        >>> orbit = cf.Orbit.eccentric(0.3, perigee_altitude=500e3)
        >>> given = [0, -200, 0, 0, 0, 0], np.zeros(6), orbit.period
        >>> bool(orbit.impulsive(*given).delta_v < orbit.two_impulse(*given[:2], 0.9 * orbit.period).delta_v)
        True
        """
        if thrusters is not None:
            raise ValueError(
                f"thrusters: hold for circular orbits only, not for an {self.chief}; leave them out"
            )
        shape, rows, finals = self._departures(initial, final, duration, start)
        plans = [self._fired(row, end, self._least(row, end)) for row, end in zip(rows, finals, strict=True)]
        offsets = np.concatenate([[0], np.cumsum([len(plan) for plan in plans])]).astype(np.int64)
        return path_of(self, np.concatenate([np.empty((0, WIDTH)), *plans]), offsets, shape)

    def _departures(
        self, initial: ArrayLike, final: ArrayLike, duration: ArrayLike, start: ArrayLike
    ) -> tuple[tuple[int, ...], Floats, Floats]:
        """Return the shape, the arcs (P, 30) and the final states (P, 6) of transfers by impulses."""
        arcs, finals = arcs_between(self._rate, initial, final, duration, start)
        rows = self._arcs(arcs).reshape(-1, WIDTH)
        longest = float((rows[:, END] - rows[:, START]).max(initial=0.0))
        if longest > MOST_TURNS * self.period:
            raise ValueError(
                f"duration: the minimum delta-v is computed over at most {MOST_TURNS:g} revolutions, got "
                f"{longest / self.period:g}; coast for the rest"
            )
        return arcs.shape[:-1], rows, finals

    def _bounds(
        self, initial: ArrayLike, final: ArrayLike, duration: ArrayLike, start: ArrayLike
    ) -> tuple[tuple[int, ...], Floats, Floats]:
        """Return the shape, the arcs (P, 30) and bounds, 1 if unique, and primers at the start (P, 9)."""
        shape, rows, finals = self._departures(initial, final, duration, start)
        found = np.empty((len(rows), 9))
        for p in range(len(rows)):
            answer, _ = self._answer(rows[p], finals[p])
            found[p] = answer[[LOWER, UPPER, UNIQUE, *range(PRIMER, FIRST)]]
        return shape, rows, found

    def _least(self, arc: Floats, final: Floats) -> Floats:
        """Return the impulses (K, 4) [s, m/s] of minimum delta-v from an arc's state to a final one."""
        answer, segments = self._answer(arc, final)
        if not answer[UPPER] - answer[LOWER] <= PROVEN * answer[UPPER]:
            raise ValueError(
                f"duration: no plan of impulses about an {self.chief} is proven to be within {PROVEN:g} "
                f"of the minimum, {answer[LOWER]:.6g} m/s; change the duration, or use two_impulse"
            )
        clock = self.chief.table.clock
        found = answer[FIRST:].reshape(-1, 5)[: int(answer[COUNT])]
        windows = segments[found[:, 0].astype(int)]
        first, last = windows[:, kernels.FIRST], windows[:, kernels.LAST]
        angles = first + found[:, 1] * (last - first)
        times = (angles - clock[1] * np.sin(angles) - clock[2]) / clock[0]
        times = np.clip(times, arc[START], arc[END])
        times[angles <= segments[0, kernels.FIRST] + kernels.ON_JOINT] = arc[START]
        times[angles >= segments[-1, kernels.LAST] - kernels.ON_JOINT] = arc[END]
        return np.column_stack([times, found[:, 2:]])

    def _answer(self, arc: Floats, final: Floats) -> tuple[Floats, Floats]:
        """Return the answer of `impulses.solve` from an arc's state to a final one in SI, and the segments.

        Its primer is that at the arc's start.
        """
        table, rate = self.chief.table, self._rate
        unit = np.array([1.0] * 3 + [rate] * 3)
        segments, _ = self._segments(arc[None], np.array([0, 1]))
        rows, whole = np.empty((len(segments), 3, 6, TERMS)), np.empty((6, 6))
        primer_rows(table.form, segments, rows, whole)
        begin = segments[0, kernels.COLUMN : kernels.COLUMN + 6]
        change = np.linalg.solve(whole, final / unit - whole @ begin)
        sizes = np.abs(whole) @ np.abs(begin) + np.abs(final / unit)
        if np.abs(whole @ change).max() <= UNMOVED * sizes.max():
            change = np.zeros(6)
        k, first = int(segments[0, kernels.WINDOW]), segments[0, kernels.FIRST]
        # theory (99)
        answer = solve(rows, np.concatenate([change[3:] + table.skew(k) @ change[:3], -change[:3]]))
        answer[[LOWER, UPPER]] *= rate
        answer[FIRST:].reshape(-1, 5)[:, 2:] *= rate
        share = (first - segments[0, kernels.ORIGIN]) / (table.joints[k + 1] - table.joints[k])
        there = np.einsum("b,jib->ij", basis_at(np.array(max(share, 0.0))), table.rows[k, :6])
        answer[PRIMER:FIRST] = unit * (there @ answer[PRIMER:FIRST])
        return answer, segments

    def _fired(self, arc: Floats, final: Floats, impulses: Floats) -> Floats:
        """Return the coasts (M, 30) between impulses (K, 4) from an arc's state to a final one."""
        out, row = [], arc.copy()
        for time, *push in impulses:
            if time > row[START]:
                out.append(row.copy())
                out[-1][END] = time
                row[STATE : STATE + 6] = self._arrived(out[-1][None])[0]
                row[START], row[IMPULSE : IMPULSE + 3] = time, 0.0
            row[IMPULSE : IMPULSE + 3] += push
            row[STATE + 3 : STATE + 6] += push
        if row[START] == row[END]:
            row[STATE : STATE + 6] = final
        return np.array([*out, row])

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
            State at the start, in the chief's frame.
        acceleration : array_like of shape (..., 3) [m/s^2]
            Thrust acceleration, constant in the chief's turning frame.
        duration : array_like of shape (...) [s]
            Above 0.
        start : array_like of shape (...) [s], default 0
            Time of the state, from that of the chief's elements; all arguments broadcast.
        frame : "orbit"
            Thrust that is constant in inertial axes holds for circular orbits only.

        Returns
        -------
        Path
            Path of the broadcast shape.

        Raises
        ------
        ValueError
            If a duration is not positive or too long, a time is outside of the span of the chief, shapes do
            not fit, a number is not finite, or `frame` is not "orbit".

        References
        ----------
        docs/motion.md.
        """
        if not isinstance(frame, str) or frame != "orbit":
            raise ValueError(
                f"frame: 'orbit' for an {self.chief}, not {shown(frame)}; join short burns that turn"
            )
        push = finite("acceleration", acceleration, 3)
        arcs = arcs_from(self._rate, duration, start, state=state, like=push.shape[:-1])
        arcs[..., PUSH : PUSH + 3] = push
        return self._path(self._arcs(arcs))

    def sampled(self, times: ArrayLike, states: ArrayLike) -> Path:
        """Return the path through states: between two of them the transfer of minimum energy.

        Parameters
        ----------
        times : array_like of shape (T,) [s]
            Increasing, T >= 2.
        states : array_like of shape (..., T, 6) [m, m/s]
            States at these times, in the chief's frame; the path passes through all of them.

        Returns
        -------
        Path
            Path of the states' leading shape; see its `interpolation_error`.

        Raises
        ------
        ValueError
            If times do not increase, shapes do not fit, a number is not finite, an interval between times
            is too long or too short, or a time is outside of the span of the chief.

        References
        ----------
        docs/motion.md.
        """
        instants, points = finite("times", times), finite("states", states, 6)
        if instants.ndim != 1 or len(instants) < 2 or points.shape[-2:-1] != instants.shape:
            raise ValueError(
                "states: expected shape (..., T, 6) for T >= 2 times, "
                f"got {points.shape} for times of shape {instants.shape}"
            )
        if not (np.diff(instants) > 0).all():
            raise ValueError("times: must increase strictly")
        arcs, finals = arcs_between(
            self._rate, points[..., :-1, :], points[..., 1:, :], np.diff(instants), instants[:-1]
        )
        rows = self._arcs(arcs).reshape(-1, WIDTH)
        self._steer(rows, finals)
        *batch, each, _ = arcs.shape
        offsets = each * np.arange(int(np.prod(batch, dtype=int)) + 1)
        return path_of(self, rows, offsets, tuple(batch))

    # What paths ask of their orbit

    @property
    def _model(self) -> str:
        """Name of the equations of relative motion."""
        words = str(self.chief)
        return f"linear motion beside {'an' if words[0] in 'aeiou' else 'a'} {words}"

    @property
    def _column(self) -> float:
        """Value of the column MEAN_MOTION of arcs: Hill's kernels make nothing of it."""
        return np.nan

    @property
    def _rate(self) -> float:
        return float(self.chief.table.clock[0])

    def _arcs(self, arcs: Floats) -> Floats:
        """Return arcs (..., 30) as those of this chief; raise ValueError beyond its span."""
        first, last = self.chief.span
        begin, end = arcs[..., START].min(initial=np.inf), arcs[..., END].max(initial=-np.inf)
        self._within(begin, end, first, last)
        arcs[..., MEAN_MOTION] = self._column
        return arcs

    def _within(self, begin: float, end: float, first: float, last: float) -> None:
        if begin < first or end > last:
            raise ValueError(
                f"start, duration: times from {begin:g} to {end:g} s are beyond those of the {self.chief}, "
                f"{first:g} to {last:g} s; make the orbit with a longer span"
            )

    def _flows(self, spans: Floats) -> tuple[Floats, Floats]:
        """Return Phi (P, 6, 6) and the responses (P, 6, 9) to costate and push over time spans (P, 2)."""
        if len(spans):
            self._within(spans.min(), spans.max(), *self.chief.span)
        flow, response = np.empty((len(spans), 6, 6)), np.empty((len(spans), 6, COLUMNS - COSTATE))
        kernels.flows(self.chief.table.form, np.ascontiguousarray(spans), flow, response)
        return flow, response

    def _flow(self, arcs: Floats) -> Floats:
        """Return the transition matrices (M, 6, 6) over arcs (M, 30)."""
        return self.transition(arcs[:, END] - arcs[:, START], arcs[:, START])

    def _steer(self, arcs: Floats, finals: Floats) -> None:
        """Set the optimal thrust of each arc so that it ends in its final state, theory (7, 8)."""
        rate = self._rate
        flow, answers = self._flows(arcs[:, [START, END]])
        speeds = np.array([1.0] * 3 + [rate] * 3)
        # equations in units of the duration: rows of positions and velocities, columns of p and p'
        lengths = rate * (arcs[:, END] - arcs[:, START])[:, None]
        rows = np.repeat(lengths ** np.array([[-2.0, -1.0]]), 3, axis=1)
        columns = np.repeat(lengths ** np.array([[0.0, -1.0]]), 3, axis=1)
        response = rows[:, :, None] * answers[:, :, : PUSHED - COSTATE] * columns[:, None, :]
        units = columns * rate ** np.array([2.0] * 3 + [3.0] * 3)
        reached = np.einsum("pij,pj->pi", flow, arcs[:, STATE : STATE + 6] / speeds) * speeds
        for _ in range(3):  # twice from where the thrust so far leads, which corrects rounding
            left = rows * (finals - reached) / speeds
            arcs[:, THRUST : THRUST + 6] += units * np.linalg.solve(response, left[..., None])[..., 0]
            reached = self._arrived(arcs)
        self._check_arrival(arcs, finals, reached)

    def _arrived(self, arcs: Floats) -> Floats:
        """Return the states (P, 6) at the ends of arcs (P, 30)."""
        path = path_of(self, arcs, np.arange(len(arcs) + 1), (len(arcs),))
        return path._evaluate_rows(arcs[:, END : END + 1])[:, 0]

    def _check_arrival(self, arcs: Floats, finals: Floats, reached: Floats) -> None:
        """Raise ValueError if arcs (P, 30) miss their final states (P, 6): a very short transfer rounds."""
        if not len(arcs):
            return
        both = np.abs(np.stack([arcs[:, STATE : STATE + 6], finals]))
        lengths = arcs[:, END] - arcs[:, START]
        scale = np.maximum(both[..., :3].max(axis=(0, 2)), both[..., 3:].max(axis=(0, 2)) * lengths)
        missed = np.abs(reached[:, :3] - finals[:, :3]).max(axis=1)
        if (missed > FORGIVEN * scale).any():
            raise ValueError(
                f"duration: {lengths.min():g} s is too short beside an {self.chief}, where rounding would "
                f"move the end by {missed.max():.2g} m; lengthen the transfer, or use two_impulse"
            )

    def _angle(self, time: float) -> float:
        """Return the angle of the table's clock at a time [s]; raise ValueError beyond the span."""
        self._within(time, time, *self.chief.span)
        return float(angles_at(self.chief.table.clock, np.array([time]))[0])

    def _segments(self, arcs: Floats, offsets: Any) -> tuple[Floats, Any]:
        """Return the segments (S, 21) of arcs (M, 30), and the index of the first one of each path."""
        table = self.chief.table
        firsts = np.empty(len(offsets), dtype=np.int64)
        guess = 2 * len(arcs) + int(len(table.joints) * (arcs[:, END] - arcs[:, START]).sum() / self.period)
        while True:
            rows = np.empty((guess, kernels.SEGMENT))
            count = kernels.unroll(table.form, arcs, offsets, rows, firsts)
            if count <= guess:
                return rows[:count], firsts
            guess = count

    def _interpolates(self, arcs: Floats) -> Any:
        """Return False for arcs (M, 30): none is a cubic through samples."""
        return np.zeros(len(arcs), dtype=bool)

    def _fill_states(self, path: Path, times: Floats, out: Floats) -> None:
        """Fill `out` with states of a path, or with thrusts if it has three columns."""
        kernels.evaluate(self.chief.table.form, *path._segments, times, out)

    def _totals(self, path: Path, what: int) -> Floats:
        """Return a quantity of `effort.totals` for each spacecraft of a path."""
        wanted = {
            effort.ENERGY: kernels.ENERGY,
            effort.DELTA_V: kernels.DELTA_V,
            effort.PEAK: kernels.PEAK,
            effort.HIDDEN: kernels.PEAK,
        }[what]
        segments, firsts = path._segments
        if what == effort.HIDDEN:
            segments, firsts = self._segments(path.arcs, np.arange(len(path.arcs) + 1))
        out = np.empty(len(firsts) - 1)
        kernels.totals(self.chief.table.form, segments, firsts, wanted, out)
        if what != effort.HIDDEN:
            return out
        out *= effort.BANG_BANG * (path.arcs[:, END] - path.arcs[:, START]) ** 2
        return np.asarray(np.maximum.reduceat(out, path.offsets[:-1]))

    def _path(self, arcs: Any) -> Path:
        rows = np.ascontiguousarray(arcs).reshape(-1, WIDTH)
        return path_of(self, rows, np.arange(len(rows) + 1), arcs.shape[:-1])
