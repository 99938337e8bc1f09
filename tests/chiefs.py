"""Truth for motion beside an eccentric chief: Kepler's motion in many digits, linear equations integrated."""

from functools import cache

import mpmath as mp
import numpy as np
from scipy.integrate import solve_ivp

import closeform as cf
from closeform.motion.chief.oblate_or_supplied import frames, gradient, gravity

MU = cf.elements.EARTH_MU


def kepler_mp(state, time):
    """Return the inertial state after `time` of Kepler's motion with mu = 1, by f and g functions."""
    r, v = mp.matrix(state[:3]), mp.matrix(state[3:])
    size = mp.norm(r)
    a = 1 / (2 / size - (v.T * v)[0])
    n, along = a ** mp.mpf(-1.5), (r.T * v)[0] / mp.sqrt(a)
    change = n * time  # E - E0
    for _ in range(100):
        f = change - (1 - size / a) * mp.sin(change) + along * (1 - mp.cos(change)) - n * time
        step = f / (1 - (1 - size / a) * mp.cos(change) + along * mp.sin(change))
        change -= step
        if abs(step) < mp.mpf(10) ** (5 - mp.mp.dps):
            break
    f = 1 - a / size * (1 - mp.cos(change))
    g = time + (mp.sin(change) - change) / n
    place = f * r + g * v
    later = mp.norm(place)
    f_rate = -mp.sqrt(a) * mp.sin(change) / (size * later)
    return [*place, *(f_rate * r + (1 - a / later * (1 - mp.cos(change))) * v)]


def to_fifty_digits(state, time):
    """Return the position [m] after `time` [s] about the Earth in 50 digits."""
    with mp.workdps(50):
        root = mp.sqrt(mp.mpf(MU))
        place, speed = ([mp.mpf(float(one)) for one in part] for part in (state[:3], state[3:]))
        later = kepler_mp([*place, *(one / root for one in speed)], root * mp.mpf(float(time)))
        return [float(one) for one in later[:3]]


def chief_mp(e, s):
    """Return the chief's inertial state at eccentric anomaly s, with a = mu = 1."""
    c, q, root = mp.cos(s), mp.sin(s), mp.sqrt(1 - mp.mpf(e) ** 2)
    d = 1 - e * c
    return [c - e, root * q, mp.mpf(0), -q / d, root * c / d, mp.mpf(0)]


def turning_mp(chief):
    """Return the matrix from the chief's turning frame to inertial differences of states."""
    r = mp.matrix(chief[:3])
    size, h = mp.norm(r), chief[0] * chief[4] - chief[1] * chief[3]
    x, y = r / size, mp.matrix([-r[1], r[0], 0]) / size
    rate = h / size**2
    out = mp.zeros(6)
    for i in range(3):
        for block in (0, 3):
            out[block + i, block], out[block + i, block + 1] = x[i], y[i]
            out[block + i, block + 2] = 1 if i == 2 else 0
        out[3 + i, 0], out[3 + i, 1] = rate * y[i], -rate * x[i]
    return out


def transition_mp(e, first, second):
    """Return the transition matrix between eccentric anomalies by central differences in 60 digits."""
    with mp.workdps(60):
        first, second, e = mp.mpf(float(first)), mp.mpf(float(second)), mp.mpf(float(e))
        time = (second - e * mp.sin(second)) - (first - e * mp.sin(first))
        begin, step, flow = chief_mp(e, first), mp.mpf(10) ** -20, mp.zeros(6)
        for j in range(6):
            ends = []
            for sign in (1, -1):
                state = list(begin)
                state[j] += sign * step
                ends.append(kepler_mp(state, time))
            for i in range(6):
                flow[i, j] = (ends[0][i] - ends[1][i]) / (2 * step)
        found = turning_mp(chief_mp(e, second)) ** -1 * flow * turning_mp(begin)
        return np.array(found.tolist(), dtype=float)


