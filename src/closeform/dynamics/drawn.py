"""What flights draw: errors of measurements, of thrust, of states at the start, and of each burn."""

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

# Streams of a craft in a flight: of its state; of burns by plan, back, and impulses; of noise
START, PLANNED, NOISE = 0, 1, 4


class Drawn(NamedTuple):
    """Errors of S flights of N craft."""

    seen: Floats  # (S, N, M, 6) [m, m/s] of measurements
    thrust: Floats  # (S, N, 4) of all thrust: of its size, and a small turn
    start: Floats  # (S, N, 6) [m, m/s] of states at the start
    events: Floats  # (S, N, E, 4) the same of each burn, see `Events`; of impulses normal numbers
    gates: Floats  # (N, 4) which these are times
    pushes: Floats  # (S, N, K or 0, 6) [m, m/s], what noise adds to states in each step


def exactly(count: int, measurements: int) -> Drawn:
    """No errors of one flight of N craft that are measured so many times."""
    shapes = (count, measurements, 6), (count, 4), (count, 6), (count, 0, 4), (count, 0, 6)
    seen, thrust, start, events, pushes = (np.zeros((1, *shape)) for shape in shapes)
    return Drawn(seen, thrust, start, events, np.zeros((count, 4)), pushes)


@dataclass(frozen=True, eq=False)
class Draws:
    """What is drawn in the flights of some `seeds`, each by itself, of N craft.

    Measured by one `sight`; `sizes` (N, 2) bound the error of thrust that is constant through a flight, and
    `errors` are each craft's own, where there are any; their noise counts `since` a time [s].
    """

    seeds: Sequence[int]
    sight: Navigation
    sizes: Floats
    errors: Sequence[Uncertainty] | None
    since: float = 0.0

    def measured(self, table: Timetable) -> tuple[Floats, Floats]:
        """Errors of measurements (S, N, M, 6) and of thrust (S, N, 4): of all craft, seen together."""
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
        """All that is drawn of `some` craft that are told to fly so, of measurements as `measured`."""
        measured = measured or self.measured(commands.table)
        seen, thrust = (np.ascontiguousarray(part[:, some]) for part in measured)
        size, gates = (len(self.seeds), len(some)), np.zeros((len(some), 4))
        if self.errors is None:
            nothing = np.zeros((*size, 0, 4)), gates, np.zeros((*size, 0, 6))
            return Drawn(seen, thrust, np.zeros((*size, 6)), *nothing)
        start, events, told = [], [], commands.events
        for seed in self.seeds:
            for k in some:
                start.append(self.errors[k]._root @ _stream(seed, k, START, leg).normal(size=6))
                events.append(self._executed(seed, k, told, leg))
        gates += [self.errors[k].impulse for k in some]
        begin, own = np.reshape(start, (*size, 6)), np.reshape(events, (*size, -1, 4))
        kicked, pushes = self._shaken(some, commands.table.nodes, commands.path.orbit.mean_motion)
        begin[..., 3:] += kicked
        return Drawn(seen, thrust, begin, own, gates, pushes)

    def _shaken(self, some: Sequence[int], nodes: Floats, n: float) -> tuple[Floats, Floats]:
        """What white noise does to velocities at the start (S, M, 3), and to states in steps (S, M, K, 6).

        Between nodes (K + 1,) [s]; by changes of velocity each 8 s, of all flights at the same times.
        """
        assert self.errors is not None
        size = len(self.seeds), len(some)
        density = np.array([self.errors[k].noise for k in some])
        if not density.any():
            return np.zeros((*size, 3)), np.zeros((*size, 0, 6))
        from closeform.dynamics.process_noise import shaken  # which few flights need

        begins, pushes = np.zeros((*size, 3)), np.zeros((*size, len(nodes) - 1, 6))
        for place in np.argwhere(np.broadcast_to(density > 0.0, size)).tolist():
            seed, k = self.seeds[place[0]], some[place[1]]

            def normal(level: int, rows: int, seed: int = seed, k: int = k) -> Floats:
                return _stream(seed, k, NOISE, level).normal(size=(rows, 6))

            told = n, density[place[1]], nodes - self.since, normal
            begins[tuple(place)], pushes[tuple(place)] = shaken(*told)
        return begins, pushes

    def _executed(self, seed: int, craft: int, events: Events, leg: int) -> Floats:
        """Errors (E, 4) of each burn and impulse of one craft in one flight."""
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
    """Whether flights differ at all: in what is `measured`, if anything is, in thrust, starts or burns."""
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
    """One flight of N craft without errors."""
    return Draws([0], Navigation(), np.zeros((count, 2)), None)


def seeds_of(seeds: int | Sequence[int]) -> list[int]:
    """The seed of each flight."""
    if not isinstance(seeds, list | tuple | range | np.ndarray):
        return list(range(whole("seeds", seeds, 1)))
    if not len(seeds):
        raise ValueError("seeds: give one at least")
    return [whole("seeds", one) for one in seeds]


def drawable(
    errors: Uncertainty | Sequence[Uncertainty | None] | None, count: int
) -> Sequence[Uncertainty] | None:
    """The argument `errors` as those of each craft; None where nobody has any."""
    if errors is None:
        return None
    from closeform.uncertainty.errors import Uncertainty  # whose kernels nothing else needs
    from closeform.uncertainty.search import given_errors

    return [
        Uncertainty() if one is None else one for one in given_errors("errors", errors, count, Uncertainty)
    ]


def _stream(seed: int, craft: int, which: int, leg: int) -> np.random.Generator:
    """Random numbers of one craft's own in a flight: of the flight's Philox, at another count."""
    return np.random.Generator(np.random.Philox(key=seed, counter=[0, leg, which, 1 + craft]))


def _drawn(
    seed: int, measurements: int, sight: Navigation, sizes: Floats, kept: float
) -> tuple[Floats, Floats]:
    """Errors of measurements (N, M, 6) and of thrust (N, 4) of one flight: its own stream of Philox.

    Of each measurement's error so much is `kept` by the next.                                # theory (91)
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
