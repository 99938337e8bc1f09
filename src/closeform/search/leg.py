"""Leg of a search: one turn of all craft.

The columns of an attitude are the body axes x, y, z; z is the boresight.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, numbers
from closeform.result import Result
from closeform.search.coverage import greatest

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
    def row(self) -> Floats:
        """Boresight of A as steady + cosine cos(rate t) + sine sin(rate t), t from the start.

        A row (12,): start and end [s], rate [rad/s], and the three vectors.
        """
        boresight = self.attitude[:, 2]
        steady = self.axis * (self.axis @ boresight)
        rate = self.angle / (self.end - self.start)
        sine = np.cross(self.axis, boresight)
        return np.concatenate([[self.start, self.end, rate], steady, boresight - steady, sine])

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
        shade = body @ self.attitude.T
        steady = np.multiply.outer(shade @ self.axis, self.axis)
        parts = np.array([steady, shade - steady, np.cross(self.axis, shade)]) @ -SUN
        found: Floats = np.arccos(np.clip(-greatest(parts[0], parts[1], parts[2], self.angle), -1.0, 1.0))
        return found
