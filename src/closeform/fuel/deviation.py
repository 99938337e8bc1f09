"""Bound on the deviation from a plan when chunks are fired as pulses, without a simulation.

With e the fired minus the planned thrust, and F its second integral over time, exactly

    dr(t) = F(t) + integral of K(t, s) F(s) ds                                        # theory (40)

A pulse about the chunk's centroid leaves F = F' = 0 at its end, and F has one sign during it.  The
remainder is a natural motion that starts at the centroid of F with a velocity change equal to its integral.
All kicks are added as vectors, so those of opposite lobes cancel, as they do in the motion.
"""

from dataclasses import dataclass

import numpy as np

from closeform.arrays import Floats, subdivided
from closeform.fuel.chunks import Chunks
from closeform.fuel.thrusters import Thrusters
from closeform.motion.orbit import Orbit
from closeform.motion.path import Path

FINE = 0.2  # of n t: step at which the remaining natural motion is evaluated
SAFE = 1.0 + 1e-6  # for neglected effects: thrust below 1e-9 of the largest, rounding


@dataclass(frozen=True, eq=False)
class Misfit:
    """Effect of each of K chunks on the path.

    From `start` to `end` [s], F along its thruster is at most `size` [m], and the motion differs from that
    after the kick by at most `astray` [m]. The kicks (K, 6) [m, m/s] occur at `when` (K,) [s]; afterwards the
    motion differs from that of the kick by at most `rest` [m].
    """

    start: Floats
    end: Floats
    size: Floats
    astray: Floats
    kick: Floats
    when: Floats
    rest: Floats


def misfit_of(plan: Path, thrusters: Thrusters, chunks: Chunks, widths: Floats, extra: Floats) -> Misfit:
    """Return the misfit of chunks of a `plan` fired as pulses of `widths` (K,) [s], nan if dropped.

    `extra` (K,) [m] is added to the largest F, for pulses whose thrust is not constant.
    """
    n, q = plan.orbit.mean_motion, chunks.impulse
    fired = np.isfinite(widths)
    width = np.where(fired, widths, 0.0)
    start = np.minimum(chunks.start, chunks.centroid - 0.5 * width)
    end = np.maximum(chunks.end, chunks.centroid + 0.5 * width)
    length = end - start
    gain = 0.5 * q * (width**2 / 12.0 - chunks.variance)  # the integral of F
    spread = width**2 / 12.0 - chunks.variance
    shift = np.divide(-chunks.skew, 3.0 * spread, out=np.zeros_like(spread), where=np.abs(spread) > 0.0)
    when = np.clip(chunks.centroid + shift, start, end)

    size = _greatest(chunks, width, np.abs(gain))
    reach = length * (1.0 + 2.0 * n * length)  # of a velocity kick, |Phi_rv|
    size = np.where(fired, size, q * reach) + extra

    spot = np.where(fired, when, chunks.centroid)
    units = thrusters.directions_at(plan.orbit, spot)[np.arange(len(q)), chunks.thruster]
    late = n * np.maximum(plan.end - start, 0.0)
    kick = np.zeros((len(q), 6))
    if thrusters.frame == "orbit":  # largest lengths of K, and of its derivatives by s
        near = far = np.full_like(q, 4.0 * n)
        bend, drift = n**2 * near, n * near
        kick[:, 0], kick[:, 1] = 2.0 * n * units[:, 1], -2.0 * n * units[:, 0]
        kick[:, 3:] = n * n * units * [-1.0, -4.0, -1.0]
    else:
        near, far = 2.0 * n * n * reach, n * (12.0 + 6.0 * late)
        bend, drift = n**3 * (48.0 + 6.0 * late), n**2 * (46.0 + 3.0 * late)
        kick[:, 3:] = n * n * units * [2.0, -1.0, -1.0]
    kick *= gain[:, None]
    kick[:, 3:] -= np.where(fired, 0.0, q)[:, None] * units
    whole = np.abs(gain)
    rest = whole * np.where(fired, bend * length**2 / 8.0, drift * length / 3.0)
    return Misfit(start, end, size, near * whole, kick, spot, rest + far * length * extra)


