"""CCSDS orbit ephemeris messages (OEM, CCSDS 502.0-B): read and write.

Files hold km and km/s; here all is in m and m/s.  Reading and writing need the extra `ephemeris`
(the packages oem and astropy), which is imported when it is first used.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from os import PathLike
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from closeform.arrays import instance, sequence
from closeform.exchange.ephemeris import SAME_EPOCH, Ephemeris, flaw_of
from closeform.exchange.epochs import EpochError, imported, scale_of, seconds_of

REQUIRED = ("OBJECT_NAME", "OBJECT_ID", "CENTER_NAME", "REF_FRAME", "TIME_SYSTEM", "START_TIME", "STOP_TIME")


def read_oem(file: str | PathLike[str]) -> Ephemeris:
    """The ephemeris in an OEM, in key-value or XML form, with one segment.

    States outside of USEABLE_START_TIME ... USEABLE_STOP_TIME are left out, as are accelerations
    and covariances.

    Parameters
    ----------
    file : str or path-like
        The file, in km and km/s as the standard has it.

    Returns
    -------
    Ephemeris
        In m and m/s.

    Raises
    ------
    ValueError
        If the file is absent, damaged, not an OEM, of several segments, with fewer than two states, with
        values that are not finite or epochs that do not rise; in one line, with file and line.
    ImportError
        If the extra `ephemeris` is not installed.

    References
    ----------
    CCSDS 502.0-B, Orbit Data Messages; docs/ephemerides.md.
    """
    instance("file", file, str, PathLike)
    try:
        text = FilePath(file).read_text(encoding="utf-8-sig")
    except OSError as error:
        raise ValueError(f"{file}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ValueError(f"{file}: not a text file; give an OEM in key-value or XML form") from None
    with _named(file):
        header, rows = _segment(text)
        missing = [key for key in REQUIRED if not header.get(key)]
        if missing:
            raise ValueError(f"keyword {missing[0]} is missing between META_START and META_STOP")
        return _ephemeris(text, header, rows)


def write_oem(
    file: str | PathLike[str],
    ephemeris: Ephemeris,
    *,
    originator: str = "CLOSEFORM",
    comments: Sequence[str] = (),
) -> None:
    """Write an ephemeris as an OEM in key-value form, to 1e-6 m and 1e-9 m/s.

    Parameters
    ----------
    file : str or path-like
        Where to; a file that is there is replaced.
    ephemeris : Ephemeris
        What to write.
    originator : str, default "CLOSEFORM"
        ORIGINATOR in the header.
    comments : sequence of str, optional
        Lines of COMMENT in the header.

    Raises
    ------
    ValueError
        If an argument is of another kind, or `epoch` or `time_system` cannot be read.
    ImportError
        If the extra `ephemeris` is not installed.

    References
    ----------
    CCSDS 502.0-B, Orbit Data Messages; docs/ephemerides.md.
    """
    instance("file", file, str, PathLike)
    instance("ephemeris", ephemeris, Ephemeris)
    instance("originator", originator, str)
    comments = sequence("comments", comments, str)
    time = imported("astropy.time")
    start = time.Time(ephemeris.epoch, scale=scale_of(ephemeris.time_system))
    epochs = start + time.TimeDelta(ephemeris.times, format="sec")
    epochs.precision = 9
    stamps = [re.sub(r"\.?0+$", "", stamp) for stamp in epochs.isot]
    lines = [
        "CCSDS_OEM_VERS = 2.0",
        *(f"COMMENT {comment}" for comment in comments),
        f"CREATION_DATE = {datetime.now(UTC):%Y-%m-%dT%H:%M:%S}",
        f"ORIGINATOR = {originator}",
        "",
        "META_START",
        f"OBJECT_NAME = {ephemeris.name}",
        f"OBJECT_ID = {ephemeris.object_id}",
        f"CENTER_NAME = {ephemeris.center}",
        f"REF_FRAME = {ephemeris.frame}",
        f"TIME_SYSTEM = {ephemeris.time_system}",
        f"START_TIME = {stamps[0]}",
        f"STOP_TIME = {stamps[-1]}",
        "META_STOP",
        "",
    ]
    for stamp, state in zip(stamps, ephemeris.states / 1e3, strict=True):
        position = " ".join(f"{value:17.9f}" for value in state[:3])
        lines.append(f"{stamp} {position} " + " ".join(f"{value:16.12f}" for value in state[3:]))
    FilePath(file).write_text("\n".join(lines) + "\n", encoding="utf-8")


@contextmanager
def _named(file: str | PathLike[str]) -> Iterator[None]:
    """Put the file's name before the message of a ValueError, in one line."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"{file}: {' '.join(str(error).split())}") from None


