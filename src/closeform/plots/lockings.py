"""When pairs lock: how many in each minute of a search."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from closeform.arrays import Floats, numbers
from closeform.plots.look import (
    AFTER,
    ALTERNATIVE,
    BEFORE,
    INK,
    OTHER,
    SMALL,
    TEXT,
    Unit,
    dress,
    headline,
    page,
    plain_unit,
)
from closeform.search.schedule import Search

PHASE_COLOURS = {"IPS": AFTER, "OPS": ALTERNATIVE, "mOPS": ALTERNATIVE, "NFS": "#AA4499"}


def histogram(times: ArrayLike, search: Search, bin: float = 60.0, what: str = "pairs lock") -> Figure:
    """How many pairs lock in each `bin` [s] of a search: S04 figure 7.

    `times` (M,) [s] are those of `lock_times`, nan where there was no lock.  Pairs locked at once
    (time 0) are counted in the headline and left out of the bars, as in S04; the count has a
    logarithmic axis.  Bands are the phases of the `search` with their counts, dashed lines the
    ends of its turns.  `what` happened, a plural and its verb, such as "formations gather" for
    the durations of `gather_cases`.

    Raises ValueError for wrong shapes, times outside of the search or a bin that is not positive.
    """
    given = numbers("times", times)
    if given.ndim != 1:
        raise ValueError(f"times: expected shape (M,), got {given.shape}")
    if not (np.isfinite(bin) and bin > 0.0):
        raise ValueError(f"bin: must be positive and finite, got {bin!r} s")
    found = given[~np.isnan(given)]
    if found.size and not (found.min() >= 0.0 and found.max() <= search.duration):
        raise ValueError(f"times: must lie in the search, from 0 to {search.duration:g} s")
    later = found[found > 0.0]
    edges = bin * np.arange(int(np.ceil(search.duration / bin)) + 1)
    counts, _ = np.histogram(later, edges)

    figure = page(5.6)
    axes = figure.add_subplot()
    dress(axes)
    unit = plain_unit(search.duration)
    top = 3.0 * max(10.0, float(counts.max(initial=0)))
    axes.set_yscale("log")
    axes.set_ylim(0.7, top)
    axes.set_xlim(0.0, edges[-1] / unit.size)
    phases(axes, search, unit, later)
    axes.stairs(counts, edges / unit.size, baseline=0.7, fill=True, color=INK, zorder=3)
    axes.set_xlabel(f"time [{unit.name}]", fontsize=TEXT, color=INK)
    axes.set_ylabel(f"{what.partition(' ')[0]} [1 per {bin:g} s]", fontsize=TEXT, color=INK)
    headline(figure, counted(len(given), len(found), len(later), what))
    return figure


def phases(axes: Axes, search: Search, unit: Unit, later: Floats) -> None:
    """Bands of the phases with their names and counts, and the ends of the turns within them."""
    for name, turn, start, end in search.phases:
        colour = PHASE_COLOURS.get(name, OTHER)
        axes.axvspan(start / unit.size, end / unit.size, facecolor=colour, alpha=0.13, linewidth=0.0)
        axes.axvline(end / unit.size, color=OTHER, linewidth=1.2)
        inside = int(np.count_nonzero((later > start) & (later <= end)))
        axes.annotate(
            f"{name} {turn}\n{number(inside)}",
            ((start + end) / 2 / unit.size, 0.985),
            xycoords=("data", "axes fraction"),
            ha="center",
            va="top",
            fontsize=SMALL,
            color=INK,
        )
    for leg in search.legs:
        axes.axvline(leg.end / unit.size, ymax=0.86, color=BEFORE, linewidth=0.7, linestyle=(0, (3, 3)))


def counted(everything: int, found: int, later: int, what: str) -> str:
    """How many there are, at once, later and never, in one line."""
    noun, _, verb = what.partition(" ")
    parts = [f"{number(found - later)} of {number(everything)} {noun} {verb} at once (not shown)"]
    parts.append(f"{number(later)} later")
    if found < everything:
        parts.append(f"{number(everything - found)} never")
    return ", ".join(parts)


def number(count: int) -> str:
    """A count with its thousands set apart."""
    return f"{count:,}".replace(",", " ")
