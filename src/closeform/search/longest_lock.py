"""The longest time to lock: an adversary looks for the initial state of a box that locks last.

It climbs from drawn pairs; then `prove_locks` says for how much of the box a later lock is impossible, and
where it finds one the climb goes on from there.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, instance, whole
from closeform.result import Result
from closeform.search.adversary import Adversary
from closeform.search.lock_proof import LockProof, ends_of_box, prove_locks, scales
from closeform.search.locks import lock_times
from closeform.search.schedule import Search

CLIMBS = 6  # at most, each from what the proof before it found


@dataclass(frozen=True, eq=False, repr=False)
class LongestLock(Result):
    """The latest first lock that was found in a box of initial states, and what is proven of it.

    Attributes
    ----------
    position : array of shape (3,) [m]
        Of that pair, B minus A at the start of the search, in the inertial frame.
    velocity : array of shape (3,) [m/s]
        B minus A, in the inertial frame.
    time : float [s]
        Of its lock, from the start of the search; inf for a pair that never locks.
    phase : str
        In which that is, and its round, like "mOPS 2"; "never" without a lock.
    proof : LockProof
        That all pairs lock by then, but for a share of the box that is told as `open`.
    """

    position: Floats
    velocity: Floats
    time: float
    phase: str
    proof: LockProof


def longest_lock(
    search: Search, low: ArrayLike, high: ArrayLike, *, seed: int = 0, nodes: int = 200_000
) -> LongestLock:
    """The latest first lock that an adversary finds among all initial states of a box.

    Parameters
    ----------
    search : Search
        Which both carry out.
    low : array_like of shape (6,) [m, m/s]
        Least position and velocity of the box, B minus A at the start of the search, in the inertial frame.
    high : array_like of shape (6,) [m, m/s]
        The greatest, in the same frame.  Without offset and range lengths scale, and any box with the origin
        inside stands for all states.
    seed : int, default 0
        Of the states that it begins with.
    nodes : int, default 200_000
        How many boxes are judged to prove that no lock is later.

    Returns
    -------
    LongestLock
        The same for the same seed.  Its time is found, not proven to be the latest; what is proven is that
        all but `proof.open` of the box locks by then.

    Raises
    ------
    ValueError
        If the box holds no two craft apart, a least component is above the greatest, shapes do not fit, or a
        number is not finite or not a whole one from 0 on.

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
        raise ValueError("high: all pairs of the box start at one place; give its positions a width")
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