def linear_matrix(orbit, time):
    """Return A (6, 6) of x' = A x beside a chief on an ellipse, from its radius and rates alone."""
    n, e, phase = orbit.chief.mean_motion, orbit.chief.eccentricity, orbit.chief.mean_anomaly
    mean = phase + n * time
    s = mean
    for _ in range(60):
        s -= (s - e * np.sin(s) - mean) / (1 - e * np.cos(s))
    a = (MU / n**2) ** (1 / 3)
    r = a * (1 - e * np.cos(s))
    h = np.sqrt(MU * a * (1 - e * e))
    w, r_rate = h / r**2, np.sqrt(MU * a) * e * np.sin(s) / r
    turn = -2 * w * r_rate / r
    out = np.zeros((6, 6))
    out[:3, 3:] = np.eye(3)
    k = MU / r**3
    out[3, [0, 1, 4]] = w * w + 2 * k, turn, 2 * w
    out[4, [0, 1, 3]] = -turn, w * w - k, -2 * w
    out[5, 2] = -k
    return out


def flown(orbit, state, times, thrust=None):
    """Return states (T, 6) at times by DOP853 on the linear equations, with a thrust (time) -> (3,)."""

    def rates(time, x):
        out = linear_matrix(orbit, time) @ x
        if thrust is not None:
            out[3:] += thrust(time)
        return out

    scale = np.abs(np.asarray(state, dtype=float)).max()
    return solve_ivp(
        rates, (times[0], times[-1]), state, method="DOP853", rtol=3e-14, atol=1e-14 * scale, t_eval=times
    ).y.T


@cache
def orbit_of(kind):
    if kind == "J2":
        return cf.Orbit.perturbed(
            0.01, 1.1, perigee_altitude=600e3, argument_of_perigee=0.4, true_anomaly=0.7, span=20_000.0
        )
    return cf.Orbit.eccentric(kind, perigee_altitude=700e3, true_anomaly=2.0)


def matrices_by_integration(orbit, times):
    """Return the matrices (T, 6, 6) from the first of `times`, by DOP853."""
    if not hasattr(orbit.chief, "j2"):
        y = solve_ivp(
            lambda time, y: (linear_matrix(orbit, time) @ y.reshape(6, 6)).ravel(),
            (times[0], times[-1]),
            np.eye(6).ravel(),
            method="DOP853",
            rtol=1e-12,
            atol=1e-12,
            t_eval=times,
        ).y
        return y.T.reshape(-1, 6, 6)
    chief, bulge = orbit.chief, orbit.chief.j2 * orbit.chief.radius**2

    def rates(_, y):
        flow = y[6:].reshape(6, 6)
        turned = gradient(y[:3], chief.mu, bulge) @ flow[:3]
        return np.concatenate([y[3:6], gravity(y[:3], chief.mu, bulge), flow[3:].ravel(), turned.ravel()])

    y0 = np.concatenate([chief.state, np.eye(6).ravel()])
    atol = np.concatenate([[1e-6] * 3, [1e-9] * 3, np.full(36, 1e-12)])
    span = 0.0, times[-1]
    found = solve_ivp(rates, span, y0, method="DOP853", rtol=1e-12, atol=atol, t_eval=times).y.T
    into = [frames(y[:6], chief.mu, bulge)[0] @ y[6:].reshape(6, 6) for y in found]
    return np.array(into) @ np.linalg.inv(into[0])


def with_impulses(path, times):
    """Return the states (T, 6) under a path's impulses by integrated transition matrices."""
    every = np.union1d(times, [time for time, _ in path.impulses])
    flows = matrices_by_integration(path.orbit, every)
    begun = path.state(path.start)
    out = np.repeat(begun[None], len(every), axis=0)
    for time, jump in path.impulses:
        k = np.searchsorted(every, time)
        if k:
            out[k:] += np.linalg.inv(flows[k])[:, 3:] @ jump
    return (flows @ out[:, :, None])[np.isin(every, times), :, 0]
