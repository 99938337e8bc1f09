"""CZML of all spacecraft, for display on a globe."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.exchange.export_tracks.interpolation_nodes import DEGREE
from closeform.exchange.export_tracks.track import FileFrame, Track

# Okabe and Ito's colours, distinguishable with colour blindness; the first suits a dark background.
COLOURS = (
    (86, 180, 233),
    (230, 159, 0),
    (0, 158, 115),
    (240, 228, 66),
    (213, 94, 0),
    (204, 121, 167),
    (0, 114, 178),
    (255, 255, 255),
)
SPEED = 60.0  # initial playback speed relative to real time
PIXELS, WIDTH = 8, 1.5  # of a spacecraft's dot and path


def czml(tracks: Sequence[Track], frame: FileFrame, title: str) -> str:
    """Return CZML with positions in inertial axes, which the globe rotates and interpolates."""
    first, last = (edge(min(t.span[0] for t in tracks)), edge(max(t.span[1] for t in tracks)))
    begin, end = frame.utc(first)[0], frame.utc(last)[0]
    clock = {"interval": f"{begin}/{end}", "currentTime": begin, "multiplier": SPEED, "range": "LOOP_STOP"}
    packets: list[dict[str, Any]] = [{"id": "document", "name": title, "version": "1.0", "clock": clock}]
    packets += [
        packet(track, frame, COLOURS[k % len(COLOURS)], f"{begin}/{end}") for k, track in enumerate(tracks)
    ]
    return "[\n" + ",\n".join(json.dumps(one, ensure_ascii=False) for one in packets) + "\n]\n"


def edge(time: float) -> Floats:
    """Return one time as an array."""
    return np.array([time])


def packet(track: Track, frame: FileFrame, colour: tuple[int, int, int], whole: str) -> dict[str, Any]:
    """Return the packet of one spacecraft: a dot with its name, and its path."""
    rgba = {"rgba": [*colour, 255]}
    return {
        "id": track.object_id if track.object_id != "UNKNOWN" else track.name,
        "name": track.name,
        "description": track.accuracy,
        "availability": whole,
        "point": {"color": rgba, "pixelSize": PIXELS},
        "label": {"text": track.name, "fillColor": rgba, "pixelOffset": {"cartesian2": [12, -12]}},
        "path": {"material": {"solidColor": {"color": rgba}}, "width": WIDTH},
        "position": [interval(piece.times, piece.states, frame) for piece in track.pieces],
    }


def interval(times: Floats, states: Floats, frame: FileFrame) -> dict[str, Any]:
    """Return samples of position and velocity of one smooth piece, within which they are interpolated."""
    first, last = frame.utc(times[[0, -1]])
    samples = np.column_stack([times - times[0], states])
    return {
        "interval": f"{first}/{last}",
        "epoch": first,
        "referenceFrame": "INERTIAL",
        "interpolationAlgorithm": "HERMITE",
        "interpolationDegree": DEGREE,
        "cartesianVelocity": samples.round(12).ravel().tolist(),
    }
