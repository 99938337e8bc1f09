"""What a reconfiguration answers: the paths of a whole formation, or why there are none."""

from dataclasses import dataclass
from math import nan
from typing import Any

from closeform.arrays import Floats
from closeform.motion.path import Path
from closeform.planning.result import Status


@dataclass(frozen=True, eq=False)
class Touch:
    """Where two paths of a plan touch the zone between them.

    `time` [s]; the craft `first` and `second` by index, N + k for obstacle k; the unit `normal` (3,) of
    the zone, pointing from second to first; the `force` [m/s^3] along it, by which the thrust's rate
    jumps: of the first along the normal, of the second against it.  Obstacles do not feel it, nor,
    planned one after another, does the second.
    """

    time: float
    first: int
    second: int
    normal: Floats
    force: float


@dataclass(frozen=True, eq=False)
class Plan:
    """The paths of N craft from their initial to their final states, or why there are none.

    `paths`: shape (N,), from the earliest start to the latest end, coasting outside of the craft's
    own time; every pair is certified clear (None where not `ok`).  `direct`: the unconstrained
    optima over the same times.  `slots` (N,): the final state that each craft flies to.  `starts`
    and `durations` (N,) [s] as flown, which differ from those asked for where `measures` says so:
    what was tried openly, in order.  `energy` [m^2/s^3] and `delta_v` [m/s] are totals (nan where
    not ok), each craft's are those of its path; `lower_bound` [m^2/s^3] is the sum of the unconstrained
    optima, which no plan over these times (and, where craft were assigned to slots, no other assignment)
    can beat.  `touches` in order of time.  `proven`: the energy is proven the global optimum for
    these slots and times; otherwise it is the best of the `tried` ways.  `status` says how it ended,
    `reason` in words, and `blocked` the two craft that stand in the way (N + k for obstacle k).
    """

    paths: Path | None
    direct: Path
    slots: Any
    starts: Floats
    durations: Floats
    energy: float
    delta_v: float
    lower_bound: float
    touches: tuple[Touch, ...]
    status: Status
    reason: str
    blocked: tuple[int, int] | None = None
    measures: tuple[str, ...] = ()
    proven: bool = False
    tried: int = 0

    @property
    def ok(self) -> bool:
        """Whether `paths` are clear paths."""
        return self.status in (Status.CLEAR, Status.AVOIDED)

    @property
    def gap(self) -> float:
        """By how much the energy exceeds the lower bound, as a share of it; nan where not ok."""
        if not self.lower_bound > 0.0:
            return 0.0 if self.energy == self.lower_bound else nan
        return self.energy / self.lower_bound - 1.0
