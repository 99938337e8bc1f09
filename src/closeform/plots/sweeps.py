"""Figure of the share of successful cases against a swept value."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.transforms import ScaledTranslation
from numpy.typing import ArrayLike

from closeform.arrays import instance, numbers, sequence
from closeform.plots.fonts import fonts, inches, plain
from closeform.plots.palette import colours
from closeform.plots.style import SMALL, WIDTH, area, dress, headline, legend, sheet

MOST, LONG = 12, 40  # maximum number of lines, and characters of a name
BESIDE = 0.9  # inches of a legend entry besides its name
ASIDE, SPREAD = 0.06, 0.24  # inches at one value: maximum between bars, and over all bars


def sweep(
    values: ArrayLike,
    share: ArrayLike,
    low: ArrayLike,
    high: ArrayLike,
    what: str,
    names: Sequence[str] = ("",),
) -> Figure:
    """Plot the share of cases against a swept value, with a line for each combination of other values.

    Error bars are 95 % confidence intervals; bars at the same value are drawn slightly apart.

    Parameters
    ----------
    values : array_like of shape (P,), no unit
        Swept values, in the unit that `what` states.
    share : array_like of shape (K, P), no unit
        Share of cases at each point, from 0 to 1; the first 12 lines are drawn.
    low, high : array_like of shape (K, P), no unit
        Ends of the intervals.
    what : str
        Name of the swept quantity with its unit.
    names : sequence of str, default one without a name
        Names of the K lines.

    Returns
    -------
    Figure
        Matplotlib figure; save it with its `savefig` method.

    Raises
    ------
    ValueError
        If shapes are wrong, a number is not finite, or an argument has the wrong type.

    References
    ----------
    docs/scenario.md.
    """
    where, called = numbers("values", values), sequence("names", names, str)
    instance("what", what, str)
    given = {"share": share, "low": low, "high": high}
    parts = {name: numbers(name, one) for name, one in given.items()}
    if where.ndim != 1 or not where.size or not np.isfinite(where).all():
        raise ValueError(f"values: expected finite numbers of shape (P,), got {where.shape}")
    for name, part in parts.items():
        if part.shape != (len(called), len(where)) or not np.isfinite(part).all():
            raise ValueError(f"{name}: expected finite numbers of shape (K, P), K names, got {part.shape}")
    words = [shortened(name, k) for k, name in enumerate(called[:MOST], 1)]
    across = max(1, int(WIDTH / (BESIDE + max(inches(word, SMALL) for word in words))))
    rows = -(-len(words) // across) if any(called) else 0
    figure = sheet(5.2 + 0.3 * rows)
    axes = area(figure, 0.95, 0.7 + 0.3 * rows, WIDTH - 0.95 - 0.4, 3.85)
    dress(axes)
    shown = 100.0 * np.stack([parts["share"], parts["low"], parts["high"]])[:, :MOST]
    lines, step = [], min(ASIDE, SPREAD / shown.shape[1])
    for k, tint in enumerate(colours(shown.shape[1])):
        middle, below, above = shown[:, k]
        bars = np.maximum([middle - below, above - middle], 0.0)
        aside = ScaledTranslation(step * (k - (shown.shape[1] - 1) / 2), 0.0, figure.dpi_scale_trans)
        look: dict[str, Any] = {"color": tint, "marker": "o", "linewidth": 1.6, "capsize": 3}
        lines.append(axes.errorbar(where, middle, bars, transform=axes.transData + aside, **look))
    axes.update_datalim(np.column_stack([np.tile(where, shown.size // len(where)), shown.ravel()]))
    axes.autoscale_view()
    axes.set_xlabel(what)
    axes.set_ylabel("cases that meet all requirements [%]")
    if rows:
        legend(figure, lines, words, ncols=across)
    least, most = 100.0 * float(parts["share"].min()), 100.0 * float(parts["share"].max())
    between = f"{least:.4g} to {most:.4g}" if most > least else f"{most:.4g}"
    plain(headline(figure, f"All requirements are met in {between} % of cases"))
    return figure


def shortened(name: str, number: int) -> str:
    """Return a name, shortened if long; its number if no installed font has its characters."""
    if None in fonts(name):
        return f"#{number}"
    return name if len(name) <= LONG else f"{name[: LONG - 1]}…"
