"""CSV of states with named columns and units: writing and reading."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path as FilePath

import numpy as np

from closeform.arrays import Floats, instance
from closeform.exchange.ccsds.entries import within
from closeform.exchange.ephemerides.ephemeris import Ephemeris
from closeform.exchange.export_tracks.track import FileFrame, Track, text_rows

HEAD = ("craft", "epoch", "time_s", "x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s")
FORM = ",".join(["%s"] + ["%.9f"] * 4 + ["%.12f"] * 3)
LENGTHS = {"m": 1.0, "km": 1e3, "cm": 1e-2, "mm": 1e-3}
SPEEDS = {"m_s": 1.0, "km_s": 1e3, "cm_s": 1e-2, "mm_s": 1e-3}
TIMES = {"s": 1.0, "min": 60.0, "h": 3600.0}
WANTED = {"time": TIMES, **dict.fromkeys("xyz", LENGTHS), **dict.fromkeys(("vx", "vy", "vz"), SPEEDS)}
STATE = ("x", "y", "z", "vx", "vy", "vz")
NAMED = re.compile(r"#\s*(center|frame|time_system|epoch)\s*[:=]\s*(.+?)\s*")


def csv_text(tracks: Iterable[Track], frame: FileFrame) -> str:
    """Return the CSV of all spacecraft, one row for each state; a burn has two rows for one time."""
    header = {"frame": frame.name, "center": frame.center, "time_system": frame.epoch.system}
    header["epoch"] = frame.stamps(np.zeros(1))[0]
    parts = ["\n".join([*(f"# {key} = {value}" for key, value in header.items()), ",".join(HEAD), ""])]
    for track in tracks:
        plain = re.search(r'[",\s]', track.name) is None
        name = track.name if plain else '"' + track.name.replace('"', '""') + '"'
        for piece in track.pieces:
            stamps = [f"{name},{stamp}" for stamp in frame.stamps(piece.times)]
            values = np.column_stack([piece.times, piece.states])
            parts.append(text_rows(stamps, FORM, values))
    return "".join(parts)


def read_csv(file: str | PathLike[str]) -> tuple[Ephemeris, ...]:
    """Read states of one or several spacecraft from a table with named columns and units.

    The first line that is not a comment names the columns.  The unit follows the last underscore, as in
    `x_m`, `y_km`, `vz_cm_s`, `time_s`, or is in brackets, as in `x [m]` and `vx [km/s]`.  Columns may be in
    any order; others are ignored.  `craft` names the spacecraft of a row.  Comments `# frame = EME2000`,
    `# center = EARTH`, `# time_system = UTC` and `# epoch = 2026-01-01T00:00:00` define the numbers.  Two
    rows of a spacecraft for one time are a burn: a new ephemeris begins with the second.

    Parameters
    ----------
    file : str or path-like
        Input file.

    Returns
    -------
    tuple of Ephemeris
        Ephemerides in m and m/s, one for each spacecraft and span between burns, in the order of the file.

    Raises
    ------
    ValueError
        If the file is absent, lacks columns, has columns without a unit or with an unknown one, cells that
        are not finite numbers, or times that do not increase; in one line, with file and line.

    References
    ----------
    docs/export.md.
    """
    instance("file", file, str, PathLike)
    with within(file):
        return tuple(ephemerides_of(state_rows(file)))


@dataclass(frozen=True, eq=False)
class StateRows:
    """Rows of a table: spacecraft (R,), `times` (R,) [s], `states` (R, 6) [m, m/s], and their `lines`.

    `times` is None for a table without times; `about` holds its comments, "UNKNOWN" if absent.
    """

    craft: tuple[str, ...]
    times: Floats | None
    states: Floats
    lines: tuple[int, ...]
    about: Mapping[str, str]


def state_rows(file: str | PathLike[str], timed: bool = True) -> StateRows:
    """Return the rows of a table of states; times are optional unless `timed`.

    Raises ValueError, with the line, for an invalid table.
    """
    try:
        text = FilePath(file).read_text(encoding="utf-8-sig")
    except OSError as error:
        raise ValueError(f"cannot be read: {error.strerror}; check the path") from None
    except UnicodeDecodeError:
        raise ValueError("not a text file; give a table of comma-separated values") from None
    about = {"frame": "UNKNOWN", "center": "UNKNOWN", "time_system": "UNKNOWN", "epoch": "UNKNOWN"}
    every = text.splitlines()
    about |= {found[1]: found[2] for line in every if (found := NAMED.fullmatch(line)) is not None}
    numbered = [(k, line) for k, line in enumerate(every, 1) if line.strip() and line[:1] != "#"]
    if not numbered:
        raise ValueError("has no rows; give a line of column names and a row for each state")
    table = list(csv.reader(line for _, line in numbered))
    columns, craft = _columns(table[0], timed)
    if len(table) < 2:
        raise ValueError("has no rows; give a row for each state below the column names")
    lines = tuple(number for number, _ in numbered[1:])
    values = _numbers(table[1:], lines, columns, len(table[0]))
    whose = tuple(row[craft].strip() if craft is not None else "" for row in table[1:])
    times = values.get("time")
    return StateRows(whose, times, np.array([values[one] for one in STATE]).T, lines, about)


def _columns(names: Sequence[str], timed: bool) -> tuple[dict[str, tuple[int, float]], int | None]:
    """Return the column and unit of each quantity, and the column of the spacecraft's name."""
    found: dict[str, tuple[int, float]] = {}
    for k, name in enumerate(names):
        parts = re.fullmatch(r"\s*([a-z]+)(?:_|\s*\[)?(.*?)\]?\s*", name.lower())
        quantity, unit = (parts[1], parts[2].replace("/", "_")) if parts else ("", "")
        if quantity not in WANTED or (quantity, unit) == ("time", "utc"):  # in addition to seconds
            continue
        units = WANTED[quantity]
        known = ", ".join(f"{quantity}_{one}" for one in units)
        if not unit:
            raise ValueError(f"column '{name.strip()}' has no unit; name it one of {known}")
        if unit not in units:
            raise ValueError(f"column '{name.strip()}' has an unknown unit; name it one of {known}")
        if quantity in found:
            raise ValueError(f"column '{name.strip()}' occurs twice; keep one")
        found[quantity] = k, units[unit]
    if missing := [one for one in WANTED if one not in found and (timed or one != "time")]:
        example = ", ".join(f"{one}_{next(iter(WANTED[one]))}" for one in missing)
        raise ValueError(f"has no column of {', '.join(missing)}; add {example}")
    lower = [name.strip().lower() for name in names]
    return found, lower.index("craft") if "craft" in lower else None


