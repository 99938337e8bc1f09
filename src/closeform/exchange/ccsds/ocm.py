"""The text of an OCM (CCSDS 502.0-B-3 section 6): states of a spacecraft, and its thrust over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from closeform.arrays import Floats
from closeform.exchange.ccsds.message_text import ROW, head, keyed
from closeform.exchange.ccsds.track_messages import comments
from closeform.exchange.export_tracks.interpolation_nodes import DEGREE
from closeform.exchange.export_tracks.track import FileFrame, Track, text_rows

ACCELERATION = ("TIME_RELATIVE", "MAN_DURA", "ACC_X", "ACC_Y", "ACC_Z", "ACC_INTERP")
IMPULSE = ("TIME_RELATIVE", "MAN_DURA", "DV_X", "DV_Y", "DV_Z")
MASS = "DELTA_MASS"
UNITS = {"MAN_DURA": "s", MASS: "kg", "ACC_INTERP": "n/a"}


def ocm(track: Track, frame: FileFrame) -> str:
    """Return an OCM in key-value form; times count in seconds from EPOCH_TZERO."""
    lines = [*head("OCM", "3.0", comments(track, frame)), "", "META_START"]
    first, last = frame.stamps(np.array(track.span))
    lines += keyed(
        {
            "OBJECT_NAME": track.name,
            "INTERNATIONAL_DESIGNATOR": track.object_id,
            "TIME_SYSTEM": frame.epoch.system,
            "EPOCH_TZERO": frame.stamps(np.zeros(1))[0],
            "START_TIME": first,
            "STOP_TIME": last,
        }
    )
    parts = ["\n".join([*lines, "META_STOP", ""])]
    for number, piece in enumerate(track.pieces, 1):
        metadata = {
            "TRAJ_ID": f"{track.name} {number}",
            "TRAJ_BASIS": "PREDICTED",
            "INTERPOLATION": "HERMITE",
            "INTERPOLATION_DEGREE": str(DEGREE),
            "CENTER_NAME": frame.center,
            "TRAJ_REF_FRAME": frame.name,
            "TRAJ_TYPE": "CARTPV",
            "TRAJ_UNITS": "[km, km, km, km/s, km/s, km/s]",
        }
        parts.append(block("TRAJ", metadata))
        parts.append(text_rows(seconds(piece.times), ROW, piece.states / 1e3))
        parts.append("TRAJ_STOP\n")
    if track.mass is not None:
        parts.append(f"\nPHYS_START\nWET_MASS = {track.mass:.9f} [kg]\nPHYS_STOP\n")
    return "".join([*parts, *impulses(track, frame), *thrusts(track, frame)])


def block(name: str, entries: Mapping[str, str], about: Sequence[str] = ()) -> str:
    """Return the beginning of a block."""
    return "\n".join([f"\n{name}_START", *(f"COMMENT {line}" for line in about), *keyed(entries), ""])


def seconds(times: Floats) -> list[str]:
    """Return times since EPOCH_TZERO, to a nanosecond."""
    return [f"{time:.9f}" for time in times.tolist()]


def manoeuvre(track: Track, frame: FileFrame, kind: str, composition: tuple[str, ...], about: str) -> str:
    """Return the beginning of a block of manoeuvres."""
    speed = {"ACC": "km/s**2", "DV_": "km/s"}
    units = [UNITS.get(word) or speed[word[:3]] for word in composition[1:]]
    metadata = {
        "MAN_ID": f"{track.name} {kind}",
        "MAN_BASIS": "PLANNED",
        "MAN_DEVICE_ID": "ALL",
        "MAN_REF_FRAME": frame.name,
        "DC_TYPE": "CONTINUOUS",
        "MAN_COMPOSITION": ", ".join(composition),
        "MAN_UNITS": f"[{', '.join(units)}]",
    }
    return block("MAN", metadata, (about,))


def impulses(track: Track, frame: FileFrame) -> list[str]:
    """Return the block of velocity jumps."""
    burns = track.burns
    kicks = np.flatnonzero(burns.duration == 0.0)
    if not len(kicks):
        return []
    known = np.isfinite(burns.propellant[kicks]).all()
    composition = (*IMPULSE[:2], MASS, *IMPULSE[2:]) if known else IMPULSE
    begin = manoeuvre(track, frame, "impulses", composition, "impulses: the velocity jumps at the time tag")
    mass = [-burns.propellant[kicks]] if known else []
    columns = [burns.duration[kicks], *mass, *(burns.push[kicks] / 1e3).T]
    form = " ".join(["%s", "%.9f", *["%.12g"] * bool(mass), *["%.15g"] * 3])
    return [begin, text_rows(seconds(burns.start[kicks]), form, np.stack(columns, axis=1)), "MAN_STOP\n"]


def thrusts(track: Track, frame: FileFrame) -> list[str]:
    """Return the block of thrust accelerations, at every node of a burn, valid to the next node."""
    rows: list[tuple[str, Floats]] = []
    starts, ends = track.burns.start, track.burns.start + track.burns.duration
    for piece in track.pieces:
        middle = 0.5 * (piece.times[0] + piece.times[-1])
        if np.any(piece.thrust) and ((starts < middle) & (middle < ends)).any():
            lasts = np.diff(piece.times, append=piece.times[-1])
            rows.append(("ON", np.column_stack([piece.times, lasts, piece.thrust / 1e3])[:-1]))
            rows.append(("OFF", np.concatenate([piece.times[-1:], [0.0, 0.0, 0.0, 0.0]])[None]))
    if not rows:
        return []
    about = "thrust acceleration between time tags: interpolated to the next, off after the last of a burn"
    parts = [manoeuvre(track, frame, "thrust", ACCELERATION, about)]
    for switch, values in rows:
        form = f"%s %.9f %.15g %.15g %.15g {switch}"
        parts.append(text_rows(seconds(values[:, 0]), form, values[:, 1:]))
    return [*parts, "MAN_STOP\n"]
