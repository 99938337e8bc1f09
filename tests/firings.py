"""Random plans and thrusters, and pulses by an independent integrator, for tests and tools."""

import numpy as np
from scipy.integrate import solve_ivp

import closeform as cf

KINDS = ("energy-optimal", "burn", "impulses", "mixed")
# eight thrusters at the corners of a cube, four in each facet of their hull
CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / np.sqrt(3.0)
TETRAHEDRON = CUBE[[0, 3, 5, 6]]


def state(rng, orbit, size):
    """Return a random state on a bounded or drifting relative orbit."""
    n = orbit.mean_motion or 1e-3
    x, y, z = rng.normal(size=3) * size
    drift = rng.normal() * rng.choice([0.0, 0.1])
    return np.array(
        [x, y, z, rng.normal() * size * n / 2, -2 * n * x + drift * size * n, rng.normal() * size * n]
    )


def modulated(rng):
    """Return a random plan of one spacecraft and thrusters that can realize it."""
    orbit = cf.Orbit(rng.choice([0.0, 1.1e-3, 1.1e-3, 7.3e-5, 8e-4]))
    size = 10 ** rng.uniform(0.5, 3.5)
    turn = orbit.period if orbit.mean_motion else 5000.0
    duration, start = turn * rng.uniform(0.1, 2.0), rng.uniform(-1, 1) * turn
    kind = rng.choice(KINDS)
    frame = rng.choice(["orbit", "inertial"])
    initial, final = state(rng, orbit, size), state(rng, orbit, size)
    if kind == "energy-optimal":
        path = orbit.transfer(initial, final, duration, start)
    elif kind == "burn":
        path = orbit.burn(initial, rng.normal(size=3) * size / duration**2, duration, start, frame)
    elif kind == "impulses":
        path = orbit.two_impulse(initial, final, duration * rng.uniform(0.3, 0.45), start)
    else:
        first = orbit.transfer(initial, final, duration / 2, start)
        idle = orbit.coast(final, duration / 4, start + duration / 2)
        kicked = idle.state(idle.end) + np.append(np.zeros(3), rng.normal(size=3) * size / duration)
        path = cf.join([first, idle, orbit.coast(kicked, duration / 4, idle.end)])
    directions = [cf.Thrusters.rtn().directions, CUBE, TETRAHEDRON][rng.integers(3)]
    turned = np.linalg.qr(rng.normal(size=(3, 3)))[0] if rng.random() < 0.5 else np.eye(3)
    strength = max(path.peak_thrust, path.delta_v / duration * 20) * rng.uniform(3.5, 30)
    period = duration / 10 ** rng.uniform(1.0, 2.5)
    bit = rng.choice([0.0, 0.0, 1e-4, 1e-3, 1e-2]) * path.delta_v
    return path, cf.Thrusters(directions @ turned.T, str(frame), strength, bit, period)


def clustered(rng):
    """Return impulses whose burns would overlap, and thrusters."""
    orbit = cf.Orbit(rng.choice([0.0, 1.1e-3, 7.3e-5]))
    turn, size = orbit.period if orbit.mean_motion else 5000.0, 10 ** rng.uniform(0.5, 3.5)
    duration, start = turn * rng.uniform(0.1, 2.0), rng.uniform(-1, 1) * turn
    at, kicks = [], []
    for middle in np.linspace(0.15, 0.85, rng.integers(1, 4)):
        count = rng.integers(1, 6)
        at += list(middle + 10 ** rng.uniform(-4.0, -1.8) * rng.random(count))
        to, astray = rng.normal(size=3), rng.choice([0.0, 0.3])
        sizes = 10 ** rng.uniform(-2, 0, (count, 1)) * size / duration
        kicks += list(sizes * (to + astray * rng.normal(size=(count, 3))))
    now, place, pieces = start, state(rng, orbit, size), []
    order = np.argsort(at)
    ends = np.append(start + duration * np.array(at)[order], start + duration)
    for k, end in zip([-1, *order], ends.tolist(), strict=True):
        place = place if k < 0 else place + np.append(np.zeros(3), kicks[k])
        pieces.append(orbit.coast(place, end - now, now))
        now, place = end, pieces[-1].state(end)
    path = cf.join(pieces)
    strength = path.delta_v / (duration * 10 ** rng.uniform(-3.5, -1.2))
    return path, cf.Thrusters.rtn(str(rng.choice(["orbit", "inertial"])), acceleration=strength)


def reflown(firing, mass, specific_impulse=np.inf):
    """Return edges (E,) of a spacecraft's pulses and states with mass (E, 7) there.

    Each pulse is integrated with constant force and decreasing mass.
    """
    path, pulses, thrusters = firing.path, firing.pulses, firing.thrusters[0]
    n, force = path.orbit.mean_motion, mass * thrusters.acceleration
    over = pulses.start + pulses.duration
    edges = np.unique(np.concatenate([[path.start, path.end], pulses.start, over]))
    states = [np.append(path.state(path.start), mass)]
    for a, b in zip(edges[:-1], edges[1:], strict=True):
        on = pulses.thruster[(pulses.start <= (a + b) / 2) & ((a + b) / 2 < over)]
        push, flow = force[on] @ thrusters.directions[on], force[on].sum() / (9.80665 * specific_impulse)

        def rates(t, s, push=push, flow=flow):
            u = push / s[6]
            if thrusters.frame == "inertial":
                c, q = np.cos(n * t), np.sin(n * t)
                u = np.array([u[0] * c + u[1] * q, u[1] * c - u[0] * q, u[2]])
            forced = [3 * n * n * s[0] + 2 * n * s[4] + u[0], -2 * n * s[3] + u[1], -n * n * s[2] + u[2]]
            return [*s[3:6], *forced, -flow]

        done = solve_ivp(rates, (a, b), states[-1], method="DOP853", rtol=1e-12, atol=1e-11, first_step=b - a)
        states.append(done.y[:, -1])
    return edges, np.array(states)


def deviation(firing, looks=40):
    """Return the distance of the pulsed path from the plan at many instants of each arc."""
    edges = np.unique(np.concatenate([firing.path.arcs[:, 0], firing.planned.arcs[:, 0], [firing.path.end]]))
    times = (
        (edges[:-1, None] + np.diff(edges)[:, None] * np.linspace(0, 1, looks)).ravel().clip(*edges[[0, -1]])
    )
    return np.linalg.norm(firing.path.position(times) - firing.planned.position(times), axis=1).max()
