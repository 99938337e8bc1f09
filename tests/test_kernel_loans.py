"""Arrays lent to kernels: read in place, released after the call."""

import sys
from typing import NamedTuple

import numpy as np
import pytest
from numba import float64, types

from closeform._jit import kernel
from closeform.kernel_loans import Lent


class Inner(NamedTuple):
    """An array in a tuple of a tuple."""

    other: np.ndarray
    factor: float


class Pair(NamedTuple):
    """Two arrays."""

    one: np.ndarray
    inner: Inner


PAIR = Lent(types.NamedTuple((float64[::1], types.NamedTuple((float64[:, ::1], float64), Inner)), Pair))


@kernel(float64(PAIR, float64))
def total(pair, factor):
    """Return the sum of both arrays, after scaling the first one in place."""
    for k in range(len(pair.one)):
        pair.one[k] *= factor
    inner = pair.inner
    return pair.one.sum() + inner.factor * inner.other.sum()


@kernel(float64(PAIR))
def fails(pair):
    """Raise an error after reading an array."""
    if pair.one[0] > 0.0:
        raise ValueError("positive")
    return pair.one[0]


def test_lent_arrays_are_changed_in_place_and_released():
    pair = Pair(np.ones(3), Inner(np.ones((2, 2)), 1.0))
    arrays = pair.one, pair.inner.other
    before = [sys.getrefcount(array) for array in arrays]
    for _ in range(100):
        assert total(pair, 1.0) == 7.0
    with pytest.raises(ValueError, match="positive"):
        fails(pair)
    assert [sys.getrefcount(array) for array in arrays] == before
    assert total(pair, 2.0) == 10.0
    assert (pair.one == 2.0).all()


def test_lent_arrays_of_another_type_are_refused():
    pair = Pair(np.ones(3), Inner(np.ones((2, 2)), 1.0))
    single = Inner(np.ones((2, 2), dtype=np.float32), 1.0)
    for wrong in (pair._replace(one=np.ones((3, 1))), pair._replace(inner=single), (1.0,)):
        with pytest.raises(TypeError):
            total(wrong, 1.0)
