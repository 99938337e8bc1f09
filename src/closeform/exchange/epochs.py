"""Epochs in the notation of CCSDS messages, seconds between them, and conversion to UTC.

ERFA provides leap seconds and conversions of time systems; dates have two parts, which keeps
nanoseconds.  It is imported at first use.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, date, datetime, timedelta
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, numbers

SYSTEMS = ("GPS", "TAI", "TCB", "TCG", "TDB", "TT", "UTC")
DAY = 86400.0  # s
GPS_BEHIND_TAI = 19.0  # s, for good
EXAMPLE = "2010-07-27T00:00:00"

EPOCH = re.compile(r"(\d{4}-(?:\d{3}|\d\d-\d\d))T(\d\d):(\d\d):(\d\d(?:\.\d*)?)Z?")
Dates = tuple[Floats, Floats]  # Julian dates in two parts whose sum is the date


class EpochError(ValueError):
    """Invalid epoch; `index` is its position among several."""

    def __init__(self, index: int, stamp: str) -> None:
        super().__init__(f"'{stamp}' is not a valid epoch; write it in the form {EXAMPLE}")
        self.index = index


@dataclass(frozen=True)
class Epoch:
    """An instant: its notation (`stamp`) and time `system`; ValueError if it is invalid."""

    stamp: str
    system: str = "UTC"

    def __post_init__(self) -> None:
        _ = self._date

    @classmethod
    def of(cls, text: str) -> Epoch:
        """Return an epoch from "2026-11-22T12:00:00Z", in UTC, or "2026-11-22T12:00:15 TAI"."""
        stamp, _, system = text.strip().partition(" ")
        return cls(stamp, system.strip() or "UTC")

    def __str__(self) -> str:
        return f"{self.stamp.removesuffix('Z')} {self.system}"

    @cached_property
    def _date(self) -> Dates:
        return dates([self.stamp], self.system)

    def until(self, other: Epoch) -> float:
        """Return the seconds until another epoch, of any time system; negative if it is earlier."""
        if self.system.upper() == other.system.upper():
            return float(seconds_of([self.stamp, other.stamp], self.system)[1])
        one, two = (tai(each._date, each.system) for each in (self, other))
        return float(between(one, two)[0])

    def seconds_until(self, other: Epoch, times: ArrayLike) -> Dates:
        """Return the seconds until times (T,) [s] after another epoch, in two parts: whole days and the rest.

        The seconds are those of this epoch's time system if both have the same one, else those of TAI.
        """
        later, own = other._later(times), self._date
        if self.system.upper() != other.system.upper():
            later, own = tai(later, other.system), tai(own, self.system)
        return (later[0] - own[0]) * DAY, (later[1] - own[1]) * DAY

    def stamps(self, times: ArrayLike) -> list[str]:
        """Return the epochs that are seconds (T,) later, in the same time system, to a nanosecond."""
        later = self._later(times)
        if self.system.upper() != "UTC":
            return written(later, "TAI", 9)
        return written(utc(later), "UTC", 9)

    def utc(self, times: ArrayLike, decimals: int = 9) -> list[str]:
        """Return the epoch in UTC, with a Z at the end."""
        later = utc(tai(self._later(times), self.system))
        return [f"{stamp}Z" for stamp in written(later, "UTC", decimals)]

    def _later(self, times: ArrayLike) -> Dates:
        """Return dates that are seconds (T,) later, counted like those of `dates`."""
        day, part = self._date
        whole, rest = np.divmod(np.ravel(numbers("times", times)), DAY)
        return day + whole, part + rest / DAY


def now() -> str:
    """Return the current second in UTC, in the notation of CREATION_DATE."""
    return f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%S}"


def seconds_of(stamps: Sequence[str], system: str) -> Floats:
    """Return the seconds of ISO epochs after the first of them, with leap seconds."""
    found = dates(stamps, system)
    return between((found[0][:1], found[1][:1]), found).round(10)  # as in the text: 20.0


def between(one: Dates, other: Dates) -> Floats:
    """Return the seconds from one date to another, accurate to tenths of a nanosecond."""
    return (other[0] - one[0]) * DAY + (other[1] - one[1]) * DAY


def dates(stamps: Sequence[str], system: str) -> Dates:
    """Return dates of ISO epochs in days of 86400 s, in TAI for UTC epochs and else in their own system."""
    if (known := system.upper()) not in SYSTEMS:
        why = "requires tables of the Earth's rotation" if known == "UT1" else "is not supported"
        raise ValueError(f"TIME_SYSTEM {system} {why}; use one of {', '.join(SYSTEMS)}")
    import erfa

    parts = []
    for index, stamp in enumerate(stamps):
        try:
            parts.append(clock(stamp.strip(), known))
        except ValueError:
            raise EpochError(index, stamp) from None
    columns = np.array(parts, dtype=float).T
    year, month, day, hour, minute = columns[:5].astype(int)
    with quiet():
        scale = "UTC" if known == "UTC" else "TAI"
        found = erfa.dtf2d(scale, year, month, day, hour, minute, columns[5])
        return dated(erfa.utctai(*found) if known == "UTC" else found)


def clock(stamp: str, system: str) -> tuple[int, int, int, int, int, float]:
    """Return year, month, day, hour, minute and second of a CCSDS epoch, in either notation of the day."""
    match = EPOCH.fullmatch(stamp)
    if match is None:
        raise ValueError
    day, hour, minute, second = calendar(match[1]), int(match[2]), int(match[3]), float(match[4])
    if hour > 23 or minute > 59 or second >= 60.0 + (hour == 23 and minute == 59 and leap(day, system)):
        raise ValueError
    return day.year, day.month, day.day, hour, minute, second


@lru_cache(maxsize=1000)
def calendar(text: str) -> date:
    """Return a date from month and day or from the day of the year."""
    year, _, rest = text.partition("-")
    if "-" in rest:
        return date.fromisoformat(text)
    day = date(int(year), 1, 1) + timedelta(int(rest) - 1)
    if day.year != int(year):
        raise ValueError
    return day


@lru_cache(maxsize=1000)
def leap(day: date, system: str) -> bool:
    """Return True if a day ends with a known leap second."""
    if system != "UTC":
        return False
    import erfa

    after = day + timedelta(1)
    with quiet():
        behind = [erfa.dat(one.year, one.month, one.day, 0.0) for one in (day, after)]
    return bool(behind[1] - behind[0] > 0.5)


def tai(found: Dates, system: str) -> Dates:
    """Return dates of a time system (see `dates`) in TAI."""
    import erfa

    known = system.upper()
    with quiet():
        if known in ("UTC", "TAI"):
            return found
        if known == "GPS":
            return found[0], found[1] + GPS_BEHIND_TAI / DAY
        if known == "TCB":
            found = erfa.tcbtdb(*found)
        if known == "TCG":
            found = erfa.tcgtt(*found)
        if known in ("TCB", "TDB"):  # at the Earth's centre
            found = erfa.tdbtt(*found, erfa.dtdb(*found, 0.0, 0.0, 0.0, 0.0))
        return dated(erfa.tttai(*found))


def dated(found: tuple[Any, Any]) -> Dates:
    """Return dates from ERFA, which has no type annotations."""
    return found


def utc(found: Dates) -> Dates:
    """Return dates of TAI in UTC, as ERFA counts them: a day with a leap second is one day."""
    import erfa

    with quiet():
        return dated(erfa.taiutc(*found))


def written(found: Dates, scale: str, decimals: int) -> list[str]:
    """Return dates as ISO epochs; "UTC" is the scale with leap seconds."""
    import erfa

    with quiet():
        *days, times = erfa.d2dtf(scale, decimals, *found)
    rows = zip(
        *(column.tolist() for column in (*days, times["h"], times["m"], times["s"], times["f"])), strict=True
    )
    dot = "." if decimals else ""
    return [
        f"{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}{dot}"
        + f"{part:0{decimals}}" * bool(dot)
        for year, month, day, hour, minute, second, part in rows
    ]


@contextmanager
def quiet() -> Iterator[None]:
    """Suppress ERFA's warnings about years without known leap seconds."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield
