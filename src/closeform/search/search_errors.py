"""Errors of craft relative to their search schedule and sensor."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, pi
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, broadcast, instance, numbers, shown
from closeform.search.sensor import Sensor

MOST_TURN = pi / 2.0  # rad, bound on a pointing error
FIELDS = (
    *("pointing", "slew_rate", "start", "half_angle", "range", "slew_acceleration", "silent"),
    *("solar_acceleration", "outages"),
)
AXES = {"pointing": 1, "outages": 2}  # array axes that a field has for one craft; other fields are numbers
# columns of a craft's row in kernels; from the last one on the begin and end [s] of each outage
BODY, PACE, START_DELAY, COSINE, RANGE, ACCELERATION, EXACT, SOLAR, OUTAGES = 0, 3, 4, 5, 6, 7, 8, 9, 10


@dataclass(frozen=True, eq=False, init=False)
class SearchErrors:
    """Constant errors of craft relative to their search schedule and sensor.

    All fields broadcast to one shape (...). For `lock_times` it is (M, 2), the craft of each pair in A and in
    B, or (2,) for all pairs.

    Parameters
    ----------
    pointing : array_like of shape (..., 3) [rad], default zeros
        Constant rotation of the body, as a rotation vector in body axes (z is the boresight), below pi/2.
    slew_rate : array_like of shape (...), no unit, default 0
        Relative error of the rate of all turns, above -1. A turn ends at its angle, and the next one begins.
    start : array_like of shape (...) [s], default 0
        Delay of the craft's start; until then it waits in its start attitude.
    half_angle : array_like of shape (...) [rad], default 0
        Difference between its sensor's half-angle and the search's.
    range : array_like of shape (...) [m], optional
        Range of its own sensor. Default: the search's. The shorter range of a pair counts.
    slew_acceleration : array_like of shape (...) [rad/s^2], default inf
        Acceleration at the start and end of a turn, which prolongs it by the rate over this value.
    silent : array_like of bool of shape (...), default False
        True if the craft never responds, so that no other locks with it.
    solar_acceleration : array_like of shape (...) [m/s^2], default 0
        Acceleration away from the sun by solar pressure, constant. Only `lock_times` supports it.
    outages : array_like of shape (..., K, 2) [s], optional
        Start and end of intervals in which the sensor or radio of the craft does not work, so that it does
        not lock. An end may be inf; (inf, inf) fills rows with fewer intervals. Default: none.

    Raises
    ------
    ValueError
        If a number is outside these bounds, or shapes do not match.

    References
    ----------
    docs/lost_craft.md.
    """

    pointing: Floats
    slew_rate: Floats
    start: Floats
    half_angle: Floats
    range: Floats | None
    slew_acceleration: Floats
    silent: Any
    solar_acceleration: Floats
    outages: Floats | None

    def __init__(
        self,
        pointing: ArrayLike = (0.0, 0.0, 0.0),
        slew_rate: ArrayLike = 0.0,
        start: ArrayLike = 0.0,
        half_angle: ArrayLike = 0.0,
        range: ArrayLike | None = None,
        slew_acceleration: ArrayLike = inf,
        silent: ArrayLike = False,
        solar_acceleration: ArrayLike = 0.0,
        outages: ArrayLike | None = None,
    ) -> None:
        turn, mute = numbers("pointing", pointing), np.asarray(silent)
        if turn.shape[-1:] != (3,):
            raise ValueError(f"pointing: expected shape (..., 3), got {turn.shape}")
        if mute.dtype != bool:
            raise ValueError(f"silent: expected True or False for each craft, got {shown(silent)}")
        self.__dict__.update(
            pointing=turn,
            slew_rate=_within("slew_rate", slew_rate, -1.0, inf),
            start=_within("start", start, -inf, inf),
            half_angle=_within("half_angle", half_angle, -pi, pi),
            range=None if range is None else _positive("range", range),
            slew_acceleration=_positive("slew_acceleration", slew_acceleration),
            silent=mute,
            solar_acceleration=_within("solar_acceleration", solar_acceleration, -inf, inf),
            outages=None if outages is None else _intervals("outages", outages),
        )
        _within("pointing", np.linalg.norm(turn, axis=-1), -1.0, MOST_TURN)
        broadcast(**self._shapes)

    @property
    def _shapes(self) -> dict[str, tuple[int, ...]]:
        """Shape of each field, without the axis of vector components."""
        shapes = {name: np.shape(getattr(self, name)) for name in FIELDS}
        return {name: shape[: len(shape) - AXES.get(name, 0)] for name, shape in shapes.items()}

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape to which all fields broadcast."""
        return np.broadcast_shapes(*self._shapes.values())

    def _each(self, name: str, shape: tuple[int, ...]) -> Any:
        """Return a field for each craft of a shape; None if it is not given."""
        values = getattr(self, name)
        own = () if values is None else values.shape[values.ndim - AXES.get(name, 0) :]
        return None if values is None else np.broadcast_to(values, (*shape, *own))


