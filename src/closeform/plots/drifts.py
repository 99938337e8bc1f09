"""Closest approach in free drift after a loss of thrust, against the time of the loss."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from closeform.arrays import Floats, instance, sequence, shown
from closeform.conflicts.two_paths import closest_approach
from closeform.motion.path import Path
from closeform.plots.inputs import crafts, one_craft, texts
from closeform.plots.palette import AFTER, ALONG, ALTERNATIVE, BEFORE, CONFLICT, CROSS, INK
from closeform.plots.style import (
    DASHED,
    DOTTED,
    HALO,
    SMALL,
    Unit,
    chart,
    clock,
    headline,
    instants,
    legend,
    plain_unit,
    time_axes,
    zone_band,
)
from closeform.safety.drift_approach import DriftApproach, drift_approach
from closeform.zones.zone import Zone

COLOURS = (AFTER, ALTERNATIVE, CROSS.colour, BEFORE, "#882255", "#7a6a00")
DASHES = ("-", ALONG.dashes, CROSS.dashes, DOTTED, "-", ALONG.dashes)
INSTANTS, SHARES = 480, 64  # failure times per curve, and fractions of an impulse at which thrust is lost
MOST = 6  # times the smallest ratio or the zone: upper limit of the axis
RING: dict[str, Any] = {"markersize": 10, "markerfacecolor": "none", "markeredgewidth": 2.2}


@dataclass(frozen=True, eq=False)
class Failed:
    """Outcome of failures of one spacecraft: `times` [s], minimum ratios, and times of closest approach."""

    path: Path
    other: Path
    zone: Zone
    until: float
    times: Floats
    ratios: Floats
    met: Floats
    worst: DriftApproach

    @classmethod
    def of(cls, path: Path, other: Path, zone: Zone, until: float) -> Failed:
        """Evaluate failures over the path; raise ValueError under the same conditions as `drift_approach`."""
        worst = drift_approach(path, other, zone, until)
        first, last = max(path.start, other.start), path.end
        joints = instants(first, last, path)
        joints = joints[
            np.isin(joints, path.arcs[:, 0]) | np.isin(np.nextafter(joints, np.inf), path.arcs[:, 0])
        ]
        times = np.union1d(np.linspace(first, last, INSTANTS), joints)
        after = times < until
        times = times[after] if after.any() else times[:1]
        times, states = failing(path, times)
        if np.isfinite(until):
            drifts = path.orbit.coast(states, until - times, times)
            near: Any = closest_approach(drifts, other, zone)
        else:
            near = drift_approach(path.orbit.coast(states, 1.0, times), other, zone, until)
        return cls(path, other, zone, until, times, near.ratio, near.time, worst)

    @property
    def burns(self) -> bool:
        """True if the time of failure changes the outcome, because the spacecraft thrusts."""
        return bool(np.ptp(self.ratios) > 0.0)


def failing(path: Path, times: Floats) -> tuple[Floats, Floats]:
    """Return failure times (K,) [s] and states (K, 6), including partial impulses."""
    found, states = [times], [path.state(times)]
    for at, jump in path.impulses:
        if times[0] <= at <= times[-1]:
            amid = np.repeat(path.state(at)[None], SHARES, axis=0)
            amid[:, 3:] -= np.linspace(1.0, 0.0, SHARES, endpoint=False)[:, None] * jump
            found.append(np.full(SHARES, at))
            states.append(amid)
    every = np.concatenate(found)
    order = np.argsort(np.concatenate([*found[1:], times]), kind="stable")  # partial impulses first
    order = (order + len(times)) % len(every)
    return every[order], np.concatenate(states)[order]


def drift_ratios(
    path: Path | Sequence[Path],
    other: Path | Sequence[Path],
    zone: Zone | Sequence[Zone],
    until: float,
    labels: Sequence[str] | None = None,
    before: tuple[Path, Path, Zone] | None = None,
) -> Figure:
    """Plot the closest approach in free drift against the time of thrust loss; below 1 is a conflict.

    Each curve is the minimum clearance ratio of a pair over the whole drift. At an impulse it covers all
    fractions of the impulse that may have been executed. A ring marks the certified worst case of each pair,
    which may lie between the sampled times.

    Parameters
    ----------
    path : Path or sequence of Path
        Paths of the failing spacecraft, one for each pair.
    other : Path or sequence of Path
        Paths of the other spacecraft, up to the end of the drift.
    zone : Zone or sequence of Zone
        One zone for each pair, or one for all.
    until : float [s]
        End of the drift, as in `drift_approach`.
    labels : sequence of str, optional
        Label of each pair.
    before : tuple of (Path, Path, Zone), optional
        Pair on its direct paths, without passive safety, and its zone; drawn dashed.

    Returns
    -------
    Figure
        Matplotlib figure; save it with its `savefig` method.

    Raises
    ------
    ValueError
        If the number of others, zones or labels differs from that of paths, `before` has the wrong type, or
        under the same conditions as `drift_approach`.
    """
    fail, fly = crafts("path", path), crafts("other", other)
    zones = [zone] * len(fail) if isinstance(zone, Zone) else sequence("zone", zone, Zone)
    for name, some in (("other", fly), ("zone", zones)):
        if len(some) != len(fail):
            raise ValueError(f"{name}: {len(some)} for {len(fail)} paths; give one for each")
    if not fail:
        raise ValueError("path: give at least one")
    called = texts("labels", labels, len(fail), "paths") if labels is not None else [""] * len(fail)
    found = [Failed.of(*pair, until) for pair in zip(fail, fly, zones, strict=True)]
    direct = None if before is None else Failed.of(*pair_given("before", before), until)
    start, end = min(one.times[0] for one in found), max(one.times[-1] for one in found)
    ticks = clock(fail[0], float(start), float(end))

    rows = len(found) + (direct is not None)
    figure, axes = chart(5.6 + 0.3 * rows, 0.85 + 0.3 * rows)
    zone_band(axes)
    lines, words = [], []
    for k, (one, name) in enumerate(zip(found, called, strict=True)):
        tint, dashes = COLOURS[k % len(COLOURS)], DASHES[k % len(DASHES)]
        when = ticks(one.times)
        (line,) = axes.plot(when, one.ratios, color=tint, linestyle=dashes, linewidth=2.2)
        axes.plot(when, np.where(one.ratios <= 1.0, one.ratios, np.nan), color=CONFLICT, linewidth=3.2)
        hit = CONFLICT if one.worst.ratio <= 1.0 else tint
        axes.plot(ticks(one.worst.failed_at), one.worst.ratio, "o", color=hit, zorder=6, **RING)
        lines.append(line)
        words.append((f"{name}: " if name else "") + told(one, ticks))
    if direct is not None:
        look: dict[str, Any] = {"color": INK, "linestyle": DASHED, "linewidth": 1.4, "zorder": 1.9}
        lines += axes.plot(ticks(direct.times), direct.ratios, **look)
        words.append(f"by the direct path: {told(direct, ticks)}")
    most = max(float(one.ratios.max()) for one in found)
    axes.set_ylim(0, min(1.06 * most, MOST * max(1.0, *(one.worst.ratio for one in found))))
    axes.set_ylabel("clearance ratio in the drift [× zone]")
    text = axes.text(0.992, 0.03, "keep-out zone", transform=axes.transAxes, fontsize=SMALL, color="#9a6a00")
    text.set(ha="right", path_effects=HALO)
    time_axes([axes], ticks, float(start), float(end))
    axes.set_xlabel(f"time of thrust loss [{ticks.unit.name}]")
    legend(figure, lines, words, ncols=1)
    without = "" if direct is None else f", {number(direct.worst.ratio)} by the direct path"
    headline(figure, verdict(found) + without)
    return figure


def pair_given(name: str, given: Any) -> tuple[Path, Path, Zone]:
    """Return a checked tuple of failing path, other path and zone."""
    if not isinstance(given, tuple) or len(given) != 3:
        raise ValueError(f"{name}: expected a tuple of two paths and their zone, got {shown(given)}")
    path, other, zone = given
    one_craft(name, path)
    one_craft(name, other)
    return path, other, instance(name, zone, Zone)


def told(one: Failed, ticks: Any) -> str:
    """Return the worst failure as text."""
    worst = one.worst
    lost = f"{number(worst.ratio)} × zone if lost at {ticks.text(worst.failed_at)}"
    if not np.isfinite(worst.time):
        return f"{lost}, in a drift without an end"
    return f"{lost}, {later(worst)} later"


def number(ratio: float) -> str:
    """Return a ratio as text, with more digits close to 1."""
    return f"{ratio:.{4 if abs(ratio - 1.0) < 0.005 else 2}f}" if ratio >= 0.1 else f"{ratio:.2g}"


def later(worst: DriftApproach) -> str:
    """Return the time from the worst failure to its closest approach as text."""
    return lasts(worst.time - worst.failed_at)


def lasts(seconds: float) -> str:
    """Return a duration [s] as text."""
    unit = plain_unit(seconds) if not 7200.0 <= seconds <= 4e5 else Unit(3600.0, "h")
    return f"{seconds / unit.size:.3g} {unit.name}"


def verdict(found: Sequence[Failed]) -> str:
    """Return the headline: whether all pairs are passively safe, and the share of unsafe failure times."""
    worst = min(found, key=lambda one: one.worst.ratio)
    drift = worst.until - worst.path.end
    spans = f"for {lasts(drift)} after the end" if np.isfinite(drift) else "for ever"
    if worst.worst.ratio > 1.0:
        return f"Passively safe {spans}: least {number(worst.worst.ratio)} × zone"
    risky = np.interp(np.linspace(worst.times[0], worst.times[-1], 2000), worst.times, worst.ratios) <= 1.0
    share = 100.0 * risky.mean()  # close to 0 if only a partial impulse is unsafe
    often = f", unsafe {share:.0f} % of the time" if share >= 0.5 else ""
    return f"Not passively safe {spans}: {number(worst.worst.ratio)} × zone{often}"
