"""Keep-out zones. A zone is a convex set about the origin: its norm is 1 on the surface, below 1 inside.

What a shape is to kernels stands in `shapes`; here are the objects that users make.
"""

from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations, product
from math import sqrt
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, numbers
from closeform.zones.shapes import BALL, CUBE, CYLINDER, FACES

CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))
LEADING = {BALL: 3, CYLINDER: 2}  # axes of the round part of a shape; the rest is flat
CORNER = {BALL: 1.0, CUBE: sqrt(3.0), CYLINDER: sqrt(2.0)}  # how far the farthest point of a unit shape is
ROUNDING = 1e-14  # relative: what is left of a direction that faces make up
SAME = 1e-12  # relative: normals that differ by less span nothing


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


def _directions(name: str, value: ArrayLike) -> Floats:
    where = numbers(name, value)
    if where.shape[-1:] != (3,):
        raise ValueError(f"{name}: expected shape (..., 3), got {where.shape}")
    return where


@dataclass(frozen=True, eq=False)
class Zone:
    """The set of relative positions r, in m, where the largest part of `shape` at M r is at most 1.

    `matrix` M (3, 3) in 1/m takes r to zone coordinates q, where a BALL is |q| <= 1, a CUBE
    max|q_i| <= 1, a CYLINDER max(hypot(q_0, q_1), |q_2|) <= 1 and FACES are f_k . q <= 1 for
    each row f_k of `faces` (F, 3).  Made by `Sphere`, `Ellipsoid`, `Box`, `Cylinder`, `HalfSpaces`.

    A zone is that *around* a craft: r is the position of the other one less its own.  All but
    `HalfSpaces` are symmetric, so that who is who does not matter.
    """

    shape: int
    matrix: Floats
    faces: Floats = field(default_factory=lambda: np.empty((0, 3)))

    def __post_init__(self) -> None:
        object.__setattr__(self, "matrix", np.array(self.matrix, dtype=float, order="C"))
        object.__setattr__(self, "faces", np.array(self.faces, dtype=float, order="C"))

    @property
    def form(self) -> tuple[int, Floats, Floats]:
        """The zone as kernels take it, of numba's type `shapes.FORM`."""
        return self.shape, self.matrix, self.faces

    @property
    def symmetric(self) -> bool:
        """Whether r is in the zone where -r is."""
        return self.shape != FACES

    def norm(self, position: ArrayLike) -> Any:
        """Norm of `position` (..., 3) in m: shape (...), <= 1 inside.  Raises ValueError for other shapes.

        Of half-spaces it is negative where every face falls away, as far behind a single one.
        """
        return scaled_norm(self, _directions("position", position) @ self.matrix.T)

    def enlarged(self, factor: float) -> "Zone":
        """The same shape, `factor` times as large.  Raises ValueError unless that is positive."""
        return Zone(self.shape, self.matrix / float(_lengths("factor", factor, ())), self.faces)

    @cached_property
    def radius(self) -> float:
        """Of a ball in m about the origin that holds the zone; inf for one without end."""
        if self.shape == FACES:
            return float(np.linalg.norm(self.extents))
        return float(CORNER[self.shape] / np.linalg.svd(self.matrix, compute_uv=False)[-1])

    @property
    def mirrored(self) -> "Zone":
        """The zone of -r: as the other craft of a pair sees it.  Itself where it is symmetric."""
        return self if self.symmetric else Zone(self.shape, self.matrix, -self.faces)

    def support(self, direction: ArrayLike) -> Any:
        """Greatest d . r over the zone for `direction` d (..., 3): shape (...), in m for unit vectors.

        inf where the zone is unbounded that way.  Raises ValueError for other shapes.
        """
        d = _directions("direction", direction) @ np.linalg.inv(self.matrix)
        if self.shape == FACES:
            return self._support_of_faces(d)
        if self.shape == CUBE:
            return np.abs(d).sum(axis=-1)
        if self.shape == BALL:
            return np.sqrt((d * d).sum(axis=-1))
        return np.sqrt((d[..., :2] ** 2).sum(axis=-1)) + np.abs(d[..., 2])

    def _support_of_faces(self, d: Floats) -> Any:
        """Least sum of l >= 0 with sum l_k f_k = d: some three faces or fewer suffice (duality)."""
        least = np.full(d.shape[:-1], np.inf)
        size = np.abs(d).sum(axis=-1)
        for some, inverse in self._bases:
            weights, left = np.zeros(()), -d[..., None, :]
            for _ in range(2):  # once more, so that what is left of d is rounding, or not of these faces
                weights = weights - np.einsum("ski,...si->...sk", inverse, left)
                left = np.einsum("...sk,ski->...si", weights, self.faces[some]) - d[..., None, :]
            good = (weights >= -SAME * np.abs(weights).sum(axis=-1, keepdims=True)).all(axis=-1)
            terms = np.einsum("...sk,sk->...s", np.abs(weights), np.abs(self.faces[some]).sum(axis=-1))
            good &= np.abs(left).sum(axis=-1) <= ROUNDING * (terms + size[..., None])
            least = np.minimum(least, np.where(good, weights.sum(axis=-1), np.inf).min(axis=-1))
        return np.where(size > 0.0, least, 0.0)[()]

    @cached_property
    def _bases(self) -> list[tuple[Any, Floats]]:
        """Sets of one, two and three independent faces (S, k), and what gives their weights (S, k, 3)."""
        found: list[tuple[Any, Floats]] = []
        for k in (1, 2, 3):
            some = np.array(list(combinations(range(len(self.faces)), k)), dtype=np.int64).reshape(-1, k)
            rows = self.faces[some]
            sizes = np.linalg.svd(
                rows / np.linalg.norm(rows, axis=2, keepdims=True), compute_uv=False, full_matrices=False
            )
            some = some[sizes[:, -1] > 1e-9]
            if len(some):
                inverse: Any = np.linalg.pinv(self.faces[some].transpose(0, 2, 1))
                found.append((some, inverse))
        return found

    @property
    def bounded(self) -> bool:
        """Whether the zone ends in every direction."""
        return bool(np.isfinite(self.extents).all())

    @property
    def vertices(self) -> Floats:
        """Corners (V, 3) in m of a box or of half-spaces, as far as they have any; none of round shapes."""
        half_axes = np.linalg.inv(self.matrix)
        if self.shape != FACES:
            return np.asarray(CORNERS[: 8 * (self.shape == CUBE)] @ half_axes.T)
        corners = np.concatenate(
            [np.empty((0, 3)), *(inverse.sum(axis=1) for some, inverse in self._bases if some.shape[1] == 3)]
        )
        kept = corners[(corners @ self.faces.T <= 1.0 + 1e-9).all(axis=1)]
        return np.asarray(np.unique(kept.round(12), axis=0) @ half_axes.T)

    @property
    def extents(self) -> Floats:
        """Half-widths (3,) in m of the smallest box along x, y, z about the origin that holds the zone.

        inf where it is unbounded.  For an ellipsoid the roots of the diagonal of P^-1.   # theory 3
        """
        ways = np.eye(3)
        widths: Floats = np.maximum(self.support(ways), self.support(-ways))
        return widths


