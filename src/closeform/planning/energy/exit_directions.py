"""Exit directions: the sides on which a zone can be passed."""

import numpy as np

from closeform.arrays import Floats
from closeform.planning.problem.problem import Problem, Trajectories
from closeform.planning.problem.scene import Contacts
from closeform.zones.shapes import BALL, CUBE, CYLINDER

AXES = np.concatenate([np.eye(3), -np.eye(3)])
EDGES = np.array([[a, b, 0.0] for a in (1, -1) for b in (1, -1)])
CUBE_NORMALS = np.concatenate([AXES, *(np.roll(EDGES, k, axis=1) / 2.0 for k in range(3))])


def exit_normals(
    shape: int, faces: Floats, aim: float, position: Floats, velocity: Floats, compliance: Floats
) -> list[tuple[float, Floats]]:
    """Return exits of a zone, (rough cost, outward normal), lowest cost first, in zone coordinates.

    A cube has exits at six faces and twelve edges, a cylinder at two ends and its side, half-spaces at each
    face.  Exits of a ball, and of a cylinder's side, are along the most compliant axes across the motion,
    and along the motion itself (later or earlier).
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


def ranked_exits(
    problem: Problem, trajectories: Trajectories, contacts: Contacts
) -> list[tuple[float, int, Floats]]:
    """Return all exits of zones from the positions at contacts: (rough cost, which, normal), sorted."""
    found = []
    for k, motion in enumerate(problem.motions(trajectories, contacts)):
        zone, compliance = problem.zones[problem.kinds[contacts.which[k]]], problem.kernel(contacts.some([k]))
        exits = exit_normals(zone.shape, zone.faces, 1.0, motion[0], motion[1], compliance)
        found += [(cost, k, normal) for cost, normal in exits]
    return sorted(found, key=lambda way: way[0])


def round_normals(aim: float, position: Floats, velocity: Floats, compliance: Floats) -> Floats:
    """Return the normals where rays from the position leave a ball, along the most compliant axes."""
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
