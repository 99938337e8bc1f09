"""Impulses of least delta-v as burns about their times, where a thrust limit makes them short."""

from typing import NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.motion.arc import END, MEAN_MOTION, PUSH, START, STATE, WIDTH
from closeform.motion.impulses import answers
from closeform.motion.path import evaluate
from closeform.motion.reduced import COUNT, FIRST, LOWER, PRIMER, UPPER
from closeform.motion.steering import transitions

NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)
ROOM = 1e-9  # of a burn, by which it is longer than the limit asks
REPAIRS = 6  # of what burns of some length leave open at the end
MISSED = 1e-12  # of what is to be gained
NOTHING = 1e-9  # of all delta-v: an impulse that is rounding


class ShortBurns(NamedTuple):
    """Arcs (M, 30) of burns and coasts, their delta-v [m/s], and what bounds it, with its primer (6,)."""

    arcs: Floats
    delta_v: float
    bound: float
    primer: Floats


def short_burns(n: float, arc: Floats, final: Floats, limit: float) -> ShortBurns | None:
    """The impulses of least delta-v as burns at a limit; None where burns do not fit.

    `arc` (30,) gives the times and the initial state, `final` (6,) the state at its end.  A burn of length b
    costs a share of (n b)^2/24 more than its impulse, and is changed by as little as makes all meet the end.
    """
    found = answers(n, arc[None], final[None])[0]
    table = found[FIRST:].reshape(-1, 4)[: int(found[COUNT])]
    duration = arc[END] - arc[START]
    scale = np.array([1.0] * 3 + [1.0 / duration] * 3)
    gain = scale * _effects(n, table[:, 0], np.zeros(len(table)), table[:, 1:]).sum(axis=0)
    table = table[np.linalg.norm(table[:, 1:], axis=1) > NOTHING * found[UPPER]]
    pushes = table[:, 1:].copy()
    for _ in range(REPAIRS):
        sizes = np.linalg.norm(pushes, axis=1)
        lengths = (1.0 + ROOM) * sizes / limit
        begins = np.clip(table[:, 0] - 0.5 * lengths, 0.0, duration - lengths)
        if (begins < 0.0).any() or (begins[1:] < (begins + lengths)[:-1]).any():
            return None
        missing = gain - scale * _effects(n, begins, lengths, pushes).sum(axis=0)
        if np.abs(missing).max() <= MISSED * np.abs(gain).max():
            break
        ways = scale[:, None, None] * _mean_rows(n, begins, lengths).transpose(2, 0, 1) * sizes[:, None]
        change = np.linalg.lstsq(ways.reshape(6, -1), missing, rcond=1e-13)[0]
        pushes += change.reshape(-1, 3) * sizes[:, None]
    else:
        return None
    arcs = _flown(n, arc, begins, lengths, pushes)
    return ShortBurns(arcs, float(sizes.sum()), float(found[LOWER]), found[PRIMER : PRIMER + 6])


def _mean_rows(n: float, begins: Floats, lengths: Floats) -> Floats:
    """Psi (K, 3, 6) in the mean over burns."""
    times = begins[:, None] + 0.5 * lengths[:, None] * (1.0 + NODES)
    rows = np.empty((times.size, 6, 6))
    transitions(n, times.ravel(), rows)
    mean: Floats = np.einsum("g,kgij->kij", 0.5 * WEIGHTS, rows.reshape(*times.shape, 6, 6)[:, :, :3])
    return mean


def _effects(n: float, begins: Floats, lengths: Floats, pushes: Floats) -> Floats:
    """What burns gain (K, 6), as primers see it.                                             # theory (27)"""
    gained: Floats = np.einsum("kij,ki->kj", _mean_rows(n, begins, lengths), pushes)
    return gained


def _flown(n: float, arc: Floats, begins: Floats, lengths: Floats, pushes: Floats) -> Floats:
    """The arcs of burns and of the coasts between them."""
    rows: list[Floats] = []
    state, now = arc[STATE : STATE + 6], 0.0
    ends = np.append(np.stack([begins, begins + lengths], axis=1), arc[END] - arc[START])
    thrusts = np.zeros((len(ends), 3))
    thrusts[1::2] = pushes / lengths[:, None]
    for last, thrust in zip(ends, thrusts, strict=True):
        if last <= now:
            continue
        row = np.zeros(WIDTH)
        row[START], row[END], row[MEAN_MOTION] = arc[START] + now, arc[START] + last, n
        row[STATE : STATE + 6], row[PUSH : PUSH + 3] = state, thrust
        after = np.empty((1, 1, 6))
        evaluate(row[None], np.array([0, 1]), n, np.array([[row[END]]]), after)
        rows.append(row)
        state, now = after[0, 0], last
    rows[-1][END] = arc[END]
    return np.array(rows)
