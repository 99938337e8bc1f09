"""Relative orbits that people name, as states (N, 6) in m and m/s.

The formations drift nowhere: in an orbit every craft has d = 0, so that it stays by itself, to
first order.  They centre on the origin of the Hill frame, and their time is that of the states.
A transfer arrives later: the relative orbit is flown from the states at arrival on.

In Palmer's coordinates natural motion with d = 0 is, with w = n t + phase (theory 5),

    x = -E cos w    y = l + 2 E sin w    z = H cos(n t - phase of h)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, instance, number, whole
from closeform.motion.mean_motion import checked
from closeform.motion.orbit import Orbit
from closeform.motion.palmer import state_from_palmer


def safety_ellipse(
    orbit: Orbit, count: int, radial: float, cross_track: float, along_track: float = 0.0, phase: float = 0.0
) -> Floats:
    """Craft evenly spread on one passively safe ellipse around the origin.

    Parameters
    ----------
    orbit : Orbit
        Of the origin.
    count : int
        N, at least 1.
    radial : float [m]
        Swing up and down; twice as much along-track.
    cross_track : float [m]
        Swing left and right, a quarter turn apart.
    along_track : float [m], default 0
        Of the ellipse's centre.
    phase : float [rad], default 0
        Of the first craft, which is lowest at 0; the others are ahead of it.

    Returns
    -------
    array of shape (N, 6) [m, m/s]
        In the rotating frame.

    Raises
    ------
    ValueError
        If `orbit` is deep space, `count` below 1, a swing not positive, or a number not finite.

    Notes
    -----
    Seen along the track the ellipse goes around the origin: the separation across the track from a craft
    there is never below the smaller swing, however wrong their distance along-track; between two of N
    craft of the ellipse never below 2 sin(pi / N) times that.

    References
    ----------
    D'Amico and Montenbruck, J. Guidance, Control, and Dynamics 29(3), 554-563, 2006.
    """
    orbiting(orbit, "safety_ellipse")
    scalar("radial", radial, positive=True)
    scalar("cross_track", cross_track, positive=True)
    return _separated(orbit, count, radial, cross_track, along_track, scalar("phase", phase))


def separated_ring(
    orbit: Orbit, count: int, eccentricity: float, inclination: float, first_phase: float = 0.0
) -> Floats:
    """Craft with e- and i-vectors parallel to each other, their phases evenly spread.

    Parameters
    ----------
    orbit : Orbit
        Of the origin.
    count : int
        N, at least 1.
    eccentricity : float [m]
        Length a |de| of the relative eccentricity vectors.
    inclination : float [m]
        Length a |di| of the relative inclination vectors, not 0; a negative one makes the two anti-parallel,
        the mirror image.
    first_phase : float [rad], default 0
        Of the first craft's (e1, e2).

    Returns
    -------
    array of shape (N, 6) [m, m/s]
        In the rotating frame.

    Raises
    ------
    ValueError
        If `orbit` is deep space, `count` below 1, `eccentricity` not positive, `inclination` 0, or a number
        not finite.

    Notes
    -----
    The vectors of any two craft differ by parallel vectors too, so radial and cross-track separation never
    vanish together: 2 sin(pi / N) times the smaller of the lengths is left between any two, at any
    along-track offset.  The relative orbits are those of a `safety_ellipse` around the origin.

    References
    ----------
    D'Amico and Montenbruck, J. Guidance, Control, and Dynamics 29(3), 554-563, 2006.
    """
    orbiting(orbit, "separated_ring")
    scalar("eccentricity", eccentricity, positive=True)
    if scalar("inclination", inclination) == 0.0:
        raise ValueError("inclination: 0 leaves no separation where the radial one vanishes; give a length")
    return _separated(orbit, count, eccentricity, inclination, 0.0, scalar("first_phase", first_phase))


def projected_circular(orbit: Orbit, count: int, radius: float, first_phase: float = 0.0) -> Floats:
    """Craft evenly spread on a relative orbit that is a circle seen from the Earth.

    Parameters
    ----------
    orbit : Orbit
        Of the origin.
    count : int
        N, at least 1.
    radius : float [m]
        Of the circle in the along-track, cross-track plane.
    first_phase : float [rad], default 0
        Of the first craft; the others are ahead of it.

    Returns
    -------
    array of shape (N, 6) [m, m/s]
        In the rotating frame: y = radius cos w, z = radius sin w and x = z / 2, w = n t + first_phase.

    Raises
    ------
    ValueError
        If `orbit` is deep space, `count` below 1, `radius` not positive, or a number not finite.

    Notes
    -----
    Radial and cross-track separation vanish together twice a turn: the formation is not passively safe.

    References
    ----------
    Sabol, Burns and McLaughlin, J. Spacecraft and Rockets 38(2), 270-278, 2001.
    """
    orbiting(orbit, "projected_circular")
    rho = scalar("radius", radius, positive=True)
    w = _phases(count, scalar("first_phase", first_phase))
    cos, sin, none = rho * np.cos(w), rho * np.sin(w), np.zeros_like(w)
    palmer = np.stack([-0.5 * sin, 0.5 * cos, none, none, sin, cos], axis=-1)
    return state_from_palmer(palmer, orbit.mean_motion)


def string_of_pearls(orbit: Orbit, count: int, spacing: float) -> Floats:
    """Craft behind one another on the same orbit, at rest along-track.

    Parameters
    ----------
    orbit : Orbit
        Of the origin.
    count : int
        N, at least 1.
    spacing : float [m]
        Between neighbours.

    Returns
    -------
    array of shape (N, 6) [m, m/s]
        In the rotating frame, centred on the origin, the last one foremost.

    Raises
    ------
    ValueError
        If `orbit` is deep space, where there is no track (see `line`), `count` below 1, or `spacing` not
        positive and finite.

    References
    ----------
    docs/theory.md (5).
    """
    orbiting(orbit, "string_of_pearls")
    return line(count, spacing, [0.0, 1.0, 0.0])


def pendulum(orbit: Orbit, count: int, spacing: float, cross_track: float) -> Floats:
    """Craft behind one another that swing across the track, each wider than the last.

    Parameters
    ----------
    orbit : Orbit
        Of the origin.
    count : int
        N, at least 1.
    spacing : float [m]
        Between neighbours along-track.
    cross_track : float [m]
        Swing of neighbours relative to each other.

    Returns
    -------
    array of shape (N, 6) [m, m/s]
        In the rotating frame, all at their widest; they cross the orbital plane together a quarter orbit
        later, when `spacing` is all that separates them.

    Raises
    ------
    ValueError
        If `orbit` is deep space, `count` below 1, or a length not positive and finite.

    References
    ----------
    Cross-track pendulum: Krieger, Fiedler, Mittermayer, Papathanassiou and Moreira, IEE Proc. Radar, Sonar
    and Navigation 150(3), 2003.
    """
    states = string_of_pearls(orbit, count, spacing)
    states[:, 2] = _places(len(states)) * scalar("cross_track", cross_track, positive=True)
    return states


def line(count: int, spacing: float, direction: ArrayLike) -> Floats:
    """Craft at rest on a straight line, for deep space.

    In an orbit only a line along the track stays by itself (`string_of_pearls`).

    Parameters
    ----------
    count : int
        N, at least 1.
    spacing : float [m]
        Between neighbours.
    direction : array_like of shape (3,), no unit
        From the first craft to the last, in the frame; of any length.

    Returns
    -------
    array of shape (N, 6) [m, m/s]
        In the frame, centred on the origin.

    Raises
    ------
    ValueError
        If `count` is below 1, `spacing` not positive, `direction` zero or of another shape, or a number not
        finite.

    References
    ----------
    docs/targets.md.
    """
    places = _places(count) * scalar("spacing", spacing, positive=True)
    along = np.asarray(checked("direction", direction, last=3))
    length = np.linalg.norm(along)
    if along.ndim != 1 or not length > 0.0:
        raise ValueError("direction: expected one vector (3,) that is not zero")
    states = np.zeros((len(places), 6))
    states[:, :3] = places[:, None] * (along / length)
    return states


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
    lengths = (radial * cos, radial * sin, 0.0, scalar("along_track", centre))
    parts = np.broadcast_arrays(*lengths, cross_track * sin, cross_track * cos)
    return state_from_palmer(np.stack(parts, axis=-1), orbit.mean_motion)


def scalar(name: str, value: ArrayLike, positive: bool = False) -> float:
    """An argument as one finite number."""
    return float(checked(name, number(name, value), positive=positive))


def orbiting(orbit: Orbit, name: str) -> None:
    """Refuse deep space, where a relative orbit of that `name` has no meaning."""
    if not instance("orbit", orbit, Orbit).mean_motion:
        raise ValueError(f"orbit: {name} has no meaning in deep space; give a mean motion above 0")
