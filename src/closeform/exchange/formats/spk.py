"""SPICE kernels (SPK type 13: Hermite's polynomials through unequal steps), written by spiceypy."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.exchange.epochs import Epoch
from closeform.exchange.export_tracks.interpolation_nodes import DEGREE
from closeform.exchange.export_tracks.track import FileFrame, Piece, Track
from closeform.motion.elements.mean_motion import EARTH_MU

CODES = {"EARTH": 399, "MOON": 301, "SUN": 10, "MARS": 499}
FIRST_CODE = -999001  # NAIF's integers for spacecraft are negative; ours count down from here
J2000 = "2000-01-01T12:00:00"
LONGEST = 40  # characters of a segment's name
APART = 100.0  # s, over which the rate of clocks is measured: their rounding is 1e-11 s
K, EB, M0, M1 = 1.657e-3, 1.671e-2, 6.239996, 1.99096871e-7  # of TDB less TT, from NAIF's leap second kernels


def spiceypy() -> Any:
    """Return the module of the extra `spice`; raise ImportError with the remedy if it is missing."""
    try:
        return import_module("spiceypy")
    except ImportError:
        raise ImportError("spiceypy is not installed; run: pip install 'closeform[spice]'") from None


def write_spk(file: Path, tracks: Sequence[Track], frame: FileFrame) -> None:
    """Write all spacecraft to one kernel, with a segment for each smooth piece."""
    spice = spiceypy()
    handle = spice.spkopn(str(file), "closeform", 0)
    try:
        for k, track in enumerate(tracks):
            for number, piece in enumerate(track.pieces, 1):
                epochs, states = on_epochs(piece, frame)
                spice.spkw13(
                    handle,
                    FIRST_CODE - k,
                    CODES[frame.center.upper()],
                    "J2000",
                    epochs[0],
                    epochs[-1],
                    f"{track.name} {number}"[:LONGEST],
                    DEGREE,
                    len(epochs),
                    np.ascontiguousarray(states / 1e3),
                    epochs,
                )
    finally:
        spice.spkcls(handle)


def on_epochs(piece: Piece, frame: FileFrame) -> tuple[Floats, Floats]:
    """Return the nodes' epochs as a kernel holds them [s TDB after J2000], and the states (T, 6) at these.

    A double of 8e8 s has steps of 1.2e-7 s, in which a spacecraft moves a millimetre: states are moved to the
    epochs as written.  Velocities are per second of TDB: interpolation needs both on one clock.
    """
    days, rest = ephemeris_time(frame.epoch, piece.times)
    epochs = days + rest
    late = ((epochs - days) - rest)[:, None]
    before, after = (ephemeris_time(frame.epoch, piece.times + apart) for apart in (-APART, APART))
    rate = (after[0] - before[0] + (after[1] - before[1]))[:, None] / (2.0 * APART)
    states, mu = piece.states.copy(), EARTH_MU if frame.chief is None else frame.chief.mu
    place = piece.states[:, :3]
    states[:, :3] += piece.states[:, 3:] * late
    states[:, 3:] -= mu * place / np.linalg.norm(place, axis=1, keepdims=True) ** 3 * late
    states[:, 3:] /= rate
    return epochs, states


def ephemeris_time(epoch: Epoch, times: Floats) -> tuple[Floats, Floats]:
    """Return times (T,) [s] after an epoch in seconds of TDB after J2000, as whole days and a remainder.

    Other time systems are converted by TT and SPICE's own series.
    """
    if epoch.system.upper() == "TDB":
        return Epoch(J2000, "TDB").seconds_until(epoch, times)
    days, rest = Epoch(J2000, "TT").seconds_until(epoch, times)
    anomaly = M0 + M1 * (days + rest)
    return days, rest + K * np.sin(anomaly + EB * np.sin(anomaly))


def names(tracks: Sequence[Track]) -> str:
    """Return a text kernel with the names of all spacecraft and their integers."""
    lines = ["KPL/FK", "", "\\begindata", ""]
    for k, track in enumerate(tracks):
        quoted = track.name.replace("'", "''")
        lines += [f"NAIF_BODY_NAME += ( '{quoted}' )", f"NAIF_BODY_CODE += ( {FIRST_CODE - k} )"]
    return "\n".join([*lines, "", "\\begintext", ""])
