"""Checks of the stage keys that go beyond a clear plan: `sigmas`, `max_probability` and `drift`."""

from collections.abc import Iterator

from closeform.scenario.craft import Craft
from closeform.scenario.scenario import Scenario
from closeform.scenario.stage_table import Drifting, StageTable, Thrusting
from closeform.scenario.stages import Avoid, Joint


def doubted(scenario: Scenario, number: int, stage: StageTable) -> Iterator[str]:
    """Yield an error line for each `sigmas` or `max_probability` without errors, other craft or sizes."""
    asked = [key for key in ("sigmas", "max_probability") if getattr(stage, key) is not None]
    for key in asked:
        if not scenario.uncertain:
            yield (
                f"stage[{number}].{key}: no craft has errors; add for example "
                f"covariance = {Craft.examples()['covariance']} to [craft]"
            )
        if len(scenario.craft) < 2:
            yield f"stage[{number}].{key}: needs another craft; add one, or remove {key}"
    sizes = [(craft.keep_out, craft.hard_body) for craft in scenario.craft]
    if stage.max_probability is not None and any(body is None for _, body in sizes):
        yield 'craft.hard_body: missing; add for example hard_body = "5 m"'
    if stage.sigmas is not None and isinstance(stage, Avoid | Joint) and stage.plans_drift and stage.is_exact:
        yield f"stage[{number}]: a plan keeps sigmas or a drift, not both; remove one of them"
    if stage.sigmas is not None and any(zone is None and body is None for zone, body in sizes):
        yield 'craft.keep_out: missing; add for example keep_out = { sphere = "20 m" }'


def drifting(scenario: Scenario, number: int, stage: Drifting) -> Iterator[str]:
    """Yield an error line for each `drift` without other craft, an end in deep space or finite thrust."""
    if len(scenario.craft) < 2:
        yield f"stage[{number}].drift: needs another craft to keep clear of; add one, or remove drift"
        return
    if stage.for_ever and scenario.orbit.deep_space is not None:
        yield f'stage[{number}].drift: "forever" needs an orbit; give a time, for example "24 h"'
    jumps = any(craft.unlimited for craft in scenario.craft_in(stage))
    if isinstance(stage, Thrusting) and stage.failure == "thrust stuck" and stage.cost == "delta-v" and jumps:
        yield (
            f"stage[{number}].failure: impulses have no thrust that could be stuck; "
            "give max_thrust in [craft], or another failure"
        )
