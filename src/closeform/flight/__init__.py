"""The flight core, a C99 library for on-board computers, called from Python to compare both.

The functions have the names of those of the package and return the same kinds of results. They raise
RuntimeError without a C compiler or cffi, and ValueError for input that the flight core rejects: a number
that is not finite, a batch of spacecraft, paths in different orbits, half-spaces. See docs/on_board.md.
"""

from closeform.flight.library import build
from closeform.flight.motion import coast, impulsive, transfer
from closeform.flight.pairs import avoid, closest_approach, find_conflicts, passively_safe
from closeform.flight.search import lock_times
from closeform.flight.table import table_bytes

__all__ = [
    "avoid",
    "build",
    "closest_approach",
    "coast",
    "find_conflicts",
    "impulsive",
    "lock_times",
    "passively_safe",
    "table_bytes",
    "transfer",
]
