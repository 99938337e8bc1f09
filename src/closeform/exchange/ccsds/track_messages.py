"""OEM and OPM of an exported track (CCSDS 502.0-B-3 sections 5 and 3)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from closeform.exchange.ccsds import message_text
from closeform.exchange.ccsds.message_text import STATE, Segment, head, keyed, oem_key_values
from closeform.exchange.export_tracks.interpolation_nodes import DEGREE
from closeform.exchange.export_tracks.track import FileFrame, Piece, Track

COVARIANCES = "covariances are relative to the formation's origin, which is taken as exact"


def object_metadata(track: Track, frame: FileFrame) -> dict[str, str]:
    """Return the metadata of the object and the frame."""
    return {
        "OBJECT_NAME": track.name,
        "OBJECT_ID": track.object_id,
        "CENTER_NAME": frame.center,
        "REF_FRAME": frame.name,
        "TIME_SYSTEM": frame.epoch.system,
    }


def segment(track: Track, frame: FileFrame, piece: Piece) -> Segment:
    """Return the segment of one smooth piece, which is useable up to its ends."""
    stamps = frame.stamps(piece.times)
    metadata = object_metadata(track, frame) | {
        "START_TIME": stamps[0],
        "USEABLE_START_TIME": stamps[0],
        "USEABLE_STOP_TIME": stamps[-1],
        "STOP_TIME": stamps[-1],
        "INTERPOLATION": "HERMITE",
        "INTERPOLATION_DEGREE": str(DEGREE),
    }
    known = frame.stamps(piece.known)
    return Segment(metadata, stamps, piece.states, known, piece.covariances, [frame.name] * len(known))


def comments(track: Track, frame: FileFrame) -> list[str]:
    """Return comments for readers."""
    known = (COVARIANCES,) if len(track.pieces[0].known) else ()
    return [*frame.about, f"{track.name}: {track.accuracy}", *known]


def oem(track: Track, frame: FileFrame) -> str:
    """Return an OEM in key-value form, with a segment for each smooth piece."""
    return oem_key_values([segment(track, frame, one) for one in track.pieces], comments(track, frame))


def oem_xml(track: Track, frame: FileFrame) -> str:
    """Return an OEM in XML, with a segment for each smooth piece."""
    return message_text.oem_xml([segment(track, frame, one) for one in track.pieces], comments(track, frame))


def opm(track: Track, frame: FileFrame) -> str:
    """Return an OPM: the initial state, and every burn as a manoeuvre; masses only where known."""
    piece = track.pieces[0]
    lines = [*head("OPM", "3.0", frame.about), *keyed(object_metadata(track, frame))]
    lines.append(f"EPOCH = {frame.stamps(piece.times[:1])[0]}")
    for (name, unit), value in zip(STATE.items(), piece.states[0] / 1e3, strict=True):
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
