"""Which of two keep-out zones is the larger: the one that holds the other."""

from itertools import product

import numpy as np

from closeform.zones import Zone

CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))
ROUNDING = 1e-9


def reach(inner: Zone, outer: Zone) -> float:
    """Greatest norm of `outer` over the zone `inner`: at most 1 if it holds all of it."""
    image = outer.matrix @ np.linalg.inv(inner.matrix)
    if inner.box:
        corners = CORNERS @ image.T
        return float(np.abs(corners).max() if outer.box else np.linalg.norm(corners, axis=1).max())
    return float(np.linalg.norm(image, axis=1).max() if outer.box else np.linalg.norm(image, 2))


def larger(*zones: Zone) -> Zone | None:
    """The zone that holds all others; None where none does: a cigar and a disc, say."""
    for zone in zones:
        if all(reach(other, zone) <= 1.0 + ROUNDING for other in zones):
            return zone
    return None
