"""The picture of any answer, and the film of any that flies: which picture shows it."""

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
    """Draw an answer of any kind, in the picture of `closeform.plots` that shows it.

    Whatever flies is drawn with its paths: a `Path`, a plan before and after, a mission, an encounter.

    Parameters
    ----------
    result : Path, Plan, Avoidance, Screening, Locks, Gathering, Mission, and so on, or a sequence of Conflict
        What a function answered.
    zone : Zone, CovarianceZone, Body, None, sequence of these, or PairZones, optional
        Of what flies, as in `formation_paths`; a mission has its own.
    obstacles : Path or sequence of Path, optional
        Drawn beside what flies.
    names : sequence of str, optional
        Of the craft, where the answer has none; their indices unless given.

    Returns
    -------
    Figure
        Matplotlib figure; save it with its `savefig` method.

    Raises
    ------
    TypeError
        If `result` is nothing that can be drawn; the message lists what can be.
    ValueError
        If there is nothing to be seen, as of a plan that was not found, another argument does not belong to
        this picture, or is of another kind.

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
    """Write whatever flies as an animated GIF: `formation_animation`, or of a gathering `animation`.

    Parameters
    ----------
    result : Path, Plan, Avoidance, ThrusterFiring, Gathering, Mission, and so on
        What a function answered.
    file : str, path-like or file of bytes
        Where to, NAME.gif; a file that is there is replaced.
    zone : Zone, CovarianceZone, Body, None, sequence of these, or PairZones, optional
        As in `plot`.
    obstacles : Path or sequence of Path, optional
        As in `plot`.
    names : sequence of str, optional
        As in `plot`.
    frames : int, default 100
        At least 2, spread evenly over the time.

    Raises
    ------
    TypeError
        If `result` is nothing that flies; the message lists what does.
    ValueError
        If `file` is not called NAME.gif, there is nothing to be seen, or an argument has the wrong type.

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
    """Under which name its picture is found: that of its class or of one above it, or of what it holds."""
    if isinstance(result, list | tuple):
        kinds = {_kind(one) for one in result} or {"Conflict"}
        return kinds.pop() if kinds in ({"Conflict"}, {"Path"}) else ""
    ours = [base for base in type(result).__mro__ if base.__module__.startswith("closeform.")]
    names = [base.__name__ for base in ours]
    return next((name for name in names if name in FLYING or name in PICTURES), "")


def _listed(kinds: Mapping[str, Any]) -> str:
    """Names in a message."""
    return ", ".join(sorted(kinds))
