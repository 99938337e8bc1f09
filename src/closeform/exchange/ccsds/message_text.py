"""Text of CCSDS messages (502.0-B, 504.0-B): the header, keywords with values, and segments of an OEM."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from xml.sax.saxutils import escape

import numpy as np

from closeform.arrays import Floats
from closeform.exchange.ephemerides.covariance import LOWER
from closeform.exchange.epochs import now
from closeform.exchange.export_tracks.track import text_rows

ORIGINATOR = "CLOSEFORM"
STATE = {"X": "km", "Y": "km", "Z": "km", "X_DOT": "km/s", "Y_DOT": "km/s", "Z_DOT": "km/s"}
FORMATS = {"km": "%.12f", "km/s": "%.15f"}  # to a nanometre, and a picometre per second
ROW = " ".join(["%s", *(FORMATS[unit] for unit in STATE.values())])  # an epoch and a state
SCHEMA = "https://sanaregistry.org/r/ndmxml_unqualified/ndmxml-3.0.0-master-3.0.xsd"


@dataclass(frozen=True, eq=False)
class Segment:
    """Segment of an OEM: `states` (T, 6) [m, m/s] at epochs as text, `covariances` (C, 6, 6) at `known` ones.

    `frames` (C,) are those of the covariances; one that is REF_FRAME of the `metadata` is not written.
    """

    metadata: Mapping[str, str]
    stamps: Sequence[str]
    states: Floats
    known: Sequence[str] = ()
    covariances: Floats = field(default_factory=lambda: np.empty((0, 6, 6)))
    frames: Sequence[str] = ()


def head(kind: str, version: str, comments: Sequence[str], originator: str = ORIGINATOR) -> list[str]:
    """Return the first lines of a message of a `kind` ("OEM")."""
    about = [f"COMMENT {line}" for line in comments]
    made = [f"CREATION_DATE = {now()}", f"ORIGINATOR = {originator}"]
    return [f"CCSDS_{kind}_VERS = {version}", *about, *made]


def covariance_units(parts: Sequence[str], length: str) -> dict[str, str]:
    """Return the units of a covariance's 21 values by keyword; `parts` are positions, then velocities."""
    units = [f"{length}**2{time}" for time in ("", "/s", "/s**2")]
    rows = zip(*(one.tolist() for one in LOWER), strict=True)
    return {f"C{parts[row]}_{parts[column]}": units[(row > 2) + (column > 2)] for row, column in rows}


COVARIANCE = covariance_units(list(STATE), "km")


def keyed(entries: Mapping[str, str]) -> list[str]:
    """Return keywords with their values, one line each."""
    return [f"{keyword} = {value}" for keyword, value in entries.items()]


def oem_key_values(segments: Sequence[Segment], comments: Sequence[str], originator: str = ORIGINATOR) -> str:
    """Return an OEM in key-value form."""
    parts = ["\n".join([*head("OEM", "2.0", comments, originator), ""])]
    for one in segments:
        parts.append("\n".join(["", "META_START", *keyed(one.metadata), "META_STOP", "", ""]))
        parts.append(text_rows(list(one.stamps), ROW, one.states / 1e3))
        parts.append("".join(f"{line}\n" for line in covariance_lines(one)))
    return "".join(parts)


def covariance_lines(one: Segment) -> Iterator[str]:
    """Yield the covariances of a segment in key-value form."""
    if not len(one.known):
        return
    yield from ("", "COVARIANCE_START")
    for stamp, matrix, frame in zip(one.known, one.covariances / 1e6, one.frames, strict=True):
        yield f"EPOCH = {stamp}"
        if frame != one.metadata["REF_FRAME"]:
            yield f"COV_REF_FRAME = {frame}"
        yield from (" ".join(f"{value:.15e}" for value in matrix[row, : row + 1]) for row in range(6))
    yield "COVARIANCE_STOP"


def oem_xml(segments: Sequence[Segment], comments: Sequence[str]) -> str:
    """Return an OEM in XML."""
    about = "".join(f"<COMMENT>{escape(line)}</COMMENT>\n" for line in comments)
    numbers = "".join(f'<{name} units="{unit}">{FORMATS[unit]}</{name}>' for name, unit in STATE.items())
    row = f"<stateVector><EPOCH>%s</EPOCH>{numbers}</stateVector>"
    parts = [
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        '<oem xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" '
        f'xsi:noNamespaceSchemaLocation="{SCHEMA}" id="CCSDS_OEM_VERS" version="2.0">\n'
        f"<header>\n{about}<CREATION_DATE>{now()}</CREATION_DATE>\n"
        f"<ORIGINATOR>{ORIGINATOR}</ORIGINATOR>\n</header>\n<body>\n"
    ]
    for one in segments:
        parts.append("<segment>\n<metadata>\n")
        parts += [f"<{keyword}>{escape(value)}</{keyword}>\n" for keyword, value in one.metadata.items()]
        parts.append("</metadata>\n<data>\n")
        parts.append(text_rows(list(one.stamps), row, one.states / 1e3))
        parts += covariance_elements(one)
        parts.append("</data>\n</segment>\n")
    return "".join([*parts, "</body>\n</oem>\n"])


def covariance_elements(one: Segment) -> Iterator[str]:
    """Yield the covariances of a segment in XML."""
    for stamp, matrix, frame in zip(one.known, one.covariances / 1e6, one.frames, strict=True):
        yield f"<covarianceMatrix><EPOCH>{stamp}</EPOCH><COV_REF_FRAME>{frame}</COV_REF_FRAME>\n"
        for (name, unit), value in zip(COVARIANCE.items(), matrix[LOWER], strict=True):
            yield f'<{name} units="{unit}">{value:.15e}</{name}>\n'
        yield "</covarianceMatrix>\n"
