"""Fuel: what thrusters a craft has, and how they fire."""
