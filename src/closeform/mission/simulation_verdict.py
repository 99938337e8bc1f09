"""Verdict of the simulation of a run in its high-fidelity model, or of the prediction without a simulation.

Without a high-fidelity model, the module estimates the model error of Hill's equations and compares it with
the minimum distance from a keep-out zone.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import inf, nan, pi
from typing import TYPE_CHECKING, Any

import numpy as np

from closeform.arrays import Floats
from closeform.confidence import estimate
from closeform.dynamics.model_error_estimate import COASTS, MOVES, model_error
from closeform.mission.verdict import (
    MET,
    NOT_MET,
    SAMPLED,
    Asked,
    Use,
    ZoneDistance,
    beyond,
    metres,
)
from closeform.motion.elements.mean_motion import EARTH_MU, EARTH_RADIUS, semi_major_axis_from_mean_motion

if TYPE_CHECKING:
    from closeform.dynamics.simulation.validity import Validity
    from closeform.mission.mission_result import Mission, StageResult
    from closeform.mission.simulation import SimulatedRun
    from closeform.motion.orbit import Orbit
    from closeform.scenario import Scenario

LOOKS = 201  # instants of a stage at which distances from the origin are sampled
EARTHLIKE = 1e-3  # relative tolerance of the gravitational parameter for an orbit around the Earth


@dataclass(frozen=True)
class Entered:
    """Number of simulated flights that enter a zone, with the minimum clearance ratio `least`.

    `least` is None without zones.  All simulations are equal unless `uncertain`.  `exceeded` lists the uses
    above a limit in the flight with the highest use; it is None without any limit.
    """

    count: int
    flights: int
    least: float | None
    uncertain: bool
    exceeded: tuple[Use, ...] | None = None

    @property
    def clear(self) -> bool:
        """True if no zone is entered in any simulation."""
        return self.count == 0

    @property
    def ok(self) -> bool:
        """True if no zone is entered in any simulation and every limit is kept."""
        return self.clear and not self.exceeded

    @property
    def status(self) -> int:
        """Exit status of the command."""
        return MET if self.ok else NOT_MET

    @property
    def many(self) -> str:
        """Text with the number of flights."""
        return f"{self.flights} simulation{'s' * (self.flights != 1)}"

    @property
    def asked(self) -> Asked:
        """Requirement of the run that no flight enters a zone, and whether it is met."""
        if self.least is None:
            return Asked(f"{self.many}, without zones", "", True, inf, "flight")
        if self.flights == 1:
            kept, broken = "no zone is entered in simulation", "a zone is entered in simulation"
        else:
            kept = f"no zone is entered in {self.many}"
            broken = f"zones are entered in {self.count} of {self.many}"
        least = f", minimum {self.least:.4f} x zone"
        return Asked(kept + least, broken + least, self.clear, self.least - 1.0, "flight")

    @property
    def zones(self) -> str:
        """Text that states the number of flights in which zones are entered."""
        if self.least is None:
            return f"{self.many}, without zones"
        found = (
            "clear: no zone is entered in"
            if self.clear
            else f"violated: zones are entered in {self.count} of"
        )
        likely = str(estimate(self.count, self.flights)) if self.uncertain else "nothing is uncertain"
        return f"{found} {self.many} ({likely}), minimum {self.least:.4f} x zone"

    def __str__(self) -> str:
        if self.exceeded is None:
            return self.zones
        if not self.exceeded:
            return f"{self.zones}; limits are kept"
        return f"{self.zones}; limits are not kept: {beyond(self.exceeded)}"


def in_flight(flights: "SimulatedRun | None", grounded: str | None) -> tuple[Asked, ...]:
    """Return the requirement on a requested simulation; `grounded` is the reason why it is impossible."""
    if grounded is not None:
        return (Asked("", f"cannot be simulated: {grounded}", False, 0.0, "flight"),)
    return () if flights is None else (flights.entered.asked,)


def predicted(mission: "Mission") -> float | None:
    """Return the minimum predicted clearance ratio of pairs that are clear as planned; None without any.

    The prediction applies the planned thrust in the high-fidelity model.
    """
    return min(
        (float(found.simulated[k]) for _, found, clear in foreseen(mission) for k in clear), default=None
    )


def eaten(mission: "Mission") -> Iterator[str]:
    """Yield a warning for each stage whose planned thrust, in the high-fidelity model, causes a conflict.

    Pairs with a planned conflict are not considered.
    """
    for result, found, clear in foreseen(mission):
        entered = [k for k in clear if found.simulated[k] < 1.0 - SAMPLED]
        if entered:
            first, second = found.pairs[min(entered, key=lambda k: float(found.simulated[k]))].tolist()
            names, more = result.after.names, f" and {len(entered) - 1} more" * (len(entered) > 1)
            where = (
                f"stage {result.number}: without compensation, in the high-fidelity model ({found.field}),"
            )
            pair = f"{names[first]} and {names[second]}{more}"
            remedy = 'add [simulation] to compensate, and margin = "auto" for errors'
            yield f"{where} {pair} enter zones that the plan keeps; {remedy}"


@dataclass(frozen=True)
class Neglected:
    """Orbit around the Earth for which the model error of Hill's equations can be estimated.

    `radius` is in m and `period` in s.  In a model that includes the eccentricity, the radius is the
    semi-latus rectum, because only oblateness and curvature remain.  `eccentricity` is None if it is unknown.
    """

    radius: float
    eccentricity: float | None
    period: float

    @classmethod
    def on(cls, orbit: "Orbit", scenario: "Scenario") -> "Neglected | None":
        """Return the orbit of a scenario without a high-fidelity model.

        Return None with such a model, with J2, in deep space and around other bodies.
        """
        if scenario.orbit.model == "j2":
            return None
        n, chief = 2.0 * pi / orbit.period, scenario.chief
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
        e = None if chief is None else chief.eccentricity
        if scenario.orbit.model == "kepler" and e is not None:
            radius, e = radius * (1.0 - e**2), 0.0
        return cls(radius, e, orbit.period)

    def error(self, reach: Any, time: Any, craft: int, kind: str = COASTS) -> tuple[Floats, Floats]:
        """Return the model error [m] after a `time` [s] that half, and 95 %, of missions do not exceed.

        `reach` [m] is the maximum distance from the origin up to that time.
        """
        return model_error(reach, time / self.period, self.radius, self.eccentricity, craft, kind)


def mission_error(mission: "Mission") -> tuple[Neglected, float, float] | None:
    """Return the orbit for the estimate, and the model error [m] as its 50 % and 95 % quantiles.

    Return None if the model error is unknown.
    """
    neglected, executed = Neglected.on(mission.orbit, mission.scenario), mission.executed
    if neglected is None or not executed:
        return None
    looks = [(one.after.paths, np.linspace(one.start, one.end, LOOKS)) for one in executed]
    reach = max(float(np.linalg.norm(paths.position(times), axis=-1).max()) for paths, times in looks)
    alone = len(executed) == 1 and bool(mission.paths.delta_v.any())
    kind = MOVES if alone else COASTS
    half, most = neglected.error(reach, executed[-1].end, len(mission.scenario.craft), kind)
    return neglected, float(half), float(most)


def asked_of(mission: "Mission", result: "StageResult[Any, Any]") -> Iterator[Asked]:
    """Yield the requirements of a stage, in doubt if the model error exceeds the slack of a met one."""
    errors: dict[str, float] = {}
    why = ""
    if (found := result.validity) is not None:
        far, fast = np.linalg.norm(found.deviations.reshape(-1, 2, 3), axis=-1).max(axis=0).tolist()
        errors, why = {"m": far, "m/s": fast}, f"predicted deviation {metres(far)} in {found.field}"
    elif any(one.unit == "m" for one in result.asked) and (error := mission_error(mission)) is not None:
        errors, why = {"m": error[2]}, f"model error (95th percentile {metres(error[2])})"
    for one in result.asked:
        exceeded = one.met and errors.get(one.unit, 0.0) > one.slack and mission.flights is None
        yield replace(one, doubt=f"not shown: {one.kept}, but the {why} exceeds it") if exceeded else one


def zone_distance(mission: "Mission") -> ZoneDistance | None:
    """Return the minimum distance of a pair from its zone, with the model error.

    Return None without zones, and with a high-fidelity model, in which the distance is predicted.
    """
    near = [one for result in mission.executed for one in result.after.approaches]
    if not near or mission.flights is not None or mission.scenario.orbit.field is not None:
        return None
    inner = {zone: zone.inner_radius for zone in {one.zone for one in near}}
    spare = [max(one.ratio - 1.0, 0.0) * inner[one.zone] for one in near]  # lower bound in any direction
    k = int(np.argmin(spare))
    ends = {end for result in mission.executed for end in (result.start, result.end)}
    inside = min(abs(near[k].time - end) for end in ends) > 1e-6 * max(
        ends
    )  # a margin does not move the ends
    enlarges = inside and any(hasattr(stage, "margin") for stage in mission.scenario.stages)
    _, half, most = mission_error(mission) or (None, nan, nan)
    table = mission.scenario.orbit
    remedy = "add a field" if table.chief is not None else "add epoch, chief and field to [orbit]"
    remedy = 'use model = "j2"' if table.model == "kepler" else remedy
    return ZoneDistance(float(spare[k]), (near[k].first, near[k].second), half, most, enlarges, remedy)


def foreseen(mission: "Mission") -> Iterator[tuple["StageResult[Any, Any]", "Validity", list[int]]]:
    """Yield each stage with a prediction, the prediction, and its rows of pairs that are clear as planned.

    Yield nothing for a simulated mission, because the simulation supersedes the predictions.
    """
    for result in mission.executed if mission.flights is None else ():
        if (found := result.validity) is not None:
            met, names = {(one.first, one.second) for one in result.after.conflicts}, result.after.names
            pairs = [(names[i], names[j]) for i, j in found.pairs.tolist()]
            yield result, found, [k for k, pair in enumerate(pairs) if pair not in met]
