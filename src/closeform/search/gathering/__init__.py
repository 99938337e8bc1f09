"""Gathering of lost craft: they search, lock and join until one formation set holds them all (H03)."""
