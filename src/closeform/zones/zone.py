"""Keep-out zones. A zone is the unit ball of a norm: 1 on its surface, below 1 inside."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, numbers


def _lengths(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Floats:
    lengths = numbers(name, value)
    if lengths.shape != shape:
        raise ValueError(f"{name}: expected shape {shape}, got {lengths.shape}")
    if not (np.isfinite(lengths).all() and (lengths > 0).all()):
        raise ValueError(f"{name}: must be positive and finite, got {lengths.tolist()}")
    return lengths


def _rotation(axes: ArrayLike | None) -> Floats:
    if axes is None:
        return np.eye(3)
    rows = numbers("axes", axes)
    if rows.shape != (3, 3) or not np.allclose(rows @ rows.T, np.eye(3), atol=1e-9):
        raise ValueError("axes: expected three orthonormal rows, the zone's own axes in the path's frame")
    return rows


@dataclass(frozen=True, eq=False)
class Zone:
    """The set where max|M r| <= 1 (`box`) or |M r| <= 1, with `matrix` M (3, 3) in 1/m.

    Made by `Box`, `Ellipsoid` and `Sphere`.
    """

    matrix: Floats
    box: bool

    def __post_init__(self) -> None:
        object.__setattr__(self, "matrix", np.array(self.matrix, dtype=float, order="C"))

    def norm(self, position: ArrayLike) -> Any:
        """Norm of `position` (..., 3) in m: shape (...), <= 1 inside.  Raises ValueError for other shapes."""
        where = numbers("position", position)
        if where.shape[-1:] != (3,):
            raise ValueError(f"position: expected shape (..., 3), got {where.shape}")
        inside = np.abs(where @ self.matrix.T)
        return inside.max(axis=-1) if self.box else np.sqrt((inside * inside).sum(axis=-1))

    def enlarged(self, factor: float) -> "Zone":
        """The same shape, `factor` times as large.  Raises ValueError unless that is positive."""
        if not (np.isfinite(factor) and factor > 0):
            raise ValueError(f"factor: must be positive and finite, got {factor}")
        return Zone(self.matrix / factor, self.box)

    @property
    def extents(self) -> Floats:
        """Half-widths (3,) in m of the smallest box along x, y, z that holds the zone.

        For an ellipsoid the roots of the diagonal of P^-1.                     # theory 3
        """
        half_axes = np.linalg.inv(self.matrix)
        widths: Floats = np.abs(half_axes).sum(axis=1) if self.box else np.sqrt((half_axes**2).sum(axis=1))
        return widths


class Box(Zone):
    """Box with `half_widths` (3,) in m; `axes` rows are its own axes in the path's frame.

    Raises ValueError for lengths that are not positive or axes that are not orthonormal.
    """

    def __init__(self, half_widths: ArrayLike, axes: ArrayLike | None = None) -> None:
        lengths = _lengths("half_widths", half_widths, (3,))
        super().__init__(_rotation(axes) / lengths[:, None], True)


class Ellipsoid(Zone):
    """Ellipsoid with `semi_axes` (3,) in m; `axes` rows are its own axes in the path's frame.

    Raises ValueError for lengths that are not positive or axes that are not orthonormal.
    """

    def __init__(self, semi_axes: ArrayLike, axes: ArrayLike | None = None) -> None:
        lengths = _lengths("semi_axes", semi_axes, (3,))
        super().__init__(_rotation(axes) / lengths[:, None], False)

    @classmethod
    def from_covariance(cls, covariance: ArrayLike, sigmas: float) -> Self:
        """Ellipsoid of `sigmas` standard deviations of a position `covariance` (3, 3) in m^2.

        P = (sigmas^2 covariance)^-1.  Raises ValueError unless it is symmetric positive definite.
        """
        matrix = numbers("covariance", covariance)
        if matrix.shape != (3, 3) or not np.isfinite(matrix).all() or not np.allclose(matrix, matrix.T):
            raise ValueError("covariance: expected a finite symmetric (3, 3) matrix in m^2")
        sigmas = float(_lengths("sigmas", sigmas, ()))
        variances, axes = np.linalg.eigh(matrix)
        if variances[0] <= 1e-15 * variances[-1]:
            raise ValueError(
                f"covariance: must be positive definite, its least variance is {variances[0]:g} m^2"
            )
        return cls(sigmas * np.sqrt(variances), axes.T)


class Sphere(Zone):
    """Sphere of `radius` in m. Raises ValueError unless it is positive and finite."""

    def __init__(self, radius: float) -> None:
        super().__init__(np.eye(3) / _lengths("radius", radius, ()), False)
