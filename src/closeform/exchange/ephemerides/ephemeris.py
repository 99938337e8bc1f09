"""Ephemeris: states of one object over time, as in a message."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import ClassVar

import numpy as np

from closeform.arrays import Floats, instance, numbers
from closeform.exchange.ephemerides.covariance import LOCAL, Covariances, canonical
from closeform.result import Rows

SAME_EPOCH = 1e-8  # s: a tenth of a millimetre of motion in low orbit


@dataclass(frozen=True, eq=False, repr=False)
class Ephemeris(Rows):
    """States of one object over time, as in one segment of an OEM.

    Parameters
    ----------
    name, object_id : str
        Values of OBJECT_NAME and OBJECT_ID.
    center : str
        CENTER_NAME, the body at the frame's origin.
    frame : str
        REF_FRAME.
    time_system : str
        TIME_SYSTEM, such as "UTC".
    epoch : str
        ISO epoch of the first state in `time_system`.
    times : array of shape (T,) [s]
        Times since `epoch`, increasing, T >= 2; array_like.
    states : array of shape (T, 6) [m, m/s]
        States in `frame` about `center`; array_like.
    covariances : Covariances, optional
        Covariances of the states, at their own epochs.

    Raises
    ------
    ValueError
        If a text is of another type, shapes do not fit, a value is not finite, times do not increase, or a
        covariance is in a frame that is neither local nor that of the states.

    References
    ----------
    CCSDS 502.0-B, Orbit Data Messages; docs/ephemerides.md.
    """

    _columns: ClassVar = {
        "times": "time_s",
        "states": "x_m y_m z_m vx_m_s vy_m_s vz_m_s",
    }

    name: str
    object_id: str
    center: str
    frame: str
    time_system: str
    epoch: str
    times: Floats
    states: Floats
    covariances: Covariances | None = None

    def __post_init__(self) -> None:
        for field in fields(self)[:6]:
            instance(field.name, getattr(self, field.name), str)
        times, states = numbers("times", self.times), numbers("states", self.states)
        if times.ndim != 1 or len(times) < 2 or states.shape != (len(times), 6):
            got = f"got {times.shape} and {states.shape}"
            raise ValueError(f"times, states: expected shapes (T,) and (T, 6) with T >= 2, {got}")
        flaw = flaw_of_states(times, states)
        if flaw is not None:
            raise ValueError(f"times, states: row {flaw[0]}: {flaw[1]}")
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "states", states)
        if self.covariances is not None:
            for frame in instance("covariances", self.covariances, Covariances).frames:
                if (wrong := flaw_of_frame(frame, self.frame)) is not None:
                    raise ValueError(f"covariances: frame {wrong}")


def flaw_of_states(times: Floats, states: Floats) -> tuple[int, str] | None:
    """Return the index of the first invalid row, and the reason, or None."""
    finite = np.isfinite(times) & np.isfinite(states).all(axis=1)
    if not finite.all():
        return int(np.argmin(finite)), "a value is not finite; remove or correct this state"
    rising = np.diff(times) > 0.0
    if not rising.all():
        return int(np.argmin(rising)) + 1, "epochs must increase; sort the states and remove duplicates"
    return None


def flaw_of_frame(frame: str, states: str) -> str | None:
    """Return the reason why a covariance cannot be in `frame`, given the frame of the states, or None."""
    if canonical(frame) in (*LOCAL, canonical(states)):
        return None
    return f"{frame} is not supported; give covariances in one of {', '.join(LOCAL)}, {states}"
