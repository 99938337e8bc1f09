"""Minimum energy by continuous thrust under any requirement, exact by duality."""
