"""Simulations of small formations about a chief, and an independent model of its motion."""

import numpy as np
from scipy.integrate import solve_ivp

import closeform as cf
from closeform.dynamics.force_model.field import GRAVITY_RADIUS

MU = cf.elements.EARTH_MU
EPOCH = "2026-11-22T12:00:00"
J2 = 1.082635854e-3


def chief(e: float = 1e-3, inclination: float = 0.9, a: float = 6.878e6, latitude: float = 0.7) -> cf.Chief:
    return cf.Chief.from_elements(EPOCH, [a, latitude, e, 0.0, inclination, 0.3])


def task(orbit: cf.Orbit, seed: int, count: int = 2, size: float = 400.0, turns: float = 1.2):
    draws = np.random.default_rng(seed)
    scale = size * np.repeat([1.0, orbit.mean_motion], 3)
    return *(draws.normal(size=(2, count, 6)) * scale), turns * orbit.period


FIELD = cf.Field(chief())
ORBIT, SIGHT = FIELD.chief.orbit, cf.Navigation(0.1, 3e-4)


def formation(turns: float = 1.0, count: int = 4) -> cf.Path:
    return ORBIT.transfer(*task(ORBIT, 7, count, turns=turns))


def kicked() -> cf.Path:
    return ORBIT.impulsive(*task(ORBIT, 7, 4, turns=0.9))


def swap() -> np.ndarray:
    """Return states (3, 6) at rest; the first two change places past the third."""
    states = np.zeros((3, 6))
    states[:, 1], states[:, 2] = [0.0, 15.0, 90.0], [140.0, -140.0, 0.0]
    return states


def textbook(place: np.ndarray) -> np.ndarray:
    """Return the acceleration of a point mass and J2 (Vallado 2013, 8-30) at positions (..., 3)."""
    r = np.linalg.norm(place, axis=-1, keepdims=True)
    square = (place[..., 2:] / r) ** 2
    factor = 1.5 * J2 * (GRAVITY_RADIUS / r) ** 2
    shape = 1.0 + factor * (1.0 - 5.0 * square) + 2.0 * factor * np.array([0.0, 0.0, 1.0])
    return -MU / r**3 * place * shape


def axes_of(state: np.ndarray) -> np.ndarray:
    radial = state[:3] / np.linalg.norm(state[:3])
    normal = np.cross(state[:3], state[3:])
    normal /= np.linalg.norm(normal)
    return np.stack([radial, np.cross(normal, radial), normal])


def turn_of(state: np.ndarray) -> np.ndarray:
    """Return the angular velocity (3,) of the chief's axes, in these axes, by finite differences."""
    dt, felt = 0.05, textbook(state[:3])
    ahead, behind = (
        axes_of(np.concatenate([state[:3] + t * state[3:] + 0.5 * t * t * felt, state[3:] + t * felt]))
        for t in (dt, -dt)
    )
    rate = axes_of(state) @ ((ahead - behind) / (2.0 * dt)).T
    return np.array([rate[2, 1], rate[0, 2], rate[1, 0]])


def flown(path: cf.Path, start: np.ndarray, duration: float, command) -> np.ndarray:
    """Return relative positions (N, 3) after DOP853 under the thrust `command(time)` (N, 3)."""
    origin = chief().state
    axes, turn = axes_of(origin), turn_of(origin)
    craft = np.hstack(
        [origin[:3] + start[:, :3] @ axes, origin[3:] + (start[:, 3:] + np.cross(turn, start[:, :3])) @ axes]
    )

    def rates(t, y):
        states = y.reshape(-1, 6)
        felt = textbook(states[:, :3])
        felt[1:] += command(t) @ axes_of(states[0])
        return np.hstack([states[:, 3:], felt]).ravel()

    end = solve_ivp(
        rates, (0.0, duration), np.vstack([origin, craft]).ravel(), "DOP853", rtol=1e-11, atol=1e-6
    )
    states = end.y[:, -1].reshape(-1, 6)
    return (states[1:, :3] - states[0, :3]) @ axes_of(states[0]).T


