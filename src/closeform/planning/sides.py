"""The sides on which a zone can be passed."""

import numpy as np

from closeform.arrays import Floats

FACES = np.concatenate([np.eye(3), -np.eye(3)])
EDGES = np.array([[a, b, 0.0] for a in (1, -1) for b in (1, -1)])
BOX_NORMALS = np.concatenate([FACES, *(np.roll(EDGES, k, axis=1) / 2.0 for k in range(3))])


def ways_out(
    box: bool, aim: float, position: Floats, velocity: Floats, compliance: Floats
) -> list[tuple[float, Floats]]:
    """Ways out of a zone: (rough cost, gradient of the norm), cheapest first, all in zone coordinates.

    A box has six faces and twelve edges.  An ellipsoid is left along the softest axes across the motion, and
    along the motion itself (by being late or early).
    """
    if box:
        normals = BOX_NORMALS
    else:
        speed = np.linalg.norm(velocity)
        across = np.eye(3) - np.outer(velocity, velocity) / speed**2 if speed > 0.0 else np.eye(3)
        axes = np.linalg.eigh(across @ compliance @ across)[1].T
        rays = np.concatenate([axes, -axes])  # from the position, until they leave the ball
        along = rays @ position
        ahead = np.sqrt(np.maximum(aim**2 - position @ position + along**2, 0.0)) - along
        normals = (position + ahead[:, None] * rays) / aim
    give = np.einsum("ki,ij,kj->k", normals, compliance, normals)
    costs = 0.5 * np.maximum(aim - normals @ position, 0.0) ** 2 / give
    found = [(float(cost), normal) for cost, normal in zip(costs, normals, strict=True)]
    return sorted(found, key=lambda way: way[0])
