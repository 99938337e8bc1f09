"""Paths of a formation about any chief, for the kernels of its problem and as arcs.

The polynomials of `pieces` come from the chief's table.  Paths at rest at the end T follow from those at rest
at the start by the constant l1.x2 - l2.x1 of two optimal paths, l their costates:

    B(s)^T = E R(s, T) G,    G = -C F(T)^-T,    C = [[0, I], [-I, -W]]                   # theory (97a)

with F(T) the response of the state at the end to the costate c = (p, p') at the start, R(s, T) that of the
state at s to the costate at the end where the state is zero, and C from l = (-p' - W p, p) to c.
"""

from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.motion.arc import END, START, STATE, THRUST
from closeform.motion.chief.bernstein import TERMS
from closeform.motion.chief.clock import RATE
from closeform.motion.chief.segments import (
    BEGIN,
    COLUMN,
    FINISH,
    WINDOW,
)
from closeform.motion.chief.segments import ORIGIN as WINDOW_ORIGIN
from closeform.motion.chief.table import COLUMNS, COSTATE, PUSH
from closeform.motion.chief_orbit import ChiefOrbit
from closeform.planning.problem.deflection import fill_changes
from closeform.planning.problem.pieces import (
    AHEAD,
    BACK,
    LENGTH,
    PATHS,
    PIECE,
    PLACES,
    columns_back,
)
from closeform.planning.problem.scene import Contacts, Scene


