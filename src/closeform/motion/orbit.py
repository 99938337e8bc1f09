"""Orbit: the frame in which craft move, and the paths that they can take in it."""

from dataclasses import dataclass
from typing import Any, Literal, Self

import numpy as np
from numba import float64, void
from numpy.typing import ArrayLike

from closeform.arrays import LARGEST, Floats, broadcast, number, numbers, shown
from closeform.compiled import kernel
from closeform.kernel_loans import stack_matrix, stack_vector
from closeform.motion.arc import END, IMPULSE, MEAN_MOTION, PUSH, START, STATE, THRUST, WIDTH
from closeform.motion.duration import flaw
from closeform.motion.effort import ENERGY, totals
from closeform.motion.hill import coast, response
from closeform.motion.lambert import start_velocities
from closeform.motion.linear import solve
from closeform.motion.mean_motion import (
    EARTH_MU,
    EARTH_RADIUS,
    mean_motion_from_altitude,
    mean_motion_from_period,
    mean_motion_from_semi_major_axis,
)
from closeform.motion.path import FORGIVEN, Path, path_of

# Of the energy of cubics through the same samples, what Hill's motion may need where a craft is said
# to coast.  Ten times as much: where flattening or thrust bends paths, Hill's motion is chosen with
# samples half an hour apart, and is off by half as much again as cubics are (GRACE).  A tenth: an hour apart
# cubics are chosen, which are off by five times as much.
COASTING = 0.1


@kernel(void(float64, float64[:, ::1], float64[:, ::1]))
def steer(n: float, arcs: Floats, finals: Floats) -> None:
    """Set the optimal thrust of each arc so that it ends in its final state.        # theory (7, 8)"""
    matrix = stack_matrix(6, 6)
    work = stack_matrix(6, 6)
    rhs = stack_vector(6)
    for p in range(len(arcs)):
        arc = arcs[p]
        t = arc[END] - arc[START]
        response(n, t, matrix)
        gap = stack_vector(6)
        reached = coast(n, t, arc[6], arc[7], arc[8], arc[9], arc[10], arc[11])
        for i in range(6):
            gap[i] = finals[p, i] - reached[i]
        for _ in range(2):  # once more on what rounding left
            for i in range(6):
                rhs[i] = gap[i]
                for j in range(6):
                    rhs[i] -= matrix[i, j] * arc[THRUST + j]
                    work[i, j] = matrix[i, j]
            solve(work, rhs, 6)
            for i in range(6):
                arc[THRUST + i] += rhs[i]


@kernel(void(float64, float64[::1], float64[:, :, ::1]))
def transitions(n: float, times: Floats, out: Floats) -> None:
    for p in range(len(times)):
        for k in range(6):
            column = coast(
                n,
                times[p],
                1.0 * (k == 0),
                1.0 * (k == 1),
                1.0 * (k == 2),
                1.0 * (k == 3),
                1.0 * (k == 4),
                1.0 * (k == 5),
            )
            for i in range(6):
                out[p, i, k] = column[i]


def fix_inertially(n: float, arcs: Floats) -> None:
    """Constant thrusts of arcs (..., 30), given in inertial axes, as the rotating frame sees them turn."""
    angle = n * arcs[..., START]
    c, s = np.cos(angle), np.sin(angle)
    x, y = arcs[..., PUSH].copy(), arcs[..., PUSH + 1].copy()
    arcs[..., PUSH], arcs[..., PUSH + 1] = x * c + y * s, y * c - x * s
    for k in range(PUSH, PUSH + 9, 3):  # each derivative, by a quarter turn against the orbit's
        arcs[..., k + 3], arcs[..., k + 4] = n * arcs[..., k + 1], -n * arcs[..., k]


