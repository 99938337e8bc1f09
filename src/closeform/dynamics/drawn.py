"""Random errors of simulations: measurements, thrust, initial states, burns, and process noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, whole
from closeform.dynamics.executed import Events
from closeform.dynamics.feedback import Navigation
from closeform.dynamics.timetable import Timetable

if TYPE_CHECKING:
    from closeform.dynamics.reference_trajectory import Commands
    from closeform.uncertainty.errors import Uncertainty

# Random streams of a craft in a simulation: initial state; burns, planned, feedback and impulsive; noise
START, PLANNED, NOISE = 0, 1, 4


class Drawn(NamedTuple):
    """Errors of S simulations of N craft."""

    seen: Floats  # (S, N, M, 6) [m, m/s] of measurements
    thrust: Floats  # (S, N, 4) of all thrust: relative size, and a small rotation
    start: Floats  # (S, N, 6) [m, m/s] of states at the start
    events: Floats  # (S, N, E, 4) the same of each burn, see `Events`; normal numbers for impulses
    gates: Floats  # (N, 4) Gates parameters of the impulses
    pushes: Floats  # (S, N, K or 0, 6) [m, m/s], increments of states by process noise in each step


def exactly(count: int, measurements: int) -> Drawn:
    """Return zero errors of one simulation of N craft with a number of measurements."""
    shapes = (count, measurements, 6), (count, 4), (count, 6), (count, 0, 4), (count, 0, 6)
    seen, thrust, start, events, pushes = (np.zeros((1, *shape)) for shape in shapes)
    return Drawn(seen, thrust, start, events, np.zeros((count, 4)), pushes)


@dataclass(frozen=True, eq=False)
class Draws:
    """Random errors of simulations with given `seeds`, each independent, of N craft.

    All are measured with one `sight`. `sizes` (N, 2) bound the constant thrust errors, and `errors` are those
    of each craft, if any. Process noise begins at the time `since` [s].
    """

    seeds: Sequence[int]
    sight: Navigation
    sizes: Floats
    errors: Sequence[Uncertainty] | None
    since: float = 0.0

    def measured(self, table: Timetable) -> tuple[Floats, Floats]:
        """Return the errors of measurements (S, N, M, 6) and of thrust (S, N, 4) of all craft."""
        kept, count = self.sight._kept(table.interval), table.measurements + 1
        draws = [_drawn(seed, count, self.sight, self.sizes, kept) for seed in self.seeds]
        return np.stack([one for one, _ in draws]), np.stack([one for _, one in draws])

    def of(
        self,
        commands: Commands,
        some: Sequence[int],
        measured: tuple[Floats, Floats] | None = None,
        leg: int = 0,
    ) -> Drawn:
        """Return all errors of `some` craft with given commands, using the measurements `measured`."""
        measured = measured or self.measured(commands.table)
        seen, thrust = (np.ascontiguousarray(part[:, some]) for part in measured)
        size, gates = (len(self.seeds), len(some)), np.zeros((len(some), 4))
        if self.errors is None:
            nothing = np.zeros((*size, 0, 4)), gates, np.zeros((*size, 0, 6))
            return Drawn(seen, thrust, np.zeros((*size, 6)), *nothing)
        start, events, kinds = [], [], commands.events
        for seed in self.seeds:
            for k in some:
                start.append(self.errors[k]._root @ _stream(seed, k, START, leg).normal(size=6))
                events.append(self._executed(seed, k, kinds, leg))
        gates += [self.errors[k].impulse for k in some]
        begin, own = np.reshape(start, (*size, 6)), np.reshape(events, (*size, -1, 4))
        kicked, pushes = self._shaken(some, commands.table.nodes, commands.path.orbit.mean_motion)
        begin[..., 3:] += kicked
        return Drawn(seen, thrust, begin, own, gates, pushes)

    def _shaken(self, some: Sequence[int], nodes: Floats, n: float) -> tuple[Floats, Floats]:
        """Return the noise on initial velocities (S, M, 3), and on states in each step (S, M, K, 6).

        Steps lie between nodes (K + 1,) [s]. The noise consists of velocity changes every 8 s, at the same
        times in all simulations.
        """
        assert self.errors is not None
        size = len(self.seeds), len(some)
        density = np.array([self.errors[k].noise for k in some])
        if not density.any():
            return np.zeros((*size, 3)), np.zeros((*size, 0, 6))
        from closeform.dynamics.process_noise import shaken  # imported late: compiles kernels

        begins, pushes = np.zeros((*size, 3)), np.zeros((*size, len(nodes) - 1, 6))
        for place in np.argwhere(np.broadcast_to(density > 0.0, size)).tolist():
            seed, k = self.seeds[place[0]], some[place[1]]

            def normal(level: int, rows: int, seed: int = seed, k: int = k) -> Floats:
                return _stream(seed, k, NOISE, level).normal(size=(rows, 6))

            noise = shaken(n, density[place[1]], nodes - self.since, normal)
            begins[tuple(place)], pushes[tuple(place)] = noise
        return begins, pushes

    def _executed(self, seed: int, craft: int, events: Events, leg: int) -> Floats:
        """Return the errors (E, 4) of each burn and impulse of one craft in one simulation."""
        assert self.errors is not None
        one = self.errors[craft]
        burn = np.array([one.magnitude, *[one.pointing] * 3])
        kinds = (events.planned, burn), (events.backward, burn), (events.struck, np.ones(4))
        draws = [
            size * _stream(seed, craft, stream, leg).normal(size=(count, 4))
            for stream, (count, size) in enumerate(kinds, PLANNED)
        ]
        return np.concatenate(draws)


def uncertain(
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


def nothing_drawn(count: int) -> Draws:
    """Return the errors of one simulation of N craft without any errors."""
    return Draws([0], Navigation(), np.zeros((count, 2)), None)


def seeds_of(seeds: int | Sequence[int]) -> list[int]:
    """Return the seed of each simulation."""
    if not isinstance(seeds, list | tuple | range | np.ndarray):
        return list(range(whole("seeds", seeds, 1)))
    if not len(seeds):
        raise ValueError("seeds: must not be empty")
    return [whole("seeds", one) for one in seeds]


def drawable(
    errors: Uncertainty | Sequence[Uncertainty | None] | None, count: int
) -> Sequence[Uncertainty] | None:
    """Return the argument `errors` for each craft; None if no craft has any."""
    if errors is None:
        return None
    from closeform.uncertainty.errors import Uncertainty, one_for_each  # imported late: compiles kernels

    return [Uncertainty() if one is None else one for one in one_for_each("errors", errors, count)]


def _stream(seed: int, craft: int, which: int, leg: int) -> np.random.Generator:
    """Return the random generator of one craft and one kind of error in a simulation."""
    return np.random.Generator(np.random.Philox(key=seed, counter=[0, leg, which, 1 + craft]))


def _drawn(
    seed: int, measurements: int, sight: Navigation, sizes: Floats, kept: float
) -> tuple[Floats, Floats]:
    """Return the errors of measurements (N, M, 6) and of thrust (N, 4) of one simulation.

    The share `kept` of each measurement error remains at the next measurement.  # theory (91)
    """
    count, draws = len(sizes), np.random.Generator(np.random.Philox(key=seed))
    ways = draws.normal(size=(count, 3, 3))
    ways /= np.linalg.norm(ways, axis=2, keepdims=True)
    shares = draws.uniform([-1.0, 0.0], 1.0, (count, 2)) * sizes
    errors = np.hstack([shares[:, :1], shares[:, 1:] * ways[:, 2]])
    stays = ways[:, :2] * np.array([sight.position_bias, sight.velocity_bias])[:, None]
    white = draws.normal(size=(measurements, count, 6)).swapaxes(0, 1)
    for k in range(1, measurements if kept else 0):
        white[:, k] = kept * white[:, k - 1] + np.sqrt(1.0 - kept * kept) * white[:, k]
    white = white * np.repeat([sight.position, sight.velocity], 3)
    return np.ascontiguousarray(white + stays.reshape(count, 1, 6)), errors
