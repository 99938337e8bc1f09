"""Least-energy paths around zones by brute force; nothing here uses the package.

The kernel of paths with fixed ends (theory 12) comes from exponentials of Hill's matrix alone.
`cheapest` then minimises the energy of a deviation, spanned by the kernel at some nodes, with
the norm of every zone at least 1 at many times, by SciPy's SLSQP from many sides of the zones.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm
from scipy.optimize import minimize, minimize_scalar

NODES, SAMPLES = 11, 120  # of the first pass
KEPT, FINER = 3, 6  # optima of the first pass that are refined, and samples for one near the zones
CORNERED, CUT = 6, 2e-4  # times that cut corners get samples, and how deep a cut may stay
CORNERS = np.stack(np.meshgrid([1, -1], [1, -1], [1, -1]), axis=-1).reshape(8, 3)
SIDES = np.concatenate([np.eye(3), -np.eye(3), CORNERS])


@dataclass
class Hindrance:
    """What to keep clear of: base path minus obstacle as a function of times, (T,) -> (T, 3)."""

    gap: object
    matrix: np.ndarray
    box: bool

    def norms(self, gaps):
        scaled = np.abs(gaps @ self.matrix.T)
        return scaled.max(axis=-1) if self.box else np.sqrt((scaled**2).sum(axis=-1))

    def outward(self, gaps):
        """Gradient of the norm with the gap."""
        scaled = gaps @ self.matrix.T
        if not self.box:
            return (scaled / np.linalg.norm(scaled, axis=-1, keepdims=True)) @ self.matrix
        face = np.abs(scaled).argmax(axis=-1)
        sign = np.sign(np.take_along_axis(scaled, face[:, None], axis=-1))
        return sign * self.matrix[face]


def hill(n):
    system = np.zeros((6, 6))
    system[:3, 3:] = np.eye(3)
    system[3, 0], system[5, 2], system[3, 4], system[4, 3] = 3 * n * n, -n * n, 2 * n, -2 * n
    return system


def bridge(n, duration, times, others):
    """K(t, s) [s^3] for `times` (A,) and `others` (B,): (A, B, 3, 3).  # theory (12)"""
    system = hill(n * duration)  # in units of the duration, good for any n T
    push = np.diag([0.0, 0.0, 0.0, 1.0, 1.0, 1.0])
    both = np.block([[system, push], [np.zeros((6, 6)), -system.T]])

    def gramian(t):
        grown = expm(both * t[:, None, None])
        return grown[:, :6, 6:] @ np.swapaxes(grown[:, :6, :6], -1, -2)

    def flow(t):
        return expm(system * t[..., None, None])

    a, b = np.asarray(times) / duration, np.asarray(others) / duration
    whole = np.linalg.inv(gramian(np.ones(1))[0])
    left = gramian(a) @ np.swapaxes(flow(1 - a), -1, -2)
    right = flow(1 - b) @ gramian(b)
    free = np.where(
        (a[:, None] <= b)[..., None, None],
        (gramian(a) @ np.swapaxes(flow(-a), -1, -2))[:, None] @ np.swapaxes(flow(b), -1, -2),
        flow(a)[:, None] @ (flow(-b) @ gramian(b)),
    )
    return (free - left[:, None] @ whole @ right)[..., :3, :3] * duration**3


def spanned(n, duration, nodes, times):
    """Deviations at `times` (T, 3, 3 N) of weights whose energy is half their square."""
    gram = bridge(n, duration, nodes, nodes).transpose(0, 2, 1, 3).reshape(3 * len(nodes), -1)
    reach = bridge(n, duration, times, nodes).transpose(0, 2, 1, 3).reshape(3 * len(times), -1)
    lower = np.linalg.cholesky(gram + 1e-13 * np.diag(np.diag(gram)))
    return np.linalg.solve(lower, reach.T).T.reshape(len(times), 3, -1)


def settle(hindrances, gaps, spans, weights):
    """Least extra energy near `weights`, and where it is; None if the zones are not cleared."""
    # weights in units of those that start the search
    unit = max(np.linalg.norm(weights), 1e-300)

    def moved(w):
        return [gap + unit * span @ w for gap, span in zip(gaps, spans, strict=True)]

    def room(w):
        return np.concatenate([h.norms(gap) - 1 for h, gap in zip(hindrances, moved(w), strict=True)])

    def slopes(w):
        parts = zip(hindrances, moved(w), spans, strict=True)
        return np.concatenate(
            [unit * np.einsum("tk,tkm->tm", h.outward(gap), span) for h, gap, span in parts]
        )

    limits = {"type": "ineq", "fun": room, "jac": slopes}
    options = {"maxiter": 150, "ftol": 1e-12}
    found = minimize(
        lambda w: 0.5 * w @ w,
        weights / unit,
        jac=lambda w: w,
        constraints=[limits],
        options=options,
        method="SLSQP",
    )
    return (found.fun * unit**2, found.x * unit) if room(found.x).min() > -1e-7 else None


