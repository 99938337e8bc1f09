"""Distribution of a quantity over many cases: histogram and cumulative share."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from closeform.arrays import instance, number, numbers
from closeform.plots.fonts import plain
from closeform.plots.palette import AFTER, INK, OTHER
from closeform.plots.style import DASHED, TEXT, WIDTH, area, dress, headline, right_axis, sheet

BINS = 60  # maximum; few cases have twice the root of their number


def distribution(values: ArrayLike, what: str, tail: float = 0.95) -> Figure:
    """Plot a histogram of values, and the cumulative share of cases up to each value.

    Dashed lines mark the median and the `tail` quantile. Quantiles interpolate linearly between two cases, as
    in NumPy and in the tables of studies.

    Parameters
    ----------
    values : array_like of shape (M,), no unit
        One value per case, in the unit that `what` states; nan if a case has none, counted in the headline.
    what : str
        Name of the quantity with its unit, such as "delta-v [m/s]".
    tail : float, no unit, default 0.95
        Share of cases below the second dashed line, between 0 and 1; use 0.05 if small values are critical.

    Returns
    -------
    Figure
        Matplotlib figure; save it with its `savefig` method.

    Raises
    ------
    ValueError
        If `values` has another shape, is infinite or all nan, `tail` is not between 0 and 1, or an argument
        has the wrong type.

    References
    ----------
    docs/scenario.md.
    """
    given = numbers("values", values)
    instance("what", what, str)
    if not 0.0 < (end := number("tail", tail)) < 1.0:
        raise ValueError(f"tail: a share between 0 and 1, got {end:g}")
    if given.ndim != 1:
        raise ValueError(f"values: expected shape (M,), got {given.shape}")
    found = np.sort(given[~np.isnan(given)])
    if not len(found) or not np.isfinite(found).all():
        raise ValueError("values: expected finite numbers, nan where a case has none; got none, or infinity")
    figure = sheet(5.4)
    axes = area(figure, 0.95, 0.7, WIDTH - 0.95 - 1.0, 4.05)
    dress(axes)
    low, high = float(found[0]), float(found[-1])
    room = 0.02 * (high - low) or 0.01 * max(abs(high), 1.0)
    bins = min(BINS, int(np.ceil(2.0 * np.sqrt(len(found)))))
    counts, edges = np.histogram(found, bins, (low - room, high + room))
    axes.stairs(counts, edges, fill=True, color=OTHER, zorder=3)
    axes.set_xlim(low - room, high + room)
    axes.set_xlabel(what)
    axes.set_ylabel("cases")
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    right = right_axis(axes, AFTER)
    share = 100.0 * np.arange(len(found) + 1) / len(found)
    right.plot([low, *found], share, color=AFTER, linewidth=2.2, drawstyle="steps-post", zorder=4)
    right.set_ylim(0.0, 103.0)
    right.set_ylabel("cumulative share [%]", fontsize=TEXT, color=AFTER)
    middle, most = (float(np.quantile(found, one)) for one in (0.5, end))
    for value in (middle, most):
        axes.axvline(value, color=INK, linewidth=1.0, linestyle=DASHED, zorder=5)
    without = f", {len(given) - len(found)} without" if len(found) < len(given) else ""
    name, _, unit = what.partition(" [")
    marked = f"median {middle:.4g}, {100.0 * end:g} % {most:.4g} {unit.rstrip(']')}"
    said = f"{name} of {len(found)} cases{without}: {marked}"
    plain(headline(figure, f"{said[0].upper()}{said[1:]}".rstrip()))
    return figure
