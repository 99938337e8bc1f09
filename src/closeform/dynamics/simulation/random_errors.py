"""Random errors of simulations: navigation, execution, initial states, and process noise.

Every kind of error of every spacecraft has its own random stream. The errors of a seed therefore depend
neither on other spacecraft nor on the number of simulations.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, shown, whole
from closeform.dynamics.control.feedback import Navigation
from closeform.dynamics.simulation.commands import Commands, ErrorEvents
from closeform.motion.elements.mean_motion import checked
from closeform.motion.steering import transition_matrices
from closeform.uncertainty.white_noise import BLOCK, increments, instants_until, velocity_changes

if TYPE_CHECKING:
    from closeform.uncertainty.errors import Uncertainty

# Random streams of a spacecraft: initial state; planned, feedback and impulsive burns; process noise.
INITIAL, BURNS, NOISE = 0, (1, 2, 3), 4
HALVED = 9  # halvings of a block of process noise, down to velocity changes every 8 s
NOISE_STEP = BLOCK / 2.0**HALVED


class SampledErrors(NamedTuple):
    """Errors of S simulations of N spacecraft."""

    measured: Floats  # (S, N, M, 6) [m, m/s] of measurements
    thrust: Floats  # (S, N, 4) of all thrust: relative size, and a small rotation
    start: Floats  # (S, N, 6) [m, m/s] of initial states
    events: Floats  # (S, N, E, 4) the same of each burn, see `ErrorEvents`; normal numbers for impulses
    gates: Floats  # (N, 4) Gates parameters of the impulses
    noise: Floats  # (S, N, K or 0, 6) [m, m/s], increments of states by process noise in each step

    @classmethod
    def none(cls, count: int, measurements: int = 1) -> SampledErrors:
        """Return zero errors of one simulation of N spacecraft with a number of measurements."""
        shapes = (count, measurements, 6), (count, 4), (count, 6), (count, 0, 4), (count, 0, 6)
        measured, thrust, start, events, noise = (np.zeros((1, *shape)) for shape in shapes)
        return cls(measured, thrust, start, events, np.zeros((count, 4)), noise)


@dataclass(frozen=True, eq=False)
class ErrorSampler:
    """Sampler of the errors of simulations with given `seeds`, of N spacecraft.

    The navigation is the same for all. `sizes` (N, 2) bound the constant thrust errors. `errors` are those of
    each spacecraft, or None. Process noise begins at the time `since` [s].
    """

    seeds: Sequence[int]
    navigation: Navigation
    sizes: Floats
    errors: Sequence[Uncertainty] | None
    since: float = 0.0

    def measured(self, measurements: int, interval: float) -> tuple[Floats, Floats]:
        """Return the errors of measurements (S, N, M, 6) and of thrust (S, N, 4) of all spacecraft."""
        kept = self.navigation._kept(interval)
        found = [self._measured(seed, measurements, kept) for seed in self.seeds]
        return np.stack([one for one, _ in found]), np.stack([one for _, one in found])

    def _measured(self, seed: int, measurements: int, kept: float) -> tuple[Floats, Floats]:
        """Return the errors of measurements (N, M, 6) and of thrust (N, 4) of one simulation.

        The share `kept` of each measurement error remains at the next measurement.  # theory (91)
        """
        sight, count = self.navigation, len(self.sizes)
        random = np.random.Generator(np.random.Philox(key=seed))
        ways = random.normal(size=(count, 3, 3))
        ways /= np.linalg.norm(ways, axis=2, keepdims=True)
        shares = random.uniform([-1.0, 0.0], 1.0, (count, 2)) * self.sizes
        thrust = np.hstack([shares[:, :1], shares[:, 1:] * ways[:, 2]])
        bias = ways[:, :2] * np.array([sight.position_bias, sight.velocity_bias])[:, None]
        white = random.normal(size=(measurements, count, 6)).swapaxes(0, 1)
        for k in range(1, measurements if kept else 0):
            white[:, k] = kept * white[:, k - 1] + np.sqrt(1.0 - kept * kept) * white[:, k]
        white = white * np.repeat([sight.position, sight.velocity], 3)
        return np.ascontiguousarray(white + bias.reshape(count, 1, 6)), thrust

    def sample(
        self,
        which: Sequence[int],
        measured: tuple[Floats, Floats],
        commands: Commands,
        leg: int = 0,
    ) -> SampledErrors:
        """Return all errors of the spacecraft `which` with these commands, using the errors `measured`."""
        seen, thrust = (np.ascontiguousarray(part[:, which]) for part in measured)
        size = len(self.seeds), len(which)
        if self.errors is None:
            begin, gates = np.zeros((*size, 6)), np.zeros((size[1], 4))
            return SampledErrors(seen, thrust, begin, np.zeros((*size, 0, 4)), gates, np.zeros((*size, 0, 6)))
        events = commands.events
        each = [self._of_craft(seed, k, commands, events, leg) for seed in self.seeds for k in which]
        start, own, noise = (np.reshape(part, (*size, *part[0].shape)) for part in zip(*each, strict=True))
        gates = np.reshape([self.errors[k].impulse for k in which], (-1, 4)).astype(float)
        return SampledErrors(seen, thrust, start, own, gates, noise)

    def _of_craft(
        self, seed: int, craft: int, commands: Commands, events: ErrorEvents, leg: int
    ) -> tuple[Floats, Floats, Floats]:
        """Return errors of the initial state (6,), of burns and impulses (E, 4), and noise (K or 0, 6)."""
        assert self.errors is not None
        one, stream = self.errors[craft], partial(_stream, seed, craft)
        start = one._root @ stream(INITIAL, leg).normal(size=6)
        burn = np.array([one.magnitude, *[one.pointing] * 3])
        own = [
            size * stream(kind, leg).normal(size=(count, 4))
            for kind, size, count in zip(BURNS, (burn, burn, np.ones(4)), events.counts, strict=True)
        ]
        nodes, n = commands.grid.nodes, commands.path.orbit.mean_motion
        noise = np.zeros(((len(nodes) - 1) * any(one.noise for one in self.errors), 6))
        if one.noise:
            kick, noise = process_noise(
                n,
                one.noise,
                nodes - self.since,
                lambda level, rows: stream(NOISE, level).normal(size=(rows, 6)),
            )
            start[3:] += kick
        return start, np.concatenate(own), noise


def process_noise(
    n: float, density: float, times: Floats, normal: Callable[[int, int], Floats]
) -> tuple[Floats, Floats]:
    """Return the noise on the initial velocity (3,), and the increments of states in steps (K, 6).

    The noise of a simulation is one random motion from its start, made of velocity changes every 8 s. It
    does not depend on steps, legs or measurements. The `density` is in m^2/s^3, the mean motion in rad/s,
    `times` (K + 1,) in s since the start. `normal` draws rows of six numbers for a level.
    """
    so_far = instants_until(times, NOISE_STEP)
    pushes = increments(n, HALVED, int(so_far[-1]), lambda level, rows: normal(level, rows)[None])
    kicks = np.sqrt(density) * velocity_changes(n, NOISE_STEP, pushes)[0]
    which = np.arange(max(so_far[0], 0), so_far[-1])
    steps = np.searchsorted(so_far, which, side="right") - 1
    moved = transition_matrices(n, times[steps + 1] - NOISE_STEP * which)[:, :, 3:]
    added = np.zeros((len(times) - 1, 6))
    np.add.at(added, steps, np.einsum("kij,kj->ki", moved, kicks[which]))
    return kicks[0], added


def _stream(seed: int, craft: int, which: int, leg: int) -> np.random.Generator:
    """Return the random generator of one spacecraft and one kind of error in a simulation."""
    return np.random.Generator(np.random.Philox(key=seed, counter=[0, leg, which, 1 + craft]))


def has_random_errors(
    measured: bool, sight: Navigation, thrust_error: ArrayLike, errors: Sequence[Uncertainty | None] | None
) -> bool:
    """Return True if simulations have any random errors."""
    seen = sight.position, sight.velocity, sight.position_bias, sight.velocity_bias
    return bool(
        (measured and any(seen))
        or np.any(thrust_error)
        or any(
            one.state.any() or one.magnitude or one.pointing or any(one.impulse) or one.noise
            for one in errors or ()
            if one is not None
        )
    )


def thrust_errors(value: ArrayLike, count: int) -> Floats:
    """Return the argument `thrust_error` of each spacecraft (N, 2): relative size, and angle [rad]."""
    sizes = np.asarray(checked("thrust_error", value))
    if sizes.shape not in ((2,), (count, 2)) or not (sizes >= 0.0).all():
        raise ValueError(f"thrust_error: expected two numbers of at least 0, got {shown(value)}")
    return np.broadcast_to(sizes, (count, 2))


def seeds_of(seeds: int | Sequence[int]) -> list[int]:
    """Return the seed of each simulation."""
    if not isinstance(seeds, list | tuple | range | np.ndarray):
        return list(range(whole("seeds", seeds, 1)))
    if not len(seeds):
        raise ValueError("seeds: must not be empty")
    return [whole("seeds", one) for one in seeds]


def errors_of_each(
    errors: Uncertainty | Sequence[Uncertainty | None] | None, count: int
) -> Sequence[Uncertainty] | None:
    """Return the argument `errors` for each spacecraft; None if none has any."""
    if errors is None:
        return None
    from closeform.uncertainty.errors import Uncertainty, one_for_each

    return [Uncertainty() if one is None else one for one in one_for_each("errors", errors, count)]
