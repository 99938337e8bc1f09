"""Process noise in the cases of a study, sampled for each craft on a common time grid.

A random number belongs to a seed, a craft's name, a case and an interval of time. It therefore does not
depend on the length of the mission, its division into stages, or the step.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil
from typing import Self

import numpy as np
from scipy.special import ndtri

from closeform.arrays import Floats
from closeform.campaign.draws import uniform
from closeform.motion.path import Path
from closeform.scenario import Craft, Scenario, ScenarioError
from closeform.uncertainty.velocity_disturbance import kicked
from closeform.uncertainty.white_noise import (
    BLOCK,
    MOST_OFF,
    SAME,
    STEPS,
    by_then,
    increments,
    kicks_of,
    level_of,
    off_beside,
    step_beside,
)
from closeform.zones.pair_zones import portions
from closeform.zones.zone import Zone

USUAL = 9  # the level with steps of 8 s
HALVES = 1 << 20  # greatest number of intervals in a block
BLOCKS = 2  # blocks of random numbers that give the six of a step


@dataclass(frozen=True)
class ProcessNoise:
    """Process noise of a study's cases with a `seed`, in steps of a `level`, at a mean motion [rad/s]."""

    seed: int
    mean_motion: float
    level: int

    @classmethod
    def beside_zones(cls, scenario: Scenario, seed: int, span: float) -> Self:
        """Return noise with steps short enough that the discretization is negligible beside every zone.

        `span`: the duration of the mission [s]. Raises ScenarioError if no allowed step is short enough.
        """
        n, steps = scenario.orbit.build().mean_motion, list[float]()
        for zone, density in noisy_zones(scenario):
            steps.append(step_beside(n, density, zone.inner_radius, span))
            if off_beside(density, steps[-1]) > MOST_OFF * zone.inner_radius:
                line = (
                    f"craft.execution: noise of {density:g} m^2/s^3 moves a pair too far for its zone in "
                    f"each of {STEPS} steps; reduce the noise, enlarge the zone, or shorten the mission"
                )
                raise ScenarioError(scenario.file, [line])
        return cls(seed, n, level_of(min(steps)) if steps else USUAL)

    @property
    def step(self) -> float:
        """Time between changes of velocity [s]."""
        return BLOCK / 2.0**self.level

    def steps(self, span: float) -> int:
        """Return the number of steps that begin within a mission of duration `span` [s]."""
        return ceil(span / self.step - SAME)

    def pushes(self, craft: Craft, count: int, first: int, last: int) -> Floats:
        """Return the noise increments of a craft's state in `count` steps in some cases (C, count, 6)."""
        key, density = f"noise of {craft.name}", density_of(craft)
        if density == 0.0:
            return np.zeros((last - first, count, 6))

        def normal(level: int, rows: int) -> Floats:
            random = [
                uniform(self.seed, key, BLOCKS, first, last, interval(level, row)).reshape(-1, 8)[:, :6]
                for row in range(rows)
            ]
            return np.asarray(ndtri(np.stack(random, axis=1)))

        return np.asarray(np.sqrt(density) * increments(self.mean_motion, self.level, count, normal))

    def moved(self, path: Path, craft: Craft, case: int, since: float) -> Path:
        """Return a craft's path with the noise after a time [s]; 0 includes the noise that begins then."""
        if density_of(craft) == 0.0:
            return path
        count = int(by_then(np.asarray(path.end), self.step))
        kicks = kicks_of(self.mean_motion, self.step, self.pushes(craft, count, case, case + 1))[0]
        first = int(by_then(np.asarray(since), self.step)) if since > 0.0 else 0
        return kicked(path, self.step * np.arange(float(first), float(count)), kicks[first:])


def density_of(craft: Craft) -> float:
    """Return the noise density of a craft [m^2/s^3]."""
    return 0.0 if craft.execution is None else craft.execution.noise


def noisy_zones(scenario: Scenario) -> Iterator[tuple[Zone, float]]:
    """Yield the zone of each pair with noise, hard bodies included, and the sum of both densities."""
    densities = np.array([density_of(craft) for craft in scenario.craft])
    for table in (scenario.zones, scenario.bodies):
        for zone, first, second in portions(table):
            yield from ((zone, both) for both in (densities[first] + densities[second]).tolist() if both)


def interval(level: int, row: int) -> int:
    """Return the event number of an interval: the sum over a block, or the split of one of its parts."""
    if level == 0:
        return row * HALVES
    parts = 1 << (level - 1)
    return row // parts * HALVES + parts + row % parts
