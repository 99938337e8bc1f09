"""Ephemerides: states and covariances of one object over time, and interpolation between them."""
