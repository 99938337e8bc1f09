"""Closed loop of a spacecraft: response to disturbances and to errors of navigation and execution."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import islice
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from closeform.arrays import Floats
from closeform.dynamics.control.feedback import (
    Feedback,
    Navigation,
    impulse_effects,
    impulse_gains,
    impulse_slots,
    optimal_return,
    return_by_impulses,
    slots_before_next,
)
from closeform.motion.orbit import Orbit
from closeform.uncertainty.white_noise import step_noise

if TYPE_CHECKING:
    from closeform.uncertainty.errors import Uncertainty

PARTS = 24  # parts of an interval in which an acceleration is constant
COARSE = 1.01  # factor on the sum over parts, for the integral and the truncated tail
FADED = 3e-4  # relative size at which the series is truncated
SETTLED = 1e-9  # relative change at which a constant error has settled
LONGEST = 10_000  # number of intervals after which a constant error has settled
# Relative errors of thrust: larger by 100 %, and rotated by 1 rad about each axis.
KINDS = np.concatenate([np.eye(3)[None], np.cross(np.eye(3)[:, None], np.eye(3)).swapaxes(1, 2)])
# corners of the thrust error domain
CORNERS = np.array([[s, *turn] for s in (-1.0, 1.0) for turn in np.eye(3)])


@dataclass(frozen=True, eq=False)
class ClosedLoop:
    """Feedback loop of a spacecraft, known at S + 1 instants `since` (S + 1,) of an interval.

    In this interval one measurement is in effect. It begins `delay` after the measurement, for which the
    state is predicted. The transition from its start is `closed` (S + 1, 6, 6) with feedback, and `coast`
    without. `law` (S + 1, 3, 6) gives the thrust, or (J, 3, 6) the impulses at `impulse_times` (J,) [s] after
    a measurement.  # theory (85), (86) and (88)
    """

    orbit: Orbit
    delay: float
    since: Floats
    closed: Floats
    coast: Floats
    law: Floats
    impulse_times: Floats

    @classmethod
    @lru_cache(maxsize=8)  # repeated planning uses the same loop and its cached properties
    def of(cls, orbit: Orbit, feedback: Feedback, every: float, steps: int, finite: bool = False) -> Self:
        """Return the loop of a feedback, for intervals of length `every` [s] with some steps.

        `finite`: finite burns in place of impulses.
        """
        since, delay = np.linspace(0.0, every, steps + 1), min(feedback.delay, every)
        if not feedback.impulses:
            return cls(orbit, delay, since, *optimal_return(orbit, feedback.horizon, since), np.zeros(0))
        begin, over = impulse_slots(feedback)
        now = slice(len(slots_before_next(feedback, every)))  # the next measurement replaces the others
        times = (0.5 * (begin + np.minimum(over, every)) if finite else begin)[now]
        gains = impulse_gains(orbit, feedback, finite)[1][now]
        return cls(orbit, delay, since, *return_by_impulses(orbit, times, gains, since), gains, times)

    @property
    def every(self) -> float:
        """Time between measurements [s]."""
        return float(self.since[-1])

    @property
    def wait(self) -> int:
        """Delay in steps."""
        return round(self.delay / self.every * (len(self.since) - 1))

    @cached_property
    def prediction(self) -> Floats:
        """Transition (6, 6) of a measurement over the delay."""
        return np.asarray(self.orbit.transition(self.delay))

    @cached_property
    def response(self) -> Floats:
        """Effect of the feedback on the state (S + 1, 6, 6), per believed deviation."""
        return self.closed - self.coast

    @cached_property
    def error_response(self) -> Floats:
        """Effect of a measurement error on the state (S + 1, 6, 6)."""
        return np.asarray(self.response @ self.prediction)

    @cached_property
    def impulse_response(self) -> Floats:
        """Effect of an impulse of 1 m/s along each axis (S + 1, J, 6, 3)."""
        return impulse_effects(self.orbit, self.impulse_times, self.since)

    def intervals(self, count: int) -> Iterator[tuple[int, slice]]:
        """Yield the step of each measurement, and the steps in which it is in effect, both ends included."""
        steps = len(self.since) - 1
        for seen in range(0, count - 1 - self.wait, steps):
            yield seen, slice(seen + self.wait, min(seen + self.wait + steps + 1, count))

    def propagate(self, coasting: Floats) -> tuple[Floats, Floats]:
        """Return deviations (R, T, 3) due to disturbances, and the believed ones (R, I, 6) per interval.

        `coasting` (R, T, 6) is the effect of each disturbance on a coast, at the steps of all intervals.
        Feedback measures a disturbance only by its effect on the state.  # theory (86)
        """
        off, believed = coasting.copy(), [np.empty((len(coasting), 0, 6))]
        for seen, some in self.intervals(coasting.shape[1]):
            now, kept = off[:, some.start], slice(some.stop - some.start)
            own = now - coasting[:, some.start] + coasting[:, seen] @ self.prediction.T
            moved = np.einsum("sij,rj->rsi", self.coast[kept], now - coasting[:, some.start])
            off[:, some] = coasting[:, some] + moved + np.einsum("sij,rj->rsi", self.response[kept], own)
            believed.append(own[:, None])
        return off[..., :3], np.concatenate(believed, axis=1)

    def commands(self, believed: Floats, count: int) -> Floats:
        """Return feedback thrust (R, T, 3) [m/s^2], or impulses (R, Q, 3) [m/s], for believed deviations."""
        each = np.einsum("sij,rkj->rksi", self.law, believed)
        if len(self.impulse_times):
            rows, intervals, fired, axes = each.shape
            return np.asarray(each.reshape(rows, intervals * fired, axes))
        thrust = np.zeros((len(believed), count, 3))
        for k, (_, some) in enumerate(self.intervals(count)):
            thrust[:, some] = each[:, k, : some.stop - some.start]
        return thrust

    def execution_covariances(
        self, sight: Navigation, errors: Uncertainty, believed: Floats, count: int
    ) -> Floats:
        """Return covariances (T, 3, 3) [m^2] due to the execution errors of feedback burns.

        Feedback responds to believed deviations, given as second moments (I, 6, 6), to navigation noise, and
        to the errors of earlier feedback burns.  # theory (96)
        """
        seen = np.hstack([np.eye(6), self.prediction])
        noise = seen @ self._steady_state(sight, self.closed, self.error_response) @ seen.T
        executed = self._impulse_errors if len(self.impulse_times) else self._burn_errors
        out = np.zeros((count, 6, 6))
        added, after, known = np.zeros((6, 6)), np.zeros_like(self.closed), np.zeros((6, 6))
        for k, (_, some) in enumerate(self.intervals(count)):
            before = _moved(self.closed, added) + after
            now, after, known = executed(errors, believed[k] + noise + added + known)
            out[some], added = (before + now)[: some.stop - some.start], before[-1]
        return out[:, :3, :3]

    def noise_covariances(self, density: float, count: int) -> tuple[Floats, Floats]:
        """Return covariances (T, 3, 3) [m^2] due to process noise of a `density` [m^2/s^3].

        Also return second moments (I, 6, 6) of the deviation that is believed in each interval. Noise during
        the delay is not yet measured.  # theory (96a)
        """
        steps, fresh = len(self.since) - 1, density * process_noise_covariances(self.orbit, self.since)
        unseen, believed, out, seen = fresh[self.wait], np.zeros((6, 6)), np.zeros((count, 6, 6)), []
        out[: self.wait + 1] = fresh[: self.wait + 1][:count]
        for _, some in self.intervals(count):
            seen.append(believed)
            moved = _moved(self.closed, believed) + _moved(self.coast, unseen)
            out[some] = (moved + fresh)[: some.stop - some.start]
            believed = moved[-1] + _moved(self.prediction, fresh[steps - self.wait])
        return out[:, :3, :3], np.reshape(seen, (-1, 6, 6))

    @cached_property
    def _wrong_response(self) -> Floats:
        """Effect (4, S + 1, 6, 6) of a feedback burn larger by 100 %, and rotated by 1 rad on each axis."""
        return np.array([self._response_with(wrong) - self.response for wrong in np.eye(4)])

    def _burn_errors(self, errors: Uncertainty, commanded: Floats) -> tuple[Floats, Floats, Floats]:
        """Return covariances (S + 1, 6, 6) of burn errors in their interval and the next, and believed.

        The burn responds to a deviation with second moments `commanded` (6, 6). The third result (6, 6) is
        the part that is believed at the start of the next interval; errors during the delay are not yet
        measured.
        """
        sizes = np.array([errors.magnitude, *[errors.pointing] * 3])
        now = sizes[:, None, None, None] * self._wrong_response
        end, unseen = now[:, -1:], now[:, -1:] - self.prediction @ now[:, -1 - self.wait, None]
        later = self.closed @ end - self.response @ unseen
        believed = _moved(end - unseen, commanded)
        now, later = _moved(now, commanded).sum(axis=0), _moved(later, commanded).sum(axis=0)
        return now, later, believed.sum(axis=0)[0]

    def _impulse_errors(self, errors: Uncertainty, commanded: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the same for Gates' errors of impulses; fixed errors act in all directions."""
        fixed, share, aside, turned = errors.impulse
        sizes = _moved(self.law, commanded)
        total = np.trace(sizes, axis1=-2, axis2=-1)[:, None, None] * np.eye(3)
        square = max(fixed, aside) ** 2 * np.eye(3) + share**2 * sizes + turned**2 * (total - sizes)
        now = _moved(self.impulse_response, square).sum(axis=1)
        return now, _moved(self.closed, now[-1]), now[-1]

    def steady_covariances(self, sight: Navigation, wrong: Floats | None = None) -> tuple[Floats, Floats]:
        """Return steady covariances of deviations (S + 1, 6, 6) and thrust (S + 1, 3, 3).

        They are due to navigation noise. `wrong` (4,): relative error of the thrust, and its rotation.
        """
        closed, taken = self.closed, self.error_response
        if wrong is not None:
            response = self._response_with(wrong)
            closed, taken = self.coast + response, response @ self.prediction
        steady = self._steady_state(sight, closed, taken)
        seen = np.concatenate([closed, taken], axis=2)
        thrust = np.concatenate([self.law, self.law @ self.prediction], axis=2)
        return _moved(seen, steady), _moved(thrust, steady)

    def _steady_state(self, sight: Navigation, closed: Floats, taken: Floats) -> Floats:
        """Return the steady joint covariance (12, 12) of a deviation and of the new measurement error."""
        kept = sight._kept(self.every)  # theory (91)
        white = np.diag(np.repeat([sight.position, sight.velocity], 3) ** 2)
        step, new = np.zeros((12, 12)), np.zeros((12, 12))
        step[:6, :6], step[:6, 6:], step[6:, 6:] = closed[-1], taken[-1], kept * np.eye(6)
        new[6:, 6:] = (1.0 - kept**2) * white
        steady = np.linalg.solve(np.eye(144) - np.kron(step, step), new.ravel())  # S = step S step^T + new
        return np.asarray(steady.reshape(12, 12))

    def noise(self, sight: Navigation, errors: Floats) -> tuple[float, float]:
        """Return standard deviations in the worst direction, of position [m] and of thrust [m/s^2].

        They are due to navigation noise, for the worst of the thrust errors (N, 2).
        """
        most = errors.max(axis=0)
        corners = CORNERS * np.repeat(most, [1, 3]) if most.any() else [None]
        found = [self.steady_covariances(sight, corner) for corner in corners]
        return (
            max(greatest_sigma(off[:, :3, :3]) for off, _ in found),
            max(greatest_sigma(thrust) for _, thrust in found),
        )

    def _response_with(self, wrong: Floats) -> Floats:
        """Return the effect (S + 1, 6, 6) of feedback with thrust errors, by the trapezoidal rule."""
        off = wrong[0] * KINDS[0] + (1.0 + wrong[0]) * np.tensordot(wrong[1:], KINDS[1:], 1)
        if len(self.impulse_times):
            return np.asarray(self.response + (self.impulse_response @ off @ self.law).sum(axis=1))
        back = self.orbit.transition(-self.since)[:, :, 3:] @ off @ self.law
        step = self.since[1]
        summed = np.concatenate([np.zeros((1, 6, 6)), np.cumsum(0.5 * step * (back[1:] + back[:-1]), axis=0)])
        return np.asarray(self.response + self.coast @ summed)

    def biased_states(self) -> Iterator[Floats]:
        """Yield the states (6, 6) due to constant unit measurement errors, at successive measurements."""
        state = np.zeros((6, 6))
        while True:
            yield state
            state = self.closed[-1] @ state + self.error_response[-1]

    def bias(self, sight: Navigation) -> tuple[float, float]:
        """Return the largest deviation [m] and thrust [m/s^2] due to constant measurement errors."""
        sizes = sight.position_bias, sight.velocity_bias
        if not any(sizes):
            return 0.0, 0.0
        before, worst = np.zeros((6, 6)), np.zeros(2)
        for state in islice(self.biased_states(), 1, LONGEST):
            off = (self.closed @ before + self.error_response)[:, :3]
            thrust = self.law @ (before + self.prediction)
            worst = np.maximum(worst, [_largest(off, sizes), _largest(thrust, sizes)])
            if np.abs(state - before).max() <= SETTLED * np.abs(state).max():
                break
            before = state
        return float(worst[0]), float(worst[1])

    @cached_property
    def acceleration_gains(self) -> tuple[float, float]:
        """Largest deviation [s^2] and feedback thrust per unit of any bounded acceleration.

        theory (87)
        """
        part, middles = self.every / PARTS, (np.arange(PARTS) + 0.5) / PARTS
        own = np.zeros(len(self.since))  # of the part of an interval that is not yet measured
        for k, length in enumerate(self.since + self.delay):
            near = self.orbit.transition(middles * length)[:, :3, 3:]
            own[k] = np.linalg.norm(near, 2, axis=(1, 2)).sum() * length / PARTS
        pushed = self.orbit.transition(self.delay + middles * self.every)[:, :, 3:]
        return (
            self._summed(self.closed[:, :3], pushed, own, part),
            self._summed(self.law, pushed, np.zeros(len(self.law)), part),
        )

    @cached_property
    def missed_gain(self) -> float:
        """Largest deviation [s] per unit of impulses that are not fired.

        In the worst directions, all of them: the sum over all previous ones.  # theory (94)
        """
        own = np.linalg.norm(self.impulse_response[:, :, :3], 2, axis=(2, 3)).sum(axis=1)
        pushed = self.orbit.transition(self.every - self.impulse_times)[..., 3:]
        return self._summed(self.closed[:, :3], pushed, own)

    def _summed(self, seen: Floats, pushed: Floats, own: Floats, weight: float = 1.0) -> float:
        """Return the largest sum over all previous intervals of the effects seen (S, 3, 6) of unit vectors.

        `pushed` (P, 6, 3) are their effects at the end of an interval, and `own` (S,) those in the last one.
        """
        total, added = own, np.array([np.inf])
        while added.max() > FADED * total.max():
            added = np.linalg.norm(seen[:, None] @ pushed, 2, axis=(2, 3)).sum(axis=1) * weight
            total, pushed = total + added, self.closed[-1] @ pushed
        return COARSE * float(total.max())

    def remainder(
        self, errors: Floats, unknown: Floats, sight: Navigation, feedback: tuple[Floats, Floats]
    ) -> tuple[Floats, Floats]:
        """Return bounds (N,) [m] of deviations not covered by `propagate` and noise, and the feedback thrust.

        They are due to unknown accelerations, biases, and the `errors` (N, 2) of the thrust (N,) [m/s^2] that
        responds to these and to the errors of the planned thrust. The response to unit errors of its size and
        direction is the `feedback` (N, T, 3) and (N, T, 3, 3).
        """
        share, angle = errors.T
        wrong = np.hypot(share, (1.0 + share) * angle)
        gain, echo = self.acceleration_gains
        bias, answer = self.bias(sight)
        stretched = np.linalg.norm(feedback[0], axis=-1)
        turned = np.linalg.norm(feedback[1], 2, axis=(-2, -1))
        first = (share * stretched.T + (1.0 + share) * angle * turned.T).max(axis=0)
        if len(self.impulse_times):  # [m/s]; errors of the response to errors are of third order
            thrust = first + echo * unknown + answer
            return gain * unknown + self.missed_gain * wrong * thrust + bias, np.zeros_like(thrust)
        thrust = (first + echo * unknown + answer) / np.maximum(1.0 - wrong * echo, np.finfo(float).tiny)
        return gain * (unknown + wrong * thrust) + bias, thrust


