"""Fuel: lower bounds of delta-v, minimum-time transfers, thrusters and their pulses."""
