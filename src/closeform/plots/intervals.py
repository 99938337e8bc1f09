"""Numbers with the intervals in which they lie, one below another."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from closeform.plots.fonts import plain
from closeform.plots.palette import AFTER
from closeform.plots.style import SMALL, area, dress, headline, sheet

MOST = 40  # rows that are shown
WORDS, BESIDE, ROW = 2.6, 0.4, 0.34  # inches for names, right of the axes, and of a row


def intervals(
    names: Sequence[str], values: ArrayLike, low: ArrayLike, high: ArrayLike, what: str, said: str
) -> Figure:
    """A row for each of the first 40 names: a dot at its value, a line from `low` to `high`."""
    value, below, above = (np.ravel(np.asarray(part, dtype=float))[:MOST] for part in (values, low, high))
    rows = np.arange(len(value))[::-1]
    figure = sheet(1.9 + ROW * max(2, len(rows)))
    wide, tall = figure.get_size_inches()
    axes = area(figure, WORDS, 0.7, wide - WORDS - BESIDE, tall - 0.7 - 0.7)
    dress(axes)
    axes.hlines(rows, below, above, color=AFTER, linewidth=5.0, alpha=0.35)
    axes.plot(value, rows, "o", color=AFTER, markersize=7, linestyle="")
    axes.set_yticks(rows, list(names)[: len(rows)], fontsize=SMALL)
    for words in axes.get_yticklabels():
        plain(words)
    axes.set_ylim(-0.6, len(rows) - 0.4)
    axes.set_xlabel(what)
    plain(headline(figure, said))
    return figure
