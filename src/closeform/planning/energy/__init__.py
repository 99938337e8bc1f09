"""Minimum energy around zones: passing sides, contacts, and the local solver."""