def cheapest(n, duration, hindrances, edges=()):
    """Extra energies [m^2/s^3] of the local optima found, least first; `edges`: more times to look at."""
    nodes = np.linspace(0, duration, NODES + 2)[1:-1]
    times = np.union1d(np.linspace(0, duration, SAMPLES + 2)[1:-1], edges)
    span = spanned(n, duration, nodes, times)
    gaps = [h.gap(times) for h in hindrances]
    found = []
    for first, gap in zip(hindrances, gaps, strict=True):
        deepest = first.norms(gap).argmin()
        if first.norms(gap).min() >= 1:
            continue
        for side in SIDES:
            there = np.linalg.solve(first.matrix, 1.3 * side) - gap[deepest]
            weights = np.linalg.lstsq(span[deepest], there, rcond=None)[0]
            coarse = settle(hindrances, gaps, [span] * len(gaps), weights)
            if coarse and not any(abs(coarse[0] - energy) < 1e-6 * energy for energy, _ in found):
                found.append(coarse)
    best = sorted(found, key=lambda one: one[0])[:KEPT]
    return sorted(refined(n, duration, hindrances, times, nodes, span @ weights) for _, weights in best)


def refined(n, duration, hindrances, times, nodes, deviation):
    """The same optimum with nodes where it comes close and samples near the zones; inf if it is lost."""
    lows, near = [], np.zeros(len(times), dtype=bool)
    for h in hindrances:
        norms = h.norms(h.gap(times) + deviation)
        near |= (norms < 1.5) | (h.norms(h.gap(times)) < 1.5)
        low = (
            np.flatnonzero((norms[1:-1] <= norms[:-2]) & (norms[1:-1] <= norms[2:]) & (norms[1:-1] < 1.2)) + 1
        )
        lows += list(times[low])
    steps = np.linspace(times[:-1], times[1:], FINER + 1, axis=1)[near[:-1] | near[1:]]
    finer = np.union1d(times, steps)
    nodes = np.union1d(nodes, lows)
    nodes = nodes[np.concatenate([[True], np.diff(nodes) > 0.02 * duration])]
    for _ in range(CORNERED):
        span = spanned(n, duration, nodes, finer)
        gaps = [h.gap(finer) for h in hindrances]
        wanted = np.array([np.interp(finer, times, deviation[:, k]) for k in range(3)]).T
        weights = np.linalg.lstsq(span.reshape(-1, span.shape[2]), wanted.ravel(), rcond=1e-10)[0]
        settled = settle(hindrances, gaps, [span] * len(gaps), weights)
        if settled is None:
            return np.inf
        times, deviation = finer, span @ settled[1]
        finer = np.union1d(finer, corners(hindrances, times, deviation))
        if len(finer) == len(times):
            break
    return settled[0]


def corners(hindrances, times, deviation):
    """Times between samples at which a path cuts a corner: edges are passed faster than samples follow."""
    found = []
    for h in hindrances:
        between = np.linspace(times[:-1], times[1:], 9, axis=1)[:, 1:-1].ravel()
        there = np.array([np.interp(between, times, deviation[:, k]) for k in range(3)]).T
        norms = h.norms(h.gap(between) + there)
        low = np.flatnonzero((norms < 1 - CUT) & (norms <= np.roll(norms, 1)) & (norms <= np.roll(norms, -1)))
        found += list(between[low])
    return found


def least(norm, start, end, samples=4001):
    """Least norm of a function of times (T,) over [start, end]: samples, every low one refined."""
    times = np.linspace(start, end, samples)
    norms = norm(times)
    lowest = min(norms[0], norms[-1])
    for k in np.flatnonzero((norms[1:-1] <= norms[:-2]) & (norms[1:-1] <= norms[2:])) + 1:
        bounds = times[k - 1], times[k + 1]
        one = minimize_scalar(
            lambda t: norm(np.array([t]))[0],
            bounds=bounds,
            method="bounded",
            options={"xatol": 1e-9 * (end - start)},
        )
        lowest = min(lowest, norms[k], one.fun)
    return float(lowest)
