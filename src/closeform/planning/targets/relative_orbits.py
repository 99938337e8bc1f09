"""Named relative orbits, as states (N, 6) [m, m/s].

The formations do not drift: in an orbit every craft has d = 0, so that it keeps its relative orbit without
control, to first order.  They are centred on the origin of the Hill frame at the time of the states.  For
a transfer this is the time of arrival: the relative orbit starts from the states at arrival.

In Palmer's coordinates natural motion with d = 0 is, with w = n t + phase (theory 5),

    x = -E cos w    y = l + 2 E sin w    z = H cos(n t - phase of h)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, number, whole
from closeform.motion.chief.yamanaka_ankersen import KeplerChief
from closeform.motion.chief_orbit import ChiefOrbit
from closeform.motion.elements.mean_motion import checked
from closeform.motion.elements.palmer import state_from_palmer
from closeform.motion.orbit import Orbit, circular_orbit


def safety_ellipse(
    orbit: Orbit, count: int, radial: float, cross_track: float, along_track: float = 0.0, phase: float = 0.0
) -> Floats:
    """Return craft evenly distributed on one passively safe ellipse around the origin.

    Parameters
    ----------
    orbit : Orbit
        Orbit of the origin.
    count : int
        Number N of craft, at least 1.
    radial : float [m]
        Radial amplitude; the along-track amplitude is twice this.
    cross_track : float [m]
        Cross-track amplitude, a quarter revolution out of phase.
    along_track : float [m], default 0
        Along-track position of the ellipse's centre.
    phase : float [rad], default 0
        Phase of the first craft, which is lowest at 0; the others are ahead of it.

    Returns
    -------
    array of shape (N, 6) [m, m/s]
        States in the rotating frame.

    Raises
    ------
    ValueError
        If `orbit` is deep space, `count` is below 1, an amplitude is not positive, or a number is not finite.

    Notes
    -----
    Seen along the track, the ellipse encircles the origin.  The separation perpendicular to the track from a
    craft there is never below the smaller amplitude, whatever the error of their along-track distance.
    Between two of N craft of the ellipse it is never below 2 sin(pi / N) times that.

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
    """Return craft with parallel e- and i-vectors and evenly distributed phases.

    Parameters
    ----------
    orbit : Orbit
        Orbit of the origin.
    count : int
        Number N of craft, at least 1.
    eccentricity : float [m]
        Length a |de| of the relative eccentricity vectors.
    inclination : float [m]
        Length a |di| of the relative inclination vectors, not 0; a negative length makes the vectors
        anti-parallel, the mirror image.
    first_phase : float [rad], default 0
        Phase of the first craft's (e1, e2).

    Returns
    -------
    array of shape (N, 6) [m, m/s]
        States in the rotating frame.

    Raises
    ------
    ValueError
        If `orbit` is deep space, `count` is below 1, `eccentricity` is not positive, `inclination` is 0, or a
        number is not finite.

    Notes
    -----
    The vectors of any two craft differ by parallel vectors as well, so that radial and cross-track separation
    never vanish together: at least 2 sin(pi / N) times the smaller length remains between any two, at any
    along-track offset.  The relative orbits are those of a `safety_ellipse` around the origin.

    References
    ----------
    D'Amico and Montenbruck, J. Guidance, Control, and Dynamics 29(3), 554-563, 2006.
    """
    orbiting(orbit, "separated_ring")
    scalar("eccentricity", eccentricity, positive=True)
    if scalar("inclination", inclination) == 0.0:
        raise ValueError("inclination: 0 gives no separation where the radial one vanishes; give a length")
    return _separated(orbit, count, eccentricity, inclination, 0.0, scalar("first_phase", first_phase))


