"""Navigation uncertainty and execution errors: covariances, sigma clearance and collision probability."""
