"""CCSDS orbit ephemeris messages (OEM, CCSDS 502.0-B): read, write, and bring to one Hill frame.

Files hold km and km/s; here all is in m and m/s.  Reading and writing need the extra `ephemeris`
(the packages oem and astropy), which is imported when it is first used.
"""

import io
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from datetime import UTC, datetime
from os import PathLike
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from closeform.arrays import Floats, instance, number, numbers, sequence
from closeform.exchange.epochs import EpochError, imported, scale_of, seconds_of
from closeform.motion.elements import EARTH_MU, mean_motion_from_semi_major_axis
from closeform.motion.frames import AlongTrack, relative_from_inertial

# Frames of CCSDS 502.0-B annex B (and the usual J2000) that do not turn with the Earth.  TOD, MOD
# and TEME follow its pole: below 1e-11 rad/s, nothing beside a mean motion.
INERTIAL = ("EME2000", "GCRF", "ICRF", "J2000", "MCI", "MOD", "TEME", "TOD")

REQUIRED = ("OBJECT_NAME", "OBJECT_ID", "CENTER_NAME", "REF_FRAME", "TIME_SYSTEM", "START_TIME", "STOP_TIME")

SAME_EPOCH = 1e-8  # s: a tenth of a millimetre of flight in low orbit


@dataclass(frozen=True, eq=False)
class Ephemeris:
    """States of the object `name` (`object_id`) over time, as in one segment of an OEM.

    times: (T,) seconds since `epoch`, rising, T >= 2; states: (T, 6) in m and m/s in `frame`
    about `center`.  `epoch` is the ISO time of the first state in `time_system`.  Raises
    ValueError for wrong shapes, values that are not finite and times that do not rise.
    """

    name: str
    object_id: str
    center: str
    frame: str
    time_system: str
    epoch: str
    times: Floats
    states: Floats

    def __post_init__(self) -> None:
        for field in fields(self)[:6]:
            instance(field.name, getattr(self, field.name), str)
        times, states = numbers("times", self.times), numbers("states", self.states)
        if times.ndim != 1 or len(times) < 2 or states.shape != (len(times), 6):
            got = f"got {times.shape} and {states.shape}"
            raise ValueError(f"times, states: expected shapes (T,) and (T, 6) with T >= 2, {got}")
        flaw = _flaw(times, states)
        if flaw is not None:
            raise ValueError(f"times, states: row {flaw[0]}: {flaw[1]}")
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "states", states)


@dataclass(frozen=True, eq=False)
class CommonFrame:
    """Ephemerides of N objects, by `names`, in the Hill frame of the first: from `common_frame`.

    times: (T,) seconds since `epoch` in `time_system`; states: (N, T, 6) in m and m/s, zero for the
    first object; `mean_motion` [rad/s] and `radius` [m] of the circle that the chief's orbit is
    taken for.
    """

    names: tuple[str, ...]
    epoch: str
    time_system: str
    times: Floats
    states: Floats
    mean_motion: float
    radius: float


def read_oem(file: str | PathLike[str]) -> Ephemeris:
    """The ephemeris in an OEM `file`, in key-value or XML form, with one segment: m and m/s.

    States outside of USEABLE_START_TIME ... USEABLE_STOP_TIME are left out, as are accelerations
    and covariances.  Raises ValueError in one line, with file and line, for a file that is absent,
    damaged, not an OEM, of several segments, with fewer than two states, with values that are not
    finite or epochs that do not rise; ImportError where the extra is not installed.
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
    """Write `ephemeris` as an OEM in key-value form, to 1e-6 m and 1e-9 m/s.

    `originator` and `comments` go into the header.  An existing `file` is replaced.  Raises ImportError
    where the extra is not installed.
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


