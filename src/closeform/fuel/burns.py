"""Burns: when a path is pushed, for how long, where to, and by how much."""

from typing import Any, NamedTuple

import numpy as np

from closeform.arrays import Floats
from closeform.fuel.pulses import Pulses
from closeform.motion.arc import END, IMPULSE, START
from closeform.motion.path import Path, runs_of

LEAST = 5e-7  # m/s, of a burn worth telling: plans within a limit leave less where they touch it in passing
SHARE = 1e-3  # of all that is burned: whoever burns next to nothing has burns worth telling, too
ROUNDING = 1e-12  # of a burn's size: a component below it is none
NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)
NOTHING = 1e-9  # of the greatest thrust: what is left by rounding where a craft coasts
PIECE = 0.5  # of n t, within which 16 points of Gauss integrate thrust to the last digits


class Burns(NamedTuple):
    """K burns in order of time: `start` and `duration` (K,) [s], 0 of an impulse.

    `push` (K, 3) [m/s] is the integral of the thrust in the rotating frame, `size` (K,) [m/s] that of its
    length, which is more where thrust turns.
    """

    start: Floats
    duration: Floats
    push: Floats
    size: Floats

    @property
    def telling(self) -> Any:
        """Which (K,) are more than nothing, in micrometres per second and among the others."""
        return self.size >= min(LEAST, SHARE * float(self.size.sum()))

    @property
    def told(self) -> "Burns":
        """Those alone."""
        return Burns(*(column[self.telling] for column in self))


def burns_of_pulses(pulses: Pulses, craft: int) -> Burns:
    """The pulses of one craft."""
    own = pulses[pulses.craft == craft]
    return _rounded(Burns(own.start, own.duration, own.direction * own.impulse[:, None], own.impulse))


def _rounded(burns: Burns) -> Burns:
    """The same without components that are rounding."""
    kept = np.abs(burns.push) > ROUNDING * burns.size[:, None]
    return burns._replace(push=np.where(kept, burns.push, 0.0))


def burns_of(path: Path) -> Burns:
    """The impulses of one craft's path, and its thrust from one coast to the next."""
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
    """Integrals of the thrust (R, 3) [m/s] over the `arcs` (M, WIDTH) of each `run` (M,), by number."""
    found = np.zeros((int(run.max()) + 1 if len(run) else 0, 3))
    for arc, whose in zip(arcs, run, strict=True):
        duration = arc[END] - arc[START]
        pieces = int(np.ceil(path.orbit.mean_motion * duration / PIECE)) or 1
        half = 0.5 * duration / pieces
        middles = arc[START] + half * (2.0 * np.arange(pieces) + 1.0)
        alone = Path(path.orbit, arc[None], np.array([0, 1]), ())
        thrust = alone.thrust((middles[:, None] + half * NODES).ravel()).reshape(pieces, len(NODES), 3)
        found[int(whose)] += half * np.einsum("k,pki->i", WEIGHTS, thrust)
    return found
