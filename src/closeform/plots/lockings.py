"""Histogram of lock times in a search."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from closeform.arrays import instance, number, numbers
from closeform.plots.palette import AFTER, ALTERNATIVE, BEFORE, INK, OTHER
from closeform.plots.style import (
    SMALL,
    TEXT,
    WIDTH,
    Unit,
    area,
    dress,
    headline,
    plain_unit,
    right_axis,
    sheet,
)
from closeform.search.histogram import FINER, Binned
from closeform.search.schedule import Search

CURVE = "#7a2a10"
LETTER = 0.095  # inches: width of a character
PHASE_COLOURS = {"IPS": AFTER, "OPS": ALTERNATIVE, "mOPS": ALTERNATIVE, "NFS": "#AA4499"}


def histogram(
    times: ArrayLike, search: Search | None = None, bin: float = 60.0, what: str = "pairs lock"
) -> Figure:
    """Plot how many pairs lock in each bin of a search: S04 figure 7.

    Pairs that lock at once (time 0) are counted in the headline but not in the bars, as in S04. The count has
    a logarithmic axis. The curve is the cumulative share of all pairs, on the right axis. Bands are the
    phases of the search with their counts, up to the phase of the last lock. Dashed lines are the ends of
    turns.

    Parameters
    ----------
    times : array_like of shape (M,) [s]
        Lock times from `lock_times`; nan if there was no lock.
    search : Search, optional
        Search in which the times lie; without it, phases and turns are not shown.
    bin : float [s], default 60
        Width of a bin.
    what : str, default "pairs lock"
        Plural noun and verb of the event, such as "formations gather" for the durations of `gather_cases`.

    Returns
    -------
    Figure
        Matplotlib figure; save it with its `savefig` method.

    Raises
    ------
    ValueError
        If `times` has another shape or lies outside the search, `bin` is not positive and finite, or an
        argument has the wrong type.

    References
    ----------
    S04 (Scharf, Ploen, Hadaegh and Sohl 2004) figure 7.
    """
    instance("search", search, Search, type(None))
    instance("what", what, str)
    given = numbers("times", times)
    if given.ndim != 1:
        raise ValueError(f"times: expected shape (M,), got {given.shape}")
    if not 0.0 < number("bin", bin) < np.inf:
        raise ValueError(f"bin: must be positive and finite, got {bin!r} s")
    found = given[~np.isnan(given)]
    longest = search.duration if search is not None else max(bin, float(found.max(initial=0.0)))
    if found.size and not (found.min() >= 0.0 and found.max() <= longest < np.inf):
        raise ValueError(f"times: must lie in the search, from 0 to {longest:g} s")
    return binned(Binned.of([given], longest, search, bin), search, what)


def binned(times: Binned, search: Search | None = None, what: str = "pairs lock") -> Figure:
    """Plot the histogram of times that are already counted."""
    bin, counts = times.bin, times.counts
    edges = bin * np.arange(len(counts) + 1)
    figure = sheet(5.8)
    axes = area(figure, 0.95, 0.7, WIDTH - 0.95 - 1.0, 4.45)
    dress(axes)
    end = shown(search, times.last) if search is not None else float(edges[-1])
    unit = plain_unit(end)
    top = 6.0 * max(10.0, float(counts.max(initial=0)))
    axes.set_yscale("log")
    axes.set_ylim(0.7, top)
    axes.set_xlim(0.0, end / unit.size)
    if search is not None:
        phases(axes, search, unit, times.inside, end)
    axes.stairs(counts, edges / unit.size, baseline=0.7, fill=True, color=OTHER, zorder=3)
    by_then(axes, times, unit, end)
    axes.set_xlabel(f"time [{unit.name}]")
    axes.set_ylabel(f"{what.partition(' ')[0]} [1 per {bin:g} s]")
    headline(figure, counted(times.every, times.at_once + times.later, times.later, what))
    return figure


def shown(search: Search, last: float) -> float:
    """Return the end [s] of the phase with the last event, up to which the search is shown."""
    return next((end for *_, end in search.phases if end >= last), search.duration)


def phases(axes: Axes, search: Search, unit: Unit, counts: Any, until: float) -> None:
    """Draw bands for the phases with their counts, and the ends of the turns.

    Names are drawn where they fit: in a second row if the first is taken.
    """
    inch = (WIDTH - 0.95 - 1.0) / until  # inches per second
    free = [0.0, 0.0]  # start of the free space in each row [inches]
    for (name, turn, start, end), count in zip(search.phases, counts.tolist(), strict=True):
        colour = PHASE_COLOURS.get(name, OTHER)
        axes.axvspan(start / unit.size, end / unit.size, facecolor=colour, alpha=0.13, linewidth=0.0)
        axes.axvline(end / unit.size, color=OTHER, linewidth=1.2)
        inside = spaced(count)
        middle, half = (start + end) / 2 * inch, LETTER * max(len(f"{name} {turn}"), len(inside)) / 2
        row = next((row for row in (0, 1) if middle - half >= free[row]), None)
        if start >= until or row is None or middle + half > until * inch + 0.1:
            continue
        free[row] = middle + half + 0.1
        place = ((start + end) / 2 / unit.size, 0.985 - 0.115 * row)
        look: dict[str, Any] = {"ha": "center", "va": "top", "fontsize": SMALL, "color": INK}
        axes.annotate(f"{name} {turn}\n{inside}", place, xycoords=("data", "axes fraction"), **look)
    for leg in search.legs:
        axes.axvline(leg.end / unit.size, ymax=0.76, color=BEFORE, linewidth=0.7, linestyle=(0, (3, 3)))


def by_then(axes: Axes, times: Binned, unit: Unit, end: float) -> None:
    """Draw the cumulative share against time, on a right axis."""
    right = right_axis(axes, CURVE)
    ends = np.minimum(times.bin / FINER * np.arange(len(times.finer) + 1), end) / unit.size
    done = times.at_once + np.concatenate([[0], np.cumsum(times.finer)])
    right.plot(ends, 100.0 * done / max(1, times.every), color=CURVE, linewidth=2.2)
    right.set_ylim(0.0, 133.0)
    right.set_yticks(range(0, 101, 20))
    right.set_ylabel("cumulative share [%]", fontsize=TEXT, color=CURVE)
    right.yaxis.set_label_coords(1.0 + 0.62 / (WIDTH - 1.95), 0.38)


def counted(everything: int, found: int, later: int, what: str) -> str:
    """Return the headline: numbers at once, later and never."""
    noun, _, verb = what.partition(" ")
    parts = [f"{spaced(found - later)} of {spaced(everything)} {noun} {verb} at once (not shown)"]
    parts.append(f"{spaced(later)} later")
    if found < everything:
        parts.append(f"{spaced(everything - found)} never")
    return ", ".join(parts)


def spaced(count: int) -> str:
    """Return a count with spaces between thousands."""
    return f"{count:,}".replace(",", " ")
