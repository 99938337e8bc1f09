"""Construction of arcs: from states and times, between two states, and through samples."""
