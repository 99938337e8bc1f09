"""Batches of transfers within a thrust limit, and the reason why a limit does not suffice."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, broadcast
from closeform.motion.arc import END, START, WIDTH
from closeform.motion.effort import ENERGY, totals
from closeform.motion.elements.mean_motion import checked
from closeform.motion.minimum_delta_v.saturated import (
    CLOSE,
    ENOUGH,
    NEEDED,
    POSSIBLE,
    PROOF,
    UNDECIDED,
    WORST,
    limit_thrust,
)
from closeform.motion.minimum_delta_v.short_burns import short_burns

ROOM, MORE = 40, 1000  # space in arcs: per path at first, and in addition
DEARER = 1e-3  # accepted relative excess of short burns over their bound if no other plan is found
BRIEF = 1e-3  # share of the duration


class TooLittleThrust(ValueError):
    """Thrust limit that is proven too low, or not proven sufficient, for spacecraft `which` of a batch.

    No transfer is possible with less than `needed` [m/s^2], and one is with `enough`; they are 0 and inf
    where nothing is proven.
    """

    def __init__(self, words: str, which: int, facts: Floats) -> None:
        super().__init__(words)
        shown = facts[NEEDED] != UNDECIDED
        self.which = which
        self.needed, self.enough = (float(facts[NEEDED]), float(facts[ENOUGH])) if shown else (0.0, np.inf)


def limited(
    n: float, arcs: Floats, finals: Floats, max_acceleration: ArrayLike, sparing: bool
) -> tuple[Floats, Any, tuple[int, ...], Floats]:
    """Return arcs, offsets, shape and facts of transfers within limits, of minimum delta-v if `sparing`.

    `arcs` (..., 30) are the optima without a limit, to `finals` (..., 6). Raises TooLittleThrust.
    """
    limits = np.asarray(checked("max_acceleration", max_acceleration, positive=True))
    shape = broadcast(arguments=arcs.shape[:-1], max_acceleration=limits.shape)
    if arcs.shape[:-1] != shape:
        arcs, finals = (np.broadcast_to(a, shape + a.shape[-1:]) for a in (arcs, finals))
    rows, finals = (np.ascontiguousarray(a).reshape(-1, a.shape[-1]) for a in (arcs, finals))
    limits = np.full(shape, limits).ravel()
    pieces, offsets = [np.empty((0, WIDTH))], np.zeros(len(rows) + 1, dtype=np.int64)
    facts, k, room = np.zeros((len(rows), PROOF + 6)), 0, ROOM * len(rows) + MORE
    brief = _brief(n, rows, limits) & sparing
    while k < len(rows):
        burns = short_burns(n, rows[k], finals[k], limits[k]) if brief[k] else None
        if burns is None or burns.gap > WORST:
            until = next((later for later in range(k + 1, len(rows)) if brief[later]), len(rows))
            made, ends = np.empty((room, WIDTH)), np.full(until - k + 1, -1)
            ends[0] = 0
            limit_thrust(
                n, rows[k:until], finals[k:until], limits[k:until], sparing, made, ends, facts[k:until]
            )
            done = int(np.count_nonzero(ends >= 0)) - 1
            pieces.append(made[: ends[done]])
            offsets[k + 1 : k + done + 1] = offsets[k] + ends[1 : done + 1]
            k += done
            if k == until or facts[k, NEEDED] == POSSIBLE:
                room *= 1 if done else 4
                continue
            undecided = sparing and facts[k, NEEDED] == UNDECIDED
            burns = short_burns(n, rows[k], finals[k], limits[k]) if undecided else None
            if burns is None or burns.gap > DEARER:
                name = f"craft {', '.join(map(str, np.unravel_index(k, shape)))}: " if shape else ""
                words = f"max_acceleration: {name}{refusal(rows[k], limits[k], facts[k])}"
                raise TooLittleThrust(words, k, facts[k])
        facts[k] = [POSSIBLE, 0.0, burns.bound, burns.delta_v, *burns.primer]
        pieces.append(burns.arcs)
        offsets[k + 1] = offsets[k] + len(burns.arcs)
        k += 1
    return np.concatenate(pieces), offsets, shape, facts


def _brief(n: float, arcs: Floats, limits: Floats) -> Any:
    """Return True for burns at a limit that are short compared with the transfer."""
    energies = np.empty(len(arcs))
    totals(arcs, np.arange(len(arcs) + 1), n, ENERGY, energies)
    duration = arcs[:, END] - arcs[:, START]
    most = np.sqrt(2.0 * energies * duration)  # bound on the delta-v
    return (most > 0.0) & (most / duration < BRIEF * limits)


def refusal(arc: Floats, limit: float, facts: Floats) -> str:
    """Return the reason why a transfer is refused."""
    duration = arc[END] - arc[START]
    if facts[NEEDED] == UNDECIDED:
        return (
            f"{limit:.10g} m/s^2 in {duration:g} s is proven neither sufficient nor insufficient; "
            "increase it or the duration a little"
        )
    return (
        f"a thrust of {limit:g} m/s^2 is too low to arrive in {duration:g} s; "
        f"{facts[ENOUGH] * (1.0 + CLOSE):.7g} m/s^2 is enough"
    )
