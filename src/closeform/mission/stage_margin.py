"""Keep-out margin of a stage: a given length, or the tracking margin that its own plan requires."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from closeform.mission.stage_start import StageStart, followed, thrusters_by_stage
from closeform.motion.path import Path
from closeform.named_craft import as_listed
from closeform.scenario import Avoid, Joint, Scenario
from closeform.zones.pair_zones import PairZones

if TYPE_CHECKING:
    from closeform.planning.plan import Plan


def with_margin(
    start: StageStart,
    stage: Avoid | Joint,
    craft: list[int],
    others: Sequence[Path],
    make: Callable[[Any], Any],
) -> Any:
    """Return the plan of `make` with the keep-out margin of the stage.

    `craft` lists the craft by index: first those that are planned, then those whose paths are `others`.  For
    the margin "auto", the plan is iterated until it keeps the margin that its tracking error in the
    high-fidelity model requires.  If the iteration fails, the plan has the status NO_MARGIN and a reason.
    Margins assume that feedback may exceed the thrust limit of the stage; a simulation applies it.
    """
    if stage.margin != "auto" or start.planner is not None:
        return make(0.0 if stage.margin == "auto" else stage.margin or 0.0)
    from closeform.dynamics.control.feedback import default_feedback
    from closeform.dynamics.margins.fit_margin import fit_margin

    settings, known = start.scenario.flight, start.scenario.field
    assert known is not None
    stages = [*((one.start, one.stage) for one in start.executed), (start.time, stage)]
    thrusters = thrusters_by_stage(start.whole or start.scenario, stages)
    found = fit_margin(
        make,
        known._of(craft),
        PairZones.of([start.keep_out[k] for k in craft]),
        settings["feedback"] or default_feedback("track", led_by_impulses(start.scenario)),
        settings["navigation"],
        obstacles=others,
        held=True,
        before=followed(start.executed)[craft] if start.executed else None,
        thrust_error=settings["thrust_error"][craft],
        errors=reference_errors(start, craft),
        thrusters=[thrusters[k] for k in craft],
        engine=settings["engine"][craft],
    )
    if found.fits or not found.plan.ok:
        return found.plan
    remedy = "" if ";" in found.reason else "; give better navigation, or more time"
    return unfit(found.plan, as_listed(found.reason, [start.scenario.names[k] for k in craft]) + remedy)


def unfit(plan: "Plan", reason: str) -> "Plan":
    """Return the plan without paths, with the status NO_MARGIN and the `reason`."""
    from closeform.planning.plan import Status, without_paths

    return without_paths(plan, Status.NO_MARGIN, reason)


def reference_errors(start: StageStart, craft: list[int]) -> list[Any] | None:
    """Return the uncertainty of `craft` on their reference paths at the start, with execution errors.

    Return None if no spacecraft has any.
    """
    own = start.scenario.flight["errors"] if start.executed else start.errors
    return [own[k] for k in craft] if own else None


def led_by_impulses(scenario: Scenario) -> bool:
    """Return True if feedback uses impulses: a spacecraft has thrusters, or a stage plans impulses."""
    fires = any(craft.fired(1.0) is not None for craft in scenario.craft_of_all)
    return fires or any(map(scenario.plans_impulses, scenario.stages))
