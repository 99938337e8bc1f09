"""Transfers within a thrust limit, from a batch to their paths, or why a limit does not make them."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, broadcast
from closeform.motion.arc import END, START, WIDTH
from closeform.motion.mean_motion import checked
from closeform.motion.saturated import CLOSE, ENOUGH, NEEDED, POSSIBLE, PROOF, UNDECIDED, limit_thrust
from closeform.motion.short_burns import short_burns

ROOM, MORE = 40, 1000  # arcs a path, of which a batch is given room at first, and beside
DEARER = 1e-3  # by what share of impulses short burns may cost more


class TooLittleThrust(ValueError):
    """A limit that is shown to make no transfer, or is not shown to make it: of craft `which` of a batch.

    Less than `needed` [m/s^2] makes none, `enough` does; 0 and inf where nothing is shown.
    """

    def __init__(self, words: str, which: int, facts: Floats) -> None:
        super().__init__(words)
        shown = facts[NEEDED] != UNDECIDED
        self.which = which
        self.needed, self.enough = (float(facts[NEEDED]), float(facts[ENOUGH])) if shown else (0.0, np.inf)


def limited(
    n: float, arcs: Floats, finals: Floats, max_acceleration: ArrayLike, sparing: bool
) -> tuple[Floats, Any, tuple[int, ...], Floats]:
    """Arcs, offsets, shape and facts of transfers within limits, of the least delta-v if `sparing`.

    `arcs` (..., 30) are the optima without a limit, to `finals` (..., 6).  Raises TooLittleThrust.
    """
    limits = np.asarray(checked("max_acceleration", max_acceleration, positive=True))
    shape = broadcast(arguments=arcs.shape[:-1], max_acceleration=limits.shape)
    if arcs.shape[:-1] != shape:
        arcs, finals = (np.broadcast_to(a, shape + a.shape[-1:]) for a in (arcs, finals))
    rows, finals = (np.ascontiguousarray(a).reshape(-1, a.shape[-1]) for a in (arcs, finals))
    limits = np.full(shape, limits).ravel()
    pieces, offsets = [np.empty((0, WIDTH))], np.zeros(len(rows) + 1, dtype=np.int64)
    facts, k, room = np.zeros((len(rows), PROOF + 6)), 0, ROOM * len(rows) + MORE
    while k < len(rows):
        made, ends = np.empty((room, WIDTH)), np.full(len(rows) - k + 1, -1)
        ends[0] = 0
        limit_thrust(n, rows[k:], finals[k:], limits[k:], sparing, made, ends, facts[k:])
        done = int(np.count_nonzero(ends >= 0)) - 1
        pieces.append(made[: ends[done]])
        offsets[k + 1 : k + done + 1] = offsets[k] + ends[1 : done + 1]
        k += done
        if k < len(rows) and facts[k, NEEDED] != POSSIBLE:
            undecided = sparing and facts[k, NEEDED] == UNDECIDED
            burns = short_burns(n, rows[k], finals[k], limits[k]) if undecided else None
            if burns is None or not burns.delta_v <= (1.0 + DEARER) * burns.bound:
                name = f"craft {', '.join(map(str, np.unravel_index(k, shape)))}: " if shape else ""
                words = f"max_acceleration: {name}{refusal(rows[k], limits[k], facts[k])}"
                raise TooLittleThrust(words, k, facts[k])
            facts[k] = [POSSIBLE, 0.0, burns.bound, burns.delta_v, *burns.primer]
            pieces.append(burns.arcs)
            offsets[k + 1] = offsets[k] + len(burns.arcs)
            k += 1
        elif not done:
            room *= 4
    return np.concatenate(pieces), offsets, shape, facts


def refusal(arc: Floats, limit: float, facts: Floats) -> str:
    """Why a transfer is refused."""
    duration = arc[END] - arc[START]
    if facts[NEEDED] == UNDECIDED:
        return (
            f"{limit:.10g} m/s^2 in {duration:g} s is shown to be neither enough nor too little; "
            "give a little more of it, or of time"
        )
    return (
        f"no thrust within {limit:g} m/s^2 makes the transfer in {duration:g} s; "
        f"{facts[ENOUGH] * (1.0 + CLOSE):.7g} m/s^2 is enough"
    )
