"""Conversions between states, orbital elements, relative orbital elements and phase-space coordinates."""

from closeform.motion.elements.elements import (
    elements_from_inertial,
    inertial_from_elements,
)
from closeform.motion.elements.frames import (
    inertial_from_relative,
    relative_from_inertial,
)
from closeform.motion.elements.mean_motion import (
    EARTH_MU,
    EARTH_RADIUS,
    altitude_from_mean_motion,
    mean_motion_from_altitude,
    mean_motion_from_period,
    mean_motion_from_semi_major_axis,
    period_from_mean_motion,
    semi_major_axis_from_mean_motion,
)
from closeform.motion.elements.palmer import (
    palmer_from_state,
    state_from_palmer,
)
from closeform.motion.elements.roe import (
    elements_from_roe,
    roe_from_elements,
    roe_from_state,
    scaled_roe_from_state,
    state_from_roe,
    state_from_scaled_roe,
)

__all__ = [
    "EARTH_MU",
    "EARTH_RADIUS",
    "altitude_from_mean_motion",
    "elements_from_inertial",
    "elements_from_roe",
    "inertial_from_elements",
    "inertial_from_relative",
    "mean_motion_from_altitude",
    "mean_motion_from_period",
    "mean_motion_from_semi_major_axis",
    "palmer_from_state",
    "period_from_mean_motion",
    "relative_from_inertial",
    "roe_from_elements",
    "roe_from_state",
    "scaled_roe_from_state",
    "semi_major_axis_from_mean_motion",
    "state_from_palmer",
    "state_from_roe",
    "state_from_scaled_roe",
]
