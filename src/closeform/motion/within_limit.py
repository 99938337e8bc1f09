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
    rows, ends = arcs.reshape(-1, WIDTH), finals.reshape(-1, 6)
    limits = np.broadcast_to(limits, shape).ravel()
    pieces, counts = [np.empty((0, WIDTH))], [np.zeros(1, dtype=np.int64)]
    told, first, room = [np.empty((0, PROOF + 6))], 0, ROOM * len(rows) + MORE
    while first < len(rows):
        made, facts = np.empty((room, WIDTH)), np.zeros((len(rows) - first, PROOF + 6))
        offsets = np.full(len(facts) + 1, -1)
        offsets[0] = 0
        task = (np.ascontiguousarray(a[first:]) for a in (rows, ends, limits))
        limit_thrust(n, *task, sparing, made, offsets, facts)
        done = int((offsets[1:] >= 0).sum())
        if done < len(facts) and facts[done, NEEDED] != POSSIBLE:
            k = first + done
            undecided = sparing and facts[done, NEEDED] == UNDECIDED
            burns = short_burns(n, rows[k], ends[k], limits[k]) if undecided else None
            if burns is not None and burns.delta_v <= (1.0 + DEARER) * burns.bound:
                facts[done] = [POSSIBLE, 0.0, burns.bound, burns.delta_v, *burns.primer]
                pieces += [made[: offsets[done]], burns.arcs]
                counts += [np.diff(offsets[: done + 1]), np.array([len(burns.arcs)])]
                told.append(facts[: done + 1])
                first += done + 1
                continue
            name = f"craft {', '.join(map(str, np.unravel_index(k, shape)))}: " if shape else ""
            words = f"max_acceleration: {name}{refusal(rows[k], limits[k], facts[done])}"
            raise TooLittleThrust(words, k, facts[done])
        pieces.append(made[: offsets[done]])
        counts.append(np.diff(offsets[: done + 1]))
        told.append(facts[:done])
        first += done
        room = room if done else 4 * room
    return np.concatenate(pieces), np.cumsum(np.concatenate(counts)), shape, np.concatenate(told)


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
