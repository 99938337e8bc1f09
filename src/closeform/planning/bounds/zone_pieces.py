r"""Pieces that cover the outside of a zone: in each of them a plane bounds the relative position.

For a round surface with the corners v of a piece on it, the plane through the nearest corner

            v1 .-----. v0
              /   ^a  \           a . q >= c = min a . v      and still |q| >= 1
             /    |    \

cuts off the outside on the side of the piece.  A flat face is a piece by itself, and exact.
"""

from dataclasses import dataclass

import numpy as np

from closeform.arrays import Floats
from closeform.zones.shapes import BALL, CUBE, CYLINDER, FACES
from closeform.zones.zone import Zone

SQUARE = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
FINEST = 1.0 - 1e-6  # distance of the plane above which a piece is not cut


@dataclass(frozen=True, eq=False)
class Piece:
    """Part of a pair's possible positions, in zone coordinates: |rows q| >= 1, and normal . q >= floor.

    `corners` (2, 2) or (4, 3) are those of a piece of a round surface, in coordinates `rows` q; `exact`:
    |rows q| >= 1 is all outside.
    """

    rows: Floats
    normal: Floats | None = None
    floor: float = 0.0
    corners: Floats | None = None
    exact: bool = True

    @property
    def whole(self) -> bool:
        """True if the piece is the whole outside."""
        return self.normal is None

    @property
    def can_be_cut(self) -> bool:
        """True if smaller pieces give a tighter bound."""
        return self.whole or (self.corners is not None and self.floor < FINEST)

    def missing(self, place: Floats) -> float:
        """Return the shortfall of a place's square from 1, or 1 where the piece is not exact."""
        return 1.0 - float(np.sum((self.rows @ place) ** 2)) if self.exact else 1.0

    def halves(self) -> list["Piece"]:
        """Return the halves of a round piece, cut across its longest edge."""
        v = self.corners
        assert v is not None
        ahead = np.roll(v, -1, axis=0)
        middles = (v + ahead) / np.linalg.norm(v + ahead, axis=1)[:, None]
        if len(v) == 2:
            return [round_piece(self.rows, np.stack([end, middles[0]])) for end in v]
        k = int(np.argmax(np.linalg.norm(ahead - v, axis=1)))
        a, b, c, d = np.roll(v, -k, axis=0)
        near, far = middles[k], middles[(k + 2) % 4]
        return [
            round_piece(self.rows, np.stack(corners)) for corners in ((a, near, far, d), (near, b, c, far))
        ]


def round_piece(rows: Floats, corners: Floats) -> Piece:
    """Return the piece of a ball, or of a cylinder's side, between corners on it."""
    middle = corners.sum(axis=0)
    middle /= np.linalg.norm(middle)
    return Piece(rows, middle @ rows, float((corners @ middle).min()), corners)


def outside(zone: Zone, inside: Floats) -> Piece:
    """Return the outside of an ellipsoid |inside q| <= 1 in a keep-out region; all outside of a ball."""
    return Piece(inside, exact=zone.shape == BALL)


def pieces(zone: Zone, inside: Floats, compliance: Floats) -> list[Piece]:
    """Return pieces that cover the outside of a zone: its faces, and squares on a ball.

    The ball is the ellipsoid |inside q| <= 1, which contains the zone where sigmas are kept clear as well.
    The axes of its squares are those of the compliance (3, 3), so that the softest exits have their own.
    """
    flat = {CUBE: np.eye(3), CYLINDER: np.eye(3)[2:], BALL: np.empty((0, 3)), FACES: np.empty((0, 3))}
    normals = np.concatenate([flat[zone.shape], -flat[zone.shape], zone.faces])
    found = [Piece(np.empty((0, 3)), normal, 1.0) for normal in normals]
    if zone.shape == CYLINDER:
        found += [round_piece(np.eye(3)[:2], SQUARE[[k, k - 1]] / np.sqrt(2.0)) for k in range(4)]
    if zone.shape == BALL:
        axes = np.linalg.eigh(inside @ compliance @ inside.T)[1].T
        for k in range(3):
            sides = SQUARE @ axes[[k - 1, k - 2]]
            found += [round_piece(inside, (sides + axis) / np.sqrt(3.0)) for axis in (axes[k], -axes[k])]
    return found
