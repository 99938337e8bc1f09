"""A gathering as an animation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from os import PathLike
from typing import IO

import numpy as np

from closeform.arrays import instance
from closeform.plots.formation import ThreeViews
from closeform.plots.inputs import filmed
from closeform.plots.panels import FEW
from closeform.plots.reel import Reel
from closeform.search.gather_result import EventKind, Gathering

WIDE, NARROW = 900, 720  # pixels across, for few and for many craft: many moving lines fill a file
PLAY, HOLD, LAST = 80, 1200, 3000  # ms that a frame stays: in motion, at a lock, at the end
STOPS = 12_000  # ms for the locks together


def animation(
    gathering: Gathering,
    file: str | PathLike[str] | IO[bytes],
    craft: int = 0,
    names: Sequence[str] | None = None,
    *,
    frames: int = 150,
    progress: Callable[[int, int], object] | None = None,
) -> None:
    """Write a gathering in three views as an animated GIF: what H03's simulation showed.

    Parameters
    ----------
    gathering : Gathering
        What is shown.
    file : str, path-like or file of bytes
        Where to; a file that is there is replaced.
    craft : int, default 0
        Which is shown from near by, as in `three_views`.
    names : sequence of str, optional
        Of the craft; their indices unless given.
    frames : int, default 150
        At least 2, spread evenly over the gathering's time, with one more at each lock, where the film stops
        for a moment, as it does at the end.
    progress : callable of int and int, optional
        Called with the frames done and all frames.

    Raises
    ------
    ValueError
        If `frames` is below 2, the craft is not there, names are not as many as the craft, or an argument is
        of another kind.

    References
    ----------
    H03 (Hadaegh, Scharf and Ploen 2003) figures 9 to 11.
    """
    filmed(file, frames, progress)
    found = reel(gathering, craft, names, frames=frames)
    found.save(file, found.frames(slice(None), progress))


def reel(
    gathering: Gathering, craft: int = 0, names: Sequence[str] | None = None, *, frames: int = 150
) -> Reel:
    """The film of `animation`, to be drawn."""
    instance("gathering", gathering, Gathering)
    views = ThreeViews(gathering, craft, names)
    pixels = WIDE if len(gathering.groups) <= FEW else NARROW
    moments = schedule(gathering, frames)
    return Reel(views.figure, lambda: views.artists, views.show, moments, pixels)


def schedule(gathering: Gathering, frames: int) -> list[tuple[float, int]]:
    """Times [s] of the frames, and how long each stays [ms]."""
    locks = np.unique([event.time for event in gathering.events if event.kind == EventKind.LOCK])
    times = np.unique(np.concatenate([np.linspace(0.0, gathering.duration, frames), locks]))
    stop = min(HOLD, STOPS // max(1, len(locks)) // 10 * 10)
    stays = np.where(np.isin(times, locks), max(stop, PLAY), PLAY)
    stays[-1] = LAST
    return list(zip(times.tolist(), stays.tolist(), strict=True))
