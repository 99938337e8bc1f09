"""Guidance for rendezvous, proximity operations and formation flying; public names are in `__init__.pyi`."""

from importlib import import_module
from typing import Any

# Loaded at first use, so that `import closeform` and the command line start at once.
_NAMES = {
    "motion.orbit": "Orbit",
    "motion.path": "Path",
    "motion.joining": "join stack",
    "zones.zone": "Zone",
    "zones.solids": "Box Ellipsoid Sphere Cylinder HalfSpaces",
    "zones.combined_zones": "CovarianceZone Body",
    "zones.pair_zones": "PairZones",
    "conflicts.two_paths": "Conflict Approach find_conflicts closest_approach last_possible_conflict",
    "conflicts.all_pairs": "Screening screen",
    "uncertainty.errors": "Uncertainty",
    "uncertainty.encounter": "Encounter",
    "safety.failures": "ThrustLost MissedBurns DegradedThrust StuckOnThrust",
    "safety.drift_approach": "DriftApproach drift_approach passively_safe",
    "uncertainty.probability": "Probability collision_probability",
    "safety.drift_screen": "DriftScreening drift_screen",
    "uncertainty.clearance": "SigmaApproach clearance_in_sigmas",
    "planning.avoid": "avoid",
    "planning.reconfigure": "reconfigure",
    "planning.plan": "Plan ShadowPrice Status",
    "planning.clearance_cost_curve": "ClearanceCostCurve clearance_cost_curve",
    "planning.max_clearance": "MaxClearance max_clearance",
    "planning.limits": "propellant",
    "fuel.arrivals": "TransferCostTable transfer_cost_table",
    "fuel.bound": "Bound delta_v_bound least_delta_v",
    "fuel.least_time": "least_time",
    "fuel.shortest": "shortest_transfer",
    "fuel.thrusters": "Thrusters",
    "fuel.firing": "ThrusterFiring fire_thrusters",
    "search.sensor": "Sensor",
    "search.schedule": "Search",
    "search.search_errors": "SearchErrors",
    "search.lock_times": "Locks lock_times",
    "search.proofs.lock_proof": "LockProof prove_locks",
    "search.proofs.longest_lock": "LongestLock longest_lock",
    "search.proofs.lock_margins": "lock_margins",
    "search.gathering.result": "GatherStatus Gathering Gatherings",
    "search.gathering.gather": "gather gather_cases",
    "plots.results": "animate plot",
    "campaign": "study",
    "mission.mission": "run",
    "exchange.chief": "Chief",
    "results.export": "export",
    "exchange.formats.states_csv": "read_csv",
    "dynamics.compensated_thrust": "CompensatedThrust compensated_thrust",
    "dynamics.force_model.field": "Drag Field",
    "dynamics.control.feedback": "Feedback Navigation",
    "dynamics.simulation.simulate": "simulate",
    "dynamics.simulation.simulation_result": "Simulation",
    "dynamics.margins.fit_margin": "fit_margin",
    "dynamics.margins.tracking_margins": "TrackingMargins tracking_margins",
    "dynamics.control.tracking_tube": "Tube tube",
    "dynamics.simulation.validity": "Validity validity",
    "results.load": "load",
    "exchange.ephemerides.ephemeris": "Ephemeris",
    "exchange.ccsds.oem": "read_oem read_oem_segments write_oem",
    "exchange.common_frame": "CommonFrame common_frame",
    "exchange.ccsds.conjunction": "Conjunction ConjunctionObject",
    "exchange.ccsds.cdm": "read_cdm write_cdm",
    "exchange.ephemerides.covariance": "Covariances",
}
_MODULES = {
    "elements": "motion.elements.conversions",
    "papers": "papers",
    "plots": "plots",
    "targets": "planning.targets",
    "requirements": "planning.requirements",
    "flight": "flight",
}
_HOMES = {name: module for module, names in _NAMES.items() for name in names.split()}


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return import_module(f"closeform.{_MODULES[name]}")
    if name not in _HOMES:
        raise AttributeError(f"module 'closeform' has no attribute {name!r}")
    value = getattr(import_module(f"closeform.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*_HOMES, *_MODULES, *(name for name in globals() if name.startswith("__"))})
