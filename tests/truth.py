"""Independent truth for motion and conflicts; nothing here uses the package.

`Reference` is theory in 200 digits: Palmer's phase coordinates (equations 2-9), whose
cancellation at small n t costs digits that are there to lose.  `Simulation` is Hill's
equations themselves, integrated by Taylor series of degree 16 over at most half a radian, for
a batch of craft at once; `extrema` samples the norm of a relative motion densely and refines
every minimum and maximum between the samples.
"""

from dataclasses import dataclass
from math import ceil, factorial

import mpmath as mp
import numpy as np

DIGITS = 200
DEGREE = 16
REACH = 0.5  # rad of n t for one series; the first term left out is below 1e-19


class Reference:
    """Motion in an orbit of mean motion n > 0, exact for all practical purposes."""

    def __init__(self, n):
        mp.mp.dps = DIGITS
        self.n = mp.mpf(float(n))

    def palmer(self, state):
        x, y, z, vx, vy, vz = [mp.mpf(float(s)) for s in state]
        n = self.n
        return mp.matrix([3 * x + 2 * vy / n, vx / n, 2 * x + vy / n, y - 2 * vx / n, z, vz / n])  # (2)

    def cartesian(self, p):
        e1, e2, d, along, h1, h2 = p
        n = self.n
        return [2 * d - e1, along + 2 * e2, h1, n * e2, n * (2 * e1 - 3 * d), n * h2]  # (3)

    def flow(self, tau):
        c, s = mp.cos(tau), mp.sin(tau)
        rows = [[c, -s, 0, 0, 0, 0], [s, c, 0, 0, 0, 0], [0, 0, 1, 0, 0, 0]]
        rows += [[0, 0, -3 * tau, 1, 0, 0], [0, 0, 0, 0, c, s], [0, 0, 0, 0, -s, c]]
        return mp.matrix(rows)

    def gramian(self, t):
        c, s, s2 = mp.cos(t), mp.sin(t), mp.sin(2 * t)
        w = mp.zeros(6)
        entries = {
            (0, 0): 5 * t / 2 + 3 * s2 / 4,
            (0, 1): 3 * s * s / 2,
            (0, 2): 2 * s,
            (0, 3): 8 - 8 * c - 6 * t * s,
            (1, 1): 5 * t / 2 - 3 * s2 / 4,
            (1, 2): 2 - 2 * c,
            (1, 3): 6 * t * c - 8 * s,
            (2, 2): t,
            (2, 3): -3 * t * t / 2,
            (3, 3): t * (3 * t * t + 4),
            (4, 4): t / 2 - s2 / 4,
            (4, 5): s * s / 2,
            (5, 5): t / 2 + s2 / 4,
        }
        for (i, j), value in entries.items():
            w[i, j] = w[j, i] = value  # (9)
        return w

    def coast(self, state, t):
        return self.cartesian(self.flow(self.n * mp.mpf(float(t))) * self.palmer(state))

    def burn(self, state, push, t):
        tau = self.n * mp.mpf(float(t))
        ux, uy, uz = [mp.mpf(float(u)) / self.n**2 for u in push]
        c, s = mp.cos(tau), mp.sin(tau)
        p = self.flow(tau) * self.palmer(state)
        p[0] += 2 * uy * s - ux * (1 - c)
        p[1] += 2 * uy * (1 - c) + ux * s
        p[2] += uy * tau
        p[3] += -2 * ux * tau - 3 * uy * tau**2 / 2
        p[4] += uz * (1 - c)
        p[5] += uz * s
        return self.cartesian(p)

    def transfer(self, initial, final, duration):
        """The optimal path: functions of time for state and thrust, and its energy."""
        n = self.n
        tau = n * mp.mpf(float(duration))
        p0 = self.palmer(initial)
        gap = self.palmer(final) - self.flow(tau) * p0
        mu = mp.lu_solve(self.gramian(tau), gap)  # (7)

        def state(t):
            s = n * mp.mpf(float(t))
            return self.cartesian(self.flow(s) * p0 + self.gramian(s) * (self.flow(tau - s).T * mu))

        def thrust(t):
            q = self.flow(tau - n * mp.mpf(float(t))).T * mu
            return [n**2 * (q[1] - 2 * q[3]), n**2 * (2 * q[0] + q[2]), n**2 * q[5]]  # (8)

        return state, thrust, n**3 * (gap.T * mu)[0] / 2


