"""Keep-out zones: convex sets about the origin, with a norm that is 1 on the surface and below 1 inside.

The kernels of each shape are in `shapes`; the zones that users create are in `solids`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations, product
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from closeform.arrays import Floats, finite, numbers
from closeform.zones.shapes import BALL, CUBE, CYLINDER, FACES

CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))
LEADING = {BALL: 3, CYLINDER: 2}  # axes of the round part of a shape; the other parts are flat
CORNER = {BALL: 1.0, CUBE: sqrt(3.0), CYLINDER: sqrt(2.0)}  # distance of the farthest point of a unit shape
ROUNDING = 1e-14  # relative: a smaller remainder of a direction is spanned by the faces
ON = 1.0 + 1e-9  # norm up to which the start or the end of a plan counts as inside
SAME = 1e-12  # relative: normals that differ by less are dependent
SMALLEST, LARGEST = 1e-9, 1e15  # m, lengths of a zone: squares far beyond them lose all digits


def positive(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Floats:
    """Return an argument as positive numbers of a shape; raise ValueError otherwise."""
    lengths = numbers(name, value)
    if lengths.shape != shape:
        raise ValueError(f"{name}: expected shape {shape}, got {lengths.shape}")
    if not (np.isfinite(lengths).all() and (lengths > 0).all()):
        raise ValueError(f"{name}: must be positive and finite, got {lengths.tolist()}")
    return lengths


def lengths_of(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Floats:
    """Return an argument as lengths [m] of a zone; raise ValueError for sizes that are not allowed."""
    lengths = positive(name, value, shape)
    if not ((lengths >= SMALLEST) & (lengths <= LARGEST)).all():
        raise ValueError(f"{name}: must be from {SMALLEST:g} to {LARGEST:g} m, got {lengths.tolist()}")
    return lengths


@dataclass(frozen=True, eq=False)
class Zone:
    """A keep-out zone: the relative positions r where the largest part of a shape at M r is at most 1.

    The zone is *around* a spacecraft: r is the position of the other spacecraft relative to it.  All zones
    but `HalfSpaces` are symmetric, so that the roles may be exchanged.  Zones are created by `Sphere`,
    `Ellipsoid`, `Box`, `Cylinder` and `HalfSpaces`.

    Attributes
    ----------
    shape : int
        A BALL is |q| <= 1 of zone coordinates q = M r, a CUBE max|q_i| <= 1, a CYLINDER
        max(hypot(q_0, q_1), |q_2|) <= 1, and FACES are f_k . q <= 1 for each k.
    matrix : array of shape (3, 3) [1/m]
        Map M from the path's frame to zone coordinates.
    faces : array of shape (F, 3), no unit
        Rows f_k in zone coordinates; empty for the other shapes.

    References
    ----------
    docs/theory.md section 3.
    """

    shape: int
    matrix: Floats
    faces: Floats = field(default_factory=lambda: np.empty((0, 3)))

    def __repr__(self) -> str:
        """Return the zone as a user creates it, with numbers to six digits."""
        if self.shape == FACES:
            planes = self.faces @ self.matrix
            offsets = 1.0 / np.linalg.norm(planes, axis=1)
            return f"HalfSpaces({_digits(planes * offsets[:, None])}, {_digits(offsets)})"
        lengths = 1.0 / np.linalg.norm(self.matrix, axis=1)
        axes = self.matrix * lengths[:, None]
        if not np.allclose(axes @ axes.T, np.eye(3), atol=1e-9):
            if self.shape != BALL:
                return f"Zone({self.shape}, {_digits(self.matrix)})"
            _, inverse, axes = np.linalg.svd(self.matrix)
            lengths = 1.0 / inverse
        if self.shape == CYLINDER:
            return f"Cylinder({lengths[0]:.6g}, {lengths[2]:.6g}, {_digits(axes[2])})"
        if self.shape == BALL and np.allclose(lengths, lengths[0], rtol=1e-12):
            return f"Sphere({lengths[0]:.6g})"
        turned = "" if np.allclose(axes, np.eye(3), atol=1e-12) else f", axes={_digits(axes)}"
        return f"{'Box' if self.shape == CUBE else 'Ellipsoid'}({_digits(lengths)}{turned})"

    def __post_init__(self) -> None:
        object.__setattr__(self, "matrix", np.array(self.matrix, dtype=float, order="C"))
        object.__setattr__(self, "faces", np.array(self.faces, dtype=float, order="C"))

    @property
    def form(self) -> tuple[int, Floats, Floats]:
        """Zone as kernels accept it, numba's `shapes.FORM`: shape, matrix (3, 3) [1/m], faces (F, 3)."""
        return self.shape, self.matrix, self.faces

    @cached_property
    def stretch(self) -> float:
        """Largest length of a metre in zone coordinates [1/m]: the spectral norm of M."""
        return float(np.linalg.norm(self.matrix, 2))

    @property
    def symmetric(self) -> bool:
        """True if r is in the zone whenever -r is."""
        return self.shape != FACES

    def norm(self, position: ArrayLike) -> Any:
        """Return the norm of relative positions: 1 on the surface, less inside.

        For half-spaces it is negative where every n_k . r is, as far behind a single face.

        Parameters
        ----------
        position : array_like of shape (..., 3) [m]
            Position of the other spacecraft relative to the one with the zone, in the path's frame.

        Returns
        -------
        float or array of shape (...), no unit
            Norm of each position.

        Raises
        ------
        ValueError
            If `position` contains numbers that are not finite, or has another shape.

        References
        ----------
        docs/theory.md section 3.
        """
        return self._norm(finite("position", position, 3))

    def _norm(self, position: Floats) -> Any:
        """Return the norm of positions (..., 3), NaN for unknown ones."""
        return scaled_norm(self, position @ self.matrix.T)

    def enlarged(self, factor: float) -> Zone:
        """Return the zone scaled about the origin.

        Parameters
        ----------
        factor : float, no unit
            Factor of all lengths.

        Returns
        -------
        Zone
            Zone of the same shape.

        Raises
        ------
        ValueError
            If `factor` is not positive and finite, or the zone becomes smaller than 1e-9 m or larger than
            1e15 m.

        References
        ----------
        docs/theory.md section 3.
        """
        times = float(positive("factor", factor, ()))
        sizes = times / np.linalg.norm(self.matrix, axis=1)
        if not (sizes.min() >= SMALLEST and sizes.max() <= LARGEST):
            raise ValueError(
                f"factor: the zone must remain from {SMALLEST:g} to {LARGEST:g} m in size, got {times:g}"
            )
        return Zone(self.shape, self.matrix / times, self.faces)

    def padded(self, margin: float) -> Zone:
        """Return a zone of the same shape that contains all points within a margin: its sum with a ball.

        Exact for spheres.  Faces of boxes, cylinders and half-spaces move out by the margin: their corners
        are sharp, where those of the sum are round.  An ellipsoid becomes the smallest
        one that contains the sum.

        Parameters
        ----------
        margin : float [m]
            Radius of the ball; 0 returns the zone itself.

        Returns
        -------
        Zone
            Zone of the same shape.

        Raises
        ------
        ValueError
            If `margin` is negative or not finite.

        References
        ----------
        docs/theory.md section 3, (24) and (25).
        """
        from closeform.zones.minkowski_sums import padded

        metres = numbers("margin", margin)
        if metres.shape or not 0.0 <= metres < np.inf:
            raise ValueError(f"margin: must be 0 m or more and finite, got {metres.tolist()}")
        return padded(self, float(metres)) if metres > 0.0 else self

    @cached_property
    def radius(self) -> float:
        """Radius [m] of a ball about the origin that contains the zone; inf for an unbounded zone."""
        if self.shape == FACES:
            return float(np.linalg.norm(self.extents))
        return float(CORNER[self.shape] / np.linalg.svd(self.matrix, compute_uv=False)[-1])

    @property
    def inner_radius(self) -> float:
        """Radius [m] of the largest ball about the origin inside the zone."""
        faces = self.faces @ self.matrix if self.shape == FACES else self.matrix[LEADING.get(self.shape, 0) :]
        nearest = np.linalg.norm(faces, axis=1).max(initial=0.0)
        if self.shape in LEADING:
            nearest = max(nearest, np.linalg.norm(self.matrix[: LEADING[self.shape]], 2))
        return float(1.0 / nearest)

    @property
    def mirrored(self) -> Zone:
        """Zone of -r, as the other spacecraft of a pair sees it; the zone itself if it is symmetric."""
        return self if self.symmetric else Zone(self.shape, self.matrix, -self.faces)

    def support(self, direction: ArrayLike) -> Any:
        """Return the extent of the zone in given directions: the largest d . r over all its r.

        Parameters
        ----------
        direction : array_like of shape (..., 3), no unit
            Directions d in the path's frame; the result scales with their lengths.

        Returns
        -------
        float or array of shape (...) [m]
            Extents; inf where the zone is unbounded.

        Raises
        ------
        ValueError
            If `direction` contains numbers that are not finite, or has another shape.

        References
        ----------
        docs/theory.md section 3.
        """
        d = finite("direction", direction, 3) @ np.linalg.inv(self.matrix)
        if self.shape == FACES:
            return self._support_of_faces(d)
        if self.shape == CUBE:
            return np.abs(d).sum(axis=-1)
        if self.shape == BALL:
            return np.sqrt((d * d).sum(axis=-1))
        return np.sqrt((d[..., :2] ** 2).sum(axis=-1)) + np.abs(d[..., 2])

    def _support_of_faces(self, d: Floats) -> Any:
        """Return the minimum sum of l >= 0 with sum l_k f_k = d: three faces or fewer suffice (duality)."""
        least = np.full(d.shape[:-1], np.inf)
        size = np.abs(d).sum(axis=-1)
        for some, inverse in self._bases:
            weights, left = np.zeros(()), -d[..., None, :]
            for _ in range(2):  # refined once: the remainder is rounding or not spanned by these faces
                weights = weights - np.einsum("ski,...si->...sk", inverse, left)
                left = np.einsum("...sk,ski->...si", weights, self.faces[some]) - d[..., None, :]
            good = (weights >= -SAME * np.abs(weights).sum(axis=-1, keepdims=True)).all(axis=-1)
            terms = np.einsum("...sk,sk->...s", np.abs(weights), np.abs(self.faces[some]).sum(axis=-1))
            good &= np.abs(left).sum(axis=-1) <= ROUNDING * (terms + size[..., None])
            least = np.minimum(least, np.where(good, weights.sum(axis=-1), np.inf).min(axis=-1))
        return np.where(size > 0.0, least, 0.0)[()]

    @cached_property
    def _bases(self) -> list[tuple[Any, Floats]]:
        """Sets of up to three independent faces (S, k), and the inverses for their weights (S, k, 3)."""
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
        """True if the zone is bounded in every direction."""
        return bool(np.isfinite(self.extents).all())

    @property
    def vertices(self) -> Floats:
        """Corners (V, 3) [m] of a box or of half-spaces, in the path's frame; (0, 3) for round shapes."""
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
        """Half-widths (3,) [m] of the smallest box along x, y, z about the origin that contains the zone.

        They are inf where the zone is unbounded, and the roots of the diagonal of P^-1 for an ellipsoid
        (theory 3).
        """
        ways = np.eye(3)
        widths: Floats = np.maximum(self.support(ways), self.support(-ways))
        return widths


