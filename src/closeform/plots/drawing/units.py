"""Units in which figures show lengths, speeds, thrust and times, and their clocks."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.motion.arc import START
from closeform.motion.path import Path
from closeform.plots.drawing.inputs import one_craft


@dataclass(frozen=True)
class Unit:
    """Display unit; `size` is its value in SI."""

    size: float
    name: str

    def text(self, value: float, digits: int = 4) -> str:
        """Return a value in SI as text with the unit."""
        return f"{value / self.size:.{digits}g} {self.name}"


def prefixed(greatest: float, name: str, prefixes: str = " mµn") -> Unit:
    """Return a unit with the prefix in which numbers up to `greatest` are above 0.1, if there is one."""
    sizes = {prefix: 1e-3**k for k, prefix in enumerate(prefixes)}
    known = [prefix for prefix, size in sizes.items() if greatest >= 0.1 * size]
    chosen = known[0] if known else prefixes[-1] if greatest > 0.0 else prefixes[1]
    return Unit(sizes[chosen], chosen.strip() + name)


def length_unit(longest: float) -> Unit:
    """Return the display unit of a length [m]: km from 10 km, mm below 0.1 m, otherwise m."""
    return Unit(1e3, "km") if longest >= 1e4 else prefixed(longest or 1.0, "m", " m")


def thrust_unit(greatest: float, basic: str = "m/s²") -> Unit:
    """Return the display unit for a maximum thrust [m/s^2 or N]."""
    return prefixed(greatest, basic)


def speed_unit(greatest: float) -> Unit:
    """Return the display unit for a maximum speed [m/s]."""
    return prefixed(greatest, "m/s", " m")


def length(value: float) -> str:
    """Return a length [m] as text with its unit."""
    return length_unit(value).text(value, 3)


def speed(value: float) -> str:
    """Return a speed [m/s] as text with its unit."""
    return speed_unit(value).text(value)


def rounded_down(most: float) -> float:
    """Return the largest of 1, 2 and 5 times a power of ten that does not exceed a positive number."""
    power = 10.0 ** np.floor(np.log10(most))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= most))


def plural(count: int, noun: str) -> str:
    """Return a count with its noun."""
    return f"{count} {noun}{'s' * (count != 1)}"


def signed_percent(share: float) -> str:
    """Return a relative change as a signed percentage."""
    return f"{100 * share:+z.3g} %".replace("-", "−")


@dataclass(frozen=True)
class Clock:
    """Time axis with its `unit`; `other` is the unit of the upper axis (None in deep space)."""

    unit: Unit
    other: Unit | None = None

    def __call__(self, time: Any) -> Any:
        """Return times [s] in the unit of the axis."""
        return np.asarray(time) / self.unit.size

    def text(self, time: float) -> str:
        """Return a time [s] as text with the unit of the axis."""
        return f"{time / self.unit.size:.2f} {self.unit.name}"


def plain_unit(duration: float) -> Unit:
    """Return the time unit (s, min, h or d) that suits a duration [s]."""
    for limit, unit in ((300.0, Unit(1.0, "s")), (3e4, Unit(60.0, "min")), (4e5, Unit(3600.0, "h"))):
        if duration <= limit:
            return unit
    return Unit(86400.0, "d")


def clock(path: Path, start: float, end: float) -> Clock:
    """Return the time axis of a path from `start` to `end` [s].

    It shows minutes (or a similar unit) with orbits on the upper axis; for four orbits or more, the two are
    swapped.
    """
    plain, period = plain_unit(end - start), path.orbit.period
    if not np.isfinite(period):
        return Clock(plain)
    orbits = Unit(period, "orbits")
    return Clock(orbits, plain) if end - start >= 4 * period else Clock(plain, orbits)


def instants(start: float, end: float, *paths: Path) -> Floats:
    """Return times [s] for smooth curves, including both sides of every joint between arcs."""
    orbits = max(((end - start) / path.orbit.period for path in paths), default=0.0)
    grid = np.linspace(start, end, int(np.clip(240 * orbits, 900, 6000)))
    joints = np.concatenate([path.arcs[:, START] for path in paths])
    joints = joints[(joints > start) & (joints <= end)]
    return np.unique(np.concatenate([grid, joints, np.nextafter(joints, -np.inf)]))


def common_time(path: Path, other: Path) -> tuple[float, float]:
    """Return the common start and end [s] of two paths; raise ValueError if there is none, or for batches."""
    one_craft("path", path)
    one_craft("other", other)
    start, end = max(path.start, other.start), min(path.end, other.end)
    if not start < end:
        raise ValueError(
            f"other: shares no time with path ({path.start:g} to {path.end:g} s and "
            f"{other.start:g} to {other.end:g} s)"
        )
    return start, end
