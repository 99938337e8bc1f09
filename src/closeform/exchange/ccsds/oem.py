"""CCSDS orbit ephemeris messages (OEM, CCSDS 502.0-B): read and write.

Files contain km and km/s; this module returns m and m/s.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from contextlib import nullcontext
from os import PathLike
from pathlib import Path as FilePath

from closeform.arrays import Floats, instance, sequence
from closeform.exchange.ccsds.entries import message, within
from closeform.exchange.ccsds.message_text import Segment, oem_key_values
from closeform.exchange.ccsds.oem_segments import ephemeris_of, segments_of
from closeform.exchange.ephemerides.ephemeris import SAME_EPOCH, Ephemeris
from closeform.exchange.epochs import Epoch, seconds_of


def read_oem(file: str | PathLike[str]) -> Ephemeris:
    """Read the ephemeris of an OEM, in key-value or XML form, with one segment.

    States outside of USEABLE_START_TIME ... USEABLE_STOP_TIME and accelerations are ignored.

    Parameters
    ----------
    file : str or path-like
        File in km and km/s, as in the standard.

    Returns
    -------
    Ephemeris
        Ephemeris in m and m/s, with the covariances of the file.

    Raises
    ------
    ValueError
        If the file is absent, damaged, not an OEM, of several segments, with fewer than two states, with
        values that are not finite or epochs that do not increase, with covariances that are incomplete,
        indefinite or in an unknown frame; in one line, with file and line.

    References
    ----------
    CCSDS 502.0-B, Orbit Data Messages; docs/ephemerides.md.
    """
    instance("file", file, str, PathLike)
    with within(file):
        segments = segments_of(message(file, "OEM"))
        if len(segments) > 1:
            remedy = "give a file for each segment, or read them with read_oem_segments"
            raise ValueError(f"has {len(segments)} segments; {remedy}")
        return ephemeris_of(segments[0])


def read_oem_segments(file: str | PathLike[str]) -> tuple[Ephemeris, ...]:
    """Read the ephemerides of an OEM with several segments, one for each, in order of time.

    Two segments are separated by a manoeuvre or a gap, across which nothing may be interpolated.  Each counts
    time from its own first state, and has its own covariances.

    Parameters
    ----------
    file : str or path-like
        File in km and km/s, as in the standard.

    Returns
    -------
    tuple of Ephemeris
        Ephemerides in m and m/s.

    Raises
    ------
    ValueError
        As `read_oem`; or if segments are of different objects or time systems, or the useable span of one
        begins before that of the previous one has ended.

    References
    ----------
    CCSDS 502.0-B, Orbit Data Messages, 5.2.4; docs/ephemerides.md.
    """
    instance("file", file, str, PathLike)
    with within(file):
        found = []
        segments = segments_of(message(file, "OEM"))
        for number, segment in enumerate(segments, 1):
            with within(f"segment {number}") if len(segments) > 1 else nullcontext():
                found.append(ephemeris_of(segment))
        for number, (one, other) in enumerate(itertools.pairwise(found), 2):
            for field in ("name", "object_id", "time_system"):
                mine, last = getattr(other, field), getattr(one, field)
                if mine != last:
                    raise ValueError(
                        f"segment {number}: is of {mine}, but the previous one is of {last}; give two files"
                    )
            begins = seconds_of([one.epoch, other.epoch], one.time_system)[1]
            if begins < one.times[-1] - SAME_EPOCH:
                early = one.times[-1] - begins
                what = f"begins {early:g} s before the previous one ends; correct the useable spans"
                raise ValueError(f"segment {number}: {what}")
        return tuple(found)


def write_oem(
    file: str | PathLike[str],
    ephemeris: Ephemeris,
    *,
    originator: str = "CLOSEFORM",
    comments: Sequence[str] = (),
) -> None:
    """Write an ephemeris as an OEM in key-value form, to 1e-9 m and 1e-12 m/s, with its covariances.

    Parameters
    ----------
    file : str or path-like
        Output file; an existing file is replaced.
    ephemeris : Ephemeris
        Ephemeris to write.
    originator : str, default "CLOSEFORM"
        ORIGINATOR in the header.
    comments : sequence of str, optional
        Lines of COMMENT in the header.

    Raises
    ------
    ValueError
        If an argument is of another type, or `epoch` or `time_system` is invalid.

    References
    ----------
    CCSDS 502.0-B, Orbit Data Messages; docs/ephemerides.md.
    """
    instance("file", file, str, PathLike)
    instance("ephemeris", ephemeris, Ephemeris)
    instance("originator", originator, str)
    comments = sequence("comments", comments, str)
    start = Epoch(ephemeris.epoch, ephemeris.time_system)

    def stamps(times: Floats) -> list[str]:
        return [re.sub(r"\.?0+$", "", stamp) for stamp in start.stamps(times)]

    own, held = stamps(ephemeris.times), ephemeris.covariances
    metadata = {
        "OBJECT_NAME": ephemeris.name,
        "OBJECT_ID": ephemeris.object_id,
        "CENTER_NAME": ephemeris.center,
        "REF_FRAME": ephemeris.frame,
        "TIME_SYSTEM": ephemeris.time_system,
        "START_TIME": own[0],
        "STOP_TIME": own[-1],
    }
    known = () if held is None else (stamps(held.times), held.matrices, held.frames)
    text = oem_key_values([Segment(metadata, own, ephemeris.states, *known)], comments, originator)
    FilePath(file).write_text(text, encoding="utf-8")