def common_frame(
    ephemerides: Sequence[Ephemeris], along_track: AlongTrack = "arc", mu: float = EARTH_MU
) -> CommonFrame:
    """The motion of `ephemerides` in the Hill frame of the first, at the epochs that all share.

    along_track: as in `relative_from_inertial`; with "arc", arcs are measured on the circle of
    `radius`.  That is the mean over the common epochs of the chief's osculating semi-major axis,
    and `mean_motion` belongs to it by Kepler's third law with `mu` [m^3/s^2].  No state is
    interpolated.

    Raises ValueError, naming the objects, for fewer than two, equal names, different centres,
    frames or time systems, a frame that turns with the Earth, and fewer than two common epochs.
    """
    ephemerides = tuple(sequence("ephemerides", ephemerides, Ephemeris))
    if not (number("mu", mu) > 0.0 and np.isfinite(mu)):
        raise ValueError(f"mu: must be positive and finite, got {mu:g} m^3/s^2")
    _comparable(ephemerides)
    chief = ephemerides[0]
    offsets = seconds_of([each.epoch for each in ephemerides], chief.time_system)
    shared = np.ones(len(chief.times), dtype=bool)
    nearest = []
    for each, offset in zip(ephemerides, offsets, strict=True):
        times = each.times + offset
        after = np.clip(np.searchsorted(times, chief.times), 1, len(times) - 1)
        index = after - (chief.times - times[after - 1] < times[after] - chief.times)
        shared &= np.abs(times[index] - chief.times) <= SAME_EPOCH
        nearest.append(index)
    if shared.sum() < 2:
        names = ", ".join(each.name for each in ephemerides)
        raise ValueError(f"{names}: fewer than two common epochs; sample them at the same times")
    pairs = zip(ephemerides, nearest, strict=True)
    inertial = np.stack([each.states[index[shared]] for each, index in pairs])
    speed_squared = (inertial[0, :, 3:] ** 2).sum(-1)
    inverse = 2.0 / np.linalg.norm(inertial[0, :, :3], axis=-1) - speed_squared / mu
    if not (inverse > 0.0).all():
        raise ValueError(f"{chief.name}: not on a closed orbit about {chief.center} with mu = {mu:g} m^3/s^2")
    radius = float((1.0 / inverse).mean())
    circle = radius if along_track == "arc" else None
    states = relative_from_inertial(inertial[0], inertial, along_track, circle)
    states[0] = 0.0
    return CommonFrame(
        names=tuple(each.name for each in ephemerides),
        epoch=chief.epoch,
        time_system=chief.time_system,
        times=chief.times[shared],
        states=states,
        mean_motion=float(mean_motion_from_semi_major_axis(radius, mu)),
        radius=radius,
    )


def _comparable(ephemerides: tuple[Ephemeris, ...]) -> None:
    if len(ephemerides) < 2:
        raise ValueError(f"ephemerides: at least two are needed, got {len(ephemerides)}")
    chief = ephemerides[0]
    if chief.frame.upper() not in INERTIAL:
        what = f"REF_FRAME {chief.frame} turns with the Earth or is unknown"
        raise ValueError(f"{chief.name}: {what}; convert to one of {', '.join(INERTIAL)}")
    names = set()
    for each in ephemerides:
        for keyword, mine, first in (
            ("CENTER_NAME", each.center, chief.center),
            ("REF_FRAME", each.frame, chief.frame),
            ("TIME_SYSTEM", each.time_system, chief.time_system),
        ):
            if mine.upper() != first.upper():
                what = f"{keyword} {mine} differs from {first} of {chief.name}"
                raise ValueError(f"{each.name}: {what}; convert one of them")
        if each.name in names:
            raise ValueError(f"{each.name}: two ephemerides have this OBJECT_NAME; give each its own")
        names.add(each.name)


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
    flaw = _flaw(times, states)
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


def _flaw(times: Floats, states: Floats) -> tuple[int, str] | None:
    """The first row that cannot stand, and why."""
    finite = np.isfinite(times) & np.isfinite(states).all(axis=1)
    if not finite.all():
        return int(np.argmin(finite)), "a value is not finite; remove or correct this state"
    rising = np.diff(times) > 0.0
    if not rising.all():
        return int(np.argmin(rising)) + 1, "epochs must rise; sort the states and remove doubles"
    return None


def _line(text: str, row: int) -> str:
    """Where data row `row` stands: its line in key-value form, else its number."""
    lines = [line.strip() for line in text.splitlines()]
    if row < 0 or "META_STOP" not in lines:
        return "time limits" if row < 0 else f"state {row + 1}"
    below = range(lines.index("META_STOP") + 1, len(lines))
    return f"line {[k for k in below if lines[k] and not lines[k].startswith('COMMENT')][row] + 1}"
