"""Hunt for pairs within one orbit that take the most evaluations: perturb the worst of many again and again.

Usage: hunt.py [ROUNDS]
"""

import sys

import numpy as np

import closeform as cf
from closeform.flight.pairs import conflict_search, nearest, pair_of

ROUNDS = int(sys.argv[1]) if len(sys.argv) > 1 else 60
N = 1.1086e-3
SIZE = 400
ZONES = {"ellipsoid": cf.Sphere(10.0), "box": cf.Box([10.0, 10.0, 10.0]), "cylinder": cf.Cylinder(10.0, 10.0)}
CIRCLE = np.array([5.0, 0.0, 5.0 * np.sqrt(3.0), 0.0, -2.0 * N * 5.0, 0.0])  # a constant distance of 10 m


def paths(genes, thrusting):
    """Return paths of one orbit from genes (C, 12) about the circle that slides along the zone."""
    orbit = cf.Orbit(N)
    scale = np.array([10.0] * 3 + [10.0 * N] * 3)
    begin = CIRCLE + genes[:, :6] * scale
    if thrusting:
        return orbit.transfer(begin, CIRCLE + genes[:, 6:] * scale, orbit.period)
    return orbit.coast(begin, orbit.period)


def evaluations(one, other, zone, closest):
    """Return the evaluations of each pair, (SIZE,)."""
    pairs = [pair_of(one[k], other[k], zone) for k in range(SIZE)]
    found = [nearest(*pair, 0.0, one.end[0]) if closest else conflict_search(*pair)[1] for pair in pairs]
    return np.array([each.evaluations_used for each in found])


def main():
    """Print the most evaluations for each shape and kind of motion."""
    rng = np.random.default_rng(2)
    for name, zone in ZONES.items():
        for thrusting in (False, True):
            for closest in (False, True):
                genes = rng.normal(size=(SIZE, 12)) * rng.choice([1e-12, 1e-8, 1e-4, 1e-2, 1.0], (SIZE, 1))
                most = 0
                for _ in range(ROUNDS):
                    one = paths(genes, thrusting)
                    other = cf.Orbit(N).coast(np.zeros((SIZE, 6)), one.end)
                    used = evaluations(one, other, zone, closest)
                    most = max(most, int(used.max()))
                    best = genes[np.argsort(used)[-20:]]
                    step = 10.0 ** rng.uniform(-14.0, 0.0, (SIZE, 1))
                    genes = best[rng.integers(20, size=SIZE)] + rng.normal(size=(SIZE, 12)) * step
                    genes[:20] = best
                what = "closest approach" if closest else "conflicts"
                print(f"{name}, {'thrust' if thrusting else 'coast'}, {what}: {most} evaluations", flush=True)


main()
