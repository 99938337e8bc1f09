"""Short burns that replace the impulses of minimum delta-v under a high thrust limit."""

from typing import NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.motion.arc import END, MEAN_MOTION, PUSH, START, STATE, WIDTH
from closeform.motion.minimum_delta_v.burn_bound import prove_burns
from closeform.motion.minimum_delta_v.impulses import answers
from closeform.motion.minimum_delta_v.reduced import COUNT, FIRST, LOWER, PRIMER, UPPER
from closeform.motion.path import evaluate
from closeform.motion.steering import transition_matrices

NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)
ROOM = 1e-7  # relative margin of a burn's duration over the minimum
ROUNDS = 4  # corrections that keep impulses far enough from the ends for their burns
NOTHING = 1e-9  # share of all delta-v: a smaller impulse is rounding
TURN = 1e-3  # share of the orbit in which a burn keeps its direction: the loss is some TURN^2/24
DEPENDENT = 1e-6  # share of the largest singular value: burns that do not determine a primer


class ShortBurns(NamedTuple):
    """Arcs (M, 30) of burns and coasts, their delta-v [m/s], its lower bound and its primer (6,)."""

    arcs: Floats
    delta_v: float
    bound: float
    primer: Floats

    @property
    def gap(self) -> float:
        """Relative excess of the delta-v over the bound."""
        return self.delta_v / self.bound - 1.0


class Impulses(NamedTuple):
    """Times (K,) [s] and velocity changes (K, 3) [m/s] of optimal impulses, their bound and primer (6,)."""

    times: Floats
    pushes: Floats
    primer: Floats
    bound: float


class Burns(NamedTuple):
    """Starts, durations [s] and velocity changes (M, 3) [m/s] of parts, and the spans (K, 2) of burns."""

    begins: Floats
    lengths: Floats
    pushes: Floats
    whole: Floats


def short_burns(n: float, arc: Floats, final: Floats, limit: float) -> ShortBurns | None:
    """Return the impulses of minimum delta-v as burns at a limit; None if burns do not fit.

    `arc` (30,) gives the times and the initial state, `final` (6,) the state at its end.
    """
    duration = float(arc[END] - arc[START])
    tick = float(np.spacing(np.abs(arc[[START, END]]).max()))  # resolution of time
    least = impulses = _impulses(n, arc, final, np.zeros(2))
    if not len(least.times):
        return None
    aim, kept = final, np.zeros(2)
    for _ in range(ROUNDS):  # adjust the impulses so that their burns have the effect of the optimal impulses
        burns = _burns(n, duration, impulses, limit, tick)
        if burns is None:
            return None
        half = 0.5 * (burns.whole[[0, -1], 1] - burns.whole[[0, -1], 0])
        off = np.array([impulses.times[0], duration - impulses.times[-1]])
        kept = np.where(off <= (1.0 + 2.0 * ROOM) * np.maximum(half, kept), half, 0.0)
        aim = aim + _missing(n, duration, least, burns)
        impulses = _impulses(n, arc, aim, kept)
    burns = _burns(n, duration, impulses, limit, tick)
    if burns is None:
        return None
    pushes = _repaired(n, duration, least, burns)
    if (np.linalg.norm(pushes, axis=1) > limit * (burns.lengths - tick)).any():
        return None
    burns = burns._replace(pushes=pushes)
    gain = np.einsum("kij,ki->j", transition_matrices(n, least.times)[:, :3], least.pushes)  # theory (27)
    near = _primer_of(n, impulses.primer, burns.whole, duration)
    starts = np.array([least.primer, impulses.primer, near])
    proof, spent = np.empty(6), float(np.linalg.norm(pushes, axis=1).sum())
    bound = prove_burns(n, duration, gain, limit, starts, proof)
    if bound < least.bound:
        bound, proof = least.bound, least.primer
    return ShortBurns(_flown(n, arc, burns), spent, bound, proof)


def _impulses(n: float, arc: Floats, final: Floats, kept: Floats) -> Impulses:
    """Return the impulses of minimum delta-v, at least `kept` (2,) [s] after the start and before the end."""
    way = transition_matrices(n, np.array([kept[0], -kept[1], -kept[0]]))
    inner = arc.copy()
    inner[END] -= kept.sum()
    inner[STATE : STATE + 6] = way[0] @ arc[STATE : STATE + 6]
    found = answers(n, inner[None], (way[1] @ final)[None])[0]
    table = found[FIRST:].reshape(-1, 4)[: int(found[COUNT])]
    table = table[np.linalg.norm(table[:, 1:], axis=1) > NOTHING * found[UPPER]]
    primer = way[2] @ found[PRIMER : PRIMER + 6]
    return Impulses(table[:, 0] + kept[0], table[:, 1:], primer, float(found[LOWER]))


