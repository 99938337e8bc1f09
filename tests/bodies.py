"""Independent model of searches with errors: sampled attitudes of two bodies, and their first lock."""

from dataclasses import dataclass
from math import cos, inf, radians

import numpy as np
from scipy.optimize import brentq, minimize_scalar
from scipy.spatial.transform import Rotation

from turns import SIGN, START, SUN

RATE = radians(0.25)
STEP = 4.0  # s, of samples: a degree of turning or so


@dataclass
class Body:
    """One craft that goes through the turns of its group by itself, and then rests.

    A turn is (phase, about, angle) as those of `turns`, or (phase, "wait", 0, seconds).
    """

    turns: list
    group: str
    pointing: tuple = (0.0, 0.0, 0.0)
    slew_rate: float = 0.0
    start: float = 0.0
    half_angle: float = 0.0
    range: float | None = None
    slew_acceleration: float = inf
    silent: bool = False
    solar_acceleration: float = 0.0

    def __post_init__(self):
        self.rate = RATE * (1.0 + self.slew_rate)
        self.angles = angles = np.array([abs(turn[2]) for turn in self.turns])
        self.ramps = np.minimum(self.rate / self.slew_acceleration, np.sqrt(angles / self.slew_acceleration))
        full = angles >= self.rate**2 / self.slew_acceleration
        lasts = np.where(full, angles / self.rate + self.ramps, 2.0 * self.ramps)
        lasts = [turn[3] if turn[1] == "wait" else last for turn, last in zip(self.turns, lasts, strict=True)]
        self.begins = self.start + np.concatenate([[0.0], np.cumsum(lasts)])
        self.attitudes = [Rotation.from_matrix(START[self.group])]
        for k, (_, _, angle, *_) in enumerate(self.turns):
            self.attitudes.append(self.turn(k, np.array([abs(angle)]))[0])
        quarters = 0.5 * np.pi * np.arange(3)
        looks = np.stack([self.off(self.turn(k, quarters))[:, :, 2] for k in range(len(angles))], axis=1)
        self.circles = looks - 0.5 * (looks[0] + looks[2])  # as the angle grows, from the first to the second
        self.middles = looks[0] - self.circles[0]

    def turned(self, k, time):
        """By what angles turns k have gone a time after each began: by its acceleration, then its rate."""
        angle, gain, ramp = self.angles[k], self.slew_acceleration, self.ramps[k]
        if gain == inf:
            return np.minimum(self.rate * time, angle)
        left = self.begins[k + 1] - self.begins[k] - time
        steady = gain * ramp * (time - 0.5 * ramp)
        slower = np.where(left < ramp, angle - 0.5 * gain * left**2, steady)
        return np.where(time < ramp, 0.5 * gain * time**2, slower)

    def boresights(self, times):
        """Unit vectors (T, 3), which go round a circle in each turn."""
        k, since = self.under_way(times)
        angles = self.turned(k, since)[:, None]
        return self.middles[k] + np.cos(angles) * self.circles[0, k] + np.sin(angles) * self.circles[1, k]

    def bodies(self, times):
        """Attitudes (T, 3, 3), columns body x, y, z."""
        turns, since = self.under_way(times)
        out = np.empty((len(times), 3, 3))
        for k in np.unique(turns):
            here = turns == k
            out[here] = self.off(self.turn(k, self.turned(k, since[here])))
        return out

    def under_way(self, times):
        """Which turn is under way, and for how long."""
        times = np.clip(times, self.start, self.begins[-1])
        k = np.minimum(np.searchsorted(self.begins, times, side="right") - 1, len(self.turns) - 1)
        return k, times - self.begins[k]

    def off(self, attitudes):
        """Matrices of attitudes that are off by the pointing error."""
        return (attitudes * Rotation.from_rotvec(self.pointing)).as_matrix()

    def turn(self, k, angles):
        """Attitudes after turn k has gone by some angles: about the sun line in space, or about body y."""
        _, about, whole = self.turns[k][:3]
        axis = SUN if about == "sun" else SIGN[self.group] * np.array([0.0, 1.0, 0.0])
        turn = Rotation.from_rotvec(np.outer(np.sign(whole) * angles, axis))
        return turn * self.attitudes[k] if about == "sun" else self.attitudes[k] * turn


def missing(a, b, sensor, r, v, times):
    """Return the distance from a lock at each time [m]: each sees the other's sensor, within both ranges."""
    one, other = a.boresights(times), b.boresights(times)
    q = r + np.outer(times, v) + sensor.offset * (other - one)
    q -= 0.5 * (b.solar_acceleration - a.solar_acceleration) * np.outer(times**2, SUN)
    length = np.linalg.norm(q, axis=1)
    seen = [
        length * cos(sensor.half_angle + body.half_angle) - way * (q * look).sum(axis=1)
        for body, look, way in ((a, one, 1.0), (b, other, -1.0))
    ]
    longest = min(sensor.range if body.range is None else body.range for body in (a, b))
    return np.maximum(np.maximum(*seen), length - longest)


def first_lock(a, b, sensor, r, v, start=0.0):
    """The first lock from `start` on by samples, minima between them and roots; nan for none.

    The position `r` is that at time 0.
    """
    if a.silent or b.silent:
        return np.nan
    last = max(a.begins[-1], b.begins[-1], start)
    ends = [t for body in (a, b) for t in body.begins if t > start]
    times = np.unique(np.concatenate([np.arange(start, last, STEP), [start], ends]))
    values = missing(a, b, sensor, r, v, times)

    def g(time):
        return float(missing(a, b, sensor, r, v, np.array([time]))[0])

    below = np.flatnonzero(values <= 0.0)
    stop = below[0] if len(below) else len(times)
    for k in range(1, min(stop, len(times) - 1)):
        if values[k] <= values[k - 1] and values[k] <= values[k + 1]:
            if values[k] > max(values[k - 1], values[k + 1]) - values[k] + 0.05 * abs(values[k]):
                continue  # it would have to bend much more here than beside it
            found = minimize_scalar(
                g, bounds=(times[k - 1], times[k + 1]), method="bounded", options={"xatol": 1e-9}
            )
            if found.fun <= 0.0:
                return brentq(g, times[k - 1], found.x, xtol=1e-10)
    if not len(below):
        return np.nan
    return start if stop == 0 else brentq(g, times[stop - 1], times[stop], xtol=1e-10)
