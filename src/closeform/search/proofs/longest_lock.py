"""Longest time to lock: an adversary searches a box of initial states for the pair that locks last.

It climbs from random pairs. Then `prove_locks` finds for which fraction of the box a later lock is
impossible. If the proof finds a later lock, the climb continues from there.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, instance, whole
from closeform.result import Result
from closeform.search.lock_times import lock_times
from closeform.search.proofs.adversary import Adversary
from closeform.search.proofs.lock_proof import LockProof, ends_of_box, prove_locks, scales
from closeform.search.schedule import Search

CLIMBS = 6  # maximum number of climbs, each from the counterexamples of the previous proof


@dataclass(frozen=True, eq=False, repr=False)
class LongestLock(Result):
    """Latest first lock found in a box of initial states, and its proof.

    Attributes
    ----------
    position : array of shape (3,) [m]
        Relative position of that pair, B minus A at the start of the search, in the inertial frame.
    velocity : array of shape (3,) [m/s]
        Relative velocity, B minus A, in the inertial frame.
    time : float [s]
        Time of its lock, from the start of the search; inf for a pair that never locks.
    phase : str
        Phase of the lock and its round, like "mOPS 2"; "never" without a lock.
    proof : LockProof
        Proof that all pairs lock by then, except for its share `open` of the box.
    """

    position: Floats
    velocity: Floats
    time: float
    phase: str
    proof: LockProof


def longest_lock(
    search: Search, low: ArrayLike, high: ArrayLike, *, seed: int = 0, nodes: int = 200_000
) -> LongestLock:
    """Return the latest first lock that an adversary finds among the initial states of a box.

    Parameters
    ----------
    search : Search
        The schedule of both craft.
    low : array_like of shape (6,) [m, m/s]
        Minimum position and velocity of the box, B minus A at the start of the search, in the inertial frame.
    high : array_like of shape (6,) [m, m/s]
        Maximum position and velocity, in the same frame. Without offset and range the problem is
        scale-invariant, and any box around the origin represents all states.
    seed : int, default 0
        Seed of the random initial states.
    nodes : int, default 200_000
        Maximum number of boxes to judge in the proof that no lock is later.

    Returns
    -------
    LongestLock
        The result, reproducible for a seed. The time is not proven to be the latest; the proof is that all
        but the share `proof.open` of the box locks by then.

    Raises
    ------
    ValueError
        If the box holds no distinct positions, a minimum component is above the maximum, shapes do not match,
        a number is not finite, or `seed` or `nodes` is not a whole number of at least 0.

    References
    ----------
    S04 (Scharf, Ploen, Hadaegh and Sohl 2004) theorem 2; docs/theory.md (57) and docs/theory.md (58).

    Examples
    --------
    >>> search = cf.Search.modified(cf.Sensor(np.radians(70.0)), np.radians(0.25), np.radians(25.0))
    >>> near, reach = np.array([300, 40, -60, 0, 0.1, 0]), np.array([9, 9, 9, 0.01, 0.01, 0.01])
    >>> cf.longest_lock(search, near - reach, near + reach).time
    0.0
    """
    instance("search", search, Search)
    least, greatest = ends_of_box(low, high)
    if not (least[:3].any() or greatest[:3].any()):
        raise ValueError("high: all pairs of the box start at the same position; give its positions a width")
    whole("nodes", nodes, 1)
    random = np.random.Generator(np.random.Philox(whole("seed", seed)))
    adversary = Adversary(search, least, greatest, scales(search, least, greatest))
    states = adversary.drawn(random)
    for _ in range(CLIMBS):
        state, time = adversary.climbed(states, adversary.times(states), random)
        if time == inf:
            break
        proof = prove_locks(search, least, greatest, latest=time, nodes=nodes)
        if not len(proof.counterexamples):
            break
        states = np.concatenate([proof.counterexamples, state[None]])
    if time == inf:
        proof = prove_locks(search, least, greatest, nodes=nodes)
    leg = int(lock_times(search, state[:3], state[3:]).leg[0])
    phase = f"{search.legs[leg].phase} {search.legs[leg].round}" if leg >= 0 else "never"
    return LongestLock(state[:3], state[3:], time, phase, proof)