def interpolated(n: float, arcs: Floats, finals: Floats) -> Floats:
    """Arcs from their states to the final ones: Hill's motion where a craft coasts, else cubics."""
    cubic, hill = arcs.copy(), arcs.copy()
    hill[:, MEAN_MOTION] = n
    each = np.arange(len(arcs) + 1)
    energies = np.empty((2, len(arcs)))
    for rows, motion, energy in ((cubic, 0.0, energies[0]), (hill, n, energies[1])):
        steer(motion, rows, finals)
        totals(rows, each, n, ENERGY, energy)
    coasts = energies[1] <= COASTING * energies[0]
    return np.where(coasts[:, None], hill, cubic)


def _checked(name: str, value: ArrayLike, columns: int | None = None) -> Floats:
    array = numbers(name, value)
    if columns is not None and (array.ndim == 0 or array.shape[-1] != columns):
        raise ValueError(f"{name}: expected shape (..., {columns}), got {array.shape}")
    if not (np.abs(array) < LARGEST).all():
        raise ValueError(f"{name}: every number must be finite, and below {LARGEST:g} in SI units")
    return array


@dataclass(frozen=True)
class Orbit:
    """A circular reference orbit by its `mean_motion` [rad/s], at least 0; 0 is deep space.

    States are (..., 6): x radial outward, y along the velocity, z along the orbit normal [m],
    then their rates [m/s], in the frame that turns with the orbit.  In deep space the frame
    does not turn.  Whatever moves does so for 1e-12 s at least and 1e6 orbits at most (`duration`).

    Raises ValueError for a mean motion that is negative or not finite.
    """

    mean_motion: float

    def __post_init__(self) -> None:
        value = numbers("mean_motion", self.mean_motion)
        if value.shape or not (np.isfinite(value) and value >= 0):
            raise ValueError(
                f"mean_motion: must be one finite number, at least 0 rad/s, got {shown(self.mean_motion)}"
            )
        object.__setattr__(self, "mean_motion", float(value))

    @classmethod
    def circular(cls, altitude: float, mu: float = EARTH_MU, radius: float = EARTH_RADIUS) -> Self:
        """Orbit at `altitude` [m] above a body of `mu` [m^3/s^2] and `radius` [m].

        Raises ValueError unless altitude + radius and mu are positive.
        """
        given = number("altitude", altitude), number("mu", mu), number("radius", radius)
        return cls(float(mean_motion_from_altitude(*given)))

    @classmethod
    def from_semi_major_axis(cls, semi_major_axis: float, mu: float = EARTH_MU) -> Self:
        """Orbit of `semi_major_axis` [m] around a body of `mu` [m^3/s^2].

        Raises ValueError unless both are positive.
        """
        given = number("semi_major_axis", semi_major_axis), number("mu", mu)
        return cls(float(mean_motion_from_semi_major_axis(*given)))

    @classmethod
    def from_period(cls, period: float) -> Self:
        """Orbit of `period` [s].  Raises ValueError unless it is positive."""
        return cls(float(mean_motion_from_period(number("period", period))))

    @property
    def period(self) -> float:
        """One turn [s]; inf in deep space."""
        return 2 * np.pi / self.mean_motion if self.mean_motion else np.inf

    def transition(self, duration: ArrayLike) -> Floats:
        """State transition matrix of natural motion over `duration` [s], of any sign: (..., 6, 6).

        Raises ValueError for numbers that are not finite.
        """
        times = _checked("duration", duration)
        out = np.empty((times.size, 6, 6))
        transitions(self.mean_motion, np.ravel(times), out)
        return out.reshape(times.shape + (6, 6))

    def coast(self, state: ArrayLike, duration: ArrayLike, start: ArrayLike = 0.0) -> Path:
        """Natural motion from `state` (..., 6) at time `start` [s] for `duration` [s].

        All arguments broadcast.  Raises ValueError for a duration that is not positive, wrong
        shapes or non-finite numbers.
        """
        return self._path(self._arcs(duration, start, state=state))

    def transfer(
        self, initial: ArrayLike, final: ArrayLike, duration: ArrayLike, start: ArrayLike = 0.0
    ) -> Path:
        """Energy-optimal path from `initial` to `final` (..., 6) in `duration` [s].   # theory 2

        Least half-integral of |thrust|^2, from time `start` [s] on; all arguments broadcast, so
        that `transfer(a[:, None], b, T).energy` is the matrix of costs from every a to every b.
        Raises ValueError for a duration that is not positive, wrong shapes or non-finite numbers.
        """
        arcs, finals = self._between(initial, final, duration, start)
        steer(self.mean_motion, arcs.reshape(-1, WIDTH), finals)
        return self._path(arcs)

    def two_impulse(
        self, initial: ArrayLike, final: ArrayLike, duration: ArrayLike, start: ArrayLike = 0.0
    ) -> Path:
        """Drift from `initial` to `final` (..., 6) in `duration` [s] between two impulses.

        The first is at time `start` [s].  All arguments broadcast.  After half an orbit, and
        at other times at which a start velocity changes nothing along some direction (see `lambert`),
        many drifts meet a place or none does: of many it is the one with the least sum of the
        squares of both impulses [m^2/s^2].

        Raises ValueError for a final position that no two impulses reach in the duration (it
        says how near they come), a duration that is not positive, wrong shapes or non-finite
        numbers.
        """
        arcs, finals = self._between(initial, final, duration, start)
        rows = arcs.reshape(-1, WIDTH)
        begins, lengths = rows[:, STATE : STATE + 6].copy(), rows[:, END] - rows[:, START]
        speeds = start_velocities(self.transition(lengths), lengths, begins, finals)
        rows[:, STATE + 3 : STATE + 6] = speeds
        rows[:, IMPULSE : IMPULSE + 3] = speeds - begins[:, 3:]
        arrived = self._path(rows)._evaluate_rows(rows[:, END : END + 1])[:, 0]
        self._reached(arcs.shape[:-1], rows, arrived, finals)
        last = np.zeros_like(rows)
        last[:, [START, END]] = rows[:, [END]]
        last[:, MEAN_MOTION] = self.mean_motion
        last[:, STATE : STATE + 6] = finals
        last[:, IMPULSE : IMPULSE + 3] = finals[:, 3:] - arrived[:, 3:]
        both = np.stack([rows, last], axis=1).reshape(-1, WIDTH)
        return Path(self, both, 2 * np.arange(len(rows) + 1), arcs.shape[:-1])

    def _reached(self, shape: tuple[int, ...], rows: Floats, arrived: Floats, finals: Floats) -> None:
        """ValueError where craft of a batch arrive beside their final position."""
        if not len(rows):
            return
        lengths = rows[:, END] - rows[:, START]
        missed = np.linalg.norm(arrived[:, :3] - finals[:, :3], axis=1)
        places = np.abs(np.concatenate([rows[:, STATE : STATE + 3], finals[:, :3]], axis=1)).max(axis=1)
        drift = np.abs(rows[:, STATE + 3 : STATE + 6]).max(axis=1) * lengths
        k = int(np.argmax(missed - FORGIVEN * np.maximum(places, drift)))
        if missed[k] <= FORGIVEN * max(places[k], drift[k]):
            return
        craft = f"craft {', '.join(map(str, np.unravel_index(k, shape)))}: " if shape else ""
        apart = f"{lengths[k]:g} s ({lengths[k] / self.period:.6g} orbits) apart"
        place = ", ".join(f"{coordinate:.9g}" for coordinate in arrived[k, :3])
        raise ValueError(
            f"final: {craft}two impulses {apart} come no nearer than {missed[k]:.6g} m, at [{place}]; "
            "end there, or change the duration"
        )

    def burn(
        self,
        state: ArrayLike,
        acceleration: ArrayLike,
        duration: ArrayLike,
        start: ArrayLike = 0.0,
        frame: Literal["orbit", "inertial"] = "orbit",
    ) -> Path:
        """Constant thrust `acceleration` (..., 3) [m/s^2] from `state`.

        It begins at time `start` [s] and lasts for `duration` [s].  It is fixed in the orbit's rotating
        `frame`, or with "inertial" in inertial axes, those of the orbit at time 0.  All arguments broadcast.
        Raises ValueError for a duration that is not positive, wrong shapes, non-finite numbers or an
        unknown frame.
        """
        if not isinstance(frame, str) or frame not in ("orbit", "inertial"):
            raise ValueError(f"frame: 'orbit' or 'inertial', not {shown(frame)}")
        push = _checked("acceleration", acceleration, 3)
        arcs = self._arcs(duration, start, state=state, like=push.shape[:-1])
        arcs[..., PUSH : PUSH + 3] = push
        if frame == "inertial":
            fix_inertially(self.mean_motion, arcs)
        return self._path(arcs)

    def sampled(self, times: ArrayLike, states: ArrayLike) -> Path:
        """Path through `states` (..., T, 6) at `times` (T,) [s]: Hill's motion where craft coast, or cubics.

        Position and velocity are met at every sample.  From one to the next the path is the optimal
        transfer in this orbit where that needs less than a tenth of the energy that a cubic would:
        there the craft coasts but for little.  Elsewhere it is the cubic (Hermite), which is the
        transfer at n = 0: samples h apart leave its position off by at most h^4/384 max|r''''|, its
        velocity by h^3/124 max|r''''|, per axis.  `interpolation_error` of the path estimates how
        far craft may have been from it, `cubic_share` tells which of the two was used.

        Raises ValueError unless the times increase strictly and all numbers are finite.
        """
        instants = _checked("times", times)
        nodes = _checked("states", states, 6)
        if instants.ndim != 1 or len(instants) < 2 or nodes.shape[-2:-1] != instants.shape:
            raise ValueError(
                "states: expected shape (..., T, 6) for T >= 2 times, "
                f"got {nodes.shape} for times of shape {instants.shape}"
            )
        if not (np.diff(instants) > 0).all():
            raise ValueError("times: must increase strictly")
        if wrong := flaw(np.diff(instants), self.mean_motion):
            raise ValueError(f"times: from one to the next {wrong}")
        batch = nodes.shape[:-2]
        arcs = np.zeros((*batch, len(instants) - 1, WIDTH))
        arcs[..., START] = instants[:-1]
        arcs[..., END] = instants[1:]
        arcs[..., STATE : STATE + 6] = nodes[..., :-1, :]
        finals = np.ascontiguousarray(nodes[..., 1:, :]).reshape(-1, 6)
        rows = interpolated(self.mean_motion, arcs.reshape(-1, WIDTH), finals)
        count = int(np.prod(batch, dtype=int))
        return Path(self, rows, np.arange(count + 1) * (len(instants) - 1), batch)

    def _arcs(
        self, duration: ArrayLike, start: ArrayLike, state: ArrayLike, like: tuple[int, ...] = ()
    ) -> Floats:
        states = _checked("state", state, 6)
        lengths, starts = _checked("duration", duration), _checked("start", start)
        if wrong := flaw(lengths, self.mean_motion):
            raise ValueError(f"duration: {wrong}")
        shape = broadcast(state=states.shape[:-1], duration=lengths.shape, start=starts.shape, other=like)
        arcs = np.zeros((*shape, WIDTH))
        arcs[..., START] = starts
        arcs[..., END] = starts + lengths
        if not (arcs[..., END] > arcs[..., START]).all():
            raise ValueError(f"duration: {lengths.min():g} s vanishes beside a start of {starts.max():g} s")
        arcs[..., MEAN_MOTION] = self.mean_motion
        arcs[..., STATE : STATE + 6] = states
        return arcs

    def _between(
        self, initial: ArrayLike, final: ArrayLike, duration: ArrayLike, start: ArrayLike
    ) -> tuple[Floats, Floats]:
        ends = _checked("final", final, 6)
        begins = _checked("initial", initial, 6)
        arcs = self._arcs(duration, start, state=begins, like=ends.shape[:-1])
        return arcs, np.broadcast_to(ends, (*arcs.shape[:-1], 6)).reshape(-1, 6).copy()

    def _path(self, arcs: Any) -> Path:
        rows = np.ascontiguousarray(arcs).reshape(-1, WIDTH)
        return path_of(self, rows, np.arange(len(rows) + 1), arcs.shape[:-1])
