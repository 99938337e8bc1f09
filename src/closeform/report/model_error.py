"""Model error of Hill's equations: predicted in a high-fidelity model, or estimated without one."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from closeform.mission.mission_result import Mission, StageResult
from closeform.mission.simulation_verdict import mission_error
from closeform.mission.verdict import metres
from closeform.motion.mean_motion import EARTH_RADIUS
from closeform.report.section import plan_of


def lines(mission: Mission, result: StageResult[Any, Any]) -> tuple[str, ...]:
    """Return the predicted deviations of a stage in its high-fidelity model, or a note on their absence."""
    if result.validity is None:
        unflown = mission.scenario.field is not None and not result.flown
        return ("In the field: not predicted, since these paths are not flown",) * unflown
    from closeform.dynamics.validity import in_words  # most runs do not need these kernels

    return in_words(result.validity, result.after.names)


def margin(result: StageResult[Any, Any]) -> tuple[str, ...]:
    """Return the keep-out margin of a plan in words."""
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
    """Return the predicted model error and the keep-out margin for `summary.json`."""
    found, names, plan = result.validity, result.after.names, plan_of(result)
    asked = getattr(result.stage, "margin", None)
    kept = {} if not asked or plan is None else {"margin_m": float(np.max(plan.padding))}
    if found is None:
        return kept
    return kept | {
        "in_field": {
            "field": found.field,
            "ends_m": dict(zip(names, found.ends.tolist(), strict=True)),
            "residual_m_s2": dict(zip(names, found.residual.tolist(), strict=True)),
            "least_ratio": float(found.flown.min(initial=np.inf)),
            "planned_ratio": float(found.planned.min(initial=np.inf)),
        }
    }


def estimate(mission: Mission) -> Iterator[str]:
    """Yield the estimated model error of a mission around the Earth without a high-fidelity model."""
    error = mission_error(mission)
    if error is None:
        return
    neglected, half, most = error
    e = neglected.eccentricity
    where = f"{(neglected.semi_major_axis - EARTH_RADIUS) / 1e3:.0f} km, e " + (
        "not known" if e is None else f"= {e:.5f}"
    )
    who = "the craft" if len(mission.scenario.craft) == 1 else "the craft that is off most"
    yield f"Model error of Hill's equations (estimate): about {metres(half)}, 95 % within {metres(most)}"
    yield f"    for {who}, at {where}"
