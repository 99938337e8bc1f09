"""Modules whose kernels a scenario needs, for compilation in several processes before the run starts."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from closeform.scenario.stages import Avoid, Drifting, Gather, Joint, Lock, Thrusting

if TYPE_CHECKING:
    from closeform.scenario import Scenario

MOTION = "motion.effort motion.path motion.steering conflicts.pair_search conflicts.quick_rejection"
PLANNING = (
    "planning.problem.approaches planning.problem.contacts planning.problem.deflection "
    "planning.energy.quadratic_program"
)
LEAST_ENERGY = "planning.energy.contact_solver planning.bounds.dual_bound"
LEAST_DELTA_V = (
    "motion.minimum_delta_v.impulses motion.minimum_delta_v.impulse_arcs "
    "motion.minimum_delta_v.constant_primers"
)
JOINT_DELTA_V = (
    "planning.delta_v.dual.dual_program planning.delta_v.dual.primer_maxima "
    "planning.delta_v.dual.impulse_paths planning.delta_v.dual.plane_shortfalls"
)
PASSIVE_SAFETY = "safety.failure_search"
ABOUT_CHIEF = (
    "motion.chief.segments motion.chief.impulses conflicts.chief.pair_search planning.problem.pieces"
)
PASSIVE_FOR_EVER = "safety.infinite_horizon"
PASSIVE_ABOUT_CHIEF = "safety.drift_beside_chief"
SAFE_PLANS = "planning.passive.failure_minima planning.energy.plane_program"
ERRORS = (
    "uncertainty.sigmas.levels uncertainty.sigmas.conflicts uncertainty.sigmas.rejection "
    "uncertainty.covariance_propagation"
)
PROBABILITY = "uncertainty.collision.sampled_trajectories uncertainty.collision.entry_rate"
FIELD = "dynamics.force_model.forces dynamics.clearance"


def modules_for(scenario: "Scenario") -> list[str]:
    """Return names of modules, without the package name.

    A kernel of another module is compiled when it is first called.
    """
    return [*dict.fromkeys(name for names in _needs(scenario) for name in names.split())]


def _needs(scenario: "Scenario") -> Iterator[str]:
    """Yield the modules that each feature of a scenario needs, as text with spaces between the names."""
    if all(stage.searches for stage in scenario.stages):
        yield (
            "search.lock_march"
            if isinstance(scenario.stages[0], Lock)
            else "search.gathering.event_simulation"
        )
        return
    yield MOTION
    hill = scenario.orbit.model == "hill"
    if not hill:
        yield ABOUT_CHIEF
    for stage in scenario.stages:
        plans = isinstance(stage, Avoid | Joint)
        cost = stage.cost if isinstance(stage, Thrusting) else None
        if isinstance(stage, Gather):
            yield "search.gathering.event_simulation"
        if plans:
            yield PLANNING
        if plans and cost == "energy":
            yield LEAST_ENERGY
        if cost == "delta-v" and hill:
            yield LEAST_DELTA_V
        if plans and cost == "delta-v":
            yield JOINT_DELTA_V
        if isinstance(stage, Drifting) and stage.drift is not None:
            yield PASSIVE_SAFETY if hill else PASSIVE_ABOUT_CHIEF
            if stage.for_ever:
                yield PASSIVE_FOR_EVER
            if plans and (hill or cost == "delta-v"):
                yield SAFE_PLANS
        if stage.sigmas is not None:
            yield ERRORS
        if stage.max_probability is not None:
            yield PROBABILITY
    if any(craft.covariance is not None for craft in scenario.craft):
        yield ERRORS
    if any(craft.thrusters is not None for craft in scenario.craft):
        yield f"{LEAST_DELTA_V} motion.minimum_delta_v.saturated"
    if scenario.orbit.field is not None:
        yield FIELD
