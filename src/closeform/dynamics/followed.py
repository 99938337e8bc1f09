"""Plan under feedback: sources of deviations along it, and the resulting deviations and responses."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice, product
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from closeform.arrays import Floats
from closeform.dynamics.chief_frame import ChiefFrame
from closeform.dynamics.closed_loop import KINDS, ClosedLoop
from closeform.dynamics.feedback import Feedback, Navigation
from closeform.dynamics.field import Field
from closeform.dynamics.holding import Holding
from closeform.dynamics.residual import residuals
from closeform.dynamics.retargeted import Retargeted, changed_impulses
from closeform.dynamics.timetable import SAME, impulses_of, intervals_in
from closeform.dynamics.validity import deviations_of
from closeform.fuel.allocation import Allocation
from closeform.fuel.thrusters import Thrusters
from closeform.motion.path import Path

if TYPE_CHECKING:
    from closeform.uncertainty.errors import Uncertainty

STEPS, MOST = 6, 60  # steps between measurements: even, and a delay is a whole number
OFTEN = 15.0  # s, step, unless there are more than the maximum number
NEAR = 0.02  # of a step, tolerance on the delay
FINER = 6  # instants of a step at which the ripple of pulses is sampled
Missed = tuple[tuple[int, float, Floats], ...]


@dataclass(frozen=True, eq=False)
class Followed:
    """Paths (N,) at T `times`, under feedback by a `loop`.

    `jumps` are the impulses as fired. They lead to the reference of the feedback, which is `aside` of the
    plan (N, T, 3) [m], as do the pulses of `thrusters` on paths that are `pulsed`, with a `ripple` (N,) [m]
    between times. `missed` lists ends that impulses did not reach, as craft, time and state error; the
    following motion starts from the states that were reached. Continuous thrust is that of the plan plus
    compensation `against` (N, T, 3) [m/s^2] of the model error; the part `felt` (N, T, 3) is not compensated.
    """

    paths: Path
    loop: ClosedLoop
    times: Floats
    jumps: Retargeted
    aside: Floats
    missed: Missed
    against: Floats
    felt: Floats
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
        """Return the paths as `simulate` follows them in a known field.

        `cancel`: compensate the model error.
        """
        times, every, steps = instants(paths, law)
        start, end = times[0], times[-1]
        loop = ClosedLoop.of(paths.orbit, law, every, steps, thrusters is not None)
        frame = ChiefFrame.of(field, times)
        left_out = residuals(field, frame, paths.state(times), paths.orbit.mean_motion)
        craft, when, planned = impulses_of(paths)
        jumps, aside = Retargeted(craft, when, planned, planned), np.zeros(left_out.shape)
        missed: Missed = ()
        holding = Holding.of(paths, law)
        moved, opposed = holding.moved(times), cancel & holding.opposed(times)
        if cancel and len(craft):
            jumps, path, _ = changed_impulses(paths, field, law)
            aside[moved] = (path.position(times) - paths.position(times))[moved]
            missed = tuple(_missed(holding, paths, path))
        pulsed, ripple = None, np.zeros(len(paths))
        if thrusters is not None:
            pulsed, shooting, path, missed = _pulses(paths, jumps, field, thrusters, law)
            fine = np.linspace(start, end, FINER * (len(times) - 1) + 1)
            off = (path.position(fine) - paths.position(fine))[shooting]
            aside[shooting] = off[:, ::FINER]
            straight = np.linspace(off[:, :-1:FINER], off[:, FINER::FINER], FINER, endpoint=False, axis=2)
            more = off[:, :-1] - straight.reshape(off[:, :-1].shape)
            ripple[shooting] = np.linalg.norm(more, axis=-1).max(axis=1)
        felt = left_out * ~(opposed | moved & cancel)[..., None]
        against = -left_out * opposed[..., None]
        return cls(paths, loop, times, jumps, aside, missed, against, felt, pulsed, ripple, thrusters)

    @property
    def bits(self) -> Floats:
        """Largest impulse (N,) [m/s] that thrusters do not fire: one bit of each of three."""
        return np.array([_least_push(one) for one in self.thrusters or ()] or np.zeros(len(self.paths)))

    @cached_property
    def flown(self) -> Floats:
        """Continuous thrust (N, T, 3) [m/s^2], as commanded without errors."""
        return np.asarray(self.paths.thrust(self.times) + self.against)

    @cached_property
    def caused(self) -> tuple[Floats, Floats]:
        """True deviations (5, N, T, 3) [m] and believed ones (5, N, I, 6) for each of five causes.

        The causes are the uncompensated acceleration, a thrust error of 100 % in size, and one of 1 rad about
        each axis.
        """
        orbit, times, flown = self.paths.orbit, self.times, self.flown
        pushes = [self.felt, *np.einsum("kij,ntj->knti", KINDS, flown)]
        pushed = deviations_of(orbit, times, np.concatenate(pushes)).reshape(5, *flown.shape[:2], 6)
        kicked = np.einsum("kij,mj->mki", KINDS, self.jumps.impulse)
        for k, when, sizes in zip(self.jumps.craft, self.jumps.time, kicked, strict=True):
            after = times > when + SAME  # a measurement at that instant precedes the impulse
            moved = orbit.transition(times[after] - when)[:, :, 3:]
            pushed[1:, k, after] += np.einsum("tij,rj->rti", moved, sizes)
        for k, when, state in self.missed:
            after = times > when + SAME
            pushed[0, k, after] += orbit.transition(times[after] - when) @ state
        off, believed = self.loop.follow(pushed.reshape(-1, len(times), 6))
        return off.reshape(5, *flown.shape), believed.reshape(5, len(flown), *believed.shape[1:])

    @cached_property
    def brought(self) -> Floats:
        """Feedback thrust (5, N, T, 3) [m/s^2], or impulses (5, N, Q, 3) [m/s], for each cause."""
        believed = self.caused[1]
        found = self.loop.answers(np.concatenate(believed), len(self.times))
        return found.reshape(*believed.shape[:2], -1, 3)

    def scattered(
        self, craft: int, sight: Navigation, size: Floats, errors: Uncertainty
    ) -> tuple[Floats, Floats]:
        """Return the covariances (T, 3, 3) [m^2] due to a craft's `errors`, and those of its responses.

        The latter are (T, 3, 3) [m^2/s^4], or for impulses (Q, 3, 3) [m^2/s^2]. `size` (2,) bounds the
        constant thrust errors.
        """
        from closeform.dynamics.error_motions import error_motions  # whose kernels only errors need

        own, path, against = self.jumps.craft == craft, self.paths[craft], self.against[craft]
        if self.pulsed is not None:  # pulses are the only burns
            own, path, against = np.zeros_like(own), self.pulsed[craft], np.zeros_like(against)
        jumps = self.jumps.time[own], self.jumps.impulse[own]
        motions = error_motions(path, errors, self.times, jumps, against)
        off, believed = self.loop.follow(motions)
        answers = self.loop.answers(believed, len(self.times))
        share, angle = size
        known, led = self.caused[1][:, craft], islice(self.loop.misled(), believed.shape[1])
        seen = np.reshape([state + self.loop.late for state in led], (-1, 6, 6)).transpose(2, 0, 1)
        causes = [known[:1], share * known[1:2], (1.0 + share) * angle * known[2:]]
        causes += [sight.position_bias * seen[:3], sight.velocity_bias * seen[3:]]
        causes = [one for one in causes if one.any()]  # correlated causes: bound on the square of their sum
        moments = _squares(believed) + len(causes) * sum(map(_squares, causes), np.zeros((6, 6)))
        errors = errors if self.pulsed is None else errors._of_orders
        shaken = self.loop.shaken(sight, errors, moments, len(self.times))
        return _squares(off) + shaken, _squares(answers)


def instants(paths: Path, law: Feedback) -> tuple[Floats, float, int]:
    """Return times (T,) along paths (N,), the time between measurements [s], and the steps in it."""
    start, end = float(paths.start[0]), float(paths.end[0])
    intervals = intervals_in(end - start, law.every)
    every = (end - start) / intervals
    steps = _steps(min(law.delay / every, 1.0), every)
    return np.linspace(start, end, steps * intervals + 1), every, steps


def _pulses(
    paths: Path, jumps: Retargeted, field: Field, thrusters: Sequence[Thrusters], law: Feedback
) -> tuple[Path, Any, Path, Missed]:
    """Return paths of thruster pulses in Hill's equations, the firing craft, their reference, and misses."""
    from closeform.dynamics.pulsed_flight import fired_in, pulsed_ways  # whose kernels only thrusters need

    firing = fired_in(paths, jumps, field, thrusters, law=law)
    times, ways = pulsed_ways(paths, firing, thrusters, field, law)
    led = paths.orbit._through(times, np.array([way.states for way in ways]))
    missed = tuple((k, *one) for k, way in enumerate(ways) for one in way.missed)
    return firing.path, np.unique(firing.pulses.craft), led, missed


def _missed(holding: Holding, paths: Path, flown: Path) -> Iterator[tuple[int, float, Floats]]:
    """Yield the state errors at ends of impulsive spans, before the ends of the paths."""
    for k, moves in enumerate(holding.moves):
        for end in moves[moves[:, 1] < paths.end[k] - SAME, 1]:
            yield k, float(end), flown[k].state(end) - paths[k].state(end)


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
