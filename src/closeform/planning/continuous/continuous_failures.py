"""Close approaches of craft that lose continuous thrust at any instant.

All failures of paths are sampled.  The minima over time of these, and those of known contacts, move to the
closest approaches over failure instant and time.                                              # theory 4
"""

from math import inf
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.motion.arc import END, START
from closeform.planning.passive.failure_minima import find_failures, slide_failures
from closeform.planning.problem.contacts import turn_normals
from closeform.planning.problem.problem import MARGIN, Problem, Trajectories
from closeform.planning.problem.scene import Contacts
from closeform.zones.shapes import BALL

# Zones, within which a sampled minimum becomes a plane, and is refined to the nearest minimum.
REACH, NEAR = 1.8, 1.4
MOMENTS = 48  # sampled instants of failure of each craft, or of each orbit where that is more
EARLY = 1e-4, 1e-3, 4e-3  # of a craft's time: additional instants near its ends
SAME = 0.25  # of the time between them: closer contacts are merged
ROOM = 400  # capacity for minima, for each pair
POWER = 32.0  # of the norms whose balls enclose zones with edges


class ContinuousFailures:
    """Loss of continuous thrust in one problem; zones with edges are rounded and slightly larger."""

    def __init__(self, problem: Problem) -> None:
        self.problem, scene = problem, problem.seen
        edged = scene.shapes != BALL
        self.scene = scene._replace(
            powers=np.where(edged, POWER, inf),
            aims=np.where(edged, 3.0 ** (1.0 / POWER), 1.0),
        )
        start, end = problem.base[:, START], problem.base[:, END]
        longest = float((end - start).max())
        count = int(MOMENTS * max(1.0, longest * problem.orbit._rate / (2.0 * np.pi)))
        shares = np.concatenate([EARLY, (np.arange(count) + 0.5) / count, 1.0 - np.array(EARLY)])
        shares = MARGIN + (1.0 - 2.0 * MARGIN) * np.sort(shares)
        self.moments = start[:, None] + (end - start)[:, None] * shares
        self.same = SAME * longest / count
        self.unshifted = np.zeros((len(scene.states), 6))
        self.room = Contacts.none(ROOM * (1 + len(scene.pairs)))
        self.norms = np.empty(self.room.number)

    def near(self, whole: Trajectories, known: Contacts) -> tuple[Contacts, float]:
        """Return planes at close approaches of failed craft of whole paths, and the smallest norm in aims.

        They are sampled failures, closest approaches near these and the `known` contacts, and the previous
        places of the known contacts.
        """
        rows = self.problem._own_rows(whole)
        fresh, norms = self.sampled(*rows, self.unshifted)
        near = known.joined(fresh.some(norms < NEAR))
        slid, stayed, ratios = (
            near.some(np.arange(near.number)),
            near.first(near.number),
            np.empty(near.number),
        )
        slide_failures(self.scene, *rows, slid, stayed.normals, ratios)
        both = slid.some(np.argsort(ratios, kind="stable")).joined(stayed.first(known.number))
        nearest = float(min(norms.min(initial=inf), ratios.min(initial=inf)))
        return both.some(self.once(both)).joined(fresh), nearest

    def inside(self, whole: Trajectories, contacts: Contacts) -> Contacts:
        """Return the contacts whose positions on paths are beyond their planes."""
        places = self.problem.motions(whole, contacts)[:, 0]
        aims = self.scene.aims[self.problem.kinds[contacts.which]]
        return contacts.some((contacts.normals * places).sum(axis=1) < aims)

    def turned(self, trajectories: Trajectories, contacts: Contacts) -> Contacts:
        """Return contacts with the normals of the given paths, and without force."""
        normals = np.zeros((contacts.number, 3))
        turn_normals(self.scene, *self.problem._own_rows(trajectories), contacts, -inf, normals)
        return contacts._replace(normals=normals, multipliers=np.zeros(contacts.number))

    def shifted(self, shifts: Floats) -> Contacts:
        """Return planes of the unconstrained paths shifted by natural motions."""
        return self.sampled(self.scene.direct, self.scene.direct_offsets, shifts)[0]

    def once(self, contacts: Contacts) -> Any:
        """Return the indices of distinct contacts, the first of each."""
        cells = np.rint(np.column_stack([contacts.times, contacts.drifts]) / self.same)
        order = np.lexsort((*cells.T[::-1], contacts.which))
        rows = np.column_stack([contacts.which, cells])[order]
        return order[np.append(True, (rows[1:] != rows[:-1]).any(axis=1))[: len(order)]]

    def sampled(self, rows: Floats, offsets: Any, shifts: Floats) -> tuple[Contacts, Floats]:
        """Return the minima within REACH after sampled failures of shifted bodies, and their norms."""
        given = self.scene, rows, offsets, self.moments, shifts, REACH, self.room, self.norms
        self.problem.effort.used += self.moments.shape[1] * len(self.scene.times) * len(self.scene.pairs)
        count = find_failures(*given)
        return self.room.first(count), self.norms[:count].copy()
