"""Probability of collision: rate of entries, sampled trajectories and short encounters."""
