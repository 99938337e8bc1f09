"""Keep-out margin of a stage: a given length, or the tracking margin that its own plan requires."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import nan
from typing import TYPE_CHECKING, Any

from closeform.mission.stage_start import StageStart, followed
from closeform.motion.path import Path
from closeform.named_craft import as_listed
from closeform.scenario import Avoid, Joint, Scenario
from closeform.zones.pair_zones import PairZones

if TYPE_CHECKING:
    from closeform.planning.plan import Avoidance, Plan


def with_margin(
    start: StageStart,
    stage: Avoid | Joint,
    who: list[int],
    others: Sequence[Path],
    make: Callable[[Any], Any],
) -> Any:
    """Return the plan of `make` with the keep-out margin of the stage.

    `who` lists the craft by index: first those that are planned, then those whose paths are `others`.  For
    the margin "auto", the plan is iterated until it keeps the margin that its tracking error in the
    high-fidelity model requires.  If the iteration fails, or tracking exceeds a limit, the plan has the
    status NO_MARGIN and a reason.
    """
    if stage.margin != "auto":
        return make(stage.margin or 0.0)
    from closeform.dynamics.control.feedback import default_feedback
    from closeform.dynamics.margins.fit_margin import fit_margin

    told, known = start.scenario.flight, start.scenario.field
    assert known is not None
    found = fit_margin(
        make,
        known._of(who),
        PairZones.of([start.keep_out[k] for k in who]),
        told["feedback"] or default_feedback("track", led_by_impulses(start.scenario)),
        told["navigation"],
        obstacles=others,
        held=True,
        before=followed(start.flown)[who] if start.flown else None,
        thrust_error=told["thrust_error"][who],
        errors=flown_errors(start, who),
        thrusters=[start.scenario.craft[k].fired(1.0) for k in who],
        engine=told["engine"][who],
    )
    if found.fits or not found.plan.ok:
        return found.plan
    remedy = "" if ";" in found.reason else "; give better navigation, or more time"
    return unfit(found.plan, as_listed(found.reason, [start.scenario.names[k] for k in who]) + remedy)


def unfit(plan: "Plan | Avoidance", reason: str) -> "Plan | Avoidance":
    """Return the plan without paths, with the status NO_MARGIN and the `reason`."""
    from closeform.planning.plan import Plan, Status

    without: Any = {"paths": None} if isinstance(plan, Plan) else {"path": None, "extra_energy": nan}
    without |= {"energy": nan, "delta_v": nan, "contacts": ()}
    return replace(plan, status=Status.NO_MARGIN, reason=reason, **without)


def flown_errors(start: StageStart, who: list[int]) -> list[Any] | None:
    """Return the uncertainty of the craft `who` at the start of their reference paths, with execution errors.

    Return None if no spacecraft has any.
    """
    own = start.scenario.flight["errors"] if start.flown else start.errors
    return [own[k] for k in who] if own else None


def led_by_impulses(scenario: Scenario) -> bool:
    """Return True if feedback uses impulses: a spacecraft has thrusters, or a stage plans impulses."""
    fires = any(craft.fired(1.0) is not None for craft in scenario.craft_of_all)
    return fires or any(map(scenario.plans_impulses, scenario.stages))
