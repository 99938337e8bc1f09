"""Epochs of CCSDS messages: instants as they are written, in the scales that astropy counts.

astropy comes with the extra `ephemeris`, and is imported when it is first used.
"""

import re
import warnings
from collections.abc import Sequence
from datetime import date, timedelta
from importlib import import_module
from typing import Any

import numpy as np

from closeform.arrays import Floats

# Scales in which astropy counts seconds; GPS time runs at TAI's rate, a constant 19 s behind.
SCALES = {"GPS": "tai"} | {name.upper(): name for name in ("tai", "tcb", "tcg", "tdb", "tt", "ut1", "utc")}

EPOCH = re.compile(r"(\d{4})-(?:(\d{3})|(\d\d-\d\d))T(\d\d:\d\d:\d\d(?:\.\d*)?)Z?")


class EpochError(ValueError):
    """What is no epoch; `index`: which of several."""

    def __init__(self, index: int, stamp: str) -> None:
        super().__init__(f"'{stamp}' is no epoch; write it as 2010-07-27T00:00:00")
        self.index = index


def seconds_of(stamps: Sequence[str], system: str) -> Floats:
    """Seconds of ISO epochs after the first of them; leap seconds are counted."""
    scale = scale_of(system)
    iso = []
    for index, stamp in enumerate(stamps):
        try:
            iso.append(calendar(stamp.strip()))
        except ValueError:
            raise EpochError(index, stamp) from None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # "dubious year": UTC after the last known leap second
        epochs = imported("astropy.time").Time(iso, format="isot", scale=scale)
        return np.asarray((epochs - epochs[0]).to_value("s"), dtype=float).round(10)  # as written: 20.0


def calendar(stamp: str) -> str:
    """A CCSDS epoch, with month and day or day of year, as calendar date and clock."""
    match = EPOCH.fullmatch(stamp)
    if match is None:
        raise ValueError
    year, day_of_year, month_day, clock = match.groups()
    if day_of_year:
        day = date(int(year), 1, 1) + timedelta(int(day_of_year) - 1)
    else:
        day = date.fromisoformat(f"{year}-{month_day}")
    hour, minute, second = (float(part) for part in clock.split(":"))
    if day.year != int(year) or hour > 23 or minute > 59 or second >= 61:  # 60: a leap second
        raise ValueError
    return f"{day}T{clock}"


def scale_of(system: str) -> str:
    """The scale of a TIME_SYSTEM in astropy's words."""
    if system.upper() not in SCALES:
        raise ValueError(f"TIME_SYSTEM {system} is not supported; use one of {', '.join(sorted(SCALES))}")
    return SCALES[system.upper()]


def imported(module: str) -> Any:
    """A module of the extra `ephemeris`; ImportError with the remedy where it is missing."""
    try:
        return import_module(module)
    except ImportError:
        package = module.partition(".")[0]
        raise ImportError(f"{package} is not installed; run: pip install 'closeform[ephemeris]'") from None
