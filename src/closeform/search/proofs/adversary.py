"""Adversarial search among the initial states of a box for the pair that locks last, or never.

The adversary draws random pairs, most of which pass close by each other, and improves the latest of them by
ever smaller changes.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.search.lock_times import lock_times
from closeform.search.schedule import Search
from closeform.search.search_errors import SearchErrors

DRAWN = 200_000  # number of random initial states
ROUNDS, PATIENCE = 300, 30  # maximum number of rounds in a climb, and of rounds without gain
ISLANDS, MEMBERS, TRIED = 8, 12, 64  # islands, members of each, trials of a member in a round
GAIN = 1e-4  # s


@dataclass(frozen=True)
class Adversary:
    """Search schedule and a box of states between `least` and `greatest` (6,).

    `scaled` is True if states on the surface of the box represent all states inside. `errors`: search errors
    of the craft in A and in B, the same for all pairs.
    """

    search: Search
    least: Floats
    greatest: Floats
    scaled: bool
    errors: SearchErrors | None = None

    def drawn(self, random: Any, count: int = DRAWN) -> Floats:
        """Return random states (count, 6) of the box; half of the pairs pass closely during the search."""
        anywhere = random.uniform(self.least, self.greatest, (count - count // 2, 6))
        velocity = random.uniform(self.least, self.greatest, (count // 2, 6))[:, 3:]
        along = random.random(len(velocity)) < 0.5  # near the sun line, where no cone reaches
        velocity[along, :2] *= 10.0 ** random.uniform(-4.0, 0.0, (int(along.sum()), 1))
        speed = np.linalg.norm(velocity, axis=1, keepdims=True)
        miss = random.normal(size=(len(velocity), 3)) * 10.0 ** random.uniform(-4.0, 0.0, (len(velocity), 1))
        duration = self.search.duration
        closest = random.uniform(0.0, duration, (len(velocity), 1))
        passing = np.hstack([(miss * speed * duration) - velocity * closest, velocity])
        return self.within(np.concatenate([anywhere, passing]))

    def within(self, states: Floats) -> Floats:
        """Return states (N, 6) moved into the box: scaled to its surface if lengths scale, else clipped."""
        if not self.scaled:
            return np.clip(states, self.least, self.greatest)
        with np.errstate(divide="ignore", invalid="ignore"):
            least = np.where(states < 0.0, states / self.least, 0.0)
            shares = np.where(states > 0.0, states / self.greatest, least)
            states = states / shares.max(axis=1, keepdims=True)
        return np.where(np.isfinite(states), states, 0.0)

    def times(self, states: Floats) -> Floats:
        """Return the first locks of states (N, 6) [s]: inf for never, -inf for craft at the same position."""
        apart = np.abs(states[:, :3]).max(axis=1) > 0.0
        times = np.full(len(states), -inf)
        found = lock_times(self.search, states[apart, :3], states[apart, 3:], self.errors).time
        times[apart] = np.where(np.isnan(found), inf, found)
        return times

    def climbed(
        self, states: Floats, times: Floats, random: Any, rounds: int = ROUNDS
    ) -> tuple[Floats, float]:
        """Return the state with the latest lock reached from states with their `times`, and its time.

        Differential evolution (Storn and Price 1997) follows the narrow ridges of the time to lock, because
        they lie along the differences between members. The members of each octant of positions climb
        separately.
        """
        width = self.greatest - self.least
        members = []
        octants = (states[:, :3] > 0.5 * (self.least + self.greatest)[:3]) @ [1, 2, 4]
        for island in range(ISLANDS):
            here = octants == island
            own = np.flatnonzero(here if here.any() else ~here)
            best = own[np.argsort(-times[own], kind="stable")[:MEMBERS]]
            members.append(np.resize(best, MEMBERS))
        states, times = states[np.concatenate(members)], times[np.concatenate(members)]
        rows, latest, idle = np.arange(len(states)), -inf, 0
        for _ in range(rounds):
            if times.max() == inf or idle == PATIENCE:
                break
            tried = self.within((states[:, None] + steps(states, width, random)).reshape(-1, 6))
            found = self.times(tried).reshape(len(states), TRIED)
            which = found.argmax(axis=1)
            better = found[rows, which] > times
            states[better] = tried.reshape(len(states), TRIED, 6)[rows, which][better]
            times[better] = found[rows, which][better]
            idle = 0 if times.max() > latest + GAIN else idle + 1
            latest = max(latest, times.max())
        winner = int(times.argmax())
        return states[winner], float(times[winner])


def steps(states: Floats, width: Floats, random: Any) -> Floats:
    """Return trial steps (N, TRIED, 6) of all sizes: of some components, or along differences of members."""
    shape = len(states), TRIED
    size = 10.0 ** random.uniform(-8.0, -0.5, (*shape, 1))
    moved = random.random((*shape, 6)) < random.choice([0.2, 0.5, 1.0], (*shape, 1))
    anyhow = width * size * moved * random.normal(size=(*shape, 6))
    home = MEMBERS * (np.arange(len(states)) // MEMBERS)[:, None]
    one, other = home + random.integers(MEMBERS, size=(2, *shape))
    along = (states[one] - states[other]) * 10.0 ** random.uniform(-2.0, 0.3, (*shape, 1))
    return np.asarray(np.where(random.random((*shape, 1)) < 0.5, anyhow, along))
