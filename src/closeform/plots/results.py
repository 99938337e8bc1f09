"""Figure of any result, and animation of any result that contains paths."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike, fspath
from typing import IO, Any

import numpy as np
from matplotlib.figure import Figure

from closeform import plots
from closeform.arrays import shown
from closeform.confidence import estimate
from closeform.motion.joining import stack
from closeform.motion.path import Path
from closeform.plots.drawing.charts import Curve, Panel, Spans, intervals, series, spans
from closeform.plots.drawing.inputs import crafts
from closeform.plots.drawing.palette import colours
from closeform.plots.drawing.style import DASHED
from closeform.plots.drawing.text import obstacle_labels, short_names
from closeform.plots.drawing.units import Clock, plain_unit, plural, speed, thrust_unit
from closeform.zones.combined_zones import OwnZone
from closeform.zones.pair_zones import PairZones

Drawer = Callable[..., Figure]
RATIO = "minimum clearance ratio [× zone]"
FEW = 12  # maximum number of spacecraft in a legend


def plot(
    result: Any,
    zone: OwnZone | Sequence[OwnZone | None] | PairZones | None = None,
    obstacles: Path | Sequence[Path] | None = None,
    names: Sequence[str] | None = None,
) -> Figure:
    """Draw a result with the function of `closeform.plots` that suits its type.

    A result that contains paths is drawn with them: a `Path`, a plan before and after, a mission, an
    encounter.

    Parameters
    ----------
    result : Path, Plan, Screening, Locks, Gathering, Mission, and so on, or a sequence of Conflict
        Result of a function of this package.
    zone : Zone, CovarianceZone, Body, None, sequence of these, or PairZones, optional
        Zones of the paths, as in `formation_paths`; a mission has its own.
    obstacles : Path or sequence of Path, optional
        Obstacles drawn with the paths.
    names : sequence of str, optional
        Names of the spacecraft; default: those of the result, or their indices.

    Returns
    -------
    Figure
        Matplotlib figure; save it with its `savefig` method.

    Raises
    ------
    TypeError
        If `result` cannot be drawn; the message lists the supported types.
    ValueError
        If there is nothing to draw, as for a failed plan, an argument does not apply to this figure, or an
        argument has the wrong type.

    References
    ----------
    docs/pictures.md.
    """
    given = {"zone": zone, "obstacles": obstacles, "names": names}
    kind = _kind(result)
    if kind not in FLYING and kind not in PICTURES:
        which = _listed({**PICTURES, **FLYING})
        raise TypeError(f"result: cannot draw {shown(result)}; give one of: {which}")
    drawer: Drawer = PICTURES.get(kind, _in_space)
    taken = inspect.signature(drawer).parameters
    for name, value in given.items():
        if name not in taken and value is not None:
            raise ValueError(f"{name}: does not apply to the picture of a {kind}; leave it out")
    return drawer(result, **{name: value for name, value in given.items() if name in taken})


def animate(
    result: Any,
    file: str | PathLike[str] | IO[bytes],
    zone: OwnZone | Sequence[OwnZone | None] | PairZones | None = None,
    obstacles: Path | Sequence[Path] | None = None,
    names: Sequence[str] | None = None,
    *,
    frames: int = 100,
) -> None:
    """Write an animated GIF of a result with paths, by `formation_animation`, or `animation` for a gathering.

    Parameters
    ----------
    result : Path, Plan, ThrusterFiring, Gathering, Mission, and so on
        Result of a function of this package.
    file : str, path-like or file of bytes
        Output file NAME.gif; an existing file is overwritten.
    zone : Zone, CovarianceZone, Body, None, sequence of these, or PairZones, optional
        As in `plot`.
    obstacles : Path or sequence of Path, optional
        As in `plot`.
    names : sequence of str, optional
        As in `plot`.
    frames : int, default 100
        Number of frames, at least 2, evenly spaced in time.

    Raises
    ------
    TypeError
        If `result` has no paths; the message lists the supported types.
    ValueError
        If `file` is not named NAME.gif, there is nothing to draw, or an argument has the wrong type.

    References
    ----------
    docs/pictures.md.
    """
    if isinstance(file, str | PathLike) and not fspath(file).lower().endswith(".gif"):
        raise ValueError(f"file: animations are GIF, give NAME.gif, got {fspath(file)}")
    kind = _kind(result)
    if kind == "Gathering":
        if zone is not None or obstacles is not None:
            raise ValueError("zone, obstacles: a gathering has its own; leave them out")
        plots.animation(result, file, names=names, frames=frames)
        return
    if kind not in FLYING:
        which = _listed({**FLYING, "Gathering": None})
        raise TypeError(f"result: {shown(result)} has no paths; give one of: {which}")
    motion = FLYING[kind](result)
    others = crafts("obstacles", obstacles) if obstacles is not None else []
    known = names if names is not None else motion.names
    if known is not None:
        known = [*known, *obstacle_labels(len(others))]
    every = stack([*crafts("result", motion.after), *others])
    plots.formation_animation(every, file, known, zone if zone is not None else motion.zone, frames=frames)


def _in_space(result: Any, zone: Any, obstacles: Any, names: Any) -> Figure:
    motion = FLYING[_kind(result)](result)
    known, kept = names if names is not None else motion.names, zone if zone is not None else motion.zone
    others = () if obstacles is None else obstacles
    return plots.formation_paths(motion.before, motion.after, known, kept, others)


def _kind(result: Any) -> str:
    """Return the type name under which a result is registered: of its class, a base class or its items."""
    if isinstance(result, list | tuple):
        kinds = {_kind(one) for one in result} or {"Conflict"}
        return kinds.pop() if kinds in ({"Conflict"}, {"Path"}) else ""
    ours = [base for base in type(result).__mro__ if base.__module__.startswith("closeform.")]
    names = [base.__name__ for base in ours]
    return next((name for name in names if name in FLYING or name in PICTURES), "")


def _listed(kinds: Mapping[str, Any]) -> str:
    """Return sorted names for a message."""
    return ", ".join(sorted(kinds))


# ----- results with paths


@dataclass(frozen=True)
class Paths:
    """Paths `before` and `after` avoidance, with the names and zones that the result contains."""

    before: Path
    after: Path
    names: Sequence[str] | None = None
    zone: Any = None


def _twice(paths: Path, names: Sequence[str] | None = None, zone: Any = None) -> Paths:
    return Paths(paths, paths, names, zone)


def _plan(result: Any) -> Paths:
    if result.paths is None:
        raise ValueError(f"result: the plan has no paths ({result.reason}); plot result.direct instead")
    return Paths(result.direct, result.paths)


def _max_clearance(result: Any) -> Paths:
    if result.plan is None:
        raise ValueError(f"result: has no plan, {result.reason}")
    return FLYING[type(result.plan).__name__](result.plan)


def _encounter(result: Any, names: Sequence[str] = ("primary", "secondary")) -> Paths:
    return _twice(stack([result.other, result.path]), names)


def _mission(result: Any) -> Paths:
    return _twice(result.paths, result.scenario.names, result.scenario.zones)


def _stage(result: Any) -> Paths:
    return Paths(result.before.paths, result.after.paths, result.after.names)


def _formation(result: Any) -> Paths:
    return _twice(result.paths, result.names)


def _firing(result: Any) -> Paths:
    before, after = (stack(crafts("result", path)) for path in (result.planned, result.path))
    return Paths(before, after)


FLYING: dict[str, Callable[[Any], Paths]] = {
    "Path": lambda result: _twice(stack(crafts("result", result))),
    "Plan": _plan,
    "MaxClearance": _max_clearance,
    "ThrusterFiring": _firing,
    "Encounter": _encounter,
    "Conjunction": lambda one: _encounter(one.encounter(), [craft.name for craft in one.objects]),
    "CommonFrame": _formation,
    "Mission": _mission,
    "LoadedRun": _mission,
    "StageResult": _stage,
    "LoadedStage": _stage,
    "WatchedFlight": _formation,
    "Simulation": lambda result: _twice(result.path(result.worst)),  # the run with the closest approach
}


# ----- results that are drawn as charts


def _conflicts(result: Any) -> Figure:
    some = result if isinstance(result, list | tuple) else [result]
    start, end, time, ratio = (
        np.array([getattr(one, name) for one in some]) for name in ("start", "end", "time", "ratio")
    )
    pairs = [f"{one.first} - {one.second}" if hasattr(one, "first") else "" for one in some]
    return spans(Spans(start, time, end, ratio, pairs.__getitem__, RATIO), _met(ratio))


def _screening(result: Any, names: Any = None) -> Figure:
    rows = Spans(result.start, result.time, result.end, result.ratio, _pairs(result, names), RATIO)
    return spans(rows, _met(result.ratio))


def _drift_screening(result: Any, names: Any = None) -> Figure:
    failed = result.failed_at if result.failed_at.ndim == 1 else result.failed_at.min(axis=1)
    rows = Spans(failed, result.time, result.time, result.ratio, _pairs(result, names), RATIO)
    said = f"{len(result)} pairs are not passively safe" if len(result) else "All pairs are passively safe"
    return spans(rows, f"{said}; lines from loss of thrust to closest approach")


def _met(ratio: Any) -> str:
    """Return the number of conflicts and the smallest clearance ratio as a headline."""
    closest = f"; closest {np.min(ratio):.4f} × zone" if len(ratio) else ""
    return f"{plural(len(ratio), 'conflict')}{closest}" if len(ratio) else "No conflict"


def _pairs(result: Any, names: Any) -> Callable[[int], str]:
    """Return a function that labels the pair of a row."""
    pairs = result.pairs.tolist()
    return lambda k: " - ".join(str(one) if names is None else names[one] for one in pairs[k])


def _least(start: Any, time: Any, least: Any, what: str, edge: float | None) -> Figure:
    """Plot the minimum of one pair, or of each pair of a batch."""
    start = np.asarray(start)
    start = start.min(axis=-1) if start.ndim > np.ndim(least) else start
    begin, when, height = (np.ravel(np.asarray(part, dtype=float)) for part in (start, time, least))
    labels = [", ".join(map(str, index)) for index in np.ndindex(np.shape(least))]
    rows = Spans(begin, when, when, height, labels.__getitem__, what, edge)
    known = np.flatnonzero(np.isfinite(when) & np.isfinite(height))
    if not len(known):
        return spans(rows, "No two spacecraft share a time, or no error causes a conflict")
    k = known[np.argmin(height[known])]
    of = f" of {height.size}" if height.size > 1 else ""
    return spans(rows, f"Minimum{of}: {height[k]:.4g} at {when[k]:.6g} s")


def _pulses(result: Any) -> Figure:
    end = result.start + result.duration
    middle = 0.5 * (result.start + end)
    rows = Spans(result.start, middle, end, result.impulse, lambda k: "", "delta-v of a pulse [m/s]", None)
    return spans(rows, f"{plural(len(result), 'pulse')}, {speed(float(result.impulse.sum()))} in total")


def _fired(result: Any, names: Any = None) -> Figure:
    if len(result.thrusters) == 1:
        return plots.pulses(result, 0, names[0] if names is not None else None)
    return plots.burns(result, names)


def _probability(result: Any) -> Figure:
    if len(result.rate_times) > 1 and result.mean_entries > 0.0:
        return plots.collision(result)
    said = f"Probability of collision {result.value:.4g}, by {result.method}"
    return intervals(["ever inside"], result.value, result.low, result.high, "probability", said)


def _bound(result: Any) -> Figure:
    from closeform.plots.costs import primer_curve

    lower, upper = np.ravel(result.lower), np.ravel(result.upper)
    if not result.primer.shape:
        said = f"Minimum delta-v at least {speed(float(lower[0]))}, with impulses {speed(float(upper[0]))}"
        return primer_curve(result.primer, None, said)
    names = [", ".join(map(str, index)) for index in np.ndindex(result.primer.shape)]
    said = f"{len(upper)} transfers; the most expensive costs {speed(float(upper.max()))}"
    return intervals(names, upper, lower, upper, "minimum delta-v [m/s]", said)


def _margins(result: Any) -> Figure:
    degrees = np.degrees(result.margins)
    names = [f"leg {k}" for k in range(len(degrees))]
    said = f"Locks in leg {result.leg}" if result.leg >= 0 else "Never locks"
    low, high = np.minimum(degrees, 0.0), np.maximum(degrees, 0.0)
    return intervals(names, degrees, low, high, "margin by which a lock is missed [deg]", said)


def _proof(result: Any) -> Figure:
    volume = [result.proven, result.open]
    said = (
        f"Proven except for {result.open:.3g} of the box" if not result.ok else "Every pair of the box locks"
    )
    found = len(result.counterexamples)
    said += f"; {plural(found, 'counterexample')}" if found else ""
    return intervals(["proven", "not proven"], volume, [0.0, 0.0], volume, "share of the box", said)


def _sweep(result: Any) -> Figure:
    names = [", ".join(point.values.values()) for point in result.points]
    counts = [point.met_cases for point in result.points]
    said = f"{len(result)} cases at each of {len(names)} points"
    return _shares(names, counts, len(result), "share of cases that meet all requirements", said)


def _missions(result: Any) -> Figure:
    return plots.distribution(result.column("delta_v_m_s"), "delta-v of all craft [m/s]")


def _errors(result: Any) -> Figure:
    inside = [np.count_nonzero(pair.inside) for pair in (*result.zones, *result.bodies)]
    names = [f"{pair.first} - {pair.second}, zone" for pair in result.zones]
    names += [f"{pair.first} - {pair.second}, bodies" for pair in result.bodies]
    said = f"{result.cases} cases: {result.reason or 'no pair is in conflict'}"
    return _shares(names, inside, result.cases, "share of cases in conflict", said)


def _loaded_study(result: Any) -> Figure:
    """Plot search times, delta-v of missions, or the fraction of cases for each outcome of an error study."""
    if "time_s" in result.cases:
        return plots.histogram(result.cases["time_s"].astype(float), what="cases end")
    if "status" in result.cases:
        return plots.distribution(result.cases["delta_v_m_s"], "delta-v of all craft [m/s]")
    met = {name: values for name, values in result.cases.items() if values.dtype.kind == "b"}
    counts, cases = [np.count_nonzero(values) for values in met.values()], len(result.cases["case"])
    names = [name.replace("_", " ") for name in met]
    return _shares(names, counts, cases, "share of cases", f"{cases} cases of errors")


def _shares(names: list[str], counts: Any, cases: int, what: str, said: str) -> Figure:
    """Plot shares of cases with their 95 % confidence intervals."""
    found = [estimate(int(count), cases) for count in counts]
    value, low, high = ([getattr(one, part) for one in found] for part in ("share", "low", "high"))
    return intervals(names, value, low, high, f"{what}, 95 % interval", said)


def _of_each(result: Any, values: Any, what: str, said: str, names: Any, planned: Any = None) -> Figure:
    """Plot non-negative values (N, T) of N spacecraft against time; `planned` (N, T) is dashed."""
    known, tints, curves = short_names(names, len(values)), colours(len(values)), list[Curve]()
    for k, tint in enumerate(tints):
        name = known[k] if len(values) <= FEW else ""
        curves.append(Curve(result.times, values[k], name, tint, width=1.8))
        if planned is not None:
            curves.append(Curve(result.times, planned[k], "", tint, DASHED, 1.2))
    start, end = float(result.times[0]), float(result.times[-1])
    return series(said, [Panel(what, curves)], Clock(plain_unit(end - start)), start, end)


def _validity(result: Any, names: Any = None) -> Figure:
    off = np.linalg.norm(result.deviations[..., :3], axis=-1)
    said = f"In {result.field}, executed as planned, craft end up to {off[:, -1].max():.3g} m from the plan"
    return _of_each(result, off, "deviation from the plan [m]", said, names)


def _commanded(result: Any, names: Any = None) -> Figure:
    unit = thrust_unit(float(result.peak_thrust.max()))
    commanded, planned = (np.linalg.norm(u, axis=-1) / unit.size for u in (result.commanded, result.planned))
    spent, asked = (speed(float(one.sum())) for one in (result.delta_v, result.planned_delta_v))
    said = f"{spent} commanded for {asked} planned (dashed), in {result.field}"
    return _of_each(result, commanded, f"thrust [{unit.name}]", said, names, planned)


def _simulation(result: Any, zone: Any = None, names: Any = None) -> Figure:
    if zone is None:
        return plots.flight_deviations(result, names=names)
    return plots.flight_ratios(result, zone, names)


def _tube(result: Any) -> Figure:
    parts = {"total": result.radius, "model": result.model, "thrust": result.thrust}
    worst = {name: float(np.max(part)) for name, part in parts.items()}
    worst |= {"bias": result.bias, f"noise, {result.sigmas:g} sigmas": result.sigmas * result.noise}
    values = list(worst.values())
    said = f"Tracking-error tube: within {worst['total']:.3g} m of the plan along any one direction"
    return intervals(list(worst), values, [0.0] * len(values), values, "maximum deviation [m]", said)


def _tracking(result: Any, names: Any = None) -> Figure:
    most = result.greatest.max()
    said = f"Tracking-error tube: within {most:.3g} m of the plan at {result.sigmas:g} sigmas"
    return _of_each(result, result.radius, "maximum deviation [m]", said, names)


def _fitted(result: Any, names: Any = None) -> Figure:
    if result.room is None:
        raise ValueError(f"result: has no paths, {result.reason}; there is nothing to draw")
    return _tracking(result.room, names)


def _retargeted(result: Any) -> Figure:
    spent, asked = (float(np.linalg.norm(one, axis=1).sum()) for one in (result.impulse, result.planned))
    changes = 1e3 * np.linalg.norm(result.impulse - result.planned, axis=1)
    rows = [f"craft {one}, {time:.6g} s" for one, time in zip(result.craft, result.time, strict=True)]
    said = f"{speed(spent)} of impulses for {speed(asked)} planned"
    return intervals(rows, changes, np.zeros(len(changes)), changes, "change of the impulse [mm/s]", said)


PICTURES: dict[str, Drawer] = {
    "Conflict": _conflicts,
    "Screening": _screening,
    "Approach": lambda result: _least(result.time, result.time, result.ratio, RATIO, 1.0),
    "DriftApproach": lambda result: _least(result.failed_at, result.time, result.ratio, RATIO, 1.0),
    "DriftScreening": _drift_screening,
    "SigmaApproach": lambda one: _least(one.time, one.time, one.sigmas, "clearance [sigma]", None),
    "Probability": _probability,
    "Bound": _bound,
    "TransferCostTable": lambda result: plots.trade(result),
    "ClearanceCostCurve": lambda result: plots.clearance(result),
    "Pulses": _pulses,
    "ThrusterFiring": _fired,
    "Search": lambda result: plots.in_plane_search(result),
    "Locks": lambda result: plots.histogram(result.time),
    "LockMargins": _margins,
    "LockProof": _proof,
    "LongestLock": lambda one: plots.histogram([one.time if np.isfinite(one.time) else np.nan]),
    "Gathering": lambda result, names=None: plots.three_views(result, result.duration, names=names),
    "Gatherings": lambda result: plots.histogram(
        np.where(result.leg < 0, np.nan, result.duration), result.search, what="formations gather"
    ),
    "LockCampaign": lambda result: plots.histogram(result.time, result.search, what="cases lock"),
    "GatherCampaign": lambda result: plots.histogram(result.time, result.search, what="formations gather"),
    "ErrorCampaign": _errors,
    "MissionCampaign": _missions,
    "SweepCampaign": _sweep,
    "Validity": _validity,
    "CompensatedThrust": _commanded,
    "Retargeted": _retargeted,
    "TrackingMargins": _tracking,
    "FittedMargin": _fitted,
    "Tube": _tube,
    "Simulation": _simulation,
    "LoadedStudy": _loaded_study,
}
