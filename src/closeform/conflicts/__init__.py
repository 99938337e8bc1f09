"""Conflicts and closest approaches of paths, certified between any two instants."""