class ChiefPaths:
    """Polynomials of N craft on unconstrained optima between `first` and `last`, for a scene's kernels.

    `spans` (U, 4) are pieces without coefficients, `units` (U, 13, 36) the coefficients of the base path, A
    and B^T, zero where a craft coasts, and `offsets` (N + 1,) the first piece of each craft.
    """

    def __init__(self, orbit: ChiefOrbit, base: Floats, first: float, last: float) -> None:
        """Make the polynomials of `base` arcs (N, 30)."""
        self.orbit, self.base, self.clock = orbit, base, orbit.chief.table.clock
        self.direct = with_coasts(orbit, base, first, last)
        whole, self.offsets = orbit._segments(*self.direct)
        self.spans = np.ascontiguousarray(self._spans(whole))
        columns = np.zeros((len(whole), PATHS, COLUMNS))
        columns[:, 0] = whole[:, COLUMN:]
        craft = np.repeat(np.arange(len(base)), np.diff(self.offsets))
        own = (whole[:, BEGIN] >= base[craft, START]) & (whole[:, FINISH] <= base[craft, END])
        columns[own, AHEAD:BACK, :PUSH] = self._ahead()
        columns[own, BACK:, :PUSH] = self._back(whole[own], craft[own])
        self.units = self._coefficients(whole, columns)

    def _ahead(self) -> Floats:
        """Return the columns (S, 6, 12) of A at the window beginnings of all craft's own segments."""
        arcs = np.repeat(self.base, 6, axis=0)
        arcs[:, STATE:] = 0.0
        arcs[:, THRUST : THRUST + 6] = np.tile(np.eye(6), (len(self.base), 1))
        found, firsts = self.orbit._segments(arcs, np.arange(len(arcs) + 1))
        counts = np.diff(firsts)[::6]
        rows = np.concatenate(
            [
                found[firsts[6 * c] : firsts[6 * c + 6], COLUMN : COLUMN + PUSH].reshape(6, counts[c], PUSH)
                for c in range(len(self.base))
            ],
            axis=1,
        )
        return np.asarray(rows.swapaxes(0, 1))

    def _back(self, segments: Floats, craft: Any) -> Floats:
        """Return the columns (S, 6, 12) of B^T at the window beginnings of segments of each `craft` (S,)."""
        table, rate = self.orbit.chief.table, float(self.clock[RATE])
        lengths = self.base[:, END] - self.base[:, START]
        flow, answers = self.orbit._flows(self.base[:, [START, END]])
        # F in units of the duration: rows of positions and velocities, columns of p and p'
        time = rate * lengths[:, None]
        rows = np.repeat(time ** np.array([[-2.0, -1.0]]), 3, axis=1)
        columns = np.repeat(time ** np.array([[0.0, -1.0]]), 3, axis=1)
        inverse = np.linalg.inv(rows[:, :, None] * answers[:, :, : PUSH - COSTATE] * columns[:, None, :])
        inverse = columns[:, :, None] * inverse * rows[:, None, :]
        units = self.units_of_columns
        out = np.empty((len(craft), PUSH, 6))
        bounds = np.searchsorted(craft, np.arange(len(self.base) + 1))
        for c, (first, last) in enumerate(zip(bounds[:-1], bounds[1:], strict=True)):
            skew = self.orbit._skew(self.base[c, END])
            adjoint = -inverse[c].T * units[1] / units[0][:, None]
            costates = np.concatenate([adjoint[3:], -adjoint[:3] - rate * skew @ adjoint[3:]])
            columns_back(table.form, segments, first, last, costates / units[1][:, None], out[first:last])
        return np.asarray(out.swapaxes(1, 2))

    @property
    def units_of_columns(self) -> Floats:
        """Units (2, 6) of the table's states [m, m/s] and costates [m/s^2, m/s^3]."""
        return np.repeat(float(self.clock[RATE]) ** np.arange(4.0), 3).reshape(2, 6)

    def _spans(self, segments: Floats) -> Floats:
        """Return segments as pieces without coefficients (S, 4)."""
        joints, windows = self.orbit.chief.table.joints, segments[:, WINDOW].astype(int)
        spans = segments[:, [BEGIN, FINISH, WINDOW_ORIGIN, WINDOW]]
        spans[:, LENGTH] = joints[windows + 1] - joints[windows]
        return np.asarray(spans)

    def _coefficients(self, segments: Floats, columns: Floats) -> Floats:
        """Return coefficients (S, Q, 36) of positions from columns (S, Q, 15)."""
        rows = self.orbit.chief.table.rows[segments[:, WINDOW].astype(int), :, :3]
        return np.ascontiguousarray(columns @ rows.reshape(len(segments), COLUMNS, 3 * TERMS))

    def pieces(self, arcs: Floats, offsets: Any) -> tuple[Floats, Any]:
        """Return the pieces (S, 40) of arcs (M, 30) of several bodies, and the first one of each body."""
        segments, firsts = self.orbit._segments(np.ascontiguousarray(arcs), offsets)
        out = np.empty((len(segments), PIECE))
        out[:, :PLACES] = self._spans(segments)
        out[:, PLACES:] = self._coefficients(segments, segments[:, None, COLUMN:])[:, 0]
        return out, firsts

    def propagate(self, scene: Scene, contacts: Contacts) -> tuple[Floats, Any]:
        """Return all craft's arcs (M, 30) under contacts, with the coasts before and after, and offsets."""
        direct, firsts = self.direct
        states, costates = self.units_of_columns
        changes = np.empty((len(self.base), 6))
        fill_changes(scene, contacts, changes)
        pairs = scene.pairs[contacts.which]
        pushes = (contacts.normals[:, None] @ scene.matrices[scene.kinds[contacts.which]])[:, 0]
        pushes *= contacts.multipliers[:, None]
        found, offsets = [], [0]
        for c, row in enumerate(self.base.copy()):
            start, end = row[START], row[END]
            side = pairs == c
            drifts = (contacts.drifts * side).sum(axis=1)
            felt = contacts.times - drifts  # the contact, or the loss of thrust
            acts = side.any(axis=1) & (start < felt) & (felt < end) & (contacts.multipliers != 0.0)
            own = np.flatnonzero(acts)[np.argsort(felt[acts], kind="stable")]
            jumps = self.orbit.transition(-drifts[own], contacts.times[own])[:, :, 3:] @ pushes[own, :, None]
            jumps = np.where(side[own, :1], jumps[..., 0], -jumps[..., 0])
            row[THRUST : THRUST + 6] += changes[c]
            times = np.array([start, *felt[own]])
            flows, answers = self.orbit._flows(np.stack([times[:-1], times[1:]], axis=1))
            rows = []
            for time, jump, flow, answer in zip(times[1:], jumps, flows, answers, strict=True):
                if time > row[START]:  # contacts at one instant share an arc
                    rows.append(row.copy())
                    rows[-1][END] = row[START] = time
                    x, p = row[STATE : STATE + 6] / states, row[THRUST : THRUST + 6] / costates
                    row[STATE : STATE + 6] = (flow @ x + answer[:, : PUSH - COSTATE] @ p) * states
                    row[THRUST : THRUST + 6] = flow @ p * costates
                row[THRUST : THRUST + 6] += jump
            whole = direct[firsts[c] : firsts[c + 1]]
            found += [whole[whole[:, END] <= start], np.array([*rows, row]), whole[whole[:, START] >= end]]
            offsets.append(offsets[-1] + sum(map(len, found[-3:])))
        return np.concatenate(found), np.array(offsets, dtype=np.int64)


def with_coasts(orbit: ChiefOrbit, base: Floats, first: float, last: float) -> tuple[Floats, Any]:
    """Return arcs (N, 30) with the coasts of each craft from `first` and until `last`, and offsets."""
    found, offsets = [], [0]
    for row in base:
        start, end, own = row[START], row[END], [row[None]]
        if first < start:
            state = orbit.transition(first - start, start) @ row[STATE : STATE + 6]
            own.insert(0, orbit.coast(state, start - first, first).arcs)
            own[0][:, END] = start
        if end < last:
            own.append(orbit.coast(orbit._arrived(row[None])[0], last - end, end).arcs)
            own[-1][:, END] = last
        found += own
        offsets.append(offsets[-1] + len(own))
    return np.concatenate(found), np.array(offsets, dtype=np.int64)
