"""What flights in a field have come to, or would: who enters a zone, whose limits are kept; why none are.

Without a field: how large the model error of Hill's equations is, estimated, and which margin is beside it.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import inf, pi
from typing import TYPE_CHECKING, Any

import numpy as np

from closeform.arrays import Floats
from closeform.confidence import estimate
from closeform.dynamics.model_error_estimate import COASTS, MOVES, model_error
from closeform.mission.verdict import MET, NOT_MET, SAMPLED, Asked, Margin, Use, beyond
from closeform.motion.mean_motion import EARTH_MU, EARTH_RADIUS, semi_major_axis_from_mean_motion

if TYPE_CHECKING:
    from closeform.dynamics.validity import Validity
    from closeform.mission.mission_result import Mission, StageResult
    from closeform.mission.simulation import FlownRun
    from closeform.motion.orbit import Orbit
    from closeform.scenario import Scenario

LOOKS = 201  # instants of a stage at which it is asked how far out craft are
EARTHLIKE = 1e-3  # of the gravitational parameter


@dataclass(frozen=True)
class Entered:
    """How many flights in a field enter a zone, `least` ratio (None without); alike unless `uncertain`.

    `exceeded`: who spends more than there is in the dearest flight, None without any limit.
    """

    count: int
    flights: int
    least: float | None
    uncertain: bool
    exceeded: tuple[Use, ...] | None = None

    @property
    def clear(self) -> bool:
        """Whether none does."""
        return self.count == 0

    @property
    def ok(self) -> bool:
        """Whether none does, and every limit is kept."""
        return self.clear and not self.exceeded

    @property
    def status(self) -> int:
        """The exit status."""
        return MET if self.ok else NOT_MET

    @property
    def many(self) -> str:
        """The flights in words."""
        return f"{self.flights} flight{'s' * (self.flights != 1)}"

    @property
    def asked(self) -> Asked:
        """The same as part of what a run comes to."""
        if self.least is None:
            return Asked(f"{self.many} flown, there is no zone to enter", "", True, inf, "flight")
        if self.flights == 1:
            kept, broken = "no zone is entered in flight", "a zone is entered in flight"
        else:
            kept = f"no zone is entered in {self.many}"
            broken = f"zones are entered in {self.count} of {self.many}"
        least = f", least {self.least:.4f} x zone"
        return Asked(kept + least, broken + least, self.clear, self.least - 1.0, "flight")

    @property
    def zones(self) -> str:
        """Whether zones are entered, in words."""
        if self.least is None:
            return f"flown: {self.many}, there is no zone to enter"
        found = (
            "clear: no zone is entered in"
            if self.clear
            else f"violated: zones are entered in {self.count} of"
        )
        likely = str(estimate(self.count, self.flights)) if self.uncertain else "nothing is uncertain"
        return f"{found} {self.many} ({likely}), least {self.least:.4f} x zone"

    def __str__(self) -> str:
        if self.exceeded is None:
            return self.zones
        if not self.exceeded:
            return f"{self.zones}; limits are kept"
        return f"{self.zones}; limits are not kept: {beyond(self.exceeded)}"


def in_flight(flights: "FlownRun | None", grounded: str | None) -> tuple[Asked, ...]:
    """What flights that were asked for come to as part of a run; or why it is `grounded`."""
    if grounded is not None:
        return (Asked("", f"cannot be flown: {grounded}", False, 0.0, "flight"),)
    return () if flights is None else (flights.entered.asked,)


def predicted(mission: "Mission") -> float | None:
    """The least ratio in a field, flown as planned, of pairs that are clear as planned; None without any."""
    return min((float(found.flown[k]) for _, found, clear in foreseen(mission) for k in clear), default=None)


def eaten(mission: "Mission") -> Iterator[str]:
    """Of stages in a field: pairs that are clear as planned, and not where thrust is played as planned."""
    for result, found, clear in foreseen(mission):
        entered = [k for k in clear if found.flown[k] < 1.0 - SAMPLED]
        if entered:
            first, second = found.pairs[min(entered, key=lambda k: float(found.flown[k]))].tolist()
            names, more = result.after.names, f" and {len(entered) - 1} more" * (len(entered) > 1)
            where = f"stage {result.number}: flown as planned, in the field of {found.field},"
            pair = f"{names[first]} and {names[second]}{more}"
            remedy = 'add [simulation] to correct thrust for it, and margin = "auto" for errors'
            yield f"{where} leads {pair} into zones that the plan keeps; {remedy}"


@dataclass(frozen=True)
class Neglected:
    """What Hill's equations neglect on an orbit around the Earth; its e is None where it is not known."""

    semi_major_axis: float
    eccentricity: float | None
    period: float

    @classmethod
    def on(cls, orbit: "Orbit", scenario: "Scenario") -> "Neglected | None":
        """The same of a scenario without a field; None with one, in deep space and around other bodies."""
        n, chief = orbit.mean_motion, scenario.chief
        mu = chief.mu if chief is not None else scenario.orbit.mu or EARTH_MU
        if (
            not n
            or scenario.orbit.field is not None
            or (chief is not None and chief.center.upper() != "EARTH")
        ):
            return None
        radius = float(semi_major_axis_from_mean_motion(n, mu))
        if abs(mu / EARTH_MU - 1.0) > EARTHLIKE or radius < EARTH_RADIUS:
            return None
        return cls(radius, None if chief is None else chief.eccentricity, 2.0 * pi / n)

    def error(self, reach: Any, time: Any, craft: int, kind: str = COASTS) -> tuple[Floats, Floats]:
        """The model error [m] after some time [s] that half, and 95 %, of missions do not exceed."""
        return model_error(reach, time / self.period, self.semi_major_axis, self.eccentricity, craft, kind)


