"""Path past a moving ellipsoid by an evolutionary search, as SP11 discusses genetic algorithms.

The path is two transfers of minimum energy that meet in one intermediate state at the closest approach.
SciPy's differential evolution, which is close to a genetic algorithm, varies that state. A path costs its
energy, and a penalty for its depth in the zone at samples. To judge the path, thrust is held between steps.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import differential_evolution

from peers.motion import Array, position, state, thrust, transfer

SAMPLES = 200  # of each transfer
STEPS = 1000  # held thrusts
REACH = 4.0  # zones, half-width of the box of positions
GENERATIONS, POPULATION = 300, 15  # POPULATION times six members
PENALTY = 100.0  # energies for a path through the centre


@dataclass(frozen=True)
class Evolved:
    """The best member of the last generation."""

    energy: float  # m^2/s^3
    delta_v: float  # m/s
    thrust: Array  # (STEPS, 3) [m/s^2]
    evaluations: int


def solve(
    path: Array, obstacle: Array, duration: float, n: float, half_axes: Array, seed: int
) -> Evolved | None:
    """Return the best path, or None if it is not clear at samples. Motions are coefficients (3, 8)."""
    times = np.linspace(0.0, duration, 2001)
    away = np.linalg.norm((position(path, times, n) - position(obstacle, times, n)) / half_axes, axis=1)
    middle = float(np.clip(times[away.argmin()], 0.15 * duration, 0.85 * duration))
    begin, through, end = (state(path, time, n) for time in (0.0, middle, duration))
    scale = REACH * np.append(half_axes, n * half_axes)
    direct = 0.5 * (thrust(path, times, n) ** 2).sum(axis=-1).mean() * duration

    def parts(states: Array) -> tuple[tuple[Array, float, float], ...]:
        """Both transfers, each with the start and the duration of its time."""
        return (
            (transfer(begin, states, middle, n), 0.0, middle),
            (transfer(states, end, duration - middle, n), middle, duration - middle),
        )

    def judged(states: Array) -> tuple[Array, Array]:
        """Energies and least norms of the paths through states (S, 6)."""
        energy, least = np.zeros(len(states)), np.full(len(states), np.inf)
        for motion, start, length in parts(states):
            at = length * (np.arange(SAMPLES) + 0.5) / SAMPLES
            energy += 0.5 * (thrust(motion, at, n) ** 2).sum(axis=(1, 2)) * length / SAMPLES
            apart = (position(motion, at, n) - position(obstacle, start + at, n)) / half_axes
            least = np.minimum(least, np.linalg.norm(apart, axis=2).min(axis=1))
        return energy, least

    def cost(members: Array) -> Array:
        energy, least = judged(through + members.T * scale)
        return energy + PENALTY * direct * np.maximum(1.0 - least, 0.0)

    found = differential_evolution(
        cost,
        [(-1.0, 1.0)] * 6,
        maxiter=GENERATIONS,
        popsize=POPULATION,
        tol=1e-6,
        polish=False,
        seed=seed,
        updating="deferred",
        vectorized=True,
    )
    best = through + found.x * scale
    energy, least = judged(best[None])
    if least[0] <= 1.0:
        return None
    dt = duration / STEPS
    at = dt * (np.arange(STEPS) + 0.5)
    first, second = ((thrust(motion, at - start, n)) for motion, start, _ in parts(best))
    used = np.where((at < middle)[:, None], first, second)
    return Evolved(float(energy[0]), float(np.linalg.norm(used, axis=1).sum() * dt), used, int(found.nfev))
