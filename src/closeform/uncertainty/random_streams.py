"""Random numbers of many cases, by seed, key, case and event.

Each key has its own stream, a Philox generator keyed by the seed and the key's name. Block c of B of case K
is at counter K B + c, and for an event e at the same counter of the e-th part of the stream. The numbers of a
case therefore depend neither on the range in which it is drawn nor on other keys.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from closeform.arrays import Floats

WORDS = 4  # random numbers in one block of Philox


def uniform(seed: int, key: str, blocks: int, first: int, last: int, event: int = 0) -> Floats:
    """Return random numbers (last - first, blocks, 4) in (0, 1) of a key in the given cases, for an event."""
    return np.asarray((words(seed, key, blocks, first, last, event) + 0.5) * 2.0**-53)


def words(seed: int, key: str, blocks: int, first: int, last: int, event: int = 0) -> Any:
    """Return the random numbers of `uniform` as whole numbers of 53 bits."""
    philox = np.random.Philox(key=stream_of(seed, key), counter=[first * blocks, event, 0, 0])
    drawn = philox.random_raw((last - first) * blocks * WORDS).reshape(last - first, blocks, WORDS)
    return drawn >> np.uint64(11)


@lru_cache(maxsize=64)
def stream_of(seed: int, key: str) -> Any:
    """Return the Philox key of the stream of a scenario key."""
    return np.random.SeedSequence(seed, spawn_key=tuple(key.encode())).generate_state(2, np.uint64)
