"""Predict one orbit of GRACE-A and B, 27 July 2010, in force models of increasing fidelity.

    python examples/grace/field.py

Both spacecraft start from one state each and are simulated for an orbit. The table shows the maximum error of
the relative position. The second column fits the initial state of the second spacecraft, which removes the
error of the first states: their noise of 0.2 mm/s causes metres in an orbit.
"""

from functools import cached_property
from math import factorial
from pathlib import Path

import erfa
import numpy as np

import closeform as cf
from closeform.dynamics.force_model.field import GRAVITY_RADIUS

SPIN = 7.292115e-5  # rad/s
LEADS = 19.0 + 32.184  # s, of terrestrial time before GPS time
UTC_BEHIND = 15.0  # s, of UTC behind GPS time in 2010
STARTS = range(0, 4701, 940)  # s
folder = Path(__file__).parent


class Tesserals:
    """Accelerations in EGM96 to some degree and order on an Earth that turns.

    By Cunningham's recursions, x + iy as one number (Montenbruck and Gill 2000, 3.2.4 and 3.2.5).
    """

    def __init__(self, angle: float, degree: int) -> None:
        """`angle` [rad] of the zero meridian from the x axis at time 0."""
        table = np.loadtxt(folder.parent / "basilisk" / "egm96.csv", delimiter=",", skiprows=1)
        self.angle, self.degree, self.terms = angle, degree, {(0, 0): 1.0 + 0.0j}
        for n, m, c, s in table[table[:, 0] <= degree]:
            falls = factorial(int(n - m)) / factorial(int(n + m))
            self.terms[int(n), int(m)] = np.sqrt((2.0 - (m == 0)) * (2.0 * n + 1.0) * falls) * (c - 1j * s)

    def __call__(self, times: np.ndarray, states: np.ndarray) -> np.ndarray:
        turned = np.exp(1j * (self.angle + SPIN * times))
        share = GRAVITY_RADIUS / (states[:, :3] ** 2).sum(axis=1)
        plane, up = share * (states[:, 0] + 1j * states[:, 1]) / turned, share * states[:, 2]
        u = self.harmonics(plane, up, share * GRAVITY_RADIUS)
        flat, rise = np.zeros(len(states), complex), np.zeros(len(states))
        for (n, m), k in self.terms.items():
            rise -= (n - m + 1) * (k * u[n + 1, m]).real
            if m == 0:
                flat -= k * u[n + 1, 1]
            else:
                inner = (n - m + 2) * (n - m + 1) * (k * u[n + 1, m - 1]).conj()
                flat += 0.5 * (inner - k * u[n + 1, m + 1])
        flat *= turned
        return cf.elements.EARTH_MU / GRAVITY_RADIUS**2 * np.stack([flat.real, flat.imag, rise], axis=1)

    def harmonics(self, plane: np.ndarray, up: np.ndarray, square: np.ndarray) -> dict:
        """Solid harmonics by degree and order, one degree further than the field."""
        u = {(0, 0): np.sqrt(square).astype(complex)}
        for m in range(self.degree + 2):
            if m:
                u[m, m] = (2 * m - 1) * plane * u[m - 1, m - 1]
            for n in range(m + 1, self.degree + 2):
                u[n, m] = (2 * n - 1) / (n - m) * up * u[n - 1, m]
                if n > m + 1:
                    u[n, m] = u[n, m] - (n + m - 1) / (n - m) * square * u[n - 2, m]
        return u


def of_date(craft: cf.Ephemeris) -> np.ndarray:
    """Return states (T, 6) with the pole of that day as z axis, the axis of the gravity field."""
    day = erfa.cal2jd(2010, 7, 27)
    turn = erfa.pnm06a(day[0], day[1] + LEADS / 86400.0)
    return np.concatenate([craft.states[:, :3] @ turn.T, craft.states[:, 3:] @ turn.T], axis=1)


class Start:
    """Measured motion of both for an orbit after a time [s], with the first as chief."""

    def __init__(self, begin: float) -> None:
        craft = [cf.read_oem(folder / f"GRACE-{letter}.oem") for letter in "AB"]
        one, other = (of_date(each)[round(begin / 10.0) :] for each in craft)
        self.chief = cf.Chief(craft[0].epoch, one[0], frame="TOD", time_system="GPS")
        steps = int(self.chief.orbit.period // 10.0)
        self.begin, self.other = begin, other[0]
        self.times = 10.0 * np.arange(steps + 1)
        self.flown = cf.elements.relative_from_inertial(one[: steps + 1], other[: steps + 1])[:, :3]

    @property
    def angle(self) -> float:
        """Angle of the zero meridian from the x axis [rad]."""
        days, day = erfa.cal2jd(2010, 7, 27)
        universal, terrestrial = day + np.array([self.begin - UTC_BEHIND, self.begin + LEADS]) / 86400.0
        return float(erfa.gst06a(days, universal, days, terrestrial))

    @cached_property
    def changed(self) -> np.ndarray:
        """Effect of initial states (T, 3, 6), per metre and mm/s; equal in all these models."""
        return cf.Field(self.chief).transition(self.times)[:, :3] * np.repeat([1.0, 1e-3], 3)

    def errors(self, field: cf.Field) -> tuple[float, float]:
        """Return the maximum errors of the relative position [m], from both states and from the fit."""
        felt = field.accelerations(0.0, self.chief.state)
        start = cf.elements.relative_from_inertial(self.chief.state, self.other, acceleration=felt)
        off = self.flown - field.coast(start, self.times[-1], within=0.05).position(self.times)
        fit = np.linalg.lstsq(self.changed.reshape(-1, 6), off.ravel(), rcond=None)[0]
        from_both, fitted = (np.linalg.norm(one, axis=1).max() for one in (off, off - self.changed @ fit))
        return float(from_both), float(fitted)

    def fields(self) -> dict[str, cf.Field]:
        """Return force models of increasing fidelity."""
        zonals = {"a point mass": 0, "J2": 2, "J2 to J6": 6}
        tesserals = {
            f"EGM96 to degree {d}": cf.Field(self.chief, acceleration=Tesserals(self.angle, d))
            for d in (4, 12)
        }
        return {name: cf.Field(self.chief, degree) for name, degree in zonals.items()} | tesserals


if __name__ == "__main__":
    starts = [Start(begin) for begin in STARTS]
    fields, worst = [start.fields() for start in starts], []
    print("| field | from one state [m] | from the start that fits [m] |\n|---|---:|---:|")
    for name in fields[0]:
        values = np.array([start.errors(own[name]) for start, own in zip(starts, fields, strict=True)])
        low, high = values.min(axis=0), values.max(axis=0)
        print(
            f"| {name} | " + " | ".join(f"{a:.2g} to {b:.2g}" for a, b in zip(low, high, strict=True)) + " |"
        )
        worst.append(high)
    point, flat, _, _, most = np.array(worst)
    assert flat[0] < 0.02 * point[0]  # nearly all that Hill's equations leave out is J2
    assert most[0] < 20.0
    assert most[1] < 1.0
