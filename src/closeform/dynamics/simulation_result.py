"""What flights of a plan in a field answer: where craft went, what it cost, how near pairs came."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from closeform.arrays import Floats, whole
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path
from closeform.result import Rows

if TYPE_CHECKING:
    from closeform.fuel.firing import ThrusterFiring

DAY = 86400.0  # s
ROUNDING = 1e-12  # of what is spent: what is left of it below that is nothing


@dataclass(frozen=True, eq=False, repr=False)
class Simulation(Rows):
    """S flights of N craft in a field; made by `fly`.

    Attributes
    ----------
    times : array of shape (T,) [s]
        Since the chief's epoch.
    states : array of shape (S, N, T, 6) [m, m/s]
        Flown, in the chief's axes.
    arrivals : array of shape (S, N, T, 6) [m, m/s]
        The same before impulses that are fired then, in the chief's axes: velocities differ.
    delta_v : array of shape (S, N) [m/s]
        Spent: the sum of the three that follow.
    planned_delta_v : array of shape (N,) [m/s]
        Of the plan; of a craft with thrusters what these fire for it in Hill's equations, each counted.
    field_delta_v : array of shape (N,) [m/s]
        What it takes beyond that to command against what Hill's equations leave out; negative where that
        helps, 0 without `cancel`.
    limited : array of shape (S, N), no unit
        The share of time in which each craft is asked for more thrust than `max_acceleration`, or to come
        back by more than its thrusters give, or where none of them pushes.
    pairs : array of int of shape (P, 2)
        Pairs i < j that have a zone.
    ratios : array of shape (S, P), no unit
        The least of each pair and flight, at these times and between them.
    planned : Path
        What was to be flown.
    replans : array of int of shape (S,)
        How many new plans were flown.
    refused : tuple of (int, float [s], str)
        New plans that there were not: the seed, the time, and with how much of the room and why.
    firing : ThrusterFiring or None
        What thrusters fire by plan, of craft that have some; None without.
    ordered : array of shape (Q,) [s]
        When thrusters are told how to lead back; none without thrusters.
    orders : array of shape (S, N, Q, 3) [m/s]
        How: the delta-v of their burns until the next time, each about the middle of what their plan leaves
        them of it; radial, along-track and cross-track, in the chief's axes.
    """

    _columns: ClassVar = {
        "seed": "seed",
        "craft": "craft",
        "ends": "end_m",
        "delta_v": "delta_v_m_s",
        "feedback_delta_v": "feedback_delta_v_m_s",
    }
    _told: ClassVar = ("greatest_end", "greatest_delta_v", "least_ratio", "violated", "worst")

    times: Floats
    states: Floats
    arrivals: Floats
    delta_v: Floats
    planned_delta_v: Floats
    field_delta_v: Floats
    limited: Floats
    pairs: Any
    ratios: Floats
    planned: Path
    replans: Any
    refused: tuple[tuple[int, float, str], ...]
    firing: ThrusterFiring | None
    ordered: Floats
    orders: Floats

    @property
    def orbit(self) -> Orbit:
        """In which the plan was made."""
        return self.planned.orbit

    @property
    def seed(self) -> Any:
        """Which flight each row of `columns` is of (S, N), no unit."""
        return np.broadcast_to(np.arange(len(self.delta_v))[:, None], self.delta_v.shape)

    @property
    def craft(self) -> Any:
        """Which craft each row of `columns` is of (S, N), no unit."""
        return np.broadcast_to(np.arange(self.delta_v.shape[1]), self.delta_v.shape)

    @property
    def feedback_delta_v(self) -> Any:
        """What each craft spends on errors of all kinds (S, N) [m/s], less what limits keep back.

        Where impulses or pulses lead back it holds coasts against the field, too.
        """
        spent = self.delta_v - self.planned_delta_v - self.field_delta_v
        return np.where(np.abs(spent) > ROUNDING * self.delta_v, spent, 0.0)

    @cached_property
    def deviations(self) -> Floats:
        """How far each craft is off the plan at the times (S, N, T) [m]."""
        apart = self.states[..., :3] - self.planned.position(self.times)
        return np.asarray(np.linalg.norm(apart, axis=-1))

    @property
    def ends(self) -> Floats:
        """How far off the plan each craft ends (S, N) [m]."""
        return self.deviations[..., -1]

    @property
    def delta_v_per_day(self) -> Floats:
        """What each craft spends in a day (S, N) [m/s]."""
        return np.asarray(self.delta_v * (DAY / (self.times[-1] - self.times[0])))

    @property
    def greatest_deviation(self) -> float:
        """How far off the plan a craft is at most [m]."""
        return float(self.deviations.max())

    @property
    def greatest_end(self) -> float:
        """How far off the plan a craft ends at most [m]."""
        return float(self.ends.max())

    @property
    def greatest_delta_v(self) -> float:
        """What a craft spends at most [m/s]."""
        return float(self.delta_v.max())

    @property
    def least_ratio(self) -> float:
        """The least of all pairs and flights, no unit; inf without zones."""
        return float(self.ratios.min(initial=np.inf))

    @property
    def violated(self) -> float:
        """The share of flights in which a zone is entered, no unit."""
        return float((self.ratios < 1.0).any(axis=1).mean())

    @property
    def worst(self) -> int:
        """The flight in which a pair comes nearest, or without zones a craft ends farthest off."""
        by_end = int(np.argmax(self.ends.max(axis=1)))
        return int(np.argmin(self.ratios.min(axis=1))) if self.ratios.size else by_end

    def path(self, seed: int) -> Path:
        """What was flown, as paths: `screen` certifies what they say.

        Parameters
        ----------
        seed : int
            Which flight.

        Returns
        -------
        Path
            Of shape (N,), through its states, with the impulses that were fired.

        Raises
        ------
        ValueError
            If there is no such flight.

        References
        ----------
        docs/field.md.
        """
        if whole("seed", seed) >= len(self.states):
            raise ValueError(f"seed: there are {len(self.states)} flights, got {seed}")
        states, arrivals = self.states[seed], self.arrivals[seed]
        return self.planned.orbit._through(self.times, states, arrivals)
