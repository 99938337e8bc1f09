"""The table of a chief: polynomials of its transition matrix, window by window, with bounds of their errors.

In a window that begins at the angle s_k (see `clock`), with u from 0 to 1,

    (r, v)(u) = sum_i B_i(u) (C_i x_k + R_i c_k + G_i a)
    C = Phi(t, t_k),  R = integral of Phi(t, t') B E Phi(t', t_k) dt',  G = integral of Phi(t, t') B dt'
                                                                                   # theory (97)

for the state x_k and the costate c_k = (p, p') at its beginning, and a constant push a in the turning frame.
E takes the position of a state, B makes an acceleration a change of state.  The thrust of least energy is
the primer p, and in any gravity field p obeys the equation of relative position, so c advances by the same
Phi.  One table therefore holds natural motion and optimal thrust.

Lengths are in metres and times in 1/n of the clock: columns of x are (r, v/n), of c (p/n^2, p'/n^3), and of a
a/n^2.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.motion.chief.bernstein import (
    DEGREE,
    TERMS,
    basis_at,
    bernstein_of,
    chebyshev_of,
    integral_to,
    nodes,
    pieces_of,
)

STATE, COSTATE, PUSH, COLUMNS = 0, 6, 12, 15  # first columns, and their number
# Degree of the interpolants through which errors are bounded (see `build`), and of the quadrature of R and G.
# With 19 the proof needs more windows than the polynomials; with 39 tables take half as long again to make.
CHECKS = 29
LEBESGUE = 3.2  # bound of the Lebesgue constant of that many Chebyshev nodes: 2/pi log(30) + 1
EPSILON = 2.0**-53
# Roundings in an entry: six products and sums of two matrices, an inverse, and the Chebyshev coefficients.
ROUNDINGS = 40.0

Flow = Callable[[Floats], tuple[Floats, Floats]]


class Table(NamedTuple):
    """Windows of a chief as arrays, shared by all paths about it.

    Attributes
    ----------
    clock : array of shape (3,) [rad/s, no unit, rad]
        Rate, eccentricity and phase of the clock.
    joints : array of shape (K + 1,) [rad]
        Angles at which windows begin and end.
    turn : float [rad]
        Angle after which the table repeats; 0 if it does not.
    rows : array of shape (K, 15, 6, 12)
        Bernstein coefficients of position and velocity, for each column.
    steps : array of shape (K, 15, 15)
        Matrices from columns at the beginning of a window to those at its end.
    errors : array of shape (K, 15)
        Bounds of the errors of the position of each column, along each axis.
    returns : array of shape (K, 9, 6, 12)
        Bernstein coefficients of the change of the window's first state to which a costate and a push amount.
    return_errors : array of shape (K, 9)
        Bounds of their errors.
    """

    clock: Floats
    joints: Floats
    turn: float
    rows: Floats
    steps: Floats
    errors: Floats
    returns: Floats
    return_errors: Floats

    @property
    def form(self) -> tuple[Floats, Floats, float, Floats, Floats]:
        """Arguments of kernels."""
        return self.clock, self.joints, self.turn, self.rows, self.steps

    def skew(self, k: int) -> Floats:
        """Return W (3, 3) where window k begins, of the form r . v' - r' . v + r . W r' of two motions.

        That form is constant in time.  W is twice the cross product with the frame's rate; the symplectic
        inverse of the step gives it.
        """
        flow = self.steps[k, :6, :6]
        back = np.linalg.inv(flow)[:, 3:]
        found = (flow[:3, :3].T - back[3:]) @ np.linalg.inv(back[:3])
        return np.asarray(0.5 * (found - found.T))

    def apart(self, pieces: int) -> Floats:
        """Return the rows (K pieces, 15, 3, 12) of positions less their chords in equal pieces of windows.

        The first and the last coefficient, of which nothing is left, are those of the positions themselves.
        """
        parts = pieces_of(pieces).copy()
        ends = np.linspace(0.0, 1.0, TERMS)[:, None]
        parts[:, 1:-1] -= ((1.0 - ends) * parts[:, :1] + ends * parts[:, -1:])[:, 1:-1]
        out = self.rows[:, None, :, :3] @ parts.swapaxes(1, 2)[None, :, None]
        return np.ascontiguousarray(out.reshape(-1, COLUMNS, 3, TERMS))

    def angles(self, first: float, last: float, pieces: int) -> Floats:
        """Return the angles that cut all windows from one angle to another into equal pieces."""
        joints = self.joints
        if self.turn > 0.0:
            turns = np.arange(
                np.floor((first - joints[0]) / self.turn), (last - joints[0]) // self.turn + 1.0
            )
            joints = np.append(
                (self.turn * turns[:, None] + joints[:-1]).ravel(), self.turn * (turns[-1] + 1.0) + joints[0]
            )
        shares = np.arange(pieces) / pieces
        angles = np.append((joints[:-1, None] + np.diff(joints)[:, None] * shares).ravel(), joints[-1])
        begin = max(int(np.searchsorted(angles, first, side="right")) - 1, 0)
        end = min(int(np.searchsorted(angles, last, side="left")), len(angles) - 1)
        return np.asarray(angles[begin : max(end, begin + 1) + 1])


def build(
    clock: Floats, joints: Floats, turn: float, flow: Flow, tails: Floats, return_tails: Floats
) -> Table:
    """Return the table of a transition matrix.

    `flow(u)` returns Phi from the beginning of each window to its points u (Q,) as (K, Q, 6, 6), and a bound
    (K, 6, 6) of the magnitudes of which these are sums, for their rounding.

    **Errors.**  The error of a polynomial of degree 11 is known at 30 Chebyshev nodes, up to rounding.
    Between them it is at most Lebesgue's constant times the largest of these, plus the error of an
    interpolant of degree 29; `tails` (K, 15) and `return_tails` (K, 9) are bounds of that remainder.
    """
    low, high = nodes(DEGREE), nodes(CHECKS)
    points = np.concatenate([low, [1.0], high])
    states, sizes = flow(points)
    lengths = np.diff(joints)
    inner, count = states[:, TERMS + 1 :], COLUMNS - PUSH
    angles = joints[:-1, None] + lengths[:, None] * high
    passed = lengths[:, None] * (1.0 - clock[1] * np.cos(angles))  # dt by u
    push = np.zeros((*inner.shape[:2], 3, COSTATE + count))
    push[..., :COSTATE] = inner[..., :3, :]
    push[..., COSTATE:] = np.eye(3)
    rates = (np.linalg.inv(inner)[..., 3:] * passed[..., None, None]) @ push
    gathered = np.tensordot(integral_to(CHECKS, tuple(points)), rates, (1, 1)).swapaxes(0, 1)
    values = np.concatenate([states, states @ gathered], axis=-1)  # (K, Q, 6, 15)
    coefficients = np.tensordot(bernstein_of() @ chebyshev_of(DEGREE), values[:, :TERMS], (1, 1))
    missed = np.tensordot(basis_at(high), coefficients, (1, 0)).swapaxes(0, 1) - values[:, TERMS + 1 :]
    steps = np.zeros((len(lengths), COLUMNS, COLUMNS))
    steps[:, :COSTATE] = values[:, TERMS]
    steps[:, COSTATE:PUSH, COSTATE:PUSH] = values[:, TERMS, :, :COSTATE]
    steps[:, PUSH:, PUSH:] = np.eye(count)
    rounded = np.concatenate([sizes, sizes @ np.abs(gathered).max(axis=1)], axis=-1)[:, :3].max(axis=1)
    worst = np.abs(missed[:, :, :3]).max(axis=(1, 2))
    errors = LEBESGUE * worst + tails + ROUNDINGS * EPSILON * rounded
    rows = np.ascontiguousarray(coefficients.transpose(1, 3, 2, 0))
    fit = bernstein_of() @ chebyshev_of(DEGREE)
    back = np.tensordot(fit, gathered[:, :TERMS], (1, 1))
    off = np.tensordot(basis_at(high), back, (1, 0)).swapaxes(0, 1) - gathered[:, TERMS + 1 :]
    size = np.abs(gathered).max(axis=(1, 2))
    return_errors = LEBESGUE * np.abs(off).max(axis=(1, 2)) + return_tails + ROUNDINGS * EPSILON * size
    returns = np.ascontiguousarray(back.transpose(1, 3, 2, 0))
    return Table(clock, joints, turn, rows, steps, errors, returns, return_errors)
