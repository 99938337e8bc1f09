"""Default figure of each result type: paths for results that contain them, charts for all others."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from closeform.motion.joining import stack
from closeform.motion.path import Path, ends_of
from closeform.plots.charts import Spans, curves, intervals, spans
from closeform.plots.inputs import crafts

Drawer = Callable[..., Figure]
RATIO = "minimum clearance ratio [× zone]"


@dataclass(frozen=True)
class Flown:
    """Paths `before` and `after` avoidance, with the names and zones that the result contains."""

    before: Path
    after: Path
    names: Sequence[str] | None = None
    zone: Any = None


def _path(path: Any) -> Flown:
    batch = stack(crafts("result", path))
    return Flown(batch, batch)


def _avoidance(result: Any) -> Flown:
    if result.path is None:
        raise ValueError(f"result: a plan without a path, {result.reason}")
    after, orbit = result.path, result.path.orbit
    least = orbit.impulsive if result.cost == "delta-v" else orbit.transfer
    before = least(*ends_of(after), after.end - after.start, after.start)
    return Flown(stack([before]), stack([after]))


def _plan(result: Any) -> Flown:
    if result.paths is None:
        raise ValueError(f"result: a plan without paths, {result.reason}; plot its direct")
    return Flown(result.direct, result.paths)


def _most_clearance(result: Any) -> Flown:
    if result.plan is None:
        raise ValueError(f"result: without a plan, {result.reason}")
    return FLYING[type(result.plan).__name__](result.plan)


def _firing(result: Any) -> Flown:
    before, after = (stack(crafts("result", path)) for path in (result.planned, result.path))
    return Flown(before, after)


def _encounter(result: Any) -> Flown:
    both = stack([result.other, result.path])
    return Flown(both, both, ("primary", "secondary"))


def _conjunction(result: Any) -> Flown:
    met = _encounter(result.encounter())
    return Flown(met.before, met.after, [one.name for one in result.objects])


def _common_frame(result: Any) -> Flown:
    paths = result.paths  # a property that builds new paths at each access
    return Flown(paths, paths, result.names)


def _mission(result: Any) -> Flown:
    paths = result.paths
    return Flown(paths, paths, result.scenario.names, result.scenario.zones)


def _stage(result: Any) -> Flown:
    return Flown(result.before.paths, result.after.paths, result.after.names)


def _formation(result: Any) -> Flown:
    return Flown(result.paths, result.paths, result.names)


def _worst(result: Any) -> Flown:
    """Return the paths of the simulation run with the closest approach."""
    paths = result.path(result.worst)
    return Flown(paths, paths)


FLYING: dict[str, Callable[[Any], Flown]] = {
    "Path": _path,
    "Avoidance": _avoidance,
    "Plan": _plan,
    "MaxClearance": _most_clearance,
    "ThrusterFiring": _firing,
    "Encounter": _encounter,
    "Conjunction": _conjunction,
    "CommonFrame": _common_frame,
    "Mission": _mission,
    "LoadedRun": _mission,
    "StageResult": _stage,
    "LoadedStage": _stage,
    "WatchedFlight": _formation,
    "Simulation": _worst,
}


def _conflicts(result: Any) -> Figure:

    those = result if isinstance(result, list | tuple) else [result]
    start, end, time, ratio = (
        np.array([getattr(one, name) for one in those]) for name in ("start", "end", "time", "ratio")
    )

    def called(k: int) -> str:
        one = those[k]
        return f"{one.first} - {one.second}" if hasattr(one, "first") else ""

    return spans(Spans(start, time, end, ratio, called, RATIO), _met(ratio))


def _screening(result: Any, names: Any = None) -> Figure:

    told = Spans(result.start, result.time, result.end, result.ratio, _pairs(result, names), RATIO)
    return spans(told, _met(result.ratio))


def _drift_screening(result: Any, names: Any = None) -> Figure:

    failed = result.failed_at if result.failed_at.ndim == 1 else result.failed_at.min(axis=1)
    told = Spans(failed, result.time, result.time, result.ratio, _pairs(result, names), RATIO)
    count = len(result)
    said = f"{count} pairs are not passively safe" if count else "All pairs are passively safe"
    return spans(told, f"{said}; lines from lost thrust to the closest")


def _met(ratio: Any) -> str:
    """Return the number of conflicts and the smallest clearance ratio as a headline."""
    if not len(ratio):
        return "No conflict"
    return f"{len(ratio)} conflict{'s' * (len(ratio) != 1)}; deepest {np.min(ratio):.4f} × zone"


def _pairs(result: Any, names: Any) -> Callable[[int], str]:
    """Return a function that labels the pair of a row."""

    def called(k: int) -> str:
        one, other = result.pairs[k].tolist()
        return f"{one} - {other}" if names is None else f"{names[one]} - {names[other]}"

    return called


def _least(start: Any, time: Any, least: Any, what: str, edge: float | None) -> Figure:
    """Plot the minimum of one pair, or of each pair of a batch."""
    shape = np.shape(least)
    begin, when, height = (np.ravel(np.asarray(part, dtype=float)) for part in (start, time, least))

    def called(k: int) -> str:
        return ", ".join(str(int(one)) for one in np.unravel_index(k, shape))

    told = Spans(begin, when, when, height, called, what, edge)
    known = np.flatnonzero(told.known)
    if not len(known):
        return spans(told, "No two spacecraft share a time, or no error brings them together")
    k = known[np.argmin(height[known])]
    of = f" of {height.size}" if height.size > 1 else ""
    return spans(told, f"Least{of}: {height[k]:.4g} at {when[k]:.6g} s")


def _approach(result: Any) -> Figure:
    return _least(result.time, result.time, result.ratio, RATIO, 1.0)


def _drift_approach(result: Any) -> Figure:
    failed = np.asarray(result.failed_at)
    failed = failed.min(axis=-1) if failed.ndim > np.ndim(result.ratio) else failed
    return _least(failed, result.time, result.ratio, RATIO, 1.0)


def _sigma_approach(result: Any) -> Figure:
    return _least(result.time, result.time, result.sigmas, "sigmas that are clear", None)


def _pulses(result: Any) -> Figure:
    from closeform.plots.style import speed

    end = result.start + result.duration
    middle = 0.5 * (result.start + end)
    told = Spans(result.start, middle, end, result.impulse, lambda k: "", "delta-v of a pulse [m/s]", None)
    return spans(told, f"{len(result)} pulses, {speed(float(result.impulse.sum()))} in all")


def _fired(result: Any, names: Any = None) -> Figure:
    from closeform import plots

    if len(result.thrusters) == 1:
        return plots.pulses(result, 0, names[0] if names is not None else None)
    return plots.burns(result, names)


def _probability(result: Any) -> Figure:
    from closeform import plots

    if len(result.rate_times) > 1 and result.mean_entries > 0.0:
        return plots.collision(result)
    said = f"Probability of collision {result.value:.4g}, by {result.method}"
    return intervals(["ever inside"], result.value, result.low, result.high, "probability", said)


def _bound(result: Any) -> Figure:
    from closeform.plots.primers import primer_length
    from closeform.plots.style import speed

    lower, upper = np.ravel(result.lower), np.ravel(result.upper)
    if not result.primer.shape:
        said = f"No plan costs less than {speed(float(lower[0]))}, impulses {speed(float(upper[0]))}"
        return primer_length(result.primer, said)
    names = [", ".join(map(str, index)) for index in np.ndindex(result.primer.shape)]
    said = f"{len(upper)} transfers; the most expensive costs {speed(float(upper.max()))}"
    return intervals(names, upper, lower, upper, "minimum delta-v [m/s]", said)


def _margins(result: Any) -> Figure:

    degrees = np.degrees(result.margins)
    names = [f"leg {k}" for k in range(len(degrees))]
    said = f"Locks in leg {result.leg}" if result.leg >= 0 else "Never locks"
    low, high = np.minimum(degrees, 0.0), np.maximum(degrees, 0.0)
    return intervals(names, degrees, low, high, "misses by, at least [deg]", said)


def _proof(result: Any) -> Figure:

    volume = [result.proven, result.open]
    said = f"Proven but for {result.open:.3g} of the box" if not result.ok else "Every pair of the box locks"
    found = len(result.counterexamples)
    said += f"; {found} counterexample{'s' * (found != 1)}" if found else ""
    return intervals(["proven", "not proven"], volume, [0.0, 0.0], volume, "share of the box", said)


def _sweep(result: Any) -> Figure:
    """Plot the share of cases that meet all requirements at each point of a sweep."""
    names = [", ".join(point.values.values()) for point in result.points]
    counts = [point.met_cases for point in result.points]
    said = f"{len(result)} cases at each of {len(names)} points"
    return _shares(names, counts, len(result), "share of cases in which all is met", said)


def _missions(result: Any) -> Figure:
    from closeform.plots.distributions import distribution

    return distribution(result.column("delta_v_m_s"), "delta-v of all craft [m/s]")


def _longest(result: Any) -> Figure:
    from closeform import plots

    return plots.histogram(np.array([result.time if np.isfinite(result.time) else np.nan]))


def _errors(result: Any) -> Figure:
    inside = [np.count_nonzero(pair.inside) for pair in (*result.zones, *result.bodies)]
    names = [f"{pair.first} - {pair.second}, zone" for pair in result.zones]
    names += [f"{pair.first} - {pair.second}, bodies" for pair in result.bodies]
    said = f"{result.cases} cases: {result.reason or 'no pair comes within its zone'}"
    return _shares(names, inside, result.cases, "share of cases inside", said)


def _loaded_study(result: Any) -> Figure:
    """Plot search times, delta-v of missions, or the share of cases for each outcome of an error study."""
    from closeform import plots

    if "time_s" in result.cases:
        return plots.histogram(result.cases["time_s"].astype(float), what="cases end")
    if "status" in result.cases:
        return plots.distribution(result.cases["delta_v_m_s"], "delta-v of all craft [m/s]")
    met = {name: values for name, values in result.cases.items() if values.dtype.kind == "b"}
    counts = [np.count_nonzero(values) for values in met.values()]
    count = len(result.cases["case"])
    return _shares(
        [name.replace("_", " ") for name in met], counts, count, "share of cases", f"{count} cases of errors"
    )


def _shares(names: list[str], counts: Any, cases: int, what: str, said: str) -> Figure:
    """Plot shares of cases with their 95 % confidence intervals."""
    from closeform.confidence import estimate

    found = [estimate(int(count), cases) for count in counts]
    value, low, high = ([getattr(one, part) for one in found] for part in ("share", "low", "high"))
    return intervals(names, value, low, high, f"{what}, 95 %", said)


def _locks(result: Any) -> Figure:
    from closeform import plots

    return plots.histogram(result.time)


def _gatherings(result: Any) -> Figure:
    from closeform import plots

    times = np.where(result.leg < 0, np.nan, result.duration)
    return plots.histogram(times, result.search, what="formations gather")


def _campaign(what: str) -> Drawer:
    def drawn(result: Any) -> Figure:
        from closeform import plots

        return plots.histogram(result.time, result.search, what=what)

    return drawn


def _gathering(result: Any, names: Any = None) -> Figure:
    from closeform import plots

    return plots.three_views(result, result.duration, names=names)


def _validity(result: Any, names: Any = None) -> Figure:

    off = np.linalg.norm(result.deviations[..., :3], axis=-1)
    said = f"In {result.field} craft end up to {off[:, -1].max():.3g} m off, played as planned"
    return curves(result.times, off, "off the plan [m]", said, names)


def _commanded(result: Any, names: Any = None) -> Figure:
    from closeform.plots.style import speed, thrust_unit

    unit = thrust_unit(float(result.peak_thrust.max()))
    commanded, planned = (np.linalg.norm(u, axis=-1) / unit.size for u in (result.commanded, result.planned))
    spent, asked = (speed(float(one.sum())) for one in (result.delta_v, result.planned_delta_v))
    said = f"{spent} commanded for {asked} planned (dashed), in {result.field}"
    return curves(result.times, commanded, f"thrust [{unit.name}]", said, names, planned)


def _flight(result: Any, zone: Any = None, names: Any = None) -> Figure:
    from closeform import plots

    if zone is None:
        return plots.flight_deviations(result, names=names)
    return plots.flight_ratios(result, zone, names)


def _tube(result: Any) -> Figure:

    parts = {"in all": result.radius, "model": result.model, "thrust": result.thrust}
    worst = {name: float(np.max(part)) for name, part in parts.items()}
    worst |= {"bias": result.bias, f"noise, {result.sigmas:g} sigmas": result.sigmas * result.noise}
    values = list(worst.values())
    said = f"Craft are within {worst['in all']:.3g} m of their paths along any one direction"
    return intervals(list(worst), values, [0.0] * len(values), values, "off the path at most [m]", said)


def _room(result: Any, names: Any = None) -> Figure:

    said = f"Craft stay within {result.greatest.max():.3g} m of this plan, at {result.sigmas:g} sigmas"
    return curves(result.times, result.radius, "off the plan at most [m]", said, names)


def _fitted(result: Any, names: Any = None) -> Figure:
    if result.room is None:
        raise ValueError(f"result: has no paths, {result.reason}; there is nothing to draw")
    return _room(result.room, names)


def _retargeted(result: Any) -> Figure:
    from closeform.plots.style import speed

    spent, asked = (float(np.linalg.norm(one, axis=1).sum()) for one in (result.impulse, result.planned))
    changes = 1e3 * np.linalg.norm(result.impulse - result.planned, axis=1)
    rows = [f"craft {one}, {time:.6g} s" for one, time in zip(result.craft, result.time, strict=True)]
    said = f"{speed(spent)} of impulses for {speed(asked)} planned"
    return intervals(rows, changes, np.zeros(len(changes)), changes, "changed by [mm/s]", said)


def _by(picture: str) -> Drawer:
    """Return a drawer that calls a public plot function with the result only."""

    def drawn(result: Any) -> Figure:
        from closeform import plots

        figure: Figure = getattr(plots, picture)(result)
        return figure

    return drawn


PICTURES: dict[str, Drawer] = {
    "Conflict": _conflicts,
    "Screening": _screening,
    "Approach": _approach,
    "DriftApproach": _drift_approach,
    "DriftScreening": _drift_screening,
    "SigmaApproach": _sigma_approach,
    "Probability": _probability,
    "Bound": _bound,
    "TransferCostTable": _by("trade"),
    "ClearanceCostCurve": _by("clearance"),
    "Pulses": _pulses,
    "ThrusterFiring": _fired,
    "Search": _by("in_plane_search"),
    "Locks": _locks,
    "LockMargins": _margins,
    "LockProof": _proof,
    "LongestLock": _longest,
    "Gathering": _gathering,
    "Gatherings": _gatherings,
    "LockCampaign": _campaign("cases lock"),
    "GatherCampaign": _campaign("formations gather"),
    "ErrorCampaign": _errors,
    "MissionCampaign": _missions,
    "SweepCampaign": _sweep,
    "Validity": _validity,
    "CompensatedThrust": _commanded,
    "Retargeted": _retargeted,
    "TrackingMargins": _room,
    "FittedMargin": _fitted,
    "Tube": _tube,
    "Simulation": _flight,
    "LoadedStudy": _loaded_study,
}
