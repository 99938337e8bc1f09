"""S04's proof that its modified search finds every pair: regions, crossings, and the case of a pair.

S04 describes craft j, of group B, relative to craft i, of group A, in a non-rotating frame: n3 = +z, away
from the sun, and n1 the boresight of A at the start of an mOPS. An in-plane search does not cover the
complementary cones about +z and -z, of half-angle 90 deg minus the sensor's. The cones with their surface
are the complementary-cone volume, and the rest is the in-plane volume.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import copysign, hypot, inf, sin, sqrt
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from closeform.arrays import Floats, instance, numbers, whole
from closeform.result import Result
from closeform.search.leg import Group
from closeform.search.lock_times import lock_times
from closeform.search.schedule import Search

Volume = Literal["in-plane", "complementary cone"]

LONGEST = 1e300  # s


@dataclass(frozen=True, repr=False)
class TheoremCase(Result):
    """Case of S04's theorem 2 that applies to a pair, and the guarantee of the theorem.

    Attributes
    ----------
    label : str
        S04's number of the case, "1" to "3.b.ii.B".
    volume : "in-plane" or "complementary cone"
        Volume in which the craft of B starts, seen from that of A.
    changes : tuple of float [s]
        Times at which it changes the volume, for the whole future and not only during the search.
    time : float [s]
        Time of the first lock.
    phase : tuple of str and int
        Name and round of the phase of the first lock.
    latest : float [s]
        Time by which the theorem guarantees a lock.
    latest_phase : tuple of str and int
        Name and round of the phase that ends at that time.
    """

    label: str
    volume: Volume
    changes: tuple[float, ...]
    time: float
    phase: tuple[str, int]
    latest: float
    latest_phase: tuple[str, int]


def cone_regions(search: Search, position: ArrayLike, mops: int = 1) -> NDArray[np.bool_]:
    """Return in which of the regions I to IV of the complementary cones a craft of B is, seen from A.

    Parameters
    ----------
    search : Search
        Search with that mOPS.
    position : array_like of shape (..., 3) [m]
        Relative position, B minus A, in the inertial frame.
    mops : int, default 1
        The mOPS that defines n1: the first, with n1 = -x, or the second, with n1 = +x.

    Returns
    -------
    array of bool of shape (..., 4)
        True for each region that contains it: none in the in-plane volume, two on the plane between regions,
        which are closed.

    Raises
    ------
    ValueError
        If `position` is of another shape, or the search has no such mOPS.

    References
    ----------
    S04 (Scharf, Ploen, Hadaegh and Sohl 2004) figure 5.
    """
    instance("search", search, Search)
    where = numbers("position", position)
    if where.shape[-1:] != (3,):
        raise ValueError(f"position: expected shape (..., 3), got {where.shape}")
    above = where[..., 2]
    along = where @ search.boresight(_start(search, mops))
    radius = np.hypot(where[..., 0], where[..., 1])
    inside = search.sensor.cosine * np.abs(above) >= sin(search.sensor.half_angle) * radius
    inside &= search.sensor.cosine > 0.0  # otherwise there are no complementary cones
    quadrants = [
        (above <= 0.0) & (along >= 0.0),
        (above >= 0.0) & (along >= 0.0),
        (above >= 0.0) & (along <= 0.0),
        (above <= 0.0) & (along <= 0.0),
    ]
    return inside[..., None] & np.stack(quadrants, axis=-1)


def regions_searched(search: Search, mops: int = 1, group: Group = "A") -> tuple[tuple[float, int], ...]:
    """Return the times at which a craft's cone contains a whole region of the complementary cones.

    Parameters
    ----------
    search : Search
        Search with that mOPS.
    mops : int, default 1
        Number of the mOPS.
    group : "A" or "B", default "A"
        Group of the craft.

    Returns
    -------
    tuple of tuple of float [s] and int
        Times with the number of the region, from 1 for I to 4 for IV. Both groups number the regions in the
        frame of A, see `cone_regions`.

    Raises
    ------
    ValueError
        If the search has no such mOPS, or `group` is neither "A" nor "B".

    Notes
    -----
    S04 gives I, II, III, IV, I, II for A, and III, IV, I, II, III, IV for B. Here the order follows from the
    legs of the search: the tips are full between two legs of an mOPS.

    References
    ----------
    S04 (Scharf, Ploen, Hadaegh and Sohl 2004) figures 4 and 5.
    """
    start = _start(instance("search", search, Search), mops)
    if search.sensor.cosine <= 0.0:
        return ()  # no cones to search
    ends = np.array([leg.end for leg in search.legs if (leg.phase, leg.round) == ("mOPS", mops)][:-1])
    boresights = search.boresight(ends, group)
    ahead = boresights @ search.boresight(start) >= 0.0
    region = np.where(ahead, np.where(boresights[:, 2] <= 0.0, 1, 2), np.where(boresights[:, 2] >= 0.0, 3, 4))
    return tuple((float(t), int(number)) for t, number in zip(ends, region, strict=True))


def cone_crossings(search: Search, position: ArrayLike, velocity: ArrayLike) -> tuple[float, ...] | None:
    """Return the times at which a craft of B crosses the surface of the complementary cones of one of A.

    Parameters
    ----------
    search : Search
        Search whose sensor defines the cones.
    position : array_like of shape (3,) [m]
        Relative position, B minus A, at time 0, in the inertial frame.
    velocity : array_like of shape (3,) [m/s]
        Relative velocity, B minus A, in the inertial frame.

    Returns
    -------
    tuple of float, or None [s]
        No, one or two times of either sign, in order; None if the whole line lies in the surface.

    Raises
    ------
    ValueError
        If shapes do not match, a number is not finite, or the two craft are at the same position.

    References
    ----------
    S04 (Scharf, Ploen, Hadaegh and Sohl 2004) lemma 3 and eq. 5.
    """
    instance("search", search, Search)
    meetings = _meetings(*_surface(search, *one_pair(position, velocity)))
    return None if meetings is None else tuple(t for t, _ in meetings)


def theorem_case(search: Search, position: ArrayLike, velocity: ArrayLike) -> TheoremCase:
    """Return the case of S04's theorem 2 for a pair, with its lock and the guaranteed time.

    Parameters
    ----------
    search : Search
        Search of `Search.modified`, with sensors at the centres of mass and of unlimited range.
    position : array_like of shape (3,) [m]
        Relative position, B minus A, at the start of the search, in the inertial frame.
    velocity : array_like of shape (3,) [m/s]
        Relative velocity, B minus A, in the inertial frame.

    Returns
    -------
    TheoremCase
        The case, with the lock that this package finds.

    Raises
    ------
    ValueError
        If the theorem does not cover the search, the craft start at the same position or collide, shapes do
        not match, or a number is not finite.

    References
    ----------
    S04 (Scharf, Ploen, Hadaegh and Sohl 2004) section IV, theorem 2.
    """
    _assumptions(search)
    r, v = one_pair(position, velocity)
    if not np.cross(r, v).any() and r @ v < 0.0:
        when = sqrt((r @ r) / (v @ v))
        raise ValueError(f"velocity: the craft collide at {when:g} s, which S04's assumption A2 excludes")
    changes, volume = _changes(search, r, v)
    locks = lock_times(search, r, v)
    if locks.leg[0] < 0:
        raise RuntimeError("the pair never locks, which contradicts the theorem; please report this")
    time, leg = float(locks.time[0]), search.legs[int(locks.leg[0])]
    label, latest_phase = _case(volume, changes, time)
    ends = {(name, number): end for name, number, _, end in search.phases}
    return TheoremCase(label, volume, changes, time, (leg.phase, leg.round), ends[latest_phase], latest_phase)


def _case(volume: Volume, changes: tuple[float, ...], time: float) -> tuple[str, tuple[str, int]]:
    """Return label and guarantee from the volumes and the time of the lock.

    S04 section IV, proof of theorem 2.
    """
    in_plane = volume == "in-plane"
    if not changes:
        return "1", ("IPS" if in_plane else "mOPS", 1)
    name = f"{len(changes) + 1}.{'a' if in_plane else 'b'}"
    if time <= changes[0]:
        return f"{name}.i", ("IPS" if in_plane else "mOPS", 1)
    if name == "2.a":
        return "2.a.ii", ("mOPS", 1)
    if name == "3.b":
        return ("3.b.ii.A", ("IPS", 2)) if time <= changes[1] else ("3.b.ii.B", ("mOPS", 2))
    return f"{name}.ii", ("IPS", 2)


def _changes(search: Search, r: Floats, v: Floats) -> tuple[tuple[float, ...], Volume]:
    """Return the times t >= 0 at which the volume changes, and the volume at the start.

    A touch of the surface from outside is a visit to the cone of no duration: two changes at the same time.
    """
    if search.sensor.cosine <= 0.0:
        return (), "in-plane"
    a, b, c, discriminant = _surface(search, r, v)
    inside = c >= 0.0
    start: Volume = "complementary cone" if inside else "in-plane"
    changes: list[float] = []
    for t, direction in _meetings(a, b, c, discriminant) or []:
        if t >= 0.0 and direction >= 0 and not inside:
            changes.append(t)
            inside = True
            if direction == 0 and a < 0.0:
                changes.append(t)
                inside = False
        elif t >= 0.0 and inside and (direction < 0 or (direction == 0 and a < 0.0)):
            changes.append(t)
            inside = False
    return tuple(changes), start


def _surface(search: Search, r: Floats, v: Floats) -> tuple[float, float, float, float]:
    """Return a, b, c of a t^2 + 2 b t + c, negative outside the cones, and its discriminant b^2 - a c.

    The quadratic is z^2 - x^2 - y^2 in lengths scaled so that the cones are right-angled.  # S04 eq. 5
    """
    cosine, sine = search.sensor.cosine, sin(search.sensor.half_angle)
    x, y, z = sine * float(r[0]), sine * float(r[1]), cosine * float(r[2])
    vx, vy, vz = sine * float(v[0]), sine * float(v[1]), cosine * float(v[2])
    radius, speed = hypot(x, y), hypot(vx, vy)
    a = (abs(vz) - speed) * (abs(vz) + speed)
    b = z * vz - x * vx - y * vy
    c = (abs(z) - radius) * (abs(z) + radius)
    # Lagrange's identity reduces b^2 - a c to moments of the line, without cancellation
    tilt, swirl = hypot(z * vx - x * vz, z * vy - y * vz), abs(x * vy - y * vx)
    discriminant = (tilt - swirl) * (tilt + swirl)
    return a, b, c, max(discriminant, b * b) if a * c <= 0.0 else discriminant


def _meetings(a: float, b: float, c: float, discriminant: float) -> list[tuple[float, int]] | None:
    """Return the roots in order, each with 1 for an entry into the cones, -1 for an exit, 0 for a touch."""
    if a == b == c == 0.0:
        return None
    if discriminant < 0.0 or a == b == 0.0:
        return []
    if discriminant == 0.0:
        return [(-b / a, 0)]
    far = -(b + copysign(sqrt(discriminant), b))
    if a == 0.0 or abs(far) >= abs(a) * LONGEST:  # the other root lies beyond all times
        return [(c / far, 1 if b > 0.0 else -1)]
    first, second = sorted((far / a, c / far))
    return [(first, -1), (second, 1)] if a > 0.0 else [(first, 1), (second, -1)]


def _assumptions(search: Search) -> None:
    """Raise ValueError unless theorem 2 covers the search.

    S04 section II.A, A3 to A6.
    """
    if [name for name, *_ in instance("search", search, Search).phases][:4] != ["IPS", "mOPS", "IPS", "mOPS"]:
        raise ValueError("search: the theorem covers only Search.modified (IPS, mOPS, IPS, mOPS)")
    offset, reach = search.sensor.offset, search.sensor.range
    if offset > 0.0:
        raise ValueError(
            f"search: the theorem requires sensors at the centre of mass, got an offset of {offset:g} m"
        )
    if reach < inf:
        raise ValueError(f"search: the theorem requires sensors of unlimited range, got {reach:g} m")


def _start(search: Search, mops: int) -> float:
    """Return the start time of an mOPS."""
    whole("mops", mops)
    for name, number, start, _ in search.phases:
        if (name, number) == ("mOPS", mops):
            return start
    raise ValueError(f"mops: this search has no mOPS {mops!r}")


def one_pair(position: ArrayLike, velocity: ArrayLike) -> tuple[Floats, Floats]:
    """Return the position and velocity of one pair of craft after a check."""
    r, v = numbers("position", position), numbers("velocity", velocity)
    for name, vector in (("position", r), ("velocity", v)):
        if vector.shape != (3,):
            raise ValueError(f"{name}: expected shape (3,), got {vector.shape}")
        if not np.isfinite(vector).all():
            raise ValueError(f"{name}: must be finite, got {vector.tolist()}")
    if not r.any():
        raise ValueError("position: the two craft are at the same position")
    return r, v