def mission_error(mission: "Mission") -> tuple[Neglected, float, float] | None:
    """What is neglected in a mission, and its model error: of half, and of 95 % of missions at most [m]."""
    neglected, flown = Neglected.on(mission.orbit, mission.scenario), mission.flown
    if neglected is None or not flown:
        return None
    looks = [(one.after.paths, np.linspace(one.start, one.end, LOOKS)) for one in flown]
    reach = max(float(np.linalg.norm(paths.position(times), axis=-1).max()) for paths, times in looks)
    alone = len(flown) == 1 and bool(mission.paths.delta_v.any())
    kind = MOVES if alone else COASTS
    half, most = neglected.error(reach, flown[-1].end, len(mission.scenario.craft), kind)
    return neglected, float(half), float(most)


def least_margin(mission: "Mission") -> Margin | None:
    """The least distance of a pair to its zone, beside the model error; None where that is not known."""
    error = mission_error(mission)
    near = [one for result in mission.flown for one in result.after.approaches]
    if error is None or not near or mission.flights is not None:
        return None
    inner = {zone: zone.inner_radius for zone in {one.zone for one in near}}
    spare = [max(one.ratio - 1.0, 0.0) * inner[one.zone] for one in near]  # at least so much, to any side
    k = int(np.argmin(spare))
    planned = any(hasattr(stage, "margin") for stage in mission.scenario.stages)
    return Margin(float(spare[k]), (near[k].first, near[k].second), *error[1:], planned)


def foreseen(mission: "Mission") -> Iterator[tuple["StageResult[Any, Any]", "Validity", list[int]]]:
    """Stages whose field predicts something, and what: with the rows of pairs that are clear as planned.

    None where flights say what becomes of them.
    """
    for result in mission.flown if mission.flights is None else ():
        if (found := result.validity) is not None:
            met, names = {(one.first, one.second) for one in result.after.conflicts}, result.after.names
            pairs = [(names[i], names[j]) for i, j in found.pairs.tolist()]
            yield result, found, [k for k, pair in enumerate(pairs) if pair not in met]
