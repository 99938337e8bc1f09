"""Clearance of pairs against time: in clearance ratios, in sigmas, along each axis, and in free drift."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from closeform.arrays import Floats, instance, number, sequence, shown, whole
from closeform.conflicts.two_paths import Conflict, closest_approach, find_conflicts, nearest_first
from closeform.motion.path import FORGIVEN, Path
from closeform.plots.drawing import style, units
from closeform.plots.drawing.charts import Curve, Panel, series, styled, timeline
from closeform.plots.drawing.inputs import Zones, crafts, one_craft, picture, texts
from closeform.plots.drawing.pairs import Pairs, asked_pairs, ratio_text, verdict_of_pairs
from closeform.plots.drawing.palette import AFTER, BEFORE, CONFLICT, DIRECTIONS, INK, ZONE
from closeform.plots.drawing.text import SMALL, short_names
from closeform.safety.drift_approach import DriftApproach, drift_approach
from closeform.uncertainty.clearance import clearance_in_sigmas
from closeform.uncertainty.errors import Uncertainty
from closeform.zones.shapes import CUBE
from closeform.zones.solids import HalfSpaces
from closeform.zones.zone import Zone

RATIO = "clearance ratio [× zone]"
TANGLED = 8.0  # curves times orbits above which each pair has its own panel
BEYOND = 1e12  # [m] stands for an open side of a zone, beyond all spacecraft
FAR = 20.0  # zone extents above which a distance has a logarithmic scale
BRIEF = 1e-6  # s, so short that the state does not change: clearance at an instant
INSTANTS, SHARES = 480, 64  # failure times per curve, and fractions of an impulse at which thrust is lost


@picture("there is no obstacle, or one shares no time with a path")
def ratios(
    before: Path,
    after: Path,
    obstacles: Path | Sequence[Path],
    zone: Zone,
    names: Sequence[str] | None = None,
) -> Figure:
    """Plot the clearance ratio of a spacecraft to its obstacles, before and after; below 1 is a conflict.

    Thin lines are the ratios to each obstacle on the path after, thick lines the minimum of all. A dot marks
    the exact minimum.

    Parameters
    ----------
    names : sequence of str, optional
        Names of the obstacles.
    """
    others = crafts("obstacles", obstacles)
    if not others:
        raise ValueError("obstacles: give at least one path")
    called = short_names(names, len(others), "obstacles") if names is not None else []
    start, end = min(before.start, after.start), max(before.end, after.end)
    ticks, curves, least = units.clock(before, start, end), list[Curve](), list[float]()
    looks: list[tuple[Path, str, Any]] = [(after, AFTER, "-")]
    if before is not after:
        looks.insert(0, (before, BEFORE, style.DASHED))
    for path, colour, dashes in looks:
        times = units.instants(path.start, path.end, path, *others)
        each = np.full((len(others), len(times)), np.nan)
        for row, other in zip(each, others, strict=True):
            first, last = units.common_time(path, other)
            both = (times >= first) & (times <= last)
            row[both] = zone.norm(path.position(times[both]) - other.position(times[both]))
        near = [closest_approach(path, other, zone) for other in others]
        k = min(range(len(others)), key=lambda k: nearest_first(near[k].ratio, near[k].time))
        when = f"{near[k].ratio:.2f} × zone{f', {called[k]}' if called else ''} at {ticks.text(near[k].time)}"
        role = "closest" if len(looks) == 1 else "after" if path is after else "before"
        dot, label = (near[k].time, near[k].ratio), f"{role}: {when}"
        curves.append(Curve(times, np.fmin.reduce(each), label, colour, dashes, 2.4, dot))
        least.append(near[k].ratio)
        if path is after and len(others) > 1:
            curves.insert(0, Curve(times, each, colour=AFTER, width=0.8))
    change = f"Before {least[0]:.2f} × zone, after " if len(looks) > 1 else "Closest "
    last_near = f"{least[-1]:.2f} × zone"
    said = f"{change}{last_near} at {ticks.text(curves[-1].dot[0])}" if curves[-1].dot else change
    return series(said, [Panel(RATIO, curves, 1.0, scale="ratio")], ticks, start, end, height=5.9)


@picture("there are fewer than two spacecraft, no pair has a zone and a common time, or `count` is below 1")
def closest_pairs(
    paths: Path | Sequence[Path],
    zones: Zones,
    names: Sequence[str] | None = None,
    count: int = 4,
) -> Figure:
    """Plot the clearance ratio of the closest pairs against time; below 1 is a conflict.

    Each line is the clearance ratio of one pair over its common time, with a dot at the exact minimum. The
    axis is logarithmic above 1 if a line exceeds the linear range. Many pairs over many orbits have a panel
    each.

    Parameters
    ----------
    count : int, default 4
        Maximum number of pairs shown.
    """
    pairs, called = asked_pairs(paths, zones, names)
    whole("count", count, 1)
    chosen = pairs.order[:count]
    sampled = [along(pairs, k) for k in chosen]
    start = min((float(times[0]) for times, _ in sampled), default=0.0)
    end = max((float(times[-1]) for times, _ in sampled), default=0.0)
    if not start < end:
        raise ValueError("paths: no pair of craft with a zone has a common time")
    ticks, curves = units.clock(pairs.paths, start, end), list[Curve]()
    for row, (k, (times, values)) in enumerate(zip(chosen, sampled, strict=True)):
        one, other = (called[craft] for craft in pairs.craft[k])
        when, ratio = float(pairs.time[k]), float(pairs.ratio[k])
        words = f"{one} and {other}: {ratio_text(ratio)} × zone at {ticks.text(when)}"
        curves.append(Curve(times, values, words, dot=(when, ratio), width=2.2, **styled(row)))
    tangled = len(curves) > 1 and len(curves) * (end - start) / pairs.paths.orbit.period > TANGLED
    groups = [[curve] for curve in curves] if tangled else [curves]
    what, edge = ("[× zone]", "") if tangled else (RATIO, "keep-out zone")
    panels = [Panel(what, group, 1.0, edge, scale="ratio") for group in groups]
    more = int(pairs.hit.sum()) - sum(bool(pairs.stays[k]) for k in chosen)
    said = verdict_of_pairs(pairs, called) + (f"; {more} more in conflict" if more else "")
    height = 2.4 + 1.15 * len(panels) + 0.2 * len(curves) if tangled else 5.5 + 0.25 * len(curves)
    return series(said, panels, ticks, start, end, height=height)


def along(pairs: Pairs, k: int) -> tuple[Floats, Floats]:
    """Return times [s] and ratios of a pair, including its minimum and the ends of conflicts."""
    one, other = (pairs.paths[craft] for craft in pairs.craft[k].tolist())
    start, end = max(one.start, other.start), min(one.end, other.end)
    edges = [time for stay in pairs.stays[k] for time in (stay.start, stay.end)]
    times = np.union1d(units.instants(start, end, one, other), [pairs.time[k], *edges])
    return times, pairs.zone[k].norm(one.position(times) - other.position(times))


@dataclass(frozen=True, eq=False)
class Deviations:
    """Relative states (T, 6) of two spacecraft at `times` (T,), and their covariances (T, 6, 6)."""

    path: Path
    times: Floats
    states: Floats
    covariances: Floats

    @classmethod
    def of(cls, path: Path, other: Path, errors: Any, other_errors: Any) -> Deviations:
        """Sample two paths; raise ValueError if they share no time or an argument has the wrong type."""
        start, end = units.common_time(path, other)
        times = units.instants(start, end, path, other)
        covariances = np.zeros((len(times), 6, 6))
        for name, one, craft in (("errors", errors, path), ("other_errors", other_errors, other)):
            if one is not None:
                covariances += instance(name, one, Uncertainty).covariance(craft, times)
        return cls(path, times, path.state(times) - other.state(times), covariances)

    def sigmas(self, zone: Zone) -> Floats:
        """Return the clearance of a zone in sigmas (T,), nan if the zone is out of reach of any error."""
        still = self.path.orbit.coast(self.states, BRIEF)
        there = self.path.orbit.coast(np.zeros(6), BRIEF)
        places = np.zeros_like(self.covariances)  # velocity errors have no effect in so short a time
        places[:, :3, :3] = self.covariances[:, :3, :3]
        found = clearance_in_sigmas(still, there, zone, [Uncertainty(one) for one in places]).sigmas
        return np.where(np.isfinite(found), found, np.nan)


@picture(
    "the numbers of paths, zones, errors or names differ, two paths share no time, no error of any size "
    "causes a conflict, or `asked` is not above 0"
)
def sigmas(
    path: Path | Sequence[Path],
    other: Path | Sequence[Path],
    zone: Zone | Sequence[Zone],
    errors: Uncertainty | Sequence[Uncertainty | None] | None,
    other_errors: Uncertainty | Sequence[Uncertainty | None] | None = None,
    asked: float | None = None,
    names: Sequence[str] | None = None,
) -> Figure:
    """Plot the clearance in sigmas of one or more pairs against time; a dot marks the exact minimum.

    Parameters
    ----------
    path, other : Path or sequence of Path
        Paths of one spacecraft each, or P paths each, in one orbit; pair k consists of both paths k.
    zone : Zone or sequence of Zone
        One zone for all pairs, or one for each.
    errors : Uncertainty, sequence of these, or None
        Uncertainty of the first spacecraft of each pair: one for all or one for each.
    other_errors : Uncertainty, sequence of these, or None, default None
        Uncertainty of the second spacecraft.
    asked : float, no unit, optional
        Required clearance in sigmas; the range below it is shaded.
    names : sequence of str, optional
        Names of the pairs.
    """
    firsts, seconds = crafts("path", path), crafts("other", other)
    if not firsts or len(firsts) != len(seconds):
        raise ValueError(f"path, other: {len(firsts)} and {len(seconds)} craft; give pairs")
    count = len(firsts)
    zones = each("zone", zone, count, Zone)
    if asked is not None and not 0.0 < number("asked", asked) < np.inf:
        raise ValueError(f"asked: must be finite and above 0, got {asked:g}")
    own = each("errors", errors, count, Uncertainty, type(None))
    theirs = each("other_errors", other_errors, count, Uncertainty, type(None))
    if not any(one is not None for one in (*own, *theirs)):
        raise ValueError("errors: no spacecraft has any; give an Uncertainty for one of each pair")
    called = [f"pair {k}" for k in range(count)] if names is None else texts("names", names, count, "pairs")

    pairs = list(zip(firsts, seconds, zones, own, theirs, strict=True))
    start = min(max(one.start, two.start) for one, two, *_ in pairs)
    end = max(min(one.end, two.end) for one, two, *_ in pairs)
    ticks, curves, least = units.clock(firsts[0], start, end), list[Curve](), list[tuple[float, str]]()
    for k, (one, two, around, own_errors, their_errors) in enumerate(pairs):
        found = Deviations.of(one, two, own_errors, their_errors)
        near = clearance_in_sigmas(one, two, around, own_errors, their_errors)
        known, when = np.isfinite(near.time), ticks.text(near.time)
        dot = (near.time, near.sigmas) if known else None
        words = f"{called[k]}: {near.sigmas:.3g} sigma at {when}"
        curves.append(Curve(found.times, found.sigmas(around), words, dot=dot, **styled(k)))
        if known:
            least.append((near.sigmas, f"{near.sigmas:.2f} sigma at least: {called[k]} at {when}"))
    if not least:
        raise ValueError("errors: no error of any size causes a conflict; there is nothing to show")
    panel = Panel("clearance [sigma]", curves, asked, f"required: {asked:g}" if asked else "", "log")
    return series(f"Clear by {min(least)[1]}", [panel], ticks, start, end, height=5.9)


def each(name: str, given: Any, count: int, *kinds: Any) -> list[Any]:
    """Return an argument as a list of one value per pair, or raise ValueError."""
    some = list(sequence(name, given, *kinds)) if isinstance(given, list | tuple) else [given] * count
    for one in some:
        instance(name, one, *kinds)
    if len(some) != count:
        raise ValueError(f"{name}: {len(some)} for {count} pairs; give one, or one for each")
    return some


@dataclass(frozen=True, eq=False)
class Failed:
    """Failures of one spacecraft: `times` [s], `states`, minimum ratios, and times of closest approach."""

    path: Path
    other: Path
    zone: Zone
    until: float
    times: Floats
    states: Floats
    ratios: Floats
    met: Floats
    worst: DriftApproach

    @classmethod
    def of(cls, path: Path, other: Path, zone: Zone, until: float) -> Failed:
        """Evaluate failures over the path; raise ValueError under the same conditions as `drift_approach`."""
        worst = drift_approach(path, other, zone, until)
        first, last = max(path.start, other.start), path.end
        joints = units.instants(first, last, path)
        joints = joints[
            np.isin(joints, path.arcs[:, 0]) | np.isin(np.nextafter(joints, np.inf), path.arcs[:, 0])
        ]
        times = np.union1d(np.linspace(first, last, INSTANTS), joints)
        after = times < until
        times, states = failing(path, times[after] if after.any() else times[:1])
        if np.isfinite(until):
            drifts = path.orbit.coast(states, until - times, times)
            near: Any = closest_approach(drifts, other, zone)
        else:
            near = drift_approach(path.orbit.coast(states, 1.0, times), other, zone, until)
        return cls(path, other, zone, until, times, states, near.ratio, near.time, worst)

    @property
    def lost(self) -> Floats:
        """State (6,) from which the worst failure drifts: at an impulse, the worst sampled fraction."""
        when = self.worst.failed_at
        here = np.abs(self.times - when) <= FORGIVEN * (self.path.end - self.path.start)
        if not here.any():
            return self.path.state(when)
        return np.asarray(self.states[here][np.argmin(self.ratios[here])])

    def story(self, ticks: units.Clock) -> str:
        """Return the worst failure as text."""
        lost = f"{precise(self.worst.ratio)} × zone if thrust is lost at {ticks.text(self.worst.failed_at)}"
        if not np.isfinite(self.worst.time):
            return f"{lost}, in a drift without an end"
        return f"{lost}, {duration(self.worst.time - self.worst.failed_at)} later"


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


@picture(
    "the number of others, zones or labels differs from that of paths, or under the same conditions as in "
    "`drift_approach`"
)
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
    labels : sequence of str, optional
        Label of each pair.
    before : tuple of (Path, Path, Zone), optional
        Pair on its direct paths, without passive safety, and its zone; dashed.
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
    ticks, curves = units.clock(fail[0], float(start), float(end)), list[Curve]()
    for k, (one, name) in enumerate(zip(found, called, strict=True)):
        words = (f"{name}: " if name else "") + one.story(ticks)
        dot = one.worst.failed_at, one.worst.ratio
        curves.append(Curve(one.times, one.ratios, words, dot=dot, width=2.2, **styled(k)))
    said = passive_safety(found)
    if direct is not None:
        words = f"direct path: {direct.story(ticks)}"
        curves.append(Curve(direct.times, direct.ratios, words, INK, style.DASHED, 1.4))
        said += f", {precise(direct.worst.ratio)} on the direct path"
    panel = Panel("clearance ratio in free drift [× zone]", curves, 1.0, scale="ratio")
    height = 5.6 + 0.3 * len(curves)
    return series(said, [panel], ticks, float(start), float(end), "time of thrust loss", height)


def pair_given(name: str, given: Any) -> tuple[Path, Path, Zone]:
    """Return a checked tuple of failing path, other path and zone."""
    if not isinstance(given, tuple) or len(given) != 3:
        raise ValueError(f"{name}: expected a tuple of two paths and their zone, got {shown(given)}")
    path, other, zone = given
    one_craft(name, path)
    one_craft(name, other)
    return path, other, instance(name, zone, Zone)


def precise(ratio: float) -> str:
    """Return a ratio as text, with more digits close to 1."""
    return f"{ratio:.{4 if abs(ratio - 1.0) < 0.005 else 2}f}" if ratio >= 0.1 else f"{ratio:.2g}"


def duration(seconds: float) -> str:
    """Return a duration [s] as text."""
    unit = units.plain_unit(seconds) if not 7200.0 <= seconds <= 4e5 else units.Unit(3600.0, "h")
    return unit.text(seconds, 3)


def passive_safety(found: Sequence[Failed]) -> str:
    """Return the headline: whether all pairs are passively safe, and the fraction of unsafe failure times."""
    worst = min(found, key=lambda one: one.worst.ratio)
    drift = worst.until - worst.path.end
    spans = f"for {duration(drift)} after the end" if np.isfinite(drift) else "without an end"
    if worst.worst.ratio > 1.0:
        return f"Passively safe {spans}: minimum {precise(worst.worst.ratio)} × zone"
    risky = np.interp(np.linspace(worst.times[0], worst.times[-1], 2000), worst.times, worst.ratios) <= 1.0
    share = 100.0 * risky.mean()  # close to 0 if only a partial impulse is unsafe
    often = f", unsafe {share:.0f} % of the time" if share >= 0.5 else ""
    return f"Not passively safe {spans}: {precise(worst.worst.ratio)} × zone{often}"


@picture("orbits differ or there is no common time", source="SP11 figure 1")
def distances(path: Path, other: Path, zone: Zone, names: Sequence[str] | None = None) -> Figure:
    """Plot the distance along each axis against time, with zone limits and timelines: SP11 figure 1.

    The shaded bands are the extent of the zone. The bars below show when the distance is within the zone's
    extent: along each axis, along all three (the box around the zone) and, if different, in the zone itself.
    Their edges are the exact times of `find_conflicts`.

    Parameters
    ----------
    path, other : Path
        Paths of one spacecraft each, in one orbit; the position of the first relative to the other is shown.
    """
    start, end = units.common_time(path, other)
    one, two = short_names(names, 2)
    conflicts, ticks = find_conflicts(path, other, zone), units.clock(path, start, end)
    times = units.instants(start, end, path, other)
    gaps = path.position(times) - other.position(times)
    rows = [(d.name, d.colour, slab_stays(path, other, zone, axis)) for axis, d in enumerate(DIRECTIONS)]
    aligned_box = zone.shape == CUBE and np.count_nonzero(zone.matrix) == 3
    if not aligned_box:
        rows.append(("all three", INK, slab_stays(path, other, zone, 0, 1, 2)))
    rows.append(("conflict" if aligned_box else "in the zone", CONFLICT, edges(conflicts)))

    figure, panels = style.chart(8.6, [1, 1, 1, 0.19 * len(rows) + 0.1])
    for axis, axes in enumerate(panels[:3]):
        distance_panel(axes, axis, ticks(times), gaps[:, axis], reach(zone, axis))
        for conflict in conflicts:
            axes.axvspan(ticks(conflict.start), ticks(conflict.end), color=CONFLICT, alpha=0.18, linewidth=0)
    timeline(panels[3], ticks, rows)
    style.time_axes(panels, ticks, start, end)
    said = conflict_story(path, other, zone, conflicts, ticks)
    style.headline(
        figure, f"{one} relative to {two}: {said[0].lower()}{said[1:]}" if names is not None else said
    )
    return figure


def reach(zone: Zone, axis: int) -> Floats:
    """Return the extent of a zone along one axis (2,), forwards and backwards; inf if it is open."""
    way = np.eye(3)[axis]
    return np.asarray(zone.support(np.stack([way, -way])))


def edges(conflicts: Sequence[Conflict]) -> Floats:
    """Return the starts and ends (K, 2) [s] of conflicts."""
    return np.array([(one.start, one.end) for one in conflicts]).reshape(-1, 2)


def slab_stays(path: Path, other: Path, zone: Zone, *those: int) -> Floats:
    """Return the intervals (K, 2) [s] within the extent of a zone along some axes."""
    ways = [sign * np.eye(3)[axis] for axis in those for sign in (1.0, -1.0)]
    offsets = np.minimum(np.concatenate([reach(zone, axis) for axis in those]), BEYOND)
    return edges(find_conflicts(path, other, HalfSpaces(ways, offsets)))


def distance_panel(axes: Axes, axis: int, times: Floats, gap: Floats, ends: Floats) -> None:
    """Draw the distance along one axis, with the band of the zone's extent."""
    direction = DIRECTIONS[axis]
    extent = float(ends[np.isfinite(ends)].max(initial=0.0))
    unit = units.length_unit(max(float(np.abs(gap).max()), extent))
    axes.plot(times, gap / unit.size, color=direction.colour, linewidth=2.2)
    scale = ""
    if np.abs(gap).max() > FAR * extent > 0.0:
        axes.set_yscale("symlog", linthresh=2.0 * extent / unit.size, linscale=0.6)
        scale = ", log"
    low, high = axes.get_ylim()
    low, high = min(low, -1.2 * extent / unit.size), max(high, 1.2 * extent / unit.size)
    forwards, backwards = ends / unit.size  # an open side extends to the limits
    axes.axhspan(max(low, -backwards), min(high, forwards), color=ZONE, alpha=0.2, linewidth=0)
    place: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points"}
    place |= {"fontsize": SMALL, "color": "#9a6a00"}
    for edge, sign in ((forwards, "±" if forwards == backwards else ""), (-backwards, "−")):
        if np.isfinite(edge):
            axes.axhline(edge, color=ZONE, linewidth=1.2)
            if sign != "−" or forwards != backwards:
                axes.annotate(f"{sign}{abs(edge):.3g}", (1.0, edge), (4, 0), va="center", **place)
    axes.set_ylim(low, high)
    axes.set_ylabel(f"{direction.name}{scale} [{unit.name}]", color=direction.colour)


def conflict_story(
    path: Path, other: Path, zone: Zone, conflicts: Sequence[Conflict], ticks: units.Clock
) -> str:
    """Return the headline: the conflicts, or the closest approach."""
    if not conflicts:
        near = closest_approach(path, other, zone)
        return f"Clear at all times: closest {near.ratio:.2f} × zone at {ticks.text(near.time)}"
    worst = min(conflicts, key=lambda conflict: conflict.ratio)
    intervals = [f"{ticks(c.start):.2f} to {ticks(c.end):.2f}" for c in conflicts]
    short = len(intervals) <= 2
    listed = f"{', '.join(intervals)} {ticks.unit.name}" if short else f"{len(intervals)} times"
    return f"In conflict {listed}; closest {worst.ratio:.2f} × zone at {ticks.text(worst.time)}"
