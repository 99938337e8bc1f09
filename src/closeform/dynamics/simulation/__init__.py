"""Simulation: commands, random errors, the integrator step, replanning, and the result."""
