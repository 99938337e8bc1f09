"""Elements and frames: conversions between relative states, orbital elements and inertial frames."""
