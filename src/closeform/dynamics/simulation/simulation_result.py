"""Result of simulations of a plan: states, delta-v and clearance ratios."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from closeform.arrays import Floats, whole
from closeform.fuel.firing import ThrusterFiring
from closeform.fuel.pulses import Pulses
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path
from closeform.result import Rows

DAY = 86400.0  # s
ROUNDING = 1e-12  # relative rounding error of the delta-v


@dataclass(frozen=True, eq=False, repr=False)
class Simulation(Rows):
    """S simulations of N spacecraft in a field; returned by `simulate`.

    Attributes
    ----------
    times : array of shape (T,) [s]
        Times since the chief's epoch.
    states : array of shape (S, N, T, 6) [m, m/s]
        Simulated states, in the chief's axes.
    arrivals : array of shape (S, N, T, 6) [m, m/s]
        States before impulses at these times, in the chief's axes; only velocities differ.
    delta_v : array of shape (S, N) [m/s]
        Delta-v spent: the sum of the next three.
    planned_delta_v : array of shape (N,) [m/s]
        Delta-v of the plan; for spacecraft with thrusters that of the firing in Hill's equations, per
        thruster.
    field_delta_v : array of shape (N,) [m/s]
        Additional delta-v to compensate the model error; negative where it helps, 0 without `cancel`.
    limited : array of shape (S, N), no unit
        Fraction of time in which the command of each spacecraft exceeds `max_acceleration`, or its feedback
        exceeds the capability of its thrusters.
    pairs : array of int of shape (P, 2)
        Pairs i < j that have a zone.
    ratios : array of shape (S, P), no unit
        Minimum clearance ratio of each pair and simulation, at these times and between them.
    planned : Path
        Planned paths.
    replans : array of int of shape (S,)
        Number of new plans executed.
    refused : tuple of (int, float [s], str)
        Failed replans: seed, time, and reason with the fraction of the margin.
    firing : ThrusterFiring or None
        Planned firing of spacecraft with thrusters; None without.
    pulses : tuple of Pulses
        Planned pulses in each simulation, those of new plans included; empty without thrusters.
    ordered : array of shape (Q,) [s]
        Times of feedback orders to thrusters; empty without thrusters.
    orders : array of shape (S, N, Q, 3) [m/s]
        Delta-v of the feedback burns until the next order, each centred in the time without planned firing;
        radial, along-track and cross-track, in the chief's axes.
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
    pulses: tuple[Pulses, ...]
    ordered: Floats
    orders: Floats

    @property
    def orbit(self) -> Orbit:
        """Orbit of the plan."""
        return self.planned.orbit

    @property
    def seed(self) -> Any:
        """Index of the simulation of each row of `columns` (S, N), no unit."""
        return np.broadcast_to(np.arange(len(self.delta_v))[:, None], self.delta_v.shape)

    @property
    def craft(self) -> Any:
        """Index of the spacecraft of each row of `columns` (S, N), no unit."""
        return np.broadcast_to(np.arange(self.delta_v.shape[1]), self.delta_v.shape)

    @property
    def feedback_delta_v(self) -> Any:
        """Delta-v of each spacecraft for feedback (S, N) [m/s], reduced by thrust limits.

        With impulsive or pulsed feedback it includes the compensation of the model error on held coasts.
        """
        spent = self.delta_v - self.planned_delta_v - self.field_delta_v
        return np.where(np.abs(spent) > ROUNDING * self.delta_v, spent, 0.0)

    @cached_property
    def deviations(self) -> Floats:
        """Distance of each spacecraft from the plan at the times (S, N, T) [m]."""
        apart = self.states[..., :3] - self.planned.position(self.times)
        return np.asarray(np.linalg.norm(apart, axis=-1))

    @property
    def ends(self) -> Floats:
        """Distance of each spacecraft from the plan at the end (S, N) [m]."""
        return self.deviations[..., -1]

    @property
    def delta_v_per_day(self) -> Floats:
        """Delta-v of each spacecraft per day (S, N) [m/s]."""
        return np.asarray(self.delta_v * (DAY / (self.times[-1] - self.times[0])))

    @property
    def greatest_deviation(self) -> float:
        """Largest distance of any spacecraft from the plan [m]."""
        return float(self.deviations.max())

    @property
    def greatest_end(self) -> float:
        """Largest distance of any spacecraft from the plan at the end [m]."""
        return float(self.ends.max())

    @property
    def greatest_delta_v(self) -> float:
        """Largest delta-v of any spacecraft [m/s]."""
        return float(self.delta_v.max())

    @property
    def least_ratio(self) -> float:
        """Minimum clearance ratio of all pairs and simulations, no unit; inf without zones."""
        return float(self.ratios.min(initial=np.inf))

    @property
    def violated(self) -> float:
        """Fraction of simulations in which a zone is entered, no unit."""
        return float((self.ratios < 1.0).any(axis=1).mean())

    @property
    def worst(self) -> int:
        """Index of the simulation with the minimum clearance ratio, or without zones largest end error."""
        by_end = int(np.argmax(self.ends.max(axis=1)))
        return int(np.argmin(self.ratios.min(axis=1))) if self.ratios.size else by_end

    def path(self, seed: int) -> Path:
        """Return the simulated paths of one simulation, for example for `screen`.

        Parameters
        ----------
        seed : int
            Index of the simulation.

        Returns
        -------
        Path
            Paths of shape (N,) through its states, with the impulses as fired.

        Raises
        ------
        ValueError
            If there is no such simulation.

        References
        ----------
        docs/field.md.
        """
        if whole("seed", seed) >= len(self.states):
            raise ValueError(f"seed: must be below {len(self.states)}, the number of simulations, got {seed}")
        states, arrivals = self.states[seed], self.arrivals[seed]
        return self.planned.orbit._through(self.times, states, arrivals)
