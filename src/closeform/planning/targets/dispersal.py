"""Targets of a formation relative to its current states: dispersal, return, no drift, one more member."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats
from closeform.conflicts.two_paths import closest_approach
from closeform.motion.elements.mean_motion import checked
from closeform.motion.elements.palmer import palmer_from_state, state_from_palmer
from closeform.motion.orbit import Orbit, circular_orbit
from closeform.planning.targets.relative_orbits import orbiting, scalar
from closeform.zones.solids import Sphere

TOGETHER = 1e-9  # of the formation's size: closer craft have the same position
EQUAL = 1e-6  # of a distance: smaller differences are ties
CROWDED = 0.25  # of the minimum spacing: required distance of a place in a ring


def without_eccentricity(orbit: Orbit, states: ArrayLike) -> Floats:
    """Return the states without eccentricity relative to the origin and otherwise unchanged.

    The craft keeps its mean along-track position and its drift, without the radial oscillation.

    Parameters
    ----------
    orbit : Orbit
        Orbit of the origin.
    states : array_like of shape (..., 6) [m, m/s]
        States in the rotating frame.

    Returns
    -------
    array of shape (..., 6) [m, m/s]
        States in the rotating frame; of Palmer's coordinates only (e1, e2) become 0.

    Raises
    ------
    ValueError
        If `orbit` is deep space, the shape is wrong, or a number is not finite.

    References
    ----------
    Palmer, J. Guidance, Control, and Dynamics 29(3), 519-526, 2006.
    """
    return _without(orbit, states, "without_eccentricity", slice(0, 2))


def without_altitude_difference(orbit: Orbit, states: ArrayLike) -> Floats:
    """Return the states without a mean altitude difference to the origin and otherwise unchanged.

    The craft stops drifting; its position changes by 2 d radially.

    Parameters
    ----------
    orbit : Orbit
        Orbit of the origin.
    states : array_like of shape (..., 6) [m, m/s]
        States in the rotating frame.

    Returns
    -------
    array of shape (..., 6) [m, m/s]
        States in the rotating frame; of Palmer's coordinates only d becomes 0.

    Raises
    ------
    ValueError
        If `orbit` is deep space, the shape is wrong, or a number is not finite.

    References
    ----------
    Palmer, J. Guidance, Control, and Dynamics 29(3), 519-526, 2006.
    """
    return _without(orbit, states, "without_altitude_difference", slice(2, 3))


def added_member(orbit: Orbit, states: ArrayLike) -> Floats:
    """Return a state for one more craft in a formation.

    Parameters
    ----------
    orbit : Orbit
        Orbit of the origin.
    states : array_like of shape (N, 6) [m, m/s]
        States of the members in the rotating frame.

    Returns
    -------
    array of shape (6,) [m, m/s]
        State in the rotating frame.

    Raises
    ------
    ValueError
        If no candidate is clear of all members (a single craft without a relative orbit), the shape is wrong,
        or a number is not finite.

    Notes
    -----
    In an orbit, the first candidates are on the relative orbits of the members, each half-way to the next
    occupied phase (on a ring, the middles of its gaps).  The candidate with the largest minimum distance from
    all members over one orbit is chosen, if that exceeds a quarter of the members' own.  Otherwise the
    formation is a string, a pendulum or a line: each member's step away from its nearest neighbour is
    repeated, and the candidate farthest from all members is chosen, of equal ones that of the last member.
    In deep space the distances are those of the given states.

    References
    ----------
    docs/targets.md.
    """
    circular_orbit("orbit", orbit)
    members = _formation(states)
    apart = _least_distances(orbit, members, members)
    np.fill_diagonal(apart, np.inf)
    spacing, nearest = apart.min(), apart.argmin(axis=1)
    onward = _half_way_to_next(orbit, members) if orbit.mean_motion else members[:0]
    steps = (2.0 * members - members[nearest])[::-1] if len(members) > 1 else members[:0]
    for places, least in ((onward, CROWDED * spacing if len(members) > 1 else 0.0), (steps, 0.0)):
        if len(places):
            clear = _least_distances(orbit, places, members).min(axis=1)
            best = int(np.argmax(clear >= clear.max() * (1.0 - EQUAL)))  # the first of equal ones
            if clear[best] > max(least, TOGETHER * np.abs(members[:, :3]).max()):
                return np.asarray(places[best])
    raise ValueError(
        "states: every place that continues this formation is in conflict with it; give a state instead"
    )


def scattered(orbit: Orbit, states: ArrayLike, duration: float, factor: float) -> Floats:
    """Return final states at which every pair's distance is at least `factor` times the initial one.

    Parameters
    ----------
    orbit : Orbit
        Orbit of the origin.
    states : array_like of shape (N, 6) [m, m/s]
        Initial states in the rotating frame.
    duration : float [s]
        Time to arrival.
    factor : float, no unit
        Factor of the distances, at least 1.

    Returns
    -------
    array of shape (N, 6) [m, m/s]
        States at arrival, in the rotating frame.

    Raises
    ------
    ValueError
        If a pair has the same position, initially or after coasting to arrival (no scale separates it),
        `duration` is not positive, `factor` is below 1, the shape is wrong, or a number is not finite.

    Notes
    -----
    The states after coasting are enlarged about their centroid, positions and velocities alike, by the
    smallest scale, at least 1, that fulfils the requirement for every pair.  The subsequent relative motion
    is that of coasting, enlarged by the same scale: a formation without drift does not start to drift, and
    no pair is ever closer than by coasting.  For a given scale, the centroid minimises the total energy.

    References
    ----------
    docs/targets.md.
    """
    members = _formation(states)
    if scalar("factor", factor) < 1.0:
        raise ValueError(f"factor: must be at least 1, got {factor:g}")
    coasted = _coasted(orbit, members, scalar("duration", duration, positive=True))
    if len(members) == 1:
        return coasted
    pairs = np.triu_indices(len(members), 1)
    before, after = (np.linalg.norm(s[pairs[0], :3] - s[pairs[1], :3], axis=1) for s in (members, coasted))
    for apart, when in ((before, "at the start"), (after, f"after {duration:g} s of coasting")):
        k = int(apart.argmin())
        if apart[k] <= TOGETHER * max(before.max(), after.max()):
            raise ValueError(f"states: craft {pairs[0][k]} and {pairs[1][k]} are at the same position {when}")
    centre = coasted.mean(axis=0)
    scale = max(1.0, float((factor * before / after).max()))
    return np.asarray(centre + scale * (coasted - centre))


def scattered_from(
    orbit: Orbit, states: ArrayLike, duration: float, point: ArrayLike, distance: float
) -> Floats:
    """Return final states at which every craft is at least `distance` from a fixed point.

    Parameters
    ----------
    orbit : Orbit
        Orbit of the origin.
    states : array_like of shape (N, 6) [m, m/s]
        Initial states in the rotating frame.
    duration : float [s]
        Time to arrival.
    point : array_like of shape (3,) [m]
        Point in the rotating frame.
    distance : float [m]
        Minimum distance from the point at arrival.

    Returns
    -------
    array of shape (N, 6) [m, m/s]
        States at arrival, in the rotating frame; the coasted states where these are far enough.

    Raises
    ------
    ValueError
        If coasting brings a craft to the point itself, `duration` or `distance` is not positive, a shape is
        wrong, or a number is not finite.

    Notes
    -----
    From the coasted states all craft move away from the point by the same length, the smallest that brings
    the nearest to `distance`; no pair is closer at arrival than by coasting.  In an orbit the along-track
    speed changes by -2 n times the radial move, so that d, and with it the drift, stays the same.

    References
    ----------
    docs/targets.md.
    """
    members = _formation(states)
    middle = np.asarray(checked("point", point, last=3))
    if middle.ndim != 1:
        raise ValueError(f"point: expected shape (3,), got {middle.shape}")
    wanted = scalar("distance", distance, positive=True)
    final = _coasted(orbit, members, scalar("duration", duration, positive=True))
    away = final[:, :3] - middle
    length = np.linalg.norm(away, axis=1)
    nearest = int(length.argmin())
    if length[nearest] >= wanted:
        return final
    if length[nearest] <= TOGETHER * max(wanted, float(length.max())):
        raise ValueError(f"point: coasting brings craft {nearest} to it, so no direction leads away; move it")
    move = (wanted - length[nearest]) * away / length[:, None]
    final[:, :3] += move
    final[:, 4] -= 2.0 * orbit.mean_motion * move[:, 0]
    return final


def regathered(orbit: Orbit, states: ArrayLike, elapsed: float) -> Floats:
    """Return earlier relative orbits of craft at a later time.

    Each craft returns to the state that it would have after coasting since then.

    Parameters
    ----------
    orbit : Orbit
        Orbit of the origin.
    states : array_like of shape (..., 6) [m, m/s]
        Earlier states in the rotating frame.
    elapsed : float [s]
        Time to arrival, at least 0.

    Returns
    -------
    array of shape (..., 6) [m, m/s]
        States at arrival, in the rotating frame.

    Raises
    ------
    ValueError
        If `elapsed` is negative, the shape is wrong, or a number is not finite.

    References
    ----------
    docs/theory.md section 1.
    """
    if scalar("elapsed", elapsed) < 0.0:
        raise ValueError(f"elapsed: must be at least 0, got {elapsed:g} s")
    return _coasted(orbit, np.asarray(checked("states", states, last=6)), elapsed)


def _without(orbit: Orbit, states: ArrayLike, name: str, part: slice) -> Floats:
    orbiting(orbit, name)
    palmer = palmer_from_state(checked("states", states, last=6), orbit.mean_motion)
    palmer[..., part] = 0.0
    return state_from_palmer(palmer, orbit.mean_motion)


def _formation(states: ArrayLike) -> Floats:
    members = np.asarray(checked("states", states, last=6))
    if members.ndim != 2 or not len(members):
        raise ValueError(f"states: expected shape (N, 6), got {members.shape}")
    return members


def _coasted(orbit: Orbit, states: Floats, duration: float) -> Floats:
    return np.asarray(states @ circular_orbit("orbit", orbit).transition(duration).T)


def _least_distances(orbit: Orbit, places: Floats, members: Floats) -> Floats:
    """Return the minimum distance (M, N) of places from members over one orbit; in deep space, now."""
    if not orbit.mean_motion:
        return np.asarray(np.linalg.norm(places[:, None, :3] - members[:, :3], axis=-1))
    ahead = orbit.coast(places, orbit.period)
    return np.asarray(
        closest_approach(ahead[:, None], orbit.coast(members, orbit.period), Sphere(1.0)).distance
    )


def _half_way_to_next(orbit: Orbit, members: Floats) -> Floats:
    """Return the members with an eccentricity, each advanced on its own relative orbit (d and l stay)."""
    palmer = palmer_from_state(members, orbit.mean_motion)
    lengths = np.hypot(palmer[:, 0], palmer[:, 1])
    palmer = palmer[lengths > TOGETHER * np.abs(palmer).max(initial=0.0)]
    phase = np.arctan2(palmer[:, 1], palmer[:, 0])
    gaps = (phase - phase[:, None]) % (2.0 * np.pi)
    gaps[gaps < TOGETHER] = 2.0 * np.pi
    turn = 0.5 * gaps.min(axis=1, initial=2.0 * np.pi)
    cos, sin = np.cos(turn), np.sin(turn)
    e1, e2, d, l, h1, h2 = palmer.T  # noqa: E741
    turned: Any = (e1 * cos - e2 * sin, e1 * sin + e2 * cos, d, l, h1 * cos + h2 * sin, h2 * cos - h1 * sin)
    return state_from_palmer(np.stack(turned, axis=-1), orbit.mean_motion)