def series(n, state, steering, push, h):
    """Taylor coefficients (M, DEGREE + 1, 3) in t / h of position, of the steering thrust and of the push.

    `push` (M, 4, 3): its first derivatives; each axis of it oscillates, about what grows evenly.
    """
    count = len(state)
    r, u, w = np.zeros((3, count, DEGREE + 1, 3), dtype=np.longdouble)
    r[:, 0], r[:, 1] = state[:, :3], state[:, 3:] * h
    u[:, 0], u[:, 1] = steering[:, :3], steering[:, 3:] * h
    for k in range(4):
        w[:, k] = push[:, k] * h**k / factorial(k)
    for k in range(4, DEGREE + 1):
        w[:, k] = -((n * h) ** 2) * w[:, k - 2] / (k * (k - 1))
    stiff = np.array([3.0, 0.0, -1.0]) * (n * h) ** 2
    for k in range(DEGREE - 1):
        for f in (u, r):
            g = stiff * f[:, k]
            g[:, 0] += 2 * n * h * (k + 1) * f[:, k + 1, 1]
            g[:, 1] -= 2 * n * h * (k + 1) * f[:, k + 1, 0]
            if f is r:
                g = g + h * h * (u[:, k] + w[:, k])
            f[:, k + 2] = g / ((k + 1) * (k + 2))
    return r, u, w


def ends(coefficients, h):
    """Value and rate (M, 6) at the end of one step of a series."""
    k = np.arange(DEGREE + 1)[:, None]
    return np.concatenate([coefficients.sum(axis=1), (k * coefficients).sum(axis=1) / h], axis=1)


def derivatives(coefficients, h):
    """The first derivatives (M, 4, 3) at the end of one step of a series."""
    k = np.arange(DEGREE + 1)[:, None]
    falling = [np.ones_like(k), k, k * (k - 1), k * (k - 1) * (k - 2)]
    return np.stack([(f * coefficients).sum(axis=1) / h**m for m, f in enumerate(falling)], axis=1)


class Flight:
    """Motions of M craft over one time grid, as polynomials (M, P, DEGREE + 1, 3) of t / h.

    Built leg by leg, each of the same times for the whole batch.
    """

    def __init__(self, n, state, start=0.0):
        self.n = n
        self.state = np.array(state, dtype=np.longdouble)
        self.grid = [start]
        self.pieces = []
        self.fitted = False  # whether constants were solved for

    def _steps(self, duration, n):
        count = max(1, ceil(n * duration / REACH))
        return np.full(count, duration / count)

    def _run(self, state, steering, push, duration):
        found = []
        push = np.zeros((len(state), 4, 3)) + push
        for h in self._steps(duration, self.n):
            r, u, w = series(self.n, state, steering, push, h)
            found.append(r.astype(float))
            state, steering, push = ends(r, h), ends(u, h), derivatives(w, h)
        return state, found

    def _fly(self, steering, push, duration):
        start = self.grid[-1]
        self.state, found = self._run(self.state, steering, push, duration)
        self.pieces += found
        self.grid += list(start + np.cumsum(self._steps(duration, self.n)))
        self.grid[-1] = start + duration
        return self

    def coast(self, duration):
        return self._fly(np.zeros_like(self.state), 0.0, duration)

    def burn(self, push, duration):
        constant = np.zeros((len(self.state), 4, 3))
        constant[:, 0] = push
        return self.push(constant, duration)

    def push(self, derivatives, duration):
        """Thrust by its first derivatives (M, 4, 3)."""
        return self._fly(np.zeros_like(self.state), derivatives, duration)

    def kick(self, jump):
        self.state = self.state + np.concatenate([np.zeros_like(jump), jump], axis=1)
        return self

    def transfer(self, final, duration):
        """Steer to `final` (M, 6): thrust u with u'' = Nu + Su', its six constants fitted to the end."""
        self.fitted = True
        lengths = np.repeat([1.0, duration], 3)
        units = np.diag(np.repeat([duration**-2, duration**-3], 3))
        response = (self._run(np.zeros((6, 6)), units, 0.0, duration)[0] * lengths).T.astype(float)
        steering = np.zeros_like(self.state)
        for _ in range(3):
            reached, _ = self._run(self.state, steering, 0.0, duration)
            gap = ((final - reached) * lengths).T.astype(float)
            steering = steering + np.linalg.solve(response, gap).T @ units
        return self._fly(steering, 0.0, duration)

    def two_impulse(self, final, duration):
        """Drift to the place of `final` (M, 6) between two impulses."""
        self.fitted = True
        for _ in range(2):
            reached, _ = self._run(self.state, np.zeros_like(self.state), 0.0, duration)
            units = np.concatenate([np.zeros((3, 3)), np.eye(3)], axis=1)
            response = self._run(units, np.zeros((3, 6)), 0.0, duration)[0][:, :3].T.astype(float)
            self.kick(np.linalg.solve(response, (final - reached)[:, :3].T.astype(float)).T)
        self.coast(duration)
        self.state = np.array(final, dtype=np.longdouble)
        return self

    def hermite(self, times, states):
        """Cubics through `states` (M, T, 6) at `times` (T,) from the last time on."""
        for k, h in enumerate(np.diff(times)):
            r0, v0 = states[:, k, :3], states[:, k, 3:] * h
            r1, v1 = states[:, k + 1, :3], states[:, k + 1, 3:] * h
            cubic = np.zeros((len(states), DEGREE + 1, 3))
            cubic[:, 0], cubic[:, 1] = r0, v0
            cubic[:, 2] = 3 * (r1 - r0) - 2 * v0 - v1
            cubic[:, 3] = -2 * (r1 - r0) + v0 + v1
            self.pieces.append(cubic)
            self.grid.append(times[k + 1])
        self.state = np.array(states[:, -1], dtype=np.longdouble)
        return self

    def on(self, grid):
        """Polynomials (M, P, DEGREE + 1, 3) of the same motion over a finer grid."""
        own = np.array(self.grid)
        all_pieces = np.stack(self.pieces, axis=1)
        which = np.clip(np.searchsorted(own, 0.5 * (grid[1:] + grid[:-1])) - 1, 0, len(own) - 2)
        h = np.diff(own)[which]
        shift, ratio = (grid[:-1] - own[which]) / h, np.diff(grid) / h
        moved = all_pieces[:, which].copy()
        shifted = np.abs(shift) > 0
        for j in range(DEGREE):  # Taylor shift by repeated synthetic division
            for k in range(DEGREE - 1, j - 1, -1):
                moved[:, shifted, k] += shift[shifted, None] * moved[:, shifted, k + 1]
        return moved * ratio[:, None, None] ** np.arange(DEGREE + 1)[:, None]


