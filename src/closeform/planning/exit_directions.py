"""The sides on which a zone can be passed."""

import numpy as np

from closeform.arrays import Floats
from closeform.planning.problem import Flown, Problem
from closeform.planning.scene import Contacts
from closeform.zones.shapes import BALL, CUBE, CYLINDER

AXES = np.concatenate([np.eye(3), -np.eye(3)])
EDGES = np.array([[a, b, 0.0] for a in (1, -1) for b in (1, -1)])
CUBE_NORMALS = np.concatenate([AXES, *(np.roll(EDGES, k, axis=1) / 2.0 for k in range(3))])


def exit_normals(
    shape: int, faces: Floats, aim: float, position: Floats, velocity: Floats, compliance: Floats
) -> list[tuple[float, Floats]]:
    """Ways out of a zone: (rough cost, outward normal), cheapest first, all in zone coordinates.

    A cube has six faces and twelve edges, a cylinder two ends and its side, half-spaces a way out each.
    A ball, and a cylinder's side, is left along the softest axes across the motion, and along the
    motion itself (by being late or early).
    """
    if shape == CUBE:
        normals = CUBE_NORMALS
    elif shape == BALL:
        normals = round_normals(aim, position, velocity, compliance)
    elif shape == CYLINDER:
        normals = round_normals(aim, position[:2], velocity[:2], compliance[:2, :2])
        normals = np.concatenate([np.pad(normals, ((0, 0), (0, 1))), AXES[[2, 5]]])
    else:
        normals = faces
    give = ((normals @ compliance) * normals).sum(axis=1)
    costs = 0.5 * np.maximum(aim - normals @ position, 0.0) ** 2 / give
    order = np.argsort(costs, kind="stable")
    return list(zip(costs[order].tolist(), normals[order], strict=True))


def ranked_exits(problem: Problem, flown: Flown, contacts: Contacts) -> list[tuple[float, int, Floats]]:
    """All ways out of zones from where pairs are at contacts, cheapest first: (rough cost, which, normal)."""
    found = []
    for k, motion in enumerate(problem.motions(flown, contacts)):
        zone, compliance = problem.zones[problem.kinds[contacts.which[k]]], problem.kernel(contacts.some([k]))
        exits = exit_normals(zone.shape, zone.faces, 1.0, motion[0], motion[1], compliance)
        found += [(cost, k, normal) for cost, normal in exits]
    return sorted(found, key=lambda way: way[0])


def round_normals(aim: float, position: Floats, velocity: Floats, compliance: Floats) -> Floats:
    """Normals of a ball where rays from the position leave it, along the softest axes across the motion."""
    square = velocity @ velocity
    across = np.eye(len(position))
    if square > 0.0:
        across -= velocity[:, None] * velocity / square
    axes = np.linalg.eigh(across @ compliance @ across)[1].T
    rays = np.concatenate([axes, -axes])
    along = rays @ position
    ahead = np.sqrt(np.maximum(aim**2 - position @ position + along**2, 0.0)) - along
    normals: Floats = (position + ahead[:, None] * rays) / aim
    return normals
