"""Checks of impulsive paths: conflicts with thrust, and after a loss of thrust."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.motion.arc import END
from closeform.planning.delta_v.firing_times import Moments, sizes_of, some_of_each
from closeform.planning.problem.problem import PairRow, Problem, Trajectories
from closeform.planning.problem.scene import Contacts
from closeform.planning.requirements.requirement import RequirementCheck, largest_shortfall

ASTRAY = 1e-6  # of the distance of the ends, or of a metre: larger errors are misses
WEAK = 1e-3  # of the mean multiplier: smaller ones are insignificant


class Checked(NamedTuple):
    """Conflicts of paths, close approaches after a loss of thrust, and the smallest norm of these.

    `required` are the checks of the requirements on single craft.
    """

    missed: list[PairRow]
    lost: Contacts
    nearest: float
    required: list[RequirementCheck]

    @property
    def outside(self) -> float:
        """Largest shortfall of a requirement in reserves, 0 if the paths keep all by proof."""
        return largest_shortfall(self.required)

    @property
    def clear(self) -> bool:
        """True if there is no conflict, with thrust or after its loss, and other requirements are kept."""
        return not (self.missed or self.outside) and self.nearest >= 1.0

    @property
    def worst(self) -> float:
        """Smallest norm of all conflicts, at most 1."""
        return min([1.0, self.nearest, *(float(row[3]) for _, row in self.missed)])


@dataclass(frozen=True, eq=False)
class Spent:
    """Result of one round: paths, their cost, remaining conflicts, and the program's solution.

    The cost is the delta-v [m/s], the sum of the sizes of all `impulses`, where two thrusters that fire at
    once both count; or the control energy [m^2/s^3] of an `EnergySolver`.
    """

    trajectories: Trajectories
    cost: float
    least: float  # certified lower bound on the cost for these planes and any firing times
    checked: Checked
    contacts: Contacts
    margin: float  # distance of the planes, in zones
    moments: list[Moments]  # of each craft
    impulses: Floats  # (N, J, 3)
    peaks: list[Moments]  # maxima of each craft's primer, or of its part along a thruster

    @property
    def clear(self) -> bool:
        """True if the paths keep all requirements."""
        return self.checked.clear

    @property
    def worst(self) -> float:
        """Smallest norm of all conflicts, at most 1."""
        return self.checked.worst

    @property
    def pushing(self) -> Any:
        """Mask (K,) of the contacts with significant multipliers."""
        return pushing(self.contacts)

    def fired(self, share: float) -> list[Moments]:
        """Return the moments of each craft at which it fires more than a `share` of the delta-v."""
        return some_of_each(self.moments, sizes_of(self.impulses) > share * self.cost)


def arrive(problem: Problem, trajectories: Trajectories, finals: Floats) -> bool:
    """Return whether craft reach their final states (N, 6), which few fixed directions may not allow."""
    paths, ends = problem.path(trajectories), problem.base[:, END]
    off = np.abs(np.stack([paths[i].state(end) for i, end in enumerate(ends)]) - finals)[:, :3].max()
    return bool(off <= ASTRAY * np.abs(finals[:, :3]).max(initial=1.0))


def pushing(contacts: Contacts) -> Any:
    """Return the mask (K,) of the contacts with significant multipliers."""
    pushes = contacts.multipliers
    return pushes > WEAK * pushes.sum() / max(len(pushes), 1)


def drifting(contacts: Contacts) -> Any:
    """Return the mask (K,) of the contacts after a loss of thrust."""
    return contacts.drifts.any(axis=1)
