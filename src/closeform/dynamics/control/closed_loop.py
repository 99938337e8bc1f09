"""Closed loop of a craft: propagation of deviations, disturbance accelerations and navigation errors."""

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
    """Feedback loop of a craft, known at S + 1 instants `since` (S + 1,) of an interval.

    In this interval one measurement is in effect. It begins `delay` after the measurement, for which the
    state is predicted. A state at its start is propagated to `left` (S + 1, 6, 6) with feedback and to
    `moved` by a coast. `law` (S + 1, 3, 6) gives the thrust, or (J, 3, 6) the impulses `fired` (J,) [s] after
    a measurement.  # theory (85), (86) and (88)
    """

    orbit: Orbit
    delay: float
    since: Floats
    left: Floats
    moved: Floats
    law: Floats
    fired: Floats

    @classmethod
    @lru_cache(maxsize=8)  # repeated planning uses the same loop and its cached properties
    def of(cls, orbit: Orbit, feedback: Feedback, every: float, steps: int, lasting: bool = False) -> Self:
        """Return the loop of a feedback, for intervals of length `every` [s] with some steps.

        `lasting`: finite burns in place of impulses.
        """
        since, delay = np.linspace(0.0, every, steps + 1), min(feedback.delay, every)
        if not feedback.impulses:
            return cls(orbit, delay, since, *optimal_return(orbit, feedback.horizon, since), np.zeros(0))
        begin, over = impulse_slots(feedback)
        now = slice(len(slots_before_next(feedback, every)))  # the next measurement replaces the others
        fired = (0.5 * (begin + np.minimum(over, every)) if lasting else begin)[now]
        gains = impulse_gains(orbit, feedback, lasting)[1][now]
        return cls(orbit, delay, since, *return_by_impulses(orbit, fired, gains, since), gains, fired)

    @property
    def every(self) -> float:
        """Time between measurements [s]."""
        return float(self.since[-1])

    @property
    def wait(self) -> int:
        """Delay in steps."""
        return round(self.delay / self.every * (len(self.since) - 1))

    @cached_property
    def late(self) -> Floats:
        """Transition (6, 6) of a measurement error over the delay."""
        return np.asarray(self.orbit.transition(self.delay))

    @cached_property
    def answered(self) -> Floats:
        """Effect of the feedback on the state (S + 1, 6, 6), per believed deviation."""
        return self.left - self.moved

    @cached_property
    def taken(self) -> Floats:
        """Effect of a measurement error on the state (S + 1, 6, 6)."""
        return np.asarray(self.answered @ self.late)

    @cached_property
    def kicked(self) -> Floats:
        """Effect of an impulse of 1 m/s along each axis (S + 1, J, 6, 3)."""
        return impulse_effects(self.orbit, self.fired, self.since)

    def intervals(self, count: int) -> Iterator[tuple[int, slice]]:
        """Yield the step of each measurement, and the steps in which it is in effect, both ends included."""
        steps = len(self.since) - 1
        for seen in range(0, count - 1 - self.wait, steps):
            yield seen, slice(seen + self.wait, min(seen + self.wait + steps + 1, count))

    def follow(self, pushed: Floats) -> tuple[Floats, Floats]:
        """Return deviations (R, T, 3) due to disturbances, and the believed ones (R, I, 6) per interval.

        `pushed` (R, T, 6) is the effect of each disturbance on a coast, at the steps of all intervals.
        Feedback measures a disturbance only by its effect on the state.  # theory (86)
        """
        off, answered = pushed.copy(), [np.empty((len(pushed), 0, 6))]
        for seen, some in self.intervals(pushed.shape[1]):
            now, kept = off[:, some.start], slice(some.stop - some.start)
            believed = now - pushed[:, some.start] + pushed[:, seen] @ self.late.T
            coasts = np.einsum("sij,rj->rsi", self.moved[kept], now - pushed[:, some.start])
            answers = np.einsum("sij,rj->rsi", self.answered[kept], believed)
            off[:, some] = pushed[:, some] + coasts + answers
            answered.append(believed[:, None])
        return off[..., :3], np.concatenate(answered, axis=1)

    def answers(self, believed: Floats, count: int) -> Floats:
        """Return feedback thrust (R, T, 3) [m/s^2], or impulses (R, Q, 3) [m/s], for believed deviations."""
        each = np.einsum("sij,rkj->rksi", self.law, believed)
        if len(self.fired):
            rows, intervals, fired, axes = each.shape
            return np.asarray(each.reshape(rows, intervals * fired, axes))
        brought = np.zeros((len(believed), count, 3))
        for k, (_, some) in enumerate(self.intervals(count)):
            brought[:, some] = each[:, k, : some.stop - some.start]
        return brought

    def shaken(self, sight: Navigation, errors: Uncertainty, believed: Floats, count: int) -> Floats:
        """Return covariances (T, 3, 3) [m^2] due to the execution errors of feedback burns.

        Feedback responds to believed deviations, given as second moments (I, 6, 6), to navigation noise, and
        to the errors of earlier feedback burns.  # theory (96)
        """
        seen = np.hstack([np.eye(6), self.late])
        noise = seen @ self._held(sight, self.left, self.taken) @ seen.T
        err = self._struck if len(self.fired) else self._pushed
        out = np.zeros((count, 6, 6))
        added, after, known = np.zeros((6, 6)), np.zeros_like(self.left), np.zeros((6, 6))
        for k, (_, some) in enumerate(self.intervals(count)):
            before = _moved(self.left, added) + after
            now, after, known = err(errors, believed[k] + noise + added + known)
            out[some], added = (before + now)[: some.stop - some.start], before[-1]
        return out[:, :3, :3]

    @cached_property
    def erring(self) -> Floats:
        """Effect (4, S + 1, 6, 6) of a feedback burn larger by 100 %, and rotated by 1 rad on each axis."""
        return np.array([self._answers(wrong) - self.answered for wrong in np.eye(4)])

    def _pushed(self, errors: Uncertainty, asked: Floats) -> tuple[Floats, Floats, Floats]:
        """Return covariances (S + 1, 6, 6) of burn errors in their interval and the next, and believed.

        The burn responds to a deviation with second moments `asked` (6, 6). The third result (6, 6) is the
        part that is believed at the start of the next interval; errors during the delay are not yet measured.
        """
        sizes = np.array([errors.magnitude, *[errors.pointing] * 3])
        now = sizes[:, None, None, None] * self.erring
        end, unseen = now[:, -1:], now[:, -1:] - self.late @ now[:, -1 - self.wait, None]
        later = self.left @ end - self.answered @ unseen
        believed = _moved(end - unseen, asked)
        return _moved(now, asked).sum(axis=0), _moved(later, asked).sum(axis=0), believed.sum(axis=0)[0]

    def _struck(self, errors: Uncertainty, asked: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the same for Gates' errors of impulses; fixed errors act in all directions."""
        fixed, share, aside, turned = errors.impulse
        sizes = _moved(self.law, asked)
        total = np.trace(sizes, axis1=-2, axis2=-1)[:, None, None] * np.eye(3)
        square = max(fixed, aside) ** 2 * np.eye(3) + share**2 * sizes + turned**2 * (total - sizes)
        now = _moved(self.kicked, square).sum(axis=1)
        return now, _moved(self.left, now[-1]), now[-1]

    def covariances(self, sight: Navigation, wrong: Floats | None = None) -> tuple[Floats, Floats]:
        """Return steady covariances of deviations (S + 1, 6, 6) and thrust (S + 1, 3, 3).

        They are due to navigation noise. `wrong` (4,): relative error of the thrust, and its rotation.
        """
        taken, left = self.taken, self.left
        if wrong is not None:
            answers = self._answers(wrong)
            taken, left = answers @ self.late, self.moved + answers
        held = self._held(sight, left, taken)
        seen = np.concatenate([left, taken], axis=2)
        thrust = np.concatenate([self.law, self.law @ self.late], axis=2)
        return seen @ held @ np.swapaxes(seen, 1, 2), thrust @ held @ np.swapaxes(thrust, 1, 2)

    def _held(self, sight: Navigation, left: Floats, taken: Floats) -> Floats:
        """Return the steady joint covariance (12, 12) of a deviation and of the new measurement error."""
        kept = sight._kept(self.every)  # theory (91)
        white = np.diag(np.repeat([sight.position, sight.velocity], 3) ** 2)
        step, new = np.zeros((12, 12)), np.zeros((12, 12))
        step[:6, :6], step[:6, 6:], step[6:, 6:] = left[-1], taken[-1], kept * np.eye(6)
        new[6:, 6:] = (1.0 - kept**2) * white
        steady = np.linalg.solve(np.eye(144) - np.kron(step, step), new.ravel())  # S = step S step^T + new
        return np.asarray(steady.reshape(12, 12))

    def noise(self, sight: Navigation, wrong: Floats | None = None) -> tuple[float, float]:
        """Return standard deviations in the worst direction, of position [m] and of thrust [m/s^2]."""
        off, thrust = self.covariances(sight, wrong)
        return greatest_sigma(off[:, :3, :3]), greatest_sigma(thrust)

    def spread(self, sight: Navigation, errors: Floats) -> tuple[float, float]:
        """Return the result of `noise` for the worst of the thrust errors (N, 2)."""
        most = errors.max(axis=0)
        if not most.any():
            return self.noise(sight)
        found = [self.noise(sight, corner * np.repeat(most, [1, 3])) for corner in CORNERS]
        return max(one[0] for one in found), max(one[1] for one in found)

    def _answers(self, wrong: Floats) -> Floats:
        """Return the effect (S + 1, 6, 6) of feedback with thrust errors, by the trapezoidal rule."""
        off = wrong[0] * KINDS[0] + (1.0 + wrong[0]) * np.tensordot(wrong[1:], KINDS[1:], 1)
        if len(self.fired):
            return np.asarray(self.answered + (self.kicked @ off @ self.law).sum(axis=1))
        back = self.orbit.transition(-self.since)[:, :, 3:] @ off @ self.law
        step = self.since[1]
        summed = np.concatenate([np.zeros((1, 6, 6)), np.cumsum(0.5 * step * (back[1:] + back[:-1]), axis=0)])
        return np.asarray(self.answered + self.moved @ summed)

    def misled(self) -> Iterator[Floats]:
        """Yield the states (6, 6) due to constant unit measurement errors, at successive measurements."""
        state = np.zeros((6, 6))
        while True:
            yield state
            state = self.left[-1] @ state + self.taken[-1]

    def biased(self, sight: Navigation) -> tuple[float, float]:
        """Return the largest deviation [m] and thrust [m/s^2] due to constant measurement errors."""
        sizes = sight.position_bias, sight.velocity_bias
        if not any(sizes):
            return 0.0, 0.0
        before, worst = np.zeros((6, 6)), np.zeros(2)
        for state in islice(self.misled(), 1, LONGEST):
            off = (self.left @ before + self.taken)[:, :3]
            thrust = self.law @ (before + self.late)
            worst = np.maximum(worst, [_by_size(off, sizes), _by_size(thrust, sizes)])
            if np.abs(state - before).max() <= SETTLED * np.abs(state).max():
                break
            before = state
        return float(worst[0]), float(worst[1])

    @cached_property
    def gains(self) -> tuple[float, float]:
        """Largest deviation [s^2] and feedback thrust per unit of any bounded acceleration.

        theory (87)
        """
        part = self.every / PARTS
        ages = (np.arange(PARTS) + 0.5) * part
        pushed = self.orbit.transition(self.delay + ages)[:, :, 3:]
        sums = [np.zeros(len(self.since)), np.zeros(len(self.law))]
        for k, since in enumerate(self.since):
            own = (np.arange(PARTS) + 0.5) * (since + self.delay) / PARTS
            near = np.linalg.norm(self.orbit.transition(own)[:, :3, 3:], 2, axis=(1, 2))
            sums[0][k] = near.sum() * (since + self.delay) / PARTS
        seen = [self.left[:, :3], self.law]
        added = [np.ones(1), np.ones(1)]
        while any(more.max() > FADED * total.max() for more, total in zip(added, sums, strict=True)):
            for k, rows in enumerate(seen):
                each = np.linalg.norm(rows[:, None] @ pushed, 2, axis=(2, 3))
                added[k] = each.sum(axis=1) * part
                sums[k] = sums[k] + added[k]
            pushed = self.left[-1] @ pushed
        return COARSE * float(sums[0].max()), COARSE * float(sums[1].max())

    @cached_property
    def missed(self) -> float:
        """Largest deviation [s] per unit of impulses that are not fired.

        In the worst directions, all of them: the sum over all previous ones.  # theory (94)
        """
        own = np.linalg.norm(self.kicked[:, :, :3], 2, axis=(2, 3)).sum(axis=1)
        pushed, total = self.orbit.transition(self.every - self.fired)[..., 3:], own
        added = np.ones(1)
        while added.max() > FADED * total.max():
            added = np.linalg.norm(self.left[:, None, :3] @ pushed, 2, axis=(2, 3)).sum(axis=1)
            total, pushed = total + added, self.left[-1] @ pushed
        return COARSE * float(total.max())

    def beyond(
        self, errors: Floats, unknown: Floats, sight: Navigation, brought: tuple[Floats, Floats]
    ) -> tuple[Floats, Floats]:
        """Return bounds (N,) [m] of deviations not covered by `follow` and noise, and the feedback thrust.

        They are due to unknown accelerations, biases, and the `errors` (N, 2) of the thrust (N,) [m/s^2] that
        responds to these and to the errors of the planned thrust, `brought` (N, T, 3) and (N, T, 3, 3).
        """
        share, angle = errors.T
        wrong = np.hypot(share, (1.0 + share) * angle)
        gain, echo = self.gains
        bias, answer = self.biased(sight)
        stretched = np.linalg.norm(brought[0], axis=-1)
        turned = np.linalg.norm(brought[1], 2, axis=(-2, -1))
        first = (share * stretched.T + (1.0 + share) * angle * turned.T).max(axis=0)
        if len(self.fired):  # [m/s]; errors of the response to errors are of third order
            thrust = first + echo * unknown + answer
            return gain * unknown + self.missed * wrong * thrust + bias, np.zeros_like(thrust)
        thrust = (first + echo * unknown + answer) / np.maximum(1.0 - wrong * echo, np.finfo(float).tiny)
        return gain * (unknown + wrong * thrust) + bias, thrust


def _moved(motion: Floats, covariance: Floats) -> Floats:
    """Return covariances after transitions (..., D, E)."""
    return np.asarray(motion @ covariance @ np.swapaxes(motion, -1, -2))


def greatest_sigma(covariances: Floats) -> float:
    """Return the largest standard deviation in any direction of covariances (..., 3, 3)."""
    return float(np.sqrt(max(np.linalg.eigvalsh(covariances)[..., -1].max(), 0.0)))


def _by_size(rows: Floats, sizes: tuple[float, float]) -> float:
    """Return the largest length of rows (S, 3, 6) applied to two vectors of given lengths."""
    each: Any = [np.linalg.norm(rows[..., part], 2, axis=(1, 2)) for part in (slice(0, 3), slice(3, 6))]
    return float((sizes[0] * each[0] + sizes[1] * each[1]).max())