class Box(Zone):
    """Box with `half_widths` (3,) in m; `axes` rows are its own axes in the path's frame.

    Raises ValueError for lengths that are not positive or axes that are not orthonormal.
    """

    def __init__(self, half_widths: ArrayLike, axes: ArrayLike | None = None) -> None:
        lengths = _lengths("half_widths", half_widths, (3,))
        super().__init__(CUBE, _rotation(axes) / lengths[:, None])


class Ellipsoid(Zone):
    """Ellipsoid with `semi_axes` (3,) in m; `axes` rows are its own axes in the path's frame.

    Raises ValueError for lengths that are not positive or axes that are not orthonormal.
    """

    def __init__(self, semi_axes: ArrayLike, axes: ArrayLike | None = None) -> None:
        lengths = _lengths("semi_axes", semi_axes, (3,))
        super().__init__(BALL, _rotation(axes) / lengths[:, None])

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


def scaled_norm(zone: Zone, q: Floats) -> Any:
    """Norm of positions (..., 3) in zone coordinates, the zone's matrix times those in m."""
    if zone.shape == FACES:
        return (q @ zone.faces.T).max(axis=-1)
    rounded = LEADING.get(zone.shape, 0)
    flat = np.abs(q[..., rounded:]).max(axis=-1, initial=0.0)
    if not rounded:
        return flat
    return np.maximum(np.sqrt((q[..., :rounded] ** 2).sum(axis=-1)), flat)


