"""What an argument may be: numbers, one number, an object of some kind. If not, ValueError names it."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
LARGEST = 1e60  # of a number's size: beyond, squares and cubes overflow
SMALLEST = 1e-30  # of a positive number: quotients by a smaller one leave the range above


def shown(value: Any) -> str:
    """An argument in an error, on one line and short."""
    return " ".join(repr(value).split())[:60]


def numbers(name: str, value: ArrayLike) -> Floats:
    """Return an argument as an array of floats, which may share memory with it.

    Refuses what NumPy would convert without a word: truth values, masked values, numbers beyond LARGEST.
    """
    parts = value if isinstance(value, list | tuple) else (value,)
    if any(isinstance(one, np.ma.MaskedArray) and np.ma.is_masked(one) for one in parts):
        raise ValueError(f"{name}: has masked values; fill or remove them")
    try:
        if any(isinstance(one, bool | np.bool_) for one in parts):
            raise TypeError(bool)
        given = np.asarray(value)
        if given.dtype.kind == "O":  # fractions, decimals; of None NumPy would make nan
            given = np.array([float(one) for one in given.flat]).reshape(given.shape)
        if given.dtype.kind not in "iuf":
            raise TypeError(given.dtype)
        array: Floats = given.astype(float, copy=False)
    except OverflowError:
        raise ValueError(f"{name}: every number must be below {LARGEST:g} in SI units") from None
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name}: expected numbers, got {shown(value)}") from error
    if np.abs(array).max(initial=0.0) > LARGEST and (np.abs(array[np.isfinite(array)]) > LARGEST).any():
        raise ValueError(f"{name}: every number must be below {LARGEST:g} in SI units")
    return array if array.flags.aligned else array.copy()


def finite(name: str, value: ArrayLike, last: int | None = None) -> Floats:
    """Return an argument as an array of finite floats, with so many along its `last` axis."""
    array = numbers(name, value)
    if last is not None and (array.ndim == 0 or array.shape[-1] != last):
        raise ValueError(f"{name}: expected shape (..., {last}), got {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name}: every number must be finite")
    return array


def number(name: str, value: ArrayLike) -> float:
    """An argument as one float."""
    array = numbers(name, value)
    if array.shape:
        raise ValueError(f"{name}: expected one number, got shape {array.shape}")
    return float(array)


def of_each(name: str, value: ArrayLike, count: int, what: str = "craft") -> Floats:
    """An argument of one number for all, or of one for each, as one for each of so many (count,)."""
    array = numbers(name, value)
    if array.shape not in ((), (count,)):
        wanted = f"one number, or one for each of {count} {what}"
        raise ValueError(f"{name}: expected {wanted}, got shape {array.shape}")
    return np.broadcast_to(array, count).copy()


def size(name: str, value: ArrayLike, unit: str = "") -> float:
    """An argument as a finite float from 0 on; its `unit` as an error says it, like " m"."""
    found = number(name, value)
    if not 0.0 <= found < np.inf:
        raise ValueError(f"{name}: must be finite and at least 0{unit}, got {found:g}")
    return found


def positive(name: str, value: ArrayLike, unit: str = "") -> float:
    """An argument as a finite float above 0; its `unit` as an error says it, like " m"."""
    found = number(name, value)
    if not 0.0 < found < np.inf:
        raise ValueError(f"{name}: must be positive and finite, got {found:g}{unit}")
    return found


def whole(name: str, value: Any, least: int = 0) -> int:
    """An argument as a whole number."""
    if not isinstance(value, int | np.integer) or isinstance(value, bool) or value < least:
        raise ValueError(f"{name}: expected a whole number from {least} on, got {shown(value)}")
    return int(value)


def instance(name: str, value: Any, *kinds: Any) -> Any:
    """An argument as it is, of one of the kinds."""
    if not isinstance(value, kinds):
        wanted = " or ".join(getattr(kind, "__name__", str(kind)) for kind in kinds)
        raise ValueError(f"{name}: expected {wanted}, got {shown(value)}")
    return value


def sequence(name: str, value: Any, *kinds: Any) -> list[Any]:
    """An argument as a list of objects of some kinds; neither a word nor a dictionary is one."""
    try:
        if isinstance(value, str | dict):
            raise TypeError(type(value))
        given = list(value)
    except TypeError as error:
        raise ValueError(f"{name}: expected a sequence, got {shown(value)}") from error
    for one in given:
        instance(name, one, *kinds)
    return given


def broadcast(**shapes: tuple[int, ...]) -> tuple[int, ...]:
    """The batch shape of several arguments; ValueError naming them where there is none."""
    batches = {shape for shape in shapes.values() if shape}
    if len(batches) <= 1:
        return batches.pop() if batches else ()
    try:
        return np.broadcast_shapes(*shapes.values())
    except ValueError:
        given = ", ".join(f"{name} {shape}" for name, shape in shapes.items() if shape)
        raise ValueError(f"batch shapes do not broadcast: {given}") from None