def projected_circular(orbit: Orbit, count: int, radius: float, first_phase: float = 0.0) -> Floats:
    """Return craft evenly distributed on a relative orbit that is a circle seen from the Earth.

    Parameters
    ----------
    orbit : Orbit
        Orbit of the origin.
    count : int
        Number N of craft, at least 1.
    radius : float [m]
        Radius of the circle in the along-track, cross-track plane.
    first_phase : float [rad], default 0
        Phase of the first craft; the others are ahead of it.

    Returns
    -------
    array of shape (N, 6) [m, m/s]
        States in the rotating frame: y = radius cos w, z = radius sin w and x = z / 2, w = n t + first_phase.

    Raises
    ------
    ValueError
        If `orbit` is deep space, `count` is below 1, `radius` is not positive, or a number is not finite.

    Notes
    -----
    Radial and cross-track separation vanish together twice an orbit: the formation is not passively safe.

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


def string_of_pearls(
    orbit: Orbit | ChiefOrbit, count: int, spacing: float, along_track: float = 0.0, time: float = 0.0
) -> Floats:
    """Return craft behind one another on the V-bar, where they stay: hold points.

    Parameters
    ----------
    orbit : Orbit or ChiefOrbit
        Orbit of the origin: circular, or an ellipse.
    count : int
        Number N of craft, at least 1.
    spacing : float [m]
        Distance of neighbours; without effect on one craft.
    along_track : float [m], default 0
        Along-track position of the craft's centre.
    time : float [s], default 0
        Time of the states, which matters about an eccentric chief.

    Returns
    -------
    array of shape (N, 6) [m, m/s]
        States in the rotating frame, the last craft foremost.

    Raises
    ------
    ValueError
        If `orbit` is deep space, which has no along-track direction (see `line`), or perturbed, `count` is
        below 1, `spacing` is not positive, or a number is not finite.

    Notes
    -----
    About a circular orbit the craft are at rest.  About an eccentric chief they differ from it in the
    argument of perigee alone: they stay on the V-bar, at a constant angle seen from the Earth's centre, so
    that their distance is proportional to the chief's radius.

    References
    ----------
    docs/theory.md (5); Yamanaka and Ankersen, J. Guidance, Control, and Dynamics 25(1), 60-66, 2002.

    Examples
    --------
    >>> orbit = cf.Orbit.eccentric(0.2, perigee_altitude=500e3)
    >>> hold = cf.targets.string_of_pearls(orbit, 1, 1.0, along_track=-200.0)
    >>> bool(np.allclose(orbit.transition(orbit.period) @ hold[0], hold[0]))
    True
    """
    when = scalar("time", time)
    states = line(count, spacing, [0.0, 1.0, 0.0])
    states[:, 1] += scalar("along_track", along_track)
    if isinstance(orbit, ChiefOrbit) and isinstance(orbit.chief, KeplerChief):
        states[:, 4] = orbit.chief.growth(orbit._angle(when)) * states[:, 1]
    else:
        orbiting(orbit, "string_of_pearls")
    return states


def pendulum(orbit: Orbit, count: int, spacing: float, cross_track: float) -> Floats:
    """Return craft behind one another with cross-track oscillations of linearly increasing amplitude.

    Parameters
    ----------
    orbit : Orbit
        Orbit of the origin.
    count : int
        Number N of craft, at least 1.
    spacing : float [m]
        Along-track distance of neighbours.
    cross_track : float [m]
        Cross-track amplitude of neighbours relative to each other.

    Returns
    -------
    array of shape (N, 6) [m, m/s]
        States in the rotating frame, all at maximum amplitude; they cross the orbital plane together a
        quarter orbit later, when `spacing` is their only separation.

    Raises
    ------
    ValueError
        If `orbit` is deep space, `count` is below 1, or a length is not positive and finite.

    References
    ----------
    Cross-track pendulum: Krieger, Fiedler, Mittermayer, Papathanassiou and Moreira, IEE Proc. Radar, Sonar
    and Navigation 150(3), 2003.
    """
    orbiting(orbit, "pendulum")
    states = string_of_pearls(orbit, count, spacing)
    states[:, 2] = _places(len(states)) * scalar("cross_track", cross_track, positive=True)
    return states


def line(count: int, spacing: float, direction: ArrayLike) -> Floats:
    """Return craft at rest on a straight line, for deep space.

    In an orbit only a line along the track is at rest without control (`string_of_pearls`).

    Parameters
    ----------
    count : int
        Number N of craft, at least 1.
    spacing : float [m]
        Distance of neighbours.
    direction : array_like of shape (3,), no unit
        Direction from the first craft to the last, in the frame; of any length.

    Returns
    -------
    array of shape (N, 6) [m, m/s]
        States in the frame, centred on the origin.

    Raises
    ------
    ValueError
        If `count` is below 1, `spacing` is not positive, `direction` is zero or of another shape, or a number
        is not finite.

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
    """Return craft with z = cross_track sin w and x = -radial cos w: parallel e- and i-vectors."""
    w = _phases(count, phase)
    cos, sin = np.cos(w), np.sin(w)
    lengths = (radial * cos, radial * sin, 0.0, scalar("along_track", centre))
    parts = np.broadcast_arrays(*lengths, cross_track * sin, cross_track * cos)
    return state_from_palmer(np.stack(parts, axis=-1), orbit.mean_motion)


def scalar(name: str, value: ArrayLike, positive: bool = False) -> float:
    """Return an argument as one finite number."""
    return float(checked(name, number(name, value), positive=positive))


def orbiting(orbit: Orbit | ChiefOrbit, name: str) -> None:
    """Raise ValueError for deep space, where the relative orbit `name` is undefined, and any other orbit."""
    if not circular_orbit("orbit", orbit).mean_motion:
        raise ValueError(f"orbit: {name} is undefined in deep space; give a mean motion above 0")