def parts(shape, r, v):
    """What the norm of a zone is the largest of, at coordinates r (..., R), and the rates of it."""
    if shape == "faces":
        return r, v
    if shape == "box":
        return np.abs(r), np.where(r == 0, np.abs(v), np.sign(r) * v)
    if shape == "cylinder":
        both = parts("ball", r[..., :2], v[..., :2]), parts("box", r[..., 2:], v[..., 2:])
        return tuple(np.concatenate(columns, axis=-1) for columns in zip(*both, strict=True))
    s = np.sqrt((r * r).sum(axis=-1, keepdims=True))
    with np.errstate(invalid="ignore", divide="ignore"):
        rate = np.where(
            s > 0, (r * v).sum(axis=-1, keepdims=True) / s, np.sqrt((v * v).sum(axis=-1))[..., None]
        )
    return s, rate


@dataclass
class Relative:
    """Relative motions of M pairs in zone coordinates on one grid, as many as the zone's shape has."""

    grid: np.ndarray
    pieces: np.ndarray  # (M, P, DEGREE + 1, R)
    shape: str  # see `parts`
    rounding: np.ndarray  # (M,) of the norm, by the largest coordinate of either craft

    @classmethod
    def between(cls, flight, other, matrix, shape):
        """Over the common time; `matrix` (M, R, 3) maps positions to zone coordinates."""
        start, end = max(flight.grid[0], other.grid[0]), min(flight.grid[-1], other.grid[-1])
        grid = np.unique(np.concatenate([flight.grid, other.grid, [start, end]]))
        grid = grid[(grid >= start) & (grid <= end)]
        # joints of both that differ by rounding are one
        grid = grid[np.append(True, np.diff(grid) > 1e-11 * (end - start) + 1e-15 * abs(end))]
        grid[-1] = end
        both = flight.on(grid), other.on(grid)
        # angles of many turns and drifts over long times round more; a fit over them more still
        sizes = [np.abs(one).sum(axis=2).max(axis=(1, 2)) for one in both]
        rounding = sum(
            5e-16 * (8 + len(grid)) * (8 if one.fitted else 1) * size
            for one, size in zip((flight, other), sizes, strict=True)
        )
        gap = np.einsum("mij,mpkj->mpki", matrix, both[0] - both[1])
        return cls(grid, gap, shape, rounding * np.abs(matrix).max(axis=(1, 2)))

    def at(self, pair, t):
        """Norm and its rate to the right for `pair` (K,) at times (K,)."""
        p = np.clip(np.searchsorted(self.grid, t, side="right") - 1, 0, len(self.grid) - 2)
        h = self.grid[p + 1] - self.grid[p]
        u = ((t - self.grid[p]) / h)[:, None]
        c = self.pieces[pair, p]
        r, v = c[:, DEGREE].copy(), np.zeros_like(c[:, 0])
        for k in range(DEGREE - 1, -1, -1):
            v = v * u + r
            r = r * u + c[:, k]
        v /= h[:, None]
        sizes, rates = parts(self.shape, r, v)
        s = sizes.max(axis=-1, keepdims=True)
        return s[..., 0], np.where(sizes >= s, rates, -np.inf).max(axis=-1)

    def sampled(self, per_piece):
        """Times (K,) and norms (M, K), the grid itself among them."""
        u = np.linspace(0.0, 1.0, per_piece, endpoint=False)
        r = np.zeros((*self.pieces.shape[:2], len(u), self.pieces.shape[-1]))
        for k in range(DEGREE, -1, -1):
            r *= u[:, None]
            r += self.pieces[:, :, k, None]
        r = np.concatenate(
            [r.reshape(len(r), -1, r.shape[-1]), self.pieces[:, -1].sum(axis=1)[:, None]], axis=1
        )
        times = (self.grid[:-1, None] + np.diff(self.grid)[:, None] * u).ravel()
        return np.append(times, self.grid[-1]), parts(self.shape, r, r)[0].max(axis=-1)

    def extrema(self, per_piece=None):
        """Samples (times (K,), norms (M, K)) and every extremum between: pair, time, norm, is least."""
        if per_piece is None:
            per_piece = max(40, ceil(400 / (len(self.grid) - 1)))
        times, s = self.sampled(per_piece)
        found = []
        for sign in (1.0, -1.0):
            left = np.concatenate([np.full((len(s), 1), np.inf), sign * s[:, :-1]], axis=1)
            right = np.concatenate([sign * s[:, 1:], np.full((len(s), 1), np.inf)], axis=1)
            pair, k = np.nonzero((sign * s <= left) & (sign * s < right))
            # both sides of the sample: at a joint or a corner of the box each may have its own
            pair, k, middle = np.tile(pair, 2), np.tile(k, 2), times[k]
            low = np.concatenate([times[np.maximum(k[: len(middle)] - 1, 0)], middle])
            high = np.concatenate([middle, times[np.minimum(k[: len(middle)] + 1, len(times) - 1)]])
            best, best_time = sign * s[pair, k], times[k].copy()
            for _ in range(52):
                middle = 0.5 * (low + high)
                here, rate = self.at(pair, middle)
                better = sign * here < best
                best = np.where(better, sign * here, best)
                best_time = np.where(better, middle, best_time)
                falls = sign * rate < 0
                low, high = np.where(falls, middle, low), np.where(falls, high, middle)
            found.append((pair, best_time, sign * best, np.full(len(pair), sign > 0)))
        return times, s, tuple(np.concatenate(column) for column in zip(*found, strict=True))


