"""Samples of the dual bound: pairs at times, with their places and kernel."""

from collections.abc import Sequence
from math import inf
from typing import Any, NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.planning.bounds.dual_bound import dual_bound
from closeform.planning.bounds.zone_pieces import Piece, inner_curvature
from closeform.planning.plan import Contact
from closeform.planning.problem.problem import Problem
from closeform.planning.problem.scene import Contacts
from closeform.zones.shapes import BALL

CLOSED = 1e-6  # of the multipliers' own energy: sufficient accuracy of the bound
ROUGH = 0.02  # accuracy of a plan's bound, of the bound or of what it lacks


class Answer(NamedTuple):
    """Bound on the extra energy [m^2/s^3], and the minimum of its Lagrangian.

    `forces` and `reached` places (K, 3) of the samples are in zone coordinates.  `short` (K,) is the gain
    of the bound, to first order, if the place were on the surface of its zone instead of inside.
    """

    bound: float
    forces: Floats
    reached: Floats
    short: Floats


class Samples:
    """Pairs at times: `contacts`, the unconstrained places there, and the kernel between them."""

    def __init__(self, problem: Problem, which: Any, times: Any, drifts: Floats | None = None) -> None:
        self.problem = problem
        self.contacts = Contacts.none()
        self.add(which, times, drifts)

    def add(self, which: Any, times: Any, drifts: Floats | None = None) -> None:
        """Add samples, moved into the windows of their pairs; `drifts` are those of contacts."""
        pairs, when = np.array(which, dtype=np.int64), np.array(times, dtype=float)
        inside = np.clip(when, *self.problem.windows[0][pairs].T)
        if drifts is not None:
            inside = np.where(drifts.any(axis=1), when, inside)
        self.contacts = self.contacts.joined(Contacts.at(pairs, inside, drifts))
        motions, gram = self.problem.unconstrained(self.contacts)
        self.places = motions[:, 0]
        self.gram = 0.5 * (gram + gram.T)
        self.zones = [self.problem.zones[kind] for kind in self.problem.kinds[self.contacts.which]]

    def near(self, which: int, time: float, same: float) -> int:
        """Return the number of a pair's sample within `same` of all time of a time; add one if missing."""
        apart = np.where(self.contacts.which == which, np.abs(self.contacts.times - time), inf)
        if apart.min() > same * (self.problem.last - self.problem.first):
            self.add([which], [time])
            return self.contacts.number - 1
        return int(apart.argmin())

    def compliance(self, sample: int) -> Floats:
        """Return the response (3, 3) of a sample's place to a force there."""
        return self.gram[3 * sample : 3 * sample + 3, 3 * sample : 3 * sample + 3]

    def pushed(self, samples: Sequence[int], forces: Floats) -> Contacts:
        """Return the samples with nonzero forces as contacts."""
        sizes = np.linalg.norm(forces, axis=1)
        bear = sizes > 0.0
        contacts = self.contacts.some(np.array(samples)[bear])
        return contacts._replace(normals=forces[bear] / sizes[bear, None], multipliers=sizes[bear])

    def bound(self, contacts: Sequence[Contact], energy: float | None) -> float:
        """Return the dual bound of samples outside the largest balls in their zones, from contacts there.

        `energy` is that of their multipliers, computed unless given.
        """
        sigmas = self.problem.sigmas
        sizes = np.array([one.multiplier * (one.reach + sigmas * one.sigma) for one in contacts])
        if energy is None:
            kinds = self.problem.kinds[self.contacts.which]
            pushes = np.array([one.multiplier * one.normal for one in contacts])
            pushes[[one.first > one.second for one in contacts]] *= -1.0
            metres = self.problem.bare.matrices[kinds].transpose(0, 2, 1)
            forces = np.linalg.solve(metres, pushes[:, :, None]).ravel()
            energy = 0.5 * float(forces @ self.gram @ forces)
        round_ones = all(zone.shape == BALL for zone in self.zones)
        start = sizes if round_ones else np.zeros(len(sizes))
        ways = np.array([one.normal for one in contacts])
        if (insides := self.problem.insides(self.contacts, ways)) is None:
            curved = np.repeat([inner_curvature(zone) for zone in self.zones], 3)
            places, gram = curved * self.places.ravel(), curved[:, None] * self.gram * curved
        else:
            count, given = len(insides), self.gram.reshape(len(insides), 3, len(insides), 3)
            places = (insides @ self.places[:, :, None]).ravel()
            both = np.einsum("kia,kamb,mjb->kimj", insides, given, insides).reshape(3 * count, 3 * count)
            gram = 0.5 * (both + both.T)
        bound: float = dual_bound(
            places,
            gram,
            3 * np.arange(len(sizes) + 1),
            np.empty(0),
            (1.0 - CLOSED) * energy,
            ROUGH,
            start,
            np.zeros(3 * len(sizes)),
        )
        return bound

    def answer(
        self,
        samples: Sequence[int],
        pieces: Sequence[Piece],
        enough: float,
        tolerance: float,
        start: Floats | None = None,
    ) -> Answer:
        """Return the dual bound of samples in pieces of their zones' outside, from multipliers `start`."""
        count = len(samples)
        round_ones = [k for k in range(count) if len(pieces[k].rows)]
        planes = [k for k in range(count) if not pieces[k].whole]
        offsets = np.cumsum([0, *(len(pieces[k].rows) for k in round_ones)])
        rows = np.zeros((offsets[-1] + len(planes), count, 3))
        for first, k in zip(offsets, round_ones, strict=False):
            rows[first : first + len(pieces[k].rows), k] = pieces[k].rows
        for row, k in enumerate(planes, offsets[-1]):
            rows[row, k] = pieces[k].normal
        rows = rows.reshape(len(rows), 3 * count)
        index = (3 * np.array(samples)[:, None] + np.arange(3)).ravel()
        gram, places = self.gram[np.ix_(index, index)], self.places[samples].ravel()
        between = rows @ gram @ rows.T
        multipliers = np.zeros(len(round_ones) + len(planes)) if start is None else start.copy()
        forces = np.zeros(len(rows))
        bound = dual_bound(
            rows @ places,
            0.5 * (between + between.T),
            offsets,
            np.array([pieces[k].floor for k in planes]),
            enough,
            tolerance,
            multipliers,
            forces,
        )
        forces = rows.T @ forces
        reached = (places + gram @ forces).reshape(count, 3)
        short = np.zeros(count)
        for weight, k in zip(multipliers, round_ones, strict=False):
            short[k] = 0.5 * weight * pieces[k].missing(reached[k])
        for weight, k in zip(multipliers[len(round_ones) :], planes, strict=True):
            if len(pieces[k].rows):
                short[k] += weight * (1.0 - np.linalg.norm(pieces[k].rows @ reached[k]))
        return Answer(bound, forces.reshape(count, 3), reached, np.maximum(short, 0.0))
