"""Leg of a search: one turn of all craft, and the attitude during it.

The columns of an attitude are the body axes x, y, z; z is the boresight. During a turn by the angle a the
attitude is steady + cosine cos(a) + sine sin(a), with constant matrices.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, sin
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, numbers
from closeform.result import Result

Group = Literal["A", "B"]

SPELLED = {  # phases as text
    "IPS": "in-plane",
    "OPS": "out-of-plane",
    "mOPS": "modified out-of-plane",
    "NFS": "near-field",
}
SUN = np.array([0.0, 0.0, -1.0])  # direction to the sun
START_ATTITUDE = {  # columns: body x at the sun, body y, boresight
    "A": np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]),
    "B": np.array([[0.0, 0.0, -1.0], [0.0, -1.0, 0.0], [-1.0, 0.0, 0.0]]),
}
# signs of the body axes relative to those of group A
AXES_OF_GROUP = {"A": np.array([1.0, 1.0, 1.0]), "B": np.array([1.0, -1.0, -1.0])}


def rotation(axis: Floats, angle: ArrayLike) -> Floats:
    """Return the right-handed rotation matrices (..., 3, 3) by `angle` (...) [rad] about a unit axis (3,)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn = np.asarray(angle, dtype=float)[..., None, None]
    along = np.outer(axis, axis)
    return np.asarray(along + np.cos(turn) * (np.eye(3) - along) + np.sin(turn) * cross)


@dataclass(frozen=True, eq=False, repr=False)
class Leg(Result):
    """Turn of all craft about an inertial axis, or a wait.

    Attributes
    ----------
    start, end : float [s]
        Times from the start of the search.
    phase : str
        "IPS", "OPS", "mOPS" or "NFS".
    round : int
        Number of this phase among those of its name, from 1.
    about : str
        "sun line" or "body y", or "none" for a wait.
    axis : array of shape (3,), no unit
        Unit axis of the turn in the inertial frame.
    angle : float [rad]
        Right-handed angle of the turn.
    attitude : array of shape (3, 3), no unit
        Attitude of group A at the start: columns are body x, y and the boresight in the inertial frame.
    """

    start: float
    end: float
    phase: str
    round: int
    about: str
    axis: Floats
    angle: float
    attitude: Floats

    @property
    def attitude_parts(self) -> Floats:
        """Steady, cosine and sine matrices (3, 3, 3) of the attitude of A [no unit]."""
        steady = np.outer(self.axis, self.axis @ self.attitude)
        sine = np.cross(self.axis, self.attitude, axisb=0, axisc=0)
        return np.stack([steady, self.attitude - steady, sine])

    def attitude_at(self, time: ArrayLike) -> Floats:
        """Return the attitude of group A during the leg.

        Parameters
        ----------
        time : array_like of shape (...) [s]
            Time from the start of the search; outside the leg the turn is extrapolated.

        Returns
        -------
        array of shape (..., 3, 3), no unit
            Columns are body x, y and the boresight in the inertial frame.

        Raises
        ------
        ValueError
            If `time` is not numeric.
        """
        share = (numbers("time", time) - self.start) / (self.end - self.start)
        return rotation(self.axis, self.angle * share) @ self.attitude

    @property
    def sun_angle(self) -> float:
        """Largest angle [rad] between body x and the sun line, the same for both groups."""
        return float(self._sun_angle_of(np.array([1.0, 0.0, 0.0])))

    def _sun_angle_of(self, body: Floats) -> Floats:
        """Return the largest angles (...) [rad] of unit vectors (..., 3) in axes of A from the sun line."""
        steady, cosine, sine = np.moveaxis(body @ (-SUN @ self.attitude_parts).T, -1, 0)
        return np.asarray(np.arccos(np.clip(-greatest(steady, cosine, sine, self.angle), -1.0, 1.0)))


def greatest(steady: Any, cosine: Any, sine: Any, angle: float) -> Any:
    """Return the largest value of steady + cosine cos(a) + sine sin(a) for a from 0 to `angle`."""
    turn = abs(angle)
    sine = sine if angle >= 0.0 else -sine
    if turn >= 2.0 * pi:
        return steady + np.hypot(cosine, sine)
    ends = np.maximum(cosine, cosine * cos(turn) + sine * sin(turn))
    rises, falls = sine >= 0.0, sine * cos(turn) <= cosine * sin(turn)  # at the start, at the end
    inside = rises & falls if turn <= pi else rises | falls  # the crest, at the angle of (cosine, sine)
    return steady + np.where(inside, np.hypot(cosine, sine), ends)
