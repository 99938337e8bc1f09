"""Formations that are tracked in a force model."""

import numpy as np

import closeform as cf

CHIEF = cf.Chief.from_elements("2026-11-22T12:00:00", [6.878e6, 0.7, 1e-3, 0.0, 0.9, 0.3])
ORBIT, FIELD = CHIEF.orbit, cf.Field(CHIEF)
SIGHT, OFF = cf.Navigation(0.1, 3e-4), (0.01, np.radians(1.0))


def formation(turns: float = 1.0, count: int = 4) -> cf.Path:
    draws = np.random.default_rng(7)
    scale = 400.0 * np.repeat([1.0, ORBIT.mean_motion], 3)
    return ORBIT.transfer(*(draws.normal(size=(2, count, 6)) * scale), turns * ORBIT.period)


def deviations(path: cf.Path, flights: cf.Simulation) -> np.ndarray:
    return (flights.states - path.state(flights.times))[..., :3]


def at(room: cf.TrackingMargins, what: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return values (N, T, ...) at the times of the margins, interpolated to other times."""
    flat = what.reshape(len(what), len(room.times), -1)
    found = [[np.interp(times, room.times, column) for column in one.T] for one in flat]
    return np.moveaxis(np.array(found), 1, 2).reshape(len(what), len(times), *what.shape[2:])


def kicked() -> cf.Path:
    draws = np.random.default_rng(7)
    scale = 400.0 * np.repeat([1.0, ORBIT.mean_motion], 3)
    return ORBIT.impulsive(*(draws.normal(size=(2, 4, 6)) * scale), 0.9 * ORBIT.period)


def swap() -> np.ndarray:
    states = np.zeros((3, 6))
    states[:, 1], states[:, 2] = [0.0, 15.0, 90.0], [140.0, -140.0, 0.0]
    return states
