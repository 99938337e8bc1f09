"""A reference orbit that is not circular, and the paths that spacecraft can take about its chief."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, broadcast, finite
from closeform.motion import effort
from closeform.motion.arc import END, IMPULSE, MEAN_MOTION, START, STATE, THRUST, WIDTH
from closeform.motion.chief import segments as kernels
from closeform.motion.chief.bernstein import DEGREE, TERMS, basis_at
from closeform.motion.chief.clock import angles_at, pace_at, times_at
from closeform.motion.chief.impulses import primer_rows, solve
from closeform.motion.chief.oblate_or_supplied import GivenChief, OblateChief
from closeform.motion.chief.table import COLUMNS, COSTATE
from closeform.motion.chief.table import PUSH as PUSHED
from closeform.motion.chief.yamanaka_ankersen import KeplerChief
from closeform.motion.construction.ends import arcs_between
from closeform.motion.construction.sampling import nodes_of
from closeform.motion.duration import MOST_TURNS
from closeform.motion.minimum_delta_v.reduced import ANSWER, COUNT, FIRST, LOWER, PRIMER, UNIQUE, UPPER
from closeform.motion.path import FORGIVEN, Path, path_of
from closeform.motion.reference_orbit import ReferenceOrbit

if TYPE_CHECKING:
    from closeform.fuel.thrusters import Thrusters

SUPPORTED = "transfer, impulsive, avoid, reconfigure, screen and passively_safe, which hold about any chief"


PROVEN = 1e-6  # relative gap between the cost of impulses and its lower bound
# [rad] of motion: for a shorter time noise acts as in deep space, and R would be rounding.
BRIEF = 1e-3
UNMOVED = 1e-14  # of the states: a smaller change is rounding, and takes no impulse


@dataclass(frozen=True, repr=False)
class ChiefOrbit(ReferenceOrbit):
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
        """Not defined: the features that use it are valid in Hill's equations only."""
        self._refuse("this feature")

    def _refuse(self, feature: str) -> NoReturn:
        raise ValueError(
            f"orbit: {feature} is available about a circular orbit only, not about {self.chief}; use "
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

    def _within_limit(self, *_: Any) -> Path:
        raise ValueError(
            f"max_acceleration: a thrust limit is available about a circular orbit only, "
            f"not about {self.chief}; omit it and check peak_thrust of the path, or lengthen the transfer"
        )

    def _fixed_inertially(self, arcs: Floats) -> Floats:
        raise ValueError(
            f"frame: must be 'orbit' about {self.chief}, got 'inertial'; join short burns that turn"
        )

    def _through(self, times: ArrayLike, states: ArrayLike) -> Path:
        instants, points = nodes_of(times, states)
        arcs, finals = arcs_between(
            self._rate, points[..., :-1, :], points[..., 1:, :], np.diff(instants), instants[:-1]
        )
        rows = self._arcs(arcs).reshape(-1, WIDTH)
        self._steer(rows, finals)
        *batch, each, _ = arcs.shape
        offsets = each * np.arange(int(np.prod(batch, dtype=int)) + 1)
        return path_of(self, rows, offsets, tuple(batch))

    def _least_impulses(self, arcs: Floats, finals: Floats, thrusters: Thrusters | None) -> Path:
        if thrusters is not None:
            raise ValueError(
                f"thrusters: are available about a circular orbit only, not about {self.chief}; omit them"
            )
        rows = self._departures(arcs)
        plans = [self._fired(row, end, self._least(row, end)) for row, end in zip(rows, finals, strict=True)]
        offsets = np.concatenate([[0], np.cumsum([len(plan) for plan in plans])]).astype(np.int64)
        return path_of(self, np.concatenate([np.empty((0, WIDTH)), *plans]), offsets, arcs.shape[:-1])

    def _departures(self, arcs: Floats) -> Floats:
        """Return the arcs (P, 30) of transfers by impulses; raise ValueError if one is too long."""
        rows = arcs.reshape(-1, WIDTH)
        longest = float((rows[:, END] - rows[:, START]).max(initial=0.0))
        if longest > MOST_TURNS * self.period:
            raise ValueError(
                f"duration: the minimum delta-v is computed over at most {MOST_TURNS:g} revolutions, got "
                f"{longest / self.period:g}; coast for the rest"
            )
        return rows

    def _bounds(
        self, initial: ArrayLike, final: ArrayLike, duration: ArrayLike, start: ArrayLike
    ) -> tuple[tuple[int, ...], Floats, Floats]:
        """Return the shape, the arcs (P, 30) and bounds, 1 if unique, and primers at the start (P, 9)."""
        arcs, finals = arcs_between(self._rate, initial, final, duration, start)
        rows = self._departures(self._arcs(arcs))
        found = np.empty((len(rows), 9))
        for p in range(len(rows)):
            found[p] = self._answer(rows[p], finals[p])[[LOWER, UPPER, UNIQUE, *range(PRIMER, FIRST)]]
        return arcs.shape[:-1], rows, found

    def _least(self, arc: Floats, final: Floats) -> Floats:
        """Return the impulses (K, 4) [s, m/s] of minimum delta-v from an arc's state to a final one."""
        answer = self._answer(arc, final)
        if not answer[UPPER] - answer[LOWER] <= PROVEN * answer[UPPER]:
            raise ValueError(
                f"duration: no plan of impulses about {self.chief} is proven to be within {PROVEN:g} "
                f"of the minimum, {answer[LOWER]:.6g} m/s; change the duration, or use two_impulse"
            )
        found = answer[FIRST:].reshape(-1, 4)[: int(answer[COUNT])] + [arc[START], 0.0, 0.0, 0.0]
        found[:, 0] = np.clip(found[:, 0], arc[START], arc[END])
        return np.asarray(found)

    def _answers(self, arcs: Floats, finals: Floats) -> Floats:
        """Return the answers (P, 34) of `_answer` for arcs (P, 30) and final states (P, 6)."""
        return np.array([self._answer(*both) for both in zip(arcs, finals, strict=True)]).reshape(-1, ANSWER)

    def _answer(self, arc: Floats, final: Floats) -> Floats:
        """Return the answer of `impulses.solve` from an arc's state to a final one in SI.

        Its primer is that at the arc's start, and its times are those since then.
        """
        table, rate = self.chief.table, self._rate
        unit = np.array([1.0] * 3 + [rate] * 3)
        coast = arc.copy()
        coast[STATE + 6 :] = 0.0
        segments, _ = self._segments(coast[None], np.array([0, 1]))
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
        answer[FIRST:].reshape(-1, 4)[:, 1:] *= rate
        share = (first - segments[0, kernels.ORIGIN]) / (table.joints[k + 1] - table.joints[k])
        there = np.einsum("b,jib->ij", basis_at(np.array(max(share, 0.0))), table.rows[k, :6])
        answer[PRIMER:FIRST] = unit * (there @ answer[PRIMER:FIRST])
        impulses = answer[FIRST:].reshape(-1, 4)[: int(answer[COUNT])]
        index = np.minimum(impulses[:, 0].astype(int), len(segments) - 1)
        begin, end = segments[:, kernels.FIRST], segments[:, kernels.LAST]
        angles = begin[index] + (impulses[:, 0] - index) * (end - begin)[index]
        times = np.clip(times_at(table.clock, angles), arc[START], arc[END])
        times[angles <= begin[0] + kernels.ON_JOINT] = arc[START]
        times[angles >= end[-1] - kernels.ON_JOINT] = arc[END]
        impulses[:, 0] = times - arc[START]
        return answer

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

    # What paths ask of their orbit

    @property
    def _model(self) -> str:
        """Name of the equations of relative motion."""
        return f"linear motion beside {self.chief}"

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
                f"start, duration: times from {begin:g} to {end:g} s are beyond those of {self.chief}, "
                f"{first:g} to {last:g} s; make the orbit with a longer span"
            )

    def _flows(self, spans: Floats) -> tuple[Floats, Floats]:
        """Return Phi (P, 6, 6) and the responses (P, 6, 9) to costate and push over time spans (P, 2)."""
        if len(spans):
            self._within(spans.min(), spans.max(), *self.chief.span)
        flow, response = np.empty((len(spans), 6, 6)), np.empty((len(spans), 6, COLUMNS - COSTATE))
        kernels.flows(self.chief.table.form, np.ascontiguousarray(spans), flow, response)
        return flow, response

    def _spaced(self, begin: Any, end: Any, count: int) -> Floats:
        """Return times (..., count) from `begin` to `end`, dense near perigee."""
        clock = self.chief.table.clock
        first, last = angles_at(clock, np.asarray(begin)), angles_at(clock, np.asarray(end))
        times = times_at(clock, np.linspace(first, last, count, axis=-1))
        times[..., 0], times[..., -1] = begin, end
        return times

    def _noise(self, start: float, times: Floats) -> Floats:
        """Return the covariances (T, 6, 6) that white noise of density 1 from a start to `times` (T,) adds.

        theory (9). W = R P Phi^T: R is the response to the costate at the start, and P gives that costate, by
        the symplectic form there, as in `covariance_propagation.add_noise`.
        """
        rate = self._rate
        flow, response = self._flows(np.stack([np.full(len(times), start), times], axis=1))
        back = np.swapaxes(flow, 1, 2)
        costates = np.concatenate([back[:, 3:], -back[:, :3] - self._skew(start) @ back[:, 3:]], axis=1)
        out = response[:, :, :6] @ costates
        unit = np.array([1.0] * 3 + [rate] * 3)
        found = 0.5 * (out + np.swapaxes(out, 1, 2)) * unit[:, None] * unit / rate**3
        passed = times - start
        soon = rate * passed < BRIEF * pace_at(self.chief.table.clock, self._angle(start)) ** 1.5
        powers = np.array([[passed**3 / 3.0, passed**2 / 2.0], [passed**2 / 2.0, passed]])
        free = np.kron(powers.transpose(2, 0, 1), np.eye(3))
        found[soon] = free[soon]
        return np.asarray(found)

    def _skew(self, time: float) -> Floats:
        """Return W (3, 3), as `Table.skew`, at any time, propagated from the beginning of its window."""
        table, angle = self.chief.table, self._angle(time)
        passed = table.turn * np.floor((angle - table.joints[0]) / table.turn) if table.turn else 0.0
        k = min(int(np.searchsorted(table.joints, angle - passed, side="right")), len(table.joints) - 1) - 1
        begin = times_at(table.clock, np.array(passed + table.joints[k]))
        back = np.linalg.inv(self._flows(np.array([[min(begin, time), time]]))[0][0])
        form = np.zeros((6, 6))
        form[:3, :3], form[:3, 3:], form[3:, :3] = table.skew(k), np.eye(3), -np.eye(3)
        return np.asarray((back.T @ form @ back)[:3, :3])

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
                f"duration: {lengths.min():g} s is too short about {self.chief}: rounding would "
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

    def _bends(self, arcs: Floats) -> tuple[Floats, Floats]:
        """Return bounds (A,) on acceleration [m/s^2] and jerk [m/s^3] of arcs (A, 30).

        The coefficients bound the derivatives of the velocity by the clock's angle, and its rate is largest
        nearest to perigee.
        """
        table, (rate, e, _) = self.chief.table, self.chief.table.clock
        segments, firsts = self._segments(np.ascontiguousarray(arcs), np.arange(len(arcs) + 1))
        k = segments[:, kernels.WINDOW].astype(int)
        begin, end = segments[:, kernels.FIRST], segments[:, kernels.LAST]
        slopes = rate * np.einsum("sj,sjib->sib", segments[:, kernels.COLUMN :], table.rows[k, :, 3:])
        by_angle = []
        for degree in (DEGREE, DEGREE - 1):
            slopes = degree * np.diff(slopes, axis=2) / np.diff(table.joints)[k, None, None]
            by_angle.append(np.linalg.norm(slopes, axis=1).max(axis=1))
        past_perigee = np.floor(end / (2.0 * np.pi)) > np.floor(begin / (2.0 * np.pi))
        nearest = np.where(past_perigee, 1.0, np.maximum(np.cos(begin), np.cos(end)))
        pace = rate / (1.0 - e * nearest)  # bound of ds/dt
        out = np.zeros((2, len(arcs)))
        owners = np.repeat(np.arange(len(arcs)), np.diff(firsts))
        np.maximum.at(out[0], owners, by_angle[0] * pace)
        np.maximum.at(out[1], owners, by_angle[1] * pace**2 + by_angle[0] * e * pace**3 / rate)
        return out[0], out[1]

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
