"""The sides on which a zone can be passed."""

import numpy as np

from closeform.zones import Floats


def ways_out(
    box: bool, aim: float, position: Floats, velocity: Floats, compliance: Floats
) -> list[tuple[float, Floats]]:
    """Ways out of a zone: (rough cost, outward normal), cheapest first, all in zone coordinates.

    A box has six faces.  An ellipsoid is left along the softest axes across the motion, and
    along the motion itself (by being late or early).
    """
    axes = np.eye(3)
    if not box:
        speed = np.linalg.norm(velocity)
        across = np.eye(3) - np.outer(velocity, velocity) / speed**2 if speed > 0.0 else np.eye(3)
        axes = np.linalg.eigh(across @ compliance @ across)[1].T
    found = []
    for axis in (*axes, *(-axes)):
        normal = axis
        if not box:  # where the ray from the position along the axis leaves the ball
            along = axis @ position
            ahead = np.sqrt(max(aim**2 - position @ position + along**2, 0.0)) - along
            normal = (position + ahead * axis) / aim
        cost = 0.5 * (aim - normal @ position) ** 2 / (normal @ compliance @ normal)
        found.append((float(cost), normal))
    return sorted(found, key=lambda way: way[0])
