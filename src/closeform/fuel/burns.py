"""Burns of a path: their times, durations, directions and sizes."""

from typing import Any, NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.fuel.pulses import Pulses
from closeform.motion.arc import END, IMPULSE, START
from closeform.motion.path import Path, runs_of

LEAST = 5e-7  # m/s, smallest reported burn: plans that touch a limit in passing contain shorter ones
SHARE = 1e-3  # of all delta-v: small plans report smaller burns
ROUNDING = 1e-12  # of a burn's size: a smaller component is zero
NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)
NOTHING = 1e-9  # of the largest thrust: rounding in coasts
PIECE = 0.5  # of n t, within which 16 Gauss points integrate thrust to the last digits


class Burns(NamedTuple):
    """K burns in order of time: `start` and `duration` (K,) [s], 0 for an impulse.

    `push` (K, 3) [m/s] is the integral of the thrust in the rotating frame, `size` (K,) [m/s] that of its
    length, which is larger where thrust turns.
    """

    start: Floats
    duration: Floats
    push: Floats
    size: Floats

    @property
    def telling(self) -> Any:
        """Mask (K,) of the significant burns, in micrometres per second or relative to the others."""
        return self.size >= min(LEAST, SHARE * float(self.size.sum()))

    @property
    def significant(self) -> "Burns":
        """Significant burns only."""
        return Burns(*(column[self.telling] for column in self))


def burns_of_pulses(pulses: Pulses, craft: int) -> Burns:
    """Return the pulses of one spacecraft as burns."""
    own = pulses[pulses.craft == craft]
    return _rounded(Burns(own.start, own.duration, own.direction * own.impulse[:, None], own.impulse))


def _rounded(burns: Burns) -> Burns:
    """Return the burns with components that are only rounding errors set to zero."""
    kept = np.abs(burns.push) > ROUNDING * burns.size[:, None]
    return burns._replace(push=np.where(kept, burns.push, 0.0))


def burns_of(path: Path) -> Burns:
    """Return the impulses of one spacecraft's path, and its thrust from one coast to the next, as burns."""
    arcs = path.arcs
    jumps = arcs[:, IMPULSE : IMPULSE + 3]
    kicks = np.flatnonzero(jumps.any(axis=1))
    peaks = Path(path.orbit, arcs, np.arange(len(arcs) + 1), (len(arcs),)).peak_thrust
    on = peaks > NOTHING * peaks.max(initial=0.0)
    first, last = runs_of(on).T
    begin, over = arcs[first, START], arcs[last - 1, END]
    rows = arcs[on].copy()
    rows[:, IMPULSE : IMPULSE + 3] = 0.0
    runs = Path(path.orbit, rows, np.concatenate([[0], np.cumsum(last - first)]), (len(first),))
    pushes = _pushes(path, arcs[on], np.repeat(np.arange(len(first)), last - first))
    every = Burns(
        np.concatenate([arcs[kicks, START], begin]),
        np.concatenate([np.zeros(len(kicks)), over - begin]),
        np.concatenate([jumps[kicks], pushes]),
        np.concatenate([np.linalg.norm(jumps[kicks], axis=1), runs.delta_v]),
    )
    order = np.argsort(every.start, kind="stable")
    return _rounded(Burns(*(column[order] for column in every)))


def _pushes(path: Path, arcs: Floats, run: Floats) -> Floats:
    """Return the integrals of thrust (R, 3) [m/s] over the `arcs` (M, WIDTH) of each index in `run` (M,)."""
    found = np.zeros((int(run.max()) + 1 if len(run) else 0, 3))
    for arc, index in zip(arcs, run, strict=True):
        duration = arc[END] - arc[START]
        pieces = int(np.ceil(2.0 * np.pi / path.orbit.period * duration / PIECE)) or 1
        half = 0.5 * duration / pieces
        middles = arc[START] + half * (2.0 * np.arange(pieces) + 1.0)
        alone = Path(path.orbit, arc[None], np.array([0, 1]), ())
        thrust = alone.thrust((middles[:, None] + half * NODES).ravel()).reshape(pieces, len(NODES), 3)
        found[int(index)] += half * np.einsum("k,pki->i", WEIGHTS, thrust)
    return found
