"""Independent samples of studies: blocks of NumPy's generator by seed, key and counter."""

import numpy as np


def words(seed, key, counter, event=0):
    """Four whole numbers of 53 bits."""
    stream = np.random.SeedSequence(seed, spawn_key=tuple(key.encode()))
    philox = np.random.Philox(key=stream.generate_state(2, np.uint64), counter=[counter, event, 0, 0])
    return philox.random_raw(4) >> np.uint64(11)


def block(seed, key, counter, event=0):
    """The same as numbers between 0 and 1."""
    return (words(seed, key, counter, event) + 0.5) * 2.0**-53
