"""Passages and holds that several tests of minimum delta-v plan."""

import numpy as np
from scipy.integrate import solve_ivp

from bridge import hill
from formations import LOW_ORBIT

ORBIT = LOW_ORBIT
NEAR = 1.3  # ratio below which it keeps a supporting plane


def passage(seed, thrusters=None):
    """Return states, duration, obstacle and radius of a transfer whose minimum violates a sphere."""
    rng = np.random.default_rng(seed)
    n = ORBIT.mean_motion
    while True:
        x, y, z, vx, vz = rng.normal(size=(5, 2)) * 150.0 * np.array([[1], [1], [1], [n], [n]])
        a, b = np.stack([x, y, z, vx, -2.0 * n * x, vz]).T
        duration = ORBIT.period * rng.uniform(0.3, 1.5)
        free = ORBIT.impulsive(a, b, duration, thrusters=thrusters)
        when, radius = duration * rng.uniform(0.3, 0.7), rng.uniform(15.0, 60.0)
        hit = free.state(when) + np.concatenate(
            [0.3 * radius * rng.normal(size=3), 0.02 * rng.normal(size=3)]
        )
        obstacle = ORBIT.coast(ORBIT.transition(-when) @ hit, duration)
        apart = [np.linalg.norm(obstacle.position(t) - s[:3]) for t, s in ((0.0, a), (duration, b))]
        if min(apart) > 1.1 * radius:
            return a, b, duration, obstacle, radius


def flown(path, times):
    """Return positions (T, 3) and the end state of impulses by an integrator."""
    motion = hill(path.orbit.mean_motion)
    fired = list(path.impulses)
    state = path.state(path.start)
    if fired and fired[0][0] == path.start:
        fired.pop(0)  # included in the initial state
    places, begin = [], float(path.start)
    for end, jump in [*fired, (float(path.end), np.zeros(3))]:
        inside = times[(times >= begin) & ((times < end) | (end == path.end))]
        if end > begin:
            way = solve_ivp(
                lambda t, x: motion @ x, (begin, end), state, rtol=1e-11, atol=1e-12, dense_output=True
            )
            if len(inside):
                places.append(way.sol(inside).T[:, :3])
            state = way.y[:, -1].copy()
        state[3:] += jump
        begin = end
    return np.concatenate(places), state
