"""Cost estimates of passing on another side, which rank the starts of the search."""

from typing import NamedTuple

import numpy as np
from numba import float64, void

from closeform._jit import kernel
from closeform.arrays import Floats
from closeform.planning.energy.quadratic_program import solve_qp
from closeform.planning.problem.problem import Problem
from closeform.planning.problem.scene import INDICES, NUMBERS, ROWS, Contacts


class Turn(NamedTuple):
    """Start of the search: contacts of a solution, but with the k-th contact's pair on another side.

    That pair has no other contacts.
    """

    contacts: Contacts
    k: int
    side: Floats

    @property
    def start(self) -> Contacts:
        """The contacts with which the local solver begins."""
        if self.contacts.number == 1:
            return self.contacts._replace(normals=self.side[None], multipliers=np.ones(1))
        rest = self.contacts.some(self.contacts.which != self.contacts.which[self.k])
        one = self.contacts.some([self.k])._replace(normals=self.side[None], multipliers=np.ones(1))
        return rest.joined(one)


def turned_energies(problem: Problem, margin: float, turns: list[Turn]) -> list[float]:
    """Return estimated energies of turns of one solution: minima for the planes of fixed contacts.

    Sliding of contacts and new contacts are neglected.
    """
    if not turns:
        return []
    contacts = turns[0].contacts
    motions, compliance = problem.unconstrained(contacts)
    energies = np.empty(len(turns))
    fill_energies(
        contacts.which,
        contacts.normals,
        motions[:, 0].copy(),
        compliance,
        margin,
        np.array([turn.k for turn in turns]),
        np.array([turn.side for turn in turns]),
        energies,
    )
    return [float(energy) for energy in energies]


@kernel(void(INDICES, ROWS, ROWS, ROWS, float64, INDICES, ROWS, NUMBERS))
def fill_energies(which, normals, places, compliance, aim, turned, sides, energies):
    """Fill `energies` from K contacts, their unconstrained `places` (K, 3), and `compliance` (3K, 3K)."""
    count = len(which)
    felt = np.zeros((count, count, 3))  # response of the place of one to a force along the normal of another
    gram, work = np.empty((count, count)), np.empty((count, count))
    gaps, multipliers = np.empty(count), np.empty(count)
    kept, active = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.bool_)
    for k in range(count):
        for m in range(count):
            for i in range(3):
                for j in range(3):
                    felt[k, m, i] += compliance[3 * k + i, 3 * m + j] * normals[m, j]
    for a in range(len(turned)):
        own, side, size = turned[a], sides[a], 1
        kept[0] = own
        for k in range(count):
            if which[k] != which[own]:
                kept[size] = k
                size += 1
        for row in range(size):
            k = kept[row]
            normal = side if row == 0 else normals[k]
            gaps[row], active[row] = aim, True
            for i in range(3):
                gaps[row] -= normal[i] * places[k, i]
            for column in range(1, row + 1):
                gram[row, column] = 0.0
                for i in range(3):
                    gram[row, column] += normal[i] * felt[k, kept[column], i]
                gram[column, row] = gram[row, column]
            gram[row, 0] = 0.0
            for i in range(3):
                for j in range(3):
                    gram[row, 0] += normal[i] * compliance[3 * k + i, 3 * own + j] * side[j]
            gram[0, row] = gram[row, 0]
        solve_qp(gram, gaps, size, active, 0.0, work, multipliers)
        energies[a] = 0.0
        for row in range(size):
            for column in range(size):
                energies[a] += 0.5 * multipliers[row] * gram[row, column] * multipliers[column]
