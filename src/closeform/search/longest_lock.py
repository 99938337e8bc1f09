"""The longest time to lock: an adversary looks for the initial state of a box that locks last.

It draws pairs, most of which pass close by each other, and climbs from the latest of them by ever smaller
changes; then `prove_locks` says for how much of the box a later lock is impossible, and where it finds one
the climb goes on from there.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, instance, whole
from closeform.result import Result
from closeform.search.lock_proof import LockProof, ends_of_box, prove_locks, scales
from closeform.search.locks import lock_times
from closeform.search.schedule import Search

DRAWN = 200_000  # states to begin with
ISLANDS, MEMBERS, TRIED = 8, 12, 64  # who climb together, how many, what each tries in a round
ROUNDS, PATIENCE = 300, 30  # most in a climb; how many without gain end it
GAIN = 1e-4  # s
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
    box = least, greatest, scales(search, least, greatest)
    states = drawn(search, box, random)
    for _ in range(CLIMBS):
        state, time = climbed(search, box, states, random)
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


def drawn(search: Search, box: tuple[Floats, Floats, bool], random: Any) -> Floats:
    """States (DRAWN, 6) of the box: half of them anywhere, half of pairs that pass close by meanwhile."""
    least, greatest, _ = box
    anywhere = random.uniform(least, greatest, (DRAWN // 2, 6))
    velocity = random.uniform(least, greatest, (DRAWN // 2, 6))[:, 3:]
    along = random.random(len(velocity)) < 0.5  # the sun line, where cones are left out
    velocity[along, :2] *= 10.0 ** random.uniform(-4.0, 0.0, (int(along.sum()), 1))
    speed = np.linalg.norm(velocity, axis=1, keepdims=True)
    miss = random.normal(size=(len(velocity), 3)) * 10.0 ** random.uniform(-4.0, 0.0, (len(velocity), 1))
    closest = random.uniform(0.0, search.duration, (len(velocity), 1))
    passing = np.hstack([(miss * speed * search.duration) - velocity * closest, velocity])
    return within(box, np.concatenate([anywhere, passing]))


def within(box: tuple[Floats, Floats, bool], states: Floats) -> Floats:
    """States (N, 6) brought into a box: to its surface, where lengths scale, else to their next in it."""
    least, greatest, scaled = box
    if not scaled:
        return np.clip(states, least, greatest)
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.where(states > 0.0, states / greatest, np.where(states < 0.0, states / least, 0.0))
        states = states / shares.max(axis=1, keepdims=True)
    return np.where(np.isfinite(states), states, 0.0)


def times_of(search: Search, states: Floats) -> Floats:
    """First locks of states (N, 6) [s]: inf for never, -inf for two craft at one place."""
    apart = np.abs(states[:, :3]).max(axis=1) > 0.0
    times = np.full(len(states), -inf)
    found = lock_times(search, states[apart, :3], states[apart, 3:]).time
    times[apart] = np.where(np.isnan(found), inf, found)
    return times


def climbed(
    search: Search, box: tuple[Floats, Floats, bool], states: Floats, random: Any
) -> tuple[Floats, float]:
    """The state with the latest lock that is reached from some, and its time.

    By differential evolution (Storn and Price 1997): ridges of the time to lock are narrow, and lie along
    what separates those who climb them.  Who begins in one octant of positions climbs apart from all others.
    """
    width = box[1] - box[0]
    all_times = times_of(search, states)
    members = []
    octants = (states[:, :3] > 0.5 * (box[0] + box[1])[:3]) @ [1, 2, 4]
    for island in range(ISLANDS):
        here = octants == island
        own = np.flatnonzero(here if here.any() else ~here)
        best = own[np.argsort(-all_times[own], kind="stable")[:MEMBERS]]
        members.append(np.resize(best, MEMBERS))
    states, times = states[np.concatenate(members)], all_times[np.concatenate(members)]
    rows, latest, idle = np.arange(len(states)), -inf, 0
    for _ in range(ROUNDS):
        if times.max() == inf or idle == PATIENCE:
            break
        tried = within(box, (states[:, None] + steps(states, width, random)).reshape(-1, 6))
        found = times_of(search, tried).reshape(len(states), TRIED)
        which = found.argmax(axis=1)
        better = found[rows, which] > times
        states[better] = tried.reshape(len(states), TRIED, 6)[rows, which][better]
        times[better] = found[rows, which][better]
        idle = 0 if times.max() > latest + GAIN else idle + 1
        latest = max(latest, times.max())
    winner = int(times.argmax())
    return states[winner], float(times[winner])


def steps(states: Floats, width: Floats, random: Any) -> Floats:
    """Steps (N, TRIED, 6) of all sizes: of some components, or along what lies between two of an island."""
    shape = len(states), TRIED
    size = 10.0 ** random.uniform(-8.0, -0.5, (*shape, 1))
    moved = random.random((*shape, 6)) < random.choice([0.2, 0.5, 1.0], (*shape, 1))
    anyhow = width * size * moved * random.normal(size=(*shape, 6))
    home = MEMBERS * (np.arange(len(states)) // MEMBERS)[:, None]
    one, other = home + random.integers(MEMBERS, size=(2, *shape))
    along = (states[one] - states[other]) * 10.0 ** random.uniform(-2.0, 0.3, (*shape, 1))
    return np.asarray(np.where(random.random((*shape, 1)) < 0.5, anyhow, along))
