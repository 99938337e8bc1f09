"""What Hill's equations leave out of a mission: as predicted in a field, or by rule for its altitude."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite, pi
from typing import Any

import numpy as np

from closeform.field.rule import HALF, MOST, ends_off, flattening_at
from closeform.mission_result import Mission, StageResult
from closeform.motion.mean_motion import EARTH_MU, EARTH_RADIUS, semi_major_axis_from_mean_motion
from closeform.report.model import Reach
from closeform.report.section import plan_of

EARTHLIKE = 1e-3  # of the gravitational parameter


def lines(mission: Mission, result: StageResult[Any, Any]) -> tuple[str, ...]:
    """What becomes of a stage in its field, before anything is said of its plan."""
    if result.validity is None:
        unflown = mission.scenario.field is not None and not result.flown
        return ("In the field: not predicted, since these paths are not flown",) * unflown
    from closeform.field.validity import in_words  # whose kernels most runs can spare

    return in_words(result.validity, result.after.names)


def margin(result: StageResult[Any, Any]) -> tuple[str, ...]:
    """What a plan keeps beyond zones."""
    asked = getattr(result.stage, "margin", None)
    plan = plan_of(result)
    if not asked or plan is None:
        return ()
    why = ", for what feedback leaves uncorrected in flight" if asked == "auto" else ""
    padded = np.unique(np.asarray(plan.padding))
    least, most = (f"{one:.3g}" for one in (padded[padded > 0.0].min(initial=np.inf), padded[-1]))
    of = f"{most} m" if float(least) >= float(most) else f"{least} to {most} m, by pair"
    return (f"Margin: zones are padded by {of}{why}",)


def figures(result: StageResult[Any, Any]) -> dict[str, Any]:
    """The same for `summary.json`."""
    found, names, plan = result.validity, result.after.names, plan_of(result)
    asked = getattr(result.stage, "margin", None)
    kept = {} if not asked or plan is None else {"margin_m": float(np.max(plan.padding))}
    if found is None:
        return kept
    return kept | {
        "in_field": {
            "field": found.field,
            "ends_m": dict(zip(names, found.ends.tolist(), strict=True)),
            "expected_m": dict(zip(names, found.expected.tolist(), strict=True)),
            "unlikely_m": dict(zip(names, found.unlikely.tolist(), strict=True)),
            "residual_m_s2": dict(zip(names, found.residual.tolist(), strict=True)),
            "least_ratio": float(found.flown.min(initial=np.inf)),
            "planned_ratio": float(found.planned.min(initial=np.inf)),
        }
    }


@dataclass(frozen=True)
class ByRule:
    """How far off craft end by rule: half of all missions by `expected`, 95 % by less than `unlikely` [m].

    How far off each cause leads at most, in one orbit, is told with the limits of the model.
    """

    altitude: float
    eccentricity: float | None
    expected: float
    unlikely: float

    @property
    def line(self) -> str:
        """The same in words."""
        where = f"at {self.altitude / 1e3:.0f} km"
        if self.eccentricity is not None:
            where += f", e = {self.eccentricity:.5f}"
        likely = f"about {self.expected:.2g} m at the end, 95 % within {self.unlikely:.2g} m (rule of thumb)"
        return f"Left out by Hill's equations {where}: {likely}"

    @property
    def figures(self) -> dict[str, Any]:
        """The same for `summary.json`."""
        return {
            "altitude_m": self.altitude,
            "eccentricity": self.eccentricity,
            "expected_m": self.expected,
            "unlikely_m": self.unlikely,
        }


def by_rule(mission: Mission) -> ByRule | None:
    """The rule for a mission around the Earth that has no field; None for others."""
    flown = [result for result in mission.results if result.flown]
    radius = _earths_radius(mission)
    if not flown or radius is None or mission.scenario.orbit.field is not None:
        return None
    half, most = (_off(mission, flown, flown[-1].end, radius, rule) for rule in (HALF, MOST))
    chief = mission.scenario.chief
    return ByRule(radius - EARTH_RADIUS, None if chief is None else chief.eccentricity, half, most)


def of_drift(mission: Mission, result: StageResult[Any, Any]) -> tuple[str, ...]:
    """That a drift is safe by less than what Hill's equations leave out until then, by the same rule."""
    passive, radius = result.passive, _earths_radius(mission)
    if passive is None or radius is None or not passive.safe:
        return ()
    worst = passive.worst
    if worst is None or not isfinite(worst.time):
        return ()
    spare = worst.distance * (1.0 - 1.0 / worst.ratio)
    off = _off(mission, [result], worst.time, radius, HALF)
    if off <= spare:
        return ()
    return (
        f"Certified of Hill's equations, which leave out about {off:.3g} m by {worst.time:.1f} s (rule of "
        f"thumb) where {spare:.3g} m are to spare: measure and judge anew before, or make the zone larger",
    )


def _earths_radius(mission: Mission) -> float | None:
    """Semi-major axis [m] of an orbit around the Earth; None of others."""
    n, chief = mission.orbit.mean_motion, mission.scenario.chief
    mu = chief.mu if chief is not None else mission.scenario.orbit.mu or EARTH_MU
    if not n or (chief is not None and chief.center.upper() != "EARTH"):
        return None
    radius = float(semi_major_axis_from_mean_motion(n, mu))
    return None if abs(mu / EARTH_MU - 1.0) > EARTHLIKE or radius < EARTH_RADIUS else radius


def _off(
    mission: Mission, flown: Sequence[StageResult[Any, Any]], time: float, radius: float, rule: Any
) -> float:
    """How far off [m] craft are by rule, at a time of a mission."""
    chief, reach = mission.scenario.chief, Reach.of([result.after for result in flown])
    e = 0.0 if chief is None else chief.eccentricity or 0.0
    turns = time * mission.orbit.mean_motion / (2.0 * pi)
    return float(ends_off(reach.distance, turns, radius, e, flattening_at(radius), rule))
