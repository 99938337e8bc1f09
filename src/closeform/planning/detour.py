"""The two ways around one obstacle: the least energy through one deviation point on either side.

SP11's figure 2 in theory (11): at the time of closest approach the optimal path is moved to a
point of the zone's surface, where the cost of the move is a quadratic form, and the move is
scaled until both legs are clear.
"""

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.two_paths import closest_approach
from closeform.motion.path import Path, join
from closeform.zones.zone import Zone

AROUND = np.linspace(0.0, 2.0 * np.pi, 241)
CIRCLE = np.stack([np.cos(AROUND), np.sin(AROUND)], axis=-1)
CLEAR = 1 + 1e-9  # the ratio aimed at
REACH = 4.0  # zones, beyond which a deviation point is not sought


def cost_of_moving(path: Path, time: float) -> Floats:
    """Matrix A (6, 6): moving the state at `time` by d costs d.A.d / 2 of energy.    # theory (11)"""
    pairs = np.eye(6)[:, None] + np.eye(6)[None]
    initial = path.orbit.transfer(np.zeros(6), pairs, time - path.start).energy
    terminal = path.orbit.transfer(pairs, np.zeros(6), path.end - time).energy
    both: Floats = initial + terminal
    single = both.diagonal() / 4
    matrix: Floats = both - single[:, None] - single[None]
    return matrix


def ways_around(path: Path, obstacle: Path, zone: Zone) -> list[Path]:
    """Clear paths between the ends of `path` on either side of the obstacle, the cheaper first.

    Each is a join of two optimal transfers.  A side that one deviation point does not clear is
    left out; there is none where the path is clear already.
    """
    near = closest_approach(path, obstacle, zone)
    if near.ratio > 1 or not path.start < near.time < path.end:
        return []
    time = near.time
    first, last = path.state(path.start), path.state(path.end)
    best = path.orbit.transfer(first, last, path.end - path.start, path.start).state(time)
    host = obstacle.state(time)
    cost = cost_of_moving(path, time)
    velocity_of = -np.linalg.solve(cost[3:, 3:], cost[3:, :3])
    stiffness = cost[:3, :3] + cost[:3, 3:] @ velocity_of

    across = np.linalg.svd((zone.matrix @ (best - host)[3:])[None])[2][1:]  # two rows normal to the motion
    points = (CIRCLE @ across) @ np.linalg.inv(zone.matrix).T
    points /= zone.norm(points)[:, None]
    moves = points + host[:3] - best[:3]
    prices = np.einsum("ki,ij,kj->k", moves, stiffness, moves)
    cheapest = int(prices.argmin())
    opposite = np.where(CIRCLE @ CIRCLE[cheapest] < -0.7, prices, np.inf)

    def through(point: Floats, scale: float) -> Path:
        move = scale * point + host[:3] - best[:3]
        middle = best + np.concatenate([move, velocity_of @ move])
        before = path.orbit.transfer(first, middle, time - path.start, path.start)
        return join([before, path.orbit.transfer(middle, last, path.end - time, time)])

    def clear(way: Path) -> bool:
        return float(closest_approach(way, obstacle, zone).ratio) >= CLEAR

    found = []
    for k in (cheapest, int(opposite.argmin())):
        inside, outside = 1.0, REACH
        if clear(through(points[k], inside)):
            outside = inside
        while outside - inside > 1e-10:
            middle = (inside + outside) / 2
            inside, outside = (inside, middle) if clear(through(points[k], middle)) else (middle, outside)
        if clear(way := through(points[k], outside)):
            found.append(way)
    return sorted(found, key=lambda way: float(way.energy))
