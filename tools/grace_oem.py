"""Convert an extract of LEOGPS's GRACE orbits to two OEM files in the inertial frame GCRF.

    python tools/grace_oem.py grca_truth.csv grcb_truth.csv examples/grace [--hours 3]

Source: github.com/sammmlow/LEOGPS, folder reference/ (MIT licence, kept in examples/grace/LICENSE):
one day of GRACE-A and B, 27 July 2010, every 10 s, GPS time; columns date, time, x, y, z [km],
vx, vy, vz, Earth-fixed (ITRF).  The velocities' unit and frame are not stated there.  Against
8th-order differences of the positions over the whole day they are dm/s, Earth-fixed, to 0.13 mm/s
rms in x and y and 0.18 mm/s in z (0.48 mm/s at most): the tool measures it again and stops above
2 mm/s.

The rotation is the IERS 2010 one (IAU 2006/2000A, CIO based) from pyerfa, with UT1 - UTC and the
pole from the IERS-B table that comes with astropy; nothing is downloaded.  The velocity gets the
Earth's rotation, w x r with the rate of the Earth rotation angle.  Left out: celestial pole
offsets (below 1 mas: 3 cm in position, the same for both craft), the length-of-day variation of
the rate (below 1e-5 m/s) and the motion of the pole and equinox (below 1e-4 m/s).
"""

import argparse
from pathlib import Path

import erfa
import numpy as np
from astropy.time import Time, TimeDelta
from astropy.utils import iers

from closeform.exchange.ccsds.oem import write_oem
from closeform.exchange.ephemerides.ephemeris import Ephemeris

OBJECTS = (("GRACE-A", "2002-012A"), ("GRACE-B", "2002-012B"))
EARTH_RATE = 1.00273781191135448 * 2.0 * np.pi / 86400.0  # rad/s: of the Earth rotation angle, IERS 2010
GPS_BEHIND_TAI = 19.0  # s
DIFFERENCE = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0.0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])
LARGEST_RESIDUAL = 2e-3  # m/s

COMMENTS = (
    "Extract of github.com/sammmlow/LEOGPS reference/, MIT licence, see LICENSE in this folder",
    "Rotated from Earth-fixed ITRF to GCRF by tools/grace_oem.py (IAU 2006/2000A, IERS-B)",
)


def table(file):
    """Return epochs and Earth-fixed states (T, 6) in m and m/s."""
    rows = [line.split(",") for line in Path(file).read_text().split()]
    stamps = ["-".join(f"{int(part):02d}" for part in row[0].split("/")[::-1]) + "T" + row[1] for row in rows]
    return stamps, np.array([[float(value) for value in row[2:]] for row in rows]) * ([1e3] * 3 + [0.1] * 3)


def residual(states, step):
    """Return velocities minus 8th-order differences of the positions [m/s]: (T - 8, 3)."""
    windows = np.lib.stride_tricks.sliding_window_view(states[:, :3], 9, axis=0)
    return states[4:-4, 3:] - windows @ DIFFERENCE / step


def to_gcrf(stamps, states):
    """Return GCRF states from Earth-fixed ones at GPS epochs."""
    tai = Time(stamps, format="isot", scale="tai") + TimeDelta(GPS_BEHIND_TAI, format="sec")
    earth = iers.IERS_B.open()
    ut1_utc = earth.ut1_utc(tai.utc).to_value("s")
    pole = [angle.to_value("rad") for angle in earth.pm_xy(tai.utc)]
    to_cirs = erfa.c2i06a(tai.tt.jd1, tai.tt.jd2)  # GCRS -> CIRS
    ut1 = erfa.utcut1(tai.utc.jd1, tai.utc.jd2, ut1_utc)
    turned = erfa.rz(erfa.era00(*ut1), to_cirs)  # GCRS -> TIRS
    polar = erfa.pom00(*pole, erfa.sp00(tai.tt.jd1, tai.tt.jd2))  # TIRS -> ITRS
    position = np.einsum("tji,tj->ti", polar, states[:, :3])
    velocity = np.einsum("tji,tj->ti", polar, states[:, 3:]) + np.cross([0.0, 0.0, EARTH_RATE], position)
    return np.hstack([np.einsum("tji,tj->ti", turned, part) for part in (position, velocity)])


def convert(file, name, object_id, hours):
    stamps, states = table(file)
    times = (Time(stamps, scale="tai") - Time(stamps[0], scale="tai")).to_value("s").round(6)
    errors = residual(states, times[1] - times[0])
    print(
        f"{name}: velocities differ from differenced positions by {1e3 * np.sqrt((errors**2).mean(0))} mm/s"
    )
    if np.abs(errors).max() > LARGEST_RESIDUAL:
        raise SystemExit(f"{file}: the velocities are not Earth-fixed dm/s")
    kept = times <= 3600.0 * hours
    inertial = to_gcrf(np.array(stamps)[kept], states[kept])
    return Ephemeris(name, object_id, "EARTH", "GCRF", "GPS", stamps[0], times[kept], inertial)


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("files", nargs=2, help="grca_truth.csv and grcb_truth.csv")
    parser.add_argument("folder", help="where GRACE-A.oem and GRACE-B.oem go")
    parser.add_argument("--hours", type=float, default=3.0)
    arguments = parser.parse_args()
    # Not the file last updated on the web, but the table that is installed.
    with iers.conf.set_temp("auto_download", False):
        for file, (name, object_id) in zip(arguments.files, OBJECTS, strict=True):
            ephemeris = convert(file, name, object_id, arguments.hours)
            write_oem(Path(arguments.folder) / f"{name}.oem", ephemeris, comments=COMMENTS)


if __name__ == "__main__":
    main()
