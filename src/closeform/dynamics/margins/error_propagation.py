"""Propagation of errors along a plan under feedback: deviations of each cause, and the responses to them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice, product
from typing import Self

import numpy as np

from closeform.arrays import Floats
from closeform.dynamics.control.closed_loop import KINDS, ClosedLoop
from closeform.dynamics.control.feedback import Feedback, Navigation
from closeform.dynamics.force_model.field import Field
from closeform.dynamics.force_model.hill_frame import ChiefFrame
from closeform.dynamics.model_error import deviations_of, residuals
from closeform.dynamics.simulation.commands import SAME, ThrustSpans, burn_edges, intervals_in
from closeform.dynamics.simulation.guidance import Guidance
from closeform.dynamics.simulation.impulse_retargeting import Retargeted
from closeform.fuel.allocation import Allocation
from closeform.fuel.thrusters import Thrusters
from closeform.motion.arc import START
from closeform.motion.path import Path
from closeform.uncertainty.error_columns import burn_ranges, columns_of, impulse_errors
from closeform.uncertainty.errors import Uncertainty

STEPS, MOST = 6, 60  # steps between measurements: even, and a delay is a whole number
OFTEN = 15.0  # s, step, unless there are more than the maximum number
NEAR = 0.02  # of a step, tolerance on the delay
FINER = 6  # instants of a step at which the ripple of pulses is sampled
UNIT = Uncertainty(magnitude=1.0, pointing=1.0)  # four columns for each burn


@dataclass(frozen=True, eq=False)
class TrackedPlan:
    """Planned paths (N,) at T `times`, under feedback by a `loop`.

    The impulses as fired, or the pulses of `thrusters` along `pulsed` paths, cause a known `offset` (N, T, 3)
    [m] from the plan, and a `ripple` (N,) [m] between times. They miss the planned states at the ends of some
    spans: `missed` are spacecraft, times and state errors, from which the following motion starts. Continuous
    thrust is that of the plan plus the `compensation` (N, T, 3) [m/s^2] of the model error, of which the
    `uncompensated` part (N, T, 3) remains.
    """

    paths: Path
    loop: ClosedLoop
    times: Floats
    impulses: Retargeted
    offset: Floats
    missed: tuple[tuple[int, float, Floats], ...]
    compensation: Floats
    uncompensated: Floats
    pulsed: Path | None
    ripple: Floats
    thrusters: Sequence[Thrusters] | None

    @classmethod
    def of(
        cls,
        paths: Path,
        field: Field,
        law: Feedback,
        cancel: bool,
        thrusters: Sequence[Thrusters] | None = None,
    ) -> Self:
        """Return the paths as `simulate` tracks them in a known field.

        `cancel`: compensate the model error.
        """
        times, every, steps = instants(paths, law)
        loop = ClosedLoop.of(paths.orbit, law, every, steps, thrusters is not None)
        left_out = residuals(field, ChiefFrame.of(field, times), paths.state(times), paths.orbit.mean_motion)
        guidance = Guidance.of(paths, field, law, thrusters or (), cancel)
        spans, offset, ripple = ThrustSpans.of(paths, law), np.zeros(left_out.shape), np.zeros(len(paths))
        moved, compensated = spans.impulsive_at(times), cancel & spans.compensated(times)
        if guidance.firing is not None:
            pulsing = np.unique(guidance.firing.pulses.craft)
            fine = np.linspace(times[0], times[-1], FINER * (len(times) - 1) + 1)
            off = (guidance.reference.position(fine) - paths.position(fine))[pulsing]
            offset[pulsing] = off[:, ::FINER]
            straight = np.linspace(off[:, :-1:FINER], off[:, FINER::FINER], FINER, endpoint=False, axis=2)
            more = off[:, :-1] - straight.reshape(off[:, :-1].shape)
            ripple[pulsing] = np.linalg.norm(more, axis=-1).max(axis=1)
        elif cancel:
            offset[moved] = (guidance.reference.position(times) - paths.position(times))[moved]
        compensation = -left_out * compensated[..., None]
        uncompensated = left_out * ~(compensated | moved & cancel)[..., None]
        missed, firing = tuple(guidance.missed), guidance.firing
        pulsed = None if firing is None else firing.path
        known = guidance.impulses, offset, missed, compensation, uncompensated
        return cls(paths, loop, times, *known, pulsed, ripple, thrusters)

    @property
    def bits(self) -> Floats:
        """Largest impulse (N,) [m/s] that thrusters do not fire: one bit of each of three."""
        return np.array([_least_push(one) for one in self.thrusters or ()] or np.zeros(len(self.paths)))

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
        jumps = np.einsum("kij,mj->mki", KINDS, self.impulses.impulse)
        for k, when, sizes in zip(self.impulses.craft, self.impulses.time, jumps, strict=True):
            after = times > when + SAME  # a measurement at that instant precedes the impulse
            moved = orbit.transition(times[after] - when)[:, :, 3:]
            coasting[1:, k, after] += np.einsum("tij,rj->rti", moved, sizes)
        for k, when, state in self.missed:
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
        loop, count, own = self.loop, len(self.times), self.impulses.craft == craft
        path, compensation = self.paths[craft], self.compensation[craft]
        if self.pulsed is not None:  # pulses are the only burns
            own, path, compensation = np.zeros_like(own), self.pulsed[craft], np.zeros_like(compensation)
        jumps = self.impulses.time[own], self.impulses.impulse[own]
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
        executed = errors if self.pulsed is None else errors._of_orders
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