def _greatest(chunks: Chunks, width: Floats, whole: Floats) -> Floats:
    """Return the largest F (K,) [m] of pulses of `width` (K,) [s], given its integral `whole` (K,) [m s].

    For an impulse it is q w / 8. Otherwise it is at most q times half the mean deviation of the chunk from
    its centroid, which is below half its standard deviation, and below that of a chunk at its two ends. F''
    is at most the thrust, so a high peak of F is also wide: theory (43).
    """
    q, lasts = chunks.impulse, np.isfinite(chunks.peak)
    before, after = chunks.centroid - chunks.start, chunks.end - chunks.centroid
    length = np.where(lasts, before + after, 1.0)
    apart = np.minimum(before * after / length, 0.5 * np.sqrt(np.maximum(chunks.variance, 0.0)))
    fired = np.divide(q, width, out=np.zeros_like(q), where=width > 0.0)
    wide = np.cbrt(9.0 / 32.0 * np.maximum(fired, np.where(lasts, chunks.peak, 0.0)) * whole**2)
    return np.where(lasts, np.minimum(q * apart, wide), 0.125 * q * width)


def bound(plan: Path, thrusters: Thrusters, chunks: Chunks, misfit: Misfit) -> float:
    """Return a bound on the deviation [m] of a spacecraft from its `plan` over the plan's time."""
    if not len(chunks):
        return 0.0
    orbit, first, last = plan.orbit, plan.start, plan.end
    n = orbit.mean_motion
    events = np.unique(np.concatenate([[first, last], misfit.start, misfit.end, misfit.when]))
    pieces = np.maximum(np.ceil(n * np.diff(events) / FINE).astype(int), 1)
    edges = subdivided(events, pieces)
    starts, steps = edges[:-1], np.diff(edges)
    left = _left(orbit, misfit, starts, steps, first)
    return SAFE * float((_held(thrusters, chunks, misfit, starts) + left).max() + misfit.rest.sum())


def _left(orbit: Orbit, misfit: Misfit, starts: Floats, steps: Floats, first: float) -> Floats:
    """Return bounds [m] of the natural motion of all kicks before `starts` (E,), within `steps` (E,) s."""
    n = orbit.mean_motion
    order = np.argsort(misfit.when)
    back = orbit.transition(first - misfit.when[order]) @ misfit.kick[order][:, :, None]
    sums = np.concatenate([np.zeros((1, 6)), np.cumsum(back[..., 0], axis=0)])
    motion = sums[np.searchsorted(misfit.when[order], starts, side="right")][..., None]
    here = (orbit.transition(starts - first) @ motion)[..., 0]
    there = (orbit.transition(steps) @ here[..., None])[..., 0]
    x, _, z, vx, vy, vz = here.T
    swing = 4.0 * n * n * ((3.0 * n * x + 2.0 * vy) ** 2 + vx**2) + n * n * ((n * z) ** 2 + vz**2)
    ends = np.maximum(np.linalg.norm(here[:, :3], axis=1), np.linalg.norm(there[:, :3], axis=1))
    found: Floats = ends + 0.125 * steps**2 * np.sqrt(swing)
    return found


def _held(thrusters: Thrusters, chunks: Chunks, misfit: Misfit, starts: Floats) -> Floats:
    """Return bounds [m] of F of all thrusters together from each of `starts` on to the next."""
    begin, over = np.searchsorted(starts, misfit.start), np.searchsorted(starts, misfit.end)
    begin = np.minimum(begin, len(starts) - 1)  # an impulse at the very end that is not fired
    sizes = np.zeros((len(thrusters) + 1, len(starts) + 1))
    both = np.stack([chunks.thruster, np.full(len(chunks), len(thrusters))])
    what = np.stack([misfit.size, misfit.astray])
    np.add.at(sizes, (both, begin), what)
    np.add.at(sizes, (both, np.maximum(over, begin + 1)), -what)
    sizes = np.maximum(np.cumsum(sizes, axis=1)[:, :-1], 0.0)
    along, astray = sizes[:-1], sizes[-1]
    together = np.abs(thrusters.directions @ thrusters.directions.T)
    found: Floats = np.sqrt(np.einsum("ie,ij,je->e", along, together, along)) + astray
    return found
