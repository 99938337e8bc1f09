"""A stage as flown, and what was done in it."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from closeform.conflicts.flight import Flight
from closeform.motion.path import Path
from closeform.scenario import StageTable
from closeform.search.gathering import Gathering, who_is_left
from closeform.search.schedule import Search
from closeform.zones.zone import Zone

if TYPE_CHECKING:
    from closeform.planning.avoid import Avoidance
    from closeform.planning.plan import Plan
    from closeform.search.locks import Locks

NAMED = 10  # pairs that are named where more have failed


@dataclass(frozen=True, eq=False)
class Change:
    """What a move changed: the `direct` path of one craft and the way around the others."""

    craft: str
    others: tuple[str, ...]
    zones: tuple[Zone, ...]  # one for each other
    method: str
    direct: Path
    avoidance: "Avoidance"


@dataclass(frozen=True, eq=False)
class Reshaping:
    """What a formation did together by a `plan`: the craft `movers` flew, the `others` coasted.

    The plan counts first those, then these.  `zones` holds each zone with the pairs (M, 2) of craft
    of the scenario for which it holds.  The plan was made by `method`; the craft were asked to arrive
    `asked` [s] after the start of the stage, and `measures` say what was tried beyond that.
    """

    movers: tuple[str, ...]
    others: tuple[str, ...]
    zones: tuple[tuple[Zone, Any], ...]
    method: str
    asked: float
    plan: "Plan"
    measures: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """The craft as the plan counts them."""
        return self.movers + self.others

    @property
    def blocked(self) -> tuple[str, ...]:
        """The two craft that stand in the way, if any."""
        return tuple(self.names[k] for k in self.plan.blocked or ())


@dataclass(frozen=True, eq=False)
class FirstLocks:
    """The first locks of all `pairs` (P, 2) of a craft in group A and one in B, by index.

    `search` begins, and times count, when the stage does.
    """

    search: Search
    pairs: Any
    locks: "Locks"

    @property
    def missing(self) -> Any:
        """The pairs (Q, 2) that never lock."""
        return self.pairs[self.locks.leg < 0]


@dataclass(frozen=True, eq=False)
class Leg:
    """A stage as flown, from `start` to `end` [s]: the flight `before` avoidance and `after` it.

    The times of a Gathering or of FirstLocks count from the start of the stage.
    """

    number: int
    stage: StageTable
    start: float
    end: float
    before: Flight
    after: Flight
    deed: Change | Reshaping | Gathering | FirstLocks | None = None  # None: a coast

    @property
    def name(self) -> str:
        """What the file calls it, or an empty text."""
        return self.stage.name or ""

    @property
    def verb(self) -> str:
        """What stands in `do`."""
        return self.stage.verb

    @property
    def flown(self) -> bool:
        """Whether its paths count: a move without a clear path is not flown."""
        return self.failure is None or not isinstance(self.deed, Change | Reshaping)

    @property
    def late(self) -> str | None:
        """That the stage takes longer than asked for, if it does."""
        if not isinstance(self.deed, Reshaping) or not self.flown:
            return None
        asked, took = self.deed.asked, self.end - self.start
        if took <= asked * (1.0 + 1e-6):
            return None
        return f'stage {self.number} ({self.verb}) takes {took:.1f} s, not {asked:.1f} s; see "Tried"'

    @property
    def failure(self) -> str | None:
        """Why the mission cannot go on after this stage; None where it can."""
        names = self.after.names
        if isinstance(self.deed, Change) and not self.deed.avoidance.ok:
            return self.deed.avoidance.reason
        if isinstance(self.deed, Reshaping) and not self.deed.plan.ok:
            return f"{self.deed.plan.status}: {self.deed.plan.reason}"
        if isinstance(self.deed, Gathering) and not self.deed.ok:
            return who_is_left(self.deed.sets, self.deed.lost, self.deed.rounds, names)
        if isinstance(self.deed, FirstLocks) and len(self.deed.missing):
            shown = [f"{names[i]} - {names[j]}" for i, j in self.deed.missing[:NAMED]]
            more = ", ..." if len(self.deed.missing) > NAMED else ""
            never = f"{len(self.deed.missing)} of {len(self.deed.pairs)} pairs never lock"
            return f"{never}: {', '.join(shown)}{more}"
        return None