def beside(origin: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Return inertial states (12,) of a chief and of a spacecraft at `start` (6,) in its axes."""
    axes = axes_of(origin)
    swung = start[3:] + np.cross(turn_of(origin), start[:3])
    return np.concatenate([origin, origin[:3] + start[:3] @ axes, origin[3:] + swung @ axes])


def fired(start, times, impulses, duration: float) -> np.ndarray:
    """Return the state (6,) of a spacecraft after DOP853 with impulses, all in the chief's axes."""
    both = beside(chief().state, start)

    def rates(t, y):
        states = y.reshape(2, 6)
        return np.hstack([states[:, 3:], textbook(states[:, :3])]).ravel()

    now = 0.0
    for time, impulse in zip([*times, duration], [*impulses, np.zeros(3)], strict=True):
        if time > now:
            both = solve_ivp(rates, (now, time), both, "DOP853", rtol=1e-11, atol=1e-6).y[:, -1]
        both[9:] += impulse @ axes_of(both[:6])
        now = time
    off = (both[6:] - both[:6]).reshape(2, 3) @ axes_of(both[:6]).T
    off[1] -= np.cross(turn_of(both[:6]), off[0])
    return off.ravel()


def pushed(
    origin: np.ndarray,
    start: np.ndarray,
    burns: list[tuple[float, float, np.ndarray]],
    span: tuple[float, float],
) -> np.ndarray:
    """Return the final position (3,) of a spacecraft after DOP853 with burns (from, to, thrust).

    `start` (6,), thrust and result are in the axes of the chief, whose inertial state is `origin` (6,).
    """
    both, ends = beside(origin, start), np.unique([*span, *(edge for one in burns for edge in one[:2])])
    for begin, over in zip(ends[:-1], ends[1:], strict=True):
        push = sum((way for on, off, way in burns if on <= begin and off >= over), np.zeros(3))

        def rates(t, y, push=push):
            states = y.reshape(2, 6)
            felt = textbook(states[:, :3])
            felt[1] += push @ axes_of(states[0])
            return np.hstack([states[:, 3:], felt]).ravel()

        both = solve_ivp(rates, (begin, over), both, "DOP853", rtol=1e-9, atol=1e-4).y[:, -1]
    return axes_of(both[:6]) @ (both[6:9] - both[:3])


def flown_apart(path: cf.Path, field: cf.Field, times: np.ndarray) -> np.ndarray:
    """Return relative positions (N, T, 3) under planned thrust by DOP853 in a textbook's J2."""
    origin = field.chief.state
    felt = textbook(origin[:3])
    start = cf.elements.inertial_from_relative(origin, path.state(0.0), acceleration=felt)
    end = float(path.end[0])

    def rates(t, y):
        states = y.reshape(-1, 6)
        felt = textbook(states[:, :3])
        felt[1:] += path.thrust(min(t, end)) @ axes_of(states[0])
        return np.hstack([states[:, 3:], felt]).ravel()

    first = np.vstack([origin, start]).ravel()
    found = solve_ivp(rates, (0.0, end), first, "DOP853", times, rtol=1e-11, atol=1e-6)
    states = found.y.T.reshape(len(times), -1, 6)
    axes = np.stack([axes_of(one[0]) for one in states])
    return np.einsum("tij,tnj->nti", axes, states[:, 1:, :3] - states[:, :1, :3])


def deviations(path: cf.Path, flights: cf.Simulation) -> np.ndarray:
    return (flights.states - path.state(flights.times))[..., :3]


def at(margins: cf.TrackingMargins, what: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return values (N, T, ...) at the times of the margins, interpolated to other times."""
    flat = what.reshape(len(what), len(margins.times), -1)
    found = [[np.interp(times, margins.times, column) for column in one.T] for one in flat]
    return np.moveaxis(np.array(found), 1, 2).reshape(len(what), len(times), *what.shape[2:])
