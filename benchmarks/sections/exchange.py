"""Files for other tools: time to write and to read, and the error in an independent reader."""

import tempfile
from pathlib import Path

import numpy as np
from oem import OrbitEphemerisMessage

import closeform as cf
from tables import Figure, Report, Table
from timing import timed

CRAFT, STEP = 8, 10.0  # s
EPOCH = "2026-11-22T12:00:00"
ROWS = {
    "oem": "OEM, key-value",
    "oem-xml": "OEM, XML",
    "ocm": "OCM",
    "csv": "CSV",
    "stk": "STK ephemeris",
    "czml": "CZML",
    "spk": "SPICE kernel, type 13",
}


def measure(quick: bool) -> Report:
    rows = 200 if quick else 10_000
    paths, chief = formation(rows)
    written, table = {}, []
    with tempfile.TemporaryDirectory() as folder:
        for to, called in ROWS.items():
            place = Path(folder) / to

            def write(to: str = to, place: Path = place) -> Path:
                return cf.export(paths, place, to, chief=chief, step=STEP, overwrite=True)

            written[to], _ = timed(write, 1 if quick else 5)
            size = sum(file.stat().st_size for file in place.iterdir()) / 1e6
            table.append([called, f"{written[to]:.2f} s", f"{size:.1f} MB"])
        file = Path(folder) / "oem" / "C1.oem"
        read, ephemeris = timed(lambda: cf.read_oem(file), 1 if quick else 7)
        theirs, message = timed(lambda: OrbitEphemerisMessage.open(file), 1)
        off = farthest(message, paths[0], chief, ephemeris.times)
    title = f"Exchange: {CRAFT} spacecraft, {rows} states each"
    notes = [
        (f"closeform reads one of the OEM files in {read:.3f} s, the Python package oem in {theirs:.2f} s.")
    ]
    report = Report([Table(title, ["format", "write time", "size"], table, notes)])
    took = written["oem"]
    report.figures += [
        Figure(f"write {CRAFT} OEM of {rows} states", "<= 1 s", f"{took:.2f} s", took <= 1.0),
        Figure(f"read an OEM of {rows} states", "<= 0.2 s", f"{read:.3f} s", read <= 0.2),
        Figure("OEM in another reader: position error", "<= 1 µm", f"{1e6 * off:.3f} µm", off <= 1e-6),
    ]
    return report


def formation(rows: int) -> tuple[cf.Path, cf.Chief]:
    """Return coasting spacecraft over the given number of steps, and their chief."""
    orbit = cf.Orbit.circular(500e3)
    radius = cf.elements.semi_major_axis_from_mean_motion(orbit.mean_motion)
    chief = cf.Chief.from_elements(EPOCH, [radius, 0.0, 0.0, 0.0, 1.7, 0.0])
    scale = [100.0] * 3 + [1e-3] * 3
    states = np.random.default_rng(1).normal(0.0, scale, (CRAFT, 6))
    return orbit.coast(states, STEP * (rows - 1)), chief


def farthest(message: OrbitEphemerisMessage, path: cf.Path, chief: cf.Chief, times: np.ndarray) -> float:
    """Return the maximum position error of another reader [m]."""
    found = np.array([state.position for segment in message.segments for state in segment.states]) * 1e3
    known = chief.inertial_from_relative(times, path.state(times))[:, :3]
    return float(np.abs(found - known).max())