def _numbers(
    rows: Sequence[Sequence[str]], lines: Sequence[int], columns: dict[str, tuple[int, float]], count: int
) -> dict[str, Floats]:
    """Return each quantity (R,) in SI units."""
    for row, line in zip(rows, lines, strict=True):
        if len(row) != count:
            raise ValueError(f"line {line}: has {len(row)} cells for {count} columns; correct the row")
    found = {}
    for quantity, (place, size) in columns.items():
        try:
            found[quantity] = np.array([float(row[place]) for row in rows]) * size
        except ValueError:
            wrong = next(k for k, row in enumerate(rows) if not _is_number(row[place]))
            what = f"'{rows[wrong][place].strip()[:30]}' is not a number"
            raise ValueError(f"line {lines[wrong]}: {what}; correct or remove the row") from None
    sound = np.isfinite(list(found.values())).all(axis=0)
    if not sound.all():
        wrong = int(np.argmin(sound))
        raise ValueError(f"line {lines[wrong]}: a value is not finite; correct or remove the row")
    return found


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def ephemerides_of(rows: StateRows, only: str | None = None) -> Iterable[Ephemeris]:
    """Yield the ephemerides of each craft, or of craft `only`, divided where two rows have the same time."""
    times, lines, about = rows.times, rows.lines, rows.about
    assert times is not None
    for name in dict.fromkeys(rows.craft) if only is None else (only,):
        own = np.flatnonzero([one == name for one in rows.craft])
        gaps = np.diff(times[own])
        if (gaps < 0.0).any():
            line = lines[own[int(np.argmax(gaps < 0.0)) + 1]]
            raise ValueError(f"line {line}: times of {name or 'the craft'} must increase; sort the rows")
        for part in np.split(own, np.flatnonzero(gaps == 0.0) + 1):
            if len(part) < 2:
                line = lines[part[0]]
                raise ValueError(f"line {line}: a span of one state; at least two are needed")
            yield Ephemeris(
                name=name or "UNKNOWN",
                object_id=name or "UNKNOWN",
                times=times[part],
                states=rows.states[part],
                center=about["center"],
                frame=about["frame"],
                time_system=about["time_system"],
                epoch=about["epoch"],
            )