def faults(relative, extrema, conflicts):
    """Return the faults of the conflicts [(start, end, time, ratio), ...] of each pair as texts.

    Outside of all stays no norm may be below 1, inside none above 1, every start and end within
    the common time must be on the surface, each to 1e-12 and rounding; the least ratio to 1e-9.
    """
    times, s, (who, when, norms, _) = extrema
    words = []
    span = relative.grid[-1] - relative.grid[0]
    for pair, stays in enumerate(conflicts):
        said = []
        mine = who == pair
        t, f = np.concatenate([times, when[mine]]), np.concatenate([s[pair], norms[mine]])
        inside = np.zeros(len(t), dtype=bool)
        tiny = 1e-12 + relative.rounding[pair]
        for start, end, time, ratio in stays:
            within = (t >= start) & (t <= end)
            inside |= within
            at, rates = relative.at(np.full(3, pair), np.array([start, end, time]))
            edges = start <= relative.grid[0], end >= relative.grid[-1]
            for edge, norm, rate in zip(edges, at, rates, strict=False):
                if edge and norm > 1 + tiny:
                    said.append(f"false: edge at norm {norm!r}")
                # a time is exact to an ulp of the span
                if not edge and abs(norm - 1) > tiny + 2.3e-16 * span * abs(rate):
                    said.append(f"surface: norm {norm!r} at a crossing")
            least = min([*f[within], *at])
            if max(abs(ratio - least), abs(at[2] - ratio)) > 1e-9 * abs(least) + tiny:
                said.append(f"ratio: {ratio!r}, sampled {least!r}")
            if within.any() and f[within].max() > 1 + tiny:
                said.append(f"false: norm {f[within].max()!r} inside of a stay")
        if not inside.all() and f[~inside].min() < 1 - tiny:
            said.append(f"missed: norm {f[~inside].min()!r} outside of all stays")
        words.append(said)
    return words
