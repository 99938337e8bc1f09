"""Fuel: lower bounds on delta-v, minimum-time transfers, thrusters and their pulses."""
