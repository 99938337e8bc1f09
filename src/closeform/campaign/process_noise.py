"""Shaking: white noise in the cases of a study, drawn for each craft at instants that all have in common.

A number belongs to a seed, a craft's name, a case and an interval of time, so that it is the same however
long a mission is, how it is cut into stages, and how short the steps are.
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

USUAL = 9  # level of steps of 8 s
HALVES = 1 << 20  # intervals of a block that are halved, at most
BLOCKS = 2  # of random numbers, for six of them


@dataclass(frozen=True)
class Shaking:
    """White noise of a study's cases with a `seed`, in steps of a `level`, at a mean motion [rad/s]."""

    seed: int
    mean_motion: float
    level: int

    @classmethod
    def beside_zones(cls, scenario: Scenario, seed: int, span: float) -> Self:
        """Of a mission as planned that lasts so long [s]: what steps leave out is little of any zone.

        Raises ScenarioError where it is not.
        """
        n, steps = scenario.orbit.build().mean_motion, list[float]()
        for zone, density in shaken_zones(scenario):
            steps.append(step_beside(n, density, zone.inner_radius, span))
            if off_beside(density, steps[-1]) > MOST_OFF * zone.inner_radius:
                line = (
                    f"craft.execution: noise of {density:g} m^2/s^3 moves a pair too far beside its zone in "
                    f"each of {STEPS} steps; give less, a larger zone, or a shorter mission"
                )
                raise ScenarioError(scenario.file, [line])
        return cls(seed, n, level_of(min(steps)) if steps else USUAL)

    @property
    def step(self) -> float:
        """From one change of velocity to the next [s]."""
        return BLOCK / 2.0**self.level

    def steps(self, span: float) -> int:
        """How many begin before a mission ends that lasts so long [s]."""
        return ceil(span / self.step - SAME)

    def pushes(self, craft: Craft, count: int, first: int, last: int) -> Floats:
        """What noise adds to a craft's state in each of `count` steps in some cases (C, count, 6)."""
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
        """A craft's path with what noise after a time [s] makes of it; of 0 with what begins then."""
        if density_of(craft) == 0.0:
            return path
        count = int(by_then(np.asarray(path.end), self.step))
        kicks = kicks_of(self.mean_motion, self.step, self.pushes(craft, count, case, case + 1))[0]
        first = int(by_then(np.asarray(since), self.step)) if since > 0.0 else 0
        return kicked(path, self.step * np.arange(float(first), float(count)), kicks[first:])


def density_of(craft: Craft) -> float:
    """Of a craft's white noise [m^2/s^3]."""
    return 0.0 if craft.execution is None else craft.execution.noise


def shaken_zones(scenario: Scenario) -> Iterator[tuple[Zone, float]]:
    """The zones of all pairs of which either is shaken, hard bodies too, and both densities' sum."""
    densities = np.array([density_of(craft) for craft in scenario.craft])
    for table in (scenario.zones, scenario.bodies):
        for zone, first, second in portions(table):
            yield from ((zone, both) for both in (densities[first] + densities[second]).tolist() if both)


def interval(level: int, row: int) -> int:
    """The number of what is drawn for an interval: a block's own sum, or how one of its parts is shared."""
    if level == 0:
        return row * HALVES
    parts = 1 << (level - 1)
    return row // parts * HALVES + parts + row % parts
