"""Truth for motion beside an eccentric chief: Kepler's motion in many digits, linear equations integrated."""

import mpmath as mp
import numpy as np
from scipy.integrate import solve_ivp

import closeform as cf

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