def _digits(values: Floats) -> str:
    """Return numbers as nested lists with six digits."""
    if values.ndim > 1:
        return f"[{', '.join(map(_digits, values))}]"
    return f"[{', '.join(f'{value:.6g}' for value in values + 0.0)}]"


def scaled_norm(zone: Zone, q: Floats) -> Any:
    """Return the norm of positions (..., 3) in zone coordinates (the zone's matrix times metres)."""
    if zone.shape == FACES:
        return (q @ zone.faces.T).max(axis=-1)
    rounded = LEADING.get(zone.shape, 0)
    length = np.sqrt(np.einsum("...k,...k->...", q[..., :rounded], q[..., :rounded]))
    if rounded == 3:
        return length
    return np.maximum(length, np.abs(q[..., rounded:]).max(axis=-1))


def inner_ball(zone: Zone) -> Floats:
    """Return the largest ball |W q| <= 1 in a zone, in its coordinates: W (3, 3)."""
    ball: Floats = np.eye(3) * (np.linalg.norm(zone.faces, axis=1).max() if zone.shape == FACES else 1.0)
    return ball


def gradient(zone: Zone, position: Floats) -> Floats:
    """Return the gradient (..., 3) [1/m] of the norm at positions (..., 3) [m]; on edges one of many.

    The zone lies below the plane of constant norm: at a norm s the plane is (s - 1)/|gradient| away.
    """
    q = position @ zone.matrix.T
    rounded = LEADING.get(zone.shape, 0)
    faces = zone.faces if zone.shape == FACES else np.eye(3)[rounded:]
    parts, rows = q @ faces.T, np.broadcast_to(faces, (*q.shape[:-1], *faces.shape))
    if zone.shape != FACES:
        parts, rows = np.abs(parts), rows * np.sign(parts)[..., None]
    if rounded:
        length = np.sqrt((q[..., :rounded] ** 2).sum(axis=-1, keepdims=True))
        side = np.where(np.arange(3) < rounded, q, 0.0) / np.maximum(length, np.finfo(float).tiny)
        parts = np.concatenate([length, parts], axis=-1)
        rows = np.concatenate([side[..., None, :], rows], axis=-2)
    most = parts.argmax(axis=-1)[..., None, None]
    return np.asarray(np.take_along_axis(rows, most, axis=-2)[..., 0, :] @ zone.matrix)


def face_normals(zone: Zone) -> Floats:
    """Return outward normals (K, 3) [1/m] of the flat faces of a zone, scaled to n . r = 1 on each."""
    if zone.shape == FACES:
        return zone.faces @ zone.matrix
    flat = zone.matrix[LEADING.get(zone.shape, 0) :]
    return np.concatenate([flat, -flat])


def enclosing(zone: Zone) -> Floats:
    """Return the matrix E (3, 3) [1/m] of an ellipsoid |E r| <= 1 that contains the zone."""
    ratios = {BALL: (1.0, 1.0), CUBE: (3.0, 3.0), CYLINDER: (1.5, 3.0)}  # of its axes, squared
    if zone.shape != FACES:
        side, end = ratios[zone.shape]
        return np.asarray(zone.matrix / np.sqrt([[side], [side], [end]]))
    widths = zone.extents  # an unbounded direction does not count
    return np.asarray(np.diag(1.0 / widths) / np.sqrt(max(1, np.isfinite(widths).sum())))
