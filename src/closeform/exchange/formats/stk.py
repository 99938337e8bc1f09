"""The text of an STK ephemeris (.e) of a spacecraft."""

from __future__ import annotations

from datetime import datetime

import numpy as np

from closeform.exchange.export_tracks.interpolation_nodes import COUNT
from closeform.exchange.export_tracks.track import FileFrame, Track, text_rows

SYSTEMS = {
    "EME2000": "J2000",
    "J2000": "J2000",
    "ICRF": "ICRF",
    "GCRF": "ICRF",
    "MOD": "MeanOfDate",
    "TOD": "TrueOfDate",
    "TEME": "TEMEOfDate",
}
FORM = " ".join(["%s"] + ["%.9f"] * 3 + ["%.12f"] * 3)  # m, m/s


def stk(track: Track, frame: FileFrame) -> str:
    """Return states in metres at seconds after ScenarioEpoch (UTC), with segment boundaries."""
    system = SYSTEMS[frame.name.upper()]
    day, _, fraction = frame.utc(np.zeros(1))[0].removesuffix("Z").partition(".")
    epoch = f"{datetime.fromisoformat(day):%d %b %Y %H:%M:%S}.{fraction}"
    lines = [
        "stk.v.11.0",
        *(f"# {line}" for line in (*frame.about, f"{track.name}: {track.accuracy}")),
        "BEGIN Ephemeris",
        f"NumberOfEphemerisPoints {track.count}",
        f"ScenarioEpoch {epoch}",
        "InterpolationMethod Hermite",
        f"InterpolationSamplesM1 {COUNT - 1}",
        f"CentralBody {frame.center.capitalize()}",
        f"CoordinateSystem {system}",
    ]
    if len(track.pieces) > 1:  # two states where velocity or thrust jumps
        edges = [f"{piece.times[0]:.9f}" for piece in track.pieces[1:]]
        lines += ["BEGIN SegmentBoundaryTimes", *edges, "END SegmentBoundaryTimes"]
    parts = ["\n".join([*lines, "EphemerisTimePosVel", ""])]
    for piece in track.pieces:
        parts.append(text_rows([f"{time:.9f}" for time in piece.times.tolist()], FORM, piece.states))
    return "".join([*parts, "END Ephemeris\n"])
