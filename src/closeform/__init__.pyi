"""Every public name, and the module it lives in."""

from closeform import flight as flight, plots as plots
from closeform.plots.results import animate as animate, plot as plot
from closeform.planning import requirements as requirements
from closeform.planning import targets as targets
from closeform import papers as papers
from closeform.motion.elements import conversions as elements
from closeform.planning.avoid import avoid as avoid
from closeform.planning.plan import (
    Plan as Plan,
    ShadowPrice as ShadowPrice,
    Status as Status,
)
from closeform.planning.clearance_cost_curve import (
    ClearanceCostCurve as ClearanceCostCurve,
    clearance_cost_curve as clearance_cost_curve,
)
from closeform.planning.max_clearance import (
    MaxClearance as MaxClearance,
    max_clearance as max_clearance,
)
from closeform.planning.reconfigure import reconfigure as reconfigure
from closeform.campaign import study as study
from closeform.exchange.ccsds.cdm import read_cdm as read_cdm, write_cdm as write_cdm
from closeform.mission.mission import run as run
from closeform.exchange.chief import Chief as Chief
from closeform.dynamics.compensated_thrust import (
    CompensatedThrust as CompensatedThrust,
    compensated_thrust as compensated_thrust,
)
from closeform.dynamics.force_model.field import Drag as Drag, Field as Field
from closeform.dynamics.control.feedback import Feedback as Feedback, Navigation as Navigation
from closeform.dynamics.simulation.simulate import simulate as simulate
from closeform.dynamics.simulation.simulation_result import Simulation as Simulation
from closeform.dynamics.margins.fit_margin import fit_margin as fit_margin
from closeform.dynamics.margins.tracking_margins import (
    TrackingMargins as TrackingMargins,
    tracking_margins as tracking_margins,
)
from closeform.dynamics.control.tracking_tube import Tube as Tube, tube as tube
from closeform.dynamics.simulation.validity import Validity as Validity, validity as validity
from closeform.exchange.common_frame import CommonFrame as CommonFrame, common_frame as common_frame
from closeform.exchange.ccsds.conjunction import (
    Conjunction as Conjunction,
    ConjunctionObject as ConjunctionObject,
)
from closeform.exchange.ephemerides.covariance import Covariances as Covariances
from closeform.exchange.ephemerides.ephemeris import Ephemeris as Ephemeris
from closeform.exchange.ccsds.oem import (
    read_oem as read_oem,
    read_oem_segments as read_oem_segments,
    write_oem as write_oem,
)
from closeform.conflicts.two_paths import (
    Approach as Approach,
    Conflict as Conflict,
    closest_approach as closest_approach,
    find_conflicts as find_conflicts,
    last_possible_conflict as last_possible_conflict,
)
from closeform.safety.drift_approach import (
    DriftApproach as DriftApproach,
    drift_approach as drift_approach,
    passively_safe as passively_safe,
)
from closeform.safety.drift_screen import (
    DriftScreening as DriftScreening,
    drift_screen as drift_screen,
)
from closeform.safety.failures import (
    MissedBurns as MissedBurns,
    StuckOnThrust as StuckOnThrust,
    ThrustLost as ThrustLost,
    DegradedThrust as DegradedThrust,
)
from closeform.fuel.arrivals import (
    TransferCostTable as TransferCostTable,
    transfer_cost_table as transfer_cost_table,
)
from closeform.fuel.bound import (
    Bound as Bound,
    delta_v_bound as delta_v_bound,
    least_delta_v as least_delta_v,
)
from closeform.fuel.firing import ThrusterFiring as ThrusterFiring, fire_thrusters as fire_thrusters
from closeform.fuel.least_time import least_time as least_time
from closeform.fuel.shortest import shortest_transfer as shortest_transfer
from closeform.fuel.thrusters import Thrusters as Thrusters
from closeform.planning.limits import propellant as propellant
from closeform.motion.orbit import Orbit as Orbit
from closeform.motion.joining import join as join, stack as stack
from closeform.motion.path import Path as Path
from closeform.conflicts.all_pairs import (
    Screening as Screening,
    screen as screen,
)
from closeform.search.gathering.gather import gather as gather, gather_cases as gather_cases
from closeform.results.export import export as export
from closeform.exchange.formats.states_csv import read_csv as read_csv
from closeform.results.load import (
    load as load,
)
from closeform.search.gathering.result import (
    GatherStatus as GatherStatus,
    Gathering as Gathering,
    Gatherings as Gatherings,
)
from closeform.search.lock_times import Locks as Locks, lock_times as lock_times
from closeform.search.proofs.lock_proof import LockProof as LockProof, prove_locks as prove_locks
from closeform.search.proofs.longest_lock import LongestLock as LongestLock, longest_lock as longest_lock
from closeform.search.proofs.lock_margins import lock_margins as lock_margins
from closeform.search.schedule import Search as Search
from closeform.search.search_errors import SearchErrors as SearchErrors
from closeform.search.sensor import Sensor as Sensor
from closeform.uncertainty.encounter import Encounter as Encounter
from closeform.uncertainty.clearance import (
    SigmaApproach as SigmaApproach,
    clearance_in_sigmas as clearance_in_sigmas,
)
from closeform.uncertainty.errors import Uncertainty as Uncertainty
from closeform.uncertainty.probability import (
    Probability as Probability,
    collision_probability as collision_probability,
)
from closeform.zones.combined_zones import Body as Body
from closeform.zones.combined_zones import CovarianceZone as CovarianceZone
from closeform.zones.pair_zones import PairZones as PairZones
from closeform.zones.solids import (
    Box as Box,
    Cylinder as Cylinder,
    Ellipsoid as Ellipsoid,
    HalfSpaces as HalfSpaces,
    Sphere as Sphere,
)
from closeform.zones.zone import Zone as Zone
