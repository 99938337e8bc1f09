"""Conversion between inertial states and states in the rotating Hill frame of a chief, exactly.

The axes of the Hill frame: x radial outward, y in the orbital plane at right angles to it in the
sense of the motion, z along the orbit normal (RTN, RSW, RIC; the `LVLH` of CCSDS is another).  It
turns at the chief's true rate h / r^2 about z, also on an eccentric orbit.  A force f_z across the
chief's orbital plane also turns it about x, at r f_z / h.  Inertial states do not contain that
force, so this rate is included only where the chief's `acceleration` is given.  Earth's oblateness makes it
up to 2e-6 rad/s in low orbit (5e-8 on a nearly polar one).  Without it, at 1 km along-track the velocity
along z has an error of 2 mm/s, and at 1 km cross-track the along-track velocity has one, which makes
spacecraft drift apart by some 9 m for each kilometre and orbit.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, broadcast, shown
from closeform.motion.elements.mean_motion import checked

AlongTrack = Literal["straight", "arc"]
STEPS = np.array([100.0, 100.0, 100.0, 1.0, 1.0, 1.0])  # m, m/s: steps of central differences


def relative_from_inertial(
    chief: ArrayLike,
    deputy: ArrayLike,
    along_track: AlongTrack = "straight",
    radius: ArrayLike | None = None,
    acceleration: ArrayLike | None = None,
) -> Floats:
    """Return the state of a deputy in the rotating Hill frame of a chief, exactly.

    Parameters
    ----------
    chief : array_like of shape (..., 6) [m, m/s]
        Inertial state in a frame centred on the body that both orbit.
    deputy : array_like of shape (..., 6) [m, m/s]
        Inertial state in the same frame at the same epoch; shapes broadcast.
    along_track : "straight" or "arc", default "straight"
        "straight": the Cartesian components of the difference.  "arc": x is the difference of the
        distances from the body's centre, y and z are the angles of the deputy ahead of the chief, in its
        plane and out of it, times `radius`.  Velocities are the rates of these.
    radius : array_like of shape (...) [m], optional
        Constant radius of the circle of "arc"; by default the chief's own distance, which varies.
    acceleration : array_like of shape (..., 3) [m/s^2], optional
        Acceleration of the chief in the same inertial frame; its cross-track part also turns the axes.

    Returns
    -------
    array of shape (..., 6) [m, m/s]
        State in the chief's Hill frame: x radial outward, y along the motion, z along the orbit normal.

    Raises
    ------
    ValueError
        If shapes do not fit, a value is not finite, the chief has no orbital plane, `along_track` is unknown,
        `radius` is not positive or given with "straight", or the deputy of an "arc" is on the axis of the
        chief's orbit, where the along-track angle is undefined.

    Notes
    -----
    With arcs, Hill's equations hold to separations of many kilometres.  With the chief's semi-major
    axis as `radius`, a spacecraft ahead on the same orbit obeys them to second order in the eccentricity.

    References
    ----------
    docs/models.md and docs/ephemerides.md.
    """
    axes, distance, climb, turn = turning_axes(checked("chief", chief, last=6))
    roll = _roll(axes, distance, turn, acceleration)
    inertial = checked("deputy", deputy, last=6)
    circle, growth = _circle(along_track, radius, distance, climb)
    broadcast(chief=np.shape(distance), deputy=inertial.shape[:-1], radius=np.shape(circle))
    x, y, z = np.moveaxis(np.einsum("...ij,...j->...i", axes, inertial[..., :3]), -1, 0)
    vx, vy, vz = np.moveaxis(np.einsum("...ij,...j->...i", axes, inertial[..., 3:]), -1, 0)
    vx, vy, vz = vx + turn * y, vy - turn * x + roll * z, vz - roll * y  # seen from the turning axes
    if along_track == "straight":
        parts = (x - distance, y, z, vx - climb, vy, vz)
        return np.stack(np.broadcast_arrays(*parts), axis=-1)
    flat = np.hypot(x, y)
    if not (flat > 0.0).all():
        raise ValueError("deputy: lies on the axis of the chief's orbit; use along_track='straight'")
    outward = (x * vx + y * vy) / flat
    full = np.hypot(flat, z)
    ahead, above = np.arctan2(y, x), np.arctan2(z, flat)
    ahead_rate, above_rate = (x * vy - y * vx) / flat**2, (vz * flat - z * outward) / full**2
    position = (full - distance, circle * ahead, circle * above)
    velocity = (
        (flat * outward + z * vz) / full - climb,
        circle * ahead_rate + growth * ahead,
        circle * above_rate + growth * above,
    )
    return np.stack(np.broadcast_arrays(*position, *velocity), axis=-1)


def inertial_from_relative(
    chief: ArrayLike,
    relative: ArrayLike,
    along_track: AlongTrack = "straight",
    radius: ArrayLike | None = None,
    acceleration: ArrayLike | None = None,
) -> Floats:
    """Return the inertial state of a deputy: the inverse of `relative_from_inertial`.

    Parameters
    ----------
    chief : array_like of shape (..., 6) [m, m/s]
        Inertial state in a frame centred on the body.
    relative : array_like of shape (..., 6) [m, m/s]
        State of the deputy in the chief's Hill frame; shapes broadcast.
    along_track : "straight" or "arc", default "straight"
        The convention of `relative`.
    radius : array_like of shape (...) [m], optional
        The value with which `relative` was computed.
    acceleration : array_like of shape (..., 3) [m/s^2], optional
        Acceleration of the chief in the same inertial frame, as for `relative`.

    Returns
    -------
    array of shape (..., 6) [m, m/s]
        State in the chief's inertial frame.

    Raises
    ------
    ValueError
        If shapes do not fit, a value is not finite, the chief has no orbital plane, `along_track` is unknown,
        or `radius` is not positive or given with "straight".

    References
    ----------
    docs/models.md.
    """
    axes, distance, climb, turn = turning_axes(checked("chief", chief, last=6))
    roll = _roll(axes, distance, turn, acceleration)
    circle, growth = _circle(along_track, radius, distance, climb)
    states = checked("relative", relative, last=6)
    broadcast(chief=np.shape(distance), relative=states.shape[:-1], radius=np.shape(circle))
    x, y, z, vx, vy, vz = np.moveaxis(states, -1, 0)
    x, vx = distance + x, climb + vx
    if along_track == "arc":
        full, full_rate, ahead, above = x, vx, y / circle, z / circle
        ahead_rate, above_rate = (vy - growth * ahead) / circle, (vz - growth * above) / circle
        flat, z = full * np.cos(above), full * np.sin(above)
        outward = full_rate * np.cos(above) - z * above_rate
        vz = full_rate * np.sin(above) + flat * above_rate
        x, y = flat * np.cos(ahead), flat * np.sin(ahead)
        vx = outward * np.cos(ahead) - y * ahead_rate
        vy = outward * np.sin(ahead) + x * ahead_rate
    vx, vy, vz = vx - turn * y, vy + turn * x - roll * z, vz + roll * y
    position = np.stack(np.broadcast_arrays(x, y, z), axis=-1)
    velocity = np.stack(np.broadcast_arrays(vx, vy, vz), axis=-1)
    inertial = [np.einsum("...ji,...j->...i", axes, part) for part in (position, velocity)]
    return np.concatenate(np.broadcast_arrays(*inertial), axis=-1)


def relative_jacobian(
    chief: ArrayLike, deputy: ArrayLike, along_track: AlongTrack = "straight", radius: ArrayLike | None = None
) -> Floats:
    """Return the Jacobian (..., 6, 6) of `relative_from_inertial` by the deputy's inertial state.

    The chief's frame is treated as constant. Central differences: accurate to a relative 1e-9 in an orbit of
    the Earth.
    """
    steps = np.diag(STEPS)
    known, there = (np.asarray(state, dtype=float)[..., None, :] for state in (chief, deputy))
    ahead, behind = (
        relative_from_inertial(known, there + step, along_track, radius) for step in (steps, -steps)
    )
    return np.swapaxes(ahead - behind, -1, -2) / (2.0 * STEPS)


def turning_axes(chief: Floats) -> tuple[Floats, Any, Any, Any]:
    """Return axes (..., 3, 3) as rows, distance [m], its rate [m/s] and the turn rate h / r^2 [rad/s]."""
    position, velocity = chief[..., :3], chief[..., 3:]
    momentum = np.cross(position, velocity)
    r, h = np.linalg.norm(position, axis=-1), np.linalg.norm(momentum, axis=-1)
    if not (h > 0.0).all():
        raise ValueError("chief: position and velocity must span an orbital plane")
    radial, normal = position / r[..., None], momentum / h[..., None]
    axes = np.stack([radial, np.cross(normal, radial), normal], axis=-2)
    return axes, r, (radial * velocity).sum(-1), h / r**2


def _roll(axes: Floats, distance: Any, turn: Any, acceleration: ArrayLike | None) -> Any:
    """Return the rate [rad/s] at which a cross-track force turns the axes about the radial one: r f_z / h."""
    if acceleration is None:
        return 0.0
    felt = checked("acceleration", acceleration, last=3)
    broadcast(chief=np.shape(distance), acceleration=felt.shape[:-1])
    return np.einsum("...j,...j->...", axes[..., 2, :], felt) / (distance * turn)


def _circle(along_track: str, radius: ArrayLike | None, distance: Any, climb: Any) -> tuple[Any, Any]:
    """Return the radius [m] on which arcs are measured, and its rate [m/s]."""
    if not isinstance(along_track, str) or along_track not in ("straight", "arc"):
        raise ValueError(f'along_track: must be "straight" or "arc", got {shown(along_track)}')
    if radius is None:
        return distance, climb
    if along_track == "straight":
        raise ValueError('radius: only used with along_track="arc"')
    return checked("radius", radius, positive=True), 0.0
