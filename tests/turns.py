"""Independent truth for searches: the papers' turns, in sequence; nothing here uses the package.

Each group has its own turns about its own body axes, as S04 figure 4 and H03 figure 5 give them:
about the body's y they have opposite signs in the two groups, about the sun line they are the same.
"""

from dataclasses import dataclass
from math import asin, cos, inf, radians, sqrt

import numpy as np
from scipy.optimize import brentq, minimize_scalar
from scipy.spatial.transform import Rotation

SUN = np.array([0.0, 0.0, -1.0])
START = {  # columns: the shade's normal at the sun, body y, boresight along +x or -x
    "A": np.column_stack([SUN, [0, 1, 0], [1, 0, 0]]),
    "B": np.column_stack([SUN, [0, -1, 0], [-1, 0, 0]]),
}
SIGN = {"A": 1.0, "B": -1.0}


def tip_angle(half_angle):
    """Tip that brings the corner of a region, 90 deg - half-angle off the sun line and 90 deg off n1, into
    the cone: sin(tip) cos(90 deg - half-angle) = cos(half-angle)."""
    return asin(cos(half_angle) / sqrt(1 - cos(half_angle) ** 2))


def turns(kind, half_angle, tip=None, in_plane=540.0):
    """The turns of A: (phase, about "sun" or "y", angle in rad)."""
    t = tip_angle(half_angle) if tip is None else tip
    first = [("IPS", "sun", radians(in_plane))]
    if kind == "modified":
        out = [("y", t), ("y", -2 * t), ("sun", np.pi), ("y", 2 * t), ("sun", np.pi), ("y", -2 * t), ("y", t)]
        return 2 * (first + [("mOPS", *turn) for turn in out])
    out = [("y", t), ("y", -2 * t), ("sun", np.pi), ("y", 2 * t), ("y", -t)]
    return 2 * (first + [("OPS", *turn) for turn in out])


@dataclass
class Turning:
    """Attitudes of a group from its turns in order, at one slew rate."""

    turns: list
    rate: float
    group: str = "A"
    sun: tuple = (0.0, 0.0, -1.0)

    def __post_init__(self):
        angles = np.array([abs(angle) for _, _, angle in self.turns])
        self.ends = np.cumsum(angles) / self.rate
        self.sampled = {}
        self.starts = np.concatenate([[0.0], self.ends[:-1]])

    def attitude(self, times):
        """Matrices (T, 3, 3), columns body x, y, z."""
        times = np.atleast_1d(np.asarray(times, dtype=float))
        out = np.empty((len(times), 3, 3))
        attitude = Rotation.from_matrix(START[self.group])
        last = len(self.turns) - 1
        times = np.minimum(times, self.ends[-1])
        for k, (_, about, angle) in enumerate(self.turns):
            here = (times >= self.starts[k]) & ((times < self.ends[k]) | (k == last))
            turned = np.sign(angle) * self.rate * (times[here] - self.starts[k])
            out[here] = self._turn(attitude, about, turned).as_matrix()
            attitude = self._turn(attitude, about, np.array([angle]))[0]
        return out

    def boresight(self, times):
        """Unit vectors (..., 3)."""
        return self.attitude(np.ravel(times))[:, :, 2].reshape(*np.shape(times), 3)

    def samples(self, step):
        """Times from the start to the end, and the boresights then."""
        if step not in self.sampled:
            times = np.append(np.arange(0.0, self.ends[-1], step), self.ends[-1])
            self.sampled[step] = times, self.boresight(times)
        return self.sampled[step]

    def _turn(self, attitude, about, angles):
        if about == "sun":  # in space
            return Rotation.from_rotvec(np.outer(angles, self.sun)) * attitude
        return attitude * Rotation.from_rotvec(
            np.outer(SIGN[self.group] * angles, [0.0, 1.0, 0.0])
        )  # in the body


def margin(boresight, position, half_angle, offset=0.0, longest=inf):
    """Return the distance from a lock [m], positive if there is none, and its reference length |q|.

    Arrays (..., 3); the sensors sit at an offset along the two boresights.
    """
    q = position - 2.0 * offset * boresight
    length = np.sqrt((q * q).sum(-1))
    cosine = 0.0 if half_angle == np.pi / 2 else cos(half_angle)
    return np.maximum(length * cosine - (q * boresight).sum(-1), length - longest), length


def first_lock(turning, position, velocity, half_angle, offset=0.0, longest=inf, step=1.0):
    """First lock of one pair by samples, and by root finding between them; nan for none.

    Between samples a lock may hide: below every low sample the least margin is searched for.
    """
    r, v = np.asarray(position, float), np.asarray(velocity, float)

    def g(t):
        where = r + np.multiply.outer(t, v)
        return margin(turning.boresight(t), where, half_angle, offset, longest)[0]

    times, boresights = turning.samples(step)
    values = margin(boresights, r + np.outer(times, v), half_angle, offset, longest)[0]
    below = np.flatnonzero(values <= 0.0)
    stop = below[0] if len(below) else len(times)
    inner = values[1:-1]
    low = np.flatnonzero((inner <= values[:-2]) & (inner <= values[2:])) + 1
    depth = np.maximum(values[low - 1], values[low + 1]) - values[low]
    for k in low[(low < stop) & (values[low] < depth)]:
        bounds = (times[k - 1], times[k + 1])
        found = minimize_scalar(
            lambda t: float(g(t)), bounds=bounds, method="bounded", options={"xatol": 1e-9}
        )
        if found.fun <= 0.0:
            return brentq(g, times[k - 1], found.x, xtol=1e-10)
    if not len(below):
        return np.nan
    return 0.0 if stop == 0 else brentq(g, times[stop - 1], times[stop], xtol=1e-10)
