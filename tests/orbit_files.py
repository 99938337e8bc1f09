"""Ephemerides on circles, as messages."""

from pathlib import Path

import numpy as np

from closeform.exchange.ephemerides.ephemeris import Ephemeris
from closeform.motion.elements.elements import inertial_from_elements

OEM = """\
CCSDS_OEM_VERS = 2.0
CREATION_DATE = 2026-01-01T00:00:00
ORIGINATOR = TEST
META_START
OBJECT_NAME = {name}
OBJECT_ID = 2026-001{name}
CENTER_NAME = EARTH
REF_FRAME = EME2000
TIME_SYSTEM = UTC
START_TIME = 2026-01-01T{hour}:00:00
STOP_TIME = 2026-01-01T{hour}:10:00
META_STOP
"""


def oem(name: str, ahead: float, hour: str = "00") -> str:
    """Return ten minutes of a circular orbit at 7000 km, `ahead` [rad], with a state each minute."""
    rate, radius = np.sqrt(398600.4418 / 7000.0**3), 7000.0
    lines = []
    for minute in range(11):
        c, s = np.cos(60 * minute * rate + ahead), np.sin(60 * minute * rate + ahead)
        state = [radius * c, radius * s, 0.0, -radius * rate * s, radius * rate * c, 0.0]
        lines.append(f"2026-01-01T{hour}:{minute:02d}:00 " + " ".join(f"{value:.9f}" for value in state))
    return OEM.format(name=name, hour=hour) + "\n".join(lines) + "\n"


def contents(folder: Path) -> dict[str, bytes]:
    """Return every file below a folder."""
    return {str(p.relative_to(folder)): p.read_bytes() if p.is_file() else b"" for p in folder.rglob("*")}


HEAD = """CCSDS_OEM_VERS = 2.0
CREATION_DATE = 2026-01-01T00:00:00
ORIGINATOR = TEST

META_START
OBJECT_NAME = DEPUTY
OBJECT_ID = 2000-001B
CENTER_NAME = EARTH
REF_FRAME = EME2000
TIME_SYSTEM = UTC
START_TIME = 2016-12-31T23:59:50
STOP_TIME = 2017-01-01T00:00:10
META_STOP

COMMENT across the leap second of 2016
"""
ROWS = """2016-12-31T23:59:50 7000.0 0.0 0.0 0.0 7.5 0.0
2016-12-31T23:59:60.5 7000.0 75.0 0.0 0.0 7.5 0.0
2017-01-01T00:00:10 7000.0 150.0 1.5e-3 0.0 7.5 -1.25
"""
GOOD = HEAD + ROWS


def circular(name="CHIEF", ahead=0.0, times=None, **changes):
    times = np.arange(0.0, 600.0, 10.0) if times is None else np.asarray(times, dtype=float)
    elements = np.tile([7e6, 0.0, 0.0, 0.0, 1.0, 0.2], (len(times), 1))
    elements[:, 1] = ahead + 1.078007e-3 * times
    states = inertial_from_elements(elements)
    fields = {"object_id": "2000-001A", "center": "EARTH", "frame": "GCRF", "time_system": "TAI"}
    fields |= {"epoch": "2020-01-01T00:00:00"} | changes
    return Ephemeris(name=name, times=times, states=states, **fields)
