"""Passive safety: failures of thrust and the drift after them, certified over all instants of failure."""