def craft_rows(
    errors: SearchErrors | None,
    sensor: Sensor,
    shape: tuple[int, ...],
    second: Any,
    asked: str,
    some: Any = ...,
) -> Floats:
    """Return the kernels' rows (..., 10 + 2 K) of `some` craft of a shape; B (`second`) uses the axes of A.

    `EXACT` is 1 for a craft without errors. Raises ValueError for errors of another shape, which `asked`
    describes, or that leave no cone.
    """
    if errors is None:
        perfect = [0.0, 0.0, 1.0, 1.0, 0.0, sensor.cosine, sensor.range, inf, 1.0, 0.0]
        out = np.tile(perfect, (*shape, 1))
        out[..., 2] = np.where(second, -1.0, 1.0)
        return out

    def of_craft(name: str) -> Any:
        try:
            return errors._each(name, shape)[some]
        except ValueError:
            own = {"pointing": ", 3", "outages": ", K, 2"}
            fits = asked.replace("{}", own.get(name, ""))
            raise ValueError(f"errors: {name} of {fits}; got {getattr(errors, name).shape}") from None

    body = body_axis(of_craft("pointing"), 2)
    count = 0 if errors.outages is None else 2 * errors.outages.shape[-2]
    out = np.empty((*body.shape[:-1], OUTAGES + count))
    if errors.outages is not None:
        out[..., OUTAGES:] = of_craft("outages").reshape(*body.shape[:-1], count)
    out[..., BODY : BODY + 3] = body
    out[..., BODY + 1 : BODY + 3] *= np.where(second, -1.0, 1.0)[..., None]  # B's axes y and z are opposite
    out[..., PACE] = 1.0 + of_craft("slew_rate")
    out[..., START_DELAY] = of_craft("start")
    half_angle = sensor.half_angle + of_craft("half_angle")
    if not ((half_angle > 0.0) & (half_angle < pi)).all():
        wrong = half_angle[(half_angle <= 0.0) | (half_angle >= pi)][0]
        raise ValueError(f"errors: half_angle leaves {wrong:g} rad; it must stay between 0 and pi")
    cosine = np.cos(half_angle)
    out[..., COSINE] = np.where(abs(cosine) > 1e-15, cosine, 0.0)
    out[..., RANGE] = sensor.range if errors.range is None else of_craft("range")
    out[..., RANGE][of_craft("silent")] = -inf
    out[..., ACCELERATION] = of_craft("slew_acceleration")
    out[..., SOLAR] = of_craft("solar_acceleration")
    exact = ~errors.pointing.any(axis=-1) & (errors.slew_rate == 0.0) & (errors.start == 0.0)
    exact = exact & (errors.half_angle == 0.0) & (errors.slew_acceleration == inf) & ~errors.silent
    exact = exact & (errors.solar_acceleration == 0.0)
    if errors.range is not None:
        exact = exact & (errors.range == sensor.range)
    if errors.outages is not None:
        exact = exact & (errors.outages[..., 0] == inf).all(axis=-1)
    out[..., EXACT] = np.broadcast_to(exact, shape)[some]
    return out


