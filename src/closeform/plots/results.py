"""Figure of any result, and animation of any result that contains paths."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from os import PathLike, fspath
from typing import IO, Any

from matplotlib.figure import Figure

from closeform.arrays import shown
from closeform.motion.joining import stack
from closeform.motion.path import Path
from closeform.plots.answers import FLYING, PICTURES, Drawer
from closeform.plots.inputs import crafts
from closeform.zones.combined_zones import OwnZone
from closeform.zones.pair_zones import PairZones


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
    result : Path, Plan, Avoidance, Screening, Locks, Gathering, Mission, and so on, or a sequence of Conflict
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
        raise TypeError(f"result: cannot draw {shown(result)}; what is drawn: {which}")
    drawer: Drawer = PICTURES.get(kind, _flight)
    taken = inspect.signature(drawer).parameters
    for name, value in given.items():
        if name not in taken and value is not None:
            raise ValueError(f"{name}: no part of the picture of a {kind}; leave it out")
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
    result : Path, Plan, Avoidance, ThrusterFiring, Gathering, Mission, and so on
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
    from closeform import plots

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
        raise TypeError(f"result: {shown(result)} does not fly; what can be animated: {which}")
    flown = FLYING[kind](result)
    others = crafts("obstacles", obstacles) if obstacles is not None else []
    called = names if names is not None else flown.names
    if called is not None:
        called = [*called, *(f"obstacle {k}" for k in range(len(others)))]
    every = stack([*crafts("result", flown.after), *others])
    plots.formation_animation(every, file, called, zone if zone is not None else flown.zone, frames=frames)


def _flight(result: Any, zone: Any, obstacles: Any, names: Any) -> Figure:
    from closeform import plots

    flown = FLYING[_kind(result)](result)
    called, kept = names if names is not None else flown.names, zone if zone is not None else flown.zone
    return plots.formation_paths(
        flown.before, flown.after, called, kept, () if obstacles is None else obstacles
    )


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