def _segment(text: str) -> tuple[dict[str, str], list[tuple[Any, ...]]]:
    """Metadata and rows (epoch, x, y, z, vx, vy, vz, ...) of the only segment."""
    parsers = imported("oem.parsers")
    if not text.strip():
        raise ValueError("empty file; give an OEM in key-value or XML form")
    xml = text.lstrip().startswith("<")
    if not xml and not text.startswith("CCSDS_OEM_VERS"):
        raise ValueError("line 1: not an OEM, which starts with CCSDS_OEM_VERS; give another file")
    # The standard allows KEY=VALUE, the parser asks for blanks around the sign.
    text = text if xml else re.sub(r"(?m)^[ \t]*([A-Z_]+)[ \t]*=[ \t]*", r"\1 = ", text)
    try:
        _, segments = (parsers.parse_xml_oem if xml else parsers.parse_kvn_oem)(io.StringIO(text.lstrip()))
    except ValueError as error:
        what = str(error).replace("Error on line", "line").rstrip(".")
        raise ValueError(f"{what}; correct the file or ask its originator for it again") from None
    except (AttributeError, IndexError, KeyError, SyntaxError, TypeError):  # what damaged XML raises
        raise ValueError("not a complete OEM; ask its originator for it again") from None
    if len(segments) != 1:
        raise ValueError(f"has {len(segments)} segments; give a file for each segment")
    return segments[0]["header"], list(segments[0]["data"])


def _ephemeris(text: str, header: dict[str, str], rows: list[tuple[Any, ...]]) -> Ephemeris:
    if len(rows) < 2:
        raise ValueError(f"has {len(rows)} states; at least two are needed")
    system = header["TIME_SYSTEM"].strip().upper()
    stamps = [row[0] for row in rows]
    limits = [header.get("USEABLE_" + key) or header[key] for key in ("START_TIME", "STOP_TIME")]
    try:
        seconds = seconds_of([*limits, *stamps], system)
    except EpochError as error:
        raise ValueError(f"{_line(text, error.index - 2)}: {error}") from None
    (start, stop), times = seconds[:2], seconds[2:]
    states = np.array([row[1:7] for row in rows]) * 1e3
    flaw = flaw_of(times, states)
    if flaw is not None:
        raise ValueError(f"{_line(text, flaw[0])}: {flaw[1]}")
    useable = (times >= start - SAME_EPOCH) & (times <= stop + SAME_EPOCH)
    if useable.sum() < 2:
        raise ValueError(f"has {useable.sum()} states from {limits[0]} to {limits[1]}; correct these limits")
    first = int(np.argmax(useable))
    return Ephemeris(
        name=header["OBJECT_NAME"].strip(),
        object_id=header["OBJECT_ID"].strip(),
        center=header["CENTER_NAME"].strip(),
        frame=header["REF_FRAME"].strip(),
        time_system=system,
        epoch=stamps[first].rstrip("Z"),
        times=times[useable] - times[first],
        states=states[useable],
    )


def _line(text: str, row: int) -> str:
    """Where data row `row` stands: its line in key-value form, else its number."""
    lines = [line.strip() for line in text.splitlines()]
    if row < 0 or "META_STOP" not in lines:
        return "time limits" if row < 0 else f"state {row + 1}"
    below = range(lines.index("META_STOP") + 1, len(lines))
    return f"line {[k for k in below if lines[k] and not lines[k].startswith('COMMENT')][row] + 1}"