def errors_of_each(errors: SearchErrors, shape: tuple[int, ...]) -> SearchErrors:
    """Return the errors broadcast to all craft of a shape."""
    return _changed(errors, shape, lambda values: values)


def errors_of_cases(errors: SearchErrors | None, shape: tuple[int, ...], some: Any) -> SearchErrors | None:
    """Return the errors (C, N) of some cases, by index or slice; those alike in all cases stay."""
    if errors is None or len(instance("errors", errors, SearchErrors).shape) < 2:
        return errors
    return _changed(errors, shape, lambda values: values[some])


def errors_of_swapped(errors: SearchErrors | None, swapped: Any) -> SearchErrors | None:
    """Return the errors (M, 2) of pairs after an exchange of both craft in those of a mask (M,)."""
    if errors is None:
        return None

    def exchanged(values: Floats) -> Floats:
        mask = swapped.reshape(-1, *[1] * (values.ndim - 1))
        return np.where(mask, values[:, ::-1], values)

    return _changed(errors, (len(swapped), 2), exchanged)


def errors_of_pairs(errors: SearchErrors, pairs: Any) -> SearchErrors:
    """Return the errors (M, 2) of pairs (P, 2) by index, from those of all craft (N,) or of cases (C, N)."""
    if not (shape := errors.shape):
        return errors  # common to all
    axis = len(shape) - 1

    def of_pairs(values: Floats) -> Floats:
        return np.asarray(np.take(values, pairs, axis=axis).reshape(-1, 2, *values.shape[axis + 1 :]))

    return _changed(errors, shape, of_pairs)


def _changed(errors: SearchErrors, shape: tuple[int, ...], change: Callable[[Any], Any]) -> SearchErrors:
    """Return the errors with each given field, broadcast to all craft of a shape, replaced by a function."""
    fields = {name: errors._each(name, shape) for name in FIELDS}
    changed: dict[str, Any] = {
        name: None if values is None else change(values) for name, values in fields.items()
    }
    return SearchErrors(**changed)


def body_axis(turn: Floats, axis: int) -> Floats:
    """Return a body axis (..., 3), rotated by rotation vectors (..., 3), in the axes before the rotation."""
    unit = np.eye(3)[axis]
    angle = np.linalg.norm(turn, axis=-1)[..., None]
    first = np.cross(turn, unit)
    half = 0.5 * np.sinc(0.5 * angle / pi) ** 2  # (1 - cos(angle)) / angle^2
    return np.asarray(unit + np.sinc(angle / pi) * first + half * np.cross(turn, first))


def _within(name: str, value: ArrayLike, least: float, most: float) -> Floats:
    """Return numbers after a check that they lie strictly between two bounds."""
    array = numbers(name, value)
    fits = (array > least) & (array < most)
    if not fits.all():
        raise ValueError(f"{name}: must be above {least:g} and below {most:g}, got {array[~fits].flat[0]:g}")
    return array


def _positive(name: str, value: ArrayLike) -> Floats:
    """Return positive numbers; raise ValueError for others."""
    array = numbers(name, value)
    if not (array > 0.0).all():
        raise ValueError(f"{name}: must be positive, got {array[~(array > 0.0)].flat[0]:g}")
    return array


def _intervals(name: str, value: ArrayLike) -> Floats:
    array = numbers(name, value)
    if array.ndim < 2 or array.shape[-1] != 2:
        raise ValueError(f"{name}: expected shape (..., K, 2), got {array.shape}")
    if not (array[..., 0] <= array[..., 1]).all():
        raise ValueError(f"{name}: an interval ends before it begins; give its start, then its end, in s")
    return array
