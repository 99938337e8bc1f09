"""Tracking margins of a plan, and plans that keep them."""
