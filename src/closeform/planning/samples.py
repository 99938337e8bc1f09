"""Pairs at times, at which the dual bound looks at all plans."""

from collections.abc import Sequence
from math import inf
from typing import Any, NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.planning.dual_bound import dual_bound
from closeform.planning.pieces import Piece, inner_curvature
from closeform.planning.plan import Contact
from closeform.planning.problem import Problem
from closeform.planning.scene import Contacts
from closeform.zones.shapes import BALL

CLOSED = 1e-6  # of the multipliers' own energy: a bound this near is enough
ROUGH = 0.02  # of the bound of a plan, or of what it lacks: how far it is climbed


class Answer(NamedTuple):
    """A bound of the extra energy [m^2/s^3], and where its Lagrangian is least.

    Of each sample: force and place (K, 3) in zone coordinates, and what it falls short: how much the bound
    would gain, to first order, were its place on the surface of its zone and not inside.
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
        """Further samples, each moved to when one of its pair can give way; `drifts` as of contacts."""
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
        """The number of the sample of a pair within `same` of all time of a time, added if there is none."""
        apart = np.where(self.contacts.which == which, np.abs(self.contacts.times - time), inf)
        if apart.min() > same * (self.problem.last - self.problem.first):
            self.add([which], [time])
            return self.contacts.number - 1
        return int(apart.argmin())

    def compliance(self, sample: int) -> Floats:
        """What a force at a sample does to its own place (3, 3)."""
        return self.gram[3 * sample : 3 * sample + 3, 3 * sample : 3 * sample + 3]

    def pushed(self, samples: Sequence[int], forces: Floats) -> Contacts:
        """The samples that bear a force, as contacts."""
        sizes = np.linalg.norm(forces, axis=1)
        bear = sizes > 0.0
        contacts = self.contacts.some(np.array(samples)[bear])
        return contacts._replace(normals=forces[bear] / sizes[bear, None], multipliers=sizes[bear])

    def bound(self, contacts: Sequence[Contact], energy: float | None) -> float:
        """The dual bound of samples outside of the largest balls in their zones, from contacts there.

        `energy`: what their multipliers spend, worked out unless given.
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
        """The dual bound of samples, each in a piece of its zone's outside; `start`: multipliers to try."""
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
