"""The margin that a stage keeps beyond zones: a length, or what feedback leaves of its own plan."""

from collections.abc import Callable
from typing import Any

import numpy as np

from closeform.motion.path import fires_impulses
from closeform.scenario import Avoid, Joint, Scenario
from closeform.stage_start import StageStart
from closeform.zones.pair_zones import PairZones

ROUNDS = 6  # of plans; two as a rule, of which the second has the thrust of the first
SPARE = 1e-3  # of a margin that grows


def with_margin(
    start: StageStart, stage: Avoid | Joint, who: list[int], rest: list[int], make: Callable[[Any], Any]
) -> Any:
    """The plan that `make` makes for a margin, for the craft `who` around the `rest`.

    Made anew, where the margin is "auto", until what its flight in the scenario's field needs is kept.
    Raises ValueError where that cannot be said.
    """
    if stage.margin != "auto":
        return make(stage.margin or 0.0)
    from closeform.field.feedback import usual_feedback
    from closeform.field.fitted import fit_margin
    from closeform.field.flown_plan import paths_of
    from closeform.field.tube import tube

    told, field = start.scenario.flight, start.scenario.field
    assert field is not None
    law = told["feedback"] or usual_feedback("track", led_by_impulses(start.scenario))
    sight, sizes = told["navigation"], told["thrust_error"][who]

    def lasting(margin: Any) -> Any:
        plan = make(margin)
        if (paths := paths_of(plan)) is not None and fires_impulses(paths):
            raise ValueError(
                'margin: "auto" is not known for impulses beside craft that coast; give a length'
            )
        return plan

    if not rest:
        zones = PairZones.of([start.keep_out[k] for k in who])
        found = fit_margin(
            make, field, zones, law, sight, thrust_error=sizes, errors=flown_errors(start, who)
        )
        if found.plan.ok and not found.fits:
            raise ValueError(f"margin: {found.reason}; give better navigation, or more time")
        return found.plan
    margin = tube(start.orbit, law, sight).of_a_pair
    for _ in range(ROUNDS):
        plan = lasting(margin)
        paths = paths_of(plan)
        if not plan.ok or paths is None:
            return plan
        peaks = np.atleast_1d(paths.peak_thrust)
        needed = tube(start.orbit, law, sight, thrust_error=peaks * np.hypot(*sizes.T)).of_a_pair
        if needed <= margin:
            return plan
        margin = (1.0 + SPARE) * needed
    raise ValueError(f"margin: still short of {needed:.3g} m after {ROUNDS} plans; give more time")


def flown_errors(start: StageStart, who: list[int]) -> list[Any] | None:
    """The errors of some craft in flight; of later stages those of their burns: feedback held them before."""
    errors = start.scenario.flight["errors"]
    if errors is None:
        return None
    return [errors[k] if errors[k] is None or start.number == 1 else errors[k]._of_burns for k in who]


def led_by_impulses(scenario: Scenario) -> bool:
    """Whether a run is led back by impulses or burns: someone has thrusters, or plans by impulses."""
    free = any(not craft.limited for craft in scenario.craft)
    impulsive = free and any(getattr(stage, "cost", None) == "delta-v" for stage in scenario.stages)
    return impulsive or any(craft.thrusters is not None for craft in scenario.craft)