def _burns(n: float, duration: float, impulses: Impulses, limit: float, tick: float) -> Burns | None:
    """Return burns about impulses, cut into parts along the primer; None where they do not fit.

    They respect the limit however their starts and ends are rounded to ticks [s].
    """
    sizes = np.linalg.norm(impulses.pushes, axis=1)
    lengths = (1.0 + ROOM) * sizes / limit + 2.0 * tick
    begins = np.clip(impulses.times - 0.5 * lengths, 0.0, duration - lengths)
    whole = np.stack([begins, begins + lengths], axis=1)
    if (whole < 0.0).any() or (whole[1:, 0] < whole[:-1, 1]).any():
        return None
    parts = 1 + (n / TURN * lengths).astype(int)
    of = np.repeat(np.arange(len(sizes)), parts)  # the burn of each part
    before = np.arange(len(of)) - (np.cumsum(parts) - parts)[of]
    lengths = (lengths / parts)[of]
    begins = begins[of] + before * lengths
    along = transition_matrices(n, begins + 0.5 * lengths)[:, :3] @ impulses.primer
    along *= (sizes / parts)[of, None] / np.linalg.norm(along, axis=1)[:, None]
    return Burns(begins, lengths, along, whole)


def _missing(n: float, duration: float, least: Impulses, burns: Burns) -> Floats:
    """Return the final state (6,) of the impulses minus that of the burns."""
    reached = np.einsum("kij,kj->i", transition_matrices(n, duration - least.times)[:, :, 3:], least.pushes)
    open_left: Floats = reached - np.einsum("kij,kj->i", _mean_effects(n, duration, burns), burns.pushes)
    return open_left


def _repaired(n: float, duration: float, least: Impulses, burns: Burns) -> Floats:
    """Return velocity changes with the smallest correction that reaches the final state."""
    scale = np.array([1.0] * 3 + [duration] * 3)
    sizes = np.linalg.norm(burns.pushes, axis=1)
    ways = scale[:, None, None] * _mean_effects(n, duration, burns).transpose(1, 0, 2) * sizes[:, None]
    missing = scale * _missing(n, duration, least, burns)
    change = np.linalg.lstsq(ways.reshape(6, -1), missing, rcond=1e-13)[0]
    repaired: Floats = burns.pushes + change.reshape(-1, 3) * sizes[:, None]
    return repaired


def _mean_effects(n: float, duration: float, burns: Burns) -> Floats:
    """Return the mean effect (M, 6, 3) of each burn's velocity change on the final state."""
    times = burns.begins[:, None] + 0.5 * burns.lengths[:, None] * (1.0 + NODES)
    rows = transition_matrices(n, duration - times)[..., 3:]
    mean: Floats = np.einsum("g,kgij->kij", 0.5 * WEIGHTS, rows)
    return mean


def _primer_of(n: float, primer: Floats, burns: Floats, duration: float) -> Floats:
    """Return the primer (6,) close to `primer` of mean length 1 where burns (K, 2) begin and end.

    The error of its bound is of second order in the durations; for impulses at an end it is of first order,
    theory (32).
    """
    switches = np.where([burns[:, 0] > 0.0, burns[:, 1] < duration], burns.T, burns[:, ::-1].T)
    rows = transition_matrices(n, switches.ravel())[:, :3]
    scale = np.array([1.0] * 3 + [1.0 / duration] * 3)
    for _ in range(2):
        there = rows @ primer
        size = np.linalg.norm(there, axis=1)
        slopes = np.einsum("ki,kij->kj", there / size[:, None], rows)
        mean, short = (one.reshape(2, len(burns), -1).mean(axis=0) for one in (slopes, 1.0 - size))
        primer = primer + scale * np.linalg.lstsq(mean * scale, short[:, 0], rcond=DEPENDENT)[0]
    return primer


def _flown(n: float, arc: Floats, burns: Burns) -> Floats:
    """Return the arcs of burns and of the coasts between them."""
    rows: list[Floats] = []
    state = arc[STATE : STATE + 6]
    spans = np.stack([burns.begins, burns.begins + burns.lengths], axis=1)
    clock = np.concatenate([arc[[START]], np.minimum(arc[START] + spans.ravel(), arc[END]), arc[[END]]])
    pushes = np.zeros((len(clock) - 1, 3))
    pushes[1::2] = burns.pushes
    for begin, end, push in zip(clock[:-1], clock[1:], pushes, strict=True):
        if end <= begin:
            continue
        row = np.zeros(WIDTH)
        row[START], row[END], row[MEAN_MOTION] = begin, end, n
        row[STATE : STATE + 6], row[PUSH : PUSH + 3] = state, push / (end - begin)
        after = np.empty((1, 1, 6))
        evaluate(row[None], np.array([0, 1]), n, np.array([[end]]), after)
        rows.append(row)
        state = after[0, 0]
    return np.array(rows)
