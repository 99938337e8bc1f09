"""What a plan answers: certified paths, where they touch, what they cost, or why there are none."""

from dataclasses import dataclass, replace
from enum import StrEnum
from math import nan
from typing import Any, TypeVar

from closeform.arrays import Floats
from closeform.motion.path import Path

Answer = TypeVar("Answer", "Avoidance", "Plan")


class Status(StrEnum):
    """How a plan ended.

    - `CLEAR`: the unconstrained optima are in nobody's way; fly them.
    - `AVOIDED`: paths around the zones, certified clear; fly them.
    - `END_INSIDE`: two craft are in conflict where or when neither can give way, at the start or the end;
      move that state or its time.
    - `NOT_FOUND`: none of the candidates was clear, which proves nothing; raise `budget`, or give more time.
    - `TOO_WEAK`: beyond `max_acceleration` for every duration that was allowed; give more thrust or time.
      `weak` says by how much.
    """

    CLEAR = "clear already"
    AVOIDED = "avoided"
    END_INSIDE = "end inside a zone"
    NOT_FOUND = "no clear path found"
    TOO_WEAK = "thrust limit exceeded"


@dataclass(frozen=True, eq=False)
class Contact:
    """Where two paths of a plan touch the zone between them.

    `time` [s]; the craft `first` and `second` by index, N + k for obstacle k of a plan of N craft; the
    first's `position` (3,) [m]; the unit `normal` (3,) of the zone, pointing from second to first; the
    `multiplier` [m/s^3] along it, a jump of the thrust's rate: of the first along the normal, of the
    second against it, and twice the extra energy per metre of push for a single contact.  Obstacles do
    not feel it, nor, planned one after another, does the second.
    """

    time: float
    first: int
    second: int
    position: Floats
    normal: Floats
    multiplier: float


@dataclass(frozen=True)
class TooWeak:
    """The `craft`, by index, that misses its thrust limit by most, and the `remedy` in words.

    It would need `needed` [m/s^2], where `limit` [m/s^2] is allowed, in the `duration` [s] that was tried
    last; in the `shortest` [s] that was tried, which is the same where no longer one was, `first` [m/s^2].
    """

    craft: int
    needed: float
    limit: float
    duration: float
    remedy: str
    shortest: float
    first: float


def weakness(weak: TooWeak, name: str, mass: float | None = None) -> str:
    """The same in words: in m/s^2, or in newtons for a craft of `mass` [kg]."""
    size, unit, has = (1.0, "m/s²", "its limit is") if mass is None else (mass, "N", "its max_thrust is")
    needs = f"{name} needs {size * weak.needed:.4g} {unit} in {weak.duration:.6g} s"
    if weak.duration > weak.shortest:
        needs += f", the longest tried, and {size * weak.first:.4g} {unit} in {weak.shortest:.6g} s"
    return f"{needs}, {has} {size * weak.limit:.4g} {unit}; {weak.remedy}"


@dataclass(frozen=True, eq=False)
class Avoidance:
    """A path around obstacles, or why there is none.

    `path` is certified clear of every zone (None where not `ok`); `energy` [m^2/s^3] and
    `delta_v` [m/s] are its own, `extra_energy` what it costs beyond the unconstrained optimum
    between its end states (nan where not ok).  No clear path between these states and times has less
    energy than `lower_bound` [m^2/s^3]; `proven`: it is the energy itself, to rounding.  Otherwise the
    path is the best of the `tried` candidates.  `contacts` are in order of time; the craft is 0,
    obstacle k is k + 1.  The path was made for zones `margin` times as large.  `status` says how it
    ended, and `reason` in words; `measures`: what was done to keep a thrust limit, and `weak` by how
    much it was missed.  `punctual` [m/s^2]: the peak thrust of a clear path over the duration asked
    for, where that is beyond the limit; with it the path would take no longer.
    """

    path: Path | None
    energy: float
    extra_energy: float
    delta_v: float
    lower_bound: float
    contacts: tuple[Contact, ...]
    status: Status
    reason: str
    margin: float = 1.0
    proven: bool = False
    tried: int = 0
    measures: tuple[str, ...] = ()
    weak: TooWeak | None = None
    punctual: float | None = None

    @property
    def ok(self) -> bool:
        """Whether `path` is a clear path."""
        return self.status in (Status.CLEAR, Status.AVOIDED)

    @property
    def gap(self) -> float:
        """By how much the energy exceeds the lower bound, as a share of it; nan where not ok."""
        return gap(self.energy, self.lower_bound)


@dataclass(frozen=True, eq=False)
class Plan:
    """The paths of N craft from their initial to their final states, or why there are none.

    `paths`: shape (N,), from the earliest start to the latest end, coasting outside of the craft's
    own time; every pair is certified clear (None where not `ok`).  `direct`: the unconstrained
    optima over the same times.  `slots` (N,): the final state that each craft flies to.  `starts`
    and `durations` (N,) [s] as flown, which differ from those asked for where `measures` says so:
    what was tried openly, in order.  `energy` [m^2/s^3] and `delta_v` [m/s] are totals (nan where
    not ok), each craft's are those of its path; no clear plan over these times (and, where craft were
    assigned to slots, no other assignment) has less energy than `lower_bound` [m^2/s^3].  `contacts` in order
    of time.  The plan was made for zones `margin` times as large.  `proven`: the energy is proven the global
    optimum for these slots and times; otherwise it is the best of the `tried` candidates.  `status` says how
    it ended, `reason` in words, `blocked` the two craft that stand in the way (N + k for obstacle k), and
    `weak` who misses its thrust limit, and by how much.  `punctual` (N,) [m/s^2]: the peak thrusts of a clear
    plan over the durations asked for, where they are beyond a limit; with these none would take longer.
    """

    paths: Path | None
    direct: Path
    slots: Any
    starts: Floats
    durations: Floats
    energy: float
    delta_v: float
    lower_bound: float
    contacts: tuple[Contact, ...]
    status: Status
    reason: str
    blocked: tuple[int, int] | None = None
    measures: tuple[str, ...] = ()
    margin: float = 1.0
    proven: bool = False
    tried: int = 0
    weak: TooWeak | None = None
    punctual: Floats | None = None

    @property
    def ok(self) -> bool:
        """Whether `paths` are clear paths."""
        return self.status in (Status.CLEAR, Status.AVOIDED)

    @property
    def extra_energy(self) -> float:
        """What the plan costs beyond the unconstrained optima [m^2/s^3]; nan where not ok."""
        return self.energy - float(self.direct.energy.sum())

    @property
    def gap(self) -> float:
        """By how much the energy exceeds the lower bound, as a share of it; nan where not ok."""
        return gap(self.energy, self.lower_bound)


def too_weak(plan: Answer, weak: TooWeak, name: str) -> Answer:
    """The same without paths, for want of thrust of the craft `name`."""
    paths: dict[str, Any] = (
        {"path": None, "extra_energy": nan} if isinstance(plan, Avoidance) else {"paths": None}
    )
    none = replace(plan, **paths, energy=nan, delta_v=nan, contacts=(), proven=False)
    return replace(none, status=Status.TOO_WEAK, reason=weakness(weak, name), weak=weak)


def gap(energy: float, bound: float) -> float:
    """By how much an energy exceeds its lower bound, as a share of it."""
    if not bound > 0.0:
        return 0.0 if energy == bound else nan
    return energy / bound - 1.0
