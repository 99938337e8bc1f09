"""Validation of arguments: numbers, one number, or an object of a type; a ValueError names the argument."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
LARGEST = 1e60  # absolute value of a number: beyond, squares and cubes overflow
SMALLEST = 1e-30  # of a positive number: quotients by a smaller one exceed LARGEST


def shown(value: Any) -> str:
    """Return an argument for an error message, on one line and short."""
    return " ".join(repr(value).split())[:60]


def numbers(name: str, value: ArrayLike) -> Floats:
    """Return an argument as an array of floats, which may share memory with it.

    Refuses input that NumPy would convert silently: booleans, masked values, numbers beyond LARGEST.
    """
    parts = value if isinstance(value, list | tuple) else (value,)
    if any(isinstance(one, np.ma.MaskedArray) and np.ma.is_masked(one) for one in parts):
        raise ValueError(f"{name}: has masked values; fill or remove them")
    try:
        if any(isinstance(one, bool | np.bool_) for one in parts):
            raise TypeError(bool)
        given = np.asarray(value)
        if given.dtype.kind == "O":  # fractions, decimals; NumPy would convert None to nan
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
    """Return an argument as an array of finite floats, with `last` numbers along its last axis."""
    array = numbers(name, value)
    if last is not None and (array.ndim == 0 or array.shape[-1] != last):
        raise ValueError(f"{name}: expected shape (..., {last}), got {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name}: every number must be finite")
    return array


def number(name: str, value: ArrayLike) -> float:
    """Return an argument as one float."""
    array = numbers(name, value)
    if array.shape:
        raise ValueError(f"{name}: expected one number, got shape {array.shape}")
    return float(array)


def of_each(name: str, value: ArrayLike, count: int, what: str = "craft") -> Floats:
    """Return an argument of one number for all, or one for each, as an array (count,)."""
    array = numbers(name, value)
    if array.shape not in ((), (count,)):
        wanted = f"one number, or one for each of {count} {what}"
        raise ValueError(f"{name}: expected {wanted}, got shape {array.shape}")
    return np.broadcast_to(array, count).copy()


def size(name: str, value: ArrayLike, unit: str = "") -> float:
    """Return an argument as a finite float of at least 0; `unit` is printed in the error, such as " m"."""
    found = number(name, value)
    if not 0.0 <= found < np.inf:
        raise ValueError(f"{name}: must be finite and at least 0{unit}, got {found:g}")
    return found


def positive(name: str, value: ArrayLike, unit: str = "") -> float:
    """Return an argument as a finite float above 0; `unit` is printed in the error, such as " m"."""
    found = number(name, value)
    if not 0.0 < found < np.inf:
        raise ValueError(f"{name}: must be positive and finite, got {found:g}{unit}")
    return found


def whole(name: str, value: Any, least: int = 0) -> int:
    """Return an argument as an integer of at least `least`."""
    if not isinstance(value, int | np.integer) or isinstance(value, bool) or value < least:
        raise ValueError(f"{name}: expected a whole number of at least {least}, got {shown(value)}")
    return int(value)


def instance(name: str, value: Any, *kinds: Any) -> Any:
    """Return an argument of one of the types unchanged; raise ValueError otherwise."""
    if not isinstance(value, kinds):
        wanted = " or ".join(getattr(kind, "__name__", str(kind)) for kind in kinds)
        raise ValueError(f"{name}: expected {wanted}, got {shown(value)}")
    return value


def sequence(name: str, value: Any, *kinds: Any) -> list[Any]:
    """Return an argument as a list of objects of the given types; refuse strings and dictionaries."""
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
    """Return the batch shape of several arguments; raise a ValueError that names them if there is none."""
    batches = {shape for shape in shapes.values() if shape}
    if len(batches) <= 1:
        return batches.pop() if batches else ()
    try:
        return np.broadcast_shapes(*shapes.values())
    except ValueError:
        given = ", ".join(f"{name} {shape}" for name, shape in shapes.items() if shape)
        raise ValueError(f"batch shapes do not broadcast: {given}") from None


def subdivided(edges: Floats, pieces: Any) -> Floats:
    """Return edges (K + 1,) with each interval cut into a number of equal `pieces` (K,)."""
    return np.interp(np.arange(np.sum(pieces) + 1.0), np.cumsum([0, *pieces]), edges)
