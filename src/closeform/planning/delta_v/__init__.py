"""Minimum delta-v: impulses, burns within a limit, and pulses of thrusters."""
