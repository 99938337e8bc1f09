"""Shares of cases against a value that was swept."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from closeform.arrays import instance, numbers, sequence
from closeform.plots.letters import plain
from closeform.plots.look import INK, SMALL, TEXT, WIDTH, area, dress, headline, sheet
from closeform.plots.tracks import colours

MOST = 12  # lines


def sweep(
    values: ArrayLike,
    share: ArrayLike,
    low: ArrayLike,
    high: ArrayLike,
    what: str,
    names: Sequence[str] = ("",),
) -> Figure:
    """Shares of cases against a swept value, a line for each combination of the other values.

    Bars are the intervals in which the true shares lie 19 times in 20.

    Parameters
    ----------
    values : array_like of shape (P,), no unit
        What was swept, in the unit that `what` says.
    share : array_like of shape (K, P), no unit
        Of the cases at each point, from 0 to 1; the first 12 lines are drawn.
    low, high : array_like of shape (K, P), no unit
        Where their intervals begin and end.
    what : str
        What was swept, with its unit.
    names : sequence of str, default one without a name
        Of the K lines.

    Returns
    -------
    Figure
        Of matplotlib; save it with its `savefig`.

    Raises
    ------
    ValueError
        If shapes do not fit, a number is not finite, or an argument is of another kind.

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
    figure = sheet(5.2)
    axes = area(figure, 0.95, 0.7, WIDTH - 0.95 - 0.4, 3.85)
    dress(axes)
    shown = 100.0 * np.stack([parts["share"], parts["low"], parts["high"]])[:, :MOST]
    for k, tint in enumerate(colours(shown.shape[1])):
        middle, below, above = shown[:, k]
        bars = np.maximum([middle - below, above - middle], 0.0)
        style: dict[str, Any] = {"marker": "o", "markersize": 5, "linewidth": 1.6, "capsize": 3}
        axes.errorbar(where, middle, bars, color=tint, label=called[k], **style)
    axes.set_xlabel(what, fontsize=TEXT, color=INK)
    axes.set_ylabel("cases in which all is met [%]", fontsize=TEXT, color=INK)
    if any(called):
        for words in axes.legend(fontsize=SMALL, frameon=False).get_texts():
            plain(words)
    least, most = 100.0 * float(parts["share"].min()), 100.0 * float(parts["share"].max())
    plain(headline(figure, f"All is met in {least:.4g} to {most:.4g} % of cases"))
    return figure
