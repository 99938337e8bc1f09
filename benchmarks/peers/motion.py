"""Relative motion for the peers, independent of closeform: Palmer coordinates in plain NumPy.

A motion is an array of coefficients `(..., 3, 8)` of the functions of the angle tau = n t

    1, tau, tau^2, tau^3, cos tau, sin tau, tau cos tau, tau sin tau                # theory 2

so that differences of motions are differences of arrays. Natural motion uses columns 0, 1, 4 and 5. It is
accurate for n > 0 and transfers of more than half a radian; shorter ones lose digits.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def palmer(states: Array, n: float) -> Array:
    """States `(..., 6)` [m, m/s] -> e1, e2, d, l, h1, h2 [m].  # theory (2)"""
    x, y, z, vx, vy, vz = np.moveaxis(np.asarray(states, dtype=float), -1, 0)
    columns = [3 * x + 2 * vy / n, vx / n, 2 * x + vy / n, y - 2 * vx / n, z, vz / n]
    return np.stack(columns, axis=-1)


def states_of(coordinates: Array, n: float) -> Array:
    """Palmer's coordinates -> states.  # theory (3)"""
    e1, e2, d, along, h1, h2 = np.moveaxis(coordinates, -1, 0)
    columns = [2 * d - e1, along + 2 * e2, h1, n * e2, n * (2 * e1 - 3 * d), n * h2]
    return np.stack(columns, axis=-1)


def natural(states: Array, n: float) -> Array:
    """Coefficients of natural motion.  # theory (5)"""
    return steered(palmer(states, n), np.zeros(np.shape(states)))


def steered(start: Array, steering: Array) -> Array:
    """Coefficients from Palmer's coordinates and those of the thrust over n^2, itself a natural motion."""
    e1, e2, d, along, h1, h2 = np.moveaxis(start, -1, 0)
    E1, E2, D, L, H1, H2 = np.moveaxis(steering, -1, 0)
    out = np.zeros((*np.broadcast(e1, E1).shape, 3, 8))
    # e1 + i e2 solves e' = i e + 2 u_y + i u_x: free and forced parts e^(i tau), tau e^(i tau), e^(-i tau)
    rising = 2.5 * (E2 - 1j * E1)
    falling = 0.75 * (1j * E2 - E1)
    free = e1 + 1j * e2 - (2j * L - 8 * D + falling)
    # semi-major-axis difference d and along-track offset l, by the powers of tau
    out[..., 0, :] = 2 * np.stack([d + 2 * E1, L, -1.5 * D, 0 * D, -2 * E1, 2 * E2, 0 * D, 0 * D], -1)
    out[..., 1, 0] = along - 8 * E2
    out[..., 1, 1] = -3 * d - 4 * D - 6 * E1
    out[..., 1, 2] = -1.5 * L
    out[..., 1, 3] = 1.5 * D
    out[..., 1, 4] = 8 * E2
    out[..., 1, 5] = 8 * E1
    eccentricity = np.stack(
        [
            -8 * D + 2j * L,
            -6j * D,
            0j * D,
            0j * D,
            free + falling,
            1j * (free - falling),
            rising,
            1j * rising,
        ],
        -1,
    )
    out[..., 0, :] -= eccentricity.real
    out[..., 1, :] += 2 * eccentricity.imag
    out[..., 2, 4] = h1
    out[..., 2, 5] = h2 + H2 / 2
    out[..., 2, 6] = -H2 / 2
    out[..., 2, 7] = H1 / 2
    return out


def transfer(initial: Array, final: Array, duration: float, n: float) -> Array:
    """Coefficients of the energy-optimal transfers between states `(..., 6)` in `duration`."""
    start = palmer(initial, n)
    missing = np.asarray(final) - state(steered(start, np.zeros_like(start)), duration, n)
    columns = state(steered(np.zeros(6), np.eye(6)), duration, n)
    scale = np.array([1, 1, 1, n, n, n])
    steering = np.linalg.solve(columns.T / scale[:, None], (missing / scale)[..., None])[..., 0]
    return steered(start, steering)


def functions(tau: Array) -> Array:
    """The eight functions `(T, 8)`."""
    tau = np.asarray(tau, dtype=float)
    c, s, one = np.cos(tau), np.sin(tau), np.ones_like(tau)
    return np.stack([one, tau, tau**2, tau**3, c, s, tau * c, tau * s], axis=-1)


def slopes(tau: Array) -> Array:
    """Their derivatives with respect to tau."""
    tau = np.asarray(tau, dtype=float)
    c, s, one = np.cos(tau), np.sin(tau), np.ones_like(tau)
    return np.stack([0 * one, one, 2 * tau, 3 * tau**2, -s, c, c - tau * s, s + tau * c], axis=-1)


def position(coefficients: Array, times: Array, n: float) -> Array:
    """Positions `coefficients.shape[:-2] + (T, 3)`."""
    return functions(n * np.asarray(times)) @ np.swapaxes(coefficients, -1, -2)


def state(coefficients: Array, time: float, n: float) -> Array:
    """States `(..., 6)` at one time."""
    r = coefficients @ functions(np.array(n * time))
    v = n * (coefficients @ slopes(np.array(n * time)))
    return np.concatenate([r, v], axis=-1)


def thrust(coefficients: Array, times: Array, n: float) -> Array:
    """Thrust accelerations `coefficients.shape[:-2] + (T, 3)` of motions by Hill's equations."""
    tau = n * np.asarray(times)
    c, s, one = np.cos(tau), np.sin(tau), np.ones_like(tau)
    curves = np.stack([0 * one, 0 * one, 2 * one, 6 * tau, -c, -s, -2 * s - tau * c, 2 * c - tau * s], -1)
    across = np.swapaxes(coefficients, -1, -2)
    x, _, z = np.moveaxis(functions(tau) @ across, -1, 0)
    vx, vy, _ = n * np.moveaxis(slopes(tau) @ across, -1, 0)
    free = np.stack([3 * n * n * x + 2 * n * vy, -2 * n * vx, -n * n * z], axis=-1)
    return np.asarray(n * n * (curves @ across) - free)


def held(n: float, dt: float) -> tuple[Array, Array]:
    """Transition `(6, 6)` over `dt` and effect `(6, 3)` of a thrust held constant in the rotating frame."""
    a = n * dt
    s, c = np.sin(a), np.cos(a)
    k = 2 * np.sin(a / 2) ** 2
    drift = a - s
    phi = np.array(
        [
            [1 + 3 * k, 0, 0, s / n, 2 * k / n, 0],
            [-6 * drift, 1, 0, -2 * k / n, (4 * s - 3 * a) / n, 0],
            [0, 0, c, 0, 0, s / n],
            [3 * n * s, 0, 0, c, 2 * s, 0],
            [-6 * n * k, 0, 0, -2 * s, 1 - 4 * k, 0],
            [0, 0, -n * s, 0, 0, c],
        ]
    )
    gamma = np.array(
        [
            [k / n**2, 2 * drift / n**2, 0],
            [-2 * drift / n**2, 4 * k / n**2 - 1.5 * dt**2, 0],
            [0, 0, k / n**2],
            [s / n, 2 * k / n, 0],
            [-2 * k / n, (4 * s - 3 * a) / n, 0],
            [0, 0, s / n],
        ]
    )
    return phi, gamma
