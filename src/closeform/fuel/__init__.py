"""Fuel: what a transfer costs at least, what thrusters a craft has, and how they fire."""
