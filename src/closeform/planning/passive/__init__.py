"""Minimum energy with passive safety: clear of zones after any loss of thrust."""
