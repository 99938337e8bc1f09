"""The text of an OEM, in key-value or XML form, and of an OPM (CCSDS 502.0-B-3 sections 5 and 3)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from xml.sax.saxutils import escape

import numpy as np

from closeform.exchange.ephemerides.covariance import LOWER, covariance_lines
from closeform.exchange.epochs import now
from closeform.exchange.export_tracks.interpolation_nodes import DEGREE
from closeform.exchange.export_tracks.track import FileFrame, Piece, Track, text_rows

# km, km/s: to a nanometre, and a picometre per second
STATE = " ".join(["%s"] + ["%.12f"] * 3 + ["%.15f"] * 3)
NAMES = ("X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT")
RATES = ("km**2", "km**2/s", "km**2/s**2")  # of covariances, by the number of velocities in them
UNITS = ("km", "km", "km", "km/s", "km/s", "km/s")
ORIGINATOR = "CLOSEFORM"
COVARIANCES = "covariances are relative to the formation's origin, which is taken as exact"
SCHEMA = "https://sanaregistry.org/r/ndmxml_unqualified/ndmxml-3.0.0-master-3.0.xsd"


def whose(track: Track, frame: FileFrame) -> dict[str, str]:
    """Return the metadata of the object and the frame."""
    return {
        "OBJECT_NAME": track.name,
        "OBJECT_ID": track.object_id,
        "CENTER_NAME": frame.center,
        "REF_FRAME": frame.name,
        "TIME_SYSTEM": frame.epoch.system,
    }


def metadata(track: Track, frame: FileFrame, piece: Piece) -> dict[str, str]:
    """Return the metadata of one segment, which is useable up to its ends."""
    first, last = frame.stamps(piece.times[[0, -1]])
    return whose(track, frame) | {
        "START_TIME": first,
        "USEABLE_START_TIME": first,
        "USEABLE_STOP_TIME": last,
        "STOP_TIME": last,
        "INTERPOLATION": "HERMITE",
        "INTERPOLATION_DEGREE": str(DEGREE),
    }


def keyed(entries: Mapping[str, str]) -> list[str]:
    """Return keywords with their values, one line each."""
    return [f"{keyword} = {value}" for keyword, value in entries.items()]


def comments(track: Track, frame: FileFrame) -> list[str]:
    """Return comments for readers."""
    known = (COVARIANCES,) if len(track.pieces[0].known) else ()
    return [*frame.about, f"{track.name}: {track.accuracy}", *known]


def oem(track: Track, frame: FileFrame) -> str:
    """Return an OEM in key-value form, with a segment for each smooth piece."""
    parts = ["\n".join(["CCSDS_OEM_VERS = 2.0", *(f"COMMENT {line}" for line in comments(track, frame))])]
    parts.append(f"\nCREATION_DATE = {now()}\nORIGINATOR = {ORIGINATOR}\n")
    for piece in track.pieces:
        parts.append("\n".join(["\nMETA_START", *keyed(metadata(track, frame, piece)), "META_STOP\n\n"]))
        parts.append(text_rows(frame.stamps(piece.times), STATE, piece.states / 1e3))
        if len(piece.known):
            stamps, own = frame.stamps(piece.known), [frame.name] * len(piece.known)
            parts.append("\n".join([*covariance_lines(piece.covariances, stamps, own, frame.name), ""]))
    return "".join(parts)


def oem_xml(track: Track, frame: FileFrame) -> str:
    """Return an OEM in XML."""
    about = "".join(f"<COMMENT>{escape(line)}</COMMENT>\n" for line in comments(track, frame))
    parts = [
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        '<oem xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" '
        f'xsi:noNamespaceSchemaLocation="{SCHEMA}" id="CCSDS_OEM_VERS" version="2.0">\n'
        f"<header>\n{about}<CREATION_DATE>{now()}</CREATION_DATE>\n"
        f"<ORIGINATOR>{ORIGINATOR}</ORIGINATOR>\n</header>\n<body>\n"
    ]
    numbers = "".join(
        f'<{name} units="{unit}">%.{12 if unit == "km" else 15}f</{name}>'
        for name, unit in zip(NAMES, UNITS, strict=True)
    )
    row = f"<stateVector><EPOCH>%s</EPOCH>{numbers}</stateVector>"
    for piece in track.pieces:
        entries = metadata(track, frame, piece).items()
        parts.append("<segment>\n<metadata>\n")
        parts += [f"<{keyword}>{escape(value)}</{keyword}>\n" for keyword, value in entries]
        parts.append("</metadata>\n<data>\n")
        parts.append(text_rows(frame.stamps(piece.times), row, piece.states / 1e3))
        parts += covariance_elements(piece, frame)
        parts.append("</data>\n</segment>\n")
    return "".join([*parts, "</body>\n</oem>\n"])


def covariance_elements(piece: Piece, frame: FileFrame) -> Iterator[str]:
    """Yield the covariances of a piece in XML."""
    for stamp, matrix in zip(frame.stamps(piece.known), piece.covariances / 1e6, strict=True):
        yield f"<covarianceMatrix><EPOCH>{stamp}</EPOCH><COV_REF_FRAME>{frame.name}</COV_REF_FRAME>\n"
        for row, column in zip(*LOWER, strict=True):
            name, unit = f"C{NAMES[row]}_{NAMES[column]}", RATES[int(row > 2) + int(column > 2)]
            yield f'<{name} units="{unit}">{matrix[row, column]:.15e}</{name}>\n'
        yield "</covarianceMatrix>\n"


def opm(track: Track, frame: FileFrame) -> str:
    """Return an OPM: the initial state, and every burn as a manoeuvre; masses only where known."""
    piece = track.pieces[0]
    lines = ["CCSDS_OPM_VERS = 3.0", *(f"COMMENT {line}" for line in frame.about)]
    lines += [f"CREATION_DATE = {now()}", f"ORIGINATOR = {ORIGINATOR}"]
    lines += keyed(whose(track, frame))
    lines.append(f"EPOCH = {frame.stamps(piece.times[:1])[0]}")
    for name, unit, value in zip(NAMES, UNITS, piece.states[0] / 1e3, strict=True):
        lines.append(f"{name} = {value:.15f} [{unit}]")
    if track.mass is not None:
        lines.append(f"MASS = {track.mass:.9f} [kg]")
    lines += manoeuvres(track, frame)
    return "\n".join(lines) + "\n"


def manoeuvres(track: Track, frame: FileFrame) -> Iterator[str]:
    """Yield the burns of an OPM, along the axes of its state."""
    burns = track.burns
    yield f"COMMENT {len(burns)} manoeuvres; velocity increments are integrals of thrust along REF_FRAME"
    if track.mass is None and len(burns):
        yield "COMMENT no mass is known, and so no MASS and no MAN_DELTA_MASS"
    for k, stamp in enumerate(frame.stamps(burns.start)):
        yield f"MAN_EPOCH_IGNITION = {stamp}"
        yield f"MAN_DURATION = {burns.duration[k]:.9f} [s]"
        if np.isfinite(burns.propellant[k]) and burns.propellant[k] > 0.0:
            yield f"MAN_DELTA_MASS = {-burns.propellant[k]:.12g} [kg]"
        yield f"MAN_REF_FRAME = {frame.name}"
        for axis, push in enumerate(burns.push[k] / 1e3, 1):
            yield f"MAN_DV_{axis} = {push:.15f} [km/s]"
