"""The closed loop: what becomes of deviations, pushes and wrong measurements of a craft under feedback."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import islice
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from closeform.arrays import Floats
from closeform.dynamics.feedback import Feedback, Navigation, kicked, kicks_back, left_of, slots_of, way_back
from closeform.dynamics.timetable import BESIDE
from closeform.motion.orbit import Orbit

if TYPE_CHECKING:
    from closeform.uncertainty.errors import Uncertainty

PARTS = 24  # of an interval, in which a push counts as one
COARSE = 1.01  # of the sum over parts, in place of an integral, and of what has faded
FADED = 3e-4  # of all pushes: those before add less than a hundredth
SETTLED = 1e-9  # of a state that is left by something constant
LONGEST = 10_000  # intervals, after which a constant error has settled
# Of thrust that is larger by the whole of itself, or turned by 1 about each axis: what is added to it.
KINDS = np.concatenate([np.eye(3)[None], np.cross(np.eye(3)[:, None], np.eye(3)).swapaxes(1, 2)])
CORNERS = np.array([[s, *turn] for s in (-1.0, 1.0) for turn in np.eye(3)])  # of errors of thrust


@dataclass(frozen=True, eq=False)
class ClosedLoop:
    """A craft that is measured every so often, and brought back; known at S + 1 instants `since` (S + 1,).

    These are of an interval in which one measurement counts.  It begins `delay` after that, for which the
    state is predicted.  Of a state at its begin `left` (S + 1, 6, 6) is left, and `moved` of a coast; `law`
    (S + 1, 3, 6) is the thrust, or (J, 3, 6) the impulses that are `fired` (J,) [s] after a measurement.

    # theory (85), (86) and (88)
    """

    orbit: Orbit
    delay: float
    since: Floats
    left: Floats
    moved: Floats
    law: Floats
    fired: Floats

    @classmethod
    @lru_cache(maxsize=8)  # rounds of plans ask for the same, with all that follows from it
    def of(cls, orbit: Orbit, feedback: Feedback, every: float, steps: int, lasting: bool = False) -> Self:
        """Of a feedback, of intervals of another length, at so many steps; by burns that are `lasting`."""
        since, delay = np.linspace(0.0, every, steps + 1), min(feedback.delay, every)
        if not feedback.impulses:
            return cls(orbit, delay, since, *way_back(orbit, feedback.horizon, since), np.zeros(0))
        begin, over = slots_of(feedback)
        now = begin < every * (1.0 - BESIDE)  # the others are left to the next measurement, as in flight
        fired = (0.5 * (begin + np.minimum(over, every)) if lasting else begin)[now]
        gains = kicks_back(orbit, feedback, lasting)[1][now]
        return cls(orbit, delay, since, *left_of(orbit, fired, gains, since), gains, fired)

    @property
    def every(self) -> float:
        """From one measurement to the next [s]."""
        return float(self.since[-1])

    @property
    def wait(self) -> int:
        """The delay in steps."""
        return round(self.delay / self.every * (len(self.since) - 1))

    @cached_property
    def late(self) -> Floats:
        """What a wrong measurement has become (6, 6) when it counts."""
        return np.asarray(self.orbit.transition(self.delay))

    @cached_property
    def answered(self) -> Floats:
        """What answers make of a state that is believed (S + 1, 6, 6)."""
        return self.left - self.moved

    @cached_property
    def taken(self) -> Floats:
        """What a wrong measurement adds (S + 1, 6, 6)."""
        return np.asarray(self.answered @ self.late)

    @cached_property
    def kicked(self) -> Floats:
        """What an impulse of 1 m/s along each axis has become (S + 1, J, 6, 3)."""
        return kicked(self.orbit, self.fired, self.since)

    def intervals(self, count: int) -> Iterator[tuple[int, slice]]:
        """Of so many steps which one a measurement is made at, and in which it counts, both ends included."""
        steps = len(self.since) - 1
        for seen in range(0, count - 1 - self.wait, steps):
            yield seen, slice(seen + self.wait, min(seen + self.wait + steps + 1, count))

    def follow(self, pushed: Floats) -> tuple[Floats, Floats]:
        """Where pushes bring a craft that are not measured but by what they do (R, T, 3).

        And what it believes to be off by when it answers (R, I, 6), in each interval.  `pushed` (R, T, 6) is
        what they make of a coast, at the steps of all intervals.                              # theory (86)
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
        """Thrust (R, T, 3) [m/s^2] at so many steps, or impulses (R, Q, 3) [m/s], of what is believed."""
        each = np.einsum("sij,rkj->rksi", self.law, believed)
        if len(self.fired):
            rows, intervals, fired, axes = each.shape
            return np.asarray(each.reshape(rows, intervals * fired, axes))
        brought = np.zeros((len(believed), count, 3))
        for k, (_, some) in enumerate(self.intervals(count)):
            brought[:, some] = each[:, k, : some.stop - some.start]
        return brought

    def shaken(self, sight: Navigation, errors: Uncertainty, believed: Floats, count: int) -> Floats:
        """Covariances (T, 3, 3) [m^2] at so many steps of what answers add, each with errors of its own.

        They answer to what is believed (I, 6, 6), as second moments, to noise, and to what answers before
        them added.                                                                            # theory (96)
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
        """What a burn that is larger by itself, or turned by 1 about an axis, adds (4, S + 1, 6, 6)."""
        return np.array([self._answers(wrong) - self.answered for wrong in np.eye(4)])

    def _pushed(self, errors: Uncertainty, asked: Floats) -> tuple[Floats, Floats, Floats]:
        """Covariances (S + 1, 6, 6) that errors of a burn make in its interval and in the next.

        It answers to what is `asked` (6, 6).  With what of them is believed (6, 6) when the next is begun,
        before which those of the delay are not seen.
        """
        sizes = np.array([errors.magnitude, *[errors.pointing] * 3])
        now = sizes[:, None, None, None] * self.erring
        end, unseen = now[:, -1:], now[:, -1:] - self.late @ now[:, -1 - self.wait, None]
        later = self.left @ end - self.answered @ unseen
        told = _moved(end - unseen, asked)
        return _moved(now, asked).sum(axis=0), _moved(later, asked).sum(axis=0), told.sum(axis=0)[0]

    def _struck(self, errors: Uncertainty, asked: Floats) -> tuple[Floats, Floats, Floats]:
        """The same of Gates' errors of impulses; those of a fixed size count to all sides."""
        fixed, share, aside, turned = errors.impulse
        sizes = _moved(self.law, asked)
        total = np.trace(sizes, axis1=-2, axis2=-1)[:, None, None] * np.eye(3)
        square = max(fixed, aside) ** 2 * np.eye(3) + share**2 * sizes + turned**2 * (total - sizes)
        now = _moved(self.kicked, square).sum(axis=1)
        return now, _moved(self.left, now[-1]), now[-1]

    def covariances(self, sight: Navigation, wrong: Floats | None = None) -> tuple[Floats, Floats]:
        """Of deviations (S + 1, 6, 6) and of thrust (S + 1, 3, 3) by random errors of measurements; steady.

        `wrong` (4,): thrust is larger by a share, and turned; as of a craft that flies.
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
        """Covariance (12, 12) of a deviation, and of the error that is new with it; steady."""
        kept = sight._kept(self.every)  # theory (91)
        white = np.diag(np.repeat([sight.position, sight.velocity], 3) ** 2)
        step, new = np.zeros((12, 12)), np.zeros((12, 12))
        step[:6, :6], step[:6, 6:], step[6:, 6:] = left[-1], taken[-1], kept * np.eye(6)
        new[6:, 6:] = (1.0 - kept**2) * white
        steady = np.linalg.solve(np.eye(144) - np.kron(step, step), new.ravel())  # S = step S step^T + new
        return np.asarray(steady.reshape(12, 12))

    def noise(self, sight: Navigation, wrong: Floats | None = None) -> tuple[float, float]:
        """Standard deviations in the worst direction, of position [m] and of thrust [m/s^2]; as above."""
        off, thrust = self.covariances(sight, wrong)
        return greatest_sigma(off[:, :3, :3]), greatest_sigma(thrust)

    def spread(self, sight: Navigation, errors: Floats) -> tuple[float, float]:
        """As `noise`, at the worst of errors of thrust (N, 2)."""
        most = errors.max(axis=0)
        if not most.any():
            return self.noise(sight)
        found = [self.noise(sight, corner * np.repeat(most, [1, 3])) for corner in CORNERS]
        return max(one[0] for one in found), max(one[1] for one in found)

    def _answers(self, wrong: Floats) -> Floats:
        """What feedback makes of a state (S + 1, 6, 6), by thrust that is off; by the trapezoidal rule."""
        off = wrong[0] * KINDS[0] + (1.0 + wrong[0]) * np.tensordot(wrong[1:], KINDS[1:], 1)
        if len(self.fired):
            return np.asarray(self.answered + (self.kicked @ off @ self.law).sum(axis=1))
        back = self.orbit.transition(-self.since)[:, :, 3:] @ off @ self.law
        step = self.since[1]
        summed = np.concatenate([np.zeros((1, 6, 6)), np.cumsum(0.5 * step * (back[1:] + back[:-1]), axis=0)])
        return np.asarray(self.answered + self.moved @ summed)

    def misled(self) -> Iterator[Floats]:
        """Where constant errors of 1 of measurements have led to (6, 6) when one after another counts."""
        state = np.zeros((6, 6))
        while True:
            yield state
            state = self.left[-1] @ state + self.taken[-1]

    def biased(self, sight: Navigation) -> tuple[float, float]:
        """How far constant errors of measurements bring a craft [m], and its thrust [m/s^2], at most."""
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
        """How far off [s^2] an acceleration of size 1 brings a craft, whatever its course; its thrust by it.

        # theory (87)
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
        """How far off [s] impulses that are not fired bring a craft.

        In the worst directions, all of them: the sum over all that were before.           # theory (94)
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
        """How far off craft are at most (N,) [m], beside what is followed along their plans and noise.

        And how large the thrust is that answers (N,) [m/s^2], but to noise and to errors of what is planned.
        By accelerations that nobody knows, biases, and `errors` (N, 2) of the thrust that answers to these
        and to the errors of what is planned, `brought` (N, T, 3) and (N, T, 3, 3).
        """
        share, angle = errors.T
        wrong = np.hypot(share, (1.0 + share) * angle)
        gain, echo = self.gains
        bias, answer = self.biased(sight)
        stretched = np.linalg.norm(brought[0], axis=-1)
        turned = np.linalg.norm(brought[1], 2, axis=(-2, -1))
        first = (share * stretched.T + (1.0 + share) * angle * turned.T).max(axis=0)
        if len(self.fired):  # [m/s]; what their errors' own answers are off by is of third order
            thrust = first + echo * unknown + answer
            return gain * unknown + self.missed * wrong * thrust + bias, np.zeros_like(thrust)
        thrust = (first + echo * unknown + answer) / np.maximum(1.0 - wrong * echo, np.finfo(float).tiny)
        return gain * (unknown + wrong * thrust) + bias, thrust


def _moved(motion: Floats, covariance: Floats) -> Floats:
    """Covariances of what motions (..., D, E) make of one."""
    return np.asarray(motion @ covariance @ np.swapaxes(motion, -1, -2))


def greatest_sigma(covariances: Floats) -> float:
    """The greatest standard deviation in any direction, of covariances (..., 3, 3)."""
    return float(np.sqrt(max(np.linalg.eigvalsh(covariances)[..., -1].max(), 0.0)))


def _by_size(rows: Floats, sizes: tuple[float, float]) -> float:
    """The greatest length of (S, 3, 6) of two vectors of some length each, however they point."""
    each: Any = [np.linalg.norm(rows[..., part], 2, axis=(1, 2)) for part in (slice(0, 3), slice(3, 6))]
    return float((sizes[0] * each[0] + sizes[1] * each[1]).max())
