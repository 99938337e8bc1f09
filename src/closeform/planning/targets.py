"""Relative orbits that people name, and where a formation can go, as states (N, 6) in m and m/s.

The formations drift nowhere: in an orbit every craft has d = 0, so that it stays by itself, to
first order.  They centre on the origin of the Hill frame, and their time is that of the states.
A transfer arrives later: the relative orbit is flown from the states at arrival on.

In Palmer's coordinates natural motion with d = 0 is, with w = n t + phase (theory 5),

    x = -E cos w    y = l + 2 E sin w    z = H cos(n t - phase of h)
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, instance, number, whole
from closeform.conflicts.two_paths import closest_approach
from closeform.motion.mean_motion import checked
from closeform.motion.orbit import Orbit
from closeform.motion.palmer import palmer_from_state, state_from_palmer
from closeform.zones.solids import Sphere

TOGETHER = 1e-9  # of the formation's size: closer craft are at one place
EQUAL = 1e-6  # of a distance
CROWDED = 0.25  # of the least spacing: a place in a ring is at least half of it from everybody


def safety_ellipse(
    orbit: Orbit, count: int, radial: float, cross_track: float, along_track: float = 0.0, phase: float = 0.0
) -> Floats:
    """`count` craft (N, 6) evenly spread on one passively safe ellipse around the origin.

    The ellipse swings `radial` [m] up and down, `cross_track` [m] left and right, a quarter turn
    apart, and twice `radial` along-track about `along_track` [m].  Seen along the track it goes
    around the origin: the separation across the track from a craft there is never below the
    smaller swing, however wrong their distance along-track; between two of N craft of the
    ellipse never below 2 sin(pi / N) times that.  The first craft is lowest at `phase` = 0 [rad];
    the others are ahead of it in phase.  orbit: of the origin.
    D'Amico and Montenbruck, J. Guidance, Control, and Dynamics 29(3), 554-563, 2006.

    Raises ValueError in deep space, for a count below 1, swings that are not positive and numbers
    that are not finite.
    """
    _orbiting(orbit, "safety_ellipse")
    _scalar("radial", radial, positive=True)
    _scalar("cross_track", cross_track, positive=True)
    return _separated(orbit, count, radial, cross_track, along_track, _scalar("phase", phase))


def separated_ring(
    orbit: Orbit, count: int, eccentricity: float, inclination: float, first_phase: float = 0.0
) -> Floats:
    """`count` craft (N, 6) with e- and i-vectors parallel to each other, their phases evenly spread.

    eccentricity, inclination: lengths a |de| and a |di| [m] of the relative eccentricity and
    inclination vectors; a negative `inclination` makes the two anti-parallel, the mirror image.
    The vectors of any two craft differ by parallel vectors too, so radial and cross-track
    separation never vanish together: 2 sin(pi / N) times the smaller of the lengths is left
    between any two, at any along-track offset.  The relative orbits are those of a `safety_ellipse`
    around the origin, whose path is `orbit`.  first_phase: of the first craft's (e1, e2) [rad].
    D'Amico and Montenbruck, J. Guidance, Control, and Dynamics 29(3), 554-563, 2006.

    Raises ValueError in deep space, for a count below 1, an eccentricity that is not positive, no
    inclination and numbers that are not finite.
    """
    _orbiting(orbit, "separated_ring")
    _scalar("eccentricity", eccentricity, positive=True)
    if _scalar("inclination", inclination) == 0.0:
        raise ValueError("inclination: 0 leaves no separation where the radial one vanishes; give a length")
    return _separated(orbit, count, eccentricity, inclination, 0.0, _scalar("first_phase", first_phase))


def projected_circular(orbit: Orbit, count: int, radius: float, first_phase: float = 0.0) -> Floats:
    """`count` craft (N, 6) evenly spread on a relative orbit that is a circle seen from the Earth.

    Along-track and cross-track, y = radius cos w and z = radius sin w with w = n t + first_phase; radius
    in m, first_phase in rad, of the first craft; the others are ahead of it.  Radially x = z / 2: an
    ellipse in its own plane.  Radial and cross-track separation vanish together twice a turn, so
    the formation is not passively safe.
    Sabol, Burns and McLaughlin, J. Spacecraft and Rockets 38(2), 270-278, 2001.

    Raises ValueError in deep space, for a count below 1, a radius that is not positive and numbers
    that are not finite.
    """
    _orbiting(orbit, "projected_circular")
    rho = _scalar("radius", radius, positive=True)
    w = _phases(count, _scalar("first_phase", first_phase))
    cos, sin, none = rho * np.cos(w), rho * np.sin(w), np.zeros_like(w)
    palmer = np.stack([-0.5 * sin, 0.5 * cos, none, none, sin, cos], axis=-1)
    return state_from_palmer(palmer, orbit.mean_motion)


def string_of_pearls(orbit: Orbit, count: int, spacing: float) -> Floats:
    """`count` craft (N, 6) behind one another on the same orbit, `spacing` [m] apart.

    They are at rest along-track, centred on the origin, the last one foremost.

    Raises ValueError in deep space, where there is no track (see `line`), for a count below 1 and a
    spacing that is not positive and finite.
    """
    _orbiting(orbit, "string_of_pearls")
    return line(count, spacing, [0.0, 1.0, 0.0])


def pendulum(orbit: Orbit, count: int, spacing: float, cross_track: float) -> Floats:
    """`count` craft (N, 6) behind one another that swing across the track, each wider than the last.

    Neighbours are `spacing` [m] apart along-track and swing `cross_track` [m] relative to each other;
    all are at their widest at the time of the states, and cross the orbital plane together a
    quarter orbit later, when `spacing` is all that separates them.  Circular orbits of slightly
    different inclination or node (cross-track pendulum: Krieger, Fiedler, Mittermayer, Papathanassiou
    and Moreira, IEE Proc. Radar, Sonar and Navigation 150(3), 2003).

    Raises ValueError in deep space, for a count below 1, and for a spacing or swing that is not
    positive and finite.
    """
    states = string_of_pearls(orbit, count, spacing)
    states[:, 2] = _places(len(states)) * _scalar("cross_track", cross_track, positive=True)
    return states


def line(count: int, spacing: float, direction: ArrayLike) -> Floats:
    """`count` craft (N, 6) at rest on a straight line, `spacing` [m] apart, centred on the origin.

    direction: (3,), of any length, from the first craft to the last.  For deep space; in an orbit only a
    line along the track stays by itself (`string_of_pearls`).

    Raises ValueError for a count below 1, a spacing that is not positive, a direction of another
    shape or without length, and numbers that are not finite.
    """
    places = _places(count) * _scalar("spacing", spacing, positive=True)
    along = np.asarray(checked("direction", direction, last=3))
    length = np.linalg.norm(along)
    if along.ndim != 1 or not length > 0.0:
        raise ValueError("direction: expected one vector (3,) that is not zero")
    states = np.zeros((len(places), 6))
    states[:, :3] = places[:, None] * (along / length)
    return states


def without_eccentricity(orbit: Orbit, states: ArrayLike) -> Floats:
    """The `states` (..., 6) in m and m/s with no eccentricity difference to the origin, and no other change.

    Only Palmer's (e1, e2) become 0; d, l and the inclination stay.  The craft keeps its mean place
    along-track and its drift, and swings radially no longer.  orbit: of the origin.
    Palmer, J. Guidance, Control, and Dynamics 29(3), 519-526, 2006.

    Raises ValueError in deep space, for other shapes and for numbers that are not finite.
    """
    return _without(orbit, states, "without_eccentricity", slice(0, 2))


def without_altitude_difference(orbit: Orbit, states: ArrayLike) -> Floats:
    """The `states` (..., 6) in m and m/s with no difference of mean altitude, and no other change.

    Only Palmer's d becomes 0: the craft drifts no longer; e- and i-vector and l stay, so its position
    changes by 2 d radially.  orbit: of the origin.
    Palmer, J. Guidance, Control, and Dynamics 29(3), 519-526, 2006.

    Raises ValueError in deep space, for other shapes and for numbers that are not finite.
    """
    return _without(orbit, states, "without_altitude_difference", slice(2, 3))


def added_member(orbit: Orbit, states: ArrayLike) -> Floats:
    """A state (6,) in m and m/s for one more craft in a formation of `states` (N, 6).

    In an orbit, the places on the relative orbits of the members are tried: for each the one half-way
    to the next phase that is taken (on a ring these are the middles of its gaps).  The one
    furthest from all members, by the least distance over one orbit, is taken, if that is more than a
    quarter of the members' own.  Otherwise the formation is a string, a pendulum, a line: each
    member's step away from its nearest neighbour is repeated, and of these places the one furthest
    from all members is taken, of equal ones that of the last.  In deep space distances are those now.

    Raises ValueError where no such place is clear of all members (a single craft without a relative
    orbit), for other shapes and for numbers that are not finite.
    """
    instance("orbit", orbit, Orbit)
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
    raise ValueError("states: no place that continues this formation is clear of it; choose a state yourself")


def scattered(orbit: Orbit, states: ArrayLike, duration: float, factor: float) -> Floats:
    """Final states (N, 6) at which every pair is at least `factor` times as far apart as in `states`.

    states: (N, 6) in m and m/s at the start; duration: from then to arrival [s].  The
    states to which the craft would coast in `orbit` are enlarged about their centroid, positions and
    velocities alike, by the least scale, but at least 1, that keeps the promise for every pair.
    The relative motion afterwards is that of coasting, enlarged by the same scale: a formation
    that does not drift does not drift then, and no pair is ever closer than by coasting.  About no
    other centre does the same scale cost less energy in sum.

    Raises ValueError for a pair at one place, at the start or, by coasting, at arrival (no scale
    parts it), a duration that is not positive, a factor below 1, other shapes and numbers that
    are not finite.
    """
    members = _formation(states)
    if _scalar("factor", factor) < 1.0:
        raise ValueError(f"factor: must be at least 1, got {factor:g}")
    coasted = _coasted(orbit, members, _scalar("duration", duration, positive=True))
    if len(members) == 1:
        return coasted
    pairs = np.triu_indices(len(members), 1)
    before, after = (np.linalg.norm(s[pairs[0], :3] - s[pairs[1], :3], axis=1) for s in (members, coasted))
    for apart, when in ((before, "at the start"), (after, f"after {duration:g} s of coasting")):
        k = int(apart.argmin())
        if apart[k] <= TOGETHER * max(before.max(), after.max()):
            raise ValueError(f"states: craft {pairs[0][k]} and {pairs[1][k]} are at one place {when}")
    centre = coasted.mean(axis=0)
    scale = max(1.0, float((factor * before / after).max()))
    return np.asarray(centre + scale * (coasted - centre))


def scattered_from(
    orbit: Orbit, states: ArrayLike, duration: float, point: ArrayLike, distance: float
) -> Floats:
    """Final states (N, 6) at which every craft is at least `distance` from a fixed `point`.

    states: (N, 6) in m and m/s at the start; duration: from then to arrival [s]; point: (3,) in m
    in the Hill frame; distance in m.  From the states to which they would coast all craft
    move straight away from the point by one length, the least that brings the nearest to
    `distance`; so no pair is closer at arrival than by coasting.  In an orbit the speed along-track
    changes by -2 n times the radial move: d stays, and nobody drifts more than before.  Where
    all are far enough already they coast.

    Raises ValueError for a craft that coasting would bring to the point itself, a duration or
    distance that is not positive, other shapes and numbers that are not finite.
    """
    members = _formation(states)
    middle = np.asarray(checked("point", point, last=3))
    if middle.ndim != 1:
        raise ValueError(f"point: expected shape (3,), got {middle.shape}")
    wanted = _scalar("distance", distance, positive=True)
    final = _coasted(orbit, members, _scalar("duration", duration, positive=True))
    away = final[:, :3] - middle
    length = np.linalg.norm(away, axis=1)
    nearest = int(length.argmin())
    if length[nearest] >= wanted:
        return final
    if length[nearest] <= TOGETHER * max(wanted, float(length.max())):
        raise ValueError(f"point: coasting brings craft {nearest} to it, so there is no way that leads away")
    move = (wanted - length[nearest]) * away / length[:, None]
    final[:, :3] += move
    final[:, 4] -= 2.0 * orbit.mean_motion * move[:, 0]
    return final


def regathered(orbit: Orbit, states: ArrayLike, elapsed: float) -> Floats:
    """The relative orbits of `states` (..., 6), in m and m/s, `elapsed` [s] later.

    Final states for craft that return to the relative orbits that they had: each takes the place at
    which it would be had it coasted in `orbit` ever since, so `elapsed` counts to the time of arrival.

    Raises ValueError for a negative time, other shapes and numbers that are not finite.
    """
    if _scalar("elapsed", elapsed) < 0.0:
        raise ValueError(f"elapsed: must be at least 0, got {elapsed:g} s")
    return _coasted(orbit, np.asarray(checked("states", states, last=6)), elapsed)


def _scalar(name: str, value: ArrayLike, positive: bool = False) -> float:
    return float(checked(name, number(name, value), positive=positive))


def _orbiting(orbit: Orbit, name: str) -> None:
    if not instance("orbit", orbit, Orbit).mean_motion:
        raise ValueError(f"orbit: {name} has no meaning in deep space; give a mean motion above 0")


def _places(count: int) -> Floats:
    return np.arange(whole("count", count, 1), dtype=np.float64) - 0.5 * (count - 1)


def _phases(count: int, first: float) -> Floats:
    return first + 2.0 * np.pi * np.arange(whole("count", count, 1)) / count


def _separated(
    orbit: Orbit, count: int, radial: float, cross_track: float, centre: float, phase: float
) -> Floats:
    """z = cross_track sin w beside x = -radial cos w: parallel e- and i-vectors."""
    w = _phases(count, phase)
    cos, sin = np.cos(w), np.sin(w)
    lengths = (radial * cos, radial * sin, 0.0, _scalar("along_track", centre))
    parts = np.broadcast_arrays(*lengths, cross_track * sin, cross_track * cos)
    return state_from_palmer(np.stack(parts, axis=-1), orbit.mean_motion)


def _without(orbit: Orbit, states: ArrayLike, name: str, part: slice) -> Floats:
    _orbiting(orbit, name)
    palmer = palmer_from_state(checked("states", states, last=6), orbit.mean_motion)
    palmer[..., part] = 0.0
    return state_from_palmer(palmer, orbit.mean_motion)


def _formation(states: ArrayLike) -> Floats:
    members = np.asarray(checked("states", states, last=6))
    if members.ndim != 2 or not len(members):
        raise ValueError(f"states: expected shape (N, 6), got {members.shape}")
    return members


def _coasted(orbit: Orbit, states: Floats, duration: float) -> Floats:
    return np.asarray(states @ instance("orbit", orbit, Orbit).transition(duration).T)


def _least_distances(orbit: Orbit, places: Floats, members: Floats) -> Floats:
    """Least distance (M, N) of each place from each member over one orbit; in deep space, now."""
    if not orbit.mean_motion:
        return np.asarray(np.linalg.norm(places[:, None, :3] - members[:, :3], axis=-1))
    ahead = orbit.coast(places, orbit.period)
    return np.asarray(
        closest_approach(ahead[:, None], orbit.coast(members, orbit.period), Sphere(1.0)).distance
    )


def _half_way_to_next(orbit: Orbit, members: Floats) -> Floats:
    """The members with an eccentricity, each moved on along its own relative orbit (d and l stay)."""
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
