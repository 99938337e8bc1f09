"""Zones that users create: boxes, ellipsoids, spheres, cylinders and half-spaces."""

from __future__ import annotations

from math import sqrt
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, finite
from closeform.zones.shapes import BALL, CUBE, CYLINDER, FACES
from closeform.zones.zone import Zone, lengths_of, positive


def _rotation(axes: ArrayLike | None) -> Floats:
    if axes is None:
        return np.eye(3)
    rows = finite("axes", axes)
    if rows.shape != (3, 3) or not np.allclose(rows @ rows.T, np.eye(3), atol=1e-9):
        raise ValueError("axes: expected three orthonormal rows, the zone's own axes in the path's frame")
    return rows


class Box(Zone):
    """Box, centred on the spacecraft.

    Parameters
    ----------
    half_widths : array_like of shape (3,) [m]
        Half-widths along its own axes.
    axes : array_like of shape (3, 3), no unit, optional
        Own axes as orthonormal rows in the path's frame; x, y, z by default.

    Raises
    ------
    ValueError
        If a half-width is not from 1e-9 to 1e15 m, or `axes` are not orthonormal.

    References
    ----------
    docs/theory.md section 3.
    """

    def __init__(self, half_widths: ArrayLike, axes: ArrayLike | None = None) -> None:
        lengths = lengths_of("half_widths", half_widths, (3,))
        super().__init__(CUBE, _rotation(axes) / lengths[:, None])


class Ellipsoid(Zone):
    """Ellipsoid, centred on the spacecraft.

    Parameters
    ----------
    semi_axes : array_like of shape (3,) [m]
        Semi-axes along its own axes.
    axes : array_like of shape (3, 3), no unit, optional
        Own axes as orthonormal rows in the path's frame; x, y, z by default.

    Raises
    ------
    ValueError
        If a semi-axis is not from 1e-9 to 1e15 m, or `axes` are not orthonormal.

    References
    ----------
    docs/theory.md section 3.
    """

    def __init__(self, semi_axes: ArrayLike, axes: ArrayLike | None = None) -> None:
        lengths = lengths_of("semi_axes", semi_axes, (3,))
        super().__init__(BALL, _rotation(axes) / lengths[:, None])

    @classmethod
    def from_covariance(cls, covariance: ArrayLike, sigmas: float) -> Self:
        """Return the ellipsoid of `sigmas` standard deviations of a position: P = (sigmas^2 covariance)^-1.

        Parameters
        ----------
        covariance : array_like of shape (3, 3) [m^2]
            Position covariance in the path's frame; symmetric and positive definite.
        sigmas : float, no unit
            Number of standard deviations.

        Returns
        -------
        Ellipsoid
            Ellipsoid with semi-axes of `sigmas` deviations along the principal axes.

        Raises
        ------
        ValueError
            If `covariance` is not symmetric, finite and positive definite, or `sigmas` is not positive
            and finite.

        References
        ----------
        docs/theory.md section 3.
        """
        matrix = finite("covariance", covariance)
        if matrix.shape != (3, 3) or not np.allclose(matrix, matrix.T):
            raise ValueError("covariance: expected a finite symmetric (3, 3) matrix in m^2")
        sigmas = float(positive("sigmas", sigmas, ()))
        variances, axes = np.linalg.eigh(matrix)
        if variances[0] <= 1e-15 * variances[-1]:
            raise ValueError(
                f"covariance: must be positive definite, its smallest variance is {variances[0]:g} m^2"
            )
        return cls(sigmas * np.sqrt(variances), axes.T)


class Sphere(Zone):
    """Sphere, centred on the spacecraft.

    Parameters
    ----------
    radius : float [m]
        Distance to keep.

    Raises
    ------
    ValueError
        If `radius` is not from 1e-9 to 1e15 m.

    References
    ----------
    docs/theory.md section 3.
    """

    def __init__(self, radius: float) -> None:
        super().__init__(BALL, np.eye(3) / lengths_of("radius", radius, ()))


class Cylinder(Zone):
    """Cylinder with flat ends, centred on the spacecraft: a tank, the sweep of a boom, an approach corridor.

    Parameters
    ----------
    radius : float [m]
        Radius about the axis.
    half_length : float [m]
        Distance from the centre to either end.
    axis : array_like of shape (3,), no unit, default x
        Direction of the axis in the path's frame, of any length.

    Raises
    ------
    ValueError
        If a length is not from 1e-9 to 1e15 m, or `axis` is zero, not finite or of another shape.

    References
    ----------
    docs/theory.md section 3.
    """

    def __init__(self, radius: float, half_length: float, axis: ArrayLike = (1.0, 0.0, 0.0)) -> None:
        wide, long = lengths_of("radius", radius, ()), lengths_of("half_length", half_length, ())
        direction = finite("axis", axis)
        if direction.shape != (3,):
            raise ValueError(f"axis: expected shape (3,), got {direction.shape}")
        if not direction.any():
            raise ValueError("axis: must not be zero")
        super().__init__(CYLINDER, _about(direction) / np.array([[wide], [wide], [long]]))


def _about(axis: Floats) -> Floats:
    """Return orthonormal rows, the last along `axis`; if `axis` is along x, y or z, so are the others."""
    x, y, z = direction = axis / np.abs(axis).max() / sqrt(sum((axis / np.abs(axis).max()) ** 2))
    sign = 1.0 if z >= 0.0 else -1.0
    u = -1.0 / (sign + z)  # Frisvad's method without its singular direction (Duff et al. 2017)
    w = x * y * u
    return np.array([[1.0 + sign * x * x * u, sign * w, -sign * x], [w, sign + y * y * u, -y], direction])


class HalfSpaces(Zone):
    """All relative positions r with n_k . r <= b_k for every face k.

    One face is a plane that must not be crossed, two are a wedge or a slab, more are a corridor or
    any convex body with flat faces; the zone may be unbounded.  It is *not* symmetric: it belongs to the
    spacecraft that it is around, and r is the position of the other spacecraft relative to it.

    Parameters
    ----------
    normals : array_like of shape (F, 3), no unit
        Normal n_k of each face out of the zone, in the path's frame; of any length.
    offsets : array_like of shape (F,) [m]
        Distance b_k of each face from the spacecraft.

    Raises
    ------
    ValueError
        If a normal is zero or not finite, an offset is not from 1e-9 to 1e15 m, or the numbers of offsets and
        normals differ.

    References
    ----------
    docs/theory.md section 3.
    """

    def __init__(self, normals: ArrayLike, offsets: ArrayLike) -> None:
        ways = finite("normals", normals)
        if ways.ndim != 2 or ways.shape[1] != 3 or not len(ways):
            raise ValueError(f"normals: expected shape (F, 3), one row for each face, got {ways.shape}")
        if not ways.any(axis=1).all():
            raise ValueError(f"normals: must not be zero, got {ways.tolist()}")
        lengths = lengths_of("offsets", offsets, (len(ways),))
        ways = ways / np.abs(ways).max(axis=1, keepdims=True)
        ways = ways / np.linalg.norm(ways, axis=1, keepdims=True)
        least = lengths.min()  # radius of the unit ball of its coordinates: it touches the nearest face
        super().__init__(FACES, np.eye(3) / least, ways * (least / lengths)[:, None])
