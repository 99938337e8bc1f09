"""States of craft in comma-separated values, whose header names the units: craft, x_m, ..., vx_m_s, ..."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path as FilePath
from typing import NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.exchange.message import number_in, within

LENGTHS = {"m": 1.0, "km": 1e3, "cm": 1e-2, "mm": 1e-3}
SPEEDS = {f"{unit}_s": scale for unit, scale in LENGTHS.items()}
TIMES = {"s": 1.0, "min": 60.0, "h": 3600.0}
UNITS = {
    **dict.fromkeys(("x", "y", "z"), LENGTHS),
    **dict.fromkeys(("vx", "vy", "vz"), SPEEDS),
    "time": TIMES,
}
STATE = tuple(UNITS)[:6]
HEADING = re.compile(r"(\w+?)(?:_(\w+)|\s*\[(.*)\])?")


class StateRows(NamedTuple):
    """States (R, 6) [m, m/s] of `craft`, one name for each row, at `times` (R,) [s]; 0 where a file has none.

    `frames`: of each row, "" where a file has none: Hill's.
    """

    craft: tuple[str, ...]
    times: Floats
    states: Floats
    frames: tuple[str, ...]


def read_states_csv(file: str | PathLike[str]) -> StateRows:
    """What a file of states holds; columns that are no part of a state are left alone.

    Raises ValueError, with file and line, for what is none: without units, with rows that are cut or
    numbers that are not finite, or where a craft stands twice at one time.
    """
    with within(file):
        try:
            text = FilePath(file).read_text(encoding="utf-8-sig")
        except OSError as error:
            raise ValueError(
                f"cannot be read: {(error.strerror or 'unknown').lower()}; check the path"
            ) from None
        except UnicodeDecodeError:
            raise ValueError("not a text file; give comma-separated values") from None
        header, *rows = csv.reader(text.splitlines()) if text.strip() else [[]]
        places, scales = columns_of([one.strip() for one in header])
        lines = [(number, row) for number, row in enumerate(rows, 2) if any(map(str.strip, row))]
        for number, row in lines:
            if len(row) != len(header):
                raise ValueError(f"line {number}: {len(row)} values for {len(header)} columns; correct it")
        if not lines:
            raise ValueError("has no states; add a line for each craft")
        cells = {name: [row[place].strip() for _, row in lines] for name, place in places.items()}
        numbers = {
            name: [
                number_in(number, cell) * scale for (number, _), cell in zip(lines, cells[name], strict=True)
            ]
            for name, scale in scales.items()
        }
        states = np.array([numbers[name] for name in STATE]).T
        times = np.array(numbers.get("time", [0.0] * len(lines)))
        sound = np.isfinite(states).all(axis=1) & np.isfinite(times)
        if not sound.all():
            raise ValueError(f"line {lines[int(np.argmin(sound))][0]}: a value is not finite; correct it")
        seen: dict[tuple[str, float], int] = {}
        for (number, _), one in zip(lines, zip(cells["craft"], times.tolist(), strict=True), strict=True):
            if seen.setdefault(one, number) != number:
                raise ValueError(f"line {number}: {one[0]} stands twice at {one[1]:g} s; keep one line")
        frames = tuple(cells.get("frame", [""] * len(lines)))
        return StateRows(tuple(cells["craft"]), times, states, frames)


def columns_of(header: Sequence[str]) -> tuple[Mapping[str, int], Mapping[str, float]]:
    """Where each column stands, and the scale to SI of those that are numbers."""
    places: dict[str, int] = {}
    scales: dict[str, float] = {}
    for place, heading in enumerate(header):
        found = HEADING.fullmatch(heading)
        name = heading if found is None or found[1] not in UNITS else found[1]
        if name not in (*UNITS, "craft", "frame"):
            continue
        unit = "" if found is None else (found[2] or (found[3] or "").strip().replace("/", "_"))
        if name in UNITS and unit not in UNITS[name]:
            if name == "time" and unit == "utc":
                continue  # beside time_s
            what = f"has the unknown unit {unit}" if unit else "has no unit"
            ways = ", ".join(f"{name}_{one}" for one in UNITS[name])
            raise ValueError(f"line 1: column {heading} {what}; name it one of {ways}")
        if name in places:
            raise ValueError(f"line 1: column {heading}: {name} stands twice; keep one")
        places[name] = place
        if name in UNITS:
            scales[name] = UNITS[name][unit]
    for name in ("craft", *STATE):
        if name not in places:
            called = name if name == "craft" else f"{name}_{next(iter(UNITS[name]))}"
            raise ValueError(
                f"line 1: no column {called}; a header is craft, x_m, y_m, z_m, vx_m_s, vy_m_s, vz_m_s"
            )
    return places, scales
