"""Requirements on a plan beyond keep-out zones; each kind has a file of its own."""

from closeform.planning.requirements.approach_cone import ApproachCone
from closeform.planning.requirements.keep_in import KeepIn
from closeform.planning.requirements.no_thrust import NoThrust
from closeform.planning.requirements.plume import Plume
from closeform.planning.requirements.requirement import StateRequirement
from closeform.planning.requirements.speed_limit import SpeedLimit
from closeform.planning.requirements.thrust_exclusion import ThrustExclusion

__all__ = ["ApproachCone", "KeepIn", "NoThrust", "Plume", "SpeedLimit", "StateRequirement", "ThrustExclusion"]
