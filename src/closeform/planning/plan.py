"""What a plan answers: certified paths, where they touch, what they cost, or why there are none."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from math import nan
from typing import Any, Literal, TypeVar

from closeform.arrays import Floats
from closeform.motion.path import Path
from closeform.planning.shadow_price import ShadowPrice, prices_of
from closeform.result import Result

Answer = TypeVar("Answer", "Avoidance", "Plan")
Cost = Literal["energy", "delta-v"]
UNITS: dict[Cost, str] = {"energy": "m²/s³", "delta-v": "m/s"}


class Status(StrEnum):
    """How a plan ended.

    - `CLEAR`: the unconstrained optima are in nobody's way; fly them.
    - `AVOIDED`: paths around the zones, certified clear; fly them.
    - `END_INSIDE`: two craft are in conflict where or when neither can give way, at the start or the end;
      move that state or its time.
    - `END_UNSAFE`: without any thrust from a plan's start, or after its end, a craft drifts into a zone, or
      to where another has arrived: no plan between these states is passively safe; move that state, or ask
      for less `drift`.
    - `NOT_FOUND`: none of the candidates was clear, which proves nothing; raise `budget`, or give more time.
    - `TOO_WEAK`: beyond `max_acceleration` for every duration that was allowed; give more thrust or time.
      `weak` says by how much.
    - `NO_MARGIN`: clear, but not by the margin that its own flight in a field needs, in a stage whose margin
      is "auto"; give a length, measure better, or give more time.
    """

    CLEAR = "clear already"
    AVOIDED = "avoided"
    END_INSIDE = "start or end inside a zone"
    END_UNSAFE = "end not passively safe"
    NOT_FOUND = "no clear path found"
    TOO_WEAK = "thrust limit exceeded"
    NO_MARGIN = "no margin fits"


@dataclass(frozen=True, eq=False, repr=False)
class Contact(Result):
    """Where two paths of a plan touch the zone between them.

    Attributes
    ----------
    time : float [s]
        Of the touch.
    first, second : int
        The two craft by index; N + k is obstacle k of a plan of N craft.
    position : array of shape (3,) [m]
        The first's, in the rotating frame.
    normal : array of shape (3,), no unit
        Of the zone, of length 1, pointing from second to first, in the rotating frame.
    multiplier : float [m/s^3]
        A jump of the thrust's rate: of the first along the normal, of the second against it.  For a single
        contact it is twice the extra energy per metre of push.  Obstacles do not feel it, nor, planned one
        after another, does the second.
    reach : float [m]
        How far the zone reaches along the normal: so far beyond the second the first is, but for the margin.
    failed_at : float [s]
        When the first lost its thrust, if it touches only then, drifting since; nan: it is under way as
        planned.  It feels the force as its thrust stops, carried back there by natural motion.
    sigma : float [m]
        Standard deviation, along the normal, of where the two are to each other; so many of it as were asked
        for are kept beyond `reach`.  0 where no errors were given.
    """

    time: float
    first: int
    second: int
    position: Floats
    normal: Floats
    multiplier: float
    reach: float
    failed_at: float = nan
    sigma: float = 0.0


@dataclass(frozen=True, repr=False)
class ThrustShortfall(Result):
    """The craft that misses its thrust limit by most.

    Attributes
    ----------
    craft : int
        By index.
    needed : float [m/s^2]
        Peak thrust in the duration that was tried last; of a plan of least delta-v a limit that is enough.
    limit : float [m/s^2]
        What is allowed.
    duration : float [s]
        That was tried last.
    remedy : str
        What would help, in words.
    shortest : float [s]
        Duration that was tried first; the same where no longer one was.
    first : float [m/s^2]
        Peak thrust in that.
    proven : float [m/s^2]
        It is proven that less than this does not do, in the duration that was tried last; 0 where nothing is.
    """

    craft: int
    needed: float
    limit: float
    duration: float
    remedy: str
    shortest: float
    first: float
    proven: float = 0.0


def weakness(weak: ThrustShortfall, name: str, mass: float | None = None) -> str:
    """The same in words: in m/s^2, or in newtons for a craft of `mass` [kg]."""
    size, unit, has = (1.0, "m/s²", "its limit is") if mass is None else (mass, "N", "its max_thrust is")
    tried = ""
    if weak.duration > weak.shortest:
        tried = f"no longer is tried, and {weak.shortest:.6g} s take {size * weak.first:.4g} {unit}: "
    least = f", and at least {size * weak.proven:.4g} {unit} by proof" if weak.proven else ""
    return (
        f"{name} needs {size * weak.needed:.4g} {unit} in {weak.duration:.6g} s{least}, "
        f"{has} {size * weak.limit:.4g} {unit}; {tried}{weak.remedy}"
    )


class Costed(Result):
    """What the answers for one craft and for many have in common."""

    status: Status
    energy: float
    delta_v: float
    lower_bound: float
    contacts: tuple[Contact, ...]
    clearance_ratio: float
    cost: Cost
    priced: bool

    @property
    def ok(self) -> bool:
        """Whether there are clear paths."""
        return self.status in (Status.CLEAR, Status.AVOIDED)

    @property
    def spent(self) -> float:
        """What is least: the energy [m^2/s^3] or delta-v [m/s], by `cost`; nan where not ok."""
        return self.delta_v if self.cost == "delta-v" else self.energy

    @property
    def gap(self) -> float:
        """By how much the cost exceeds the lower bound, as a share of it, no unit; nan where not ok."""
        return gap(self.spent, self.lower_bound)

    @property
    def prices(self) -> tuple[ShadowPrice, ...]:
        """What more clearance costs: a ShadowPrice for each pair in contact, the dearest by the metre first.

        None where not `priced`.  Where the least cost has a kink, as at an edge or that of impulses may, the
        slopes for more and for less clearance differ: it is that for more, of impulses one between them.
        """
        return prices_of(self.contacts, self.clearance_ratio) if self.priced else ()

    @property
    def price(self) -> float:
        """What a metre more of all zones costs [m/s^3, of delta-v 1/s]; nan where not ok or not `priced`."""
        return sum((one.per_metre for one in self.prices), 0.0) if self.ok and self.priced else nan


@dataclass(frozen=True, eq=False, repr=False)
class Avoidance(Costed):
    """A path around obstacles, or why there is none.

    Attributes
    ----------
    path : Path or None
        Certified clear of every zone; None where not `ok`.
    energy : float [m^2/s^3]
        Half the integral of |thrust|^2 of the path; nan where not ok.
    extra_energy : float [m^2/s^3]
        Beyond that of the unconstrained optimum between its end states; nan where not ok.
    delta_v : float [m/s]
        Of the path; nan where not ok.  Planned for thrusters it is what they spend together: where several
        fire at once more than the path's, whose impulses are their sums.
    lower_bound : float [m^2/s^3, or m/s of delta-v]
        No clear path between these states and times has less energy.
    contacts : tuple of Contact
        In order of time; the craft is 0, obstacle k is k + 1.
    status : Status
        How it ended.
    reason : str
        The same in words.
    clearance_ratio : float, no unit
        For which the path was made: with zones so many times as large.
    proven : bool
        Whether the energy is the lower bound, to rounding; else the path is the best of those tried.
    tried : int
        How many candidates were examined.
    measures : tuple of str
        What was done to keep a thrust limit.
    weak : ThrustShortfall or None
        By how much a thrust limit is missed.
    punctual : float or None [m/s^2]
        Peak thrust of a clear path over the duration asked for, where that is beyond the limit: with it the
        path would take no longer.
    cost : "energy" or "delta-v"
        What is least: `lower_bound`, `proven` and `gap` are of it, in m/s of delta-v.  With "delta-v" the
        path has impulses, its energy is inf, and multipliers of contacts are delta-v per metre of push
        [1/s].
    priced : bool
        Whether multipliers of contacts are the slopes of what is least, as `prices` need them: not by
        "sauter-palmer", nor of a path of least energy where delta-v was asked for.
    drift : float or None [s]
        Whenever thrust is lost the craft stays clear until so long after the path's end, certified; None: not
        asked for.
    sigmas : float, no unit
        How many standard deviations of all errors are kept clear, certified; 0: of nobody errors were given.
    padding : float or array of shape (1 + M, 1 + M) [m]
        What was asked for as `margin`: certified clear are zones that are padded by so much, and with them
        the zones themselves.  Contacts are with those.
    """

    path: Path | None
    energy: float
    extra_energy: float
    delta_v: float
    lower_bound: float
    contacts: tuple[Contact, ...]
    status: Status
    reason: str
    clearance_ratio: float = 1.0
    proven: bool = False
    tried: int = 0
    measures: tuple[str, ...] = ()
    weak: ThrustShortfall | None = None
    punctual: float | None = None
    cost: Cost = "energy"
    priced: bool = True
    drift: float | None = None
    sigmas: float = 0.0
    padding: Any = 0.0


@dataclass(frozen=True, eq=False, repr=False)
class Plan(Costed):
    """The paths of N craft from their initial to their final states, or why there are none.

    Attributes
    ----------
    paths : Path or None
        Of shape (N,), from the earliest start to the latest end, coasting outside of the craft's own time;
        every pair is certified clear.  None where not `ok`.
    direct : Path
        The unconstrained optima over the same times.
    slots : array of int of shape (N,)
        The final state that each craft flies to.
    starts, durations : array of shape (N,) [s]
        As flown, which differ from those asked for where `measures` says so.
    energy : float [m^2/s^3]
        Half the integral of |thrust|^2, of all craft; nan where not ok.
    delta_v : float [m/s]
        Of all craft; nan where not ok.  Planned for thrusters it is what they spend together, as of an
        `Avoidance`.
    lower_bound : float [m^2/s^3, or m/s of delta-v]
        No clear plan over these times has less energy, nor, where craft were assigned to slots, has any
        other assignment.
    contacts : tuple of Contact
        In order of time.
    status : Status
        How it ended.
    reason : str
        The same in words.
    blocked : tuple of int, or None
        The two craft that stand in the way, N + k for obstacle k.
    measures : tuple of str
        What was tried openly, in order.
    clearance_ratio : float, no unit
        For which the plan was made: with zones so many times as large.
    proven : bool
        Whether the energy is proven the least for these slots and times; else the plan is the best of
        those tried.
    tried : int
        How many candidates were examined.
    weak : ThrustShortfall or None
        Who misses its thrust limit, and by how much.
    punctual : array of shape (N,), or None [m/s^2]
        Peak thrusts of a clear plan over the durations asked for, where they are beyond a limit: with these
        none would take longer.
    cost : "energy" or "delta-v"
        What is least, as of an `Avoidance`.
    priced : bool
        As of an `Avoidance`; not of craft that planned one after another.
    drift : float or None [s]
        Whenever a craft loses its thrust, and the others fly on, it stays clear until so long after the
        plan's end, certified; None: not asked for.
    sigmas : float, no unit
        As of an `Avoidance`.
    padding : float or array of shape (N + M, N + M) [m]
        As of an `Avoidance`.
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
    clearance_ratio: float = 1.0
    proven: bool = False
    tried: int = 0
    weak: ThrustShortfall | None = None
    punctual: Floats | None = None
    cost: Cost = "energy"
    priced: bool = True
    drift: float | None = None
    sigmas: float = 0.0
    padding: Any = 0.0

    @property
    def extra_energy(self) -> float:
        """What the plan costs beyond the unconstrained optima [m^2/s^3]; nan where not ok."""
        return self.energy - float(self.direct.energy.sum())


def too_weak(plan: Answer, weak: ThrustShortfall, name: str) -> Answer:
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