def process_noise_covariances(orbit: Orbit, times: Floats) -> Floats:
    """Return the covariances (T, 6, 6) due to noise of density 1 m^2/s^3, for equal steps from the first."""
    flow, root = step_noise(orbit.mean_motion, float(times[1] - times[0]))
    found = [np.zeros((6, 6))]
    for _ in times[1:]:
        found.append(flow @ found[-1] @ flow.T + root @ root.T)
    return np.array(found)


def _moved(motion: Floats, covariance: Floats) -> Floats:
    """Return covariances after transitions (..., D, E)."""
    return np.asarray(motion @ covariance @ np.swapaxes(motion, -1, -2))


def greatest_sigma(covariances: Floats) -> float:
    """Return the largest standard deviation in any direction of covariances (..., 3, 3)."""
    return float(np.sqrt(max(np.linalg.eigvalsh(covariances)[..., -1].max(), 0.0)))


def _largest(rows: Floats, sizes: tuple[float, float]) -> float:
    """Return the largest length of rows (S, 3, 6) applied to two vectors of given lengths."""
    each: Any = [np.linalg.norm(rows[..., part], 2, axis=(1, 2)) for part in (slice(0, 3), slice(3, 6))]
    return float((sizes[0] * each[0] + sizes[1] * each[1]).max())
