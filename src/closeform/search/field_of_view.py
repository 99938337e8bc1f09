"""Field-of-view test: whether two craft see each other.

With b the boresight of the craft in A, d that of the craft in B and q the vector from the sensor of A to that
of B, they lock when

    |q| cos(h_A) - b.q <= 0,   |q| cos(h_B) + d.q <= 0,   |q| <= range            # theory (13)

Craft without search errors look in opposite directions, d = -b, with equal cones: they are *facing*, and the
second condition is the first. During an outage a craft neither sees nor is seen.
"""

from math import inf, sqrt
from typing import NamedTuple

from closeform._jit import kernel
from closeform.search.search_errors import OUTAGES

TOLERANCE = 1e-12  # of the distance: a smaller positive gap counts as a lock


class Sensors(NamedTuple):
    """Sensors of a pair: offset of each [m], cosines of the half-angles of A and B, common range [m]."""

    offset: float
    cosine: float
    other_cosine: float
    range: float


@kernel(inline=True)
def view(boresight, other_boresight, place, sensors):
    """Return the vector between the sensors and its length, the three gaps of theory (13), and a tolerance.

    `place` is the position of B relative to A. A gap is positive if the condition does not hold. Computed by
    components, so that a pass within a micrometre keeps its digits.
    """
    bx, by, bz = boresight
    dx, dy, dz = other_boresight
    px, py, pz = place
    offset = sensors.offset
    qx, qy, qz = px + offset * (dx - bx), py + offset * (dy - by), pz + offset * (dz - bz)
    q = sqrt(qx * qx + qy * qy + qz * qz)
    gap = sensors.cosine * q - (bx * qx + by * qy + bz * qz)
    other_gap = sensors.other_cosine * q + (dx * qx + dy * qy + dz * qz)
    return (qx, qy, qz), q, gap, other_gap, q - sensors.range, TOLERANCE * (q + 4.0 * offset)


@kernel()
def outage(craft, t):
    """Return whether a craft has an outage at time t, and the time of its next change."""
    out, change = False, inf
    for k in range(OUTAGES, len(craft), 2):
        if craft[k] <= t < craft[k + 1]:
            out, change = True, min(change, craft[k + 1])
        elif craft[k] > t:
            change = min(change, craft[k])
    return out, change
