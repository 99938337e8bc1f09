"""Where everybody is when a stage begins, and what follows from that: coasts, transfers, being late."""

from dataclasses import dataclass

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.flight import Flight, watch
from closeform.motion.joining import stack
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path
from closeform.scenario import Avoid, Joint, Scenario, Target
from closeform.verdict import Late, Use

LATE = 1.0 + 1e-6  # times the duration asked for: longer is later than asked


@dataclass(frozen=True, eq=False)
class StageStart:
    """Where everybody is when a stage begins, at `time` [s]; `past` has time and states of named stages."""

    scenario: Scenario
    orbit: Orbit
    number: int
    states: Floats
    time: float
    past: dict[str, tuple[float, Floats]]

    def flight(self, paths: list[Path]) -> Flight:
        """The paths, watched over their common time."""
        return watch(stack(paths), self.scenario.names, self.scenario.zones)

    def coast(self, k: int, duration: float) -> Path:
        """Craft k does not burn for a `duration` [s]."""
        return self.orbit.coast(self.states[k], duration, self.time)

    def coasts(self, duration: float) -> Flight:
        """Nobody burns for a `duration` [s]."""
        return self.flight([self.coast(k, duration) for k in range(len(self.states))])

    def latitude(self, duration: float) -> float:
        """The origin's argument of latitude [rad] after a `duration` [s]."""
        return self.scenario.orbit.latitude + self.orbit.mean_motion * (self.time + duration)

    def transfer(self, target: Target, k: int, duration: float) -> Path:
        """Craft k's own way to a target, at least energy."""
        final = target.state(self.orbit, self.latitude(duration))
        return self.orbit.transfer(self.states[k], final, duration, self.time)

    def mixed(self, who: list[int], paths: Path) -> Flight:
        """The `paths` of the craft `who`; the others coast meanwhile."""
        duration = float(np.max(paths.end)) - self.time
        flying = {k: paths[place] for place, k in enumerate(who)}
        flying |= {k: self.coast(k, duration) for k in range(len(self.states)) if k not in flying}
        return self.flight([flying[k] for k in sorted(flying)])


def too_late(
    start: StageStart, stage: Avoid | Joint, after: Flight, punctual: dict[str, float | None]
) -> Late | None:
    """That a stage takes longer than it was asked to, where it does.

    `punctual`: with which thrust [m/s^2] each craft would not, None where that is not known.
    """
    took, asked = after.end - start.time, stage.within.on(start.orbit.mean_motion)
    if took <= asked * LATE:
        return None
    short = [
        Use("thrust", "N", craft.name, needed * craft.mass, craft.max_thrust)
        for craft in start.scenario.craft
        if (needed := punctual.get(craft.name)) is not None
        and craft.mass is not None
        and craft.max_thrust is not None
    ]
    return Late(start.number, stage.verb, asked, took, tuple(use for use in short if use.exceeded))
