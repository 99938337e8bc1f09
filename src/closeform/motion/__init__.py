"""Relative motion in closed form: orbits, paths, transfers and their lower bounds."""