class Sphere(Zone):
    """Sphere of `radius` in m. Raises ValueError unless it is positive and finite."""

    def __init__(self, radius: float) -> None:
        super().__init__(BALL, np.eye(3) / _lengths("radius", radius, ()))


class Cylinder(Zone):
    """Finite cylinder of `radius` and `half_length` in m about `axis` (3,), a direction in the path's frame.

    It ends flat at half_length on either side: a tank, a sweep of a boom, an approach corridor.

    Raises ValueError for lengths that are not positive and finite, or an axis without a direction.
    """

    def __init__(self, radius: float, half_length: float, axis: ArrayLike = (1.0, 0.0, 0.0)) -> None:
        wide, long = _lengths("radius", radius, ()), _lengths("half_length", half_length, ())
        way = numbers("axis", axis)
        if way.shape != (3,):
            raise ValueError(f"axis: expected shape (3,), got {way.shape}")
        if not np.isfinite(way).all() or not way.any():
            raise ValueError(f"axis: must be finite and not zero, got {way.tolist()}")
        super().__init__(CYLINDER, _about(way) / np.array([[wide], [wide], [long]]))


def _about(axis: Floats) -> Floats:
    """Orthonormal rows, the last along `axis`; the others along x, y, z where it is."""
    x, y, z = way = axis / np.abs(axis).max() / sqrt(sum((axis / np.abs(axis).max()) ** 2))
    sign = 1.0 if z >= 0.0 else -1.0
    u = -1.0 / (sign + z)  # Frisvad, without his singular direction (Duff et al. 2017)
    w = x * y * u
    return np.array([[1.0 + sign * x * x * u, sign * w, -sign * x], [w, sign + y * y * u, -y], way])


class HalfSpaces(Zone):
    """All r with n_k . r <= b_k: `normals` n (F, 3), of any length, and `offsets` b (F,) in m.

    One face is a plane that is not to be crossed, two are a wedge or a slab, more a corridor or
    any convex body with flat faces; it may be unbounded.  It is *not* symmetric: it belongs to the
    craft that it is around, and r is the position of the other one less its own.

    Raises ValueError for normals without a direction, offsets that are not positive and finite,
    or numbers of them that differ.
    """

    def __init__(self, normals: ArrayLike, offsets: ArrayLike) -> None:
        ways = numbers("normals", normals)
        if ways.ndim != 2 or ways.shape[1] != 3 or not len(ways):
            raise ValueError(f"normals: expected shape (F, 3), one row for each face, got {ways.shape}")
        if not (np.isfinite(ways).all() and ways.any(axis=1).all()):
            raise ValueError(f"normals: must be finite and not zero, got {ways.tolist()}")
        lengths = _lengths("offsets", offsets, (len(ways),))
        ways = ways / np.abs(ways).max(axis=1, keepdims=True)
        ways = ways / np.linalg.norm(ways, axis=1, keepdims=True)
        least = lengths.min()  # the ball that touches the nearest face is the unit of its coordinates
        super().__init__(FACES, np.eye(3) / least, ways * (least / lengths)[:, None])


def enclosing(zone: Zone) -> Floats:
    """Matrix E (3, 3) in 1/m with |E r| <= 1 for every r in the zone: an ellipsoid that holds it."""
    ratios = {BALL: (1.0, 1.0), CUBE: (3.0, 3.0), CYLINDER: (1.5, 3.0)}  # of its axes, squared
    if zone.shape != FACES:
        side, end = ratios[zone.shape]
        return np.asarray(zone.matrix / np.sqrt([[side], [side], [end]]))
    widths = zone.extents  # a direction without an end does not count
    return np.asarray(np.diag(1.0 / widths) / np.sqrt(max(1, np.isfinite(widths).sum())))
