"""Commands of one spacecraft's thrusters: pulses, their times, and the parts of a plan that are dropped."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.fuel.chunks import Chunks, cells_of, gathered
from closeform.fuel.deviation import bound, misfit_of
from closeform.fuel.falling_mass import fired_within
from closeform.fuel.pulses import Pulses, pulsed_path
from closeform.fuel.thrusters import Thrusters
from closeform.motion.path import Path, ends_of

FULL = 1.0 + 1e-6  # share of a thruster's acceleration that a plan may require
CLOCK = 1e-12  # of all times: no pulse is shorter
JOINED = 1e-9  # of a pulse: gap before the next one that counts as none
# Impulses of one thruster are joined if they are nearer than these shares of their burns' duration and of the
# plan's. Linear programs share one impulse among neighbouring times. One burn has the same bound on F: it is
# as long as both, about their centroid, and no part of it is nearer to that than the parts that it replaces,
# so F keeps its sign. Continuous thrust may extend beyond that burn, and is not joined.
APART, BESIDE = 0.5, 0.02
# Share of q w x: F of two pulses of one delta-v q, centroid and duration w, of which one is constant and the
# other grows by the share x. It is 1/64 where all growth is in the middle, 1/125 where it is steady.
RAMP = 1.0 / 32.0


class Overlap(ValueError):
    """Plan that requires a thruster to fire again before it has ended."""


@dataclass(frozen=True, eq=False)
class Order:
    """Chunks of a plan, of which those that are `fired` (K,) begin and end at `times` (2, M) [s].

    `span` [s] covers the plan and all pulses, and `extra` (K,) [m] is the contribution of the falling mass to
    F. `pulses` are the commands.
    """

    thrusters: Thrusters
    chunks: Chunks
    fired: Any
    times: Floats
    span: tuple[float, float]
    extra: Floats
    pulses: Pulses
    dropped: Pulses

    def path(self, plan: Path) -> Path:
        """Return the path under the pulses over the time of the `plan`, which contains them."""
        chunks = self.chunks[self.fired]
        strength = chunks.impulse / np.diff(self.times, axis=0)[0]
        ends = np.array([plan.start, plan.end])
        return pulsed_path(
            plan.orbit, self.thrusters, chunks.thruster, self.times, strength, ends_of(plan)[0], ends
        )

    def bounds(self, plan: Path) -> tuple[float, float]:
        """Return bounds [m] of the deviation from the `plan`, and of its part due to dropped chunks."""
        widths = np.full(len(self.chunks), np.nan)
        widths[self.fired] = np.diff(self.times, axis=0)[0]
        every = np.ones(len(widths), dtype=bool)
        whole, left = (
            bound(
                plan,
                self.thrusters,
                self.chunks[some],
                misfit_of(plan, self.thrusters, self.chunks[some], widths[some], self.extra[some]),
            )
            for some in (every, ~self.fired)
        )
        return whole, left


def order_of(craft: int, path: Path, thrusters: Thrusters, mass: float, exhaust: float) -> Order:
    """Return the order for one spacecraft's path, of `mass` [kg] at its start, nan if unknown.

    `exhaust` is the exhaust speed [m/s]. Raises ValueError that names a missing or invalid value.
    """
    if thrusters.acceleration is None:
        raise ValueError("thrusters: acceleration is missing; give it, or use with_force")
    cells = cells_of(path, thrusters)
    known = np.isfinite(mass)
    kilograms, speed = (mass, exhaust) if known else (1.0, np.inf)
    lighter = np.exp(-cells.impulse.sum() / speed)  # a bit is larger after mass has been lost
    bits = np.broadcast_to(thrusters.minimum_bit / lighter, len(thrusters))
    _check_period(cells, path, thrusters)
    chunks = gathered(cells, path.start, thrusters.period, bits)
    _check_strength(chunks, thrusters)
    chunks = _together(_without_gaps(chunks, thrusters), thrusters, BESIDE * (path.end - path.start))
    fired = _fired(chunks, path, thrusters, bits)
    shot, force = chunks[fired], kilograms * thrusters.acceleration
    begin, over, masses = fired_within(shot, force[shot.thruster], kilograms, speed)
    half = 0.5 * (over - begin)
    extra = np.zeros(len(chunks))
    extra[fired] = RAMP * shot.impulse * 2.0 * half * (masses[0] / masses[1] - 1.0)
    burned = force[shot.thruster] * 2.0 * half / speed if known else np.full(len(shot), np.nan)
    _check_overlap(shot.thruster, begin, over)
    times = np.stack([shot.centroid - half, shot.centroid + half])
    left, none = chunks[~fired], np.full(len(chunks) - len(shot), 0.0 if known else np.nan)
    return Order(
        thrusters,
        chunks,
        fired,
        times,
        (min([path.start, *begin, *times[0]]), max([path.end, *over, *times[1]])),
        extra,
        _pulses(craft, path, thrusters, shot, begin, over, burned),
        _pulses(craft, path, thrusters, left, left.start, left.end, none),
    )


def _fired(chunks: Chunks, path: Path, thrusters: Thrusters, bits: Floats) -> Any:
    """Return True for chunks (K,) that are at least a bit, and long enough for the resolution of time."""
    enough = chunks.impulse >= bits[chunks.thruster]
    if len(chunks) and not enough.any():
        remedy = "take finer thrusters" if path.impulses else "plan with impulses, or take finer thrusters"
        raise ValueError(
            f"minimum_bit: {bits.min():g} m/s is above {chunks.impulse.max():.3g} m/s, the largest pulse "
            f"of the plan, so no thruster would fire; {remedy}"
        )
    briefest = CLOCK * (np.abs([path.start, path.end]).max() + path.end - path.start)
    fired = enough & (chunks.impulse >= briefest * thrusters.acceleration[chunks.thruster])
    if len(chunks) and not fired.any():
        raise ValueError(
            f"acceleration: {thrusters.acceleration.max():g} m/s² fires the whole plan in pulses shorter "
            f"than {briefest:.2g} s, below the resolution of time; reduce it"
        )
    return fired


def _pulses(
    craft: int, path: Path, thrusters: Thrusters, chunks: Chunks, begin: Floats, over: Floats, burned: Floats
) -> Pulses:
    """Return chunks as pulses, in order of time."""
    turned = thrusters.directions_at(path.orbit, chunks.centroid)
    units = turned[np.arange(len(chunks)), chunks.thruster]
    crafts = np.full(len(chunks), craft)
    columns = Pulses(crafts, chunks.thruster, begin, over - begin, units, chunks.impulse, burned)
    return columns[np.lexsort((chunks.thruster, begin))]


def _without_gaps(chunks: Chunks, thrusters: Thrusters) -> Chunks:
    """Join chunks during which a thruster is always on with preceding chunks of the same kind."""
    if not len(chunks):
        return chunks
    length, full = chunks.end - chunks.start, _are_full(chunks, thrusters)
    goes_on = (
        full & np.roll(full, 1) & (chunks.thruster == np.roll(chunks.thruster, 1)) & np.isfinite(chunks.peak)
    )
    goes_on &= np.abs(chunks.start - np.roll(chunks.end, 1)) <= JOINED * length
    goes_on[0] = False
    return chunks.joined(np.flatnonzero(~goes_on))


def _are_full(chunks: Chunks, thrusters: Thrusters) -> Any:
    """Return True for chunks (K,) during which a thruster is always on; impulses count."""
    length = chunks.end - chunks.start
    return chunks.impulse >= thrusters.acceleration[chunks.thruster] * length * (1.0 - JOINED)


def _together(chunks: Chunks, thrusters: Thrusters, beside: float) -> Chunks:
    """Join impulses of one thruster less than `beside` [s] apart where their burns would overlap."""
    while len(chunks) > 1:
        width = chunks.impulse / thrusters.acceleration[chunks.thruster]
        near = chunks.thruster[1:] == chunks.thruster[:-1]
        near &= np.isinf(np.minimum(chunks.peak[1:], chunks.peak[:-1]))
        near &= np.diff(chunks.centroid) < np.minimum(APART * (width[1:] + width[:-1]), beside)
        if not near.any():
            break
        chunks = chunks.joined(np.flatnonzero(~np.concatenate([[False], near])))
    return chunks


def _check_period(cells: Chunks, path: Path, thrusters: Thrusters) -> None:
    if not np.isfinite(cells.peak).any():
        return
    if thrusters.period is None and _are_full(cells, thrusters).all():
        return
    if thrusters.period is None:
        raise ValueError("thrusters: continuous thrust requires a period; give one")
    if thrusters.period > path.end - path.start:
        raise ValueError(
            f"period: {thrusters.period:g} s is longer than the plan, which takes "
            f"{path.end - path.start:.6g} s; give a shorter one"
        )


def _check_strength(chunks: Chunks, thrusters: Thrusters) -> None:
    has = thrusters.acceleration[chunks.thruster]
    over = np.where(np.isinf(chunks.peak), 0.0, chunks.peak / has)
    if len(over) and over.max() > FULL:
        k = int(over.argmax())
        raise ValueError(
            f"acceleration: at about {chunks.centroid[k]:.6g} s thruster {chunks.thruster[k]} must provide "
            f"{chunks.peak[k]:.4g} m/s², above its {has[k]:.4g} m/s²; plan with a "
            "max_acceleration or more time"
        )


def _check_overlap(thruster: Any, begin: Floats, over: Floats) -> None:
    order = np.lexsort((begin, thruster))
    one, begin, over = thruster[order], begin[order], over[order]
    both = (one[1:] == one[:-1]) & (begin[1:] < over[:-1] - JOINED * (over - begin)[:-1])
    if both.any():
        k = int(both.argmax())
        raise Overlap(
            f"acceleration: thruster {one[k]} fires from {begin[k]:.6g} to {over[k]:.6g} s, and must begin "
            f"again at {begin[k + 1]:.6g} s; increase the acceleration, or plan with more time between"
        )
